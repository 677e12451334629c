//! What reading costs in place, beside a copy on the heap.

use super::figure::Figure;
use super::hall::Hall;
use super::replica::Replica;
use super::{Effort, NODES, PATIENCE};
use crate::Failure;
use dsr::{AttributeId, NodeId, ReadError, Snapshot};
use std::hint::black_box;
use std::time::Instant;

/// Nanoseconds per item of `ours` and of `theirs`, which tell how many items they did: the
/// middle of many turns.
fn compare(
    effort: Effort,
    mut ours: impl FnMut() -> Result<u64, ReadError>,
    mut theirs: impl FnMut() -> u64,
) -> Result<(f64, f64), Failure> {
    let mut samples = [Vec::new(), Vec::new()];
    for _ in 0..effort.turns {
        let start = Instant::now();
        let done = ours().map_err(Failure::internal)?;
        samples[0].push(start.elapsed().as_nanos() as f64 / done.max(1) as f64);
        let start = Instant::now();
        let done = theirs();
        samples[1].push(start.elapsed().as_nanos() as f64 / done.max(1) as f64);
    }
    for samples in &mut samples {
        samples.sort_by(f64::total_cmp);
    }
    let [ours, theirs] = samples.map(|samples| samples[samples.len() / 2]);
    Ok((ours, theirs))
}

fn read_all(snapshot: &Snapshot, nodes: &[NodeId], name: AttributeId) -> Result<u64, ReadError> {
    let mut found = 0;
    for &node in nodes {
        if let Some(node) = snapshot.find_node(node)? {
            found += u64::from(black_box(node.attribute(name)?).is_some());
        }
    }
    Ok(found)
}

pub(super) fn all(hall: &Hall, effort: Effort, figures: &mut Vec<Figure>) -> Result<(), Failure> {
    let mut session = hall.session("reader")?;
    session
        .wait_for_store(PATIENCE)
        .map_err(Failure::internal)?;
    let snapshot = session.snapshot().map_err(Failure::internal)?;
    let replica = Replica::of(&snapshot)?;
    let schema = snapshot.schema();
    // In no order that a cache could guess.
    let mut nodes: Vec<NodeId> = (1..=NODES).map(NodeId).collect();
    nodes.sort_by_key(|node| node.0.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    for (figure, name) in [("read_attribute", "a"), ("read_pose", "p")] {
        let name = schema.attribute_id(name).map_err(Failure::internal)?;
        let (value, raw) = compare(
            effort,
            || read_all(&snapshot, &nodes, name),
            || {
                let read = |node: &NodeId| black_box(replica.attribute(*node, name)).is_some();
                nodes.iter().map(|node| u64::from(read(node))).sum()
            },
        )?;
        figures.push(Figure {
            name: figure,
            value,
            unit: "ns",
            raw: Some(raw),
            peer: "petgraph replica on the heap".to_owned(),
        });
    }
    let label = schema.label_id("next").map_err(Failure::internal)?;
    let (value, raw) = compare(
        effort,
        || {
            let mut count = 0;
            for edge in snapshot.edges_of_label(label) {
                black_box(edge?);
                count += 1;
            }
            Ok(count)
        },
        || {
            let edges = replica.edges_of_label(label);
            edges.map(black_box).count() as u64
        },
    )?;
    figures.push(Figure {
        name: "label_edges_per_edge",
        value,
        unit: "ns",
        raw: Some(raw),
        peer: "petgraph replica on the heap, filtered".to_owned(),
    });
    Ok(())
}
