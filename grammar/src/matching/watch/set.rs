//! The matches of one pattern.
//!
//! Guarantee: matches come in ascending order of their nodes, and those that bind a slot to a
//! node are found without looking at others.

use dsr::NodeId;
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::BTreeSet;
use std::sync::Arc;

/// The nodes of a match, by slot.
pub(super) type Row = Arc<[NodeId]>;
/// Some of the slots of a match and their nodes.
pub(super) type Seed = Vec<(usize, NodeId)>;

#[derive(Debug, Default)]
pub(super) struct MatchSet {
    rows: BTreeSet<Row>,
    /// In no order: whoever asks puts what comes of it into one.
    by_node: FxHashMap<(usize, NodeId), FxHashSet<Row>>,
}

impl MatchSet {
    /// Adds a match; `false` if it is there already.
    pub(super) fn insert(&mut self, row: &Row) -> bool {
        if !self.rows.insert(Arc::clone(row)) {
            return false;
        }
        for (slot, &node) in row.iter().enumerate() {
            let rows = self.by_node.entry((slot, node)).or_default();
            rows.insert(Arc::clone(row));
        }
        true
    }

    pub(super) fn remove(&mut self, row: &Row) {
        self.rows.remove(row);
        for (slot, &node) in row.iter().enumerate() {
            if let Some(rows) = self.by_node.get_mut(&(slot, node)) {
                rows.remove(row);
                if rows.is_empty() {
                    self.by_node.remove(&(slot, node));
                }
            }
        }
    }

    pub(super) fn rows(&self) -> impl ExactSizeIterator<Item = &Row> {
        self.rows.iter()
    }

    /// The matches that bind all of these slots so.
    pub(super) fn extending(&self, seed: &Seed) -> Vec<Row> {
        let mut fewest: Option<&FxHashSet<Row>> = None;
        for &(slot, node) in seed {
            let Some(rows) = self.by_node.get(&(slot, node)) else {
                return Vec::new();
            };
            if fewest.is_none_or(|known| rows.len() < known.len()) {
                fewest = Some(rows);
            }
        }
        let fits = |row: &&Row| seed.iter().all(|&(slot, node)| row[slot] == node);
        match fewest {
            Some(rows) => rows.iter().filter(fits).cloned().collect(),
            None => self.rows.iter().cloned().collect(),
        }
    }
}
