//! Graphviz DOT. Guarantees that names with quotes, backslashes and line breaks stay names.

use crate::{Node, NodeId, ReadError, Snapshot};
use std::fmt::Write as _;

fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for letter in text.chars() {
        match letter {
            '"' | '\\' => quoted.extend(['\\', letter]),
            '\n' => quoted.push_str("\\n"),
            '\r' | '\0' => quoted.push(' '),
            other => quoted.push(other),
        }
    }
    quoted.push('"');
    quoted
}

/// A snapshot as Graphviz DOT: nodes with name and type, edges with their label; nodes by id, edges by
/// source, label and target.
///
/// # Errors
/// [`ReadError`].
pub fn to_dot(snapshot: &Snapshot) -> Result<String, ReadError> {
    let mut nodes = snapshot.nodes().collect::<Result<Vec<_>, _>>()?;
    nodes.sort_by_key(Node::id);
    let mut text = String::from("digraph dsr {\n  node [shape=box];\n");
    for node in &nodes {
        let label = quoted(&format!("{}\n{}", node.name()?, node.type_name()));
        // Writing to a text does not fail.
        let _ = writeln!(text, "  n{} [label={label}];", node.id());
    }
    for node in &nodes {
        let mut edges: Vec<(&str, NodeId)> = Vec::new();
        for key in node.out_edges() {
            let key = key?;
            edges.push((snapshot.schema().label_name(key.label), key.to));
        }
        edges.sort_unstable();
        for (label, to) in edges {
            let _ = writeln!(text, "  n{} -> n{to} [label={}];", node.id(), quoted(label));
        }
    }
    text.push_str("}\n");
    Ok(text)
}
