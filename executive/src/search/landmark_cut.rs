//! The landmark-cut heuristic (Helmert and Domshlak 2009): finds sets of actions of which every
//! plan must have one, and shares the actions' costs out among them. With conditional effects a
//! cut takes its cost from every part of its actions, as in Roeger, Pommerening and Helmert 2014.
//! This file guarantees that the estimate is never above the cost of a plan.

use super::relaxed::{NO_ACTION, Proposition, Relaxed};
use crate::task::Micro;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

const UNREACHED: Micro = Micro::MAX;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Zone {
    Outside,
    BeforeGoal,
    Goal,
}

/// The heuristic, with its working memory.
#[derive(Debug)]
pub(super) struct LandmarkCut<'a> {
    relaxed: &'a Relaxed,
    costs: Vec<Micro>,
    /// The operators of each action.
    parts: Vec<Vec<u32>>,
    rest: Vec<Micro>,
    distance: Vec<Micro>,
    missing: Vec<u32>,
    /// The dearest proposition that each operator needs; of several, the one that the fewest operators
    /// need: it says more of this one. Of eight choices that were tried on twelve small tasks of the planning
    /// competitions, none does better over all; the one by number expands twice as much in logistics. Of a goal's
    /// needs, one that was not cut already comes first: a second cut for it is one for several things before it, and
    /// worth one where they are worth one each (visitall of 5 by 5 cells: 27 states in place of 60,300).
    supporter: Vec<Proposition>,
    /// The place of each proposition in that order, the best last.
    rank: Vec<u32>,
    open: BinaryHeap<Reverse<(Micro, u32, Proposition)>>,
    zone: Vec<Zone>,
}

impl<'a> LandmarkCut<'a> {
    /// The heuristic under `costs` of actions.
    pub(super) fn new(relaxed: &'a Relaxed, costs: Vec<Micro>) -> Self {
        let mut parts = vec![Vec::new(); costs.len()];
        for (index, operator) in (0..).zip(&relaxed.operators) {
            if operator.action != NO_ACTION {
                parts[operator.action as usize].push(index);
            }
        }
        let mut order: Vec<Proposition> = (0..relaxed.propositions as u32).collect();
        order.sort_by_key(|&of| (Reverse(relaxed.needed_by.of(of).len()), of));
        let mut rank = vec![0; relaxed.propositions];
        for (place, &of) in (0..).zip(&order) {
            rank[of as usize] = place;
        }
        Self {
            relaxed,
            parts,
            rank,
            rest: costs.clone(),
            costs,
            distance: vec![UNREACHED; relaxed.propositions],
            missing: vec![0; relaxed.operators.len()],
            supporter: vec![0; relaxed.operators.len()],
            open: BinaryHeap::new(),
            zone: vec![Zone::Outside; relaxed.propositions],
        }
    }

    /// The estimate for `state`, or `None` for a dead end.
    pub(super) fn estimate(&mut self, state: &[u64]) -> Option<Micro> {
        self.rest.clone_from(&self.costs);
        self.explore(state);
        let goal = self.relaxed.goal;
        if self.distance[goal as usize] == UNREACHED {
            return None;
        }
        let mut total: Micro = 0;
        while self.distance[goal as usize] > 0 {
            self.zone.fill(Zone::Outside);
            self.mark_goal_zone();
            let cut = self.cut(state);
            let Some(cost) = cut.iter().map(|&a| self.rest[a as usize]).min() else {
                // Cannot be: a goal at a cost lies behind some action that costs.
                break;
            };
            total = total.saturating_add(cost);
            for &action in &cut {
                self.rest[action as usize] -= cost;
            }
            self.lower(&cut);
        }
        Some(total)
    }

    fn reach(&mut self, operator: usize, from: Micro) {
        let relaxed = self.relaxed;
        let cost = from.saturating_add(relaxed.cost(operator, &self.rest));
        for &add in &relaxed.operators[operator].adds {
            if cost < self.distance[add as usize] {
                self.distance[add as usize] = cost;
                self.open
                    .push(Reverse((cost, self.rank[add as usize], add)));
            }
        }
    }

    /// `h_max` from scratch.
    fn explore(&mut self, state: &[u64]) {
        let relaxed = self.relaxed;
        self.distance.fill(UNREACHED);
        for (missing, operator) in self.missing.iter_mut().zip(&relaxed.operators) {
            *missing = operator.needs.len() as u32;
        }
        self.open.clear();
        relaxed.each_holding(state, |proposition| {
            self.distance[proposition as usize] = 0;
            let rank = self.rank[proposition as usize];
            self.open.push(Reverse((0, rank, proposition)));
        });
        while let Some(Reverse((cost, _, proposition))) = self.open.pop() {
            if cost > self.distance[proposition as usize] {
                continue;
            }
            for &operator in relaxed.needed_by.of(proposition) {
                let index = operator as usize;
                self.missing[index] -= 1;
                if self.missing[index] == 0 {
                    self.supporter[index] = proposition;
                    self.reach(index, cost);
                }
            }
        }
    }

    /// `h_max` after the actions of a cut have become cheaper.
    fn lower(&mut self, cheaper: &[u32]) {
        let relaxed = self.relaxed;
        self.open.clear();
        for &action in cheaper {
            for part in 0..self.parts[action as usize].len() {
                let operator = self.parts[action as usize][part] as usize;
                if self.missing[operator] == 0 {
                    let from = self.distance[self.supporter[operator] as usize];
                    self.reach(operator, from);
                }
            }
        }
        while let Some(Reverse((cost, _, proposition))) = self.open.pop() {
            if cost > self.distance[proposition as usize] {
                continue;
            }
            for &operator in relaxed.needed_by.of(proposition) {
                let index = operator as usize;
                if self.missing[index] > 0 || self.supporter[index] != proposition {
                    continue;
                }
                // Its dearest need has become cheaper; another may be the dearest now.
                let free = relaxed.operators[index].action == NO_ACTION;
                let needs = relaxed.operators[index].needs.iter().copied();
                let dearest = needs.max_by_key(|&need| {
                    let fresh = !free || !self.is_cut(need);
                    (
                        self.distance[need as usize],
                        fresh,
                        self.rank[need as usize],
                    )
                });
                if let Some(dearest) = dearest {
                    self.supporter[index] = dearest;
                    self.reach(index, self.distance[dearest as usize]);
                }
            }
        }
    }

    /// Whether what brings it about soonest costs nothing any more: a cut for it is one for something before it.
    fn is_cut(&self, proposition: Proposition) -> bool {
        let relaxed = self.relaxed;
        let mut makers = relaxed.added_by.of(proposition).iter();
        makers.any(|&operator| {
            let index = operator as usize;
            self.missing[index] == 0
                && relaxed.cost(index, &self.rest) == 0
                && self.distance[self.supporter[index] as usize]
                    == self.distance[proposition as usize]
        })
    }

    /// Marks the propositions from which the goal is reached at no further cost.
    fn mark_goal_zone(&mut self) {
        let relaxed = self.relaxed;
        let mut stack = vec![relaxed.goal];
        while let Some(proposition) = stack.pop() {
            if self.zone[proposition as usize] == Zone::Goal {
                continue;
            }
            self.zone[proposition as usize] = Zone::Goal;
            for &operator in relaxed.added_by.of(proposition) {
                let index = operator as usize;
                if self.missing[index] == 0 && relaxed.cost(index, &self.rest) == 0 {
                    stack.push(self.supporter[index]);
                }
            }
        }
    }

    /// The actions that lead from what the state reaches outside the goal zone into it.
    fn cut(&mut self, state: &[u64]) -> Vec<u32> {
        let relaxed = self.relaxed;
        let mut stack = Vec::new();
        relaxed.each_holding(state, |proposition| {
            if self.zone[proposition as usize] == Zone::Outside {
                self.zone[proposition as usize] = Zone::BeforeGoal;
                stack.push(proposition);
            }
        });
        let mut cut = Vec::new();
        while let Some(proposition) = stack.pop() {
            for &operator in relaxed.needed_by.of(proposition) {
                let index = operator as usize;
                if self.missing[index] > 0 || self.supporter[index] != proposition {
                    continue;
                }
                let operator = &relaxed.operators[index];
                if operator
                    .adds
                    .iter()
                    .any(|&add| self.zone[add as usize] == Zone::Goal)
                {
                    cut.push(operator.action);
                    continue;
                }
                for &add in &operator.adds {
                    if self.zone[add as usize] == Zone::Outside {
                        self.zone[add as usize] = Zone::BeforeGoal;
                        stack.push(add);
                    }
                }
            }
        }
        cut.sort_unstable();
        cut.dedup();
        cut
    }
}
