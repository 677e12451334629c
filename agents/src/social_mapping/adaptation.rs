//! Personal space that gives way to the walls around a person, so that a robot may pass where people
//! themselves would make room (paper FD sections IV-C and V; READING.md item 3). This file owns the
//! law and its verdicts; both are closed form.
//!
//! FD's widths are *inverse*: `sigma(d) = a d^b` grows as the wall comes nearer. As a standard
//! deviation the width to a side is `d'^-b / a`, with `d' = d_s - margin` and `d_s = d - d_r`, d being
//! the distance to the wall on that side.

use super::four_sided::{FourSided, WIDTHS};
use super::limits::is_length;
use super::scene::Wall;
use nalgebra::{Isometry2, Point2, Vector2};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// Between which distances a side gives way, metres, measured from the person to what the robot
/// leaves free.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Give {
    /// At and below it the robot does not pass.
    pub least: f64,
    /// Above it nobody needs to give way.
    pub most: f64,
}

/// The figures of the adaptation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WallAdaptation {
    /// `d_r`: the robot's diameter and a safety margin, metres.
    pub clearance: f64,
    /// What of the room left stays between the zone and the robot, metres: the tables' `d' = d_s - 0.05`.
    pub margin: f64,
    /// `a` of `sigma = a d^b`.
    pub factor: f64,
    /// `b` of `sigma = a d^b`.
    pub exponent: f64,
    /// Towards a wall ahead.
    pub front: Give,
    /// Towards a wall to either side. FD prints these with those of the rear exchanged.
    pub sides: Give,
    /// Towards a wall behind.
    pub rear: Give,
}

impl Default for WallAdaptation {
    fn default() -> Self {
        Self {
            clearance: 0.8,
            margin: 0.05,
            factor: 1.2,
            exponent: -0.976,
            front: Give {
                least: 0.6,
                most: 1.3,
            },
            sides: Give {
                least: 0.5,
                most: 1.0,
            },
            rear: Give {
                least: 0.3,
                most: 0.6,
            },
        }
    }
}

/// What a wall on one side makes of the space there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Passage {
    /// There is room: the space stays, and the robot passes.
    Free,
    /// The space gives way, and the robot passes.
    Adapted {
        /// `d'`: what is left for the space, metres.
        room: f64,
        /// The width to this side as FD prints it: an inverse, 1/m.
        inverse_width: f64,
    },
    /// There is no room to give: the space stays, and the robot does not pass.
    Blocked,
}

impl Passage {
    /// Its name in the graph.
    pub fn name(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::Adapted { .. } => "adapted",
            Self::Blocked => "blocked",
        }
    }

    /// Whether the robot passes between the person and the wall.
    pub fn is_passable(self) -> bool {
        self != Self::Blocked
    }
}

impl WallAdaptation {
    /// Whether the figures make sense.
    pub fn is_valid(&self) -> bool {
        let gives = [self.front, self.sides, self.rear];
        // The width grows with the distance, so those at the ends of the range say all.
        let sound =
            |distance: f64| WIDTHS.contains(&self.inverse_width(distance - self.margin).recip());
        self.exponent < 0.0
            && is_length(self.clearance)
            && is_length(self.margin)
            && gives.iter().all(|give| {
                give.least > self.margin
                    && give.least <= give.most
                    && is_length(give.most)
                    && sound(give.least)
                    && sound(give.most)
            })
    }

    /// The figures of the front, left, rear and right.
    fn gives(&self) -> [Give; 4] {
        [self.front, self.sides, self.rear, self.sides]
    }

    /// `sigma(d) = a d^b`, FD's inverse width, 1/m.
    pub fn inverse_width(&self, room: f64) -> f64 {
        self.factor * room.powf(self.exponent)
    }

    /// What walls at these distances (front, left, rear, right; metres, infinite without a wall) make
    /// of a space.
    pub fn passages(&self, distances: [f64; 4]) -> [Passage; 4] {
        let gives = self.gives();
        std::array::from_fn(|side| {
            let free = distances[side] - self.clearance;
            // FD's figures are round, and their differences are not.
            let below = |limit: f64| free <= limit + 1e-9;
            if below(gives[side].least) {
                Passage::Blocked
            } else if below(gives[side].most) {
                let room = free - self.margin;
                Passage::Adapted {
                    room,
                    inverse_width: self.inverse_width(room),
                }
            } else {
                Passage::Free
            }
        })
    }

    /// `shape` as far as walls at these distances leave it: a side that gives way is never wider
    /// than it was.
    #[must_use]
    pub fn adapt(&self, shape: FourSided, distances: [f64; 4]) -> FourSided {
        let (passages, sides) = (self.passages(distances), shape.sides());
        FourSided::from_sides(std::array::from_fn(|side| match passages[side] {
            Passage::Adapted { inverse_width, .. } => sides[side].min(1.0 / inverse_width),
            Passage::Free | Passage::Blocked => sides[side],
        }))
    }
}

/// How far from a person the nearest wall is ahead, to the left, behind and to the right, metres;
/// infinite where there is none. Linear in the walls.
pub fn wall_distances(world_from_person: &Isometry2<f64>, walls: &[Wall]) -> [f64; 4] {
    let origin = Point2::from(world_from_person.translation.vector);
    std::array::from_fn(|side| {
        let ahead = Isometry2::rotation(side as f64 * FRAC_PI_2) * Vector2::x();
        let direction = world_from_person.rotation * ahead;
        walls
            .iter()
            .filter_map(|wall| hit(origin, direction, wall))
            .fold(f64::INFINITY, f64::min)
    })
}

/// How far along a ray it meets a wall.
fn hit(origin: Point2<f64>, direction: Vector2<f64>, [a, b]: &Wall) -> Option<f64> {
    let along = b - a;
    let across = direction.perp(&along);
    let to = a - origin;
    let distance = to.perp(&along) / across;
    let share = to.perp(&direction) / across;
    (distance >= 0.0 && (0.0..=1.0).contains(&share)).then_some(distance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FAR: f64 = f64::INFINITY;

    #[test]
    fn a_wall_ahead_narrows_the_space_as_the_paper_prints() {
        let law = WallAdaptation::default();
        // FD Table I.
        for (distance, printed) in [(1.95, 1.10), (1.75, 1.34), (1.65, 1.50), (1.45, 1.99)] {
            let [front, rest @ ..] = law.passages([distance, FAR, FAR, FAR]);
            let Passage::Adapted { inverse_width, .. } = front else {
                panic!("{front:?}");
            };
            assert!((inverse_width - printed).abs() < 0.015, "{inverse_width}");
            assert_eq!(rest, [Passage::Free; 3]);
        }
        let front = |distance| law.passages([distance, FAR, FAR, FAR])[0];
        assert_eq!(front(2.5), Passage::Free);
        assert_eq!(front(2.11), Passage::Free);
        assert_eq!(front(1.4), Passage::Blocked);
        assert!(!front(1.35).is_passable());
    }

    #[test]
    fn walls_are_found_in_the_four_directions() {
        let pose = Isometry2::new(Vector2::new(1.0, 1.0), FRAC_PI_2);
        let square =
            [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)].map(|(x, y)| Point2::new(x, y));
        let walls: Vec<Wall> = (0..4).map(|i| [square[i], square[(i + 1) % 4]]).collect();
        let found = wall_distances(&pose, &walls);
        for (distance, expected) in found.into_iter().zip([2.0, 1.0, 1.0, 3.0]) {
            assert!((distance - expected).abs() < 1e-12, "{found:?}");
        }
        assert!(wall_distances(&pose, &[]).iter().all(|d| d.is_infinite()));
    }

    proptest! {
        #[test]
        fn a_nearer_wall_never_widens_a_space(
            front in 0.1..4.0f64, left in 0.1..4.0f64, rear in 0.1..4.0f64, right in 0.1..4.0f64,
        ) {
            let law = WallAdaptation::default();
            let shape = law.adapt(FourSided::HALL, [front, left, rear, right]);
            prop_assert!(shape.is_valid());
            for (is, was) in shape.sides().into_iter().zip(FourSided::HALL.sides()) {
                prop_assert!(is <= was);
            }
        }
    }
}
