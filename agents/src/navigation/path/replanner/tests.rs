//! Planning again is held against searching from scratch, change by change.

use super::super::{CostModel, PathError, Request, Search, cost_of};
use super::*;
use crate::grid::BLOCKED;
use proptest::prelude::*;

/// One thing that happens: cells get a cost, then the robot asks from a place.
type Event = (Vec<(prop::sample::Index, f32)>, prop::sample::Index);

fn costs() -> impl Strategy<Value = f32> {
    prop_oneof![4 => Just(1.0), 1 => Just(1.5), 1 => Just(3.5), 1 => Just(0.5), 3 => Just(BLOCKED)]
}

fn events() -> impl Strategy<Value = Vec<Event>> {
    let change = (any::<prop::sample::Index>(), costs());
    let event = (
        proptest::collection::vec(change, 0..6),
        any::<prop::sample::Index>(),
    );
    proptest::collection::vec(event, 1..20)
}

proptest! {
    #[test]
    fn after_any_changes_it_finds_what_a_search_from_scratch_finds(
        (width, height) in (2..14usize, 2..14usize),
        cells in proptest::collection::vec(costs(), 196),
        goal in any::<prop::sample::Index>(),
        model in prop_oneof![
            Just(CostModel::LengthMean), Just(CostModel::LengthDest), Just(CostModel::NodeSum),
        ],
        events in events(),
        told in any::<bool>(),
    ) {
        let mut grid = CostGrid::covering([0.0, 0.0, width as f64 * 0.5, height as f64 * 0.5], 0.5);
        grid.costs.copy_from_slice(&cells[..width * height]);
        let cell = |index: prop::sample::Index| {
            let index = index.index(width * height);
            (index % width, index / width)
        };
        let goal = cell(goal);
        grid.costs[goal.1 * width + goal.0] = 1.0;
        let mut planner = Replanner::new(&grid, goal, model).unwrap();
        for (changes, start) in events {
            let changed: Vec<Cell> = changes.iter().map(|&(index, cost)| {
                let cell = cell(index);
                grid.costs[cell.1 * width + cell.0] = cost;
                cell
            }).collect();
            if told {
                planner.update(&grid, changed);
            } else {
                planner.observe(&grid);
            }
            prop_assert!(!planner.differs(&grid));
            let start = cell(start);
            let request = Request { model, ..Request::new(start, goal) };
            let expected = Search::default().find(&grid, &request);
            match (planner.find(&grid, start), expected) {
                (Ok(path), Ok(expected)) => {
                    prop_assert!((path.cost - expected.cost).abs() < 1e-9);
                    prop_assert!((cost_of(&grid, &path.cells, model) - path.cost).abs() < 1e-9);
                    prop_assert_eq!(path.cells.first(), Some(&start));
                    prop_assert_eq!(path.cells.last(), Some(&goal));
                }
                (found, expected) => prop_assert_eq!(found, expected),
            }
        }
    }
}

#[test]
fn a_change_beside_the_robot_costs_a_small_part_of_a_search_from_scratch() {
    let mut grid = CostGrid::covering([0.0, 0.0, 40.0, 40.0], 0.2);
    // A wall with two doors, so that the way is not straight.
    for row in (0..200).filter(|row| !(95..105).contains(row) && !(150..160).contains(row)) {
        grid.costs[row * 200 + 100] = BLOCKED;
    }
    let mut planner = Replanner::new(&grid, (190, 20), CostModel::LengthMean).unwrap();
    let path = planner.find(&grid, (10, 20)).unwrap();
    let first = planner.expanded();
    // Somebody stands three cells ahead.
    let at = path.cells[3];
    grid.costs[at.1 * 200 + at.0] = BLOCKED;
    planner.update(&grid, [at]);
    let round = planner.find(&grid, path.cells[1]).unwrap();
    assert!(!round.cells.contains(&at));
    let again = planner.expanded() - first;
    assert!(again * 10 < first, "{again} of {first} nodes");
}

#[test]
fn on_a_long_way_of_many_costs_rounding_makes_no_search_begin_anew() {
    let side = 500usize;
    let mut grid = CostGrid::covering([0.0, 0.0, 500.0, 500.0], 1.0);
    // Spaces of people and objects, and what is left of walls between them.
    for k in 0..side * side {
        let (x, y) = (k % side, k / side);
        let (across, along) = (x % 41, y % 37);
        let away = across.abs_diff(20).pow(2) + along.abs_diff(18).pow(2);
        grid.costs[k] = match away {
            0..16 => BLOCKED,
            16..64 => 4.0,
            64..100 => 2.0,
            100..144 => 1.5,
            _ if across == 0 && along > 9 => BLOCKED,
            _ => 1.0,
        };
    }
    let mut planner = Replanner::new(&grid, (480, 490), CostModel::LengthMean).unwrap();
    let mut path = planner.find(&grid, (6, 5)).unwrap();
    let first = planner.expanded();
    for turn in 0..20 {
        let before = planner.expanded();
        let (robot, at) = (path.cells[4], path.cells[20 + turn]);
        grid.costs[at.1 * side + at.0] = BLOCKED;
        planner.update(&grid, [at]);
        path = planner.find(&grid, robot).unwrap();
        let again = planner.expanded() - before;
        assert!(again * 5 < first, "turn {turn}: {again} of {first} nodes");
    }
}

#[test]
fn a_goal_that_is_closed_later_is_told_and_opens_again() {
    let mut grid = CostGrid::covering([0.0, 0.0, 5.0, 1.0], 1.0);
    let mut planner = Replanner::new(&grid, (4, 0), CostModel::LengthMean).unwrap();
    let (goal, tolerance) = ((4, 0), 0.0);
    grid.costs[4] = BLOCKED;
    planner.update(&grid, [goal]);
    let blocked = PathError::GoalBlocked { goal, tolerance };
    assert_eq!(planner.find(&grid, (0, 0)), Err(blocked));
    grid.costs[4] = 2.0;
    planner.update(&grid, [goal]);
    let path = planner.find(&grid, (0, 0)).unwrap();
    assert!((path.cost - 4.5).abs() < 1e-12);
    assert_eq!(
        Replanner::new(&grid, (5, 0), CostModel::LengthMean).err(),
        Some(PathError::GoalOutside((5, 0)))
    );
}
