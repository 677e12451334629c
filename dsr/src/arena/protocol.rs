//! In which order the words that processes share are written and read. Everything here guarantees the
//! same: what a reader takes for genuine was written so, however writer and reader interleave and
//! in whatever order their processors show each other what they wrote.
//!
//! The functions take any word, so that a model checker can put its own in the place of [`Word`] and
//! drive the very code that runs (see the tests).

use super::Word;
use std::sync::atomic::{AtomicU32, Ordering, fence};

/// A word that several threads or processes touch at once.
pub(crate) trait Atomic {
    fn load(&self, order: Ordering) -> u64;
    fn store(&self, value: u64, order: Ordering);
    fn fence(order: Ordering);
    /// Lets another go on that is in the middle of writing.
    fn pause();
}

impl Atomic for Word {
    #[inline]
    fn load(&self, order: Ordering) -> u64 {
        self.0.load(order)
    }

    #[inline]
    fn store(&self, value: u64, order: Ordering) {
        self.put(value, order);
    }

    #[inline]
    fn fence(order: Ordering) {
        fence(order);
    }

    fn pause() {
        std::hint::spin_loop();
    }
}

/// A number that the kernel too can look at, so that who waits for it can sleep.
pub(crate) trait Counter {
    fn load(&self, order: Ordering) -> u32;
    fn increment(&self, order: Ordering);
}

impl Counter for AtomicU32 {
    fn load(&self, order: Ordering) -> u32 {
        self.load(order)
    }

    fn increment(&self, order: Ordering) {
        self.fetch_add(1, order);
    }
}

/// The roots of the newest versions, each of `N` words of which the first is its version.
#[derive(Debug)]
pub(super) struct Ring<'a, W, const N: usize> {
    /// The newest version.
    pub(super) head: &'a W,
    pub(super) roots: &'a [W],
}

impl<W: Atomic, const N: usize> Ring<'_, W, N> {
    fn slot(&self, version: u64) -> Option<&[W; N]> {
        let slots = (self.roots.len() / N).max(1);
        self.roots
            .get(version as usize % slots * N..)?
            .first_chunk()
    }

    /// The newest version.
    pub(super) fn head(&self) -> u64 {
        self.head.load(Ordering::Acquire)
    }

    /// How many versions back a root is kept for sure.
    fn kept(&self) -> u64 {
        // The slot is written over no sooner than when `head` is within one of the ring's turn.
        (self.roots.len() / N) as u64 - 1
    }

    /// The root of a version, and the newest version after it was read; whether it is kept, or was
    /// perhaps written over meanwhile, so that it may be anything.
    pub(super) fn read(&self, version: u64) -> Option<([u64; N], u64, bool)> {
        let slot = self.slot(version)?;
        let root = slot.each_ref().map(|word| word.load(Ordering::Relaxed));
        W::fence(Ordering::Acquire);
        let head = self.head();
        Some((root, head, head.wrapping_sub(version) < self.kept()))
    }

    /// Writes what is there where the root of `version` will be, which takes the words from other processors'
    /// caches before anybody waits for it.
    pub(super) fn prepare(&self, version: u64) {
        for word in self.slot(version).into_iter().flatten() {
            word.store(word.load(Ordering::Relaxed), Ordering::Relaxed);
        }
    }

    /// Makes `root` the newest version: one release store, before which nobody sees any of it.
    pub(super) fn publish(&self, root: [u64; N]) {
        let Some(slot) = self.slot(root[0]) else {
            return;
        };
        // Whoever sees any of this root in the slot sees that `head` has come near it.
        W::fence(Ordering::Release);
        for (to, from) in slot.iter().zip(root) {
            to.store(from, Ordering::Relaxed);
        }
        self.head.store(root[0], Ordering::Release);
    }
}

/// Takes a promise back: that versions from `oldest` on can be read, or that a lease holds. To be
/// called before any memory is written over that the promise kept.
pub(super) fn revoke<W: Atomic>(promise: &W, value: u64) {
    promise.store(value, Ordering::Relaxed);
    W::fence(Ordering::Release);
}

/// Whether a promise still stood when all that was read up to now was read, by what `word` says of
/// it.
#[inline]
pub(super) fn stands<W: Atomic>(promise: &W, holds: impl FnOnce(u64) -> bool) -> bool {
    W::fence(Ordering::Acquire);
    holds(promise.load(Ordering::Relaxed))
}

/// Leads from a cell to a node's newest record: once that is written, and before its version is published.
pub(super) fn lead<W: Atomic>(cell: &W, record: u64) {
    cell.store(record, Ordering::Release);
}

/// Where a cell leads.
#[inline]
pub(super) fn led<W: Atomic>(cell: &W) -> u64 {
    cell.load(Ordering::Acquire)
}

/// Whether the record that a cell leads to is node `id`'s in `version`, by what it says of whose it is and since
/// when; for as long as that version stands.
#[inline]
pub(super) fn is_record_of<W: Atomic>((whose, since): (&W, &W), id: u64, version: u64) -> bool {
    whose.load(Ordering::Relaxed) == id && since.load(Ordering::Relaxed) <= version
}

/// The store says whether it sleeps, before it looks for requests one last time.
pub(crate) fn set_asleep<W: Atomic>(asleep: &W, sleeps: bool) {
    asleep.store(u64::from(sleeps), Ordering::Relaxed);
    W::fence(Ordering::SeqCst);
}

/// Whether the store has to be woken for what was sent before this call: either this sees that it
/// sleeps, or its last look sees what was sent.
pub(super) fn is_asleep<W: Atomic>(asleep: &W) -> bool {
    W::fence(Ordering::SeqCst);
    asleep.load(Ordering::Relaxed) != 0
}

/// What a bell says now: to be asked before looking for news, so that it says something else where
/// there are some that the look did not see.
pub(crate) fn listen<C: Counter>(bell: &C) -> u32 {
    bell.load(Ordering::Acquire)
}

/// Says that there are news: after they can be seen, and before whoever sleeps is woken.
pub(crate) fn ring<C: Counter>(bell: &C) {
    bell.increment(Ordering::Release);
}

#[cfg(test)]
pub(crate) mod tests;
