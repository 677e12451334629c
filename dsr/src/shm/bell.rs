//! Waiting for the store without asking it: the store counts up a word of the arena whenever it has
//! answered or committed something, and processes that have nothing to do sleep on that word. It
//! guarantees that who looked at the bell before it looked for news misses none.
//!
//! A sleeper writes nothing, its mapping is read-only; the kernel alone knows of it.

use crate::arena::{Arena, Word, protocol};
use rustix::io::Errno;
use rustix::thread::futex::{Flags, Timespec, wait, wake};
use std::sync::atomic::AtomicU32;
use std::time::Duration;

/// What the kernel calls everybody.
const EVERYBODY: u32 = i32::MAX as u32;

/// The half of the bell's word that is counted: the kernel waits on 32 bits.
fn half(word: &Word) -> &AtomicU32 {
    let start = std::ptr::from_ref(word).cast::<AtomicU32>();
    // SAFETY: a word is 8 bytes of atomic memory, aligned to 8; its first 4 are as good as an
    // `AtomicU32` for as long as the word lives. No code touches the bell's word in another width.
    unsafe { &*start }
}

/// What the bell says now: to be asked before looking for news.
pub(super) fn listen(arena: &Arena) -> u32 {
    arena.bell().map_or(0, |word| protocol::listen(half(word)))
}

/// Sleeps until the bell says something else than `heard`, for `patience` at the most. It may wake
/// for nothing.
pub(super) fn sleep(arena: &Arena, heard: u32, patience: Duration) {
    let Some(word) = arena.bell() else { return };
    let Ok(patience) = Timespec::try_from(patience) else {
        return;
    };
    match wait(half(word), Flags::empty(), heard, Some(&patience)) {
        // Woken, or there were news before it slept, or a signal came: the caller looks.
        Ok(()) | Err(Errno::AGAIN | Errno::INTR | Errno::TIMEDOUT) => {}
        Err(error) => tracing::warn!("waiting for the store: {error}"),
    }
}

/// The store has news.
pub(super) fn ring(arena: &Arena) {
    let Some(word) = arena.bell() else { return };
    protocol::ring(half(word));
    if let Err(error) = wake(half(word), Flags::empty(), EVERYBODY) {
        tracing::warn!("waking the agents: {error}");
    }
}
