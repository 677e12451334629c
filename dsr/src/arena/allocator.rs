//! The writer's side of the arena: gives out blocks, takes back those that no readable version
//! reaches. This file guarantees that a block is given out again only after the versions that
//! reach it were declared unreadable.

use super::{Address, Arena, FIRST_BLOCK, Word};
use crate::shm::Segment;
use rustc_hash::FxHashSet;
use std::collections::VecDeque;

/// A block that the next published version does not reach any more.
#[derive(Debug)]
struct Retired {
    /// The last version that reaches it.
    version: u64,
    address: Address,
    words: usize,
}

/// There is no room for another block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Full;

/// Adds segments to the arena on demand.
pub(crate) trait Growth: Send + std::fmt::Debug {
    /// Makes segment `index` of the arena, if there is room for it.
    fn grow(&mut self, arena: &Arena, index: usize) -> Result<(), Full>;
    /// Makes sure that words `from..to` of segment `index` are backed by memory, so that writing
    /// to them cannot fail.
    fn reserve(&mut self, index: usize, from: usize, to: usize) -> Result<(), Full>;
}

/// Growth on the heap of one process.
#[derive(Debug)]
pub(crate) struct HeapGrowth;

impl Growth for HeapGrowth {
    fn grow(&mut self, arena: &Arena, index: usize) -> Result<(), Full> {
        if index >= arena.capacity() {
            return Err(Full);
        }
        let words = (0..arena.segment_words()).map(|_| Word::default());
        arena.attach(index, Segment::on_heap(words.collect()));
        Ok(())
    }
    fn reserve(&mut self, _: usize, _: usize, _: usize) -> Result<(), Full> {
        Ok(())
    }
}

/// Memory is made sure of in steps of this many words (1 MiB).
const RESERVE_STEP: usize = 1 << 17;

#[derive(Debug)]
pub(crate) struct Allocator {
    growth: Box<dyn Growth>,
    /// Next word never given out.
    next: Address,
    /// Words of the current segment that are backed by memory, as an address.
    reserved: Address,
    /// Free blocks by size class.
    free: Vec<Vec<Address>>,
    retired: VecDeque<Retired>,
    retired_words: usize,
    /// Blocks given out since the last version: still private to the writer.
    fresh: FxHashSet<Address>,
    /// All blocks given out since the last version, with their words.
    given: Vec<(Address, usize)>,
    /// Blocks retired since the last version, taken back if the commit fails.
    pending: Vec<(Address, usize)>,
    in_use: usize,
}

impl Allocator {
    /// An allocator for an empty arena whose segment 0 is there.
    pub(crate) fn new(growth: Box<dyn Growth>) -> Self {
        Self {
            growth,
            next: FIRST_BLOCK,
            reserved: 0,
            free: Vec::new(),
            retired: VecDeque::new(),
            retired_words: 0,
            fresh: FxHashSet::default(),
            given: Vec::new(),
            pending: Vec::new(),
            in_use: 0,
        }
    }

    /// Bytes in blocks that are given out or still readable.
    pub(crate) fn bytes_in_use(&self) -> u64 {
        (self.in_use * 8) as u64
    }

    /// A block of at least `words` words with unspecified content.
    pub(crate) fn allocate(&mut self, arena: &Arena, words: usize) -> Result<Address, Full> {
        let (class, size) = size_class(words);
        let address = match self.free.get_mut(class).and_then(Vec::pop) {
            Some(address) => address,
            None => self.bump(arena, size)?,
        };
        self.in_use += size;
        self.fresh.insert(address);
        self.given.push((address, words));
        Ok(address)
    }

    fn bump(&mut self, arena: &Arena, size: usize) -> Result<Address, Full> {
        let segment_words = arena.segment_words();
        if size > segment_words - FIRST_BLOCK as usize {
            return Err(Full);
        }
        let end = |address: Address| (address as usize & (segment_words - 1)) + size;
        if end(self.next) > segment_words || self.next as usize & (segment_words - 1) == 0 {
            let index = (self.next as usize).div_ceil(segment_words);
            self.growth.grow(arena, index)?;
            arena.announce_segments(index as u64 + 1);
            self.next = (index * segment_words) as Address;
            self.reserved = self.next;
        }
        let after = self.next + size as Address;
        if after > self.reserved {
            let segment = self.next as usize / segment_words;
            let base = (segment * segment_words) as Address;
            let to = ((after - base) as usize)
                .next_multiple_of(RESERVE_STEP)
                .min(segment_words);
            self.growth
                .reserve(segment, self.reserved.saturating_sub(base) as usize, to)?;
            self.reserved = base + to as Address;
        }
        let address = self.next;
        self.next = after;
        Ok(address)
    }

    /// Whether the block is private to the writer still, so that it may be changed in place.
    pub(crate) fn is_fresh(&self, address: Address) -> bool {
        self.fresh.contains(&address)
    }

    /// Gives a block up: at once if no version reaches it, else once those are unreadable.
    pub(crate) fn retire(&mut self, address: Address, words: usize) {
        if self.fresh.remove(&address) {
            self.release(address, words);
        } else {
            self.pending.push((address, words));
        }
    }

    fn release(&mut self, address: Address, words: usize) {
        let (class, size) = size_class(words);
        if self.free.len() <= class {
            self.free.resize_with(class + 1, Vec::new);
        }
        self.free[class].push(address);
        self.in_use -= size;
    }

    /// The commit that followed version `version` succeeded: what it retired stays readable in
    /// versions up to that one.
    pub(crate) fn committed(&mut self, version: u64) {
        self.fresh.clear();
        self.given.clear();
        for (address, words) in self.pending.drain(..) {
            self.retired_words += size_class(words).1;
            self.retired.push_back(Retired {
                version,
                address,
                words,
            });
        }
    }

    /// The commit failed: its blocks are free again, and what it retired is not.
    pub(crate) fn abandoned(&mut self) {
        self.pending.clear();
        // From the newest back: a block that was given up and given out again counts with its
        // last size, which shares its class with the others.
        while let Some((address, words)) = self.given.pop() {
            if self.fresh.remove(&address) {
                self.release(address, words);
            }
        }
    }

    /// Frees blocks of old versions until at most `keep_bytes` of them are left.
    pub(crate) fn reclaim(&mut self, arena: &Arena, keep_bytes: usize) {
        let mut count: usize = 0;
        let mut words = self.retired_words;
        for block in &self.retired {
            if words * 8 <= keep_bytes {
                break;
            }
            words -= size_class(block.words).1;
            count += 1;
        }
        // A version is given up as a whole.
        let Some(last) = count.checked_sub(1).and_then(|i| self.retired.get(i)) else {
            return;
        };
        let last = last.version;
        arena.forget_before(last + 1);
        while self
            .retired
            .front()
            .is_some_and(|block| block.version <= last)
        {
            if let Some(block) = self.retired.pop_front() {
                self.retired_words -= size_class(block.words).1;
                self.release(block.address, block.words);
            }
        }
    }
}

/// The size class of a block and the words that it takes: steps of 4 words up to 64, then of an
/// eighth of the power of two, so that no more than an eighth is lost.
fn size_class(words: usize) -> (usize, usize) {
    if words <= 64 {
        let class = words.max(1).div_ceil(4);
        return (class, class * 4);
    }
    let top = (words - 1).ilog2();
    let step = 1usize << (top - 3);
    let steps = words.div_ceil(step);
    // `steps` lies in 9..=16, and 16 steps of one power are 8 of the next.
    (17 + (top as usize - 6) * 8 + (steps - 9), steps * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn size_classes_hold_what_they_promise_and_never_mix_sizes() {
        let mut sizes: Vec<Option<usize>> = Vec::new();
        for words in 1..100_000 {
            let (class, size) = size_class(words);
            assert!(size >= words, "{words}");
            assert!(size <= words + words / 8 + 4, "{words}: {size}");
            sizes.resize(sizes.len().max(class + 1), None);
            assert_eq!(
                *sizes[class].get_or_insert(size),
                size,
                "class {class} for {words}"
            );
        }
    }

    #[test]
    fn a_retired_block_comes_back_only_after_its_version_was_forgotten() {
        let arena = Arena::new(4, 17);
        let mut growth = HeapGrowth;
        growth.grow(&arena, 0).unwrap();
        let mut allocator = Allocator::new(Box::new(HeapGrowth));
        let block = allocator.allocate(&arena, 10).unwrap();
        allocator.committed(0);
        allocator.retire(block, 10);
        allocator.committed(1);
        assert_ne!(
            allocator.allocate(&arena, 10).unwrap(),
            block,
            "version 1 can still be read"
        );
        assert_eq!(arena.oldest(), 0);
        allocator.reclaim(&arena, 0);
        assert_eq!(arena.oldest(), 2);
        assert_eq!(allocator.allocate(&arena, 10).unwrap(), block);
    }
}
