//! The nodes, edges and attributes of a snapshot. As every read of a snapshot, theirs are genuine or
//! say [`ReadError::SnapshotTooOld`].

use super::scan::Scan;
use super::{NodeIds, Snapshot};
use crate::arena::record;
use crate::arena::table::{self, AttributeRecord, Head, Place, Small};
use crate::arena::{Address, ReadError, Word};
use crate::hot::Key;
use crate::{AttributeId, EdgeKey, LabelId, NodeId, Time, TypeId, Value, Version, WriterId};
use std::ops::Deref;

/// What nodes and edges have in common: a record with a version and a table of attributes.
#[derive(Debug, Clone, Copy)]
pub struct Element<'a> {
    pub(super) snapshot: &'a Snapshot,
    address: Address,
    /// Of its record.
    words: &'a [Word],
    layout: &'static Layout,
}

/// Where a record has what.
#[derive(Debug)]
struct Layout {
    /// The word with the number of attributes.
    kind: usize,
    version: usize,
    attributes: usize,
}

static NODE: Layout = Layout {
    kind: 1,
    version: 3,
    attributes: record::NODE_HEADER,
};
static EDGE: Layout = Layout {
    kind: 2,
    version: 3,
    attributes: record::EDGE_HEADER,
};

/// A node of a snapshot.
#[derive(Debug, Clone, Copy)]
pub struct Node<'a> {
    element: Element<'a>,
    id: NodeId,
    type_id: TypeId,
}

/// An edge of a snapshot.
#[derive(Debug, Clone, Copy)]
pub struct Edge<'a> {
    element: Element<'a>,
    pub(super) key: EdgeKey,
}

impl<'a> Deref for Node<'a> {
    type Target = Element<'a>;
    fn deref(&self) -> &Element<'a> {
        &self.element
    }
}

impl<'a> Deref for Edge<'a> {
    type Target = Element<'a>;
    fn deref(&self) -> &Element<'a> {
        &self.element
    }
}

/// An attribute as it was last written.
#[derive(Debug, Clone, PartialEq)]
pub struct Attribute {
    /// Which.
    pub name: AttributeId,
    /// Its value.
    pub value: Value,
    /// The commit that wrote it.
    pub version: Version,
    /// When.
    pub time: Time,
    /// Who.
    pub writer: WriterId,
}

impl<'a> Element<'a> {
    #[inline]
    pub(super) fn word(&self, index: usize) -> Result<u64, ReadError> {
        let word = self.words.get(index).map(Word::load);
        self.snapshot.genuine(word.ok_or(self.address))
    }

    /// The commit that last changed the attributes or, of a node, the type; or made it.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn version(&self) -> Result<Version, ReadError> {
        self.word(self.layout.version).map(Version)
    }

    /// The table of attributes and its rows, not yet known to be genuine.
    #[inline]
    fn table(&self) -> Option<(&'a [Word], &'a [Word])> {
        let kind = self.words.get(self.layout.kind)?.load();
        let table = self.words.get(self.layout.attributes..)?;
        Some((table, table.get(..table::count(kind))?))
    }

    fn decode(&self, table: &'a [Word], row: u64) -> Result<AttributeRecord, Address> {
        let words = self.words_of(table, row)?;
        AttributeRecord::decode(words).ok_or(self.address)
    }

    /// One attribute, if it is there. Where its owner gives out a newer value beside the graph (see
    /// [`Session::hot`](crate::Session::hot)), that one, with its time; version and writer are those of
    /// the last commit.
    ///
    /// # Errors
    /// [`ReadError`].
    #[allow(
        clippy::inline_always,
        reason = "handing the result over in memory takes as long as reading it"
    )]
    #[inline(always)]
    pub fn attribute(&self, name: AttributeId) -> Result<Option<Attribute>, ReadError> {
        let words = match self.find(name) {
            Ok(Some(words)) => words,
            Ok(None) => {
                self.snapshot.check()?;
                return Ok(None);
            }
            Err(address) => return Err(self.snapshot.broken(address)),
        };
        // Numbers and poses are made here, so that they are written once, where they are wanted.
        match table::small_value(words) {
            Some((head, Small::Number(number))) if !self.is_hot(name) => {
                self.snapshot.check()?;
                Ok(Some(written(name, head, Value::F64(number))))
            }
            Some((head, Small::Pose(row))) if !self.is_hot(name) => {
                self.snapshot.check()?;
                let pose = table::pose_of(row);
                Ok(Some(written(name, head, Value::Pose(pose))))
            }
            _ => match self.other_attribute(name, words) {
                Ok(record) => {
                    self.snapshot.check()?;
                    Ok(Some(written(name, record.head, record.value)))
                }
                Err(address) => Err(self.snapshot.broken(address)),
            },
        }
    }

    /// Where the attribute lies; not yet known to be genuine.
    #[inline]
    fn find(&self, name: AttributeId) -> Result<Option<&'a [Word]>, Address> {
        let (table, rows) = self.table().ok_or(self.address)?;
        let mut rows = rows.iter().map(Word::load);
        match rows.find(|&row| table::name_of(row) == name.0) {
            Some(row) => self.words_of(table, row).map(Some),
            None => Ok(None),
        }
    }

    /// The words of a row's attribute.
    #[inline]
    fn words_of(&self, table: &'a [Word], row: u64) -> Result<&'a [Word], Address> {
        match table::place_of(row) {
            Place::InTable(offset) => table.get(offset..).ok_or(self.address),
            Place::At(address) => self.snapshot.arena.from(address).ok_or(address),
        }
    }

    /// Whether there may be a newer value beside the graph.
    #[inline]
    fn is_hot(&self, name: AttributeId) -> bool {
        let pages = self.snapshot.hot.as_ref().map(|hot| hot.pages.is_empty());
        pages == Some(false) && self.snapshot.schema.hot_rate(name).is_some()
    }

    #[inline(never)]
    fn other_attribute(
        &self,
        name: AttributeId,
        words: &[Word],
    ) -> Result<AttributeRecord, Address> {
        let committed = AttributeRecord::decode(words).ok_or(self.address)?;
        Ok(self.newest(name, committed))
    }

    /// What its owner gives out of a hot attribute takes the place of what was committed before.
    fn newest(&self, name: AttributeId, committed: AttributeRecord) -> AttributeRecord {
        let hot = self.snapshot.hot.as_ref().filter(|_| self.is_hot(name));
        let session = || self.snapshot.arena.session_of(committed.head.writer);
        let found = hot.and_then(|hot| hot.read(session(), self.key_of(name)?));
        match found {
            Some(hot) if hot.head.time > committed.head.time => AttributeRecord {
                value: hot.value,
                head: Head {
                    time: hot.head.time,
                    ..committed.head
                },
            },
            _ => committed,
        }
    }

    fn key_of(&self, name: AttributeId) -> Option<Key> {
        let [first, second, third] = self.words.first_chunk()?.each_ref().map(Word::load);
        Some(if self.layout.kind == NODE.kind {
            Key::of_node(NodeId(first), name)
        } else {
            let edge = EdgeKey {
                from: NodeId(first),
                label: LabelId(third as u16),
                to: NodeId(second),
            };
            Key::of_edge(edge, name)
        })
    }

    /// The values of an attribute that are kept, newest first: as many as the schema's `history`
    /// asks for, else the one that it has.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn history(&self, name: AttributeId) -> Result<Vec<Attribute>, ReadError> {
        let mut history = Vec::new();
        let (table, rows) = self
            .table()
            .ok_or_else(|| self.snapshot.broken(self.address))?;
        let mut rows = rows.iter().map(Word::load);
        if let Some(row) = rows.find(|&row| table::name_of(row) == name.0) {
            self.append_history(table, row, &mut history)?;
        }
        self.snapshot.check()?;
        Ok(history)
    }

    fn append_history(
        &self,
        table: &'a [Word],
        row: u64,
        history: &mut Vec<Attribute>,
    ) -> Result<(), ReadError> {
        let name = AttributeId(table::name_of(row));
        let mut append = |row| {
            let record = self.snapshot.genuine(self.decode(table, row))?;
            history.push(written(name, record.head, record.value));
            Ok::<_, ReadError>(())
        };
        append(row)?;
        let Place::At(address) = table::place_of(row) else {
            return Ok(());
        };
        let arena = &self.snapshot.arena;
        let older = |at| AttributeRecord::older(arena, at).unwrap_or_default();
        // Where the chain ends is up to its newest record: what the oldest leads to is gone.
        let (mut count, mut address) = older(address);
        self.snapshot.check()?;
        while count > 0 {
            append(table::row(name.0, Place::At(address)))?;
            (_, address) = older(address);
            count -= 1;
        }
        Ok(())
    }

    /// All attributes by id of their names, each after the older values of its history.
    pub(crate) fn recorded(&self) -> Result<Vec<Attribute>, ReadError> {
        let (table, rows) = self
            .table()
            .ok_or_else(|| self.snapshot.broken(self.address))?;
        let mut recorded = Vec::new();
        for row in rows {
            let from = recorded.len();
            self.append_history(table, row.load(), &mut recorded)?;
            recorded[from..].reverse();
        }
        Ok(recorded)
    }

    /// The value of the attribute of that name, if it is there.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn value(&self, name: &str) -> Result<Option<Value>, ReadError> {
        let Some(name) = self.snapshot.schema.find_attribute(name) else {
            return Ok(None);
        };
        Ok(self.attribute(name)?.map(|attribute| attribute.value))
    }

    /// All attributes, by id of their names.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn attributes(&self) -> Result<Vec<Attribute>, ReadError> {
        let (table, rows) = self
            .table()
            .ok_or_else(|| self.snapshot.broken(self.address))?;
        rows.iter()
            .map(|row| {
                let row = row.load();
                let record = self.snapshot.genuine(self.decode(table, row))?;
                let name = AttributeId(table::name_of(row));
                let newest = self.newest(name, record);
                Ok(written(name, newest.head, newest.value))
            })
            .collect()
    }
}

#[inline]
fn written(name: AttributeId, head: Head, value: Value) -> Attribute {
    Attribute {
        name,
        value,
        version: Version(head.version),
        time: Time::from_nanoseconds(head.time),
        writer: WriterId(head.writer),
    }
}

impl<'a> Node<'a> {
    #[inline]
    pub(super) fn at(
        snapshot: &'a Snapshot,
        address: Address,
        words: &'a [Word],
        id: NodeId,
        type_id: TypeId,
    ) -> Self {
        let element = Element {
            snapshot,
            address,
            words,
            layout: &NODE,
        };
        Self {
            element,
            id,
            type_id,
        }
    }

    /// The node's id.
    pub fn id(&self) -> NodeId {
        self.id
    }

    /// The node's type.
    pub fn type_id(&self) -> TypeId {
        self.type_id
    }

    pub(super) fn type_id_ref(&self) -> &TypeId {
        &self.type_id
    }

    /// The name of the node's type.
    pub fn type_name(&self) -> &'a str {
        self.element.snapshot.schema.type_name(self.type_id)
    }

    /// The node's name.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn name(&self) -> Result<String, ReadError> {
        let address = self.word(2)?;
        let snapshot = self.element.snapshot;
        let bytes = snapshot.genuine(record::read_blob(&snapshot.arena, address))?;
        String::from_utf8(bytes).map_err(|_| ReadError::Damaged { address })
    }

    pub(super) fn adjacent(self, tree: usize, labels: [u16; 2]) -> Scan<'a> {
        let [from, to] = labels.map(u64::from);
        self.element
            .snapshot
            .scan(self.word(tree), [from, 0], [to, u64::MAX])
    }

    /// The edges that start here, by label and target.
    pub fn out_edges(&self) -> impl Iterator<Item = Result<EdgeKey, ReadError>> + use<'a> {
        self.outgoing([0, u16::MAX]).map(|edge| Ok(edge?.key))
    }

    /// The edges of a label that start here, by target.
    pub fn out_edges_of(
        &self,
        label: LabelId,
    ) -> impl Iterator<Item = Result<EdgeKey, ReadError>> + use<'a> {
        self.outgoing([label.0; 2]).map(|edge| Ok(edge?.key))
    }

    /// The edges that start here, ready to be read, by label and target.
    pub fn edges(&self) -> impl Iterator<Item = Result<Edge<'a>, ReadError>> + use<'a> {
        self.outgoing([0, u16::MAX])
    }

    fn outgoing(
        &self,
        labels: [u16; 2],
    ) -> impl Iterator<Item = Result<Edge<'a>, ReadError>> + use<'a> {
        let node = *self;
        node.adjacent(4, labels).map(move |entry| {
            let ([label, to], end) = entry?;
            let key = EdgeKey {
                from: node.id,
                label: LabelId(label as u16),
                to: NodeId(to),
            };
            let edge = record::edge_of(end);
            Ok(Edge::at(node.element.snapshot, edge, key))
        })
    }

    /// Where the edges of a label that start here end, by ascending id.
    pub fn targets_of(&self, label: LabelId) -> NodeIds<'a> {
        NodeIds::new(self.adjacent(4, [label.0; 2]), 1)
    }

    /// Where the edges of a label that end here start, by ascending id.
    pub fn sources_of(&self, label: LabelId) -> NodeIds<'a> {
        NodeIds::new(self.adjacent(5, [label.0; 2]), 1)
    }

    /// The edges that end here, by label and source.
    pub fn in_edges(&self) -> impl Iterator<Item = Result<EdgeKey, ReadError>> + use<'a> {
        self.incoming([0, u16::MAX])
    }

    /// The edges of a label that end here, by source.
    pub fn in_edges_of(
        &self,
        label: LabelId,
    ) -> impl Iterator<Item = Result<EdgeKey, ReadError>> + use<'a> {
        self.incoming([label.0; 2])
    }

    fn incoming(
        &self,
        labels: [u16; 2],
    ) -> impl Iterator<Item = Result<EdgeKey, ReadError>> + use<'a> {
        let node = *self;
        node.adjacent(5, labels).map(move |entry| {
            let ([label, from], _) = entry?;
            Ok(EdgeKey {
                from: NodeId(from),
                label: LabelId(label as u16),
                to: node.id,
            })
        })
    }
}

impl<'a> Edge<'a> {
    #[inline]
    pub(super) fn at(snapshot: &'a Snapshot, address: Address, key: EdgeKey) -> Self {
        let element = Element {
            snapshot,
            address,
            // A place outside the arena is told by the first read.
            words: snapshot.arena.from(address).unwrap_or(&[]),
            layout: &EDGE,
        };
        Self { element, key }
    }

    /// What names the edge.
    pub fn key(&self) -> EdgeKey {
        self.key
    }
}
