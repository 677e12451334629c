//! Compiled conditions and expressions, at a binding.
//!
//! Guarantee: every formula has a truth value. A term that has no value (an attribute that is not
//! there, a division by zero, an overflow) makes the comparison that it stands in not hold.

use super::program::{Link, Slot, Term, Test};
use crate::{Arithmetic, Comparison};
use dsr::{EdgeKey, NodeId, ReadError, Snapshot, Value};
use std::cmp::Ordering;

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
                Ok(matches!((left, right), (Some(l), Some(r)) if compare(*operator, &l, &r)))
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
                arithmetic(*operator, &numbers).and_then(Number::into_value)
            }
        })
    }
}

/// A number as formulas see it: whole numbers of any width, or reals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Number {
    Whole(i128),
    Real(f64),
}

impl Number {
    /// The value, if it is a number (a bool is none).
    pub(crate) fn of(value: &Value) -> Option<Self> {
        Some(match *value {
            Value::I32(n) => Self::Whole(n.into()),
            Value::U32(n) => Self::Whole(n.into()),
            Value::I64(n) => Self::Whole(n.into()),
            Value::U64(n) => Self::Whole(n.into()),
            Value::F32(n) => Self::Real(n.into()),
            Value::F64(n) => Self::Real(n),
            _ => return None,
        })
    }

    pub(crate) fn real(self) -> f64 {
        match self {
            Self::Whole(n) => n as f64,
            Self::Real(n) => n,
        }
    }

    fn into_value(self) -> Option<Value> {
        match self {
            Self::Whole(n) => i64::try_from(n)
                .map(Value::I64)
                .or_else(|_| u64::try_from(n).map(Value::U64))
                .ok(),
            Self::Real(n) => n.is_finite().then_some(Value::F64(n)),
        }
    }
}

fn arithmetic(operator: Arithmetic, numbers: &[Number]) -> Option<Number> {
    use Number::{Real, Whole};
    let (&first, rest) = numbers.split_first()?;
    if rest.is_empty() {
        return match (operator, first) {
            (Arithmetic::Subtract, Whole(n)) => n.checked_neg().map(Whole),
            (Arithmetic::Subtract, Real(n)) => Some(Real(-n)),
            _ => Some(first),
        };
    }
    rest.iter()
        .try_fold(first, |sum, &next| match (operator, sum, next) {
            (Arithmetic::Add, Whole(a), Whole(b)) => a.checked_add(b).map(Whole),
            (Arithmetic::Subtract, Whole(a), Whole(b)) => a.checked_sub(b).map(Whole),
            (Arithmetic::Multiply, Whole(a), Whole(b)) => a.checked_mul(b).map(Whole),
            (Arithmetic::Add, a, b) => Some(Real(a.real() + b.real())),
            (Arithmetic::Subtract, a, b) => Some(Real(a.real() - b.real())),
            (Arithmetic::Multiply, a, b) => Some(Real(a.real() * b.real())),
            (Arithmetic::Divide, a, b) => (b.real() != 0.0).then(|| Real(a.real() / b.real())),
        })
}

/// Numbers compare as numbers whatever their width; vectors and lists of numbers element by
/// element; all else is equal only to its own kind. Only numbers have an order.
pub(crate) fn compare(operator: Comparison, left: &Value, right: &Value) -> bool {
    let order = match (Number::of(left), Number::of(right)) {
        (Some(Number::Whole(a)), Some(Number::Whole(b))) => Some(a.cmp(&b)),
        (Some(a), Some(b)) => a.real().partial_cmp(&b.real()),
        _ => None,
    };
    let equal = || match (order, row(left), row(right)) {
        (Some(order), _, _) => order == Ordering::Equal,
        (None, Some(a), Some(b)) => a == b,
        _ => left == right,
    };
    match operator {
        Comparison::Equal => equal(),
        Comparison::NotEqual => !equal(),
        Comparison::Less => order == Some(Ordering::Less),
        Comparison::LessOrEqual => matches!(order, Some(Ordering::Less | Ordering::Equal)),
        Comparison::Greater => order == Some(Ordering::Greater),
        Comparison::GreaterOrEqual => matches!(order, Some(Ordering::Greater | Ordering::Equal)),
    }
}

/// A vector or list of reals.
fn row(value: &Value) -> Option<Vec<f64>> {
    match value {
        Value::Vector(row) | Value::F64List(row) => Some(row.clone()),
        Value::F32Vector(row) | Value::F32List(row) => {
            Some(row.iter().map(|&x| f64::from(x)).collect())
        }
        _ => None,
    }
}

/// The node in a slot.
pub(crate) fn node(environment: &[Slot], slot: usize) -> Option<NodeId> {
    match environment[slot] {
        Slot::Node(node) => Some(node),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_compare_across_their_kinds_and_text_has_no_order() {
        let yes = |operator, a: Value, b: Value| assert!(compare(operator, &a, &b), "{a:?} {b:?}");
        let no = |operator, a: Value, b: Value| assert!(!compare(operator, &a, &b), "{a:?} {b:?}");
        yes(Comparison::Equal, Value::I64(2), Value::F64(2.0));
        yes(
            Comparison::Less,
            Value::U64(u64::MAX - 1),
            Value::U64(u64::MAX),
        );
        yes(Comparison::NotEqual, Value::Bool(true), Value::I64(1));
        yes(
            Comparison::Equal,
            Value::Vector(vec![1.0]),
            Value::F32List(vec![1.0]),
        );
        no(Comparison::Less, "a".into(), "b".into());
        no(Comparison::LessOrEqual, f64::NAN.into(), 1.0.into());
    }

    #[test]
    fn whole_numbers_stay_exact_and_nothing_overflows() {
        use Number::{Real, Whole};
        let big = Whole(i128::from(i64::MAX));
        let sum = arithmetic(Arithmetic::Add, &[big, Whole(1)]);
        assert_eq!(sum.and_then(Number::into_value), Some(Value::U64(1 << 63)));
        let huge = arithmetic(Arithmetic::Multiply, &[big, big, big]);
        assert_eq!(huge.and_then(Number::into_value), None);
        assert_eq!(arithmetic(Arithmetic::Divide, &[Whole(1), Whole(0)]), None);
        assert_eq!(
            arithmetic(Arithmetic::Divide, &[Whole(1), Whole(4)]),
            Some(Real(0.25))
        );
        assert_eq!(
            arithmetic(Arithmetic::Subtract, &[Whole(3)]),
            Some(Whole(-3))
        );
        assert_eq!(
            arithmetic(Arithmetic::Subtract, &[Whole(9), Whole(3), Whole(2)]),
            Some(Whole(4))
        );
    }
}
