//! What the world and the agents send each other beside the graph: sensor readings, commands and
//! the social grid. This file owns the shape of each message and the name of its channel; a real
//! camera, laser or base speaks the same messages, so it replaces the simulator without touching
//! an agent.
//!
//! Frames: `world` is the map's frame (x east, y north); a camera or robot frame has x forward and
//! y left. Poses are named target-from-source. Metres, radians, seconds.

use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};
use serde::{Deserialize, Serialize};

/// Channel of [`CameraFrame`].
pub const DETECTIONS: &str = "detections";
/// Channel of [`LaserScan`].
pub const LASER: &str = "laser";
/// Channel of [`Odometry`].
pub const ODOMETRY: &str = "odometry";
/// Channel of [`VelocityCommand`].
pub const VELOCITY: &str = "velocity";
/// Channel of [`Speech`].
pub const SPEECH: &str = "speech";

/// All that one camera's detectors found in one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraFrame {
    /// The camera's name, unique in the world.
    pub camera: String,
    /// When the image was taken.
    pub time: Time,
    /// Where the camera was.
    pub world_from_camera: Isometry2<f64>,
    /// Full horizontal opening angle, in (0, 2 pi].
    pub field_of_view: f64,
    /// How far the detectors see.
    pub range: f64,
    /// People found, in no order.
    pub people: Vec<PersonDetection>,
    /// Objects found, in no order.
    pub objects: Vec<ObjectDetection>,
}

/// One person in one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PersonDetection {
    /// Centre of the body on the floor, camera frame.
    pub position: Point2<f64>,
    /// Where the body faces, camera frame, where the detector can tell.
    pub heading: Option<f64>,
    /// The detector's confidence, in [0, 1].
    pub score: f64,
    /// How the person looks, as a network for re-identification writes it: a direction of any number of
    /// dimensions, the same for all cameras of an instance. Empty where there is none.
    #[serde(default)]
    pub appearance: Vec<f32>,
}

/// One object in one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectDetection {
    /// What it is, a type name of the schema such as `table`.
    pub class: String,
    /// Which one it is, where it carries a marker that says so.
    pub identity: Option<String>,
    /// Where it is and faces.
    pub camera_from_object: Isometry2<f64>,
    /// Extent along its own x and y, metres.
    pub size: Vector2<f64>,
    /// The detector's confidence, in [0, 1].
    pub score: f64,
}

/// One turn of the robot's laser, which sits at the robot's centre.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LaserScan {
    /// When it was taken.
    pub time: Time,
    /// Direction of the first beam, robot frame.
    pub angle_min: f64,
    /// From one beam to the next, counter-clockwise.
    pub angle_step: f64,
    /// Beams that met nothing read this.
    pub range_max: f64,
    /// Distance to the first surface along each beam.
    pub ranges: Vec<f32>,
}

/// Where the robot believes it is, and how it moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Odometry {
    /// When it was measured.
    pub time: Time,
    /// The localised pose: wheel odometry corrected by the map, so its error is bounded.
    pub world_from_robot: Isometry2<f64>,
    /// Forward speed, m/s.
    pub linear: f64,
    /// Speed to the left, m/s; 0 of a differential base.
    pub lateral: f64,
    /// Turning speed, rad/s, counter-clockwise.
    pub angular: f64,
}

/// What the base shall do until the next command. The base stops by itself when none comes for 0.5 s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct VelocityCommand {
    /// When it was decided.
    pub time: Time,
    /// Forward speed, m/s.
    pub linear: f64,
    /// Speed to the left, m/s; 0 of a differential base.
    pub lateral: f64,
    /// Turning speed, rad/s, counter-clockwise.
    pub angular: f64,
}

/// Something the robot says aloud.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Speech {
    /// When it is said.
    pub time: Time,
    /// Where the person addressed stands, world frame.
    pub toward: Point2<f64>,
    /// The words.
    pub text: String,
}
