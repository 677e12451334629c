//! An arena that is full, or whose memory is: a refusal that says so, a graph that is as it was, and room again
//! once something was deleted.

use crate::arena::Arena;
use crate::arena::allocator::{Full, Growth, HeapGrowth};
use crate::graph::{Graph, Image};
use crate::{Epoch, Refusal, Schema, Time, Transaction, Value};
use std::sync::Arc;

/// Growth that refuses to back more than so many words of each segment.
#[derive(Debug)]
struct Scarce(usize);

impl Growth for Scarce {
    fn grow(&mut self, arena: &Arena, index: usize) -> Result<(), Full> {
        HeapGrowth.grow(arena, index)
    }
    fn reserve(&mut self, _: usize, _: usize, to: usize) -> Result<(), Full> {
        if to <= self.0 { Ok(()) } else { Err(Full) }
    }
}

fn large(name: &str) -> Transaction {
    let mut transaction = Transaction::new();
    let bytes = Value::U8List(vec![1; 40_000]);
    transaction.create_node("thing", name, vec![("bytes".into(), bytes)]);
    transaction
}

#[test]
fn an_arena_that_is_full_refuses_and_has_room_again_once_something_is_deleted() {
    const SEGMENT: u32 = 18;
    let growths: [Box<dyn Growth>; 2] = [Box::new(HeapGrowth), Box::new(Scarce(1 << 17))];
    for growth in growths {
        let arena = Arc::new(Arena::new(2, SEGMENT));
        let mut graph = Graph::on(arena, growth, Schema::open(), Epoch(1)).unwrap();
        let commit = |graph: &mut Graph, transaction: &Transaction| {
            graph.commit(transaction, "a", Time::default())
        };
        let mut made = 0;
        let refusal = loop {
            match commit(&mut graph, &large(&format!("n{made}"))) {
                Ok(_) => made += 1,
                Err(refusal) => break refusal,
            }
            assert!(made < 1000, "it is never full");
        };
        assert!(
            matches!(refusal, Refusal::OutOfMemory { bytes } if bytes > 0),
            "{refusal}"
        );
        assert!(made > 2);
        // Half of a transaction fits, and none of it stays.
        let before = Image::of(&graph.snapshot()).unwrap();
        let mut half = Transaction::new();
        half.set("n0", "x", 1.0);
        half.operations.extend(large("more").operations);
        commit(&mut graph, &half).unwrap_err();
        assert_eq!(Image::of(&graph.snapshot()).unwrap(), before);
        let mut less = Transaction::new();
        less.delete_node("n0");
        less.delete_node("n1");
        commit(&mut graph, &less).unwrap();
        commit(&mut graph, &large("again")).unwrap();
        assert_eq!(graph.snapshot().node_count(), made - 1);
    }
}
