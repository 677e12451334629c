//! The edges at a node, found by its id alone and read in place. What is told of them is genuine, or comes
//! with the error that says why not.

use super::Snapshot;
use crate::arena::record::{SOURCES, TARGETS};
use crate::arena::{Address, ReadError, Word, record, tree};
use crate::{EdgeKey, LabelId, NodeId, TypeId};

/// The edges that start at a node, or those that end at it.
///
/// Finding where they lie and reading them are two steps, so that who has many nodes to look at can
/// find all of them first: the processor then waits for their memory at once, not one after the other.
#[derive(Debug, Clone, Copy)]
pub struct Adjacency<'a> {
    snapshot: &'a Snapshot,
    /// Not yet known to be genuine.
    tree: Address,
}

impl Snapshot {
    /// The edges that start at a node; none where there is no such node.
    ///
    /// # Errors
    /// [`ReadError`].
    #[inline]
    pub fn edges_from(&self, node: NodeId) -> Result<Adjacency<'_>, ReadError> {
        self.adjacency(TARGETS, node)
    }

    /// The edges that end at a node; none where there is no such node.
    ///
    /// # Errors
    /// [`ReadError`].
    #[inline]
    pub fn edges_into(&self, node: NodeId) -> Result<Adjacency<'_>, ReadError> {
        self.adjacency(SOURCES, node)
    }

    #[allow(
        clippy::inline_always,
        reason = "handing the result over in memory takes as long as finding it"
    )]
    #[inline(always)]
    fn adjacency(&self, tree: usize, node: NodeId) -> Result<Adjacency<'_>, ReadError> {
        let found = match self.record(node) {
            Ok(Some((address, words))) => words.get(tree).map(Word::load).ok_or(address),
            Ok(None) => Ok(0),
            Err(address) => Err(address),
        };
        match found {
            Ok(tree) => Ok(Adjacency {
                snapshot: self,
                tree,
            }),
            Err(address) => Err(self.broken(address)),
        }
    }

    /// Whether the edge is there, by what is known where it starts.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn has_edge(&self, key: EdgeKey) -> Result<bool, ReadError> {
        self.edges_from(key.from)?.has(key.label, key.to)
    }

    /// Whether the edge is there, by what is known where it ends.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn has_edge_into(&self, key: EdgeKey) -> Result<bool, ReadError> {
        self.edges_into(key.to)?.has(key.label, key.from)
    }
}

impl Adjacency<'_> {
    /// Brings the first of them near the processor, before they are asked for. Says nothing and
    /// guarantees nothing.
    #[inline]
    pub fn fetch(&self) {
        let first = self.snapshot.arena.from(self.tree).and_then(<[_]>::first);
        std::hint::black_box(first.map_or(0, Word::load));
    }

    /// The nodes at their other ends under a label, with their exact types: of those from an id
    /// on, in ascending order, some that lie together, each given to `visit`. The id from which to go on,
    /// or `None` where there are no more. What is visited is known to be genuine only where this gives no
    /// error.
    ///
    /// # Errors
    /// [`ReadError`].
    #[inline]
    pub fn visit(
        &self,
        label: LabelId,
        from: NodeId,
        mut visit: impl FnMut(NodeId, TypeId),
    ) -> Result<Option<NodeId>, ReadError> {
        let Self { snapshot, tree } = *self;
        let label = u64::from(label.0);
        let (entries, next) = match tree::leaf(&snapshot.arena, tree, [label, from.0]) {
            Ok(leaf) => leaf,
            Err(address) => return Err(snapshot.broken(address)),
        };
        let mut more = next;
        for [key, id, end] in entries {
            if key.load() != label {
                more = None;
                break;
            }
            visit(NodeId(id.load()), TypeId(record::other_type(end.load())));
        }
        snapshot.check()?;
        // Only upwards, so that a walk ends in damaged memory, too.
        let more = more.filter(|next| next[0] == label && next[1] > from.0);
        Ok(more.map(|next| NodeId(next[1])))
    }

    /// Whether one of a label leads to or comes from that node.
    ///
    /// # Errors
    /// [`ReadError`].
    #[inline]
    pub fn has(&self, label: LabelId, other: NodeId) -> Result<bool, ReadError> {
        let key = [u64::from(label.0), other.0];
        let found = tree::find(&self.snapshot.arena, self.tree, key);
        Ok(self.snapshot.genuine(found)?.is_some())
    }
}
