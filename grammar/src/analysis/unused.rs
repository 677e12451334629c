//! Variables that do nothing.
//!
//! Guarantee: leaving out a variable that is reported changes nothing but how many nodes there
//! must be.

use super::at;
use crate::parser::Finding;
use crate::{AttributePath, Condition, Effect, Expression, Name, PatternNode, Problem, Rule};
use std::collections::BTreeSet;

#[derive(Default)]
struct Uses(BTreeSet<Name>);

impl Uses {
    fn add(&mut self, name: &Name) {
        self.0.insert(name.clone());
    }

    fn path(&mut self, path: &AttributePath) {
        match path {
            AttributePath::Node { variable, .. } => self.add(variable),
            AttributePath::Edge { from, to, .. } => {
                self.add(from);
                self.add(to);
            }
        }
    }

    fn expression(&mut self, expression: &Expression) {
        match expression {
            Expression::Literal(_) => {}
            Expression::Attribute(path) => self.path(path),
            Expression::Arithmetic { operands, .. } => {
                for operand in operands {
                    self.expression(operand);
                }
            }
        }
    }

    /// Uses in a condition; variables that it quantifies over in vain are reported.
    fn condition(&mut self, condition: &Condition, findings: &mut Vec<Finding>) {
        match condition {
            Condition::Edge { from, to, .. } => {
                self.add(from);
                self.add(to);
            }
            Condition::Same(a, b) => {
                self.add(a);
                self.add(b);
            }
            Condition::Compare { left, right, .. } => {
                self.expression(left);
                self.expression(right);
            }
            Condition::Not(inner) => self.condition(inner, findings),
            Condition::And(all) | Condition::Or(all) => {
                for inner in all {
                    self.condition(inner, findings);
                }
            }
            Condition::Exists { variables, body } | Condition::Forall { variables, body } => {
                let mut inner = Self::default();
                inner.condition(body, findings);
                let asks = !matches!(&**body, Condition::And(all) if all.is_empty());
                self.quantified(variables, inner, asks, findings);
            }
            Condition::When {
                condition,
                consequence,
            } => {
                self.condition(condition, findings);
                self.condition(consequence, findings);
            }
        }
    }

    /// Variables of a quantifier. With nothing in it, it asks only whether there is one.
    fn quantified(
        &mut self,
        variables: &[PatternNode],
        mut inner: Self,
        asks: bool,
        found: &mut Vec<Finding>,
    ) {
        for variable in variables {
            if !inner.0.remove(&variable.variable) && (asks || variables.len() > 1) {
                found.push(at(&variable.variable, unused(variable)));
            }
        }
        self.0.extend(inner.0);
    }

    fn effects(&mut self, effects: &[Effect], findings: &mut Vec<Finding>) {
        for effect in effects {
            match effect {
                Effect::Link { from, to, .. } | Effect::Unlink { from, to, .. } => {
                    self.add(from);
                    self.add(to);
                }
                Effect::Assign { target, value } => {
                    self.path(target);
                    self.expression(value);
                }
                Effect::Create { .. } => {}
                Effect::Delete { variable } | Effect::Retype { variable, .. } => self.add(variable),
                Effect::Forall { variables, body } => {
                    let mut inner = Self::default();
                    inner.effects(body, findings);
                    self.quantified(variables, inner, !body.is_empty(), findings);
                }
                Effect::When { condition, body } => {
                    self.condition(condition, findings);
                    self.effects(body, findings);
                }
            }
        }
    }
}

fn unused(node: &PatternNode) -> Problem {
    Problem::UnusedVariable {
        name: node.variable.to_string(),
        type_name: node.type_name.to_string(),
    }
}

/// Reports what a rule binds or quantifies over and does nothing with.
pub(super) fn variables(rule: &Rule, findings: &mut Vec<Finding>) {
    let mut uses = Uses::default();
    for edge in rule.left.edges.iter().chain(&rule.right.edges) {
        uses.add(&edge.from);
        uses.add(&edge.to);
    }
    uses.expression(&rule.cost);
    rule.duration.iter().for_each(|d| uses.expression(d));
    for condition in rule.precondition.as_slice() {
        uses.condition(condition, findings);
    }
    uses.effects(&rule.effect, findings);
    let (left, right) = (rule.left.index(), rule.right.index());
    for node in rule.bound_nodes() {
        let kept = match right.node(&node.variable) {
            Some(after) => after.type_name == node.type_name,
            None => left.node(&node.variable).is_none(),
        };
        if kept && !uses.0.contains(&node.variable) {
            findings.push(at(&node.variable, unused(node)));
        }
    }
}
