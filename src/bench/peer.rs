//! The other processes of a measurement. Each says `ready` on its standard output when it has
//! joined, and ends when its standard input does.

use crate::{Answer, Failure};
use dsr::{
    BareServer, Filter, Instance, Limits, NodeId, Operation, Owner, ReadError, Schema, Session,
    Snapshot, Store, Time, Transaction, Value,
};
use nalgebra::{Isometry2, Vector2};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::PATIENCE;
use super::replica::Replica;

/// Nodes that `pairs` writes the same number to, each time in one transaction.
pub(super) const PAIRS: u64 = 8;

/// Plays a role until standard input ends.
pub(crate) fn play(role: &str, instance: &str, numbers: &[u64]) -> Result<Answer, Failure> {
    let instance = Instance::new(instance).map_err(Failure::input)?;
    let number = |index: usize| numbers.get(index).copied().unwrap_or(0);
    match role {
        "store" => store(&instance, number(0), Duration::from_micros(number(1)), None),
        // So little history that memory is reused under slow readers.
        "forgetful" => store(
            &instance,
            number(0),
            Duration::from_millis(2),
            Some(64 << 10),
        ),
        "bare" => bare(&instance, Duration::from_micros(number(0))),
        "stamp" => stamp(&instance, number(0)),
        "pose" => pose(&instance),
        "reader" => reader(&instance),
        "follow" => follow(&instance),
        "join" => join(&instance, false),
        "copy" => join(&instance, true),
        "pairs" => pairs(&instance),
        "indoor" => super::replan::indoor(&instance),
        "executive" => super::replan::executive(&instance),
        other => Err(Failure::input(format!("no role `{other}`"))),
    }?;
    Ok(Answer::Yes)
}

pub(super) fn say(line: &str) -> Result<(), Failure> {
    let mut output = std::io::stdout().lock();
    let said = output.write_all(format!("{line}\n").as_bytes());
    said.and_then(|()| output.flush())
        .map_err(Failure::internal)
}

/// True once standard input has ended.
pub(super) fn end_of_input() -> Arc<AtomicBool> {
    let ended = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&ended);
    std::thread::spawn(move || {
        // However the input ends, it has.
        drop(std::io::stdin().read_to_end(&mut Vec::new()));
        flag.store(true, Ordering::Release);
    });
    ended
}

/// Nanoseconds of a clock that all processes of the host share.
pub(super) fn clock() -> u64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// Keeps the calling thread on one of the processors that it may use; all of those. Where the kernel
/// puts processes decides over the time between them more than anything that they do: some processors are
/// nearer to each other than others, and one may have to be woken. So those that are compared sit alike, each
/// on a processor of its own.
pub(super) fn sit(place: usize) -> Result<CpuSet, Failure> {
    let all = sched_getaffinity(None).map_err(Failure::internal)?;
    let mut usable = (0..CpuSet::MAX_CPU).filter(|&processor| all.is_set(processor));
    if let Some(processor) = usable.nth(place) {
        let mut one = CpuSet::new();
        one.set(processor);
        stand(&one)?;
    }
    Ok(all)
}

/// Lets the calling thread use those processors.
pub(super) fn stand(on: &CpuSet) -> Result<(), Failure> {
    sched_setaffinity(None, on).map_err(Failure::internal)
}

pub(super) fn attach(instance: &Instance, agent: &str) -> Result<Session, Failure> {
    Session::attach(instance, agent, PATIENCE).map_err(Failure::internal)
}

/// `nodes` nodes with four attributes and four edges each.
fn world(nodes: u64) -> Transaction {
    let mut transaction = Transaction::new();
    let pose = Isometry2::new(Vector2::new(1.0, 2.0), 0.5);
    for n in 0..nodes {
        let attributes = vec![
            ("a".to_owned(), Value::F64(n as f64)),
            ("b".to_owned(), Value::I64(n.cast_signed())),
            ("c".to_owned(), "text".into()),
            ("p".to_owned(), pose.into()),
        ];
        transaction.create_node("thing", &format!("n{n}"), attributes);
    }
    for n in 0..nodes {
        for (label, step) in [("next", 1), ("next", 131), ("next", 7919), ("near", 17)] {
            transaction.create_edge(NodeId(1 + n), label, NodeId(1 + (n + step) % nodes));
        }
    }
    transaction
}

fn store(
    instance: &Instance,
    nodes: u64,
    spin: Duration,
    history: Option<usize>,
) -> Result<(), Failure> {
    let schema = "open = true\n[attributes]\np = { kind = \"pose\", hot = 10.0 }\n";
    let schema = Schema::from_toml("bench", schema).map_err(Failure::internal)?;
    let mut store = Store::open(instance, schema).map_err(Failure::internal)?;
    if let Some(history_bytes) = history {
        store.graph_mut().set_limits(Limits {
            history_bytes,
            ..Limits::default()
        });
    }
    if nodes > 0 {
        let committed = store.commit(&world(nodes), Time::default());
        committed.map_err(Failure::internal)?;
    }
    store.set_spin(spin);
    sit(1)?;
    let ended = end_of_input();
    say("ready")?;
    while !ended.load(Ordering::Acquire) {
        let served = store.serve(Duration::from_millis(20));
        served.map_err(Failure::internal)?;
    }
    Ok(())
}

fn bare(instance: &Instance, spin: Duration) -> Result<(), Failure> {
    let server = BareServer::open(instance).map_err(Failure::internal)?;
    sit(1)?;
    let ended = end_of_input();
    say("ready")?;
    while !ended.load(Ordering::Acquire) {
        let served = server.serve(Duration::from_millis(20), spin);
        served.map_err(Failure::internal)?;
    }
    Ok(())
}

/// What is stamped last: nothing comes after it.
pub(super) const LAST_STAMP: u64 = u64::MAX;

/// Commits the time so many times, and that it was the last.
fn stamp(instance: &Instance, times: u64) -> Result<(), Failure> {
    let mut session = attach(instance, "stamper")?;
    session.set_spin(PATIENCE);
    sit(2)?;
    say("ready")?;
    std::io::stdin()
        .read_exact(&mut [0; 3])
        .map_err(Failure::internal)?;
    for number in 0..=times {
        // Others have time to see each; the time is taken after the wait.
        let pause = Instant::now();
        while pause.elapsed() < Duration::from_micros(50) {
            std::hint::spin_loop();
        }
        let mut transaction = Transaction::new();
        transaction.set(NodeId(1), "stamp", LAST_STAMP);
        // Last: what is measured begins with the call of `commit`.
        if let [Operation::SetAttribute { value, .. }] = transaction.operations.as_mut_slice()
            && number < times
        {
            *value = Value::U64(clock());
        }
        let committed = session.commit(&transaction, Time::default());
        committed.map_err(Failure::internal)?;
    }
    Ok(())
}

/// The time of the last stamp.
pub(super) fn read_stamp(snapshot: &Snapshot) -> Result<Option<u64>, ReadError> {
    let Some(name) = snapshot.schema().find_attribute("stamp") else {
        return Ok(None);
    };
    let node = snapshot.find_node(NodeId(1))?;
    let value = node.map(|node| node.attribute(name)).transpose()?.flatten();
    Ok(match value.map(|attribute| attribute.value) {
        Some(Value::U64(time)) => Some(time),
        _ => None,
    })
}

/// Gives out a pose with the time, again and again.
fn pose(instance: &Instance) -> Result<(), Failure> {
    let mut session = attach(instance, "driver")?;
    let owner = Owner::Node(NodeId(1).into());
    let mut pose = session.hot(owner, "p").map_err(Failure::internal)?;
    let ended = end_of_input();
    say("ready")?;
    let mut n = 0.0;
    while !ended.load(Ordering::Acquire) {
        let pause = Instant::now();
        while pause.elapsed() < Duration::from_micros(50) {
            std::hint::spin_loop();
        }
        n += 1.0;
        let value = Value::from(Isometry2::new(Vector2::new(n, n), 0.5));
        let time = Time::from_nanoseconds(clock().cast_signed());
        pose.set(value, time).map_err(Failure::internal)?;
    }
    Ok(())
}

/// An agent that looks a thousand times a second.
fn reader(instance: &Instance) -> Result<(), Failure> {
    let mut session = attach(instance, "reader")?;
    let ended = end_of_input();
    say("ready")?;
    let mut node = 0;
    while !ended.load(Ordering::Acquire) {
        node = (node + 7919) % super::NODES;
        let snapshot = session.snapshot().map_err(Failure::internal)?;
        let found = snapshot.find_node(NodeId(1 + node));
        let found = found.map_err(Failure::internal)?;
        let value = found.map(|node| node.value("a")).transpose();
        value.map_err(Failure::internal)?;
        std::thread::sleep(Duration::from_millis(1));
    }
    Ok(())
}

/// An agent that follows every commit.
fn follow(instance: &Instance) -> Result<(), Failure> {
    let mut session = attach(instance, "follower")?;
    let changes = session.changes(Filter::default());
    let mut changes = changes.map_err(Failure::internal)?;
    let ended = end_of_input();
    say("ready")?;
    while !ended.load(Ordering::Acquire) {
        let waited = changes.wait(Duration::from_millis(20));
        waited.map_err(Failure::internal)?;
        let snapshot = session.snapshot().map_err(Failure::internal)?;
        while changes
            .next(snapshot.schema())
            .map_err(Failure::internal)?
            .is_some()
        {}
    }
    Ok(())
}

/// Joins, reads one attribute, then all of the graph, or copies it; tells the nanoseconds until the
/// first read (or the copy) was done, and the private memory at the end, in KiB.
fn join(instance: &Instance, copy: bool) -> Result<(), Failure> {
    let start = Instant::now();
    let mut session = attach(instance, "joiner")?;
    let snapshot = session.snapshot().map_err(Failure::internal)?;
    let node = snapshot.find_node(NodeId(super::MANY / 2));
    let node = node.map_err(Failure::internal)?;
    let value = node.map(|node| node.value("a")).transpose();
    if value.map_err(Failure::internal)?.flatten().is_none() {
        return Err(Failure::internal("the graph that was joined is not whole"));
    }
    let mut joined = start.elapsed();
    let replica = copy.then(|| Replica::of(&snapshot)).transpose()?;
    if copy {
        joined = start.elapsed();
    } else {
        read_all(&snapshot).map_err(Failure::internal)?;
    }
    let memory = private_kilobytes()?;
    drop(replica);
    say(&format!("{} {memory}", joined.as_nanos()))?;
    drop(std::io::stdin().read_to_end(&mut Vec::new()));
    Ok(())
}

fn read_all(snapshot: &Snapshot) -> Result<(), ReadError> {
    for node in snapshot.nodes() {
        let node = node?;
        std::hint::black_box((node.name()?, node.attributes()?));
        for edge in node.out_edges() {
            std::hint::black_box(edge?);
        }
    }
    Ok(())
}

/// Memory that is this process's own, in KiB.
fn private_kilobytes() -> Result<u64, Failure> {
    let text = std::fs::read_to_string("/proc/self/smaps_rollup").map_err(Failure::internal)?;
    let field = text.lines().find(|line| line.starts_with("Private_Dirty:"));
    let number = field.and_then(|line| line.split_whitespace().nth(1)?.parse().ok());
    number.ok_or_else(|| Failure::internal("no Private_Dirty in smaps_rollup"))
}

/// Writes the same number to several nodes, each time in one transaction, flat out.
fn pairs(instance: &Instance) -> Result<(), Failure> {
    let mut session = attach(instance, "writer")?;
    let mut transaction = Transaction::new();
    for n in 0..PAIRS {
        let attributes = vec![("n".to_owned(), Value::U64(0))];
        transaction.create_node("pair", &format!("pair{n}"), attributes);
    }
    let created = session.commit(&transaction, Time::default());
    let nodes = created.map_err(Failure::internal)?.created;
    let ended = end_of_input();
    say("ready")?;
    let mut number = 0;
    while !ended.load(Ordering::Acquire) {
        let batch: Vec<Transaction> = (0..16)
            .map(|_| {
                number += 1;
                let mut transaction = Transaction::new();
                for &node in &nodes {
                    transaction.set(node, "n", Value::U64(number));
                }
                transaction
            })
            .collect();
        let answers = session.commit_each(&batch, Time::default());
        for answer in answers.map_err(Failure::internal)? {
            answer.map_err(Failure::internal)?;
        }
    }
    Ok(())
}
