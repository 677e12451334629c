//! `cortex graph show` and `get`.

use super::path::{Path, Thing};
use super::source::{Source, name_of, no_such};
use crate::cli::GraphSource;
use crate::commands::output::{Table, bold, brief, dim, print, print_json, tell, value_text};
use crate::{Answer, Failure};
use dsr::{Attribute, NodeId, ReadError, Snapshot, json};
use serde_json::{Map, Value as Json, json};
use std::fmt::Write as _;

pub(super) fn show(source: &GraphSource, what: Option<&str>) -> Result<Answer, Failure> {
    let snapshot = Source::open(source)?.snapshot()?;
    let nodes = selected(&snapshot, what)?;
    if source.json {
        let mut graph = json::to_json(&snapshot).map_err(Failure::internal)?;
        if what.is_some() {
            keep(&mut graph, &nodes);
        }
        print_json(&graph)?;
        return Ok(Answer::Yes);
    }
    let text = match what {
        // Many nodes are listed, a few are shown whole.
        None if nodes.len() > 30 => overview(&snapshot),
        _ => whole(&snapshot, &nodes),
    };
    let heading = format!(
        "version {}, {:.3} s, {} nodes, {} edges\n",
        snapshot.version(),
        snapshot.time().seconds(),
        snapshot.node_count(),
        snapshot.edge_count()
    );
    print(&(heading + &text.map_err(Failure::internal)?))?;
    Ok(Answer::Yes)
}

/// Leaves those nodes in graph JSON, and the edges that start there.
fn keep(graph: &mut Json, nodes: &[NodeId]) {
    let holds = |row: &Json, key: &str| {
        let id = row[key].as_u64().map(NodeId);
        id.is_some_and(|id| nodes.binary_search(&id).is_ok())
    };
    for (list, key) in [("nodes", "id"), ("edges", "from")] {
        if let Some(rows) = graph[list].as_array_mut() {
            rows.retain(|row| holds(row, key));
        }
    }
}

/// A line per node.
fn overview(snapshot: &Snapshot) -> Result<String, ReadError> {
    let mut nodes = snapshot.nodes().collect::<Result<Vec<_>, _>>()?;
    nodes.sort_by_key(dsr::Node::id);
    let mut table = Table::new(&["id", "type", "name", "attributes", "edges"]);
    for node in nodes {
        let attributes = node.attributes()?;
        let names = attributes
            .iter()
            .map(|a| snapshot.schema().attribute_name(a.name));
        let edges = node.out_edges().collect::<Result<Vec<_>, _>>()?.len();
        table.row([
            node.id().to_string(),
            node.type_name().to_owned(),
            bold(&node.name()?),
            brief(&names.collect::<Vec<_>>().join(", "), 60),
            edges.to_string(),
        ]);
    }
    Ok(format!(
        "\n{table}\n`cortex graph show NAME` shows one whole, `... TYPE` those of a type\n"
    ))
}

fn whole(snapshot: &Snapshot, nodes: &[NodeId]) -> Result<String, ReadError> {
    let mut text = String::new();
    for &id in nodes {
        let Some(node) = snapshot.find_node(id)? else {
            continue;
        };
        let (name, id) = (bold(&node.name()?), dim(&format!("id {id}")));
        // Writing to a text does not fail.
        let _ = writeln!(text, "\n{name} : {}  {id}", node.type_name());
        let mut table = Table::indented(4);
        for attribute in node.attributes()? {
            table.row(row(snapshot, "", &attribute)?);
        }
        for edge in node.edges() {
            let edge = edge?;
            let label = snapshot.schema().label_name(edge.key().label);
            let target = name_of(snapshot, edge.key().to);
            table.row([
                format!("-{label}-> {}", bold(&target)),
                String::new(),
                String::new(),
            ]);
            for attribute in edge.attributes()? {
                table.row(row(snapshot, "    ", &attribute)?);
            }
        }
        text.push_str(&table.to_string());
    }
    Ok(text)
}

fn row(snapshot: &Snapshot, indent: &str, attribute: &Attribute) -> Result<[String; 3], ReadError> {
    let schema = snapshot.schema();
    let name = schema.attribute_name(attribute.name);
    let unit = schema
        .attributes()
        .get(usize::from(attribute.name.0))
        .and_then(|known| known.unit.clone());
    // A pose has its units with it.
    let unit = unit.filter(|_| attribute.value.as_pose().is_none());
    let unit = unit.map(|unit| format!(" {unit}")).unwrap_or_default();
    let value = brief(&value_text(&attribute.value), 80);
    let writer = snapshot.writer_name(attribute.writer)?;
    let written = format!("{writer}, version {}", attribute.version);
    Ok([format!("{indent}{name}"), value + &unit, dim(&written)])
}

/// The nodes of a type, or the node of a name or id, or all; by id.
fn selected(snapshot: &Snapshot, what: Option<&str>) -> Result<Vec<NodeId>, Failure> {
    let read = || -> Result<Vec<NodeId>, ReadError> {
        let ids = |nodes: Result<Vec<dsr::Node<'_>>, ReadError>| {
            nodes.map(|nodes| nodes.iter().map(dsr::Node::id).collect())
        };
        match what {
            None => ids(snapshot.nodes().collect()),
            Some(what) => match snapshot.schema().find_type(what) {
                Some(kind) => ids(snapshot.nodes_of_type(kind).collect()),
                None => Ok(Vec::new()),
            },
        }
    };
    let mut nodes = read().map_err(Failure::internal)?;
    if let Some(what) = what
        && nodes.is_empty()
    {
        let found = super::source::node_ref(snapshot, what)?;
        let is_type = snapshot.schema().find_type(what).is_some();
        match found {
            Some(id) => nodes.push(id),
            None if is_type => {}
            None => return Err(no_such(snapshot, what, "node or type")),
        }
    }
    nodes.sort();
    Ok(nodes)
}

pub(super) fn get(source: &GraphSource, path: &str) -> Result<Answer, Failure> {
    let snapshot = Source::open(source)?.snapshot()?;
    let found = Path::find(&snapshot, path)?;
    let Some(name) = &found.attribute else {
        print_json(&thing(&snapshot, found.thing).map_err(Failure::internal)?)?;
        return Ok(Answer::Yes);
    };
    let id = snapshot
        .schema()
        .attribute_id(name)
        .map_err(Failure::input)?;
    let read = found.thing.attribute(&snapshot, id);
    let Some(attribute) = read.map_err(Failure::internal)? else {
        let owner = found.thing.describe(&snapshot);
        tell(&format!("{owner} has no attribute `{name}`\n"));
        return Ok(Answer::No);
    };
    let value = json::value_to_json(&attribute.value);
    if !source.json {
        print(&format!("{value}\n"))?;
        return Ok(Answer::Yes);
    }
    let writer = snapshot.writer_name(attribute.writer);
    print_json(&json!({
        "value": value, "version": attribute.version.0, "time": attribute.time.seconds(),
        "writer": writer.map_err(Failure::internal)?,
    }))?;
    Ok(Answer::Yes)
}

/// A node or an edge, as it is in graph JSON.
fn thing(snapshot: &Snapshot, thing: Thing) -> Result<Json, ReadError> {
    let values = |attributes: Vec<Attribute>| -> Map<String, Json> {
        let named = |a: &Attribute| {
            let name = snapshot.schema().attribute_name(a.name).to_owned();
            (name, json::value_to_json(&a.value))
        };
        attributes.iter().map(named).collect()
    };
    Ok(match thing {
        Thing::Node(id) => match snapshot.find_node(id)? {
            None => Json::Null,
            Some(node) => json!({
                "id": id.0, "type": node.type_name(), "name": node.name()?,
                "version": node.version()?.0, "attributes": values(node.attributes()?),
            }),
        },
        Thing::Edge(key) => match snapshot.find_edge(key)? {
            None => Json::Null,
            Some(edge) => json!({
                "from": key.from.0, "label": snapshot.schema().label_name(key.label), "to": key.to.0,
                "version": edge.version()?.0, "attributes": values(edge.attributes()?),
            }),
        },
    })
}
