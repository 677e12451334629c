//! The FF heuristic: the cost of a plan that ignores deletes, found along the cheapest supporters
//! by h_add (Hoffmann and Nebel 2001, Keyder and Geffner 2008), and the actions of it that can be
//! applied at once. This file guarantees that a state it calls a dead end is one.

use super::relaxed::{NO_ACTION, Proposition, Relaxed};
use crate::task::{Micro, Task};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

const UNREACHED: Micro = Micro::MAX;

/// The heuristic, with its working memory.
#[derive(Debug)]
pub(super) struct Ff<'a> {
    task: &'a Task,
    relaxed: &'a Relaxed,
    costs: Vec<Micro>,
    distance: Vec<Micro>,
    supporter: Vec<u32>,
    missing: Vec<u32>,
    sum: Vec<Micro>,
    open: BinaryHeap<Reverse<(Micro, Proposition)>>,
    marked: Vec<bool>,
    /// Applicable actions of the last relaxed plan, ascending.
    pub(super) preferred: Vec<u32>,
}

impl<'a> Ff<'a> {
    /// The heuristic under `costs` of actions.
    pub(super) fn new(task: &'a Task, relaxed: &'a Relaxed, costs: Vec<Micro>) -> Self {
        Self {
            task,
            relaxed,
            costs,
            distance: vec![UNREACHED; relaxed.propositions],
            supporter: vec![0; relaxed.propositions],
            missing: vec![0; relaxed.operators.len()],
            sum: vec![0; relaxed.operators.len()],
            open: BinaryHeap::new(),
            marked: vec![false; relaxed.propositions],
            preferred: Vec::new(),
        }
    }

    /// The estimate for `state`, or `None` for a dead end; sets `preferred`.
    pub(super) fn estimate(&mut self, state: &[u64]) -> Option<Micro> {
        self.explore(state);
        self.preferred.clear();
        if self.distance[self.relaxed.goal as usize] == UNREACHED {
            return None;
        }
        Some(self.extract(state))
    }

    fn explore(&mut self, state: &[u64]) {
        let relaxed = self.relaxed;
        self.distance.fill(UNREACHED);
        for (index, operator) in relaxed.operators.iter().enumerate() {
            self.missing[index] = operator.needs.len() as u32;
            self.sum[index] = relaxed.cost(index, &self.costs);
        }
        self.open.clear();
        relaxed.each_holding(state, |proposition| {
            self.distance[proposition as usize] = 0;
            self.open.push(Reverse((0, proposition)));
        });
        while let Some(Reverse((cost, proposition))) = self.open.pop() {
            if cost > self.distance[proposition as usize] {
                continue;
            }
            if proposition == relaxed.goal {
                break;
            }
            for &operator in &relaxed.needed_by[proposition as usize] {
                let index = operator as usize;
                self.missing[index] -= 1;
                self.sum[index] = self.sum[index].saturating_add(cost);
                if self.missing[index] > 0 {
                    continue;
                }
                let reached = self.sum[index];
                for &add in &relaxed.operators[index].adds {
                    if reached < self.distance[add as usize] {
                        self.distance[add as usize] = reached;
                        self.supporter[add as usize] = operator;
                        self.open.push(Reverse((reached, add)));
                    }
                }
            }
        }
    }

    fn extract(&mut self, state: &[u64]) -> Micro {
        let relaxed = self.relaxed;
        self.marked.fill(false);
        let mut chosen = Vec::new();
        let mut stack = vec![relaxed.goal];
        while let Some(proposition) = stack.pop() {
            let index = proposition as usize;
            if std::mem::replace(&mut self.marked[index], true) || self.distance[index] == 0 {
                continue;
            }
            let operator = &relaxed.operators[self.supporter[index] as usize];
            if operator.action != NO_ACTION {
                chosen.push(operator.action);
            }
            stack.extend(&operator.needs);
        }
        chosen.sort_unstable();
        chosen.dedup();
        let cost = chosen.iter().map(|&action| self.costs[action as usize]);
        let total = cost.fold(0, Micro::saturating_add);
        chosen.retain(|&action| self.task.is_applicable(state, action as usize));
        self.preferred = chosen;
        total
    }
}
