//! The root of a version: the words in the ring from which all that the version has is found.

use super::{Address, trie};
use crate::Time;

/// What a word of a root holds.
trait Bits {
    fn to_bits(self) -> u64;
    fn from_bits(bits: u64) -> Self;
}

impl Bits for u64 {
    fn to_bits(self) -> u64 {
        self
    }

    fn from_bits(bits: u64) -> Self {
        bits
    }
}

impl Bits for i64 {
    fn to_bits(self) -> u64 {
        self.cast_unsigned()
    }

    fn from_bits(bits: u64) -> Self {
        bits.cast_signed()
    }
}

/// Defines a root and its words, which are its fields in their order.
macro_rules! root {
    ($(#[$of_root:meta])* { $($(#[$of_field:meta])* $field:ident: $kind:ty,)* }) => {
        $(#[$of_root])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        pub(crate) struct Root {
            $($(#[$of_field])* pub(crate) $field: $kind,)*
        }

        /// Words of a root.
        pub(crate) const ROOT_WORDS: usize = [$(stringify!($field)),*].len();

        impl Root {
            pub(super) fn to_words(self) -> [u64; ROOT_WORDS] {
                [$(Bits::to_bits(self.$field)),*]
            }

            pub(super) fn from_words(words: [u64; ROOT_WORDS]) -> Self {
                let [$($field),*] = words;
                Self { $($field: Bits::from_bits($field)),* }
            }
        }
    };
}

root! {
    /// One version of the graph: where its structures begin.
    {
        version: u64,
        time: i64,
        /// Link to the trie from node id to node record.
        nodes: trie::Link,
        /// Tree from (hash of name, node id) to node record.
        names: Address,
        /// Directory by type: tree of node ids, count.
        types: Address,
        /// Directory by label: tree of (from, to), count.
        labels: Address,
        /// Blob: the schema, and how often it changed.
        schema: Address,
        schema_version: u64,
        /// Blob: the names of the agents that have written.
        writers: Address,
        node_count: u64,
        edge_count: u64,
        next_id: u64,
        /// Tree from (label, type of source, type of target) to how many edges are such.
        triples: Address,
        /// Directory by attribute with an index: tree of (value's place in the order, node id), count.
        values: Address,
        /// The agent that made the version: 1 more than its number among the writers, 0 for none.
        agent: u64,
        /// Blob: the rules that were applied; 0 for none.
        rules: Address,
        /// Tree from (client, 0) to the client's last transaction.
        answers: Address,
        /// The epoch of the first store of this graph.
        lineage: u64,
        /// The row of cells, and how many they are.
        cells: Address,
        cell_count: u64,
        /// The record of a node which the trie has elsewhere, see the file `late`; 0 for none.
        late_node: Address,
        /// A client whose last transaction the tree of answers does not have, and that; 0 for none.
        late_client: u64,
        late_answer: Address,
        /// Fills the root's last cache line.
        reserved: u64,
    }
}

impl Root {
    pub(crate) fn time(&self) -> Time {
        Time::from_nanoseconds(self.time)
    }
}
