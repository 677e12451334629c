//! The protocol of desks and slots: by example, against hostile words, and in every order in which
//! two processes may see each other's writes.

use super::*;
use crate::arena::Word;
use crate::arena::protocol::{self, tests::Modelled};
use loom::thread;
use proptest::prelude::*;
use std::sync::Arc;

const EPOCH: Epoch = Epoch(7);

fn page(words: usize) -> Vec<Word> {
    (0..words).map(|_| Word::default()).collect()
}

fn owner(agent: &str) -> Owner {
    Owner {
        client: 5,
        process: 6,
        agent: agent.to_owned(),
    }
}

#[test]
fn a_desk_is_its_owners_until_it_is_closed() {
    let desk = page(DESK_WORDS);
    assert_eq!(owner_of(&desk), None);
    assert!(!format(&desk, &owner(&"x".repeat(257))), "too long a name");
    assert_eq!(owner_of(&desk), None);
    let owner = owner(&"é".repeat(128));
    assert!(format(&desk, &owner));
    assert_eq!(owner_of(&desk), Some(owner));
    close(&desk);
    assert!(!is_open(&desk));
    assert_eq!(owner_of(&desk), None);
}

#[test]
fn a_request_is_taken_as_it_was_laid_down_by_the_store_that_it_is_for() {
    let desk = page(DESK_WORDS);
    let request = request_of(&desk);
    let mut bytes = vec![1];
    assert_eq!(take(request, state(request), EPOCH, &mut bytes), None);
    let room = (request.len() - 4) * 8;
    for (sequence, length) in [(1, 0), (2, 1), (3, 8), (4, 9), (5, room)] {
        let laid: Vec<u8> = (0..length).map(|i| i as u8).collect();
        let before = state(request);
        assert!(lay(request, sequence, EPOCH, &laid));
        assert_ne!(state(request), before);
        let now = state(request);
        assert_eq!(take(request, now, EPOCH, &mut bytes), Some(sequence));
        assert_eq!(bytes, laid);
        assert_eq!(take(request, now, Epoch(8), &mut bytes), None);
        assert_eq!(take(request, before, EPOCH, &mut bytes), None);
    }
    assert!(!lay(request, 6, EPOCH, &vec![0; room + 1]), "too long");
    assert_eq!(take(request, state(request), EPOCH, &mut bytes), Some(5));
}

#[test]
fn an_owner_that_died_while_it_wrote_leaves_no_request() {
    let desk = page(DESK_WORDS);
    let request = request_of(&desk);
    assert!(lay(request, 1, EPOCH, &[1, 2, 3]));
    request[request::STATE].store(5);
    assert_eq!(take(request, state(request), EPOCH, &mut Vec::new()), None);
}

#[test]
fn an_answer_is_to_one_request_of_one_client() {
    let slot = page(SLOT_WORDS);
    let mut bytes = Vec::new();
    assign(&slot, 5);
    assert!(is_of(&slot, 5) && !is_of(&slot, 6));
    assert_eq!(answered(&slot, 1, &mut bytes), None);
    answer(&slot, 1, Some(&[9; ANSWER_BYTES]));
    assert_eq!(answered(&slot, 2, &mut bytes), None);
    assert_eq!(answered(&slot, 1, &mut bytes), Some(Answered::Here));
    assert_eq!(bytes, [9; ANSWER_BYTES]);
    answer(&slot, 2, Some(&[9; ANSWER_BYTES + 1]));
    assert_eq!(answered(&slot, 2, &mut bytes), Some(Answered::ByRequest));
    answer(&slot, 3, None);
    assert_eq!(answered(&slot, 3, &mut bytes), Some(Answered::ByRequest));
    assign(&slot, 6);
    assert_eq!(answered(&slot, 3, &mut bytes), None);
}

proptest! {
    #[test]
    fn no_words_make_the_store_or_a_session_fail(
        words in prop::collection::vec(any::<u64>(), 0..2 * DESK_WORDS),
        small in prop::collection::vec(0..600u64, 0..64),
        at in 0..64usize,
    ) {
        let desk: Vec<Word> = words.iter().map(|_| Word::default()).collect();
        for (word, value) in desk.iter().zip(&words) {
            word.store(*value);
        }
        // Lengths and states that mean something.
        for (word, value) in desk.iter().skip(at).zip(&small) {
            word.store(*value);
        }
        if let Some(magic) = desk.first() {
            magic.store(MAGIC);
        }
        drop(owner_of(&desk));
        let request = request_of(&desk);
        let mut bytes = Vec::new();
        let epoch = Epoch(request.get(request::EPOCH).map_or(0, Word::load));
        take(request, state(request), epoch, &mut bytes);
        prop_assert!(bytes.len() <= 8 * DESK_WORDS.max(desk.len()));
        is_asleep(request);
        for sequence in [0, 1, words.first().map_or(0, |word| word >> 1)] {
            answered(&desk, sequence, &mut bytes);
        }
    }
}

fn checked(words: usize) -> Arc<[Modelled]> {
    Modelled::row(words).into()
}

#[test]
fn in_no_order_is_a_request_taken_in_halves() {
    loom::model(|| {
        let request = checked(6);
        let owners = Arc::clone(&request);
        let owner = thread::spawn(move || {
            for sequence in 1..=2u8 {
                // An owner that has given up writes over what the store may be reading.
                assert!(lay(&owners, sequence.into(), EPOCH, &[sequence; 16]));
            }
        });
        let mut bytes = Vec::new();
        let seen = state(&request);
        if let Some(sequence) = take(&request, seen, EPOCH, &mut bytes) {
            assert_eq!(bytes, [sequence as u8; 16]);
        }
        owner.join().unwrap();
    });
}

#[test]
fn in_no_order_is_an_answer_taken_in_halves() {
    loom::model(|| {
        let slot = checked(5);
        let stores = Arc::clone(&slot);
        let store = thread::spawn(move || answer(&stores, 1, Some(&[1; 16])));
        let mut bytes = Vec::new();
        if answered(&slot, 1, &mut bytes).is_some() {
            assert_eq!(bytes, [1; 16]);
        }
        store.join().unwrap();
    });
}

/// Of two that sleep, each unless it sees what it waits for and only then, one is always woken: the
/// store by the owner, the owner by the store.
#[test]
fn in_no_order_do_both_sleep() {
    loom::model(|| {
        let (request, slot, asleep) = (checked(5), checked(4), checked(1));
        let owner = {
            let (request, slot, asleep) =
                (Arc::clone(&request), Arc::clone(&slot), Arc::clone(&asleep));
            thread::spawn(move || {
                assert!(lay(&request, 1, EPOCH, &[1]));
                let rings = asleep[0].load(Relaxed) != 0;
                set_asleep(&request, true);
                let sleeps = answered(&slot, 1, &mut Vec::new()).is_none();
                (rings, sleeps)
            })
        };
        protocol::set_asleep(&asleep[0], true);
        let sleeps = state(&request) == 0;
        let mut wakes = false;
        if !sleeps {
            let mut bytes = Vec::new();
            if let Some(sequence) = take(&request, state(&request), EPOCH, &mut bytes) {
                answer(&slot, sequence, Some(&bytes));
                wakes = is_asleep(&request);
            }
        }
        let (rung, owner_sleeps) = owner.join().unwrap();
        assert!(rung || !sleeps, "the store sleeps with a request before it");
        let is_answered = answered(&slot, 1, &mut Vec::new()).is_some();
        assert!(
            wakes || !owner_sleeps || !is_answered,
            "the owner sleeps with an answer before it"
        );
    });
}
