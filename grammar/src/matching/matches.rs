//! The matches of a rule or goal, as an iterator.
//!
//! Guarantee: it ends: where it was told to, or where one match takes too long to be found.

use super::MatchError;
use super::environment::Interrupt;
use super::plan::{Plan, plan};
use super::query::Problem;
use super::search::Search;
use super::statistics::Statistics;
use crate::Binding;
use dsr::{ReadError, Snapshot};
use std::fmt;
use std::sync::Arc;

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

    /// The same, but ending with [`MatchError::Whole`] where so many nodes were tried for all matches together, so that
    /// looking at all of them comes to an end in reasonable time, too.
    #[must_use]
    pub fn within_all(mut self, limit: u64) -> Self {
        self.search.problem.environment.set_whole_limit(limit);
        self
    }

    /// Counts the matches that are left.
    ///
    /// # Errors
    /// [`MatchError`], which ends the search.
    pub fn count_all(mut self) -> Result<u64, MatchError> {
        let (count, ended) = self.counted();
        ended.map(|()| count).map_err(MatchError::from)
    }

    /// Counts the matches that are left, and says whether those are all: not so where the limit of
    /// [`Self::within_all`] was met.
    ///
    /// # Errors
    /// [`MatchError`], which ends the search.
    pub fn count_rest(mut self) -> Result<(u64, bool), MatchError> {
        match self.counted() {
            (count, Ok(())) => Ok((count, true)),
            (count, Err(Interrupt::Whole(_))) => Ok((count, false)),
            (_, Err(error)) => Err(error.into()),
        }
    }

    fn counted(&mut self) -> (u64, Result<(), Interrupt>) {
        let mut count = 0;
        loop {
            match self.search.advance() {
                Ok(true) => count += 1,
                Ok(false) => return (count, Ok(())),
                Err(interrupt) => return (count, Err(interrupt)),
            }
        }
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
