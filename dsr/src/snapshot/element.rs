//! The nodes, edges and attributes of a snapshot. As every read of a snapshot, theirs are genuine or
//! say [`ReadError::SnapshotTooOld`].

use super::{NodeIds, Scan, Snapshot};
use crate::arena::record::{self, AttributeRecord, EdgeRecord};
use crate::arena::{Address, ReadError, Word};
use crate::{AttributeId, EdgeKey, LabelId, NodeId, Time, TypeId, Value, Version, WriterId};

/// A node of a snapshot.
#[derive(Debug, Clone, Copy)]
pub struct Node<'a> {
    pub(super) snapshot: &'a Snapshot,
    pub(super) address: Address,
    pub(super) id: NodeId,
    pub(super) type_id: TypeId,
}

/// An edge of a snapshot.
#[derive(Debug, Clone, Copy)]
pub struct Edge<'a> {
    pub(super) snapshot: &'a Snapshot,
    pub(super) address: Address,
    pub(super) key: EdgeKey,
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

/// What nodes and edges have in common: a record with a table of attributes.
fn find_attribute(
    snapshot: &Snapshot,
    rows: Option<&[Word]>,
    address: Address,
    name: AttributeId,
) -> Result<Option<Attribute>, ReadError> {
    let rows = rows.ok_or_else(|| snapshot.arena.broken(snapshot.root.version, address))?;
    for word in rows {
        let (attribute, at) = record::split_row(word.load());
        if attribute == name.0 {
            return read_attribute(snapshot, name, at).map(Some);
        }
    }
    snapshot.check().map(|()| None)
}

fn read_attribute(
    snapshot: &Snapshot,
    name: AttributeId,
    address: Address,
) -> Result<Attribute, ReadError> {
    let read = snapshot.genuine(AttributeRecord::read(&snapshot.arena, address))?;
    Ok(Attribute {
        name,
        value: read.value,
        version: Version(read.version),
        time: Time::from_nanoseconds(read.time),
        writer: WriterId(read.writer),
    })
}

fn all_attributes(snapshot: &Snapshot, rows: &[u64]) -> Result<Vec<Attribute>, ReadError> {
    rows.iter()
        .map(|&row| {
            let (attribute, address) = record::split_row(row);
            read_attribute(snapshot, AttributeId(attribute), address)
        })
        .collect()
}

impl<'a> Node<'a> {
    /// The node's id.
    pub fn id(&self) -> NodeId {
        self.id
    }

    /// The node's type.
    pub fn type_id(&self) -> TypeId {
        self.type_id
    }

    /// The name of the node's type.
    pub fn type_name(&self) -> &'a str {
        self.snapshot.schema.type_name(self.type_id)
    }

    pub(super) fn word(&self, index: usize) -> Result<u64, ReadError> {
        let words = self
            .snapshot
            .arena
            .from(self.address)
            .and_then(|words| words.get(index));
        self.snapshot
            .genuine(words.map(Word::load).ok_or(self.address))
    }

    /// The node's name.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn name(&self) -> Result<String, ReadError> {
        let address = self.word(2)?;
        let bytes = self
            .snapshot
            .genuine(record::read_blob(&self.snapshot.arena, address))?;
        String::from_utf8(bytes).map_err(|_| ReadError::Damaged { address })
    }

    /// The commit that last changed the node's type or attributes.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn version(&self) -> Result<Version, ReadError> {
        self.word(3).map(Version)
    }

    /// One attribute, if the node has it.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn attribute(&self, name: AttributeId) -> Result<Option<Attribute>, ReadError> {
        let words = self.snapshot.arena.from(self.address);
        let rows =
            words.and_then(|words| record::table(words, record::NODE_HEADER, words.get(1)?.load()));
        find_attribute(self.snapshot, rows, self.address, name)
    }

    /// The value of the attribute of that name, if the node has it.
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
        let record = record::NodeRecord::read(&self.snapshot.arena, self.address);
        all_attributes(self.snapshot, &self.snapshot.genuine(record)?.rows)
    }

    fn adjacent(self, tree: usize, labels: [u16; 2]) -> Scan<'a> {
        let [from, to] = labels.map(u64::from);
        self.snapshot
            .scan(self.word(tree), [from, 0], [to, u64::MAX])
    }

    /// The edges that start here, by label and target.
    pub fn out_edges(&self) -> impl Iterator<Item = Result<EdgeKey, ReadError>> + use<'a> {
        self.outgoing([0, u16::MAX])
    }

    /// The edges of a label that start here, by target.
    pub fn out_edges_of(
        &self,
        label: LabelId,
    ) -> impl Iterator<Item = Result<EdgeKey, ReadError>> + use<'a> {
        self.outgoing([label.0; 2])
    }

    fn outgoing(
        &self,
        labels: [u16; 2],
    ) -> impl Iterator<Item = Result<EdgeKey, ReadError>> + use<'a> {
        let node = *self;
        node.adjacent(4, labels).map(move |entry| {
            let ([label, to], _) = entry?;
            Ok(EdgeKey {
                from: node.id,
                label: LabelId(label as u16),
                to: NodeId(to),
            })
        })
    }

    /// Where the edges of a label that start here end, by ascending id.
    pub fn targets_of(&self, label: LabelId) -> NodeIds<'a> {
        NodeIds {
            scan: self.adjacent(4, [label.0; 2]),
            word: 1,
        }
    }

    /// Where the edges of a label that end here start, by ascending id.
    pub fn sources_of(&self, label: LabelId) -> NodeIds<'a> {
        NodeIds {
            scan: self.adjacent(5, [label.0; 2]),
            word: 1,
        }
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

impl Edge<'_> {
    /// What names the edge.
    pub fn key(&self) -> EdgeKey {
        self.key
    }

    /// The commit that last changed the edge's attributes, or made it.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn version(&self) -> Result<Version, ReadError> {
        let words = self.snapshot.arena.from(self.address);
        let word = words.and_then(|words| words.get(3));
        let version = word.map(Word::load).ok_or(self.address);
        self.snapshot.genuine(version).map(Version)
    }

    /// One attribute, if the edge has it.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn attribute(&self, name: AttributeId) -> Result<Option<Attribute>, ReadError> {
        let words = self.snapshot.arena.from(self.address);
        let rows =
            words.and_then(|words| record::table(words, record::EDGE_HEADER, words.get(2)?.load()));
        find_attribute(self.snapshot, rows, self.address, name)
    }

    /// The value of the attribute of that name, if the edge has it.
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
        let record = EdgeRecord::read(&self.snapshot.arena, self.address);
        all_attributes(self.snapshot, &self.snapshot.genuine(record)?.rows)
    }
}
