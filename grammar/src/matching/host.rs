//! What a pattern can be looked for in.
//!
//! Guarantee: matching, conditions and values ask a graph nothing but what is here, so they mean
//! the same in the shared graph and in a graph that is worked on in memory.

use dsr::{
    AttributeId, EdgeKey, LabelId, NodeId, ReadError, Snapshot, TripleCount, TypeId, Value,
    ValueRange, Version,
};

/// Which way edges are followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Way {
    /// From their sources to their targets.
    Out,
    /// From their targets to their sources.
    In,
}

/// A graph in which patterns are looked for.
pub(crate) trait Host {
    /// A node that was looked up.
    type Node<'a>: Copy
    where
        Self: 'a;
    /// A node's edges that go one way, found but not yet read.
    type Adjacency<'a>: Copy
    where
        Self: 'a;
    /// Ids of nodes, one after another.
    type Ids<'a>: Iterator<Item = Result<NodeId, ReadError>>
    where
        Self: 'a;
    /// Nodes with their exact types, one after another.
    type Ends<'a>: Iterator<Item = Result<(NodeId, TypeId), ReadError>>
    where
        Self: 'a;
    /// Edges with the exact types of source and target, one after another.
    type Edges<'a>: Iterator<Item = Result<(EdgeKey, [TypeId; 2]), ReadError>>
    where
        Self: 'a;

    /// Equal where nothing can have changed.
    fn version(&self) -> Version;

    /// Looks a node up.
    fn find(&self, id: NodeId) -> Result<Option<Self::Node<'_>>, ReadError>;
    /// The node's exact type.
    fn type_of(&self, node: Self::Node<'_>) -> TypeId;
    /// Finds a node's edges; none where there is no such node.
    fn adjacency(&self, way: Way, of: NodeId) -> Result<Self::Adjacency<'_>, ReadError>;
    /// Brings edges that were found near the processor: to be asked of many before any of them is read.
    fn fetch(&self, edges: Self::Adjacency<'_>);
    /// Whether one of a label leads to or comes from another node.
    fn has_end(
        &self,
        edges: Self::Adjacency<'_>,
        label: LabelId,
        other: NodeId,
    ) -> Result<bool, ReadError>;
    fn node_value(
        &self,
        node: Self::Node<'_>,
        attribute: AttributeId,
    ) -> Result<Option<Value>, ReadError>;
    fn edge_value(&self, key: EdgeKey, attribute: AttributeId) -> Result<Option<Value>, ReadError>;

    /// Where the edges of a label that start at a node end, by ascending id.
    fn targets<'a>(&'a self, from: Self::Node<'a>, label: LabelId) -> Self::Ends<'a>;
    /// Where the edges of a label that end at a node start, by ascending id.
    fn sources<'a>(&'a self, to: Self::Node<'a>, label: LabelId) -> Self::Ends<'a>;
    /// Gives to `visit` some of the nodes at the other ends of edges that were found, of those from an id
    /// on by ascending id; the id from which to go on, or `None` where there are no more. Without an error
    /// only, what was visited is there.
    fn visit_ends(
        &self,
        edges: Self::Adjacency<'_>,
        label: LabelId,
        from: NodeId,
        visit: impl FnMut(NodeId, TypeId),
    ) -> Result<Option<NodeId>, ReadError>;
    /// The nodes of exactly this type.
    fn members(&self, exact: TypeId) -> Self::Ids<'_>;
    /// Gives some of the ids that are left to `visit`; whether there may be more. Without an error only,
    /// what was visited is there.
    fn visit_ids(
        &self,
        ids: &mut Self::Ids<'_>,
        visit: impl FnMut(NodeId),
    ) -> Result<bool, ReadError>;
    /// The edges of a label.
    fn edges(&self, label: LabelId) -> Self::Edges<'_>;
    /// Gives some of the edges that are left to `visit`; whether there may be more. Without an error only,
    /// what was visited is there.
    fn visit_edges(
        &self,
        edges: &mut Self::Edges<'_>,
        visit: impl FnMut(EdgeKey, [TypeId; 2]),
    ) -> Result<bool, ReadError>;
    /// Among other nodes, those whose value of an attribute is in the range; only of attributes
    /// with an index.
    fn by_value(&self, attribute: AttributeId, range: &ValueRange) -> Self::Ids<'_>;

    /// How many nodes are of exactly this type.
    fn count_of_type(&self, exact: TypeId) -> Result<u64, ReadError>;
    /// How many edges of a label join nodes of which types.
    fn triples(&self, label: LabelId, visit: &mut dyn FnMut(TripleCount)) -> Result<(), ReadError>;

    fn has_edge(&self, key: EdgeKey) -> Result<bool, ReadError> {
        self.has_end(self.adjacency(Way::Out, key.from)?, key.label, key.to)
    }
}

impl Host for Snapshot {
    type Node<'a> = dsr::Node<'a>;
    type Adjacency<'a> = dsr::Adjacency<'a>;
    type Ids<'a> = dsr::NodeIds<'a>;
    type Ends<'a> = dsr::TypedIds<'a>;
    type Edges<'a> = dsr::TypedEdges<'a>;

    fn version(&self) -> Version {
        self.version()
    }

    #[inline]
    fn find(&self, id: NodeId) -> Result<Option<Self::Node<'_>>, ReadError> {
        self.find_node(id)
    }

    fn type_of(&self, node: Self::Node<'_>) -> TypeId {
        node.type_id()
    }

    #[inline]
    fn adjacency(&self, way: Way, of: NodeId) -> Result<Self::Adjacency<'_>, ReadError> {
        match way {
            Way::Out => self.edges_from(of),
            Way::In => self.edges_into(of),
        }
    }

    #[inline]
    fn fetch(&self, edges: Self::Adjacency<'_>) {
        edges.fetch();
    }

    #[inline]
    fn has_end(
        &self,
        edges: Self::Adjacency<'_>,
        label: LabelId,
        other: NodeId,
    ) -> Result<bool, ReadError> {
        edges.has(label, other)
    }

    fn node_value(
        &self,
        node: Self::Node<'_>,
        attribute: AttributeId,
    ) -> Result<Option<Value>, ReadError> {
        Ok(node.attribute(attribute)?.map(|held| held.value))
    }

    fn edge_value(&self, key: EdgeKey, attribute: AttributeId) -> Result<Option<Value>, ReadError> {
        let Some(edge) = self.find_edge(key)? else {
            return Ok(None);
        };
        Ok(edge.attribute(attribute)?.map(|held| held.value))
    }

    fn targets<'a>(&'a self, from: Self::Node<'a>, label: LabelId) -> Self::Ends<'a> {
        from.typed_targets_of(label)
    }

    fn sources<'a>(&'a self, to: Self::Node<'a>, label: LabelId) -> Self::Ends<'a> {
        to.typed_sources_of(label)
    }

    #[inline]
    fn visit_ends(
        &self,
        edges: Self::Adjacency<'_>,
        label: LabelId,
        from: NodeId,
        visit: impl FnMut(NodeId, TypeId),
    ) -> Result<Option<NodeId>, ReadError> {
        edges.visit(label, from, visit)
    }

    fn members(&self, exact: TypeId) -> Self::Ids<'_> {
        self.ids_of_type(exact)
    }

    fn visit_ids(
        &self,
        ids: &mut Self::Ids<'_>,
        visit: impl FnMut(NodeId),
    ) -> Result<bool, ReadError> {
        ids.visit_some(visit)
    }

    fn edges(&self, label: LabelId) -> Self::Edges<'_> {
        self.typed_edges_of_label(label)
    }

    fn visit_edges(
        &self,
        edges: &mut Self::Edges<'_>,
        visit: impl FnMut(EdgeKey, [TypeId; 2]),
    ) -> Result<bool, ReadError> {
        edges.visit_some(visit)
    }

    fn by_value(&self, attribute: AttributeId, range: &ValueRange) -> Self::Ids<'_> {
        self.ids_by_value(attribute, range)
    }

    fn count_of_type(&self, exact: TypeId) -> Result<u64, ReadError> {
        self.count_of_exact_type(exact)
    }

    fn triples(&self, label: LabelId, visit: &mut dyn FnMut(TripleCount)) -> Result<(), ReadError> {
        for triple in self.triple_counts(label) {
            visit(triple?);
        }
        Ok(())
    }
}
