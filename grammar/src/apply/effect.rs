//! Effect blocks.
//!
//! Guarantee: conditions and values are read in the graph before the rule; nodes that the rule
//! creates are seen by links, deletions and assignments only.

use super::ApplyError;
use super::change::Changes;
use crate::matching::{Choices, Compiler, Environment, Slot, Term, Test};
use crate::{AttributePath, Effect, Expression, MatchError, Name};
use dsr::Snapshot;

/// A compiled effect.
#[derive(Debug)]
pub(super) enum Action {
    Link {
        from: usize,
        label: Name,
        to: usize,
    },
    Unlink {
        from: usize,
        label: Name,
        to: usize,
    },
    AssignNode {
        node: usize,
        attribute: Name,
        value: Computed,
    },
    AssignLink {
        from: usize,
        label: Name,
        to: usize,
        attribute: Name,
        value: Computed,
    },
    Create {
        slot: usize,
        type_name: Name,
    },
    Delete {
        node: usize,
    },
    Retype {
        node: usize,
        type_name: Name,
    },
    Forall {
        choices: Choices,
        body: Vec<Action>,
    },
    When {
        condition: Test,
        body: Vec<Action>,
    },
}

/// An expression, compiled and as it was written.
#[derive(Debug)]
pub(super) struct Computed {
    term: Term,
    expression: Expression,
}

impl Compiler<'_> {
    /// Compiles a list of effects; nodes created in it are in scope to its end.
    pub(super) fn effects(&mut self, effects: &[Effect]) -> Result<Vec<Action>, MatchError> {
        let outer = self.scope();
        let actions = effects.iter().map(|effect| self.effect(effect)).collect();
        self.leave(outer);
        actions
    }

    fn effect(&mut self, effect: &Effect) -> Result<Action, MatchError> {
        Ok(match effect {
            Effect::Link { label, from, to } => Action::Link {
                from: self.slot(from)?,
                label: label.clone(),
                to: self.slot(to)?,
            },
            Effect::Unlink { label, from, to } => Action::Unlink {
                from: self.slot(from)?,
                label: label.clone(),
                to: self.slot(to)?,
            },
            Effect::Assign { target, value } => {
                let value = Computed {
                    term: self.term(value)?,
                    expression: value.clone(),
                };
                match target {
                    AttributePath::Node {
                        variable,
                        attribute,
                    } => Action::AssignNode {
                        node: self.slot(variable)?,
                        attribute: attribute.clone(),
                        value,
                    },
                    AttributePath::Edge {
                        from,
                        label,
                        to,
                        attribute,
                    } => Action::AssignLink {
                        from: self.slot(from)?,
                        label: label.clone(),
                        to: self.slot(to)?,
                        attribute: attribute.clone(),
                        value,
                    },
                }
            }
            Effect::Create {
                variable,
                type_name,
            } => Action::Create {
                slot: self.declare(variable),
                type_name: type_name.clone(),
            },
            Effect::Delete { variable } => Action::Delete {
                node: self.slot(variable)?,
            },
            Effect::Retype {
                variable,
                type_name,
            } => Action::Retype {
                node: self.slot(variable)?,
                type_name: type_name.clone(),
            },
            Effect::Forall { variables, body } => {
                let outer = self.scope();
                let mut choices = self.quantify(variables);
                let body = self.effects(body);
                self.leave(outer);
                let body = body?;
                if let [Action::When { condition, .. }] = &body[..] {
                    choices.narrow(condition, true);
                }
                Action::Forall { choices, body }
            }
            Effect::When { condition, body } => Action::When {
                condition: self.test(condition)?,
                body: self.effects(body)?,
            },
        })
    }
}

impl Action {
    pub(super) fn run(
        &self,
        snapshot: &Snapshot,
        environment: &mut Environment,
        changes: &mut Changes<'_>,
    ) -> Result<(), ApplyError> {
        match self {
            Self::Link { from, label, to } => {
                changes.link(environment[*from], label, environment[*to]);
            }
            Self::Unlink { from, label, to } => {
                changes.unlink(environment[*from], label, environment[*to]);
            }
            Self::AssignNode {
                node,
                attribute,
                value,
            } => {
                let value = value.compute(snapshot, environment)?;
                changes.assign_node(environment[*node], attribute, value)?;
            }
            Self::AssignLink {
                from,
                label,
                to,
                attribute,
                value,
            } => {
                let value = value.compute(snapshot, environment)?;
                let link = (environment[*from], label.as_str(), environment[*to]);
                changes.assign_link(link, attribute, value)?;
            }
            Self::Create { slot, type_name } => {
                environment[*slot] = Slot::New(changes.create(type_name));
            }
            Self::Delete { node } => changes.delete(environment[*node]),
            Self::Retype { node, type_name } => {
                changes.retype(environment[*node], type_name)?;
            }
            // Names of created nodes follow the order.
            Self::Forall { choices, body } => {
                let mut run = |environment: &mut Environment| {
                    changes.limit()?;
                    for action in body {
                        action.run(snapshot, environment, changes)?;
                    }
                    Ok::<_, ApplyError>(None::<()>)
                };
                choices.each_in_order(snapshot, environment, &mut run)?;
            }
            Self::When { condition, body } => {
                if condition.holds(snapshot, environment)? {
                    for action in body {
                        action.run(snapshot, environment, changes)?;
                    }
                }
            }
        }
        Ok(())
    }
}

impl Computed {
    fn compute(
        &self,
        snapshot: &Snapshot,
        environment: &Environment,
    ) -> Result<dsr::Value, ApplyError> {
        let value = self.term.value(snapshot, environment)?;
        value.ok_or_else(|| ApplyError::Undefined {
            expression: self.expression.to_string(),
        })
    }
}
