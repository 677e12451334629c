//! The grid as a graph: its nodes, steps, their prices and the least that can remain to a goal. This
//! file guarantees that no step leads off the grid, for a blocked border lies around it.

use super::CostModel;
use crate::grid::{Cell, CostGrid};
use std::f64::consts::SQRT_2;

/// Columns and rows of the eight steps: four straight, then four diagonal ones.
pub(super) const STEPS: [(isize, isize); 8] = [
    (1, 0),
    (-1, 0),
    (0, 1),
    (0, -1),
    (1, 1),
    (-1, 1),
    (1, -1),
    (-1, -1),
];

/// The straight steps on either side of each diagonal one.
pub(super) const BESIDE: [[usize; 2]; 4] = [[0, 2], [1, 2], [0, 3], [1, 3]];

impl CostModel {
    /// What a step of `length` cells costs between nodes of these costs.
    #[inline]
    pub(super) fn price(self, from: f64, to: f64, length: f64) -> f64 {
        match self {
            Self::LengthMean => length * 0.5 * (from + to),
            Self::LengthDest => length * to,
            Self::NodeSum => to,
        }
    }
}

/// Node costs with a blocked border around.
#[derive(Debug, Clone, Default)]
pub(super) struct Lattice {
    /// Infinite where nothing may enter.
    pub(super) costs: Vec<f32>,
    stride: usize,
    /// The least cost, and the greatest that is finite.
    pub(super) least: f32,
    pub(super) greatest: f32,
}

/// NaN and negative costs have no meaning: such a cell is not entered.
pub(super) fn node_cost(cost: f32) -> f32 {
    // Of -0, only the bits differ from 0.
    if cost > 0.0 {
        cost
    } else if cost >= 0.0 {
        0.0
    } else {
        f32::INFINITY
    }
}

impl Lattice {
    pub(super) fn load(&mut self, grid: &CostGrid) {
        if !self.fits(grid) {
            self.stride = grid.width + 2;
            self.costs.clear();
            self.costs
                .resize(self.stride * (grid.height + 2), f32::INFINITY);
        }
        // Bits of floats that are not negative order like the floats, and are compared many at a time.
        let blocked = f32::INFINITY.to_bits();
        let (mut least, mut greatest) = (blocked, 0);
        for row in 0..grid.height {
            let from = &grid.costs[row * grid.width..(row + 1) * grid.width];
            let into = &mut self.costs[(row + 1) * self.stride + 1..][..grid.width];
            for (into, &cost) in into.iter_mut().zip(from) {
                *into = node_cost(cost);
                let bits = into.to_bits();
                least = least.min(bits);
                greatest = greatest.max(if bits < blocked { bits } else { 0 });
            }
        }
        (self.least, self.greatest) = (f32::from_bits(least), f32::from_bits(greatest));
    }

    /// Whether a grid has the size of the one that was loaded.
    pub(super) fn fits(&self, grid: &CostGrid) -> bool {
        self.stride == grid.width + 2 && self.costs.len() == self.stride * (grid.height + 2)
    }

    /// The cells of which `grid` says another cost; all of them where it has another size.
    pub(super) fn changed<'a>(&'a self, grid: &'a CostGrid) -> impl Iterator<Item = Cell> + 'a {
        let fits = self.fits(grid);
        (0..grid.height).flat_map(move |row| {
            let new = &grid.costs[row * grid.width..(row + 1) * grid.width];
            let old = if fits {
                &self.costs[(row + 1) * self.stride + 1..][..grid.width]
            } else {
                &[]
            };
            let differs = move |column: usize| {
                let known = old.get(column);
                known.is_none_or(|old| old.to_bits() != node_cost(new[column]).to_bits())
            };
            (0..grid.width)
                .filter(move |&column| differs(column))
                .map(move |column| (column, row))
        })
    }

    /// The node of a cell.
    pub(super) fn node(&self, cell: Cell) -> usize {
        (cell.1 + 1) * self.stride + cell.0 + 1
    }

    /// The cell of a node that is not of the border.
    pub(super) fn cell(&self, node: usize) -> Cell {
        (node % self.stride - 1, node / self.stride - 1)
    }

    /// Which of the eight neighbours in the order of [`STEPS`] are free, a bit for each, and whether all
    /// that are free cost as much as the node, and anything.
    #[inline]
    pub(super) fn around(&self, at: usize) -> (u8, bool) {
        let row = |first: usize| &self.costs[first..first + 3];
        let (above, beside, below) = (
            row(at + self.stride - 1),
            row(at - 1),
            row(at - self.stride - 1),
        );
        let here = beside[1].to_bits();
        let around = [
            beside[2], beside[0], above[1], below[1], above[2], above[0], below[2], below[0],
        ]
        .map(f32::to_bits);
        let differ = around.into_iter().fold(0, |all, cost| all | cost ^ here);
        if differ == 0 {
            return (u8::MAX, here > 0);
        }
        let (mut free, mut same) = (0u8, 0u8);
        for (k, cost) in around.into_iter().enumerate() {
            free |= u8::from(cost < f32::INFINITY.to_bits()) << k;
            same |= u8::from(cost == here) << k;
        }
        (free, same == free && here > 0)
    }

    /// How far on each step leads among the nodes.
    pub(super) fn steps(&self) -> [isize; 8] {
        let stride = self.stride.cast_signed();
        STEPS.map(|(column, row)| row * stride + column)
    }

    /// The least that a way between a node and `goal` can cost under `model`: the octile distance
    /// at the least cost of the grid. No step changes it by more than the step costs.
    pub(super) fn estimate_to(
        &self,
        goal: Cell,
        model: CostModel,
    ) -> impl Fn(usize) -> f64 + use<> {
        // Numbers of 32 bits are divided in half the time.
        let (stride, least) = (self.stride as u32, f64::from(self.least));
        let (x, y) = (goal.0 as u32 + 1, goal.1 as u32 + 1);
        // Under NodeSum a diagonal step costs no more than a straight one.
        let diagonal = match model {
            CostModel::NodeSum => 1.0,
            CostModel::LengthMean | CostModel::LengthDest => SQRT_2,
        } - 1.0;
        move |node| {
            let node = node as u32;
            let across = f64::from((node % stride).abs_diff(x));
            let along = f64::from((node / stride).abs_diff(y));
            least * (across.max(along) + diagonal * across.min(along))
        }
    }
}
