//! Walks through the trees of a snapshot, entry by entry. Each entry is genuine, or the walk ends with the
//! error that says why.

use super::Snapshot;
use crate::NodeId;
use crate::arena::tree::{Entry, Key, Range};
use crate::arena::{Address, ReadError};

/// Walks a part of a tree.
#[derive(Debug)]
pub(super) struct Scan<'a> {
    snapshot: &'a Snapshot,
    /// Where the walk is; `None` at its end.
    range: Option<Range<'a>>,
    /// Why it could not begin.
    error: Option<ReadError>,
}

impl Snapshot {
    pub(super) fn scan(&self, root: Result<Address, ReadError>, from: Key, to: Key) -> Scan<'_> {
        let range = root.and_then(|root| {
            let range = Range::new(&self.arena, root, from, to);
            self.genuine(range)
        });
        let (range, error) = match range {
            Ok(range) => (Some(range), None),
            Err(error) => (None, Some(error)),
        };
        Scan {
            snapshot: self,
            range,
            error,
        }
    }
}

impl Scan<'_> {
    /// Goes on to the next leaf, and tells whether there is one.
    #[cold]
    fn next_leaf(&mut self) -> bool {
        let Some(range) = &mut self.range else {
            return false;
        };
        let next = range.next_leaf();
        match self.snapshot.genuine(next) {
            Ok(true) => return true,
            Ok(false) => {}
            Err(error) => self.error = Some(error),
        }
        self.range = None;
        false
    }
}

impl Iterator for Scan<'_> {
    type Item = Result<Entry, ReadError>;

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(entry) = self.range.as_mut().and_then(Range::next_in_leaf) {
                return match self.snapshot.check() {
                    Ok(()) => Some(Ok(entry)),
                    Err(error) => {
                        self.range = None;
                        Some(Err(error))
                    }
                };
            }
            if !self.next_leaf() {
                return self.error.take().map(Err);
            }
        }
    }
}

/// Ids of nodes, one after another.
#[derive(Debug)]
pub struct NodeIds<'a> {
    scan: Scan<'a>,
    /// Which word of the keys is the id.
    word: usize,
}

impl<'a> NodeIds<'a> {
    pub(super) fn new(scan: Scan<'a>, word: usize) -> Self {
        Self { scan, word }
    }
}

impl Iterator for NodeIds<'_> {
    type Item = Result<NodeId, ReadError>;

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        let entry = self.scan.next()?;
        Some(entry.map(|(key, _)| NodeId(key[self.word])))
    }
}
