//! What is drawn into the grid, one stamp for each thing. This file owns how a shape becomes cells:
//! a cell takes part where its centre does, and keeps the larger cost (READING.md item 7). Because
//! drawing is a maximum, the order of stamps is indifferent and drawing twice is drawing once.

use super::gaussian::AsymmetricGaussian;
use super::object_space::Outline;
use super::scene::Wall;
use super::zones::Cuts;
use crate::grid::{BLOCKED, CostGrid, FREE};
use nalgebra::{Isometry2, Point2, Vector2};

/// How obstacles grow by the robot: blocked within `reach`, then dearer by `extra`, falling
/// linearly to nothing over `width`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Inflation {
    pub(super) reach: f64,
    pub(super) extra: f64,
    pub(super) width: f64,
}

impl Inflation {
    fn cost(&self, distance: f64) -> f32 {
        if distance <= self.reach {
            BLOCKED
        } else {
            let share = 1.0 - (distance - self.reach) / self.width;
            FREE + (self.extra * share.max(0.0)) as f32
        }
    }

    fn total(&self) -> f64 {
        self.reach + self.width
    }
}

/// One thing on the grid.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Stamp {
    /// A wall, inflated.
    Wall { wall: Wall, inflation: Inflation },
    /// An object's footprint, inflated.
    Footprint {
        outline: Outline,
        world_from_object: Isometry2<f64>,
        inflation: Inflation,
    },
    /// An object's space.
    Space {
        polygon: Vec<Point2<f64>>,
        cost: f32,
    },
    /// A person's zones.
    Zones {
        world_from_person: Isometry2<f64>,
        shape: AsymmetricGaussian,
        cuts: Cuts,
    },
    /// A person's body, inflated: blocked within `radius`.
    Body { centre: Point2<f64>, radius: f64 },
    /// The space between two who interact, within `half_width` of the line between them.
    Between {
        ends: Wall,
        half_width: f64,
        cost: f32,
    },
}

/// A rectangle of cells: columns and rows, ends excluded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window {
    columns: (usize, usize),
    rows: (usize, usize),
}

impl Window {
    /// The cells of `grid` whose centres may lie within `margin` of the box around `points`.
    fn around(grid: &CostGrid, points: &[Point2<f64>], margin: f64) -> Self {
        let span = |values: &mut dyn Iterator<Item = f64>, origin: f64, count: usize| {
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
                (l.min(v), h.max(v))
            });
            // A float to integer cast saturates, so far away is the edge; no points is empty.
            let cell = |value: f64| ((value - origin) / grid.resolution).floor();
            let start = cell(low - margin).max(0.0) as usize;
            let end = (cell(high + margin) + 1.0).max(0.0) as usize;
            (start.min(count), end.min(count))
        };
        Self {
            columns: span(&mut points.iter().map(|p| p.x), grid.origin.x, grid.width),
            rows: span(&mut points.iter().map(|p| p.y), grid.origin.y, grid.height),
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.columns.0 >= self.columns.1 || self.rows.0 >= self.rows.1
    }

    pub(super) fn meets(&self, other: &Self) -> bool {
        self.columns.0 < other.columns.1
            && other.columns.0 < self.columns.1
            && self.rows.0 < other.rows.1
            && other.rows.0 < self.rows.1
    }

    /// The smallest window around both.
    #[must_use]
    pub(super) fn joined(&self, other: &Self) -> Self {
        let join = |a: (usize, usize), b: (usize, usize)| (a.0.min(b.0), a.1.max(b.1));
        Self {
            columns: join(self.columns, other.columns),
            rows: join(self.rows, other.rows),
        }
    }

    /// Where each of its rows stands in a grid's costs.
    pub(super) fn row_ranges(&self, width: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
        let (start, end) = self.columns;
        (self.rows.0..self.rows.1).map(move |row| row * width + start..row * width + end)
    }
}

impl Stamp {
    /// The cells it may touch.
    pub(super) fn window(&self, grid: &CostGrid) -> Window {
        match self {
            Self::Wall { wall, inflation } => Window::around(grid, wall, inflation.total()),
            Self::Footprint {
                outline,
                world_from_object,
                inflation,
            } => {
                let half = half_extent(outline);
                let corners = corners(world_from_object, [-half.x, half.x], [-half.y, half.y]);
                Window::around(grid, &corners, inflation.total())
            }
            Self::Space { polygon, .. } => Window::around(grid, polygon, 0.0),
            Self::Zones {
                world_from_person,
                shape,
                cuts,
            } => {
                let reach = cuts.social.sqrt();
                let (front, side, rear) =
                    (reach * shape.front, reach * shape.side, reach * shape.rear);
                let corners = corners(world_from_person, [-rear, front], [-side, side]);
                Window::around(grid, &corners, 0.0)
            }
            Self::Body { centre, radius } => Window::around(grid, &[*centre], *radius),
            Self::Between {
                ends, half_width, ..
            } => Window::around(grid, ends, *half_width),
        }
    }

    /// Raises the costs of the cells it covers.
    pub(super) fn draw(&self, grid: &mut CostGrid) {
        let window = self.window(grid);
        match self {
            Self::Wall { wall, inflation } => {
                raise(grid, window, |p| {
                    inflation.cost(distance_to_segment(p, wall))
                });
            }
            Self::Footprint {
                outline,
                world_from_object,
                inflation,
            } => raise(grid, window, |p| {
                let place = world_from_object.inverse_transform_point(&p);
                inflation.cost(distance_to_outline(place, outline))
            }),
            Self::Space { polygon, cost } => fill(grid, window, polygon, *cost),
            Self::Zones {
                world_from_person,
                shape,
                cuts,
            } => raise(grid, window, |p| {
                let place = world_from_person.inverse_transform_point(&p);
                cuts.zone(shape.squared_deviation(place)).cost()
            }),
            Self::Body { centre, radius } => raise(grid, window, |p| {
                if (p - centre).norm_squared() <= radius * radius {
                    BLOCKED
                } else {
                    FREE
                }
            }),
            Self::Between {
                ends,
                half_width,
                cost,
            } => raise(grid, window, |p| {
                if distance_to_segment(p, ends) <= *half_width {
                    *cost
                } else {
                    FREE
                }
            }),
        }
    }
}

/// Raises each cell of the window to `cost` at its centre.
fn raise(grid: &mut CostGrid, window: Window, cost: impl Fn(Point2<f64>) -> f32) {
    for row in window.rows.0..window.rows.1 {
        for column in window.columns.0..window.columns.1 {
            let cell = (column, row);
            let index = grid.index(cell);
            grid.costs[index] = grid.costs[index].max(cost(grid.centre(cell)));
        }
    }
}

/// Raises the cells whose centres lie in the polygon (even-odd), row by row.
fn fill(grid: &mut CostGrid, window: Window, polygon: &[Point2<f64>], cost: f32) {
    let mut crossings: Vec<f64> = Vec::new();
    for row in window.rows.0..window.rows.1 {
        let y = grid.centre((0, row)).y;
        crossings.clear();
        for (i, a) in polygon.iter().enumerate() {
            let b = polygon[(i + 1) % polygon.len()];
            if (a.y <= y) != (b.y <= y) {
                crossings.push(a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x));
            }
        }
        crossings.sort_by(f64::total_cmp);
        for pair in crossings.chunks_exact(2) {
            // Centres at (column + 1/2): the first at or after the entry, up to the exit.
            let column = |x: f64| {
                ((x - grid.origin.x) / grid.resolution - 0.5)
                    .ceil()
                    .max(0.0)
            };
            let start = (column(pair[0]) as usize).clamp(window.columns.0, window.columns.1);
            let end = (column(pair[1]) as usize).clamp(start, window.columns.1);
            let base = row * grid.width;
            for value in &mut grid.costs[base + start..base + end] {
                *value = value.max(cost);
            }
        }
    }
}

/// Half the sides of the rectangle around an outline, along its own axes.
fn half_extent(outline: &Outline) -> Vector2<f64> {
    match outline {
        Outline::Rectangle(size) => size / 2.0,
        Outline::Circle(radius) => Vector2::new(*radius, *radius),
    }
}

/// The corners of a rectangle given in a thing's own frame, in the world frame.
fn corners(world_from_own: &Isometry2<f64>, x: [f64; 2], y: [f64; 2]) -> [Point2<f64>; 4] {
    [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])]
        .map(|(x, y)| world_from_own * Point2::new(x, y))
}

pub(super) fn distance_to_segment(point: Point2<f64>, [a, b]: &Wall) -> f64 {
    let along = b - a;
    let squared = along.norm_squared();
    let share = if squared > 0.0 {
        ((point - a).dot(&along) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (point - (a + along * share)).norm()
}

/// From a place in the object's frame to its outline; 0 inside.
fn distance_to_outline(place: Point2<f64>, outline: &Outline) -> f64 {
    match outline {
        Outline::Circle(radius) => (place.coords.norm() - radius).max(0.0),
        Outline::Rectangle(size) => {
            let x = (place.x.abs() - size.x / 2.0).max(0.0);
            let y = (place.y.abs() - size.y / 2.0).max(0.0);
            x.hypot(y)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::social_mapping::object_space::Space;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_space_covers_the_cells_whose_centres_it_contains(
            x in -1.0..5.0f64, y in -1.0..5.0f64, heading in -4.0..4.0f64, viewed: bool,
        ) {
            let space = if viewed { Space::VIEWED } else { Space::USED_AROUND };
            let outline = Outline::Rectangle(Vector2::new(1.3, 0.7));
            let pose = Isometry2::new(Vector2::new(x, y), heading);
            let polygon = space.polygon(&outline, &pose);
            let mut grid = CostGrid::covering([0.0, 0.0, 4.0, 3.0], 0.1);
            Stamp::Space { polygon: polygon.clone(), cost: 2.5 }.draw(&mut grid);
            for index in 0..grid.costs.len() {
                let centre = grid.centre((index % grid.width, index / grid.width));
                let depth = polygon
                    .iter()
                    .zip(polygon.iter().cycle().skip(1))
                    .map(|(a, b)| (b - a).normalize().perp(&(centre - a)))
                    .fold(f64::INFINITY, f64::min);
                if depth.abs() > 1e-9 {
                    prop_assert_eq!(depth > 0.0, grid.costs[index] > 2.0, "at {}", centre);
                }
            }
        }
    }
}
