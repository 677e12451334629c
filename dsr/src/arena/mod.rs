//! The memory that a graph lives in: an array of atomic words in segments, written by one process
//! and read in place by all. This file owns the header, the versions' roots and the rule by which
//! a reader knows that what it read is whole; the formats of what lies behind a root are in the
//! files beside it.
//!
//! Every structure behind a root is immutable once the root's version is published: a commit
//! writes new blocks along the paths that it changes and shares the rest. A block that no version
//! newer than `v` can reach is written over only after `oldest` was raised above `v`. So a reader
//! reads, then looks at `oldest`: if its version is not older, all that it read was genuine. The cells
//! alone change in place, see the file `cells`.

pub(crate) mod allocator;
pub(crate) mod cells;
#[cfg(test)]
pub(crate) mod journal;
pub(crate) mod late;
pub(crate) mod protocol;
pub(crate) mod record;
mod root;
mod sessions;
pub(crate) mod table;
pub(crate) mod tree;
pub(crate) mod trie;

use crate::desk::{SLOT_WORDS, SLOTS};
use crate::shm::{Segment, Segments};
use crate::{Epoch, Version};
use protocol::Ring;
pub(crate) use root::{ROOT_WORDS, Root};
use std::sync::atomic::{AtomicU64, Ordering};
use thiserror::Error;

/// A word of the arena.
#[derive(Debug, Default)]
#[repr(transparent)]
pub(crate) struct Word(AtomicU64);

impl Word {
    #[inline]
    pub(crate) fn load(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
    #[inline]
    fn put(&self, value: u64, order: Ordering) {
        #[cfg(test)]
        journal::note(self, value);
        self.0.store(value, order);
    }
    pub(crate) fn store(&self, value: u64) {
        self.put(value, Ordering::Relaxed);
    }
    #[inline]
    pub(crate) fn load_acquire(&self) -> u64 {
        self.0.load(Ordering::Acquire)
    }
    pub(crate) fn store_release(&self, value: u64) {
        self.put(value, Ordering::Release);
    }
}

/// Where a block lies: the index of its first word over all segments. 0 is nowhere.
pub(crate) type Address = u64;

/// Why a read of a snapshot gave nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum ReadError {
    /// The store has reused memory of this version: its history is bounded. Take a new snapshot.
    #[error("version {version} is too old: the oldest that can still be read is {oldest}")]
    SnapshotTooOld {
        /// The snapshot's version.
        version: Version,
        /// The oldest version that can still be read.
        oldest: Version,
    },
    /// The arena holds something that no store writes.
    #[error("the graph's memory is damaged at word {address}")]
    Damaged {
        /// Where.
        address: u64,
    },
}

pub(crate) const MAGIC: u64 = u64::from_le_bytes(*b"cortexG1");
pub(crate) const FORMAT: u64 = 9;

/// Header words of segment 0.
mod at {
    pub(super) const MAGIC: usize = 0;
    pub(super) const FORMAT: usize = 1;
    pub(super) const EPOCH: usize = 2;
    pub(super) const HEAD: usize = 3;
    pub(super) const OLDEST: usize = 4;
    pub(super) const SEGMENTS: usize = 5;
    pub(super) const BELL: usize = 6;
    pub(super) const FIRST: usize = 7;
    /// On another cache line than the head: who asks reads it, and shall not slow the next commit.
    pub(super) const ASLEEP: usize = 8;
    pub(super) const LEASES: usize = 16;
    pub(super) const SLOTS: usize = 64;
    pub(super) const ROOTS: usize = SLOTS + super::SLOTS * super::SLOT_WORDS;
    pub(super) const SESSIONS: usize = ROOTS + super::ROOT_RING as usize * super::ROOT_WORDS;
}

/// How many leases there may be at once.
pub(crate) const LEASES: usize = 32;
/// How many versions back a root can be looked up.
const ROOT_RING: u64 = 4096;
/// First word that blocks are given out from.
pub(crate) const FIRST_BLOCK: Address = (at::SESSIONS + sessions::COUNT) as u64;

/// How a reader knows that its lease holds: its place has its token.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LeaseMark {
    pub(crate) place: usize,
    /// Not 0, and never given twice.
    pub(crate) token: u64,
}

/// The arena as one process sees it.
#[derive(Debug)]
pub(crate) struct Arena {
    segments: Segments,
    /// log2 of the words in a segment.
    shift: u32,
}

impl Arena {
    /// An arena of up to `capacity` segments of `2^shift` words, none of them there yet.
    pub(crate) fn new(capacity: usize, shift: u32) -> Self {
        Self {
            segments: Segments::new(capacity, 1 << shift),
            shift,
        }
    }

    #[inline]
    pub(crate) fn segment_words(&self) -> usize {
        1 << self.shift
    }

    pub(crate) fn capacity(&self) -> usize {
        self.segments.capacity()
    }

    /// Segments that are there.
    pub(crate) fn attached(&self) -> usize {
        let there = (0..self.capacity()).take_while(|&index| self.segments.get(index).is_some());
        there.count()
    }

    /// Adds segment `index`; one that is there already stays.
    pub(crate) fn attach(&self, index: usize, segment: Segment) {
        self.segments.add(index, segment);
    }

    /// The words from `address` to the end of its segment.
    #[inline]
    pub(crate) fn from(&self, address: Address) -> Option<&[Word]> {
        let segment = self.segments.get((address >> self.shift) as usize)?;
        segment.get((address as usize) & (self.segment_words() - 1)..)
    }

    /// The `len` words at `address`.
    pub(crate) fn block(&self, address: Address, len: usize) -> Option<&[Word]> {
        self.from(address)?.get(..len)
    }

    #[inline]
    fn header(&self, index: usize) -> Option<&Word> {
        self.segments.get(0)?.get(index)
    }

    /// Writes the header of an empty arena; the writer's first act.
    pub(crate) fn format(&self, epoch: Epoch) {
        let put = |index, value| {
            if let Some(word) = self.header(index) {
                word.store(value);
            }
        };
        put(at::FORMAT, FORMAT);
        put(at::EPOCH, epoch.0);
        put(at::SEGMENTS, self.attached() as u64);
        put(at::FIRST, self.head());
        // Version 0, the empty graph, is the root of zeros that the ring holds already.
        if let Some(word) = self.header(at::MAGIC) {
            word.store_release(MAGIC);
        }
    }

    /// Whether segment 0 is an arena of this format, with its epoch.
    pub(crate) fn epoch(&self) -> Option<Epoch> {
        let right = self.header(at::MAGIC)?.load_acquire() == MAGIC
            && self.header(at::FORMAT)?.load() == FORMAT;
        right.then_some(Epoch(self.header(at::EPOCH)?.load()))
    }

    /// How many segments the writer has added.
    pub(crate) fn announced_segments(&self) -> u64 {
        self.header(at::SEGMENTS).map_or(0, Word::load_acquire)
    }

    pub(crate) fn announce_segments(&self, count: u64) {
        if let Some(word) = self.header(at::SEGMENTS) {
            word.store_release(count);
        }
    }

    /// The version that the store showed first: the last of the store before it, if it goes on with the
    /// graph of one.
    pub(crate) fn first_shown(&self) -> u64 {
        self.header(at::FIRST).map_or(0, Word::load)
    }

    /// The word that a process sleeps on until the store has answered or committed something.
    pub(crate) fn bell(&self) -> Option<&Word> {
        self.header(at::BELL)
    }

    /// The store says whether it sleeps, before it looks for requests one last time.
    pub(crate) fn set_asleep(&self, asleep: bool) {
        if let Some(word) = self.header(at::ASLEEP) {
            protocol::set_asleep(word, asleep);
        }
    }

    /// Whether the store has to be woken for a request that was sent before this call: either this
    /// sees that it sleeps, or its last look sees the request.
    pub(crate) fn is_asleep(&self) -> bool {
        self.header(at::ASLEEP).is_none_or(protocol::is_asleep)
    }

    /// The newest version.
    #[inline]
    pub(crate) fn head(&self) -> u64 {
        self.header(at::HEAD).map_or(0, Word::load_acquire)
    }

    /// The oldest version that can still be read.
    #[inline]
    pub(crate) fn oldest(&self) -> u64 {
        self.header(at::OLDEST).map_or(0, Word::load)
    }

    #[inline]
    fn ring(&self) -> Option<Ring<'_, Word, ROOT_WORDS>> {
        let header = self.from(0)?;
        Some(Ring {
            head: header.get(at::HEAD)?,
            roots: header.get(at::ROOTS..at::SESSIONS)?,
        })
    }

    /// The root of a version, the newest version after it was read, and whether the root is kept.
    fn read_root(&self, version: u64) -> Result<(Root, u64, bool), ReadError> {
        let read = self.ring().and_then(|ring| ring.read(version));
        let (words, head, kept) = read.ok_or(ReadError::Damaged { address: 0 })?;
        Ok((Root::from_words(words), head, kept))
    }

    /// Reads the newest version's root.
    pub(crate) fn newest_root(&self) -> Result<Root, ReadError> {
        loop {
            let version = self.head();
            let (root, _, kept) = self.read_root(version)?;
            if kept {
                if root.version != version {
                    return Err(ReadError::Damaged {
                        address: at::ROOTS as u64,
                    });
                }
                return Ok(root);
            }
        }
    }

    /// Reads the root of a version, as far back as it is kept.
    pub(crate) fn root_of(&self, version: u64) -> Result<Root, ReadError> {
        let (root, head, kept) = self.read_root(version)?;
        if root.version != version || !kept {
            let oldest = self.oldest_root(head);
            return Err(ReadError::SnapshotTooOld {
                version: Version(version),
                oldest: Version(oldest),
            });
        }
        self.check(version, None).map(|()| root)
    }

    /// The oldest version up to `newest` whose root is kept.
    pub(crate) fn oldest_root(&self, newest: u64) -> u64 {
        let turned = self.head().saturating_sub(ROOT_RING - 2);
        let first = self.oldest().max(turned).max(1);
        let kept = |version: u64| {
            let slot = (version % ROOT_RING) as usize * ROOT_WORDS;
            let slot = self.header(at::ROOTS + slot);
            slot.map(Word::load) == Some(version)
        };
        // The versions before a restored one were made in another arena.
        (first..newest)
            .find(|&version| kept(version))
            .unwrap_or(newest)
    }

    /// Makes `root` the newest version: one release store, before which nobody sees any of it.
    pub(crate) fn publish(&self, root: &Root) {
        if let Some(ring) = self.ring() {
            ring.publish(root.to_words());
        }
    }

    /// Brings the place of the next version's root into the processor's cache.
    pub(crate) fn prepare_root(&self, version: u64) {
        if let Some(ring) = self.ring() {
            ring.prepare(version);
        }
    }

    /// Declares versions before `oldest` unreadable, before their memory is written over.
    pub(crate) fn forget_before(&self, oldest: u64) {
        if let Some(word) = self.header(at::OLDEST) {
            protocol::revoke(word, oldest);
        }
    }

    /// Says in a place for leases which lease it is for, or, with 0, that there is none any more:
    /// before the memory that it kept is written over.
    pub(crate) fn set_lease(&self, place: usize, token: u64) {
        if place < LEASES
            && let Some(word) = self.header(at::LEASES + place)
        {
            protocol::revoke(word, token);
        }
    }

    /// The place for the answers to a session, where there is one of that number.
    #[inline]
    pub(crate) fn slot(&self, index: usize) -> Option<&[Word]> {
        let start = at::SLOTS + index * SLOT_WORDS;
        let there = index < SLOTS;
        self.from(0)?
            .get(start..start + SLOT_WORDS)
            .filter(|_| there)
    }

    #[cold]
    fn lease_holds(&self, mark: &LeaseMark) -> bool {
        let word = self.header(at::LEASES + mark.place);
        let holds = |word| protocol::stands(word, |token| token == mark.token);
        mark.place < LEASES && word.is_some_and(holds)
    }

    /// Whether all that was read of `version` up to now was genuine, where the reader may have a
    /// lease of it.
    #[inline]
    pub(crate) fn check(&self, version: u64, lease: Option<&LeaseMark>) -> Result<(), ReadError> {
        match self.overtaken(version, lease) {
            None => Ok(()),
            Some(oldest) => Err(ReadError::SnapshotTooOld {
                version: Version(version),
                oldest: Version(oldest),
            }),
        }
    }

    /// The error of a read that met something impossible at `address`: either the memory was
    /// reused under the reader, or it is damaged.
    #[inline]
    pub(crate) fn broken(
        &self,
        version: u64,
        lease: Option<&LeaseMark>,
        address: Address,
    ) -> ReadError {
        let checked = self.check(version, lease);
        checked.err().unwrap_or(ReadError::Damaged { address })
    }

    /// The oldest version that can be read, where `version` is older and no lease keeps it.
    ///
    /// What is out of the way gives no more than registers hold: who is given a place to write to
    /// keeps its own result there, too.
    #[inline]
    fn overtaken(&self, version: u64, lease: Option<&LeaseMark>) -> Option<u64> {
        let word = self.header(at::OLDEST)?;
        let mut oldest = 0;
        let stands = protocol::stands(word, |found| {
            oldest = found;
            version >= found
        });
        if stands || lease.is_some_and(|mark| self.lease_holds(mark)) {
            return None;
        }
        Some(oldest)
    }
}
