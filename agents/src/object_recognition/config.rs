//! The figures of object recognition.

use serde::{Deserialize, Serialize};

/// How objects are recognised. Metres, radians, seconds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Standard deviation of a detected position along each axis, m.
    pub position_noise: f64,
    /// Standard deviation of a detected heading, rad.
    pub heading_noise: f64,
    /// How fast the variance of a place grows while nobody looks, m^2/s: furniture is nudged. 1e-5
    /// is 6 cm after five minutes.
    pub drift: f64,
    /// The same for headings, rad^2/s.
    pub heading_drift: f64,
    /// The position's standard deviation falls no further than this, m, so that an object that is
    /// pushed slowly is still followed.
    pub least_spread: f64,
    /// Detections with a smaller score are not looked at.
    pub least_score: f64,
    /// A detection without identity belongs to an object of its class within this distance, m.
    pub gate: f64,
    /// A detection further from the object than this many standard deviations says that it moved.
    pub moved_deviations: f64,
    /// So many detections in a row that agree on another place move the object there.
    pub moved_sightings: u32,
    /// Hits within `confirmation_looks` looks that make an object of detections without identity,
    /// and so many to confirm one with identity: a marker is not read by chance twice.
    pub confirmation_hits: u32,
    /// See `confirmation_hits`.
    pub identified_hits: u32,
    /// Looks considered for confirmation, at most 32.
    pub confirmation_looks: u32,
    /// So many looks in vain at its place, and an object of a class of which a new one stands
    /// elsewhere is taken to be that one.
    pub moved_looks: u32,
    /// Candidates unseen for so long are dropped, s.
    pub tentative_time: f64,
    /// Probability that an object in view is detected. Lower than a detector's own figure: what
    /// hides an object hides it for many looks in a row.
    pub detection_probability: f64,
    /// Probability that a detection is where no such object is.
    pub false_probability: f64,
    /// A look in vain counts at most once in this time, s.
    pub look_period: f64,
    /// A body within this distance of the line of sight hides an object, m.
    pub body_radius: f64,
    /// Below this confidence an object without identity is forgotten.
    pub least_confidence: f64,
    /// Looks are never so bad that confidence falls below this for an object with identity: it is
    /// somewhere, and this was its last place.
    pub identity_confidence: f64,
    /// How far inside the border of a view an object's centre must be, beyond its own half
    /// diagonal, to count as looked at, m.
    pub view_margin: f64,
    /// How far outside a room an object in it must get to have left it, m.
    pub room_margin: f64,
    /// Where objects may be.
    pub memory: MemoryConfig,
}

/// The figures of the memory of places, whose law `object_recognition/memory.rs` states.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MemoryConfig {
    /// How long an object stays where it is before somebody takes it elsewhere, on average, s: until it is learned of
    /// that object.
    pub stay: f64,
    /// How fast that is learned; 0: never.
    pub stay_rate: f64,
    /// Found again where it was after nobody saw it for longer than this, an object was found once more, s.
    pub visit_gap: f64,
    /// Probability that a look at the object's place detects it. Lower than a detector's own figure:
    /// what hides an object hides it for many looks in a row.
    pub detection_probability: f64,
    /// Probability that a detection of the object is none of it.
    pub false_probability: f64,
    /// Of the probability that the object is somewhere unknown, the share that a new place begins
    /// with.
    pub new_place: f64,
    /// Sightings this near to each other are at one place, m.
    pub same_place: f64,
    /// So many places are remembered; a new one takes the place of the least visited.
    pub most_places: usize,
}

impl Default for MemoryConfig {
    fn default() -> Self {
        Self {
            stay: 3600.0,
            stay_rate: 0.2,
            visit_gap: 600.0,
            detection_probability: 0.5,
            false_probability: 0.05,
            new_place: 0.1,
            same_place: 0.5,
            most_places: 8,
        }
    }
}

impl Default for Config {
    fn default() -> Self {
        Self {
            position_noise: 0.1,
            heading_noise: 0.15,
            drift: 1e-5,
            heading_drift: 1e-5,
            least_spread: 0.015,
            least_score: 0.1,
            gate: 0.6,
            moved_deviations: 3.5,
            moved_sightings: 3,
            confirmation_hits: 5,
            identified_hits: 2,
            confirmation_looks: 8,
            moved_looks: 15,
            tentative_time: 2.0,
            detection_probability: 0.5,
            false_probability: 0.1,
            look_period: 0.3,
            body_radius: 0.35,
            least_confidence: 0.05,
            identity_confidence: 0.1,
            view_margin: 0.2,
            room_margin: 0.2,
            memory: MemoryConfig::default(),
        }
    }
}
