//! Compiled conditions and expressions, at a binding.
//!
//! Guarantee: every formula has a truth value. A term that has no value (an attribute that is not
//! there, a division by zero, an overflow) makes the comparison that it stands in not hold.

use super::environment::{Environment, Interrupt};
use super::host::Host;
use super::program::{Link, Slot, Term, Test};
use crate::Number;
use dsr::{EdgeKey, ReadError, Value};

/// The key of a link whose ends are nodes of the graph and whose label the schema has.
fn key(link: &Link, environment: &[Slot]) -> Option<EdgeKey> {
    match (environment[link.from], link.label, environment[link.to]) {
        (Slot::Node(from), Some(label), Slot::Node(to)) => Some(EdgeKey { from, label, to }),
        _ => None,
    }
}

/// Whether the link is in the graph.
pub(crate) fn is_there<H: Host>(
    host: &H,
    link: &Link,
    environment: &[Slot],
) -> Result<bool, ReadError> {
    match key(link, environment) {
        Some(key) => host.has_edge(key),
        None => Ok(false),
    }
}

impl Test {
    /// Whether it holds. Quantified slots of the environment are overwritten.
    pub(crate) fn holds<H: Host>(
        &self,
        host: &H,
        environment: &mut Environment,
    ) -> Result<bool, Interrupt> {
        match self {
            Self::Link(link) => Ok(is_there(host, link, environment)? != link.negated),
            Self::Same(first, second) => {
                let (first, second) = (environment[*first], environment[*second]);
                Ok(first == second && first != Slot::Unbound)
            }
            Self::Compare(operator, left, right) => {
                let left = left.value(host, environment)?;
                let right = right.value(host, environment)?;
                Ok(matches!((left, right), (Some(l), Some(r)) if operator.holds(&l, &r)))
            }
            Self::Not(inner) => Ok(!inner.holds(host, environment)?),
            Self::All(tests) => {
                for test in tests {
                    if !test.holds(host, environment)? {
                        return Ok(false);
                    }
                }
                Ok(true)
            }
            Self::Any(tests) => {
                for test in tests {
                    if test.holds(host, environment)? {
                        return Ok(true);
                    }
                }
                Ok(false)
            }
            Self::Exists(choices, body) => {
                let mut found = |environment: &mut Environment| {
                    Ok::<_, Interrupt>(body.holds(host, environment)?.then_some(()))
                };
                Ok(choices.each(host, environment, &mut found)?.is_some())
            }
            Self::Forall(choices, body) => {
                let mut refuted = |environment: &mut Environment| {
                    Ok::<_, Interrupt>((!body.holds(host, environment)?).then_some(()))
                };
                Ok(choices.each(host, environment, &mut refuted)?.is_none())
            }
        }
    }
}

impl Term {
    /// Its value, if it has one.
    pub(crate) fn value<H: Host>(
        &self,
        host: &H,
        environment: &[Slot],
    ) -> Result<Option<Value>, ReadError> {
        Ok(match self {
            Self::Constant(value) => Some(value.clone()),
            Self::NodeAttribute { node, attribute } => {
                let (Slot::Node(node), Some(attribute)) = (environment[*node], *attribute) else {
                    return Ok(None);
                };
                match host.find(node)? {
                    Some(node) => host.node_value(node, attribute)?,
                    None => None,
                }
            }
            Self::EdgeAttribute { link, attribute } => {
                let (Some(key), Some(attribute)) = (key(link, environment), *attribute) else {
                    return Ok(None);
                };
                host.edge_value(key, attribute)?
            }
            Self::Arithmetic(operator, operands) => {
                let mut numbers = Vec::with_capacity(operands.len());
                for operand in operands {
                    let value = operand.value(host, environment)?;
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
