//! The attributes of a node or an edge as they lie in its record. This file owns their layout, and
//! guarantees that decoding takes any words without a panic.
//!
//! - Table: a row per attribute, ascending: `attribute << 48 | place`. With bit 47 set, the place is
//!   how many words after the table's first the attribute lies, in the table itself; else it is the
//!   attribute's address. Small attributes lie in the table: who has found the node has them.
//! - Attribute: `kind | writer << 16 | length << 32`, version, time, then the value. With a history,
//!   bit 15 of the kind is set and a word `count << 48 | address` comes before the value: how many
//!   older values there are, and the record of the newest of them. Such a one lies in a block.

use super::record::{pack, unpack};
use super::{Address, Arena, Word};
use crate::large::{HANDLE_WORDS, LargeHandle};
use crate::value::{Pose, Value, ValueKind};
use nalgebra::{Quaternion, Translation3, UnitQuaternion};

const ATTRIBUTE_HEADER: usize = 3;
/// The largest attribute that lies in the table, in words: a pose.
const SMALL: usize = ATTRIBUTE_HEADER + 7;
/// In an attribute's kind: the record leads to older ones.
const HAS_HISTORY: u16 = 1 << 15;
const IN_TABLE: u64 = 1 << 47;
const PLACE: u64 = IN_TABLE - 1;

/// A word, of the arena or of the writer's own.
pub(crate) trait Load {
    fn get(&self) -> u64;
}

impl Load for Word {
    #[inline]
    fn get(&self) -> u64 {
        self.load()
    }
}

impl Load for u64 {
    #[inline]
    fn get(&self) -> u64 {
        *self
    }
}

/// Where an attribute lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    /// So many words after the table's first.
    InTable(usize),
    /// In a block of its own.
    At(Address),
}

/// The attribute of a row.
#[inline]
pub(crate) fn name_of(row: u64) -> u16 {
    (row >> 48) as u16
}

/// Where the attribute of a row lies.
#[inline]
pub(crate) fn place_of(row: u64) -> Place {
    if row & IN_TABLE == 0 {
        Place::At(row & PLACE)
    } else {
        Place::InTable((row & PLACE) as usize)
    }
}

/// The row of an attribute.
pub(crate) fn row(name: u16, place: Place) -> u64 {
    u64::from(name) << 48
        | match place {
            Place::At(address) => address & PLACE,
            Place::InTable(offset) => IN_TABLE | offset as u64,
        }
}

/// How many attributes a table has whose record's kind word is `kind`.
#[inline]
pub(crate) fn count(kind: u64) -> usize {
    usize::from((kind >> 16) as u16)
}

/// Where in the table at the beginning of `words` the attribute of that name lies, if it lies there.
pub(super) fn small_of(words: &[Word], kind: u64, name: u16) -> Option<std::ops::Range<usize>> {
    let words = words.get(..(kind >> 32) as usize)?;
    let mut rows = words.get(..count(kind))?.iter().map(Word::load);
    match place_of(rows.find(|&row| name_of(row) == name)?) {
        Place::At(_) => None,
        Place::InTable(offset) => {
            let end = offset + attribute_words(words.get(offset)?.load());
            (end <= words.len()).then_some(offset..end)
        }
    }
}

/// A table on its way to being written again.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Table {
    count: usize,
    words: Vec<u64>,
}

impl Table {
    /// Copies the table at the beginning of `words`.
    pub(super) fn read(words: &[Word], kind: u64) -> Option<Self> {
        let words = words.get(..(kind >> 32) as usize)?;
        let count = count(kind);
        (count <= words.len()).then(|| Self {
            count,
            words: words.iter().map(Word::load).collect(),
        })
    }

    /// How many attributes it has.
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    pub(super) fn words(&self) -> &[u64] {
        &self.words
    }

    fn rows(&self) -> &[u64] {
        &self.words[..self.count]
    }

    /// Its attributes, ascending, with their places.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (u16, Place)> {
        self.rows().iter().map(|&row| (name_of(row), place_of(row)))
    }

    /// The blocks that belong to it.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = Address> {
        self.iter().filter_map(|(_, place)| match place {
            Place::At(address) => Some(address),
            Place::InTable(_) => None,
        })
    }

    /// Where an attribute lies, if it is there.
    pub(crate) fn find(&self, name: u16) -> Option<Place> {
        let mut rows = self.iter();
        rows.find(|&(found, _)| found == name)
            .map(|(_, place)| place)
    }

    /// Decodes the attribute at `place`.
    pub(crate) fn attribute(
        &self,
        arena: &Arena,
        place: Place,
    ) -> Result<AttributeRecord, Address> {
        match place {
            Place::At(address) => AttributeRecord::read(arena, address),
            Place::InTable(offset) => self
                .words
                .get(offset..)
                .and_then(AttributeRecord::decode)
                .ok_or(0),
        }
    }

    /// Whether an attribute of so many words lies in the table.
    pub(crate) fn holds(words: usize) -> bool {
        words <= SMALL
    }

    /// Puts an attribute in the place of the one of that name. The block that belongs to the table
    /// no more, if any.
    pub(crate) fn set(&mut self, name: u16, attribute: Stored<'_>) -> Option<Address> {
        let before = self.find(name);
        if let (Some(Place::InTable(offset)), Stored::InTable(words)) = (before, attribute)
            && self.small(offset).len() == words.len()
        {
            self.words[offset..offset + words.len()].copy_from_slice(words);
            return None;
        }
        let others = std::mem::take(self);
        let at = others
            .rows()
            .partition_point(|&found| name_of(found) < name);
        let after = at + usize::from(before.is_some());
        self.words.reserve(others.words.len() + 1 + SMALL);
        let rows = |range: std::ops::Range<usize>| &others.words[range];
        self.words.extend(rows(0..at));
        self.words.push(0);
        self.words.extend(rows(after..others.count));
        self.count = self.words.len();
        for index in (0..self.count).filter(|&index| index != at) {
            self.adopt(index, &others);
        }
        self.words[at] = match attribute {
            Stored::At(address) => row(name, Place::At(address)),
            Stored::InTable(words) => {
                let offset = self.words.len();
                self.words.extend(words);
                row(name, Place::InTable(offset))
            }
        };
        match before {
            Some(Place::At(address)) => Some(address),
            _ => None,
        }
    }

    /// Takes an attribute out. Where it lay, if it was there.
    pub(crate) fn remove(&mut self, name: u16) -> Option<Place> {
        let place = self.find(name)?;
        let others = std::mem::take(self);
        let rows = others.rows().iter();
        self.words
            .extend(rows.filter(|&&found| name_of(found) != name));
        self.count = self.words.len();
        for index in 0..self.count {
            self.adopt(index, &others);
        }
        Some(place)
    }

    /// Copies what the row at `index` speaks of from the table that the row comes from.
    fn adopt(&mut self, index: usize, from: &Self) {
        let found = self.words[index];
        if let Place::InTable(offset) = place_of(found) {
            self.words[index] = row(name_of(found), Place::InTable(self.words.len()));
            self.words.extend(from.small(offset));
        }
    }

    /// The words of an attribute in the table.
    fn small(&self, offset: usize) -> &[u64] {
        let words = self.words.get(offset..).unwrap_or(&[]);
        let len = words.first().map_or(0, |&head| attribute_words(head));
        words.get(..len).unwrap_or(&[])
    }
}

/// An attribute to put into a table.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Stored<'a> {
    /// Its words.
    InTable(&'a [u64]),
    /// The block that it lies in.
    At(Address),
}

/// An attribute as it lies in the arena.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct AttributeRecord {
    pub(crate) value: Value,
    pub(crate) head: Head,
}

/// What an attribute says of its value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Head {
    /// The commit that wrote it.
    pub(crate) version: u64,
    pub(crate) time: i64,
    pub(crate) writer: u16,
}

/// A value that takes no memory of its own, still as words.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Small<'a> {
    Number(f64),
    Pose(&'a [Word; 7]),
}

/// The attribute at the beginning of `words`, where its value is of a kind that is read the most.
#[inline]
pub(crate) fn small_value(words: &[Word]) -> Option<(Head, Small<'_>)> {
    const F64: u16 = ValueKind::F64 as u16;
    const POSE: u16 = ValueKind::Pose as u16;
    let (header, value) = words.split_first_chunk::<ATTRIBUTE_HEADER>()?;
    let [first, version, time] = header.each_ref().map(Word::load);
    let head = Head {
        version,
        time: time.cast_signed(),
        writer: (first >> 16) as u16,
    };
    match first as u16 {
        F64 => Some((head, Small::Number(f64::from_bits(value.first()?.load())))),
        POSE => Some((head, Small::Pose(value.first_chunk()?))),
        _ => None,
    }
}

/// The pose of these words.
#[inline]
pub(crate) fn pose_of<W: Load>(words: &[W; 7]) -> Pose {
    let [x, y, z, i, j, k, w] = words.each_ref().map(|word| f64::from_bits(word.get()));
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
    Pose::from_parts(Translation3::new(x, y, z), rotation)
}

/// The count and address of a link to older records.
fn split_link(link: u64) -> (u16, Address) {
    ((link >> 48) as u16, link & ((1 << 48) - 1))
}

/// The words before the value of an attribute of that kind.
#[inline]
fn header_of(kind: u16) -> usize {
    ATTRIBUTE_HEADER + usize::from(kind & HAS_HISTORY != 0)
}

impl AttributeRecord {
    /// The attribute in a block of its own.
    pub(crate) fn read(arena: &Arena, address: Address) -> Result<Self, Address> {
        arena.from(address).and_then(Self::decode).ok_or(address)
    }

    /// The attribute at the beginning of `words`.
    pub(crate) fn decode<W: Load>(words: &[W]) -> Option<Self> {
        let header = words.first_chunk::<ATTRIBUTE_HEADER>()?;
        let [first, version, time] = header.each_ref().map(Load::get);
        let (kind, length) = (first as u16, (first >> 32) as usize);
        let value = words.get(header_of(kind)..)?;
        let head = Head {
            version,
            time: time.cast_signed(),
            writer: (first >> 16) as u16,
        };
        Some(Self {
            value: decode_value(kind & !HAS_HISTORY, length, value)?,
            head,
        })
    }

    /// Appends an attribute's words: its version, time and writer, and how many older records it
    /// leads to and the newest of them, where it has a history.
    pub(crate) fn encode(
        words: &mut Vec<u64>,
        value: &Value,
        (version, time, writer): (u64, i64, u16),
        older: Option<(u16, Address)>,
    ) {
        let at = words.len();
        words.extend([0, version, time.cast_unsigned()]);
        words.extend(older.map(|(count, address)| u64::from(count) << 48 | address));
        let length = encode_value(words, value) as u64;
        let flag = older.map_or(0, |_| u64::from(HAS_HISTORY));
        words[at] = value.kind() as u64 | flag | u64::from(writer) << 16 | length << 32;
    }

    /// Where the record at `address` leads: how many older records there are, and the newest of
    /// them.
    pub(crate) fn older(arena: &Arena, address: Address) -> Option<(u16, Address)> {
        let words = arena.from(address)?;
        let kind = words.first()?.load() as u16;
        let link = || Some(split_link(words.get(ATTRIBUTE_HEADER)?.load()));
        (kind & HAS_HISTORY != 0).then(link)?
    }

    /// The version that wrote the record at `address`.
    pub(crate) fn version(arena: &Arena, address: Address) -> Option<u64> {
        Some(arena.from(address)?.get(1)?.load())
    }

    /// The words that the attribute at `address` takes.
    pub(crate) fn len(arena: &Arena, address: Address) -> usize {
        let head = arena.from(address).and_then(<[_]>::first).map(Word::load);
        head.map_or(ATTRIBUTE_HEADER, attribute_words)
    }
}

/// The words of an attribute that begins with `head`.
fn attribute_words(head: u64) -> usize {
    let kind = head as u16;
    let value = value_words(kind & !HAS_HISTORY, (head >> 32) as usize);
    header_of(kind) + value.unwrap_or(0)
}

/// Appends a value's words; its length in elements, or bytes of text.
fn encode_value(words: &mut Vec<u64>, value: &Value) -> usize {
    let mut f32s = |row: &[f32]| {
        words.extend(row.chunks(2).map(|pair| {
            let high = pair.get(1).map_or(0, |x| u64::from(x.to_bits()));
            u64::from(pair[0].to_bits()) | high << 32
        }));
        row.len()
    };
    let word = match value {
        Value::Bool(b) => u64::from(*b),
        Value::I32(n) => i64::from(*n).cast_unsigned(),
        Value::U32(n) => u64::from(*n),
        Value::I64(n) => n.cast_unsigned(),
        Value::U64(n) => *n,
        Value::F32(n) => u64::from(n.to_bits()),
        Value::F64(n) => n.to_bits(),
        Value::String(text) => {
            words.extend(pack(text.as_bytes()));
            return text.len();
        }
        Value::Vector(row) | Value::F64List(row) => {
            words.extend(row.iter().map(|x| x.to_bits()));
            return row.len();
        }
        Value::F32Vector(row) | Value::F32List(row) => return f32s(row),
        Value::U8List(bytes) => {
            words.extend(pack(bytes));
            return bytes.len();
        }
        Value::U64List(row) => {
            words.extend(row);
            return row.len();
        }
        Value::Pose(pose) => {
            words.extend(pose_words(pose));
            return 7;
        }
        Value::Large(handle) => {
            words.extend(handle.to_words());
            return HANDLE_WORDS;
        }
    };
    words.push(word);
    1
}

fn pose_words(pose: &Pose) -> [u64; 7] {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(f64::to_bits)
}

fn value_words(kind: u16, length: usize) -> Option<usize> {
    Some(match *ValueKind::ALL.get(usize::from(kind))? {
        ValueKind::String | ValueKind::U8List => length.div_ceil(8),
        ValueKind::F32Vector | ValueKind::F32List => length.div_ceil(2),
        ValueKind::Vector | ValueKind::F64List | ValueKind::U64List => length,
        ValueKind::Pose => 7,
        ValueKind::Large => HANDLE_WORDS,
        _ => 1,
    })
}

fn decode_value<W: Load>(kind: u16, length: usize, words: &[W]) -> Option<Value> {
    let kind = *ValueKind::ALL.get(usize::from(kind))?;
    let first = || words.first().map(Load::get);
    let f64s = |words: &[W]| {
        words
            .iter()
            .map(|word| f64::from_bits(word.get()))
            .collect()
    };
    Some(match kind {
        ValueKind::Bool => Value::Bool(first()? != 0),
        ValueKind::I32 => Value::I32(first()? as i32),
        ValueKind::U32 => Value::U32(first()? as u32),
        ValueKind::I64 => Value::I64(first()?.cast_signed()),
        ValueKind::U64 => Value::U64(first()?),
        ValueKind::F32 => Value::F32(f32::from_bits(first()? as u32)),
        ValueKind::F64 => Value::F64(f64::from_bits(first()?)),
        ValueKind::String => Value::String(String::from_utf8(unpack(words, length)?).ok()?),
        ValueKind::Vector => Value::Vector(f64s(words.get(..length)?)),
        ValueKind::F64List => Value::F64List(f64s(words.get(..length)?)),
        ValueKind::F32Vector => Value::F32Vector(f32s(words, length)?),
        ValueKind::F32List => Value::F32List(f32s(words, length)?),
        ValueKind::U8List => Value::U8List(unpack(words, length)?),
        ValueKind::U64List => Value::U64List(words.get(..length)?.iter().map(Load::get).collect()),
        ValueKind::Pose => Value::Pose(pose_of(words.first_chunk()?)),
        ValueKind::Large => {
            let row = words.first_chunk::<HANDLE_WORDS>()?;
            Value::Large(LargeHandle::from_words(row.each_ref().map(Load::get)))
        }
    })
}

fn f32s<W: Load>(words: &[W], length: usize) -> Option<Vec<f32>> {
    let words = words.get(..length.div_ceil(2))?;
    let halves = words
        .iter()
        .flat_map(|word| [word.get() as u32, (word.get() >> 32) as u32]);
    Some(halves.take(length).map(f32::from_bits).collect())
}
