//! Values of expressions. This file guarantees the same values and comparisons as the grammar's own
//! evaluation, over places that a search may fill with values that the graph does not have yet.

use super::program::{Place, Term};
use crate::task::MOST_COST;
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

/// A cost: a number from 0 to [`MOST_COST`].
pub(crate) fn amount(value: Option<&Value>) -> Option<f64> {
    let amount = Number::of(value?)?.real();
    (0.0..=MOST_COST).contains(&amount).then_some(amount)
}
