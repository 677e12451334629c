//! A cheapest path that follows its grid: where cells change their costs and the start moves on,
//! only what that concerns is searched again (D* Lite, optimised version; Koenig and Likhachev, "Fast
//! Replanning for Navigation in Unknown Terrain", 2005). This file guarantees the cost that a search
//! from scratch finds.

use super::canonical::{self, START};
use super::lattice::{Lattice, node_cost};
use super::{CostModel, Path, PathError, check_inside, free, told};
use crate::grid::{Cell, CostGrid};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::SQRT_2;

/// What is known of a node: the cost from it to the goal as it was last settled, and as it follows
/// from its neighbours. Where they differ, the node waits.
#[derive(Debug, Clone, Copy)]
struct Node {
    settled: f64,
    follows: f64,
}

/// Where more than one of so many cells changed, beginning anew is quicker than mending.
const TOO_MANY: usize = 8;

/// Sums of the same steps in another order differ by less than this part.
const SAME: f64 = 1e-9;

const UNKNOWN: Node = Node {
    settled: f64::INFINITY,
    follows: f64::INFINITY,
};

impl Node {
    fn waits(self) -> bool {
        self.settled.to_bits() != self.follows.to_bits()
    }
}

/// A node's place in the order of the search: the least of both costs with the estimate from the
/// start, then without. Bits of floats that are not negative order like the floats.
type Key = (u64, u64);

/// A planner to one goal that keeps what it found.
///
/// ```
/// use agents::grid::{BLOCKED, CostGrid};
/// use agents::navigation::path::{CostModel, Replanner};
///
/// let mut grid = CostGrid::covering([0.0, 0.0, 5.0, 3.0], 1.0);
/// let mut planner = Replanner::new(&grid, (4, 1), CostModel::LengthMean)?;
/// assert_eq!(planner.find(&grid, (0, 1))?.cost, 4.0);
/// // Somebody steps into the way, and the robot is one cell further.
/// let cell = grid.index((2, 1));
/// grid.costs[cell] = BLOCKED;
/// planner.update(&grid, [(2, 1)]);
/// let round = 3.0 + std::f64::consts::SQRT_2;
/// assert!((planner.find(&grid, (1, 1))?.cost - round).abs() < 1e-9);
/// # Ok::<(), agents::navigation::path::PathError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Replanner {
    lattice: Lattice,
    nodes: Vec<Node>,
    /// An entry is out of date where its node does not wait, or waits at a later place.
    open: BinaryHeap<Reverse<(Key, u32)>>,
    goal: Cell,
    model: CostModel,
    /// From where the search was made last.
    start: Cell,
    /// By how much the estimates of entries may be too low, since the start has moved (`k_m`).
    moved: f64,
    expanded: u64,
}

impl Replanner {
    /// A planner to `goal` on `grid`.
    ///
    /// # Errors
    /// [`PathError::GoalOutside`], [`PathError::GoalBlocked`].
    pub fn new(grid: &CostGrid, goal: Cell, model: CostModel) -> Result<Self, PathError> {
        check_inside(grid, (0, 0), goal)?;
        if !free(grid, goal) {
            let tolerance = 0.0;
            return Err(PathError::GoalBlocked { goal, tolerance });
        }
        let mut planner = Self {
            lattice: Lattice::default(),
            nodes: Vec::new(),
            open: BinaryHeap::new(),
            goal,
            model,
            start: goal,
            moved: 0.0,
            expanded: 0,
        };
        planner.begin(grid);
        Ok(planner)
    }

    /// Forgets all that was found.
    fn begin(&mut self, grid: &CostGrid) {
        self.lattice.load(grid);
        self.nodes.clear();
        self.nodes.resize(self.lattice.costs.len(), UNKNOWN);
        self.open.clear();
        self.moved = 0.0;
        let goal = self.lattice.node(self.goal);
        self.nodes[goal].follows = 0.0;
        self.wait(goal, &self.estimate());
    }

    /// How many nodes were looked at so far.
    pub fn expanded(&self) -> u64 {
        self.expanded
    }

    /// The cell that it plans to.
    pub fn goal(&self) -> Cell {
        self.goal
    }

    /// Whether `grid` says anything of a cell that this planner does not know yet.
    pub fn differs(&self, grid: &CostGrid) -> bool {
        self.lattice.changed(grid).next().is_some()
    }

    /// Takes over all that `grid` says, whatever its size. The goal must lie on it.
    pub fn observe(&mut self, grid: &CostGrid) {
        if !self.lattice.fits(grid) {
            return self.begin(grid);
        }
        let changed: Vec<Cell> = self.lattice.changed(grid).collect();
        if changed.len() * TOO_MANY > grid.costs.len() {
            self.begin(grid);
        } else {
            self.update(grid, changed);
        }
    }

    /// Takes over what `grid` says of the cells that were `changed`; those outside are passed over.
    ///
    /// # Panics
    /// If the grid has not the size that it had.
    pub fn update(&mut self, grid: &CostGrid, changed: impl IntoIterator<Item = Cell>) {
        assert!(self.lattice.fits(grid), "the grid has another size");
        let mut concerned = Vec::new();
        let steps = self.lattice.steps();
        for cell in changed {
            if cell.0 >= grid.width || cell.1 >= grid.height {
                continue;
            }
            let node = self.lattice.node(cell);
            let cost = node_cost(grid.cost(cell));
            if self.lattice.costs[node].to_bits() == cost.to_bits() {
                continue;
            }
            if cost < self.lattice.least {
                // Estimates made with the least cost before would be too high.
                return self.begin(grid);
            }
            self.lattice.costs[node] = cost;
            // Its own steps, those to it, and the diagonal ones that pass it.
            concerned.push(node);
            concerned.extend(steps.map(|step| node.wrapping_add_signed(step)));
        }
        concerned.sort_unstable();
        concerned.dedup();
        let estimate = self.estimate();
        for node in concerned {
            self.follow(node, &estimate);
        }
    }

    /// The cheapest path from `start` on `grid`, of which every change was told.
    ///
    /// # Errors
    /// [`PathError`]; the start and the goal are taken as they are, without a tolerance.
    pub fn find(&mut self, grid: &CostGrid, start: Cell) -> Result<Path, PathError> {
        let (goal, tolerance) = (self.goal, 0.0);
        check_inside(grid, start, goal)?;
        if !free(grid, start) {
            return Err(PathError::StartBlocked { start, tolerance });
        }
        if !free(grid, goal) {
            return Err(PathError::GoalBlocked { goal, tolerance });
        }
        let before = self.lattice.node(self.start);
        self.start = start;
        let estimate = self.estimate();
        self.moved += estimate(before);
        self.settle(&estimate);
        if let Some(path) = self.trace(grid) {
            return Ok(path);
        }
        if self.nodes[self.lattice.node(start)].follows.is_finite() {
            self.begin(grid);
            self.settle(&estimate);
            if let Some(path) = self.trace(grid) {
                return Ok(path);
            }
        }
        Err(PathError::Unreachable {
            start,
            goal,
            tolerance,
        })
    }

    fn estimate(&self) -> impl Fn(usize) -> f64 + use<> {
        self.lattice.estimate_to(self.start, self.model)
    }

    /// Settles nodes in their order until the start is settled and none before it waits.
    fn settle(&mut self, estimate: &impl Fn(usize) -> f64) {
        let start = self.lattice.node(self.start);
        while let Some(&Reverse((place, at))) = self.open.peek() {
            let at = at as usize;
            let node = self.nodes[at];
            if !node.waits() {
                self.open.pop();
                continue;
            }
            let first = self.nodes[start];
            // Along a cheapest path all totals are the same but for rounding.
            let (total, _) = self.key(start, estimate);
            let total = f64::from_bits(total);
            let beyond = f64::from_bits(place.0) > total + SAME * total;
            if beyond && first.follows <= first.settled {
                break;
            }
            self.open.pop();
            let now = self.key(at, estimate);
            if place < now {
                self.open.push(Reverse((now, at as u32)));
                continue;
            }
            self.expanded += 1;
            if node.settled > node.follows {
                self.nodes[at].settled = node.follows;
                self.reach_from(at, estimate);
            } else {
                self.nodes[at].settled = f64::INFINITY;
                self.leave(at, node.settled, estimate);
            }
        }
    }

    fn key(&self, at: usize, estimate: &impl Fn(usize) -> f64) -> Key {
        let node = self.nodes[at];
        let least = node.settled.min(node.follows);
        let total = least + estimate(at) + self.moved;
        (total.to_bits(), least.to_bits())
    }

    /// Gives a node its place in the order, if it waits.
    fn wait(&mut self, at: usize, estimate: &impl Fn(usize) -> f64) {
        if self.nodes[at].waits() {
            let key = self.key(at, estimate);
            self.open.push(Reverse((key, at as u32)));
        }
    }

    /// The neighbours that a step joins a node with, either way, and its length.
    fn neighbours(&self, at: usize) -> impl Iterator<Item = (usize, f64)> + use<> {
        let mut joined = if self.lattice.costs[at].is_finite() {
            let (free, _) = self.lattice.around(at);
            canonical::offers()[usize::from(START)][usize::from(free)]
        } else {
            0
        };
        let steps = self.lattice.steps();
        std::iter::from_fn(move || {
            let k = joined.trailing_zeros() as usize;
            let step = steps.get(k)?;
            joined &= joined - 1;
            let length = if k < 4 { 1.0 } else { SQRT_2 };
            Some((at.wrapping_add_signed(*step), length))
        })
    }

    /// What a step costs.
    fn price(&self, from: usize, to: usize, length: f64) -> f64 {
        let cost = |node: usize| f64::from(self.lattice.costs[node]);
        self.model.price(cost(from), cost(to), length)
    }

    /// A node was settled lower: its neighbours may be nearer to the goal by it.
    fn reach_from(&mut self, at: usize, estimate: &impl Fn(usize) -> f64) {
        let settled = self.nodes[at].settled;
        for (neighbour, length) in self.neighbours(at) {
            let cost = self.price(neighbour, at, length) + settled;
            if cost < self.nodes[neighbour].follows {
                self.nodes[neighbour].follows = cost;
                self.wait(neighbour, estimate);
            }
        }
    }

    /// A node is not worth any more what it was `settled` at: nor are those that went by it.
    fn leave(&mut self, at: usize, settled: f64, estimate: &impl Fn(usize) -> f64) {
        self.wait(at, estimate);
        for (neighbour, length) in self.neighbours(at) {
            let by_it = self.price(neighbour, at, length) + settled;
            if self.nodes[neighbour].follows.to_bits() == by_it.to_bits() {
                self.follow(neighbour, estimate);
            }
        }
    }

    /// Works out anew what follows for a node from its neighbours.
    fn follow(&mut self, at: usize, estimate: &impl Fn(usize) -> f64) {
        if at != self.lattice.node(self.goal) {
            let onwards = self.neighbours(at).map(|(neighbour, length)| {
                self.price(at, neighbour, length) + self.nodes[neighbour].settled
            });
            self.nodes[at].follows = onwards.fold(f64::INFINITY, f64::min);
        }
        self.wait(at, estimate);
    }

    /// The path that the settled costs describe, if it costs what they say: of two ways of the same
    /// cost but for rounding, one may go by a node that was left waiting.
    fn trace(&self, grid: &CostGrid) -> Option<Path> {
        let (mut at, goal) = (self.lattice.node(self.start), self.lattice.node(self.goal));
        let steps = self.nodes[at].follows;
        let mut walked = 0.0;
        let mut cells = vec![self.start];
        while at != goal {
            let onwards = self.neighbours(at).map(|(neighbour, length)| {
                let price = self.price(at, neighbour, length);
                (price + self.nodes[neighbour].settled, price, neighbour)
            });
            let (_, price, next) = onwards.min_by(|one, other| one.0.total_cmp(&other.0))?;
            walked += price;
            // Also where it turns in a circle.
            if walked > steps + SAME * (1.0 + steps) || cells.len() > self.nodes.len() {
                return None;
            }
            at = next;
            cells.push(self.lattice.cell(at));
        }
        Some(Path {
            cost: told(steps, grid, self.start, self.model),
            cells,
        })
    }
}

#[cfg(test)]
mod tests;
