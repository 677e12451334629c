//! Two rules that are compared.
//!
//! Guarantee: that the first cannot disable the second is only said where each way to lay one over the other was
//! shown to be no such case.

use super::joint::{Disabled, Joint};
use super::overlay::{Laid, Overlays, Sides};
use super::touch::Touched;
use super::{Conflict, Effort, Undecided};
use crate::analysis::complete::{Drawn, Ways};
use crate::analysis::draft::{Draft, Link, Places};
use crate::analysis::kinds::Kinds;
use crate::matching::conjuncts;
use crate::{Binding, Condition, Diagnostic, Grammar, Obstacle, PatternNode, Problem, Rule};
use dsr::{Graph, Operation, Schema, Time, Transaction};
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

/// Rules with more nodes than this, or quantifiers over so many within each other, are not compared.
const NODE_LIMIT: usize = 48;
/// So many graphs to be tried are kept for two rules.
const DRAFT_LIMIT: usize = 4_096;
/// What making a graph and trying two rules in it costs, beside the nodes in it.
const TRIAL: u64 = 3_000;
/// What drawing what a formula asks for costs, or looking at it with others.
const FORMULA: u64 = 200;
/// What looking at a comparison costs where values are chosen.
const COMPARISON: u64 = 100;
/// More than this for one graph is not tried: quantifiers in it have too many combinations.
const TRIAL_LIMIT: u64 = 100_000;

/// Two rules that are compared, and what is known of them.
pub(super) struct Pair<'p, 'a> {
    pub(super) grammar: &'a Grammar,
    pub(super) schema: Option<&'a Schema>,
    pub(super) first: &'a Rule,
    pub(super) second: &'a Rule,
    /// What the first changes.
    pub(super) changes: &'p Touched<'a>,
    /// What the second looks at.
    pub(super) looks: &'p Touched<'a>,
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

impl<'a> Pair<'_, 'a> {
    /// The conflict with the fewest nodes, and of these the fewest links.
    pub(super) fn smallest(
        &self,
        kinds: &Kinds<'a>,
        effort: &mut Effort,
    ) -> Result<Option<Conflict>, Undecided> {
        let both = [self.first, self.second];
        let nodes = both.map(|rule| rule.bound_nodes().count());
        let depth = self.changes.depth.max(self.looks.depth);
        if nodes[0] + nodes[1] > NODE_LIMIT || depth as usize > NODE_LIMIT {
            return Err(Undecided::Size);
        }
        effort.spend(self.changes.checks(self.looks) * kinds.words())?;
        let needs = self.changes.needs(kinds, self.looks);
        let Some(sides) = Sides::new(kinds, both, &needs) else {
            // No node can be of all the types of a variable.
            return Ok(None);
        };
        let mut overlays = Overlays::new(&sides);
        let mut drafts = Drafts::default();
        let mut may = false;
        for beside in 0..=sides.second.len() {
            let before = overlays.steps;
            let choices = overlays.with_beside(beside);
            effort.spend((overlays.steps - before) * needs.len() as u64)?;
            for choice in choices {
                effort.spend(sides.nodes() as u64)?;
                let Some(laid) = overlays.drawn(&choice) else {
                    continue;
                };
                let joint = Joint::new(&self.grammar.types, [self.first, self.second], &laid);
                let disabled = joint.disabled();
                let (impossible, cost) = joint.is_impossible(&disabled, self.schema);
                effort.spend(FORMULA * (disabled.cost + cost))?;
                if impossible {
                    continue;
                }
                may = true;
                let laid = Rc::new(laid);
                for draft in self.completed(&laid, &joint, &disabled, effort)? {
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
                let cost = (draft.nodes.len() as u64).saturating_pow(depth);
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
        if may {
            return Err(Undecided::Conditions);
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

    /// Drafts where both match and the first disables the second, as far as that can be drawn.
    fn completed(
        &self,
        laid: &Laid,
        joint: &Joint,
        disabled: &Disabled,
        effort: &mut Effort,
    ) -> Result<Vec<Draft>, Undecided> {
        let preconditions = joint.preconditions().flat_map(conjuncts);
        let conditions: Vec<&Condition> = preconditions.collect();
        let mut drafts = self.drawn(laid, joint, &conditions, Some(&disabled.when), effort)?;
        if !disabled.is_whole {
            drafts.extend(self.drawn(laid, joint, &conditions, None, effort)?);
        }
        Ok(drafts)
    }

    fn drawn(
        &self,
        laid: &Laid,
        joint: &Joint,
        conditions: &[&Condition],
        disabled: Option<&Condition>,
        effort: &mut Effort,
    ) -> Result<Vec<Draft>, Undecided> {
        let types = &self.grammar.types;
        let ways = Ways::new(types, disabled.is_none());
        let places = &joint.places;
        let may = |draft: &Draft, drawn| {
            let known = |one: &&Condition| ways.known(draft, places, one, drawn);
            !conditions.iter().any(|one| known(one) == Some(false))
        };
        let nodes = laid.draft.nodes.len() as u64;
        let looks = conditions.len() as u64;
        effort.spend(FORMULA * looks * nodes)?;
        if !may(&laid.draft, Drawn::Parts) {
            return Ok(Vec::new());
        }
        let mut drafts = vec![laid.draft.clone()];
        // What is drawn for one may be more than another allows.
        let again = conditions.iter().copied();
        for condition in again.clone().chain(disabled).chain(again) {
            let ways = |draft| ways.to(draft, places, condition, true);
            drafts = drafts.into_iter().flat_map(ways).collect();
        }
        let looks = ways.looked_at() + looks * drafts.len() as u64;
        effort.spend(FORMULA * looks * nodes)?;
        let effects = &joint.first().effect;
        let mut valued = Vec::new();
        for draft in drafts {
            let asking = draft.clone().with_effects(effects, places, types);
            let (mut found, cost) = asking.with_values(self.schema);
            effort.spend(COMPARISON * cost)?;
            if found.is_none() {
                let (without, cost) = draft.with_values(self.schema);
                effort.spend(COMPARISON * cost)?;
                found = without;
            }
            valued.extend(found.filter(|draft| may(draft, Drawn::Whole)));
        }
        Ok(valued)
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
        let after = graph.snapshot();
        grammar.obstacle(&after, self.second, &two).ok()??;
        // In the names of the graph, where a variable of both rules could stand for two nodes.
        let joint = Joint::new(&grammar.types, [self.first, self.second], laid);
        let second = joint.second();
        let named = bound(second, &joint.places)?;
        let obstacle = grammar.obstacle(&after, second, &named).ok()??;
        let made = change
            .operations
            .iter()
            .filter_map(|operation| match operation {
                Operation::CreateNode { name, .. } => Some(name.as_str()),
                _ => None,
            });
        Some(Trial {
            reason: reason(&obstacle, &self.first.name, made),
            first: one,
            second: two,
        })
    }
}

/// What does not hold after the first rule, in words that also tell of nodes which the drawn graph does not have, as
/// that rule makes them.
fn reason<'n>(obstacle: &Obstacle, first: &str, made: impl Iterator<Item = &'n str>) -> String {
    let reason = match obstacle {
        // It has no name any more, and is called as in the drawn graph.
        Obstacle::NoNode { node } => format!("`{first}` deletes {}", node.variable),
        other => other.to_string(),
    };
    let between = |c: char| !(c.is_alphanumeric() || c == '_');
    let made: Vec<&str> = made
        .filter(|name| reason.split(between).any(|word| word == *name))
        .collect();
    if made.is_empty() {
        return reason;
    }
    format!("{reason}, where `{first}` makes {}", made.join(" and "))
}

/// What came of trying a draft out.
struct Trial {
    first: Binding,
    second: Binding,
    reason: String,
}
