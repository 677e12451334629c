//! Choices of values for places that rules assign: where several states are looked at as one, a place may have
//! several. This file guarantees that each choice is given once, in the order in which the values came.

use super::facts::Facts;
use super::program::{Object, Place, Program, Term};
use super::value::evaluate;
use dsr::Value;

/// A choice of one value (by its number) for each of some places.
pub(crate) type Choice = Vec<(Place, usize)>;

/// Every choice of values for the places of `term` that rules assign, and the term's value then.
pub(crate) fn combinations(
    term: &Term,
    environment: &[Object],
    facts: &Facts,
    program: &Program,
) -> Vec<(Choice, Option<Value>)> {
    let terms = [term];
    let choices = choices(&terms, environment, facts, program);
    choices
        .into_iter()
        .map(|choice| {
            let value = evaluate(term, &mut |place| {
                read(place.at(environment), &choice, facts)
            });
            (choice, value)
        })
        .collect()
}

/// Every choice of values for the places of some terms that rules assign.
pub(crate) fn choices(
    terms: &[&Term],
    environment: &[Object],
    facts: &Facts,
    program: &Program,
) -> Vec<Choice> {
    let mut places: Vec<Place> = Vec::new();
    for term in terms {
        term.each_place(&mut |place| {
            let place = place.at(environment);
            if program.assigned[usize::from(place.attribute())] && !places.contains(&place) {
                places.push(place);
            }
        });
    }
    let mut all = vec![Choice::new()];
    for place in places {
        all = all
            .iter()
            .flat_map(|choice| {
                (0..facts.values(place).len()).map(move |value| {
                    let mut longer = choice.clone();
                    longer.push((place, value));
                    longer
                })
            })
            .collect();
    }
    all
}

/// The value of a place, by a choice or else the only one.
pub(crate) fn read(place: Place, choice: &Choice, facts: &Facts) -> Option<Value> {
    let chosen = choice.iter().find(|(known, _)| *known == place);
    let index = chosen.map_or(0, |(_, index)| *index);
    facts.values(place).get(index).cloned().flatten()
}
