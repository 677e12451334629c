//! Takes the robot where its task says: a path on the social grid, an elastic band, and control.
pub mod anticipation;
pub mod band;
pub mod control;
pub mod graph;
pub mod ground;
pub mod navigator;
pub mod obstacles;
pub mod path;
pub mod people;
mod planner;
mod settled;
pub mod target;
#[cfg(test)]
mod testing;
