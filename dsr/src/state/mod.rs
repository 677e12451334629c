//! The graph on disk: a folder with one database whose rows are the nodes and edges of one
//! version. This file guarantees that the folder always holds a whole version: each group of
//! commits replaces the one before it in a single transaction of the database.

mod error;
mod keeper;
#[cfg(test)]
mod tests;

pub use error::StateError;
pub(crate) use keeper::Keeper;

use crate::graph::{EdgeImage, Frame, Image, NodeImage};
use crate::{EdgeKey, Epoch, LabelId, NodeId, ReadError, Schema, Snapshot, Version};
use redb::backends::FileBackend;
use redb::{
    Database, DatabaseError, ReadableDatabase, ReadableTable, StorageError, TableDefinition,
    TableError,
};
use rustix::fs::{FlockOperation, flock};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// What the rows mean; another number is another meaning.
const FORMAT: u32 = 3;
/// The format before it, which has no [`about::LIFE`].
const WITHOUT_LIFE: u32 = 2;
/// The database's name in the folder.
const FILE: &str = "graph.redb";
/// The name of one that is being made.
const UNFINISHED: &str = "graph.redb.new";
/// The mode of the database: what a robot knows of people is for its owner alone.
const OF_OWNER: u32 = 0o600;
/// Memory that the database may keep pages in.
const CACHE_BYTES: usize = 16 << 20;
/// A file that is smaller than this is not worth making smaller.
const SMALL_BYTES: u64 = 8 << 20;

/// What is said once: see [`about`].
const ABOUT: TableDefinition<'_, &str, &[u8]> = TableDefinition::new("about");
/// Node id to [`NodeImage`].
const NODES: TableDefinition<'_, u64, &[u8]> = TableDefinition::new("nodes");
/// Source, label and target to [`EdgeImage`].
const EDGES: TableDefinition<'_, (u64, u16, u64), &[u8]> = TableDefinition::new("edges");

/// Keys of [`ABOUT`].
mod about {
    /// [`super::FORMAT`].
    pub(super) const FORMAT: &str = "format";
    /// [`super::Frame`].
    pub(super) const FRAME: &str = "frame";
    /// [`super::Life`].
    pub(super) const LIFE: &str = "life";
    /// [`super::Schema`].
    pub(super) const SCHEMA: &str = "schema";
}

/// Which life of the store wrote a folder last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Life {
    pub(crate) epoch: Epoch,
    /// What it went on from, if that was in memory: a life that was killed, and its last version.
    pub(crate) from: Option<(Epoch, Version)>,
}

/// Rows to write: all that the commits of a group touched, as the last of them left it.
#[derive(Debug)]
struct Group {
    frame: Frame,
    /// Where it changed.
    schema: Option<Schema>,
    /// `None` where it is gone.
    nodes: Vec<(NodeId, Option<NodeImage>)>,
    edges: Vec<(EdgeKey, Option<EdgeImage>)>,
}

impl Group {
    /// Reads the touched nodes and edges; the schema too where it is not of `schema_version`.
    fn read(
        snapshot: &Snapshot,
        schema_version: u64,
        nodes: &BTreeSet<NodeId>,
        edges: &BTreeSet<EdgeKey>,
    ) -> Result<Self, ReadError> {
        let node = |id: &NodeId| {
            let found = snapshot.find_node(*id)?;
            Ok((*id, found.as_ref().map(NodeImage::of).transpose()?))
        };
        let edge = |key: &EdgeKey| {
            let found = snapshot.find_edge(*key)?;
            Ok((*key, found.as_ref().map(EdgeImage::of).transpose()?))
        };
        let changed = snapshot.root.schema_version != schema_version;
        Ok(Self {
            frame: Frame::of(snapshot)?,
            schema: changed.then(|| snapshot.schema().clone()),
            nodes: nodes.iter().map(node).collect::<Result<_, ReadError>>()?,
            edges: edges.iter().map(edge).collect::<Result<_, ReadError>>()?,
        })
    }
}

/// A state folder that this process alone has open.
#[derive(Debug)]
pub struct State {
    database: Database,
    path: PathBuf,
    // Given back last: the kernel does it if this process is killed.
    _lock: fs::File,
}

impl State {
    /// Opens a state folder, and makes it where there is none. What was damaged from outside is
    /// found here, for every page is checked.
    ///
    /// # Errors
    /// [`StateError`].
    pub fn open(folder: &Path) -> Result<Self, StateError> {
        let failed = |source| StateError::Io {
            path: folder.to_owned(),
            source,
        };
        let path = folder.join(FILE);
        let made = fs::DirBuilder::new()
            .recursive(true)
            .mode(0o700)
            .create(folder);
        made.map_err(failed)?;
        let lock = fs::File::open(folder).map_err(failed)?;
        let operation = FlockOperation::NonBlockingLockExclusive;
        flock(&lock, operation).map_err(|_| StateError::InUse { path: path.clone() })?;
        if lock.metadata().map_err(failed)?.permissions().mode() & 0o022 != 0 {
            let path = folder.to_owned();
            return Err(StateError::Shared { path });
        }
        if !path.try_exists().map_err(failed)? {
            create(folder, &path)?;
            lock.sync_all().map_err(failed)?;
        }
        // Where it was copied to, others may read it.
        fs::set_permissions(&path, fs::Permissions::from_mode(OF_OWNER)).map_err(failed)?;
        let database = Database::builder()
            .set_cache_size(CACHE_BYTES)
            .set_check_integrity_on_open(true)
            .open(&path)
            .map_err(|error| opening(&path, error))?;
        let mut state = Self {
            database,
            path,
            _lock: lock,
        };
        state.check_format()?;
        state.shrink()?;
        Ok(state)
    }

    fn check_format(&self) -> Result<(), StateError> {
        match self.find_about::<u32>(about::FORMAT)? {
            Some(FORMAT | WITHOUT_LIFE) => Ok(()),
            Some(found) => Err(StateError::Format {
                path: self.path.clone(),
                found,
            }),
            None => Err(StateError::Foreign {
                path: self.path.clone(),
            }),
        }
    }

    /// Gives back what a graph that was once much larger has left of the file.
    fn shrink(&mut self) -> Result<(), StateError> {
        let bytes = fs::metadata(&self.path).map_or(0, |file| file.len());
        if bytes < SMALL_BYTES {
            return Ok(());
        }
        let write = self.done(self.database.begin_write())?;
        let stats = self.done(write.stats())?;
        self.done(write.abort())?;
        if stats.stored_bytes() + stats.metadata_bytes() < bytes / 4 {
            let compacted = self.database.compact();
            self.done(compacted)?;
        }
        Ok(())
    }

    /// The version that the folder holds; `None` where nothing was written to it yet.
    ///
    /// # Errors
    /// [`StateError::Damaged`].
    pub fn load(&self) -> Result<Option<Image>, StateError> {
        let Some(frame) = self.find_about::<Frame>(about::FRAME)? else {
            return Ok(None);
        };
        let schema = self.find_about::<Schema>(about::SCHEMA)?;
        let schema = schema.ok_or_else(|| self.damaged("it has no schema"))?;
        let read = self.done(self.database.begin_read())?;
        let mut nodes: Vec<NodeImage> = Vec::new();
        let table = self.done(read.open_table(NODES))?;
        for row in self.done(table.iter())? {
            let (id, bytes) = self.done(row)?;
            let node: NodeImage = self.decode("a node", bytes.value())?;
            if node.id.0 != id.value() {
                return Err(self.damaged("a node's row has another node's key"));
            }
            nodes.push(node);
        }
        let mut edges: Vec<EdgeImage> = Vec::new();
        let table = self.done(read.open_table(EDGES))?;
        for row in self.done(table.iter())? {
            let (key, bytes) = self.done(row)?;
            let edge: EdgeImage = self.decode("an edge", bytes.value())?;
            if row_key(edge.key) != key.value() {
                return Err(self.damaged("an edge's row has another edge's key"));
            }
            edges.push(edge);
        }
        Ok(Some(Image {
            schema,
            frame,
            nodes,
            edges,
        }))
    }

    /// Which life of the store wrote the folder last; `None` where nothing was written to it yet, or by an
    /// older version of this program.
    pub(crate) fn life(&self) -> Result<Option<Life>, StateError> {
        self.find_about(about::LIFE)
    }

    /// Makes the folder hold `image`, of that life of the store, whatever it held before; rows that are
    /// the same already stay.
    ///
    /// # Errors
    /// [`StateError::Newer`] where it held a newer version; [`StateError::Io`].
    pub(crate) fn replace(&mut self, image: &Image, life: Life) -> Result<(), StateError> {
        let saved = self.find_about::<Frame>(about::FRAME)?;
        if let Some(saved) = saved.map(|frame| frame.version)
            && saved > image.version()
        {
            return Err(StateError::Newer {
                path: self.path.clone(),
                saved,
                given: image.version(),
            });
        }
        let write = self.done(self.database.begin_write())?;
        {
            let mut nodes = self.done(write.open_table(NODES))?;
            let kept: BTreeSet<u64> = image.nodes.iter().map(|node| node.id.0).collect();
            self.done(nodes.retain(|id, _| kept.contains(&id)))?;
            for node in &image.nodes {
                let (id, bytes) = (node.id.0, self.encode(node)?);
                let same = self
                    .done(nodes.get(id))?
                    .is_some_and(|row| row.value() == bytes);
                if !same {
                    self.done(nodes.insert(id, bytes.as_slice()))?;
                }
            }
            let mut edges = self.done(write.open_table(EDGES))?;
            let kept: BTreeSet<_> = image.edges.iter().map(|edge| row_key(edge.key)).collect();
            self.done(edges.retain(|key, _| kept.contains(&key)))?;
            for edge in &image.edges {
                let (key, bytes) = (row_key(edge.key), self.encode(edge)?);
                let same = self
                    .done(edges.get(key))?
                    .is_some_and(|row| row.value() == bytes);
                if !same {
                    self.done(edges.insert(key, bytes.as_slice()))?;
                }
            }
        }
        self.write_about(&write, &image.frame, Some(&image.schema), Some(life))?;
        self.done(write.commit())
    }

    /// Writes a group; when this returns, it is on disk.
    fn write(&mut self, group: &Group) -> Result<(), StateError> {
        let write = self.done(self.database.begin_write())?;
        {
            let mut nodes = self.done(write.open_table(NODES))?;
            for (id, node) in &group.nodes {
                match node {
                    Some(node) => {
                        let bytes = self.encode(node)?;
                        self.done(nodes.insert(id.0, bytes.as_slice()))?;
                    }
                    None => drop(self.done(nodes.remove(id.0))?),
                }
            }
            let mut edges = self.done(write.open_table(EDGES))?;
            for (key, edge) in &group.edges {
                let key = row_key(*key);
                match edge {
                    Some(edge) => {
                        let bytes = self.encode(edge)?;
                        self.done(edges.insert(key, bytes.as_slice()))?;
                    }
                    None => drop(self.done(edges.remove(key))?),
                }
            }
        }
        self.write_about(&write, &group.frame, group.schema.as_ref(), None)?;
        self.done(write.commit())
    }

    fn write_about(
        &self,
        write: &redb::WriteTransaction,
        frame: &Frame,
        schema: Option<&Schema>,
        life: Option<Life>,
    ) -> Result<(), StateError> {
        let mut table = self.done(write.open_table(ABOUT))?;
        let mut put =
            |key: &str, bytes: Vec<u8>| self.done(table.insert(key, bytes.as_slice())).map(drop);
        put(about::FRAME, self.encode(frame)?)?;
        if let Some(schema) = schema {
            put(about::SCHEMA, self.encode(schema)?)?;
        }
        if let Some(life) = life {
            put(about::FORMAT, self.encode(&FORMAT)?)?;
            put(about::LIFE, self.encode(&life)?)?;
        }
        Ok(())
    }

    fn find_about<T: DeserializeOwned>(&self, key: &str) -> Result<Option<T>, StateError> {
        let read = self.done(self.database.begin_read())?;
        let table = match read.open_table(ABOUT) {
            Err(TableError::TableDoesNotExist(_)) => return Ok(None),
            other => self.done(other)?,
        };
        let found = self.done(table.get(key))?;
        found
            .map(|bytes| self.decode(key, bytes.value()))
            .transpose()
    }

    fn encode<T: Serialize>(&self, value: &T) -> Result<Vec<u8>, StateError> {
        postcard::to_stdvec(value).map_err(|error| self.damaged(&error.to_string()))
    }

    fn decode<T: DeserializeOwned>(&self, what: &str, bytes: &[u8]) -> Result<T, StateError> {
        postcard::from_bytes(bytes).map_err(|error| self.damaged(&format!("{what}: {error}")))
    }

    fn damaged(&self, reason: &str) -> StateError {
        StateError::Damaged {
            path: self.path.clone(),
            reason: reason.to_owned(),
        }
    }

    /// What the database said, in our terms.
    fn done<T, E: Into<redb::Error>>(&self, outcome: Result<T, E>) -> Result<T, StateError> {
        outcome.map_err(|error| match error.into() {
            redb::Error::Io(source) => StateError::Io {
                path: self.path.clone(),
                source,
            },
            other => self.damaged(&other.to_string()),
        })
    }
}

fn row_key(key: EdgeKey) -> (u64, u16, u64) {
    let LabelId(label) = key.label;
    (key.from.0, label, key.to.0)
}

/// Makes an empty database under another name first, so that one that is there is whole, whenever
/// this process is killed.
fn create(folder: &Path, path: &Path) -> Result<(), StateError> {
    let failed = |source| StateError::Io {
        path: folder.to_owned(),
        source,
    };
    for entry in fs::read_dir(folder).map_err(failed)? {
        if entry.map_err(failed)?.file_name() != UNFINISHED {
            return Err(StateError::Foreign {
                path: folder.to_owned(),
            });
        }
    }
    let unfinished = folder.join(UNFINISHED);
    match fs::remove_file(&unfinished) {
        Err(source) if source.kind() != io::ErrorKind::NotFound => return Err(failed(source)),
        _ => {}
    }
    let make = || -> Result<(), redb::Error> {
        let file = fs::File::options()
            .read(true)
            .write(true)
            .create_new(true)
            .mode(OF_OWNER)
            .open(&unfinished)?;
        let database = Database::builder().create_with_backend(FileBackend::new(file)?)?;
        let write = database.begin_write()?;
        let format = postcard::to_stdvec(&FORMAT).unwrap_or_default();
        write
            .open_table(ABOUT)?
            .insert(about::FORMAT, format.as_slice())?;
        Ok(write.commit()?)
    };
    make().map_err(|error| match error {
        redb::Error::Io(source) => failed(source),
        other => StateError::Damaged {
            path: unfinished.clone(),
            reason: other.to_string(),
        },
    })?;
    fs::rename(&unfinished, path).map_err(failed)
}

fn opening(path: &Path, error: DatabaseError) -> StateError {
    let path = path.to_owned();
    match error {
        DatabaseError::DatabaseAlreadyOpen => StateError::InUse { path },
        DatabaseError::Storage(StorageError::Io(source))
            if source.kind() != io::ErrorKind::InvalidData =>
        {
            StateError::Io { path, source }
        }
        other => StateError::Damaged {
            path,
            reason: other.to_string(),
        },
    }
}
