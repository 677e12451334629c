//! Ways for walking people: a grid of clearances, A* over it, and the corners that remain when
//! the way is pulled tight. Whoever follows the corners keeps the clearance asked for, where the
//! world leaves that much.

use super::obstacles::Obstacles;
use nalgebra::{Point2, Vector2};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Side of a cell, m.
const CELL: f64 = 0.1;
/// People like this much room, m, and take `NARROW` where there is no other way.
const COMFORT: f64 = 0.35;
const NARROW: f64 = 0.22;

/// How far each point of the floor is from anything solid.
#[derive(Debug, Clone)]
pub(super) struct FloorPlan {
    origin: Point2<f64>,
    width: usize,
    height: usize,
    clearance: Vec<f32>,
}

impl FloorPlan {
    pub(super) fn new(bounds: [f64; 4], obstacles: &Obstacles) -> Self {
        let cells = |from: f64, to: f64| ((to - from) / CELL).ceil().max(1.0) as usize;
        let (width, height) = (cells(bounds[0], bounds[2]), cells(bounds[1], bounds[3]));
        let origin = Point2::new(bounds[0], bounds[1]);
        let mut plan = Self {
            origin,
            width,
            height,
            clearance: Vec::new(),
        };
        plan.clearance = (0..width * height)
            .map(|cell| obstacles.clearance_of_walker(plan.centre(cell)) as f32)
            .collect();
        plan
    }

    fn centre(&self, cell: usize) -> Point2<f64> {
        let (column, row) = (cell % self.width, cell / self.width);
        self.origin + Vector2::new(column as f64 + 0.5, row as f64 + 0.5) * CELL
    }

    /// The cell that `point` lies in, or the nearest.
    fn cell(&self, point: Point2<f64>) -> usize {
        let index =
            |offset: f64, cells: usize| ((offset / CELL).floor().max(0.0) as usize).min(cells - 1);
        let offset = point - self.origin;
        index(offset.y, self.height) * self.width + index(offset.x, self.width)
    }

    /// Distance from `point` to the nearest thing that one cannot walk through, to half a cell.
    pub(super) fn clearance(&self, point: Point2<f64>) -> f64 {
        f64::from(self.clearance[self.cell(point)])
    }

    /// Corners of a way from one point to the other, without `from`, with `to`. Where there is
    /// no way, the straight line.
    pub(super) fn route(&self, from: Point2<f64>, to: Point2<f64>) -> Vec<Point2<f64>> {
        if self.free_line(from, to, COMFORT) {
            return vec![to];
        }
        let way = [COMFORT, NARROW].into_iter().find_map(|clearance| {
            let start = self.nearest_free(from, clearance)?;
            let goal = self.nearest_free(to, clearance)?;
            let cells = self.search(start, goal, clearance)?;
            let mut points = vec![from];
            points.extend(cells.into_iter().map(|cell| self.centre(cell)));
            Some(self.tighten(&points, clearance))
        });
        let mut way = way.unwrap_or_default();
        way.push(to);
        way
    }

    fn is_free(&self, cell: usize, clearance: f64) -> bool {
        f64::from(self.clearance[cell]) >= clearance
    }

    /// Whether the straight line keeps the clearance.
    fn free_line(&self, from: Point2<f64>, to: Point2<f64>, clearance: f64) -> bool {
        let steps = ((to - from).norm() / (CELL / 2.0)).ceil().max(1.0);
        (0..=steps as usize).all(|step| {
            let at = from + (to - from) * (step as f64 / steps);
            self.clearance(at) >= clearance
        })
    }

    /// The nearest cell with that clearance.
    fn nearest_free(&self, point: Point2<f64>, clearance: f64) -> Option<usize> {
        let here = self.cell(point);
        if self.is_free(here, clearance) {
            return Some(here);
        }
        (0..self.clearance.len())
            .filter(|cell| self.is_free(*cell, clearance))
            .map(|cell| ((self.centre(cell) - point).norm_squared(), cell))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, cell)| cell)
    }

    /// A* over the cells, 8-connected, no corner cut; in units of a tenth of a cell.
    fn search(&self, start: usize, goal: usize, clearance: f64) -> Option<Vec<usize>> {
        let split = |cell: usize| (cell % self.width, cell / self.width);
        let far = |cell: usize| {
            let ((x, y), (gx, gy)) = (split(cell), split(goal));
            let (dx, dy) = (x.abs_diff(gx), y.abs_diff(gy));
            10 * dx.max(dy) + 4 * dx.min(dy)
        };
        let mut cost = vec![usize::MAX; self.clearance.len()];
        let mut parent = vec![usize::MAX; self.clearance.len()];
        let mut open = BinaryHeap::from([Reverse((far(start), start))]);
        cost[start] = 0;
        while let Some(Reverse((estimate, cell))) = open.pop() {
            if cell == goal {
                let mut way = vec![goal];
                while let Some(&last) = way.last().filter(|last| **last != start) {
                    way.push(parent[last]);
                }
                way.reverse();
                return Some(way);
            }
            if estimate > cost[cell] + far(cell) {
                continue;
            }
            let (x, y) = split(cell);
            let free = |dx: isize, dy: isize| {
                let x = x.checked_add_signed(dx).filter(|x| *x < self.width)?;
                let y = y.checked_add_signed(dy).filter(|y| *y < self.height)?;
                let cell = y * self.width + x;
                self.is_free(cell, clearance).then_some(cell)
            };
            for (dx, dy) in [
                (1, 0),
                (0, 1),
                (-1, 0),
                (0, -1),
                (1, 1),
                (-1, 1),
                (-1, -1),
                (1, -1),
            ] {
                let Some(next) = free(dx, dy) else { continue };
                let diagonal = dx != 0 && dy != 0;
                if diagonal && (free(dx, 0).is_none() || free(0, dy).is_none()) {
                    continue;
                }
                let through = cost[cell] + if diagonal { 14 } else { 10 };
                if through < cost[next] {
                    cost[next] = through;
                    parent[next] = cell;
                    open.push(Reverse((through + far(next), next)));
                }
            }
        }
        None
    }

    /// Leaves out every point that a straight line can skip.
    fn tighten(&self, points: &[Point2<f64>], clearance: f64) -> Vec<Point2<f64>> {
        let mut corners = Vec::new();
        let mut at = 0;
        while at + 1 < points.len() {
            let reach = (at + 2..points.len())
                .rev()
                .find(|next| self.free_line(points[at], points[*next], clearance));
            at = reach.unwrap_or(at + 1);
            corners.push(points[at]);
        }
        corners
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A room of 6 x 4 m, cut in two at x = 3 but for a door of 1 m at y = 3.
    fn two_rooms() -> Obstacles {
        let at = |x: f64, y: f64| Point2::new(x, y);
        let walls = vec![
            [at(0.0, 0.0), at(6.0, 0.0)],
            [at(6.0, 0.0), at(6.0, 4.0)],
            [at(6.0, 4.0), at(0.0, 4.0)],
            [at(0.0, 4.0), at(0.0, 0.0)],
            [at(3.0, 0.0), at(3.0, 2.5)],
            [at(3.0, 3.5), at(3.0, 4.0)],
        ];
        Obstacles {
            walls,
            objects: Vec::new(),
        }
    }

    #[test]
    fn the_way_leads_through_the_door_and_keeps_clear_of_walls() {
        let obstacles = two_rooms();
        let plan = FloorPlan::new([0.0, 0.0, 6.0, 4.0], &obstacles);
        let (from, to) = (Point2::new(1.0, 0.5), Point2::new(5.0, 0.5));
        let mut way = vec![from];
        way.extend(plan.route(from, to));
        assert_eq!(way.last(), Some(&to));
        let length: f64 = way.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
        assert!((5.6..6.6).contains(&length), "{length}");
        for leg in way.windows(2) {
            for part in 0..=20 {
                let point = leg[0] + (leg[1] - leg[0]) * (f64::from(part) / 20.0);
                assert!(
                    obstacles.clearance_of_walker(point) > COMFORT - CELL,
                    "{point}"
                );
            }
        }
    }

    #[test]
    fn in_the_open_the_way_is_straight() {
        let plan = FloorPlan::new([0.0, 0.0, 6.0, 4.0], &two_rooms());
        let to = Point2::new(2.0, 3.0);
        assert_eq!(plan.route(Point2::new(1.0, 1.0), to), vec![to]);
    }
}
