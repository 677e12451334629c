//! What a store promises its clients whatever happens: versions kept by leases, transactions
//! applied once, names and rights, memory that is full or grows, others that are stopped.

use crate::support::{Process, TestInstance, pause, within};
use dsr::{
    CommitError, LeaseError, LeaseRefusal, Manifest, ReadError, Refusal, Schema, Session, Snapshot,
    Store, Time, Transaction, Value, Version,
};
use std::process::Command;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(20);
const LONG: Duration = Duration::from_mins(5);

fn numbers(snapshot: &Snapshot) -> Result<Vec<Value>, ReadError> {
    let mut numbers = Vec::new();
    for node in snapshot.nodes_of("pair") {
        numbers.extend(node?.value("n")?);
    }
    Ok(numbers)
}

#[test]
fn a_lease_keeps_a_version_readable_under_a_writer_flat_out_until_it_is_dropped() {
    let instance = TestInstance::new("lease");
    let store = Process::peer("store", &instance);
    let writer = Process::peer("write-pairs", &instance);
    let mut session = Session::attach(&instance.0, "planner", PATIENCE).unwrap();
    let (lease, before) = within(PATIENCE, || {
        // The writer may outrun the history between the two.
        let snapshot = session.snapshot().unwrap();
        let lease = session.lease(&snapshot, LONG).ok()?;
        let before = numbers(lease.snapshot()).unwrap();
        Some((lease, before))
    })
    .unwrap();
    assert_eq!(before.len(), 8);
    let plain = session.snapshot().unwrap();
    let far = Version(lease.snapshot().version().0 + 10_000);
    let advanced = within(PATIENCE, || {
        assert_eq!(numbers(lease.snapshot()).unwrap(), before);
        (session.snapshot().unwrap().version() > far).then_some(())
    });
    assert!(advanced.is_some(), "the writer has stopped");
    assert!(numbers(&plain).is_err(), "without a lease it is outlived");
    let kept = lease.snapshot().clone();
    drop(lease);
    let ended = within(PATIENCE, || numbers(&kept).err()).unwrap();
    assert!(matches!(ended, ReadError::SnapshotTooOld { .. }), "{ended}");
    writer.finish();
    drop(session);
    store.finish();
}

#[test]
fn a_look_that_takes_longer_than_the_history_lasts_is_looked_again_and_succeeds() {
    let instance = TestInstance::new("look");
    let store = Process::peer("store", &instance);
    let writer = Process::peer("write-pairs", &instance);
    let mut session = Session::attach(&instance.0, "looker", PATIENCE).unwrap();
    let mut watch = Session::attach(&instance.0, "watch", PATIENCE).unwrap();
    let mut looks = 0;
    let found = session.read(|snapshot| {
        looks += 1;
        let before = numbers(snapshot)?;
        let far = Version(snapshot.version().0 + 5_000);
        let advanced = within(PATIENCE, || {
            (watch.snapshot().unwrap().version() > far).then_some(())
        });
        assert!(advanced.is_some(), "the writer has stopped");
        assert_eq!(numbers(snapshot)?, before);
        Ok(before.len())
    });
    assert_eq!(found.unwrap(), 8);
    assert!(looks > 1, "it was not overtaken");
    writer.finish();
    drop((session, watch));
    store.finish();
}

#[test]
fn a_lease_ends_with_its_time_and_with_the_process_that_has_it() {
    let instance = TestInstance::new("lease-ends");
    let store = Process::peer("store", &instance);
    let mut session = Session::attach(&instance.0, "planner", PATIENCE).unwrap();
    let snapshot = session.snapshot().unwrap();
    let refused = |error: &LeaseError| match error {
        LeaseError::Refused(refusal) => *refusal,
        other => panic!("{other}"),
    };
    let long = session.lease(&snapshot, Duration::from_hours(1));
    let long = refused(&long.unwrap_err());
    assert!(matches!(long, LeaseRefusal::TooLong { .. }), "{long}");
    // All the leases there are.
    let holder = Process::peer("leases", &instance);
    let full = session.lease(&snapshot, LONG).unwrap_err();
    assert_eq!(refused(&full), LeaseRefusal::TooMany);
    holder.kill();
    let again = within(PATIENCE, || session.lease(&snapshot, LONG).ok());
    assert!(again.is_some(), "the leases of a dead process have ended");
    drop(again);
    let short = Duration::from_millis(1);
    let leases: Vec<_> = (0..8)
        .map(|_| session.lease(&snapshot, short).unwrap())
        .collect();
    let holder = within(PATIENCE, || {
        let told = Process::start("leases", &instance, &[]).line();
        (told == "ready").then_some(())
    });
    assert!(holder.is_some(), "leases end with their time");
    drop((leases, session));
    store.finish();
}

#[test]
fn no_commit_is_lost_or_applied_twice_however_often_the_store_is_killed() {
    let instance = TestInstance::new("once");
    let mut store = Process::peer("store", &instance);
    let mut session = Session::attach(&instance.0, "watch", PATIENCE).unwrap();
    let clients = ["a", "b"].map(|name| Process::start("append", &instance, &[name]));
    for round in 0..crate::support::rounds(8) {
        let reached = Version(session.snapshot().unwrap().version().0 + 50 + 13 * round);
        let moved = within(PATIENCE, || {
            (session.snapshot().unwrap().version() > reached).then_some(())
        });
        assert!(moved.is_some(), "nothing is committed in round {round}");
        store.kill();
        let epoch = session.epoch().unwrap();
        let left = session.snapshot().unwrap().version();
        assert_eq!(instance.0.orphaned().unwrap(), Some(left));
        store = Process::peer("store", &instance);
        let new = within(PATIENCE, || (session.epoch().ok()? != epoch).then_some(()));
        assert!(new.is_some(), "the new store does not show itself");
    }
    // Each client ends with an error where a node that it makes is there already.
    let made: u64 = clients
        .map(|client| client.finish().parse::<u64>().unwrap())
        .iter()
        .sum();
    assert_eq!(session.snapshot().unwrap().node_count(), made);
    drop(session);
    store.finish();
}

const SCHEMA: &str = "[types]\nrobot = []\n[labels]\n[attributes]\nspeed = { kind = \"f64\" }\n\
                      radius = { kind = \"f64\" }\n";

#[test]
fn an_agent_may_do_what_its_manifest_says_and_only_one_process_is_it() {
    let instance = TestInstance::new("rights");
    let schema = Schema::from_toml("schema.toml", SCHEMA).unwrap();
    let manifest = "agent = \"driver\"\nattributes = [\"robot.speed\"]\n";
    let manifest = Manifest::from_toml("driver.toml", manifest, &schema).unwrap();
    let mut store = Store::open(&instance.0, schema).unwrap();
    store.graph_mut().set_rights([manifest]);
    let mut transaction = Transaction::new();
    transaction.create_node("robot", "shelly", vec![]);
    store.commit(&transaction, Time::default()).unwrap();
    let set = |session: &mut Session, name: &str| {
        let mut transaction = Transaction::new();
        transaction.set("shelly", name, 1.0);
        session.commit(&transaction, Time::default())
    };
    let refusal = |outcome: Result<_, CommitError>| match outcome {
        Err(CommitError::Refused(refusal)) => refusal.to_string(),
        other => panic!("{other:?}"),
    };
    let checks = || {
        // Another process is the driver first.
        let mut other = Process::start("set", &instance, &["driver", "speed"]);
        assert_eq!(other.line(), "done");
        let mut session = Session::attach(&instance.0, "driver", PATIENCE).unwrap();
        let why = refusal(set(&mut session, "speed"));
        assert!(why.contains("only one process may be it"), "{why}");
        other.kill();
        set(&mut session, "speed").unwrap();
        let why = refusal(set(&mut session, "radius"));
        assert!(why.contains("`robot.radius`"), "{why}");
        for name in ["store", "stranger"] {
            let mut session = Session::attach(&instance.0, name, PATIENCE).unwrap();
            let why = refusal(set(&mut session, "speed"));
            assert!(why.starts_with("not allowed"), "{why}");
        }
    };
    serve_while(&mut store, checks);
}

/// Serves until the other has done what it does.
fn serve_while<T: Send>(store: &mut Store, what: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| {
        let doing = scope.spawn(what);
        while !doing.is_finished() {
            store.serve(Duration::from_millis(5)).unwrap();
        }
        doing.join().unwrap()
    })
}

/// Versions committed in a short while.
fn commits(session: &mut Session) -> u64 {
    let version = |session: &mut Session| session.snapshot().unwrap().version().0;
    let before = version(session);
    pause(Duration::from_millis(150));
    version(session) - before
}

#[test]
fn agents_that_are_stopped_or_killed_at_any_moment_slow_nobody_else() {
    let instance = TestInstance::new("stopped");
    let store = Process::peer("store", &instance);
    let writer = Process::peer("write-pairs", &instance);
    let mut session = Session::attach(&instance.0, "watch", PATIENCE).unwrap();
    let mut others = vec![
        Process::peer("follow", &instance),
        Process::peer("follow", &instance),
        Process::peer("read-pairs", &instance),
        Process::start("append", &instance, &["a"]),
        Process::start("append", &instance, &["b"]),
    ];
    // Stopped, so that what they were in the middle of stays as it is: the two that write wait
    // for answers, those that follow have buffers that fill.
    pause(Duration::from_millis(200));
    let measured = (0..5).any(|_| {
        let (mut stopped, mut alone) = (0, 0);
        for _ in 0..4 {
            others.iter().for_each(Process::stop);
            stopped += commits(&mut session);
            // With two more that write the store has more to do: only who follows goes on.
            others[..3].iter().for_each(Process::resume);
            alone += commits(&mut session);
        }
        stopped * 2 >= alone && stopped > 0
    });
    assert!(measured, "stopped agents slow others down");
    // Stopped at other moments of their work, again and again, and killed there.
    for _ in 0..10 {
        others.iter().for_each(Process::resume);
        pause(Duration::from_millis(7));
        others.iter().for_each(Process::stop);
        assert!(commits(&mut session) > 0, "stopped agents hold others up");
    }
    for other in others.drain(..) {
        other.kill();
        assert!(commits(&mut session) > 0, "a killed agent holds others up");
    }
    writer.finish();
    drop(session);
    store.finish();
}

#[test]
fn a_full_shared_memory_is_a_refusal_and_not_the_end() {
    // A memory of its own for one process, where the host lets a user have that.
    let alone = |script: &str, arguments: &[&str]| {
        let mut command = Command::new("unshare");
        command.args(["-Urm", "sh", "-c", script, "sh"]);
        command.args(arguments).output().unwrap()
    };
    let small = "mount -t tmpfs -o size=80m tmpfs /dev/shm && ";
    if !alone(&format!("{small} true"), &[]).status.success() {
        return;
    }
    let instance = TestInstance::new("full");
    let peer = env!("CARGO_BIN_EXE_peer");
    let filled = alone(
        &format!("{small} exec \"$1\" fill \"$2\""),
        &[peer, instance.name()],
    );
    let told = String::from_utf8_lossy(&filled.stderr);
    assert!(filled.status.success(), "{}: {told}", filled.status);
    let told = String::from_utf8(filled.stdout).unwrap();
    assert_eq!(
        told,
        "full by the graph\nfull by others\nnobody joins\nroom again\n"
    );
}

#[test]
fn a_graph_grows_while_readers_that_came_before_go_on_reading() {
    let instance = TestInstance::new("growth");
    let store = Process::peer("store", &instance);
    let mut session = Session::attach(&instance.0, "grower", PATIENCE).unwrap();
    let mut early = Process::start("sum", &instance, &[]);
    assert_eq!(early.line(), "ready");
    let nodes = crate::support::size("CORTEX_NODES", 100_000);
    let batch = 1_000;
    for start in (0..nodes).step_by(batch) {
        let mut transaction = Transaction::new();
        for i in start..nodes.min(start + batch) {
            let attributes = vec![
                ("n".into(), Value::U64(1)),
                ("row".into(), Value::F64List(vec![0.5; 320])),
            ];
            transaction.create_node("thing", &format!("node{i}"), attributes);
        }
        session.commit(&transaction, Time::default()).unwrap();
    }
    let memory = instance.0.shared_memory().unwrap();
    let largest = memory.iter().map(|path| {
        use std::os::unix::fs::MetadataExt;
        std::fs::metadata(path).map_or(0, |file| file.blocks() * 512)
    });
    let segment = 256 << 20;
    assert!(largest.max() > Some(segment), "it fits in one segment");
    assert_eq!(session.snapshot().unwrap().node_count(), nodes as u64);
    // A store that is killed leaves all its segments to the next.
    let (left, epoch) = (
        session.snapshot().unwrap().version(),
        session.epoch().unwrap(),
    );
    store.kill();
    let store = Process::peer("store", &instance);
    let new = within(PATIENCE, || (session.epoch().ok()? != epoch).then_some(()));
    assert!(new.is_some(), "the new store does not show itself");
    assert_eq!(session.snapshot().unwrap().version(), left);
    // Who was there before it grew, who comes after, and this one count the same.
    let late = Process::start("sum", &instance, &[]);
    for reader in [early, late] {
        let told = reader.finish();
        assert_eq!(told.lines().last().unwrap(), nodes.to_string());
    }
    drop(session);
    store.finish();
}

#[test]
fn a_refusal_says_what_kind_it_is() {
    let instance = TestInstance::new("refusals");
    let store = Process::peer("store", &instance);
    let mut session = Session::attach(&instance.0, "agent", PATIENCE).unwrap();
    let mut transaction = Transaction::new();
    transaction.create_node("room", "kitchen", vec![("area".into(), 1.0.into())]);
    let made = session.commit(&transaction, Time::default()).unwrap();
    let mut refusal = |transaction: &Transaction| match session.commit(transaction, Time::default())
    {
        Err(CommitError::Refused(refusal)) => refusal,
        other => panic!("{other:?}"),
    };
    let exists = refusal(&transaction);
    assert!(matches!(exists, Refusal::AlreadyExists(_)), "{exists}");
    let mut missing = Transaction::new();
    missing.delete_node("hall");
    let missing = refusal(&missing);
    assert!(matches!(missing, Refusal::NotFound(_)), "{missing}");
    let mut rule = Transaction::new();
    rule.apply_rule("none", vec![]);
    let rule = refusal(&rule);
    assert!(matches!(rule, Refusal::RuleNotApplicable { .. }), "{rule}");
    let unchanged = |version| {
        Transaction::new().require(dsr::Precondition::NodeUnchangedSince {
            node: "kitchen".into(),
            version,
        })
    };
    let mut conflict = unchanged(Version(made.version.0 - 1));
    conflict.set("kitchen", "area", 2.0);
    let conflict = refusal(&conflict);
    assert!(matches!(conflict, Refusal::Conflict(_)), "{conflict}");
    let mut good = unchanged(made.version);
    good.set("kitchen", "area", 2.0);
    session.commit(&good, Time::default()).unwrap();
    drop(session);
    store.finish();
}
