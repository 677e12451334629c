//! The map from node id to node record: a trie of 64-way bitmap nodes over the id, lowest six bits
//! first, so that ids that run from 1 make the shallowest trie and a few wild ones cost nobody.
//!
//! Inner block: bitmap, then one child per set bit, lowest first. A child is `address << 1`, plus
//! 1 where it is a record. A record's first word is its id. An empty trie is address 0.

use super::allocator::Full;
use super::{Address, Arena};
use crate::graph::Writer;

/// No id has more groups of six bits than this.
const MAX_DEPTH: u32 = 11;

fn slot(id: u64, depth: u32) -> u64 {
    if depth < MAX_DEPTH {
        (id >> (6 * depth)) & 63
    } else {
        0
    }
}

fn rank(bitmap: u64, bit: u64) -> usize {
    (bitmap & ((1 << bit) - 1)).count_ones() as usize
}

/// The record of node `id`; `Err` where the trie leads to an impossible place.
pub(crate) fn find(arena: &Arena, root: Address, id: u64) -> Result<Option<Address>, Address> {
    let mut block = root;
    for depth in 0..MAX_DEPTH {
        if block == 0 {
            return Ok(None);
        }
        let words = arena.from(block).ok_or(block)?;
        let bitmap = words.first().ok_or(block)?.load();
        let bit = slot(id, depth);
        if bitmap & (1 << bit) == 0 {
            return Ok(None);
        }
        let child = words.get(1 + rank(bitmap, bit)).ok_or(block)?.load();
        let address = child >> 1;
        if child & 1 == 1 {
            let found = arena
                .from(address)
                .and_then(<[_]>::first)
                .ok_or(address)?
                .load();
            return Ok((found == id).then_some(address));
        }
        block = address;
    }
    Err(block)
}

/// Puts `record` (whose first word is `id`) into the trie, in place of the one that is there.
pub(crate) fn insert(
    writer: &mut Writer,
    root: Address,
    id: u64,
    record: Address,
) -> Result<Address, Full> {
    if root == 0 {
        return writer.write(&[1 << slot(id, 0), record << 1 | 1]);
    }
    insert_at(writer, root, id, record, 0)
}

fn insert_at(
    writer: &mut Writer,
    block: Address,
    id: u64,
    record: Address,
    depth: u32,
) -> Result<Address, Full> {
    let mut words = read(writer, block);
    let bit = slot(id, depth);
    let at = 1 + rank(words[0], bit);
    if words[0] & (1 << bit) == 0 {
        words[0] |= 1 << bit;
        words.insert(at, record << 1 | 1);
        return writer.replace(block, words.len() - 1, &words);
    }
    let child = words[at];
    let address = child >> 1;
    let new = if child & 1 == 0 {
        insert_at(writer, address, id, record, depth + 1)? << 1
    } else {
        let other = writer
            .arena()
            .from(address)
            .and_then(<[_]>::first)
            .map_or(id, super::Word::load);
        if other == id {
            record << 1 | 1
        } else {
            split(writer, (other, address), (id, record), depth + 1)? << 1
        }
    };
    if new == child {
        return Ok(block);
    }
    words[at] = new;
    writer.replace(block, words.len(), &words)
}

/// A block that holds two records whose ids agree in their lowest `6 * depth` bits.
fn split(
    writer: &mut Writer,
    a: (u64, Address),
    b: (u64, Address),
    depth: u32,
) -> Result<Address, Full> {
    let (bit_a, bit_b) = (slot(a.0, depth), slot(b.0, depth));
    if bit_a == bit_b {
        let below = split(writer, a, b, depth + 1)?;
        return writer.write(&[1 << bit_a, below << 1]);
    }
    let (first, second) = if bit_a < bit_b {
        (a.1, b.1)
    } else {
        (b.1, a.1)
    };
    writer.write(&[1 << bit_a | 1 << bit_b, first << 1 | 1, second << 1 | 1])
}

/// Takes node `id` out of the trie; the trie's new root, 0 where it is empty.
pub(crate) fn remove(writer: &mut Writer, block: Address, id: u64) -> Result<Address, Full> {
    remove_at(writer, block, id, 0)
}

fn remove_at(writer: &mut Writer, block: Address, id: u64, depth: u32) -> Result<Address, Full> {
    if block == 0 {
        return Ok(0);
    }
    let mut words = read(writer, block);
    let bit = slot(id, depth);
    if words[0] & (1 << bit) == 0 {
        return Ok(block);
    }
    let at = 1 + rank(words[0], bit);
    let old_len = words.len();
    let child = words[at];
    let below = if child & 1 == 1 {
        0
    } else {
        remove_at(writer, child >> 1, id, depth + 1)?
    };
    if below != 0 {
        if below << 1 == child {
            return Ok(block);
        }
        words[at] = below << 1;
        return writer.replace(block, old_len, &words);
    }
    words[0] &= !(1 << bit);
    words.remove(at);
    if words[0] == 0 {
        writer.retire(block, old_len);
        return Ok(0);
    }
    writer.replace(block, old_len, &words)
}

fn read(writer: &Writer, block: Address) -> Vec<u64> {
    let words = writer.arena().from(block).unwrap_or(&[]);
    let bitmap = words.first().map_or(0, super::Word::load);
    let len = 1 + bitmap.count_ones() as usize;
    words.iter().take(len).map(super::Word::load).collect()
}

/// Walks the records in the trie's own order, which depends on the ids alone.
#[derive(Debug, Clone)]
pub(crate) struct Walk {
    /// Children still to visit, last first.
    stack: Vec<u64>,
    /// Bounds the walk in a damaged arena.
    budget: u64,
}

impl Walk {
    pub(crate) fn new(root: Address, count: u64) -> Self {
        let stack = if root == 0 {
            Vec::new()
        } else {
            vec![root << 1]
        };
        Self {
            stack,
            budget: count
                .saturating_mul(u64::from(MAX_DEPTH) + 1)
                .saturating_add(1),
        }
    }

    /// The next record; `Err` where the trie leads to an impossible place.
    pub(crate) fn next(&mut self, arena: &Arena) -> Result<Option<Address>, Address> {
        while let Some(child) = self.stack.pop() {
            let address = child >> 1;
            if child & 1 == 1 {
                return Ok(Some(address));
            }
            self.budget = self.budget.checked_sub(1).ok_or(address)?;
            let words = arena.from(address).ok_or(address)?;
            let bitmap = words.first().ok_or(address)?.load();
            let children = words.get(1..=bitmap.count_ones() as usize).ok_or(address)?;
            self.stack
                .extend(children.iter().rev().map(super::Word::load));
        }
        Ok(None)
    }
}
