//! The searches that ours is measured beside: Dijkstra as one writes it, with flat arrays and a binary
//! heap, and A* of the crate `pathfinding`. Both price steps as `length_mean`, in cells.

use agents::grid::{Cell, CostGrid};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::SQRT_2;

/// Micro-cells: `pathfinding` wants whole numbers, or others that are never unordered.
const MICRO: f64 = 1e6;

/// The steps from a cell, with their prices.
fn steps(grid: &CostGrid, (x, y): Cell) -> impl Iterator<Item = (Cell, f64)> {
    let cost = |x: usize, y: usize| {
        if x < grid.width && y < grid.height {
            f64::from(grid.cost((x, y)))
        } else {
            f64::INFINITY
        }
    };
    let here = cost(x, y);
    (-1isize..=1)
        .flat_map(|row| (-1isize..=1).map(move |column| (column, row)))
        .filter(|&step| step != (0, 0))
        .filter_map(move |(column, row)| {
            let (to_x, to_y) = (x.wrapping_add_signed(column), y.wrapping_add_signed(row));
            let diagonal = column != 0 && row != 0;
            let to = cost(to_x, to_y);
            let passes = to.is_finite()
                && !(diagonal && (cost(to_x, y).is_infinite() || cost(x, to_y).is_infinite()));
            let length = if diagonal { SQRT_2 } else { 1.0 };
            passes.then_some(((to_x, to_y), length * 0.5 * (here + to)))
        })
}

/// The least cost by Dijkstra's search on flat arrays.
pub(super) fn flat_dijkstra(grid: &CostGrid, start: Cell, goal: Cell) -> Option<f64> {
    let (width, height) = (grid.width, grid.height);
    let mut least = vec![f64::INFINITY; width * height];
    let mut open = BinaryHeap::new();
    let (start, goal) = (grid.index(start), grid.index(goal));
    least[start] = 0.0;
    open.push(Reverse((0u64, start as u32)));
    while let Some(Reverse((bits, at))) = open.pop() {
        let (so_far, at) = (f64::from_bits(bits), at as usize);
        if at == goal {
            return Some(so_far);
        }
        if so_far > least[at] {
            continue;
        }
        let (x, y) = (at % width, at / width);
        let here = f64::from(grid.costs[at]);
        let (left, right) = (x > 0, x + 1 < width);
        let (below, above) = (y > 0, y + 1 < height);
        let free = |inside: bool, index: usize| inside && grid.costs[index].is_finite();
        let straight = [
            (free(right, at + 1), at + 1),
            (free(left, at.wrapping_sub(1)), at.wrapping_sub(1)),
            (free(above, at + width), at + width),
            (free(below, at.wrapping_sub(width)), at.wrapping_sub(width)),
        ];
        let mut look = |to: usize, length: f64| {
            let cost = so_far + length * 0.5 * (here + f64::from(grid.costs[to]));
            if cost < least[to] {
                least[to] = cost;
                open.push(Reverse((cost.to_bits(), to as u32)));
            }
        };
        for &(is_free, to) in &straight {
            if is_free {
                look(to, 1.0);
            }
        }
        for across in &straight[..2] {
            for along in &straight[2..] {
                let to = across.1.wrapping_add(along.1).wrapping_sub(at);
                if across.0 && along.0 && grid.costs[to].is_finite() {
                    look(to, SQRT_2);
                }
            }
        }
    }
    None
}

/// The least cost by A* of `pathfinding`.
pub(super) fn pathfinding_astar(grid: &CostGrid, start: Cell, goal: Cell) -> Option<f64> {
    let whole = |cost: f64| (cost * MICRO).round() as u64;
    let estimate = |&(x, y): &Cell| {
        let (across, along) = (x.abs_diff(goal.0) as f64, y.abs_diff(goal.1) as f64);
        ((across.max(along) + (SQRT_2 - 1.0) * across.min(along)) * MICRO) as u64
    };
    let found = pathfinding::directed::astar::astar(
        &start,
        |&cell| steps(grid, cell).map(move |(to, cost)| (to, whole(cost))),
        estimate,
        |&cell| cell == goal,
    );
    found.map(|(_, cost)| cost as f64 / MICRO)
}
