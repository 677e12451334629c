//! Arithmetic and comparisons on values, as conditions, costs and effects mean them.
//!
//! Guarantee: whole numbers stay exact whatever their width, and nothing overflows: what has no
//! result is `None`, and a comparison that makes no sense does not hold.

use crate::{Arithmetic, AttributePath, Comparison, Expression};
use dsr::Value;
use std::cmp::Ordering;

/// A number as formulas see it: whole numbers of any width, or reals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// From any of the integer kinds.
    Whole(i128),
    /// From either width of floating point.
    Real(f64),
}

impl Number {
    /// The value, if it is a number (a bool is none).
    pub fn of(value: &Value) -> Option<Self> {
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

    /// The nearest real number.
    pub fn real(self) -> f64 {
        match self {
            Self::Whole(n) => n as f64,
            Self::Real(n) => n,
        }
    }

    /// As an attribute's value: `i64` where it fits, else `u64`; a real must be finite.
    pub fn into_value(self) -> Option<Value> {
        match self {
            Self::Whole(n) => i64::try_from(n)
                .map(Value::I64)
                .or_else(|_| u64::try_from(n).map(Value::U64))
                .ok(),
            Self::Real(n) => n.is_finite().then_some(Value::F64(n)),
        }
    }
}

impl Arithmetic {
    /// The operation on one operand after another; `None` where it has no result (no operand, a
    /// division by zero, an overflow). One operand alone is negated by `-`, and else itself.
    pub fn compute(self, numbers: &[Number]) -> Option<Number> {
        use Number::{Real, Whole};
        let (&first, rest) = numbers.split_first()?;
        if rest.is_empty() {
            return match (self, first) {
                (Self::Subtract, Whole(n)) => n.checked_neg().map(Whole),
                (Self::Subtract, Real(n)) => Some(Real(-n)),
                _ => Some(first),
            };
        }
        rest.iter()
            .try_fold(first, |sum, &next| match (self, sum, next) {
                (Self::Add, Whole(a), Whole(b)) => a.checked_add(b).map(Whole),
                (Self::Subtract, Whole(a), Whole(b)) => a.checked_sub(b).map(Whole),
                (Self::Multiply, Whole(a), Whole(b)) => a.checked_mul(b).map(Whole),
                (Self::Add, a, b) => Some(Real(a.real() + b.real())),
                (Self::Subtract, a, b) => Some(Real(a.real() - b.real())),
                (Self::Multiply, a, b) => Some(Real(a.real() * b.real())),
                (Self::Divide, a, b) => (b.real() != 0.0).then(|| Real(a.real() / b.real())),
            })
    }
}

impl Expression {
    /// The value of what names no attribute, if it has one.
    pub(crate) fn constant(&self) -> Option<Value> {
        match self {
            Self::Literal(literal) => Some(literal.value()),
            Self::Attribute(_) => None,
            Self::Arithmetic { operator, operands } => {
                let numbers = operands.iter().map(|one| Number::of(&one.constant()?));
                let numbers: Vec<Number> = numbers.collect::<Option<_>>()?;
                operator.compute(&numbers).and_then(Number::into_value)
            }
        }
    }

    /// The attributes that it reads.
    pub(crate) fn paths(&self) -> Vec<&AttributePath> {
        match self {
            Self::Literal(_) => Vec::new(),
            Self::Attribute(path) => vec![path],
            Self::Arithmetic { operands, .. } => operands.iter().flat_map(Self::paths).collect(),
        }
    }

    /// Whether it has a value in no graph: a constant that is no number is reckoned with, or 0 divides.
    pub(crate) fn is_undefined(&self) -> bool {
        let Self::Arithmetic { operator, operands } = self else {
            return false;
        };
        let numbers: Vec<Option<Value>> = operands.iter().map(Self::constant).collect();
        let is_text =
            |value: &Option<Value>| value.as_ref().is_some_and(|v| Number::of(v).is_none());
        let is_zero = |value: &Option<Value>| value.as_ref().and_then(Value::as_f64) == Some(0.0);
        let by_zero = *operator == Arithmetic::Divide && numbers.iter().skip(1).any(is_zero);
        by_zero
            || numbers.iter().any(is_text)
            || operands.iter().any(Self::is_undefined)
            || numbers.iter().all(Option::is_some) && self.constant().is_none()
    }

    /// Whether it is no cost or duration in any graph: undefined, a constant below 0, or one that is no number.
    pub(crate) fn is_no_amount(&self) -> bool {
        let is_amount = |value: &Value| Number::of(value).is_some_and(|n| n.real() >= 0.0);
        self.is_undefined() || self.constant().is_some_and(|value| !is_amount(&value))
    }
}

impl Comparison {
    /// Whether it holds of two values. Numbers compare as numbers whatever their width; vectors and lists of numbers element by
    /// element; all else is equal only to its own kind. Only numbers have an order.
    pub fn holds(self, left: &Value, right: &Value) -> bool {
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
        match self {
            Self::Equal => equal(),
            Self::NotEqual => !equal(),
            Self::Less => order == Some(Ordering::Less),
            Self::LessOrEqual => matches!(order, Some(Ordering::Less | Ordering::Equal)),
            Self::Greater => order == Some(Ordering::Greater),
            Self::GreaterOrEqual => matches!(order, Some(Ordering::Greater | Ordering::Equal)),
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_compare_across_their_kinds_and_text_has_no_order() {
        let yes = |operator: Comparison, a: Value, b: Value| {
            assert!(operator.holds(&a, &b), "{a:?} {b:?}");
        };
        let no = |operator: Comparison, a: Value, b: Value| {
            assert!(!operator.holds(&a, &b), "{a:?} {b:?}");
        };
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
        let sum = Arithmetic::Add.compute(&[big, Whole(1)]);
        assert_eq!(sum.and_then(Number::into_value), Some(Value::U64(1 << 63)));
        let huge = Arithmetic::Multiply.compute(&[big, big, big]);
        assert_eq!(huge.and_then(Number::into_value), None);
        assert_eq!(Arithmetic::Divide.compute(&[Whole(1), Whole(0)]), None);
        assert_eq!(
            Arithmetic::Divide.compute(&[Whole(1), Whole(4)]),
            Some(Real(0.25))
        );
        assert_eq!(Arithmetic::Subtract.compute(&[Whole(3)]), Some(Whole(-3)));
        assert_eq!(
            Arithmetic::Subtract.compute(&[Whole(9), Whole(3), Whole(2)]),
            Some(Whole(4))
        );
    }
}
