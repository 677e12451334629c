//! Walks through the trees of a snapshot, entry by entry. Each entry is genuine, or the walk ends with the
//! error that says why.

use super::{Node, Snapshot};
use crate::arena::record::{SOURCES, TARGETS};
use crate::arena::tree::{Entry, Key, Range};
use crate::arena::{Address, ReadError, record};
use crate::{EdgeKey, LabelId, NodeId, TypeId};

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

impl Scan<'_> {
    /// Gives what is left of the leaf at hand to `visit`, and goes on to the next; whether there is one.
    fn visit_leaf(&mut self, mut visit: impl FnMut(Key, u64)) -> Result<bool, ReadError> {
        while let Some((key, word)) = self.range.as_mut().and_then(Range::next_in_leaf) {
            visit(key, word);
        }
        self.snapshot.check()?;
        let more = self.next_leaf();
        self.error.take().map_or(Ok(more), Err)
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

impl NodeIds<'_> {
    /// Gives those that lie together next, each to `visit`; whether there may be more. What is visited is
    /// known to be genuine only where this gives no error.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn visit_some(&mut self, mut visit: impl FnMut(NodeId)) -> Result<bool, ReadError> {
        let word = self.word;
        self.scan.visit_leaf(|key, _| visit(NodeId(key[word])))
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

/// Edges of a label, with the exact types of source and target, one after another.
#[derive(Debug)]
pub struct TypedEdges<'a> {
    scan: Scan<'a>,
    label: LabelId,
}

impl<'a> TypedEdges<'a> {
    pub(super) fn new(scan: Scan<'a>, label: LabelId) -> Self {
        Self { scan, label }
    }
}

impl TypedEdges<'_> {
    /// Gives those that lie together next, each to `visit`; whether there may be more. What is visited is
    /// known to be genuine only where this gives no error.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn visit_some(
        &mut self,
        mut visit: impl FnMut(EdgeKey, [TypeId; 2]),
    ) -> Result<bool, ReadError> {
        let label = self.label;
        self.scan.visit_leaf(|[from, to], ends| {
            let (from, to) = (NodeId(from), NodeId(to));
            visit(
                EdgeKey { from, label, to },
                record::types_of(ends).map(TypeId),
            );
        })
    }
}

impl Iterator for TypedEdges<'_> {
    type Item = Result<(EdgeKey, [TypeId; 2]), ReadError>;

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        let ([from, to], ends) = match self.scan.next()? {
            Ok(entry) => entry,
            Err(error) => return Some(Err(error)),
        };
        let key = EdgeKey {
            from: NodeId(from),
            label: self.label,
            to: NodeId(to),
        };
        Some(Ok((key, record::types_of(ends).map(TypeId))))
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
        TypedIds(self.adjacent(TARGETS, [label.0; 2]))
    }

    /// Where the edges of a label that end here start, by ascending id, with the nodes' exact types:
    /// reads no other node.
    pub fn typed_sources_of(&self, label: LabelId) -> TypedIds<'a> {
        TypedIds(self.adjacent(SOURCES, [label.0; 2]))
    }
}
