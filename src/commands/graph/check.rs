//! `cortex graph check`.

use super::source::{Source, is_recording};
use crate::cli::GraphSource;
use crate::commands::output::{print, print_json};
use crate::commands::read_text;
use crate::{Answer, Failure};
use dsr::interchange::{self, Problem, Problems, Severity};
use dsr::{Graph, Schema, Time, json};
use serde_json::json;
use std::path::Path;

pub(super) fn check(source: &GraphSource, schema: Option<&Path>) -> Result<Answer, Failure> {
    let schema = schema.map(read_schema).transpose()?;
    let text_file = source.file.as_ref().filter(|_| !is_recording(source));
    let (name, text, schema) = match text_file {
        Some(path) => (path.display().to_string(), read_text(path)?, schema),
        None => {
            // A running or recorded graph is shown as the file that it would be.
            let snapshot = Source::open(source)?.snapshot()?;
            let json = json::to_json(&snapshot).map_err(Failure::internal)?;
            let text = serde_json::to_string_pretty(&json).map_err(Failure::internal)?;
            let schema = schema.or_else(|| Some(snapshot.schema().clone()));
            let name = source.file.as_ref().map_or_else(
                || format!("@{}", source.instance),
                |path| path.display().to_string(),
            );
            (name, text, schema)
        }
    };
    let schema = schema.unwrap_or_else(Schema::open);
    let mut problems = match interchange::read(&text, &schema) {
        Err(error) => error.problems,
        Ok(world) => {
            let mut problems = world.check(&text, &schema);
            let mut graph = Graph::in_memory(Schema::open());
            match graph.import(&world, "file", Time::default()) {
                Err(refusal) => return Err(Failure::input(format!("{name}: {refusal}"))),
                Ok(_) => {
                    let found = interchange::check_graph(&graph.snapshot());
                    problems.extend(found.map_err(Failure::internal)?);
                }
            }
            problems
        }
    };
    problems.sort_by_key(|problem| std::cmp::Reverse(problem.severity));
    let count = |severity| problems.iter().filter(|p| p.severity == severity).count();
    let (errors, warnings) = (count(Severity::Error), count(Severity::Warning));
    if source.json {
        let list: Vec<serde_json::Value> = problems.iter().map(|p| row(&name, p)).collect();
        print_json(&json!({"errors": errors, "warnings": warnings, "problems": list}))?;
    } else if problems.is_empty() {
        print(&format!("{name}: nothing is wrong\n"))?;
    } else {
        let report: miette::Report = Problems::new(&name, &text, problems).into();
        let count = |count, what| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
        let (errors, warnings) = (count(errors, "error"), count(warnings, "warning"));
        print(&format!("{report:?}\n{errors}, {warnings}\n"))?;
    }
    Ok(if errors == 0 { Answer::Yes } else { Answer::No })
}

fn read_schema(path: &Path) -> Result<Schema, Failure> {
    let text = read_text(path)?;
    Schema::from_toml(&path.display().to_string(), &text)
        .map_err(|error| Failure::Input(error.into()))
}

fn row(file: &str, problem: &Problem) -> serde_json::Value {
    json!({
        "severity": problem.severity.to_string(),
        "message": problem.message,
        "help": problem.help,
        "file": file,
        "line": problem.place.map(|place| place.0),
        "column": problem.place.map(|place| place.1),
        "span": problem.span.as_ref().map(|span| [span.start, span.end]),
    })
}
