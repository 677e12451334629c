//! The agents that perceive, map and move: pure cores, and thin processes around them.
#![forbid(unsafe_code)]

pub mod grid;
pub mod messages;
pub mod social_mapping;
