//! Backtracking along a plan.
//!
//! Guarantee: every match comes exactly once, in an order that the graph and the plan alone
//! determine; matches are injective.

use super::MatchError;
use super::candidates::{Candidate, Candidates};
use super::environment::{Environment, Interrupt, node};
use super::host::Host;
use super::plan::{Plan, Source, Step, plan};
use super::program::{Link, Slot};
use super::query::{Problem, Query};
use super::statistics::Statistics;
use crate::Binding;
use dsr::{NodeId, ReadError, Snapshot, TypeId};
use std::fmt;
use std::sync::Arc;

/// A search under way.
#[derive(Debug)]
pub(crate) struct Search<'h, H: Host> {
    host: &'h H,
    problem: Problem,
    plan: Arc<Plan>,
    /// By slot, the nodes that were looked up.
    nodes: Vec<Option<H::Node<'h>>>,
    levels: Vec<Candidates<'h, H>>,
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
            nodes: vec![None; problem.query.variables.len()],
            problem,
            levels: Vec::with_capacity(plan.steps.len()),
            seen: vec![[0; 2]; plan.steps.len()],
            plan,
            state: State::Fresh,
        }
    }

    /// Goes to the next match; `false` where there is none. After that, and after an error, there
    /// is none any more.
    pub(crate) fn advance(&mut self) -> Result<bool, Interrupt> {
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
            nodes,
            levels,
            seen,
            state,
        } = self;
        let frame = Frame {
            host: *host,
            query,
            plan,
        };
        environment.renew();
        let mut slots = Slots { environment, nodes };
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
                levels.push(frame.candidates(0, &mut slots)?);
            }
        }
        while let Some(depth) = levels.len().checked_sub(1) {
            let Some(candidate) = levels[depth].next() else {
                levels.pop();
                continue;
            };
            slots.environment.spend()?;
            seen[depth][0] += 1;
            if !frame.accept(depth, candidate?, &mut slots)? {
                continue;
            }
            seen[depth][1] += 1;
            if depth + 1 == plan.steps.len() {
                return Ok(true);
            }
            levels.push(frame.candidates(depth + 1, &mut slots)?);
        }
        Ok(false)
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

/// What the slots of a search stand for, and those of the nodes in them that were looked up.
pub(crate) struct Slots<'s, 'h, H: Host + 'h> {
    pub(crate) environment: &'s mut Environment,
    /// By slot of a variable.
    pub(crate) nodes: &'s mut [Option<H::Node<'h>>],
}

impl<'h, H: Host> Slots<'_, 'h, H> {
    fn put(&mut self, slot: usize, id: NodeId) {
        self.environment[slot] = Slot::Node(id);
        self.nodes[slot] = None;
    }

    /// The node in a slot, looked up once.
    fn node(&mut self, host: &'h H, slot: usize) -> Result<Option<H::Node<'h>>, ReadError> {
        if self.nodes[slot].is_none()
            && let Some(id) = node(self.environment, slot)
        {
            self.nodes[slot] = host.find(id)?;
        }
        Ok(self.nodes[slot])
    }

    /// Whether the link is in the graph.
    fn joined(&mut self, host: &'h H, link: &Link) -> Result<bool, ReadError> {
        let (Some(from), Some(label), Some(to)) = (
            node(self.environment, link.from),
            link.label,
            node(self.environment, link.to),
        ) else {
            return Ok(false);
        };
        // Either end knows; that which was looked up before costs less.
        if let (None, Some(to)) = (self.nodes[link.from], self.nodes[link.to]) {
            return host.has_source(to, label, from);
        }
        match self.node(host, link.from)? {
            Some(from) => host.has_target(from, label, to),
            None => Ok(false),
        }
    }
}

/// What a search goes by.
pub(crate) struct Frame<'h, 'p, H: Host> {
    pub(crate) host: &'h H,
    pub(crate) query: &'p Query,
    pub(crate) plan: &'p Plan,
}

impl<'h, H: Host> Frame<'h, '_, H> {
    /// Puts the first match into the slots, those that are given kept.
    pub(crate) fn first(&self, slots: &mut Slots<'_, 'h, H>) -> Result<bool, Interrupt> {
        Ok(self.given_holds(slots)? && self.descend(0, slots)?)
    }

    fn descend(&self, depth: usize, slots: &mut Slots<'_, 'h, H>) -> Result<bool, Interrupt> {
        if depth == self.plan.steps.len() {
            return Ok(true);
        }
        for candidate in self.candidates(depth, slots)? {
            slots.environment.spend()?;
            if self.accept(depth, candidate?, slots)? && self.descend(depth + 1, slots)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// What can be said of the slots that are bound from the start.
    fn given_holds(&self, slots: &mut Slots<'_, 'h, H>) -> Result<bool, Interrupt> {
        let Self { host, query, plan } = self;
        for (index, &slot) in plan.given.iter().enumerate() {
            let taken = slots.environment[slot];
            let mut others = plan.given[..index].iter();
            if others.any(|&other| slots.environment[other] == taken) {
                return Ok(false);
            }
            slots.nodes[slot] = None;
            let exact = slots.node(host, slot)?.map(|node| host.type_of(node));
            if !exact.is_some_and(|exact| query.domains[slot].contains(exact)) {
                return Ok(false);
            }
        }
        self.passes(&plan.links, &plan.tests, slots)
    }

    /// Whether these links and conditions hold.
    fn passes(
        &self,
        links: &[usize],
        tests: &[usize],
        slots: &mut Slots<'_, 'h, H>,
    ) -> Result<bool, Interrupt> {
        for &link in links {
            let link = &self.query.links[link];
            if slots.joined(self.host, link)? == link.negated {
                return Ok(false);
            }
        }
        for &test in tests {
            if !self.query.tests[test].holds(self.host, slots.environment)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn candidates(
        &self,
        depth: usize,
        slots: &mut Slots<'_, 'h, H>,
    ) -> Result<Candidates<'h, H>, ReadError> {
        let Self { host, query, .. } = *self;
        Ok(match self.plan.steps[depth].source {
            Source::Out { link } => {
                let Link { from, label, .. } = query.links[link];
                match (slots.node(host, from)?, label) {
                    (Some(from), Some(label)) => Candidates::Ends(host.targets(from, label)),
                    _ => Candidates::Nothing,
                }
            }
            Source::In { link } => {
                let Link { to, label, .. } = query.links[link];
                match (slots.node(host, to)?, label) {
                    (Some(to), Some(label)) => Candidates::Ends(host.sources(to, label)),
                    _ => Candidates::Nothing,
                }
            }
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

    /// Puts a candidate into its slots and tests what can be tested now.
    fn accept(
        &self,
        depth: usize,
        candidate: Candidate,
        slots: &mut Slots<'_, 'h, H>,
    ) -> Result<bool, Interrupt> {
        let step = &self.plan.steps[depth];
        let fits = match candidate {
            Candidate::Node(id, exact) => self.bind(step, 0, (id, exact), slots),
            Candidate::Edge(key, [from, to]) => {
                key.from != key.to
                    && self.bind(step, 0, (key.from, from), slots)
                    && self.bind(step, 1, (key.to, to), slots)
            }
        };
        Ok(fits && self.passes(&step.links, &step.tests, slots)?)
    }

    /// Puts a node into one of a step's slots, unless its type is wrong or another slot has it.
    fn bind(
        &self,
        step: &Step,
        index: usize,
        (id, exact): (NodeId, TypeId),
        slots: &mut Slots<'_, 'h, H>,
    ) -> bool {
        let Some(slot) = step.binds[index] else {
            return true;
        };
        let taken = Slot::Node(id);
        let mut others = step.others[index].iter();
        let free = self.query.domains[slot].contains(exact)
            && !others.any(|&other| slots.environment[other] == taken);
        if free {
            slots.put(slot, id);
        }
        free
    }
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
