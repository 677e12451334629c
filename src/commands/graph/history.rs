//! `cortex graph history`: what an attribute was, or what happened to a node or an edge, as far back as the
//! graph keeps it.

use super::path::{Path, Thing};
use super::source::{Source, name_of};
use crate::cli::GraphSource;
use crate::commands::output::{Table, brief, clock, dim, print, print_json, value_text};
use crate::{Answer, Failure};
use dsr::{Attribute, AttributeId, ReadError, Snapshot, Time, Value, Version, json};
use serde_json::{Value as Json, json};
use std::collections::btree_map::Entry::Vacant;
use std::collections::{BTreeMap, BTreeSet};

/// One change.
struct Entry {
    version: Version,
    time: f64,
    agent: String,
    rules: Vec<String>,
    /// For people,
    text: String,
    /// and for machines.
    value: Json,
}

/// When the oldest version was made that is kept.
pub(in crate::commands) fn oldest_time(newest: &Snapshot) -> Time {
    let oldest = newest.at(newest.oldest());
    oldest.map_or(newest.time(), |oldest| oldest.time())
}

/// What a path was, newest first, and the name of what it is about.
fn entries(
    newest: &Snapshot,
    path: &str,
    limit: Option<usize>,
) -> Result<(Vec<Entry>, String), Failure> {
    let (found, gone) = Path::find_kept(newest, path)?;
    let name = match gone {
        None => found.thing.describe(newest),
        Some(last) => format!("{} (gone)", found.thing.describe(&last)),
    };
    let entries = match &found.attribute {
        None => of_thing(newest, found.thing),
        Some(attribute) => {
            let id = newest.schema().attribute_id(attribute);
            of_attribute(newest, found.thing, id.map_err(Failure::input)?)
        }
    };
    let mut entries = entries.map_err(Failure::internal)?;
    entries.reverse();
    entries.truncate(limit.unwrap_or(usize::MAX));
    Ok((entries, name))
}

/// The history of a path for machines, newest first.
pub(crate) fn rows(newest: &Snapshot, path: &str, limit: Option<usize>) -> Result<Json, Failure> {
    let (entries, _) = entries(newest, path, limit)?;
    let rows: Vec<Json> = entries.iter().map(row).collect();
    Ok(json!({
        "path": path, "oldest": newest.oldest().0, "oldest_time": oldest_time(newest).seconds(),
        "newest": newest.version().0, "entries": rows,
    }))
}

pub(super) fn history(
    source: &GraphSource,
    path: &str,
    limit: Option<usize>,
) -> Result<Answer, Failure> {
    let newest = Source::open(source)?.snapshot()?;
    if source.json {
        print_json(&rows(&newest, path, limit)?)?;
        return Ok(Answer::Yes);
    }
    let oldest = newest.oldest();
    let (entries, name) = entries(&newest, path, limit)?;
    let oldest_time = oldest_time(&newest);
    let mut table = Table::new(&["version", "time", "agent", "rule", "value"]);
    for entry in &entries {
        table.row([
            entry.version.to_string(),
            clock(Time::from_seconds(entry.time)),
            entry.agent.clone(),
            entry.rules.join(", "),
            brief(&entry.text, 80),
        ]);
    }
    let kept = format!(
        "{name}: versions {oldest} to {} are kept, the last {:.1} s",
        newest.version(),
        newest.time().since(oldest_time)
    );
    print(&format!("{}\n{table}", dim(&kept)))?;
    Ok(Answer::Yes)
}

fn entry(snapshot: &Snapshot, text: String, value: Json) -> Result<Entry, ReadError> {
    Ok(Entry {
        version: snapshot.version(),
        time: snapshot.time().seconds(),
        agent: snapshot.agent()?.unwrap_or_default(),
        rules: snapshot.rules()?.into_iter().map(|r| r.rule).collect(),
        text,
        value,
    })
}

/// An attribute as its record says, whether or not its version is kept.
fn recorded(newest: &Snapshot, attribute: &Attribute) -> Result<Entry, ReadError> {
    let rules = match newest.at(attribute.version) {
        Ok(made) => made.rules()?.into_iter().map(|r| r.rule).collect(),
        Err(_) => Vec::new(),
    };
    Ok(Entry {
        version: attribute.version,
        time: attribute.time.seconds(),
        agent: newest.writer_name(attribute.writer)?,
        rules,
        text: value_text(&attribute.value),
        value: json::value_to_json(&attribute.value),
    })
}

/// The versions that are kept, oldest first, until one is given up meanwhile.
fn kept(newest: &Snapshot) -> impl Iterator<Item = Snapshot> + '_ {
    let versions = newest.oldest().0..=newest.version().0;
    // The oldest go first, perhaps while this reads them.
    versions.filter_map(|version| newest.at(Version(version)).ok())
}

fn of_attribute(
    newest: &Snapshot,
    thing: Thing,
    name: AttributeId,
) -> Result<Vec<Entry>, ReadError> {
    let mut entries: BTreeMap<Version, Entry> = BTreeMap::new();
    for attribute in thing.kept(newest, name)? {
        entries.insert(attribute.version, recorded(newest, &attribute)?);
    }
    let mut there = false;
    for snapshot in kept(newest) {
        match thing.attribute(&snapshot, name) {
            Ok(Some(attribute)) => {
                there = true;
                if let Vacant(place) = entries.entry(attribute.version) {
                    place.insert(recorded(newest, &attribute)?);
                }
            }
            Ok(None) if there => {
                there = false;
                let gone = entry(&snapshot, "(removed)".to_owned(), Json::Null)?;
                entries.insert(snapshot.version(), gone);
            }
            Ok(None) | Err(ReadError::SnapshotTooOld { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(entries.into_values().collect())
}

/// What a node or an edge is at one version.
#[derive(PartialEq, Default)]
struct State {
    type_name: String,
    /// Attributes with the version that wrote each.
    attributes: BTreeMap<String, (Version, String)>,
    /// Edges, as they are shown.
    edges: BTreeSet<String>,
}

fn state(snapshot: &Snapshot, thing: Thing) -> Result<Option<State>, ReadError> {
    let schema = snapshot.schema();
    let attributes = |list: Vec<Attribute>| {
        let shown = |value: &Value| brief(&value_text(value), 40);
        let named = |a: Attribute| {
            let name = schema.attribute_name(a.name).to_owned();
            (name, (a.version, shown(&a.value)))
        };
        list.into_iter().map(named).collect()
    };
    match thing {
        Thing::Edge(key) => {
            let Some(edge) = snapshot.find_edge(key)? else {
                return Ok(None);
            };
            Ok(Some(State {
                attributes: attributes(edge.attributes()?),
                ..State::default()
            }))
        }
        Thing::Node(id) => {
            let Some(node) = snapshot.find_node(id)? else {
                return Ok(None);
            };
            let mut edges = BTreeSet::new();
            for key in node.out_edges() {
                let key = key?;
                let label = schema.label_name(key.label);
                edges.insert(format!("-{label}-> {}", name_of(snapshot, key.to)));
            }
            for key in node.in_edges() {
                let key = key?;
                let label = schema.label_name(key.label);
                edges.insert(format!("<-{label}- {}", name_of(snapshot, key.from)));
            }
            Ok(Some(State {
                type_name: node.type_name().to_owned(),
                attributes: attributes(node.attributes()?),
                edges,
            }))
        }
    }
}

fn of_thing(newest: &Snapshot, thing: Thing) -> Result<Vec<Entry>, ReadError> {
    let mut entries = Vec::new();
    let mut before: Option<Option<State>> = None;
    for snapshot in kept(newest) {
        let now = match state(&snapshot, thing) {
            Err(ReadError::SnapshotTooOld { .. }) => continue,
            now => now?,
        };
        let happened = match (&before, &now) {
            // As it was when what is kept begins.
            (None, Some(state)) => vec![format!("is there {}", whole(state)).trim_end().to_owned()],
            (None | Some(None), None) => Vec::new(),
            (Some(None), Some(state)) => {
                vec![format!("created {}", whole(state)).trim_end().to_owned()]
            }
            (Some(Some(_)), None) => vec!["deleted".to_owned()],
            (Some(Some(before)), Some(now)) => changes(before, now),
        };
        if !happened.is_empty() {
            let value = json!(happened);
            entries.push(entry(&snapshot, happened.join("; "), value)?);
        }
        before = Some(now);
    }
    Ok(entries)
}

fn whole(state: &State) -> String {
    let values = state
        .attributes
        .iter()
        .map(|(name, (_, value))| format!("{name} = {value}"));
    let kind = Some(format!(": {}", state.type_name)).filter(|_| !state.type_name.is_empty());
    let parts: Vec<String> = kind.into_iter().chain(values).collect();
    parts.join(", ")
}

fn changes(before: &State, now: &State) -> Vec<String> {
    let mut happened = Vec::new();
    if before.type_name != now.type_name {
        happened.push(format!("type {} -> {}", before.type_name, now.type_name));
    }
    for (name, written) in &now.attributes {
        if before.attributes.get(name) != Some(written) {
            happened.push(format!("{name} = {}", written.1));
        }
    }
    let gone = |name: &&String| !now.attributes.contains_key(*name);
    happened.extend(
        before
            .attributes
            .keys()
            .filter(gone)
            .map(|name| format!("no {name}")),
    );
    happened.extend(
        now.edges
            .difference(&before.edges)
            .map(|edge| format!("+ {edge}")),
    );
    happened.extend(
        before
            .edges
            .difference(&now.edges)
            .map(|edge| format!("- {edge}")),
    );
    happened
}

fn row(entry: &Entry) -> Json {
    json!({
        "version": entry.version.0, "time": entry.time, "agent": entry.agent,
        "rules": entry.rules, "value": entry.value,
    })
}
