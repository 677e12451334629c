//! The cheapest way over a cost grid (paper TD 5.1). This file guarantees that Dijkstra and A*
//! return a path of the same, least cost, and that the same request gives the same path.
//!
//! The graph is 8-connected; a diagonal step needs both orthogonal neighbours free (READING.md
//! item 8), so a path never cuts the corner of an obstacle.

mod canonical;
mod lattice;
mod queue;
mod replanner;

pub use replanner::Replanner;

use crate::grid::{BLOCKED, Cell, CostGrid};
use lattice::{Lattice, STEPS};
use queue::{Buckets, Queue, Sorted, Waiting};
use std::f64::consts::SQRT_2;
use std::mem::take;
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
    /// Of each node, infinite where it was not reached.
    cost_so_far: Vec<f64>,
    /// The direction, an index of [`STEPS`], in which a node was reached, where it was.
    reached_by: Vec<u8>,
    buckets: Buckets,
    sorted: Sorted,
}

impl Search {
    /// The cheapest path that answers `request` on `grid`.
    ///
    /// # Errors
    /// [`PathError`] where an end lies outside the grid or no allowed path exists.
    ///
    /// # Complexity
    /// O(n) for n cells whose costs differ by less than four powers of ten, else O(n log n); no
    /// allocation beyond the path once the buffers have grown.
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
        self.cost_so_far[self.lattice.node(cell)].is_finite()
    }

    /// Searches from `start` until `goal` is settled or nothing is left.
    fn expand(&mut self, start: Cell, goal: Cell, request: &Request) {
        // Each model has a loop of its own, which asks for no model.
        match request.model {
            CostModel::LengthMean => {
                self.order(start, goal, request, |from, to, length| {
                    CostModel::LengthMean.price(from, to, length)
                });
            }
            CostModel::LengthDest => {
                self.order(start, goal, request, |from, to, length| {
                    CostModel::LengthDest.price(from, to, length)
                });
            }
            CostModel::NodeSum => {
                self.order(start, goal, request, |from, to, length| {
                    CostModel::NodeSum.price(from, to, length)
                });
            }
        }
    }

    fn order(
        &mut self,
        start: Cell,
        goal: Cell,
        request: &Request,
        price: impl Fn(f64, f64, f64) -> f64,
    ) {
        let (start, end) = (self.lattice.node(start), self.lattice.node(goal));
        // Under NodeSum a diagonal step costs no more than a straight one: another order of ways.
        let prunes = request.model != CostModel::NodeSum;
        let ends = (start, end, prunes);
        let estimate = self.lattice.estimate_to(goal, request.model);
        // No step raises a total by more than its own price and what it may lead away; and none costs
        // less than the least cost, so that within such a width no order is needed.
        let span = 2.0 * SQRT_2 * f64::from(self.lattice.greatest);
        let width = f64::from(self.lattice.least);
        let (mut buckets, mut sorted) = (take(&mut self.buckets), take(&mut self.sorted));
        match request.algorithm {
            Algorithm::Dijkstra if buckets.clear(span, width) => {
                self.search(ends, price, |_| 0.0, &mut buckets);
            }
            Algorithm::AStar if buckets.clear(span, 0.5 * width) => {
                self.search(ends, price, estimate, &mut buckets);
            }
            Algorithm::Dijkstra => {
                sorted.clear();
                self.search(ends, price, |_| 0.0, &mut sorted);
            }
            Algorithm::AStar => {
                sorted.clear();
                self.search(ends, price, estimate, &mut sorted);
            }
        }
        (self.buckets, self.sorted) = (buckets, sorted);
    }

    fn search(
        &mut self,
        (start, goal, prunes): (usize, usize, bool),
        price: impl Fn(f64, f64, f64) -> f64,
        estimate: impl Fn(usize) -> f64,
        open: &mut impl Queue,
    ) {
        let Self {
            lattice,
            cost_so_far,
            reached_by,
            ..
        } = self;
        cost_so_far.clear();
        cost_so_far.resize(lattice.costs.len(), f64::INFINITY);
        reached_by.resize(lattice.costs.len(), canonical::START);
        let steps = lattice.steps();
        let offers = canonical::offers();
        cost_so_far[start] = 0.0;
        reached_by[start] = canonical::START;
        open.push(estimate(start), Waiting::new(0.0, start));
        while let Some(next) = open.pop() {
            let at = next.node as usize;
            let so_far = cost_so_far[at];
            if so_far < next.cost {
                continue; // a cheaper way to this node came up meanwhile
            }
            if open.is_past(cost_so_far[goal]) {
                return;
            }
            let from = f64::from(lattice.costs[at]);
            let (free, uniform) = lattice.around(at);
            let came = if uniform && prunes {
                reached_by[at]
            } else {
                canonical::START
            };
            let mut offered = offers[usize::from(came)][usize::from(free)];
            while offered != 0 {
                let k = offered.trailing_zeros() as usize;
                offered &= offered - 1;
                let neighbour = at.wrapping_add_signed(steps[k]);
                let length = if k < 4 { 1.0 } else { SQRT_2 };
                let to = f64::from(lattice.costs[neighbour]);
                let cost = so_far + price(from, to, length);
                if cost < cost_so_far[neighbour] {
                    cost_so_far[neighbour] = cost;
                    reached_by[neighbour] = k as u8;
                    // What cannot make the way to the goal cheaper need not wait.
                    let total = cost + estimate(neighbour);
                    if total < cost_so_far[goal] {
                        open.push(total, Waiting::new(cost, neighbour));
                    }
                }
            }
        }
    }

    fn trace(&self, grid: &CostGrid, start: Cell, end: Cell, model: CostModel) -> Path {
        let mut cells = vec![end];
        let mut cell = end;
        while cell != start {
            let reached_by = self.reached_by[self.lattice.node(cell)];
            let (column, row) = STEPS[usize::from(reached_by)];
            cell = (
                cell.0.wrapping_add_signed(-column),
                cell.1.wrapping_add_signed(-row),
            );
            cells.push(cell);
        }
        cells.reverse();
        let cost = self.cost_so_far[self.lattice.node(end)];
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
