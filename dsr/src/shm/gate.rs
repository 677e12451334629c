//! The gate of an instance: one process at a time joins it, opens a service in it, or removes it.
//! This file guarantees that nothing is removed under a process that is just starting, and that
//! no file of the instance can be opened by another user.
//!
//! iceoryx2 lets several processes make the same service at once, and most of the time it works;
//! a lock makes it all of the time. The lock is one on the instance's folder, which leaves no file
//! behind and is given back by the kernel when its holder dies.

use super::{Instance, InstanceError, IpcNode, ipc, leftovers, now, pause};
use iceoryx2::config::Config;
use iceoryx2::node::Node;
use iceoryx2::prelude::{NodeBuilder, SignalHandlingMode};
use iceoryx2::service::Service;
use rustix::fs::{FlockOperation, flock};
use std::fs::{self, File};
use std::io::{self, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;
use std::time::{Duration, Instant};

/// How long a process waits for another to get through.
const PATIENCE: Duration = Duration::from_secs(2);
/// How long it tries again to open what the dead may still hold.
const CLEANED: Duration = Duration::from_secs(1);
/// How often it looks.
const LOOK: Duration = Duration::from_millis(1);
/// The mode of a service's description while it is being written; readable alone once it is whole.
const BEING_MADE: u32 = 0o600;
/// What iceoryx2 calls the file that it makes for everybody on the host to write to.
const OPEN_FILE: &str = ".global_mgmt";

/// While it lives, no other process gets through the gate.
#[derive(Debug)]
pub(crate) struct Gate {
    _lock: File,
}

/// Locks a file or folder, which takes as long as another has it locked. `None` where that is seconds.
#[allow(
    clippy::disallowed_methods,
    reason = "a lock cannot be waited for with a time limit otherwise"
)]
pub(super) fn lock(path: &Path) -> io::Result<Option<Gate>> {
    let file = File::open(path)?;
    let deadline = Instant::now() + PATIENCE;
    while flock(&file, FlockOperation::NonBlockingLockExclusive).is_err() {
        if Instant::now() > deadline {
            return Ok(None);
        }
        std::thread::sleep(LOOK);
    }
    // Whoever held it may have removed what it is on.
    let same = fs::metadata(path).is_ok_and(|now| {
        file.metadata()
            .is_ok_and(|then| (then.dev(), then.ino()) == (now.dev(), now.ino()))
    });
    if same {
        Ok(Some(Gate { _lock: file }))
    } else {
        Err(io::ErrorKind::NotFound.into())
    }
}

impl Gate {
    /// Makes the instance's folder and goes through its gate. `None` where another process has
    /// been in it for seconds, so that it must be stopped: whoever only wants to join goes on
    /// without.
    pub(super) fn enter(instance: &Instance) -> Result<Option<Self>, InstanceError> {
        loop {
            instance.create_folder()?;
            match lock(instance.folder()) {
                Ok(gate) => return Ok(gate),
                // Removed between the two.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(source) => {
                    let path = instance.folder().to_owned();
                    return Err(InstanceError::Io { path, source });
                }
            }
        }
    }

    /// Goes through the gate of an instance that is there. `None` as above, and where it is not.
    pub(super) fn of(config: &Config) -> Option<Self> {
        let folder = config.global.root_path().to_string();
        lock(Path::new(&folder)).ok().flatten()
    }
}

/// Opens something that several processes may open at once, one process after the other. Where that
/// fails it is tried again without what dead processes left: places that they hold, a service that
/// one of them had begun to make.
pub(super) fn one_at_a_time<T, E>(node: &IpcNode, open: impl Fn() -> Result<T, E>) -> Result<T, E> {
    let config = node.config();
    // Without the gate it works too, but for bad luck.
    let Some(_gate) = Gate::of(config) else {
        let folder = config.global.root_path();
        tracing::warn!("another process has held {folder} for {PATIENCE:?}; is it stopped?");
        return open();
    };
    let remove = || {
        remove_half_made(Path::new(&config.global.service_dir().to_string()));
        leftovers::remove_half_made(config, |name| name.ends_with(".dynamic"));
    };
    remove();
    open().or_else(|_| {
        // What was told from a living process's work by its age is old enough now.
        remove();
        without_the_dead(config, || Some(()), open)
    })
}

/// Makes a port. Where that fails it is tried again without what dead processes left: the places that
/// they hold.
pub(super) fn port<T, E>(node: &IpcNode, make: impl Fn() -> Result<T, E>) -> Result<T, E> {
    let config = node.config();
    make().or_else(|_| without_the_dead(config, || Gate::of(config), make))
}

/// Cleans up after the dead and tries again what failed, for as long as others who clean may take.
fn without_the_dead<T, E, G>(
    config: &Config,
    enter: impl Fn() -> Option<G>,
    again: impl Fn() -> Result<T, E>,
) -> Result<T, E> {
    let deadline = now() + CLEANED;
    loop {
        if let Err(error) = leftovers::clean(config, &enter) {
            tracing::debug!("cleaning up after dead processes: {error}");
        }
        match again() {
            Err(_) if now() < deadline => pause(LOOK),
            last => return last,
        }
    }
}

/// Removes the descriptions of services whose maker was killed while it made them: iceoryx2 would wait
/// for it in vain, in every process and for good. To be called inside the gate, where nobody else
/// makes one. What cannot be removed shows when the service is opened.
fn remove_half_made(services: &Path) {
    let Ok(entries) = fs::read_dir(services) else {
        return;
    };
    for entry in entries.flatten() {
        let half_made = entry
            .metadata()
            .is_ok_and(|metadata| metadata.is_file() && metadata.mode() & 0o777 == BEING_MADE);
        if half_made {
            tracing::warn!(
                "{} was left by a process that was killed",
                entry.path().display()
            );
            drop(fs::remove_file(entry.path()));
        }
    }
}

fn node<S: Service>(config: &Config) -> Result<Node<S>, InstanceError> {
    NodeBuilder::new()
        .config(config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<S>()
        .map_err(|e| ipc("cannot join the instance", e))
}

/// Announces this process as a member of the instance. To be called inside the gate.
pub(super) fn join<S: Service>(
    instance: &Instance,
    config: &Config,
) -> Result<Node<S>, InstanceError> {
    if !seal(instance)? {
        // The first node of an instance makes the file; this one is for that alone.
        drop(node::<S>(config)?);
        seal(instance)?;
    }
    node(config)
}

/// Closes the one file that iceoryx2 opens to all users, and which whoever truncates it could end
/// every process with that joins. iceoryx2 looks at it only while a process joins, so that inside
/// the gate nobody does: a copy that only its owner can open takes its place, and whoever opened
/// the first holds a file that nobody reads any more. Whether there is one.
fn seal(instance: &Instance) -> Result<bool, InstanceError> {
    let mut sealed = false;
    for path in instance.shared_memory()? {
        let io = |source| InstanceError::Io {
            path: path.clone(),
            source,
        };
        if !path.to_string_lossy().ends_with(OPEN_FILE) {
            continue;
        }
        let metadata = fs::symlink_metadata(&path).map_err(io)?;
        if metadata.uid() != rustix::process::getuid().as_raw() || !metadata.is_file() {
            return Err(InstanceError::Foreign { path });
        }
        // Made by a process that was killed at that: everybody else would wait for it.
        if leftovers::is_half_made(&metadata) {
            fs::remove_file(&path).map_err(io)?;
            continue;
        }
        if metadata.mode().trailing_zeros() >= 6 {
            sealed = true;
            continue;
        }
        let content = fs::read(&path).map_err(io)?;
        let sealing = path.with_extension("sealing");
        // Left by a process that was killed at this very place.
        drop(fs::remove_file(&sealing));
        let mut copy = File::options()
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(&sealing)
            .map_err(io)?;
        copy.write_all(&content).map_err(io)?;
        fs::rename(&sealing, &path).map_err(io)?;
        sealed = true;
    }
    Ok(sealed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn only_descriptions_that_were_never_finished_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, mode: u32| {
            let path = folder.path().join(name);
            fs::write(&path, name).unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
            path
        };
        let half_made = file("half.service", BEING_MADE);
        let whole = file("whole.service", 0o400);
        remove_half_made(folder.path());
        assert!(!half_made.exists() && whole.exists());
        remove_half_made(&folder.path().join("nowhere"));
    }
}
