//! Conditions over facts, in negation normal form. This file guarantees that the smart
//! constructors keep a formula's meaning and leave no constant inside a larger formula.

use super::{Fact, holds};

/// A fact that must, or must not, hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Literal(u32);

impl Literal {
    /// The fact holds.
    pub const fn positive(fact: Fact) -> Self {
        Self(fact * 2)
    }

    /// The fact does not hold.
    pub const fn negative(fact: Fact) -> Self {
        Self(fact * 2 + 1)
    }

    /// Of which fact.
    pub const fn fact(self) -> Fact {
        self.0 / 2
    }

    /// Whether the fact must not hold.
    pub const fn negated(self) -> bool {
        self.0 % 2 == 1
    }

    /// A number of its own below twice the number of facts.
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// Whether it holds.
    pub fn holds(self, state: &[u64]) -> bool {
        holds(state, self.fact()) != self.negated()
    }
}

/// A condition over facts.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Formula {
    /// A literal.
    Literal(Literal),
    /// All of these; none of them is an `And`. Holds when empty.
    And(Vec<Formula>),
    /// One of these; none of them is an `Or`. Does not hold when empty.
    Or(Vec<Formula>),
}

impl Formula {
    /// Holds always.
    pub const TRUE: Self = Self::And(Vec::new());
    /// Holds never.
    pub const FALSE: Self = Self::Or(Vec::new());

    /// All of `parts`, simplified.
    pub fn all(parts: impl IntoIterator<Item = Self>) -> Self {
        let mut kept = Vec::new();
        for part in parts {
            match part {
                Self::And(inner) => kept.extend(inner),
                part if part == Self::FALSE => return Self::FALSE,
                part => kept.push(part),
            }
        }
        kept.sort_unstable();
        kept.dedup();
        if contradicts(&kept) {
            return Self::FALSE;
        }
        match <[Self; 1]>::try_from(kept) {
            Ok([only]) => only,
            Err(kept) => Self::And(kept),
        }
    }

    /// One of `parts`, simplified.
    pub fn any(parts: impl IntoIterator<Item = Self>) -> Self {
        let mut kept = Vec::new();
        for part in parts {
            match part {
                Self::Or(inner) => kept.extend(inner),
                part if part == Self::TRUE => return Self::TRUE,
                part => kept.push(part),
            }
        }
        kept.sort_unstable();
        kept.dedup();
        if contradicts(&kept) {
            return Self::TRUE;
        }
        match <[Self; 1]>::try_from(kept) {
            Ok([only]) => only,
            Err(kept) => Self::Or(kept),
        }
    }

    /// The constant formula.
    pub const fn constant(value: bool) -> Self {
        if value { Self::TRUE } else { Self::FALSE }
    }

    /// Whether it holds.
    pub fn holds(&self, state: &[u64]) -> bool {
        match self {
            Self::Literal(literal) => literal.holds(state),
            Self::And(parts) => parts.iter().all(|part| part.holds(state)),
            Self::Or(parts) => parts.iter().any(|part| part.holds(state)),
        }
    }

    /// Calls `visit` with each literal in it.
    pub fn each_literal(&self, visit: &mut impl FnMut(Literal)) {
        match self {
            Self::Literal(literal) => visit(*literal),
            Self::And(parts) | Self::Or(parts) => {
                parts.iter().for_each(|part| part.each_literal(visit));
            }
        }
    }
}

/// Whether a sorted list of parts has a literal beside its negation.
fn contradicts(parts: &[Formula]) -> bool {
    parts.windows(2).any(|pair| match pair {
        [Formula::Literal(a), Formula::Literal(b)] => a.fact() == b.fact(),
        _ => false,
    })
}

/// The literals that a formula demands outright, and what else it demands.
pub(crate) fn conjuncts(formula: &Formula) -> (Vec<Literal>, Vec<&Formula>) {
    let parts = match formula {
        Formula::And(parts) => parts.as_slice(),
        other => std::slice::from_ref(other),
    };
    let mut literals = Vec::new();
    let mut rest = Vec::new();
    for part in parts {
        match part {
            Formula::Literal(literal) => literals.push(*literal),
            other => rest.push(other),
        }
    }
    (literals, rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A formula as it was said, before any constructor simplified it.
    #[derive(Debug, Clone)]
    enum Said {
        Literal(u32, bool),
        All(Vec<Said>),
        Any(Vec<Said>),
    }

    impl Said {
        fn holds(&self, state: u64) -> bool {
            match self {
                Self::Literal(fact, negated) => (state >> fact & 1 == 1) != *negated,
                Self::All(parts) => parts.iter().all(|p| p.holds(state)),
                Self::Any(parts) => parts.iter().any(|p| p.holds(state)),
            }
        }

        fn formula(&self) -> Formula {
            match self {
                Self::Literal(fact, true) => Formula::Literal(Literal::negative(*fact)),
                Self::Literal(fact, false) => Formula::Literal(Literal::positive(*fact)),
                Self::All(parts) => Formula::all(parts.iter().map(Self::formula)),
                Self::Any(parts) => Formula::any(parts.iter().map(Self::formula)),
            }
        }
    }

    fn said() -> impl Strategy<Value = Said> {
        let leaf = (0..4u32, any::<bool>()).prop_map(|(f, n)| Said::Literal(f, n));
        leaf.prop_recursive(3, 24, 4, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..4).prop_map(Said::All),
                prop::collection::vec(inner, 0..4).prop_map(Said::Any),
            ]
        })
    }

    fn tidy(formula: &Formula, root: bool) -> bool {
        match formula {
            Formula::Literal(_) => true,
            Formula::And(parts) => {
                (root && parts.is_empty() || parts.len() > 1)
                    && parts
                        .iter()
                        .all(|p| !matches!(p, Formula::And(_)) && tidy(p, false))
            }
            Formula::Or(parts) => {
                (root && parts.is_empty() || parts.len() > 1)
                    && parts
                        .iter()
                        .all(|p| !matches!(p, Formula::Or(_)) && tidy(p, false))
            }
        }
    }

    proptest! {
        #[test]
        fn the_constructors_keep_the_meaning_and_leave_no_constant_inside(said in said()) {
            let formula = said.formula();
            for state in 0..16 {
                prop_assert_eq!(formula.holds(&[state]), said.holds(state));
            }
            prop_assert!(tidy(&formula, true), "{:?}", formula);
        }
    }
}
