//! What an operator changes at a binding, one primitive change at a time. This file guarantees that
//! each is given with everything that it depends on.

use super::facts::Facts;
use super::program::{Change, Environment, Link, Object, Place, Quantified, Term, Test};
use super::vocabulary::TypeSet;

/// Something that a change depends on.
#[derive(Debug, Clone)]
pub(crate) enum Guard<'a> {
    /// The test holds before the rule.
    Test(&'a Test, Environment),
    /// The object exists before the rule and is of one of these types.
    OfType(Object, &'a TypeSet),
}

/// A change of one thing.
#[derive(Debug, Clone)]
pub(crate) enum Primitive<'a> {
    Link(Link),
    Unlink(Link),
    Assign(Place, &'a Term, Environment),
    Create(Object, u16),
    Delete(Object),
    Retype(Object, u16),
}

/// Calls `visit` for each choice of objects (by `facts`) for the quantified slots.
pub(crate) fn each_choice<T>(
    quantified: &Quantified<T>,
    facts: &Facts,
    environment: &mut Environment,
    visit: &mut dyn FnMut(&mut Environment, &[Object]),
) {
    fn go(
        domains: &[TypeSet],
        first: usize,
        depth: usize,
        facts: &Facts,
        environment: &mut Environment,
        visit: &mut dyn FnMut(&mut Environment, &[Object]),
    ) {
        let Some(domain) = domains.get(depth) else {
            let chosen = environment[first..first + depth].to_vec();
            return visit(environment, &chosen);
        };
        let objects: Vec<Object> = facts.objects_of(domain).collect();
        for object in objects {
            environment[first + depth] = object;
            go(domains, first, depth + 1, facts, environment, visit);
        }
    }
    // The slots may be those of variables that come into scope later.
    let first = quantified.first;
    let slots = first..first + quantified.domains.len();
    let before = environment[slots.clone()].to_vec();
    go(&quantified.domains, first, 0, facts, environment, visit);
    environment[slots].copy_from_slice(&before);
}

/// Calls `visit` with each primitive change and its guards. Quantifiers range over what exists by
/// `facts`.
pub(crate) fn each_primitive<'a>(
    changes: &'a [Change],
    facts: &Facts,
    environment: &mut Environment,
    guards: &mut Vec<Guard<'a>>,
    visit: &mut dyn FnMut(&[Guard<'a>], Primitive<'a>),
) {
    for change in changes {
        let at = |slot: &u32| environment[*slot as usize];
        let primitive = match change {
            Change::Link(link) => Primitive::Link(link.at(environment)),
            Change::Unlink(link) => Primitive::Unlink(link.at(environment)),
            Change::Assign(place, term) => {
                Primitive::Assign(place.at(environment), term, environment.clone())
            }
            Change::Create(slot, exact) => Primitive::Create(at(slot), *exact),
            Change::Delete(slot) => Primitive::Delete(at(slot)),
            Change::Retype(slot, exact) => Primitive::Retype(at(slot), *exact),
            Change::Forall(quantified) => {
                each_choice(
                    quantified,
                    facts,
                    environment,
                    &mut |environment, chosen| {
                        let before = guards.len();
                        for (object, domain) in chosen.iter().zip(&quantified.domains) {
                            guards.push(Guard::OfType(*object, domain));
                        }
                        each_primitive(&quantified.body, facts, environment, guards, visit);
                        guards.truncate(before);
                    },
                );
                continue;
            }
            Change::When(test, body) => {
                guards.push(Guard::Test(test, environment.clone()));
                each_primitive(body, facts, environment, guards, visit);
                guards.pop();
                continue;
            }
        };
        visit(guards, primitive);
    }
}
