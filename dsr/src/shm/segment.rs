//! Memory of the arena as its readers use it: a row of atomic words, wherever it lies. It guarantees
//! that the words stay where they are for as long as the segment lives.
//!
//! Every read of the graph goes through here, so a segment is a pointer and a length, not an
//! object that has to be asked.

use crate::arena::Word;
use std::any::Any;
use std::fmt;
use std::sync::Arc;

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
