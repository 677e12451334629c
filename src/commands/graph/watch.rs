//! `cortex graph watch`: prints commits as they come.

use super::source::{attach, find_node, no_such};
use crate::cli::{GraphSource, Watch};
use crate::commands::output::{bold, brief, clock, dim, green, print, red, tell, value_text};
use crate::seen::Seen;
use crate::{Answer, Failure};
use dsr::{Attribute, Change, Filter, NodeId, Snapshot, Touch, Update};
use serde_json::json;
use std::sync::atomic::Ordering;
use std::time::Duration;

fn filter(snapshot: &Snapshot, arguments: &Watch) -> Result<Filter, Failure> {
    let mut filter = Filter::default();
    let schema = snapshot.schema();
    for name in &arguments.types {
        filter
            .types
            .push(schema.type_id(name).map_err(Failure::input)?);
    }
    for name in &arguments.labels {
        filter
            .labels
            .push(schema.label_id(name).map_err(Failure::input)?);
    }
    for name in &arguments.attributes {
        let id = schema.attribute_id(name).map_err(Failure::input)?;
        filter.attributes.push(id);
    }
    for name in &arguments.nodes {
        filter.nodes.push(find_node(snapshot, name)?);
    }
    for name in &arguments.filter {
        let before = filter.clone();
        filter.types.extend(schema.find_type(name));
        filter.labels.extend(schema.find_label(name));
        filter.attributes.extend(schema.find_attribute(name));
        filter
            .nodes
            .extend(super::source::node_ref(snapshot, name)?);
        if filter == before {
            return Err(no_such(snapshot, name, "type, label, attribute or node"));
        }
    }
    Ok(filter)
}

pub(super) fn watch(source: &GraphSource, arguments: &Watch) -> Result<Answer, Failure> {
    if source.file.is_some() {
        return Err(Failure::input(
            "`graph watch` follows a running system, not a file",
        ));
    }
    let interrupted = crate::commands::interruption()?;
    let mut session = attach(&source.instance)?;
    let filter = filter(&session.snapshot().map_err(Failure::internal)?, arguments)?;
    let mut changes = session.changes(filter).map_err(Failure::internal)?;
    let mut left = arguments.count.unwrap_or(u64::MAX);
    while left > 0 && !interrupted.load(Ordering::Acquire) {
        let snapshot = session.snapshot().map_err(Failure::internal)?;
        match changes.next(snapshot.schema()).map_err(Failure::internal)? {
            None => {
                if !session.instance().exists() {
                    tell("the instance has ended\n");
                    return Ok(Answer::Yes);
                }
                changes
                    .wait(Duration::from_millis(100))
                    .map_err(Failure::internal)?;
            }
            Some(Update::Gap(version)) => {
                if source.json {
                    print(&format!("{}\n", json!({"gap": version.0})))?;
                } else {
                    print(&format!("(commits up to version {version} were missed)\n"))?;
                }
            }
            Some(Update::Change(change)) => {
                left -= 1;
                let newest = session.snapshot().map_err(Failure::internal)?;
                let seen = Seen::new(newest, &change);
                let text = if source.json {
                    seen.row(&change).map_err(Failure::internal)?.to_string()
                } else {
                    line(&seen, &change)
                };
                print(&format!("{text}\n"))?;
            }
        }
    }
    Ok(Answer::Yes)
}

/// What was set, in braces.
fn values<'a>(set: impl Iterator<Item = (&'a str, Option<Attribute>)>) -> String {
    let shown = |(name, attribute): (&str, Option<Attribute>)| match attribute {
        Some(attribute) => format!("{name} = {}", brief(&value_text(&attribute.value), 40)),
        None => name.to_owned(),
    };
    let all: Vec<String> = set.map(shown).collect();
    if all.is_empty() {
        String::new()
    } else {
        format!(" {{{}}}", all.join(", "))
    }
}

/// A commit in one line.
fn line(seen: &Seen, change: &Change) -> String {
    let mark = |touch, text: String| match touch {
        Touch::Created => green(&format!("+{text}")),
        Touch::Deleted => red(&format!("-{text}")),
        Touch::Updated | Touch::Replaced => text,
    };
    let mut parts = Vec::new();
    for rule in &change.rules {
        let bound = |(var, id): &(String, NodeId)| format!("{var}={}", seen.name(*id));
        let binding: Vec<String> = rule.binding.iter().map(bound).collect();
        parts.push(format!("rule {}({})", bold(&rule.rule), binding.join(", ")));
    }
    for touched in &change.nodes {
        let set = seen.set(&touched.attributes, |name| seen.of_node(touched.node, name));
        let kind = seen.after().schema().type_name(touched.type_id);
        let kind = match touched.touch {
            Touch::Created | Touch::Replaced => format!(" : {kind}"),
            Touch::Deleted | Touch::Updated => String::new(),
        };
        let name = seen.name(touched.node);
        let text = format!("{name}{kind}{}", values(set));
        parts.push(mark(touched.touch, text));
    }
    for touched in &change.edges {
        let key = touched.edge;
        let set = seen.set(&touched.attributes, |name| seen.of_edge(key, name));
        let label = seen.after().schema().label_name(key.label);
        let (from, to) = (seen.name(key.from), seen.name(key.to));
        let text = format!("{from} -{label}-> {to}{}", values(set));
        parts.push(mark(touched.touch, text));
    }
    let heading = format!("{} {}", change.version, clock(change.time));
    format!("{} {}: {}", dim(&heading), change.agent, parts.join("; "))
}
