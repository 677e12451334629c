//! The states that a search has seen, each kept once, and the way to each. This file guarantees
//! that two nodes never stand for the same state.

use crate::task::Micro;
use std::hash::Hasher;

/// A state that was seen, by number.
pub(super) type Node = u32;

/// The first state's parent, and a node not yet there.
pub(super) const NONE: u32 = u32::MAX;

/// What a search knows of a state.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known {
    /// The node that led to it, or [`NONE`].
    pub(super) parent: Node,
    /// The action that led to it.
    pub(super) action: u32,
    /// What the way to it costs.
    pub(super) cost: Micro,
    /// The heuristic's estimate from it; `Micro::MAX` for a dead end.
    pub(super) estimate: Micro,
}

/// The states seen, without duplicates.
#[derive(Debug)]
pub(super) struct States {
    words: usize,
    /// All states, one after another.
    bits: Vec<u64>,
    known: Vec<Known>,
    /// Open addressing: node numbers, [`NONE`] where free; a power of two in length.
    table: Vec<u32>,
}

fn hash(state: &[u64]) -> usize {
    let mut hasher = rustc_hash::FxHasher::default();
    for &word in state {
        hasher.write_u64(word);
    }
    hasher.finish() as usize
}

impl States {
    pub(super) fn new(words: usize) -> Self {
        Self {
            words,
            bits: Vec::new(),
            known: Vec::new(),
            table: vec![NONE; 1024],
        }
    }

    /// Bytes in use.
    pub(super) fn bytes(&self) -> usize {
        self.bits.capacity() * 8
            + self.known.capacity() * size_of::<Known>()
            + self.table.capacity() * 4
    }

    pub(super) fn state(&self, node: Node) -> &[u64] {
        &self.bits[node as usize * self.words..][..self.words]
    }

    pub(super) fn known(&self, node: Node) -> &Known {
        &self.known[node as usize]
    }

    pub(super) fn known_mut(&mut self, node: Node) -> &mut Known {
        &mut self.known[node as usize]
    }

    /// The slot of the state, or the free one where it would go.
    fn slot(&self, state: &[u64]) -> usize {
        let mask = self.table.len() - 1;
        let mut slot = hash(state) & mask;
        while self.table[slot] != NONE && self.state(self.table[slot]) != state {
            slot = (slot + 1) & mask;
        }
        slot
    }

    /// The node of `state`, if it was seen.
    pub(super) fn find(&self, state: &[u64]) -> Option<Node> {
        Some(self.table[self.slot(state)]).filter(|&node| node != NONE)
    }

    /// A node for a state that was not seen.
    pub(super) fn insert(&mut self, state: &[u64], known: Known) -> Node {
        if self.known.len() * 2 >= self.table.len() {
            self.grow();
        }
        let slot = self.slot(state);
        let node = self.known.len() as u32;
        self.table[slot] = node;
        self.bits.extend_from_slice(state);
        self.known.push(known);
        node
    }

    fn grow(&mut self) {
        self.table = vec![NONE; self.table.len() * 2];
        for node in 0..self.known.len() as u32 {
            let slot = self.slot(self.state(node));
            self.table[slot] = node;
        }
    }

    /// The actions that lead to a node.
    pub(super) fn way_to(&self, mut node: Node) -> Vec<usize> {
        let mut way = Vec::new();
        while self.known(node).parent != NONE {
            way.push(self.known(node).action as usize);
            node = self.known(node).parent;
        }
        way.reverse();
        way
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_state_is_found_iff_it_was_inserted(
            states in prop::collection::btree_set(prop::collection::vec(0u64..40, 2), 0..1500),
            probe in prop::collection::vec(prop::collection::vec(0u64..40, 2), 50),
        ) {
            let mut seen = States::new(2);
            for state in &states {
                prop_assert_eq!(seen.find(state), None);
                let known = Known { parent: NONE, action: 0, cost: 0, estimate: 0 };
                let node = seen.insert(state, known);
                prop_assert_eq!(seen.find(state), Some(node));
            }
            for state in &probe {
                let found = seen.find(state);
                prop_assert_eq!(found.is_some(), states.contains(state));
                if let Some(node) = found {
                    prop_assert_eq!(seen.state(node), state.as_slice());
                }
            }
        }
    }
}
