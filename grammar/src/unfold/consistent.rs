//! Steps that contradict themselves.
//!
//! Guarantee: a step that passes gives no node two types.

use super::compose::{Outcome, impossible};
use crate::{Effect, Expression, Name, Rule};

pub(super) fn contradiction<T>(what: &str, alias: &str) -> Outcome<T> {
    impossible(format!("step `{alias}` sets `{what}` to two values"))
}

/// Refuses a step that gives one node two types.
pub(super) fn consistent(rule: &Rule, alias: &str) -> Outcome<()> {
    let by_sides = rule.right.nodes.iter().filter_map(|node| {
        let bound = rule.bound_nodes().find(|b| b.variable == node.variable)?;
        (bound.type_name != node.type_name).then_some((&node.variable, &node.type_name))
    });
    let by_effects = rule.effect.iter().filter_map(|effect| match effect {
        Effect::Retype {
            variable,
            type_name,
        } => Some((variable, type_name)),
        _ => None,
    });
    let mut types: Vec<(&Name, &Name)> = Vec::new();
    for (variable, type_name) in by_sides.chain(by_effects) {
        if types.iter().any(|(v, t)| *v == variable && *t != type_name) {
            return contradiction(variable, alias);
        }
        types.push((variable, type_name));
    }
    Ok(())
}

/// Whether a value is computed from another.
pub(super) fn contains(whole: &Expression, part: &Expression) -> bool {
    whole == part
        || matches!(whole, Expression::Arithmetic { operands, .. }
            if operands.iter().any(|operand| contains(operand, part)))
}
