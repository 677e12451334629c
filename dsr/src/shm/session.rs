//! A process's membership in an instance: reads the graph in place, asks the store for changes,
//! follows commits and the clock, opens channels. It guarantees that whatever became of the store,
//! a snapshot is of the newest graph that this process can see, and that a restarted store is
//! found again without the caller's doing.

use super::arena::ArenaSubscriber;
use super::changes::Changes;
use super::{
    Instance, InstanceError, Ipc, IpcNode, MAX_PROCESSES, Publisher, Subscriber, ipc,
    one_at_a_time, service_name, wait,
};
use crate::arena::Arena;
use crate::arena::record;
use crate::{
    Commit, Durability, Epoch, Filter, ReadError, Refusal, Schema, Snapshot, Time, Transaction,
    Version,
};
use iceoryx2::port::client::Client;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy};
use iceoryx2::service::port_factory::{event as event_factory, request_response};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use thiserror::Error;

pub(super) const CHANGES: &str = "graph/changes";
pub(super) const COMMITS_EVENT: &str = "graph/commits";
pub(super) const REQUESTS_EVENT: &str = "graph/wake";
const REQUESTS: &str = "graph/requests";
const CLOCK: &str = "clock";
const CLOCK_EVENT: &str = "clock/tick";

/// How long a store may take to answer before the asker gives up.
const PATIENCE: Duration = Duration::from_secs(5);
/// How often an asker looks whether its request has to be sent again.
const RETRY: Duration = Duration::from_millis(250);

/// A transaction on its way to the store.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Request {
    /// Which session asks.
    pub(super) client: u64,
    /// The how-manyeth request of it: a repeated number is a repeated request.
    pub(super) sequence: u64,
    pub(super) agent: String,
    pub(super) time: Time,
    pub(super) transaction: Transaction,
}

/// Requests and answers are bytes: see [`Request`].
type RequestFactory = request_response::PortFactory<Ipc, [u8], (), [u8], ()>;

pub(super) fn requests(node: &IpcNode) -> Result<RequestFactory, InstanceError> {
    let builder = node
        .service_builder(&service_name(REQUESTS)?)
        .request_response::<[u8], [u8]>()
        .max_servers(2)
        .max_clients(MAX_PROCESSES)
        .max_nodes(MAX_PROCESSES)
        .max_active_requests_per_client(4);
    one_at_a_time(node, || builder.open_or_create()).map_err(|e| ipc("the store's requests", e))
}

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
    one_at_a_time(node, || builder.open_or_create()).map_err(|e| ipc(&format!("event `{name}`"), e))
}

/// Why a process cannot see the graph.
#[derive(Debug, Error)]
pub enum AttachError {
    /// The instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// No store has shown itself.
    #[error(
        "instance `{instance}` has no store; start it with `cortex run`, or name another with --instance"
    )]
    NoStore {
        /// The instance's name.
        instance: String,
    },
    /// The graph's memory cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
}

/// Why a commit did not come about, or may not have.
#[derive(Debug, Error)]
pub enum CommitError {
    /// The store said no: nothing was changed.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// No store answered in time; whether the transaction was applied is in the next snapshot.
    #[error("the store did not answer within {} s", PATIENCE.as_secs())]
    NoAnswer,
    /// The transaction was applied, and everybody sees it, but the store could not bring it to the
    /// disk.
    #[error("version {version} was committed, but could not be written to disk")]
    NotDurable {
        /// The version that it made.
        version: Version,
    },
    /// The store was restarted meanwhile; whether the transaction was applied is in the next
    /// snapshot.
    #[error("the store was restarted before it answered")]
    StoreRestarted,
    /// The instance cannot be used.
    #[error(transparent)]
    Attach(#[from] AttachError),
}

impl From<InstanceError> for CommitError {
    fn from(error: InstanceError) -> Self {
        Self::Attach(error.into())
    }
}

/// Why there is no tick.
#[derive(Debug, Error)]
pub enum ClockError {
    /// The instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
}

/// A step of the world's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tick {
    /// How many came before it.
    pub index: u64,
    /// The world's time.
    pub time: Time,
}

/// A process's membership in an instance.
#[derive(Debug)]
pub struct Session {
    instance: Instance,
    agent: String,
    arena: ArenaSubscriber,
    schema: Option<(Epoch, u64, Arc<Schema>)>,
    client: Client<Ipc, [u8], (), [u8], ()>,
    wake_store: Notifier<Ipc>,
    answers: Listener<Ipc>,
    clock: Option<(Listener<Ipc>, Subscriber<Tick>)>,
    id: u64,
    sequence: u64,
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
        let client = requests(&node)?
            .client_builder()
            .initial_max_slice_len(4096)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| ipc("the store's client", e))?;
        let wake_store = event(&node, REQUESTS_EVENT)?
            .notifier_builder()
            .create()
            .map_err(|e| ipc("the store's bell", e))?;
        let answers = event(&node, COMMITS_EVENT)?
            .listener_builder()
            .create()
            .map_err(|e| ipc("the listener for commits", e))?;
        let session = Self {
            instance: instance.clone(),
            agent: agent.to_owned(),
            arena,
            schema: None,
            client,
            wake_store,
            answers,
            clock: None,
            id: new_session_id(),
            sequence: 0,
            node,
        };
        session.ring();
        Ok(session)
    }

    /// Wakes the store, if there is one.
    fn ring(&self) {
        if let Err(error) = self.wake_store.notify() {
            tracing::debug!("waking the store: {error}");
        }
    }

    /// Joins an instance and waits up to `patience` for its graph.
    ///
    /// # Errors
    /// [`AttachError`].
    pub fn attach(
        instance: &Instance,
        agent: &str,
        patience: Duration,
    ) -> Result<Self, AttachError> {
        let mut session = Self::join(instance, agent)?;
        session.wait_for_store(patience)?;
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
            self.ring();
            let nap = left.min(Duration::from_millis(5));
            wait(&self.answers, nap, "waiting for the store")?;
        }
        Ok(())
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
        let found = self.arena.poll()?;
        Ok(found.filter(|(epoch, arena)| {
            // Segments arrive in order; the snapshot waits for the last.
            arena.epoch() == Some(*epoch)
        }))
    }

    /// The life of the store whose graph this process sees.
    ///
    /// # Errors
    /// [`AttachError::NoStore`].
    pub fn epoch(&mut self) -> Result<Epoch, AttachError> {
        let found = self.arena()?;
        found.map(|(epoch, _)| epoch).ok_or_else(|| self.no_store())
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
        let (epoch, arena) = match self.arena()? {
            Some(found) => found,
            None => {
                self.wait_for_store(PATIENCE)?;
                self.arena()?.ok_or_else(|| self.no_store())?
            }
        };
        loop {
            let root = arena.newest_root()?;
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
                    match arena.check(root.version) {
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
            return Ok(Snapshot::new(Arc::clone(&arena), root, schema));
        }
    }

    /// Asks the store for a change and waits for its answer. A request that got lost is sent
    /// again; the store applies it once.
    ///
    /// # Errors
    /// [`CommitError`].
    pub fn commit(&mut self, transaction: &Transaction, time: Time) -> Result<Commit, CommitError> {
        let epoch = self.epoch()?;
        self.sequence += 1;
        let request = Request {
            client: self.id,
            sequence: self.sequence,
            agent: self.agent.clone(),
            time,
            transaction: transaction.clone(),
        };
        let bytes = postcard::to_stdvec(&request).map_err(|e| ipc("encoding a request", e))?;
        let deadline = now() + PATIENCE;
        while now() < deadline {
            let loan = self.client.loan_slice_uninit(bytes.len());
            let loan = loan.map_err(|e| ipc("sending a request", e))?;
            let pending = loan.write_from_slice(&bytes).send();
            let pending = pending.map_err(|e| ipc("sending a request", e))?;
            self.ring();
            let retry = now() + RETRY;
            loop {
                if let Some(answer) = pending
                    .receive()
                    .map_err(|e| ipc("the store's answer", e))?
                {
                    let answer: Result<Commit, Refusal> = postcard::from_bytes(answer.payload())
                        .map_err(|e| ipc("the store's answer", e))?;
                    let commit = answer?;
                    if transaction.durability == Durability::OnDisk && !commit.durable {
                        let version = commit.version;
                        return Err(CommitError::NotDurable { version });
                    }
                    return Ok(commit);
                }
                let left = retry.saturating_duration_since(now());
                if left.is_zero() {
                    break;
                }
                wait(&self.answers, left, "waiting for an answer")?;
            }
            if self.epoch()? != epoch {
                return Err(CommitError::StoreRestarted);
            }
        }
        Err(CommitError::NoAnswer)
    }

    /// As [`Self::commit`], for agents that decide anew from the next snapshot: does nothing for an
    /// empty transaction, logs a refusal or a lost store, and goes on.
    ///
    /// # Errors
    /// [`AttachError`] where there is nothing to go on with.
    pub fn submit(
        &mut self,
        transaction: &Transaction,
        time: Time,
    ) -> Result<Option<Commit>, AttachError> {
        if transaction.is_empty() {
            return Ok(None);
        }
        match self.commit(transaction, time) {
            Ok(commit) => Ok(Some(commit)),
            Err(CommitError::Attach(error @ AttachError::Instance(_))) => Err(error),
            Err(error) => {
                tracing::warn!(%time, "{error}");
                Ok(None)
            }
        }
    }

    /// Follows the commits that pass `filter`, from now on.
    ///
    /// # Errors
    /// [`AttachError`].
    pub fn changes(&mut self, filter: Filter) -> Result<Changes, AttachError> {
        let subscriber = Subscriber::open(&self.node, CHANGES)?;
        let listener = event(&self.node, COMMITS_EVENT)?
            .listener_builder()
            .create()
            .map_err(|e| ipc("the listener for commits", e))?;
        let epoch = self.epoch()?;
        let seen = self.snapshot()?.version();
        Ok(Changes {
            subscriber,
            listener,
            filter,
            epoch,
            seen,
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

    /// The world's end of the clock: sends ticks and wakes those who wait for them.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn clock(
        &self,
    ) -> Result<impl Fn(Tick) -> Result<(), InstanceError> + use<>, InstanceError> {
        let publisher = Publisher::<Tick>::open(&self.node, CLOCK)?;
        let notifier = event(&self.node, CLOCK_EVENT)?
            .notifier_builder()
            .create()
            .map_err(|e| ipc("the clock", e))?;
        Ok(move |tick| {
            publisher.send(&tick)?;
            notifier
                .notify()
                .map_err(|e| ipc("the clock", e))
                .map(|_| ())
        })
    }

    /// The newest tick since the last call, waiting up to `patience` for one.
    ///
    /// # Errors
    /// [`ClockError`].
    pub fn wait_for_tick(&mut self, patience: Duration) -> Result<Option<Tick>, ClockError> {
        if self.clock.is_none() {
            let listener = event(&self.node, CLOCK_EVENT)?
                .listener_builder()
                .create()
                .map_err(|e| ipc("the clock", e))?;
            self.clock = Some((listener, Subscriber::open(&self.node, CLOCK)?));
        }
        let Some((listener, ticks)) = &mut self.clock else {
            return Ok(None);
        };
        if let Some(tick) = ticks.newest()? {
            return Ok(Some(tick));
        }
        wait(listener, patience, "waiting for a tick")?;
        Ok(ticks.newest()?)
    }
}

#[allow(
    clippy::disallowed_methods,
    reason = "waiting for another process takes the host's clock"
)]
fn now() -> Instant {
    Instant::now()
}

/// A number that no other session has: the process and the time.
#[allow(
    clippy::disallowed_methods,
    reason = "tells sessions apart; nothing is computed from it"
)]
fn new_session_id() -> u64 {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    (since.as_nanos() as u64).rotate_left(24) ^ u64::from(std::process::id())
}
