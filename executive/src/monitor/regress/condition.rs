//! Which parts of a condition steps cannot change. This file guarantees that a part it keeps is true
//! after the steps exactly if it is true before them.

use super::Touched;
use dsr::NodeId;
use grammar::{AttributePath, Binding, Condition, Expression, Name};

impl Touched<'_> {
    /// The conjuncts that the steps do not change. Variables of `free` may be any node.
    pub(super) fn conjuncts(
        &self,
        condition: Option<&Condition>,
        binding: &Binding,
        free: &[Name],
    ) -> Option<Condition> {
        let all = match condition? {
            Condition::And(all) => all.as_slice(),
            one => std::slice::from_ref(one),
        };
        let settled = |part: &&Condition| !self.unsettles(part, binding, &mut free.to_vec());
        let kept: Vec<Condition> = all.iter().filter(settled).cloned().collect();
        (!kept.is_empty()).then_some(Condition::And(kept))
    }

    /// Whether the steps may change the condition's truth, or it is about nodes not there yet.
    /// Variables in `scope` may be any node.
    fn unsettles(&self, condition: &Condition, binding: &Binding, scope: &mut Vec<Name>) -> bool {
        match condition {
            Condition::Edge { label, from, to } => {
                self.unsettles_edge([from, to], label, binding, scope)
            }
            Condition::Same(one, other) => [one, other]
                .into_iter()
                .any(|variable| end(variable, binding, scope).is_err()),
            Condition::Compare { left, right, .. } => [left, right]
                .into_iter()
                .any(|side| self.unsettles_value(side, binding, scope)),
            Condition::Not(inner) => self.unsettles(inner, binding, scope),
            Condition::And(parts) | Condition::Or(parts) => parts
                .iter()
                .any(|part| self.unsettles(part, binding, scope)),
            Condition::Exists { variables, body } | Condition::Forall { variables, body } => {
                let depth = scope.len();
                scope.extend(variables.iter().map(|node| node.variable.clone()));
                let unsettled = variables.iter().any(|node| self.populates(&node.type_name))
                    || self.unsettles(body, binding, scope);
                scope.truncate(depth);
                unsettled
            }
            Condition::When {
                condition,
                consequence,
            } => {
                self.unsettles(condition, binding, scope)
                    || self.unsettles(consequence, binding, scope)
            }
        }
    }

    fn unsettles_edge(
        &self,
        ends: [&Name; 2],
        label: &Name,
        binding: &Binding,
        scope: &[Name],
    ) -> bool {
        match ends.map(|variable| end(variable, binding, scope)) {
            [Ok(from), Ok(to)] => self.edge(from, label, to),
            _ => true,
        }
    }

    fn unsettles_value(&self, value: &Expression, binding: &Binding, scope: &[Name]) -> bool {
        match value {
            Expression::Literal(_) => false,
            Expression::Attribute(AttributePath::Node {
                variable,
                attribute,
            }) => self.attributes.contains(attribute) || end(variable, binding, scope).is_err(),
            Expression::Attribute(AttributePath::Edge {
                from,
                label,
                to,
                attribute,
            }) => {
                self.attributes.contains(attribute)
                    || self.unsettles_edge([from, to], label, binding, scope)
            }
            Expression::Arithmetic { operands, .. } => operands
                .iter()
                .any(|operand| self.unsettles_value(operand, binding, scope)),
        }
    }
}

/// The node that a variable stands for: `Err` if it is not there, `Ok(None)` if it may be any.
fn end(variable: &Name, binding: &Binding, scope: &[Name]) -> Result<Option<NodeId>, ()> {
    if scope.contains(variable) {
        return Ok(None);
    }
    binding.get(variable).map(Some).ok_or(())
}
