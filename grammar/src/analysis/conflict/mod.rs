//! Critical pairs: which rules can disable which.
//!
//! Guarantee: every conflict was tried out: in its graph both rules match, and after the first was
//! applied the second does not match there any more.

mod overlay;
mod touch;

use super::complete::Ways;
use super::contradiction::contradiction;
use super::draft::{Draft, Link, Places};
use super::kinds::{Kinds, types_of};
use crate::matching::conjuncts;
use crate::{Binding, Condition, Diagnostic, Grammar, PatternNode, Problem, Rule};
use dsr::{Graph, Schema, Time, Transaction};
use overlay::{Laid, Overlays, Shared, Sides};
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use touch::{Index, Touched};

/// How many ways of laying one rule over another are looked at.
pub const OVERLAY_LIMIT: usize = 10_000;
/// No more conflicts than this are given, and no more pairs named of which it was not found out.
pub const CONFLICT_LIMIT: usize = 1_000;
/// How much is done for all conflicts of a grammar: about as much as looking at so many nodes.
pub const EFFORT_LIMIT: u64 = 10_000_000_000;
/// Rules with more nodes than this are not compared.
const NODE_LIMIT: usize = 48;
/// Two rules get at least so much of it, as long as there is any: with less, hardly any two are decided.
const SHARE: u64 = 5_000_000;
/// So many pairs of rules are looked into.
const PAIR_LIMIT: usize = 1_000_000;
/// So many graphs to be tried are kept for two rules.
const DRAFT_LIMIT: usize = 4_096;
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

/// Why it was not found out whether one rule can disable another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
#[non_exhaustive]
pub enum Undecided {
    /// There are more ways to lay one over the other, and to meet their conditions, than were tried.
    #[error("there was more to try than the effort allowed")]
    Effort,
    /// They have too many nodes, or quantifiers within each other.
    #[error("the rules are too large to be compared")]
    Size,
    /// There were [`CONFLICT_LIMIT`] conflicts before.
    #[error("as many conflicts as are given had been found")]
    Conflicts,
}

/// The conflicts of a grammar.
#[derive(Debug, Clone, Default)]
pub struct Conflicts {
    /// In the order of the rules.
    pub found: Vec<Conflict>,
    /// Pairs of rules of which it was not found out, and why, in the order of the rules; no more than
    /// [`CONFLICT_LIMIT`].
    pub undecided: Vec<(String, String, Undecided)>,
    /// How many pairs there are of which it was not found out: at least so many where not even that could be
    /// looked at.
    pub left: usize,
}

/// What may still be done for two rules, and where.
struct Effort {
    left: u64,
    /// An empty graph to try rules in: making a new one takes longer than trying them.
    ground: Graph,
}

impl Effort {
    fn spend(&mut self, amount: u64) -> Result<(), Undecided> {
        let enough = self.left >= amount;
        self.left = self.left.saturating_sub(amount);
        if enough {
            Ok(())
        } else {
            Err(Undecided::Effort)
        }
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
    /// Of these sets of nodes one must be shared.
    needs: BTreeSet<Vec<Shared>>,
}

/// The conflicts that are found with so much effort.
pub(super) fn conflicts(grammar: &Grammar, effort: u64) -> Conflicts {
    let mut awake = grammar.clone();
    for rule in &mut awake.rules {
        rule.dormant = false;
        rule.activates.clear();
    }
    let kinds = Kinds::new(&awake, awake.rules.iter().flat_map(types_of));
    let mut effort = Effort {
        left: effort,
        ground: Graph::in_memory(Schema::open()),
    };
    let (pairs, left) = pairs(&awake, &kinds, &mut effort);
    let mut results = Results::of(&pairs, left);
    let mut open: Vec<usize> = (0..pairs.len()).collect();
    let mut given = 0;
    // What pairs leave of their shares is for the others, and then for those that are not decided yet.
    while results.found < CONFLICT_LIMIT && !open.is_empty() {
        let share = effort.left / open.len() as u64;
        if share / 2 < given {
            break;
        }
        given = share.max(1);
        let count = open.len();
        let mut next = Vec::new();
        for (place, pair) in open.into_iter().enumerate() {
            if results.found >= CONFLICT_LIMIT {
                results.all[pair] = Err(Undecided::Conflicts);
                continue;
            }
            let (all, rest) = (effort.left, (count - place) as u64);
            effort.left = (all / rest).max(SHARE).min(all);
            let share = effort.left;
            let result = pairs[pair].smallest(&kinds, &mut effort);
            effort.left += all - share;
            if matches!(result, Err(Undecided::Effort)) {
                next.push(pair);
            }
            results.found += usize::from(matches!(result, Ok(Some(_))));
            results.all[pair] = result;
        }
        open = next;
    }
    if results.found >= CONFLICT_LIMIT {
        for pair in open {
            results.all[pair] = Err(Undecided::Conflicts);
        }
    }
    results.told(&pairs)
}

/// Pairs of rules of which the first changes something like what the second looks at; and how many more there
/// are at least.
fn pairs<'a>(
    grammar: &'a Grammar,
    kinds: &Kinds<'a>,
    effort: &mut Effort,
) -> (Vec<Pair<'a>>, usize) {
    let rules = &grammar.rules;
    let of = |rule: &'a Rule| match contradiction(grammar, rule, None) {
        // What never matches disables nothing, and nothing disables it.
        Some(_) => Touched::default(),
        None => Touched::of(kinds, rule),
    };
    let touched: Vec<Touched> = rules.iter().map(of).collect();
    let index = Index::new(&touched);
    let (mut pairs, mut left) = (Vec::new(), 0);
    for (first, changes) in rules.iter().zip(&touched) {
        if pairs.len() >= PAIR_LIMIT || effort.left == 0 {
            left += index.at_least(changes);
            continue;
        }
        for two in index.of(changes) {
            let looks = &touched[two];
            if effort.spend(changes.checks(looks) * kinds.words()).is_err() {
                left += 1;
                continue;
            }
            let needs = changes.needs(kinds, looks);
            if !needs.is_empty() {
                pairs.push(Pair {
                    grammar,
                    first,
                    second: &rules[two],
                    depth: changes.depth.max(looks.depth),
                    needs,
                });
            }
        }
    }
    (pairs, left)
}

/// What was found out, pair by pair.
struct Results {
    all: Vec<Result<Option<Conflict>, Undecided>>,
    found: usize,
    left: usize,
}

impl Results {
    fn of(pairs: &[Pair], left: usize) -> Self {
        Self {
            all: pairs.iter().map(|_| Err(Undecided::Effort)).collect(),
            found: 0,
            left,
        }
    }

    fn told(self, pairs: &[Pair]) -> Conflicts {
        let mut told = Conflicts {
            left: self.left,
            ..Conflicts::default()
        };
        for (pair, result) in pairs.iter().zip(self.all) {
            match result {
                Ok(conflict) => told.found.extend(conflict),
                Err(why) => {
                    told.left += 1;
                    if told.undecided.len() < CONFLICT_LIMIT {
                        let names = [pair.first, pair.second].map(|rule| rule.name.to_string());
                        let [first, second] = names;
                        told.undecided.push((first, second, why));
                    }
                }
            }
        }
        told
    }
}

/// What must hold beside a rule's left side.
fn conditions(rule: &Rule) -> impl Iterator<Item = &Condition> {
    rule.precondition.as_slice().iter().flat_map(conjuncts)
}

/// What makes two drafts the same graph; the smallest come first.
type Shape = (
    usize,
    usize,
    Rc<Vec<(Rc<str>, Rc<str>)>>,
    Rc<BTreeSet<Link>>,
    String,
);

/// Graphs that are still to be tried, each once for an overlay.
#[derive(Default)]
struct Drafts {
    waiting: BTreeMap<(Shape, Vec<usize>), (Draft, Rc<Laid>)>,
    /// There were more than are kept.
    are_cut: bool,
}

impl Drafts {
    fn add(&mut self, draft: Draft, laid: &Rc<Laid>) {
        let (nodes, links) = (draft.nodes.clone(), draft.links.clone());
        let shape = (nodes.len(), links.len(), nodes, links, draft.value_words());
        let places = laid.second.nodes().collect();
        self.waiting
            .entry((shape, places))
            .or_insert_with(|| (draft, Rc::clone(laid)));
        if self.waiting.len() > DRAFT_LIMIT {
            self.waiting.pop_last();
            self.are_cut = true;
        }
    }

    /// The smallest, if it has at most so many nodes.
    fn next(&mut self, most: usize) -> Option<(Draft, Rc<Laid>)> {
        let first = self.waiting.first_entry()?;
        (first.key().0.0 <= most).then(|| first.remove())
    }
}

impl Pair<'_> {
    /// The conflict with the fewest nodes, and of these the fewest links.
    fn smallest(&self, kinds: &Kinds, effort: &mut Effort) -> Result<Option<Conflict>, Undecided> {
        let Some(sides) = Sides::new(kinds, [self.first, self.second], &self.needs) else {
            // No node can be of all the types of a variable.
            return Ok(None);
        };
        if sides.nodes() > NODE_LIMIT {
            return Err(Undecided::Size);
        }
        let mut overlays = Overlays::new(&sides);
        let mut drafts = Drafts::default();
        for beside in 0..=sides.second.len() {
            let before = overlays.steps;
            let choices = overlays.with_beside(beside);
            effort.spend((overlays.steps - before) * self.needs.len() as u64)?;
            for choice in choices {
                effort.spend(sides.nodes() as u64)?;
                let Some(laid) = overlays.drawn(&choice) else {
                    continue;
                };
                let laid = Rc::new(laid);
                for draft in self.completed(&laid, effort)? {
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
                if cost > TRIAL_LIMIT {
                    return Err(Undecided::Size);
                }
                effort.spend(TRIAL + cost)?;
                let trial = self.tried(&draft, &laid, &mut effort.ground);
                effort.clear();
                if let Some(trial) = trial {
                    return Ok(self.conflict(&draft, trial));
                }
            }
        }
        if overlays.are_cut() || drafts.are_cut {
            return Err(Undecided::Size);
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
    fn completed(&self, laid: &Laid, effort: &mut Effort) -> Result<Vec<Draft>, Undecided> {
        let ways = Ways::new(&self.grammar.types);
        let sides = [(self.first, &laid.first), (self.second, &laid.second)];
        let conditions = || {
            let of = |(rule, places)| conditions(rule).map(move |one| (one, places));
            sides.into_iter().flat_map(of)
        };
        let may = |draft: &Draft, whole| {
            let known = |(one, places)| ways.known(draft, places, one, whole);
            !conditions().any(|condition| known(condition) == Some(false))
        };
        let looks = conditions().count() as u64;
        effort.spend(FORMULA * looks * laid.draft.nodes.len() as u64)?;
        if !may(&laid.draft, false) {
            return Ok(Vec::new());
        }
        let mut drafts = vec![laid.draft.clone()];
        for (condition, places) in conditions() {
            let ways = |draft| ways.to(draft, places, condition, true);
            drafts = drafts.into_iter().flat_map(ways).collect();
        }
        let looks = ways.looked_at() + looks * drafts.len() as u64;
        effort.spend(FORMULA * looks * laid.draft.nodes.len() as u64)?;
        let effects = &self.first.effect;
        let drafts = drafts.into_iter().filter(|draft| may(draft, true));
        let drafts = drafts.map(|draft| draft.with_numbers_for(effects, &laid.first));
        Ok(drafts.collect())
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
                let name = &draft.nodes[places.get(&node.variable)?].0;
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
