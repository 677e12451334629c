//! Backtracking along a plan, some partial matches at a time.
//!
//! Guarantee: every match comes exactly once, in an order that the graph and the plan alone
//! determine; matches are injective.

use super::ahead::Ends;
use super::candidates::Candidates;
use super::environment::{Environment, Interrupt, node};
use super::frame::Frame;
use super::host::Host;
use super::plan::Plan;
use super::query::Problem;
use crate::Binding;
use dsr::NodeId;
use std::fmt;
use std::sync::Arc;

/// A step finds about so many partial matches together, if they are asked for: so many can be looked at
/// while the memory of the last is on its way.
const WIDEST: usize = 32;
/// So many it finds at first.
const NARROWEST: usize = 8;
/// In no row's place: none is in the slots.
const NONE: usize = usize::MAX;

/// A search under way.
///
/// Each step keeps some of what it found, and finds more for the rows of the step before it, one after the
/// other, where all of those were gone on from. The first time it looks for a few only, then for twice as
/// many each time, so that who wants but the first match hardly waits for others.
#[derive(Debug)]
pub(crate) struct Search<'h, H: Host> {
    host: &'h H,
    pub(super) problem: Problem,
    pub(super) plan: Arc<Plan>,
    levels: Vec<Level<'h, H>>,
    pub(super) state: State,
}

/// What one step has found.
struct Level<'h, H: Host + 'h> {
    rows: Vec<Ends>,
    /// By row, the row before it that it goes on from.
    parents: Vec<usize>,
    /// The first row that was not yet gone on from.
    next: usize,
    /// The row that is in the slots.
    bound: usize,
    /// The row before it for which it looks, and from where on there may be more for it.
    parent: usize,
    more: Option<NodeId>,
    /// What it finds for that, if not along a link.
    other: Option<Candidates<'h, H>>,
    /// The edges at the step's anchors, for the rows before it from one on up to another.
    edges: Vec<Option<H::Adjacency<'h>>>,
    found_from: usize,
    found_to: usize,
    /// So many rows are wanted the next time.
    width: usize,
    /// What was in the way of more.
    interrupt: Option<Interrupt>,
    /// How many candidates there were, and how many of them passed.
    seen: [u64; 2],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum State {
    Fresh,
    Running,
    Done,
}

impl<H: Host> Level<'_, H> {
    fn new() -> Self {
        Self {
            rows: Vec::new(),
            parents: Vec::new(),
            next: 0,
            bound: NONE,
            parent: 0,
            more: None,
            other: None,
            edges: Vec::new(),
            found_from: 0,
            found_to: 0,
            width: NARROWEST,
            interrupt: None,
            seen: [0; 2],
        }
    }
}

impl<H: Host> fmt::Debug for Level<'_, H> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let left = self.rows.get(self.next..);
        f.debug_struct("Level")
            .field("left", &left)
            .finish_non_exhaustive()
    }
}

impl<'h, H: Host> Search<'h, H> {
    /// A search by a plan that was made for the problem's query and given slots.
    pub(crate) fn new(host: &'h H, problem: Problem, plan: Arc<Plan>) -> Self {
        Self {
            host,
            problem,
            levels: plan.steps.iter().map(|_| Level::new()).collect(),
            plan,
            state: State::Fresh,
        }
    }

    /// Goes to the next match; `false` where there is none. After that, and after an error, there
    /// is none any more.
    #[inline]
    pub(crate) fn advance(&mut self) -> Result<bool, Interrupt> {
        let steps = self.levels.len();
        if let Some(last) = self.levels.last_mut()
            && last.next < last.rows.len()
        {
            let row = last.next;
            last.next += 1;
            let environment = &mut self.problem.environment;
            if let Some(step) = self.plan.steps.last()
                && last.bound != NONE
                && last.parents[row] == last.parents[last.bound]
            {
                last.bound = row;
                step.bind(last.rows[row], environment);
            } else {
                bind(&mut self.levels, &self.plan, (steps - 1, row), environment);
            }
            return Ok(true);
        }
        let found = self.try_advance();
        if !matches!(found, Ok(true)) {
            self.state = State::Done;
        }
        found
    }

    fn try_advance(&mut self) -> Result<bool, Interrupt> {
        self.problem.environment.renew();
        let Some(last) = self.levels.len().checked_sub(1) else {
            return Ok(self.state == State::Fresh && self.begin()?);
        };
        let goes_on = match self.state {
            State::Done => false,
            State::Fresh => self.begin()?,
            State::Running => true,
        };
        if !goes_on || !self.refill(last)? {
            return Ok(false);
        }
        self.levels[last].next = 1;
        bind(
            &mut self.levels,
            &self.plan,
            (last, 0),
            &mut self.problem.environment,
        );
        Ok(true)
    }

    fn begin(&mut self) -> Result<bool, Interrupt> {
        self.state = State::Running;
        let Problem { query, environment } = &mut self.problem;
        let frame = Frame {
            host: self.host,
            query,
            plan: &self.plan,
        };
        if !frame.given_holds(environment)? {
            return Ok(false);
        }
        if let (Some(first), Some(step)) = (self.levels.first_mut(), self.plan.steps.first()) {
            first.other = frame.open(step);
            first.more = Some(NodeId(0));
            self.find_edges(0)?;
        }
        Ok(true)
    }

    /// Finds the next rows of a step, all before them having been gone on from; `false` where there are
    /// no more.
    fn refill(&mut self, depth: usize) -> Result<bool, Interrupt> {
        let level = &mut self.levels[depth];
        if let Some(interrupt) = level.interrupt.take() {
            return Err(interrupt);
        }
        level.rows.clear();
        level.parents.clear();
        level.rows.reserve(WIDEST);
        level.parents.reserve(WIDEST);
        (level.next, level.bound) = (0, NONE);
        let width = level.width;
        level.width = (2 * width).min(WIDEST);
        while self.levels[depth].rows.len() < width {
            if self.levels[depth].more.is_none() {
                let Some(above) = depth.checked_sub(1) else {
                    break;
                };
                if self.levels[above].next == self.levels[above].rows.len() {
                    // What was found leads to rows that are kept there.
                    if !self.levels[depth].rows.is_empty() {
                        break;
                    }
                    if !self.refill(above)? {
                        return Ok(false);
                    }
                    self.levels[depth].found_to = 0;
                }
                self.turn_to_next(depth)?;
            }
            if let Err(interrupt) = self.read_on(depth, width) {
                let level = &mut self.levels[depth];
                level.rows.truncate(level.parents.len());
                if level.rows.is_empty() {
                    return Err(interrupt);
                }
                level.interrupt = Some(interrupt);
                break;
            }
        }
        Ok(!self.levels[depth].rows.is_empty())
    }

    /// Turns a step to the next row before it.
    fn turn_to_next(&mut self, depth: usize) -> Result<(), Interrupt> {
        let above = &mut self.levels[depth - 1];
        let parent = above.next;
        above.next += 1;
        let level = &mut self.levels[depth];
        level.parent = parent;
        level.more = Some(NodeId(0));
        if parent >= level.found_to {
            self.find_edges(depth)?;
        }
        Ok(())
    }

    /// Finds the edges at a step's anchors for some of the rows before it, from the one on that it is turned
    /// to; and only then has them fetched, all at once.
    fn find_edges(&mut self, depth: usize) -> Result<(), Interrupt> {
        let Self {
            host,
            problem: Problem { query, environment },
            plan,
            levels,
            ..
        } = self;
        let host: &'h H = host;
        let frame = Frame { host, query, plan };
        let step = &plan.steps[depth];
        let (above, below) = levels.split_at_mut(depth);
        let Some(level) = below.first_mut() else {
            return Ok(());
        };
        level.edges.clear();
        level.edges.reserve(WIDEST);
        level.found_from = level.parent;
        level.found_to = level.parent + 1;
        let Some(above_it) = above.last() else {
            for anchor in &step.anchors {
                level.edges.push(frame.edges(*anchor, environment)?);
            }
            return Ok(());
        };
        if step.follows() {
            level.found_to = above_it.rows.len().min(level.parent + level.width);
        } else {
            level.other = frame.open(step);
        }
        if step.anchors.iter().all(|anchor| anchor.fresh.is_some()) {
            for ends in &above_it.rows[level.parent..level.found_to] {
                for anchor in &step.anchors {
                    let node = ends[anchor.fresh.unwrap_or_default()];
                    level.edges.push(Some(host.adjacency(anchor.way, node)?));
                }
            }
        } else {
            for row in level.parent..level.found_to {
                bind(above, plan, (depth - 1, row), environment);
                for anchor in &step.anchors {
                    level.edges.push(frame.edges(*anchor, environment)?);
                }
            }
        }
        if level.edges.len() > 1 {
            for edges in level.edges.iter().flatten() {
                host.fetch(*edges);
            }
        }
        Ok(())
    }

    /// Reads candidates for the row that a step is turned to and for those after it whose edges were found,
    /// until there are `width` that pass, and keeps these.
    fn read_on(&mut self, depth: usize, width: usize) -> Result<(), Interrupt> {
        let last = depth + 1 == self.levels.len();
        let Self {
            host,
            problem: Problem { query, environment },
            plan,
            levels,
            ..
        } = self;
        let frame = Frame {
            host: *host,
            query,
            plan,
        };
        let step = &plan.steps[depth];
        let (above, below) = levels.split_at_mut(depth);
        let Some(level) = below.first_mut() else {
            return Ok(());
        };
        let is_free = step.is_free();
        let anchors = step.anchors.len();
        loop {
            let Some(from) = level.more.take() else {
                return Ok(());
            };
            if let Some(before) = depth.checked_sub(1)
                && !(is_free && step.others.iter().all(Vec::is_empty))
            {
                bind(above, plan, (before, level.parent), environment);
            }
            let at = (level.parent - level.found_from) * anchors;
            let found = level.edges.get(at..at + anchors).unwrap_or(&[]);
            let before = level.rows.len();
            let origin = found.first().copied().flatten();
            let rows = (&mut level.rows, &mut *environment);
            let (read, more) = frame.read(step, origin, from, &mut level.other, rows)?;
            level.more = more;
            level.seen[0] += read;
            if !is_free {
                let mut kept = before;
                for row in before..level.rows.len() {
                    let ends = level.rows[row];
                    step.bind(ends, environment);
                    if frame.passes(step, found, environment)? {
                        level.rows[kept] = ends;
                        kept += 1;
                    }
                }
                level.rows.truncate(kept);
            }
            if level.rows.len() > before {
                level.seen[1] += (level.rows.len() - before) as u64;
                level.parents.resize(level.rows.len(), level.parent);
                if last {
                    environment.renew();
                }
            }
            if level.more.is_some()
                || level.rows.len() >= width
                || level.parent + 1 >= level.found_to
            {
                return Ok(());
            }
            level.parent += 1;
            level.more = Some(NodeId(0));
            if let Some(above) = above.last_mut() {
                above.next = level.parent + 1;
            }
        }
    }

    /// By step, how many candidates there were so far, and how many of them passed.
    pub(crate) fn seen(&self) -> impl Iterator<Item = [u64; 2]> {
        self.levels.iter().map(|level| level.seen)
    }

    /// The nodes of the match that [`Self::advance`] went to, by slot.
    pub(crate) fn nodes(&self) -> impl Iterator<Item = NodeId> {
        let variables = self.problem.query.variables.len();
        (0..variables).filter_map(|slot| node(&self.problem.environment, slot))
    }

    pub(super) fn binding(&self) -> Binding {
        let variables = self.problem.query.variables.iter();
        Binding::of_distinct(variables.cloned().zip(self.nodes()))
    }
}

/// Puts a row into its slots, and the rows that it goes on from.
#[inline]
fn bind<H: Host>(
    levels: &mut [Level<'_, H>],
    plan: &Plan,
    (depth, mut row): (usize, usize),
    environment: &mut Environment,
) {
    let upwards = levels[..=depth].iter_mut().zip(&plan.steps[..=depth]);
    for (level, step) in upwards.rev() {
        if level.bound == row {
            return;
        }
        level.bound = row;
        step.bind(level.rows[row], environment);
        row = level.parents[row];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{graph, read};

    #[test]
    fn the_far_end_of_a_link_is_none_of_the_nodes_that_are_bound() {
        let grammar = read(
            "name=n\n===\ntypes {\n(thing)\n(tool)\n(pot : thing tool)\n(cup : thing)\n}\n===\n\
             by : passive(1) { { c:thing b:cup a:tool b->c(by) } => { c:thing b:cup a:tool } }\n",
        );
        let links = [("cup1", "by", "cup1"), ("cup1", "by", "pot1")];
        let one_tool = [("cup", "cup1"), ("thing", "thing1"), ("pot", "pot1")];
        let two_tools = [&one_tool[..], &[("tool", "tool1")]].concat();
        for (nodes, count) in [(&one_tool[..], 0), (&two_tools, 1)] {
            let graph = graph(nodes, &links);
            let snapshot = graph.snapshot();
            let found = grammar.matches(&snapshot, &grammar.rules[0], &Binding::new());
            assert_eq!(found.unwrap().count_all(), Ok(count));
        }
    }
}
