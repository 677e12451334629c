//! A queue by small whole numbers: buckets for the numbers that are common, a heap for the others.
//! This file guarantees that lower numbers come first, and of equal ones below [`BUCKETS`] the one that
//! was pushed first.

use super::relaxed::Proposition;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Numbers below this have a bucket each.
const BUCKETS: usize = 2048;

/// Propositions by distance.
#[derive(Debug, Default)]
pub(super) struct Queue {
    buckets: Vec<Vec<Proposition>>,
    /// No bucket below this one has anything.
    lowest: usize,
    /// So many of the lowest bucket are gone.
    gone: usize,
    far: BinaryHeap<Reverse<(u32, Proposition)>>,
}

impl Queue {
    pub(super) fn clear(&mut self) {
        let lowest = self.lowest.min(self.buckets.len());
        for bucket in &mut self.buckets[lowest..] {
            bucket.clear();
        }
        self.lowest = 0;
        self.gone = 0;
        self.far.clear();
    }

    /// Adds one that is not nearer than the last that was popped since it was cleared.
    pub(super) fn push(&mut self, distance: u32, proposition: Proposition) {
        let index = distance as usize;
        if index >= BUCKETS {
            return self.far.push(Reverse((distance, proposition)));
        }
        if index >= self.buckets.len() {
            self.buckets.resize_with(index + 1, Vec::new);
        }
        self.buckets[index].push(proposition);
    }

    pub(super) fn pop(&mut self) -> Option<(u32, Proposition)> {
        while let Some(bucket) = self.buckets.get_mut(self.lowest) {
            if let Some(&proposition) = bucket.get(self.gone) {
                self.gone += 1;
                return Some((self.lowest as u32, proposition));
            }
            bucket.clear();
            self.gone = 0;
            self.lowest += 1;
        }
        self.far.pop().map(|Reverse(entry)| entry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_nearer_comes_first_whatever_the_distance() {
        let mut queue = Queue::default();
        let distances = [7, 0, 5000, 3, 4_000_000_000, 2047, 2048, 3];
        for _ in 0..2 {
            for (proposition, &distance) in (0..).zip(&distances) {
                queue.push(distance, proposition);
            }
            let mut popped = Vec::new();
            while let Some((distance, proposition)) = queue.pop() {
                assert_eq!(distances[proposition as usize], distance);
                popped.push(distance);
            }
            assert_eq!(popped, [0, 3, 3, 7, 2047, 2048, 5000, 4_000_000_000]);
            queue.clear();
            queue.push(1, 0);
            queue.push(9000, 0);
            queue.clear();
            assert_eq!(queue.pop(), None);
            queue.clear();
        }
    }
}
