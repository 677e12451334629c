//! Missions: planned over the rules, watched while they run, and planned anew when the world does
//! not go along. Which agents carry the steps out is nothing that this package knows.
#![forbid(unsafe_code)]

mod mission;
mod monitor;
mod outcome;
pub mod process;
#[cfg(test)]
mod testing;

pub use mission::{Config, Entry, Executive, MissionSpec, MissionStatus, Planner, StepStatus};
pub use outcome::{Options, Outcome, Plan, PlanStep};
