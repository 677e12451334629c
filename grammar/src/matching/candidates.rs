//! Where nodes for a variable come from.
//!
//! Guarantee: each source gives every node once, with its exact type, in an order that the graph
//! alone determines.

use super::host::Host;
use dsr::{EdgeKey, NodeId, ReadError, TypeId};
use std::fmt;
use std::sync::Arc;

/// So many are read together where they do not lie together.
const TOGETHER: usize = 32;

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
    /// The nodes at the other ends of a node's edges.
    Ends(H::Ends<'h>),
    /// The nodes that an index has.
    Indexed(&'h H, H::Ids<'h>),
    Edges(H::Edges<'h>),
}

/// What one or two variables could stand for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Candidate {
    Node(NodeId, TypeId),
    Edge(EdgeKey, [TypeId; 2]),
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

    /// Gives some of those that are left to `visit`; whether there may be more. Without an error only,
    /// what was visited is there.
    pub(crate) fn visit_some(
        &mut self,
        host: &'h H,
        mut visit: impl FnMut(Candidate),
    ) -> Result<bool, ReadError> {
        match self {
            Self::Edges(edges) => {
                return host.visit_edges(edges, |key, types| visit(Candidate::Edge(key, types)));
            }
            Self::Members {
                host,
                types,
                next,
                ids,
            } => loop {
                if let Some(ids) = ids {
                    // They are of the type whose members come last.
                    let exact = types[*next - 1];
                    let mut any = false;
                    let more = host.visit_ids(ids, |id| {
                        any = true;
                        visit(Candidate::Node(id, exact));
                    })?;
                    if any || more {
                        return Ok(more || *next < types.len());
                    }
                }
                let Some(&exact) = types.get(*next) else {
                    return Ok(false);
                };
                *next += 1;
                *ids = Some(host.members(exact));
            },
            _ => {}
        }
        for _ in 0..TOGETHER {
            match self.next().transpose()? {
                Some(candidate) => visit(candidate),
                None => return Ok(false),
            }
        }
        Ok(true)
    }
}

impl<H: Host> fmt::Debug for Candidates<'_, H> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Candidates").finish_non_exhaustive()
    }
}

impl<H: Host> Iterator for Candidates<'_, H> {
    type Item = Result<Candidate, ReadError>;

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        match self {
            Self::Ends(ends) => {
                let end = ends.next()?;
                Some(end.map(|(id, exact)| Candidate::Node(id, exact)))
            }
            Self::Members {
                host,
                types,
                next,
                ids,
            } => loop {
                if let Some(id) = ids.as_mut().and_then(Iterator::next) {
                    // It is of the type whose members come last.
                    let exact = types[*next - 1];
                    return Some(id.map(|id| Candidate::Node(id, exact)));
                }
                let exact = *types.get(*next)?;
                *next += 1;
                *ids = Some(host.members(exact));
            },
            Self::Indexed(host, ids) => loop {
                let found = ids.next()?.and_then(|id| Ok((id, host.find(id)?)));
                match found {
                    // What is worked on in memory may have lost a node that the index has.
                    Ok((_, None)) => {}
                    Ok((id, Some(node))) => {
                        return Some(Ok(Candidate::Node(id, host.type_of(node))));
                    }
                    Err(error) => return Some(Err(error)),
                }
            },
            Self::Edges(edges) => {
                let edge = edges.next()?;
                Some(edge.map(|(key, types)| Candidate::Edge(key, types)))
            }
            Self::Nothing => None,
        }
    }
}
