//! What a pattern can be looked for in.
//!
//! Guarantee: matching, conditions and values ask a graph nothing but what is here, so they mean
//! the same in the shared graph and in a graph that is worked on in memory.

use dsr::{
    AttributeId, EdgeKey, LabelId, NodeId, ReadError, Snapshot, TripleCount, TypeId, Value,
    ValueRange, Version,
};

/// A graph in which patterns are looked for.
pub(crate) trait Host {
    /// A node that was looked up.
    type Node<'a>: Copy
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
    /// Whether an edge of the label leads from the node to that of the id.
    fn has_target(
        &self,
        from: Self::Node<'_>,
        label: LabelId,
        to: NodeId,
    ) -> Result<bool, ReadError>;
    /// Whether an edge of the label leads to the node from that of the id.
    fn has_source(
        &self,
        to: Self::Node<'_>,
        label: LabelId,
        from: NodeId,
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
    /// The nodes of exactly this type.
    fn members(&self, exact: TypeId) -> Self::Ids<'_>;
    /// The edges of a label.
    fn edges(&self, label: LabelId) -> Self::Edges<'_>;
    /// Among other nodes, those whose value of an attribute is in the range; only of attributes
    /// with an index.
    fn by_value(&self, attribute: AttributeId, range: &ValueRange) -> Self::Ids<'_>;

    /// How many nodes are of exactly this type.
    fn count_of_type(&self, exact: TypeId) -> Result<u64, ReadError>;
    /// How many edges of a label join nodes of which types.
    fn triples(&self, label: LabelId, visit: &mut dyn FnMut(TripleCount)) -> Result<(), ReadError>;

    fn has_edge(&self, key: EdgeKey) -> Result<bool, ReadError> {
        match self.find(key.from)? {
            Some(from) => self.has_target(from, key.label, key.to),
            None => Ok(false),
        }
    }
}

impl Host for Snapshot {
    type Node<'a> = dsr::Node<'a>;
    type Ids<'a> = dsr::NodeIds<'a>;
    type Ends<'a> = dsr::TypedIds<'a>;
    type Edges<'a> = Box<dyn Iterator<Item = Result<(EdgeKey, [TypeId; 2]), ReadError>> + 'a>;

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

    fn has_target(
        &self,
        from: Self::Node<'_>,
        label: LabelId,
        to: NodeId,
    ) -> Result<bool, ReadError> {
        from.has_target(label, to)
    }

    fn has_source(
        &self,
        to: Self::Node<'_>,
        label: LabelId,
        from: NodeId,
    ) -> Result<bool, ReadError> {
        to.has_source(label, from)
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

    fn members(&self, exact: TypeId) -> Self::Ids<'_> {
        self.ids_of_type(exact)
    }

    fn edges(&self, label: LabelId) -> Self::Edges<'_> {
        Box::new(self.typed_edges_of_label(label))
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
