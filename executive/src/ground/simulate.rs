//! Rules carried out on facts, one after another: what the monitor foresees the rest of a plan by,
//! and an independent judge of the planner. This file guarantees the outcome that the grammar's own
//! application has.

use super::effects::{Guard, Primitive, each_primitive};
use super::facts::Facts;
use super::join::Plan;
use super::program::{Environment, Object, Operator, Program};
use super::truth::holds;
use super::value::evaluate;
use super::words::Words;

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
    for link in &operator.absent {
        if facts.has_link(link.at(environment)) {
            let link = words.link(*link, operator, environment);
            return Some(format!("{link} holds, which must not be"));
        }
    }
    for test in &operator.tests {
        if !holds(test, facts, environment) {
            let test = words.test(test, operator, environment);
            return Some(format!("{test} does not hold"));
        }
    }
    None
}

/// Applies an operator at an environment where its left side holds; created variables get the
/// objects there, or new ones where they have none.
pub(crate) fn apply(
    program: &Program,
    operator: &Operator,
    environment: &mut Environment,
    facts: &mut Facts,
) {
    for slot in operator.bound..operator.variables.len() {
        if environment[slot] == super::program::UNBOUND {
            environment[slot] = facts.add_object();
        }
    }
    let before = facts.clone();
    let mut happening: Vec<Primitive<'_>> = Vec::new();
    let mut visit = |guards: &[Guard<'_>], primitive| {
        let all = guards.iter().all(|guard| match guard {
            Guard::Test(test, at) => holds(test, &before, &mut at.clone()),
            Guard::OfType(object, types) => before.is_of(*object, types),
        });
        if all {
            happening.push(primitive);
        }
    };
    let changes = &operator.changes;
    each_primitive(changes, &before, environment, &mut Vec::new(), &mut visit);
    let deleted = |object: &Object| {
        happening
            .iter()
            .any(|p| matches!(p, Primitive::Delete(gone) if gone == object))
    };
    for primitive in &happening {
        match primitive {
            Primitive::Unlink(link) => facts.remove_link(*link),
            Primitive::Delete(object) => {
                for link in facts.links_at(*object) {
                    facts.remove_link(link);
                }
                facts.remove_types(*object);
            }
            _ => {}
        }
    }
    for primitive in &happening {
        match primitive {
            Primitive::Create(object, exact) => {
                facts.add_type(*object, *exact);
            }
            Primitive::Retype(object, exact) if !deleted(object) => {
                facts.remove_types(*object);
                facts.add_type(*object, *exact);
            }
            Primitive::Link(link) if !deleted(&link.from) && !deleted(&link.to) => {
                facts.add_link(*link);
            }
            Primitive::Assign(place, term, at)
                if program.assigned[usize::from(place.attribute())] =>
            {
                let value = evaluate(term, &mut |p| before.value(p.at(at)).cloned());
                facts.set_value(*place, value);
            }
            _ => {}
        }
    }
}

/// Whether a goal holds somewhere.
pub(crate) fn goal_holds(goal: &Operator, facts: &Facts) -> bool {
    let mut found = Vec::new();
    Plan::new(goal, facts).all(goal, facts, &mut found);
    found.into_iter().any(|mut environment| {
        let absent = goal.absent.iter();
        absent.clone().all(|l| !facts.has_link(l.at(&environment)))
            && goal.tests.iter().all(|t| holds(t, facts, &mut environment))
    })
}
