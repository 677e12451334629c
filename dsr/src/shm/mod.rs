//! Processes that share one graph: the only module that knows iceoryx2, shared memory and the
//! clock of the host. It guarantees that what it hands to the rest of the crate is plain data.
//!
//! An *instance* is one running system on one host: a store, a world, agents, and whoever looks
//! on. Its name keeps it apart from all others; its files lie in a folder of its own that only
//! the user who started it can enter, and its shared memory carries a prefix of its own.

mod arena;
mod changes;
mod channel;
mod session;
mod store;

pub use changes::{Changes, Update};
pub use channel::{Publisher, Subscriber};
pub use session::{AttachError, ClockError, CommitError, Session, Tick};
pub use store::{Store, StoreError};

use iceoryx2::config::Config;
use iceoryx2::prelude::{
    CallbackProgression, FileName, LogLevel, NodeBuilder, NodeState, Path as IpcPath,
    SemanticString, ServiceName, SignalHandlingMode, ipc_threadsafe, set_log_level,
};
use std::fs;
use std::hash::Hasher;
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// iceoryx2's flavour that lets a snapshot be read from any thread.
pub(crate) type Ipc = ipc_threadsafe::Service;
/// iceoryx2's notion of a process's presence; not a node of the graph.
pub(crate) type IpcNode = iceoryx2::node::Node<Ipc>;

/// How many processes and ports one instance may have.
pub(crate) const MAX_PROCESSES: usize = 64;
/// How many lives of the store may leave their ports behind before somebody cleans up.
pub(crate) const MAX_STORES: usize = 8;
/// Where shared memory shows up as files.
const SHARED_MEMORY: &str = "/dev/shm";

/// Why an instance cannot be used.
#[derive(Debug, Error)]
pub enum InstanceError {
    /// The name cannot be one.
    #[error("`{0}` cannot be an instance's name: use 1 to 40 letters, digits, `-` or `_`")]
    BadName(String),
    /// The instance's folder belongs to somebody else or others can write to it.
    #[error("{path} is not safe to use: it must be a folder of yours with mode 700; remove it")]
    Unsafe {
        /// The folder.
        path: PathBuf,
    },
    /// The operating system said no.
    #[error("cannot use {path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What it said.
        source: io::Error,
    },
    /// iceoryx2 said no.
    #[error("shared memory: {0}")]
    Ipc(String),
}

/// The name of one running system on this host, and where its files are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Instance {
    name: String,
    folder: PathBuf,
}

impl Instance {
    /// The instance of that name of the current user.
    ///
    /// Its folder is `cortex-<uid>/<name>` in `$CORTEX_RUNTIME_DIR`, else `$XDG_RUNTIME_DIR`, else
    /// the folder for temporary files.
    ///
    /// # Errors
    /// [`InstanceError::BadName`].
    pub fn new(name: &str) -> Result<Self, InstanceError> {
        let good = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if name.is_empty() || name.len() > 40 || !name.chars().all(good) {
            return Err(InstanceError::BadName(name.to_owned()));
        }
        let base = ["CORTEX_RUNTIME_DIR", "XDG_RUNTIME_DIR"]
            .iter()
            .find_map(|variable| std::env::var_os(variable).filter(|path| !path.is_empty()))
            .map_or_else(std::env::temp_dir, PathBuf::from);
        let uid = rustix::process::getuid().as_raw();
        let folder = base.join(format!("cortex-{uid}")).join(name);
        Ok(Self {
            name: name.to_owned(),
            folder,
        })
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The folder of its files.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What the names of its shared-memory files start with.
    fn prefix(&self) -> String {
        // A hash, for names of sockets have little room; and an end that no other prefix has.
        let mut hasher = rustc_hash::FxHasher::default();
        hasher.write(self.name.as_bytes());
        let hash = hasher.finish();
        format!("cortex_{}_{hash:016x}.", rustix::process::getuid().as_raw())
    }

    /// Whether anything of it is there.
    pub fn exists(&self) -> bool {
        self.folder.join("nodes").is_dir()
    }

    /// Makes the instance's folder, which only its owner can enter.
    ///
    /// # Errors
    /// [`InstanceError::Unsafe`] where somebody else made it or can write to it.
    pub fn create_folder(&self) -> Result<(), InstanceError> {
        let io = |path: &Path| {
            let path = path.to_owned();
            move |source| InstanceError::Io { path, source }
        };
        let user = self.folder.parent().unwrap_or(&self.folder);
        for folder in [user, &self.folder] {
            fs::DirBuilder::new()
                .recursive(true)
                .mode(0o700)
                .create(folder)
                .map_err(io(folder))?;
            let metadata = fs::symlink_metadata(folder).map_err(io(folder))?;
            let mine = metadata.uid() == rustix::process::getuid().as_raw();
            if !metadata.is_dir() || !mine || metadata.permissions().mode() & 0o022 != 0 {
                return Err(InstanceError::Unsafe {
                    path: folder.to_owned(),
                });
            }
        }
        Ok(())
    }

    /// Removes every file and piece of shared memory of the instance. To be called when none of
    /// its processes runs: before the first starts and after the last has ended.
    ///
    /// # Errors
    /// [`InstanceError::Io`] with the file that could not be removed.
    pub fn remove(&self) -> Result<(), InstanceError> {
        for file in self.shared_memory()? {
            match fs::remove_file(&file) {
                Err(source) if source.kind() != io::ErrorKind::NotFound => {
                    return Err(InstanceError::Io { path: file, source });
                }
                _ => {}
            }
        }
        match fs::remove_dir_all(&self.folder) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => Err(InstanceError::Io {
                path: self.folder.clone(),
                source,
            }),
            _ => Ok(()),
        }
    }

    /// Removes the instance if none of its processes runs: for a process that was started by hand
    /// and ends, and may be the last.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn remove_if_unused(&self) -> Result<(), InstanceError> {
        let mut running = 0;
        IpcNode::list(&self.config()?, |state| {
            running += u32::from(matches!(state, NodeState::Alive(_)));
            CallbackProgression::Continue
        })
        .map_err(|e| ipc("listing the instance's processes", e))?;
        if running == 0 { self.remove() } else { Ok(()) }
    }

    /// The instance's files in shared memory.
    ///
    /// # Errors
    /// [`InstanceError::Io`] where shared memory cannot be listed.
    pub fn shared_memory(&self) -> Result<Vec<PathBuf>, InstanceError> {
        let io = |source| InstanceError::Io {
            path: SHARED_MEMORY.into(),
            source,
        };
        let prefix = self.prefix();
        let mut files = Vec::new();
        for entry in fs::read_dir(SHARED_MEMORY).map_err(io)? {
            let entry = entry.map_err(io)?;
            if entry.file_name().to_string_lossy().starts_with(&prefix) {
                files.push(entry.path());
            }
        }
        Ok(files)
    }

    fn config(&self) -> Result<Config, InstanceError> {
        let ipc = |what: &str| InstanceError::Ipc(what.to_owned());
        let mut config = Config::default();
        let folder = self
            .folder
            .to_str()
            .ok_or_else(|| ipc("the folder's path is not UTF-8"))?;
        let path = IpcPath::new(folder.as_bytes())
            .map_err(|_| ipc("the folder's path is too long; set CORTEX_RUNTIME_DIR"))?;
        config.global.set_root_path(&path);
        config.global.prefix = FileName::new(self.prefix().as_bytes())
            .map_err(|_| ipc("the instance's name is too long"))?;
        // A process that was killed is cleaned up after by its supervisor and by the store, not by
        // whoever comes by: cleaning races with processes that are starting.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        Ok(config)
    }

    /// Announces this process as a member of the instance.
    pub(crate) fn join(&self) -> Result<IpcNode, InstanceError> {
        set_log_level(LogLevel::Fatal);
        NodeBuilder::new()
            .config(&self.config()?)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Ipc>()
            .map_err(|e| InstanceError::Ipc(format!("cannot join the instance: {e}")))
    }
}

/// A service's name; all of ours are valid.
pub(crate) fn service_name(name: &str) -> Result<ServiceName, InstanceError> {
    ServiceName::new(name).map_err(|e| InstanceError::Ipc(format!("service `{name}`: {e}")))
}

fn ipc(what: &str, error: impl std::fmt::Display) -> InstanceError {
    InstanceError::Ipc(format!("{what}: {error}"))
}
