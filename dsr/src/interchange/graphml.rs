//! GraphML. Guarantees that whatever names and texts hold, what is written is XML that a GraphML reader
//! takes: each attribute is declared with a type that all its values have.

use crate::json::value_to_json;
use crate::{Attribute, NodeId, ReadError, Snapshot, Value};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// A text in XML; letters that XML does not have become U+FFFD.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\r' => escaped.push_str("&#13;"),
            '\n' => escaped.push_str("&#10;"),
            '\t' => escaped.push_str("&#9;"),
            '\0'..='\x1f' | '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            other => escaped.push(other),
        }
    }
    escaped
}

/// The GraphML type of a value, and the value.
fn written(value: &Value) -> (&'static str, String) {
    let real = |x: f64| match x {
        x if x.is_nan() => "NaN".to_owned(),
        x if x.is_infinite() && x > 0.0 => "INF".to_owned(),
        x if x.is_infinite() => "-INF".to_owned(),
        x => x.to_string(),
    };
    match value {
        Value::Bool(b) => ("boolean", b.to_string()),
        Value::I32(n) => ("int", n.to_string()),
        Value::U32(n) => ("long", n.to_string()),
        Value::I64(n) => ("long", n.to_string()),
        Value::F32(x) => ("float", real(f64::from(*x))),
        Value::F64(x) => ("double", real(*x)),
        Value::String(text) => ("string", text.clone()),
        // Larger than any whole number of GraphML can be.
        Value::U64(n) => ("string", n.to_string()),
        other => ("string", value_to_json(other).to_string()),
    }
}

/// The attributes of all nodes, or of all edges.
struct Keys {
    of: &'static str,
    /// Name to type; `string` where values are of several.
    types: BTreeMap<String, &'static str>,
}

impl Keys {
    fn new(of: &'static str) -> Self {
        let types = BTreeMap::new();
        Self { of, types }
    }

    fn learn(&mut self, name: &str, attribute: &Attribute) {
        let (kind, _) = written(&attribute.value);
        let known = self.types.entry(name.to_owned()).or_insert(kind);
        if *known != kind {
            *known = "string";
        }
    }

    /// The key of the attribute of that name: its place in the alphabet.
    fn key(&self, name: &str) -> String {
        let place = self
            .types
            .keys()
            .take_while(|known| known.as_str() < name)
            .count();
        format!("{}{place}", &self.of[..1])
    }

    fn declare(&self, text: &mut String) {
        for (place, (name, kind)) in self.types.iter().enumerate() {
            let (of, name) = (self.of, escaped(name));
            // Writing to a text does not fail.
            let _ = writeln!(
                text,
                "  <key id=\"{}{place}\" for=\"{of}\" attr.name=\"{name}\" attr.type=\"{kind}\"/>",
                &of[..1]
            );
        }
    }

    fn data(&self, text: &mut String, attributes: &[(String, Attribute)]) {
        for (name, attribute) in attributes {
            let (_, value) = written(&attribute.value);
            let key = self.key(name);
            let _ = writeln!(text, "      <data key=\"{key}\">{}</data>", escaped(&value));
        }
    }
}

/// A snapshot as GraphML, with all attributes. Name and type of a node and the label of an edge are the data
/// `name`, `type` and `label`; lists, vectors and poses are texts of JSON.
///
/// # Errors
/// [`ReadError`].
pub fn to_graphml(snapshot: &Snapshot) -> Result<String, ReadError> {
    let named = |attributes: Vec<Attribute>| {
        let name = |a: Attribute| (snapshot.schema().attribute_name(a.name).to_owned(), a);
        let mut named: Vec<_> = attributes.into_iter().map(name).collect();
        named.sort_by(|a, b| a.0.cmp(&b.0));
        named
    };
    let (mut node_keys, mut edge_keys) = (Keys::new("node"), Keys::new("edge"));
    let (mut nodes, mut edges) = (Vec::new(), Vec::new());
    for node in snapshot.nodes() {
        let node = node?;
        let attributes = named(node.attributes()?);
        for (name, attribute) in &attributes {
            node_keys.learn(name, attribute);
        }
        nodes.push((node.id(), node.name()?, node.type_name(), attributes));
        for edge in node.edges() {
            let edge = edge?;
            let attributes = named(edge.attributes()?);
            for (name, attribute) in &attributes {
                edge_keys.learn(name, attribute);
            }
            let label = snapshot.schema().label_name(edge.key().label);
            edges.push((edge.key().from, label, edge.key().to, attributes));
        }
    }
    nodes.sort_by_key(|(id, ..)| *id);
    edges.sort_by_key(|&(from, label, to, _)| (from, label, to));
    let mut text = String::from(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <graphml xmlns=\"http://graphml.graphdrawing.org/xmlns\">\n  \
         <key id=\"name\" for=\"node\" attr.name=\"name\" attr.type=\"string\"/>\n  \
         <key id=\"type\" for=\"node\" attr.name=\"type\" attr.type=\"string\"/>\n  \
         <key id=\"label\" for=\"edge\" attr.name=\"label\" attr.type=\"string\"/>\n",
    );
    node_keys.declare(&mut text);
    edge_keys.declare(&mut text);
    text.push_str("  <graph id=\"dsr\" edgedefault=\"directed\">\n");
    for (id, name, kind, attributes) in &nodes {
        let _ = writeln!(text, "    <node id=\"n{id}\">");
        for (key, value) in [("name", name.as_str()), ("type", *kind)] {
            let _ = writeln!(text, "      <data key=\"{key}\">{}</data>", escaped(value));
        }
        node_keys.data(&mut text, attributes);
        text.push_str("    </node>\n");
    }
    for (from, label, to, attributes) in &edges {
        let (NodeId(from), NodeId(to)) = (from, to);
        let _ = writeln!(text, "    <edge source=\"n{from}\" target=\"n{to}\">");
        let _ = writeln!(text, "      <data key=\"label\">{}</data>", escaped(label));
        edge_keys.data(&mut text, attributes);
        text.push_str("    </edge>\n");
    }
    text.push_str("  </graph>\n</graphml>\n");
    Ok(text)
}
