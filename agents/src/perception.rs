//! What the agents that perceive share: angles, who a camera can see, which room a point lies in,
//! and optimal assignment. Everything here is a pure function of its arguments, so two runs on the
//! same detections agree to the bit.

mod angle;
mod assignment;
mod floor_plan;
pub(crate) mod graph;
mod view;

pub use angle::{HeadingEstimate, circular_mean, difference, wrap};
pub use assignment::{Pair, assign};
pub use floor_plan::FloorPlan;
pub(crate) use floor_plan::{distance_to_polygon, polygon};
pub use view::{hides, in_time_order, is_finite_pose, sees};

#[cfg(test)]
pub(crate) mod synthetic;
