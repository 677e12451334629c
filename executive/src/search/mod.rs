//! Searching plans of a ground task: a first one fast, better ones until the limit, or the best.
//! This module guarantees that what it returns is a plan by [`Task::plan_cost`], and says
//! *optimal* or *none* only when it is proved.

mod astar;
mod ff;
mod greedy;
mod landmark_cut;
mod landmarks;
mod limits;
mod queue;
mod relaxed;
mod states;
mod windows;

pub use limits::{Limits, Milestones, StopReason};

use crate::task::{Literal, Micro, Task};
use ff::Ff;
use greedy::{Found, Ranking, Way};
use landmark_cut::LandmarkCut;
use landmarks::Landmarks;
use relaxed::Relaxed;

/// What is asked of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Effort {
    /// A plan fast: the first one found, made better with about as much work again.
    First,
    /// The first, then better ones until the limit or until the best is proved.
    #[default]
    Anytime,
    /// A plan of least cost, or none.
    Optimal,
}

/// What a search came to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Answer {
    /// A plan.
    Solved {
        /// Its actions, by their number in the task.
        actions: Vec<usize>,
        /// What it costs.
        cost: Micro,
        /// Whether it is proved that none costs less.
        optimal: bool,
    },
    /// It is proved that there is none.
    Unsolvable,
    /// None was found within the limit.
    Stopped(StopReason),
}

/// What may ever hold, ignoring what actions delete: no plan reaches what is not in here.
#[derive(Debug, Clone)]
pub struct Reachability {
    /// Whether the goal may.
    pub goal: bool,
    literals: Vec<bool>,
}

impl Reachability {
    /// Of `task`. A literal that no condition of the task names counts as reachable.
    pub fn new(task: &Task) -> Self {
        let reachable = Relaxed::new(task).reachable(task);
        Self {
            goal: reachable.goal,
            literals: reachable.literals,
        }
    }

    /// Whether a literal may hold.
    pub fn literal(&self, literal: Literal) -> bool {
        self.literals[literal.index()]
    }
}

/// Searches a plan of `task`.
///
/// ```
/// use executive::task::{Action, Effect, Formula, Literal, Task, micro};
/// use executive::{Answer, Effort, Limits, search};
///
/// let fact = |f| Formula::Literal(Literal::positive(f));
/// let go = Effect { condition: Formula::TRUE, add: vec![1], delete: vec![0] };
/// let action = Action::new(fact(0), vec![go], micro(2.0));
/// let task = Task::new(2, &[0], fact(1), vec![action]);
/// let answer = search(&task, Effort::Optimal, &mut Limits::new());
/// assert_eq!(answer, Answer::Solved { actions: vec![0], cost: 2_000_000, optimal: true });
/// ```
pub fn search(task: &Task, effort: Effort, limits: &mut Limits<'_>) -> Answer {
    limits.note_grounded();
    let relaxed = Relaxed::new(task);
    limits.forget_nearest();
    if let Err(reason) = limits.check_time() {
        return Answer::Stopped(reason);
    }
    let costs = || task.actions().iter().map(|action| action.cost);
    if effort == Effort::Optimal {
        let mut heuristic = LandmarkCut::new(&relaxed, costs().collect());
        return match astar::search(task, &mut heuristic, limits) {
            Found::Plan(actions) => {
                limits.note_plan();
                solved(task, actions, true)
            }
            Found::Nothing => Answer::Unsolvable,
            Found::Stopped(reason) => Answer::Stopped(reason),
        };
    }
    let landmarks = Landmarks::new(task, &relaxed);
    // Every action counts 1 for the first plan: short relaxed plans lead to the goal fastest.
    let mut unit = Ff::new(task, &relaxed, &vec![1; task.actions().len()]);
    let first = Ranking {
        weight: None,
        unit: 1,
        bound: Micro::MAX,
        narrow: false,
    };
    let before = limits.expanded();
    let mut best = match greedy::search(task, Way::of(task), &mut unit, &landmarks, first, limits) {
        Found::Plan(actions) => actions,
        Found::Nothing => return Answer::Unsolvable,
        Found::Stopped(reason) => return Answer::Stopped(reason),
    };
    limits.note_plan();
    best = without_needless(task, best);
    // One unit is added to each cost, so that free actions do not make a way look short.
    let by_cost: Vec<Micro> = costs().map(|c| c.saturating_add(1_000_000)).collect();
    let mut by_cost = Ff::new(task, &relaxed, &by_cost);
    let polish = ((limits.expanded() - before) / 4).clamp(LEAST_POLISH, MOST_POLISH);
    if effort == Effort::First {
        // A little work more makes the plan better by far: it came without a look at costs.
        limits.cap(polish);
    } else {
        best = windows::improve(task, &relaxed, &mut by_cost, best, LONG_POLISH, limits);
        limits.uncap();
    }
    let mut optimal = false;
    let mut schedule = [5, 3, 2, 1].into_iter();
    let mut weight = schedule.next();
    loop {
        let ranking = Ranking {
            weight,
            unit: 1_000_000,
            bound: task.plan_cost(&best).unwrap_or(Micro::MAX),
            narrow: false,
        };
        match greedy::search(
            task,
            Way::of(task),
            &mut by_cost,
            &landmarks,
            ranking,
            limits,
        ) {
            Found::Plan(better) => best = without_needless(task, better),
            // The search saw every state that a cheaper plan could pass through.
            Found::Nothing => {
                optimal = true;
                break;
            }
            Found::Stopped(_) => break,
        }
        if effort != Effort::First {
            best = windows::improve(task, &relaxed, &mut by_cost, best, LONG_POLISH, limits);
            limits.uncap();
        }
        weight = schedule.next().or(weight);
    }
    if effort == Effort::First && !optimal {
        let piecewise = PIECEWISE * polish;
        best = windows::improve(task, &relaxed, &mut by_cost, best, piecewise, limits);
    }
    limits.uncap();
    solved(task, best, optimal)
}

/// So many states are expanded at least to make a first plan better as a whole.
const LEAST_POLISH: u64 = 500;

/// So many times that at the most piece by piece, which makes more of them.
const PIECEWISE: u64 = 3;

/// ... and so many at the most.
const MOST_POLISH: u64 = 1000;

/// So many where there is time.
const LONG_POLISH: u64 = 20_000;

/// Plans longer than this are not looked through: it takes the square of their length.
const LONG_PLAN: usize = 1000;

/// A plan without the actions that it can do without, each with those that depend on it
/// (Nakhost and Mueller 2010).
fn without_needless(task: &Task, mut plan: Vec<usize>) -> Vec<usize> {
    if plan.len() > LONG_PLAN {
        return plan;
    }
    let mut index = 0;
    let (mut before, mut state, mut next) = (task.initial().to_vec(), Vec::new(), Vec::new());
    while index < plan.len() {
        state.clone_from(&before);
        let mut rest = Vec::new();
        for &action in &plan[index + 1..] {
            if task.is_applicable(&state, action) {
                task.successor(&state, action, &mut next);
                std::mem::swap(&mut state, &mut next);
                rest.push(action);
            }
        }
        if task.is_goal(&state) {
            plan.truncate(index);
            plan.extend(rest);
        } else {
            task.successor(&before, plan[index], &mut next);
            std::mem::swap(&mut before, &mut next);
            index += 1;
        }
    }
    plan
}

fn solved(task: &Task, actions: Vec<usize>, optimal: bool) -> Answer {
    let cost = task.plan_cost(&actions).unwrap_or(Micro::MAX);
    Answer::Solved {
        actions,
        cost,
        optimal,
    }
}

#[cfg(test)]
mod tests;
