//! Missions: planning, monitoring, replanning.
#![forbid(unsafe_code)]

mod ground;
mod plan;
mod search;
pub mod task;
#[cfg(test)]
mod testing;

pub use plan::{Options, Outcome, Raised, Status, Step, plan};
pub use search::{Answer, Effort, Limits, Reachability, StopReason, search};
