//! An instance: its name, where its files are, and who has joined it. This file guarantees that its folder
//! is one that only its owner can enter, and that nothing of it is removed under a process that runs.

use super::gate::{self, Gate};
use super::leftovers::Members;
use super::orphan::Orphan;
use super::{IpcNode, MAX_STORES, ROOM, SHARED_MEMORY, memory_of, room_for};
use crate::Version;
use iceoryx2::config::Config;
use iceoryx2::prelude::{FileName, LogLevel, Path as IpcPath, SemanticString, set_log_level};
use iceoryx2::service::Service;
use std::fs;
use std::hash::Hasher;
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Bytes in the path of a socket, by unix(7), less the end.
const SOCKET_PATH: usize = 107;
/// Digits of a port's number.
const PORT: usize = 34;

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
    /// Another user has made a file of that name first.
    #[error("{path} belongs to another user; use another instance name, or have it removed")]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// The names of sockets have little room.
    #[error(
        "the folder {folder} leaves {room} letters for an instance's name, and `{name}` is longer; \
         set CORTEX_RUNTIME_DIR to a shorter folder"
    )]
    LongPath {
        /// The folder of the user's instances.
        folder: PathBuf,
        /// The name.
        name: String,
        /// How long it may be.
        room: usize,
    },
    /// Shared memory is full: what was asked for takes more than there is.
    #[error(
        "{free} KiB are free in /dev/shm, and this takes {needed}; free some, or mount it larger",
        free = free >> 10,
        needed = needed >> 10
    )]
    Full {
        /// What it takes, in bytes.
        needed: u64,
        /// What there is, in bytes.
        free: u64,
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
    /// [`InstanceError::BadName`], [`InstanceError::LongPath`].
    pub fn new(name: &str) -> Result<Self, InstanceError> {
        let good = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if name.is_empty() || name.len() > 40 || !name.chars().all(good) {
            return Err(InstanceError::BadName(name.to_owned()));
        }
        Self::within(&Self::base(), name)
    }

    /// The instances of the current user that have files, by their names.
    ///
    /// # Errors
    /// [`InstanceError::Io`] where their folder cannot be listed.
    pub fn all() -> Result<Vec<Self>, InstanceError> {
        let folder = Self::of_user(&Self::base());
        let entries = match fs::read_dir(&folder) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            other => other.map_err(|source| InstanceError::Io {
                path: folder,
                source,
            })?,
        };
        let mut all: Vec<Self> = entries
            .flatten()
            .filter(|entry| entry.path().is_dir())
            .filter_map(|entry| Self::new(entry.file_name().to_str()?).ok())
            .collect();
        all.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(all)
    }

    /// Where the folders of users are.
    fn base() -> PathBuf {
        ["CORTEX_RUNTIME_DIR", "XDG_RUNTIME_DIR"]
            .iter()
            .find_map(|variable| std::env::var_os(variable).filter(|path| !path.is_empty()))
            .map_or_else(std::env::temp_dir, PathBuf::from)
    }

    /// The folder of the current user's instances.
    fn of_user(base: &Path) -> PathBuf {
        base.join(format!("cortex-{}", rustix::process::getuid().as_raw()))
    }

    /// The instance of that name whose files are below `base`.
    pub(super) fn within(base: &Path, name: &str) -> Result<Self, InstanceError> {
        let user = Self::of_user(base);
        let instance = Self {
            name: name.to_owned(),
            folder: user.join(name),
        };
        // A socket's path is the folder, `/`, the prefix, the port's number and `.event`.
        let taken = user.as_os_str().len() + 2 + instance.prefix().len() + PORT + ".event".len();
        let room = SOCKET_PATH.saturating_sub(taken);
        if name.len() > room {
            return Err(InstanceError::LongPath {
                folder: user,
                name: name.to_owned(),
                room,
            });
        }
        Ok(instance)
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
        // A hash, for names of sockets have little room; of the whole path, which holds the user;
        // and an end that no other prefix has.
        let mut hasher = rustc_hash::FxHasher::default();
        hasher.write(self.folder.as_os_str().as_encoded_bytes());
        let hash = hasher.finish();
        // Of the 64 bits the upper 60, five a letter: they are the better mixed.
        let letter =
            |i: u32| b"0123456789abcdefghijklmnopqrstuv"[(hash >> (4 + 5 * i)) as usize % 32];
        let letters: String = (0..12).map(|i| char::from(letter(i))).collect();
        format!("cortex_{letters}.")
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
        let user = self.folder.parent().unwrap_or(&self.folder);
        for folder in [user, &self.folder] {
            let created = fs::DirBuilder::new()
                .recursive(true)
                .mode(0o700)
                .create(folder);
            created.map_err(|source| InstanceError::Io {
                path: folder.to_owned(),
                source,
            })?;
            check(folder)?;
        }
        Ok(())
    }

    /// Whether a store could use the folder of the user's instances and this one's, as far as they are
    /// there.
    ///
    /// # Errors
    /// [`InstanceError::Unsafe`] with the folder that it could not.
    pub fn check_folder(&self) -> Result<(), InstanceError> {
        let user = self.folder.parent().unwrap_or(&self.folder);
        for folder in [user, &self.folder] {
            match check(folder) {
                Err(InstanceError::Io { source, .. })
                    if source.kind() == io::ErrorKind::NotFound => {}
                checked => checked?,
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

    /// Removes the instance if none of its processes runs, and tells whether it did. A process that is
    /// just starting either is seen here or finds nothing and begins anew.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn remove_if_unused(&self) -> Result<bool, InstanceError> {
        self.remove_where(|| Ok(true))
    }

    /// Leaves the instance, for a process that was started by hand and ends: if it was the last, all is
    /// removed but the graph of a store that was killed, with which another may go on.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn leave(&self) -> Result<(), InstanceError> {
        self.remove_where(|| Ok(self.orphaned()?.is_none()))?;
        Ok(())
    }

    /// Removes the instance if none of its processes runs and it may go.
    fn remove_where(
        &self,
        may_go: impl FnOnce() -> Result<bool, InstanceError>,
    ) -> Result<bool, InstanceError> {
        let Some(_gate) = Gate::enter(self)? else {
            return Ok(false);
        };
        let unused = self.processes()?.is_empty() && may_go()?;
        if unused {
            self.remove()?;
        }
        Ok(unused)
    }

    /// The newest version of the graph that a store left which was killed, if no other store has taken it
    /// over.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn orphaned(&self) -> Result<Option<Version>, InstanceError> {
        let orphan = Orphan::find(&self.config()?)?;
        Ok(orphan.map(|orphan| orphan.version()))
    }

    /// The ids of the processes that have joined it and are alive.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn processes(&self) -> Result<Vec<u32>, InstanceError> {
        let members = Members::of(&self.config()?)?;
        Ok(members.alive.into_iter().collect())
    }

    /// The instance's files in shared memory.
    ///
    /// # Errors
    /// [`InstanceError::Io`] where shared memory cannot be listed.
    pub fn shared_memory(&self) -> Result<Vec<PathBuf>, InstanceError> {
        memory_of(&self.prefix()).map_err(|source| InstanceError::Io {
            path: SHARED_MEMORY.into(),
            source,
        })
    }

    /// Its files that other users could open: none, unless somebody opened them to others.
    ///
    /// # Errors
    /// [`InstanceError::Io`].
    pub fn open_to_others(&self) -> Result<Vec<PathBuf>, InstanceError> {
        let mut files = self.shared_memory()?;
        files.push(self.folder.clone());
        files.retain(|path| {
            fs::symlink_metadata(path).is_ok_and(|file| file.permissions().mode() & 0o077 != 0)
        });
        Ok(files)
    }

    /// Takes from other users the right to open its files.
    ///
    /// # Errors
    /// [`InstanceError::Io`] with the file that cannot be closed.
    pub fn close_to_others(&self) -> Result<(), InstanceError> {
        for path in self.open_to_others()? {
            let closed = fs::symlink_metadata(&path).and_then(|file| {
                let mode = file.permissions().mode() & 0o700;
                fs::set_permissions(&path, fs::Permissions::from_mode(mode))
            });
            match closed {
                Err(source) if source.kind() != io::ErrorKind::NotFound => {
                    return Err(InstanceError::Io { path, source });
                }
                _ => {}
            }
        }
        Ok(())
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
        // A process that was killed is cleaned up after by the store, not by whoever comes by: cleaning
        // races with processes that are starting.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        // Of so many ports that died is kept what they sent until it was taken. Each takes some 4 KiB of
        // every other, whether it is needed or not.
        let defaults = &mut config.defaults;
        defaults.request_response.client_expired_connection_buffer = 2 * MAX_STORES;
        defaults
            .publish_subscribe
            .subscriber_expired_connection_buffer = 2 * MAX_STORES;
        Ok(config)
    }

    /// Announces this process as a member of the instance.
    pub(crate) fn join(&self) -> Result<IpcNode, InstanceError> {
        self.join_as()
    }

    pub(super) fn join_as<S: Service>(&self) -> Result<iceoryx2::node::Node<S>, InstanceError> {
        set_log_level(LogLevel::Fatal);
        room_for(ROOM)?;
        let gate = Gate::enter(self)?;
        if gate.is_none() {
            tracing::warn!("another process has been joining for seconds; is it stopped?");
        }
        gate::join(self, &self.config()?)
    }
}

/// Whether a folder is its user's, and nobody else's.
fn check(folder: &Path) -> Result<(), InstanceError> {
    let metadata = fs::symlink_metadata(folder).map_err(|source| InstanceError::Io {
        path: folder.to_owned(),
        source,
    })?;
    let mine = metadata.uid() == rustix::process::getuid().as_raw();
    if !metadata.is_dir() || !mine || metadata.permissions().mode() & 0o077 != 0 {
        return Err(InstanceError::Unsafe {
            path: folder.to_owned(),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_leaves_no_room_for_sockets_is_refused_with_the_room_there_is() {
        let base = Path::new("/run/user/1000");
        let longest = Instance::within(base, &"x".repeat(19)).unwrap();
        let socket =
            longest
                .folder()
                .join(format!("{}{}.event", longest.prefix(), "9".repeat(PORT)));
        assert!(socket.as_os_str().len() <= SOCKET_PATH, "{socket:?}");
        let deep = base.join("a-folder-that-lies-deep").join("below/others");
        let error = Instance::within(&deep, "default-baseline").unwrap_err();
        let InstanceError::LongPath { room, .. } = error else {
            panic!("{error}");
        };
        assert!(Instance::within(&deep, &"x".repeat(room)).is_ok());
        assert!(Instance::within(&deep, &"x".repeat(room + 1)).is_err());
    }

    #[test]
    fn instances_of_one_name_in_two_folders_have_different_prefixes() {
        let of = |base| {
            Instance::within(Path::new(base), "default")
                .unwrap()
                .prefix()
        };
        assert_ne!(of("/run"), of("/run/x"));
        assert_eq!(of("/run"), of("/run"));
    }
}
