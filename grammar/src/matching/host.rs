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
    /// Ids of nodes, one after another.
    type Ids<'a>: Iterator<Item = Result<NodeId, ReadError>>
    where
        Self: 'a;
    /// Keys of edges, one after another.
    type Edges<'a>: Iterator<Item = Result<EdgeKey, ReadError>>
    where
        Self: 'a;

    /// Equal where nothing can have changed.
    fn version(&self) -> Version;

    /// The node's exact type; `None` if it is not there.
    fn type_of(&self, node: NodeId) -> Result<Option<TypeId>, ReadError>;
    fn has_edge(&self, key: EdgeKey) -> Result<bool, ReadError>;
    fn node_value(&self, node: NodeId, attribute: AttributeId) -> Result<Option<Value>, ReadError>;
    fn edge_value(&self, key: EdgeKey, attribute: AttributeId) -> Result<Option<Value>, ReadError>;

    /// Where the edges of a label that start at a node end, by ascending id; `None` if the node
    /// is not there.
    fn targets(&self, from: NodeId, label: LabelId) -> Result<Option<Self::Ids<'_>>, ReadError>;
    /// Where the edges of a label that end at a node start, by ascending id; `None` if the node
    /// is not there.
    fn sources(&self, to: NodeId, label: LabelId) -> Result<Option<Self::Ids<'_>>, ReadError>;
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
}

impl Host for Snapshot {
    type Ids<'a> = dsr::NodeIds<'a>;
    type Edges<'a> = Box<dyn Iterator<Item = Result<EdgeKey, ReadError>> + 'a>;

    fn version(&self) -> Version {
        self.version()
    }

    fn type_of(&self, node: NodeId) -> Result<Option<TypeId>, ReadError> {
        Ok(self.find_node(node)?.map(|node| node.type_id()))
    }

    fn has_edge(&self, key: EdgeKey) -> Result<bool, ReadError> {
        Ok(self.find_edge(key)?.is_some())
    }

    fn node_value(&self, node: NodeId, attribute: AttributeId) -> Result<Option<Value>, ReadError> {
        let Some(node) = self.find_node(node)? else {
            return Ok(None);
        };
        Ok(node.attribute(attribute)?.map(|held| held.value))
    }

    fn edge_value(&self, key: EdgeKey, attribute: AttributeId) -> Result<Option<Value>, ReadError> {
        let Some(edge) = self.find_edge(key)? else {
            return Ok(None);
        };
        Ok(edge.attribute(attribute)?.map(|held| held.value))
    }

    fn targets(&self, from: NodeId, label: LabelId) -> Result<Option<Self::Ids<'_>>, ReadError> {
        Ok(self.find_node(from)?.map(|node| node.targets_of(label)))
    }

    fn sources(&self, to: NodeId, label: LabelId) -> Result<Option<Self::Ids<'_>>, ReadError> {
        Ok(self.find_node(to)?.map(|node| node.sources_of(label)))
    }

    fn members(&self, exact: TypeId) -> Self::Ids<'_> {
        self.ids_of_type(exact)
    }

    fn edges(&self, label: LabelId) -> Self::Edges<'_> {
        Box::new(self.edges_of_label(label))
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
