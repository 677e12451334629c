//! What the variables of a search or of a condition stand for, and how many nodes may still be
//! tried for them.
//!
//! Guarantee: whoever tries nodes asks here first, so that no condition and no search goes on for
//! ever, however its quantifiers are nested.

use super::program::Slot;
use dsr::{NodeId, ReadError};
use std::ops::{Deref, DerefMut};

/// At a given binding, no more nodes than this are tried for quantified variables: neither by all
/// conditions of a rule together, nor by its effects.
pub const CHOICE_LIMIT: u64 = 5_000_000;
/// No more nodes than this are tried from one match to the next, for all variables together.
pub const SEARCH_LIMIT: u64 = 50_000_000;

/// Why a search, or the evaluation of a condition, was not brought to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Interrupt {
    /// The graph cannot be read (any more).
    Read(ReadError),
    /// So many nodes were tried.
    Limit(u64),
}

impl From<ReadError> for Interrupt {
    fn from(error: ReadError) -> Self {
        Self::Read(error)
    }
}

/// What each slot stands for, and how many more nodes may be tried.
#[derive(Debug, Clone)]
pub(crate) struct Environment {
    slots: Vec<Slot>,
    limit: u64,
    left: u64,
}

impl Environment {
    /// Slots of which none is bound.
    pub(crate) fn new(slots: usize, limit: u64) -> Self {
        Self {
            slots: vec![Slot::Unbound; slots],
            limit,
            left: limit,
        }
    }

    /// Adds a slot.
    pub(crate) fn push(&mut self, slot: Slot) {
        self.slots.push(slot);
    }

    /// Adds unbound slots until there are so many.
    pub(crate) fn extend_to(&mut self, slots: usize) {
        let slots = slots.max(self.slots.len());
        self.slots.resize(slots, Slot::Unbound);
    }

    /// Counts so many more nodes that are tried.
    #[inline]
    pub(crate) fn spend(&mut self, nodes: u64) -> Result<(), Interrupt> {
        self.left = self
            .left
            .checked_sub(nodes)
            .ok_or(Interrupt::Limit(self.limit))?;
        Ok(())
    }

    /// Starts to count afresh.
    pub(crate) fn renew(&mut self) {
        self.left = self.limit;
    }

    /// Starts to count afresh, up to another limit.
    pub(crate) fn set_limit(&mut self, limit: u64) {
        self.limit = limit;
        self.left = limit;
    }
}

impl Deref for Environment {
    type Target = [Slot];
    #[inline]
    fn deref(&self) -> &[Slot] {
        &self.slots
    }
}

impl DerefMut for Environment {
    #[inline]
    fn deref_mut(&mut self) -> &mut [Slot] {
        &mut self.slots
    }
}

/// The node in a slot.
#[inline]
pub(crate) fn node(slots: &[Slot], slot: usize) -> Option<NodeId> {
    match slots[slot] {
        Slot::Node(node) => Some(node),
        _ => None,
    }
}
