//! Pages as their owners and readers use them.

use super::*;
use crate::arena::Word;
use crate::{LabelId, Pose};
use nalgebra::{Translation3, UnitQuaternion};
use std::sync::atomic::{AtomicBool, Ordering};

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
fn a_value_stands_while_its_owner_is_in_the_middle_of_the_next_and_after_it_came_again() {
    let page = page();
    let index = claim(&page, key(1)).unwrap();
    let number = |n: u64| write(&page, index, EPOCH, (&Value::U64(n), 0), &mut Vec::new());
    let value = || read(&page, EPOCH, key(1)).map(|read| read.value);
    for n in 1..4 {
        number(n);
        let slot = slot(&page, index).unwrap();
        let next = cell(slot, slot[0].load() + 1);
        for word in &next[..CONTENT / 2] {
            word.store(u64::MAX);
        }
        assert_eq!(value(), Some(Value::U64(n)));
    }
    number(4);
    assert_eq!(value(), Some(Value::U64(4)));
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
        let (mut last, mut reads) = (0, 0);
        while reads < 200_000 || last < 1_000 {
            reads += 1;
            let read = read(&page, EPOCH, key(1)).unwrap();
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
    assert_eq!(read::<Word>(&[], EPOCH, key(1)), None);
}
