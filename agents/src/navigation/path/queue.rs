//! Nodes that wait to be looked at, those of the least totals first. This file guarantees that a node
//! comes before all whose totals are greater by a width: none in [`Sorted`], that of a bucket in
//! [`Buckets`], where the newest in a bucket comes first, so that the search goes on where it is.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// No more buckets than this.
const MOST: usize = 1 << 16;

/// Waiting nodes in some order.
pub(super) trait Queue {
    /// Takes a node whose cost and estimate add up to `total`.
    fn push(&mut self, total: f64, waiting: Waiting);
    /// The next one.
    fn pop(&mut self) -> Option<Waiting>;
    /// Whether all with this total have come.
    fn is_past(&self, total: f64) -> bool;
}

/// A node that waits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Waiting {
    /// What it was reached for.
    pub(super) cost: f64,
    pub(super) node: u32,
}

impl Waiting {
    pub(super) fn new(cost: f64, node: usize) -> Self {
        Self {
            cost,
            node: node as u32,
        }
    }
}

/// The waiting nodes, in a ring of buckets.
#[derive(Debug, Clone, Default)]
pub(super) struct Buckets {
    /// A power of two of them.
    ring: Vec<Vec<Waiting>>,
    /// The newest of the bucket whose turn it is, if it has come since the last one went.
    newest: Option<Waiting>,
    count: usize,
    /// The bucket whose turn it is, counted from total 0.
    turn: u64,
    per_cost: f64,
}

impl Buckets {
    /// Forgets all, for a search in which a node is pushed at most `span` above the one popped before,
    /// and makes buckets about `width` wide, if no more than a sensible number of them are needed.
    pub(super) fn clear(&mut self, span: f64, width: f64) -> bool {
        let buckets = span / width;
        let sensible = buckets < (MOST - 3) as f64;
        if sensible {
            self.ring.iter_mut().for_each(Vec::clear);
            let buckets = (buckets as usize + 3).next_power_of_two();
            self.ring.resize(buckets, Vec::new());
            (self.count, self.turn, self.newest) = (0, 0, None);
            self.per_cost = (buckets - 3) as f64 / span;
        }
        sensible
    }

    fn bucket_of(&self, total: f64) -> u64 {
        (total * self.per_cost) as u64
    }
}

impl Queue for Buckets {
    fn push(&mut self, total: f64, waiting: Waiting) {
        let bucket = self.bucket_of(total);
        // Whose turn is over by a rounding comes at once, too.
        let (bucket, waiting) = if bucket <= self.turn {
            match self.newest.replace(waiting) {
                Some(before) => (self.turn, before),
                None => return,
            }
        } else {
            (bucket, waiting)
        };
        let mask = self.ring.len() - 1;
        self.ring[bucket as usize & mask].push(waiting);
        self.count += 1;
    }

    fn pop(&mut self) -> Option<Waiting> {
        if self.newest.is_some() {
            return self.newest.take();
        }
        if self.count == 0 {
            return None;
        }
        let mask = self.ring.len() - 1;
        loop {
            if let Some(next) = self.ring[self.turn as usize & mask].pop() {
                self.count -= 1;
                return Some(next);
            }
            self.turn += 1;
        }
    }

    fn is_past(&self, total: f64) -> bool {
        self.bucket_of(total) < self.turn
    }
}

/// The waiting nodes in a heap, for costs that lie too far apart for buckets.
#[derive(Debug, Clone, Default)]
pub(super) struct Sorted {
    /// Totals, costs and nodes: bits of floats that are not negative order like the floats.
    heap: BinaryHeap<Reverse<(u64, u64, u32)>>,
    last: u64,
}

impl Sorted {
    /// Forgets all.
    pub(super) fn clear(&mut self) {
        self.heap.clear();
        self.last = 0;
    }
}

impl Queue for Sorted {
    fn push(&mut self, total: f64, waiting: Waiting) {
        let entry = (total.to_bits(), waiting.cost.to_bits(), waiting.node);
        self.heap.push(Reverse(entry));
    }

    fn pop(&mut self) -> Option<Waiting> {
        let Reverse((total, cost, node)) = self.heap.pop()?;
        self.last = total;
        let cost = f64::from_bits(cost);
        Some(Waiting { cost, node })
    }

    fn is_past(&self, total: f64) -> bool {
        total.to_bits() < self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn all_come_out_and_none_before_its_turn(
            span in 0.1..100.0f64,
            share in 0.001..3.0f64,
            steps in proptest::collection::vec((any::<bool>(), 0.0..1.0f64), 0..400),
        ) {
            let mut buckets = Buckets::default();
            prop_assert!(buckets.clear(span, span * share));
            let mut sorted = Sorted::default();
            sorted.clear();
            prop_assert!(!buckets.clear(span, 0.0) && !buckets.clear(0.0, 0.0));
            check(&mut buckets, span, &steps)?;
            check(&mut sorted, span, &steps)?;
        }
    }

    fn check(
        queue: &mut impl Queue,
        span: f64,
        steps: &[(bool, f64)],
    ) -> Result<(), TestCaseError> {
        let mut waiting: Vec<Waiting> = Vec::new();
        let mut last: f64 = 0.0;
        let pops = std::iter::repeat_n(&(false, 0.0), steps.len() + 1);
        for (node, (push, ahead)) in steps.iter().chain(pops).enumerate() {
            if *push {
                let new = Waiting::new(last + ahead * span, node);
                queue.push(new.cost, new);
                waiting.push(new);
                continue;
            }
            let found = queue.pop();
            prop_assert_eq!(found.is_some(), !waiting.is_empty());
            if let Some(found) = found {
                waiting.retain(|other| *other != found);
                last = last.max(found.cost);
                prop_assert!(!queue.is_past(found.cost));
                prop_assert!(waiting.iter().all(|other| !queue.is_past(other.cost)));
            }
        }
        Ok(())
    }
}
