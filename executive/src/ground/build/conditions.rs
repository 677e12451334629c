//! Conditions at a binding, as formulas over facts. This file guarantees that what never changes
//! becomes a constant and that no other fact is named than one that may change.

use super::{Atom, Builder};
use crate::ground::choices::{Choice, choices, read};
use crate::ground::effects::each_choice;
use crate::ground::program::{Environment, Object, Operator, Place, Quantified, Test};
use crate::ground::value::{compare, evaluate};
use crate::ground::vocabulary::TypeSet;
use crate::task::{Fact, Formula, Literal};

impl Builder<'_> {
    pub(super) fn holds_at_first(&self, atom: Atom) -> bool {
        match atom {
            Atom::Link(link) => self.initial.has_link(link),
            Atom::Type(object, exact) => self.initial.types(object).contains(&exact),
            Atom::Used(..) => false,
            Atom::Awake(operator) => self.awake[operator],
            Atom::Value(_, value) => value == 0,
        }
    }

    pub(super) fn may_hold(&self, atom: Atom) -> bool {
        match atom {
            Atom::Link(link) => self.reached.facts.has_link(link),
            Atom::Type(object, exact) => self.reached.facts.types(object).contains(&exact),
            Atom::Used(operator, spare) => self.used.contains(&(operator, spare)),
            Atom::Awake(operator) => self.reached.awake[operator],
            Atom::Value(place, value) => value < self.reached.facts.values(place).len(),
        }
    }

    /// An atom or its negation, as a constant where it never changes.
    pub(super) fn literal(&mut self, atom: Atom, positive: bool) -> Formula {
        if !self.may_hold(atom) {
            return Formula::constant(!positive);
        }
        if self.holds_at_first(atom) && !self.deleted.contains(&atom) {
            return Formula::constant(positive);
        }
        let next = self.atoms.len() as Fact;
        let fact = *self.numbers.entry(atom).or_insert(next);
        if fact == next {
            self.atoms.push(atom);
        }
        Formula::Literal(if positive {
            Literal::positive(fact)
        } else {
            Literal::negative(fact)
        })
    }

    pub(super) fn of_type(&mut self, object: Object, types: &TypeSet, positive: bool) -> Formula {
        let reached = self.reached;
        let exact = reached.facts.types(object).iter().copied();
        let parts: Vec<Formula> = exact
            .filter(|&exact| types.contains(usize::from(exact)))
            .map(|exact| self.literal(Atom::Type(object, exact), positive))
            .collect();
        combine(parts, positive)
    }

    pub(super) fn test(
        &mut self,
        test: &Test,
        environment: &mut Environment,
        positive: bool,
    ) -> Formula {
        match test {
            Test::Link(link) => self.literal(Atom::Link(link.at(environment)), positive),
            Test::Same(a, b) => {
                let same = environment[*a as usize] == environment[*b as usize];
                Formula::constant(same == positive)
            }
            Test::Compare(operator, left, right) => {
                let reached = &self.reached.facts;
                let all = choices(&[left, right], environment, reached, self.program);
                let mut parts = Vec::new();
                for choice in all {
                    let mut look = |place: Place| read(place.at(environment), &choice, reached);
                    let (left, right) = (evaluate(left, &mut look), evaluate(right, &mut look));
                    if compare(*operator, left.as_ref(), right.as_ref()) == positive {
                        parts.push(self.choice(&choice, true));
                    }
                }
                Formula::any(parts)
            }
            Test::Not(inner) => self.test(inner, environment, !positive),
            Test::All(parts) => {
                let parts: Vec<Formula> = parts
                    .iter()
                    .map(|part| self.test(part, environment, positive))
                    .collect();
                combine(parts, !positive)
            }
            Test::Any(parts) => {
                let parts: Vec<Formula> = parts
                    .iter()
                    .map(|part| self.test(part, environment, positive))
                    .collect();
                combine(parts, positive)
            }
            Test::Exists(quantified) => self.quantified(quantified, environment, positive, true),
            Test::Forall(quantified) => self.quantified(quantified, environment, positive, false),
        }
    }

    pub(super) fn quantified(
        &mut self,
        quantified: &Quantified<Box<Test>>,
        environment: &mut Environment,
        positive: bool,
        exists: bool,
    ) -> Formula {
        let reached = self.reached;
        let mut parts = Vec::new();
        // A choice counts where all chosen exist and (for `exists`) the body holds; the negation
        // of `forall` is an `exists` of the body's negation.
        let body = positive == exists;
        each_choice(
            quantified,
            &reached.facts,
            environment,
            &mut |environment, chosen| {
                let body = if body {
                    self.test(&quantified.body, environment, exists)
                } else {
                    self.test(&quantified.body, environment, !exists)
                };
                let there = chosen
                    .iter()
                    .zip(&quantified.domains)
                    .map(|(&object, types)| self.of_type(object, types, positive == exists));
                let mut one: Vec<Formula> = there.collect();
                one.push(body);
                parts.push(combine(one, positive != exists));
            },
        );
        combine(parts, positive == exists)
    }

    /// That some places have the chosen values, or that not all have.
    pub(super) fn choice(&mut self, choice: &Choice, positive: bool) -> Formula {
        let parts: Vec<Formula> = choice
            .iter()
            .map(|&(place, value)| self.literal(Atom::Value(place, value), positive))
            .collect();
        combine(parts, !positive)
    }

    /// What an operator or a goal asks for at a binding.
    pub(super) fn demand(&mut self, operator: &Operator, environment: &mut Environment) -> Formula {
        let mut parts = Vec::new();
        for (slot, variable) in operator.variables[..operator.bound].iter().enumerate() {
            parts.push(self.of_type(environment[slot], &variable.types, true));
        }
        for link in &operator.links {
            parts.push(self.literal(Atom::Link(link.at(environment)), true));
        }
        for link in &operator.absent {
            parts.push(self.literal(Atom::Link(link.at(environment)), false));
        }
        for test in &operator.tests {
            parts.push(self.test(test, environment, true));
        }
        Formula::all(parts)
    }
}

/// Any of the parts, or all of them.
pub(super) fn combine(parts: Vec<Formula>, any: bool) -> Formula {
    if any {
        Formula::any(parts)
    } else {
        Formula::all(parts)
    }
}

/// The opposite of a formula.
pub(super) fn negation(formula: &Formula) -> Formula {
    match formula {
        Formula::Literal(literal) => Formula::Literal(if literal.negated() {
            Literal::positive(literal.fact())
        } else {
            Literal::negative(literal.fact())
        }),
        Formula::And(parts) => Formula::any(parts.iter().map(negation)),
        Formula::Or(parts) => Formula::all(parts.iter().map(negation)),
    }
}
