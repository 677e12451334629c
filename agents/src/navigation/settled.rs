//! The social grid without the spaces of those who walk: they will be elsewhere when the robot gets
//! there, and a path planned round where they are now would swing about with them. Where they will
//! be is the planner's and the anticipation's business. This file guarantees that a cell outside
//! walkers' spaces costs what the newest grid says.

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

/// What the grid said of each cell when nobody last walked there.
#[derive(Debug, Clone)]
pub(super) struct Settled {
    grid: CostGrid,
    looked: Option<Time>,
    hidden: Vec<bool>,
}

impl Default for Settled {
    fn default() -> Self {
        Self {
            grid: CostGrid::covering([0.0; 4], 1.0),
            looked: None,
            hidden: Vec::new(),
        }
    }
}

impl Settled {
    /// The grid without walkers.
    pub(super) fn grid(&self) -> &CostGrid {
        &self.grid
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
        let at = |settled: &Settled, x: f64| settled.grid().cost((((x * 10.0) as usize), 50));
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
}
