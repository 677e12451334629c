//! petgraph's algorithms on a graph that lies in the memory of another process.

use crate::support::{Process, TestInstance};
use dsr::{Edge, EdgeRef, Operation, Session, Time, Transaction};
use petgraph::algo::{dijkstra, kosaraju_scc, tarjan_scc};
use petgraph::graph::{DiGraph, NodeIndex};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(20);
const SIDE: usize = 20;

/// A grid of one-way corridors: forth in every row, down in every column, back up only at the left
/// border. From, to, length.
fn corridors() -> Vec<(usize, usize, f64)> {
    let mut corridors = Vec::new();
    for row in 0..SIDE {
        for column in 0..SIDE {
            let here = row * SIDE + column;
            let length = ((here * 7919) % 13 + 1) as f64;
            if column + 1 < SIDE {
                corridors.push((here, here + 1, length));
            }
            if row + 1 < SIDE {
                corridors.push((here, here + SIDE, length + 0.5));
                if column == 0 {
                    corridors.push((here + SIDE, here, 1.0));
                }
            }
        }
    }
    corridors
}

#[test]
fn petgraphs_algorithms_run_in_place_on_the_memory_of_another_process() {
    let instance = TestInstance::new("algorithms");
    let store = Process::peer("store", &instance);
    let mut session = Session::attach(&instance.0, "walker", PATIENCE).unwrap();
    let mut transaction = Transaction::new();
    let mut own: DiGraph<String, f64> = DiGraph::new();
    for index in 0..SIDE * SIDE {
        transaction.create_node("place", &format!("p{index}"), vec![]);
        own.add_node(format!("p{index}"));
    }
    for (from, to, length) in corridors() {
        own.add_edge(NodeIndex::new(from), NodeIndex::new(to), length);
        transaction.push(Operation::CreateEdge {
            edge: EdgeRef::new(format!("p{from}"), "leads", format!("p{to}")),
            attributes: vec![("length".into(), length.into())],
        });
    }
    session.commit(&transaction, Time::default()).unwrap();

    let snapshot = session.snapshot().unwrap();
    let name = |id| snapshot.find_node(id).unwrap().unwrap().name().unwrap();
    let start = snapshot.find_node_by_name("p0").unwrap().unwrap().id();
    let length = |edge: Edge<'_>| edge.value("length").unwrap().unwrap().as_f64().unwrap();
    let mut found: Vec<(String, f64)> = dijkstra(&snapshot, start, None, length)
        .into_iter()
        .map(|(id, distance)| (name(id), distance))
        .collect();
    let mut expected: Vec<(String, f64)> = dijkstra(&own, NodeIndex::new(0), None, |e| *e.weight())
        .into_iter()
        .map(|(index, distance)| (own[index].clone(), distance))
        .collect();
    for distances in [&mut found, &mut expected] {
        distances.sort_by(|a, b| a.0.cmp(&b.0));
    }
    assert_eq!(found.len(), SIDE * SIDE);
    assert_eq!(found, expected);

    // Only the left border leads back, so that it alone is strongly connected.
    for components in [tarjan_scc(&snapshot), kosaraju_scc(&snapshot)] {
        let mut sizes: Vec<usize> = components.iter().map(Vec::len).collect();
        sizes.sort_unstable();
        assert_eq!(sizes.len(), SIDE * SIDE - SIDE + 1);
        assert_eq!(sizes.last(), Some(&SIDE));
    }
    snapshot.check().unwrap();
    drop((snapshot, session));
    store.finish();
}
