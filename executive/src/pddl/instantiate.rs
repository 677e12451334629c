//! From what may come to hold to a ground task. This file guarantees that the task's plans are the
//! plans of the definition, and that what never changes is compiled away.

use super::definition::{Condition, Cost, Definition, Effect, Object};
use super::facts::AtomId;
use super::reach::{Reached, each_choice};
use crate::task::{self, Fact, Formula, Literal, MOST_COST, Micro, Task, micro};
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;

/// A ground task and what its actions and facts are.
#[derive(Debug)]
pub(super) struct Ground {
    pub(super) task: Task,
    /// The instance that each action is.
    pub(super) actions: Vec<usize>,
    /// The atom that each fact is.
    pub(super) facts: Vec<AtomId>,
    /// How many instances were left out, for their costs are no amounts.
    pub(super) left_out: usize,
    /// The first of them in words, and why.
    pub(super) without_cost: Option<String>,
}

struct Builder<'a> {
    reached: &'a Reached,
    /// Atoms that some instance may delete.
    deleted: Vec<bool>,
    numbers: Vec<Option<Fact>>,
    facts: Vec<AtomId>,
}

/// Builds the task.
pub(super) fn instantiate(definition: &Definition, reached: &Reached) -> Ground {
    let mut builder = Builder {
        reached,
        deleted: vec![false; reached.facts.len()],
        numbers: vec![None; reached.facts.len()],
        facts: Vec::new(),
    };
    for (action, objects) in &reached.instances {
        let action = &definition.actions[*action];
        builder.note_deleted(&action.effects, &mut environment(action.slots, objects));
    }
    let goal = match &definition.goal {
        Some(goal) => {
            let mut environment = vec![0; definition.goal_slots];
            builder.formula(goal, true, &mut environment)
        }
        None => Formula::TRUE,
    };
    let values: FxHashMap<(usize, &[Object]), f64> = definition
        .values
        .iter()
        .map(|(function, objects, value)| ((*function, objects.as_slice()), *value))
        .collect();
    let (mut left_out, mut without_cost) = (0, None);
    let mut drafts = Vec::new();
    for (index, (number, objects)) in reached.instances.iter().enumerate() {
        let action = &definition.actions[*number];
        let mut environment = environment(action.slots, objects);
        let worth = if definition.metric {
            worth(&action.cost, &environment, &values)
        } else {
            Some(1.0)
        };
        let Some(cost) = worth.filter(|cost| (0.0..=MOST_COST).contains(cost)) else {
            left_out += 1;
            without_cost.get_or_insert_with(|| {
                let instance = definition.written(&action.name, objects);
                let place = |(function, objects): (usize, Vec<Object>)| {
                    definition.written(definition.functions.name(function), &objects)
                };
                let why = match (unvalued(&action.cost, &environment, &values), worth) {
                    (Some(unvalued), _) => format!("{} has no value", place(unvalued)),
                    (None, worth) => format!(
                        "its cost is {}, and costs are from 0 to {MOST_COST}",
                        worth.unwrap_or(f64::NAN)
                    ),
                };
                format!("{instance} was left out, since {why}")
            });
            continue;
        };
        let precondition = builder.formula(&action.precondition, true, &mut environment);
        if precondition == Formula::FALSE {
            continue;
        }
        let mut changes = Changes::new();
        builder.changes(
            &action.effects,
            &Formula::TRUE,
            &mut environment,
            &mut changes,
        );
        drafts.push((index, precondition, changes, micro(cost)));
    }
    let (mut actions, mut which) = (Vec::new(), Vec::new());
    for (index, precondition, changes, cost) in drafts {
        if let Some(action) = builder.action(precondition, changes, cost) {
            actions.push(action);
            which.push(index);
        }
    }
    let relevant = task::relevant(builder.facts.len(), &goal, &actions);
    let holds = |atom: &AtomId| (*atom as usize) < reached.initial;
    let numbered = (0..).zip(&builder.facts);
    let initial: Vec<Fact> = numbered
        .filter(|(_, atom)| holds(atom))
        .map(|(f, _)| f)
        .collect();
    Ground {
        task: Task::new(
            builder.facts.len(),
            &initial,
            goal,
            task::keep(actions, &relevant),
        ),
        actions: task::keep(which, &relevant),
        facts: builder.facts,
        left_out,
        without_cost,
    }
}

/// By condition, what is added and deleted.
type Changes = BTreeMap<Formula, (Vec<AtomId>, Vec<AtomId>)>;

fn environment(slots: usize, objects: &[Object]) -> Vec<Object> {
    let mut environment = vec![0; slots];
    environment[..objects.len()].copy_from_slice(objects);
    environment
}

fn worth(
    cost: &Cost,
    environment: &[Object],
    values: &FxHashMap<(usize, &[Object]), f64>,
) -> Option<f64> {
    let worth = |part: &Cost| worth(part, environment, values);
    match cost {
        Cost::Number(number) => Some(*number),
        Cost::Function(function, terms) => {
            let objects: Vec<Object> = terms.iter().map(|term| term.at(environment)).collect();
            values.get(&(*function, objects.as_slice())).copied()
        }
        Cost::Sum(parts) => parts.iter().map(worth).sum(),
        Cost::Product(parts) => parts.iter().map(worth).product(),
        Cost::Difference(a, b) => Some(worth(a)? - worth(b)?),
        Cost::Quotient(a, b) => Some(worth(a)? / worth(b)?),
    }
}

/// The first function of a cost that has no value, with its objects.
fn unvalued(
    cost: &Cost,
    environment: &[Object],
    values: &FxHashMap<(usize, &[Object]), f64>,
) -> Option<(usize, Vec<Object>)> {
    let unvalued = |part: &Cost| unvalued(part, environment, values);
    match cost {
        Cost::Number(_) => None,
        Cost::Function(function, terms) => {
            let objects: Vec<Object> = terms.iter().map(|term| term.at(environment)).collect();
            let known = values.contains_key(&(*function, objects.as_slice()));
            (!known).then_some((*function, objects))
        }
        Cost::Sum(parts) | Cost::Product(parts) => parts.iter().find_map(unvalued),
        Cost::Difference(a, b) | Cost::Quotient(a, b) => unvalued(a).or_else(|| unvalued(b)),
    }
}

impl Builder<'_> {
    fn note_deleted(&mut self, effects: &[Effect], environment: &mut Vec<Object>) {
        for effect in effects {
            match effect {
                Effect::Add(_) => {}
                Effect::Delete(atom) => {
                    let objects: Vec<Object> = atom
                        .arguments
                        .iter()
                        .map(|term| term.at(environment))
                        .collect();
                    if let Some(atom) = self.reached.facts.find(atom.predicate, &objects) {
                        self.deleted[atom as usize] = true;
                    }
                }
                Effect::When(_, body) => self.note_deleted(body, environment),
                Effect::Forall(variables, body) => {
                    each_choice(variables, environment, &mut |environment| {
                        self.note_deleted(body, environment);
                        true
                    });
                }
            }
        }
    }

    fn literal(&mut self, atom: Option<AtomId>, wanted: bool) -> Formula {
        let Some(atom) = atom else {
            return Formula::constant(!wanted);
        };
        let index = atom as usize;
        if index < self.reached.initial && !self.deleted[index] {
            return Formula::constant(wanted);
        }
        let facts = &mut self.facts;
        let fact = *self.numbers[index].get_or_insert_with(|| {
            facts.push(atom);
            facts.len() as Fact - 1
        });
        Formula::Literal(if wanted {
            Literal::positive(fact)
        } else {
            Literal::negative(fact)
        })
    }

    fn formula(
        &mut self,
        condition: &Condition,
        wanted: bool,
        environment: &mut Vec<Object>,
    ) -> Formula {
        match condition {
            Condition::Atom(atom) => {
                let objects: Vec<Object> = atom
                    .arguments
                    .iter()
                    .map(|term| term.at(environment))
                    .collect();
                let atom = self.reached.facts.find(atom.predicate, &objects);
                self.literal(atom, wanted)
            }
            Condition::Same(a, b) => {
                Formula::constant((a.at(environment) == b.at(environment)) == wanted)
            }
            Condition::Not(inner) => self.formula(inner, !wanted, environment),
            Condition::All(parts) | Condition::Any(parts) => {
                let all = matches!(condition, Condition::All(_)) == wanted;
                let mut found = Vec::new();
                for part in parts {
                    let part = self.formula(part, wanted, environment);
                    if part == Formula::constant(!all) {
                        return part;
                    }
                    found.push(part);
                }
                joined(all, found)
            }
            Condition::Exists(variables, body) | Condition::Forall(variables, body) => {
                let all = matches!(condition, Condition::Forall(..)) == wanted;
                let mut found = Vec::new();
                each_choice(variables, environment, &mut |environment| {
                    let part = self.formula(body, wanted, environment);
                    let decided = part == Formula::constant(!all);
                    found.push(part);
                    !decided
                });
                joined(all, found)
            }
        }
    }

    fn changes(
        &mut self,
        effects: &[Effect],
        condition: &Formula,
        environment: &mut Vec<Object>,
        changes: &mut Changes,
    ) {
        for effect in effects {
            match effect {
                Effect::Add(atom) | Effect::Delete(atom) => {
                    let objects: Vec<Object> = atom
                        .arguments
                        .iter()
                        .map(|term| term.at(environment))
                        .collect();
                    let Some(number) = self.reached.facts.find(atom.predicate, &objects) else {
                        continue;
                    };
                    let entry = changes.entry(condition.clone()).or_default();
                    match effect {
                        Effect::Add(_) => entry.0.push(number),
                        _ => entry.1.push(number),
                    }
                }
                Effect::When(when, body) => {
                    let when = self.formula(when, true, environment);
                    let both = Formula::all([condition.clone(), when]);
                    if both != Formula::FALSE {
                        self.changes(body, &both, environment, changes);
                    }
                }
                Effect::Forall(variables, body) => {
                    each_choice(variables, environment, &mut |environment| {
                        self.changes(body, condition, environment, changes);
                        true
                    });
                }
            }
        }
    }

    /// The action, unless it changes nothing that any condition names.
    fn action(&self, precondition: Formula, changes: Changes, cost: Micro) -> Option<task::Action> {
        let numbers = |atoms: Vec<AtomId>| -> Vec<Fact> {
            let known = atoms.iter().filter_map(|&atom| self.numbers[atom as usize]);
            let mut facts: Vec<Fact> = known.collect();
            facts.sort_unstable();
            facts.dedup();
            facts
        };
        let mut effects = Vec::new();
        for (condition, (add, delete)) in changes {
            let (add, delete) = (numbers(add), numbers(delete));
            if !(add.is_empty() && delete.is_empty()) {
                effects.push(task::Effect {
                    condition,
                    add,
                    delete,
                });
            }
        }
        (!effects.is_empty()).then(|| task::Action::new(precondition, effects, cost))
    }
}

fn joined(all: bool, parts: Vec<Formula>) -> Formula {
    if all {
        Formula::all(parts)
    } else {
        Formula::any(parts)
    }
}
