//! The agents that perceive, map and move: pure cores, and thin processes around them.
#![forbid(unsafe_code)]

pub mod grid;
pub mod human_observer;
pub mod messages;
pub mod names;
pub mod navigation;
pub mod object_recognition;
pub mod perception;
pub mod process;
pub mod social_mapping;
