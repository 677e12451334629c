//! Attributes that change faster than commits are worth: their one owner writes them into a page of
//! its own, over and over, and everybody reads them there. This file owns the page's layout and the
//! protocol by which the newest value is read whole, also while its owner is stopped or dies in the
//! middle of the next (a seqlock over two cells in turn); it knows no process.
//!
//! Page, in words: 0 magic, 1 the owner's session, 2 slots in use; from 16 on, slots of 32.
//! Slot: 0 how many values were written, 1 to 3 whose (node, 0, attribute; or source, target,
//! `attribute | label << 16 | 1 << 32`), from 4 and from 16 on a cell each. Cell: 0 epoch, from 1 on the
//! attribute as in a record's table. Words 1 to 3 are written once, before the slot is in use. Value n
//! is in cell n mod 2.

use crate::arena::protocol::Atomic;
use crate::arena::table::AttributeRecord;
use crate::shm::Segment;
use crate::{AttributeId, EdgeKey, Epoch, NodeId, Value, ValueKind};
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

/// Hot attributes that one owner can have.
pub(crate) const SLOTS: usize = 64;
const SLOT_WORDS: usize = 32;
const FIRST_SLOT: usize = 16;
/// Words of a page.
pub(crate) const PAGE_WORDS: usize = FIRST_SLOT + SLOTS * SLOT_WORDS;
const MAGIC: u64 = u64::from_le_bytes(*b"cortexH2");
/// Epoch and attribute: a header of three words and seven of value at the most.
const CONTENT: usize = 11;
/// How often a reader tries: it tries again only where two more values came while it read one.
const PATIENCE: u32 = 10_000;

mod at {
    pub(super) const SESSION: usize = 1;
    pub(super) const USED: usize = 2;
    pub(super) const KEY: usize = 1;
    pub(super) const CELLS: [usize; 2] = [4, 16];
}

/// Whose attribute a slot holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Key([u64; 3]);

impl Key {
    pub(crate) fn of_node(node: NodeId, attribute: AttributeId) -> Self {
        Self([node.0, 0, u64::from(attribute.0)])
    }

    pub(crate) fn of_edge(edge: EdgeKey, attribute: AttributeId) -> Self {
        let name = u64::from(attribute.0) | u64::from(edge.label.0) << 16 | 1 << 32;
        Self([edge.from.0, edge.to.0, name])
    }
}

/// Whether values of this kind have one size, so that they fit into a slot.
pub(crate) fn has_fixed_size(kind: ValueKind) -> bool {
    !matches!(
        kind,
        ValueKind::String
            | ValueKind::F64List
            | ValueKind::F32List
            | ValueKind::U8List
            | ValueKind::U64List
            | ValueKind::Large
    )
}

/// A page, and the session that it is of.
#[derive(Debug, Clone)]
pub(crate) struct Page {
    pub(crate) session: u64,
    pub(crate) segment: Arc<Segment>,
}

/// The pages that a snapshot reads besides its version.
#[derive(Debug, Clone)]
pub(crate) struct Hot {
    pub(crate) pages: Arc<Vec<Page>>,
    pub(crate) epoch: Epoch,
}

impl Hot {
    /// The hot value of an attribute that a session gives out, where there is one.
    pub(crate) fn read(&self, session: u64, key: Key) -> Option<AttributeRecord> {
        let page = self.pages.iter().find(|page| page.session == session)?;
        read(page.segment.words(), self.epoch, key)
    }
}

fn slot<W>(page: &[W], index: usize) -> Option<&[W; SLOT_WORDS]> {
    let start = FIRST_SLOT + index.min(SLOTS) * SLOT_WORDS;
    page.get(start..)?.first_chunk()
}

/// Makes a page of zeros one of that session's; the writer's first act.
pub(crate) fn format<W: Atomic>(page: &[W], session: u64) {
    if let [magic, of, ..] = page {
        of.store(session, Relaxed);
        magic.store(MAGIC, Release);
    }
}

/// The session that a page is of, where this is one.
pub(crate) fn session_of<W: Atomic>(page: &[W]) -> Option<u64> {
    let whole = page.len() >= PAGE_WORDS && page.first()?.load(Acquire) == MAGIC;
    whole.then(|| page[at::SESSION].load(Relaxed))
}

fn used<W: Atomic>(page: &[W]) -> usize {
    let used = page.get(at::USED).map_or(0, |word| word.load(Acquire));
    (used as usize).min(SLOTS)
}

fn find<W: Atomic>(page: &[W], key: Key) -> Option<usize> {
    (0..used(page)).find(|&index| {
        slot(page, index).is_some_and(|slot| {
            let found = slot[at::KEY..].iter().zip(key.0);
            found
                .take(3)
                .all(|(word, wanted)| word.load(Relaxed) == wanted)
        })
    })
}

/// The slot of an attribute, a new one if it has none; `None` where the page is full. For the
/// page's owner alone.
pub(crate) fn claim<W: Atomic>(page: &[W], key: Key) -> Option<usize> {
    if let Some(index) = find(page, key) {
        return Some(index);
    }
    let index = used(page);
    let (slot, count) = (slot(page, index)?, page.get(at::USED)?);
    if index >= SLOTS {
        return None;
    }
    for (word, value) in slot[at::KEY..].iter().zip(key.0) {
        word.store(value, Relaxed);
    }
    count.store(index as u64 + 1, Release);
    Some(index)
}

/// Writes a value that the owner gives out. For the page's owner alone.
///
/// `scratch` saves an allocation.
pub(crate) fn write<W: Atomic>(
    page: &[W],
    index: usize,
    epoch: Epoch,
    (value, time): (&Value, i64),
    scratch: &mut Vec<u64>,
) {
    let Some(slot) = slot(page, index) else {
        return;
    };
    scratch.clear();
    scratch.push(epoch.0);
    AttributeRecord::encode(scratch, value, (0, time, 0), None);
    let count = slot[0].load(Relaxed).wrapping_add(1);
    // Who sees any of what follows sees that the cell's last value is no longer the newest.
    W::fence(Release);
    for (to, from) in cell(slot, count).iter().zip(scratch.iter()) {
        to.store(*from, Relaxed);
    }
    slot[0].store(count, Release);
}

/// Where the value of that number is.
fn cell<W>(slot: &[W; SLOT_WORDS], count: u64) -> &[W] {
    let start = at::CELLS[(count & 1) as usize];
    &slot[start..start + CONTENT]
}

/// The value of an attribute, if the page has it: the newest at the time of the call or a later one,
/// never one that was not written so.
pub(crate) fn read<W: Atomic>(page: &[W], epoch: Epoch, key: Key) -> Option<AttributeRecord> {
    let slot = slot(page, find(page, key)?)?;
    for _ in 0..PATIENCE {
        let count = slot[0].load(Acquire);
        let mut words = [0; CONTENT];
        for (to, from) in words.iter_mut().zip(cell(slot, count)) {
            *to = from.load(Relaxed);
        }
        W::fence(Acquire);
        if slot[0].load(Relaxed) == count {
            // Nothing was written yet, or under another store, whose nodes were others.
            if count == 0 || words[0] != epoch.0 {
                return None;
            }
            return AttributeRecord::decode(&words[1..]);
        }
        W::pause();
    }
    None
}

#[cfg(test)]
mod model;
#[cfg(test)]
mod tests;
