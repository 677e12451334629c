//! Formulas put together from others.
//!
//! Guarantee: what always or never holds does not stay as a part of another formula.

use crate::Condition;

/// What always holds.
pub(crate) fn yes() -> Condition {
    Condition::And(Vec::new())
}

/// What never holds.
pub(crate) fn no() -> Condition {
    Condition::Or(Vec::new())
}

/// What always or never holds.
pub(crate) fn constant(holds: bool) -> Condition {
    if holds { yes() } else { no() }
}

/// That all hold.
pub(crate) fn all(conditions: Vec<Condition>) -> Condition {
    let mut flat = Vec::new();
    for condition in conditions {
        match condition {
            Condition::And(inner) => flat.extend(inner),
            never if never == no() => return no(),
            other => flat.push(other),
        }
    }
    if flat.len() == 1 {
        flat.remove(0)
    } else {
        Condition::And(flat)
    }
}

/// That one holds.
pub(crate) fn any(conditions: Vec<Condition>) -> Condition {
    let mut flat = Vec::new();
    for condition in conditions {
        match condition {
            Condition::Or(inner) => flat.extend(inner),
            always if always == yes() => return yes(),
            other => flat.push(other),
        }
    }
    if flat.len() == 1 {
        flat.remove(0)
    } else {
        Condition::Or(flat)
    }
}

/// That it does not hold.
pub(crate) fn negated(condition: Condition) -> Condition {
    match condition {
        Condition::Not(inner) => *inner,
        always if always == yes() => no(),
        never if never == no() => yes(),
        other => Condition::Not(Box::new(other)),
    }
}
