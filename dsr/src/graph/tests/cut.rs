//! A store that is killed in the middle of a commit: wherever that is, what its memory holds is the
//! last version that it published, whole, and a graph that starts from it goes on.

use super::{Model, operation};
use crate::arena::{Arena, Word, journal, record};
use crate::graph::{Graph, Image, Limits};
use crate::shm::Segment;
use crate::{Operation, Schema, Snapshot, Time, Transaction};
use proptest::prelude::*;
use std::sync::Arc;

/// The first segment of a graph's memory as another process has it mapped.
struct Witness {
    arena: Arc<Arena>,
    /// Where the graph's own begins.
    start: usize,
}

impl Witness {
    fn of(graph: &Graph) -> Self {
        let words = graph.words();
        let copy = Arena::new(1, words.len().ilog2());
        let segment: Vec<Word> = words
            .into_iter()
            .map(|value| {
                let word = Word::default();
                word.store(value);
                word
            })
            .collect();
        copy.attach(0, Segment::on_heap(segment.into()));
        Self {
            arena: Arc::new(copy),
            start: graph.arena().from(0).unwrap().as_ptr().addr(),
        }
    }

    /// One word arrives.
    fn see(&self, (address, value): journal::Store) {
        let index = (address - self.start) / size_of::<Word>();
        self.arena.from(0).unwrap()[index].store(value);
    }

    fn snapshot(&self) -> Snapshot {
        let root = self.arena.newest_root().unwrap();
        let schema = record::read_blob(&self.arena, root.schema).unwrap();
        let schema: Schema = postcard::from_bytes(&schema).unwrap();
        Snapshot::new(Arc::clone(&self.arena), root, Arc::new(schema))
    }
}

fn commit(graph: &mut Graph, operations: &[Operation]) {
    let transaction = Transaction {
        operations: operations.to_vec(),
        ..Transaction::new()
    };
    let committed = graph.commit(&transaction, "tester", Time::default());
    committed.unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn a_commit_that_is_cut_off_anywhere_never_happened(
        transactions in prop::collection::vec(prop::collection::vec(operation(), 1..5), 1..30),
        history_bytes in prop_oneof![Just(0), Just(20_000)],
        step in 1..6usize,
        restored_at in 0.0..1.0f64,
    ) {
        let mut graph = Graph::in_memory(Schema::open());
        graph.set_limits(Limits { history_bytes, ..Limits::default() });
        let mut model = Model::default();
        for operations in transactions {
            let mut next = model.clone();
            let mut kept = Vec::new();
            for operation in operations {
                let mut trial = next.clone();
                if trial.apply(&operation).is_ok() {
                    next = trial;
                    kept.push(operation);
                }
            }
            let witness = Witness::of(&graph);
            let before = graph.snapshot().version();
            let ((), stores) = journal::of(|| commit(&mut graph, &kept));
            // Around the end, where the version is published and old ones are given up, at each.
            let near_end = stores.len().saturating_sub(60);
            let cut = (restored_at * stores.len() as f64) as usize;
            for (count, store) in stores.iter().enumerate() {
                if count >= near_end || count % step == 0 || count == cut {
                    let seen = witness.snapshot();
                    let published = seen.version() > before;
                    let expected = if published { &next } else { &model };
                    prop_assert_eq!(&Model::of(&seen).unwrap(), expected, "after {} stores", count);
                    if count == cut {
                        let mut heir = Graph::in_memory(Schema::open());
                        heir.restore(&Image::of(&seen).unwrap()).unwrap();
                        if !published {
                            commit(&mut heir, &kept);
                        }
                        prop_assert_eq!(heir.snapshot().version(), graph.snapshot().version());
                        prop_assert_eq!(&Model::of(&heir.snapshot()).unwrap(), &next);
                    }
                }
                witness.see(*store);
            }
            prop_assert_eq!(&Model::of(&witness.snapshot()).unwrap(), &next);
            model = next;
        }
    }
}
