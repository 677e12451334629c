//! What joining a large graph costs a process, and whether what it reads is whole while others write
//! as fast as they can.

use super::figure::{Figure, median};
use super::hall::Hall;
use super::peer::PAIRS;
use super::{Effort, MANY, NODES};
use crate::Failure;
use dsr::{NodeId, ReadError, Snapshot, Value};

/// Joining a graph of 100,000 nodes, and the memory of the process that has read all of it.
pub(super) fn joining(effort: Effort, figures: &mut Vec<Figure>) -> Result<(), Failure> {
    write_back_program()?;
    let hall = Hall::open()?;
    let store = hall.ready("store", &[MANY, 50])?;
    let mut measured = [Vec::new(), Vec::new(), Vec::new(), Vec::new()];
    for _ in 0..effort.joins {
        for (role, at) in [("join", 0), ("copy", 2)] {
            let mut peer = hall.start(role, &[])?;
            let [time, memory] = peer.numbers()?;
            peer.end()?;
            measured[at].push(time);
            measured[at + 1].push(memory);
        }
    }
    store.end()?;
    let [time, memory, copy_time, copy_memory] = measured.map(|mut samples| median(&mut samples));
    figures.push(Figure {
        name: "attach_100k",
        value: time / 1e6,
        unit: "ms",
        raw: Some(copy_time / 1e6),
        peer: "petgraph replica, filled".to_owned(),
    });
    figures.push(Figure {
        name: "private_memory_per_agent",
        value: memory / 1024.0,
        unit: "MB",
        raw: Some(copy_memory / 1024.0),
        peer: "process with a petgraph replica".to_owned(),
    });
    Ok(())
}

/// Pages of a program that was just built and is not yet on disk would count as its processes' own memory.
fn write_back_program() -> Result<(), Failure> {
    let program = std::env::current_exe().and_then(std::fs::File::open);
    let written = program.and_then(|program| program.sync_all());
    written.map_err(Failure::internal)
}

/// Reads what another process writes flat out.
pub(super) fn torn(effort: Effort, figures: &mut Vec<Figure>) -> Result<(), Failure> {
    let hall = Hall::open()?;
    let store = hall.ready("forgetful", &[NODES])?;
    let writer = hall.ready("pairs", &[])?;
    let mut session = hall.session("reader")?;
    let (mut done, mut torn, mut outlived) = (0, 0, 0u64);
    while done < effort.reads {
        // The same version again and again until its memory is reused: that is when it could
        // go wrong.
        let snapshot = session.snapshot().map_err(Failure::internal)?;
        for _ in 0..1000 {
            match pairs_agree(&snapshot) {
                Ok(agree) => {
                    done += PAIRS;
                    torn += u64::from(!agree);
                }
                Err(ReadError::SnapshotTooOld { .. }) => {
                    outlived += 1;
                    break;
                }
                Err(damaged) => return Err(Failure::internal(damaged)),
            }
        }
    }
    writer.end()?;
    store.end()?;
    figures.push(Figure {
        name: "torn_reads",
        value: torn as f64,
        unit: "reads",
        raw: None,
        peer: format!("of {done} under full write load, {outlived} versions outlived"),
    });
    Ok(())
}

fn pairs_agree(snapshot: &Snapshot) -> Result<bool, ReadError> {
    let Some(name) = snapshot.schema().find_attribute("n") else {
        return Ok(false);
    };
    let mut first = None;
    for n in 0..PAIRS {
        let node = snapshot.find_node(NodeId(NODES + 1 + n))?;
        let read = node.map(|node| node.attribute(name)).transpose()?.flatten();
        let Some((Value::U64(number), version)) = read.map(|read| (read.value, read.version))
        else {
            return Ok(false);
        };
        if *first.get_or_insert((number, version)) != (number, version) {
            return Ok(false);
        }
    }
    Ok(true)
}
