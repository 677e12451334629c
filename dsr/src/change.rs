//! What a commit changed, as it goes out to every agent, and the filters that agents subscribe
//! with. This file guarantees that a filter passes each change that touches what it names.

use crate::{AttributeId, EdgeKey, Epoch, LabelId, NodeId, Schema, Time, TypeId, Version};
use serde::{Deserialize, Serialize};

/// How a node or an edge was touched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Touch {
    /// It is new.
    Created,
    /// It is gone.
    Deleted,
    /// Its attributes changed.
    Updated,
    /// It went and came again, or its type changed: nothing that was known of it need hold.
    Replaced,
}

/// One touched node.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct NodeChange {
    /// Which.
    pub node: NodeId,
    /// Its type; after the change, or before it where the node is gone.
    pub type_id: TypeId,
    /// How.
    pub touch: Touch,
    /// Attributes set or removed.
    pub attributes: Vec<AttributeId>,
}

/// One touched edge.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct EdgeChange {
    /// Which.
    pub edge: EdgeKey,
    /// How.
    pub touch: Touch,
    /// Attributes set or removed.
    pub attributes: Vec<AttributeId>,
}

/// A rule application that the commit holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RuleApplication {
    /// The rule's name.
    pub rule: String,
    /// The node that each variable stood for.
    pub binding: Vec<(String, NodeId)>,
}

/// All that one commit changed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Change {
    /// The life of the store that made it.
    pub epoch: Epoch,
    /// The version that it made. Versions follow each other without a gap.
    pub version: Version,
    /// When.
    pub time: Time,
    /// Which agent asked for it.
    pub agent: String,
    /// The rules that it applied.
    pub rules: Vec<RuleApplication>,
    /// Touched nodes, each once, by id.
    pub nodes: Vec<NodeChange>,
    /// Touched edges, each once, by source, label and target.
    pub edges: Vec<EdgeChange>,
}

/// Which changes an agent wants to see: those that touch anything named here. An empty filter
/// passes everything.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Filter {
    /// Nodes of these types or their subtypes.
    pub types: Vec<TypeId>,
    /// Edges with these labels.
    pub labels: Vec<LabelId>,
    /// These attributes, of nodes or edges.
    pub attributes: Vec<AttributeId>,
    /// These nodes, and the edges that touch them.
    pub nodes: Vec<NodeId>,
}

impl Filter {
    /// Whether `change` touches anything that the filter names.
    pub fn passes(&self, change: &Change, schema: &Schema) -> bool {
        let everything = self.types.is_empty()
            && self.labels.is_empty()
            && self.attributes.is_empty()
            && self.nodes.is_empty();
        everything
            || change.nodes.iter().any(|touched| {
                self.types
                    .iter()
                    .any(|&wanted| schema.is_subtype(touched.type_id, wanted))
                    || self.nodes.contains(&touched.node)
                    || touched
                        .attributes
                        .iter()
                        .any(|name| self.attributes.contains(name))
            })
            || change.edges.iter().any(|touched| {
                self.labels.contains(&touched.edge.label)
                    || self.nodes.contains(&touched.edge.from)
                    || self.nodes.contains(&touched.edge.to)
                    || touched
                        .attributes
                        .iter()
                        .any(|name| self.attributes.contains(name))
            })
    }
}
