//! Whether the world goes along with a plan: the effect and the left-hand side of the step in
//! hand, and what must hold already now for those after it. This file only judges; what is done
//! about it is the mission's.

mod interest;
mod regress;
mod shortcut;

pub(crate) use interest::Interest;
pub(crate) use shortcut::shortcut;

use crate::mission::record::{Step, StepStatus};
use dsr::{ReadError, Snapshot, Time};
use grammar::{
    Binding, Effect, Goal, GoalConstants, Grammar, MatchError, PatternEdge, Rule, ValueError,
};
use regress::Touched;
use std::collections::BTreeMap;

/// A step is given this many times the duration that its rule expects ...
const DURATIONS: f64 = 4.0;
/// ... but at least so long, seconds, ...
const LEAST: f64 = 10.0;
/// ... and so long where the rule expects none.
const USUAL: f64 = 120.0;

/// What the monitor found of the open steps of a plan.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Report {
    /// So many of them, from the first, are over, for their effects hold.
    pub(crate) over: usize,
    /// How the next one stands.
    pub(crate) next: Finding,
}

impl Report {
    /// What is in the way of the plan.
    pub(crate) fn trouble(&self) -> Option<&str> {
        match &self.next {
            Finding::Broken(why)
            | Finding::Sound {
                ahead: Some(why), ..
            } => Some(why),
            _ => None,
        }
    }
}

/// How the first step that is not over stands.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Finding {
    /// There is none.
    Finished,
    /// It is well.
    Sound {
        /// It can be dispatched, with this binding; it is under way where there is none.
        dispatch: Option<BTreeMap<String, String>>,
        /// Why the steps after it will not be possible.
        ahead: Option<String>,
    },
    /// It and others are needed no more: the one after the first `skipped` can be dispatched.
    Shortcut {
        /// So many steps are left out.
        skipped: usize,
        /// Of the step after them.
        binding: BTreeMap<String, String>,
    },
    /// It is not possible any more.
    Broken(String),
    /// It has been in its agent's hands for longer than this, seconds.
    TimedOut(f64),
}

/// A step's rule and the nodes that it is bound to.
pub(crate) struct Ground<'a> {
    pub(crate) rule: &'a Rule,
    pub(crate) binding: Binding,
    pub(crate) missing: Vec<&'a str>,
}

/// What there is to say of a match: an error in it other than of reading is an obstacle itself.
fn words<T: ToString>(found: Result<Option<T>, MatchError>) -> Result<Option<String>, ReadError> {
    match found {
        Ok(obstacle) => Ok(obstacle.map(|obstacle| obstacle.to_string())),
        Err(MatchError::Read(error)) => Err(error),
        Err(other) => Ok(Some(other.to_string())),
    }
}

/// Judges plans by a grammar.
#[derive(Debug, Clone)]
pub(crate) struct Monitor {
    /// Of each rule whose effect can be seen in the graph: the rule, its right side completed by
    /// the links that its effects make and remove in any case.
    observable: BTreeMap<String, Rule>,
}

impl Monitor {
    pub(crate) fn new(grammar: &Grammar) -> Self {
        let observable = grammar.rules.iter().filter_map(observable);
        Self {
            observable: observable
                .map(|rule| (rule.name.to_string(), rule))
                .collect(),
        }
    }

    /// Judges the open steps of a plan, in their order.
    pub(crate) fn judge(
        &self,
        grammar: &Grammar,
        snapshot: &Snapshot,
        now: Time,
        open: &[Step],
        goal: &Goal,
    ) -> Result<Report, ReadError> {
        let mut over = 0;
        for step in open {
            let Some(ground) = ground(grammar, snapshot, step)? else {
                break;
            };
            if !self.effect_holds(grammar, snapshot, &ground)? {
                break;
            }
            over += 1;
        }
        let next = match open.split_at(over).1.split_first() {
            None => Finding::Finished,
            Some((step, later)) => next(grammar, snapshot, now, step, later, goal)?,
        };
        Ok(Report { over, next })
    }

    fn effect_holds(
        &self,
        grammar: &Grammar,
        snapshot: &Snapshot,
        ground: &Ground,
    ) -> Result<bool, ReadError> {
        let Some(rule) = self.observable.get(&*ground.rule.name) else {
            return Ok(false);
        };
        let gone = |variable: &&str| rule.right.node(variable).is_none();
        let complete = rule.bound_nodes().count() == ground.binding.len() + ground.missing.len();
        if !complete || !ground.missing.iter().all(gone) {
            return Ok(false);
        }
        let obstacle = words(grammar.outcome_obstacle(snapshot, rule, &ground.binding))?;
        Ok(obstacle.is_none())
    }
}

/// How `step` stands, the first that is not over, with those `later` than it.
fn next(
    grammar: &Grammar,
    snapshot: &Snapshot,
    now: Time,
    step: &Step,
    later: &[Step],
    goal: &Goal,
) -> Result<Finding, ReadError> {
    let Some(mut ground) = ground(grammar, snapshot, step)? else {
        return Ok(Finding::Broken(format!(
            "the grammar has no rule `{}`",
            step.rule
        )));
    };
    let pending = step.status == StepStatus::Pending;
    let verb = if pending {
        "does not hold"
    } else {
        "no longer holds"
    };
    let broken =
        |what: &str| Finding::Broken(format!("left-hand side of `{}` {verb}: {what}", step.rule));
    if let Some(variable) = ground.missing.first() {
        let name = step.binding.get(*variable).map_or("", String::as_str);
        return Ok(broken(&format!("{variable} ({name}) is not in the graph")));
    }
    if pending && ground.binding.len() < ground.rule.bound_nodes().count() {
        // Nodes that an earlier step made are chosen when it has made them.
        let matches = grammar.matches(snapshot, ground.rule, &ground.binding);
        let first = matches.and_then(|mut matches| matches.next().transpose());
        match first {
            Ok(Some(binding)) => ground.binding = binding,
            Ok(None) => return Ok(broken("nothing in the graph matches it")),
            Err(MatchError::Read(error)) => return Err(error),
            Err(other) => return Ok(broken(&other.to_string())),
        }
    }
    if let Some(what) = words(grammar.obstacle(snapshot, ground.rule, &ground.binding))? {
        return Ok(broken(&what));
    }
    if !pending {
        let limit = limit(grammar, snapshot, &ground)?;
        if now.since(step.since) > limit {
            return Ok(Finding::TimedOut(limit));
        }
    }
    let ahead = ahead(grammar, snapshot, &ground, later, goal)?;
    let dispatch = if pending {
        Some(names(snapshot, &ground.binding)?)
    } else {
        None
    };
    Ok(Finding::Sound { dispatch, ahead })
}

/// How long a step may be in its agent's hands, seconds.
fn limit(grammar: &Grammar, snapshot: &Snapshot, ground: &Ground) -> Result<f64, ReadError> {
    match grammar.duration(snapshot, ground.rule, &ground.binding) {
        Ok(Some(duration)) => Ok((DURATIONS * duration).max(LEAST)),
        Err(ValueError::Match(MatchError::Read(error))) => Err(error),
        Ok(None) | Err(_) => Ok(USUAL),
    }
}

/// Why what comes after the step in hand will not be possible; `None` if nothing is seen to be in
/// the way.
fn ahead(
    grammar: &Grammar,
    snapshot: &Snapshot,
    hand: &Ground,
    later: &[Step],
    goal: &Goal,
) -> Result<Option<String>, ReadError> {
    let mut touched = Touched::new(&grammar.types, snapshot);
    touched.add(hand.rule, &hand.binding);
    for step in later {
        let Some(ground) = ground(grammar, snapshot, step)? else {
            return Ok(Some(format!("the grammar has no rule `{}`", step.rule)));
        };
        if let Some(variable) = ground.missing.first() {
            let name = step.binding.get(*variable).map_or("", String::as_str);
            let rule = &step.rule;
            return Ok(Some(format!(
                "`{rule}` needs {variable} ({name}), which is not in the graph"
            )));
        }
        let (rule, binding) = touched.needed_by(ground.rule, &ground.binding);
        if let Some(what) = words(grammar.obstacle(snapshot, &rule, &binding))? {
            return Ok(Some(format!(
                "`{}` will not be possible: {what}",
                step.rule
            )));
        }
        touched.add(ground.rule, &ground.binding);
    }
    let constants = match goal.find_constants(snapshot)? {
        GoalConstants::Found(constants) => constants,
        GoalConstants::Missing(obstacle) => return Ok(Some(obstacle.to_string())),
    };
    let rest = touched.needed_for(goal, &constants)?;
    let obstacle = words(grammar.goal_obstacle(snapshot, &rest))?;
    Ok(obstacle.map(|what| format!("the plan will not reach the goal: {what}")))
}

/// `None` where the grammar has no such rule.
pub(crate) fn ground<'a>(
    grammar: &'a Grammar,
    snapshot: &Snapshot,
    step: &'a Step,
) -> Result<Option<Ground<'a>>, ReadError> {
    let Some(rule) = grammar.rule(&step.rule) else {
        return Ok(None);
    };
    let (binding, missing) = step.nodes(snapshot)?;
    Ok(Some(Ground {
        rule,
        binding,
        missing,
    }))
}

/// A binding by the nodes' names.
pub(crate) fn names(
    snapshot: &Snapshot,
    binding: &Binding,
) -> Result<BTreeMap<String, String>, ReadError> {
    let mut names = BTreeMap::new();
    for (variable, id) in binding.iter() {
        if let Some(node) = snapshot.find_node(id)? {
            names.insert(variable.to_string(), node.name()?);
        }
    }
    Ok(names)
}

/// The rule by which to see that another's effect holds; `None` if that cannot be seen: it changes
/// no more than attributes, or it makes nodes, which others that fit would be taken for.
fn observable(rule: &Rule) -> Option<Rule> {
    let bound = |variable: &str| rule.bound_nodes().any(|node| node.variable == *variable);
    if !rule.right.nodes.iter().all(|node| bound(&node.variable)) {
        return None;
    }
    let mut seen = rule.clone();
    for effect in &rule.effect {
        let (label, from, to, negated) = match effect {
            Effect::Link { label, from, to } => (label, from, to, false),
            Effect::Unlink { label, from, to } => (label, from, to, true),
            _ => continue,
        };
        let kept = |variable: &str| seen.right.node(variable).is_some();
        if kept(from) && kept(to) && seen.right.edge(from, label, to).is_none() {
            let (from, label, to) = (from.clone(), label.clone(), to.clone());
            seen.right.edges.push(PatternEdge {
                from,
                label,
                to,
                negated,
            });
        }
    }
    let same_nodes = seen.left.nodes.iter().all(|node| {
        let kept = seen.right.node(&node.variable);
        kept.is_some_and(|kept| kept.type_name == node.type_name)
    });
    let stays = |edge: &PatternEdge, other: &[PatternEdge]| edge.negated || other.contains(edge);
    let same_edges = seen
        .left
        .edges
        .iter()
        .all(|edge| stays(edge, &seen.right.edges))
        && seen
            .right
            .edges
            .iter()
            .all(|edge| seen.left.edges.contains(edge));
    (!same_nodes || !same_edges).then_some(seen)
}

#[cfg(test)]
mod tests;
