//! Expressions as sides of a comparison.
//!
//! Guarantee: two expressions have the same key only where they have the same value in every graph.

use super::contradiction::Scope;
use super::order::Side;
use crate::{Arithmetic, AttributePath, Expression, Number};

/// What tells expressions apart: the same for the same attribute of the same node.
pub(super) fn key(expression: &Expression, scope: &Scope) -> Option<String> {
    Some(match expression {
        Expression::Literal(_) => expression.to_string(),
        Expression::Attribute(AttributePath::Node {
            variable,
            attribute,
        }) => format!("{}.{attribute}", scope.get(variable)?),
        Expression::Attribute(AttributePath::Edge {
            from,
            label,
            to,
            attribute,
        }) => {
            let (from, to) = (scope.get(from)?, scope.get(to)?);
            format!("e({from},{label},{to}).{attribute}")
        }
        Expression::Arithmetic { operator, operands } => {
            let operands = operands.iter().map(|operand| key(operand, scope));
            let operands: Vec<String> = operands.collect::<Option<_>>()?;
            format!("({} {})", operator.symbol(), operands.join(" "))
        }
    })
}

/// What an expression adds to what.
pub(super) fn side(expression: &Expression, scope: &Scope) -> Side {
    if let Some(constant) = expression.constant() {
        return Side::Constant(constant);
    }
    let sum = match expression {
        Expression::Literal(_) => None,
        Expression::Attribute(_) => key(expression, scope).map(|base| Side::Sum {
            base,
            added: Vec::new(),
        }),
        Expression::Arithmetic { operator, operands } => sum(*operator, operands, scope),
    };
    // What it comes to is not known, but the same where it is written alike.
    let whole = || {
        key(expression, scope).map(|base| Side::Sum {
            base,
            added: Vec::new(),
        })
    };
    sum.or_else(whole).unwrap_or(Side::Other)
}

/// The same for arithmetic, if it is a sum of one attribute and constants.
fn sum(operator: Arithmetic, operands: &[Expression], scope: &Scope) -> Option<Side> {
    let number = |value: &Expression| value.constant().as_ref().and_then(Number::of);
    let place = operands.iter().position(|one| one.constant().is_none())?;
    let Side::Sum { base, mut added } = side(&operands[place], scope) else {
        return None;
    };
    match operator {
        Arithmetic::Add => {
            if place > 0 {
                let first: Option<Vec<Number>> = operands[..place].iter().map(number).collect();
                added.push(operator.compute(&first?)?);
            }
            for one in &operands[place + 1..] {
                added.push(number(one)?);
            }
        }
        Arithmetic::Subtract if place == 0 && operands.len() > 1 => {
            for one in &operands[1..] {
                added.push(Arithmetic::Subtract.compute(&[number(one)?])?);
            }
        }
        _ => return None,
    }
    Some(Side::Sum { base, added })
}
