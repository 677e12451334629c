//! What the page asks for, each a pure function of what is looked at. It guarantees that every answer is
//! JSON and that what cannot be answered says why.

use super::look::{Looker, Source};
use super::news;
use crate::Failure;
use crate::commands::{graph, why};
use crate::view::map::Map;
use crate::view::{agenda, graph as nodes, grid, mission};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dsr::{NodeId, Snapshot};
use grammar::live::Published;
use serde::Deserialize;
use serde_json::{Value as Json, json};
use std::time::Duration;

/// How long the first grid of its owner may take to arrive.
const PATIENCE: Duration = Duration::from_millis(200);
/// So many entries of a history.
const HISTORY: usize = 100;
/// So many commits before a time.
const COMMITS: usize = 80;

/// What a question says beside its name.
#[derive(Debug, Clone, Default, Deserialize)]
pub(super) struct Question {
    /// As of when, seconds since 1970; now where it is not said.
    pub(super) at: Option<f64>,
    pub(super) id: Option<u64>,
    pub(super) path: Option<String>,
    /// Of commits: only those that applied rules,
    #[serde(default)]
    pub(super) rules: bool,
    /// only those of an agent.
    pub(super) agent: Option<String>,
}

/// Answers a question; `None` where nobody knows such a one.
pub(super) fn answer(
    looker: &mut Looker,
    what: &str,
    question: &Question,
) -> Option<Result<Json, Failure>> {
    let path = question.path.as_deref();
    let sieve = news::Sieve {
        rules: question.rules,
        agent: question.agent.as_deref(),
    };
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
        "commits" => looker
            .at(question.at)
            .map(|snapshot| json!(news::commits(&snapshot, &sieve, COMMITS))),
        "agenda" => of(looker, question.at, agenda::agenda),
        "rules" => of(looker, question.at, rules),
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

/// The rules that can be applied, each with the variables that it binds and their types.
fn rules(snapshot: &Snapshot) -> Result<Json, dsr::ReadError> {
    // The store lets in no other rules than those that can be read.
    let grammar = Published::find(snapshot)?.and_then(|text| text.read(snapshot.schema()).ok());
    let row = |rule: &grammar::Rule| {
        let bound = rule.bound_nodes();
        let bound = bound.map(|node| [node.variable.to_string(), node.type_name.to_string()]);
        json!({
            "name": rule.name.to_string(), "variables": bound.collect::<Vec<_>>(),
            "says": rule.comments.join(" "),
        })
    };
    Ok(grammar
        .iter()
        .flat_map(|grammar| grammar.all_rules().map(row))
        .collect())
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
