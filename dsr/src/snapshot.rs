//! Reading the graph as of one commit, in place. A snapshot copies nothing and holds nothing up;
//! everything it gives is genuine: where the store has reused the version's memory meanwhile, the
//! read says [`ReadError::SnapshotTooOld`] and never gives foreign or half-written data.

mod adjacency;
mod element;
mod geometry;
mod past;
mod petgraph;
mod scan;

pub use adjacency::Adjacency;
pub use element::{Attribute, Edge, Element, Node};
pub use geometry::TransformError;
pub use petgraph::{Edges, Neighbors};
pub use scan::{NodeIds, TypedEdges, TypedIds};

use crate::arena::record;
use crate::arena::tree::{self, Key};
use crate::arena::{Address, Arena, LeaseMark, ReadError, Root, Word, cells, late};
use crate::hot::Hot;
use crate::shm::Segment;
use crate::value::{hash, place};
use crate::{
    AttributeId, EdgeKey, Epoch, LabelId, NodeId, Schema, Time, TypeId, Value, Version, WriterId,
};
use std::sync::{Arc, OnceLock};

/// The graph as of one commit.
///
/// Cheap to clone and to hold; see [`ReadError::SnapshotTooOld`] for how long it can be read.
///
/// It has petgraph's traits, so that petgraph's algorithms run on it in place. They have no place for
/// errors: ask [`Self::check`] afterwards.
///
/// ```
/// use dsr::{Edge, EdgeRef, Graph, Operation, Schema, Time, Transaction};
/// use petgraph::{algo::dijkstra, visit::EdgeFiltered};
///
/// let mut transaction = Transaction::new();
/// for room in ["hall", "kitchen", "bedroom"] {
///     transaction.create_node("room", room, vec![]);
/// }
/// for (from, to, metres) in [("hall", "kitchen", 4.0), ("kitchen", "bedroom", 3.5)] {
///     let edge = EdgeRef::new(from, "connected", to);
///     let attributes = vec![("distance".into(), metres.into())];
///     transaction.push(Operation::CreateEdge { edge, attributes });
/// }
/// let mut graph = Graph::in_memory(Schema::open());
/// graph.commit(&transaction, "me", Time::default())?;
///
/// let snapshot = graph.snapshot();
/// let hall = snapshot.find_node_by_name("hall")?.unwrap().id();
/// let bedroom = snapshot.find_node_by_name("bedroom")?.unwrap().id();
/// let connected = snapshot.schema().label_id("connected")?;
/// let doors = EdgeFiltered::from_fn(&snapshot, |edge: Edge<'_>| edge.key().label == connected);
/// let metres = |edge: Edge<'_>| match edge.value("distance") {
///     Ok(Some(value)) => value.as_f64().unwrap_or(f64::INFINITY),
///     _ => f64::INFINITY,
/// };
/// let distances = dijkstra(&doors, hall, Some(bedroom), metres);
/// snapshot.check()?;
/// assert_eq!(distances[&bedroom], 7.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Snapshot {
    pub(crate) arena: Arc<Arena>,
    pub(crate) root: Root,
    pub(crate) schema: Arc<Schema>,
    /// The nodes in order of their ids, once somebody counts them.
    index: OnceLock<Arc<[NodeId]>>,
    /// What owners give out beside the graph.
    hot: Option<Hot>,
    /// By what it is read although it may be older than the history.
    lease: Option<LeaseMark>,
}

/// Which values of an attribute to look for in its index.
#[derive(Debug, Clone, PartialEq)]
pub enum ValueRange {
    /// This one.
    Equal(Value),
    /// Numbers from the first to the second, both included.
    Between(f64, f64),
}

/// How many edges of a label join nodes of two types.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TripleCount {
    /// The exact type of the sources.
    pub from: TypeId,
    /// The exact type of the targets.
    pub to: TypeId,
    /// How many.
    pub count: u64,
}

impl Snapshot {
    pub(crate) fn new(arena: Arc<Arena>, root: Root, schema: Arc<Schema>) -> Self {
        Self {
            arena,
            root,
            schema,
            index: OnceLock::new(),
            hot: None,
            lease: None,
        }
    }

    /// The newest version that the words of an arena of one segment hold, whoever wrote them. No
    /// words make a read of it panic or go on for ever.
    ///
    /// # Errors
    /// [`ReadError::Damaged`] where they hold none.
    pub fn of_words(words: &[u64]) -> Result<Self, ReadError> {
        let shift = words.len().next_power_of_two().ilog2();
        let arena = Arena::new(1, shift);
        let mut segment: Vec<Word> = Vec::with_capacity(1 << shift);
        for index in 0..1 << shift {
            let word = Word::default();
            word.store(words.get(index).copied().unwrap_or(0));
            segment.push(word);
        }
        arena.attach(0, Segment::on_heap(segment.into()));
        Self::of_arena(Arc::new(arena))
    }

    /// The newest version in an arena, whoever wrote it.
    pub(crate) fn of_arena(arena: Arc<Arena>) -> Result<Self, ReadError> {
        arena.epoch().ok_or(ReadError::Damaged { address: 0 })?;
        let root = arena.newest_root()?;
        let damaged = ReadError::Damaged {
            address: root.schema,
        };
        let bytes = record::read_blob(&arena, root.schema).map_err(|_| damaged)?;
        let schema: Schema = postcard::from_bytes(&bytes).map_err(|_| damaged)?;
        Ok(Self::new(arena, root, Arc::new(schema)))
    }

    /// The snapshot with what owners give out beside the graph.
    pub(crate) fn with_hot(mut self, hot: Option<Hot>) -> Self {
        self.hot = hot;
        self
    }

    /// The life of the store that it is of.
    pub fn epoch(&self) -> Epoch {
        self.arena.epoch().unwrap_or(Epoch(0))
    }

    /// The same version without hot values: every attribute is as it was committed, however often
    /// it is read.
    #[must_use]
    pub fn committed(&self) -> Self {
        self.clone().with_hot(None)
    }

    /// The same version, read by a lease.
    pub(crate) fn leased(&self, mark: LeaseMark) -> Self {
        let mut leased = self.clone();
        leased.lease = Some(mark);
        leased
    }

    /// The version that this is the state of.
    pub fn version(&self) -> Version {
        Version(self.root.version)
    }

    /// Whether this store has committed nothing since: one load from the shared memory, for who looks again and
    /// again. Of a store that was restarted only [`Session::snapshot`](crate::Session::snapshot) knows.
    #[inline]
    pub fn is_newest(&self) -> bool {
        self.arena.head() <= self.root.version
    }

    /// When that version was committed.
    pub fn time(&self) -> Time {
        self.root.time()
    }

    /// The names in use.
    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// The names in use, for who keeps them: versions whose names are the same share them.
    pub fn shared_schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    /// How many nodes there are.
    pub fn node_count(&self) -> u64 {
        self.root.node_count
    }

    /// How many edges there are.
    pub fn edge_count(&self) -> u64 {
        self.root.edge_count
    }

    /// Whether everything read so far was genuine, and reading can go on.
    ///
    /// # Errors
    /// [`ReadError::SnapshotTooOld`].
    #[inline]
    pub fn check(&self) -> Result<(), ReadError> {
        self.arena.check(self.root.version, self.lease.as_ref())
    }

    /// Turns the outcome of a walk through the arena into what the caller may see.
    #[inline]
    pub(crate) fn genuine<T>(&self, outcome: Result<T, Address>) -> Result<T, ReadError> {
        match outcome {
            Ok(found) => self.check().map(|()| found),
            Err(address) => Err(self.broken(address)),
        }
    }

    #[inline]
    pub(in crate::snapshot) fn broken(&self, address: Address) -> ReadError {
        let lease = self.lease.as_ref();
        self.arena.broken(self.root.version, lease, address)
    }

    /// The node whose record begins with `words`; not yet known to be genuine.
    #[inline]
    fn node_at<'a>(&'a self, address: Address, words: &'a [Word]) -> Result<Node<'a>, Address> {
        let header = words.first_chunk::<{ record::NODE_HEADER }>();
        let [id, kind, ..] = header.ok_or(address)?;
        let (id, type_id) = (NodeId(id.load()), TypeId(kind.load() as u16));
        Ok(Node::at(self, address, words, id, type_id))
    }

    /// Where a node's record is, and the words from its first on; not yet known to be genuine.
    #[inline]
    fn record(&self, id: NodeId) -> Result<Option<(Address, &[Word])>, Address> {
        match cells::find(&self.arena, &self.root, id.0) {
            Some(found) => Ok(Some(found)),
            None => self.record_in_trie(id),
        }
    }

    #[inline(never)]
    fn record_in_trie(&self, id: NodeId) -> Result<Option<(Address, &[Word])>, Address> {
        let found = late::find(&self.arena, &self.root, id.0)?;
        Ok(found.map(|address| (address, self.arena.from(address).unwrap_or(&[]))))
    }

    /// The node of that id, if it is there.
    ///
    /// # Errors
    /// [`ReadError`], as for every read of a snapshot.
    #[allow(
        clippy::inline_always,
        reason = "handing the result over in memory takes as long as finding it"
    )]
    #[inline(always)]
    pub fn find_node(&self, id: NodeId) -> Result<Option<Node<'_>>, ReadError> {
        let found = match self.record(id) {
            Ok(Some((address, words))) => self.node_at(address, words),
            Ok(None) => {
                self.check()?;
                return Ok(None);
            }
            Err(address) => Err(address),
        };
        match found {
            Ok(node) => {
                self.check()?;
                Ok(Some(node))
            }
            Err(address) => Err(self.broken(address)),
        }
    }

    /// The node of that name, if it is there.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn find_node_by_name(&self, name: &str) -> Result<Option<Node<'_>>, ReadError> {
        let hash = hash(name);
        let mut range = self.range(self.root.names, [hash, 0], [hash, u64::MAX])?;
        while let Some((key, _)) = self.genuine(range.next())? {
            if let Some(node) = self.find_node(NodeId(key[1]))?
                && node.name()? == name
            {
                return Ok(Some(node));
            }
        }
        Ok(None)
    }

    fn range(&self, root: Address, from: Key, to: Key) -> Result<tree::Range<'_>, ReadError> {
        self.genuine(tree::Range::new(&self.arena, root, from, to))
    }

    /// All nodes, in an order that depends on their ids alone.
    pub fn nodes(&self) -> impl Iterator<Item = Result<Node<'_>, ReadError>> {
        let mut walk = Some(late::Walk::new(self.root));
        std::iter::from_fn(move || {
            let next = walk.as_mut()?.next(&self.arena);
            let node = |(address, words)| self.node_at(address, words);
            let next = self.genuine(next.and_then(|found| found.map(node).transpose()));
            if !matches!(next, Ok(Some(_))) {
                walk = None;
            }
            next.transpose()
        })
    }

    /// The nodes of a type or its subtypes: type by type, each by ascending id.
    pub fn nodes_of_type(
        &self,
        type_id: TypeId,
    ) -> impl Iterator<Item = Result<Node<'_>, ReadError>> {
        self.schema
            .subtypes(type_id)
            .iter()
            .flat_map(move |&exact| self.nodes_of_exact_type(exact))
    }

    /// The nodes of the type of that name or its subtypes, as [`Snapshot::nodes_of_type`]; none
    /// where the schema does not have it.
    pub fn nodes_of(
        &self,
        type_name: &str,
    ) -> impl Iterator<Item = Result<Node<'_>, ReadError>> + use<'_> {
        self.schema
            .find_type(type_name)
            .into_iter()
            .flat_map(|type_id| self.nodes_of_type(type_id))
    }

    fn nodes_of_exact_type(
        &self,
        exact: TypeId,
    ) -> impl Iterator<Item = Result<Node<'_>, ReadError>> {
        let entry = record::directory_entry(&self.arena, self.root.types, exact.0);
        let root = self.genuine(entry).map(|(tree, _)| tree);
        self.scan(root, [0, 0], [u64::MAX, u64::MAX]).map(|entry| {
            let (key, _) = entry?;
            self.find_node(NodeId(key[0]))?
                .ok_or(ReadError::Damaged { address: 0 })
        })
    }

    /// The nodes of a type, but not of its subtypes, by ascending id.
    pub fn ids_of_type(&self, exact: TypeId) -> NodeIds<'_> {
        let entry = record::directory_entry(&self.arena, self.root.types, exact.0);
        let root = self.genuine(entry).map(|(tree, _)| tree);
        NodeIds::new(self.scan(root, [0, 0], [u64::MAX, u64::MAX]), 0)
    }

    /// How many nodes are of a type, but not of its subtypes.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn count_of_exact_type(&self, exact: TypeId) -> Result<u64, ReadError> {
        let entry = record::directory_entry(&self.arena, self.root.types, exact.0);
        Ok(self.genuine(entry)?.1)
    }

    /// The nodes that an attribute's index has in a range, by ascending number (or by the texts'
    /// hashes), then id; none if the attribute has no index.
    ///
    /// Look at the values, too: texts of equal hash, and whole numbers that are nearest to the
    /// same f64, come together.
    pub fn ids_by_value(&self, attribute: AttributeId, range: &ValueRange) -> NodeIds<'_> {
        let entry = record::directory_entry(&self.arena, self.root.values, attribute.0);
        let root = self.genuine(entry).map(|(tree, _)| tree);
        let places = match range {
            ValueRange::Equal(value) => value.place().map(|place| (place, place)),
            ValueRange::Between(from, to) => Some((place(*from), place(*to))),
        };
        let (root, (from, to)) = places.map_or((Ok(0), (0, 0)), |places| (root, places));
        NodeIds::new(self.scan(root, [from, 0], [to, u64::MAX]), 1)
    }

    /// How many edges of a label join nodes of which exact types, by types.
    pub fn triple_counts(
        &self,
        label: LabelId,
    ) -> impl Iterator<Item = Result<TripleCount, ReadError>> {
        let from = record::triple(label.0, 0, 0);
        let to = record::triple(label.0, u16::MAX, u16::MAX);
        self.scan(Ok(self.root.triples), from, to).map(|entry| {
            let ([key, _], count) = entry?;
            Ok(TripleCount {
                from: TypeId((key >> 16) as u16),
                to: TypeId(key as u16),
                count,
            })
        })
    }

    /// How many nodes are of a type or its subtypes.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn count_of_type(&self, type_id: TypeId) -> Result<u64, ReadError> {
        self.schema
            .subtypes(type_id)
            .iter()
            .try_fold(0, |sum, exact| {
                let entry = record::directory_entry(&self.arena, self.root.types, exact.0);
                Ok(sum + self.genuine(entry)?.1)
            })
    }

    /// The edges of a label, by ascending source and target.
    pub fn edges_of_label(
        &self,
        label: LabelId,
    ) -> impl Iterator<Item = Result<EdgeKey, ReadError>> {
        self.typed_edges_of_label(label).map(|edge| Ok(edge?.0))
    }

    /// The edges of a label, by ascending source and target, with the exact types of both: reads no
    /// node.
    pub fn typed_edges_of_label(&self, label: LabelId) -> TypedEdges<'_> {
        let entry = record::directory_entry(&self.arena, self.root.labels, label.0);
        let root = self.genuine(entry).map(|(tree, _)| tree);
        TypedEdges::new(self.scan(root, [0, 0], [u64::MAX, u64::MAX]), label)
    }

    /// How many edges have a label.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn count_of_label(&self, label: LabelId) -> Result<u64, ReadError> {
        let entry = record::directory_entry(&self.arena, self.root.labels, label.0);
        Ok(self.genuine(entry)?.1)
    }

    /// The edge of that key, if it is there.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn find_edge(&self, key: EdgeKey) -> Result<Option<Edge<'_>>, ReadError> {
        let Some(node) = self.find_node(key.from)? else {
            return Ok(None);
        };
        let root = node.word(4)?;
        let found = self.genuine(tree::find(
            &self.arena,
            root,
            [u64::from(key.label.0), key.to.0],
        ))?;
        Ok(found.map(|end| Edge::at(self, record::edge_of(end), key)))
    }

    /// The name of an agent that wrote an attribute.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn writer_name(&self, writer: WriterId) -> Result<String, ReadError> {
        Ok(self
            .writers()?
            .into_iter()
            .nth(usize::from(writer.0))
            .unwrap_or_default())
    }

    pub(crate) fn writers(&self) -> Result<Vec<String>, ReadError> {
        if self.root.writers == 0 {
            return Ok(Vec::new());
        }
        let bytes = self.genuine(record::read_blob(&self.arena, self.root.writers))?;
        postcard::from_bytes(&bytes).map_err(|_| ReadError::Damaged {
            address: self.root.writers,
        })
    }
}
