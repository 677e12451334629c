//! The social grid without the spaces of those who walk: they will be elsewhere when the robot gets
//! there, and a path planned round where they are now would swing about with them. Where they will
//! be is the planner's and the anticipation's business. Beside the spaces that stay, a berth is kept.
//! This file guarantees that a cell outside walkers' spaces costs at least what the newest grid says,
//! and more only within [`BERTH`] of a dearer space.

use super::people::{INTIMATE, Person, SOCIAL};
use crate::grid::{BLOCKED, CostGrid, FREE};
use crate::social_mapping::AsymmetricGaussian;
use dsr::Time;
use nalgebra::{Point2, Vector2};

/// How much wider than their social space a walker hides the grid, in squared deviations: the grid
/// is older than the person's pose.
const HIDDEN: f64 = 1.5 * SOCIAL;
/// The grid is looked at again after this, seconds.
const PERIOD: f64 = 0.25;
/// What a space can cost at most without being blocked (READING.md item 7).
const DEAREST_SPACE: f32 = 4.0;

/// So far from a space the cells are dearer than their own cost, metres: the cheapest path around a
/// space would else lead along its very edge, and a robot that cuts a curve or errs about where it is
/// by some centimetres drives inside it.
const BERTH: f64 = 0.15;
/// What a cell in the berth costs, as a share of what the space costs more than a free cell.
const BERTH_SHARE: f32 = 0.8;
/// From this cost on a cell is one of a space rather than one beside a wall (READING.md item 7).
const LEAST_SPACE: f32 = 1.5;

/// What the grid said of each cell when nobody last walked there.
#[derive(Debug, Clone)]
pub(super) struct Settled {
    grid: CostGrid,
    /// The same with the berth.
    kept_off: CostGrid,
    looked: Option<Time>,
    hidden: Vec<bool>,
}

impl Default for Settled {
    fn default() -> Self {
        Self {
            grid: CostGrid::covering([0.0; 4], 1.0),
            kept_off: CostGrid::covering([0.0; 4], 1.0),
            looked: None,
            hidden: Vec::new(),
        }
    }
}

impl Settled {
    /// The grid without walkers and with the berth.
    pub(super) fn with_berth(&self) -> &CostGrid {
        &self.kept_off
    }

    /// Takes in `newest`, with `people` where they are now. A cell that has never been seen without
    /// a walker is taken for free where its cost can be that of the walker's space.
    pub(super) fn observe(&mut self, now: Time, newest: &CostGrid, people: &[Person]) {
        let known = self.grid.costs.len() == newest.costs.len()
            && self.grid.width == newest.width
            && self.grid.origin == newest.origin;
        let recent = |looked: Time| (0.0..PERIOD).contains(&now.since(looked));
        if known && self.looked.is_some_and(recent) {
            return;
        }
        self.looked = Some(now);
        self.hidden.clear();
        self.hidden.resize(newest.costs.len(), false);
        for person in people.iter().filter(|person| person.is_walking()) {
            self.hide(newest, person, known);
        }
        if known {
            let seen = newest
                .costs
                .iter()
                .zip(&self.hidden)
                .zip(&mut self.grid.costs);
            for ((new, _), cost) in seen.filter(|((_, hidden), _)| !**hidden) {
                *cost = *new;
            }
            self.keep_off();
            return;
        }
        self.grid = newest.clone();
        for (cost, _) in self
            .grid
            .costs
            .iter_mut()
            .zip(&self.hidden)
            .filter(|(_, hidden)| **hidden)
        {
            *cost = FREE;
        }
        self.keep_off();
    }

    /// Makes dearer what lies beside a space.
    fn keep_off(&mut self) {
        let CostGrid { width, height, .. } = self.grid;
        let resolution = self.grid.resolution;
        let mut costs = std::mem::take(&mut self.kept_off.costs);
        costs.clone_from(&self.grid.costs);
        self.kept_off = CostGrid { costs, ..self.grid };
        // Rounding takes no cell away.
        let reach = BERTH / resolution + 1e-9;
        let (cells, reach) = (reach as usize, reach.powi(2));
        for (index, &cost) in self.grid.costs.iter().enumerate() {
            if !(LEAST_SPACE..BLOCKED).contains(&cost) {
                continue;
            }
            let (column, row) = (index % width, index / width);
            let dearer = FREE + BERTH_SHARE * (cost - FREE);
            for y in row.saturating_sub(cells)..(row + cells + 1).min(height) {
                for x in column.saturating_sub(cells)..(column + cells + 1).min(width) {
                    let squared = x.abs_diff(column).pow(2) + y.abs_diff(row).pow(2);
                    let beside = &mut self.kept_off.costs[y * width + x];
                    if squared as f64 <= reach && *beside < dearer {
                        *beside = dearer;
                    }
                }
            }
        }
    }

    /// Marks the cells about which the grid says nothing but that `person` is there.
    fn hide(&mut self, newest: &CostGrid, person: &Person, known: bool) {
        let shape = AsymmetricGaussian::HALL
            .four_sided()
            .walking(person.velocity.norm());
        let reach = HIDDEN.sqrt() * shape.front;
        let position = person.position();
        let cell = |offset: f64, end: usize| {
            ((offset / newest.resolution).floor().max(0.0) as usize).min(end)
        };
        let low = position - newest.origin - Vector2::new(reach, reach);
        let high = low + 2.0 * Vector2::new(reach, reach);
        let (width, height) = (newest.width, newest.height);
        let now = person.predicted(0.0);
        for row in cell(low.y, height)..cell(high.y + newest.resolution, height) {
            for column in cell(low.x, width)..cell(high.x + newest.resolution, width) {
                let place = newest.centre((column, row));
                let offset = place - position;
                let own = Point2::new(offset.dot(&now.facing), now.facing.perp(&offset));
                if shape.squared_deviation(own) >= HIDDEN {
                    continue;
                }
                let index = newest.index((column, row));
                let cost = newest.costs[index];
                let space = if cost < BLOCKED {
                    cost <= DEAREST_SPACE
                } else {
                    now.squared_deviation(place) < 3.0 * INTIMATE
                };
                self.hidden[index] |= known || space;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Isometry2;

    fn walker(x: f64, speed: f64) -> Person {
        Person {
            name: "w".into(),
            world_from_person: Isometry2::new(Vector2::new(x, 5.0), 0.0),
            velocity: Vector2::new(speed, 0.0),
            radius: 0.25,
        }
    }

    /// The grid with a wall across and the space of one person.
    fn grid(person: &Person) -> CostGrid {
        let mut grid = CostGrid::covering([0.0, 0.0, 20.0, 10.0], 0.1);
        for k in 0..grid.costs.len() {
            let place = grid.centre((k % grid.width, k / grid.width));
            let q = person.predicted(0.0).squared_deviation(place);
            grid.costs[k] = if (place.x - 12.0).abs() < 0.2 || q < INTIMATE {
                BLOCKED
            } else if q < SOCIAL {
                2.0
            } else {
                FREE
            };
        }
        grid
    }

    #[test]
    fn who_walks_leaves_no_trace_and_who_stands_does() {
        let at = |settled: &Settled, x: f64| settled.with_berth().cost((((x * 10.0) as usize), 50));
        let mut settled = Settled::default();
        let mut now = Time::from_seconds(1.0);
        let mut x = 3.0;
        while x < 9.5 {
            let person = walker(x, 1.3);
            settled.observe(now, &grid(&person), &[person]);
            for place in [x - 0.5, x, x + 1.0, x + 2.0] {
                assert!(at(&settled, place) <= FREE, "{place} at {x}");
            }
            assert!(at(&settled, 12.05) >= BLOCKED, "the wall stays, at {x}");
            now = now + 0.3;
            x += 0.39;
        }
        let person = walker(x, 0.0);
        settled.observe(now, &grid(&person), &[person]);
        assert!(at(&settled, x) >= BLOCKED && at(&settled, x + 1.0) >= 2.0);
    }

    #[test]
    fn a_berth_is_kept_beside_spaces_and_none_beside_walls() {
        let mut grid = CostGrid::covering([0.0, 0.0, 2.0, 1.0], 0.05);
        for k in 0..grid.costs.len() {
            let x = grid.centre((k % grid.width, k / grid.width)).x;
            grid.costs[k] = if x > 1.8 {
                BLOCKED
            } else if x > 1.0 {
                3.5
            } else if x < 0.2 {
                1.4
            } else {
                FREE
            };
        }
        let mut settled = Settled::default();
        settled.observe(Time::from_seconds(1.0), &grid, &[]);
        let cost = |x: f64| {
            settled
                .with_berth()
                .cost(grid.cell_at(Point2::new(x, 0.5)).unwrap())
        };
        for (x, expected) in [
            (0.1, 1.4),
            (0.3, FREE),
            (0.82, FREE),
            (0.87, 3.0),
            (0.98, 3.0),
            (1.02, 3.5),
        ] {
            assert!((cost(x) - expected).abs() < 1e-6, "{} at {x}", cost(x));
        }
        assert!(cost(1.9) >= BLOCKED);
    }
}
