//! Takes the robot where its task says, among people, without walking into their space.
//!
//! Three layers, as in paper TD 5.3: a path on the social grid ([`path`]), an elastic band along it
//! ([`band`]) and control of the base ([`control`]). Beyond the paper, [`anticipation`] chooses
//! between manoeuvres by where people will be. [`navigator`] puts them together as a pure core, and
//! [`graph`] lets that core carry out the steps which the executive dispatches. Nothing here reads a
//! clock or sends a message, and the laser alone can stop the robot.

pub mod anticipation;
pub mod band;
pub mod control;
pub mod graph;
pub mod ground;
pub mod map_age;
pub mod navigator;
pub mod obstacles;
pub mod path;
pub mod people;
mod planner;
mod settled;
pub mod target;
#[cfg(test)]
mod testing;
