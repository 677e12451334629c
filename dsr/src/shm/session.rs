//! A process's membership in an instance: reads the graph in place, asks the store for changes,
//! follows commits and the clock, opens channels. It guarantees that whatever became of the store,
//! a snapshot is of the newest graph that this process can see, and that a restarted store is
//! found again without the caller's doing.

mod clock;
mod commit;
mod desk;
mod hot;
mod large;
mod look;

pub use clock::{ClockError, Tick};
pub use commit::CommitError;
pub(super) use commit::{ANSWERS, Request, requests};
pub(super) use desk::DESKS;

use commit::{Client, SPIN};
use desk::Desk;

use super::arena::ArenaSubscriber;
use super::changes::Changes;
use super::hot::HotSubscriber;
use super::large::{OwnStreams, Readers};
use super::lease::Tenant;
use super::page::OwnPage;
use super::{
    Instance, InstanceError, Ipc, IpcNode, MAX_PROCESSES, Publisher, Subscriber, ipc, now,
    one_at_a_time, pause, port, service_name,
};
use crate::arena::{Arena, Root, record};
use crate::{Epoch, Filter, ReadError, Schema, Snapshot};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::service::port_factory::event as event_factory;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use thiserror::Error;

pub(super) const CHANGES: &str = "graph/changes";
pub(super) const REQUESTS_EVENT: &str = "graph/wake";

/// How long a session may go on without a look for memory that it does not have: asking iceoryx2 takes
/// longer than all else of a snapshot. Whoever brings such memory waits for so long before it is
/// relied on, so that a look that begins afterwards finds it.
pub(super) const NEWS: Duration = Duration::from_micros(50);

/// How long a store may take to answer before the asker gives up.
const PATIENCE: Duration = Duration::from_secs(5);
/// How often a session looks whether there is a store.
const LOOK: Duration = Duration::from_millis(5);

pub(super) fn event(
    node: &IpcNode,
    name: &str,
) -> Result<event_factory::PortFactory<Ipc>, InstanceError> {
    let builder = node
        .service_builder(&service_name(name)?)
        .event()
        .max_listeners(MAX_PROCESSES)
        .max_notifiers(MAX_PROCESSES)
        .max_nodes(MAX_PROCESSES);
    one_at_a_time(node, || builder.clone().open_or_create())
        .map_err(|e| ipc(&format!("event `{name}`"), e))
}

/// Why a process cannot see the graph.
#[derive(Debug, Error)]
pub enum AttachError {
    /// The instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// No store has shown itself.
    #[error(
        "instance `{instance}` has no store, or one that is stopped; start it with `cortex run`, or name another with --instance"
    )]
    NoStore {
        /// The instance's name.
        instance: String,
    },
    /// The graph's memory cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
}

/// A process's membership in an instance.
#[derive(Debug)]
pub struct Session {
    instance: Instance,
    agent: String,
    arena: ArenaSubscriber,
    schema: Option<(Epoch, u64, Arc<Schema>)>,
    /// For requests by message, once there was one.
    client: Option<Client>,
    wake_store: Notifier<Ipc>,
    clock: Option<(Listener<Ipc>, Subscriber<Tick>)>,
    /// When it last looked for memory that it does not have: of another store, of owners of hot
    /// attributes.
    looked: Option<Instant>,
    /// The root that was read last, and of which store's life it is.
    root: Option<(Epoch, Root)>,
    /// The pages of hot attributes, once the schema has some.
    hot: Option<HotSubscriber>,
    /// This session's own.
    page: Option<Arc<OwnPage>>,
    /// The streams of large values, of its own and of others.
    own_streams: OwnStreams,
    readers: Readers,
    tenant: Option<Arc<Tenant>>,
    /// Where this session's requests lie, once there was one.
    desk: Option<Desk>,
    /// An epoch, and the first life of the store that its graph goes back to.
    lineage: Option<(Epoch, u64)>,
    id: u64,
    sequence: u64,
    spin: Duration,
    /// Where requests are put together; empty between uses.
    scratch: Vec<u8>,
    // Dropped last: the ports above belong to it.
    node: IpcNode,
}

impl Session {
    /// Joins an instance as `agent`. The store may come later: see [`Self::wait_for_store`].
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn join(instance: &Instance, agent: &str) -> Result<Self, InstanceError> {
        instance.create_folder()?;
        let node = instance.join()?;
        let arena = ArenaSubscriber::open(&node)?;
        let bell = event(&node, REQUESTS_EVENT)?;
        let wake_store = port(&node, || bell.notifier_builder().create())
            .map_err(|e| ipc("the store's bell", e))?;
        let session = Self {
            instance: instance.clone(),
            agent: agent.to_owned(),
            arena,
            schema: None,
            client: None,
            wake_store,
            clock: None,
            looked: None,
            root: None,
            hot: None,
            page: None,
            own_streams: OwnStreams::default(),
            readers: Readers::default(),
            tenant: None,
            desk: None,
            lineage: None,
            id: unique_number(),
            sequence: 0,
            spin: SPIN,
            scratch: Vec::new(),
            node,
        };
        ring(&session.wake_store);
        Ok(session)
    }

    /// Joins an instance and waits up to `patience` for its graph, also where it takes the store that long
    /// to remove what stands in the way of joining.
    ///
    /// # Errors
    /// [`AttachError`].
    pub fn attach(
        instance: &Instance,
        agent: &str,
        patience: Duration,
    ) -> Result<Self, AttachError> {
        let deadline = now() + patience;
        let mut session = loop {
            match Self::join(instance, agent) {
                Err(InstanceError::Ipc(error)) if now() < deadline => {
                    tracing::debug!("joining `{}`: {error}", instance.name());
                    pause(LOOK);
                }
                joined => break joined?,
            }
        };
        session.wait_for_store(deadline.saturating_duration_since(now()))?;
        Ok(session)
    }

    /// Waits up to `patience` until the graph can be read.
    ///
    /// # Errors
    /// [`AttachError::NoStore`].
    pub fn wait_for_store(&mut self, patience: Duration) -> Result<(), AttachError> {
        let deadline = now() + patience;
        while self.arena()?.is_none() {
            let left = deadline.saturating_duration_since(now());
            if left.is_zero() {
                return Err(self.no_store());
            }
            ring(&self.wake_store);
            pause(left.min(LOOK));
        }
        Ok(())
    }

    /// How long [`Self::commit`] looks for the answer of a store that is awake before it sleeps:
    /// longer is faster where there are processors to spare, zero burns nothing.
    pub fn set_spin(&mut self, spin: Duration) {
        self.spin = spin;
    }

    /// The name that this process goes by.
    pub fn agent(&self) -> &str {
        &self.agent
    }

    /// The instance.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    fn arena(&mut self) -> Result<Option<(Epoch, Arc<Arena>)>, InstanceError> {
        self.look()?;
        Ok(self.arena.newest().cloned())
    }

    /// Looks for memory that has come, unless it just did.
    fn look(&mut self) -> Result<(), InstanceError> {
        // Before the look: what comes during it may go unseen.
        let time = now();
        let looked = self.looked.filter(|_| self.arena.newest().is_some());
        if looked.is_none_or(|looked| time.saturating_duration_since(looked) >= NEWS) {
            self.arena.poll()?;
            if let Some(hot) = &mut self.hot {
                hot.poll(self.arena.newest().map(|(_, arena)| arena.as_ref()))?;
            }
            self.looked = Some(time);
        }
        Ok(())
    }

    /// The life of the store whose graph this process sees.
    ///
    /// # Errors
    /// [`AttachError::NoStore`].
    pub fn epoch(&mut self) -> Result<Epoch, AttachError> {
        self.newest_epoch()?.ok_or_else(|| self.no_store())
    }

    /// The life of the newest store that a look finds.
    fn newest_epoch(&mut self) -> Result<Option<Epoch>, InstanceError> {
        self.look()?;
        Ok(self.arena.newest().map(|(epoch, _)| *epoch))
    }

    fn no_store(&self) -> AttachError {
        AttachError::NoStore {
            instance: self.instance.name().to_owned(),
        }
    }

    /// The newest version of the graph.
    ///
    /// # Errors
    /// [`AttachError`].
    pub fn snapshot(&mut self) -> Result<Snapshot, AttachError> {
        self.own_streams.serve_newcomers();
        let (epoch, arena) = match self.arena()? {
            Some(found) => found,
            None => {
                self.wait_for_store(PATIENCE)?;
                self.arena()?.ok_or_else(|| self.no_store())?
            }
        };
        loop {
            let root = match self.root {
                Some((of, root)) if of == epoch && root.version == arena.head() => root,
                _ => arena.newest_root()?,
            };
            self.root = Some((epoch, root));
            // A version made since the last look may lie in a segment that has come since.
            if arena.announced_segments() > arena.attached() as u64 {
                self.arena.poll()?;
                continue;
            }
            let known = self
                .schema
                .as_ref()
                .filter(|(e, v, _)| (*e, *v) == (epoch, root.schema_version));
            let schema = match known {
                Some((_, _, schema)) => Arc::clone(schema),
                None => {
                    let bytes = record::read_blob(&arena, root.schema);
                    match arena.check(root.version, None) {
                        // Overtaken while reading; the newest version is another by now.
                        Err(ReadError::SnapshotTooOld { .. }) => continue,
                        other => other?,
                    }
                    let damaged = ReadError::Damaged {
                        address: root.schema,
                    };
                    let bytes = bytes.map_err(|_| damaged)?;
                    let schema: Schema = postcard::from_bytes(&bytes).map_err(|_| damaged)?;
                    let schema = Arc::new(schema);
                    self.schema = Some((epoch, root.schema_version, Arc::clone(&schema)));
                    schema
                }
            };
            let hot = self.hot_of((epoch, &arena), &schema)?;
            return Ok(Snapshot::new(arena, root, schema).with_hot(hot));
        }
    }

    /// The first life of the store of that epoch.
    fn lineage(&mut self, epoch: Epoch, arena: &Arena) -> Result<u64, AttachError> {
        match self.lineage {
            Some((known, lineage)) if known == epoch => Ok(lineage),
            _ => {
                let lineage = arena.newest_root()?.lineage;
                self.lineage = Some((epoch, lineage));
                Ok(lineage)
            }
        }
    }

    /// Follows the commits that pass `filter`, from now on.
    ///
    /// # Errors
    /// [`AttachError`].
    pub fn changes(&mut self, filter: Filter) -> Result<Changes, AttachError> {
        let subscriber = Subscriber::open(&self.node, CHANGES)?;
        let snapshot = self.snapshot()?;
        Ok(Changes {
            subscriber,
            waiting: VecDeque::new(),
            current: self.arena.current.clone(),
            filter,
            epoch: snapshot.epoch(),
            lineage: Some(snapshot.root.lineage),
            seen: snapshot.version(),
            past: Vec::new(),
        })
    }

    /// Opens the sending end of a channel.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn publisher<T: Serialize>(&self, channel: &str) -> Result<Publisher<T>, InstanceError> {
        Publisher::open(&self.node, &format!("channel/{channel}"))
    }

    /// Opens the receiving end of a channel.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn subscriber<T: DeserializeOwned>(
        &self,
        channel: &str,
    ) -> Result<Subscriber<T>, InstanceError> {
        Subscriber::open(&self.node, &format!("channel/{channel}"))
    }
}

/// Wakes the store, if there is one.
fn ring(store: &Notifier<Ipc>) {
    if let Err(error) = store.notify() {
        tracing::debug!("waking the store: {error}");
    }
}

/// A number that no other session or stream has: the process and the time.
#[allow(
    clippy::disallowed_methods,
    reason = "tells sessions apart; nothing is computed from it"
)]
fn unique_number() -> u64 {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    (since.as_nanos() as u64).rotate_left(24) ^ u64::from(std::process::id())
}
