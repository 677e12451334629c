//! How long a commit takes until it is acknowledged and until it is seen, and how many there are in
//! a second.

use super::figure::{Figure, median};
use super::hall::Hall;
use super::{Effort, NODES, PATIENCE, peer};
use crate::Failure;
use dsr::{BareClient, NodeId, Session, Time, Transaction, Value};
use std::time::{Duration, Instant};

/// Looks at the newest version between two snapshots.
const LOOKS: usize = 1000;

pub(super) fn set(node: u64, value: f64) -> Transaction {
    let mut transaction = Transaction::new();
    transaction.set(NodeId(1 + node % NODES), "a", value);
    transaction
}

/// Times `count` calls of `act` in nanoseconds, after a tenth as many that do not count.
fn time(
    count: usize,
    samples: &mut Vec<u64>,
    mut act: impl FnMut(u64) -> Result<(), Failure>,
) -> Result<(), Failure> {
    for round in 0..count + count / 10 {
        let start = Instant::now();
        act(round as u64)?;
        if round >= count / 10 {
            samples.push(start.elapsed().as_nanos() as u64);
        }
    }
    Ok(())
}

fn answered(came: bool) -> Result<(), Failure> {
    if came {
        Ok(())
    } else {
        Err(Failure::internal("the bare server did not answer"))
    }
}

pub(super) fn commit(session: &mut Session, transaction: &Transaction) -> Result<(), Failure> {
    let commit = session.commit(transaction, Time::default());
    commit.map(|_| ()).map_err(Failure::internal)
}

/// Commits of one attribute beside bare round trips, both ends polling. The bare figure, in us.
pub(super) fn polling(
    hall: &Hall,
    effort: Effort,
    figures: &mut Vec<Figure>,
) -> Result<f64, Failure> {
    let echo = hall.ready("bare", &[2000])?;
    let bare = BareClient::open(hall.instance()).map_err(Failure::internal)?;
    let mut session = hall.session("committer")?;
    session.set_spin(PATIENCE);
    let all = peer::sit(0)?;
    let (mut ours, mut raw) = (Vec::new(), Vec::new());
    for turn in 0..effort.turns {
        bare.wake().map_err(Failure::internal)?;
        time(1000, &mut raw, |word| {
            answered(bare.poll(word, PATIENCE).map_err(Failure::internal)?)
        })?;
        let base = turn as u64 * 1000;
        time(1000, &mut ours, |n| {
            commit(&mut session, &set((base + n) * 7919, n as f64))
        })?;
    }
    drop(bare);
    peer::stand(&all)?;
    echo.end()?;
    let raw = median(&mut raw) / 1e3;
    figures.push(Figure {
        name: "commit_ack_poll",
        value: median(&mut ours) / 1e3,
        unit: "us",
        raw: Some(raw),
        peer: "iceoryx2 round trip, polling".to_owned(),
    });
    Ok(raw)
}

/// From the call of `commit` in one process until another reads the value.
pub(super) fn visible(
    hall: &Hall,
    effort: Effort,
    raw: f64,
    figures: &mut Vec<Figure>,
) -> Result<(), Failure> {
    let mut writer = hall.ready("stamp", &[effort.stamps])?;
    let mut session = hall.session("seer")?;
    let mut samples = Vec::new();
    let mut snapshot = session.snapshot().map_err(Failure::internal)?;
    let all = peer::sit(0)?;
    writer.go()?;
    let deadline = Instant::now() + PATIENCE;
    let mut last = 0;
    while last != peer::LAST_STAMP {
        if Instant::now() > deadline {
            return Err(Failure::internal("the stamps stopped coming"));
        }
        // A session looks now and then for memory that has come: not just when there is a commit.
        let _is_over = (0..LOOKS).any(|_| !snapshot.is_newest());
        snapshot = session.snapshot().map_err(Failure::internal)?;
        let read = peer::read_stamp(&snapshot).map_err(Failure::internal)?;
        let seen = peer::clock();
        if let Some(stamp) = read
            && stamp > last
        {
            last = stamp;
            if stamp != peer::LAST_STAMP {
                samples.push(seen.saturating_sub(stamp));
            }
        }
    }
    peer::stand(&all)?;
    writer.end()?;
    figures.push(Figure {
        name: "visible_poll",
        value: median(&mut samples) / 1e3,
        unit: "us",
        raw: Some(raw),
        peer: "iceoryx2 round trip, polling".to_owned(),
    });
    Ok(())
}

/// From the call of `set` of a hot pose in one process until another has read it.
pub(super) fn hot(
    hall: &Hall,
    effort: Effort,
    raw: f64,
    figures: &mut Vec<Figure>,
) -> Result<(), Failure> {
    let owner = hall.ready("pose", &[])?;
    let mut session = hall.session("seer")?;
    let deadline = Instant::now() + PATIENCE;
    let mut samples = Vec::new();
    let mut last = 0;
    while samples.len() < effort.stamps as usize {
        // A snapshot for a while, as an agent's turn has one.
        let snapshot = session.snapshot().map_err(Failure::internal)?;
        let name = snapshot.schema().attribute_id("p");
        let name = name.map_err(Failure::internal)?;
        let node = snapshot.find_node(NodeId(1)).map_err(Failure::internal)?;
        let node = node.ok_or_else(|| Failure::internal("no node 1"))?;
        for _ in 0..1000 {
            let read = node.attribute(name).map_err(Failure::internal)?;
            let seen = peer::clock();
            let stamp = read.map_or(0, |read| read.time.nanoseconds().cast_unsigned());
            if stamp > last {
                // The first may have been there for long.
                if last > 0 {
                    samples.push(seen.saturating_sub(stamp));
                }
                last = stamp;
            }
        }
        if Instant::now() > deadline {
            return Err(Failure::internal("the hot poses stopped coming"));
        }
    }
    owner.end()?;
    figures.push(Figure {
        name: "hot_pose_visible",
        value: median(&mut samples) / 1e3,
        unit: "us",
        raw: Some(raw),
        peer: "iceoryx2 round trip, polling".to_owned(),
    });
    Ok(())
}

/// As [`polling`], with ends that sleep until they are woken.
pub(super) fn blocking(
    hall: &Hall,
    effort: Effort,
    figures: &mut Vec<Figure>,
) -> Result<(), Failure> {
    let echo = hall.ready("bare", &[0])?;
    let bare = BareClient::open(hall.instance()).map_err(Failure::internal)?;
    let mut session = hall.session("committer")?;
    session.set_spin(Duration::ZERO);
    let all = peer::sit(0)?;
    let (mut ours, mut raw) = (Vec::new(), Vec::new());
    for turn in 0..effort.turns {
        time(200, &mut raw, |word| {
            answered(bare.block(word, PATIENCE).map_err(Failure::internal)?)
        })?;
        let base = turn as u64 * 1000;
        time(200, &mut ours, |n| {
            commit(&mut session, &set((base + n) * 7919, n as f64))
        })?;
    }
    drop(bare);
    peer::stand(&all)?;
    echo.end()?;
    figures.push(Figure {
        name: "commit_ack_block",
        value: median(&mut ours) / 1e3,
        unit: "us",
        raw: Some(median(&mut raw) / 1e3),
        peer: "iceoryx2 round trip, both ends asleep".to_owned(),
    });
    Ok(())
}

/// Commits per second of one client that sends as many as it can, with eight readers attached.
pub(super) fn flat_out(
    hall: &Hall,
    effort: Effort,
    raw: f64,
    figures: &mut Vec<Figure>,
) -> Result<(), Failure> {
    const READERS: usize = 8;
    const BATCH: u64 = 128;
    let mut readers = Vec::new();
    for _ in 0..READERS {
        readers.push(hall.ready("reader", &[])?);
    }
    let mut session = hall.session("committer")?;
    session.set_spin(PATIENCE);
    let first = session.snapshot().map_err(Failure::internal)?.version().0;
    let batches: Vec<Vec<Transaction>> = (0..16)
        .map(|batch| {
            (0..BATCH)
                .map(|n| set((batch * BATCH + n) * 7919, n as f64))
                .collect()
        })
        .collect();
    let mut next = first;
    let start = Instant::now();
    for batch in 0..effort.batches {
        let transactions = &batches[batch as usize % batches.len()];
        let answers = session
            .commit_each(transactions, Time::default())
            .map_err(Failure::internal)?;
        for answer in answers {
            let commit = answer.map_err(Failure::internal)?;
            next += 1;
            if commit.version.0 != next {
                let got = commit.version;
                return Err(Failure::internal(format!("commit {next} became {got}")));
            }
        }
    }
    let seconds = start.elapsed().as_secs_f64();
    // What was acknowledged last is there, and nothing came between.
    let snapshot = session.snapshot().map_err(Failure::internal)?;
    let node = 1 + ((effort.batches - 1) % 16 * BATCH + BATCH - 1) * 7919 % NODES;
    let node = snapshot
        .find_node(NodeId(node))
        .map_err(Failure::internal)?;
    let value = node.map(|node| node.value("a")).transpose();
    let lost = value.map_err(Failure::internal)?.flatten() != Some(Value::F64(BATCH as f64 - 1.0));
    if lost || snapshot.version().0 != first + BATCH * effort.batches {
        return Err(Failure::internal("acknowledged commits were lost"));
    }
    for reader in readers {
        reader.end()?;
    }
    figures.push(Figure {
        name: "commits_flat_out",
        value: (BATCH * effort.batches) as f64 / seconds,
        unit: "commits/s",
        raw: Some(1e6 / raw),
        peer: "iceoryx2 round trips, one at a time".to_owned(),
    });
    Ok(())
}
