//! `cortex graph diff`.

use super::source::Source;
use crate::cli::GraphSource;
use crate::commands::output::{brief, green, print, print_json, red, value_text, yellow};
use crate::{Answer, Failure};
use dsr::{Difference, EdgeRef, NodeRef, Owner, Snapshot, Value, json};
use serde_json::{Map, Value as Json, json};
use std::path::Path;

/// A file, or `@INSTANCE`.
fn open(source: &GraphSource, operand: &str) -> Result<Snapshot, Failure> {
    match operand.strip_prefix('@') {
        Some(instance) => {
            let source = GraphSource {
                instance: instance.to_owned(),
                file: None,
                ..source.clone()
            };
            Source::open(&source)?.snapshot()
        }
        None => Source::open_file(Path::new(operand))?.snapshot(),
    }
}

pub(super) fn diff(source: &GraphSource, a: &str, b: Option<&str>) -> Result<Answer, Failure> {
    let before = open(source, a)?;
    let after = match b {
        Some(b) => open(source, b)?,
        None => Source::open(source)?.snapshot()?,
    };
    let found = dsr::differences(&before, &after).map_err(Failure::internal)?;
    if source.json {
        let list: Vec<Json> = found.iter().map(row).collect();
        print_json(&json!({"equal": found.is_empty(), "differences": list}))?;
    } else {
        print(&found.iter().map(line).collect::<String>())?;
    }
    Ok(if found.is_empty() {
        Answer::Yes
    } else {
        Answer::No
    })
}

fn name(node: &NodeRef) -> String {
    match node {
        NodeRef::Name(name) => name.clone(),
        NodeRef::Id(id) => id.to_string(),
    }
}

fn edge_text(edge: &EdgeRef) -> String {
    format!("{} -{}-> {}", name(&edge.from), edge.label, name(&edge.to))
}

pub(super) fn owner_text(owner: &Owner) -> String {
    match owner {
        Owner::Node(node) => name(node),
        Owner::Edge(edge) => edge_text(edge),
    }
}

fn values(attributes: &[(String, Value)]) -> Map<String, Json> {
    let value = |(name, value): &(String, Value)| (name.clone(), json::value_to_json(value));
    attributes.iter().map(value).collect()
}

/// Values behind a node or an edge that is new.
fn listed(attributes: &[(String, Value)]) -> String {
    if attributes.is_empty() {
        return String::new();
    }
    let shown =
        |(name, value): &(String, Value)| format!("{name} = {}", brief(&value_text(value), 40));
    let all: Vec<String> = attributes.iter().map(shown).collect();
    format!("  {{{}}}", all.join(", "))
}

fn line(difference: &Difference) -> String {
    let shown = |value: &Value| brief(&value_text(value), 60);
    let line = match difference {
        Difference::NodeAdded {
            name,
            type_name,
            attributes,
            ..
        } => green(&format!("+ {name} : {type_name}{}", listed(attributes))),
        Difference::NodeRemoved { name, type_name } => red(&format!("- {name} : {type_name}")),
        Difference::NodeRetyped {
            name,
            before,
            after,
        } => yellow(&format!("~ {name} : {before} -> {after}")),
        Difference::EdgeAdded { edge, attributes } => {
            green(&format!("+ {}{}", edge_text(edge), listed(attributes)))
        }
        Difference::EdgeRemoved { edge } => red(&format!("- {}", edge_text(edge))),
        Difference::Attribute {
            owner,
            name,
            before,
            after,
        } => {
            let owner = owner_text(owner);
            match (before, after) {
                (None, Some(value)) => green(&format!("+ {owner}.{name} = {}", shown(value))),
                (Some(value), None) => red(&format!("- {owner}.{name} = {}", shown(value))),
                (Some(a), Some(b)) => {
                    yellow(&format!("~ {owner}.{name} = {} -> {}", shown(a), shown(b)))
                }
                (None, None) => String::new(),
            }
        }
    };
    line + "\n"
}

fn row(difference: &Difference) -> Json {
    let edge_json = |edge: &EdgeRef| json!({"from": name(&edge.from), "label": edge.label, "to": name(&edge.to)});
    match difference {
        Difference::NodeAdded {
            name,
            type_name,
            attributes,
            ..
        } => json!({
            "change": "added", "node": name, "type": type_name, "attributes": values(attributes),
        }),
        Difference::NodeRemoved { name, type_name } => {
            json!({"change": "removed", "node": name, "type": type_name})
        }
        Difference::NodeRetyped {
            name,
            before,
            after,
        } => json!({"change": "retyped", "node": name, "before": before, "after": after}),
        Difference::EdgeAdded { edge, attributes } => json!({
            "change": "added", "edge": edge_json(edge), "attributes": values(attributes),
        }),
        Difference::EdgeRemoved { edge } => json!({"change": "removed", "edge": edge_json(edge)}),
        Difference::Attribute {
            owner,
            name: attribute,
            before,
            after,
        } => {
            let value = |value: &Option<Value>| value.as_ref().map(json::value_to_json);
            let mut row = json!({
                "change": "attribute", "attribute": attribute,
                "before": value(before), "after": value(after),
            });
            match owner {
                Owner::Node(node) => row["node"] = json!(name(node)),
                Owner::Edge(edge) => row["edge"] = edge_json(edge),
            }
            row
        }
    }
}
