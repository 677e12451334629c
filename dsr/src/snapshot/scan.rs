//! Walks through the trees of a snapshot, entry by entry. Each entry is genuine, or the walk ends with the
//! error that says why.

use super::{Node, Snapshot};
use crate::arena::record::{SOURCES, TARGETS};
use crate::arena::tree::{self, Entry, Key, Range};
use crate::arena::{Address, ReadError, Word, record};
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

impl Snapshot {
    /// Where edges of a label that start at a node end, with the nodes' exact types: of those from an id
    /// on, in ascending order, some that lie together, each given to `visit`. The id from which to go on,
    /// or `None` where there are no more. What is visited is known to be genuine only where this gives no
    /// error.
    ///
    /// # Errors
    /// [`ReadError`].
    #[inline]
    pub fn visit_targets(
        &self,
        node: NodeId,
        label: LabelId,
        from: NodeId,
        visit: impl FnMut(NodeId, TypeId),
    ) -> Result<Option<NodeId>, ReadError> {
        self.visit_ends(TARGETS, node, label, from, visit)
    }

    /// As [`Self::visit_targets`], where edges start that end at the node.
    ///
    /// # Errors
    /// [`ReadError`].
    #[inline]
    pub fn visit_sources(
        &self,
        node: NodeId,
        label: LabelId,
        from: NodeId,
        visit: impl FnMut(NodeId, TypeId),
    ) -> Result<Option<NodeId>, ReadError> {
        self.visit_ends(SOURCES, node, label, from, visit)
    }

    #[inline]
    fn visit_ends(
        &self,
        tree: usize,
        node: NodeId,
        label: LabelId,
        from: NodeId,
        mut visit: impl FnMut(NodeId, TypeId),
    ) -> Result<Option<NodeId>, ReadError> {
        let label = u64::from(label.0);
        let root = self.tree_of(node, tree);
        let leaf = root.and_then(|root| tree::leaf(&self.arena, root, [label, from.0]));
        let (entries, next) = match leaf {
            Ok(leaf) => leaf,
            Err(address) => return Err(self.broken(address)),
        };
        let mut more = next;
        for [key, id, end] in entries {
            if key.load() != label {
                more = None;
                break;
            }
            visit(NodeId(id.load()), TypeId(record::other_type(end.load())));
        }
        self.check()?;
        // Only upwards, so that a walk ends in damaged memory, too.
        let more = more.filter(|next| next[0] == label && next[1] > from.0);
        Ok(more.map(|next| NodeId(next[1])))
    }

    /// Whether the edge is there, by what is known where it starts.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn has_edge(&self, key: EdgeKey) -> Result<bool, ReadError> {
        self.has_end(TARGETS, key.from, key.label, key.to)
    }

    /// Whether the edge is there, by what is known where it ends.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn has_edge_into(&self, key: EdgeKey) -> Result<bool, ReadError> {
        self.has_end(SOURCES, key.to, key.label, key.from)
    }

    #[inline]
    fn has_end(
        &self,
        tree: usize,
        node: NodeId,
        label: LabelId,
        other: NodeId,
    ) -> Result<bool, ReadError> {
        let key = [u64::from(label.0), other.0];
        let root = self.tree_of(node, tree);
        let found = root.and_then(|root| tree::find(&self.arena, root, key));
        Ok(self.genuine(found)?.is_some())
    }

    /// A node's tree of edges, empty where there is no such node; not yet known to be genuine.
    #[inline]
    fn tree_of(&self, node: NodeId, tree: usize) -> Result<Address, Address> {
        match self.record(node)? {
            Some((address, words)) => words.get(tree).map(Word::load).ok_or(address),
            None => Ok(0),
        }
    }
}
