//! What each step of a plan finds, and what can be said of it there: the parts that every search is made
//! of, and the search for a first match.
//!
//! Guarantee: what a step finds is of the right types and in no other slot.

use super::ahead::{Ahead, Ends};
use super::candidates::{Candidate, Candidates};
use super::environment::{Environment, Interrupt, node};
use super::host::{Host, Way};
use super::plan::{Anchor, Plan, Source, Step};
use super::program::{Link, Slot};
use super::query::Query;
use dsr::{EdgeKey, NodeId, ReadError, TypeId};

/// A candidate counts once more for each time that it must be none of so many other nodes.
const OTHERS: usize = 16;

/// What a search fills.
pub(crate) struct Slots<'s> {
    pub(crate) environment: &'s mut Environment,
    /// By step, what was read of its candidates.
    pub(crate) ahead: &'s mut [Ahead],
}

/// What a search goes by.
pub(crate) struct Frame<'h, 'p, H: Host> {
    pub(crate) host: &'h H,
    pub(crate) query: &'p Query,
    pub(crate) plan: &'p Plan,
}

/// How many candidates were read, and from which node on to read on, if there are more.
type Read = (u64, Option<NodeId>);

impl<'h, H: Host> Frame<'h, '_, H> {
    /// Puts the first match into the slots, those that are given kept.
    pub(crate) fn first(&self, slots: &mut Slots<'_>) -> Result<bool, Interrupt> {
        Ok(self.given_holds(slots.environment)? && self.descend(0, slots)?)
    }

    fn descend(&self, depth: usize, slots: &mut Slots<'_>) -> Result<bool, Interrupt> {
        if depth == self.plan.steps.len() {
            return Ok(true);
        }
        let step = &self.plan.steps[depth];
        let mut other = self.open(step);
        slots.ahead[depth].begin();
        loop {
            if let Some(ends) = slots.ahead[depth].next() {
                step.bind(ends, slots.environment);
                if self.passes(step, &[], slots.environment)? && self.descend(depth + 1, slots)? {
                    return Ok(true);
                }
            } else if let Some((from, rows)) = slots.ahead[depth].read_on() {
                let anchor = step.anchors.first().filter(|_| step.follows());
                let edges = anchor.map(|anchor| self.edges(*anchor, slots.environment));
                let edges = edges.transpose()?.flatten();
                let read = self.read(step, edges, from, &mut other, (rows, slots.environment));
                let (_, more) = read?;
                slots.ahead[depth].stopped_at(more);
            } else {
                return Ok(false);
            }
        }
    }

    /// What can be said of the slots that are bound from the start.
    pub(super) fn given_holds(&self, environment: &mut Environment) -> Result<bool, Interrupt> {
        Ok(self.given_fits(environment)? && self.tests_hold(&self.plan.tests, environment)?)
    }

    /// The same, conditions left aside.
    pub(super) fn given_fits(&self, environment: &Environment) -> Result<bool, Interrupt> {
        let Self { host, query, plan } = self;
        for (index, &slot) in plan.given.iter().enumerate() {
            let taken = environment[slot];
            let mut others = plan.given[..index].iter();
            if others.any(|&other| environment[other] == taken) {
                return Ok(false);
            }
            let node = node(environment, slot).map(|id| host.find(id));
            let exact = node.transpose()?.flatten().map(|node| host.type_of(node));
            if !exact.is_some_and(|exact| query.domains[slot].contains(exact)) {
                return Ok(false);
            }
        }
        for &link in &plan.links {
            let link = &query.links[link];
            let edges = self.edges(Anchor::of(Way::Out, link.from), environment)?;
            if !self.link_holds(link, Way::Out, edges, environment)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Whether the links and conditions hold that are looked at after a step; `found` has the edges at
    /// the step's anchors, as far as somebody has looked for them.
    #[inline]
    pub(super) fn passes(
        &self,
        step: &Step,
        found: &[Option<H::Adjacency<'h>>],
        environment: &mut Environment,
    ) -> Result<bool, Interrupt> {
        Ok(self.links_hold(step, found, environment)?
            && (step.tests.is_empty() || self.tests_hold(&step.tests, environment)?))
    }

    /// The same, conditions left aside.
    #[inline]
    pub(super) fn links_hold(
        &self,
        step: &Step,
        found: &[Option<H::Adjacency<'h>>],
        environment: &Environment,
    ) -> Result<bool, Interrupt> {
        for &(link, anchor) in &step.links {
            let link = &self.query.links[link];
            let way = if step.binds.contains(&Some(link.from)) {
                Way::In
            } else {
                Way::Out
            };
            let edges = match anchor.and_then(|anchor| found.get(anchor)) {
                Some(edges) => *edges,
                None => {
                    let slot = match way {
                        Way::Out => link.from,
                        Way::In => link.to,
                    };
                    self.edges(Anchor::of(way, slot), environment)?
                }
            };
            if !self.link_holds(link, way, edges, environment)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Whether conditions hold, by their indices.
    pub(super) fn tests_hold(
        &self,
        tests: &[usize],
        environment: &mut Environment,
    ) -> Result<bool, Interrupt> {
        for &test in tests {
            if !self.query.tests[test].holds(self.host, environment)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The edges at the node of a slot.
    #[inline]
    pub(super) fn edges(
        &self,
        anchor: Anchor,
        environment: &Environment,
    ) -> Result<Option<H::Adjacency<'h>>, ReadError> {
        let host: &'h H = self.host;
        node(environment, anchor.slot)
            .map(|node| host.adjacency(anchor.way, node))
            .transpose()
    }

    /// Whether the link is there, or is not where it must not be, by the edges of one of its ends.
    #[inline]
    fn link_holds(
        &self,
        link: &Link,
        way: Way,
        edges: Option<H::Adjacency<'h>>,
        environment: &Environment,
    ) -> Result<bool, ReadError> {
        let other = match way {
            Way::Out => link.to,
            Way::In => link.from,
        };
        let (Some(edges), Some(label), Some(other)) = (edges, link.label, node(environment, other))
        else {
            return Ok(link.negated);
        };
        Ok(self.host.has_end(edges, label, other)? != link.negated)
    }

    /// Begins a step; where it does not follow a link, what it finds comes back.
    pub(super) fn open(&self, step: &Step) -> Option<Candidates<'h, H>> {
        let Self { host, query, .. } = *self;
        Some(match step.source {
            Source::Out { .. } | Source::In { .. } => return None,
            Source::Nodes { slot } => Candidates::members(host, query.domains[slot].types()),
            Source::Edges { link } => match query.links[link].label {
                Some(label) => Candidates::Edges(host.edges(label)),
                None => Candidates::Nothing,
            },
            Source::Values { bound } => {
                let bound = &query.bounds[bound];
                Candidates::Indexed(host, host.by_value(bound.attribute, &bound.range))
            }
        })
    }

    /// Reads some candidates of a step, those along a link from a node on, and keeps what is of the
    /// right type and in no other slot. A step that follows links follows these edges.
    #[inline]
    pub(super) fn read(
        &self,
        step: &Step,
        edges: Option<H::Adjacency<'h>>,
        from: NodeId,
        other: &mut Option<Candidates<'h, H>>,
        (rows, environment): (&mut Vec<Ends>, &mut Environment),
    ) -> Result<Read, Interrupt> {
        let read = match (edges, step.label, step.binds[0], other) {
            (Some(edges), Some(label), Some(slot), _) if step.follows() => {
                let (domain, others) = (&self.query.domains[slot], &step.others[0]);
                let mut visited = 0;
                let more = self.host.visit_ends(edges, label, from, |id, exact| {
                    visited += 1;
                    if domain.contains(exact) && !is_in(others, id, environment) {
                        rows.push([id; 2]);
                    }
                });
                (visited, more?)
            }
            (.., Some(other)) => self.take(other, step, (rows, environment))?,
            _ => (0, None),
        };
        // In a wide pattern, holding a candidate against all others is what takes the time.
        let others = step.others[0].len() / OTHERS;
        environment.spend(read.0.saturating_mul(1 + others as u64))?;
        Ok(read)
    }

    #[inline(never)]
    fn take(
        &self,
        other: &mut Candidates<'h, H>,
        step: &Step,
        (rows, environment): (&mut Vec<Ends>, &Environment),
    ) -> Result<Read, ReadError> {
        let fits = |index: usize, (id, exact): (NodeId, TypeId)| {
            step.binds[index].is_none_or(|slot| {
                self.query.domains[slot].contains(exact)
                    && !is_in(&step.others[index], id, environment)
            })
        };
        let mut read = 0;
        let more = other.visit_some(self.host, |candidate| {
            read += 1;
            match candidate {
                Candidate::Node(id, exact) if fits(0, (id, exact)) => rows.push([id; 2]),
                Candidate::Edge(EdgeKey { from, to, .. }, [source, target])
                    if from != to && fits(0, (from, source)) && fits(1, (to, target)) =>
                {
                    rows.push([from, to]);
                }
                _ => {}
            }
        })?;
        Ok((read, more.then_some(NodeId(0))))
    }
}

/// Whether one of the slots has the node.
#[inline]
fn is_in(slots: &[usize], id: NodeId, environment: &Environment) -> bool {
    slots
        .iter()
        .any(|&slot| environment[slot] == Slot::Node(id))
}
