//! Bindings of patterns, found by following links. This file guarantees that every binding it
//! gives is injective, typed, and has all positive links; and that among facts that come one after
//! another, each binding is given when the last of its facts comes.

use super::facts::Facts;
use super::program::{Environment, Link, Object, Operator, UNBOUND};
use crate::search::{Limits, StopReason};
use fixedbitset::FixedBitSet;

/// One step of a join.
#[derive(Debug, Clone, Copy)]
enum Step {
    /// Both ends are bound: look whether the link is there.
    Check(Link),
    /// Bind the target.
    Forward(Link),
    /// Bind the source.
    Backward(Link),
    /// Bind both.
    Scan(Link),
    /// Bind a variable that no link leads to.
    Each(usize),
}

/// Bindings as they are found, within limits: a rule whose variables no link joins may have more of
/// them than there is time or memory.
#[derive(Debug)]
pub(crate) struct Found<'l, 'c> {
    pub(crate) bindings: Vec<Environment>,
    /// Bytes that are in use besides.
    bytes: usize,
    tried: u32,
    /// The only objects that may be bound, where not all may.
    only: Option<&'l FixedBitSet>,
    limits: &'l mut Limits<'c>,
    pub(crate) stopped: Option<StopReason>,
}

impl<'l, 'c> Found<'l, 'c> {
    pub(crate) fn new(
        bytes: usize,
        only: Option<&'l FixedBitSet>,
        limits: &'l mut Limits<'c>,
    ) -> Self {
        Self {
            only,
            bindings: Vec::new(),
            bytes,
            tried: 0,
            limits,
            stopped: None,
        }
    }

    fn admits(&self, objects: &[Object]) -> bool {
        let known = |only: &FixedBitSet| objects.iter().all(|&o| only.contains(o as usize));
        self.only.is_none_or(known)
    }

    fn is_stopped(&mut self) -> bool {
        self.tried += 1;
        if self.tried.is_multiple_of(1024) && self.stopped.is_none() {
            let slots = self.bindings.first().map_or(0, Vec::len);
            let bytes = self.bytes + self.bindings.len() * bytes_of_binding(slots);
            self.stopped = self.limits.check(bytes).err();
        }
        self.stopped.is_some()
    }
}

/// About what a binding takes.
pub(crate) const fn bytes_of_binding(slots: usize) -> usize {
    size_of::<Environment>() + 16 + slots * size_of::<Object>()
}

/// In which order to bind the variables of an operator, from every fact that may come last.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    by_link: Vec<Vec<Step>>,
    by_variable: Vec<Vec<Step>>,
    all: Vec<Step>,
}

impl Plan {
    /// For an operator, by how many links of each label there are.
    pub(crate) fn new(operator: &Operator, facts: &Facts) -> Self {
        let order = |bound: &[usize], done: Option<usize>| order(operator, facts, bound, done);
        Self {
            by_link: operator
                .links
                .iter()
                .enumerate()
                .map(|(index, link)| order(&[link.from as usize, link.to as usize], Some(index)))
                .collect(),
            by_variable: (0..operator.bound).map(|v| order(&[v], None)).collect(),
            all: order(&[], None),
        }
    }

    /// All bindings.
    pub(crate) fn all(&self, operator: &Operator, facts: &Facts, found: &mut Found<'_, '_>) {
        let mut environment = operator.environment();
        let is_of = |&(slot, object): &(usize, Object)| {
            facts.is_of(object, &operator.variables[slot].types)
        };
        if operator.fixed.iter().all(is_of) {
            extend(operator, facts, &self.all, &mut environment, found);
        }
    }

    /// The bindings that have `new` as the link number `index` of the operator.
    pub(crate) fn with_link(
        &self,
        operator: &Operator,
        facts: &Facts,
        index: usize,
        new: Link,
        found: &mut Found<'_, '_>,
    ) {
        let link = operator.links[index];
        let mut environment = operator.environment();
        if bind(operator, facts, &mut environment, link.from, new.from)
            && bind(operator, facts, &mut environment, link.to, new.to)
        {
            extend(
                operator,
                facts,
                &self.by_link[index],
                &mut environment,
                found,
            );
        }
    }

    /// The bindings that have `object` for the variable.
    pub(crate) fn with_variable(
        &self,
        operator: &Operator,
        facts: &Facts,
        variable: usize,
        object: Object,
        found: &mut Found<'_, '_>,
    ) {
        let mut environment = operator.environment();
        if bind(operator, facts, &mut environment, variable as u32, object) {
            let steps = &self.by_variable[variable];
            extend(operator, facts, steps, &mut environment, found);
        }
    }
}

/// Binds what is bound already, or may be: of the right type and no other variable's.
fn bind(
    operator: &Operator,
    facts: &Facts,
    environment: &mut Environment,
    slot: u32,
    object: Object,
) -> bool {
    let slot = slot as usize;
    if environment[slot] != UNBOUND {
        return environment[slot] == object && facts.is_of(object, &operator.variables[slot].types);
    }
    if environment[..operator.bound].contains(&object)
        || !facts.is_of(object, &operator.variables[slot].types)
    {
        return false;
    }
    environment[slot] = object;
    true
}

fn order(operator: &Operator, facts: &Facts, bound: &[usize], done: Option<usize>) -> Vec<Step> {
    let mut known = vec![false; operator.bound];
    let fixed = operator.fixed.iter().map(|&(slot, _)| slot);
    for slot in bound.iter().copied().chain(fixed) {
        known[slot] = true;
    }
    let mut left: Vec<usize> = (0..operator.links.len())
        .filter(|&index| Some(index) != done)
        .collect();
    let mut steps = Vec::new();
    while !left.is_empty() {
        // Links with more bound ends first, then those of rarer labels.
        let cost = |&index: &usize| {
            let link = operator.links[index];
            let [from, to] = [link.from, link.to].map(|slot| known[slot as usize]);
            let open = usize::from(!from) + usize::from(!to);
            (open, facts.pairs(link.label).len(), index)
        };
        let Some(next) = left.iter().copied().min_by_key(cost) else {
            break;
        };
        left.retain(|&index| index != next);
        let link = operator.links[next];
        let [from, to] = [link.from, link.to].map(|slot| known[slot as usize]);
        steps.push(match (from, to) {
            (true, true) => Step::Check(link),
            (true, false) => Step::Forward(link),
            (false, true) => Step::Backward(link),
            (false, false) => Step::Scan(link),
        });
        known[link.from as usize] = true;
        known[link.to as usize] = true;
    }
    steps.extend((0..operator.bound).filter(|&v| !known[v]).map(Step::Each));
    steps
}

fn extend(
    operator: &Operator,
    facts: &Facts,
    steps: &[Step],
    environment: &mut Environment,
    found: &mut Found<'_, '_>,
) {
    if found.is_stopped() {
        return;
    }
    let Some((&step, rest)) = steps.split_first() else {
        found.bindings.push(environment.clone());
        return;
    };
    let mut choose = |environment: &mut Environment, slots: &[u32], objects: &[Object]| {
        let fits = found.admits(objects)
            && slots
                .iter()
                .zip(objects)
                .all(|(&slot, &object)| bind(operator, facts, environment, slot, object));
        if fits {
            extend(operator, facts, rest, environment, found);
        }
        for &slot in slots {
            environment[slot as usize] = UNBOUND;
        }
    };
    match step {
        Step::Check(link) => {
            if facts.has_link(link.at(environment)) {
                extend(operator, facts, rest, environment, found);
            }
        }
        Step::Forward(link) => {
            for &to in facts.targets(link.label, environment[link.from as usize]) {
                choose(environment, &[link.to], &[to]);
            }
        }
        Step::Backward(link) => {
            for &from in facts.sources(link.label, environment[link.to as usize]) {
                choose(environment, &[link.from], &[from]);
            }
        }
        Step::Scan(link) => {
            for &(from, to) in facts.pairs(link.label) {
                choose(environment, &[link.from, link.to], &[from, to]);
            }
        }
        Step::Each(variable) => {
            let objects: Vec<Object> = facts
                .objects_of(&operator.variables[variable].types)
                .collect();
            for object in objects {
                choose(environment, &[variable as u32], &[object]);
            }
        }
    }
}
