//! `cortex rules check`: everything that is wrong or suspicious, and where.

use super::{diagnostics_json, read, warn};
use crate::commands::graph::read_graph;
use crate::commands::output::{print, print_json};
use crate::commands::read_text;
use crate::{Answer, Failure};
use dsr::{Graph, Schema, Time, json};
use grammar::{Conflict, Defects};
use serde_json::json;
use std::path::Path;

/// The graph that shows a conflict, as graph JSON.
fn smallest(conflict: &Conflict) -> Result<serde_json::Value, Failure> {
    let mut graph = Graph::in_memory(Schema::open());
    graph
        .commit(&conflict.graph, "rules", Time::default())
        .map_err(Failure::internal)?;
    json::to_json(&graph.snapshot()).map_err(Failure::internal)
}

pub(super) fn check(
    file: &Path,
    schema: Option<&Path>,
    world: Option<&Path>,
    conflicts: bool,
    as_json: bool,
) -> Result<Answer, Failure> {
    let (grammar, mut diagnostics) = read(file)?;
    let schema = schema.map(|path| {
        Schema::from_toml(&path.display().to_string(), &read_text(path)?)
            .map_err(|error| Failure::Input(error.into()))
    });
    let schema = schema.transpose()?;
    if let Some(schema) = &schema {
        diagnostics.extend(grammar.check_schema(schema));
    }
    let broken = grammar::has_errors(&diagnostics);
    diagnostics.extend(grammar.analyse(schema.as_ref()));
    if let Some(world) = world {
        let graph = read_graph(world)?;
        let unreachable = grammar.unreachable(&graph.snapshot());
        diagnostics.extend(unreachable.map_err(Failure::internal)?);
    }
    let found = if conflicts || as_json {
        grammar.conflicts()
    } else {
        Vec::new()
    };
    diagnostics.extend(found.iter().map(|conflict| conflict.diagnostic.clone()));
    diagnostics.sort_by(|a, b| {
        let place = |d: &grammar::Diagnostic| (d.span.file, d.span.start);
        place(a).cmp(&place(b))
    });
    if as_json {
        let conflicts: Vec<_> = found
            .iter()
            .map(|conflict| {
                Ok(json!({
                    "first": conflict.first, "second": conflict.second,
                    "message": conflict.diagnostic.to_string(), "graph": smallest(conflict)?,
                }))
            })
            .collect::<Result<_, Failure>>()?;
        print_json(&json!({
            "diagnostics": diagnostics_json(&diagnostics), "conflicts": conflicts,
        }))?;
    }
    if broken {
        return Err(Failure::Input(Defects { diagnostics }.into()));
    }
    warn(diagnostics);
    if !as_json {
        let (rules, combos) = (grammar.rules.len(), grammar.combos.len());
        let types = grammar.types.names().count();
        let combos = if combos == 0 {
            String::new()
        } else {
            format!(", {combos} combos")
        };
        print(&format!(
            "{}: {types} types, {rules} rules{combos}\n",
            file.display()
        ))?;
    }
    Ok(Answer::Yes)
}
