//! Writes the blocks of the next version into the arena. Until it is published nobody sees any of them, and a
//! version that is abandoned leaves nothing behind.

use crate::arena::allocator::{Allocator, Full};
use crate::arena::{Address, Arena, Root, cells};
use std::sync::Arc;

/// Writes blocks into the arena.
#[derive(Debug)]
pub(crate) struct Writer {
    pub(super) arena: Arc<Arena>,
    pub(super) allocator: Allocator,
    /// Where a block's words are put together; empty between uses.
    pub(super) scratch: Vec<u64>,
    /// The nodes whose records the next version has elsewhere, and where; 0 for those that are gone.
    pub(super) moved: Vec<(u64, Address)>,
}

impl Writer {
    pub(super) fn new(arena: Arc<Arena>, allocator: Allocator) -> Self {
        Self {
            arena,
            allocator,
            scratch: Vec::new(),
            moved: Vec::new(),
        }
    }

    /// Makes `root` the version after `old`.
    pub(super) fn publish(&mut self, old: u64, root: &Root) {
        cells::set(&self.arena, root, &mut self.moved);
        self.arena.publish(root);
        self.allocator.committed(old, root.version);
    }

    /// Drops what was written since the last version.
    pub(super) fn abandon(&mut self) {
        self.moved.clear();
        self.allocator.abandoned();
    }

    pub(crate) fn arena(&self) -> &Arena {
        &self.arena
    }

    /// Writes a new block.
    pub(crate) fn write(&mut self, words: &[u64]) -> Result<Address, Full> {
        let address = self.allocator.allocate(&self.arena, words.len())?;
        self.fill(address, words);
        Ok(address)
    }

    fn fill(&self, address: Address, words: &[u64]) {
        let block = self.arena.block(address, words.len()).unwrap_or(&[]);
        for (to, from) in block.iter().zip(words) {
            to.store(*from);
        }
    }

    /// Writes `words` in place of the block of `old` words at `address`: into it where nobody
    /// else can see it yet and they fit, else into a new block.
    pub(crate) fn replace(
        &mut self,
        address: Address,
        old: usize,
        words: &[u64],
    ) -> Result<Address, Full> {
        if self.allocator.is_fresh(address) && words.len() == old {
            self.fill(address, words);
            return Ok(address);
        }
        let new = self.write(words)?;
        self.retire(address, old);
        Ok(new)
    }

    /// Writes what `encode` appends, in place of the `old` block and its words where there is one.
    pub(crate) fn put(
        &mut self,
        old: Option<(Address, usize)>,
        encode: impl FnOnce(&mut Vec<u64>),
    ) -> Result<Address, Full> {
        let mut words = std::mem::take(&mut self.scratch);
        words.clear();
        encode(&mut words);
        let put = match old {
            Some((address, len)) => self.replace(address, len, &words),
            None => self.write(&words),
        };
        self.scratch = words;
        put
    }

    /// Writes the block of `len` words at `address` again, with another word `at` one place.
    pub(crate) fn change(
        &mut self,
        address: Address,
        len: usize,
        at: usize,
        word: u64,
    ) -> Result<Address, Full> {
        let own = self.own(address, len)?;
        self.overwrite(own, at, &[word]);
        Ok(own)
    }

    /// Whether nobody else can see the block yet.
    pub(crate) fn is_own(&self, address: Address) -> bool {
        self.allocator.is_fresh(address)
    }

    /// A block like the one of `len` words at `address`, in its place, that may be written over: itself where
    /// nobody else can see it yet.
    fn own(&mut self, address: Address, len: usize) -> Result<Address, Full> {
        let own = self.copy(address, len)?;
        if own != address {
            self.retire(address, len);
        }
        Ok(own)
    }

    /// A block like the one of `len` words at `address` that may be written over: itself where nobody else can
    /// see it yet, else beside it.
    pub(crate) fn copy(&mut self, address: Address, len: usize) -> Result<Address, Full> {
        if self.is_own(address) {
            return Ok(address);
        }
        let new = self.allocator.allocate(&self.arena, len)?;
        let blocks = (self.arena.block(address, len), self.arena.block(new, len));
        if let (Some(from), Some(to)) = blocks {
            for (to, from) in to.iter().zip(from) {
                to.store(from.load());
            }
        }
        Ok(new)
    }

    /// Writes over words of an own block, from the one `at` a place on.
    pub(crate) fn overwrite(&self, own: Address, at: usize, words: &[u64]) {
        let block = self.arena.block(own, at + words.len()).unwrap_or(&[]);
        for (to, from) in block.iter().skip(at).zip(words) {
            to.store(*from);
        }
    }

    pub(crate) fn retire(&mut self, address: Address, words: usize) {
        if address != 0 {
            self.allocator.retire(address, words);
        }
    }
}
