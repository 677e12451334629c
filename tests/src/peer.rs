//! The other process of a multi-process test: `peer ROLE INSTANCE ...`. It says `ready` when it has
//! joined, and goes on until its standard input ends.
#![forbid(unsafe_code)]
#![allow(
    clippy::print_stdout,
    reason = "standard output is how it speaks to the test"
)]

mod fill;
mod large;

use dsr::{
    Durability, Instance, ReadError, Schema, Session, Snapshot, State, Store, Time, Transaction,
    Value,
};
use std::error::Error;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(20);

type Outcome = Result<(), Box<dyn Error>>;

fn main() -> Outcome {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [role, instance, rest @ ..] = arguments.as_slice() else {
        return Err("usage: peer ROLE INSTANCE".into());
    };
    let instance = Instance::new(instance)?;
    let number = |index: usize| rest.get(index).map_or(Ok(0), |text| text.parse::<u64>());
    match role.as_str() {
        "large-store" => large::store(&instance),
        "large-camera" => large::camera(&instance),
        "large-still" => large::still(&instance),
        "large-watch" => large::watch(&instance),
        "hot-store" => hot_store(&instance),
        "hot-owner" => hot_owner(&instance),
        "store" => store(&instance),
        "join" => join(&instance),
        "store-with-state" => store_with_state(&instance, rest),
        "write-durable" => write_durable(&instance, number(0)?),
        "append" => append(&instance, rest.first().map_or("a", String::as_str)),
        "leases" => leases(&instance),
        "follow" => follow(&instance),
        "sum" => sum(&instance),
        "fill" => fill::fill(&instance),
        "set" => set(&instance, rest),
        "write-pairs" => write_pairs(&instance),
        "read-pairs" => read_pairs(&instance),
        "memory" => memory(&instance, number(0)?),
        "increment" => increment(&instance, number(0)?),
        other => Err(format!("no role `{other}`").into()),
    }
}

/// True once standard input has ended: the test is done, or gone.
fn end_of_input() -> Arc<AtomicBool> {
    let ended = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&ended);
    std::thread::spawn(move || {
        let mut rest = Vec::new();
        // However the input ends, it has.
        drop(std::io::stdin().read_to_end(&mut rest));
        flag.store(true, Ordering::Release);
    });
    ended
}

/// Serves; from an image, if there is one.
fn store(instance: &Instance) -> Outcome {
    let mut store = Store::open(instance, Schema::open())?;
    if let Some(left) = store.orphaned(None)? {
        store.take_over(&left)?;
    }
    // Little history, so that memory of old versions is reused under slow readers.
    store.graph_mut().set_limits(dsr::Limits {
        history_bytes: 64 << 10,
        ..dsr::Limits::default()
    });
    println!("ready");
    let ended = end_of_input();
    while !ended.load(Ordering::Acquire) {
        store.serve(Duration::from_millis(20))?;
    }
    Ok(())
}

/// Makes one node after the other, flat out, and tells how many.
fn append(instance: &Instance, name: &str) -> Outcome {
    let mut session = Session::attach(instance, name, PATIENCE)?;
    let ended = end_of_input();
    let mut made = 0;
    while !ended.load(Ordering::Acquire) {
        let mut transaction = Transaction::new();
        transaction.create_node("thing", &format!("{name}{made}"), vec![]);
        session.commit(&transaction, Time::default())?;
        made += 1;
    }
    println!("{made}");
    Ok(())
}

/// Takes all the leases there are.
fn leases(instance: &Instance) -> Outcome {
    let mut session = Session::attach(instance, "tenant", PATIENCE)?;
    let snapshot = session.snapshot()?;
    let mut leases = Vec::new();
    for _ in 0..32 {
        leases.push(session.lease(&snapshot, Duration::from_mins(5))?);
    }
    println!("ready");
    let ended = end_of_input();
    while !ended.load(Ordering::Acquire) {
        session.wait_for_tick(Duration::from_millis(20))?;
    }
    Ok(())
}

/// Follows every commit.
fn follow(instance: &Instance) -> Outcome {
    let mut session = Session::attach(instance, "follower", PATIENCE)?;
    let mut changes = session.changes(dsr::Filter::default())?;
    println!("ready");
    let ended = end_of_input();
    while !ended.load(Ordering::Acquire) {
        changes.wait(Duration::from_millis(20))?;
        let schema = session.snapshot()?.schema().clone();
        while changes.next(&schema)?.is_some() {}
    }
    Ok(())
}

/// Reads all nodes again and again, and tells at the end how many the last version has.
fn sum(instance: &Instance) -> Outcome {
    let mut session = Session::attach(instance, "reader", PATIENCE)?;
    println!("ready");
    let ended = end_of_input();
    let sum = loop {
        let last = ended.load(Ordering::Acquire);
        let snapshot = session.snapshot()?;
        match read_all(&snapshot, u64::MAX) {
            Ok(found) if found != snapshot.node_count() => {
                return Err(format!("{found} of {} nodes", snapshot.node_count()).into());
            }
            Ok(found) if last => break found,
            Ok(_) | Err(ReadError::SnapshotTooOld { .. }) => {}
            Err(other) => return Err(other.into()),
        }
    };
    println!("{sum}");
    Ok(())
}

/// Sets one attribute as an agent of that name, and stays.
fn set(instance: &Instance, rest: &[String]) -> Outcome {
    let [agent, attribute] = rest else {
        return Err("usage: peer set INSTANCE AGENT ATTRIBUTE".into());
    };
    let mut session = Session::attach(instance, agent, PATIENCE)?;
    let mut transaction = Transaction::new();
    transaction.set("shelly", attribute, 1.0);
    session.commit(&transaction, Time::default())?;
    println!("done");
    let ended = end_of_input();
    while !ended.load(Ordering::Acquire) {
        session.wait_for_tick(Duration::from_millis(20))?;
    }
    Ok(())
}

/// Joins, waits for the store, opens a channel at both ends.
fn join(instance: &Instance) -> Outcome {
    let mut session = Session::join(instance, "guest")?;
    session.wait_for_store(PATIENCE)?;
    session.snapshot()?;
    let sender = session.publisher::<u64>("numbers")?;
    let receiver = session.subscriber::<u64>("numbers")?;
    println!("ready");
    let ended = end_of_input();
    while !ended.load(Ordering::Acquire) {
        session.wait_for_tick(Duration::from_millis(20))?;
    }
    drop((sender, receiver));
    Ok(())
}

/// A store that keeps its graph in a folder, with a new group every few milliseconds.
fn store_with_state(instance: &Instance, rest: &[String]) -> Outcome {
    let folder = rest.first().ok_or("which folder?")?;
    let state = State::open(Path::new(folder))?;
    let mut store = Store::open(instance, Schema::open())?;
    if let Some(image) = state.load()? {
        store.restore(&image)?;
    }
    store.keep(state, Duration::from_millis(3), Durability::InMemory)?;
    println!("ready");
    let ended = end_of_input();
    while !ended.load(Ordering::Acquire) {
        store.serve(Duration::from_millis(20))?;
    }
    Ok(())
}

/// Writes ever greater numbers to nodes of its own, all in one transaction, flat out, and says
/// each number that the store called durable, with the version.
fn write_durable(instance: &Instance, client: u64) -> Outcome {
    let mut session = Session::attach(instance, &format!("writer{client}"), PATIENCE)?;
    let name = |i: u64| format!("w{client}-{i}");
    let snapshot = session.snapshot()?;
    let mut n = match snapshot.find_node_by_name(&name(0))? {
        Some(node) => node.value("n")?.and_then(|n| n.as_f64()).unwrap_or(0.0) as u64,
        None => {
            let mut create = Transaction::new();
            for i in 0..PAIRS {
                create.create_node("pair", &name(i), vec![("n".into(), Value::U64(0))]);
            }
            session.commit(&create, Time::default())?;
            0
        }
    };
    loop {
        n += 1;
        let mut transaction = Transaction::new();
        for i in 0..PAIRS {
            transaction.set(name(i), "n", Value::U64(n));
        }
        // A node that comes and goes, with edges.
        let visitor = format!("visitor{client}");
        if n.is_multiple_of(2) {
            transaction.create_node("visitor", &visitor, vec![]);
            transaction.create_edge(visitor, "sees", name(n % PAIRS));
        } else if session.snapshot()?.find_node_by_name(&visitor)?.is_some() {
            transaction.delete_node(visitor);
        }
        if n.is_multiple_of(3) {
            let commit = session.commit(&transaction.durable(), Time::default())?;
            println!("{n} {}", commit.version);
        } else {
            session.commit(&transaction, Time::default())?;
        }
    }
}

/// A store in whose graph a robot's pose is hot; `driver` may write that, `tool` everything.
fn hot_store(instance: &Instance) -> Outcome {
    let text = "open = true\n[attributes]\npose = { kind = \"pose\", hot = 100.0 }\n";
    let mut store = Store::open(instance, Schema::from_toml("test", text)?)?;
    let mut transaction = Transaction::new();
    transaction.create_node("robot", "robot", vec![("pose".into(), place(0).into())]);
    store.commit(&transaction, Time::default())?;
    let driver = "agent = \"driver\"\nattributes = [\"robot.pose\"]\n";
    store.graph_mut().set_rights([
        dsr::Manifest::from_toml("driver.toml", driver, &Schema::open())?,
        dsr::Manifest::everything("tool"),
    ]);
    println!("ready");
    let ended = end_of_input();
    while !ended.load(Ordering::Acquire) {
        store.serve(Duration::from_millis(20))?;
    }
    Ok(())
}

fn place(n: i64) -> dsr::Pose {
    dsr::Pose::translation(n as f64, n as f64, n as f64)
}

/// Gives out the robot's pose as fast as it can, a microsecond of its time apart, on from where it
/// was, and folds it in.
fn hot_owner(instance: &Instance) -> Outcome {
    let mut session = Session::attach(instance, "driver", PATIENCE)?;
    let mut pose = session.hot(dsr::Owner::Node("robot".into()), "pose")?;
    let snapshot = session.snapshot()?;
    let robot = snapshot.find_node_by_name("robot")?.ok_or("no robot")?;
    let value = robot.value("pose")?;
    let start = value.as_ref().and_then(Value::as_pose).ok_or("no pose")?;
    let mut n = start.translation.x as i64;
    println!("ready");
    let ended = end_of_input();
    while !ended.load(Ordering::Acquire) {
        n += 1;
        let time = Time::from_nanoseconds(n * 1000);
        pose.set(place(n), time)?;
        let mut transaction = Transaction::new();
        if pose.fold_into(&mut transaction) {
            session.commit(&transaction, time)?;
        }
    }
    println!("{n}");
    Ok(())
}

/// How many nodes every transaction of `write-pairs` writes the same number to.
const PAIRS: u64 = 8;

/// Writes the same number to many nodes, each time in one transaction, flat out.
fn write_pairs(instance: &Instance) -> Outcome {
    let mut session = Session::attach(instance, "writer", PATIENCE)?;
    let mut create = Transaction::new();
    for i in 0..PAIRS {
        create.create_node(
            "pair",
            &format!("pair{i}"),
            vec![("n".into(), Value::U64(0))],
        );
    }
    session.commit(&create, Time::default())?;
    println!("ready");
    let ended = end_of_input();
    let mut n = 0;
    while !ended.load(Ordering::Acquire) {
        n += 1;
        let mut transaction = Transaction::new();
        for i in 0..PAIRS {
            transaction.set(format!("pair{i}"), "n", Value::U64(n));
            transaction.set(
                format!("pair{i}"),
                "text",
                "x".repeat((n % 50) as usize).as_str(),
            );
        }
        // A node that comes and goes moves every index.
        if n % 2 == 0 {
            transaction.create_node("visitor", "visitor", vec![]);
            transaction.create_edge("visitor", "sees", "pair0");
        } else if n > 1 {
            transaction.delete_node("visitor");
        }
        session.commit(&transaction, Time::default())?;
    }
    println!("{n}");
    Ok(())
}

/// Reads what `write-pairs` writes and counts reads, and reads that saw half a transaction.
fn read_pairs(instance: &Instance) -> Outcome {
    let mut session = Session::attach(instance, "reader", PATIENCE)?;
    println!("ready");
    let ended = end_of_input();
    let (mut reads, mut torn, mut outlived) = (0u64, 0u64, 0u64);
    while !ended.load(Ordering::Acquire) {
        // Again and again until the version is outlived: that is when it could go wrong.
        let snapshot = session.snapshot()?;
        loop {
            match pairs_agree(&snapshot) {
                Ok(true) => reads += 1,
                Ok(false) => torn += 1,
                Err(ReadError::SnapshotTooOld { .. }) => {
                    outlived += 1;
                    break;
                }
                Err(other) => return Err(other.into()),
            }
            if ended.load(Ordering::Acquire) {
                break;
            }
        }
    }
    println!("{reads} {torn} {outlived}");
    Ok(())
}

fn pairs_agree(snapshot: &Snapshot) -> Result<bool, ReadError> {
    let schema = snapshot.schema();
    let (Some(pair), Some(n)) = (schema.find_type("pair"), schema.find_attribute("n")) else {
        return Ok(true);
    };
    let mut seen = Vec::new();
    for node in snapshot.nodes_of_type(pair) {
        let node = node?;
        seen.push((
            node.name()?,
            node.attribute(n)?.map(|a| (a.value, a.version)),
        ));
    }
    let visitor = snapshot.find_node_by_name("visitor")?;
    let visits = match &visitor {
        Some(visitor) => visitor.out_edges().collect::<Result<Vec<_>, _>>()?.len(),
        None => 0,
    };
    let first = seen.first().and_then(|(_, read)| read.clone());
    let even = matches!(&first, Some((Value::U64(n), _)) if *n > 0 && n % 2 == 0);
    Ok(seen.len() as u64 == PAIRS
        && seen.iter().all(|(_, read)| *read == first)
        && visitor.is_some() == even
        && visits == usize::from(even))
}

/// Reads the whole graph and tells the private memory of this process before and after, in KiB.
fn memory(instance: &Instance, nodes: u64) -> Outcome {
    let mut session = Session::attach(instance, "reader", PATIENCE)?;
    // Everything that is allocated once is allocated by reading one node.
    read_all(&session.snapshot()?, 1)?;
    let before = private_kilobytes()?;
    let sum = read_all(&session.snapshot()?, nodes)?;
    let after = private_kilobytes()?;
    println!("{before} {after} {sum}");
    Ok(())
}

fn read_all(snapshot: &Snapshot, most: u64) -> Result<u64, ReadError> {
    let mut sum = 0;
    for node in snapshot.nodes().take(most as usize) {
        for attribute in node?.attributes()? {
            sum += attribute.value.as_f64().map_or(0, |x| x as u64);
        }
    }
    Ok(sum)
}

/// Memory that is this process's own: neither shared with others nor backed by a file.
fn private_kilobytes() -> Result<u64, Box<dyn Error>> {
    let text = std::fs::read_to_string("/proc/self/smaps_rollup")?;
    let field = |name: &str| {
        let line = text.lines().find(|line| line.starts_with(name))?;
        line.split_whitespace().nth(1)?.parse::<u64>().ok()
    };
    field("Private_Dirty:").ok_or_else(|| "no Private_Dirty in smaps_rollup".into())
}

/// Adds one to a counter so many times, each time from what it read, retrying on conflict.
fn increment(instance: &Instance, times: u64) -> Outcome {
    let mut session = Session::attach(instance, "incrementer", PATIENCE)?;
    let mut conflicts = 0;
    for _ in 0..times {
        loop {
            let snapshot = session.snapshot()?;
            let node = snapshot.find_node_by_name("counter")?.ok_or("no counter")?;
            let old = node.value("n")?;
            let n = old.as_ref().and_then(Value::as_f64).unwrap_or_default();
            let mut transaction = Transaction::new().require(dsr::Precondition::AttributeEquals {
                owner: dsr::Owner::Node("counter".into()),
                name: "n".into(),
                value: old,
            });
            transaction.set("counter", "n", n + 1.0);
            match session.commit(&transaction, Time::default()) {
                Ok(_) => break,
                Err(dsr::CommitError::Refused(dsr::Refusal::Conflict(_))) => conflicts += 1,
                Err(other) => return Err(other.into()),
            }
        }
    }
    println!("{conflicts}");
    Ok(())
}
