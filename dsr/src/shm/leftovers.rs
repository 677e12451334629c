//! What a store does for its instance beside its work: it removes what processes that were killed left,
//! and makes sure of the memory of those that live. This file guarantees that nobody waits long for what a dead process was about to make, that its places
//! in the services are free again, and that nothing is taken from a process that lives; nor is the graph of a
//! store that was killed, see the file `orphan`.
//!
//! iceoryx2 cleans up after a process that has ended, but not where it was killed at a bad moment:
//!
//! - Shared memory that has no size yet: whoever opens it waits for ever, the cleaning itself too.
//! - A tag in its node's folder that is not whole: the folder is never empty, and cleaned in vain.
//! - A node without its lock, or a connection that nobody has entered yet: it is never looked at.
//! - A node without its details, which say where its files are: it is looked for elsewhere.

use super::gate::Gate;
use super::orphan;
use super::{InstanceError, Ipc, IpcNode, ROOM, ipc, memory_of, room_for};
use iceoryx2::config::Config;
use iceoryx2::node::{DeadNodeView, NodeView};
use iceoryx2::prelude::{CallbackProgression, NodeState};
use rustix::fs::{FallocateFlags, fallocate};
use std::collections::BTreeSet;
use std::fs::{self, File, Metadata};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// How often a store cleans up after the dead.
const CLEANING: Duration = Duration::from_millis(500);
/// How often it looks for what is half made, which somebody may wait for.
const SWEEPING: Duration = Duration::from_millis(100);
/// A connection that is half made for so long is not being made: its maker is stopped.
const STOPPED: Duration = Duration::from_secs(1);
/// Memory up to this many bytes is backed by pages whether it is in use or not.
const RESERVED: u64 = 4 << 20;
/// The mode of shared memory, and of a node's lock, while it is being made.
const BEING_MADE: u32 = 0o200;
/// The mode of a tag while it is being made.
const TAG_BEING_MADE: u32 = 0o600;
/// The ends of names of memory that belongs to no process: services, and the counter of nodes.
const OF_NOBODY: [&str; 2] = [".dynamic", ".global_mgmt"];

/// The processes whose ids are in the name of a file. iceoryx2 counts up an id of 128 bits, the time in the
/// lower half, and above it the process.
pub(super) fn processes_in(name: &str) -> impl Iterator<Item = u32> {
    name.split(['.', '_'])
        .filter_map(|part| part.parse::<u128>().ok())
        .map(|id| (id >> 64) as u32)
        .filter(|process| *process != 0)
}

pub(super) fn name_of(path: &Path) -> &str {
    path.file_name()
        .and_then(|name| name.to_str())
        .unwrap_or_default()
}

/// Who belongs to an instance.
#[derive(Debug, Default)]
pub(super) struct Members {
    /// The processes that have joined and live.
    pub(super) alive: BTreeSet<u32>,
    /// What has not been cleaned up after, and iceoryx2 can.
    dead: Vec<DeadNodeView<Ipc>>,
    /// What is in a state that iceoryx2 cannot tell.
    unclear: BTreeSet<u32>,
}

impl Members {
    pub(super) fn of(config: &Config) -> Result<Self, InstanceError> {
        let mut members = Self::default();
        IpcNode::list(config, |state| {
            let process = state.node_id().pid::<Ipc>();
            let process = process.map_or(0, |process| process.value().cast_unsigned());
            match state {
                NodeState::Alive(_) => drop(members.alive.insert(process)),
                NodeState::Dead(node) if node.details().is_some() => members.dead.push(node),
                // It has made nothing but its lock, or all else has been removed.
                NodeState::Dead(_) => {}
                _ => drop(members.unclear.insert(process)),
            }
            CallbackProgression::Continue
        })
        .map_err(|e| ipc("listing the instance's processes", e))?;
        Ok(members)
    }

    /// Whether the process has ended, if it ever was a member.
    pub(super) fn has_ended(&self, process: u32) -> bool {
        !self.alive.contains(&process) && !self.unclear.contains(&process)
    }

    /// Whether it has ended and iceoryx2 knows no more of it.
    fn is_forgotten(&self, process: u32) -> bool {
        let of = |node: &DeadNodeView<Ipc>| processes_in(&node.id().value().to_string()).next();
        self.has_ended(process) && !self.dead.iter().any(|node| of(node) == Some(process))
    }
}

/// Whether shared memory is being made, or was when its maker was killed.
pub(super) fn is_half_made(file: &Metadata) -> bool {
    file.len() == 0 || file.mode() & 0o777 == BEING_MADE
}

/// Removes shared memory that a process was making when it was killed, of those whose names pass.
pub(super) fn remove_half_made(config: &Config, passes: impl Fn(&str) -> bool) {
    let found: Vec<(PathBuf, Metadata)> = memory_of(&config.global.prefix.to_string())
        .unwrap_or_default()
        .into_iter()
        .filter(|path| passes(name_of(path)))
        .filter_map(|path| fs::metadata(&path).ok().map(|file| (path, file)))
        .filter(|(_, file)| is_half_made(file))
        .collect();
    if found.is_empty() {
        return;
    }
    // Asked after the files were seen: who made them was a member before, and is now if it lives.
    let Ok(members) = Members::of(config) else {
        return;
    };
    for (path, file) in found {
        let name = name_of(&path);
        let age = file.modified().ok().and_then(|made| made.elapsed().ok());
        let left = processes_in(name).any(|process| members.has_ended(process));
        if left || (name.ends_with(".connection") && age > Some(STOPPED)) {
            remove(&path);
        }
    }
}

/// Has the kernel make the pages of what members send each other small messages in: a page that is
/// first touched when there is no room for it ends the process that does.
fn reserve(config: &Config) {
    for path in memory_of(&config.global.prefix.to_string()).unwrap_or_default() {
        let Ok(file) = fs::metadata(&path) else {
            continue;
        };
        let lacks = file.blocks() * 512 < file.len();
        let small = (1..=RESERVED).contains(&file.len());
        if !lacks || !small || is_half_made(&file) || room_for(ROOM + file.len()).is_err() {
            continue;
        }
        let reserved = File::options().write(true).open(&path).and_then(|open| {
            fallocate(open, FallocateFlags::KEEP_SIZE, 0, file.len()).map_err(io::Error::from)
        });
        if let Err(error) = reserved {
            tracing::debug!("{}: {error}", path.display());
        }
    }
}

/// Removes all that dead processes left, each while `enter` keeps others from joining or opening: what
/// is being made is not told from what was left. How many were cleaned up after, and how many not.
pub(super) fn clean<G>(
    config: &Config,
    enter: impl Fn() -> Option<G>,
) -> Result<(usize, usize), InstanceError> {
    let members = orphan::keep(config)?;
    // Whoever is known to be dead makes nothing any more.
    remove_half_made(config, |_| true);
    let (mut cleaned, mut failed) = (0, 0);
    for node in members.dead {
        let Some(_gate) = enter() else { break };
        let folder = nodes(config).join(node.id().value().to_string());
        for path in entries(&folder) {
            let mode = fs::metadata(&path).map_or(0, |file| file.mode() & 0o777);
            if name_of(&path).ends_with("_tag") && mode == TAG_BEING_MADE {
                remove(&path);
            }
        }
        match node.try_remove_stale_resources() {
            Ok(()) => cleaned += 1,
            Err(error) => {
                tracing::debug!("{}: {error}", folder.display());
                failed += 1;
            }
        }
    }
    if strays(config, &members.alive)?.is_empty() {
        return Ok((cleaned, failed));
    }
    if let Some(_gate) = enter() {
        for path in strays(config, &members.alive)? {
            remove(&path);
        }
    }
    Ok((cleaned, failed))
}

/// The files and folders of processes that iceoryx2 does not know any more, or never did. `members` were
/// alive a moment ago.
fn strays(config: &Config, members: &BTreeSet<u32>) -> Result<Vec<PathBuf>, InstanceError> {
    let prefix = config.global.prefix.to_string();
    let sockets = PathBuf::from(config.global.root_path().to_string());
    let mut found = memory_of(&prefix).unwrap_or_default();
    found.retain(|path| !OF_NOBODY.iter().any(|end| name_of(path).ends_with(end)));
    found.extend(entries(&nodes(config)));
    found.extend(entries(&sockets).filter(|path| name_of(path).starts_with(&prefix)));
    found.retain(|path| processes_in(name_of(path)).any(|process| !members.contains(&process)));
    if found.is_empty() {
        return Ok(found);
    }
    // Asked after the files were seen, as above.
    let members = Members::of(config)?;
    found.retain(|path| processes_in(name_of(path)).any(|process| members.is_forgotten(process)));
    Ok(found)
}

fn nodes(config: &Config) -> PathBuf {
    config.global.node_dir().to_string().into()
}

fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    let entries = fs::read_dir(folder).ok();
    entries
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
}

/// Removes a file, or a folder with all in it. What cannot be removed is found again.
pub(super) fn remove(path: &Path) {
    tracing::debug!("{} was left by a process that was killed", path.display());
    let removed = if path.is_dir() {
        fs::remove_dir_all(path)
    } else {
        fs::remove_file(path)
    };
    if let Err(error) = removed {
        tracing::debug!("{}: {error}", path.display());
    }
}

/// The threads that clean an instance, beside the one that serves it.
#[derive(Debug)]
pub(super) struct Cleaner {
    // Ended in this order: the second frees the first where it waits for what nobody will make.
    _cleaning: Repeated,
    _sweeping: Repeated,
}

impl Cleaner {
    /// Cleans once, and then again and again.
    pub(super) fn start(node: &IpcNode) -> io::Result<Self> {
        let config = node.config().clone();
        let sweeping = Repeated::start("sweeping", SWEEPING, {
            let config = config.clone();
            move || {
                remove_half_made(&config, |_| true);
                reserve(&config);
            }
        })?;
        let clean = move || match clean(&config, || Gate::of(&config)) {
            Ok((0, 0)) => {}
            Ok((cleaned, failed)) => {
                tracing::debug!("dead processes: {cleaned} cleaned up after, {failed} not");
            }
            Err(error) => tracing::warn!("cleaning up after dead processes: {error}"),
        };
        clean();
        Ok(Self {
            _cleaning: Repeated::start("cleaning", CLEANING, clean)?,
            _sweeping: sweeping,
        })
    }
}

/// Something that a thread does again and again until this is dropped.
#[derive(Debug)]
struct Repeated {
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Repeated {
    fn start(
        name: &str,
        interval: Duration,
        mut work: impl FnMut() + Send + 'static,
    ) -> io::Result<Self> {
        let (end, ended) = channel::<()>();
        let thread = std::thread::Builder::new()
            .name(name.to_owned())
            .spawn(move || {
                while ended.recv_timeout(interval) == Err(RecvTimeoutError::Timeout) {
                    work();
                }
            })?;
        Ok(Self {
            end: Some(end),
            thread: Some(thread),
        })
    }
}

impl Drop for Repeated {
    fn drop(&mut self) {
        self.end = None;
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("cleaning up after dead processes has failed");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Instance;

    #[test]
    fn the_name_of_a_file_says_which_processes_it_is_of() {
        let of = |name: &str| processes_in(name).collect::<Vec<_>>();
        let id = |process: u128| ((7 << 96) + (process << 64) + 123_456_789).to_string();
        let (this, other) = (id(42), id(4_000_000));
        let hash = "b9fc73e5c1f646968758453273c6c65cb372831b";
        let prefix = "cortex_0123456789uv";
        let connection = format!("{prefix}.{hash}_{this}_{other}.connection");
        assert_eq!(of(&connection), [42, 4_000_000]);
        assert_eq!(of(&format!("{prefix}.{hash}_{this}__0.data")), [42]);
        assert_eq!(of(&format!("{prefix}.{this}.node_monitor_context")), [42]);
        assert_eq!(of(&this), [42]);
        let counter = "cortex_012345678901.9204dd183d1c_node.0_10_0.global_mgmt";
        assert_eq!(of(counter), [0; 0]);
    }

    #[test]
    fn a_process_that_lives_keeps_all_that_is_its() {
        let base = tempfile::tempdir().unwrap();
        let instance = Instance::within(base.path(), "living").unwrap();
        let node = instance.join().unwrap();
        let this = std::process::id();
        assert_eq!(instance.processes().unwrap(), [this]);
        let folder = nodes(node.config()).join(node.id().value().to_string());
        assert!(folder.is_dir());
        assert_eq!(processes_in(name_of(&folder)).next(), Some(this));
        let before: Vec<PathBuf> = entries(&nodes(node.config())).collect();
        // What another thread of it is making.
        let prefix = node.config().global.prefix.to_string();
        let made = format!("{prefix}hash_{}.data", node.id().value());
        let made = Path::new(crate::shm::SHARED_MEMORY).join(made);
        fs::File::create(&made).unwrap();
        clean(node.config(), || Some(())).unwrap();
        assert!(made.exists());
        assert_eq!(entries(&nodes(node.config())).count(), before.len());
        drop(node);
        instance.remove().unwrap();
        assert!(!made.exists());
    }
}
