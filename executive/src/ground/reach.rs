//! Everything that rules may bring about from a world, ignoring what they take away. This file
//! guarantees that every plan uses only instances and facts found here, as long as it makes no more
//! new nodes per rule than there are spare objects.

use super::choices::combinations;
use super::effects::{Guard, Primitive, each_primitive};
use super::facts::Facts;
use super::join::{Found, Plan, bytes_of_binding};
use super::program::{
    Change, Environment, Link, Object, Operator, Place, Program, Quantified, Term,
};
use super::truth::always;
use crate::search::{Limits, StopReason};
use fixedbitset::FixedBitSet;
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::VecDeque;
use std::collections::hash_map::Entry::Vacant;

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

/// How much of what may come to hold is looked for.
#[derive(Debug, Clone)]
pub(crate) enum Scope {
    /// All of it, unless there are more instances than this.
    All(usize),
    /// What rules bring about at these objects alone, unless there are more instances than this.
    At(FixedBitSet, usize),
    /// Until the goal may hold, with only those instances that first brought about something.
    Way,
    /// What these instances bring about, and no others.
    Steps(Vec<Instance>),
}

/// What may come to hold.
#[derive(Debug)]
pub(crate) struct Reached {
    /// There are more instances than were asked for: the rest was not looked for.
    pub(crate) overflow: bool,
    /// On the way to the goal, the instance that first brought about each fact.
    pub(crate) achieved: FxHashMap<Arrival, usize>,
    pub(crate) facts: Facts,
    pub(crate) instances: Vec<Instance>,
    /// Bindings at which the goal may hold.
    pub(crate) goals: Vec<Environment>,
    /// Operators that are awake, or may be woken.
    pub(crate) awake: Vec<bool>,
    /// A place had more values than are followed.
    pub(crate) truncated: bool,
    /// About how many bytes all of this takes.
    pub(crate) bytes: usize,
}

/// A fact that comes to hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Arrival {
    Type(Object, u16),
    Link(Link),
}

impl Arrival {
    fn is_among(self, objects: &FixedBitSet) -> bool {
        match self {
            Self::Type(object, _) => objects.contains(object as usize),
            Self::Link(Link { from, to, .. }) => {
                objects.contains(from as usize) && objects.contains(to as usize)
            }
        }
    }
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
    /// What each operator may bring about.
    gains: &'a [Vec<Change>],
    /// Operators of which later facts may change what they bring about.
    open_ended: Vec<bool>,
    arrivals: VecDeque<Arrival>,
    scope: Scope,
    reached: Reached,
}

/// Finds what may come to hold. `spares` are the objects for what rules create: by operator, by
/// application, in the order of its created variables.
///
/// # Errors
/// [`StopReason::Time`], [`StopReason::Memory`].
pub(crate) fn reach(
    program: &Program,
    goal: &Operator,
    initial: &Facts,
    spares: &[Vec<Vec<Object>>],
    awake: Vec<bool>,
    scope: Scope,
    limits: &mut Limits<'_>,
) -> Result<Reached, StopReason> {
    let labels = program.vocabulary.labels.len();
    let types = program.vocabulary.types.len();
    let mut facts = initial.clone();
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
    let changes = program.operators.iter().map(|operator| &operator.changes);
    let gains: Vec<Vec<Change>> = changes.map(|all| gains(all, program)).collect();
    let mut reaching = Reaching {
        plans: operators().map(|o| Plan::new(o, initial)).collect(),
        sleeping: vec![Vec::new(); program.operators.len()],
        seen: FxHashSet::default(),
        open_ended: gains.iter().map(|gains| open_ended(gains)).collect(),
        gains: &gains,
        arrivals: VecDeque::new(),
        scope,
        initial,
        program,
        goal,
        spares,
        by_label,
        by_type,
        reached: Reached {
            overflow: false,
            achieved: FxHashMap::default(),
            facts,
            instances: Vec::new(),
            goals: Vec::new(),
            awake,
            truncated: false,
            bytes: 0,
        },
    };
    // Types first: until links are there, few bindings have all that they need.
    for object in 0..initial.objects() as Object {
        for &exact in initial.types(object) {
            reaching.arrivals.push_back(Arrival::Type(object, exact));
        }
    }
    for label in 0..labels as u16 {
        for &(from, to) in initial.pairs(label) {
            let link = Link { label, from, to };
            reaching.arrivals.push_back(Arrival::Link(link));
        }
    }
    reaching.run(limits)?;
    Ok(reaching.reached)
}

/// Of some changes, those that may bring about a fact or a value.
fn gains(changes: &[Change], program: &Program) -> Vec<Change> {
    let gain = |change: &Change| match change {
        Change::Link(_) | Change::Create(..) | Change::Retype(..) => Some(change.clone()),
        Change::Unlink(_) | Change::Delete(_) => None,
        Change::Assign(place, _) => {
            program.assigned[usize::from(place.attribute())].then(|| change.clone())
        }
        Change::Forall(quantified) => {
            let body = gains(&quantified.body, program);
            (!body.is_empty()).then(|| {
                Change::Forall(Quantified {
                    first: quantified.first,
                    domains: quantified.domains.clone(),
                    body,
                })
            })
        }
        Change::When(test, body) => {
            let body = gains(body, program);
            (!body.is_empty()).then(|| Change::When(test.clone(), body))
        }
    };
    changes.iter().filter_map(gain).collect()
}

fn open_ended(gains: &[Change]) -> bool {
    gains.iter().any(|change| match change {
        Change::Forall(_) | Change::Assign(..) => true,
        Change::When(_, body) => open_ended(body),
        _ => false,
    })
}

impl<'a> Reaching<'a> {
    fn operator(&self, number: usize) -> &'a Operator {
        self.program.operators.get(number).unwrap_or(self.goal)
    }

    fn run(&mut self, limits: &mut Limits<'_>) -> Result<(), StopReason> {
        for number in 0..=self.program.operators.len() {
            let is_rule = number < self.program.operators.len();
            if self.operator(number).bound == 0
                && !(is_rule && matches!(self.scope, Scope::Steps(_)))
            {
                let environment = self.operator(number).environment();
                self.bound(number, vec![environment]);
            }
        }
        loop {
            while let Some(arrival) = self.arrivals.pop_front() {
                self.arrive(arrival, limits)?;
                if self.is_enough() {
                    return Ok(());
                }
            }
            if let Scope::Steps(steps) = &mut self.scope {
                for instance in std::mem::take(steps) {
                    self.effects(&instance);
                    for &woken in &self.operator(instance.operator).wakes {
                        self.reached.awake[woken] = true;
                    }
                    self.reached.instances.push(instance);
                }
            }
            // Effects on every object of a type, and assigned values, depend on what was reached
            // after their rule was.
            let mut grew = false;
            for index in 0..self.reached.instances.len() {
                if self.open_ended[self.reached.instances[index].operator] {
                    let instance = self.reached.instances[index].clone();
                    grew |= self.effects(&instance);
                }
            }
            if !grew && self.arrivals.is_empty() {
                return Ok(());
            }
        }
    }

    fn is_enough(&mut self) -> bool {
        match self.scope {
            Scope::All(most) | Scope::At(_, most) => {
                self.reached.overflow = self.reached.instances.len() > most;
                self.reached.overflow
            }
            Scope::Way => !self.reached.goals.is_empty(),
            Scope::Steps(_) => false,
        }
    }

    fn arrive(&mut self, arrival: Arrival, limits: &mut Limits<'_>) -> Result<(), StopReason> {
        let waiting = match arrival {
            Arrival::Type(object, exact) => {
                let new = self.reached.facts.add_type(object, exact);
                new.then(|| self.by_type[usize::from(exact)].clone())
            }
            Arrival::Link(link) => {
                let new = self.reached.facts.add_link(link);
                new.then(|| self.by_label[usize::from(link.label)].clone())
            }
        };
        for (number, index) in waiting.unwrap_or_default() {
            limits.check(self.reached.bytes)?;
            let is_rule = number < self.program.operators.len();
            if is_rule && matches!(self.scope, Scope::Steps(_)) {
                continue;
            }
            let operator = self.operator(number);
            let (plan, facts) = (&self.plans[number], &self.reached.facts);
            let only = match &self.scope {
                Scope::At(objects, _) if is_rule => Some(objects),
                _ => None,
            };
            if only.is_some_and(|objects| !arrival.is_among(objects)) {
                continue;
            }
            let mut found = Found::new(self.reached.bytes, only, limits);
            match arrival {
                Arrival::Type(object, _) => {
                    plan.with_variable(operator, facts, index, object, &mut found);
                }
                Arrival::Link(link) => plan.with_link(operator, facts, index, link, &mut found),
            }
            let Found {
                bindings, stopped, ..
            } = found;
            if let Some(reason) = stopped {
                return Err(reason);
            }
            self.bound(number, bindings);
        }
        Ok(())
    }

    /// Takes new bindings of an operator or the goal.
    fn bound(&mut self, number: usize, found: Vec<Environment>) {
        let operator = self.operator(number);
        for mut environment in found {
            // On the way to the goal, to see a binding again brings about nothing new.
            if !matches!(self.scope, Scope::Way) {
                if self.seen.contains(&(number, environment.clone())) {
                    continue;
                }
                self.seen.insert((number, environment.clone()));
                // Seen, and kept as an instance with what it changes.
                self.reached.bytes += 4 * bytes_of_binding(environment.len());
            }
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
            let queued = self.arrivals.len();
            self.effects(&instance);
            if matches!(self.scope, Scope::Way) {
                let number = self.reached.instances.len();
                let new: Vec<Arrival> = self.arrivals.drain(queued..).collect();
                for arrival in new {
                    if let Vacant(place) = self.reached.achieved.entry(arrival) {
                        place.insert(number);
                        self.arrivals.push_back(arrival);
                    }
                }
                if self.arrivals.len() == queued && !self.open_ended[instance.operator] {
                    continue;
                }
                self.reached.bytes += 2 * bytes_of_binding(instance.objects.len());
            }
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
        let mut arrivals = Vec::new();
        let mut assigned: Vec<(Place, &Term, Environment)> = Vec::new();
        let mut environment = instance.objects.clone();
        let (program, initial, facts) = (self.program, self.initial, &self.reached.facts);
        let mut visit = |guards: &[Guard<'_>], primitive: Primitive<'a>| {
            let new = match &primitive {
                Primitive::Link(link) => !facts.has_link(*link),
                Primitive::Create(object, exact) | Primitive::Retype(object, exact) => {
                    !facts.types(*object).contains(exact)
                }
                Primitive::Assign(place, ..) => program.assigned[usize::from(place.attribute())],
                Primitive::Unlink(_) | Primitive::Delete(_) => false,
            };
            let never = |guard: &Guard<'_>| match guard {
                Guard::Test(test, environment) => {
                    always(test, program, initial, &mut environment.clone()) == Some(false)
                }
                Guard::OfType(..) => false,
            };
            if !new || guards.iter().any(never) {
                return;
            }
            match primitive {
                Primitive::Link(link) => arrivals.push(Arrival::Link(link)),
                Primitive::Create(object, exact) | Primitive::Retype(object, exact) => {
                    arrivals.push(Arrival::Type(object, exact));
                }
                Primitive::Assign(place, term, environment) => {
                    assigned.push((place, term, environment));
                }
                Primitive::Unlink(_) | Primitive::Delete(_) => {}
            }
        };
        each_primitive(
            &self.gains[instance.operator],
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
