//! Where a graph is: in a running instance, or in a file. Guarantees that a file is written whole or not
//! at all, in the format that it was read from.

use crate::Failure;
use crate::cli::GraphSource;
use crate::commands::output::tell;
use crate::commands::{instance, read_text};
use crate::recording;
use dsr::interchange::{self, Format, World};
use dsr::{
    AttachError, Commit, Graph, NodeId, NodeRef, Schema, Session, Snapshot, Time, Transaction, json,
};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long to wait for an instance that may be starting.
const PATIENCE: Duration = Duration::from_secs(2);

/// A graph that can be read and changed.
pub(crate) enum Source {
    Live(Box<Session>),
    File(Box<FileGraph>),
    /// As of the end of what was played of a recording.
    Recording(Box<Graph>),
}

/// A graph in a file.
pub(crate) struct FileGraph {
    path: PathBuf,
    format: Format,
    graph: Graph,
}

impl Source {
    pub(crate) fn open(source: &GraphSource) -> Result<Self, Failure> {
        if source.at.is_some() && !is_recording(source) {
            return Err(Failure::input_with_help(
                "only a recording can be looked at as of a time",
                "name one with --file RUN.mcap; `cortex graph history` tells what a running graph still keeps",
            ));
        }
        match &source.file {
            Some(path) if source.at.is_some() => Self::play(path, source.at),
            Some(path) => Self::open_file(path),
            None => Ok(Self::Live(Box::new(attach(&source.instance)?))),
        }
    }

    fn play(path: &Path, at: Option<f64>) -> Result<Self, Failure> {
        let graph = recording::played(path, at).map_err(Failure::input)?;
        Ok(Self::Recording(Box::new(graph)))
    }

    pub(super) fn open_file(path: &Path) -> Result<Self, Failure> {
        if recording::is_recording(path) {
            return Self::play(path, None);
        }
        let (world, graph) = read_world(path)?;
        Ok(Self::File(Box::new(FileGraph {
            path: path.to_owned(),
            format: world.format(),
            graph,
        })))
    }

    pub(crate) fn snapshot(&mut self) -> Result<Snapshot, Failure> {
        match self {
            Self::Live(session) => session.snapshot().map_err(Failure::internal),
            Self::File(file) => Ok(file.graph.snapshot()),
            Self::Recording(graph) => Ok(graph.snapshot()),
        }
    }

    /// Applies a transaction; a file is written then.
    pub(super) fn commit(&mut self, transaction: &Transaction) -> Result<Commit, CommitFailure> {
        match self {
            Self::Live(session) => {
                let time = session.snapshot().map_err(Failure::internal)?.time();
                session
                    .commit(transaction, time)
                    .map_err(|error| match error {
                        dsr::CommitError::Refused(refusal) => CommitFailure::Refused(refusal),
                        error => CommitFailure::Other(Failure::internal(error)),
                    })
            }
            Self::File(file) => {
                let committed = file.graph.commit(transaction, "file", Time::default());
                let (commit, _) = committed.map_err(CommitFailure::Refused)?;
                file.save()?;
                Ok(commit)
            }
            Self::Recording(_) => Err(CommitFailure::Other(Failure::input_with_help(
                "a recording is read, not written",
                "write it as graph JSON: `cortex graph export json --file RUN.mcap`",
            ))),
        }
    }
}

/// Why a change was not made.
pub(super) enum CommitFailure {
    Refused(dsr::Refusal),
    Other(Failure),
}

impl From<Failure> for CommitFailure {
    fn from(failure: Failure) -> Self {
        Self::Other(failure)
    }
}

impl From<CommitFailure> for Failure {
    fn from(failure: CommitFailure) -> Self {
        match failure {
            CommitFailure::Refused(refusal) => Self::input(refusal),
            CommitFailure::Other(failure) => failure,
        }
    }
}

impl FileGraph {
    fn save(&self) -> Result<(), Failure> {
        let snapshot = self.graph.snapshot();
        let json = match self.format {
            Format::Json => json::to_json(&snapshot),
            Format::Robocomp => interchange::to_robocomp(&snapshot),
            Format::Agm => {
                return Err(Failure::input_with_help(
                    "AGM models are read, not written",
                    "write it as graph JSON: `cortex graph export json --file MODEL.xml`",
                ));
            }
        };
        let json = json.map_err(Failure::internal)?;
        let text = serde_json::to_string_pretty(&json).map_err(Failure::internal)?;
        let mut beside = self.path.clone().into_os_string();
        beside.push(format!(".{}", std::process::id()));
        let written = std::fs::write(&beside, text + "\n")
            .and_then(|()| std::fs::rename(&beside, &self.path));
        written.map_err(|error| {
            // It may not be there.
            drop(std::fs::remove_file(&beside));
            Failure::input(format!("cannot write {}: {error}", self.path.display()))
        })
    }
}

/// Whether the graph is that of a recording.
pub(super) fn is_recording(source: &GraphSource) -> bool {
    source.file.as_deref().is_some_and(recording::is_recording)
}

/// Joins a system that runs.
pub(crate) fn attach(name: &str) -> Result<Session, Failure> {
    let instance = instance(name)?;
    if !instance.exists() {
        return Err(crate::commands::not_running(name));
    }
    let attached = Session::attach(&instance, crate::manifests::TERMINAL, PATIENCE);
    attached.map_err(|error| match (&error, instance.orphaned()) {
        (AttachError::NoStore { .. }, Ok(Some(version))) => Failure::input_with_help(
            format!("the store of instance `{name}` was killed"),
            format!("`cortex store` goes on with what it left, version {version} of its graph"),
        ),
        (AttachError::NoStore { .. }, _) => Failure::input(error),
        _ => Failure::internal(error),
    })
}

/// Reads a world file; what was left out of it is told.
pub(super) fn parse_world(path: &Path, text: &str, schema: &Schema) -> Result<World, Failure> {
    let name = path.display().to_string();
    let world = interchange::read(text, schema)
        .map_err(|error| Failure::Input(error.in_file(&name, text).into()))?;
    for left_out in &world.left_out {
        tell(&format!("{name}: warning: {left_out}\n"));
    }
    Ok(world)
}

fn read_world(path: &Path) -> Result<(World, Graph), Failure> {
    let text = read_text(path)?;
    let world = parse_world(path, &text, &Schema::open())?;
    let mut graph = Graph::in_memory(Schema::open());
    graph
        .import(&world, "file", Time::default())
        .map_err(|error| Failure::input(format!("{}: {error}", path.display())))?;
    Ok((world, graph))
}

/// Reads a graph file into a graph of this process.
pub(crate) fn read_graph(path: &Path) -> Result<Graph, Failure> {
    read_world(path).map(|(_, graph)| graph)
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

/// A node as the command line names it: by name, else by id.
pub(super) fn node_ref(snapshot: &Snapshot, text: &str) -> Result<Option<NodeId>, Failure> {
    let found = snapshot.find_node_by_name(text);
    if let Some(node) = found.map_err(Failure::internal)? {
        return Ok(Some(node.id()));
    }
    let Ok(id) = text.parse::<u64>() else {
        return Ok(None);
    };
    let found = snapshot.find_node(NodeId(id)).map_err(Failure::internal)?;
    Ok(found.map(|node| node.id()))
}

/// As [`node_ref`], where it must be there.
pub(super) fn find_node(snapshot: &Snapshot, text: &str) -> Result<NodeId, Failure> {
    node_ref(snapshot, text)?.ok_or_else(|| no_such(snapshot, text, "node"))
}

/// A node's name, or its id where it is gone.
pub(crate) fn name_of(snapshot: &Snapshot, id: NodeId) -> String {
    let node = snapshot.find_node(id).ok().flatten();
    let name = node.and_then(|node| node.name().ok());
    name.unwrap_or_else(|| NodeRef::Id(id).to_string())
}
