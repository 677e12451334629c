//! The state that a search without ground actions looks at. A state is what differs in it from the world at first,
//! so that one of a large world takes no more room than what was done in it. This file guarantees that equal states
//! are written the same, and that going from one to another costs what lies between them.

use crate::ground::{Atom, Facts, Instance, Problem, changes};
use dsr::Value;
use rustc_hash::{FxHashMap, FxHashSet};
use std::cmp::Ordering;
use std::rc::Rc;

/// The numbers of the atoms that hold here and not at first, or the other way round, ascending.
pub(super) type State = Rc<[u32]>;

/// The facts of one state at a time.
#[derive(Debug)]
pub(super) struct Present<'a> {
    problem: &'a Problem,
    facts: Facts,
    used: FxHashSet<(usize, usize)>,
    awake: Vec<bool>,
    atoms: Vec<Atom>,
    numbers: FxHashMap<Atom, u32>,
    /// Values that places came to have, each once, by how it is written.
    values: Vec<Value>,
    written: FxHashMap<String, usize>,
    state: State,
}

impl<'a> Present<'a> {
    /// The state at first.
    pub(super) fn new(problem: &'a Problem, awake: &[bool]) -> Self {
        Self {
            problem,
            facts: problem.world.facts.clone(),
            used: FxHashSet::default(),
            awake: awake.to_vec(),
            atoms: Vec::new(),
            numbers: FxHashMap::default(),
            values: Vec::new(),
            written: FxHashMap::default(),
            state: Rc::new([]),
        }
    }

    pub(super) fn facts(&self) -> &Facts {
        &self.facts
    }

    pub(super) fn awake(&self) -> &[bool] {
        &self.awake
    }

    pub(super) fn state(&self) -> &State {
        &self.state
    }

    /// About how many bytes the names of atoms take.
    pub(super) fn bytes(&self) -> usize {
        self.atoms.capacity() * 2 * size_of::<Atom>() + self.values.len() * 100
    }

    /// The spare that a rule would take next: spares are interchangeable.
    pub(super) fn next_spare(&self, operator: usize) -> usize {
        let mut numbers = 0..;
        let next = numbers.find(|&spare| !self.used.contains(&(operator, spare)));
        next.unwrap_or(usize::MAX)
    }

    pub(super) fn number(&mut self, atom: Atom) -> u32 {
        *self.numbers.entry(atom).or_insert_with(|| {
            self.atoms.push(atom);
            self.atoms.len() as u32 - 1
        })
    }

    pub(super) fn holds(&self, number: u32) -> bool {
        match self.atoms[number as usize] {
            Atom::Link(link) => self.facts.has_link(link),
            Atom::Type(object, exact) => self.facts.types(object).contains(&exact),
            Atom::Used(operator, spare) => self.used.contains(&(operator, spare)),
            Atom::Awake(operator) => self.awake[operator],
            Atom::Value(place, value) => self.facts.value(place) == Some(&self.values[value]),
        }
    }

    /// What an instance whose left side holds changes from one to the other, ascending; `None` where it is refused.
    pub(super) fn changed_by(&mut self, instance: &Instance) -> Option<Vec<u32>> {
        let program = &self.problem.program;
        let operator = &program.operators[instance.operator];
        let mut environment = instance.objects.clone();
        let made = changes(program, operator, &mut environment, &self.facts)?;
        let mut come: Vec<Atom> = made.linked.into_iter().map(Atom::Link).collect();
        let mut gone: Vec<Atom> = made.unlinked.into_iter().map(Atom::Link).collect();
        for object in made.untyped {
            let types = self.facts.types(object).iter();
            gone.extend(types.map(|&exact| Atom::Type(object, exact)));
        }
        let typed = made.typed.into_iter();
        come.extend(typed.map(|(object, exact)| Atom::Type(object, exact)));
        for (place, value) in made.assigned {
            if let Some(before) = self.facts.value(place).cloned() {
                gone.push(Atom::Value(place, self.value(before)));
            }
            come.push(Atom::Value(place, self.value(value)));
        }
        if operator.creates() {
            come.push(Atom::Used(instance.operator, instance.spare));
        }
        come.extend(operator.wakes.iter().map(|&woken| Atom::Awake(woken)));
        let come: Vec<u32> = come.into_iter().map(|atom| self.number(atom)).collect();
        let gone: Vec<u32> = gone.into_iter().map(|atom| self.number(atom)).collect();
        let lost = gone
            .iter()
            .filter(|&&a| self.holds(a) && !come.contains(&a));
        let won = come.iter().filter(|&&atom| !self.holds(atom));
        let mut changed: Vec<u32> = lost.chain(won).copied().collect();
        changed.sort_unstable();
        changed.dedup();
        Some(changed)
    }

    fn value(&mut self, value: Value) -> usize {
        // Values have no order and no hash of their own: a real may be no number.
        *self.written.entry(format!("{value:?}")).or_insert_with(|| {
            self.values.push(value);
            self.values.len() - 1
        })
    }

    /// Goes to the state in which just these atoms are the other way.
    pub(super) fn change(&mut self, changed: &[u32]) {
        self.state = difference(&self.state, changed).into();
        // What goes, goes first: a place has one value.
        let (gone, come): (Vec<u32>, Vec<u32>) = changed.iter().partition(|&&a| self.holds(a));
        for number in gone {
            match self.atoms[number as usize] {
                Atom::Link(link) => self.facts.remove_link(link),
                Atom::Type(object, exact) => self.facts.remove_type(object, exact),
                Atom::Used(operator, spare) => drop(self.used.remove(&(operator, spare))),
                Atom::Awake(operator) => self.awake[operator] = false,
                Atom::Value(place, _) => self.facts.set_value(place, None),
            }
        }
        for number in come {
            match self.atoms[number as usize] {
                Atom::Link(link) => drop(self.facts.add_link(link)),
                Atom::Type(object, exact) => drop(self.facts.add_type(object, exact)),
                Atom::Used(operator, spare) => drop(self.used.insert((operator, spare))),
                Atom::Awake(operator) => self.awake[operator] = true,
                Atom::Value(place, value) => {
                    let value = self.values[value].clone();
                    self.facts.set_value(place, Some(value));
                }
            }
        }
    }

    /// Goes to a state.
    pub(super) fn go(&mut self, to: &State) {
        self.change(&difference(&self.state, to));
    }
}

/// What is in one of two ascending lists and not in the other, ascending.
fn difference(a: &[u32], b: &[u32]) -> Vec<u32> {
    let (mut a, mut b) = (a.iter().peekable(), b.iter().peekable());
    let mut only = Vec::new();
    loop {
        let order = match (a.peek(), b.peek()) {
            (Some(a), Some(b)) => a.cmp(b),
            (Some(_), None) => Ordering::Less,
            (None, Some(_)) => Ordering::Greater,
            (None, None) => return only,
        };
        match order {
            Ordering::Less => only.extend(a.next()),
            Ordering::Greater => only.extend(b.next()),
            Ordering::Equal => {
                a.next();
                b.next();
            }
        }
    }
}
