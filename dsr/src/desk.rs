//! Requests without a message: each session has a *desk*, a page of its own that only it writes, and
//! lays one small request at a time on it; the store looks at all desks, and writes the answer into a
//! *slot* of its own memory. This file owns the layout of both and the protocol. It guarantees that the
//! store takes only requests that were laid down whole and for it, that a session takes only the answer
//! to its last request, and that whoever sleeps is woken; it knows no process.
//!
//! Desk, in words: 0 magic (0 once it is closed), 1 client, 2 process, 3 bytes of the agent's name, 8 to 39
//! that name; from 40 on the request: 0 twice its sequence, odd while it is written, 1 whether the owner sleeps,
//! 2 the epoch that it is for, 3 its length in bytes, from 4 on the bytes.
//! Slot, in words: 0 client, 1 twice the sequence that it answers, plus 1 where the answer is to be had by
//! request, 2 its length in bytes, from 3 on the bytes. Bytes lie eight to a word, lowest first.

use crate::Epoch;
use crate::arena::protocol::Atomic;
use crate::arena::record::pack;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release, SeqCst};

const MAGIC: u64 = u64::from_le_bytes(*b"cortexD1");
/// Words of a desk.
pub(crate) const DESK_WORDS: usize = 512;
/// Words of a slot.
pub(crate) const SLOT_WORDS: usize = 16;
/// Bytes of an answer that a slot has room for.
pub(crate) const ANSWER_BYTES: usize = (SLOT_WORDS - slot::BYTES) * 8;
/// How many slots there are.
pub(crate) const SLOTS: usize = 64;
/// Where the request begins, on a cache line of its own: a short one fills no second.
const REQUEST: usize = 40;

mod at {
    pub(super) const CLIENT: usize = 1;
    pub(super) const PROCESS: usize = 2;
    pub(super) const NAME_LENGTH: usize = 3;
    pub(super) const NAME: usize = 8;
}

mod request {
    pub(super) const STATE: usize = 0;
    pub(super) const ASLEEP: usize = 1;
    pub(super) const EPOCH: usize = 2;
    pub(super) const LENGTH: usize = 3;
    pub(super) const BYTES: usize = 4;
}

mod slot {
    pub(super) const CLIENT: usize = 0;
    pub(super) const STATE: usize = 1;
    pub(super) const LENGTH: usize = 2;
    pub(super) const BYTES: usize = 3;
}

/// Whose a desk is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Owner {
    pub(crate) client: u64,
    pub(crate) process: u32,
    pub(crate) agent: String,
}

/// What the store answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Answered {
    /// The bytes are in the buffer.
    Here,
    /// Whoever asks again by a request hears it.
    ByRequest,
}

/// Whether the bytes had room.
fn put<A: Atomic>(words: &[A], bytes: &[u8]) -> bool {
    let fits = bytes.len() <= words.len() * 8;
    if fits {
        for (word, eight) in words.iter().zip(pack(bytes)) {
            word.store(eight, Relaxed);
        }
    }
    fits
}

/// Copies so many bytes into the buffer, where there are so many.
fn get<A: Atomic>(words: &[A], length: u64, bytes: &mut Vec<u8>) -> bool {
    bytes.clear();
    let fits = length <= words.len() as u64 * 8;
    if fits {
        let words = &words[..(length as usize).div_ceil(8)];
        bytes.resize(words.len() * 8, 0);
        let (eights, _) = bytes.as_chunks_mut();
        for (eight, word) in eights.iter_mut().zip(words) {
            *eight = word.load(Relaxed).to_le_bytes();
        }
        bytes.truncate(length as usize);
    }
    fits
}

/// Makes a page of zeros the desk of that owner; false where its name is too long. The owner's first
/// act.
pub(crate) fn format<A: Atomic>(desk: &[A], owner: &Owner) -> bool {
    let fits = desk.len() >= DESK_WORDS && put(&desk[at::NAME..REQUEST], owner.agent.as_bytes());
    if fits {
        desk[at::CLIENT].store(owner.client, Relaxed);
        desk[at::PROCESS].store(u64::from(owner.process), Relaxed);
        desk[at::NAME_LENGTH].store(owner.agent.len() as u64, Relaxed);
        desk[0].store(MAGIC, Release);
    }
    fits
}

/// Whose desk it is, where it is one and open.
pub(crate) fn owner_of<A: Atomic>(desk: &[A]) -> Option<Owner> {
    if desk.len() < DESK_WORDS || !is_open(desk) {
        return None;
    }
    let mut name = Vec::new();
    let length = desk[at::NAME_LENGTH].load(Relaxed);
    get(&desk[at::NAME..REQUEST], length, &mut name).then_some(())?;
    Some(Owner {
        client: desk[at::CLIENT].load(Relaxed),
        process: u32::try_from(desk[at::PROCESS].load(Relaxed)).ok()?,
        agent: String::from_utf8(name).ok()?,
    })
}

/// Says that nothing more will come from the desk. Its owner's last act.
pub(crate) fn close<A: Atomic>(desk: &[A]) {
    if let Some(magic) = desk.first() {
        magic.store(0, Release);
    }
}

/// Whether something may still come from the desk.
pub(crate) fn is_open<A: Atomic>(desk: &[A]) -> bool {
    desk.first()
        .is_some_and(|magic| magic.load(Acquire) == MAGIC)
}

/// The part of a desk that holds the request.
pub(crate) fn request_of<A: Atomic>(desk: &[A]) -> &[A] {
    desk.get(REQUEST..).unwrap_or(&[])
}

/// Lays a request down, for the store of that epoch; false where it is too long. For the owner alone.
pub(crate) fn lay<A: Atomic>(request: &[A], sequence: u64, epoch: Epoch, bytes: &[u8]) -> bool {
    if request.len() < request::BYTES || bytes.len() > (request.len() - request::BYTES) * 8 {
        return false;
    }
    // Who sees any of what follows sees that the state is odd.
    request[request::STATE].store(sequence << 1 | 1, Relaxed);
    A::fence(Release);
    request[request::EPOCH].store(epoch.0, Relaxed);
    request[request::LENGTH].store(bytes.len() as u64, Relaxed);
    put(&request[request::BYTES..], bytes);
    request[request::STATE].store(sequence << 1, Release);
    // Before its owner looks whether the store sleeps.
    A::fence(SeqCst);
    true
}

/// Says whether the owner sleeps, before it looks for the answer one last time. For the owner alone.
pub(crate) fn set_asleep<A: Atomic>(request: &[A], asleep: bool) {
    if let Some(word) = request.get(request::ASLEEP) {
        word.store(u64::from(asleep), Relaxed);
    }
    A::fence(SeqCst);
}

/// Whether the owner has to be woken for an answer that was given before this call: either this sees
/// that it sleeps, or its last look sees the answer.
pub(crate) fn is_asleep<A: Atomic>(request: &[A]) -> bool {
    A::fence(SeqCst);
    request
        .get(request::ASLEEP)
        .is_some_and(|word| word.load(Relaxed) != 0)
}

/// What tells a request from those before it.
#[inline]
pub(crate) fn state<A: Atomic>(request: &[A]) -> u64 {
    request
        .get(request::STATE)
        .map_or(0, |word| word.load(Acquire))
}

/// Takes the request that `state` told of: its sequence, and its bytes into the buffer. `None` where
/// it is not whole, or is not for the store of that epoch. A request is there to be taken as often as
/// one likes.
pub(crate) fn take<A: Atomic>(
    request: &[A],
    state: u64,
    epoch: Epoch,
    bytes: &mut Vec<u8>,
) -> Option<u64> {
    if state == 0 || state & 1 == 1 || request.len() < request::BYTES {
        return None;
    }
    let of = request[request::EPOCH].load(Relaxed);
    let length = request[request::LENGTH].load(Relaxed);
    let fits = get(&request[request::BYTES..], length, bytes);
    A::fence(Acquire);
    let whole = request[request::STATE].load(Relaxed) == state;
    (whole && fits && of == epoch.0).then_some(state >> 1)
}

/// Gives a slot to a client. For the store alone.
pub(crate) fn assign<A: Atomic>(slot: &[A], client: u64) {
    if slot.len() >= SLOT_WORDS {
        slot[slot::CLIENT].store(0, Relaxed);
        slot[slot::STATE].store(0, Relaxed);
        slot[slot::CLIENT].store(client, Release);
    }
}

/// Whether the slot is that client's.
pub(crate) fn is_of<A: Atomic>(slot: &[A], client: u64) -> bool {
    slot.get(slot::CLIENT)
        .is_some_and(|word| word.load(Acquire) == client)
}

/// Answers a request, with those bytes where they have room. For the store alone.
pub(crate) fn answer<A: Atomic>(slot: &[A], sequence: u64, bytes: Option<&[u8]>) {
    if slot.len() <= slot::BYTES {
        return;
    }
    let here = bytes.is_some_and(|bytes| put(&slot[slot::BYTES..], bytes));
    let length = bytes.map_or(0, |bytes| bytes.len() as u64);
    slot[slot::LENGTH].store(length, Relaxed);
    slot[slot::STATE].store(sequence << 1 | u64::from(!here), Release);
}

/// The answer to a request, its bytes into the buffer.
#[inline]
pub(crate) fn answered<A: Atomic>(
    slot: &[A],
    sequence: u64,
    bytes: &mut Vec<u8>,
) -> Option<Answered> {
    let state = slot.get(slot::STATE)?.load(Acquire);
    if state >> 1 != sequence {
        return None;
    }
    let length = slot.get(slot::LENGTH)?.load(Relaxed);
    let here = state & 1 == 0 && get(slot.get(slot::BYTES..)?, length, bytes);
    Some(if here {
        Answered::Here
    } else {
        Answered::ByRequest
    })
}

#[cfg(test)]
mod tests;
