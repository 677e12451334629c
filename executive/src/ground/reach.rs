//! Everything that rules may bring about from a world, ignoring what they take away. This file
//! guarantees that every plan uses only instances and facts found here, as long as it makes no more
//! new nodes per rule than there are spare objects.

use super::effects::{Guard, Primitive, each_primitive};
use super::facts::Facts;
use super::join::Plan;
use super::program::{Environment, Link, Object, Operator, Place, Program, Term};
use super::truth::always;
use super::value::evaluate;
use super::world::World;
use crate::search::{Limits, StopReason};
use dsr::Value;
use rustc_hash::FxHashSet;
use std::collections::VecDeque;

/// A place is followed through so many values; beyond, a plan cannot count on it.
const MOST_VALUES: usize = 64;

/// A rule at a binding.
#[derive(Debug, Clone)]
pub(crate) struct Instance {
    pub(crate) operator: usize,
    /// The object of each slot, spare ones for what the rule creates.
    pub(crate) objects: Environment,
    /// Which of the rule's spares it takes.
    pub(crate) spare: usize,
}

/// What may come to hold.
#[derive(Debug)]
pub(crate) struct Reached {
    pub(crate) facts: Facts,
    pub(crate) instances: Vec<Instance>,
    /// Bindings at which the goal may hold.
    pub(crate) goals: Vec<Environment>,
    /// Operators that are awake, or may be woken.
    pub(crate) awake: Vec<bool>,
    /// A place had more values than are followed.
    pub(crate) truncated: bool,
}

#[derive(Debug, Clone, Copy)]
enum Arrival {
    Type(Object, u16),
    Link(Link),
}

struct Reaching<'a> {
    program: &'a Program,
    goal: &'a Operator,
    initial: &'a Facts,
    spares: &'a [Vec<Vec<Object>>],
    plans: Vec<Plan>,
    /// Which links of which operators have a label.
    by_label: Vec<Vec<(usize, usize)>>,
    /// Which variables of which operators may stand for a type.
    by_type: Vec<Vec<(usize, usize)>>,
    seen: FxHashSet<(usize, Environment)>,
    /// Bindings of operators that still sleep.
    sleeping: Vec<Vec<Environment>>,
    arrivals: VecDeque<Arrival>,
    reached: Reached,
}

/// Finds what may come to hold. `spares` are the objects for what rules create: by operator, by
/// application, in the order of its created variables.
///
/// # Errors
/// [`StopReason::Time`].
pub(crate) fn reach(
    program: &Program,
    goal: &Operator,
    world: &World,
    spares: &[Vec<Vec<Object>>],
    awake: Vec<bool>,
    limits: &mut Limits<'_>,
) -> Result<Reached, StopReason> {
    let labels = program.vocabulary.labels.len();
    let types = program.vocabulary.types.len();
    let objects = world.nodes.len();
    let mut facts = world.facts.clone();
    facts.forget_structure();
    let mut by_label = vec![Vec::new(); labels];
    let mut by_type = vec![Vec::new(); types];
    let operators = || program.operators.iter().chain([goal]);
    for (number, operator) in operators().enumerate() {
        for (index, link) in operator.links.iter().enumerate() {
            by_label[usize::from(link.label)].push((number, index));
        }
        for (index, variable) in operator.variables[..operator.bound].iter().enumerate() {
            for exact in variable.types.ones() {
                by_type[exact].push((number, index));
            }
        }
    }
    let mut reaching = Reaching {
        plans: operators().map(|o| Plan::new(o, &world.facts)).collect(),
        sleeping: vec![Vec::new(); program.operators.len()],
        seen: FxHashSet::default(),
        arrivals: VecDeque::new(),
        initial: &world.facts,
        program,
        goal,
        spares,
        by_label,
        by_type,
        reached: Reached {
            facts,
            instances: Vec::new(),
            goals: Vec::new(),
            awake,
            truncated: false,
        },
    };
    // Types first: until links are there, few bindings have all that they need.
    for object in 0..objects as Object {
        for &exact in world.facts.types(object) {
            reaching.arrivals.push_back(Arrival::Type(object, exact));
        }
    }
    for label in 0..labels as u16 {
        for &(from, to) in world.facts.pairs(label) {
            let link = Link { label, from, to };
            reaching.arrivals.push_back(Arrival::Link(link));
        }
    }
    reaching.run(limits)?;
    Ok(reaching.reached)
}

impl<'a> Reaching<'a> {
    fn operator(&self, number: usize) -> &'a Operator {
        self.program.operators.get(number).unwrap_or(self.goal)
    }

    fn run(&mut self, limits: &mut Limits<'_>) -> Result<(), StopReason> {
        for number in 0..=self.program.operators.len() {
            if self.operator(number).bound == 0 {
                let environment = self.operator(number).environment();
                self.bound(number, vec![environment]);
            }
        }
        let mut count = 0usize;
        loop {
            while let Some(arrival) = self.arrivals.pop_front() {
                if count.is_multiple_of(256) {
                    limits.check_time()?;
                }
                count += 1;
                self.arrive(arrival);
            }
            // Effects on every object of a type, and assigned values, depend on what was reached
            // after their rule was.
            let mut grew = false;
            for index in 0..self.reached.instances.len() {
                let instance = self.reached.instances[index].clone();
                grew |= self.effects(&instance);
            }
            if !grew && self.arrivals.is_empty() {
                return Ok(());
            }
        }
    }

    fn arrive(&mut self, arrival: Arrival) {
        let mut found = Vec::new();
        match arrival {
            Arrival::Type(object, exact) => {
                if !self.reached.facts.add_type(object, exact) {
                    return;
                }
                for at in 0..self.by_type[usize::from(exact)].len() {
                    let (number, variable) = self.by_type[usize::from(exact)][at];
                    let operator = self.operator(number);
                    let (plan, facts) = (&self.plans[number], &self.reached.facts);
                    plan.from_variable(operator, facts, variable, object, &mut found);
                    self.bound(number, std::mem::take(&mut found));
                }
            }
            Arrival::Link(link) => {
                if !self.reached.facts.add_link(link) {
                    return;
                }
                for at in 0..self.by_label[usize::from(link.label)].len() {
                    let (number, index) = self.by_label[usize::from(link.label)][at];
                    let operator = self.operator(number);
                    let (plan, facts) = (&self.plans[number], &self.reached.facts);
                    plan.from_link(operator, facts, index, link, &mut found);
                    self.bound(number, std::mem::take(&mut found));
                }
            }
        }
    }

    /// Takes new bindings of an operator or the goal.
    fn bound(&mut self, number: usize, found: Vec<Environment>) {
        let operator = self.operator(number);
        for mut environment in found {
            if self.seen.contains(&(number, environment.clone())) {
                continue;
            }
            self.seen.insert((number, environment.clone()));
            let impossible = |environment: &mut Environment| {
                let forbidden = operator.absent.iter().any(|link| {
                    self.initial.has_link(link.at(environment))
                        && !self.program.removed[usize::from(link.label)]
                });
                forbidden
                    || operator.tests.iter().any(|test| {
                        always(test, self.program, self.initial, environment) == Some(false)
                    })
            };
            if impossible(&mut environment) {
                continue;
            }
            if number == self.program.operators.len() {
                self.reached.goals.push(environment);
            } else if self.reached.awake[number] {
                self.apply(number, &environment);
            } else {
                self.sleeping[number].push(environment);
            }
        }
    }

    fn apply(&mut self, number: usize, environment: &Environment) {
        let operator = self.operator(number);
        let once = [Vec::new()];
        let spares: &[Vec<Object>] = if operator.creates() {
            &self.spares[number]
        } else {
            &once
        };
        for (spare, created) in spares.iter().enumerate() {
            let mut objects = environment.clone();
            objects[operator.bound..operator.bound + created.len()].copy_from_slice(created);
            let instance = Instance {
                operator: number,
                objects,
                spare,
            };
            self.effects(&instance);
            self.reached.instances.push(instance);
        }
        for &woken in &operator.wakes {
            if !std::mem::replace(&mut self.reached.awake[woken], true) {
                for environment in std::mem::take(&mut self.sleeping[woken]) {
                    self.apply(woken, &environment);
                }
            }
        }
    }

    /// Queues what an instance may bring about; gives whether a place has new values.
    fn effects(&mut self, instance: &Instance) -> bool {
        let operator = self.operator(instance.operator);
        let mut arrivals = Vec::new();
        let mut assigned: Vec<(Place, &Term, Environment)> = Vec::new();
        let mut environment = instance.objects.clone();
        let (program, initial, facts) = (self.program, self.initial, &self.reached.facts);
        let mut visit = |guards: &[Guard<'_>], primitive: Primitive<'a>| {
            let never = guards.iter().any(|guard| match guard {
                Guard::Test(test, environment) => {
                    always(test, program, initial, &mut environment.clone()) == Some(false)
                }
                Guard::OfType(..) => false,
            });
            if never {
                return;
            }
            match primitive {
                Primitive::Link(link) if !facts.has_link(link) => {
                    arrivals.push(Arrival::Link(link));
                }
                Primitive::Create(object, exact) | Primitive::Retype(object, exact)
                    if !facts.types(object).contains(&exact) =>
                {
                    arrivals.push(Arrival::Type(object, exact));
                }
                Primitive::Assign(place, term, environment)
                    if program.assigned[usize::from(place.attribute())] =>
                {
                    assigned.push((place, term, environment));
                }
                _ => {}
            }
        };
        let changes = &operator.changes;
        each_primitive(
            changes,
            facts,
            &mut environment,
            &mut Vec::new(),
            &mut visit,
        );
        self.arrivals.extend(arrivals);
        let mut grew = false;
        for (place, term, environment) in assigned {
            for (_, value) in combinations(term, &environment, &self.reached.facts, program) {
                let Some(value) = value else { continue };
                if self.reached.facts.values(place).len() >= MOST_VALUES {
                    self.reached.truncated |=
                        !self.reached.facts.values(place).contains(&Some(value));
                } else {
                    grew |= self.reached.facts.add_value(place, Some(value));
                }
            }
        }
        grew
    }
}

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
