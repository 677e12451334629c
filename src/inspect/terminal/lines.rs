//! What the views' lines say: pure functions of what the page gets, too. Guarantees that a line which can be asked
//! about has the path that *why* and *history* take.

use crate::commands::output::clock;
use dsr::Time;
use serde_json::Value as Json;

/// A line that can be chosen, with what *why* and *history* are asked of there.
#[derive(Debug, Clone, Default)]
pub(super) struct Line {
    pub(super) text: String,
    /// Kept in sight where the line is too narrow: who wrote it and when.
    pub(super) after: String,
    pub(super) path: Option<String>,
    pub(super) is_heading: bool,
}

pub(super) fn text(json: &Json) -> String {
    json.as_str().unwrap_or_default().to_owned()
}

pub(super) fn rows(json: &Json) -> impl Iterator<Item = &Json> {
    json.as_array().into_iter().flatten()
}

fn time(json: &Json) -> String {
    clock(Time::from_seconds(json.as_f64().unwrap_or_default()))
}

fn rules(json: &Json) -> String {
    let rules: Vec<String> = rows(json).map(text).collect();
    rules.join(", ")
}

pub(super) fn history_line(entry: &Json) -> String {
    let said = entry["text"].as_str().map(str::to_owned);
    let value = said.unwrap_or_else(|| entry["value"].to_string());
    let (time, agent) = (time(&entry["time"]), text(&entry["agent"]));
    format!("{time} {agent} {} {value}\n", rules(&entry["rules"]))
}

pub(super) fn commit_line(commit: &Json) -> Line {
    let what: Vec<String> = rows(&commit["what"]).map(text).collect();
    let path = what.first().cloned();
    let mut words = vec![time(&commit["time"]), text(&commit["agent"])];
    words.push(rules(&commit["rules"]));
    words.push(what.join(", "));
    if let Some(more @ 1..) = commit["more"].as_u64() {
        words.push(format!("and {more} more"));
    }
    words.retain(|word| !word.is_empty());
    Line {
        text: words.join(" "),
        path,
        ..Line::default()
    }
}

fn written(row: &Json) -> String {
    let age = row["age"].as_f64().unwrap_or_default();
    format!("{}, {age:.1} s ago", text(&row["writer"]))
}

pub(super) fn node_lines(node: &Json) -> Vec<Line> {
    let owner = text(&node["name"]);
    let attribute = |row: &Json| {
        let name = text(&row["name"]);
        Line {
            text: format!("{name} = {}", text(&row["text"])),
            after: written(row),
            path: Some(format!("{owner}.{name}")),
            ..Line::default()
        }
    };
    let edge = |row: &Json| {
        let (from, label, to) = (text(&row["from"]), text(&row["label"]), text(&row["to"]));
        let one = rows(&row["attributes"]).next();
        Line {
            text: format!("{from} -{label}-> {to}"),
            after: one.map(written).unwrap_or_default(),
            path: Some(format!("{from}-{label}->{to}")),
            ..Line::default()
        }
    };
    let attributes = rows(&node["attributes"]).map(attribute);
    attributes.chain(rows(&node["edges"]).map(edge)).collect()
}

pub(super) fn mission_lines(missions: &Json) -> Vec<Line> {
    let mut lines = Vec::new();
    for mission in rows(missions) {
        let (name, status) = (text(&mission["name"]), text(&mission["status"]));
        lines.push(Line {
            text: format!("{name}: {status} {}", text(&mission["reason"])),
            path: Some(name.clone()),
            is_heading: true,
            ..Line::default()
        });
        for step in rows(&mission["steps"]) {
            let bound = step["binding"].as_object().into_iter().flatten();
            let bound = bound.map(|(variable, node)| format!("{variable}={}", text(node)));
            let bound = bound.collect::<Vec<_>>().join(", ");
            let [rule, agent, status, reason] =
                ["rule", "agent", "status", "reason"].map(|key| text(&step[key]));
            lines.push(Line {
                text: format!("  {status:10} {rule}({bound}) by {agent} {reason}"),
                path: Some(text(&step["name"])),
                ..Line::default()
            });
        }
        for decision in rows(&mission["decisions"]) {
            let (what, why) = (text(&decision["what"]), text(&decision["why"]));
            let cause = &decision["cause"];
            let since = cause["agent"].as_str().map(|agent| {
                format!(
                    ", since version {} by {agent} {}",
                    cause["version"],
                    rules(&cause["rules"])
                )
            });
            let since = since.unwrap_or_default();
            lines.push(Line {
                text: format!("  {} {what}: {why}{since}", time(&decision["time"])),
                path: Some(name.clone()),
                ..Line::default()
            });
        }
    }
    if lines.is_empty() {
        lines.push(Line {
            text: "There are no missions.".to_owned(),
            ..Line::default()
        });
    }
    lines
}

pub(super) fn process_lines(processes: &Json, now: f64) -> Vec<Line> {
    let heading = format!(
        "{:18} {:9} {:>8} {:>6} {:>9} {:>9}  {}",
        "name", "state", "restarts", "load/%", "memory/MB", "commits/s", "last"
    );
    let process = |row: &Json| {
        let load = 100.0 * row["load"].as_f64().unwrap_or_default();
        let memory = row["memory"].as_f64().unwrap_or_default() / 1e6;
        let restarts = row["restarts"].as_u64().unwrap_or_default();
        let commits = row["commits"].as_f64().unwrap_or_default();
        let last = row["last"].as_f64();
        let last = last.map(|last| format!("{:.1} s ago", now - last));
        let last = last.unwrap_or_default();
        let (name, state) = (text(&row["name"]), text(&row["state"]));
        Line {
            text: format!(
                "{name:18} {state:9} {restarts:8} {load:6.1} {memory:9.1} {commits:9.1}  {last}"
            ),
            ..Line::default()
        }
    };
    let heading = Line {
        text: heading,
        is_heading: true,
        ..Line::default()
    };
    let mut lines: Vec<Line> = std::iter::once(heading)
        .chain(rows(processes).map(process))
        .collect();
    if lines.len() == 1 {
        "A recording has no processes.".clone_into(&mut lines[0].text);
    }
    lines
}
