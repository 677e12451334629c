//! The map from node id to node record: a trie of 32-way bitmap nodes over the id, highest bits
//! first, without levels in which there is nothing to choose. So ids that follow each other lie
//! side by side, a graph whose ids run from 1 has the shallowest trie, and a few wild ones cost
//! everybody one level.
//!
//! Block: bitmap, the ids' common bits above the level, then one link per set bit, lowest first. A
//! link is `address << 1`, plus 1 where it leads to a record, else with the block's level in bits
//! 60 to 63: level `l` goes by bits `5 l` to `5 l + 4`. Wider blocks would be read in fewer steps, but
//! every commit copies those above the node that it changes. A record's first word is its id. An empty
//! trie is link 0.

use super::allocator::Full;
use super::{Address, Arena, Word};
use crate::graph::Writer;

/// The way to a block or a record.
pub(crate) type Link = u64;

/// Bits of the id that a level goes by.
const BITS: u64 = 5;
const WIDTH: u64 = 1 << BITS;
/// The bitmap of a block that has all its links.
const FULL: u64 = (1 << WIDTH) - 1;
/// No id has more groups of so many bits than this.
pub(crate) const LEVELS: u64 = 64u64.div_ceil(BITS);
/// Blocks and the record on the way to a node.
const STEPS: u64 = LEVELS + 1;
/// Bitmap and prefix.
const HEADER: usize = 2;
/// Words of the largest block.
const LARGEST: usize = HEADER + WIDTH as usize;

fn slot(id: u64, level: u64) -> u64 {
    (id >> (BITS * level)) & (WIDTH - 1)
}

/// The bits of `id` above a level.
fn prefix(id: u64, level: u64) -> u64 {
    id.checked_shr((BITS * (level + 1)) as u32).unwrap_or(0)
}

fn rank(bitmap: u64, bit: u64) -> usize {
    (bitmap & ((1 << bit) - 1)).count_ones() as usize
}

/// The link to the record at `address`.
pub(crate) fn to_record(address: Address) -> Link {
    address << 1 | 1
}

fn to_block(address: Address, level: u64) -> Link {
    address << 1 | level << 60
}

fn is_record(link: Link) -> bool {
    link & 1 == 1
}

fn address_of(link: Link) -> Address {
    (link & ((1 << 60) - 1)) >> 1
}

fn level_of(link: Link) -> u64 {
    link >> 60
}

/// The record of node `id`; `Err` where the trie leads to an impossible place.
pub(crate) fn find(arena: &Arena, root: Link, id: u64) -> Result<Option<Address>, Address> {
    let mut link = root;
    for _ in 0..STEPS {
        if link == 0 {
            return Ok(None);
        }
        let address = address_of(link);
        let words = arena.from(address).ok_or(address)?;
        let first = words.first().ok_or(address)?.load();
        if is_record(link) {
            return Ok((first == id).then_some(address));
        }
        let level = level_of(link);
        if level >= LEVELS {
            return Err(address);
        }
        let bit = slot(id, level);
        // Ids that follow each other fill their blocks. There the link's place does not depend on
        // the bitmap, so that the processor need not wait for that.
        let at = if first == FULL {
            bit as usize
        } else if first & (1 << bit) == 0 {
            return Ok(None);
        } else {
            rank(first, bit)
        };
        link = words.get(HEADER + at).ok_or(address)?.load();
    }
    Err(address_of(link))
}

/// A block on its way to being written again.
struct Block {
    words: [u64; LARGEST],
    len: usize,
}

impl Block {
    fn read(writer: &Writer, address: Address) -> Self {
        let from = writer.arena().from(address).unwrap_or(&[]);
        let bitmap = from.first().map_or(0, Word::load);
        let len = HEADER + bitmap.count_ones() as usize;
        let mut words = [0; LARGEST];
        for (to, from) in words[..len].iter_mut().zip(from) {
            *to = from.load();
        }
        Self { words, len }
    }

    fn has(&self, bit: u64) -> bool {
        self.words[0] & (1 << bit) != 0
    }

    fn at(&self, bit: u64) -> usize {
        HEADER + rank(self.words[0], bit)
    }

    fn insert(&mut self, bit: u64, link: Link) {
        let at = self.at(bit);
        self.words.copy_within(at..self.len, at + 1);
        self.words[at] = link;
        self.words[0] |= 1 << bit;
        self.len += 1;
    }

    fn remove(&mut self, bit: u64) {
        let at = self.at(bit);
        self.words.copy_within(at + 1..self.len, at);
        self.words[0] &= !(1 << bit);
        self.len -= 1;
    }

    fn words(&self) -> &[u64] {
        &self.words[..self.len]
    }
}

/// Puts `record` (whose first word is `id`) into the trie, in place of the one that is there.
pub(crate) fn insert(
    writer: &mut Writer,
    link: Link,
    id: u64,
    record: Address,
) -> Result<Link, Full> {
    if link == 0 {
        return Ok(to_record(record));
    }
    let address = address_of(link);
    if is_record(link) {
        let other = writer.arena().from(address).and_then(<[_]>::first);
        let other = other.map_or(id, Word::load);
        if other == id {
            return Ok(to_record(record));
        }
        return join(writer, (other, link), (id, to_record(record)));
    }
    let level = level_of(link);
    let bit = slot(id, level);
    if let Some((len, at, link)) = way(writer.arena(), address, id, level) {
        let below = insert(writer, link, id, record)?;
        if below == link {
            return Ok(to_block(address, level));
        }
        return Ok(to_block(writer.change(address, len, at, below)?, level));
    }
    let mut block = Block::read(writer, address);
    if block.words[1] != prefix(id, level) {
        // Any id below the block will do; above it they are all alike.
        let other = block.words[1] << (BITS * (level + 1));
        return join(writer, (other, link), (id, to_record(record)));
    }
    let old = block.len;
    block.insert(bit, to_record(record));
    let address = writer.replace(address, old, block.words())?;
    Ok(to_block(address, level))
}

/// Where the block at `address` leads on to `id`, if it does: the words of the block, which of them is the
/// link, and that.
fn way(arena: &Arena, address: Address, id: u64, level: u64) -> Option<(usize, usize, Link)> {
    let words = arena.from(address)?;
    let (bitmap, bit) = (words.first()?.load(), slot(id, level));
    let leads = bitmap & (1 << bit) != 0 && words.get(1)?.load() == prefix(id, level);
    let at = HEADER + rank(bitmap, bit);
    let len = HEADER + bitmap.count_ones() as usize;
    Some((len, at, words.get(at)?.load())).filter(|_| leads)
}

/// A block over two links whose ids differ, at the level of their highest difference.
fn join(writer: &mut Writer, a: (u64, Link), b: (u64, Link)) -> Result<Link, Full> {
    let level = u64::from((a.0 ^ b.0).ilog2()) / BITS;
    let mut block = Block {
        words: [0; LARGEST],
        len: HEADER,
    };
    block.words[1] = prefix(a.0, level);
    for (id, link) in [a, b] {
        block.insert(slot(id, level), link);
    }
    Ok(to_block(writer.write(block.words())?, level))
}

/// Takes node `id` out of the trie; the link to what is left, 0 where that is nothing.
pub(crate) fn remove(writer: &mut Writer, link: Link, id: u64) -> Result<Link, Full> {
    let address = address_of(link);
    if is_record(link) {
        let found = writer.arena().from(address).and_then(<[_]>::first);
        let found = found.map(Word::load);
        return Ok(if found == Some(id) { 0 } else { link });
    }
    if link == 0 {
        return Ok(0);
    }
    let level = level_of(link);
    let mut block = Block::read(writer, address);
    let bit = slot(id, level);
    if !block.has(bit) {
        return Ok(link);
    }
    let old = block.len;
    let at = block.at(bit);
    let below = remove(writer, block.words[at], id)?;
    if below == block.words[at] {
        return Ok(link);
    }
    if below == 0 {
        block.remove(bit);
    } else {
        block.words[at] = below;
    }
    // A block with one link is a level with nothing to choose.
    if block.len == HEADER + 1 {
        writer.retire(address, old);
        return Ok(block.words[HEADER]);
    }
    let address = writer.replace(address, old, block.words())?;
    Ok(to_block(address, level))
}

/// Gives `found` the ids under two links whose records may differ: those on all ways that the two do not
/// share. `Err` where one leads to an impossible place.
pub(crate) fn differences(
    arena: &Arena,
    [a, b]: [Link; 2],
    above: u64,
    found: &mut Vec<u64>,
) -> Result<(), Address> {
    if a == b {
        return Ok(());
    }
    let level = level_of(a);
    if let (Some(one), Some(other)) = (block(arena, a)?, block(arena, b)?)
        && level == level_of(b)
        && level < above
        && one[1].load() == other[1].load()
    {
        let link = |words: &[Word], bit: u64| {
            let bitmap = words[0].load();
            match bitmap & (1 << bit) {
                0 => 0,
                _ => words.get(HEADER + rank(bitmap, bit)).map_or(0, Word::load),
            }
        };
        let either = one[0].load() | other[0].load();
        for bit in (0..WIDTH).filter(|bit| either & (1 << bit) != 0) {
            differences(arena, [link(one, bit), link(other, bit)], level, found)?;
        }
        return Ok(());
    }
    for link in [a, b] {
        let mut walk = Walk::new(link);
        while let Some((_, words)) = walk.next(arena)? {
            found.extend(words.first().map(Word::load));
        }
    }
    Ok(())
}

/// The words of the block that a link leads to, two at the least; `None` where it leads to a record or
/// nowhere.
fn block(arena: &Arena, link: Link) -> Result<Option<&[Word]>, Address> {
    if link == 0 || is_record(link) {
        return Ok(None);
    }
    let address = address_of(link);
    let words = arena.from(address).filter(|words| words.len() >= HEADER);
    words.map(Some).ok_or(address)
}

/// Walks the records by ascending id.
///
/// In a damaged arena blocks may lead to themselves or to each other. The walk ends all the same, for
/// levels fall from block to block, no block is empty, and ids ascend.
#[derive(Debug, Clone)]
pub(crate) struct Walk {
    /// Links still to follow, last first, each with the level that its block must lie below.
    stack: Vec<(Link, u64)>,
    last: Option<u64>,
}

impl Walk {
    pub(crate) fn new(root: Link) -> Self {
        Self {
            stack: (root != 0).then_some((root, LEVELS)).into_iter().collect(),
            last: None,
        }
    }

    /// The next record; `Err` where the trie leads to an impossible place.
    pub(crate) fn next<'a>(
        &mut self,
        arena: &'a Arena,
    ) -> Result<Option<(Address, &'a [Word])>, Address> {
        while let Some((link, above)) = self.stack.pop() {
            let address = address_of(link);
            let words = arena.from(address).ok_or(address)?;
            let first = words.first().ok_or(address)?.load();
            if is_record(link) {
                if self.last.is_some_and(|last| first <= last) {
                    return Err(address);
                }
                self.last = Some(first);
                return Ok(Some((address, words)));
            }
            let level = level_of(link);
            if level >= above || first == 0 {
                return Err(address);
            }
            let links = words
                .get(HEADER..HEADER + first.count_ones() as usize)
                .ok_or(address)?;
            let links = links.iter().rev().map(|link| (link.load(), level));
            self.stack.extend(links);
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arena::allocator::{Growth, HeapGrowth};

    const BLOCK: Address = 90_000;
    const RECORD: Address = 100_000;

    /// An arena with a block of as many links as one can have, all to `link`, and a record.
    fn arena(link: Link) -> Arena {
        let arena = Arena::new(1, 17);
        HeapGrowth.grow(&arena, 0).unwrap();
        let block = arena.block(BLOCK, HEADER + 64).unwrap();
        block[0].store(u64::MAX);
        for word in &block[HEADER..] {
            word.store(link);
        }
        arena.block(RECORD, 1).unwrap()[0].store(5);
        arena
    }

    /// A walk once put all links of such a block on its stack, over and over, for as long as the
    /// root said that there were nodes left.
    #[test]
    fn a_block_that_leads_to_itself_ends_a_walk() {
        let link = to_block(BLOCK, 3);
        let end = Walk::new(link).next(&arena(link)).map(|_| ());
        assert_eq!(end, Err(BLOCK));
    }

    #[test]
    fn a_record_counts_once() {
        let arena = arena(to_record(RECORD));
        let mut walk = Walk::new(to_block(BLOCK, 0));
        let mut next = || {
            walk.next(&arena)
                .map(|found| found.map(|(address, _)| address))
        };
        assert_eq!(next(), Ok(Some(RECORD)));
        assert_eq!(next(), Err(RECORD));
    }

    #[test]
    fn an_empty_block_is_damage() {
        let arena = arena(0);
        arena.block(BLOCK, 1).unwrap()[0].store(0);
        let end = Walk::new(to_block(BLOCK, 0)).next(&arena).map(|_| ());
        assert_eq!(end, Err(BLOCK));
    }
}
