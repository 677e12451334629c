//! Values that are too large for the graph: grids, scans, images. They lie in shared memory of their
//! own, and the graph holds a handle. This file owns the handle and the numbers that a large value
//! consists of, and guarantees that a handle which says something impossible is told from one that
//! does not; it knows no process.

use crate::SchemaError;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Dimensions that a shape can have.
pub(crate) const DIMENSIONS: usize = 4;
/// Words of a handle in the arena.
pub(crate) const HANDLE_WORDS: usize = 3 + DIMENSIONS / 2;

/// Which large value an attribute has: what the graph holds of it.
///
/// [`Session::read_large`](crate::Session::read_large) gives the value itself, as long as there is
/// one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct LargeHandle {
    stream: u64,
    sequence: u64,
    bytes: u64,
    /// From the slowest to the fastest; 0 where there are no more.
    shape: [u32; DIMENSIONS],
}

impl LargeHandle {
    /// The handle of the `sequence`th value of a stream, of so many bytes; `None` where the shape
    /// has more than four dimensions, or one of 0.
    pub fn new(stream: u64, sequence: u64, bytes: u64, shape: &[u32]) -> Option<Self> {
        let mut dimensions = [0; DIMENSIONS];
        dimensions.get_mut(..shape.len())?.copy_from_slice(shape);
        (!shape.contains(&0)).then_some(Self {
            stream,
            sequence,
            bytes,
            shape: dimensions,
        })
    }

    /// The row of values that it is one of: the life of one owner of one attribute.
    pub fn stream(&self) -> u64 {
        self.stream
    }

    /// The how-manyeth value of its stream it is, from 1.
    pub fn sequence(&self) -> u64 {
        self.sequence
    }

    /// How long the value is.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// How many numbers it has along each dimension, the fastest last, such as rows and columns; empty
    /// where its owner said nothing.
    pub fn shape(&self) -> &[u32] {
        let used = self.shape.iter().take_while(|&&length| length > 0).count();
        &self.shape[..used]
    }

    /// Whether its length is that of whole numbers of that kind, as many as its shape says.
    pub fn is_of(&self, kind: NumberKind) -> bool {
        let size = kind.size() as u64;
        let mut lengths = self.shape().iter().map(|&length| u64::from(length));
        let count = lengths.try_fold(1, u64::checked_mul);
        let agrees = count.and_then(|count| count.checked_mul(size)) == Some(self.bytes);
        self.bytes.is_multiple_of(size) && (self.shape().is_empty() || agrees)
    }

    /// As the arena and a value's own memory hold it.
    pub(crate) fn to_words(self) -> [u64; HANDLE_WORDS] {
        let [a, b, c, d] = self.shape.map(u64::from);
        [
            self.stream,
            self.sequence,
            self.bytes,
            a | b << 32,
            c | d << 32,
        ]
    }

    pub(crate) fn from_words(words: [u64; HANDLE_WORDS]) -> Self {
        let [stream, sequence, bytes, first, second] = words;
        let halves = |word: u64| [word as u32, (word >> 32) as u32];
        let ([a, b], [c, d]) = (halves(first), halves(second));
        Self {
            stream,
            sequence,
            bytes,
            shape: [a, b, c, d],
        }
    }
}

impl fmt::Display for LargeHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes", self.bytes)?;
        if !self.shape().is_empty() {
            let lengths: Vec<String> = self.shape().iter().map(u32::to_string).collect();
            write!(f, ", {}", lengths.join(" x "))?;
        }
        write!(f, ", number {} of {:016x}", self.sequence, self.stream)
    }
}

/// What a large value consists of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[allow(
    missing_docs,
    reason = "each is the kind of the number type of the same name"
)]
pub enum NumberKind {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

impl NumberKind {
    /// All kinds.
    pub const ALL: [Self; 10] = [
        Self::U8,
        Self::I8,
        Self::U16,
        Self::I16,
        Self::U32,
        Self::I32,
        Self::U64,
        Self::I64,
        Self::F32,
        Self::F64,
    ];

    /// The kind's name in schema files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::U64 => "u64",
            Self::I64 => "i64",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// The kind of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Bytes of a number.
    pub const fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }
}

impl fmt::Display for NumberKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

mod sealed {
    pub trait Sealed {}
}

/// A number type that large values can be read and written as: every bit pattern is a value of it.
pub trait Number: Copy + Send + Sync + sealed::Sealed + 'static {
    /// Which.
    const KIND: NumberKind;
}

macro_rules! numbers {
    ($($type:ty => $kind:ident),* $(,)?) => {$(
        impl sealed::Sealed for $type {}
        impl Number for $type {
            const KIND: NumberKind = NumberKind::$kind;
        }
    )*};
}
numbers!(u8 => U8, i8 => I8, u16 => U16, i16 => I16, u32 => U32, i32 => I32, u64 => U64, i64 => I64,
    f32 => F32, f64 => F64);

/// What the schema says of an attribute with large values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct LargeType {
    /// What its values consist of.
    pub of: NumberKind,
    /// How long a value can be.
    pub max_bytes: u64,
}

impl LargeType {
    /// The length that a schema can allow at the most: 1 GiB.
    pub const MAX_BYTES: u64 = 1 << 30;

    /// Whether a value of an attribute of this type may be what the handle says.
    ///
    /// # Errors
    /// [`SchemaError::TooLarge`], [`SchemaError::WrongShape`].
    pub(crate) fn check(&self, attribute: &str, handle: &LargeHandle) -> Result<(), SchemaError> {
        let attribute = || attribute.to_owned();
        if handle.bytes > self.max_bytes {
            return Err(SchemaError::TooLarge {
                attribute: attribute(),
                max_bytes: self.max_bytes,
                bytes: handle.bytes,
            });
        }
        if !handle.is_of(self.of) {
            return Err(SchemaError::WrongShape {
                attribute: attribute(),
                of: self.of,
                handle: *handle,
            });
        }
        Ok(())
    }
}

impl Default for LargeType {
    /// Bytes, 16 MiB of them at the most.
    fn default() -> Self {
        Self {
            of: NumberKind::U8,
            max_bytes: 16 << 20,
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;

    pub(crate) fn handle() -> impl Strategy<Value = LargeHandle> {
        let shape = prop::collection::vec(1..u32::MAX, 0..=DIMENSIONS);
        (any::<[u64; 3]>(), shape).prop_map(|([stream, sequence, bytes], shape)| {
            LargeHandle::new(stream, sequence, bytes, &shape).unwrap()
        })
    }

    #[test]
    fn a_handle_tells_its_shape_and_survives_the_way_through_words() {
        let handle = LargeHandle::new(u64::MAX, 7, 24, &[2, 3]).unwrap();
        assert_eq!(LargeHandle::from_words(handle.to_words()), handle);
        assert_eq!(handle.shape(), [2, 3]);
        let text = handle.to_string();
        assert_eq!(text, "24 bytes, 2 x 3, number 7 of ffffffffffffffff");
        assert_eq!(LargeHandle::new(1, 1, 0, &[2, 0]), None);
        assert_eq!(LargeHandle::new(1, 1, 0, &[1; 5]), None);
    }

    #[test]
    fn a_length_that_is_not_the_shapes_is_noticed() {
        let of = |bytes, shape: &[u32]| LargeHandle::new(1, 1, bytes, shape).unwrap();
        assert!(of(24, &[2, 3]).is_of(NumberKind::F32));
        assert!(!of(24, &[2, 3]).is_of(NumberKind::F64));
        assert!(of(24, &[]).is_of(NumberKind::F64));
        assert!(!of(25, &[]).is_of(NumberKind::I16));
        assert!(!of(0, &[u32::MAX; 4]).is_of(NumberKind::U64), "overflows");
    }
}
