//! Nodes that wait to be looked at, cheapest first. This file guarantees the order of a binary heap,
//! at a cost that hardly grows with how many wait: only the cheapest few lie in a heap, the others
//! in buckets by their estimate, unsorted until their turn.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Into how many buckets the span of the waiting nodes is cut.
const BUCKETS: usize = 512;

/// A node that waits. Of equal totals the node nearer to the goal goes first, then the lower one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Waiting {
    /// Bits of floats that are not negative order like the floats.
    total: u64,
    estimate: u32,
    node: u32,
}

impl Waiting {
    /// A node reached for `cost`, with an `estimate` of what remains to the goal.
    pub(super) fn new(cost: f64, estimate: f64, node: usize) -> Self {
        Self {
            total: (cost + estimate).to_bits(),
            estimate: (estimate as f32).to_bits(),
            node: node as u32,
        }
    }

    pub(super) fn node(self) -> usize {
        self.node as usize
    }

    /// Cost so far and estimate.
    pub(super) fn total(self) -> f64 {
        f64::from_bits(self.total)
    }
}

/// The waiting nodes.
#[derive(Debug, Clone, Default)]
pub(super) struct Queue {
    /// Those of the bucket whose turn it is, and of the ones before.
    soon: BinaryHeap<Reverse<Waiting>>,
    /// Those of the [`BUCKETS`] buckets after it, in a ring.
    later: Vec<Vec<Reverse<Waiting>>>,
    /// How many wait in `later`.
    count: usize,
    /// Whose turn it is.
    turn: usize,
    buckets_per_cost: f64,
}

impl Queue {
    /// Forgets all, for a search in which a node is pushed at most `span` above the one popped before.
    pub(super) fn clear(&mut self, span: f64) {
        self.soon.clear();
        self.later.iter_mut().for_each(Vec::clear);
        self.later.resize(BUCKETS, Vec::new());
        (self.count, self.turn) = (0, 0);
        let per_cost = (BUCKETS - 2) as f64 / span;
        // Where all is free of charge there is one bucket.
        self.buckets_per_cost = if per_cost.is_finite() { per_cost } else { 0.0 };
    }

    fn bucket_of(&self, waiting: Waiting) -> usize {
        (waiting.total() * self.buckets_per_cost) as usize
    }

    pub(super) fn push(&mut self, waiting: Waiting) {
        let bucket = self.bucket_of(waiting);
        // What is too far away for the ring is in nobody's way in the heap.
        if bucket <= self.turn || bucket - self.turn >= BUCKETS {
            self.soon.push(Reverse(waiting));
        } else {
            self.later[bucket % BUCKETS].push(Reverse(waiting));
            self.count += 1;
        }
    }

    pub(super) fn pop(&mut self) -> Option<Waiting> {
        loop {
            // The turn of a node in the heap may be yet to come.
            if let Some(Reverse(next)) = self.soon.peek() {
                let bucket = self.bucket_of(*next);
                if self.count == 0 {
                    self.turn = self.turn.max(bucket);
                }
                if bucket <= self.turn {
                    return self.soon.pop().map(|Reverse(next)| next);
                }
            }
            if self.count == 0 {
                return None;
            }
            self.turn += 1;
            let bucket = &mut self.later[self.turn % BUCKETS];
            self.count -= bucket.len();
            if self.soon.is_empty() && !bucket.is_empty() {
                let mut empty = std::mem::take(&mut self.soon).into_vec();
                std::mem::swap(&mut empty, bucket);
                self.soon = BinaryHeap::from(empty);
            } else {
                self.soon.extend(bucket.drain(..));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_gives_the_order_of_a_heap(
            span in prop_oneof![Just(0.0), 0.1..100.0f64],
            steps in proptest::collection::vec((any::<bool>(), 0.0..2.0f64, 0.0..3.0f64), 0..400),
        ) {
            let mut queue = Queue::default();
            queue.clear(span);
            let mut heap = BinaryHeap::new();
            let mut last = 0.0;
            for (node, (push, ahead, estimate)) in steps.into_iter().enumerate() {
                if push {
                    // Also beyond the span.
                    let waiting = Waiting::new(last + ahead * span, estimate, node);
                    queue.push(waiting);
                    heap.push(Reverse(waiting));
                } else {
                    let expected = heap.pop().map(|Reverse(waiting)| waiting);
                    last = expected.map_or(last, |waiting| waiting.total());
                    prop_assert_eq!(queue.pop(), expected);
                }
            }
            while let Some(Reverse(expected)) = heap.pop() {
                prop_assert_eq!(queue.pop(), Some(expected));
            }
            prop_assert_eq!(queue.pop(), None);
        }
    }
}
