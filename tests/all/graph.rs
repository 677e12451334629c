//! The shared graph between real processes: what one reads while another writes, what a reader
//! costs, and what happens when somebody dies.

use crate::support::{Process, TestInstance, within};
use dsr::{
    EdgeRef, Filter, Image, Schema, Session, Store, Time, Transaction, Update, Value, Version,
};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(20);

#[test]
fn no_reader_sees_half_a_transaction_while_another_process_writes_flat_out() {
    let instance = TestInstance::new("torn");
    let store = Process::peer("store", &instance);
    let writer = Process::peer("write-pairs", &instance);
    let readers = [(); 2].map(|()| Process::peer("read-pairs", &instance));
    // Long enough for the store to reuse the memory of old versions many times over.
    let mut session = Session::attach(&instance.0, "watch", PATIENCE).unwrap();
    let mut changes = session.changes(Filter::default()).unwrap();
    while session.snapshot().unwrap().version() < Version(20_000) {
        changes.wait(PATIENCE).unwrap();
        let schema = session.snapshot().unwrap().schema().clone();
        while changes.next(&schema).unwrap().is_some() {}
    }
    for reader in readers {
        let told = reader.finish();
        let told: Vec<u64> = told.split(' ').map(|n| n.parse().unwrap()).collect();
        let [reads, torn, outlived] = told[..] else {
            panic!("{told:?}")
        };
        assert_eq!(torn, 0, "of {reads} reads");
        assert!(
            outlived > 10,
            "memory was reused under the reader {outlived} times"
        );
        assert!(reads > 1000, "{reads} reads");
    }
    writer.finish();
    drop(session);
    store.finish();
}

#[test]
fn a_readers_private_memory_does_not_grow_with_the_graph() {
    let instance = TestInstance::new("memory");
    let mut store = Store::open(&instance.0, Schema::open()).unwrap();
    let mut growth = Vec::new();
    for (from, to) in [(0, 1_000), (1_000, 50_000)] {
        let mut transaction = Transaction::new();
        for i in from..to {
            let attributes = vec![("n".into(), Value::U64(1)), ("row".into(), [0.5; 6].into())];
            transaction.create_node("thing", &format!("node{i}"), attributes);
        }
        store.commit(&transaction, Time::default()).unwrap();
        let mut reader = Process::start("memory", &instance, &[&to.to_string()]);
        let told = std::thread::scope(|scope| {
            let told = scope.spawn(|| reader.line());
            while !told.is_finished() {
                store.serve(Duration::from_millis(5)).unwrap();
            }
            told.join().unwrap()
        });
        let told: Vec<u64> = told.split(' ').map(|n| n.parse().unwrap()).collect();
        let [before, after, sum] = told[..] else {
            panic!("{told:?}")
        };
        assert_eq!(sum, to, "every node was read");
        growth.push(after.saturating_sub(before));
    }
    // 50,000 nodes take some 20 MB in the arena; a copy of them would show.
    assert!(growth[1] < 1024, "reading cost {growth:?} KiB");
    drop(store);
}

#[test]
fn increments_of_several_processes_are_all_counted() {
    let instance = TestInstance::new("increments");
    let store = Process::peer("store", &instance);
    let mut session = Session::attach(&instance.0, "setup", PATIENCE).unwrap();
    let mut transaction = Transaction::new();
    transaction.create_node("counter", "counter", vec![("n".into(), 0.0.into())]);
    session.commit(&transaction, Time::default()).unwrap();
    let peers = [(); 3].map(|()| Process::start("increment", &instance, &["200"]));
    for peer in peers {
        peer.finish();
    }
    let snapshot = session.snapshot().unwrap();
    let counter = snapshot.find_node_by_name("counter").unwrap().unwrap();
    assert_eq!(counter.value("n").unwrap(), Some(Value::F64(600.0)));
    drop(session);
    store.finish();
}

#[test]
fn subscribers_hear_what_their_filter_names_and_of_gaps() {
    let instance = TestInstance::new("changes");
    let store = Process::peer("store", &instance);
    let mut session = Session::attach(&instance.0, "agent", PATIENCE).unwrap();
    let mut transaction = Transaction::new();
    transaction.create_node("room", "kitchen", vec![]);
    transaction.create_node("person", "ann", vec![("mood".into(), 1.0.into())]);
    transaction.create_edge("ann", "in", "kitchen");
    session.commit(&transaction, Time::default()).unwrap();
    let schema = session.snapshot().unwrap().schema().clone();
    let mood = Filter {
        attributes: vec![schema.attribute_id("mood").unwrap()],
        ..Filter::default()
    };
    let within = Filter {
        labels: vec![schema.label_id("in").unwrap()],
        ..Filter::default()
    };
    let mut moods = session.changes(mood).unwrap();
    let mut places = session.changes(within).unwrap();
    let mut transaction = Transaction::new();
    transaction.set("ann", "mood", 2.0);
    session.commit(&transaction, Time::default()).unwrap();
    let mut transaction = Transaction::new();
    transaction.delete_edge("ann", "in", "kitchen");
    session.commit(&transaction, Time::default()).unwrap();
    let next = |changes: &mut dsr::Changes| loop {
        match changes.next(&schema).unwrap() {
            Some(update) => return update,
            None => changes.wait(PATIENCE).unwrap(),
        }
    };
    let Update::Change(change) = next(&mut moods) else {
        panic!("a gap where there is none")
    };
    assert_eq!(
        (change.version, change.agent.as_str()),
        (Version(3), "agent")
    );
    let Update::Change(change) = next(&mut places) else {
        panic!("a gap where there is none")
    };
    assert_eq!(change.version, Version(4));
    // More commits than a subscriber's buffer holds.
    for i in 0..400 {
        let mut transaction = Transaction::new();
        transaction.set("ann", "mood", f64::from(i));
        session.commit(&transaction, Time::default()).unwrap();
    }
    assert!(
        matches!(next(&mut moods), Update::Gap(_)),
        "400 commits do not fit"
    );
    drop((moods, places, session));
    store.finish();
}

#[test]
fn a_killed_store_is_replaced_without_losing_a_commit_and_agents_find_the_new_one() {
    let instance = TestInstance::new("restart");
    let store = Process::peer("store", &instance);
    let mut session = Session::attach(&instance.0, "agent", PATIENCE).unwrap();
    for i in 0..50 {
        let mut transaction = Transaction::new();
        transaction.create_node(
            "thing",
            &format!("n{i}"),
            vec![("i".into(), f64::from(i).into())],
        );
        session.commit(&transaction, Time::default()).unwrap();
    }
    let old = session.epoch().unwrap();
    store.kill();
    // What it left is all that this process still sees.
    assert_eq!(instance.0.orphaned().unwrap(), Some(Version(51)));
    let mut store = Store::open(&instance.0, Schema::open()).unwrap();
    let left = store.orphaned(None).unwrap().unwrap();
    let image = Image::of(&session.snapshot().unwrap()).unwrap();
    assert_eq!(left.image(), &image);
    store.take_over(&left).unwrap();
    // Until the new store shows its graph, the old one is read.
    assert_eq!(session.epoch().unwrap(), old);
    let transaction = {
        let mut transaction = Transaction::new();
        transaction.create_edge("n0", "next", "n49");
        transaction
    };
    let commit = std::thread::scope(|scope| {
        let asked = scope.spawn(|| {
            while session.epoch().unwrap() == old {
                std::thread::yield_now();
            }
            session.commit(&transaction, Time::default())
        });
        while !asked.is_finished() {
            store.serve(Duration::from_millis(5)).unwrap();
        }
        asked.join().unwrap().unwrap()
    });
    assert_eq!(commit.version, Version(52), "versions go on");
    let snapshot = session.snapshot().unwrap();
    assert_eq!(snapshot.node_count(), 50);
    let next = snapshot.schema().label_id("next").unwrap();
    assert_eq!(snapshot.edges_of_label(next).count(), 1);
    let node = snapshot.find_node_by_name("n7").unwrap().unwrap();
    let written = node.attributes().unwrap().remove(0);
    assert_eq!(
        (written.value, written.version),
        (Value::F64(7.0), Version(9))
    );
    assert_eq!(
        EdgeRef::new("n0", "next", "n49").to_string(),
        "`n0` -next-> `n49`"
    );
    drop((session, store));
}

#[test]
fn who_follows_hears_every_commit_across_restarts_of_the_store_and_of_another_graph() {
    let instance = TestInstance::new("follows");
    let mut store = Process::peer("store", &instance);
    let mut session = Session::attach(&instance.0, "agent", PATIENCE).unwrap();
    let mut changes = session.changes(Filter::default()).unwrap();
    let mut late = session.changes(Filter::default()).unwrap();
    let schema = Schema::open();
    let hear = |changes: &mut dsr::Changes| {
        within(PATIENCE, || changes.next(&schema).unwrap()).expect("nothing is heard")
    };
    let make = |session: &mut Session, name: &str| {
        let mut transaction = Transaction::new();
        transaction.create_node("thing", name, vec![]);
        let commit = session.commit(&transaction, Time::default()).unwrap();
        commit.version
    };
    for round in 0..4 {
        // The first after a restart too: the graph goes on.
        for i in 0..3 {
            let version = make(&mut session, &format!("n{round}_{i}"));
            let Update::Change(change) = hear(&mut changes) else {
                panic!("a gap before {version}")
            };
            assert_eq!(change.version, version);
        }
        store.kill();
        store = Process::peer("store", &instance);
    }
    // What nobody had taken when its store ended is told as a gap, without another commit.
    let last = session.snapshot().unwrap().version();
    let mut gaps = 0;
    let told = within(PATIENCE, || {
        session.epoch().unwrap();
        match late.next(&schema).unwrap()? {
            Update::Gap(version) => {
                gaps += 1;
                (version == last).then_some(())
            }
            Update::Change(change) => (change.version == last).then_some(()),
        }
    });
    assert!(told.is_some() && gaps > 0, "{gaps} gaps");
    store.kill();
    // One that begins another graph, at the version that follows on what was heard last.
    let mut store = Store::open(&instance.0, Schema::open()).unwrap();
    while store.graph_mut().snapshot().version() < last {
        let mut transaction = Transaction::new();
        let name = store.graph_mut().snapshot().version().to_string();
        transaction.create_node("thing", &name, vec![]);
        store.commit(&transaction, Time::default()).unwrap();
    }
    let old = session.epoch().unwrap();
    let version = std::thread::scope(|scope| {
        let made = scope.spawn(|| {
            while session.epoch().unwrap() == old {
                std::thread::yield_now();
            }
            make(&mut session, "n0_0")
        });
        while !made.is_finished() {
            store.serve(Duration::from_millis(5)).unwrap();
        }
        made.join().unwrap()
    });
    assert_eq!(version, Version(last.0 + 1));
    for mut changes in [changes, late] {
        let first = changes.next(&schema).unwrap();
        assert!(
            matches!(first, Some(Update::Gap(_))),
            "another graph: {first:?}"
        );
    }
    drop((session, store));
}

#[test]
fn nothing_is_left_of_an_instance_that_was_removed() {
    let instance = TestInstance::new("nothing");
    let store = Process::peer("store", &instance);
    let session = Session::attach(&instance.0, "agent", PATIENCE).unwrap();
    assert!(!instance.0.shared_memory().unwrap().is_empty());
    drop(session);
    store.kill();
    instance.0.remove().unwrap();
    assert_eq!(
        instance.0.shared_memory().unwrap(),
        Vec::<std::path::PathBuf>::new()
    );
    assert!(!instance.0.folder().exists());
}

#[test]
fn an_instance_leaves_alone_another_whose_name_begins_with_its_own() {
    let (short, long) = (TestInstance::new("a"), TestInstance::new("a"));
    let longer = TestInstance::named(&format!("{}_b", short.name()));
    let stores = [&short, &longer, &long].map(|instance| Process::peer("store", instance));
    let [first, second, third] = stores;
    first.kill();
    short.0.remove().unwrap();
    let mut session = Session::attach(&longer.0, "agent", PATIENCE).unwrap();
    assert_eq!(session.snapshot().unwrap().node_count(), 0);
    drop(session);
    second.finish();
    third.finish();
}
