//! `cortex graph`: the shared graph of a running instance, or of a file, for people and scripts.

use super::output::{print, print_json, tell};
use crate::cli::{Graph as Arguments, GraphAction, GraphSource};
use crate::{Answer, Failure};
use dsr::{
    Attribute, EdgeRef, Filter, Graph, NodeRef, Operation, Owner, Schema, Session, Snapshot, Time,
    Transaction, Update, Value, interchange, json,
};
use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;

/// How long to wait for an instance that may be starting.
const PATIENCE: Duration = Duration::from_secs(2);

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let source = &arguments.source;
    let done = match &arguments.action {
        GraphAction::Show { what } => {
            show(&mut Source::open(source)?, what.as_deref(), source.json)
        }
        GraphAction::Get { path } => get(&mut Source::open(source)?, path, source.json),
        GraphAction::Set { path, value } => set(source, path, value),
        GraphAction::Watch { filter, count } => watch(source, filter.as_deref(), *count),
        GraphAction::Export { format } => export(&mut Source::open(source)?, format),
    };
    done.map(|()| Answer::Yes)
}

/// Where the graph is.
enum Source {
    Live(Box<Session>),
    File(Box<Graph>),
}

impl Source {
    fn open(source: &GraphSource) -> Result<Self, Failure> {
        match &source.file {
            Some(path) => Ok(Self::File(Box::new(read_graph(path)?))),
            None => Ok(Self::Live(Box::new(attach(&source.instance)?))),
        }
    }

    fn snapshot(&mut self) -> Result<Snapshot, Failure> {
        match self {
            Self::Live(session) => session.snapshot().map_err(Failure::internal),
            Self::File(graph) => Ok(graph.snapshot()),
        }
    }
}

/// Joins a system that runs.
pub(crate) fn attach(name: &str) -> Result<Session, Failure> {
    let instance = super::instance(name)?;
    if !instance.exists() {
        return Err(Failure::input_with_help(
            format!("no instance `{name}` is running"),
            "start one with `cortex run SCENARIO`, or look at a file with --file",
        ));
    }
    Session::attach(&instance, crate::manifests::TERMINAL, PATIENCE).map_err(Failure::internal)
}

/// Reads a graph file into a graph of this process.
pub(crate) fn read_graph(path: &Path) -> Result<Graph, Failure> {
    let place =
        |error: &dyn std::fmt::Display| Failure::input(format!("{}: {error}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|error| place(&error))?;
    let import = interchange::read(&text).map_err(|error| place(&error))?;
    for left_out in &import.left_out {
        tell(&format!("{}: warning: {left_out}\n", path.display()));
    }
    let mut graph = Graph::in_memory(Schema::open());
    graph
        .commit(&import.transaction, "file", Time::default())
        .map_err(|error| place(&error))?;
    Ok(graph)
}

fn show(source: &mut Source, what: Option<&str>, as_json: bool) -> Result<(), Failure> {
    let snapshot = source.snapshot()?;
    if as_json && what.is_none() {
        return print_json(&json::to_json(&snapshot).map_err(Failure::internal)?);
    }
    let nodes = selected(&snapshot, what)?;
    let mut text = String::new();
    let read = || -> Result<(), dsr::ReadError> {
        let schema = snapshot.schema();
        let name = |id| {
            Ok(snapshot
                .find_node(id)?
                .map(|n| n.name())
                .transpose()?
                .unwrap_or_default())
        };
        let heading = format!(
            "version {}, {} nodes, {} edges\n",
            snapshot.version(),
            snapshot.node_count(),
            snapshot.edge_count()
        );
        text.push_str(&heading);
        for id in nodes {
            let Some(node) = snapshot.find_node(id)? else {
                continue;
            };
            // Writing to a string does not fail.
            let _ = writeln!(text, "\n{} : {}  (id {id})", node.name()?, node.type_name());
            for attribute in node.attributes()? {
                let _ = writeln!(text, "    {}", attribute_line(&snapshot, &attribute)?);
            }
            for key in node.out_edges() {
                let key = key?;
                let target: Result<String, dsr::ReadError> = name(key.to);
                let _ = writeln!(text, "    -{}-> {}", schema.label_name(key.label), target?);
                let edge = snapshot.find_edge(key)?;
                for attribute in edge
                    .map(|edge| edge.attributes())
                    .transpose()?
                    .unwrap_or_default()
                {
                    let _ = writeln!(text, "        {}", attribute_line(&snapshot, &attribute)?);
                }
            }
        }
        Ok(())
    };
    read().map_err(Failure::internal)?;
    print(&text)
}

/// The nodes of a type, or the node of a name, or all; by id.
fn selected(snapshot: &Snapshot, what: Option<&str>) -> Result<Vec<dsr::NodeId>, Failure> {
    let read = || -> Result<Option<Vec<dsr::NodeId>>, dsr::ReadError> {
        let mut nodes: Vec<dsr::NodeId> = match what {
            None => snapshot
                .nodes()
                .map(|n| n.map(|n| n.id()))
                .collect::<Result<_, _>>()?,
            Some(what) => match snapshot.schema().find_type(what) {
                Some(kind) => {
                    let nodes = snapshot.nodes_of_type(kind);
                    nodes.map(|n| n.map(|n| n.id())).collect::<Result<_, _>>()?
                }
                None => match snapshot.find_node_by_name(what)? {
                    Some(node) => vec![node.id()],
                    None => return Ok(None),
                },
            },
        };
        nodes.sort();
        Ok(Some(nodes))
    };
    let nodes = read().map_err(Failure::internal)?;
    nodes.ok_or_else(|| no_such(snapshot, what.unwrap_or_default(), "node or type"))
}

/// The failure for a name that nothing has, with the nearest that something has.
pub(crate) fn no_such(snapshot: &Snapshot, name: &str, what: &str) -> Failure {
    let names: Vec<String> = snapshot
        .nodes()
        .flatten()
        .filter_map(|node| node.name().ok())
        .collect();
    let types = snapshot
        .schema()
        .types()
        .iter()
        .map(|kind| kind.name.as_str());
    let known = dsr::suggest(name, names.iter().map(String::as_str).chain(types));
    let help = known.map_or_else(
        || "`cortex graph show` lists what there is".to_owned(),
        |known| format!("did you mean `{known}`?"),
    );
    Failure::input_with_help(format!("there is no {what} `{name}`"), help)
}

fn attribute_line(snapshot: &Snapshot, attribute: &Attribute) -> Result<String, dsr::ReadError> {
    let name = snapshot.schema().attribute_name(attribute.name);
    let mut value = match &attribute.value {
        Value::Pose(pose) => {
            let floor = dsr::pose_on_floor(pose);
            let (x, y) = (floor.translation.x, floor.translation.y);
            format!(
                "({x:.3}, {y:.3}) m, heading {:.3} rad",
                floor.rotation.angle()
            )
        }
        Value::F64(x) => format!("{x}"),
        Value::Vector(row) | Value::F64List(row) => {
            let row: Vec<String> = row.iter().map(|x| format!("{x:.3}")).collect();
            format!("[{}]", row.join(", "))
        }
        other => json::value_to_json(other).to_string(),
    };
    if value.chars().count() > 90 {
        let end = value
            .char_indices()
            .nth(80)
            .map_or(value.len(), |(at, _)| at);
        value.truncate(end);
        value.push_str(" ...");
    }
    let writer = snapshot.writer_name(attribute.writer)?;
    Ok(format!(
        "{name} = {value}   [{writer}, version {}]",
        attribute.version
    ))
}

/// `NODE.ATTRIBUTE`, or `FROM-LABEL->TO.ATTRIBUTE`.
fn parse_path(path: &str) -> Result<(Owner, String), Failure> {
    let bad = || {
        Failure::input_with_help(
            format!("`{path}` names no attribute"),
            "write NODE.ATTRIBUTE, or FROM-LABEL->TO.ATTRIBUTE for an edge",
        )
    };
    let (owner, attribute) = path.rsplit_once('.').ok_or_else(bad)?;
    let node = |name: &str| match name.parse::<u64>() {
        Ok(id) => NodeRef::Id(dsr::NodeId(id)),
        Err(_) => NodeRef::Name(name.to_owned()),
    };
    let owner = match owner.split_once("->") {
        None => Owner::Node(node(owner)),
        Some((start, to)) => {
            let (from, label) = start.rsplit_once('-').ok_or_else(bad)?;
            Owner::Edge(EdgeRef::new(node(from), label, node(to)))
        }
    };
    Ok((owner, attribute.to_owned()))
}

fn find_attribute(snapshot: &Snapshot, path: &str) -> Result<Attribute, Failure> {
    let (owner, name) = parse_path(path)?;
    let attribute = snapshot
        .schema()
        .attribute_id(&name)
        .map_err(Failure::input)?;
    let find = |node: &NodeRef| -> Result<dsr::NodeId, Failure> {
        let found = match node {
            NodeRef::Id(id) => snapshot.find_node(*id),
            NodeRef::Name(name) => snapshot.find_node_by_name(name),
        };
        let found = found.map_err(Failure::internal)?.map(|node| node.id());
        let name = node.to_string();
        found.ok_or_else(|| no_such(snapshot, name.trim_matches('`'), "node"))
    };
    let found = match &owner {
        Owner::Node(node) => {
            let id = find(node)?;
            let node = snapshot.find_node(id).map_err(Failure::internal)?;
            node.map(|node| node.attribute(attribute)).transpose()
        }
        Owner::Edge(edge) => {
            let label = snapshot
                .schema()
                .label_id(&edge.label)
                .map_err(Failure::input)?;
            let key = dsr::EdgeKey {
                from: find(&edge.from)?,
                label,
                to: find(&edge.to)?,
            };
            let found = snapshot.find_edge(key).map_err(Failure::internal)?;
            found.map(|edge| edge.attribute(attribute)).transpose()
        }
    };
    let found = found.map_err(Failure::internal)?.flatten();
    found.ok_or_else(|| Failure::input(format!("{owner} has no attribute `{name}`")))
}

fn get(source: &mut Source, path: &str, as_json: bool) -> Result<(), Failure> {
    let snapshot = source.snapshot()?;
    let attribute = find_attribute(&snapshot, path)?;
    let value = json::value_to_json(&attribute.value);
    if !as_json {
        return print(&format!("{value}\n"));
    }
    let writer = snapshot
        .writer_name(attribute.writer)
        .map_err(Failure::internal)?;
    print_json(&serde_json::json!({
        "value": value, "version": attribute.version.0, "time": attribute.time.seconds(),
        "writer": writer,
    }))
}

fn set(source: &GraphSource, path: &str, value: &str) -> Result<(), Failure> {
    if source.file.is_some() {
        return Err(Failure::input(
            "`graph set` changes a running system, not a file",
        ));
    }
    let mut session = attach(&source.instance)?;
    let snapshot = session.snapshot().map_err(Failure::internal)?;
    let (owner, name) = parse_path(path)?;
    let attribute = snapshot
        .schema()
        .attribute_id(&name)
        .map_err(Failure::input)?;
    let expected = snapshot
        .schema()
        .attributes()
        .get(usize::from(attribute.0))
        .and_then(|a| a.kind);
    // A bare word is a string, so that a shell needs no quotes within quotes.
    let parsed = serde_json::from_str(value).unwrap_or_else(|_| value.into());
    let value = json::value_from_json(&parsed, expected).map_err(Failure::input)?;
    let mut transaction = Transaction::new();
    transaction.push(Operation::SetAttribute { owner, name, value });
    match session.commit(&transaction, snapshot.time()) {
        Ok(commit) => print(&format!("version {}\n", commit.version)),
        Err(dsr::CommitError::Refused(refusal)) => Err(Failure::input(refusal)),
        Err(error) => Err(Failure::internal(error)),
    }
}

fn filter(snapshot: &Snapshot, name: Option<&str>) -> Result<Filter, Failure> {
    let mut filter = Filter::default();
    let Some(name) = name else { return Ok(filter) };
    let schema = snapshot.schema();
    filter.types.extend(schema.find_type(name));
    filter.labels.extend(schema.find_label(name));
    filter.attributes.extend(schema.find_attribute(name));
    let node = snapshot
        .find_node_by_name(name)
        .map_err(Failure::internal)?;
    filter.nodes.extend(node.map(|node| node.id()));
    if filter == Filter::default() {
        return Err(no_such(snapshot, name, "type, label, attribute or node"));
    }
    Ok(filter)
}

fn watch(source: &GraphSource, name: Option<&str>, count: Option<u64>) -> Result<(), Failure> {
    if source.file.is_some() {
        return Err(Failure::input(
            "`graph watch` follows a running system, not a file",
        ));
    }
    let interrupted = super::interruption()?;
    let mut session = attach(&source.instance)?;
    let filter = filter(&session.snapshot().map_err(Failure::internal)?, name)?;
    let mut changes = session.changes(filter).map_err(Failure::internal)?;
    let mut left = count.unwrap_or(u64::MAX);
    while left > 0 && !interrupted.load(std::sync::atomic::Ordering::Acquire) {
        let snapshot = session.snapshot().map_err(Failure::internal)?;
        match changes.next(snapshot.schema()).map_err(Failure::internal)? {
            None => {
                if !session.instance().exists() {
                    return Ok(());
                }
                changes
                    .wait(Duration::from_millis(100))
                    .map_err(Failure::internal)?;
            }
            Some(Update::Gap(version)) => {
                print(&format!("(commits before version {version} were missed)\n"))?;
            }
            Some(Update::Change(change)) => {
                left -= 1;
                let line = if source.json {
                    serde_json::to_string(&change).map_err(Failure::internal)?
                } else {
                    describe(&snapshot, &change)
                };
                print(&format!("{line}\n"))?;
            }
        }
    }
    Ok(())
}

/// A commit in one line.
fn describe(snapshot: &Snapshot, change: &dsr::Change) -> String {
    let schema = snapshot.schema();
    let name = |id| {
        let found = snapshot
            .find_node(id)
            .ok()
            .flatten()
            .and_then(|node| node.name().ok());
        found.unwrap_or_else(|| format!("node {id}"))
    };
    let sign = |touch| match touch {
        dsr::Touch::Created => "+",
        dsr::Touch::Deleted => "-",
        dsr::Touch::Updated | dsr::Touch::Replaced => "",
    };
    let mut parts = Vec::new();
    for rule in &change.rules {
        let binding = rule
            .binding
            .iter()
            .map(|(var, id)| format!("{var}={}", name(*id)));
        parts.push(format!(
            "rule {}({})",
            rule.rule,
            binding.collect::<Vec<_>>().join(", ")
        ));
    }
    let attributes = |list: &[dsr::AttributeId]| {
        let names: Vec<&str> = list.iter().map(|&a| schema.attribute_name(a)).collect();
        if names.is_empty() {
            String::new()
        } else {
            format!(".{{{}}}", names.join(","))
        }
    };
    for touched in &change.nodes {
        let attributes = attributes(&touched.attributes);
        parts.push(format!(
            "{}{}{attributes}",
            sign(touched.touch),
            name(touched.node)
        ));
    }
    for touched in &change.edges {
        let key = touched.edge;
        let label = schema.label_name(key.label);
        let attributes = attributes(&touched.attributes);
        let sign = sign(touched.touch);
        parts.push(format!(
            "{sign}{} -{label}-> {}{attributes}",
            name(key.from),
            name(key.to)
        ));
    }
    format!(
        "{} {:.3} s {}: {}",
        change.version,
        change.time.seconds(),
        change.agent,
        parts.join("; ")
    )
}

fn export(source: &mut Source, format: &str) -> Result<(), Failure> {
    let snapshot = source.snapshot()?;
    if format == "json" {
        return print_json(&json::to_json(&snapshot).map_err(Failure::internal)?);
    }
    let dot = || -> Result<String, dsr::ReadError> {
        let mut text = String::from("digraph dsr {\n  node [shape=box];\n");
        let quoted = |text: &str| text.replace('\\', "\\\\").replace('"', "\\\"");
        for node in snapshot.nodes() {
            let node = node?;
            let (name, kind) = (quoted(&node.name()?), quoted(node.type_name()));
            // Writing to a string does not fail.
            let _ = writeln!(text, "  n{} [label=\"{name}\\n{kind}\"];", node.id());
        }
        for node in snapshot.nodes() {
            for key in node?.out_edges() {
                let key = key?;
                let label = quoted(snapshot.schema().label_name(key.label));
                let _ = writeln!(text, "  n{} -> n{} [label=\"{label}\"];", key.from, key.to);
            }
        }
        text.push_str("}\n");
        Ok(text)
    };
    print(&dot().map_err(Failure::internal)?)
}
