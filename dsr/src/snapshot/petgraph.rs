//! petgraph's traits on [`Snapshot`], so that its algorithms run in place on the shared memory.
//!
//! A node's weight is its type, an edge's its label; `petgraph::visit::EdgeFiltered` narrows a walk
//! to some labels. Those traits have no place for errors: a walk that meets one ends there.
//! So ask [`Snapshot::check`] when the algorithm is done: if it says yes, everything that the
//! algorithm saw was genuine; if not, throw the outcome away. No walk goes on for ever.

use super::scan::Scan;
use super::{Edge, Node, Snapshot};
use crate::arena::record;
use crate::{EdgeKey, LabelId, NodeId, TypeId};
use petgraph::visit::{
    Data, EdgeCount, EdgeRef, GraphBase, GraphProp, IntoEdgeReferences, IntoEdges,
    IntoEdgesDirected, IntoNeighbors, IntoNeighborsDirected, IntoNodeIdentifiers,
    IntoNodeReferences, NodeCompactIndexable, NodeCount, NodeIndexable, NodeRef, Visitable,
};
use petgraph::{Directed, Direction};
use rustc_hash::FxHashSet;
use std::sync::Arc;

/// Words of a node's record: the roots of its trees of edges.
const OUT: usize = 4;
const IN: usize = 5;

impl Snapshot {
    /// The nodes in order of their ids.
    fn index(&self) -> &[NodeId] {
        self.index.get_or_init(|| {
            let ids = self.nodes().map_while(Result::ok).map(|node| node.id());
            let mut ids: Vec<NodeId> = ids.collect();
            ids.sort_unstable();
            Arc::from(ids)
        })
    }

    fn adjacent(&self, node: NodeId, tree: usize) -> Option<Scan<'_>> {
        let node = self.find_node(node).ok().flatten()?;
        Some(node.adjacent(tree, [0, u16::MAX]))
    }
}

impl GraphBase for Snapshot {
    type NodeId = NodeId;
    type EdgeId = EdgeKey;
}

impl Data for Snapshot {
    type NodeWeight = TypeId;
    type EdgeWeight = LabelId;
}

impl GraphProp for Snapshot {
    type EdgeType = Directed;
}

impl NodeCount for Snapshot {
    fn node_count(&self) -> usize {
        self.root.node_count as usize
    }
}

impl EdgeCount for Snapshot {
    fn edge_count(&self) -> usize {
        self.root.edge_count as usize
    }
}

/// By rank among the ids. The first use sorts the ids into 8 bytes a node, kept with the snapshot.
impl NodeIndexable for Snapshot {
    fn node_bound(&self) -> usize {
        // Not 0, so that there is a place for the index of a node that is not there.
        self.index().len().max(1)
    }

    fn to_index(&self, node: NodeId) -> usize {
        self.index().binary_search(&node).unwrap_or(0)
    }

    fn from_index(&self, index: usize) -> NodeId {
        self.index().get(index).copied().unwrap_or(NodeId(0))
    }
}

impl NodeCompactIndexable for Snapshot {}

impl Visitable for Snapshot {
    type Map = FxHashSet<NodeId>;

    fn visit_map(&self) -> Self::Map {
        FxHashSet::default()
    }

    fn reset_map(&self, map: &mut Self::Map) {
        map.clear();
    }
}

/// The nodes at the other ends of a node's edges, once per edge.
#[derive(Debug)]
pub struct Neighbors<'a>(Option<Scan<'a>>);

impl Iterator for Neighbors<'_> {
    type Item = NodeId;

    fn next(&mut self) -> Option<NodeId> {
        let ([_, other], _) = self.0.as_mut()?.next()?.ok()?;
        Some(NodeId(other))
    }
}

impl<'a> IntoNeighbors for &'a Snapshot {
    type Neighbors = Neighbors<'a>;

    fn neighbors(self, node: NodeId) -> Neighbors<'a> {
        self.neighbors_directed(node, Direction::Outgoing)
    }
}

impl<'a> IntoNeighborsDirected for &'a Snapshot {
    type NeighborsDirected = Neighbors<'a>;

    fn neighbors_directed(self, node: NodeId, direction: Direction) -> Neighbors<'a> {
        let tree = match direction {
            Direction::Outgoing => OUT,
            Direction::Incoming => IN,
        };
        Neighbors(self.adjacent(node, tree))
    }
}

/// A node's edges of one direction.
#[derive(Debug)]
pub struct Edges<'a> {
    snapshot: &'a Snapshot,
    node: NodeId,
    direction: Direction,
    scan: Option<Scan<'a>>,
}

impl<'a> Iterator for Edges<'a> {
    type Item = Edge<'a>;

    fn next(&mut self) -> Option<Edge<'a>> {
        let ([label, other], end) = self.scan.as_mut()?.next()?.ok()?;
        let (label, other) = (LabelId(label as u16), NodeId(other));
        if self.direction == Direction::Incoming {
            let (from, to) = (other, self.node);
            let key = EdgeKey { from, label, to };
            return self.snapshot.find_edge(key).ok().flatten();
        }
        let (from, to) = (self.node, other);
        let key = EdgeKey { from, label, to };
        Some(Edge::at(self.snapshot, record::edge_of(end), key))
    }
}

impl<'a> IntoEdges for &'a Snapshot {
    type Edges = Edges<'a>;

    fn edges(self, node: NodeId) -> Edges<'a> {
        self.edges_directed(node, Direction::Outgoing)
    }
}

impl<'a> IntoEdgesDirected for &'a Snapshot {
    type EdgesDirected = Edges<'a>;

    fn edges_directed(self, node: NodeId, direction: Direction) -> Edges<'a> {
        let tree = match direction {
            Direction::Outgoing => OUT,
            Direction::Incoming => IN,
        };
        Edges {
            snapshot: self,
            node,
            direction,
            scan: self.adjacent(node, tree),
        }
    }
}

impl<'a> IntoNodeIdentifiers for &'a Snapshot {
    type NodeIdentifiers = Box<dyn Iterator<Item = NodeId> + 'a>;

    fn node_identifiers(self) -> Self::NodeIdentifiers {
        let nodes = self.nodes().map_while(Result::ok);
        Box::new(nodes.map(|node| node.id()))
    }
}

impl<'a> IntoNodeReferences for &'a Snapshot {
    type NodeRef = Node<'a>;
    type NodeReferences = Box<dyn Iterator<Item = Node<'a>> + 'a>;

    fn node_references(self) -> Self::NodeReferences {
        Box::new(self.nodes().map_while(Result::ok))
    }
}

impl<'a> IntoEdgeReferences for &'a Snapshot {
    type EdgeRef = Edge<'a>;
    type EdgeReferences = Box<dyn Iterator<Item = Edge<'a>> + 'a>;

    fn edge_references(self) -> Self::EdgeReferences {
        let nodes = self.nodes().map_while(Result::ok);
        Box::new(nodes.flat_map(|node| self.edges(node.id())))
    }
}

impl NodeRef for Node<'_> {
    type NodeId = NodeId;
    type Weight = TypeId;

    fn id(&self) -> NodeId {
        Node::id(self)
    }

    fn weight(&self) -> &TypeId {
        self.type_id_ref()
    }
}

impl EdgeRef for Edge<'_> {
    type NodeId = NodeId;
    type EdgeId = EdgeKey;
    type Weight = LabelId;

    fn source(&self) -> NodeId {
        self.key.from
    }

    fn target(&self) -> NodeId {
        self.key.to
    }

    fn weight(&self) -> &LabelId {
        &self.key.label
    }

    fn id(&self) -> EdgeKey {
        self.key
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EdgeRef as Named, Graph, Operation, Schema, Time, Transaction};
    use petgraph::algo::{dijkstra, is_cyclic_directed, kosaraju_scc, tarjan_scc, toposort};
    use petgraph::graph::{DiGraph, NodeIndex};
    use petgraph::visit::EdgeFiltered;
    use proptest::prelude::*;
    use std::collections::{BTreeMap, BTreeSet};

    const IDS: [u64; 8] = [3, 900, 901, 7, u64::MAX - 1, 64, 65, 4096];
    const LABELS: [&str; 2] = ["leads", "sees"];

    /// The same random graph in the arena and as petgraph's own.
    fn twins(edges: &[(usize, usize, usize, f64)]) -> (Graph, DiGraph<u64, (usize, f64)>) {
        let mut transaction = Transaction::new();
        let mut own = DiGraph::new();
        for id in IDS {
            own.add_node(id);
            transaction.push(Operation::CreateNode {
                id: Some(NodeId(id)),
                type_name: "place".into(),
                name: format!("n{id}"),
                attributes: vec![],
            });
        }
        let unique: BTreeMap<_, _> = edges.iter().map(|&(a, b, l, w)| ((a, b, l), w)).collect();
        for ((from, to, label), length) in unique {
            own.add_edge(NodeIndex::new(from), NodeIndex::new(to), (label, length));
            transaction.push(Operation::CreateEdge {
                edge: Named::new(NodeId(IDS[from]), LABELS[label], NodeId(IDS[to])),
                attributes: vec![("length".into(), length.into())],
            });
        }
        let mut graph = Graph::in_memory(Schema::open());
        graph.commit(&transaction, "test", Time::default()).unwrap();
        (graph, own)
    }

    fn length(edge: Edge<'_>) -> f64 {
        edge.value("length").unwrap().unwrap().as_f64().unwrap()
    }

    fn sets(components: Vec<Vec<u64>>) -> BTreeSet<BTreeSet<u64>> {
        let sets = components.into_iter().map(|c| c.into_iter().collect());
        sets.collect()
    }

    proptest! {
        #[test]
        fn algorithms_find_in_place_what_they_find_in_a_copy(
            edges in prop::collection::vec((0..8usize, 0..8usize, 0..2usize, 0.0..9.0), 0..30)
        ) {
            let (graph, own) = twins(&edges);
            let snapshot = graph.snapshot();
            let snapshot = &snapshot;
            let start = NodeIndex::new(0);
            let found: BTreeMap<u64, f64> = dijkstra(snapshot, NodeId(IDS[0]), None, length)
                .into_iter().map(|(id, cost)| (id.0, cost)).collect();
            let expected: BTreeMap<u64, f64> = dijkstra(&own, start, None, |e| e.weight().1)
                .into_iter().map(|(index, cost)| (own[index], cost)).collect();
            prop_assert_eq!(found, expected);
            // Of one label only, and against the edges.
            let leads = snapshot.schema().find_label("leads");
            let filtered = EdgeFiltered::from_fn(snapshot, |e: Edge<'_>| Some(*e.weight()) == leads);
            let found: BTreeSet<u64> = dijkstra(&filtered, NodeId(IDS[0]), None, length)
                .into_keys().map(|id| id.0).collect();
            let filtered = EdgeFiltered::from_fn(&own, |e: petgraph::graph::EdgeReference<'_, _>| e.weight().0 == 0);
            let expected: BTreeSet<u64> = dijkstra(&filtered, start, None, |e| e.weight().1)
                .into_keys().map(|index| own[index]).collect();
            prop_assert_eq!(found, expected);
            let into = snapshot.edges_directed(NodeId(IDS[1]), Direction::Incoming);
            let found: BTreeSet<_> = into.map(|e| (e.source().0, e.key().label)).collect();
            let into = own.edges_directed(NodeIndex::new(1), Direction::Incoming);
            let expected: BTreeSet<_> = into
                .map(|e| (own[e.source()], snapshot.schema().find_label(LABELS[e.weight().0]).unwrap()))
                .collect();
            prop_assert_eq!(found, expected);
            let ids = |components: Vec<Vec<NodeId>>| {
                sets(components.into_iter().map(|c| c.into_iter().map(|id| id.0).collect()).collect())
            };
            let own_ids = tarjan_scc(&own).into_iter()
                .map(|c| c.into_iter().map(|index| own[index]).collect()).collect();
            let expected = sets(own_ids);
            prop_assert_eq!(&ids(tarjan_scc(snapshot)), &expected);
            prop_assert_eq!(&ids(kosaraju_scc(snapshot)), &expected);
            prop_assert_eq!(is_cyclic_directed(snapshot), is_cyclic_directed(&own));
            prop_assert_eq!(toposort(snapshot, None).is_ok(), toposort(&own, None).is_ok());
            prop_assert_eq!(snapshot.edge_references().count(), own.edge_count());
            prop_assert!(snapshot.node_references().all(|node| snapshot.from_index(snapshot.to_index(node.id())) == node.id()));
            snapshot.check().unwrap();
        }
    }

    #[test]
    fn what_is_not_there_has_no_neighbours() {
        let graph = Graph::in_memory(Schema::open());
        let snapshot = graph.snapshot();
        assert_eq!((&snapshot).neighbors(NodeId(5)).count(), 0);
        assert_eq!(tarjan_scc(&snapshot).len(), 0);
        assert_eq!(snapshot.to_index(NodeId(5)), 0);
    }
}
