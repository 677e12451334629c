//! The graph on disk, when everything is killed: what was called durable is there again, whole.

use crate::support::{Process, Program, TestInstance, within};
use dsr::{Commit, Durability, Schema, Session, State, Store, Time, Transaction, Value, Version};
use std::collections::BTreeMap;
use std::process::{Child, Stdio};
use std::sync::mpsc;
use std::time::Duration;
use tempfile::TempDir;

const PATIENCE: Duration = Duration::from_secs(20);
const WRITERS: u64 = 2;

/// `SplitMix64`.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (x ^ (x >> 31)) % end
    }
}

/// Lets some time go by: the moment of a kill is what these rounds vary.
fn let_pass(microseconds: u64) {
    let (_keep, nothing) = mpsc::channel::<()>();
    let waited = nothing.recv_timeout(Duration::from_micros(microseconds));
    assert_eq!(waited, Err(mpsc::RecvTimeoutError::Timeout));
}

/// What the writers heard to be durable.
#[derive(Default)]
struct Promised {
    numbers: BTreeMap<u64, u64>,
    version: u64,
}

impl Promised {
    fn take(&mut self, client: u64, said: &str) {
        // The last line may have been cut off.
        for line in said.lines().filter(|_| said.ends_with('\n')) {
            let (n, version) = line.split_once(' ').unwrap();
            self.numbers.insert(client, n.parse().unwrap());
            self.version = self.version.max(version.parse().unwrap());
        }
    }

    /// Holds the graph of a new store against what was promised; its version and epoch.
    fn hold(&self, session: &mut Session) -> (Version, u64) {
        let snapshot = session.snapshot().unwrap();
        assert!(
            snapshot.version().0 >= self.version,
            "version {} was promised, {} is there",
            self.version,
            snapshot.version()
        );
        for client in 0..WRITERS {
            let promised = self.numbers.get(&client).copied();
            let mut numbers = Vec::new();
            for i in 0..8 {
                let node = snapshot
                    .find_node_by_name(&format!("w{client}-{i}"))
                    .unwrap();
                numbers.push(node.map(|node| node.value("n").unwrap().unwrap()));
            }
            let first = numbers[0].clone();
            assert!(
                numbers.iter().all(|n| *n == first),
                "half a transaction: {numbers:?}"
            );
            let Some(Value::U64(n)) = first else {
                assert_eq!((first, promised), (None, None));
                continue;
            };
            assert!(
                n >= promised.unwrap_or(0),
                "writer {client}: {promised:?} was promised, {n} is there"
            );
            let visitor = snapshot
                .find_node_by_name(&format!("visitor{client}"))
                .unwrap();
            let visits = visitor.map(|node| node.out_edges().count());
            assert_eq!(visits, (n > 0 && n.is_multiple_of(2)).then_some(1), "{n}");
        }
        (snapshot.version(), session.epoch().unwrap().0)
    }
}

/// Rounds of: start a store on the folder, hold it to what was promised, let writers write flat
/// out, kill everything.
#[test]
fn whoever_is_killed_when_no_acknowledged_commit_is_lost() {
    let rounds = std::env::var("CORTEX_ROUNDS").map_or(10, |text| text.parse().unwrap());
    let seed = u64::from(std::process::id());
    println!("seed {seed}");
    let mut random = Random(seed);
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("state");
    let arguments = [path.to_str().unwrap()];
    let instance = TestInstance::new("kill-all");
    let mut promised = Promised::default();
    let (mut version, mut epoch) = (Version(0), 0);
    let mut acknowledged = 0;
    for round in 0..rounds {
        // Now and then it does not even get to start.
        if random.below(4) == 0 {
            let store = Process::start("store-with-state", &instance, &arguments);
            let_pass(random.below(60_000));
            store.kill();
            instance.0.remove().unwrap();
        }
        let mut store = Process::start("store-with-state", &instance, &arguments);
        assert_eq!(store.line(), "ready", "round {round}");
        let mut session = Session::attach(&instance.0, "test", PATIENCE).unwrap();
        let (found, life) = promised.hold(&mut session);
        assert!(found >= version, "round {round}: versions go on");
        assert_ne!(life, epoch, "round {round}: a new life has a new epoch");
        (version, epoch) = (found, life);
        let writers: Vec<_> = (0..WRITERS)
            .map(|i| Process::start("write-durable", &instance, &[&i.to_string()]))
            .collect();
        let mut writers: Vec<_> = writers.into_iter().enumerate().collect();
        if random.below(8) > 0 {
            // Some commits, then in the middle of another.
            for _ in 0..=random.below(20) {
                let line = writers[0].1.line();
                promised.take(0, &format!("{line}\n"));
                acknowledged += 1;
            }
        }
        let_pass(random.below(5_000));
        let store_first = random.below(2) == 0;
        let mut store = Some(store);
        if store_first && let Some(store) = store.take() {
            store.kill();
        }
        if random.below(2) == 0 {
            writers.reverse();
        }
        for (client, writer) in writers {
            let said = writer.kill_and_hear();
            acknowledged += said.lines().count();
            promised.take(client as u64, &said);
        }
        drop((store, session));
        instance.0.remove().unwrap();
    }
    let mut store = Process::start("store-with-state", &instance, &arguments);
    assert_eq!(store.line(), "ready");
    let mut session = Session::attach(&instance.0, "test", PATIENCE).unwrap();
    let (last, _) = promised.hold(&mut session);
    let mut transaction = Transaction::new();
    transaction.create_node("thing", "last", vec![]);
    let commit = session
        .commit(&transaction.durable(), Time::default())
        .unwrap();
    assert_eq!(
        (commit.version, commit.durable),
        (Version(last.0 + 1), true)
    );
    println!("{rounds} rounds, {acknowledged} durable commits acknowledged, version {last}");
    assert!(acknowledged >= rounds as usize, "{acknowledged} commits");
    drop(session);
    store.finish();
}

#[test]
fn a_durable_commit_is_refused_where_the_store_keeps_no_state() {
    let instance = TestInstance::new("no-state");
    let store = Process::peer("store", &instance);
    let mut session = Session::attach(&instance.0, "agent", PATIENCE).unwrap();
    let before = session.snapshot().unwrap().version();
    let mut transaction = Transaction::new();
    transaction.create_node("thing", "precious", vec![]);
    let refused = session.commit(&transaction.clone().durable(), Time::default());
    assert!(
        matches!(
            refused,
            Err(dsr::CommitError::Refused(dsr::Refusal::NotDurable(_)))
        ),
        "{refused:?}"
    );
    assert_eq!(session.snapshot().unwrap().version(), before);
    let commit = session.commit(&transaction, Time::default()).unwrap();
    assert!(!commit.durable);
    drop(session);
    store.finish();
}

/// `cortex store` by hand, killed with signal 9 when it is dropped.
struct ByHand(Child);

impl ByHand {
    fn start(instance: &TestInstance, rest: &[&str]) -> Self {
        let scenario = "scenarios/care-centre";
        let mut arguments = vec!["store", "--scenario", scenario];
        arguments.extend(["--instance", instance.name()]);
        arguments.extend(rest);
        let child = Program::command(&arguments)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        Self(child.unwrap())
    }
}

impl ByHand {
    /// Ends it as a person does.
    fn end(mut self) {
        rustix::process::kill_process(
            rustix::process::Pid::from_child(&self.0),
            rustix::process::Signal::INT,
        )
        .unwrap();
        assert!(self.0.wait().unwrap().success());
    }
}

impl Drop for ByHand {
    fn drop(&mut self) {
        drop(self.0.kill());
        self.0.wait().unwrap();
    }
}

fn refused(arguments: &[&str]) -> String {
    let output = Program::run(arguments);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn a_store_by_hand_goes_on_from_its_folder_and_says_what_is_wrong_with_another() {
    let folder = TempDir::new().unwrap();
    let state = folder.path().join("state");
    let state = state.to_str().unwrap();
    let instance = TestInstance::new("by-hand");
    let store = ByHand::start(&instance, &["--state", state, "--durable"]);
    let mut session = Session::attach(&instance.0, "cortex-graph", PATIENCE).unwrap();
    let mut transaction = Transaction::new();
    transaction.create_node("tv", "screen", vec![]);
    transaction.set("robot", "max_speed", 0.123);
    // A room of the scenario, whichever it is called.
    let room = {
        let snapshot = session.snapshot().unwrap();
        let kind = snapshot.schema().type_id("room").unwrap();
        let room = snapshot.nodes_of_type(kind).next().unwrap().unwrap();
        room.name().unwrap()
    };
    transaction.create_edge("screen", "in", room.as_str());
    let commit = session.commit(&transaction, Time::default()).unwrap();
    assert!(commit.durable, "the store was told to");
    // Two stores never share a folder.
    let second = [
        "store",
        "--scenario",
        "scenarios/care-centre",
        "--state",
        state,
    ];
    let other = TestInstance::new("by-hand-too");
    let said = refused(&[&second[..], &["--instance", other.name()]].concat());
    assert!(said.contains("is in use by another store"), "{said}");
    drop((store, session));
    instance.0.remove().unwrap();
    let store = ByHand::start(&instance, &["--state", state]);
    let mut session = Session::attach(&instance.0, "cortex-graph", PATIENCE).unwrap();
    let snapshot = session.snapshot().unwrap();
    assert!(snapshot.version() > commit.version);
    let screen = snapshot.find_node_by_name("screen").unwrap().unwrap();
    assert_eq!(screen.out_edges().count(), 1, "what was found out stays");
    let robot = snapshot.find_node_by_name("robot").unwrap().unwrap();
    let speed = robot.value("max_speed").unwrap();
    assert_ne!(
        speed,
        Some(0.123.into()),
        "the scenario says how the robot is"
    );
    drop((store, session));
    instance.0.remove().unwrap();
    let plaza = ["run", "scenarios/plaza", "--state", state, "--lockstep"];
    let report = folder.path().join("report");
    let named = [
        "--instance",
        instance.name(),
        "--report",
        report.to_str().unwrap(),
    ];
    let said = refused(&[&plaza[..], &named].concat());
    assert!(said.contains("not of `plaza`"), "{said}");
    let foreign = ["run", "scenarios/plaza", "--state", "docs"];
    let said = refused(&[&foreign[..], &named].concat());
    assert!(said.contains("not a state folder"), "{said}");
}

/// Commits something that a test finds again.
fn set(session: &mut Session, speed: f64) -> Commit {
    let mut transaction = Transaction::new();
    transaction.set("robot", "max_speed", speed);
    session.commit(&transaction, Time::default()).unwrap()
}

#[test]
fn a_store_by_hand_that_was_killed_leaves_its_graph_to_the_next_by_hand() {
    let instance = TestInstance::new("left");
    let store = ByHand::start(&instance, &[]);
    let mut session = Session::attach(&instance.0, "cortex-graph", PATIENCE).unwrap();
    let commit = set(&mut session, 0.123);
    let epoch = session.epoch().unwrap();
    let renewed = |session: &mut Session| {
        let new = within(PATIENCE, || (session.epoch().ok()? != epoch).then_some(()));
        assert!(new.is_some(), "the new store does not show itself");
    };
    drop(store);
    let store = ByHand::start(&instance, &[]);
    renewed(&mut session);
    // To the byte, while somebody looks on.
    assert_eq!(session.snapshot().unwrap().version(), commit.version);
    let last = set(&mut session, 0.124);
    assert_eq!(last.version, Version(commit.version.0 + 1));
    drop((store, session));
    // And where nobody does: what a person asks of it removes nothing.
    let said = refused(&["graph", "show", "--instance", instance.name()]);
    assert!(
        said.contains(&format!("version {}", last.version)),
        "{said}"
    );
    let store = ByHand::start(&instance, &[]);
    let mut session = Session::attach(&instance.0, "cortex-graph", PATIENCE).unwrap();
    assert_eq!(session.snapshot().unwrap().version(), last.version);
    drop((store, session));
    // What ends well leaves nothing, and nothing older comes back.
    let store = ByHand::start(&instance, &[]);
    let session = Session::attach(&instance.0, "cortex-graph", PATIENCE).unwrap();
    assert_eq!(instance.0.orphaned().unwrap(), None);
    drop(session);
    store.end();
    assert_eq!(
        instance.0.shared_memory().unwrap(),
        Vec::<std::path::PathBuf>::new()
    );
}

#[test]
fn an_instance_has_one_store_and_goes_on_with_its_own_scenario_and_its_own_state() {
    let instance = TestInstance::new("one");
    let store = ByHand::start(&instance, &[]);
    let mut session = Session::attach(&instance.0, "cortex-graph", PATIENCE).unwrap();
    let commit = set(&mut session, 0.123);
    let flags = ["--instance", instance.name()];
    let here = [
        &["store", "--scenario", "scenarios/care-centre"],
        &flags[..],
    ]
    .concat();
    let said = refused(&here);
    assert!(said.contains("has a store already"), "{said}");
    assert_eq!(session.snapshot().unwrap().version(), commit.version);
    drop((store, session));
    // Another scenario's graph is not taken for one's own.
    let elsewhere = ["store", "--scenario", "scenarios/apartment"];
    let said = refused(&[&elsewhere[..], &flags].concat());
    assert!(
        said.contains("care-centre") && said.contains("--fresh"),
        "{said}"
    );
    // A folder that another instance went on from has commits that the memory does not have.
    let folder = TempDir::new().unwrap();
    let state = folder.path().join("state");
    let state = state.to_str().unwrap();
    let keep = ["--state", state, "--durable"];
    let store = ByHand::start(&instance, &keep);
    let mut session = Session::attach(&instance.0, "cortex-graph", PATIENCE).unwrap();
    set(&mut session, 0.15);
    drop((store, session));
    // Of the same life: goes on with the memory.
    let store = ByHand::start(&instance, &keep);
    let session = Session::attach(&instance.0, "cortex-graph", PATIENCE).unwrap();
    drop((store, session));
    let other = TestInstance::new("one-too");
    let store = ByHand::start(&other, &keep);
    let mut session = Session::attach(&other.0, "cortex-graph", PATIENCE).unwrap();
    let durable = set(&mut session, 0.99);
    assert!(durable.durable);
    drop((store, session));
    let said = refused(&[&here[..], &keep].concat());
    assert!(
        said.contains("another graph") && said.contains("--fresh"),
        "{said}"
    );
    let store = ByHand::start(&instance, &["--state", state, "--fresh"]);
    let mut session = Session::attach(&instance.0, "cortex-graph", PATIENCE).unwrap();
    let snapshot = session.snapshot().unwrap();
    assert!(snapshot.version() >= durable.version);
    let robot = snapshot.find_node_by_name("robot").unwrap().unwrap();
    // What the scenario's files say is laid over what the folder has.
    assert!(robot.value("max_speed").unwrap().is_some());
    drop((store, session));
}

#[test]
fn stores_that_end_before_they_show_what_they_took_over_lose_nothing() {
    let instance = TestInstance::new("unshown");
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("state");
    let keep = ["--state", path.to_str().unwrap(), "--durable"];
    let store = ByHand::start(&instance, &keep);
    let mut session = Session::attach(&instance.0, "cortex-graph", PATIENCE).unwrap();
    let commit = set(&mut session, 0.101);
    assert!(commit.durable);
    drop((store, session));
    for _ in 0..3 {
        let state = State::open(&path).unwrap();
        let mut store = Store::open(&instance.0, Schema::open()).unwrap();
        let left = store.orphaned(Some(&state)).unwrap().unwrap();
        assert_eq!(left.version(), commit.version);
        store.take_over(&left).unwrap();
        store.keep(state, PATIENCE, Durability::OnDisk).unwrap();
    }
    let store = ByHand::start(&instance, &keep);
    let mut session = Session::attach(&instance.0, "cortex-graph", PATIENCE).unwrap();
    let snapshot = session.snapshot().unwrap();
    assert_eq!(snapshot.version(), commit.version);
    let robot = snapshot.find_node_by_name("robot").unwrap().unwrap();
    assert_eq!(robot.value("max_speed").unwrap(), Some(Value::F64(0.101)));
    drop((store, session));
}
