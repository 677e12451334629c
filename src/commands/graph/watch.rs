//! `cortex graph watch`: prints commits as they come.

use super::source::{attach, find_node, name_of, no_such};
use crate::cli::{GraphSource, Watch};
use crate::commands::output::{bold, brief, dim, green, print, red, tell, value_text};
use crate::{Answer, Failure};
use dsr::{
    Attribute, AttributeId, Change, EdgeKey, Filter, NodeId, ReadError, Session, Snapshot, Touch,
    Update, Version, json,
};
use serde_json::{Map, Value as Json, json};
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
                let seen = Seen::new(&mut session, change.version)?;
                let line = if source.json {
                    seen.row(&change).to_string()
                } else {
                    seen.line(&change)
                };
                print(&format!("{line}\n"))?;
            }
        }
    }
    Ok(Answer::Yes)
}

/// The graph after a commit and before it, where they are still kept.
struct Seen {
    after: Snapshot,
    before: Option<Snapshot>,
}

impl Seen {
    fn new(session: &mut Session, version: Version) -> Result<Self, Failure> {
        let newest = session.snapshot().map_err(Failure::internal)?;
        let before = newest.at(Version(version.0.saturating_sub(1))).ok();
        Ok(Self {
            after: newest.at(version).unwrap_or(newest),
            before,
        })
    }

    /// The name of a node; of one that the commit took away, as it was before.
    fn name(&self, id: NodeId) -> String {
        let there = |snapshot: &&Snapshot| matches!(snapshot.find_node(id), Ok(Some(_)));
        let snapshot = Some(&self.after).filter(there).or(self.before.as_ref());
        name_of(snapshot.unwrap_or(&self.after), id)
    }

    fn of_node(&self, id: NodeId, name: AttributeId) -> Result<Option<Attribute>, ReadError> {
        match self.after.find_node(id)? {
            Some(node) => node.attribute(name),
            None => Ok(None),
        }
    }

    fn of_edge(&self, key: EdgeKey, name: AttributeId) -> Result<Option<Attribute>, ReadError> {
        match self.after.find_edge(key)? {
            Some(edge) => edge.attribute(name),
            None => Ok(None),
        }
    }

    /// What a commit set, with the values; without, where the version is not kept any more.
    fn set<'a>(
        &'a self,
        names: &'a [AttributeId],
        read: impl Fn(AttributeId) -> Result<Option<Attribute>, ReadError> + 'a,
    ) -> impl Iterator<Item = (&'a str, Option<Attribute>)> + 'a {
        let name = |id| self.after.schema().attribute_name(id);
        names
            .iter()
            .map(move |&id| (name(id), read(id).ok().flatten()))
    }

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
    fn line(&self, change: &Change) -> String {
        let mark = |touch, text: String| match touch {
            Touch::Created => green(&format!("+{text}")),
            Touch::Deleted => red(&format!("-{text}")),
            Touch::Updated | Touch::Replaced => text,
        };
        let mut parts = Vec::new();
        for rule in &change.rules {
            let bound = |(var, id): &(String, NodeId)| format!("{var}={}", self.name(*id));
            let binding: Vec<String> = rule.binding.iter().map(bound).collect();
            parts.push(format!("rule {}({})", bold(&rule.rule), binding.join(", ")));
        }
        for touched in &change.nodes {
            let set = self.set(&touched.attributes, |name| self.of_node(touched.node, name));
            let kind = self.after.schema().type_name(touched.type_id);
            let kind = match touched.touch {
                Touch::Created | Touch::Replaced => format!(" : {kind}"),
                Touch::Deleted | Touch::Updated => String::new(),
            };
            let name = self.name(touched.node);
            let text = format!("{name}{kind}{}", Self::values(set));
            parts.push(mark(touched.touch, text));
        }
        for touched in &change.edges {
            let key = touched.edge;
            let set = self.set(&touched.attributes, |name| self.of_edge(key, name));
            let label = self.after.schema().label_name(key.label);
            let (from, to) = (self.name(key.from), self.name(key.to));
            let text = format!("{from} -{label}-> {to}{}", Self::values(set));
            parts.push(mark(touched.touch, text));
        }
        let heading = format!("{} {:.3} s", change.version, change.time.seconds());
        format!("{} {}: {}", dim(&heading), change.agent, parts.join("; "))
    }

    /// A commit as a line of JSON.
    fn row(&self, change: &Change) -> Json {
        let touch = |touch| match touch {
            Touch::Created => "created",
            Touch::Deleted => "deleted",
            Touch::Updated => "updated",
            Touch::Replaced => "replaced",
        };
        let schema = self.after.schema();
        let rules = change.rules.iter().map(|rule| {
            let bound = |(var, id): &(String, NodeId)| (var.clone(), json!(self.name(*id)));
            let binding: Map<String, Json> = rule.binding.iter().map(bound).collect();
            json!({"rule": rule.rule, "binding": binding})
        });
        let nodes = change.nodes.iter().map(|touched| {
            let set = self.set(&touched.attributes, |name| self.of_node(touched.node, name));
            json!({
                "id": touched.node.0, "name": self.name(touched.node),
                "type": schema.type_name(touched.type_id), "touch": touch(touched.touch),
                "attributes": json_values(set),
            })
        });
        let edges = change.edges.iter().map(|touched| {
            let key = touched.edge;
            let set = self.set(&touched.attributes, |name| self.of_edge(key, name));
            json!({
                "from": self.name(key.from), "label": schema.label_name(key.label),
                "to": self.name(key.to), "touch": touch(touched.touch),
                "attributes": json_values(set),
            })
        });
        json!({
            "version": change.version.0, "time": change.time.seconds(), "agent": change.agent,
            "rules": rules.collect::<Vec<_>>(), "nodes": nodes.collect::<Vec<_>>(),
            "edges": edges.collect::<Vec<_>>(),
        })
    }
}

/// Values by name; `null` for what was removed.
fn json_values<'a>(set: impl Iterator<Item = (&'a str, Option<Attribute>)>) -> Map<String, Json> {
    let value = |attribute: Option<Attribute>| match attribute {
        Some(attribute) => json::value_to_json(&attribute.value),
        None => Json::Null,
    };
    set.map(|(name, attribute)| (name.to_owned(), value(attribute)))
        .collect()
}
