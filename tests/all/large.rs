//! Large values between real processes.

use crate::support::{Process, Program, TestInstance, within};
use dsr::{
    CommitError, LargeError, LargeHandle, LargeReadError, LargeSample, Owner, Refusal, Session,
    Time, Transaction, Value,
};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(20);
/// How many values of one stream a session can hold at least.
const HELD: usize = 8;

fn handle(session: &mut Session) -> Option<LargeHandle> {
    let snapshot = session.snapshot().unwrap();
    let camera = snapshot.find_node_by_name("camera").unwrap().unwrap();
    let value = camera.value("picture").unwrap();
    value.as_ref().and_then(Value::as_large).copied()
}

/// Looks for the newest picture, again where its owner was faster.
fn newest(session: &mut Session) -> LargeSample {
    loop {
        let Some(handle) = handle(session) else {
            std::thread::yield_now();
            continue;
        };
        match session.read_large(&handle, PATIENCE) {
            Ok(sample) => {
                assert_eq!(sample.handle(), &handle);
                return sample;
            }
            Err(LargeReadError::Overtaken { newest }) => assert!(newest > handle.sequence()),
            Err(other) => panic!("{other}"),
        }
    }
}

/// The number that the picture is full of, which is its own.
fn look(sample: &LargeSample) -> u64 {
    assert_eq!(sample.handle().shape(), [64, 128]);
    let numbers: &[u64] = sample.numbers().unwrap();
    assert_eq!(numbers.len(), 64 * 128);
    assert!(numbers.iter().all(|n| *n == sample.handle().sequence()));
    numbers[0]
}

#[test]
fn a_large_value_is_read_whole_stays_while_it_is_held_and_outlives_its_owner() {
    let instance = TestInstance::new("large");
    let store = Process::peer("large-store", &instance);
    let owner = Process::peer("large-camera", &instance);
    let mut session = Session::attach(&instance.0, "reader", PATIENCE).unwrap();
    let first = newest(&mut session);
    let n = look(&first);
    let mut last = n;
    while last < n + 300 {
        last = look(&newest(&mut session));
    }
    assert_eq!(look(&first), n, "held while 300 others were sent");
    // Who comes late gets the newest.
    let mut late = Session::attach(&instance.0, "late", PATIENCE).unwrap();
    assert!(look(&newest(&mut late)) >= last);
    owner.kill();
    let left = handle(&mut session).unwrap();
    // The store removes what the dead owner left; what is held stays.
    let mut stranger = Session::attach(&instance.0, "stranger", PATIENCE).unwrap();
    let gone = within(PATIENCE, || {
        let read = stranger.read_large(&left, Duration::ZERO);
        matches!(read, Err(LargeReadError::OwnerEnded)).then_some(())
    });
    assert!(gone.is_some());
    let files = |instance: &TestInstance| instance.0.shared_memory().unwrap().len();
    let before = files(&instance);
    drop((late, stranger));
    within(PATIENCE, || (files(&instance) < before).then_some(())).unwrap();
    assert_eq!(look(&first), n, "its owner is dead and cleaned up after");
    // The next owner begins a stream of its own; nothing of the old one is taken for it.
    let owner = Process::peer("large-camera", &instance);
    let next = within(PATIENCE, || {
        handle(&mut session).filter(|next| next.stream() != left.stream())
    });
    assert!(next.is_some());
    look(&newest(&mut session));
    assert_eq!(look(&first), n);
    owner.finish();
    drop((session, first));
    store.finish();
}

#[test]
fn readers_that_are_slow_or_stopped_keep_nobody_from_sending() {
    let instance = TestInstance::new("slow");
    let store = Process::peer("large-store", &instance);
    let owner = Process::peer("large-camera", &instance);
    let mut watchers: Vec<Process> = (0..3)
        .map(|_| Process::start("large-watch", &instance, &[]))
        .collect();
    for watcher in &mut watchers {
        assert_eq!(watcher.line(), "ready");
        watcher.stop();
    }
    let mut session = Session::attach(&instance.0, "reader", PATIENCE).unwrap();
    // A session that holds all it may is told so, and goes on once it lets go.
    let mut held: Vec<LargeSample> = Vec::new();
    let refused = within(PATIENCE, || {
        let handle = handle(&mut session).unwrap();
        match session.read_large(&handle, Duration::ZERO) {
            Ok(sample) => held.push(sample),
            Err(LargeReadError::TooManyHeld) => return Some(()),
            Err(_) => {}
        }
        None
    });
    assert!(refused.is_some());
    held.dedup_by_key(|sample| *sample.handle());
    assert!(held.len() >= HELD, "{} held", held.len());
    let from = held.last().unwrap().handle().sequence();
    let sent = within(PATIENCE, || {
        let handle = handle(&mut session).unwrap();
        (handle.sequence() > from + 500).then_some(())
    });
    assert!(sent.is_some(), "the owner goes on");
    let numbers: Vec<u64> = held.iter().map(look).collect();
    assert!(numbers.is_sorted());
    held.clear();
    assert!(look(&newest(&mut session)) > from + 500);
    for watcher in watchers {
        watcher.resume();
        assert!(watcher.finish().parse::<u64>().unwrap() > 0);
    }
    owner.finish();
    drop(session);
    store.finish();
}

#[test]
fn handles_that_lie_and_agents_without_the_right_get_an_answer() {
    let instance = TestInstance::new("liar");
    let store = Process::peer("large-store", &instance);
    let owner = Process::peer("large-still", &instance);
    let mut session = Session::attach(&instance.0, "tool", PATIENCE).unwrap();
    let good = handle(&mut session).unwrap();
    assert_eq!(look(&newest(&mut session)), 1);
    let read = |session: &mut Session, handle: LargeHandle| {
        session.read_large(&handle, Duration::ZERO).unwrap_err()
    };
    let forged = |stream, sequence, bytes, shape: &[u32]| {
        LargeHandle::new(stream, sequence, bytes, shape).unwrap()
    };
    let unknown = forged(good.stream() ^ 1, 1, good.bytes(), good.shape());
    let error = read(&mut session, unknown);
    assert!(matches!(error, LargeReadError::OwnerEnded), "{error}");
    let coming = forged(good.stream(), 2, good.bytes(), good.shape());
    let error = read(&mut session, coming);
    assert!(matches!(error, LargeReadError::NotArrived), "{error}");
    for (bytes, shape) in [(8, &[][..]), (u64::MAX, &[]), (good.bytes(), &[128, 64])] {
        let error = read(&mut session, forged(good.stream(), 1, bytes, shape));
        assert!(matches!(error, LargeReadError::Mismatch), "{error}");
    }
    // What cannot be is refused by the store, from whoever may write the attribute.
    for (bytes, shape) in [(65544, &[][..]), (9, &[]), (64, &[3, 3])] {
        let mut transaction = Transaction::new();
        transaction.set("camera", "picture", forged(1, 1, bytes, shape));
        let error = session.commit(&transaction, Time::default()).unwrap_err();
        let CommitError::Refused(Refusal::SchemaViolation(_)) = error else {
            panic!("{error}");
        };
    }
    // Who may not write the attribute sends into the void.
    let mut guest = Session::attach(&instance.0, "guest", PATIENCE).unwrap();
    let mut attribute = guest
        .large(Owner::Node("camera".into()), "picture")
        .unwrap();
    let mut transaction = Transaction::new();
    let loan = attribute.loan(8).unwrap();
    loan.send_into(&mut transaction, &[]).unwrap();
    let error = guest.commit(&transaction, Time::default()).unwrap_err();
    let CommitError::Refused(Refusal::NotAllowed(_)) = error else {
        panic!("{error}");
    };
    assert_eq!(handle(&mut session), Some(good));
    assert_eq!(look(&newest(&mut session)), 1);
    drop((attribute, guest, session));
    owner.finish();
    store.finish();
}

#[test]
fn the_terminal_shows_the_handle_and_writes_the_value() {
    let instance = TestInstance::new("saved");
    let store = Process::peer("large-store", &instance);
    let owner = Process::peer("large-still", &instance);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("picture");
    let file = file.to_str().unwrap();
    let get = |rest: &[&str]| {
        let name = instance.name();
        let arguments = [
            &["graph", "get", "camera.picture", "--instance", name],
            rest,
        ]
        .concat();
        Program::command(&arguments).output().unwrap()
    };
    let shown: serde_json::Value = serde_json::from_slice(&get(&[]).stdout).unwrap();
    assert_eq!(shown["type"], "large");
    assert_eq!(shown["value"]["shape"], serde_json::json!([64, 128]));
    assert!(get(&["--bytes", file]).status.success());
    let expected = 1u64.to_le_bytes().repeat(64 * 128);
    assert_eq!(std::fs::read(file).unwrap(), expected);
    owner.kill();
    let gone = get(&["--bytes", file]);
    assert_eq!(gone.status.code(), Some(1));
    let said = String::from_utf8(gone.stderr).unwrap();
    assert!(
        said.contains("the value is gone with the process"),
        "{said}"
    );
    store.finish();
}

#[test]
fn an_owner_fills_in_place_and_reads_its_own() {
    let instance = TestInstance::new("own");
    let store = Process::peer("large-store", &instance);
    let mut session = Session::attach(&instance.0, "tool", PATIENCE).unwrap();
    let mut attribute = session
        .large(Owner::Node("camera".into()), "picture")
        .unwrap();
    assert!(matches!(attribute.loan(65544), Err(LargeError::Schema(_))));
    assert!(matches!(attribute.loan(12), Err(LargeError::Schema(_))));
    // One that is not sent costs nothing, however often.
    for _ in 0..2000 {
        let mut loan = attribute.loan(65536).unwrap();
        assert_eq!(loan.as_ptr() as usize % 64, 0);
        loan.fill(1);
    }
    let mut transaction = Transaction::new();
    let loan = attribute.loan(48).unwrap();
    let error = loan.send_into(&mut transaction, &[2, 2]).unwrap_err();
    assert!(matches!(error, LargeError::Schema(_)), "{error}");
    let loan = attribute.loan(48).unwrap();
    let error = loan.send_into(&mut transaction, &[6, 0]).unwrap_err();
    assert!(matches!(error, LargeError::BadShape { .. }), "{error}");
    assert!(transaction.is_empty());
    let mut loan = attribute.loan(48).unwrap();
    assert!(loan.numbers_mut::<f64>().unwrap().len() == 6);
    loan.numbers_mut()
        .unwrap()
        .copy_from_slice(&[1u64, 2, 3, 4, 5, 6]);
    let handle = loan.send_into(&mut transaction, &[2, 3]).unwrap();
    session.commit(&transaction, Time::default()).unwrap();
    let sample = session.read_large(&handle, PATIENCE).unwrap();
    assert_eq!(sample.numbers::<u64>().unwrap(), [1, 2, 3, 4, 5, 6]);
    // Given up: gone for whoever did not hold it, also though its process lives.
    drop(attribute);
    let mut other = Session::attach(&instance.0, "other", PATIENCE).unwrap();
    let error = other.read_large(&handle, Duration::ZERO).unwrap_err();
    assert!(matches!(error, LargeReadError::OwnerEnded), "{error}");
    assert_eq!(sample.numbers::<u64>().unwrap()[5], 6);
    drop((sample, session, other));
    store.finish();
}
