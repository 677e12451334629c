//! Which parts of a match a changed node or edge can touch.
//!
//! Guarantee: a match that appears or goes with a change binds the nodes of one of the change's
//! seeds, or the pattern is matched afresh. Where a quantified node changes, the seeds are found
//! along the links which must be there for it to matter: each of them is there after the change,
//! or was taken away by it and gives seeds of its own.

use super::super::domain::Domain;
use super::super::host::Host;
use super::super::program::{Link, Term, Test};
use super::super::query::Query;
use super::set::Seed;
use dsr::{AttributeId, LabelId, NodeId, ReadError};
use std::collections::BTreeSet;

/// How a changed node comes to bind a slot of the match.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Anchor {
    /// It stands in it.
    Slot(usize),
    /// It stands in a quantified slot, which links join to the slot of a match.
    Near { hops: Vec<Hop>, slot: usize },
    /// It stands in a quantified slot that nothing joins to the match.
    Anywhere,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Hop {
    label: Option<LabelId>,
    outwards: bool,
}

/// What a change can do to matches that bind some nodes.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Can {
    pub(super) make: bool,
    /// Each has to be looked at.
    pub(super) break_some: bool,
    /// None is left: a link of theirs is gone.
    pub(super) break_all: bool,
}
impl Can {
    pub(super) const EITHER: Self = Self {
        make: true,
        break_some: true,
        break_all: false,
    };

    pub(super) fn add(&mut self, other: Self) {
        self.make |= other.make;
        self.break_some |= other.break_some;
        self.break_all |= other.break_all;
    }
}

/// What a changed edge can do.
#[derive(Debug, Clone)]
pub(super) struct EdgeTrigger {
    pub(super) label: LabelId,
    pub(super) from: Anchor,
    pub(super) to: Anchor,
    /// Only if this attribute changed, or the edge came or went.
    pub(super) attribute: Option<AttributeId>,
    /// Whether an edge that came can make matches, and break some; one that went the other way.
    pub(super) makes: bool,
    pub(super) breaks: bool,
}

/// What a changed node can do.
#[derive(Debug, Clone)]
pub(super) struct NodeTrigger {
    pub(super) anchor: Anchor,
    pub(super) when: When,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum When {
    /// This attribute changed, or all may have.
    Attribute(AttributeId),
    /// It came with a type of the domain (no link of the pattern leads to it), or changed it.
    Came(Domain),
    /// It changed its type.
    Retyped,
    /// It came, went or changed its type.
    Membership(Domain),
}

/// Everything that can change the matches of a pattern, but that a node of a match goes.
#[derive(Debug, Default)]
pub(super) struct Triggers {
    pub(super) edges: Vec<EdgeTrigger>,
    pub(super) nodes: Vec<NodeTrigger>,
}

impl Triggers {
    pub(super) fn of(query: &Query) -> Self {
        let mut triggers = Self::default();
        for link in &query.links {
            triggers.link(link, None, &Scope::new(query), !link.negated, link.negated);
        }
        for (slot, domain) in query.domains.iter().enumerate() {
            let mut links = query.links.iter().filter(|link| !link.negated);
            let joined = links.any(|link| link.from == slot || link.to == slot);
            triggers.nodes.push(NodeTrigger {
                anchor: Anchor::Slot(slot),
                when: if joined {
                    When::Retyped
                } else {
                    When::Came(domain.clone())
                },
            });
        }
        for test in &query.tests {
            triggers.test(test, &mut Scope::new(query));
        }
        triggers
    }

    fn link(
        &mut self,
        link: &Link,
        attribute: Option<AttributeId>,
        scope: &Scope,
        makes: bool,
        breaks: bool,
    ) {
        if let Some(label) = link.label {
            self.edges.push(EdgeTrigger {
                label,
                from: scope.anchor(link.from),
                to: scope.anchor(link.to),
                attribute,
                makes,
                breaks,
            });
        }
    }

    fn test(&mut self, test: &Test, scope: &mut Scope) {
        match test {
            Test::Link(link) => self.link(link, None, scope, true, true),
            Test::Same(..) => {}
            Test::Compare(_, left, right) => {
                self.term(left, scope);
                self.term(right, scope);
            }
            Test::Not(inner) => self.test(inner, scope),
            Test::All(tests) | Test::Any(tests) => {
                for inner in tests {
                    self.test(inner, scope);
                }
            }
            Test::Exists(choices, body) | Test::Forall(choices, body) => {
                let outer = scope.near.len();
                for (slot, domain) in choices.domains() {
                    let near = choices.near(slot);
                    scope.near.push(near);
                    let when = match near {
                        Some(_) => When::Retyped,
                        None => When::Membership(domain.clone()),
                    };
                    let anchor = scope.anchor(slot);
                    self.nodes.push(NodeTrigger { anchor, when });
                }
                self.test(body, scope);
                scope.near.truncate(outer);
            }
        }
    }

    fn term(&mut self, term: &Term, scope: &Scope) {
        match term {
            Term::Constant(_) => {}
            Term::NodeAttribute { node, attribute } => {
                if let Some(attribute) = attribute {
                    self.nodes.push(NodeTrigger {
                        anchor: scope.anchor(*node),
                        when: When::Attribute(*attribute),
                    });
                }
            }
            Term::EdgeAttribute { link, attribute } => {
                if attribute.is_some() {
                    self.link(link, *attribute, scope, true, true);
                }
            }
            Term::Arithmetic(_, operands) => {
                for operand in operands {
                    self.term(operand, scope);
                }
            }
        }
    }
}

/// The quantified slots in scope: by which link each is near what is bound before it.
struct Scope {
    variables: usize,
    near: Vec<Option<Link>>,
}

impl Scope {
    fn new(query: &Query) -> Self {
        Self {
            variables: query.variables.len(),
            near: Vec::new(),
        }
    }

    fn anchor(&self, slot: usize) -> Anchor {
        let mut hops = Vec::new();
        let mut at = slot;
        while at >= self.variables {
            let Some(Some(link)) = self.near.get(at - self.variables) else {
                return Anchor::Anywhere;
            };
            let outwards = link.from == at;
            let label = link.label;
            hops.push(Hop { label, outwards });
            at = if outwards { link.to } else { link.from };
        }
        if hops.is_empty() {
            Anchor::Slot(slot)
        } else {
            Anchor::Near { hops, slot: at }
        }
    }
}

/// Partial matches that a change touches.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Seeds {
    All,
    These(Vec<Seed>),
}

impl Anchor {
    /// What a node that stands here binds.
    pub(super) fn seeds<H: Host>(&self, host: &H, node: NodeId) -> Result<Seeds, ReadError> {
        let (hops, slot) = match self {
            Self::Slot(slot) => return Ok(Seeds::These(vec![vec![(*slot, node)]])),
            Self::Anywhere => return Ok(Seeds::All),
            Self::Near { hops, slot } => (hops, *slot),
        };
        let mut nodes = BTreeSet::from([node]);
        for hop in hops {
            let mut next = BTreeSet::new();
            for &node in &nodes {
                let (Some(label), Some(node)) = (hop.label, host.find(node)?) else {
                    continue;
                };
                let ends = if hop.outwards {
                    host.targets(node, label)
                } else {
                    host.sources(node, label)
                };
                for end in ends {
                    next.insert(end?.0);
                }
            }
            nodes = next;
        }
        let seeds = nodes.into_iter().map(|node| vec![(slot, node)]);
        Ok(Seeds::These(seeds.collect()))
    }

    fn distance(&self) -> usize {
        match self {
            Self::Slot(_) => 0,
            Self::Near { hops, .. } => hops.len(),
            Self::Anywhere => usize::MAX,
        }
    }
}

impl EdgeTrigger {
    /// Whether every match has the edge between the nodes that it binds.
    pub(super) fn is_link(&self) -> bool {
        let bound = |anchor: &Anchor| matches!(anchor, Anchor::Slot(_));
        self.makes && !self.breaks && bound(&self.from) && bound(&self.to)
    }

    /// What an edge between these nodes binds.
    pub(super) fn seeds<H: Host>(
        &self,
        host: &H,
        from: NodeId,
        to: NodeId,
    ) -> Result<Seeds, ReadError> {
        match (&self.from, &self.to) {
            (Anchor::Slot(a), Anchor::Slot(b)) if a == b => Ok(Seeds::These(if from == to {
                vec![vec![(*a, from)]]
            } else {
                Vec::new()
            })),
            (Anchor::Slot(a), Anchor::Slot(b)) => {
                let mut seed = vec![(*a, from), (*b, to)];
                seed.sort_unstable();
                Ok(Seeds::These(vec![seed]))
            }
            (a, b) if a.distance() <= b.distance() => a.seeds(host, from),
            (_, b) => b.seeds(host, to),
        }
    }
}
