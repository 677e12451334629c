//! `cortex rules check`: everything that is wrong or suspicious, and where.

use super::{clipped, put_diagnostics, read, warn};
use crate::commands::graph::read_graph;
use crate::commands::output::{print, print_json, tell};
use crate::commands::read_text;
use crate::{Answer, Failure};
use dsr::{Graph, Manifest, Schema, Time, json};
use grammar::{Conflict, Conflicts, Defects, Diagnostic, Grammar, Problem, SourceFile};
use serde_json::json;
use std::path::{Path, PathBuf};

/// The graph that shows a conflict, as graph JSON.
fn smallest(conflict: &Conflict) -> Result<serde_json::Value, Failure> {
    let mut graph = Graph::in_memory(Schema::open());
    graph
        .commit(&conflict.graph, "rules", Time::default())
        .map_err(Failure::internal)?;
    json::to_json(&graph.snapshot()).map_err(Failure::internal)
}

/// Files that a grammar is checked beside.
pub(super) struct Beside<'a> {
    pub(super) schema: Option<&'a Path>,
    pub(super) world: Option<&'a Path>,
    pub(super) manifests: &'a [PathBuf],
}

/// What does not fit an agent's manifest.
fn check_manifest(
    grammar: &Grammar,
    schema: Option<&Schema>,
    path: &Path,
) -> Result<Vec<Diagnostic>, Failure> {
    let (name, text) = (path.display().to_string(), read_text(path)?);
    let open = Schema::open();
    let manifest = Manifest::from_toml(&name, &text, schema.unwrap_or(&open));
    let manifest = manifest.map_err(|error| Failure::Input(error.into()))?;
    Ok(grammar.check_manifest(schema, &manifest, &SourceFile::new(&name, &text)))
}

/// A goal by itself: nothing but its text is looked at.
fn check_goal(file: &Path, as_json: bool) -> Result<Answer, Failure> {
    let name = file.display().to_string();
    let goal = grammar::parse_goal(&read_text(file)?, &name, &grammar::Types::default());
    if as_json {
        let mut object = json!({ "conflicts": [], "undecided": [], "conflicts_left": 0 });
        let defects = goal.as_ref().err();
        put_diagnostics(
            &mut object,
            defects.map_or(&[], |defects| &defects.diagnostics),
        );
        print_json(&object)?;
    }
    let goal = goal.map_err(|defects| Failure::Input(defects.into()))?;
    if !as_json {
        let (nodes, links) = (goal.pattern.nodes.len(), goal.pattern.edges.len());
        print(&format!("{name}: a goal, {nodes} nodes, {links} links\n"))?;
    }
    Ok(Answer::Yes)
}

/// What is found out of conflicts where they were not asked for: of a twentieth of the time at most.
const UNASKED_EFFORT: u64 = grammar::EFFORT_LIMIT / 20;
/// So many pairs of rules that were not decided are told to a person.
const TOLD: usize = 10;

fn conflicts_json(conflicts: &Conflicts) -> Result<serde_json::Value, Failure> {
    let row = |conflict: &Conflict| {
        Ok(json!({
            "first": conflict.first, "second": conflict.second,
            "message": clipped(&conflict.diagnostic.to_string()), "graph": smallest(conflict)?,
        }))
    };
    let rows = conflicts.found.iter().map(row);
    let rows = rows.collect::<Result<Vec<_>, Failure>>()?;
    let undecided = conflicts.undecided.iter();
    let undecided = undecided.map(
        |(first, second, why)| json!({"first": first, "second": second, "reason": why.to_string()}),
    );
    Ok(json!({
        "conflicts": rows, "undecided": undecided.collect::<Vec<_>>(),
        "conflicts_left": conflicts.left,
    }))
}

/// Says of which rules it is not known whether one can disable the other, and why.
fn tell_undecided(conflicts: &Conflicts) {
    let left = conflicts.left;
    let pairs = if left == 1 { "pair" } else { "pairs" };
    let words = "it was not found out whether one can disable the other";
    let mut lines = vec![format!("note: of {left} {pairs} of rules {words}:")];
    let named = conflicts.undecided.iter().take(TOLD);
    lines.extend(named.map(|(first, second, why)| format!("  `{first}` and `{second}`: {why}")));
    if left > TOLD {
        lines.push(format!("  and {} more", left - TOLD));
    }
    tell(&format!("{}\n", lines.join("\n")));
}

pub(super) fn check(
    file: &Path,
    beside: &Beside<'_>,
    conflicts: bool,
    as_json: bool,
) -> Result<Answer, Failure> {
    if super::is_goal(file) {
        return check_goal(file, as_json);
    }
    let (grammar, mut diagnostics) = read(file)?;
    let schema = beside.schema.map(|path| {
        Schema::from_toml(&path.display().to_string(), &read_text(path)?)
            .map_err(|error| Failure::Input(error.into()))
    });
    let schema = schema.transpose()?;
    if let Some(schema) = &schema {
        diagnostics.extend(grammar.check_schema(schema));
    }
    for manifest in beside.manifests {
        diagnostics.extend(check_manifest(&grammar, schema.as_ref(), manifest)?);
    }
    let broken = grammar::has_errors(&diagnostics);
    let mut analysed = grammar.analyse(schema.as_ref());
    if let Some(world) = beside.world {
        let graph = read_graph(world)?;
        let unreachable = grammar.unreachable(&graph.snapshot());
        // The world tells more of what can be applied than the rules alone do: which are awake.
        analysed.retain(|found| !matches!(found.problem, Problem::Unreachable { .. }));
        analysed.extend(unreachable.map_err(Failure::internal)?);
    }
    diagnostics.extend(analysed);
    let found = match (conflicts, as_json) {
        (true, _) => grammar.conflicts(schema.as_ref(), grammar::EFFORT_LIMIT),
        (false, true) => grammar.conflicts(schema.as_ref(), UNASKED_EFFORT),
        (false, false) => Conflicts::default(),
    };
    let shown = found.found.iter();
    diagnostics.extend(shown.map(|conflict| conflict.diagnostic.clone()));
    diagnostics.sort_by_cached_key(|d| {
        let included = grammar.files.iter().position(|file| *file == d.file);
        (included.unwrap_or(usize::MAX), d.span.start)
    });
    if as_json {
        let mut object = conflicts_json(&found)?;
        put_diagnostics(&mut object, &diagnostics);
        print_json(&object)?;
    }
    if conflicts && found.left > 0 {
        tell_undecided(&found);
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
