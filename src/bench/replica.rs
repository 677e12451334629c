//! A copy of the graph on the heap of one process, as an agent would keep one in petgraph: what
//! reading in place is measured against.

use crate::Failure;
use dsr::{Attribute, AttributeId, LabelId, NodeId, Snapshot};
use petgraph::stable_graph::{NodeIndex, StableDiGraph};
use petgraph::visit::{EdgeRef, IntoEdgeReferences};
use rustc_hash::FxHashMap;

/// The copy.
#[derive(Debug, Default)]
pub(super) struct Replica {
    /// A node's weight is its attributes, by id of their names; an edge's is its label.
    graph: StableDiGraph<Vec<Attribute>, LabelId>,
    indices: FxHashMap<NodeId, NodeIndex>,
}

impl Replica {
    /// Copies nodes with their attributes, and edges with their labels.
    pub(super) fn of(snapshot: &Snapshot) -> Result<Self, Failure> {
        let mut replica = Self::default();
        for node in snapshot.nodes() {
            let node = node.map_err(Failure::internal)?;
            let attributes = node.attributes().map_err(Failure::internal)?;
            let index = replica.graph.add_node(attributes);
            replica.indices.insert(node.id(), index);
        }
        for node in snapshot.nodes() {
            for edge in node.map_err(Failure::internal)?.out_edges() {
                let edge = edge.map_err(Failure::internal)?;
                let ends = [edge.from, edge.to].map(|end| replica.indices.get(&end).copied());
                if let [Some(from), Some(to)] = ends {
                    replica.graph.add_edge(from, to, edge.label);
                }
            }
        }
        Ok(replica)
    }

    /// One attribute of a node.
    pub(super) fn attribute(&self, node: NodeId, name: AttributeId) -> Option<Attribute> {
        let attributes = self.graph.node_weight(*self.indices.get(&node)?)?;
        let found = attributes.iter().find(|found| found.name == name);
        found.cloned()
    }

    /// The edges of a label.
    pub(super) fn edges_of_label(
        &self,
        label: LabelId,
    ) -> impl Iterator<Item = (NodeIndex, NodeIndex)> {
        let edges = self.graph.edge_references();
        edges
            .filter(move |edge| *edge.weight() == label)
            .map(|edge| (edge.source(), edge.target()))
    }
}
