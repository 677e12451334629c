//! Walks through the trees of a snapshot, entry by entry. Each entry is genuine, or the walk ends with the
//! error that says why.

use super::{Node, Snapshot};
use crate::arena::tree::{self, Entry, Key, Range};
use crate::arena::{Address, ReadError, record};
use crate::{LabelId, NodeId, TypeId};

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

/// Ids of nodes at the other ends of edges, with their exact types, one after another.
#[derive(Debug)]
pub struct TypedIds<'a>(Scan<'a>);

impl Iterator for TypedIds<'_> {
    type Item = Result<(NodeId, TypeId), ReadError>;

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        let entry = self.0.next()?;
        Some(entry.map(|(key, end)| (NodeId(key[1]), TypeId(record::other_type(end)))))
    }
}

impl<'a> Node<'a> {
    /// Where the edges of a label that start here end, by ascending id, with the nodes' exact types:
    /// reads no other node.
    pub fn typed_targets_of(&self, label: LabelId) -> TypedIds<'a> {
        TypedIds(self.adjacent(4, [label.0; 2]))
    }

    /// Where the edges of a label that end here start, by ascending id, with the nodes' exact types:
    /// reads no other node.
    pub fn typed_sources_of(&self, label: LabelId) -> TypedIds<'a> {
        TypedIds(self.adjacent(5, [label.0; 2]))
    }

    /// Whether an edge of the label leads from here to that node.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn has_target(&self, label: LabelId, to: NodeId) -> Result<bool, ReadError> {
        self.has_end(4, label, to)
    }

    /// Whether an edge of the label leads from that node to here.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn has_source(&self, label: LabelId, from: NodeId) -> Result<bool, ReadError> {
        self.has_end(5, label, from)
    }

    fn has_end(&self, tree: usize, label: LabelId, other: NodeId) -> Result<bool, ReadError> {
        let key = [u64::from(label.0), other.0];
        let found = tree::find(&self.snapshot.arena, self.word(tree)?, key);
        Ok(self.snapshot.genuine(found)?.is_some())
    }
}
