//! What goes in and out of the observer beside camera frames: the surroundings people are related
//! to, and the scene of people it makes of them.

use crate::perception::FloorPlan;
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};
use std::collections::BTreeMap;

/// What people are related to. World frame, metres, radians.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Surroundings {
    /// Rooms and walls.
    pub plan: FloorPlan,
    /// Where the robot is, if known.
    pub world_from_robot: Option<Isometry2<f64>>,
    /// The objects people may interact with, in order of name.
    pub objects: Vec<Object>,
}

/// An object as far as people are concerned.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Its unique name.
    pub name: String,
    /// What it is, a type of the schema such as `table`.
    pub class: String,
    /// Where it is and faces.
    pub world_from_object: Isometry2<f64>,
    /// The outline of its footprint.
    pub shape: Shape,
    /// Extent along its own x and y, m; a circle's diameter is the first.
    pub size: Vector2<f64>,
    /// Its affordance space as a closed outline, empty where none is known.
    pub space: Vec<Point2<f64>>,
}

/// The outline of an object on the floor, centred on its pose.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Shape {
    /// As long and wide as its size says.
    #[default]
    Rectangle,
    /// As wide as the size's first figure.
    Circle,
}

/// The people there are, at one time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Scene {
    /// In order of id.
    pub people: Vec<TrackedPerson>,
    /// The room each person is in, where there is one.
    pub in_room: BTreeMap<u64, String>,
    /// People near the robot.
    pub near_robot: Vec<u64>,
    /// Pairs of people who interact, the smaller id first.
    pub interacting: Vec<(u64, u64)>,
    /// People who interact with objects.
    pub interacting_with: Vec<(u64, String)>,
    /// People who face the robot from near.
    pub front: Vec<u64>,
}

impl Scene {
    /// The person with `id`.
    pub fn find(&self, id: u64) -> Option<&TrackedPerson> {
        self.people
            .binary_search_by_key(&id, |p| p.id)
            .ok()
            .map(|index| &self.people[index])
    }
}

/// A person, as believed at the scene's time.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackedPerson {
    /// Given once and never again.
    pub id: u64,
    /// Where the person is and faces, world frame. The heading is 0 until something tells it.
    pub pose: Isometry2<f64>,
    /// World frame, m/s.
    pub velocity: Vector2<f64>,
    /// Of the position: xx, xy, yy, m^2.
    pub covariance: [f64; 3],
    /// Probability that there is such a person, in [0, 1].
    pub confidence: f64,
    /// When a camera last saw the person.
    pub last_seen: Time,
}

impl TrackedPerson {
    /// Where the person stands, world frame.
    pub fn position(&self) -> Point2<f64> {
        Point2::from(self.pose.translation.vector)
    }

    /// The angle between where the person faces and the direction to `point`, in [0, pi]. 0 where
    /// the person stands on it.
    pub fn angle_to(&self, point: Point2<f64>) -> f64 {
        let seen = self.pose.inverse_transform_point(&point);
        if seen.coords.norm() < 1e-9 {
            0.0
        } else {
            seen.y.atan2(seen.x).abs()
        }
    }
}

impl Object {
    /// The point of the footprint nearest to `point`, world frame; `point` itself inside.
    pub fn nearest(&self, point: Point2<f64>) -> Point2<f64> {
        let local = self.world_from_object.inverse_transform_point(&point);
        let nearest = match self.shape {
            Shape::Rectangle => {
                let half = self.size.abs() / 2.0;
                Point2::new(
                    local.x.clamp(-half.x, half.x),
                    local.y.clamp(-half.y, half.y),
                )
            }
            Shape::Circle => {
                let radius = self.size.x.abs() / 2.0;
                let distance = local.coords.norm();
                if distance <= radius {
                    local
                } else {
                    local * (radius / distance)
                }
            }
        };
        self.world_from_object * nearest
    }
}
