//! What the tests of several modules share: the rules of a care centre, its schema, and worlds.

use dsr::{EdgeRef, Graph, Schema, Time, Transaction};
use grammar::{Goal, Grammar, parse_goal, parse_grammar};
use std::sync::Arc;

/// The rules that a robot in a care centre goes by.
pub(crate) const CARE: &str = include_str!("care.aggl");

/// Reads a grammar that has nothing wrong with it.
pub(crate) fn read(text: &str) -> Grammar {
    let (grammar, diagnostics) = parse_grammar(text, "test.aggl");
    assert!(
        diagnostics.is_empty(),
        "{}",
        grammar::Defects { diagnostics }
    );
    grammar
}

/// Reads a goal that has nothing wrong with it.
pub(crate) fn goal(grammar: &Grammar, text: &str) -> Goal {
    parse_goal(text, "goal.aggt", &grammar.types).unwrap_or_else(|defects| panic!("{defects}"))
}

/// An empty graph of the care centre's schema, with its rules in force.
pub(crate) fn centre(grammar: &Grammar) -> Graph {
    let schema = Schema::from_toml("schema.toml", include_str!("schema.toml")).unwrap();
    let mut graph = Graph::in_memory(schema);
    graph.set_rules(Arc::new(grammar.clone()));
    graph
}

/// Adds nodes `(type, name)` and links `(from, label, to)`.
pub(crate) fn add(graph: &mut Graph, nodes: &[(&str, &str)], links: &[(&str, &str, &str)]) {
    let mut transaction = Transaction::new();
    for (type_name, name) in nodes {
        transaction.create_node(type_name, name, vec![]);
    }
    for (from, label, to) in links {
        transaction.create_edge(*from, label, *to);
    }
    graph.commit(&transaction, "test", Time::default()).unwrap();
}

/// Adds a way to and fro between two rooms.
pub(crate) fn connect(graph: &mut Graph, a: &str, b: &str, distance: f64) {
    let mut transaction = Transaction::new();
    for (from, to) in [(a, b), (b, a)] {
        transaction.create_edge(from, "connected", to);
        transaction.set_on_edge(EdgeRef::new(from, "connected", to), "distance", distance);
    }
    graph.commit(&transaction, "test", Time::default()).unwrap();
}

/// Four rooms in a ring (the way over the ward is longer than that over the corridor), a robot in
/// the hall, ana in the kitchen opposite, with a place beside her.
pub(crate) fn ring(grammar: &Grammar) -> Graph {
    let mut graph = centre(grammar);
    let rooms = ["hall", "corridor", "kitchen", "ward"].map(|name| ("room", name));
    add(&mut graph, &rooms, &[]);
    add(
        &mut graph,
        &[("robot", "shelly"), ("person", "ana"), ("place", "table")],
        &[
            ("shelly", "in", "hall"),
            ("ana", "in", "kitchen"),
            ("table", "in", "kitchen"),
        ],
    );
    connect(&mut graph, "hall", "corridor", 3.0);
    connect(&mut graph, "corridor", "kitchen", 4.0);
    connect(&mut graph, "hall", "ward", 6.0);
    connect(&mut graph, "ward", "kitchen", 6.0);
    graph
}
