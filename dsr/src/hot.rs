//! Attributes that change faster than commits are worth: their one owner writes them into a page of
//! its own, over and over, and everybody reads them there. This file owns the page's layout and the
//! protocol by which a value is read whole or not at all (a seqlock); it knows no process.
//!
//! Page, in words: 0 magic, 1 the owner's session, 2 slots in use; from 16 on, slots of 16.
//! Slot: 0 sequence (odd while it is written), 1 to 3 whose (node, 0, attribute; or source, target,
//! `attribute | label << 16 | 1 << 32`), 4 epoch, from 5 on the attribute as in a record's table. Words
//! 1 to 3 are written once, before the slot is in use.

use crate::arena::Word;
use crate::arena::table::AttributeRecord;
use crate::shm::Segment;
use crate::{AttributeId, EdgeKey, Epoch, NodeId, Value, ValueKind};
use std::sync::Arc;
use std::sync::atomic::{Ordering, fence};

/// Hot attributes that one owner can have.
pub(crate) const SLOTS: usize = 64;
const SLOT_WORDS: usize = 16;
const FIRST_SLOT: usize = 16;
/// Words of a page.
pub(crate) const PAGE_WORDS: usize = FIRST_SLOT + SLOTS * SLOT_WORDS;
const MAGIC: u64 = u64::from_le_bytes(*b"cortexH1");
/// Epoch and attribute: a header of three words and seven of value at the most.
const CONTENT: usize = 11;
/// How often a reader tries before it takes it that the owner died while it wrote.
const PATIENCE: u32 = 10_000;

mod at {
    pub(super) const SESSION: usize = 1;
    pub(super) const USED: usize = 2;
    pub(super) const KEY: usize = 1;
    pub(super) const CONTENT: usize = 4;
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

fn slot(page: &[Word], index: usize) -> Option<&[Word; SLOT_WORDS]> {
    let start = FIRST_SLOT + index.min(SLOTS) * SLOT_WORDS;
    page.get(start..)?.first_chunk()
}

/// Makes a page of zeros one of that session's; the writer's first act.
pub(crate) fn format(page: &[Word], session: u64) {
    if let [magic, of, ..] = page {
        of.store(session);
        magic.store_release(MAGIC);
    }
}

/// The session that a page is of, where this is one.
pub(crate) fn session_of(page: &[Word]) -> Option<u64> {
    let whole = page.len() >= PAGE_WORDS && page.first()?.load_acquire() == MAGIC;
    whole.then(|| page[at::SESSION].load())
}

fn used(page: &[Word]) -> usize {
    let used = page.get(at::USED).map_or(0, Word::load_acquire);
    (used as usize).min(SLOTS)
}

fn find(page: &[Word], key: Key) -> Option<usize> {
    (0..used(page)).find(|&index| {
        slot(page, index).is_some_and(|slot| {
            let found = slot[at::KEY..].iter().zip(key.0);
            found.take(3).all(|(word, wanted)| word.load() == wanted)
        })
    })
}

/// The slot of an attribute, a new one if it has none; `None` where the page is full. For the
/// page's owner alone.
pub(crate) fn claim(page: &[Word], key: Key) -> Option<usize> {
    if let Some(index) = find(page, key) {
        return Some(index);
    }
    let index = used(page);
    let (slot, count) = (slot(page, index)?, page.get(at::USED)?);
    if index >= SLOTS {
        return None;
    }
    for (word, value) in slot[at::KEY..].iter().zip(key.0) {
        word.store(value);
    }
    count.store_release(index as u64 + 1);
    Some(index)
}

/// Writes a value that the owner gives out. For the page's owner alone.
///
/// `scratch` saves an allocation.
pub(crate) fn write(
    page: &[Word],
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
    let sequence = slot[0].load();
    // Who sees any of what follows sees that the sequence is odd.
    slot[0].store(sequence | 1);
    fence(Ordering::Release);
    for (to, from) in slot[at::CONTENT..].iter().zip(scratch.iter()) {
        to.store(*from);
    }
    // An owner that died in the middle and came again left an odd one.
    slot[0].store_release((sequence | 1).wrapping_add(1));
}

/// The value of an attribute, if the page has it. Never one that was not written so: an owner that is
/// writing is waited for, for a moment.
pub(crate) fn read(page: &[Word], epoch: Epoch, key: Key) -> Option<AttributeRecord> {
    let slot = slot(page, find(page, key)?)?;
    for _ in 0..PATIENCE {
        let before = slot[0].load_acquire();
        let mut words = [0; CONTENT];
        for (to, from) in words.iter_mut().zip(&slot[at::CONTENT..]) {
            *to = from.load();
        }
        fence(Ordering::Acquire);
        if before & 1 == 0 && slot[0].load() == before {
            // Nothing was written yet, or under another store, whose nodes were others.
            if before == 0 || words[0] != epoch.0 {
                return None;
            }
            return AttributeRecord::decode(&words[1..]);
        }
        std::hint::spin_loop();
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LabelId, Pose};
    use nalgebra::{Translation3, UnitQuaternion};
    use std::sync::atomic::AtomicBool;

    const EPOCH: Epoch = Epoch(3);

    fn page() -> Arc<[Word]> {
        let page: Arc<[Word]> = (0..PAGE_WORDS).map(|_| Word::default()).collect();
        format(&page, 7);
        page
    }

    fn key(node: u64) -> Key {
        Key::of_node(NodeId(node), AttributeId(1))
    }

    #[test]
    fn a_value_is_read_as_it_was_written_last_under_this_store() {
        let page = page();
        assert_eq!(session_of(&page), Some(7));
        let index = claim(&page, key(5)).unwrap();
        assert_eq!(read(&page, EPOCH, key(5)), None, "not written yet");
        for (value, time) in [(Value::F64(1.5), 10), (Value::F64(2.5), 20)] {
            write(&page, index, EPOCH, (&value, time), &mut Vec::new());
            let read = read(&page, EPOCH, key(5)).unwrap();
            assert_eq!((read.value, read.head.time), (value, time));
        }
        assert_eq!(read(&page, EPOCH, key(6)), None);
        assert_eq!(read(&page, Epoch(4), key(5)), None, "another store's graph");
    }

    #[test]
    fn every_attribute_has_a_slot_of_its_own_until_the_page_is_full() {
        let page = page();
        let edge = EdgeKey {
            from: NodeId(0),
            label: LabelId(0),
            to: NodeId(0),
        };
        let first = claim(&page, Key::of_edge(edge, AttributeId(1))).unwrap();
        let mut slots = vec![first];
        slots.extend((0..SLOTS as u64 - 1).map(|node| claim(&page, key(node)).unwrap()));
        let distinct: std::collections::BTreeSet<_> = slots.iter().collect();
        assert_eq!(distinct.len(), SLOTS);
        assert_eq!(claim(&page, key(0)), Some(slots[1]), "claimed again");
        assert_eq!(claim(&page, key(1000)), None);
    }

    #[test]
    fn an_owner_that_died_while_it_wrote_leaves_no_value_and_its_next_life_gives_one() {
        let page = page();
        let index = claim(&page, key(1)).unwrap();
        write(&page, index, EPOCH, (&Value::U64(1), 1), &mut Vec::new());
        let words = slot(&page, index).unwrap();
        words[0].store(words[0].load() | 1);
        assert_eq!(read(&page, EPOCH, key(1)), None);
        write(&page, index, EPOCH, (&Value::U64(2), 2), &mut Vec::new());
        let read = read(&page, EPOCH, key(1)).unwrap();
        assert_eq!(read.value, Value::U64(2));
    }

    struct EndOnDrop<'a>(&'a AtomicBool);

    impl Drop for EndOnDrop<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Relaxed);
        }
    }

    #[test]
    fn no_value_is_read_in_halves_while_it_is_written() {
        let page = page();
        let index = claim(&page, key(1)).unwrap();
        let pose = |n: f64| {
            let rotation = UnitQuaternion::identity();
            Value::Pose(Pose::from_parts(Translation3::new(n, n, n), rotation))
        };
        write(&page, index, EPOCH, (&pose(0.0), 0), &mut Vec::new());
        let ended = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let mut scratch = Vec::new();
                for n in 1.. {
                    write(&page, index, EPOCH, (&pose(n as f64), n), &mut scratch);
                    if ended.load(Ordering::Relaxed) {
                        break;
                    }
                }
            });
            // Also where an assertion fails, or the writer would never end.
            let _end = EndOnDrop(&ended);
            let (mut last, mut reads) = (-1, 0);
            while reads < 200_000 || last < 1_000 {
                reads += 1;
                let read = read(&page, EPOCH, key(1));
                // The writer was stopped in the middle by the scheduler, or has not begun.
                let Some(read) = read.filter(|read| read.head.time > 0) else {
                    std::thread::yield_now();
                    continue;
                };
                let place = read.value.as_pose().unwrap().translation.vector;
                let numbers = [place.x, place.y, place.z].map(|number| number as i64);
                assert_eq!(numbers, [read.head.time; 3]);
                assert!(read.head.time >= last, "time ran back");
                last = read.head.time;
            }
        });
    }

    #[test]
    fn no_words_make_a_reader_fail() {
        let page = page();
        for (index, word) in page.iter().enumerate().skip(1) {
            word.store((index as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        }
        assert_eq!(read(&page, EPOCH, key(1)), None);
        for (index, word) in [key(1).0[0], 0, key(1).0[2], EPOCH.0].iter().enumerate() {
            page[FIRST_SLOT + 1 + index].store(*word);
        }
        page[FIRST_SLOT].store(2);
        drop(read(&page, EPOCH, key(1)));
        assert_eq!(read(&[], EPOCH, key(1)), None);
    }
}
