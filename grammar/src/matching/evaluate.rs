//! Compiled conditions and expressions, at a binding.
//!
//! Guarantee: every formula has a truth value. A term that has no value (an attribute that is not
//! there, a division by zero, an overflow) makes the comparison that it stands in not hold.

use super::program::{Link, Slot, Term, Test};
use crate::Number;
use dsr::{EdgeKey, NodeId, ReadError, Snapshot, Value};

/// What each slot stands for.
pub(crate) type Environment = Vec<Slot>;

/// The key of a link whose ends are nodes of the graph and whose label the schema has.
fn key(link: &Link, environment: &[Slot]) -> Option<EdgeKey> {
    match (environment[link.from], link.label, environment[link.to]) {
        (Slot::Node(from), Some(label), Slot::Node(to)) => Some(EdgeKey { from, label, to }),
        _ => None,
    }
}

/// Whether the link is in the graph.
pub(crate) fn is_there(
    snapshot: &Snapshot,
    link: &Link,
    environment: &[Slot],
) -> Result<bool, ReadError> {
    match key(link, environment) {
        Some(key) => Ok(snapshot.find_edge(key)?.is_some()),
        None => Ok(false),
    }
}

impl Test {
    /// Whether it holds. Quantified slots of the environment are overwritten.
    pub(crate) fn holds(
        &self,
        snapshot: &Snapshot,
        environment: &mut Environment,
    ) -> Result<bool, ReadError> {
        match self {
            Self::Link(link) => Ok(is_there(snapshot, link, environment)? != link.negated),
            Self::Same(first, second) => {
                let (first, second) = (environment[*first], environment[*second]);
                Ok(first == second && first != Slot::Unbound)
            }
            Self::Compare(operator, left, right) => {
                let left = left.value(snapshot, environment)?;
                let right = right.value(snapshot, environment)?;
                Ok(matches!((left, right), (Some(l), Some(r)) if operator.holds(&l, &r)))
            }
            Self::Not(inner) => Ok(!inner.holds(snapshot, environment)?),
            Self::All(tests) => {
                for test in tests {
                    if !test.holds(snapshot, environment)? {
                        return Ok(false);
                    }
                }
                Ok(true)
            }
            Self::Any(tests) => {
                for test in tests {
                    if test.holds(snapshot, environment)? {
                        return Ok(true);
                    }
                }
                Ok(false)
            }
            Self::Exists(choices, body) => {
                let mut found = |environment: &mut Environment| {
                    Ok::<_, ReadError>(body.holds(snapshot, environment)?.then_some(()))
                };
                Ok(choices.each(snapshot, environment, &mut found)?.is_some())
            }
            Self::Forall(choices, body) => {
                let mut refuted = |environment: &mut Environment| {
                    Ok::<_, ReadError>((!body.holds(snapshot, environment)?).then_some(()))
                };
                Ok(choices.each(snapshot, environment, &mut refuted)?.is_none())
            }
        }
    }
}

impl Term {
    /// Its value, if it has one.
    pub(crate) fn value(
        &self,
        snapshot: &Snapshot,
        environment: &[Slot],
    ) -> Result<Option<Value>, ReadError> {
        Ok(match self {
            Self::Constant(value) => Some(value.clone()),
            Self::NodeAttribute { node, attribute } => {
                let (Slot::Node(node), Some(attribute)) = (environment[*node], *attribute) else {
                    return Ok(None);
                };
                let Some(node) = snapshot.find_node(node)? else {
                    return Ok(None);
                };
                node.attribute(attribute)?.map(|attribute| attribute.value)
            }
            Self::EdgeAttribute { link, attribute } => {
                let (Some(key), Some(attribute)) = (key(link, environment), *attribute) else {
                    return Ok(None);
                };
                let Some(edge) = snapshot.find_edge(key)? else {
                    return Ok(None);
                };
                edge.attribute(attribute)?.map(|attribute| attribute.value)
            }
            Self::Arithmetic(operator, operands) => {
                let mut numbers = Vec::with_capacity(operands.len());
                for operand in operands {
                    let value = operand.value(snapshot, environment)?;
                    let Some(number) = value.as_ref().and_then(Number::of) else {
                        return Ok(None);
                    };
                    numbers.push(number);
                }
                operator.compute(&numbers).and_then(Number::into_value)
            }
        })
    }
}

/// The node in a slot.
pub(crate) fn node(environment: &[Slot], slot: usize) -> Option<NodeId> {
    match environment[slot] {
        Slot::Node(node) => Some(node),
        _ => None,
    }
}
