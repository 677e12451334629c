//! Memory of the arena as its readers use it: a row of atomic words, wherever it lies. It guarantees
//! that the words stay where they are for as long as the segment lives.
//!
//! Every read of the graph goes through here, so a segment is a pointer and a length, not an
//! object that has to be asked, and an arena's are found by one load.

use crate::arena::Word;
use std::any::Any;
use std::fmt;
use std::sync::atomic::{AtomicPtr, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// A part of the arena in one piece.
pub(crate) struct Segment {
    start: *const Word,
    len: usize,
    /// Owns the memory.
    _owner: Box<dyn Any + Send>,
}

impl Segment {
    /// Words of this process alone.
    pub(crate) fn on_heap(words: Arc<[Word]>) -> Self {
        Self {
            start: words.as_ptr(),
            len: words.len(),
            _owner: Box::new(words),
        }
    }

    /// So many words of 0, of this process alone. Those that nobody touches take no memory.
    pub(crate) fn of_zeros(len: usize) -> Self {
        let words = Arc::<[Word]>::new_zeroed_slice(len);
        // SAFETY: a word is an `AtomicU64` and nothing else, for which all bits 0 are a value.
        Self::on_heap(unsafe { words.assume_init() })
    }

    /// Words that `owner` keeps mapped.
    ///
    /// # Safety
    /// `start` points to `len` words that are initialised and only ever touched as atomics, until
    /// `owner` is dropped.
    pub(super) unsafe fn in_shared_memory(
        start: *const Word,
        len: usize,
        owner: Box<dyn Any + Send>,
    ) -> Self {
        Self {
            start,
            len,
            _owner: owner,
        }
    }

    /// The segment's words.
    #[inline]
    pub(crate) fn words(&self) -> &[Word] {
        // SAFETY: on the heap, `start` and `len` are those of the row that `_owner` holds, which is
        // neither moved nor written over while it does; in shared memory, whoever made the segment
        // promised the same.
        unsafe { std::slice::from_raw_parts(self.start, self.len) }
    }
}

// SAFETY: a segment is a range of atomics, which any thread may use at any time; its owner may be
// sent, and is only touched again to drop it.
unsafe impl Send for Segment {}
// SAFETY: shared, a segment gives nothing but shared atomics; nobody reaches its owner.
unsafe impl Sync for Segment {}

impl fmt::Debug for Segment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Segment")
            .field("words", &self.len)
            .finish_non_exhaustive()
    }
}

/// The segments of an arena, all of one size. One that was added stays for as long as they live.
pub(crate) struct Segments {
    /// Where each begins; null for one that is not there.
    starts: Box<[AtomicPtr<Word>]>,
    /// Words of each.
    words: usize,
    /// Keep the memory.
    owners: Mutex<Vec<Segment>>,
}

impl Segments {
    /// Room for `capacity` segments of `words` words.
    pub(crate) fn new(capacity: usize, words: usize) -> Self {
        Self {
            starts: (0..capacity).map(|_| AtomicPtr::default()).collect(),
            words,
            owners: Mutex::default(),
        }
    }

    /// How many there can be.
    pub(crate) fn capacity(&self) -> usize {
        self.starts.len()
    }

    /// Adds segment `index`. One that is there already stays; one that is too small is not added.
    pub(crate) fn add(&self, index: usize, segment: Segment) {
        let Some(start) = self.starts.get(index) else {
            return;
        };
        let mut owners = self.owners.lock().unwrap_or_else(PoisonError::into_inner);
        // Whoever adds one holds the lock.
        if start.load(Ordering::Relaxed).is_null() && segment.len >= self.words {
            start.store(segment.start.cast_mut(), Ordering::Release);
            owners.push(segment);
        }
    }

    /// The words of segment `index`, if it is there.
    #[inline]
    pub(crate) fn get(&self, index: usize) -> Option<&[Word]> {
        let start = self.starts.get(index)?.load(Ordering::Acquire);
        if start.is_null() {
            return None;
        }
        // SAFETY: `start` is where a segment in `owners` begins that has at least so many words. It
        // is never taken out, and what it promises holds until it is dropped with `self`.
        Some(unsafe { std::slice::from_raw_parts(start, self.words) })
    }
}

impl fmt::Debug for Segments {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let there = (0..self.capacity()).take_while(|&index| self.get(index).is_some());
        f.debug_struct("Segments")
            .field("words", &self.words)
            .field("there", &there.count())
            .finish_non_exhaustive()
    }
}
