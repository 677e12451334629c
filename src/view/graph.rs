//! The graph as the inspector's page has it: nodes with their places, edges, and one node with all that
//! is known of it.

use super::layout::Layout;
use dsr::{Attribute, Element, NodeId, ReadError, Snapshot, json};
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;

/// The whole graph, each node as `[id, name, type, x, y]` and each edge as `[from, label, to]` with types
/// and labels as places in the lists beside them.
///
/// # Errors
/// [`ReadError`].
pub(crate) fn graph(snapshot: &Snapshot, layout: &Layout) -> Result<Json, ReadError> {
    let schema = snapshot.schema();
    let (mut nodes, mut edges) = (Vec::new(), Vec::new());
    let mut labels: BTreeMap<u64, usize> = BTreeMap::new();
    let mut label_names = Vec::new();
    let mut types: BTreeMap<&str, usize> = BTreeMap::new();
    let mut type_names = Vec::new();
    for node in snapshot.nodes() {
        let node = node?;
        let name = node.type_name();
        let kind = *types.entry(name).or_insert_with(|| {
            type_names.push(name);
            type_names.len() - 1
        });
        let [x, y] = layout.place(node.id()).unwrap_or_default();
        nodes.push(json!([
            node.id().0,
            node.name()?,
            kind,
            x.round(),
            y.round()
        ]));
        for key in node.out_edges() {
            let key = key?;
            let label = *labels.entry(u64::from(key.label.0)).or_insert_with(|| {
                label_names.push(schema.label_name(key.label));
                label_names.len() - 1
            });
            edges.push(json!([key.from.0, label, key.to.0]));
        }
    }
    Ok(json!({
        "version": snapshot.version().0, "time": snapshot.time().seconds(),
        "types": type_names, "labels": label_names, "nodes": nodes, "edges": edges,
    }))
}

fn attributes(snapshot: &Snapshot, element: &Element<'_>) -> Result<Json, ReadError> {
    let rows = element.attributes()?;
    let row = |attribute: &Attribute| -> Result<Json, ReadError> {
        Ok(json!({
            "name": snapshot.schema().attribute_name(attribute.name),
            "value": json::value_to_json(&attribute.value),
            "text": crate::commands::value_text(&attribute.value),
            "writer": snapshot.writer_name(attribute.writer)?, "version": attribute.version.0,
            "age": snapshot.time().since(attribute.time),
        }))
    };
    let mut list = rows.iter().map(row).collect::<Result<Vec<_>, _>>()?;
    list.sort_by_key(|row| row["name"].as_str().unwrap_or_default().to_owned());
    Ok(Json::Array(list))
}

/// A node with its attributes, each with writer and age in seconds, and the edges that touch it. `None`
/// where it is not there.
///
/// # Errors
/// [`ReadError`].
pub(crate) fn node(snapshot: &Snapshot, id: NodeId) -> Result<Option<Json>, ReadError> {
    let Some(node) = snapshot.find_node(id)? else {
        return Ok(None);
    };
    let name = |id| crate::commands::graph::name_of(snapshot, id);
    let schema = snapshot.schema();
    let mut edges = Vec::new();
    for key in node.out_edges().chain(node.in_edges()) {
        let key = key?;
        let Some(edge) = snapshot.find_edge(key)? else {
            continue;
        };
        edges.push(json!({
            "from": name(key.from), "from_id": key.from.0, "label": schema.label_name(key.label),
            "to": name(key.to), "to_id": key.to.0, "attributes": attributes(snapshot, &edge)?,
        }));
    }
    Ok(Some(json!({
        "id": id.0, "name": node.name()?, "type": node.type_name(),
        "version": node.version()?.0, "attributes": attributes(snapshot, &node)?, "edges": edges,
    })))
}
