//! Where the robot's centre can be within a few metres around it, as a bitmap: predictions ask this
//! some thousand times a step. This file guarantees that a place is blocked where the robot would
//! touch an obstacle, to within one cell.

use super::obstacles::Obstacles;
use nalgebra::{Point2, Vector2, distance};

/// Half the side of the square that is looked at, metres.
pub const REACH: f64 = 5.0;
/// Side of a cell, metres.
const CELL: f64 = 0.1;
/// Cells along a side.
const SIDE: usize = (2.0 * REACH / CELL) as usize;

/// The obstacles around a place, widened by the robot's radius.
#[derive(Debug, Clone)]
pub struct Ground {
    corner: Point2<f64>,
    blocked: Vec<bool>,
    occupied: Vec<bool>,
}

impl Default for Ground {
    fn default() -> Self {
        let cells = vec![false; SIDE * SIDE];
        Self {
            corner: Point2::origin(),
            blocked: cells.clone(),
            occupied: cells,
        }
    }
}

impl Ground {
    /// Looks at `obstacles` around `centre` for a robot of that `radius`, metres.
    pub fn load(&mut self, centre: Point2<f64>, obstacles: &Obstacles, radius: f64) {
        self.corner = centre - Vector2::new(REACH, REACH);
        self.blocked.fill(false);
        self.occupied.fill(false);
        for &point in obstacles.points() {
            self.occupy(point);
        }
        for &[from, to] in obstacles.walls() {
            let pieces = (distance(&from, &to) / CELL).ceil().max(1.0) as usize;
            for k in 0..=pieces {
                self.occupy(from + (to - from) * (k as f64 / pieces as f64));
            }
        }
        let reach = (radius / CELL).round() as usize;
        for cell in (0..self.occupied.len()).filter(|&cell| self.occupied[cell]) {
            let (column, row) = (cell % SIDE, cell / SIDE);
            for y in row.saturating_sub(reach)..(row + reach + 1).min(SIDE) {
                let rise = y.abs_diff(row);
                let half = (reach * reach - rise * rise).isqrt();
                let columns = column.saturating_sub(half)..(column + half + 1).min(SIDE);
                self.blocked[y * SIDE..][columns].fill(true);
            }
        }
    }

    fn occupy(&mut self, point: Point2<f64>) {
        if let Some(cell) = self.cell(point) {
            self.occupied[cell] = true;
        }
    }

    fn cell(&self, place: Point2<f64>) -> Option<usize> {
        let at = (place - self.corner) / CELL;
        let inside = at.x >= 0.0 && at.y >= 0.0 && at.x < SIDE as f64 && at.y < SIDE as f64;
        inside.then_some(at.y as usize * SIDE + at.x as usize)
    }

    /// Whether the robot would touch something at `place`. Beyond [`REACH`] nothing is known, and
    /// nothing is blocked.
    pub fn is_blocked(&self, place: Point2<f64>) -> bool {
        self.cell(place).is_some_and(|cell| self.blocked[cell])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn obstacles_are_widened_by_the_radius() {
        let mut obstacles = Obstacles::new();
        obstacles.push_wall([Point2::new(11.0, 0.0), Point2::new(11.0, 30.0)]);
        let mut ground = Ground::default();
        ground.load(Point2::new(10.0, 10.0), &obstacles, 0.3);
        for (x, blocked) in [
            (10.55, false),
            (10.75, true),
            (11.0, true),
            (11.25, true),
            (11.45, false),
        ] {
            assert_eq!(ground.is_blocked(Point2::new(x, 12.0)), blocked, "{x}");
        }
        assert!(!ground.is_blocked(Point2::new(11.0, 20.0)));
    }
}
