//! A query with the plans that were made for it.
//!
//! Guarantee: a plan is kept as long as no count that it goes by has doubled or halved.

use super::host::Host;
use super::plan::{Plan, plan};
use super::query::Query;
use super::statistics::{FEW, Statistics};
use dsr::{ReadError, Version};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A query with its plans, by the slots that are given.
#[derive(Debug)]
pub(crate) struct Planned {
    query: Arc<Query>,
    /// What the plans go by, and the version that was last compared with it.
    basis: Option<(Statistics, Version)>,
    plans: BTreeMap<Vec<usize>, Arc<Plan>>,
}

impl Planned {
    pub(crate) fn new(query: Query) -> Self {
        Self {
            query: Arc::new(query),
            basis: None,
            plans: BTreeMap::new(),
        }
    }

    pub(crate) fn query(&self) -> &Arc<Query> {
        &self.query
    }

    /// The plan for a search with these slots given, ascending.
    pub(crate) fn plan<H: Host>(
        &mut self,
        host: &H,
        given: &[usize],
    ) -> Result<Arc<Plan>, ReadError> {
        let mut unknown = u64::MAX;
        self.plan_after(&mut unknown, host, given)
    }

    /// The same, where it is known how many nodes and edges have changed since the counts were looked
    /// at: where these are so few that no count that matters can have doubled or halved, none is
    /// looked at, else counting begins afresh.
    pub(crate) fn plan_after<H: Host>(
        &mut self,
        changes: &mut u64,
        host: &H,
        given: &[usize],
    ) -> Result<Arc<Plan>, ReadError> {
        let version = host.version();
        let statistics = match &mut self.basis {
            Some((statistics, _)) if *changes < FEW as u64 => statistics,
            Some((statistics, looked)) if *looked == version => statistics,
            Some((statistics, looked)) => {
                *changes = 0;
                *looked = version;
                let now = Statistics::of(host, &self.query)?;
                if now.drifted(statistics) {
                    *statistics = now;
                    self.plans.clear();
                }
                statistics
            }
            none => {
                let now = Statistics::of(host, &self.query)?;
                &mut none.insert((now, version)).0
            }
        };
        if let Some(known) = self.plans.get(given) {
            return Ok(Arc::clone(known));
        }
        let plan = Arc::new(plan(&self.query, statistics, given));
        self.plans.insert(given.to_vec(), Arc::clone(&plan));
        Ok(plan)
    }
}
