//! A whole version of the graph as one message: what a restarted store starts from. This file
//! guarantees that a restored graph equals the one the image was taken of, down to who wrote each
//! attribute when.

use super::{Answered, Graph, apply};
use crate::{
    Attribute, AttributeId, Edge, EdgeKey, Node, NodeId, ReadError, Refusal, Schema, Snapshot,
    Time, TypeId, Value, Version,
};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A value of an attribute; older values of its history come before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct AttributeImage {
    pub(super) name: AttributeId,
    pub(super) value: Value,
    pub(super) version: u64,
    pub(super) time: i64,
    pub(super) writer: u16,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct NodeImage {
    pub(crate) id: NodeId,
    pub(super) type_id: TypeId,
    pub(super) name: String,
    pub(super) version: u64,
    pub(super) attributes: Vec<AttributeImage>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct EdgeImage {
    pub(crate) key: EdgeKey,
    pub(super) version: u64,
    pub(super) attributes: Vec<AttributeImage>,
}

impl AttributeImage {
    fn of(attribute: Attribute) -> Self {
        Self {
            name: attribute.name,
            value: attribute.value,
            version: attribute.version.0,
            time: attribute.time.nanoseconds(),
            writer: attribute.writer.0,
        }
    }
}

impl NodeImage {
    pub(crate) fn of(node: &Node<'_>) -> Result<Self, ReadError> {
        let attributes = node.recorded()?;
        Ok(Self {
            id: node.id(),
            type_id: node.type_id(),
            name: node.name()?,
            version: node.version()?.0,
            attributes: attributes.into_iter().map(AttributeImage::of).collect(),
        })
    }
}

impl EdgeImage {
    pub(crate) fn of(edge: &Edge<'_>) -> Result<Self, ReadError> {
        let attributes = edge.recorded()?;
        Ok(Self {
            key: edge.key(),
            version: edge.version()?.0,
            attributes: attributes.into_iter().map(AttributeImage::of).collect(),
        })
    }
}

/// What an image says beside its nodes and edges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Frame {
    pub(crate) writers: Vec<String>,
    pub(crate) version: Version,
    pub(crate) time: Time,
    pub(crate) next_id: u64,
    pub(crate) answered: Vec<Answered>,
    pub(crate) lineage: u64,
}

impl Frame {
    pub(crate) fn of(snapshot: &Snapshot) -> Result<Self, ReadError> {
        Ok(Self {
            writers: snapshot.writers()?,
            version: snapshot.version(),
            time: snapshot.time(),
            next_id: snapshot.root.next_id,
            answered: snapshot.all_answered()?,
            lineage: snapshot.root.lineage,
        })
    }
}

/// A whole version of the graph.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Image {
    pub(crate) schema: Schema,
    pub(crate) frame: Frame,
    pub(crate) nodes: Vec<NodeImage>,
    pub(crate) edges: Vec<EdgeImage>,
}

impl Image {
    /// The image of a snapshot.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn of(snapshot: &Snapshot) -> Result<Self, ReadError> {
        let mut nodes = Vec::new();
        let mut edges = Vec::new();
        for node in snapshot.nodes() {
            let node = node?;
            nodes.push(NodeImage::of(&node)?);
            for key in node.out_edges() {
                if let Some(edge) = snapshot.find_edge(key?)? {
                    edges.push(EdgeImage::of(&edge)?);
                }
            }
        }
        // The trie gives them in another order.
        nodes.sort_by_key(|node| node.id);
        edges.sort_by_key(|edge| edge.key);
        Ok(Self {
            schema: snapshot.schema().clone(),
            frame: Frame::of(snapshot)?,
            nodes,
            edges,
        })
    }

    /// The image as bytes, which [`decode_image`] reads.
    pub fn to_bytes(&self) -> Vec<u8> {
        // Encoding to memory cannot fail for these types.
        postcard::to_stdvec(self).unwrap_or_default()
    }

    /// The version that this is the image of.
    pub fn version(&self) -> Version {
        self.frame.version
    }

    /// Its time.
    pub fn time(&self) -> Time {
        self.frame.time
    }
}

/// Reads what [`Image::to_bytes`] wrote.
///
/// # Errors
/// [`Refusal::Malformed`].
pub fn decode_image(bytes: &[u8]) -> Result<Image, Refusal> {
    postcard::from_bytes(bytes).map_err(|error| Refusal::Malformed(error.to_string()))
}

impl Graph {
    /// Replaces an empty graph's content by an image. Its version becomes the image's.
    ///
    /// The schema becomes the image's too if the graph's own is open; else the image is read into
    /// the graph's schema by the names of its types, labels and attributes.
    ///
    /// # Errors
    /// [`Refusal::AlreadyExists`] where the graph is not empty; [`Refusal::SchemaViolation`] where
    /// its schema does not allow what the image has; [`Refusal::OutOfMemory`].
    pub fn restore(&mut self, image: &Image) -> Result<(), Refusal> {
        if self.snapshot().node_count() > 0 {
            return Err(Refusal::AlreadyExists(
                "a graph; only an empty one can be filled".into(),
            ));
        }
        let before = (Arc::clone(&self.schema), Arc::clone(&self.writers));
        if self.schema.is_open() {
            self.schema = Arc::new(image.schema.clone());
        }
        let root = apply::Work::restore(self, image);
        match root {
            Ok(root) => {
                self.publish(&root);
                let clients = image.frame.answered.iter();
                self.clients = clients.map(|a| (a.id.client, a.commit.version.0)).collect();
                Ok(())
            }
            Err(refusal) => {
                self.abandon(&before);
                Err(refusal)
            }
        }
    }
}
