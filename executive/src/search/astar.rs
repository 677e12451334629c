//! A* with the landmark-cut heuristic. This file guarantees that the plan it returns costs no more
//! than any other plan.

use super::greedy::Found;
use super::landmark_cut::LandmarkCut;
use super::limits::Limits;
use super::states::{Known, NONE, Node, States};
use crate::task::{Micro, State, Task};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A node to expand: cost plus estimate, estimate (so that deep nodes go first), order of arrival,
/// node, and its cost when it was queued.
type Entry = Reverse<(Micro, Micro, u64, Node, Micro)>;

/// Searches a plan of least cost.
pub(super) fn search(
    task: &Task,
    heuristic: &mut LandmarkCut<'_>,
    limits: &mut Limits<'_>,
) -> Found {
    let mut states = States::new(task.words());
    let mut open: BinaryHeap<Entry> = BinaryHeap::new();
    let mut arrivals = 0;
    let mut applicable = Vec::new();
    let mut next = State::new();
    let Some(estimate) = heuristic.estimate(task.initial()) else {
        return Found::Nothing;
    };
    let first = Known {
        parent: NONE,
        action: 0,
        cost: 0,
        estimate,
    };
    let node = states.insert(task.initial(), first);
    open.push(Reverse((estimate, estimate, 0, node, 0)));
    while let Some(Reverse((_, _, _, node, cost))) = open.pop() {
        if cost > states.known(node).cost {
            continue;
        }
        if task.is_goal(states.state(node)) {
            return Found::Plan(states.way_to(node));
        }
        if let Err(reason) = limits.expand(states.bytes() + open.capacity() * size_of::<Entry>()) {
            return Found::Stopped(reason);
        }
        limits.note(states.known(node).estimate, states.state(node));
        task.applicable(states.state(node), &mut applicable);
        for &action in &applicable {
            task.successor(states.state(node), action as usize, &mut next);
            let cost = task.cost_after(cost, action as usize);
            let mut known = Known {
                parent: node,
                action,
                cost,
                estimate: Micro::MAX,
            };
            let reached = if let Some(seen) = states.find(&next) {
                known.estimate = states.known(seen).estimate;
                if cost >= states.known(seen).cost {
                    continue;
                }
                *states.known_mut(seen) = known;
                seen
            } else {
                known.estimate = heuristic.estimate(&next).unwrap_or(Micro::MAX);
                states.insert(&next, known)
            };
            if known.estimate != Micro::MAX {
                arrivals += 1;
                let rank = cost.saturating_add(known.estimate);
                open.push(Reverse((rank, known.estimate, arrivals, reached, cost)));
            }
        }
    }
    Found::Nothing
}
