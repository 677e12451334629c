//! The blocks behind the tries and trees: nodes, edges, attributes, texts and directories. This
//! file owns their layout, and guarantees that decoding takes any words without a panic.
//!
//! - Node: id, `type | count << 32`, name (blob), version, out tree, in tree, then `count`
//!   attributes as `attribute << 48 | address`, ascending. Out tree: (label, target) to edge;
//!   in tree: (label, source) to 0.
//! - Edge: from, to, `label | count << 32`, version, then attributes as in a node.
//! - Attribute: `kind | writer << 16 | length << 32`, version, time, then the value. With a history,
//!   bit 15 of the kind is set and a word `count << 48 | address` comes before the value: how many
//!   older values there are, and the record of the newest of them.
//! - Blob: length in bytes, then the bytes, eight to a word, lowest first.
//! - Directory: length, then (tree, count) per id.

use super::allocator::Full;
use super::tree::Key;
use super::{Address, Arena, Word};
use crate::graph::Writer;
use crate::value::{Pose, Value, ValueKind};
use nalgebra::{Quaternion, Translation3, UnitQuaternion};

pub(crate) const NODE_HEADER: usize = 6;
pub(crate) const EDGE_HEADER: usize = 4;
const ATTRIBUTE_HEADER: usize = 3;
const ADDRESS_MASK: u64 = (1 << 48) - 1;
/// In an attribute's kind: the record leads to older ones.
const HAS_HISTORY: u16 = 1 << 15;

/// The key under which edges of a label between nodes of these exact types are counted.
pub(crate) fn triple(label: u16, from: u16, to: u16) -> Key {
    [
        u64::from(label) << 32 | u64::from(from) << 16 | u64::from(to),
        0,
    ]
}

/// One row of a record's attribute table.
pub(crate) fn row(attribute: u16, address: Address) -> u64 {
    u64::from(attribute) << 48 | address & ADDRESS_MASK
}

/// The attribute and address of a row.
pub(crate) fn split_row(row: u64) -> (u16, Address) {
    ((row >> 48) as u16, row & ADDRESS_MASK)
}

/// A node's record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct NodeRecord {
    pub(crate) id: u64,
    pub(crate) type_id: u16,
    pub(crate) name: Address,
    pub(crate) version: u64,
    pub(crate) out: Address,
    pub(crate) into: Address,
    pub(crate) rows: Vec<u64>,
}

impl NodeRecord {
    pub(crate) fn read(arena: &Arena, address: Address) -> Result<Self, Address> {
        let words = arena.from(address).ok_or(address)?;
        let at = |i: usize| words.get(i).map(Word::load).ok_or(address);
        let rows = table(words, NODE_HEADER, at(1)?).ok_or(address)?;
        Ok(Self {
            id: at(0)?,
            type_id: at(1)? as u16,
            name: at(2)?,
            version: at(3)?,
            out: at(4)?,
            into: at(5)?,
            rows: rows.iter().map(Word::load).collect(),
        })
    }

    pub(crate) fn words(&self) -> Vec<u64> {
        let kind = u64::from(self.type_id) | (self.rows.len() as u64) << 32;
        let mut words = vec![self.id, kind, self.name, self.version, self.out, self.into];
        words.extend(&self.rows);
        words
    }
}

/// An edge's record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct EdgeRecord {
    pub(crate) from: u64,
    pub(crate) to: u64,
    pub(crate) label: u16,
    pub(crate) version: u64,
    pub(crate) rows: Vec<u64>,
}

impl EdgeRecord {
    pub(crate) fn read(arena: &Arena, address: Address) -> Result<Self, Address> {
        let words = arena.from(address).ok_or(address)?;
        let at = |i: usize| words.get(i).map(Word::load).ok_or(address);
        let rows = table(words, EDGE_HEADER, at(2)?).ok_or(address)?;
        Ok(Self {
            from: at(0)?,
            to: at(1)?,
            label: at(2)? as u16,
            version: at(3)?,
            rows: rows.iter().map(Word::load).collect(),
        })
    }

    pub(crate) fn words(&self) -> Vec<u64> {
        let kind = u64::from(self.label) | (self.rows.len() as u64) << 32;
        let mut words = vec![self.from, self.to, kind, self.version];
        words.extend(&self.rows);
        words
    }
}

/// The attribute table of a record whose kind word is `kind`.
pub(crate) fn table(words: &[Word], header: usize, kind: u64) -> Option<&[Word]> {
    let count = (kind >> 32) as usize;
    words.get(header..header.checked_add(count)?)
}

/// An attribute as it lies in the arena.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct AttributeRecord {
    pub(crate) value: Value,
    pub(crate) version: u64,
    pub(crate) time: i64,
    pub(crate) writer: u16,
    /// How many older records there are, and the address of the newest of them; `None` where the
    /// attribute keeps no history.
    pub(crate) older: Option<(u16, Address)>,
}

impl AttributeRecord {
    pub(crate) fn read(arena: &Arena, address: Address) -> Result<Self, Address> {
        let words = arena.from(address).ok_or(address)?;
        let at = |i: usize| words.get(i).map(Word::load).ok_or(address);
        let head = at(0)?;
        let kind = head as u16;
        let (older, header) = if kind & HAS_HISTORY == 0 {
            (None, ATTRIBUTE_HEADER)
        } else {
            (Some(split_row(at(ATTRIBUTE_HEADER)?)), ATTRIBUTE_HEADER + 1)
        };
        let value = words.get(header..).ok_or(address)?;
        let length = (head >> 32) as usize;
        Ok(Self {
            value: decode(kind & !HAS_HISTORY, length, value).ok_or(address)?,
            version: at(1)?,
            time: at(2)?.cast_signed(),
            writer: (head >> 16) as u16,
            older,
        })
    }

    pub(crate) fn words(&self) -> Vec<u64> {
        let (length, value) = encode(&self.value);
        let flag = self.older.map_or(0, |_| u64::from(HAS_HISTORY));
        let kind = self.value.kind() as u64 | flag;
        let head = kind | u64::from(self.writer) << 16 | (length as u64) << 32;
        let mut words = vec![head, self.version, self.time.cast_unsigned()];
        words.extend(self.older.map(|(count, address)| row(count, address)));
        words.extend(value);
        words
    }

    /// The words that the attribute at `address` takes.
    pub(crate) fn len(arena: &Arena, address: Address) -> usize {
        arena
            .from(address)
            .and_then(<[_]>::first)
            .map_or(ATTRIBUTE_HEADER, |head| {
                let head = head.load();
                let kind = head as u16;
                let link = usize::from(kind & HAS_HISTORY != 0);
                let value = value_words(kind & !HAS_HISTORY, (head >> 32) as usize);
                ATTRIBUTE_HEADER + link + value.unwrap_or(0)
            })
    }

    /// Where the record at `address` leads: how many older records there are, and the newest of
    /// them.
    pub(crate) fn older(arena: &Arena, address: Address) -> Option<(u16, Address)> {
        let words = arena.from(address)?;
        let kind = words.first()?.load() as u16;
        let link = || Some(split_row(words.get(ATTRIBUTE_HEADER)?.load()));
        (kind & HAS_HISTORY != 0).then(link)?
    }

    /// The version that wrote the record at `address`.
    pub(crate) fn version(arena: &Arena, address: Address) -> Option<u64> {
        Some(arena.from(address)?.get(1)?.load())
    }
}

fn pack(bytes: &[u8]) -> Vec<u64> {
    bytes
        .chunks(8)
        .map(|chunk| {
            let mut eight = [0; 8];
            eight[..chunk.len()].copy_from_slice(chunk);
            u64::from_le_bytes(eight)
        })
        .collect()
}

fn unpack(words: &[Word], length: usize) -> Option<Vec<u8>> {
    let words = words.get(..length.div_ceil(8))?;
    let mut bytes: Vec<u8> = words
        .iter()
        .flat_map(|word| word.load().to_le_bytes())
        .collect();
    bytes.truncate(length);
    Some(bytes)
}

/// A value's length (in elements, or bytes of text) and words.
fn encode(value: &Value) -> (usize, Vec<u64>) {
    let f32s = |row: &[f32]| {
        row.chunks(2)
            .map(|pair| {
                let high = pair.get(1).map_or(0, |x| u64::from(x.to_bits()));
                u64::from(pair[0].to_bits()) | high << 32
            })
            .collect()
    };
    match value {
        Value::Bool(b) => (1, vec![u64::from(*b)]),
        Value::I32(n) => (1, vec![i64::from(*n).cast_unsigned()]),
        Value::U32(n) => (1, vec![u64::from(*n)]),
        Value::I64(n) => (1, vec![n.cast_unsigned()]),
        Value::U64(n) => (1, vec![*n]),
        Value::F32(n) => (1, vec![u64::from(n.to_bits())]),
        Value::F64(n) => (1, vec![n.to_bits()]),
        Value::String(text) => (text.len(), pack(text.as_bytes())),
        Value::Vector(row) | Value::F64List(row) => {
            (row.len(), row.iter().map(|x| x.to_bits()).collect())
        }
        Value::F32Vector(row) | Value::F32List(row) => (row.len(), f32s(row)),
        Value::U8List(bytes) => (bytes.len(), pack(bytes)),
        Value::U64List(row) => (row.len(), row.clone()),
        Value::Pose(pose) => {
            let (t, q) = (pose.translation.vector, pose.rotation.coords);
            (
                7,
                [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
                    .map(f64::to_bits)
                    .to_vec(),
            )
        }
    }
}

fn value_words(kind: u16, length: usize) -> Option<usize> {
    Some(match *ValueKind::ALL.get(usize::from(kind))? {
        ValueKind::String | ValueKind::U8List => length.div_ceil(8),
        ValueKind::F32Vector | ValueKind::F32List => length.div_ceil(2),
        ValueKind::Vector | ValueKind::F64List | ValueKind::U64List => length,
        ValueKind::Pose => 7,
        _ => 1,
    })
}

fn decode(kind: u16, length: usize, words: &[Word]) -> Option<Value> {
    let kind_of = *ValueKind::ALL.get(usize::from(kind))?;
    let words = words.get(..value_words(kind, length)?)?;
    let first = || words.first().map(Word::load);
    let f64s = || {
        words
            .iter()
            .map(|word| f64::from_bits(word.load()))
            .collect::<Vec<_>>()
    };
    let f32s = || {
        let halves = words
            .iter()
            .flat_map(|word| [word.load() as u32, (word.load() >> 32) as u32]);
        halves.take(length).map(f32::from_bits).collect::<Vec<_>>()
    };
    Some(match kind_of {
        ValueKind::Bool => Value::Bool(first()? != 0),
        ValueKind::I32 => Value::I32(first()? as i32),
        ValueKind::U32 => Value::U32(first()? as u32),
        ValueKind::I64 => Value::I64(first()?.cast_signed()),
        ValueKind::U64 => Value::U64(first()?),
        ValueKind::F32 => Value::F32(f32::from_bits(first()? as u32)),
        ValueKind::F64 => Value::F64(f64::from_bits(first()?)),
        ValueKind::String => Value::String(String::from_utf8(unpack(words, length)?).ok()?),
        ValueKind::Vector => Value::Vector(f64s()),
        ValueKind::F64List => Value::F64List(f64s()),
        ValueKind::F32Vector => Value::F32Vector(f32s()),
        ValueKind::F32List => Value::F32List(f32s()),
        ValueKind::U8List => Value::U8List(unpack(words, length)?),
        ValueKind::U64List => Value::U64List(words.iter().map(Word::load).collect()),
        ValueKind::Pose => {
            let row = f64s();
            let &[x, y, z, i, j, k, w] = row.first_chunk::<7>()?;
            let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
            Value::Pose(Pose::from_parts(Translation3::new(x, y, z), rotation))
        }
    })
}

/// Writes bytes.
pub(crate) fn write_blob(writer: &mut Writer, bytes: &[u8]) -> Result<Address, Full> {
    let mut words = vec![bytes.len() as u64];
    words.extend(pack(bytes));
    writer.write(&words)
}

/// Reads bytes.
pub(crate) fn read_blob(arena: &Arena, address: Address) -> Result<Vec<u8>, Address> {
    let words = arena.from(address).ok_or(address)?;
    let length = words.first().ok_or(address)?.load() as usize;
    unpack(words.get(1..).ok_or(address)?, length).ok_or(address)
}

/// The words that the blob at `address` takes.
pub(crate) fn blob_len(arena: &Arena, address: Address) -> usize {
    arena
        .from(address)
        .and_then(<[_]>::first)
        .map_or(1, |len| 1 + (len.load() as usize).div_ceil(8))
}

/// The tree and count that a directory keeps for `id`.
pub(crate) fn directory_entry(
    arena: &Arena,
    directory: Address,
    id: u16,
) -> Result<(Address, u64), Address> {
    if directory == 0 {
        return Ok((0, 0));
    }
    let words = arena.from(directory).ok_or(directory)?;
    let length = words.first().ok_or(directory)?.load();
    if u64::from(id) >= length {
        return Ok((0, 0));
    }
    let at = |i: usize| words.get(i).map(Word::load).ok_or(directory);
    Ok((at(1 + 2 * usize::from(id))?, at(2 + 2 * usize::from(id))?))
}

/// Sets what a directory keeps for `id`; the new directory.
pub(crate) fn set_directory_entry(
    writer: &mut Writer,
    directory: Address,
    id: u16,
    entry: (Address, u64),
) -> Result<Address, Full> {
    let old = writer
        .arena()
        .from(directory)
        .and_then(<[_]>::first)
        .map_or(0, Word::load) as usize;
    let old = if directory == 0 { 0 } else { old };
    let block = writer.arena().from(directory).unwrap_or(&[]);
    let mut words: Vec<u64> = block.iter().take(1 + 2 * old).map(Word::load).collect();
    let length = old.max(usize::from(id) + 1);
    words.resize(1 + 2 * length, 0);
    words[0] = length as u64;
    words[1 + 2 * usize::from(id)] = entry.0;
    words[2 + 2 * usize::from(id)] = entry.1;
    if directory == 0 {
        writer.write(&words)
    } else {
        writer.replace(directory, 1 + 2 * old, &words)
    }
}
