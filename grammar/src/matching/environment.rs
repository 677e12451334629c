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

/// No more nodes than this are tried for all matches together where they are explained or listed for people; see
/// [`Matches::within_all`](crate::Matches::within_all).
pub const WHOLE_LIMIT: u64 = 200_000_000;

/// Why a search, or the evaluation of a condition, was not brought to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Interrupt {
    /// The graph cannot be read (any more).
    Read(ReadError),
    /// So many nodes were tried for one match.
    Limit(u64),
    /// So many nodes were tried for all of them.
    Whole(u64),
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
    /// What was left when it was last counted afresh.
    fresh: u64,
    whole_limit: u64,
    whole_left: u64,
}

impl Environment {
    /// Slots of which none is bound.
    pub(crate) fn new(slots: usize, limit: u64) -> Self {
        Self {
            slots: vec![Slot::Unbound; slots],
            limit,
            left: limit,
            fresh: limit,
            whole_limit: u64::MAX,
            whole_left: u64::MAX,
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
        self.left = self.left.checked_sub(nodes).ok_or_else(|| self.limit())?;
        Ok(())
    }

    #[cold]
    fn limit(&self) -> Interrupt {
        if self.fresh < self.limit {
            Interrupt::Whole(self.whole_limit)
        } else {
            Interrupt::Limit(self.limit)
        }
    }

    /// Starts to count afresh.
    pub(crate) fn renew(&mut self) {
        self.whole_left -= self.fresh - self.left;
        self.fresh = self.limit.min(self.whole_left);
        self.left = self.fresh;
    }

    /// Starts to count afresh, up to another limit.
    pub(crate) fn set_limit(&mut self, limit: u64) {
        self.limit = limit;
        self.fresh = limit.min(self.whole_left);
        self.left = self.fresh;
    }

    /// Starts to count all afresh, up to another limit.
    pub(crate) fn set_whole_limit(&mut self, limit: u64) {
        self.whole_limit = limit;
        self.whole_left = limit;
        self.set_limit(self.limit);
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
