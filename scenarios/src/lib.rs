//! Everything around a run that is not an agent: the scenario folder and its diagnostics, the
//! world simulator that moves robot and people and makes sensor readings, recorded pedestrians,
//! and the graph that a run begins with.
//!
//! Nothing here reads a clock or starts a process: a scenario is data, and the world is a function
//! of scenario, seed and inputs.
#![forbid(unsafe_code)]

pub mod grid_file;
mod initial_graph;
pub mod metrics;
pub mod picture;
pub mod process;
pub mod report;
mod resume;
pub mod scenario;
pub mod scenes;
pub mod situation;
pub mod tracks;
pub mod trial;
pub mod world;

pub use initial_graph::{WORLD, activity_attributes, initial_graph, schema};
pub use resume::{ResumeError, check_scenario, resume};
pub use scenario::{LoadError, Scenario};
pub use tracks::{Tracks, TracksError};
pub use world::{Inputs, Outputs, Truth, World};
