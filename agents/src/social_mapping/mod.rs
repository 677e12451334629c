//! Social mapping: how near the robot may come to people and to what they use, as a function of
//! place and time (paper TD sections 4 and 5; READING.md items 1, 2, 5, 6, 7, 9, 11).
//!
//! This module owns the models and the grid made of them. It guarantees that the grid is a pure
//! function of the scene and the time: what is updated step by step equals, bit for bit, what a
//! new mapper would draw, because layers are combined by the maximum and by nothing else.
//!
//! The map has AP's layers in AP's order, see [`Layer`].

pub mod adaptation;
pub mod comfort;
pub mod config;
pub mod density;
mod drawn;
pub mod features;
mod found;
pub mod four_sided;
pub mod gaussian;
pub mod graph;
pub mod groups;
pub mod layers;
pub mod limits;
pub mod map;
pub mod object_space;
pub mod personal;
pub mod preset;
pub mod rejection;
pub mod scene;
mod stamps;
mod visibility;
pub mod zones;

pub use comfort::{Comfort, ComfortScene};
pub use config::{ConfigError, SocialConfig};
pub use found::{FoundGroup, extent};
pub use four_sided::FourSided;
pub use gaussian::AsymmetricGaussian;
pub use graph::{SocialMapping, Turn};
pub use layers::Layer;
pub use map::{ObjectUse, PersonSpaces, SocialMapper, Update};
pub use object_space::{Agenda, Outline, Space, UsageCurve};
pub use personal::CooperationZone;
pub use rejection::Rejection;
pub use scene::{SceneError, SocialScene};
pub use zones::{Levels, Proxemics, Zone, zone_at};
