//! What the page asks for, each a pure function of what is looked at. It guarantees that every answer is
//! JSON and that what cannot be answered says why.

use super::look::{Looker, Source};
use crate::Failure;
use crate::commands::{graph, why};
use crate::view::map::Map;
use crate::view::{graph as nodes, grid, mission};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dsr::{NodeId, Snapshot, Version};
use serde::Deserialize;
use serde_json::{Value as Json, json};
use std::time::Duration;

/// How long the first grid of its owner may take to arrive.
const PATIENCE: Duration = Duration::from_millis(200);
/// So many entries of a history.
const HISTORY: usize = 100;
/// So many commits before a time.
const COMMITS: u64 = 80;

/// What a question says beside its name.
#[derive(Debug, Clone, Default, Deserialize)]
pub(super) struct Question {
    /// As of when, seconds since 1970; now where it is not said.
    pub(super) at: Option<f64>,
    pub(super) id: Option<u64>,
    pub(super) path: Option<String>,
}

/// Answers a question; `None` where nobody knows such a one.
pub(super) fn answer(
    looker: &mut Looker,
    what: &str,
    question: &Question,
) -> Option<Result<Json, Failure>> {
    let path = question.path.as_deref();
    Some(match what {
        "about" => about(looker),
        "graph" => whole(looker, question.at),
        "map" => of(looker, question.at, |snapshot| {
            Ok(json!(Map::of(snapshot)?))
        }),
        "missions" => of(looker, question.at, mission::missions),
        "node" => node(looker, question),
        "history" => looker
            .at(question.at)
            .and_then(|snapshot| graph::history_rows(&snapshot, path.unwrap_or(""), Some(HISTORY))),
        "why" => looker
            .at(question.at)
            .and_then(|snapshot| why::explain(&snapshot, path.filter(|path| !path.is_empty()))),
        "commits" => looker.at(question.at).map(|snapshot| commits(&snapshot)),
        "agenda" => of(looker, question.at, agenda),
        "grid" => social_grid(looker),
        _ => return None,
    })
}

fn of(
    looker: &mut Looker,
    at: Option<f64>,
    look: impl Fn(&Snapshot) -> Result<Json, dsr::ReadError>,
) -> Result<Json, Failure> {
    match (&mut looker.source, at) {
        // As often as it takes not to be overtaken.
        (Source::Live(session), None) => session.read(look).map_err(Failure::internal),
        _ => look(&looker.at(at)?).map_err(Failure::internal),
    }
}

fn about(looker: &mut Looker) -> Result<Json, Failure> {
    let [oldest, newest] = looker.range()?;
    let name = match &looker.source {
        Source::Live(session) => session.instance().name().to_owned(),
        Source::Recording(_) => "recording".to_owned(),
    };
    let snapshot = looker.newest()?;
    Ok(json!({
        "instance": name, "live": matches!(looker.source, Source::Live(_)),
        "oldest": oldest.seconds(), "newest": newest.seconds(),
        "nodes": snapshot.node_count(), "edges": snapshot.edge_count(),
        "version": snapshot.version().0,
    }))
}

fn whole(looker: &mut Looker, at: Option<f64>) -> Result<Json, Failure> {
    let snapshot = looker.at(at)?;
    let layout = looker.placed(&snapshot)?;
    nodes::graph(&snapshot, layout).map_err(Failure::internal)
}

fn node(looker: &mut Looker, question: &Question) -> Result<Json, Failure> {
    let id = question
        .id
        .ok_or_else(|| Failure::input("give the node's id"))?;
    let snapshot = looker.at(question.at)?;
    let found = nodes::node(&snapshot, NodeId(id)).map_err(Failure::internal)?;
    found.ok_or_else(|| Failure::input(format!("there is no node {id} then")))
}

/// The last commits up to a snapshot, newest first: by whom and by which rules, as far as they are kept.
fn commits(snapshot: &Snapshot) -> Json {
    let version = snapshot.version().0;
    let versions = (version.saturating_sub(COMMITS)..=version).rev();
    let row = |version| {
        let cause = executive::Cause::find(snapshot, Version(version))
            .ok()
            .flatten()?;
        Some(json!({
            "version": version, "time": cause.time, "agent": cause.agent, "rules": cause.rules,
        }))
    };
    versions.filter_map(row).collect()
}

/// What is to take place when, at which object, by start.
fn agenda(snapshot: &Snapshot) -> Result<Json, dsr::ReadError> {
    let mut rows = Vec::new();
    for activity in snapshot.nodes_of("activity") {
        let activity = activity?;
        let value = |name: &str| activity.value(name);
        let number = |name: &str| Ok::<_, dsr::ReadError>(value(name)?.and_then(|v| v.as_f64()));
        let text = value("object")?;
        rows.push(json!({
            "name": activity.name()?, "start": number("start")?, "end": number("end")?,
            "object": text.as_ref().and_then(dsr::Value::as_str),
            "cancelled": value("cancelled")?.and_then(|v| v.as_bool()).unwrap_or(false),
        }));
    }
    let start = |row: &Json| row["start"].as_f64().unwrap_or(0.0);
    rows.sort_by(|a, b| start(a).total_cmp(&start(b)));
    Ok(Json::Array(rows))
}

/// The newest grid of costs as a byte a cell: 0 costs what free space costs, 255 is blocked.
fn social_grid(looker: &mut Looker) -> Result<Json, Failure> {
    let snapshot = looker.newest()?;
    let found = grid::find(&snapshot).map_err(Failure::internal)?;
    let (Source::Live(session), Some((handle, place))) = (&mut looker.source, found) else {
        return Ok(Json::Null);
    };
    let Ok(sample) = session.read_large(&handle, PATIENCE) else {
        return Ok(Json::Null);
    };
    let (Some(costs), &[rows, columns]) = (sample.numbers::<f32>(), handle.shape()) else {
        return Ok(Json::Null);
    };
    let byte = |cost: &f32| {
        if cost.is_finite() {
            ((cost - 1.0) * 10.0).clamp(0.0, 254.0) as u8
        } else {
            255
        }
    };
    let cells: Vec<u8> = costs.iter().map(byte).collect();
    Ok(json!({
        "place": place, "rows": rows, "columns": columns, "cells": STANDARD.encode(cells),
        "sequence": handle.sequence().to_string(),
    }))
}
