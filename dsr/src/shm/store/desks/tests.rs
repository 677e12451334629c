//! Sessions that ask at their desks of a store in the same process.

use super::*;
use crate::arena::Word;
use crate::desk::{DESK_WORDS, Owner};
use crate::shm::page::OwnPage;
use crate::shm::{Instance, Session};
use crate::{Commit, CommitError, Refusal, Schema, Transaction};
use std::sync::atomic::{AtomicBool, Ordering};

/// An instance that is removed at the end.
struct Place {
    instance: Instance,
    _folder: tempfile::TempDir,
}

impl Drop for Place {
    fn drop(&mut self) {
        self.instance.remove().unwrap();
    }
}

fn place(name: &str) -> Place {
    let folder = tempfile::tempdir().unwrap();
    let instance = Instance::within(folder.path(), name).unwrap();
    Place {
        instance,
        _folder: folder,
    }
}

/// Lets `store` serve while `agents` acts.
fn while_served(store: &mut Store, agents: impl FnOnce() + Send) {
    let ended = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let acting = scope.spawn(|| {
            struct End<'a>(&'a AtomicBool);
            impl Drop for End<'_> {
                fn drop(&mut self) {
                    self.0.store(true, Ordering::Release);
                }
            }
            let _end = End(&ended);
            agents();
        });
        while !ended.load(Ordering::Acquire) {
            store.serve(Duration::from_millis(5)).unwrap();
        }
        acting.join().unwrap();
    });
}

fn set(value: u64) -> Transaction {
    let mut transaction = Transaction::new();
    transaction.set("n", "a", crate::Value::U64(value));
    transaction
}

fn commit(session: &mut Session, transaction: &Transaction) -> Result<Commit, CommitError> {
    session.commit(transaction, Time::default())
}

/// Makes the node that the others write to; the version that this made.
fn begin(session: &mut Session) -> u64 {
    let mut transaction = Transaction::new();
    transaction.create_node("thing", "n", vec![]);
    commit(session, &transaction).unwrap().version.0
}

/// Commits until the store answers at the desk.
fn settle(session: &mut Session, mut version: u64) -> u64 {
    while !session.is_at_desk() {
        version += 1;
        let commit = commit(session, &set(version)).unwrap();
        assert_eq!(commit.version.0, version);
    }
    version
}

#[test]
fn a_session_comes_to_ask_without_messages_and_every_answer_finds_it() {
    let place = place("desk");
    let mut store = Store::open(&place.instance, Schema::open()).unwrap();
    let mut count = 0;
    while_served(&mut store, || {
        let patience = Duration::from_secs(20);
        let mut session = Session::attach(&place.instance, "one", patience).unwrap();
        let mut version = begin(&mut session);
        version = settle(&mut session, version);
        for spin in [Duration::ZERO, patience] {
            session.set_spin(spin);
            for _ in 0..100 {
                version += 1;
                let done = commit(&mut session, &set(version)).unwrap();
                assert_eq!(done.version.0, version);
            }
        }
        // Answers that are too long for a slot, requests that are too long for a desk.
        let mut unknown = Transaction::new();
        unknown.set("x".repeat(300).as_str(), "a", 1.0);
        let refused = commit(&mut session, &unknown).unwrap_err();
        assert!(
            matches!(&refused, CommitError::Refused(Refusal::NotFound(what)) if what.len() > 300),
            "{refused}"
        );
        let mut many = Transaction::new();
        for n in 0..500 {
            many.create_node("thing", &format!("node{n}"), vec![]);
        }
        assert_eq!(commit(&mut session, &many).unwrap().created.len(), 500);
        many = Transaction::new();
        for n in 0..30 {
            many.create_node("thing", &format!("other{n}"), vec![]);
        }
        let done = commit(&mut session, &many).unwrap();
        assert_eq!((done.created.len(), done.version.0), (30, version + 2));
        count = done.version.0;
        assert!(session.is_at_desk());
    });
    assert_eq!(store.graph.snapshot().version().0, count);
    store.desks.next_look = crate::shm::now();
    store.welcome(crate::shm::now()).unwrap();
    assert!(store.desks.adopted.is_empty(), "closed, and its slot free");
}

#[test]
fn what_lies_on_another_desk_harms_nobody() {
    let place = place("desks");
    let mut store = Store::open(&place.instance, Schema::open()).unwrap();
    let epoch = store.graph.epoch();
    while_served(&mut store, || {
        let patience = Duration::from_secs(20);
        let mut session = Session::attach(&place.instance, "one", patience).unwrap();
        let mut version = begin(&mut session);
        let node = place.instance.join().unwrap();
        let owner = Owner {
            client: 1,
            process: std::process::id(),
            agent: "two".to_owned(),
        };
        let page = OwnPage::open(&node, DESKS, DESK_WORDS, |words| {
            assert!(desk::format(words, &owner));
        });
        let page = page.unwrap();
        version = settle(&mut session, version);
        let request = desk::request_of(page.words());
        let mut number = 1u64;
        for round in 0..200 {
            number = number.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(1);
            match round % 4 {
                0 => assert!(desk::lay(
                    request,
                    number >> 1,
                    epoch,
                    &number.to_le_bytes()
                )),
                1 => request[0].store(number | 1),
                2 => request[3].store(number),
                _ => request
                    .iter()
                    .for_each(|word: &Word| word.store(number & !1)),
            }
            version += 1;
            let done = commit(&mut session, &set(version)).unwrap();
            assert_eq!(done.version.0, version, "nothing else was committed");
        }
        assert!(session.is_at_desk());
    });
}
