//! The blocks behind the tries and trees: nodes, edges, attributes, texts and directories. This
//! file owns their layout, and guarantees that decoding takes any words without a panic.
//!
//! - Node: id, kind word, name (blob), version, out tree, in tree, the version that wrote the record, then
//!   its table of attributes.
//!   Out tree: (label, target) to end; in tree: (label, source) to end.
//! - End: `edge | type of the node at the other end << 48`; in an in tree without the edge. So who
//!   looks for neighbours of a type looks up none of another.
//! - Edge: from, to, kind word, version, then its table of attributes.
//! - Kind word: `type or label | attributes << 16 | words of the table << 32`.
//! - Table and attribute: see the file `table`.
//! - Blob: length in bytes, then the bytes, eight to a word, lowest first.
//! - Directory: length, then (tree, count) per id.

use super::allocator::Full;
use super::table::{self, Load, Table};
use super::tree::Key;
use super::{Address, Arena, Word};
use crate::graph::Writer;

pub(crate) const NODE_HEADER: usize = 7;
/// The word of a node's header that says which version changed the node last.
pub(crate) const VERSION: usize = 3;
/// The word of a node's header that leads to the edges that start there.
pub(crate) const TARGETS: usize = 4;
/// The word of a node's header that leads to the edges that end there.
pub(crate) const SOURCES: usize = 5;
/// The word of a node's header that says since which version the record is the node's.
pub(crate) const SINCE: usize = 6;
pub(crate) const EDGE_HEADER: usize = 4;

/// The key under which edges of a label between nodes of these exact types are counted.
pub(crate) fn triple(label: u16, from: u16, to: u16) -> Key {
    [
        u64::from(label) << 32 | u64::from(from) << 16 | u64::from(to),
        0,
    ]
}

const EDGE_OF_END: u64 = (1 << 48) - 1;

/// What a node keeps of an edge: the type of the node at the other end, and the edge's record
/// where it starts here, else 0.
pub(crate) fn end(other: u16, edge: Address) -> u64 {
    u64::from(other) << 48 | edge
}

/// The edge's record.
#[inline]
pub(crate) fn edge_of(end: u64) -> Address {
    end & EDGE_OF_END
}

/// The type of the node at the other end.
#[inline]
pub(crate) fn other_type(end: u64) -> u16 {
    (end >> 48) as u16
}

/// What a label's tree keeps of an edge: the types of its source and target.
pub(crate) fn ends(types: [u16; 2]) -> u64 {
    u64::from(types[0]) << 16 | u64::from(types[1])
}

/// The types of source and target.
#[inline]
pub(crate) fn types_of(ends: u64) -> [u16; 2] {
    [(ends >> 16) as u16, ends as u16]
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
    pub(crate) table: Table,
}

fn kind_word(type_or_label: u16, table: &Table) -> u64 {
    u64::from(type_or_label) | (table.len() as u64) << 16 | (table.words().len() as u64) << 32
}

impl NodeRecord {
    pub(crate) fn read(arena: &Arena, address: Address) -> Result<Self, Address> {
        let words = arena.from(address).ok_or(address)?;
        let (header, table) = words.split_first_chunk::<NODE_HEADER>().ok_or(address)?;
        let [id, kind, name, version, out, into, _] = header.each_ref().map(Word::load);
        Ok(Self {
            id,
            type_id: kind as u16,
            name,
            version,
            out,
            into,
            table: Table::read(table, kind).ok_or(address)?,
        })
    }

    /// Appends its words, as those of a record that is the node's from version `since` on.
    pub(crate) fn encode(&self, since: u64, words: &mut Vec<u64>) {
        let kind = kind_word(self.type_id, &self.table);
        words.extend([self.id, kind, self.name, self.version]);
        words.extend([self.out, self.into, since]);
        words.extend(self.table.words());
    }

    /// The words that it takes.
    pub(crate) fn len(&self) -> usize {
        NODE_HEADER + self.table.words().len()
    }
}

/// A node's record, left where it lies.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NodeInPlace {
    pub(crate) id: u64,
    pub(crate) type_id: u16,
    /// The words that it takes.
    pub(crate) len: usize,
}

impl NodeInPlace {
    /// The node at the beginning of `words`.
    pub(crate) fn at(words: &[Word]) -> Option<Self> {
        let header = words.first_chunk::<NODE_HEADER>()?;
        let kind = header[1].load();
        Some(Self {
            id: header[0].load(),
            type_id: kind as u16,
            len: NODE_HEADER + (kind >> 32) as usize,
        })
    }

    /// The node at the beginning of `words`, and where in them its small attribute of that name lies.
    pub(crate) fn with_small(words: &[Word], name: u16) -> Option<(Self, std::ops::Range<usize>)> {
        let node = Self::at(words)?;
        let (header, table) = words.split_first_chunk::<NODE_HEADER>()?;
        let kind = header[1].load();
        let small = table::small_of(table, kind, name)?;
        Some((node, NODE_HEADER + small.start..NODE_HEADER + small.end))
    }
}

/// An edge's record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct EdgeRecord {
    pub(crate) from: u64,
    pub(crate) to: u64,
    pub(crate) label: u16,
    pub(crate) version: u64,
    pub(crate) table: Table,
}

impl EdgeRecord {
    pub(crate) fn read(arena: &Arena, address: Address) -> Result<Self, Address> {
        let words = arena.from(address).ok_or(address)?;
        let (header, table) = words.split_first_chunk::<EDGE_HEADER>().ok_or(address)?;
        let [from, to, kind, version] = header.each_ref().map(Word::load);
        Ok(Self {
            from,
            to,
            label: kind as u16,
            version,
            table: Table::read(table, kind).ok_or(address)?,
        })
    }

    /// Appends its words.
    pub(crate) fn encode(&self, words: &mut Vec<u64>) {
        let kind = kind_word(self.label, &self.table);
        words.extend([self.from, self.to, kind, self.version]);
        words.extend(self.table.words());
    }

    /// The words that it takes.
    pub(crate) fn len(&self) -> usize {
        EDGE_HEADER + self.table.words().len()
    }
}

/// Bytes as words.
pub(crate) fn pack(bytes: &[u8]) -> impl Iterator<Item = u64> {
    bytes.chunks(8).map(|chunk| {
        let mut eight = [0; 8];
        eight[..chunk.len()].copy_from_slice(chunk);
        u64::from_le_bytes(eight)
    })
}

pub(super) fn unpack<W: Load>(words: &[W], length: usize) -> Option<Vec<u8>> {
    let words = words.get(..length.div_ceil(8))?;
    let mut bytes: Vec<u8> = words
        .iter()
        .flat_map(|word| word.get().to_le_bytes())
        .collect();
    bytes.truncate(length);
    Some(bytes)
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
