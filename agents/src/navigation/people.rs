//! The people around the robot, where they will be, and how deep a place lies in their space.
//! This file guarantees that a place's zone is exactly the one that the metrics count it to.

use crate::social_mapping::{AsymmetricGaussian, CooperationZone};
use nalgebra::{Isometry2, Point2, Vector2};

/// The shape of every personal space.
const SPACE: AsymmetricGaussian = AsymmetricGaussian::HALL;

/// Below this squared deviation a place lies in the intimate space: density 0.9 (READING.md item 6).
pub const INTIMATE: f64 = 0.210_721_031_315_652_6;
/// Below this one in the personal space: density 0.5.
pub const PERSONAL: f64 = 1.386_294_361_119_890_6;
/// Below this one in the social space: density 0.1.
pub const SOCIAL: f64 = 4.605_170_185_988_091;

/// From this speed on somebody counts as walking, m/s; slower motion is tracking noise.
pub const WALKING: f64 = 0.3;

/// Somebody near the robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Person {
    /// The name of the person's node.
    pub name: String,
    /// Where the person stands and faces.
    pub world_from_person: Isometry2<f64>,
    /// How the person moves, world frame, m/s.
    pub velocity: Vector2<f64>,
    /// Radius of the body, metres.
    pub radius: f64,
}

impl Person {
    /// Where the person stands.
    pub fn position(&self) -> Point2<f64> {
        self.world_from_person.translation.vector.into()
    }

    /// Where the person will be in `seconds`, walking on as now; who stands remains.
    pub fn predicted(&self, seconds: f64) -> Presence {
        let walking = self.velocity.norm() >= WALKING;
        let ahead = if walking {
            self.velocity * seconds
        } else {
            Vector2::zeros()
        };
        let rotation = self.world_from_person.rotation;
        Presence {
            position: self.position() + ahead,
            facing: Vector2::new(rotation.re, rotation.im),
            radius: self.radius,
        }
    }

    /// Whether the person walks rather than stands.
    pub fn is_walking(&self) -> bool {
        self.velocity.norm() >= WALKING
    }
}

/// A person at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Presence {
    /// Where.
    pub position: Point2<f64>,
    /// Unit vector of where the person faces.
    pub facing: Vector2<f64>,
    /// Radius of the body, metres.
    pub radius: f64,
}

impl Presence {
    /// How far `place` is from the person in standard deviations of their space, squared: compare
    /// with [`INTIMATE`], [`PERSONAL`] and [`SOCIAL`].
    pub fn squared_deviation(&self, place: Point2<f64>) -> f64 {
        SPACE.squared_deviation(self.own_frame(place))
    }

    /// The direction, not normalised, in which [`Presence::squared_deviation`] grows fastest.
    pub fn gradient(&self, place: Point2<f64>) -> Vector2<f64> {
        let place = self.own_frame(place);
        let along = if place.x >= 0.0 {
            SPACE.front
        } else {
            SPACE.rear
        };
        let left = Vector2::new(-self.facing.y, self.facing.x);
        self.facing * (place.x / along.powi(2)) + left * (place.y / SPACE.side.powi(2))
    }

    /// Whether `place` lies where the person wants a robot that comes to talk (AP 2.2).
    pub fn wants_at(&self, place: Point2<f64>) -> bool {
        CooperationZone::AHEAD.contains(self.own_frame(place))
    }

    /// `place` as the person sees it: x ahead, y to the left.
    fn own_frame(&self, place: Point2<f64>) -> Point2<f64> {
        let offset = place - self.position;
        Point2::new(offset.dot(&self.facing), self.facing.perp(&offset))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn halls_distances_come_out_ahead_aside_and_behind() {
        let person = Person {
            name: "ana".into(),
            world_from_person: Isometry2::new(Vector2::new(2.0, 1.0), FRAC_PI_2),
            velocity: Vector2::new(0.0, 1.0),
            radius: 0.25,
        };
        let now = person.predicted(0.0);
        for (offset, limit) in [
            ((0.0, 1.177), PERSONAL),
            ((0.883, 0.0), PERSONAL),
            ((0.0, -0.589), PERSONAL),
            ((0.0, 0.459), INTIMATE),
            ((0.0, 2.146), SOCIAL),
        ] {
            let offset = Vector2::new(offset.0, offset.1);
            let at = |share: f64| now.squared_deviation(now.position + offset * share);
            assert!(at(0.99) < limit && at(1.01) > limit, "{offset:?}");
        }
        let later = person.predicted(2.0);
        assert!((later.position - Point2::new(2.0, 3.0)).norm() < 1e-12);
    }

    #[test]
    fn the_gradient_is_the_slope_of_the_deviation() {
        let now = Presence {
            position: Point2::new(0.3, -0.2),
            facing: Vector2::new(0.6, 0.8),
            radius: 0.25,
        };
        for place in [
            Point2::new(1.0, 1.0),
            Point2::new(-0.5, -0.7),
            Point2::new(0.9, -0.9),
        ] {
            let slope = |step: Vector2<f64>| {
                (now.squared_deviation(place + step) - now.squared_deviation(place - step)) / 2e-6
            };
            let numeric = Vector2::new(slope(Vector2::x() * 1e-6), slope(Vector2::y() * 1e-6));
            assert!((numeric - 2.0 * now.gradient(place)).norm() < 1e-6);
        }
    }
}
