//! Recordings: what happened in an instance, as one MCAP file that Foxglove opens, that other
//! programs read, and that can be played again. This module owns the topics and what each holds.
//! It guarantees that what was recorded and is played again is the same graph, or says where it is not.

mod channels;
mod digest;
mod draw;
mod file;
mod follow;
mod live;
mod play;
mod read;
mod replayed;
mod scene;

use agents::messages::{DETECTIONS, LASER, ODOMETRY, SPEECH, VELOCITY};
pub(crate) use follow::{Recorder, follow};
pub(crate) use live::Live;
pub(crate) use play::{Heap, Player, Target, Verdict, end, played};
pub(crate) use read::{Item, PlayError, Recording, is_recording};

/// The whole graph: at the start, and again where commits were missed.
const SNAPSHOT: &str = "/graph/snapshot";
/// Each commit.
const COMMITS: &str = "/graph/commits";
/// A digest of the whole graph as of a version.
const DIGEST: &str = "/graph/digest";
/// Missions with their plans.
const MISSIONS: &str = "/missions";
/// Every pose of the graph.
const TRANSFORMS: &str = "/tf";
/// Walls, people with zones, groups, objects with their spaces.
const SCENE: &str = "/scene";
/// What each cell of the social map costs.
const SOCIAL_GRID: &str = "/social_grid";
/// What the robot still has to go.
const PATH: &str = "/path";
/// What the laser measures.
const LASER_SCAN: &str = "/laser";
/// Every tick of the world's clock.
const CLOCK: &str = "/clock";
/// The channels whose messages are recorded, each with its topic.
const CHANNELS: [(&str, &str); 5] = [
    (DETECTIONS, "/channel/detections"),
    (LASER, "/channel/laser"),
    (ODOMETRY, "/channel/odometry"),
    (VELOCITY, "/channel/velocity"),
    (SPEECH, "/channel/speech"),
];
/// Which rules were applied, and what became of missions and steps.
const LOG: &str = "/log";
