//! `cortex graph import`: brings what a file says into a graph, in one transaction.

use super::source::{CommitFailure, Source, parse_world};
use crate::cli::GraphSource;
use crate::commands::output::{print, print_json, tell};
use crate::commands::read_text;
use crate::{Answer, Failure};
use dsr::interchange::{Problems, Severity};
use dsr::{Graph, Refusal, Schema, Time};
use serde_json::json;
use std::path::Path;

/// How often to begin anew where the graph was changed meanwhile.
const TRIES: u32 = 5;

pub(super) fn import(source: &GraphSource, path: &Path, replace: bool) -> Result<Answer, Failure> {
    let mut graph = Source::open(source)?;
    let schema = graph.snapshot()?.schema().clone();
    let (text, name) = (read_text(path)?, path.display().to_string());
    let world = parse_world(path, &text, &schema)?;
    let mut problems = world.check(&text, &schema);
    problems.retain(|problem| problem.severity == Severity::Error);
    if !problems.is_empty() {
        let problems = Problems::new(&name, &text, problems);
        return Err(Failure::Input(problems.into()));
    }
    if matches!(graph, Source::Live(_)) && !world.stamps().is_empty() {
        tell(&format!(
            "{name}: its times and agents stay in the file: the graph says when and by whom it was \
             changed itself\n"
        ));
    }
    // What the file says, as a graph; of a schema that takes every kind, for it is checked.
    let mut wanted = Graph::in_memory(Schema::open());
    wanted
        .import(&world, "file", Time::default())
        .map_err(|error| Failure::input(format!("{name}: {error}")))?;
    let wanted = wanted.snapshot();
    let mut tries = 0;
    loop {
        tries += 1;
        let now = graph.snapshot()?;
        let differences = dsr::differences(&now, &wanted).map_err(Failure::internal)?;
        let transaction =
            dsr::bring_over(&now, &differences, replace).map_err(Failure::internal)?;
        let operations = transaction.operations.len();
        let version = if transaction.is_empty() {
            now.version()
        } else {
            match graph.commit(&transaction) {
                Ok(commit) => commit.version,
                Err(CommitFailure::Refused(
                    Refusal::NotFound(_) | Refusal::AlreadyExists(_) | Refusal::Conflict(_),
                )) if tries < TRIES => continue,
                Err(failure) => return Err(failure.into()),
            }
        };
        if source.json {
            print_json(&json!({"version": version.0, "operations": operations}))?;
        } else {
            let s = if operations == 1 { "" } else { "s" };
            print(&format!("version {version}: {operations} operation{s}\n"))?;
        }
        return Ok(Answer::Yes);
    }
}
