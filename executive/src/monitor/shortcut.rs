//! Whether a later step of a plan is possible already. This file guarantees that what is left out is
//! needed neither by the steps after it nor by the goal, as far as links tell: rules that do more
//! than make and remove links are never passed over, nor is anything where they come after.

use super::{Finding, Ground, ground, next};
use crate::mission::record::{Step, StepStatus};
use dsr::{ReadError, Snapshot, Time};
use grammar::{Effect, Goal, Grammar, MatchError, Rule};

/// The last step of `open`, but for the first, from which the rest of the plan leads to the goal.
pub(crate) fn shortcut(
    grammar: &Grammar,
    snapshot: &Snapshot,
    now: Time,
    open: &[Step],
    goal: &Goal,
) -> Result<Option<Finding>, ReadError> {
    // Which nodes the goal means must be plain, and that it holds must hang on links alone.
    let named = |variable: &str| goal.constants.contains_key(variable);
    let nodes = &goal.pattern.nodes;
    if goal.precondition.is_some() || !nodes.iter().all(|node| named(&node.variable)) {
        return Ok(None);
    }
    let plain = |step: &Step| grammar.rule(&step.rule).is_some_and(is_plain);
    if !open.iter().all(plain) {
        return Ok(None);
    }
    for first in (1..open.len()).rev() {
        let step = &open[first];
        if step.status != StepStatus::Pending || !applies(grammar, snapshot, step)? {
            continue;
        }
        let found = next(grammar, snapshot, now, step, &open[first + 1..], goal)?;
        if let Finding::Sound {
            dispatch: Some(binding),
            ahead: None,
        } = found
        {
            return Ok(Some(Finding::Shortcut {
                skipped: first,
                binding,
            }));
        }
    }
    Ok(None)
}

/// Whether a step has all its nodes, and its left-hand side holds.
fn applies(grammar: &Grammar, snapshot: &Snapshot, step: &Step) -> Result<bool, ReadError> {
    let Some(Ground {
        rule,
        binding,
        missing,
    }) = ground(grammar, snapshot, step)?
    else {
        return Ok(false);
    };
    if !missing.is_empty() || binding.len() < rule.bound_nodes().count() {
        return Ok(false);
    }
    match grammar.obstacle(snapshot, rule, &binding) {
        Ok(obstacle) => Ok(obstacle.is_none()),
        Err(MatchError::Read(error)) => Err(error),
        Err(_) => Ok(false),
    }
}

/// Whether a rule makes and removes links, and does nothing else.
fn is_plain(rule: &Rule) -> bool {
    fn links_only(effects: &[Effect]) -> bool {
        effects.iter().all(|effect| match effect {
            Effect::Link { .. } | Effect::Unlink { .. } => true,
            Effect::Forall { body, .. } | Effect::When { body, .. } => links_only(body),
            Effect::Assign { .. }
            | Effect::Create { .. }
            | Effect::Delete { .. }
            | Effect::Retype { .. } => false,
        })
    }
    let kept = |variable: &str, type_name: &str| {
        let kept = rule.right.node(variable);
        kept.is_some_and(|kept| *kept.type_name == *type_name)
    };
    let all_kept = (rule.left.nodes.iter()).all(|node| kept(&node.variable, &node.type_name));
    let bound = |variable: &str| rule.bound_nodes().any(|node| *node.variable == *variable);
    let none_new = (rule.right.nodes.iter()).all(|node| bound(&node.variable));
    rule.activates.is_empty() && all_kept && none_new && links_only(&rule.effect)
}
