//! The thread that brings commits to the disk, a group at a time. It guarantees that a commit is
//! called durable only after the group that holds it was synced, and that the store never waits
//! for the disk: it only notes what a commit touched.

use super::{Group, State, StateError};
use crate::{Change, EdgeKey, NodeId, ReadError, Snapshot, Version};
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// After so many groups whose memory was reused while they were read, the store is held up for the
/// time of reading one.
const ATTEMPTS: u32 = 3;

/// What was committed since the last group.
#[derive(Debug, Default)]
struct Pending {
    newest: Option<Snapshot>,
    nodes: BTreeSet<NodeId>,
    edges: BTreeSet<EdgeKey>,
    /// Somebody waits for it.
    urgent: bool,
    ended: bool,
}

#[derive(Debug)]
struct Shared {
    pending: Mutex<Pending>,
    news: Condvar,
    /// The newest version on disk.
    durable: AtomicU64,
    /// Why nothing more reaches the disk.
    failure: OnceLock<String>,
}

impl Shared {
    fn pending(&self) -> MutexGuard<'_, Pending> {
        // Notes are whole at every moment, also where a holder of the lock panicked.
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Brings commits to the disk.
#[derive(Debug)]
pub(crate) struct Keeper {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Keeper {
    /// Starts with a folder that holds `snapshot`. Groups that nobody waits for are `interval`
    /// apart; `bell` is rung after each.
    pub(crate) fn start(
        state: State,
        snapshot: &Snapshot,
        interval: Duration,
        bell: Box<dyn Fn() + Send>,
    ) -> std::io::Result<Self> {
        let shared = Arc::new(Shared {
            pending: Mutex::default(),
            news: Condvar::new(),
            durable: AtomicU64::new(snapshot.version().0),
            failure: OnceLock::new(),
        });
        let writer = Writer {
            shared: Arc::clone(&shared),
            state,
            schema_version: snapshot.root.schema_version,
            interval,
            bell,
        };
        let thread = std::thread::Builder::new()
            .name("state".to_owned())
            .spawn(|| writer.run())?;
        Ok(Self {
            shared,
            thread: Some(thread),
        })
    }

    /// Notes a commit; `newest` is the graph after it.
    pub(crate) fn note(&self, change: &Change, newest: Snapshot, urgent: bool) {
        let mut pending = self.shared.pending();
        let idle = pending.newest.is_none() || (urgent && !pending.urgent);
        pending
            .nodes
            .extend(change.nodes.iter().map(|node| node.node));
        pending
            .edges
            .extend(change.edges.iter().map(|edge| edge.edge));
        pending.newest = Some(newest);
        pending.urgent |= urgent;
        drop(pending);
        if idle {
            self.shared.news.notify_one();
        }
    }

    /// The newest version on disk.
    pub(crate) fn durable(&self) -> Version {
        Version(self.shared.durable.load(Ordering::Acquire))
    }

    /// Why nothing more reaches the disk, if so.
    pub(crate) fn failure(&self) -> Option<&str> {
        self.shared.failure.get().map(String::as_str)
    }
}

impl Drop for Keeper {
    /// Writes what was noted, and ends.
    fn drop(&mut self) {
        self.shared.pending().ended = true;
        self.shared.news.notify_one();
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the state was not written to its end");
        }
    }
}

struct Writer {
    shared: Arc<Shared>,
    state: State,
    /// Of the schema on disk.
    schema_version: u64,
    interval: Duration,
    bell: Box<dyn Fn() + Send>,
}

impl Writer {
    fn run(mut self) {
        let mut due = now();
        while self.wait(due) {
            due = now() + self.interval;
            if let Err(error) = self.write_group() {
                tracing::error!("nothing more is kept on disk: {error}");
                // Set by this thread alone, which ends here.
                drop(self.shared.failure.set(error.to_string()));
                (self.bell)();
                return;
            }
            (self.bell)();
        }
    }

    /// Waits until there is a group to write: at `due`, or at once where somebody waits for it.
    /// False when all is written and the store has ended.
    fn wait(&self, due: Instant) -> bool {
        let mut pending = self.shared.pending();
        loop {
            if pending.newest.is_none() {
                if pending.ended {
                    return false;
                }
                let woken = self.shared.news.wait(pending);
                pending = woken.unwrap_or_else(PoisonError::into_inner);
                continue;
            }
            let left = due.saturating_duration_since(now());
            if pending.urgent || pending.ended || left.is_zero() {
                return true;
            }
            let woken = self.shared.news.wait_timeout(pending, left);
            pending = woken.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn write_group(&mut self) -> Result<(), StateError> {
        let Some((group, schema_version)) = self.read_group()? else {
            return Ok(());
        };
        self.state.write(&group)?;
        self.schema_version = schema_version;
        self.shared
            .durable
            .store(group.frame.version.0, Ordering::Release);
        Ok(())
    }

    /// Reads what the group holds from the graph's memory, with the schema's version.
    fn read_group(&self) -> Result<Option<(Group, u64)>, StateError> {
        let (mut nodes, mut edges) = (BTreeSet::new(), BTreeSet::new());
        let mut attempt = 0;
        loop {
            let mut pending = self.shared.pending();
            let Some(snapshot) = pending.newest.take() else {
                // The version was overtaken, and the commit that did it is about to be noted.
                if attempt == 0 || pending.ended {
                    return Ok(None);
                }
                let woken = self.shared.news.wait(pending);
                drop(woken.unwrap_or_else(PoisonError::into_inner));
                continue;
            };
            nodes.append(&mut pending.nodes);
            edges.append(&mut pending.edges);
            pending.urgent = false;
            attempt += 1;
            let held = (attempt > ATTEMPTS).then_some(pending);
            let group = Group::read(&snapshot, self.schema_version, &nodes, &edges);
            drop(held);
            match group {
                Ok(group) => return Ok(Some((group, snapshot.root.schema_version))),
                Err(ReadError::SnapshotTooOld { .. }) => {}
                Err(other) => return Err(other.into()),
            }
        }
    }
}

#[allow(
    clippy::disallowed_methods,
    reason = "groups of commits are a time of the host apart"
)]
fn now() -> Instant {
    Instant::now()
}
