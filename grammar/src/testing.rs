//! What the tests of several modules share: the grammar of the scenarios, a small care centre, and
//! strategies for random grammars and graphs.

pub(crate) mod oracle;
pub(crate) mod random;
mod reference;
pub(crate) mod repair;

use crate::{Grammar, parse_grammar};
use dsr::{Graph, Schema, Time, Transaction, Value};
use proptest::prelude::ProptestConfig;
use std::sync::Arc;

/// The rules that a robot in a care centre goes by.
pub(crate) const CARE: &str = include_str!("testing/care.aggl");

/// So many cases of a property; more, in proportion, where `PROPTEST_CASES` asks for more than the 256
/// that are its default.
pub(crate) fn cases(usually: u32) -> ProptestConfig {
    let asked = ProptestConfig::default().cases;
    ProptestConfig::with_cases((u64::from(usually) * u64::from(asked) / 256) as u32)
}

/// Reads a grammar that has nothing wrong with it.
pub(crate) fn read(text: &str) -> Grammar {
    let (grammar, diagnostics) = parse_grammar(text, "test.aggl");
    assert!(diagnostics.is_empty(), "{}", crate::Defects { diagnostics });
    grammar
}

/// One rule called `r` in a grammar without types.
pub(crate) fn rule(body: &str) -> Grammar {
    read(&format!("name=test\n===\nr : active(1) {{ {body} }}\n"))
}

/// A graph of nodes `(type, name)` and links `(from, label, to)` under an open schema.
pub(crate) fn graph(nodes: &[(&str, &str)], links: &[(&str, &str, &str)]) -> Graph {
    let mut graph = Graph::in_memory(Schema::open());
    let mut transaction = Transaction::new();
    for (type_name, name) in nodes {
        transaction.create_node(type_name, name, vec![]);
    }
    for (from, label, to) in links {
        transaction.create_edge(*from, label, *to);
    }
    graph.commit(&transaction, "test", Time::default()).unwrap();
    graph
}

/// Three rooms in a row, a robot in the first, two people in the others.
pub(crate) fn care_centre() -> Graph {
    let mut graph = graph(
        &[
            ("room", "hall"),
            ("room", "kitchen"),
            ("room", "ward"),
            ("robot", "shelly"),
            ("person", "ana"),
            ("person", "bob"),
        ],
        &[
            ("hall", "connected", "kitchen"),
            ("kitchen", "connected", "hall"),
            ("kitchen", "connected", "ward"),
            ("ward", "connected", "kitchen"),
            ("shelly", "in", "hall"),
            ("ana", "in", "kitchen"),
            ("bob", "in", "ward"),
        ],
    );
    let mut transaction = Transaction::new();
    for (from, to, distance) in [("hall", "kitchen", 4.5), ("kitchen", "ward", 6.0)] {
        for (a, b) in [(from, to), (to, from)] {
            let edge = dsr::EdgeRef::new(a, "connected", b);
            transaction.set_on_edge(edge, "distance", Value::F64(distance));
        }
    }
    graph.commit(&transaction, "test", Time::default()).unwrap();
    graph
}

/// Applies a rule by node names, through the store.
pub(crate) fn apply(
    graph: &mut Graph,
    grammar: &Grammar,
    rule: &str,
    binding: &[(&str, &str)],
) -> Result<(), String> {
    graph.set_rules(Arc::new(grammar.clone()));
    let mut transaction = Transaction::new();
    let binding = binding
        .iter()
        .map(|(v, n)| ((*v).to_owned(), (*n).into()))
        .collect();
    transaction.apply_rule(rule, binding);
    let committed = graph.commit(&transaction, "test", Time::default());
    committed.map(|_| ()).map_err(|refusal| refusal.to_string())
}

/// Nodes `name:type`, links `from->to(label)` and attributes `name.attribute=value`, sorted.
pub(crate) fn describe(graph: &Graph) -> Vec<String> {
    let snapshot = graph.snapshot();
    let schema = snapshot.schema();
    let name = |id| snapshot.find_node(id).unwrap().unwrap().name().unwrap();
    let mut lines = Vec::new();
    for node in snapshot.nodes() {
        let node = node.unwrap();
        let this = node.name().unwrap();
        lines.push(format!("{this}:{}", node.type_name()));
        for attribute in node.attributes().unwrap() {
            let key = schema.attribute_name(attribute.name);
            lines.push(format!("{this}.{key}={:?}", attribute.value));
        }
        for key in node.out_edges() {
            let key = key.unwrap();
            let link = format!("{this}->{}({})", name(key.to), schema.label_name(key.label));
            for attribute in snapshot
                .find_edge(key)
                .unwrap()
                .unwrap()
                .attributes()
                .unwrap()
            {
                let key = schema.attribute_name(attribute.name);
                lines.push(format!("{link}.{key}={:?}", attribute.value));
            }
            lines.push(link);
        }
    }
    lines.sort();
    lines
}
