//! Whether a condition holds: in one state, or in any state that a search may come to. This file
//! guarantees that the second answer is *no* or *yes* only where it is so in all of them.

use super::effects::each_choice;
use super::facts::Facts;
use super::program::{Environment, Operator, Program, Test};
use super::value::{compare, evaluate};

/// Whether a condition holds in the state that `facts` is.
pub(crate) fn holds(test: &Test, facts: &Facts, environment: &mut Environment) -> bool {
    match test {
        Test::Link(link) => facts.has_link(link.at(environment)),
        Test::Same(a, b) => environment[*a as usize] == environment[*b as usize],
        Test::Compare(operator, left, right) => {
            let mut read =
                |place: super::program::Place| facts.value(place.at(environment)).cloned();
            let left = evaluate(left, &mut read);
            let right = evaluate(right, &mut read);
            compare(*operator, left.as_ref(), right.as_ref())
        }
        Test::Not(inner) => !holds(inner, facts, environment),
        Test::All(parts) => parts.iter().all(|part| holds(part, facts, environment)),
        Test::Any(parts) => parts.iter().any(|part| holds(part, facts, environment)),
        Test::Exists(quantified) => {
            let mut found = false;
            each_choice(quantified, facts, environment, &mut |environment, _| {
                found = found || holds(&quantified.body, facts, environment);
            });
            found
        }
        Test::Forall(quantified) => {
            let mut all = true;
            each_choice(quantified, facts, environment, &mut |environment, _| {
                all = all && holds(&quantified.body, facts, environment);
            });
            all
        }
    }
}

/// How much of what a goal asks for does not hold at a binding, counted in types, links and tests: 0 where it holds.
pub(crate) fn lacking(goal: &Operator, facts: &Facts, environment: &mut Environment) -> u64 {
    let variables = goal.variables[..goal.bound].iter().zip(&*environment);
    let types = variables.filter(|(variable, object)| !facts.is_of(**object, &variable.types));
    let links = goal.links.iter();
    let links = links.filter(|link| !facts.has_link(link.at(environment)));
    let absent = goal.absent.iter();
    let absent = absent.filter(|link| facts.has_link(link.at(environment)));
    let structure = (types.count() + links.count() + absent.count()) as u64;
    let tests = goal.tests.iter();
    structure
        + tests
            .map(|test| lacking_of(test, facts, environment))
            .sum::<u64>()
}

fn lacking_of(test: &Test, facts: &Facts, environment: &mut Environment) -> u64 {
    match test {
        Test::All(parts) => {
            let parts = parts.iter();
            parts.map(|part| lacking_of(part, facts, environment)).sum()
        }
        Test::Any(parts) => {
            let parts = parts.iter();
            let least = parts.map(|part| lacking_of(part, facts, environment)).min();
            least.unwrap_or(1)
        }
        Test::Forall(quantified) => {
            let mut lacking = 0;
            each_choice(quantified, facts, environment, &mut |environment, _| {
                lacking += lacking_of(&quantified.body, facts, environment);
            });
            lacking
        }
        _ => u64::from(!holds(test, facts, environment)),
    }
}

/// What is known of a condition in every state that rules lead to from `initial`: whether it
/// holds, or `None` where that depends.
pub(crate) fn always(
    test: &Test,
    program: &Program,
    initial: &Facts,
    environment: &mut Environment,
) -> Option<bool> {
    let is_fixed = |place: super::program::Place| !program.assigned[usize::from(place.attribute())];
    match test {
        Test::Link(link) => {
            let label = usize::from(link.label);
            match initial.has_link(link.at(environment)) {
                false if !program.made[label] => Some(false),
                true if !program.removed[label] => Some(true),
                _ => None,
            }
        }
        Test::Same(..) => Some(holds(test, initial, environment)),
        Test::Compare(_, left, right) => {
            let mut fixed = true;
            left.each_place(&mut |place| fixed &= is_fixed(place));
            right.each_place(&mut |place| fixed &= is_fixed(place));
            fixed.then(|| holds(test, initial, environment))
        }
        Test::Not(inner) => always(inner, program, initial, environment).map(|known| !known),
        Test::All(parts) => {
            let mut all = Some(true);
            for part in parts {
                match always(part, program, initial, environment) {
                    Some(false) => return Some(false),
                    Some(true) => {}
                    None => all = None,
                }
            }
            all
        }
        Test::Any(parts) => {
            let mut any = Some(false);
            for part in parts {
                match always(part, program, initial, environment) {
                    Some(true) => return Some(true),
                    Some(false) => {}
                    None => any = None,
                }
            }
            any
        }
        Test::Exists(_) | Test::Forall(_) if program.types_change => None,
        Test::Exists(quantified) => {
            let mut any = Some(false);
            each_choice(quantified, initial, environment, &mut |environment, _| {
                if any != Some(true) {
                    match always(&quantified.body, program, initial, environment) {
                        Some(false) => {}
                        known => any = known,
                    }
                }
            });
            any
        }
        Test::Forall(quantified) => {
            let mut all = Some(true);
            each_choice(quantified, initial, environment, &mut |environment, _| {
                if all != Some(false) {
                    match always(&quantified.body, program, initial, environment) {
                        Some(true) => {}
                        known => all = known,
                    }
                }
            });
            all
        }
    }
}
