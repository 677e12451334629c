//! Search on ground tasks: every method agrees with trying everything.

use super::*;
use crate::task::{Action, Effect, Fact, Formula, State, micro};
use proptest::prelude::*;
use std::collections::{BTreeMap, BinaryHeap};

/// The least cost of a plan, by trying everything in the order of its cost.
fn brute_force(task: &Task) -> Option<Micro> {
    let mut best: BTreeMap<State, Micro> = BTreeMap::from([(task.initial().to_vec(), 0)]);
    let mut open = BinaryHeap::from([std::cmp::Reverse((0, task.initial().to_vec()))]);
    while let Some(std::cmp::Reverse((cost, state))) = open.pop() {
        if cost > best[&state] {
            continue;
        }
        if task.is_goal(&state) {
            return Some(cost);
        }
        for action in 0..task.actions().len() {
            if !task.actions()[action].precondition.holds(&state) {
                continue;
            }
            let mut next = State::new();
            task.successor(&state, action, &mut next);
            let cost = task.cost_after(cost, action);
            if best.get(&next).is_none_or(|&known| cost < known) {
                best.insert(next.clone(), cost);
                open.push(std::cmp::Reverse((cost, next)));
            }
        }
    }
    None
}

const FACTS: u32 = 7;

fn literals(most: usize) -> impl Strategy<Value = Vec<Formula>> {
    let literal = (0..FACTS, prop::bool::weighted(0.3)).prop_map(|(fact, negated)| {
        Formula::Literal(if negated {
            Literal::negative(fact)
        } else {
            Literal::positive(fact)
        })
    });
    prop::collection::vec(literal, 0..=most)
}

fn condition() -> impl Strategy<Value = Formula> {
    (
        literals(2),
        prop::option::weighted(0.2, (literals(2), literals(2))),
    )
        .prop_map(|(all, either)| {
            let either = either.map(|(a, b)| Formula::any([Formula::all(a), Formula::all(b)]));
            Formula::all(all.into_iter().chain(either))
        })
}

fn effect(conditional: bool) -> impl Strategy<Value = Effect> {
    let facts = |most| prop::collection::vec(0..FACTS, 0..=most);
    let when = if conditional {
        condition().boxed()
    } else {
        Just(Formula::TRUE).boxed()
    };
    (when, facts(2), facts(2)).prop_map(|(condition, add, delete)| Effect {
        condition,
        add,
        delete,
    })
}

fn action() -> impl Strategy<Value = Action> {
    (
        condition(),
        effect(false),
        prop::option::weighted(0.3, effect(true)),
        prop_oneof![Just(0.0), Just(1.0), Just(2.5), Just(7.0)],
        prop_oneof![4 => Just(1.0), 1 => Just(0.5)],
    )
        .prop_map(|(precondition, always, sometimes, cost, success)| {
            let effects = std::iter::once(always).chain(sometimes).collect();
            let mut action = Action::new(precondition, effects, micro(cost));
            action.success = success;
            action
        })
}

fn task() -> impl Strategy<Value = Task> {
    let initial = prop::collection::vec(0..FACTS, 0..4);
    let goal = literals(4).prop_map(Formula::all);
    let goal = (goal, prop::option::weighted(0.3, literals(3)));
    (initial, goal, prop::collection::vec(action(), 0..12)).prop_map(
        |(initial, (goal, other), actions)| {
            let other = other.map(Formula::all);
            let goal = Formula::any(std::iter::once(goal).chain(other));
            Task::new(FACTS as usize, &initial, goal, actions)
        },
    )
}

fn check(task: &Task, effort: Effort, least: Option<Micro>) -> Result<(), TestCaseError> {
    match (search(task, effort, &mut Limits::new()), least) {
        (
            Answer::Solved {
                actions,
                cost,
                optimal,
            },
            Some(least),
        ) => {
            prop_assert_eq!(task.plan_cost(&actions), Some(cost));
            // Without a limit only the first plan may be worse than the best.
            if effort != Effort::First {
                prop_assert!(optimal);
                prop_assert_eq!(cost, least);
            }
        }
        (Answer::Unsolvable, None) => {}
        (answer, least) => prop_assert!(false, "{effort:?}: {answer:?}, by force {least:?}"),
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn every_search_agrees_with_trying_everything(task in task()) {
        let least = brute_force(&task);
        for effort in [Effort::First, Effort::Anytime, Effort::Optimal] {
            check(&task, effort, least)?;
        }
    }

    #[test]
    fn a_plan_that_is_made_better_piece_by_piece_is_one_and_costs_no_more(task in task()) {
        let relaxed = Relaxed::new(&task);
        let units = vec![1; task.actions().len()];
        let mut heuristic = Ff::new(&task, &relaxed, &units);
        let ranking = Ranking { weight: None, unit: 1, bound: Micro::MAX, narrow: false };
        let way = Way::of(&task);
        let none = Landmarks::none();
        let found = greedy::search(&task, way, &mut heuristic, &none, ranking, &mut Limits::new());
        if let Found::Plan(plan) = found {
            let mut limits = Limits::new();
            let before = plan.clone();
            let better =
                windows::improve(&task, &relaxed, &mut heuristic, before, 500, &mut limits);
            let cost = task.plan_cost(&better);
            prop_assert!(cost.is_some() && cost <= task.plan_cost(&plan), "{better:?} for {plan:?}");
            prop_assert_eq!(windows::is_plan(&task, &better), true);
        }
    }

    #[test]
    fn the_estimates_of_landmark_cut_never_exceed_the_true_cost(task in task()) {
        let relaxed = Relaxed::new(&task);
        let costs: Vec<Micro> = task.actions().iter().map(|a| a.cost).collect();
        let estimate = LandmarkCut::new(&relaxed, costs).estimate(task.initial());
        if let Some(least) = brute_force(&task) {
            prop_assert!(estimate.is_some_and(|e| e <= least), "{estimate:?} {least}");
        }
    }

    #[test]
    fn what_is_unreachable_never_holds(task in task()) {
        let reachability = Reachability::new(&task);
        let mut seen = std::collections::BTreeSet::from([task.initial().to_vec()]);
        let mut open = vec![task.initial().to_vec()];
        while let Some(state) = open.pop() {
            for fact in 0..FACTS {
                for literal in [Literal::positive(fact), Literal::negative(fact)] {
                    prop_assert!(!literal.holds(&state) || reachability.literal(literal));
                }
            }
            prop_assert!(!task.is_goal(&state) || reachability.goal);
            let mut found = Vec::new();
            task.applicable(&state, &mut found);
            for action in found {
                let mut next = State::new();
                task.successor(&state, action as usize, &mut next);
                if seen.insert(next.clone()) {
                    open.push(next);
                }
            }
        }
    }
}

/// A robot on a line of `length` rooms, at the left end, wanted at the right one, with a door
/// between any two that must be opened first.
fn corridor(length: u32) -> Task {
    let fact = |f: Fact| Formula::Literal(Literal::positive(f));
    let mut actions = Vec::new();
    for room in 0..length - 1 {
        for (from, to) in [(room, room + 1), (room + 1, room)] {
            actions.push(Action::new(
                Formula::all([fact(from), fact(length + room)]),
                vec![Effect {
                    condition: Formula::TRUE,
                    add: vec![to],
                    delete: vec![from],
                }],
                micro(1.0),
            ));
        }
        for at in 0..length {
            actions.push(Action::new(
                fact(at),
                vec![Effect {
                    condition: Formula::TRUE,
                    add: vec![length + room],
                    delete: vec![],
                }],
                micro(0.5),
            ));
        }
    }
    Task::new(2 * length as usize, &[0], fact(length - 1), actions)
}

#[test]
fn a_corridor_of_doors_is_crossed_at_once_in_every_mode() {
    let task = corridor(40);
    for effort in [Effort::First, Effort::Optimal] {
        let mut limits = Limits::new().with_expansions(2000);
        let answer = search(&task, effort, &mut limits);
        let Answer::Solved { cost, actions, .. } = answer else {
            panic!("{effort:?}: {answer:?}");
        };
        assert_eq!((cost, actions.len()), (micro(58.5), 78));
    }
}

#[test]
fn the_limits_hold_and_the_best_plan_so_far_is_kept() {
    let task = corridor(12);
    let stopped = search(
        &task,
        Effort::Optimal,
        &mut Limits::new().with_expansions(3),
    );
    assert_eq!(stopped, Answer::Stopped(StopReason::Expansions));
    let stopped = search(&task, Effort::First, &mut Limits::new().with_bytes(100));
    assert_eq!(stopped, Answer::Stopped(StopReason::Memory));
    let cancelled = search(
        &task,
        Effort::First,
        &mut Limits::new().with_clock(1.0, || f64::INFINITY),
    );
    assert_eq!(cancelled, Answer::Stopped(StopReason::Time));
    let mut limits = Limits::new().with_expansions(60);
    let answer = search(&task, Effort::Anytime, &mut limits);
    assert!(
        matches!(answer, Answer::Solved { optimal: false, .. }),
        "{answer:?}"
    );
    assert_eq!(limits.expanded(), 60);
}
