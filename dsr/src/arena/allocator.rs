//! The writer's side of the arena: gives out blocks, takes back those that no readable version
//! reaches. This file guarantees that a block is given out again only after the versions that
//! reach it were declared unreadable.

use super::{Address, Arena, FIRST_BLOCK};
use crate::shm::Segment;
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::VecDeque;
use std::time::Duration;

/// A block that the next published version does not reach any more.
#[derive(Debug)]
struct Retired {
    /// The last version that reaches it.
    version: u64,
    /// The first version that reaches it, or 0 where that is not known.
    created: u64,
    address: Address,
    words: usize,
}

impl Retired {
    /// Whether one of the versions reaches it.
    fn is_in(&self, versions: &[u64]) -> bool {
        let mut versions = versions.iter();
        versions.any(|version| (self.created..=self.version).contains(version))
    }
}

/// Versions are as old as the end of the span of so long that they were superseded in.
const SPAN: Duration = Duration::from_millis(100);

/// Words of a cache line.
const LINE: usize = 8;

/// A commit usually takes fewer blocks.
const USUAL: usize = 64;

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
        arena.attach(index, Segment::of_zeros(arena.segment_words()));
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
    /// Blocks given out since the last version, with their words: still private to the writer.
    given: Vec<(Address, usize)>,
    /// Once they are many, those of them that were not given up again.
    fresh: Option<FxHashSet<Address>>,
    /// Blocks retired since the last version, taken back if the commit fails.
    pending: Vec<(Address, usize)>,
    /// The size classes of the blocks that the last commit was given, where they were not many.
    last: Vec<(usize, usize)>,
    in_use: usize,
    /// Versions that leases keep.
    leased: Vec<u64>,
    /// While there are leases: the versions that blocks came with which are younger than the
    /// first of those leases.
    young: FxHashMap<Address, u64>,
    /// Blocks that only leased versions reach.
    held: Vec<Retired>,
    held_words: usize,
    /// The time, and when versions were superseded: the last of each span, and the span's end.
    now: Duration,
    ages: VecDeque<(u64, Duration)>,
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
            given: Vec::new(),
            fresh: None,
            pending: Vec::new(),
            last: Vec::new(),
            in_use: 0,
            leased: Vec::new(),
            young: FxHashMap::default(),
            held: Vec::new(),
            held_words: 0,
            now: Duration::ZERO,
            ages: VecDeque::new(),
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
        self.given.push((address, words));
        match &mut self.fresh {
            Some(fresh) => drop(fresh.insert(address)),
            None if self.given.len() > USUAL => {
                self.fresh = Some(self.given.iter().map(|(address, _)| *address).collect());
            }
            None => {}
        }
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

    /// Brings the blocks that a commit like the last one would be given into the processor's cache. They
    /// have not been used for as long as the history is, and fetching them takes as long as all else
    /// of a small commit; now nobody waits for it.
    pub(crate) fn prepare(&self, arena: &Arena) {
        let mut next = self.next;
        for (index, &(class, size)) in self.last.iter().enumerate() {
            let before = self.last[..index].iter();
            let before = before.filter(|(other, _)| *other == class).count();
            let free = self.free.get(class).map_or(&[][..], Vec::as_slice);
            let address = match free.len().checked_sub(before + 1) {
                Some(at) => free[at],
                None if next + size as Address <= self.reserved => {
                    next += size as Address;
                    next - size as Address
                }
                None => continue,
            };
            // What a free block holds nobody reads.
            for line in arena.block(address, size).unwrap_or(&[]).chunks(LINE) {
                line[0].store(0);
            }
        }
    }

    /// Whether the block is private to the writer still, so that it may be changed in place.
    pub(crate) fn is_fresh(&self, address: Address) -> bool {
        match &self.fresh {
            Some(fresh) => fresh.contains(&address),
            None => self.given.iter().any(|(given, _)| *given == address),
        }
    }

    /// Gives a block up: at once if no version reaches it, else once those are unreadable.
    pub(crate) fn retire(&mut self, address: Address, words: usize) {
        if self.take_fresh(address) {
            self.release(address, words);
        } else {
            self.pending.push((address, words));
        }
    }

    /// Takes a block from those that are private to the writer, if it is one.
    fn take_fresh(&mut self, address: Address) -> bool {
        if let Some(fresh) = &mut self.fresh {
            return fresh.remove(&address);
        }
        let at = self.given.iter().position(|(given, _)| *given == address);
        at.map(|at| self.given.remove(at)).is_some()
    }

    fn release(&mut self, address: Address, words: usize) {
        let (class, size) = size_class(words);
        if self.free.len() <= class {
            self.free.resize_with(class + 1, Vec::new);
        }
        self.free[class].push(address);
        self.in_use -= size;
    }

    /// The commit that made version `new` after `old` succeeded: what it retired stays readable
    /// in versions up to `old`.
    pub(crate) fn committed(&mut self, old: u64, new: u64) {
        if !self.leased.is_empty() {
            for (address, _) in &self.given {
                if self
                    .fresh
                    .as_ref()
                    .is_none_or(|fresh| fresh.contains(address))
                {
                    self.young.insert(*address, new);
                }
            }
        }
        self.last.clear();
        if self.given.len() <= USUAL {
            let given = self.given.iter();
            self.last.extend(given.map(|&(_, words)| size_class(words)));
        }
        self.given.clear();
        self.fresh = None;
        for (address, words) in self.pending.drain(..) {
            self.retired_words += size_class(words).1;
            self.retired.push_back(Retired {
                version: old,
                created: self.young.remove(&address).unwrap_or(0),
                address,
                words,
            });
        }
        match self.ages.back_mut() {
            Some((last, end)) if *end > self.now => *last = old,
            _ => self.ages.push_back((old, self.now + SPAN)),
        }
    }

    /// Tells the time, by a clock that does not run back.
    pub(crate) fn set_clock(&mut self, now: Duration) {
        self.now = self.now.max(now);
    }

    /// The commit failed: its blocks are free again, and what it retired is not.
    pub(crate) fn abandoned(&mut self) {
        self.pending.clear();
        // From the newest back: a block that was given up and given out again counts with its
        // last size, which shares its class with the others.
        while let Some((address, words)) = self.given.pop() {
            if self
                .fresh
                .as_mut()
                .is_none_or(|fresh| fresh.remove(&address))
            {
                self.release(address, words);
            }
        }
        self.fresh = None;
    }

    /// Gives up old versions until what only they reach takes at most `keep_bytes`, and those
    /// that were superseded longer than `keep_age` ago.
    pub(crate) fn reclaim(&mut self, arena: &Arena, keep_bytes: usize, keep_age: Duration) {
        let mut last = None;
        let mut words = self.retired_words;
        for block in &self.retired {
            if words * 8 <= keep_bytes {
                break;
            }
            words -= size_class(block.words).1;
            last = Some(block.version);
        }
        while let Some(&(version, end)) = self.ages.front()
            && end.saturating_add(keep_age) <= self.now
        {
            last = last.max(Some(version));
            self.ages.pop_front();
        }
        // A version is given up as a whole.
        let Some(last) = last.filter(|&last| last >= arena.oldest()) else {
            return;
        };
        arena.forget_before(last + 1);
        while let Some(block) = self.retired.pop_front() {
            if block.version > last {
                self.retired.push_front(block);
                break;
            }
            let words = size_class(block.words).1;
            self.retired_words -= words;
            if block.is_in(&self.leased) {
                self.held_words += words;
                self.held.push(block);
            } else {
                self.release(block.address, block.words);
            }
        }
        while self
            .ages
            .front()
            .is_some_and(|&(version, _)| version <= last)
        {
            self.ages.pop_front();
        }
    }

    /// Keeps what version `version` reaches, until [`Self::end_lease`].
    pub(crate) fn lease(&mut self, version: u64) {
        self.leased.push(version);
    }

    /// Ends a lease of that version; whoever reads by it must have been told before.
    pub(crate) fn end_lease(&mut self, version: u64) {
        if let Some(at) = self.leased.iter().position(|&leased| leased == version) {
            self.leased.swap_remove(at);
        }
        if self.leased.is_empty() {
            self.young = FxHashMap::default();
        }
        for block in std::mem::take(&mut self.held) {
            if block.is_in(&self.leased) {
                self.held.push(block);
            } else {
                self.held_words -= size_class(block.words).1;
                self.release(block.address, block.words);
            }
        }
    }

    /// Bytes that are kept for leases alone.
    pub(crate) fn held_bytes(&self) -> usize {
        self.held_words * 8
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
        allocator.committed(0, 1);
        allocator.retire(block, 10);
        allocator.committed(1, 2);
        assert_ne!(
            allocator.allocate(&arena, 10).unwrap(),
            block,
            "version 1 can still be read"
        );
        assert_eq!(arena.oldest(), 0);
        allocator.reclaim(&arena, 0, Duration::MAX);
        assert_eq!(arena.oldest(), 2);
        assert_eq!(allocator.allocate(&arena, 10).unwrap(), block);
    }

    /// A graph of 10,000 nodes that came in one commit once doubled the time of every later one.
    #[test]
    fn what_a_large_commit_took_to_remember_is_given_up_after_it() {
        let arena = Arena::new(4, 17);
        HeapGrowth.grow(&arena, 0).unwrap();
        let mut allocator = Allocator::new(Box::new(HeapGrowth));
        for succeeds in [true, false] {
            for _ in 0..10_000 {
                allocator.allocate(&arena, 1).unwrap();
            }
            if succeeds {
                allocator.committed(0, 1);
            } else {
                allocator.abandoned();
            }
            assert!(allocator.fresh.is_none());
        }
    }

    /// An arena that was formatted after it had grown once said that it had one segment, and readers
    /// went on without the others.
    #[test]
    fn an_arena_that_shows_itself_tells_of_all_its_segments() {
        let arena = Arena::new(4, 17);
        let mut growth = HeapGrowth;
        growth.grow(&arena, 0).unwrap();
        growth.grow(&arena, 1).unwrap();
        arena.format(crate::Epoch(1));
        assert_eq!(arena.announced_segments(), 2);
    }
}
