//! What is drawn into the grid, one stamp for each thing. This file owns how a shape becomes cells:
//! a cell takes part where its centre does, and keeps the larger cost (READING.md item 7). Because
//! drawing is a maximum, the order of stamps is indifferent and drawing twice is drawing once.

mod zones;

use super::four_sided::FourSided;
use super::object_space::Outline;
use super::personal::CooperationZone;
use super::scene::Wall;
use super::zones::{Cuts, Zone};
use crate::grid::{BLOCKED, CostGrid, FREE, Region};
use nalgebra::{Isometry2, Point2, Vector2};
use pulp::Arch;
use std::sync::Arc;
use zones::RaiseZones;

/// How obstacles grow by the robot: blocked within `reach`, then dearer by `extra`, falling
/// linearly to nothing over `width`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Inflation {
    pub(super) reach: f64,
    pub(super) extra: f64,
    pub(super) width: f64,
}

impl Inflation {
    /// No growth but what it takes for a wall to block each cell that it passes through.
    pub(super) fn none(resolution: f64) -> Self {
        Self {
            reach: resolution * std::f64::consts::FRAC_1_SQRT_2,
            extra: 0.0,
            width: 0.0,
        }
    }

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
        polygon: Arc<[Point2<f64>]>,
        cost: f32,
    },
    /// A person's zones.
    Zones {
        world_from_person: Isometry2<f64>,
        shape: FourSided,
        cuts: Cuts,
        /// Where personal space is free for the robot.
        open: Vec<CooperationZone>,
        /// Towards which sides (front, left, rear, right) it does not pass, for want of room.
        shut: [bool; 4],
    },
    /// A person's body, grown by the robot: blocked within `radius` and `reach` together.
    Body {
        centre: Point2<f64>,
        radius: f64,
        reach: f64,
    },
    /// The space between two who interact, within `half_width` of the line between them.
    Between {
        ends: Wall,
        half_width: f64,
        cost: f32,
    },
}

/// The cells of `grid` whose centres may lie within `margin` of the box around `points`.
fn around(grid: &CostGrid, points: &[Point2<f64>], margin: f64) -> Region {
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
    Region {
        columns: span(&mut points.iter().map(|p| p.x), grid.origin.x, grid.width),
        rows: span(&mut points.iter().map(|p| p.y), grid.origin.y, grid.height),
    }
}

impl Stamp {
    /// The same obstacle with another growth; what is no obstacle stays as it is.
    pub(super) fn grown(&self, inflation: Inflation) -> Self {
        match self {
            Self::Wall { wall, .. } => Self::Wall {
                wall: *wall,
                inflation,
            },
            Self::Footprint {
                outline,
                world_from_object,
                ..
            } => Self::Footprint {
                outline: *outline,
                world_from_object: *world_from_object,
                inflation,
            },
            Self::Body { centre, radius, .. } => Self::Body {
                centre: *centre,
                radius: *radius,
                reach: inflation.reach,
            },
            other => other.clone(),
        }
    }

    /// The cells it may touch.
    pub(super) fn window(&self, grid: &CostGrid) -> Region {
        match self {
            Self::Wall { wall, inflation } => around(grid, wall, inflation.total()),
            Self::Footprint {
                outline,
                world_from_object,
                inflation,
            } => {
                let half = half_extent(outline);
                let corners = corners(world_from_object, [-half.x, half.x], [-half.y, half.y]);
                around(grid, &corners, inflation.total())
            }
            Self::Space { polygon, .. } => around(grid, polygon, 0.0),
            Self::Zones {
                world_from_person,
                shape,
                cuts,
                ..
            } => {
                let reach = cuts.social.sqrt();
                let [front, left, rear, right] = shape.sides().map(|side| reach * side);
                let corners = corners(world_from_person, [-rear, front], [-right, left]);
                around(grid, &corners, 0.0)
            }
            Self::Body {
                centre,
                radius,
                reach,
            } => around(grid, &[*centre], radius + reach),
            Self::Between {
                ends, half_width, ..
            } => around(grid, ends, *half_width),
        }
    }

    /// Raises the costs of the cells it covers, as far as they lie in `clip`.
    pub(super) fn draw(&self, grid: &mut CostGrid, clip: &Region) {
        let window = self.window(grid).common(clip);
        if window.is_empty() {
            return;
        }
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
                open,
                shut: [false, false, false, false],
            } if open.is_empty() => Arch::new().dispatch(RaiseZones {
                grid,
                window,
                world_from_person,
                shape,
                cuts,
            }),
            Self::Zones {
                world_from_person,
                shape,
                cuts,
                open,
                shut,
            } => raise(grid, window, |p| {
                let place = world_from_person.inverse_transform_point(&p);
                match cuts.zone(shape.squared_deviation(place)) {
                    Zone::Personal if shut[side_of(place)] => BLOCKED,
                    Zone::Personal if open.iter().any(|zone| zone.contains(place)) => FREE,
                    zone => zone.cost(),
                }
            }),
            Self::Body {
                centre,
                radius,
                reach,
            } => {
                let limit = (radius + reach).powi(2);
                raise(grid, window, |p| {
                    if (p - centre).norm_squared() <= limit {
                        BLOCKED
                    } else {
                        FREE
                    }
                });
            }
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

/// Towards which side a place in a person's own frame lies: front, left, rear or right.
fn side_of(place: Point2<f64>) -> usize {
    match (
        place.x.abs() >= place.y.abs(),
        place.x >= 0.0,
        place.y >= 0.0,
    ) {
        (true, true, _) => 0,
        (true, false, _) => 2,
        (false, _, true) => 1,
        (false, _, false) => 3,
    }
}

/// Raises each cell of the window to `cost` at its centre.
fn raise(grid: &mut CostGrid, window: Region, cost: impl Fn(Point2<f64>) -> f32) {
    for row in window.rows.0..window.rows.1 {
        for column in window.columns.0..window.columns.1 {
            let cell = (column, row);
            let index = grid.index(cell);
            grid.costs[index] = grid.costs[index].max(cost(grid.centre(cell)));
        }
    }
}

/// Raises the cells whose centres lie in the polygon (even-odd), row by row.
fn fill(grid: &mut CostGrid, window: Region, polygon: &[Point2<f64>], cost: f32) {
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
            let whole = grid.whole();
            Stamp::Space { polygon: polygon.clone().into(), cost: 2.5 }.draw(&mut grid, &whole);
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
