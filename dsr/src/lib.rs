//! The shared graph.
mod time;
pub use time::Time;
