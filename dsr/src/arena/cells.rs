//! The short way to a node: a row of words by node id, each the address of the node's newest record. It
//! guarantees that what it finds is what the trie would have found; where it cannot tell, it finds
//! nothing, and the trie has the answer.
//!
//! Cells are the one part of the graph that is written over while it can be read: the writer sets those
//! of the nodes that a commit touched just before it publishes the version. So a cell never speaks of
//! a commit that is refused, and a record in it is the node's in every version from the one that wrote
//! it, which the record says, to the newest. A reader of an older version than that, or of a node that is
//! gone since, takes the trie. A row that has become too short is left as it is: for its versions, what
//! it says remains true.
//!
//! Ids far above the number of nodes have no cell, nor has a node for which there was no room.

use super::{Address, Arena, Root, Word, protocol, record};
use crate::graph::Writer;

/// Cells of the shortest row.
const FEWEST: u64 = 1 << 10;
/// There are at most so many cells for a node.
const SPARSE: u64 = 8;

/// The record of node `id` and the words from its first on, where its cell can tell.
#[inline]
pub(crate) fn find<'a>(arena: &'a Arena, root: &Root, id: u64) -> Option<(Address, &'a [Word])> {
    if id >= root.cell_count {
        return None;
    }
    let address = protocol::led(arena.from(root.cells)?.get(id as usize)?);
    if address == 0 {
        return None;
    }
    let words = arena.from(address)?;
    let header = words.first_chunk::<{ record::NODE_HEADER }>()?;
    let marks = (&header[0], &header[record::SINCE]);
    protocol::is_record_of(marks, id, root.version).then_some((address, words))
}

/// Makes the row long enough for node `id`, where that is worth it and there is room.
pub(crate) fn reach(writer: &mut Writer, root: &mut Root, id: u64) {
    // So much is always to be had in one piece.
    let most = writer.arena().segment_words() as u64 / 4;
    if id < root.cell_count || id >= most {
        return;
    }
    let wanted = (id + 1).next_power_of_two().max(FEWEST);
    if wanted / SPARSE > root.node_count.max(FEWEST) {
        return;
    }
    let (old, count) = (root.cells, root.cell_count as usize);
    let words = writer.arena().block(old, count).unwrap_or(&[]);
    let mut cells: Vec<u64> = words.iter().map(Word::load).collect();
    cells.resize(wanted as usize, 0);
    if let Ok(longer) = writer.write(&cells) {
        (root.cells, root.cell_count) = (longer, wanted);
        writer.retire(old, count);
    }
}

/// Sets cells, just before `root` is published: of nodes with the addresses of their records, 0 for those
/// that are gone. The last word on a node counts.
pub(crate) fn set(arena: &Arena, root: &Root, moved: &mut Vec<(u64, Address)>) {
    // What an earlier word speaks of may be another block by now, which no cell may show.
    moved.sort_by_key(|&(id, _)| id);
    let row = arena.block(root.cells, root.cell_count as usize);
    for same in moved.chunk_by(|a, b| a.0 == b.0) {
        if let (Some(row), Some(&(id, address))) = (row, same.last())
            && let Some(cell) = row.get(id as usize)
        {
            protocol::lead(cell, address);
        }
    }
    moved.clear();
}
