//! Lazy best-first search with preferred actions, greedy or weighted (Richter and Westphal 2010).
//! This file guarantees that a search that ends without plan or limit has seen every state that a
//! plan below its bound could pass through.

use super::StopReason;
use super::ff::Ff;
use super::landmarks::Landmarks;
use super::limits::Limits;
use super::states::{Known, NONE, Node, States};
use crate::task::{Literal, Micro, State, Task};
use std::collections::{BTreeMap, VecDeque};

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

/// A successor not yet computed: parent and action.
type Entry = (Node, u32);

/// Queues of successors: for each of two estimates all of them, and those by preferred actions.
#[derive(Debug)]
struct Queues {
    /// By rank; of equals the first comes first.
    open: [BTreeMap<Micro, VecDeque<Entry>>; 4],
    /// The queue with the lowest one is next; of equals the one with the highest number.
    turns: [i64; 4],
    entries: usize,
}

impl Queues {
    fn new() -> Self {
        Self {
            open: std::array::from_fn(|_| BTreeMap::new()),
            turns: [0; 4],
            entries: 0,
        }
    }

    fn bytes(&self) -> usize {
        self.entries * size_of::<Entry>() * 3 / 2
    }

    fn boost(&mut self) {
        self.turns[1] -= BOOST;
        self.turns[3] -= BOOST;
    }

    /// Adds the successors of a node by some actions, of which some are preferred; of one node's the last
    /// action comes first: in nine of ten larger tasks of the planning competitions a plan is found after a
    /// quarter to nine tenths of the states that it takes the other way round (in miconic after 1.4 times as
    /// many), and orders by chance lie between.
    fn push(&mut self, ranks: [Option<Micro>; 2], node: Node, actions: &[u32], preferred: &[u32]) {
        for (which, rank) in ranks.into_iter().enumerate() {
            let Some(rank) = rank else { continue };
            for (queue, actions) in [(2 * which, actions), (2 * which + 1, preferred)] {
                if !actions.is_empty() {
                    let bucket = self.open[queue].entry(rank).or_default();
                    bucket.extend(actions.iter().rev().map(|&action| (node, action)));
                    self.entries += actions.len();
                }
            }
        }
    }

    fn pop(&mut self) -> Option<Entry> {
        let filled = (0..4).rev().filter(|&queue| !self.open[queue].is_empty());
        let next = filled.min_by_key(|&queue| self.turns[queue])?;
        self.turns[next] += 1;
        self.entries -= 1;
        let mut bucket = self.open[next].first_entry()?;
        let entry = bucket.get_mut().pop_front();
        if bucket.get().is_empty() {
            bucket.remove();
        }
        entry
    }
}

/// How a search ranks states.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ranking {
    /// By the estimate alone, or by the cost so far plus so many times the estimate.
    pub(super) weight: Option<u64>,
    /// What a landmark counts beside costs.
    pub(super) unit: Micro,
    /// A plan must cost less.
    pub(super) bound: Micro,
    /// Whether only preferred actions are looked at: then nothing found says nothing.
    pub(super) narrow: bool,
}

/// From where to where a search goes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Way<'a> {
    pub(super) from: &'a [u64],
    /// What holds at its end; without, the task's goal.
    pub(super) to: Option<&'a [Literal]>,
}

impl<'a> Way<'a> {
    /// The task's own.
    pub(super) fn of(task: &'a Task) -> Self {
        Self {
            from: task.initial(),
            to: None,
        }
    }

    fn ends_at(&self, task: &Task, state: &[u64]) -> bool {
        match self.to {
            Some(literals) => literals.iter().all(|literal| literal.holds(state)),
            None => task.is_goal(state),
        }
    }
}

/// Searches a plan that costs less than the ranking's bound. The heuristic looks at where the way ends.
pub(super) fn search(
    task: &Task,
    way: Way<'_>,
    heuristic: &mut Ff<'_>,
    landmarks: &Landmarks,
    ranking: Ranking,
    limits: &mut Limits<'_>,
) -> Found {
    let Ranking { weight, bound, .. } = ranking;
    // Without a bound, any way to a state is as good as another.
    let reopens = weight.is_some() || bound != Micro::MAX;
    let mut states = States::new(task.words());
    let mut queues = Queues::new();
    let mut best = [Micro::MAX; 2];
    let mut applicable = Vec::new();
    let mut next = State::new();
    let mut from = (NONE, 0);
    // The landmarks accepted on the way to each node.
    let words = landmarks.words();
    let mut accepted: Vec<u64> = Vec::new();
    next.extend_from_slice(way.from);
    loop {
        // Enter the state in `next`, reached by `from`.
        let (parent, action) = from;
        let cost = if parent == NONE {
            0
        } else {
            task.cost_after(states.known(parent).cost, action as usize)
        };
        let reached = Known {
            parent,
            action,
            cost,
            estimate: Micro::MAX,
        };
        let entered = if cost >= bound {
            None
        } else {
            match states.find(&next) {
                None => {
                    if parent == NONE {
                        accepted.resize(words, 0);
                    } else {
                        let before = parent as usize * words;
                        accepted.extend_from_within(before..before + words);
                    }
                    let node = states.insert(&next, reached);
                    landmarks.accept(&next, &mut accepted[node as usize * words..]);
                    Some((node, true))
                }
                Some(node) if reopens && cost < states.known(node).cost => {
                    let estimate = states.known(node).estimate;
                    *states.known_mut(node) = Known {
                        estimate,
                        ..reached
                    };
                    // Nothing leads on from a dead end, whatever the way to it costs.
                    (estimate != Micro::MAX).then_some((node, false))
                }
                Some(_) => None,
            }
        };
        if let Some((node, new)) = entered {
            if way.ends_at(task, &next) {
                return Found::Plan(states.way_to(node));
            }
            let bytes = states.bytes() + queues.bytes() + accepted.capacity() * 8;
            if let Err(reason) = limits.expand(bytes) {
                return Found::Stopped(reason);
            }
            // A better way to a known state costs one more estimate, for its preferred actions.
            if let Some(estimate) = heuristic.estimate(&next) {
                states.known_mut(node).estimate = estimate;
                limits.note(estimate, &next);
                let mut estimates = [Some(estimate), None];
                if words > 0 {
                    let own = &accepted[node as usize * words..][..words];
                    estimates[1] = Some(landmarks.count(&next, own).saturating_mul(ranking.unit));
                }
                for (estimate, best) in estimates.iter().zip(&mut best) {
                    if let Some(estimate) = estimate
                        && new
                        && estimate < best
                    {
                        *best = *estimate;
                        queues.boost();
                    }
                }
                let ranks = estimates.map(|estimate| {
                    Some(match weight {
                        None => estimate?,
                        Some(weight) => cost.saturating_add(weight.saturating_mul(estimate?)),
                    })
                });
                choose(
                    task,
                    (&next, cost),
                    ranking,
                    &mut applicable,
                    &mut heuristic.preferred,
                );
                queues.push(ranks, node, &applicable, &heuristic.preferred);
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

/// The actions to go on with from a state that is reached at a cost, among them the preferred ones.
fn choose(
    task: &Task,
    (state, cost): (&[u64], Micro),
    ranking: Ranking,
    applicable: &mut Vec<u32>,
    preferred: &mut Vec<u32>,
) {
    if ranking.narrow {
        applicable.clear();
        applicable.append(preferred);
    } else {
        task.applicable(state, applicable);
    }
    if ranking.bound != Micro::MAX {
        let below = |&action: &u32| task.cost_after(cost, action as usize) < ranking.bound;
        applicable.retain(below);
        preferred.retain(below);
    }
}
