//! Processes that share one graph: the only module that knows iceoryx2, shared memory and the
//! clock of the host. It guarantees that what it hands to the rest of the crate is plain data.
//!
//! An *instance* is one running system on one host: a store, a world, agents, and whoever looks
//! on. Its name keeps it apart from all others; its files lie in a folder of its own that only
//! the user who started it can enter, and its shared memory carries a prefix of its own.

mod arena;
mod bare;
mod bell;
mod changes;
mod channel;
pub(crate) mod decode;
mod gate;
mod hot;
mod instance;
mod large;
mod lease;
mod leftovers;
mod orphan;
mod page;
mod presence;
mod segment;
mod session;
mod store;

pub use bare::{BareClient, BareServer};
pub use changes::{Changes, Update};
pub use channel::{Publisher, Subscriber};
pub use hot::{HotAttribute, HotError};
pub use instance::{Instance, InstanceError};
pub use large::{LargeAttribute, LargeError, LargeLoan, LargeReadError, LargeSample};
pub use lease::{Lease, LeaseError};
pub use orphan::OrphanError;
pub(crate) use segment::{Segment, Segments};
pub use session::{AttachError, ClockError, CommitError, Session, Tick};
pub use store::{Orphaned, Store, StoreError};

use gate::{one_at_a_time, port};
use iceoryx2::port::listener::{Listener, ListenerWaitError};
use iceoryx2::prelude::{ServiceName, ipc_threadsafe};
use std::fs;
use std::io;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// iceoryx2's flavour that lets a snapshot be read from any thread.
pub(crate) type Ipc = ipc_threadsafe::Service;
/// iceoryx2's notion of a process's presence; not a node of the graph.
pub(crate) type IpcNode = iceoryx2::node::Node<Ipc>;

/// How many processes and ports one instance may have.
pub(crate) const MAX_PROCESSES: usize = 64;
/// How many lives of the store may leave their ports behind before somebody cleans up.
pub(crate) const MAX_STORES: usize = 8;
/// The free shared memory, in bytes, that whoever joins or opens a channel leaves alone: until a store
/// has made sure of what that takes, and for those who are there.
const ROOM: u64 = 4 << 20;
/// Where shared memory shows up as files.
const SHARED_MEMORY: &str = "/dev/shm";

/// The files in shared memory whose names start with that.
fn memory_of(prefix: &str) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(SHARED_MEMORY)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().starts_with(prefix) {
            files.push(entry.path());
        }
    }
    Ok(files)
}

/// A service's name; all of ours are valid.
pub(crate) fn service_name(name: &str) -> Result<ServiceName, InstanceError> {
    ServiceName::new(name).map_err(|e| InstanceError::Ipc(format!("service `{name}`: {e}")))
}

/// Waits up to `patience` until it is rung. A signal to this process ends the wait too: whoever
/// waits looks again, and may find that it shall end.
pub(crate) fn wait(
    listener: &Listener<Ipc>,
    patience: Duration,
    what: &str,
) -> Result<(), InstanceError> {
    // To a socket no time at all would mean for ever.
    let patience = patience.max(Duration::from_micros(1));
    match listener.timed_wait(|_| (), patience) {
        Ok(_) | Err(ListenerWaitError::InterruptSignal) => Ok(()),
        Err(error) => Err(ipc(what, error)),
    }
}

/// How much shared memory the host has left, in bytes.
pub(crate) fn free_bytes() -> u64 {
    rustix::fs::statvfs(SHARED_MEMORY).map_or(0, |s| s.f_bavail * s.f_frsize)
}

/// Whether so many bytes of shared memory are free: memory that is written to when there is none
/// ends the process.
fn room_for(needed: u64) -> Result<(), InstanceError> {
    let free = free_bytes();
    if free < needed {
        return Err(InstanceError::Full { needed, free });
    }
    Ok(())
}

#[allow(
    clippy::disallowed_methods,
    reason = "waiting for another process takes the host's clock"
)]
fn now() -> Instant {
    Instant::now()
}

/// Waits where nobody could wake the process.
#[allow(
    clippy::disallowed_methods,
    reason = "before there is a store there is nothing to wait on"
)]
fn pause(nap: Duration) {
    std::thread::sleep(nap);
}

fn ipc(what: &str, error: impl std::fmt::Display) -> InstanceError {
    InstanceError::Ipc(format!("{what}: {error}"))
}
