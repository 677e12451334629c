//! Values of expressions. This file guarantees the same values and comparisons as the grammar's own
//! evaluation, over places that a search may fill with values that the graph does not have yet.

use super::program::{Place, Term};
use dsr::Value;
use grammar::{Arithmetic, Comparison};
use std::cmp::Ordering;

/// The value of a term whose places (of slots) `read` looks up; `None` where it has none.
pub(crate) fn evaluate(
    term: &Term,
    read: &mut impl FnMut(Place) -> Option<Value>,
) -> Option<Value> {
    match term {
        Term::Constant(value) => Some(value.clone()),
        Term::Place(place) => read(*place),
        Term::Arithmetic(operator, operands) => {
            let numbers: Option<Vec<Number>> = operands
                .iter()
                .map(|operand| Number::of(&evaluate(operand, read)?))
                .collect();
            arithmetic(*operator, &numbers?).and_then(Number::into_value)
        }
    }
}

/// A number as formulas see it: whole numbers of any width, or reals.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Number {
    Whole(i128),
    Real(f64),
}

impl Number {
    fn of(value: &Value) -> Option<Self> {
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

    fn real(self) -> f64 {
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

/// Whether a comparison holds; one with a missing value does not.
pub(crate) fn compare(operator: Comparison, left: Option<&Value>, right: Option<&Value>) -> bool {
    let (Some(left), Some(right)) = (left, right) else {
        return false;
    };
    let order = match (Number::of(left), Number::of(right)) {
        (Some(Number::Whole(a)), Some(Number::Whole(b))) => Some(a.cmp(&b)),
        (Some(a), Some(b)) => a.real().partial_cmp(&b.real()),
        _ => None,
    };
    let equal = match (order, row(left), row(right)) {
        (Some(order), _, _) => order == Ordering::Equal,
        (None, Some(a), Some(b)) => a == b,
        _ => left == right,
    };
    match operator {
        Comparison::Equal => equal,
        Comparison::NotEqual => !equal,
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

/// A cost or duration: a number that is 0 or more.
pub(crate) fn amount(value: Option<&Value>) -> Option<f64> {
    let amount = Number::of(value?)?.real();
    (amount >= 0.0 && amount.is_finite()).then_some(amount)
}
