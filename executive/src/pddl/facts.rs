//! Ground atoms as they are reached, indexed by predicate, argument and object. This file guarantees
//! that each atom has one number, by the order in which they came.

use super::definition::Object;
use rustc_hash::FxHashMap;

/// A ground atom, by number.
pub(super) type AtomId = u32;

/// Atoms with an index over those that were entered.
#[derive(Debug, Default)]
pub(super) struct Facts {
    atoms: Vec<(usize, Box<[Object]>)>,
    numbers: Vec<FxHashMap<Box<[Object]>, AtomId>>,
    /// Entered atoms by predicate.
    of: Vec<Vec<AtomId>>,
    /// Entered atoms by predicate, argument and object.
    with: FxHashMap<(usize, usize, Object), Vec<AtomId>>,
}

impl Facts {
    pub(super) fn new(predicates: usize) -> Self {
        Self {
            numbers: vec![FxHashMap::default(); predicates],
            of: vec![Vec::new(); predicates],
            ..Self::default()
        }
    }

    pub(super) fn len(&self) -> usize {
        self.atoms.len()
    }

    pub(super) fn atom(&self, number: AtomId) -> (usize, &[Object]) {
        let (predicate, arguments) = &self.atoms[number as usize];
        (*predicate, arguments)
    }

    pub(super) fn find(&self, predicate: usize, arguments: &[Object]) -> Option<AtomId> {
        self.numbers[predicate].get(arguments).copied()
    }

    /// The number of an atom, if it is new.
    pub(super) fn add(&mut self, predicate: usize, arguments: &[Object]) -> Option<AtomId> {
        if self.numbers[predicate].contains_key(arguments) {
            return None;
        }
        let number = self.atoms.len() as AtomId;
        let arguments: Box<[Object]> = arguments.into();
        self.numbers[predicate].insert(arguments.clone(), number);
        self.atoms.push((predicate, arguments));
        Some(number)
    }

    /// Makes an atom one that joins find.
    pub(super) fn enter(&mut self, number: AtomId) {
        let (predicate, arguments) = &self.atoms[number as usize];
        self.of[*predicate].push(number);
        for (position, &object) in arguments.iter().enumerate() {
            let entry = self.with.entry((*predicate, position, object));
            entry.or_default().push(number);
        }
    }

    /// The entered atoms of a predicate.
    pub(super) fn of(&self, predicate: usize) -> &[AtomId] {
        &self.of[predicate]
    }

    /// The entered atoms of a predicate with an object as one of its arguments.
    pub(super) fn with(&self, predicate: usize, position: usize, object: Object) -> &[AtomId] {
        let found = self.with.get(&(predicate, position, object));
        found.map_or(&[], Vec::as_slice)
    }
}
