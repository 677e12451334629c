//! A pattern that is watched: its query, its plans and its matches.
//!
//! Guarantee: what it is asked for it finds as a fresh search would.

use super::super::environment::{Environment, Interrupt, SEARCH_LIMIT};
use super::super::frame::{Frame, Slots};
use super::super::plan::Plan;
use super::super::planned::Planned;
use super::super::program::Slot;
use super::super::query::Problem;
use super::super::search::Search;
use super::set::{MatchSet, Row, Seed};
use dsr::{NodeId, ReadError, Snapshot};
use std::sync::Arc;

#[derive(Debug)]
pub(super) struct Pattern {
    pub(super) planned: Planned,
    /// How many nodes and edges have changed since the plans were last compared with the graph.
    pub(super) changes: u64,
    pub(super) set: MatchSet,
}

impl Pattern {
    fn at(&self, seed: impl Iterator<Item = (usize, NodeId)>) -> Problem {
        let query = self.planned.query();
        let mut environment = Environment::new(query.slots, SEARCH_LIMIT);
        for (slot, node) in seed {
            environment[slot] = Slot::Node(node);
        }
        Problem {
            query: Arc::clone(query),
            environment,
        }
    }

    /// The plan for a search with these slots given.
    pub(super) fn plan(
        &mut self,
        snapshot: &Snapshot,
        given: &[usize],
    ) -> Result<Arc<Plan>, ReadError> {
        self.planned.plan_after(&mut self.changes, snapshot, given)
    }

    /// The matches that bind these slots so.
    pub(super) fn search(
        &mut self,
        snapshot: &Snapshot,
        seed: &Seed,
    ) -> Result<Vec<Row>, Interrupt> {
        let problem = self.at(seed.iter().copied());
        let given: Vec<usize> = seed.iter().map(|(slot, _)| *slot).collect();
        let plan = self.plan(snapshot, &given)?;
        let mut search = Search::new(snapshot, problem, plan);
        let mut rows = Vec::new();
        while search.advance()? {
            rows.push(search.nodes().collect());
        }
        Ok(rows)
    }

    /// Whether a match still holds.
    pub(super) fn holds(&mut self, snapshot: &Snapshot, row: &Row) -> Result<bool, Interrupt> {
        let mut problem = self.at(row.iter().copied().enumerate());
        let given: Vec<usize> = (0..row.len()).collect();
        let plan = self.plan(snapshot, &given)?;
        let frame = Frame {
            host: snapshot,
            query: &problem.query,
            plan: &plan,
        };
        frame.first(&mut Slots {
            environment: &mut problem.environment,
            // All slots are given: there is no step.
            ahead: &mut [],
        })
    }
}
