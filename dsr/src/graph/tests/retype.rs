//! A node that is given another type keeps only edges that its new type may have.

use crate::{Graph, NodeRef, Operation, Refusal, Schema, Time, Transaction};

const SCHEMA: &str = r#"
[types]
cat = []
dog = []
[labels]
chases = { from = ["dog"], to = ["cat"] }
"#;

fn retype(node: &str, type_name: &str) -> Operation {
    Operation::RetypeNode {
        node: NodeRef::from(node),
        type_name: type_name.into(),
    }
}

fn commit(graph: &mut Graph, operations: Vec<Operation>) -> Result<(), Refusal> {
    let mut transaction = Transaction::new();
    transaction.operations = operations;
    let done = graph.commit(&transaction, "a", Time::default());
    done.map(|_| ())
}

#[test]
fn its_edges_must_be_allowed_when_the_transaction_is_done() {
    let schema = Schema::from_toml("schema.toml", SCHEMA).unwrap();
    let mut graph = Graph::in_memory(schema);
    let mut transaction = Transaction::new();
    transaction.create_node("dog", "rex", vec![]);
    transaction.create_node("cat", "tom", vec![]);
    transaction.create_edge("rex", "chases", "tom");
    graph.commit(&transaction, "a", Time::default()).unwrap();
    for (node, kind) in [("rex", "cat"), ("tom", "dog")] {
        let refused = commit(&mut graph, vec![retype(node, kind)]).unwrap_err();
        assert!(matches!(refused, Refusal::SchemaViolation(_)), "{refused}");
    }
    let snapshot = graph.snapshot();
    let rex = snapshot.find_node_by_name("rex").unwrap().unwrap();
    assert_eq!(rex.type_name(), "dog", "nothing was changed");
    // What is not allowed on the way may be in the end.
    let mut turn = vec![retype("rex", "cat"), retype("tom", "dog")];
    let refused = commit(&mut graph, turn.clone()).unwrap_err();
    assert!(matches!(refused, Refusal::SchemaViolation(_)), "{refused}");
    let mut edges = Transaction::new();
    edges.delete_edge("rex", "chases", "tom");
    edges.create_edge("tom", "chases", "rex");
    turn.extend(edges.operations);
    commit(&mut graph, turn).unwrap();
    let snapshot = graph.snapshot();
    assert_eq!(snapshot.edge_count(), 1);
    let tom = snapshot.find_node_by_name("tom").unwrap().unwrap();
    assert_eq!((tom.type_name(), tom.out_edges().count()), ("dog", 1));
}
