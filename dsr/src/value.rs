//! What an attribute can hold. This file owns the kinds of value and their names in files and
//! messages; the arena and the wire know how to store each of them without loss.

use crate::LargeHandle;
use nalgebra::{Isometry2, Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::hash::Hasher;

/// A pose in space: the isometry `parent_from_node`, metres.
pub type Pose = Isometry3<f64>;

/// A pose on the floor as a pose in space: z = 0, turned about z.
pub fn planar_pose(pose: &Isometry2<f64>) -> Pose {
    Pose::from_parts(
        Translation3::new(pose.translation.x, pose.translation.y, 0.0),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), pose.rotation.angle()),
    )
}

/// The part of a pose that lies in the floor: x, y, and the heading about z.
pub fn pose_on_floor(pose: &Pose) -> Isometry2<f64> {
    let ahead = pose.rotation * Vector3::x();
    Isometry2::new(pose.translation.vector.xy(), ahead.y.atan2(ahead.x))
}

/// An attribute's value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Value {
    /// True or false.
    Bool(bool),
    /// A 32-bit integer.
    I32(i32),
    /// An unsigned 32-bit integer.
    U32(u32),
    /// A 64-bit integer.
    I64(i64),
    /// An unsigned 64-bit integer.
    U64(u64),
    /// A single-precision number.
    F32(f32),
    /// A number.
    F64(f64),
    /// A text.
    String(String),
    /// A fixed vector of 1 to 6 numbers.
    Vector(Vec<f64>),
    /// A fixed vector of 1 to 6 single-precision numbers.
    F32Vector(Vec<f32>),
    /// A list of numbers of any length.
    F64List(Vec<f64>),
    /// A list of single-precision numbers of any length.
    F32List(Vec<f32>),
    /// Bytes.
    U8List(Vec<u8>),
    /// A list of unsigned 64-bit integers.
    U64List(Vec<u64>),
    /// A pose in space.
    Pose(Pose),
    /// What leads to a value that lies beside the graph.
    Large(LargeHandle),
}

/// Which kind of [`Value`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(
    missing_docs,
    reason = "each is the kind of the value of the same name"
)]
pub enum ValueKind {
    Bool,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
    String,
    Vector,
    F32Vector,
    F64List,
    F32List,
    U8List,
    U64List,
    Pose,
    Large,
}

impl ValueKind {
    /// All kinds, in the order of their codes in the arena.
    pub const ALL: [Self; 16] = [
        Self::Bool,
        Self::I32,
        Self::U32,
        Self::I64,
        Self::U64,
        Self::F32,
        Self::F64,
        Self::String,
        Self::Vector,
        Self::F32Vector,
        Self::F64List,
        Self::F32List,
        Self::U8List,
        Self::U64List,
        Self::Pose,
        Self::Large,
    ];

    /// The kind's name in schema files, graph JSON and messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::I32 => "i32",
            Self::U32 => "u32",
            Self::I64 => "i64",
            Self::U64 => "u64",
            Self::F32 => "f32",
            Self::F64 => "f64",
            Self::String => "string",
            Self::Vector => "vector",
            Self::F32Vector => "f32_vector",
            Self::F64List => "f64_list",
            Self::F32List => "f32_list",
            Self::U8List => "u8_list",
            Self::U64List => "u64_list",
            Self::Pose => "pose",
            Self::Large => "large",
        }
    }

    /// Whether the graph can keep an index by values of this kind.
    pub const fn can_have_index(self) -> bool {
        matches!(
            self,
            Self::Bool
                | Self::I32
                | Self::U32
                | Self::I64
                | Self::U64
                | Self::F32
                | Self::F64
                | Self::String
        )
    }

    /// The kind of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// The place of a number: ascends with it, and is one for both zeros.
pub(crate) fn place(number: f64) -> u64 {
    let bits = (number + 0.0).to_bits();
    if bits >> 63 == 1 {
        !bits
    } else {
        bits | 1 << 63
    }
}

/// The hash of a name or text.
pub(crate) fn hash(text: &str) -> u64 {
    let mut hasher = rustc_hash::FxHasher::default();
    hasher.write(text.as_bytes());
    hasher.finish()
}

impl fmt::Display for ValueKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Value {
    /// Which kind of value this is.
    pub const fn kind(&self) -> ValueKind {
        match self {
            Self::Bool(_) => ValueKind::Bool,
            Self::I32(_) => ValueKind::I32,
            Self::U32(_) => ValueKind::U32,
            Self::I64(_) => ValueKind::I64,
            Self::U64(_) => ValueKind::U64,
            Self::F32(_) => ValueKind::F32,
            Self::F64(_) => ValueKind::F64,
            Self::String(_) => ValueKind::String,
            Self::Vector(_) => ValueKind::Vector,
            Self::F32Vector(_) => ValueKind::F32Vector,
            Self::F64List(_) => ValueKind::F64List,
            Self::F32List(_) => ValueKind::F32List,
            Self::U8List(_) => ValueKind::U8List,
            Self::U64List(_) => ValueKind::U64List,
            Self::Pose(_) => ValueKind::Pose,
            Self::Large(_) => ValueKind::Large,
        }
    }

    /// The value as a number, if it is a bool or a scalar number (a bool counts 0 or 1).
    pub fn as_f64(&self) -> Option<f64> {
        match *self {
            Self::Bool(b) => Some(f64::from(u8::from(b))),
            Self::I32(n) => Some(f64::from(n)),
            Self::U32(n) => Some(f64::from(n)),
            Self::I64(n) => Some(n as f64),
            Self::U64(n) => Some(n as f64),
            Self::F32(n) => Some(f64::from(n)),
            Self::F64(n) => Some(n),
            _ => None,
        }
    }

    /// Where an index has the value: numbers ascend, equal values have equal places, and a text's
    /// place is its hash. `None` for kinds that cannot have an index.
    pub(crate) fn place(&self) -> Option<u64> {
        match self {
            Self::String(text) => Some(hash(text)),
            other => other.as_f64().map(place),
        }
    }

    /// The value as truth, if it is a bool.
    pub fn as_bool(&self) -> Option<bool> {
        if let Self::Bool(b) = self {
            Some(*b)
        } else {
            None
        }
    }

    /// The value as text, if it is a string.
    pub fn as_str(&self) -> Option<&str> {
        if let Self::String(text) = self {
            Some(text)
        } else {
            None
        }
    }

    /// The value as a row of numbers, if it is an `f64` vector or list.
    pub fn as_f64s(&self) -> Option<&[f64]> {
        match self {
            Self::Vector(row) | Self::F64List(row) => Some(row),
            _ => None,
        }
    }

    /// The value as a pose, if it is one.
    pub fn as_pose(&self) -> Option<&Pose> {
        if let Self::Pose(pose) = self {
            Some(pose)
        } else {
            None
        }
    }

    /// The value as the handle of a large value, if it is one.
    pub fn as_large(&self) -> Option<&LargeHandle> {
        if let Self::Large(handle) = self {
            Some(handle)
        } else {
            None
        }
    }
}

macro_rules! from {
    ($($type:ty => $variant:ident),* $(,)?) => {$(
        impl From<$type> for Value {
            fn from(value: $type) -> Self {
                Self::$variant(value)
            }
        }
    )*};
}
from!(bool => Bool, i64 => I64, u64 => U64, f64 => F64, String => String, Pose => Pose,
    LargeHandle => Large);

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::String(text.to_owned())
    }
}

impl<const N: usize> From<[f64; N]> for Value {
    fn from(row: [f64; N]) -> Self {
        Self::Vector(row.to_vec())
    }
}

/// A pose on the floor.
impl From<Isometry2<f64>> for Value {
    fn from(pose: Isometry2<f64>) -> Self {
        Self::Pose(planar_pose(&pose))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_on_the_floor_survives_the_way_to_space_and_back() {
        for heading in [-3.1, -1.0, 0.0, 0.5, 3.1] {
            let pose = Isometry2::new(nalgebra::Vector2::new(1.5, -2.0), heading);
            let back = pose_on_floor(&planar_pose(&pose));
            assert!((back.translation.vector - pose.translation.vector).norm() < 1e-12);
            assert!((back.rotation.angle() - heading).abs() < 1e-12);
        }
    }

    #[test]
    fn every_kind_has_a_name_of_its_own_that_leads_back_to_it() {
        for kind in ValueKind::ALL {
            assert_eq!(ValueKind::from_name(kind.name()), Some(kind));
        }
    }
}
