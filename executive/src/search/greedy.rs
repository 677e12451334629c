//! Lazy best-first search with preferred actions, greedy or weighted (Richter and Westphal 2010).
//! This file guarantees that a search that ends without plan or limit has seen every state that a
//! plan below its bound could pass through.

use super::StopReason;
use super::ff::Ff;
use super::limits::Limits;
use super::states::{Known, NONE, Node, States};
use crate::task::{Micro, State, Task};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// What a search came to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Found {
    /// A plan below the bound.
    Plan(Vec<usize>),
    /// There is no plan below the bound.
    Nothing,
    /// A limit was met.
    Stopped(StopReason),
}

/// How many turns the queue of preferred actions gains when the search makes progress.
const BOOST: i64 = 1000;

/// A successor not yet computed: rank, order of arrival, parent, action.
type Entry = Reverse<(Micro, u64, Node, u32)>;

#[derive(Debug)]
struct Queues {
    /// All successors, and those by preferred actions alone.
    open: [BinaryHeap<Entry>; 2],
    /// The queue with the lower one is next.
    turns: [i64; 2],
    arrivals: u64,
}

impl Queues {
    fn new() -> Self {
        Self {
            open: [BinaryHeap::new(), BinaryHeap::new()],
            turns: [0, 0],
            arrivals: 0,
        }
    }

    fn bytes(&self) -> usize {
        let capacity: usize = self.open.iter().map(BinaryHeap::capacity).sum();
        capacity * size_of::<Entry>()
    }

    fn push(&mut self, rank: Micro, parent: Node, action: u32, preferred: bool) {
        self.arrivals += 1;
        let entry = Reverse((rank, self.arrivals, parent, action));
        self.open[0].push(entry);
        if preferred {
            self.open[1].push(entry);
        }
    }

    fn pop(&mut self) -> Option<(Node, u32)> {
        let first = usize::from(self.turns[1] <= self.turns[0]);
        for queue in [first, 1 - first] {
            if let Some(Reverse((_, _, parent, action))) = self.open[queue].pop() {
                self.turns[queue] += 1;
                return Some((parent, action));
            }
        }
        None
    }
}

/// Searches a plan that costs less than `bound`. States are ranked by the estimate alone, or by
/// the cost so far plus `weight` times the estimate.
pub(super) fn search(
    task: &Task,
    heuristic: &mut Ff<'_>,
    weight: Option<u64>,
    bound: Micro,
    limits: &mut Limits<'_>,
) -> Found {
    let mut states = States::new(task.words());
    let mut queues = Queues::new();
    let mut best = Micro::MAX;
    let mut applicable = Vec::new();
    let mut next = State::new();
    let mut from = (NONE, 0);
    next.extend_from_slice(task.initial());
    loop {
        // Enter the state in `next`, reached by `from`.
        let (parent, action) = from;
        let cost = if parent == NONE {
            0
        } else {
            task.cost_after(states.known(parent).cost, action as usize)
        };
        let way = Known {
            parent,
            action,
            cost,
            estimate: Micro::MAX,
        };
        let entered = if cost >= bound {
            None
        } else {
            match states.find(&next) {
                None => Some((states.insert(&next, way), true)),
                Some(node) if cost < states.known(node).cost => {
                    let estimate = states.known(node).estimate;
                    *states.known_mut(node) = Known { estimate, ..way };
                    // Nothing leads on from a dead end, whatever the way to it costs.
                    (estimate != Micro::MAX).then_some((node, false))
                }
                Some(_) => None,
            }
        };
        if let Some((node, new)) = entered {
            if task.is_goal(&next) {
                return Found::Plan(states.way_to(node));
            }
            if let Err(reason) = limits.expand(states.bytes() + queues.bytes()) {
                return Found::Stopped(reason);
            }
            // A better way to a known state costs one more estimate, for its preferred actions.
            if let Some(estimate) = heuristic.estimate(&next) {
                states.known_mut(node).estimate = estimate;
                if new && estimate < best {
                    best = estimate;
                    queues.turns[1] -= BOOST;
                }
                let rank = match weight {
                    None => estimate,
                    Some(weight) => cost.saturating_add(weight.saturating_mul(estimate)),
                };
                task.applicable(&next, &mut applicable);
                for &action in &applicable {
                    if task.cost_after(cost, action as usize) < bound {
                        let preferred = heuristic.preferred.binary_search(&action).is_ok();
                        queues.push(rank, node, action, preferred);
                    }
                }
            }
        }
        // Take the next successor.
        let Some((parent, action)) = queues.pop() else {
            return Found::Nothing;
        };
        task.successor(states.state(parent), action as usize, &mut next);
        from = (parent, action);
    }
}
