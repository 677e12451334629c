//! Critical pairs: which rules can disable which.
//!
//! Guarantee: every conflict was tried out: in its graph both rules match, and after the first was
//! applied the second does not match there any more.

mod overlay;
mod touch;

use super::complete::{Draft, Link, Places, Ways};
use super::kinds::Kinds;
use crate::{Binding, Condition, Diagnostic, Effect, Grammar, PatternNode, Problem, Rule};
use dsr::{Graph, Schema, Time, Transaction};
use overlay::{Laid, Overlays, Sides};
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use touch::{Index, Touched};

/// How many ways of laying one rule over another are looked at.
pub const OVERLAY_LIMIT: usize = 2_000;
/// No more conflicts than this are given.
pub const CONFLICT_LIMIT: usize = 1_000;
/// How much is done for all conflicts of a grammar: about as much as looking at so many nodes.
pub const EFFORT_LIMIT: u64 = 100_000_000;
/// Rules with more nodes than this are not compared.
const NODE_LIMIT: usize = 48;
/// How many graphs are tried out for two rules.
const TRIALS: usize = 256;
/// What making a graph and trying two rules in it costs, beside the nodes in it.
const TRIAL: u64 = 3_000;
/// What drawing what a formula asks for costs.
const FORMULA: u64 = 200;
/// More than this for one graph is not tried: quantifiers in it have too many combinations.
const TRIAL_LIMIT: u64 = 100_000;

/// Two rules of which the first can disable the second.
#[derive(Debug, Clone)]
pub struct Conflict {
    /// The rule that is applied.
    pub first: String,
    /// The rule that does not match any more; can be the same one, at another match.
    pub second: String,
    /// Makes the smallest graph where both match, in an empty one.
    pub graph: Transaction,
    /// The first rule's match in that graph.
    pub first_match: Binding,
    /// The second rule's.
    pub second_match: Binding,
    /// All of it in words, at the first rule.
    pub diagnostic: Diagnostic,
}

/// The conflicts of a grammar.
#[derive(Debug, Clone, Default)]
pub struct Conflicts {
    /// In the order of the rules.
    pub found: Vec<Conflict>,
    /// At least how many pairs of rules, of which the first changes something like what the second looks at, were not
    /// looked into, or not to the end: there are more conflicts than [`CONFLICT_LIMIT`], or there was more to try than
    /// [`EFFORT_LIMIT`] allows.
    pub left: usize,
}

/// What may still be done, and where.
struct Effort {
    left: u64,
    /// An empty graph to try rules in: making a new one takes longer than trying them.
    ground: Graph,
}

impl Effort {
    /// Whether there was as much left.
    fn spend(&mut self, amount: u64) -> bool {
        let enough = self.left >= amount;
        self.left = self.left.saturating_sub(amount);
        enough
    }

    /// Makes the graph empty again.
    fn clear(&mut self) {
        let snapshot = self.ground.snapshot();
        let mut all = Transaction::new();
        for node in snapshot.nodes().flatten() {
            all.delete_node(node.id());
        }
        if self
            .ground
            .commit(&all, "analysis", Time::default())
            .is_err()
        {
            self.ground = Graph::in_memory(Schema::open());
        }
    }
}

/// Two rules that are compared, and what is known of them.
struct Pair<'a> {
    grammar: &'a Grammar,
    first: &'a Rule,
    second: &'a Rule,
    /// How deep the quantifiers of either go.
    depth: u32,
}

pub(super) fn conflicts(grammar: &Grammar) -> Conflicts {
    conflicts_within(grammar, EFFORT_LIMIT)
}

fn conflicts_within(grammar: &Grammar, limit: u64) -> Conflicts {
    let mut awake = grammar.clone();
    for rule in &mut awake.rules {
        rule.dormant = false;
        rule.activates.clear();
    }
    let kinds = Kinds::new(&awake, awake.rules.iter().flat_map(types));
    let touched: Vec<Touched> = awake.rules.iter().map(|r| Touched::of(&kinds, r)).collect();
    let index = Index::new(&touched);
    let mut effort = Effort {
        left: limit,
        ground: Graph::in_memory(Schema::open()),
    };
    let (mut found, mut left) = (Vec::new(), 0);
    for (one, first) in awake.rules.iter().enumerate() {
        if found.len() >= CONFLICT_LIMIT || effort.left == 0 {
            left += index.at_least(&touched[one]);
            continue;
        }
        for two in index.of(&touched[one]) {
            let second = &awake.rules[two];
            let changes = &touched[one];
            if !effort.spend(changes.checks(&touched[two]) * kinds.words()) {
                left += 1;
                continue;
            }
            if !changes.may_disable(&kinds, &touched[two]) {
                continue;
            }
            if found.len() >= CONFLICT_LIMIT {
                left += 1;
                continue;
            }
            let pair = Pair {
                grammar: &awake,
                first,
                second,
                depth: changes.depth.max(touched[two].depth),
            };
            match pair.smallest(&kinds, &mut effort) {
                Ok(conflict) => found.extend(conflict),
                Err(Unfinished) => left += 1,
            }
        }
    }
    Conflicts { found, left }
}

/// The types that a rule names.
fn types(rule: &Rule) -> impl Iterator<Item = &str> {
    let nodes = rule
        .bound_nodes()
        .chain(&rule.parameters)
        .chain(&rule.right.nodes);
    let mut names: Vec<&str> = nodes.map(|node| &*node.type_name).collect();
    let mut conditions: Vec<&Condition> = rule.precondition.iter().collect();
    let mut effects: Vec<&Effect> = rule.effect.iter().collect();
    while let Some(effect) = effects.pop() {
        match effect {
            Effect::Create { type_name, .. } | Effect::Retype { type_name, .. } => {
                names.push(type_name);
            }
            Effect::Forall { variables, body } => {
                names.extend(variables.iter().map(|node| &*node.type_name));
                effects.extend(body);
            }
            Effect::When { condition, body } => {
                conditions.push(condition);
                effects.extend(body);
            }
            _ => {}
        }
    }
    while let Some(condition) = conditions.pop() {
        match condition {
            Condition::Not(inner) => conditions.push(inner),
            Condition::And(all) | Condition::Or(all) => conditions.extend(all),
            Condition::Exists { variables, body } | Condition::Forall { variables, body } => {
                names.extend(variables.iter().map(|node| &*node.type_name));
                conditions.push(body);
            }
            Condition::When {
                condition,
                consequence,
            } => conditions.extend([&**condition, &**consequence]),
            Condition::Edge { .. } | Condition::Same(..) | Condition::Compare { .. } => {}
        }
    }
    names.into_iter()
}

/// There was more to try than there was effort left.
struct Unfinished;

/// What makes two drafts the same graph; the smallest come first.
type Shape = (usize, usize, Vec<(String, String)>, BTreeSet<Link>, String);

/// Graphs that are still to be tried, each once for an overlay.
#[derive(Default)]
struct Drafts(BTreeMap<(Shape, Vec<usize>), (Draft, Rc<Laid>)>);

impl Drafts {
    fn add(&mut self, draft: Draft, laid: &Rc<Laid>) {
        let (nodes, links) = (draft.nodes.clone(), draft.links.clone());
        let shape = (nodes.len(), links.len(), nodes, links, draft.words());
        let places = laid.second.values().copied().collect();
        self.0
            .entry((shape, places))
            .or_insert_with(|| (draft, Rc::clone(laid)));
    }

    /// The smallest, if it has at most so many nodes.
    fn next(&mut self, most: usize) -> Option<(Draft, Rc<Laid>)> {
        let first = self.0.first_entry()?;
        (first.key().0.0 <= most).then(|| first.remove())
    }
}

impl Pair<'_> {
    /// The conflict with the fewest nodes, and of these the fewest links.
    fn smallest(&self, kinds: &Kinds, effort: &mut Effort) -> Result<Option<Conflict>, Unfinished> {
        let Some(sides) = Sides::new(kinds, self.first, self.second) else {
            // No node can be of all the types of a variable.
            return Ok(None);
        };
        if sides.nodes() > NODE_LIMIT {
            return Err(Unfinished);
        }
        let mut overlays = Overlays::new(&sides);
        let mut drafts = Drafts::default();
        let mut trials = 0;
        for beside in 0..=sides.second.len() {
            for laid in overlays.with_beside(beside) {
                if !effort.spend(sides.nodes() as u64) {
                    return Err(Unfinished);
                }
                let laid = Rc::new(laid);
                for draft in self.completed(&laid, effort) {
                    drafts.add(draft, &laid);
                }
            }
            // Overlays that are still to come have more nodes than those that are tried now.
            let last = beside == sides.second.len();
            let most = if last {
                usize::MAX
            } else {
                sides.first.len() + beside
            };
            while let Some((draft, laid)) = drafts.next(most) {
                let cost = (draft.nodes.len() as u64).saturating_pow(self.depth);
                trials += 1;
                if trials > TRIALS || cost > TRIAL_LIMIT || !effort.spend(TRIAL + cost) {
                    return Err(Unfinished);
                }
                let trial = self.tried(&draft, &laid, &mut effort.ground);
                effort.clear();
                if let Some(trial) = trial {
                    return Ok(self.conflict(&draft, trial));
                }
            }
        }
        Ok(None)
    }

    fn conflict(&self, draft: &Draft, trial: Trial) -> Option<Conflict> {
        let (first, second) = (self.first, self.second);
        let span = first.name.span();
        let diagnostic = Diagnostic {
            problem: Problem::Conflict {
                first: first.name.to_string(),
                second: second.name.to_string(),
                reason: trial.reason,
                graph: draft.words(),
            },
            span,
            file: self.grammar.files.get(span.file as usize)?.clone(),
            related: (second.name.span().file == span.file && second.name != first.name)
                .then(|| (second.name.span(), "this rule".to_owned())),
        };
        Some(Conflict {
            first: first.name.to_string(),
            second: second.name.to_string(),
            graph: draft.transaction(),
            first_match: trial.first,
            second_match: trial.second,
            diagnostic,
        })
    }

    /// Drafts that meet both preconditions, as far as that can be drawn.
    fn completed(&self, laid: &Laid, effort: &mut Effort) -> Vec<Draft> {
        let ways = Ways::new(&self.grammar.types);
        let mut drafts = vec![laid.draft.clone()];
        for (rule, places) in [(self.first, &laid.first), (self.second, &laid.second)] {
            for condition in rule.precondition.as_slice() {
                drafts = drafts
                    .into_iter()
                    .flat_map(|draft| ways.to(draft, places, condition, true))
                    .collect();
            }
        }
        effort.spend(FORMULA * ways.looked_at() * laid.draft.nodes.len() as u64);
        drafts
    }

    /// Tries both rules in the draft, made in an empty graph; `None` where the first does not disable the second.
    fn tried(&self, draft: &Draft, laid: &Laid, graph: &mut Graph) -> Option<Trial> {
        let grammar = self.grammar;
        graph
            .commit(&draft.transaction(), "analysis", Time::default())
            .ok()?;
        let snapshot = graph.snapshot();
        let bound = |rule: &Rule, places: &Places| -> Option<Binding> {
            let node = |node: &PatternNode| {
                let name = &draft.nodes[*places.get(&*node.variable)?].0;
                let found = snapshot.find_node_by_name(name).ok()??;
                Some((node.variable.clone(), found.id()))
            };
            rule.bound_nodes().map(node).collect()
        };
        let one = bound(self.first, &laid.first)?;
        let two = bound(self.second, &laid.second)?;
        if grammar
            .obstacle(&snapshot, self.second, &two)
            .ok()?
            .is_some()
        {
            return None;
        }
        let operations = grammar.apply(&snapshot, &self.first.name, &one).ok()?;
        let change = Transaction {
            operations,
            ..Transaction::new()
        };
        graph.commit(&change, "analysis", Time::default()).ok()?;
        let obstacle = grammar
            .obstacle(&graph.snapshot(), self.second, &two)
            .ok()??;
        Some(Trial {
            first: one,
            second: two,
            reason: obstacle.to_string(),
        })
    }
}

/// What came of trying a draft out.
struct Trial {
    first: Binding,
    second: Binding,
    reason: String,
}
