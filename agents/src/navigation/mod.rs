//! Takes the robot where its task says: a path on the social grid, an elastic band, and control.
pub mod band;
pub mod control;
pub mod obstacles;
pub mod path;
pub mod people;
