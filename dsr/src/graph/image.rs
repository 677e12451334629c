//! A whole version of the graph as one message: what a restarted store starts from. This file
//! guarantees that a restored graph equals the one the image was taken of, down to who wrote each
//! attribute when.

use super::{Graph, apply};
use crate::{
    AttributeId, EdgeKey, NodeId, ReadError, Refusal, Schema, Snapshot, Time, TypeId, Value,
    Version,
};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A value of an attribute; older values of its history come before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct AttributeImage {
    pub(super) name: AttributeId,
    pub(super) value: Value,
    pub(super) version: u64,
    pub(super) time: i64,
    pub(super) writer: u16,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct NodeImage {
    pub(super) id: NodeId,
    pub(super) type_id: TypeId,
    pub(super) name: String,
    pub(super) version: u64,
    pub(super) attributes: Vec<AttributeImage>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct EdgeImage {
    pub(super) key: EdgeKey,
    pub(super) version: u64,
    pub(super) attributes: Vec<AttributeImage>,
}

/// A whole version of the graph.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Image {
    schema: Schema,
    writers: Vec<String>,
    version: Version,
    time: Time,
    next_id: u64,
    nodes: Vec<NodeImage>,
    edges: Vec<EdgeImage>,
}

impl Image {
    /// The image of a snapshot.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn of(snapshot: &Snapshot) -> Result<Self, ReadError> {
        let image = |a: crate::Attribute| AttributeImage {
            name: a.name,
            value: a.value,
            version: a.version.0,
            time: a.time.nanoseconds(),
            writer: a.writer.0,
        };
        let mut nodes = Vec::new();
        let mut edges = Vec::new();
        for node in snapshot.nodes() {
            let node = node?;
            let attributes = node.recorded()?.into_iter().map(image).collect();
            let (id, type_id) = (node.id(), node.type_id());
            nodes.push(NodeImage {
                id,
                type_id,
                name: node.name()?,
                version: node.version()?.0,
                attributes,
            });
            for key in node.out_edges() {
                let key = key?;
                let Some(edge) = snapshot.find_edge(key)? else {
                    continue;
                };
                let attributes = edge.recorded()?.into_iter().map(image).collect();
                let version = edge.version()?.0;
                edges.push(EdgeImage {
                    key,
                    version,
                    attributes,
                });
            }
        }
        Ok(Self {
            schema: snapshot.schema().clone(),
            writers: snapshot.writers()?,
            version: snapshot.version(),
            time: snapshot.time(),
            next_id: snapshot.root.next_id,
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
        self.version
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
    /// # Errors
    /// [`Refusal::AlreadyExists`] where the graph is not empty; [`Refusal::OutOfMemory`].
    pub fn restore(&mut self, image: &Image) -> Result<(), Refusal> {
        if self.snapshot().node_count() > 0 {
            return Err(Refusal::AlreadyExists(
                "a graph; only an empty one can be filled".into(),
            ));
        }
        let before = (Arc::clone(&self.schema), self.writers.clone());
        self.schema = Arc::new(image.schema.clone());
        let root = apply::Work::restore(self, image);
        match root {
            Ok(root) => {
                self.publish(root);
                Ok(())
            }
            Err(refusal) => {
                self.abandon(&before);
                Err(refusal)
            }
        }
    }
}

impl Image {
    pub(super) fn parts(&self) -> (&[NodeImage], &[EdgeImage], &[String]) {
        (&self.nodes, &self.edges, &self.writers)
    }

    pub(super) fn stamp(&self) -> (Version, Time, u64) {
        (self.version, self.time, self.next_id)
    }
}
