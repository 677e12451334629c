//! Nodes by the short way: whatever it finds, in whatever version, is what the trie has there.

use super::*;
use crate::NodeRef;
use crate::arena::{Address, cells, late};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// The addresses of a node's record by the short way and by the trie.
fn ways(snapshot: &Snapshot, id: u64) -> Result<[Option<Address>; 2], ReadError> {
    let short = cells::find(&snapshot.arena, &snapshot.root, id);
    let long = snapshot.genuine(late::find(&snapshot.arena, &snapshot.root, id))?;
    snapshot.check()?;
    Ok([short.map(|(address, _)| address), long])
}

/// That the short way leads nowhere else than the trie.
#[allow(
    clippy::panic_in_result_fn,
    reason = "a wrong answer fails the test, an outlived version does not"
)]
pub(super) fn agree(snapshot: &Snapshot) -> Result<(), ReadError> {
    for id in 0..=snapshot.root.next_id {
        let [short, long] = ways(snapshot, id)?;
        assert!(short.is_none() || short == long, "{id}: {short:?} {long:?}");
    }
    Ok(())
}

/// How many of the nodes are found by the short way.
fn short_ways(snapshot: &Snapshot) -> usize {
    let nodes = snapshot.nodes().map(|node| node.unwrap().id().0);
    let short = nodes.filter(|&id| ways(snapshot, id).unwrap()[0].is_some());
    short.count()
}

fn create(id: u64) -> Operation {
    Operation::CreateNode {
        id: Some(NodeId(id)),
        type_name: "t".into(),
        name: format!("n{id}"),
        attributes: vec![("x".into(), Value::U64(id))],
    }
}

fn commit(graph: &mut Graph, operations: Vec<Operation>) -> Snapshot {
    let transaction = Transaction {
        operations,
        ..Transaction::new()
    };
    graph.commit(&transaction, "a", Time::default()).unwrap();
    graph.snapshot()
}

fn set(id: u64, x: u64) -> Operation {
    Operation::SetAttribute {
        owner: Owner::Node(NodeId(id).into()),
        name: "x".into(),
        value: Value::U64(x),
    }
}

fn x(snapshot: &Snapshot, id: u64) -> Option<u64> {
    let node = snapshot.find_node(NodeId(id)).unwrap()?;
    match node.value("x").unwrap() {
        Some(Value::U64(x)) => Some(x),
        other => panic!("{other:?}"),
    }
}

#[test]
fn wild_ids_live_beside_small_ones() {
    let mut graph = Graph::in_memory(Schema::open());
    let small = [1, 2, 63, 64, 65];
    let wild = [
        1 << 40,
        (1 << 40) + 64,
        u64::MAX - 1,
        u64::MAX - 1 - (1 << 63),
    ];
    let mut ids = small.to_vec();
    ids.extend(wild);
    for &id in &ids {
        commit(&mut graph, vec![create(id)]);
    }
    let snapshot = graph.snapshot();
    for &id in &ids {
        let found = snapshot.find_node(NodeId(id)).unwrap().unwrap();
        assert_eq!(found.id(), NodeId(id));
    }
    assert_eq!(snapshot.nodes().count(), ids.len());
    assert_eq!(
        short_ways(&snapshot),
        small.len(),
        "the wild ones have no cell"
    );
}

/// Rows are replaced by longer ones while versions are alive that have the shorter.
#[test]
fn a_growing_graph_is_what_it_was_in_every_version() {
    const STEP: u64 = 500;
    let mut graph = Graph::in_memory(Schema::open());
    let mut past = Vec::new();
    for step in 0..8 {
        let new = 1 + step * STEP..1 + (step + 1) * STEP;
        past.push(commit(&mut graph, new.clone().map(create).collect()));
        // Of the nodes so far some change, some go, and one that is gone comes again.
        let change = (1..new.end).step_by(7).filter(|id| id % 10 != 0);
        let mut operations: Vec<Operation> = change.map(|id| set(id, step + 10_000)).collect();
        let node = NodeRef::from(NodeId(10 + step * STEP));
        operations.push(Operation::DeleteNode { node });
        past.push(commit(&mut graph, operations));
        past.push(commit(&mut graph, vec![create(10 + step * STEP)]));
        assert_eq!(short_ways(&graph.snapshot()), new.end as usize - 1);
    }
    for (index, snapshot) in past.iter().enumerate() {
        agree(snapshot).unwrap();
        let (step, turn) = (index as u64 / 3, index % 3);
        let end = 1 + (step + 1) * STEP;
        for id in 1..end {
            let changes = (id - 1) % 7 == 0 && id % 10 != 0;
            let born = (id - 1) / STEP;
            let wanted = match turn {
                1 if id == 10 + step * STEP => None,
                0 if changes && born < step => Some(step - 1 + 10_000),
                1 | 2 if changes => Some(step + 10_000),
                _ => Some(id),
            };
            assert_eq!(
                x(snapshot, id),
                wanted,
                "node {id} in turn {turn} of {step}"
            );
        }
        assert_eq!(x(snapshot, end), None);
    }
}

/// A store may be killed when it has set the cells of a commit and not published it.
#[test]
fn cells_of_a_version_that_is_never_published_show_nothing_of_it() {
    let mut graph = Graph::in_memory(Schema::open());
    let before = commit(&mut graph, (1..=3).map(create).collect());
    let mut transaction = Transaction::new();
    transaction.operations = vec![set(1, 100), create(4)];
    transaction.delete_node(NodeId(2));
    let mut work = Work::new(&mut graph, "a", Time::default()).unwrap();
    work.apply(&transaction.operations).unwrap();
    work.finish(None).unwrap();
    let (root, writer) = (work.root, &mut graph.writer);
    cells::set(&writer.arena, &root, &mut writer.moved);
    let newest = Snapshot::new(
        Arc::clone(&before.arena),
        before.arena.newest_root().unwrap(),
        Arc::clone(&before.schema),
    );
    for snapshot in [before, newest] {
        agree(&snapshot).unwrap();
        let found = [1, 2, 3, 4].map(|id| x(&snapshot, id));
        assert_eq!(found, [Some(1), Some(2), Some(3), None]);
    }
}

/// Writes down what it sees of node 1 in every version before that is published.
#[derive(Debug, Default)]
struct Witness(Mutex<Vec<Option<u64>>>);

impl RuleEngine for Witness {
    fn expand(
        &self,
        _: &Snapshot,
        _: &str,
        _: &[(String, NodeId)],
    ) -> Result<Vec<Operation>, Refusal> {
        Ok(Vec::new())
    }

    fn successor(
        &self,
        after: &Snapshot,
        _: &Change,
    ) -> Result<Option<Arc<dyn RuleEngine>>, Refusal> {
        self.0.lock().unwrap().push(x(after, 1));
        Ok(None)
    }
}

#[test]
fn who_is_asked_about_a_version_sees_it_before_it_is_published() {
    let mut graph = Graph::in_memory(Schema::open());
    let witness = Arc::new(Witness::default());
    graph.set_rules(Arc::clone(&witness) as _);
    commit(&mut graph, vec![create(1)]);
    commit(&mut graph, vec![set(1, 7)]);
    let node = NodeRef::from(NodeId(1));
    commit(&mut graph, vec![Operation::DeleteNode { node }]);
    assert_eq!(*witness.0.lock().unwrap(), [Some(1), Some(7), None]);
}

/// Readers as slow as they like beside a writer that reuses memory as fast as it can.
#[test]
fn two_nodes_that_are_always_written_together_are_never_read_apart() {
    let mut graph = Graph::in_memory(Schema::open());
    graph.set_limits(Limits {
        history_bytes: 8 << 10,
        ..Limits::default()
    });
    let both = |n: u32| {
        [1, 2].map(|id| Operation::SetAttribute {
            owner: Owner::Node(NodeId(id).into()),
            name: "n".into(),
            value: f64::from(n).into(),
        })
    };
    let mut operations = vec![create(1), create(2)];
    operations.extend(both(0));
    let first = commit(&mut graph, operations);
    let newest = || {
        let root = first.arena.newest_root().unwrap();
        let (arena, schema) = (Arc::clone(&first.arena), Arc::clone(&first.schema));
        Snapshot::new(arena, root, schema)
    };
    let name = first.schema.attribute_id("n").unwrap();
    let read = |snapshot: &Snapshot| -> Result<_, ReadError> {
        let of = |id| {
            let node = snapshot.find_node(NodeId(id))?;
            let found = node.map(|node| node.attribute(name)).transpose()?;
            Ok(found.flatten().map(|found| found.value))
        };
        Ok([of(1)?, of(2)?])
    };
    let (ended, whole) = (AtomicBool::new(false), AtomicU64::new(0));
    let reader = || {
        while !ended.load(Ordering::Relaxed) {
            let snapshot = newest();
            for _ in 0..100 {
                match read(&snapshot) {
                    Ok([a, b]) => assert!(a.is_some() && a == b, "{a:?} {b:?}"),
                    Err(ReadError::SnapshotTooOld { .. }) => break,
                    Err(other) => panic!("{other}"),
                }
                whole.fetch_add(1, Ordering::Relaxed);
            }
        }
    };
    std::thread::scope(|scope| {
        let readers = [scope.spawn(reader), scope.spawn(reader)];
        let at_work = || readers.iter().all(|reader| !reader.is_finished());
        let mut n = 0;
        while at_work() && (n < 20_000 || whole.load(Ordering::Relaxed) < 20_000) {
            n += 1;
            let mut operations = both(n).to_vec();
            // Blocks of other sizes and kinds come and go.
            match n % 3 {
                0 => operations.push(create(3)),
                1 if n > 3 => {
                    let node = NodeId(3).into();
                    operations.push(Operation::DeleteNode { node });
                }
                _ => {}
            }
            commit(&mut graph, operations);
        }
        ended.store(true, Ordering::Relaxed);
    });
}
