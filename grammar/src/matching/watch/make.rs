//! New matches of several patterns.
//!
//! Guarantee: each pattern gets the matches that a search of its own finds.

use super::super::environment::Interrupt;
use super::set::{Row, Seed};
use super::shared::{Member, Shared};
use super::{Rows, Watch};
use dsr::{NodeId, ReadError, Snapshot};
use std::collections::btree_map::Entry;
use std::sync::Arc;

impl Watch {
    /// Searches for new matches of some patterns that have these nodes in these slots.
    pub(super) fn make(
        &mut self,
        snapshot: &Snapshot,
        nodes: &[NodeId],
        wanted: Vec<(usize, Vec<usize>)>,
        rows: &mut Rows,
    ) -> Result<(), Interrupt> {
        let mut alone: Vec<(usize, Seed)> = Vec::new();
        let seed = |slots: &[usize]| {
            let mut seed: Seed = slots.iter().copied().zip(nodes.iter().copied()).collect();
            seed.sort_unstable();
            seed
        };
        if wanted.len() > 1 && !nodes.is_empty() {
            let mut found: Vec<(usize, Row)> = Vec::new();
            let shared = self.together(snapshot, wanted)?;
            for &member in &shared.alone {
                let member = &shared.members[member];
                alone.push((member.pattern, seed(member.given())));
            }
            if shared.alone.len() < shared.members.len() {
                shared.search(snapshot, nodes, &mut |pattern, row| {
                    found.push((pattern, row));
                })?;
            }
            for (pattern, row) in found {
                self.add(pattern, row, rows);
            }
        } else {
            let wanted = wanted.iter();
            alone.extend(wanted.map(|(pattern, slots)| (*pattern, seed(slots))));
        }
        for (pattern, seed) in alone {
            for row in self.patterns[pattern].search(snapshot, &seed)? {
                self.add(pattern, row, rows);
            }
        }
        Ok(())
    }

    fn add(&mut self, pattern: usize, row: Row, rows: &mut Rows) {
        if self.patterns[pattern].set.insert(&row) {
            let [added, _] = rows.entry(pattern).or_default();
            added.push(row);
        }
    }

    /// The searches for patterns with slots given, made together by their plans of now.
    fn together(
        &mut self,
        snapshot: &Snapshot,
        wanted: Vec<(usize, Vec<usize>)>,
    ) -> Result<&mut Shared, ReadError> {
        let mut plans = Vec::with_capacity(wanted.len());
        for (pattern, slots) in &wanted {
            let mut given = slots.clone();
            given.sort_unstable();
            plans.push(self.patterns[*pattern].plan(snapshot, &given)?);
        }
        let patterns = &self.patterns;
        let make = |wanted: &[(usize, Vec<usize>)]| {
            let members = wanted.iter().zip(&plans).map(|((pattern, slots), plan)| {
                let query = Arc::clone(patterns[*pattern].planned.query());
                Member::new(*pattern, query, Arc::clone(plan), slots)
            });
            Shared::new(members.collect())
        };
        match self.shared.entry(wanted) {
            Entry::Vacant(entry) => {
                let shared = make(entry.key());
                Ok(entry.insert(shared))
            }
            Entry::Occupied(mut entry) => {
                if !entry.get().goes_by(&plans) {
                    let shared = make(entry.key());
                    entry.insert(shared);
                }
                Ok(entry.into_mut())
            }
        }
    }
}
