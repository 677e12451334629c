//! A floor of rooms with people and furniture, as a cost grid of any size. This file guarantees that
//! a size gives the same floor everywhere, and that a way leads from corner to corner.

use crate::bench::chance::Chance;
use agents::grid::{BLOCKED, Cell, CostGrid, FREE};
use agents::navigation::path::{Request, Search};

/// Cells on the side of a room with its walls: 4 m.
const ROOM: usize = 80;
/// Cells of a door: 1 m.
const DOOR: usize = 20;
/// Metres on the side of a cell.
pub(super) const RESOLUTION: f64 = 0.05;

/// A disc of cells around a centre.
pub(super) fn disc(grid: &CostGrid, centre: Cell, radius: usize) -> Vec<Cell> {
    let span =
        |middle: usize, end: usize| middle.saturating_sub(radius)..(middle + radius + 1).min(end);
    let mut cells = Vec::new();
    for row in span(centre.1, grid.height) {
        for column in span(centre.0, grid.width) {
            let away = column.abs_diff(centre.0).pow(2) + row.abs_diff(centre.1).pow(2);
            if away <= radius * radius {
                cells.push((column, row));
            }
        }
    }
    cells
}

/// Somebody's intimate, personal and social space (READING.md item 7), or an object's own footprint
/// and the space around it.
fn settle(grid: &mut CostGrid, centre: Cell, zones: &[(usize, f32)]) {
    for &(radius, cost) in zones {
        for cell in disc(grid, centre, radius) {
            let at = grid.index(cell);
            grid.costs[at] = grid.costs[at].max(cost);
        }
    }
}

/// The two ends of a way across the floor.
pub(super) fn corners(grid: &CostGrid) -> [Cell; 2] {
    [
        (ROOM / 8, ROOM / 8),
        (grid.width - ROOM / 8, grid.height - ROOM / 8),
    ]
}

/// `side` x `side` cells: rooms that lie wall to wall, two doors out of three, and in every other
/// room a person or an object in use.
pub(super) fn floor(side: usize) -> CostGrid {
    let metres = side as f64 * RESOLUTION;
    let mut seed = side as u64;
    loop {
        let mut grid = CostGrid::covering([0.0, 0.0, metres, metres], RESOLUTION);
        furnish(&mut grid, &mut Chance::new(seed));
        let [start, goal] = corners(&grid);
        if Search::default()
            .find(&grid, &Request::new(start, goal))
            .is_ok()
        {
            return grid;
        }
        seed += 1 << 32;
    }
}

fn furnish(grid: &mut CostGrid, chance: &mut Chance) {
    let side = grid.width;
    let mut any = |end: usize| chance.below(end as u32) as usize;
    for room in (0..side).step_by(ROOM) {
        for along in (0..side).step_by(ROOM) {
            for lies_down in [false, true] {
                let open = any(3) > 0;
                let door = along + 5 + any(ROOM - DOOR - 10);
                for at in along..(along + ROOM).min(side) {
                    let free = open && (door..door + DOOR).contains(&at);
                    let cell = if lies_down { (at, room) } else { (room, at) };
                    let cell = grid.index(cell);
                    grid.costs[cell] = if free { FREE } else { BLOCKED };
                }
            }
        }
    }
    for y in (0..side).step_by(ROOM) {
        for x in (0..side).step_by(ROOM) {
            let centre = (x + 15 + any(ROOM - 30), y + 15 + any(ROOM - 30));
            match any(4) {
                0 => settle(grid, centre, &[(24, 2.0), (20, 4.0), (9, BLOCKED)]),
                1 => settle(grid, centre, &[(22, 3.5), (10, BLOCKED)]),
                _ => {}
            }
        }
    }
    for corner in corners(grid) {
        for cell in disc(grid, corner, 4) {
            let at = grid.index(cell);
            grid.costs[at] = FREE;
        }
    }
}
