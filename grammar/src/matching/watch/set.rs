//! The matches of one pattern.
//!
//! Guarantee: matches come in ascending order of their nodes where all are asked for, and those that bind a slot to a
//! node are found without looking at others.

use dsr::NodeId;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// The nodes of a match, by slot.
pub(super) type Row = Arc<[NodeId]>;
/// Some of the slots of a match and their nodes.
pub(super) type Seed = Vec<(usize, NodeId)>;

/// What it takes to add or remove a match does not depend on how many there are.
#[derive(Debug, Default)]
pub(super) struct MatchSet {
    numbers: FxHashMap<Row, usize>,
    /// By number; `None` where the number is free.
    rows: Vec<Option<Row>>,
    free: Vec<usize>,
    /// The numbers of the matches with this node in this slot, in no order.
    by_node: FxHashMap<(usize, NodeId), Vec<usize>>,
    /// By number and slot, the place of the match in the list of its node there.
    places: Vec<usize>,
}

impl MatchSet {
    /// Adds a match, of as many slots as the others; `false` if it is there already.
    pub(super) fn insert(&mut self, row: &Row) -> bool {
        if self.numbers.contains_key(row) {
            return false;
        }
        let number = self.free.pop().unwrap_or(self.rows.len());
        if number == self.rows.len() {
            self.rows.push(None);
            self.places.resize(self.rows.len() * row.len(), 0);
        }
        for (slot, &node) in row.iter().enumerate() {
            let list = self.by_node.entry((slot, node)).or_default();
            self.places[number * row.len() + slot] = list.len();
            list.push(number);
        }
        self.rows[number] = Some(Arc::clone(row));
        self.numbers.insert(Arc::clone(row), number);
        true
    }

    pub(super) fn remove(&mut self, row: &Row) {
        let Some(number) = self.numbers.remove(row) else {
            return;
        };
        for (slot, &node) in row.iter().enumerate() {
            let Some(list) = self.by_node.get_mut(&(slot, node)) else {
                continue;
            };
            let place = self.places[number * row.len() + slot];
            list.swap_remove(place);
            match list.get(place) {
                Some(moved) => self.places[moved * row.len() + slot] = place,
                None if list.is_empty() => {
                    self.by_node.remove(&(slot, node));
                }
                None => {}
            }
        }
        self.rows[number] = None;
        self.free.push(number);
    }

    pub(super) fn len(&self) -> usize {
        self.numbers.len()
    }

    /// All of them, in ascending order.
    pub(super) fn rows(&self) -> Vec<&Row> {
        let mut rows: Vec<&Row> = self.rows.iter().flatten().collect();
        rows.sort_unstable();
        rows
    }

    /// The matches that bind all of these slots so.
    pub(super) fn extending(&self, seed: &Seed) -> Vec<Row> {
        let mut fewest: Option<&Vec<usize>> = None;
        for &(slot, node) in seed {
            let Some(list) = self.by_node.get(&(slot, node)) else {
                return Vec::new();
            };
            if fewest.is_none_or(|known| list.len() < known.len()) {
                fewest = Some(list);
            }
        }
        let fits = |row: &&Row| seed.iter().all(|&(slot, node)| row[slot] == node);
        match fewest {
            Some(list) => {
                let rows = list.iter().filter_map(|&number| self.rows[number].as_ref());
                rows.filter(fits).cloned().collect()
            }
            None => self.rows.iter().flatten().cloned().collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{MatchSet, Row};
    use dsr::NodeId;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn matches_come_and_go_as_in_an_ordered_set(
            steps in prop::collection::vec((any::<bool>(), [0_u64..4, 0_u64..4, 0_u64..4]), 0..60),
        ) {
            let (mut set, mut expected) = (MatchSet::default(), BTreeSet::<Row>::new());
            for (comes, nodes) in steps {
                let row: Row = nodes.map(NodeId).into();
                if comes {
                    prop_assert_eq!(set.insert(&row), expected.insert(row.clone()));
                } else {
                    set.remove(&row);
                    expected.remove(&row);
                }
                prop_assert_eq!(set.len(), expected.len());
                prop_assert!(set.rows().into_iter().eq(&expected));
                let seed = vec![(0, row[0]), (2, row[2])];
                let found: BTreeSet<Row> = set.extending(&seed).into_iter().collect();
                let fits = |other: &&Row| other[0] == row[0] && other[2] == row[2];
                prop_assert_eq!(found, expected.iter().filter(fits).cloned().collect());
            }
        }
    }
}
