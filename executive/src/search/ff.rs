//! The FF heuristic: the cost of a plan that ignores deletes, found along the cheapest supporters
//! by `h_add` (Hoffmann and Nebel 2001, Keyder and Geffner 2008), and the actions of it that can be
//! applied at once. This file guarantees that a state it calls a dead end is one.

use super::queue::Queue;
use super::relaxed::{NO_ACTION, Proposition, Relaxed};
use crate::task::{Micro, Task};

const UNREACHED: u32 = u32::MAX;

/// How far the exploration has come with an operator.
#[derive(Debug, Clone, Copy)]
struct Progress {
    missing: u32,
    sum: u32,
}

/// What the exploration knows of a proposition.
#[derive(Debug, Clone, Copy)]
struct Reached {
    distance: u32,
    supporter: u32,
}

/// The heuristic, with its working memory.
#[derive(Debug)]
pub(super) struct Ff<'a> {
    task: &'a Task,
    relaxed: &'a Relaxed,
    /// Costs of actions, in the unit that they are all multiples of.
    costs: Vec<u32>,
    unit: Micro,
    /// All operators before the exploration.
    fresh: Vec<Progress>,
    progress: Vec<Progress>,
    reached: Vec<Reached>,
    open: Queue,
    marked: Vec<bool>,
    /// What is to be reached, and by proposition whether it is one of that.
    goals: Vec<Proposition>,
    is_goal: Vec<bool>,
    /// Applicable actions of the last relaxed plan, ascending.
    pub(super) preferred: Vec<u32>,
}

fn greatest_common_divisor(mut a: Micro, mut b: Micro) -> Micro {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a
}

impl<'a> Ff<'a> {
    /// The heuristic under `costs` of actions.
    pub(super) fn new(task: &'a Task, relaxed: &'a Relaxed, costs: &[Micro]) -> Self {
        let mut unit = costs
            .iter()
            .copied()
            .fold(0, greatest_common_divisor)
            .max(1);
        let dearest = costs.iter().copied().max().unwrap_or_default();
        // Sums stay far below the end of their numbers; it is an estimate.
        unit = unit.max(dearest / 100_000);
        let costs: Vec<u32> = costs.iter().map(|cost| (cost / unit) as u32).collect();
        let operators = relaxed.operators.iter();
        let fresh: Vec<Progress> = operators
            .map(|operator| Progress {
                missing: operator.needs.len() as u32,
                sum: match operator.action {
                    NO_ACTION => 0,
                    action => costs[action as usize],
                },
            })
            .collect();
        Self {
            task,
            relaxed,
            costs,
            unit,
            progress: fresh.clone(),
            fresh,
            reached: Vec::new(),
            open: Queue::default(),
            marked: vec![false; relaxed.propositions],
            goals: vec![relaxed.goal],
            is_goal: (0..relaxed.propositions as u32)
                .map(|p| p == relaxed.goal)
                .collect(),
            preferred: Vec::new(),
        }
    }

    /// Estimates the way to where all of `goals` hold from now on.
    pub(super) fn aim_at(&mut self, goals: Vec<Proposition>) {
        for goal in std::mem::replace(&mut self.goals, goals) {
            self.is_goal[goal as usize] = false;
        }
        for &goal in &self.goals {
            self.is_goal[goal as usize] = true;
        }
    }

    /// The estimate for `state`, or `None` for a dead end; sets `preferred`.
    pub(super) fn estimate(&mut self, state: &[u64]) -> Option<Micro> {
        self.explore(state);
        self.preferred.clear();
        let mut goals = self.goals.iter();
        if goals.any(|&goal| self.reached[goal as usize].distance == UNREACHED) {
            return None;
        }
        Some(self.extract(state))
    }

    fn explore(&mut self, state: &[u64]) {
        let relaxed = self.relaxed;
        let nothing = Reached {
            distance: UNREACHED,
            supporter: 0,
        };
        self.reached.clear();
        self.reached.resize(relaxed.propositions, nothing);
        self.progress.copy_from_slice(&self.fresh);
        self.open.clear();
        relaxed.each_holding(state, |proposition| {
            self.reached[proposition as usize].distance = 0;
            self.open.push(0, proposition);
        });
        let mut missing = self.goals.len();
        while let Some((cost, proposition)) = self.open.pop() {
            if cost > self.reached[proposition as usize].distance {
                continue;
            }
            if self.is_goal[proposition as usize] {
                missing -= 1;
                if missing == 0 {
                    break;
                }
            }
            for &operator in relaxed.needed_by.of(proposition) {
                let progress = &mut self.progress[operator as usize];
                progress.missing -= 1;
                progress.sum = progress.sum.saturating_add(cost);
                if progress.missing > 0 {
                    continue;
                }
                let distance = progress.sum.min(UNREACHED - 1);
                for &add in relaxed.adds.of(operator) {
                    let known = &mut self.reached[add as usize];
                    if distance < known.distance {
                        *known = Reached {
                            distance,
                            supporter: operator,
                        };
                        self.open.push(distance, add);
                    }
                }
            }
        }
    }

    fn extract(&mut self, state: &[u64]) -> Micro {
        let relaxed = self.relaxed;
        self.marked.fill(false);
        let mut chosen = Vec::new();
        let mut stack: Vec<Proposition> = self.goals.clone();
        while let Some(proposition) = stack.pop() {
            let index = proposition as usize;
            if std::mem::replace(&mut self.marked[index], true) || self.reached[index].distance == 0
            {
                continue;
            }
            let operator = &relaxed.operators[self.reached[index].supporter as usize];
            if operator.action != NO_ACTION {
                chosen.push(operator.action);
            }
            stack.extend(&operator.needs);
        }
        chosen.sort_unstable();
        chosen.dedup();
        let costs = chosen
            .iter()
            .map(|&action| Micro::from(self.costs[action as usize]));
        let total: Micro = costs.sum();
        chosen.retain(|&action| self.task.is_applicable(state, action as usize));
        self.preferred = chosen;
        total.saturating_mul(self.unit)
    }
}
