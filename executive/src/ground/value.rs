//! Values of expressions. This file guarantees the same values and comparisons as the grammar's own
//! evaluation, over places that a search may fill with values that the graph does not have yet.

use super::program::{Place, Term};
use dsr::Value;
use grammar::{Comparison, Number};

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
            operator.compute(&numbers?).and_then(Number::into_value)
        }
    }
}

/// Whether a comparison holds; one with a missing value does not.
pub(crate) fn compare(operator: Comparison, left: Option<&Value>, right: Option<&Value>) -> bool {
    let (Some(left), Some(right)) = (left, right) else {
        return false;
    };
    operator.holds(left, right)
}

/// A cost or duration: a number that is 0 or more.
pub(crate) fn amount(value: Option<&Value>) -> Option<f64> {
    let amount = Number::of(value?)?.real();
    (amount >= 0.0 && amount.is_finite()).then_some(amount)
}
