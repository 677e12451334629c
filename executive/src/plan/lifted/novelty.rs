//! How new a state is among those that a search has met (Lipovetzky and Geffner 2017): whether it is the first with
//! some fact, or with some pair of facts, of those that stand as near to the goal as it does. This file guarantees
//! that what it says depends only on the order in which it is asked.

use rustc_hash::{FxHashMap, FxHashSet};

/// How near to the goal a state stands: the guide it is measured by, how much of the goal it lacks, and how much of
/// the guide's way.
pub(super) type Nearness = (u32, u64, usize);

/// New by a fact, by a pair of facts, or not by either: the lower, the newer.
pub(super) type Novelty = u8;

/// What was met.
#[derive(Debug, Default)]
pub(super) struct Met {
    parts: FxHashMap<Nearness, u32>,
    facts: FxHashSet<(u32, u32)>,
    pairs: FxHashSet<(u32, u32, u32)>,
}

impl Met {
    /// How new a state is that has the facts `gained` more than one that was met at the same nearness, all of its
    /// facts (as far as they were not there at first) being `all`.
    pub(super) fn novelty(&mut self, near: Nearness, gained: &[u32], all: &[u32]) -> Novelty {
        let next = self.parts.len() as u32;
        let part = *self.parts.entry(near).or_insert(next);
        let mut novelty = 3;
        for &fact in gained {
            for &other in all {
                let (a, b) = (fact.min(other), fact.max(other));
                if a != b && self.pairs.insert((part, a, b)) {
                    novelty = novelty.min(2);
                }
            }
            if self.facts.insert((part, fact)) {
                novelty = 1;
            }
        }
        novelty
    }

    /// About how many bytes it takes.
    pub(super) fn bytes(&self) -> usize {
        self.facts.capacity() * 9 + self.pairs.capacity() * 13
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_new_once() {
        let mut met = Met::default();
        assert_eq!(met.novelty((0, 3, 2), &[1, 2], &[1, 2]), 1);
        assert_eq!(met.novelty((0, 3, 2), &[3], &[2, 3]), 1);
        assert_eq!(met.novelty((0, 3, 2), &[3], &[1, 3]), 2);
        assert_eq!(met.novelty((0, 3, 2), &[1], &[1, 3]), 3);
        assert_eq!(met.novelty((0, 2, 2), &[1], &[1, 3]), 1, "nearer");
    }
}
