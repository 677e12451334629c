//! Missions: planning, monitoring, replanning.
//!
//! [`plan`] finds the steps from what holds in a snapshot of the graph to what a goal asks for, by
//! the rules of a grammar, or says why there are none. [`Executive`] carries missions out: it
//! writes them and the steps of their plans into the graph, dispatches one step at a time to the
//! agent that its rule names, watches the left-hand sides of what is to come and the effects of
//! what is done, and plans anew where the world took another course. It knows no agent: the graph
//! is all that they share. Only [`process`] knows processes and turns.
#![forbid(unsafe_code)]

mod ground;
mod mission;
mod monitor;
pub mod pddl;
mod plan;
pub mod process;
mod purpose;
mod search;
pub mod task;
#[cfg(test)]
mod testing;

pub use mission::{
    Cause, Config, Decision, Entry, Executive, Mission, MissionSpec, MissionStatus, MissionStep,
    Planner, Preemption, Request, RulePlanner, Schedule, StepStatus, experience, missions,
    missions_with_steps, steps,
};
pub use plan::{Options, Outcome, Raised, Status, Step, plan};
pub use purpose::{Purpose, obstacle, purposes};
pub use search::{Answer, Effort, Limits, Milestones, Reachability, StopReason, search};
