//! Makes a plan better piece by piece: each piece is searched anew, from the state before it to what the rest
//! of the plan needs after it (as in Siddiqui and Haslum 2015, with windows of a plan as it stands). This
//! file guarantees that what it returns is a plan, and costs no more than the one it was given.

use super::StopReason;
use super::ff::Ff;
use super::greedy::{self, Found, Ranking, Way};
use super::landmarks::Landmarks;
use super::limits::Limits;
use super::relaxed::{Proposition, Relaxed};
use super::without_needless;
use crate::task::{Formula, Literal, Micro, State, Task, conjuncts};
use rustc_hash::FxHashMap;
use std::collections::BTreeSet;

/// How many actions a piece has, one length after the other.
const LENGTHS: [usize; 3] = [10, 20, 40];
/// So many states are expanded at most for each action of a piece.
const PATIENCE: u64 = 4;

/// A plan that costs no more, found with so many expansions at the most, or as far as the limits allow: their
/// cap is another one afterwards.
pub(super) fn improve(
    task: &Task,
    relaxed: &Relaxed,
    heuristic: &mut Ff<'_>,
    mut plan: Vec<usize>,
    mut effort: u64,
    limits: &mut Limits<'_>,
) -> Vec<usize> {
    let propositions = relaxed.of_literals();
    let none = Landmarks::none();
    'all: for length in LENGTHS {
        let mut start = 0;
        let mut stations = stations(task, &plan);
        let mut needs = needs(task, &plan, &stations);
        while start < plan.len() && plan.len() > 1 {
            let end = (start + length).min(plan.len());
            if effort == 0 {
                break 'all;
            }
            let before = limits.expanded();
            limits.cap(effort.min(PATIENCE * length as u64));
            let way = Way {
                from: &stations[start],
                to: Some(&needs[end]),
            };
            heuristic.aim_at(aims(&propositions, &needs[end]));
            let ranking = Ranking {
                weight: Some(1),
                unit: 1,
                bound: cost(task, &plan[start..end]),
                narrow: true,
            };
            let found = greedy::search(task, way, heuristic, &none, ranking, limits);
            effort -= (limits.expanded() - before).min(effort);
            match found {
                Found::Plan(piece) => {
                    let mut other = plan.clone();
                    other.splice(start..end, piece);
                    if is_plan(task, &other) && task.plan_cost(&other) < task.plan_cost(&plan) {
                        plan = without_needless(task, other);
                        stations = self::stations(task, &plan);
                        needs = self::needs(task, &plan, &stations);
                        continue;
                    }
                }
                Found::Stopped(StopReason::Time | StopReason::Memory) => break 'all,
                Found::Nothing | Found::Stopped(_) => {}
            }
            start += length.div_ceil(2);
        }
    }
    heuristic.aim_at(vec![relaxed.goal]);
    plan
}

fn cost(task: &Task, actions: &[usize]) -> Micro {
    let after = |cost, &action: &usize| task.cost_after(cost, action);
    actions.iter().fold(0, after)
}

fn aims(propositions: &FxHashMap<Literal, Proposition>, literals: &[Literal]) -> Vec<Proposition> {
    let known = literals
        .iter()
        .filter_map(|literal| propositions.get(literal));
    known.copied().collect()
}

pub(super) fn is_plan(task: &Task, plan: &[usize]) -> bool {
    let (mut state, mut next) = (task.initial().to_vec(), State::new());
    for &action in plan {
        if !task.is_applicable(&state, action) {
            return false;
        }
        task.successor(&state, action, &mut next);
        std::mem::swap(&mut state, &mut next);
    }
    task.is_goal(&state)
}

/// The states that a plan passes through.
fn stations(task: &Task, plan: &[usize]) -> Vec<State> {
    let mut all = vec![task.initial().to_vec()];
    for &action in plan {
        let mut next = State::new();
        if let Some(last) = all.last() {
            task.successor(last, action, &mut next);
        }
        all.push(next);
    }
    all
}

/// The literals before each action, and at the end, that the rest of a plan needs. Of conditions that are no
/// conjunctions only what they demand outright: who changes the plan has to look whether it still is one.
fn needs(task: &Task, plan: &[usize], stations: &[State]) -> Vec<Vec<Literal>> {
    let outright = |formula: &Formula| conjuncts(formula).0;
    let mut needed: BTreeSet<Literal> = outright(task.goal()).into_iter().collect();
    let mut all = vec![needed.iter().copied().collect::<Vec<_>>()];
    for (&action, state) in plan.iter().zip(stations).rev() {
        let action = &task.actions()[action];
        let mut demanded = outright(&action.precondition);
        for effect in &action.effects {
            if !effect.condition.holds(state) {
                continue;
            }
            demanded.extend(outright(&effect.condition));
            for &fact in &effect.add {
                needed.remove(&Literal::positive(fact));
            }
            for &fact in &effect.delete {
                needed.remove(&Literal::negative(fact));
            }
        }
        needed.extend(demanded);
        all.push(needed.iter().copied().collect());
    }
    all.reverse();
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::{Action, Effect};

    #[test]
    fn a_detour_is_cut_off_and_the_rest_of_the_plan_stays() {
        // Rooms in a row, a door from the third to the last but one, and a lamp to be lit in the first.
        let step = |from, to| {
            let effect = Effect {
                condition: Formula::TRUE,
                add: vec![to],
                delete: vec![from],
            };
            Action::new(
                Formula::Literal(Literal::positive(from)),
                vec![effect],
                1_000_000,
            )
        };
        let rooms: u32 = 30;
        let mut actions: Vec<Action> = (0..rooms - 1).map(|room| step(room, room + 1)).collect();
        let light = Effect {
            condition: Formula::Literal(Literal::positive(0)),
            add: vec![rooms],
            delete: vec![],
        };
        actions.push(Action::new(Formula::TRUE, vec![light], 1_000_000));
        let door = actions.len();
        actions.push(step(2, rooms - 2));
        let goal = [rooms - 1, rooms].map(|fact| Formula::Literal(Literal::positive(fact)));
        let task = Task::new(rooms as usize + 1, &[0], Formula::all(goal), actions);
        let lamp = door - 1;
        let row = 0..door - 1;
        let plan: Vec<usize> = [lamp].into_iter().chain(row).collect();
        assert!(is_plan(&task, &plan));
        let relaxed = Relaxed::new(&task);
        let mut heuristic = Ff::new(&task, &relaxed, &vec![1; task.actions().len()]);
        let mut limits = Limits::new();
        let better = improve(
            &task,
            &relaxed,
            &mut heuristic,
            plan.clone(),
            1000,
            &mut limits,
        );
        assert_eq!(better, [lamp, 0, 1, door, rooms as usize - 2]);
        assert!(limits.expanded() <= 1000);
        let none = improve(
            &task,
            &relaxed,
            &mut heuristic,
            plan.clone(),
            0,
            &mut Limits::new(),
        );
        assert_eq!(none, plan);
    }
}
