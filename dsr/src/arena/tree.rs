//! Ordered maps from a key of two words to one word: a B+ tree of immutable blocks. Adjacency,
//! names, and the members of types and labels are such maps, so that what is read together lies
//! together: a scan costs a few loads per entry.
//!
//! Block: `count << 1`, plus 1 in an inner block; then `count` entries of (key, key, word) in
//! ascending order. In an inner block the word is a child's address and the key the least in it.
//! An empty tree is address 0.

use super::allocator::Full;
use super::{Address, Arena, Word};
use crate::graph::Writer;

pub(crate) type Key = [u64; 2];
pub(crate) type Entry = (Key, u64);

const CAPACITY: usize = 32;
/// No tree is deeper; a deeper one is damaged.
const MAX_DEPTH: usize = 20;

#[derive(Debug, Clone, Copy)]
struct Block<'a> {
    inner: bool,
    len: usize,
    words: &'a [Word],
}

impl<'a> Block<'a> {
    #[inline]
    fn at(arena: &'a Arena, address: Address) -> Result<Self, Address> {
        let words = arena.from(address).ok_or(address)?;
        let head = words.first().ok_or(address)?.load();
        let len = (head >> 1) as usize;
        if len == 0 || len > CAPACITY {
            return Err(address);
        }
        let words = words.get(1..=3 * len).ok_or(address)?;
        Ok(Self {
            inner: head & 1 == 1,
            len,
            words,
        })
    }

    #[inline]
    fn len(&self) -> usize {
        self.len
    }

    #[inline]
    fn key(&self, index: usize) -> Key {
        [
            self.words[3 * index].load(),
            self.words[3 * index + 1].load(),
        ]
    }

    #[inline]
    fn word(&self, index: usize) -> u64 {
        self.words[3 * index + 2].load()
    }

    /// How many keys are smaller than `key`.
    #[inline]
    fn lower_bound(&self, key: Key) -> usize {
        let whole = |[a, b]: Key| u128::from(a) << 64 | u128::from(b);
        let key = whole(key);
        let (mut low, mut left) = (0, self.len());
        // Where it goes on is chosen without a branch, which no processor could foretell.
        while left > 0 {
            let half = left / 2;
            let smaller = whole(self.key(low + half)) < key;
            low += usize::from(smaller) * (left - half);
            left = half;
        }
        low
    }

    /// The child that `key` belongs to.
    #[inline]
    fn child_of(&self, key: Key) -> usize {
        let after = self.lower_bound(key);
        if after < self.len() && self.key(after) == key {
            after
        } else {
            after.saturating_sub(1)
        }
    }
}

/// The word at `key`; `Err` where the tree leads to an impossible place.
pub(crate) fn find(arena: &Arena, root: Address, key: Key) -> Result<Option<u64>, Address> {
    if root == 0 {
        return Ok(None);
    }
    let mut address = root;
    for _ in 0..MAX_DEPTH {
        let block = Block::at(arena, address)?;
        if block.inner {
            address = block.word(block.child_of(key));
            continue;
        }
        let index = block.lower_bound(key);
        let found = index < block.len() && block.key(index) == key;
        return Ok(found.then(|| block.word(index)));
    }
    Err(address)
}

/// The entries from `from` on that lie in one leaf, three words each, and a key from which on to go
/// for those of the next.
#[inline]
pub(crate) fn leaf(
    arena: &Arena,
    root: Address,
    from: Key,
) -> Result<(&[[Word; 3]], Option<Key>), Address> {
    let mut next = None;
    if root == 0 {
        return Ok((&[], next));
    }
    let mut address = root;
    for _ in 0..MAX_DEPTH {
        let block = Block::at(arena, address)?;
        if block.inner {
            let child = block.child_of(from);
            if child + 1 < block.len() {
                next = Some(block.key(child + 1));
            }
            address = block.word(child);
            continue;
        }
        let (entries, _) = block.words.as_chunks();
        // Most nodes have edges of few labels, so that often the first is the one.
        let first = if from <= block.key(0) {
            0
        } else {
            block.lower_bound(from)
        };
        return Ok((entries.get(first..).ok_or(address)?, next));
    }
    Err(address)
}

/// Walks the entries from `from` to `to` (both included) in ascending order.
#[derive(Debug, Clone)]
pub(crate) struct Range<'a> {
    arena: &'a Arena,
    /// Inner blocks on the way down, with the next child to visit.
    path: Vec<(Block<'a>, usize)>,
    /// What is left of the leaf at hand, three words an entry.
    leaf: std::slice::ChunksExact<'a, Word>,
    to: Key,
    /// The last key of that leaf.
    last: Option<Key>,
}

impl<'a> Range<'a> {
    pub(crate) fn new(
        arena: &'a Arena,
        root: Address,
        from: Key,
        to: Key,
    ) -> Result<Self, Address> {
        let mut range = Self {
            arena,
            path: Vec::new(),
            leaf: [].chunks_exact(3),
            to,
            last: None,
        };
        if root != 0 && from <= to {
            range.descend(root, Some(from))?;
        }
        Ok(range)
    }

    fn descend(&mut self, root: Address, from: Option<Key>) -> Result<(), Address> {
        let mut address = root;
        while self.path.len() < MAX_DEPTH {
            let block = Block::at(self.arena, address)?;
            if block.inner {
                let child = from.map_or(0, |key| block.child_of(key));
                self.path.push((block, child + 1));
                address = block.word(child);
                continue;
            }
            let first = from.map_or(0, |key| block.lower_bound(key));
            let last = block.key(block.len() - 1);
            // Ascending keys also bound the walk in a damaged arena.
            if self.last.is_some_and(|before| block.key(0) <= before) {
                return Err(address);
            }
            self.last = Some(last);
            let end = if last <= self.to {
                block.len()
            } else {
                self.path.clear();
                let after = block.lower_bound(self.to);
                after + usize::from(after < block.len() && block.key(after) == self.to)
            };
            let entries = block.words.get(3 * first..3 * end.max(first));
            self.leaf = entries.unwrap_or(&[]).chunks_exact(3);
            return Ok(());
        }
        Err(address)
    }

    /// The next entry; `Err` where the tree leads to an impossible place.
    pub(crate) fn next(&mut self) -> Result<Option<Entry>, Address> {
        loop {
            if let Some(entry) = self.next_in_leaf() {
                return Ok(Some(entry));
            }
            if !self.next_leaf()? {
                return Ok(None);
            }
        }
    }

    /// The next entry of the leaf at hand.
    #[inline]
    pub(crate) fn next_in_leaf(&mut self) -> Option<Entry> {
        let [a, b, word] = self.leaf.next()? else {
            return None;
        };
        Some(([a.load(), b.load()], word.load()))
    }

    /// Goes on to the next leaf, if there is one.
    pub(crate) fn next_leaf(&mut self) -> Result<bool, Address> {
        while let Some((block, child)) = self.path.pop() {
            if child < block.len() {
                self.path.push((block, child + 1));
                self.descend(block.word(child), None)?;
                return Ok(true);
            }
        }
        Ok(false)
    }
}

fn read(arena: &Arena, address: Address) -> (bool, Vec<Entry>) {
    Block::at(arena, address).map_or((false, Vec::new()), |block| {
        (
            block.inner,
            (0..block.len())
                .map(|i| (block.key(i), block.word(i)))
                .collect(),
        )
    })
}

fn encode(inner: bool, entries: &[Entry]) -> Vec<u64> {
    let mut words = Vec::with_capacity(1 + 3 * entries.len());
    words.push((entries.len() as u64) << 1 | u64::from(inner));
    words.extend(entries.iter().flat_map(|&([a, b], word)| [a, b, word]));
    words
}

fn words_of(entries: usize) -> usize {
    1 + 3 * entries
}

/// Sets `key` to `word`; the new root.
pub(crate) fn insert(
    writer: &mut Writer,
    root: Address,
    key: Key,
    word: u64,
) -> Result<Address, Full> {
    if root == 0 {
        return writer.write(&encode(false, &[(key, word)]));
    }
    let (left, right) = insert_at(writer, root, key, word)?;
    let Some((right_key, right)) = right else {
        return Ok(left);
    };
    let (_, entries) = read(writer.arena(), left);
    let left_key = entries.first().map_or(key, |entry| entry.0);
    writer.write(&encode(true, &[(left_key, left), (right_key, right)]))
}

/// Sets what `key` leads to, if it leads to something already; the new root, and what that was.
pub(crate) fn set(
    writer: &mut Writer,
    root: Address,
    key: Key,
    word: u64,
) -> Result<Option<(Address, u64)>, Full> {
    if root == 0 {
        return Ok(None);
    }
    let Ok(block) = Block::at(writer.arena(), root) else {
        return Ok(None);
    };
    let (len, inner) = (words_of(block.len()), block.inner);
    let index = if inner {
        block.child_of(key)
    } else {
        block.lower_bound(key)
    };
    let below = (index < block.len()).then(|| (block.key(index), block.word(index)));
    let new = match below {
        Some((_, child)) if inner => set(writer, child, key, word)?,
        Some((found, before)) if found == key => Some((word, before)),
        _ => None,
    };
    let Some((new, before)) = new else {
        return Ok(None);
    };
    let root = writer.change(root, len, words_of(index) + 2, new)?;
    Ok(Some((root, before)))
}

type Split = Option<(Key, Address)>;

fn insert_at(
    writer: &mut Writer,
    address: Address,
    key: Key,
    word: u64,
) -> Result<(Address, Split), Full> {
    let (inner, mut entries) = read(writer.arena(), address);
    let old = entries.len();
    let after = entries.partition_point(|entry| entry.0 < key);
    let exact = entries.get(after).is_some_and(|entry| entry.0 == key);
    let mut at_end = after == old;
    if inner {
        let child = if exact {
            after
        } else {
            after.saturating_sub(1)
        };
        at_end = child + 1 == old;
        let (below, split) = insert_at(writer, entries[child].1, key, word)?;
        if below == entries[child].1 && split.is_none() && entries[child].0 <= key {
            return Ok((address, None));
        }
        entries[child] = (entries[child].0.min(key), below);
        if let Some(split) = split {
            entries.insert(child + 1, split);
        }
    } else if exact {
        if entries[after].1 == word {
            return Ok((address, None));
        }
        entries[after].1 = word;
    } else {
        entries.insert(after, (key, word));
    }
    if entries.len() <= CAPACITY {
        let block = writer.replace(address, words_of(old), &encode(inner, &entries))?;
        return Ok((block, None));
    }
    // Keys that come in ascending order leave full blocks behind, not half empty ones.
    let keep = if at_end {
        CAPACITY * 7 / 8
    } else {
        CAPACITY / 2
    };
    let right = writer.write(&encode(inner, &entries[keep..]))?;
    let left = writer.replace(address, words_of(old), &encode(inner, &entries[..keep]))?;
    Ok((left, Some((entries[keep].0, right))))
}

/// Takes `key` out; the new root, 0 where the tree is empty.
pub(crate) fn remove(writer: &mut Writer, root: Address, key: Key) -> Result<Address, Full> {
    if root == 0 {
        return Ok(0);
    }
    let mut root = remove_at(writer, root, key)?;
    // A root with one child is its child.
    while root != 0 {
        let (inner, entries) = read(writer.arena(), root);
        if !inner || entries.len() != 1 {
            break;
        }
        writer.retire(root, words_of(1));
        root = entries[0].1;
    }
    Ok(root)
}

fn remove_at(writer: &mut Writer, address: Address, key: Key) -> Result<Address, Full> {
    let (inner, mut entries) = read(writer.arena(), address);
    let old = entries.len();
    let after = entries.partition_point(|entry| entry.0 < key);
    let exact = entries.get(after).is_some_and(|entry| entry.0 == key);
    if inner {
        let child = if exact {
            after
        } else {
            after.saturating_sub(1)
        };
        let below = remove_at(writer, entries[child].1, key)?;
        if below == entries[child].1 {
            return Ok(address);
        }
        if below == 0 {
            entries.remove(child);
        } else {
            entries[child].1 = below;
            merge(writer, &mut entries, child)?;
        }
    } else if exact {
        entries.remove(after);
    } else {
        return Ok(address);
    }
    if entries.is_empty() {
        writer.retire(address, words_of(old));
        return Ok(0);
    }
    writer.replace(address, words_of(old), &encode(inner, &entries))
}

/// Joins child `index` with a neighbour where both fit in half a block.
fn merge(writer: &mut Writer, entries: &mut Vec<Entry>, index: usize) -> Result<(), Full> {
    let left = index.saturating_sub(1);
    for left in left..=index.min(entries.len().saturating_sub(2)) {
        let Some(&[(_, a), (_, b)]) = entries.get(left..left + 2).and_then(|e| e.first_chunk())
        else {
            return Ok(());
        };
        let (inner, mut joined) = read(writer.arena(), a);
        let (_, right) = read(writer.arena(), b);
        if joined.len() + right.len() <= CAPACITY / 2 {
            let old = joined.len();
            writer.retire(b, words_of(right.len()));
            joined.extend(right);
            entries[left].1 = writer.replace(a, words_of(old), &encode(inner, &joined))?;
            entries.remove(left + 1);
            return Ok(());
        }
    }
    Ok(())
}
