//! Missions: planning, monitoring, replanning.
#![forbid(unsafe_code)]

mod search;
pub mod task;

pub use search::{Answer, Effort, Limits, Reachability, StopReason, search};
