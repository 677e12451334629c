//! The small numbers that stand for things in the graph. This file owns their meaning; nothing
//! else makes one out of a bare integer except the decoder of the arena.

use serde::{Deserialize, Serialize};
use std::fmt;

macro_rules! id {
    ($(#[$doc:meta])* $name:ident($inner:ty)) => {
        $(#[$doc])*
        #[derive(
            Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
        )]
        pub struct $name(pub $inner);

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{}", self.0)
            }
        }
    };
}

id!(
    /// A node, for as long as the graph lives: ids are never given twice.
    NodeId(u64)
);
id!(
    /// A node type of the schema.
    TypeId(u16)
);
id!(
    /// An edge label of the schema.
    LabelId(u16)
);
id!(
    /// An attribute name of the schema.
    AttributeId(u16)
);
id!(
    /// A state of the graph: the number of the commit that made it. The empty graph has version 0.
    Version(u64)
);
id!(
    /// One life of a store. A restarted store has a new one, so that nothing of the old is taken
    /// for the new.
    Epoch(u64)
);
id!(
    /// An agent that has written to the graph; [`crate::Snapshot::writer_name`] tells its name.
    WriterId(u16)
);

/// What names an edge: there is at most one per source, label and target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct EdgeKey {
    /// Where the edge starts.
    pub from: NodeId,
    /// Its label.
    pub label: LabelId,
    /// Where it ends.
    pub to: NodeId,
}
