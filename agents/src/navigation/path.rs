//! The cheapest way over a cost grid (paper TD 5.1). This file guarantees that Dijkstra and A*
//! return a path of the same, least cost, and that the same request gives the same path.
//!
//! The graph is 8-connected; a diagonal step needs both orthogonal neighbours free (READING.md
//! item 8), so a path never cuts the corner of an obstacle.

mod lattice;
mod queue;
mod replanner;

pub use replanner::Replanner;

use crate::grid::{BLOCKED, Cell, CostGrid};
use lattice::{BESIDE, Lattice, STEPS};
use queue::{Queue, Waiting};
use std::f64::consts::SQRT_2;
use thiserror::Error;

/// What one step from a node to its neighbour costs (READING.md item 8).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CostModel {
    /// Step length times the mean of both node costs.
    #[default]
    LengthMean,
    /// Step length times the cost of the node stepped on.
    LengthDest,
    /// The cost of the node stepped on, whatever the step's length, and of the start (TD 5.1).
    NodeSum,
}

/// How the search orders the nodes it looks at; the cost of the path is the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Algorithm {
    /// By cost so far, as the paper does.
    Dijkstra,
    /// By cost so far plus the octile distance to the goal at the grid's least cost.
    #[default]
    AStar,
}

/// One question to [`Search::find`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Request {
    /// Where the path begins.
    pub start: Cell,
    /// Where it shall end.
    pub goal: Cell,
    /// The price of a step.
    pub model: CostModel,
    /// The order of the search.
    pub algorithm: Algorithm,
    /// A blocked start gives way to the nearest free cell from which there is a way, up to this many
    /// metres away.
    pub start_tolerance: f64,
    /// A blocked or unreachable goal gives way to the nearest reachable cell, up to this many metres
    /// away.
    pub goal_tolerance: f64,
}

impl Request {
    /// From `start` to `goal` by A* under [`CostModel::LengthMean`], ends exactly as given.
    pub fn new(start: Cell, goal: Cell) -> Self {
        Self {
            start,
            goal,
            model: CostModel::default(),
            algorithm: Algorithm::default(),
            start_tolerance: 0.0,
            goal_tolerance: 0.0,
        }
    }
}

/// The cheapest path.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    /// The cells from the first to the last, each a neighbour of the one before.
    pub cells: Vec<Cell>,
    /// Its cost: metres times node cost, or under [`CostModel::NodeSum`] the sum of node costs.
    pub cost: f64,
}

/// Why there is no path.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum PathError {
    /// The start lies outside the grid.
    #[error("the start, cell {0:?}, lies outside the grid")]
    StartOutside(Cell),
    /// The goal lies outside the grid.
    #[error("the goal, cell {0:?}, lies outside the grid")]
    GoalOutside(Cell),
    /// The start is blocked and so is all around it.
    #[error("the start, cell {start:?}, is blocked, and so is everything within {tolerance} m")]
    StartBlocked {
        /// The start asked for.
        start: Cell,
        /// How far away a free cell was looked for, metres.
        tolerance: f64,
    },
    /// The goal is blocked and so is all around it.
    #[error("the goal, cell {goal:?}, is blocked, and so is everything within {tolerance} m")]
    GoalBlocked {
        /// The goal asked for.
        goal: Cell,
        /// How far away a free cell was looked for, metres.
        tolerance: f64,
    },
    /// No way leads from the start to the goal or near it.
    #[error("nothing within {tolerance} m of cell {goal:?} can be reached from cell {start:?}")]
    Unreachable {
        /// The start asked for.
        start: Cell,
        /// The goal asked for.
        goal: Cell,
        /// How far from the goal an end was looked for, metres.
        tolerance: f64,
    },
}

/// A path search that keeps its memory from one call to the next.
#[derive(Debug, Clone, Default)]
pub struct Search {
    lattice: Lattice,
    nodes: Vec<Node>,
    open: Queue,
}

/// What the search knows of a node.
#[derive(Debug, Clone, Copy)]
struct Node {
    cost_so_far: f64,
    /// As in the lattice: beside the cost so far, so that looking at a neighbour is one look.
    cost: f32,
    /// The direction, an index of [`STEPS`], by which the node was reached.
    reached_by: u8,
}

impl Search {
    /// The cheapest path that answers `request` on `grid`.
    ///
    /// # Errors
    /// [`PathError`] where an end lies outside the grid or no allowed path exists.
    ///
    /// # Complexity
    /// O(n log n) for n cells; no allocation beyond the path once the buffers have grown.
    pub fn find(&mut self, grid: &CostGrid, request: &Request) -> Result<Path, PathError> {
        let &Request {
            start,
            goal,
            start_tolerance,
            goal_tolerance: tolerance,
            ..
        } = request;
        check_inside(grid, start, goal)?;
        let starts = if free(grid, start) {
            vec![start]
        } else {
            free_cells_near(grid, start, start_tolerance)
        };
        if starts.is_empty() {
            return Err(PathError::StartBlocked {
                start,
                tolerance: start_tolerance,
            });
        }
        let goals = free_cells_near(grid, goal, tolerance);
        let Some(&nearest_goal) = goals.first() else {
            return Err(PathError::GoalBlocked { goal, tolerance });
        };
        self.lattice.load(grid);
        // A search that does not meet the nearest goal has seen all that its start can reach, so
        // each further search begins in a part of the grid not seen before.
        let mut seen = vec![false; starts.len()];
        for k in 0..starts.len() {
            if seen[k] {
                continue;
            }
            self.expand(starts[k], nearest_goal, request);
            if let Some(&end) = goals.iter().find(|&&cell| self.reached(cell)) {
                return Ok(self.trace(grid, starts[k], end, request.model));
            }
            for (cell, seen) in starts.iter().zip(&mut seen) {
                *seen |= self.reached(*cell);
            }
        }
        Err(PathError::Unreachable {
            start,
            goal,
            tolerance,
        })
    }

    fn reached(&self, cell: Cell) -> bool {
        self.nodes[self.lattice.node(cell)].cost_so_far.is_finite()
    }

    /// Searches from `start` until `goal` is settled or nothing is left.
    fn expand(&mut self, start: Cell, goal: Cell, request: &Request) {
        match request.algorithm {
            Algorithm::Dijkstra => self.search(start, goal, request.model, |_| 0.0),
            Algorithm::AStar => {
                let estimate = self.lattice.estimate_to(goal, request.model);
                self.search(start, goal, request.model, estimate);
            }
        }
    }

    fn search(
        &mut self,
        start: Cell,
        goal: Cell,
        model: CostModel,
        estimate: impl Fn(usize) -> f64,
    ) {
        let Self {
            lattice,
            nodes,
            open,
        } = self;
        nodes.clear();
        nodes.extend(lattice.costs.iter().map(|&cost| Node {
            cost_so_far: f64::INFINITY,
            cost,
            reached_by: u8::MAX,
        }));
        // No step raises a total estimate by more than its own price and what it may lead away.
        open.clear(2.0 * SQRT_2 * f64::from(lattice.greatest));
        let steps = lattice.steps();
        let (start, goal) = (lattice.node(start), lattice.node(goal));
        nodes[start].cost_so_far = 0.0;
        open.push(Waiting::new(0.0, estimate(start), start));
        while let Some(next) = open.pop() {
            let at = next.node();
            if at == goal {
                return;
            }
            let node = nodes[at];
            if node.cost_so_far + estimate(at) < next.total() {
                continue; // a cheaper way to this node came up meanwhile
            }
            let from = f64::from(node.cost);
            // Which of the straight neighbours are free decides over the diagonals.
            let mut straight_free = [false; 4];
            for (k, step) in steps.iter().enumerate() {
                let length = if k < 4 {
                    1.0
                } else {
                    let [across, along] = BESIDE[k - 4];
                    if !(straight_free[across] && straight_free[along]) {
                        continue;
                    }
                    SQRT_2
                };
                let neighbour = at.wrapping_add_signed(*step);
                let to = &mut nodes[neighbour];
                if k < 4 {
                    straight_free[k] = to.cost.is_finite();
                }
                let cost = node.cost_so_far + model.price(from, f64::from(to.cost), length);
                if cost < to.cost_so_far {
                    to.cost_so_far = cost;
                    to.reached_by = k as u8;
                    open.push(Waiting::new(cost, estimate(neighbour), neighbour));
                }
            }
        }
    }

    fn trace(&self, grid: &CostGrid, start: Cell, end: Cell, model: CostModel) -> Path {
        let mut cells = vec![end];
        let mut cell = end;
        while cell != start {
            let reached_by = self.nodes[self.lattice.node(cell)].reached_by;
            let (column, row) = STEPS[usize::from(reached_by)];
            cell = (
                cell.0.wrapping_add_signed(-column),
                cell.1.wrapping_add_signed(-row),
            );
            cells.push(cell);
        }
        cells.reverse();
        let cost = self.nodes[self.lattice.node(end)].cost_so_far;
        Path {
            cost: told(cost, grid, start, model),
            cells,
        }
    }
}

/// Whether both ends lie on the grid.
fn check_inside(grid: &CostGrid, start: Cell, goal: Cell) -> Result<(), PathError> {
    let outside = |cell: Cell| cell.0 >= grid.width || cell.1 >= grid.height;
    if outside(start) {
        return Err(PathError::StartOutside(start));
    }
    if outside(goal) {
        return Err(PathError::GoalOutside(goal));
    }
    Ok(())
}

/// The cost of a path from `start` as [`Path::cost`] tells it, from the sum of its steps in cells.
fn told(steps: f64, grid: &CostGrid, start: Cell, model: CostModel) -> f64 {
    match model {
        CostModel::LengthMean | CostModel::LengthDest => steps * grid.resolution,
        CostModel::NodeSum => steps + f64::from(grid.cost(start)),
    }
}

fn free(grid: &CostGrid, cell: Cell) -> bool {
    grid.cost(cell) < BLOCKED
}

/// The free cells whose centre is at most `tolerance` metres from that of `cell`, nearest first.
pub(super) fn free_cells_near(grid: &CostGrid, cell: Cell, tolerance: f64) -> Vec<Cell> {
    if tolerance <= 0.0 {
        return if free(grid, cell) {
            vec![cell]
        } else {
            Vec::new()
        };
    }
    let reach = tolerance / grid.resolution;
    let span = |centre: usize, end: usize| {
        centre.saturating_sub(reach as usize)..(centre + reach as usize + 1).min(end)
    };
    let mut near: Vec<(usize, Cell)> = span(cell.1, grid.height)
        .flat_map(|row| span(cell.0, grid.width).map(move |column| (column, row)))
        .filter(|&candidate| free(grid, candidate))
        .map(|near| {
            (
                near.0.abs_diff(cell.0).pow(2) + near.1.abs_diff(cell.1).pow(2),
                near,
            )
        })
        .filter(|&(squared, _)| squared as f64 <= reach * reach + 1e-9)
        .collect();
    near.sort_unstable_by_key(|&(squared, (column, row))| (squared, row, column));
    near.into_iter().map(|(_, cell)| cell).collect()
}

/// The length of `cells` in cells: 1 for a straight step, sqrt 2 for a diagonal one.
pub fn length_of(cells: &[Cell]) -> f64 {
    let diagonal = |step: &[Cell]| step[0].0 != step[1].0 && step[0].1 != step[1].1;
    let steps = cells.windows(2);
    steps
        .map(|step| if diagonal(step) { SQRT_2 } else { 1.0 })
        .sum()
}

/// The cost of walking `cells` on `grid` under `model`, infinite where a step is not allowed; so a
/// path found earlier can be judged on the grid as it is now.
///
/// # Panics
/// If a cell lies outside the grid.
pub fn cost_of(grid: &CostGrid, cells: &[Cell], model: CostModel) -> f64 {
    let node = |cell: Cell| f64::from(grid.cost(cell));
    let first = cells.first().map_or(0.0, |&cell| node(cell));
    let steps = cells.windows(2).map(|step| {
        let (from, to) = (step[0], step[1]);
        let diagonal = from.0 != to.0 && from.1 != to.1;
        if diagonal && !(free(grid, (from.0, to.1)) && free(grid, (to.0, from.1))) {
            return f64::INFINITY;
        }
        let length = grid.resolution * if diagonal { SQRT_2 } else { 1.0 };
        match model {
            CostModel::LengthMean => length * 0.5 * (node(from) + node(to)),
            CostModel::LengthDest => length * node(to),
            CostModel::NodeSum => node(to),
        }
    });
    steps.sum::<f64>()
        + if model == CostModel::NodeSum {
            first
        } else {
            0.0
        }
}

#[cfg(test)]
mod tests;
