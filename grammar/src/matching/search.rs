//! Backtracking along a plan.
//!
//! Guarantee: every match comes exactly once, in an order that the graph and the plan alone
//! determine; matches are injective.

use super::candidates::Candidates;
use super::evaluate::{Environment, is_there, node};
use super::host::Host;
use super::plan::{Plan, Source, plan};
use super::program::Slot;
use super::query::{Problem, Query};
use super::statistics::Statistics;
use crate::Binding;
use dsr::{NodeId, ReadError, Snapshot};
use std::fmt;
use std::sync::Arc;

/// A search under way.
#[derive(Debug)]
pub(crate) struct Search<'h, H: Host> {
    host: &'h H,
    problem: Problem,
    plan: Arc<Plan>,
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
            problem,
            levels: Vec::with_capacity(plan.steps.len()),
            seen: vec![[0; 2]; plan.steps.len()],
            plan,
            state: State::Fresh,
        }
    }

    fn frame(&self) -> Frame<'h, '_, H> {
        Frame {
            host: self.host,
            query: &self.problem.query,
            plan: &self.plan,
        }
    }

    /// Goes to the next match; `false` where there is none. After that, and after an error, there
    /// is none any more.
    pub(crate) fn advance(&mut self) -> Result<bool, ReadError> {
        let found = self.try_advance();
        if !matches!(found, Ok(true)) {
            self.state = State::Done;
        }
        found
    }

    fn try_advance(&mut self) -> Result<bool, ReadError> {
        match self.state {
            State::Done => return Ok(false),
            State::Running => {}
            State::Fresh => {
                self.state = State::Running;
                let Self {
                    host,
                    problem: Problem { query, environment },
                    plan,
                    ..
                } = self;
                let frame = Frame {
                    host: *host,
                    query,
                    plan,
                };
                if !frame.given_holds(environment)? {
                    return Ok(false);
                }
                if self.plan.steps.is_empty() {
                    return Ok(true);
                }
                let first = self.frame().candidates(0, &self.problem.environment)?;
                self.levels.push(first);
            }
        }
        while let Some(depth) = self.levels.len().checked_sub(1) {
            let Some(candidate) = self.levels[depth].next() else {
                self.levels.pop();
                continue;
            };
            self.seen[depth][0] += 1;
            let Self {
                host,
                problem: Problem { query, environment },
                plan,
                ..
            } = self;
            let frame = Frame {
                host: *host,
                query,
                plan,
            };
            if !frame.accept(depth, candidate?, environment)? {
                continue;
            }
            self.seen[depth][1] += 1;
            if depth + 1 == self.plan.steps.len() {
                return Ok(true);
            }
            let environment = &self.problem.environment;
            let next = self.frame().candidates(depth + 1, environment)?;
            self.levels.push(next);
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

/// What a search goes by.
pub(crate) struct Frame<'h, 'p, H: Host> {
    pub(crate) host: &'h H,
    pub(crate) query: &'p Query,
    pub(crate) plan: &'p Plan,
}

impl<'h, H: Host> Frame<'h, '_, H> {
    /// Puts the first match into the slots, those that are given kept.
    pub(crate) fn first(&self, environment: &mut Environment) -> Result<bool, ReadError> {
        Ok(self.given_holds(environment)? && self.descend(0, environment)?)
    }

    fn descend(&self, depth: usize, environment: &mut Environment) -> Result<bool, ReadError> {
        if depth == self.plan.steps.len() {
            return Ok(true);
        }
        for candidate in self.candidates(depth, environment)? {
            if self.accept(depth, candidate?, environment)?
                && self.descend(depth + 1, environment)?
            {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// What can be said of the slots that are bound from the start.
    fn given_holds(&self, environment: &mut Environment) -> Result<bool, ReadError> {
        let Self { host, query, plan } = self;
        for (index, &slot) in plan.given.iter().enumerate() {
            let others = &plan.given[..index];
            if others
                .iter()
                .any(|&other| environment[other] == environment[slot])
            {
                return Ok(false);
            }
            let Some(id) = node(environment, slot) else {
                return Ok(false);
            };
            let exact = host.type_of(id)?;
            if !exact.is_some_and(|exact| query.domains[slot].contains(exact)) {
                return Ok(false);
            }
        }
        for &link in &plan.links {
            let link = &query.links[link];
            if is_there(*host, link, environment)? == link.negated {
                return Ok(false);
            }
        }
        for &test in &plan.tests {
            if !query.tests[test].holds(*host, environment)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn candidates(
        &self,
        depth: usize,
        environment: &[Slot],
    ) -> Result<Candidates<'h, H>, ReadError> {
        let Self { host, query, .. } = *self;
        let ids = match self.plan.steps[depth].source {
            Source::Nodes { slot } => {
                return Ok(Candidates::members(host, query.domains[slot].types()));
            }
            Source::Edges { link } => {
                let label = query.links[link].label;
                return Ok(label.map_or(Candidates::Nothing, |label| {
                    Candidates::Edges(host.edges(label))
                }));
            }
            Source::Values { bound } => {
                let bound = &query.bounds[bound];
                Some(host.by_value(bound.attribute, &bound.range))
            }
            Source::Out { link } => {
                let link = query.links[link];
                match (node(environment, link.from), link.label) {
                    (Some(from), Some(label)) => host.targets(from, label)?,
                    _ => None,
                }
            }
            Source::In { link } => {
                let link = query.links[link];
                match (node(environment, link.to), link.label) {
                    (Some(to), Some(label)) => host.sources(to, label)?,
                    _ => None,
                }
            }
        };
        Ok(ids.map_or(Candidates::Nothing, Candidates::Ids))
    }

    /// Puts a candidate into its slots and tests what can be tested now.
    fn accept(
        &self,
        depth: usize,
        (first, second): (NodeId, Option<NodeId>),
        environment: &mut Environment,
    ) -> Result<bool, ReadError> {
        let Self { host, query, plan } = self;
        let step = &plan.steps[depth];
        if second == Some(first) {
            return Ok(false);
        }
        for (index, id) in [Some(first), second].into_iter().enumerate() {
            let (Some(slot), Some(id)) = (step.binds[index], id) else {
                continue;
            };
            let taken = Slot::Node(id);
            if step.others[index]
                .iter()
                .any(|&other| environment[other] == taken)
            {
                return Ok(false);
            }
            environment[slot] = taken;
        }
        if step.typed {
            for (slot, id) in step.binds.iter().zip([Some(first), second]) {
                if let (Some(slot), Some(id)) = (slot, id)
                    && !host
                        .type_of(id)?
                        .is_some_and(|exact| query.domains[*slot].contains(exact))
                {
                    return Ok(false);
                }
            }
        }
        for &link in &step.links {
            let link = &query.links[link];
            if is_there(*host, link, environment)? == link.negated {
                return Ok(false);
            }
        }
        for &test in &step.tests {
            if !query.tests[test].holds(*host, environment)? {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// The matches of a rule or goal, found one at a time.
///
/// Ends after the first [`ReadError`] (a snapshot that became too old, say).
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

    /// Counts the matches that are left.
    ///
    /// # Errors
    /// [`ReadError`], which ends the search.
    pub fn count_all(mut self) -> Result<u64, ReadError> {
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
    type Item = Result<Binding, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        match self.search.advance() {
            Ok(true) => Some(Ok(self.search.binding())),
            Ok(false) => None,
            Err(error) => Some(Err(error)),
        }
    }
}
