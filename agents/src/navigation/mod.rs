//! Takes the robot where its task says: a path on the social grid, an elastic band, and control.
pub mod path;
