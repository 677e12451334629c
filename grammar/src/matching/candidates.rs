//! Where nodes for a variable come from.
//!
//! Guarantee: each source gives every node once, in an order that the graph alone determines.

use super::host::Host;
use dsr::{NodeId, ReadError, TypeId};
use std::fmt;
use std::sync::Arc;

/// Nodes that a variable, or edges whose ends two variables, could stand for.
pub(crate) enum Candidates<'h, H: Host + 'h> {
    Nothing,
    /// The nodes of these types, one type after another.
    Members {
        host: &'h H,
        types: Arc<[TypeId]>,
        next: usize,
        ids: Option<H::Ids<'h>>,
    },
    Ids(H::Ids<'h>),
    Edges(H::Edges<'h>),
}

impl<'h, H: Host> Candidates<'h, H> {
    pub(crate) fn members(host: &'h H, types: &Arc<[TypeId]>) -> Self {
        Self::Members {
            host,
            types: Arc::clone(types),
            next: 0,
            ids: None,
        }
    }
}

impl<H: Host> fmt::Debug for Candidates<'_, H> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Candidates").finish_non_exhaustive()
    }
}

impl<H: Host> Iterator for Candidates<'_, H> {
    /// A node, or both ends of an edge.
    type Item = Result<(NodeId, Option<NodeId>), ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        match self {
            Self::Nothing => None,
            Self::Members {
                host,
                types,
                next,
                ids,
            } => loop {
                if let Some(id) = ids.as_mut().and_then(Iterator::next) {
                    return Some(id.map(|id| (id, None)));
                }
                let exact = *types.get(*next)?;
                *next += 1;
                *ids = Some(host.members(exact));
            },
            Self::Ids(ids) => ids.next().map(|id| id.map(|id| (id, None))),
            Self::Edges(edges) => edges
                .next()
                .map(|key| key.map(|key| (key.from, Some(key.to)))),
        }
    }
}
