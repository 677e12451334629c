//! Backtracking along a plan.
//!
//! Guarantee: every match comes exactly once, in an order that the graph and the plan alone
//! determine; matches are injective.

use super::MatchError;
use super::ahead::Ahead;
use super::candidates::{Candidate, Candidates};
use super::environment::{Environment, Interrupt, node};
use super::host::{Host, Way};
use super::plan::{Plan, Source, Step, plan};
use super::program::{Link, Slot};
use super::query::{Problem, Query};
use super::statistics::Statistics;
use crate::Binding;
use dsr::{EdgeKey, NodeId, ReadError, Snapshot, TypeId};
use std::fmt;
use std::sync::Arc;

/// So many candidates are read together where they come from no link.
const TOGETHER: usize = 32;

/// A search under way.
#[derive(Debug)]
pub(crate) struct Search<'h, H: Host> {
    host: &'h H,
    problem: Problem,
    plan: Arc<Plan>,
    /// By step, what was read of its candidates.
    ahead: Vec<Ahead>,
    /// By step, where its candidates come from, if not along a link.
    others: Vec<Option<Candidates<'h, H>>>,
    /// The step that is tried.
    depth: usize,
    /// Whether nothing is tested after the last step.
    free: bool,
    /// By step, how many candidates there were, and how many of them passed.
    seen: Vec<[u64; 2]>,
    state: State,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Fresh,
    Running,
    Done,
}

impl<'h, H: Host> Search<'h, H> {
    /// A search by a plan that was made for the problem's query and given slots.
    pub(crate) fn new(host: &'h H, problem: Problem, plan: Arc<Plan>) -> Self {
        Self {
            host,
            problem,
            ahead: vec![Ahead::default(); plan.steps.len()],
            others: plan.steps.iter().map(|_| None).collect(),
            depth: 0,
            free: plan.steps.last().is_some_and(Step::is_free),
            seen: vec![[0; 2]; plan.steps.len()],
            plan,
            state: State::Fresh,
        }
    }

    /// Goes to the next match; `false` where there is none. After that, and after an error, there
    /// is none any more.
    #[inline]
    pub(crate) fn advance(&mut self) -> Result<bool, Interrupt> {
        if self.free
            && self.state == State::Running
            && let (Some(step), Some(ahead)) = (self.plan.steps.last(), self.ahead.last_mut())
            && let Some(ends) = ahead.next()
            && let Some([_, passed]) = self.seen.last_mut()
        {
            let environment = &mut self.problem.environment;
            environment.renew();
            step.bind(ends, environment);
            *passed += 1;
            return Ok(true);
        }
        let found = self.try_advance();
        if !matches!(found, Ok(true)) {
            self.state = State::Done;
        }
        found
    }

    fn try_advance(&mut self) -> Result<bool, Interrupt> {
        let Self {
            host,
            problem: Problem { query, environment },
            plan,
            ahead,
            others,
            depth,
            seen,
            state,
            free: _,
        } = self;
        let frame = Frame {
            host: *host,
            query,
            plan,
        };
        environment.renew();
        let mut slots = Slots { environment, ahead };
        match state {
            State::Done => return Ok(false),
            State::Running => {}
            State::Fresh => {
                *state = State::Running;
                if !frame.given_holds(&mut slots)? {
                    return Ok(false);
                }
                if plan.steps.is_empty() {
                    return Ok(true);
                }
                others[0] = frame.open(0, &mut slots);
            }
        }
        loop {
            let Some(step) = plan.steps.get(*depth) else {
                return Ok(false);
            };
            if let Some(ends) = slots.ahead[*depth].next() {
                step.bind(ends, slots.environment);
                if !frame.passes(step, &mut slots)? {
                    continue;
                }
                seen[*depth][1] += 1;
                if *depth + 1 == plan.steps.len() {
                    return Ok(true);
                }
                *depth += 1;
                if let Some(other) = frame.open(*depth, &mut slots) {
                    others[*depth] = Some(other);
                }
            } else if let Some(from) = slots.ahead[*depth].read_on() {
                let (other, seen) = (&mut others[*depth], &mut seen[*depth][0]);
                *seen += frame.read(*depth, from, other, &mut slots)?;
            } else if let Some(before) = depth.checked_sub(1) {
                *depth = before;
            } else {
                return Ok(false);
            }
        }
    }

    /// By step, how many candidates there were so far, and how many of them passed.
    pub(crate) fn seen(&self) -> &[[u64; 2]] {
        &self.seen
    }

    /// The nodes of the match that [`Self::advance`] went to, by slot.
    pub(crate) fn nodes(&self) -> impl Iterator<Item = NodeId> {
        let variables = self.problem.query.variables.len();
        (0..variables).filter_map(|slot| node(&self.problem.environment, slot))
    }

    fn binding(&self) -> Binding {
        let variables = self.problem.query.variables.iter();
        Binding::of_distinct(variables.cloned().zip(self.nodes()))
    }
}

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

impl<'h, H: Host> Frame<'h, '_, H> {
    /// Puts the first match into the slots, those that are given kept.
    pub(crate) fn first(&self, slots: &mut Slots<'_>) -> Result<bool, Interrupt> {
        Ok(self.given_holds(slots)? && self.descend(0, slots)?)
    }

    fn descend(&self, depth: usize, slots: &mut Slots<'_>) -> Result<bool, Interrupt> {
        if depth == self.plan.steps.len() {
            return Ok(true);
        }
        let step = &self.plan.steps[depth];
        let mut other = self.open(depth, slots);
        loop {
            if let Some(ends) = slots.ahead[depth].next() {
                step.bind(ends, slots.environment);
                if self.passes(step, slots)? && self.descend(depth + 1, slots)? {
                    return Ok(true);
                }
            } else if let Some(from) = slots.ahead[depth].read_on() {
                self.read(depth, from, &mut other, slots)?;
            } else {
                return Ok(false);
            }
        }
    }

    /// What can be said of the slots that are bound from the start.
    fn given_holds(&self, slots: &mut Slots<'_>) -> Result<bool, Interrupt> {
        let Self { host, query, plan } = self;
        for (index, &slot) in plan.given.iter().enumerate() {
            let taken = slots.environment[slot];
            let mut others = plan.given[..index].iter();
            if others.any(|&other| slots.environment[other] == taken) {
                return Ok(false);
            }
            let node = node(slots.environment, slot).map(|id| host.find(id));
            let exact = node.transpose()?.flatten().map(|node| host.type_of(node));
            if !exact.is_some_and(|exact| query.domains[slot].contains(exact)) {
                return Ok(false);
            }
        }
        for &link in &plan.links {
            if !self.link_holds(&query.links[link], Way::Out, slots)? {
                return Ok(false);
            }
        }
        self.tests_hold(&plan.tests, slots)
    }

    /// Whether the links and conditions hold that are looked at after a step.
    #[inline]
    fn passes(&self, step: &Step, slots: &mut Slots<'_>) -> Result<bool, Interrupt> {
        for &link in &step.links {
            let link = &self.query.links[link];
            // Either end knows, but what the step has just bound was never looked at.
            let way = if step.binds[0] == Some(link.from) {
                Way::In
            } else {
                Way::Out
            };
            if !self.link_holds(link, way, slots)? {
                return Ok(false);
            }
        }
        Ok(step.tests.is_empty() || self.tests_hold(&step.tests, slots)?)
    }

    fn tests_hold(&self, tests: &[usize], slots: &mut Slots<'_>) -> Result<bool, Interrupt> {
        for &test in tests {
            if !self.query.tests[test].holds(self.host, slots.environment)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Whether the link is there, or is not where it must not be.
    fn link_holds(&self, link: &Link, way: Way, slots: &Slots<'_>) -> Result<bool, ReadError> {
        let [from, to] = [link.from, link.to].map(|slot| node(slots.environment, slot));
        let (Some(from), Some(label), Some(to)) = (from, link.label, to) else {
            return Ok(link.negated);
        };
        let there = match way {
            Way::Out => self.host.has_end(way, from, label, to)?,
            Way::In => self.host.has_end(way, to, label, from)?,
        };
        Ok(there != link.negated)
    }

    /// Begins a step; where it does not follow a link, what it finds comes back.
    fn open(&self, depth: usize, slots: &mut Slots<'_>) -> Option<Candidates<'h, H>> {
        let Self { host, query, .. } = *self;
        slots.ahead[depth].begin();
        Some(match self.plan.steps[depth].source {
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

    /// Reads some candidates of a step ahead, those along a link from a node on, and keeps what is of the
    /// right type and in no other slot; how many there were.
    #[inline]
    fn read(
        &self,
        depth: usize,
        from: NodeId,
        other: &mut Option<Candidates<'h, H>>,
        slots: &mut Slots<'_>,
    ) -> Result<u64, Interrupt> {
        let step = &self.plan.steps[depth];
        let read = match (step.source, other) {
            (Source::Out { link }, _) => self.follow(Way::Out, link, depth, from, slots)?,
            (Source::In { link }, _) => self.follow(Way::In, link, depth, from, slots)?,
            (_, Some(other)) => self.take(other, depth, slots)?,
            (_, None) => 0,
        };
        slots.environment.spend(read)?;
        Ok(read)
    }

    fn follow(
        &self,
        way: Way,
        link: usize,
        depth: usize,
        from: NodeId,
        slots: &mut Slots<'_>,
    ) -> Result<u64, ReadError> {
        let Link {
            from: source,
            label,
            to: target,
            ..
        } = self.query.links[link];
        let (origin, slot) = match way {
            Way::Out => (source, target),
            Way::In => (target, source),
        };
        let (Some(origin), Some(label)) = (node(slots.environment, origin), label) else {
            return Ok(0);
        };
        let (domain, others) = (&self.query.domains[slot], &self.plan.steps[depth].others[0]);
        let (ahead, environment) = (&mut slots.ahead[depth], &*slots.environment);
        let mut visited = 0;
        let more = self.host.visit_ends(way, origin, label, from, |id, exact| {
            visited += 1;
            if domain.contains(exact) && !is_in(others, id, environment) {
                ahead.push([id; 2]);
            }
        });
        ahead.stopped_at(more?);
        Ok(visited)
    }

    #[inline(never)]
    fn take(
        &self,
        other: &mut Candidates<'h, H>,
        depth: usize,
        slots: &mut Slots<'_>,
    ) -> Result<u64, ReadError> {
        let step = &self.plan.steps[depth];
        let (ahead, environment) = (&mut slots.ahead[depth], &*slots.environment);
        let fits = |index: usize, (id, exact): (NodeId, TypeId)| {
            step.binds[index].is_none_or(|slot| {
                self.query.domains[slot].contains(exact)
                    && !is_in(&step.others[index], id, environment)
            })
        };
        let mut read = 0;
        for candidate in other.take(TOGETHER) {
            read += 1;
            match candidate? {
                Candidate::Node(id, exact) if fits(0, (id, exact)) => ahead.push([id; 2]),
                Candidate::Edge(EdgeKey { from, to, .. }, [source, target])
                    if from != to && fits(0, (from, source)) && fits(1, (to, target)) =>
                {
                    ahead.push([from, to]);
                }
                _ => {}
            }
        }
        ahead.stopped_at((read == TOGETHER as u64).then_some(NodeId(0)));
        Ok(read)
    }
}

/// Whether one of the slots has the node.
#[inline]
fn is_in(slots: &[usize], id: NodeId, environment: &Environment) -> bool {
    slots
        .iter()
        .any(|&slot| environment[slot] == Slot::Node(id))
}

/// The matches of a rule or goal, found one at a time.
///
/// Ends after the first error: a snapshot that became too old, or a search without end.
pub struct Matches<'a> {
    search: Search<'a, Snapshot>,
}

impl fmt::Debug for Matches<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Matches")
            .field("plan", &self.search.plan)
            .field("state", &self.search.state)
            .finish_non_exhaustive()
    }
}

impl<'a> Matches<'a> {
    pub(crate) fn new(snapshot: &'a Snapshot, problem: Problem) -> Result<Self, ReadError> {
        let statistics = Statistics::of(snapshot, &problem.query)?;
        let plan = plan(&problem.query, &statistics, &problem.given());
        Ok(Self::by_plan(snapshot, problem, Arc::new(plan)))
    }

    pub(crate) fn by_plan(snapshot: &'a Snapshot, problem: Problem, plan: Arc<Plan>) -> Self {
        Self {
            search: Search::new(snapshot, problem, plan),
        }
    }

    /// The same, but giving up where so many nodes were tried from one match to the next, in place
    /// of [`SEARCH_LIMIT`](crate::SEARCH_LIMIT).
    #[must_use]
    pub fn within(mut self, limit: u64) -> Self {
        self.search.problem.environment.set_limit(limit);
        self
    }

    /// Counts the matches that are left.
    ///
    /// # Errors
    /// [`MatchError`], which ends the search.
    pub fn count_all(mut self) -> Result<u64, MatchError> {
        let mut count = 0;
        while self.search.advance()? {
            count += 1;
        }
        Ok(count)
    }

    /// Where each step of the plan finds its candidates.
    #[cfg(test)]
    pub(super) fn sources(&self) -> impl Iterator<Item = String> {
        self.search
            .plan
            .steps
            .iter()
            .map(|step| format!("{:?}", step.source))
    }
}

impl Iterator for Matches<'_> {
    type Item = Result<Binding, MatchError>;

    fn next(&mut self) -> Option<Self::Item> {
        match self.search.advance() {
            Ok(true) => Some(Ok(self.search.binding())),
            Ok(false) => None,
            Err(interrupt) => Some(Err(interrupt.into())),
        }
    }
}
