//! Paths on the grid: costs as documented, and never through what is blocked.

use super::*;
use crate::grid::FREE;
use proptest::prelude::*;

const MODELS: [CostModel; 3] = [
    CostModel::LengthMean,
    CostModel::LengthDest,
    CostModel::NodeSum,
];

/// `.` free, digits their cost, `#` blocked; the first line is the highest row.
fn grid(picture: &str) -> CostGrid {
    let lines: Vec<&str> = picture.split_whitespace().rev().collect();
    let mut grid = CostGrid::covering([0.0, 0.0, lines[0].len() as f64, lines.len() as f64], 1.0);
    grid.costs = lines
        .concat()
        .chars()
        .map(|c| match c {
            '.' => FREE,
            '#' => BLOCKED,
            digit => digit.to_digit(10).unwrap() as f32,
        })
        .collect();
    grid
}

fn find(grid: &CostGrid, start: Cell, goal: Cell, tolerance: f64) -> Result<Path, PathError> {
    Search::default().find(
        grid,
        &Request {
            start_tolerance: tolerance,
            goal_tolerance: tolerance,
            ..Request::new(start, goal)
        },
    )
}

/// The least cost by relaxing every step until nothing changes (Bellman and Ford).
fn naive(grid: &CostGrid, start: Cell, goal: Cell, model: CostModel) -> f64 {
    let mut least = vec![f64::INFINITY; grid.costs.len()];
    let first = if model == CostModel::NodeSum {
        f64::from(grid.cost(start))
    } else {
        0.0
    };
    least[grid.index(start)] = first;
    let mut changed = grid.cost(start) < BLOCKED;
    while changed {
        changed = false;
        for from in (0..grid.height).flat_map(|y| (0..grid.width).map(move |x| (x, y))) {
            for (column, row) in STEPS {
                let to = from
                    .0
                    .checked_add_signed(column)
                    .zip(from.1.checked_add_signed(row));
                let Some(to) = to.filter(|to| to.0 < grid.width && to.1 < grid.height) else {
                    continue;
                };
                let step = cost_of(grid, &[from, to], model)
                    - if model == CostModel::NodeSum {
                        f64::from(grid.cost(from))
                    } else {
                        0.0
                    };
                let cost = least[grid.index(from)] + step;
                if cost < least[grid.index(to)] - 1e-12 {
                    least[grid.index(to)] = cost;
                    changed = true;
                }
            }
        }
    }
    least[grid.index(goal)]
}

#[test]
fn a_diagonal_needs_both_orthogonal_neighbours() {
    let open = find(&grid(".. .."), (0, 0), (1, 1), 0.0).unwrap();
    assert!((open.cost - SQRT_2).abs() < 1e-12);
    let one_side = find(&grid("#. .."), (0, 0), (1, 1), 0.0).unwrap();
    assert_eq!(one_side.cells, [(0, 0), (1, 0), (1, 1)]);
    let none = find(&grid("#. .#"), (0, 0), (1, 1), 0.0);
    assert_eq!(
        none,
        Err(PathError::Unreachable {
            start: (0, 0),
            goal: (1, 1),
            tolerance: 0.0
        })
    );
}

#[test]
fn the_models_price_a_step_onto_a_dear_node_as_documented() {
    let grid = grid(".4");
    let cost = |model| {
        let request = Request {
            model,
            ..Request::new((0, 0), (1, 0))
        };
        Search::default().find(&grid, &request).unwrap().cost
    };
    for (model, price) in MODELS.into_iter().zip([2.5, 4.0, 5.0]) {
        assert!((cost(model) - price).abs() < 1e-12, "{model:?}");
    }
}

#[test]
fn a_dear_zone_is_walked_round_where_the_detour_is_cheaper() {
    let path = find(&grid("..... .444. ....."), (0, 1), (4, 1), 0.0).unwrap();
    assert!(
        path.cells
            .iter()
            .all(|cell| cell.1 != 1 || cell.0 == 0 || cell.0 == 4)
    );
}

#[test]
fn a_blocked_end_gives_way_to_the_nearest_free_cell_within_the_tolerance() {
    let grid = grid("#...... #.....# #....##");
    assert_eq!(
        find(&grid, (0, 0), (3, 0), 0.0),
        Err(PathError::StartBlocked {
            start: (0, 0),
            tolerance: 0.0
        })
    );
    assert_eq!(
        find(&grid, (1, 0), (6, 0), 1.0),
        Err(PathError::GoalBlocked {
            goal: (6, 0),
            tolerance: 1.0
        })
    );
    let path = find(&grid, (0, 0), (6, 0), 2.0).unwrap();
    assert_eq!(
        (path.cells.first(), path.cells.last()),
        (Some(&(1, 0)), Some(&(5, 1)))
    );
}

#[test]
fn an_unreachable_goal_gives_way_to_the_nearest_reachable_cell() {
    // The goal is free but walled in; cells of its own side are nearer and must not be taken.
    let grid = grid("....#.. ....#.. ....#..");
    let path = find(&grid, (0, 0), (6, 1), 3.0).unwrap();
    assert_eq!(path.cells.last(), Some(&(3, 1)));
    assert!(matches!(
        find(&grid, (0, 0), (6, 1), 2.0),
        Err(PathError::Unreachable { .. })
    ));
    // Nor does a blocked start trap the search in the part it happens to be nearest to.
    let path = find(&grid, (4, 1), (0, 0), 3.0).unwrap();
    assert_eq!(path.cells.first(), Some(&(3, 1)));
    let path = find(&grid, (4, 1), (6, 0), 2.0).unwrap();
    assert_eq!(path.cells.first(), Some(&(5, 1)));
}

#[test]
fn ends_outside_the_grid_are_told_apart() {
    let grid = grid("..");
    assert_eq!(
        find(&grid, (2, 0), (0, 0), 1.0),
        Err(PathError::StartOutside((2, 0)))
    );
    assert_eq!(
        find(&grid, (0, 0), (0, 1), 1.0),
        Err(PathError::GoalOutside((0, 1)))
    );
}

fn costs() -> impl Strategy<Value = f32> {
    prop_oneof![4 => Just(1.0), 1 => Just(1.5), 1 => Just(2.0), 1 => Just(4.0), 3 => Just(BLOCKED)]
}

/// Both searches under every model against [`naive`].
fn check_searches(grid: &CostGrid, ends: [prop::sample::Index; 2]) -> Result<(), TestCaseError> {
    let [start, goal] = ends.map(|end| {
        let index = end.index(grid.costs.len());
        (index % grid.width, index / grid.width)
    });
    let mut search = Search::default();
    for model in MODELS {
        let least = naive(grid, start, goal, model);
        for algorithm in [Algorithm::Dijkstra, Algorithm::AStar] {
            let request = Request {
                model,
                algorithm,
                ..Request::new(start, goal)
            };
            match search.find(grid, &request) {
                Ok(path) => {
                    prop_assert!((path.cost - least).abs() < 1e-9);
                    prop_assert!((cost_of(grid, &path.cells, model) - least).abs() < 1e-9);
                    prop_assert_eq!(path.cells.first(), Some(&start));
                    prop_assert_eq!(path.cells.last(), Some(&goal));
                }
                Err(_) => prop_assert!(
                    least.is_infinite()
                        || grid.cost(goal) == BLOCKED
                        || grid.cost(start) == BLOCKED
                ),
            }
        }
    }
    Ok(())
}

proptest! {
    #[test]
    fn every_search_finds_the_least_cost(
        (width, height) in (2..12usize, 2..12usize),
        cells in proptest::collection::vec(costs(), 144),
        ends in any::<[prop::sample::Index; 2]>(),
    ) {
        let mut grid = CostGrid::covering([0.0, 0.0, width as f64, height as f64], 1.0);
        grid.costs.copy_from_slice(&cells[..width * height]);
        check_searches(&grid, ends)?;
    }

    /// In places of one cost a search leaves neighbours out.
    #[test]
    fn every_search_finds_the_least_cost_across_places_of_one_cost(
        (width, height) in (4..24usize, 4..24usize),
        places in proptest::collection::vec(
            (any::<[prop::sample::Index; 2]>(), 1..12usize, 1..12usize, costs()), 0..8,
        ),
        free in prop_oneof![Just(FREE), Just(0.0)],
        ends in any::<[prop::sample::Index; 2]>(),
    ) {
        let mut grid = CostGrid::covering([0.0, 0.0, width as f64, height as f64], 1.0);
        grid.costs.fill(free);
        for (corner, across, along, cost) in places {
            let (left, low) = (corner[0].index(width), corner[1].index(height));
            for row in low..(low + along).min(height) {
                grid.costs[row * width..][left..(left + across).min(width)].fill(cost);
            }
        }
        check_searches(&grid, ends)?;
    }
}
