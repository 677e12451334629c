//! Rules carried out on facts, one after another: how a search goes from state to state where it has no ground
//! task. This file guarantees the outcome that the grammar's own application has; the tests hold it against
//! the store.

use super::effects::{Guard, Primitive, each_primitive};
use super::facts::Facts;
use super::program::{Environment, Link, Object, Operator, Place, Program};
use super::truth::holds;
use super::value::evaluate;
use dsr::Value;
use std::collections::BTreeMap;

/// What an operator changes. What is both in `gone` and in `come` holds afterwards.
#[derive(Debug, Default)]
pub(crate) struct Changes {
    pub(crate) unlinked: Vec<Link>,
    pub(crate) linked: Vec<Link>,
    /// Objects that lose the exact types they had.
    pub(crate) untyped: Vec<Object>,
    pub(crate) typed: BTreeMap<Object, u16>,
    pub(crate) assigned: BTreeMap<Place, Value>,
}

/// Whether what is not in an operator's links holds: what must be absent is, and its tests hold.
pub(crate) fn is_admitted(
    operator: &Operator,
    environment: &mut Environment,
    facts: &Facts,
) -> bool {
    let is_there = |link: &Link| facts.has_link(link.at(environment));
    !operator.absent.iter().any(is_there)
        && operator
            .tests
            .iter()
            .all(|test| holds(test, facts, environment))
}

/// What an operator changes at an environment where its left side holds and created variables have their
/// objects; `None` where it is refused: a value is assigned that there is not, or a strict rule leaves a link
/// hanging.
pub(crate) fn changes(
    program: &Program,
    operator: &Operator,
    environment: &mut Environment,
    facts: &Facts,
) -> Option<Changes> {
    let mut happening: Vec<Primitive<'_>> = Vec::new();
    let mut visit = |guards: &[Guard<'_>], primitive| {
        let all = guards.iter().all(|guard| match guard {
            Guard::Test(test, at) => holds(test, facts, &mut at.clone()),
            Guard::OfType(object, types) => facts.is_of(*object, types),
        });
        if all {
            happening.push(primitive);
        }
    };
    let made = &operator.changes;
    each_primitive(made, facts, environment, &mut Vec::new(), &mut visit);
    let deleted = |object: &Object| {
        let mut primitives = happening.iter();
        primitives.any(|p| matches!(p, Primitive::Delete(gone) if gone == object))
    };
    let mut changes = Changes::default();
    for primitive in &happening {
        match primitive {
            Primitive::Unlink(link) => changes.unlinked.push(*link),
            Primitive::Delete(object) => {
                let links = facts.links_at(*object);
                let unlinked = |link: &Link| {
                    let mut primitives = happening.iter();
                    primitives.any(|p| matches!(p, Primitive::Unlink(other) if other == link))
                };
                if operator.strict && !links.iter().all(unlinked) {
                    return None;
                }
                changes.unlinked.extend(links);
                changes.untyped.push(*object);
            }
            Primitive::Create(object, exact) => {
                changes.typed.insert(*object, *exact);
            }
            Primitive::Retype(object, exact) if !deleted(object) => {
                changes.untyped.push(*object);
                changes.typed.insert(*object, *exact);
            }
            Primitive::Link(link) if !deleted(&link.from) && !deleted(&link.to) => {
                changes.linked.push(*link);
            }
            Primitive::Assign(place, term, at)
                if program.assigned[usize::from(place.attribute())] =>
            {
                let value = evaluate(term, &mut |p| facts.value(p.at(at)).cloned())?;
                changes.assigned.insert(*place, value);
            }
            Primitive::Retype(..) | Primitive::Link(_) | Primitive::Assign(..) => {}
        }
    }
    Some(changes)
}

#[cfg(test)]
pub(crate) mod testing {
    //! What only the tests need, which hold this against the store.

    use super::super::words::Words;
    use super::*;

    /// What of an operator's left side does not hold, in words; `None` if all holds.
    pub(crate) fn obstacle(
        operator: &Operator,
        environment: &mut Environment,
        facts: &Facts,
        words: Words<'_>,
    ) -> Option<String> {
        for (slot, variable) in operator.variables[..operator.bound].iter().enumerate() {
            if !facts.is_of(environment[slot], &variable.types) {
                let object = words.object(environment[slot], operator, slot);
                return Some(format!("{object} is no {}", words.types(&variable.types)));
            }
        }
        for link in &operator.links {
            if !facts.has_link(link.at(environment)) {
                let link = words.link(*link, operator, environment);
                return Some(format!("{link} does not hold"));
            }
        }
        let admitted = is_admitted(operator, environment, facts);
        (!admitted).then(|| "something holds that must not, or a test does not".to_owned())
    }

    /// Carries out some changes.
    pub(crate) fn apply(changes: &Changes, facts: &mut Facts) {
        for link in &changes.unlinked {
            facts.remove_link(*link);
        }
        for &object in &changes.untyped {
            for exact in facts.types(object).to_vec() {
                facts.remove_type(object, exact);
            }
        }
        for (&object, &exact) in &changes.typed {
            facts.add_type(object, exact);
        }
        for link in &changes.linked {
            facts.add_link(*link);
        }
        for (place, value) in &changes.assigned {
            facts.set_value(*place, Some(value.clone()));
        }
    }
}
