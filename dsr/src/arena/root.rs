//! The root of a version: the words in the ring from which all that the version has is found.

use super::{Address, trie};
use crate::Time;

/// Words of a root.
pub(crate) const ROOT_WORDS: usize = 20;

/// One version of the graph: where its structures begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Root {
    pub(crate) version: u64,
    pub(crate) time: i64,
    /// Link to the trie from node id to node record.
    pub(crate) nodes: trie::Link,
    /// Tree from (hash of name, node id) to node record.
    pub(crate) names: Address,
    /// Directory by type: tree of node ids, count.
    pub(crate) types: Address,
    /// Directory by label: tree of (from, to), count.
    pub(crate) labels: Address,
    /// Blob: the schema, and how often it changed.
    pub(crate) schema: Address,
    pub(crate) schema_version: u64,
    /// Blob: the names of the agents that have written.
    pub(crate) writers: Address,
    pub(crate) node_count: u64,
    pub(crate) edge_count: u64,
    pub(crate) next_id: u64,
    /// Tree from (label, type of source, type of target) to how many edges are such.
    pub(crate) triples: Address,
    /// Directory by attribute with an index: tree of (value's place in the order, node id), count.
    pub(crate) values: Address,
    /// The agent that made the version: 1 more than its number among the writers, 0 for none.
    pub(crate) agent: u64,
    /// Blob: the rules that were applied; 0 for none.
    pub(crate) rules: Address,
    /// Tree from (client, 0) to the client's last transaction.
    pub(crate) answers: Address,
    /// The epoch of the first store of this graph.
    pub(crate) lineage: u64,
    /// The row of cells, and how many they are.
    pub(crate) cells: Address,
    pub(crate) cell_count: u64,
}

impl Root {
    pub(super) fn to_words(self) -> [u64; ROOT_WORDS] {
        let Self {
            version,
            time,
            nodes,
            names,
            types,
            labels,
            schema,
            schema_version,
            writers,
            node_count,
            edge_count,
            next_id,
            triples,
            values,
            agent,
            rules,
            answers,
            lineage,
            cells,
            cell_count,
        } = self;
        let time = time.cast_unsigned();
        [
            version,
            time,
            nodes,
            names,
            types,
            labels,
            schema,
            schema_version,
            writers,
            node_count,
            edge_count,
            next_id,
            triples,
            values,
            agent,
            rules,
            answers,
            lineage,
            cells,
            cell_count,
        ]
    }

    pub(super) fn from_words(words: [u64; ROOT_WORDS]) -> Self {
        let [
            version,
            time,
            nodes,
            names,
            types,
            labels,
            schema,
            schema_version,
            writers,
            node_count,
            edge_count,
            next_id,
            triples,
            values,
            agent,
            rules,
            answers,
            lineage,
            cells,
            cell_count,
        ] = words;
        let time = time.cast_signed();
        Self {
            version,
            time,
            nodes,
            names,
            types,
            labels,
            schema,
            schema_version,
            writers,
            node_count,
            edge_count,
            next_id,
            triples,
            values,
            agent,
            rules,
            answers,
            lineage,
            cells,
            cell_count,
        }
    }

    pub(crate) fn time(&self) -> Time {
        Time::from_nanoseconds(self.time)
    }
}
