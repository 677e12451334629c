//! The store's process: takes requests, lets the graph's single writer decide, answers, and tells
//! everybody what changed. It guarantees that a request that was answered is not applied again.

use super::arena::ArenaPublisher;
use super::session::{CHANGES, COMMITS_EVENT, REQUESTS_EVENT, Request, event, requests};
use super::{Instance, InstanceError, Ipc, IpcNode, Publisher, ipc, wait};
use crate::arena::allocator::Full;
use crate::graph::Image;
use crate::state::Keeper;
use crate::{
    Change, Commit, Durability, Epoch, Graph, Refusal, Schema, State, StateError, Time, Transaction,
};
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy};
use std::collections::BTreeMap;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use thiserror::Error;

/// Why a store cannot start or go on.
#[derive(Debug, Error)]
pub enum StoreError {
    /// The instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// There is no room in shared memory for the smallest graph.
    #[error("no room in /dev/shm for a graph; free some memory or mount it larger")]
    OutOfMemory,
    /// The graph refused what it should start with.
    #[error("the initial graph was refused: {0}")]
    Refused(#[from] Refusal),
    /// The state folder cannot be used.
    #[error(transparent)]
    State(#[from] StateError),
    /// The operating system gave no thread.
    #[error("the state cannot be kept: {0}")]
    Thread(std::io::Error),
}

/// An answer as it was given.
type Answer = Result<Commit, Refusal>;
/// A request that awaits its answer.
type Asker = ActiveRequest<Ipc, [u8], (), [u8], ()>;

/// The store of an instance: one process holds it, and it alone writes the graph.
#[derive(Debug)]
pub struct Store {
    graph: Graph,
    arena: ArenaPublisher,
    server: Server<Ipc, [u8], (), [u8], ()>,
    wake: Listener<Ipc>,
    commits: Notifier<Ipc>,
    changes: Publisher<Change>,
    /// The last request of each client, with its answer.
    answered: BTreeMap<u64, (u64, Answer)>,
    last_time: Time,
    keeper: Option<Keeper>,
    durability: Durability,
    /// Who is to be told of a commit once it is on disk.
    waiting: Vec<(Asker, Commit)>,
    // Dropped last: the ports above belong to it.
    node: IpcNode,
}

impl Store {
    /// Opens the store of an instance with an empty graph.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn open(instance: &Instance, schema: Schema) -> Result<Self, StoreError> {
        instance.create_folder()?;
        let node = instance.join()?;
        // A store that was killed has left its ports behind, which count.
        node.try_cleanup_dead_nodes();
        let arena = ArenaPublisher::open(&node)?;
        let epoch = new_epoch();
        let (memory, growth) = arena.arena(epoch);
        let graph =
            Graph::on(memory, growth, schema, epoch).map_err(|Full| StoreError::OutOfMemory)?;
        let server = requests(&node)?
            .server_builder()
            .initial_max_slice_len(1024)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| ipc("the store's server", e))?;
        let wake = event(&node, REQUESTS_EVENT)?
            .listener_builder()
            .create()
            .map_err(|e| ipc("the store's listener", e))?;
        let commits = event(&node, COMMITS_EVENT)?
            .notifier_builder()
            .create()
            .map_err(|e| ipc("the store's notifier", e))?;
        let changes = Publisher::open(&node, CHANGES)?;
        let answered = BTreeMap::new();
        let last_time = Time::default();
        Ok(Self {
            graph,
            arena,
            server,
            wake,
            commits,
            changes,
            answered,
            last_time,
            keeper: None,
            durability: Durability::InMemory,
            waiting: Vec::new(),
            node,
        })
    }

    /// Fills the empty graph with what another store's memory held; versions go on from there.
    ///
    /// # Errors
    /// [`StoreError::Refused`].
    pub fn restore(&mut self, image: &Image) -> Result<(), StoreError> {
        self.graph.restore(image)?;
        self.last_time = self.graph.snapshot().time();
        Ok(())
    }

    /// From now on keeps the graph in a state folder, which first becomes what the graph is now.
    ///
    /// A commit that asks for it, or every one where `durability` is [`Durability::OnDisk`] and
    /// it does not ask for less, is acknowledged once it is on disk. The others get there within
    /// about `interval`.
    ///
    /// # Errors
    /// [`StoreError::State`] where the folder cannot be written to, or holds a newer version.
    pub fn keep(
        &mut self,
        mut state: State,
        interval: Duration,
        durability: Durability,
    ) -> Result<(), StoreError> {
        let snapshot = self.graph.snapshot();
        state.replace(&Image::of(&snapshot).map_err(StateError::from)?)?;
        let bell = event(&self.node, REQUESTS_EVENT)?
            .notifier_builder()
            .create()
            .map_err(|e| ipc("the state's bell", e))?;
        let bell = move || {
            if let Err(error) = bell.notify() {
                tracing::debug!("waking the store: {error}");
            }
        };
        let keeper = Keeper::start(state, &snapshot, interval, Box::new(bell));
        self.keeper = Some(keeper.map_err(StoreError::Thread)?);
        self.durability = durability;
        Ok(())
    }

    /// The graph's writer, for what the store's own process does before it serves.
    pub fn graph_mut(&mut self) -> &mut Graph {
        &mut self.graph
    }

    /// Commits in the store's own name.
    ///
    /// # Errors
    /// [`Refusal`].
    pub fn commit(&mut self, transaction: &Transaction, time: Time) -> Result<Commit, Refusal> {
        self.decide(transaction, "store", time)
    }

    fn decide(&mut self, transaction: &Transaction, agent: &str, time: Time) -> Answer {
        // Agents at the edge of a tick may be a tick apart; the graph's time does not run back.
        self.last_time = self.last_time.max(time);
        let durable = self.durability_of(transaction);
        if durable {
            self.can_keep()?;
        }
        let (commit, change) = self.graph.commit(transaction, agent, self.last_time)?;
        if let Err(error) = self.changes.send(&change) {
            // The commit stands; who listens sees the gap and reads the snapshot.
            tracing::warn!("change {} was not sent: {error}", commit.version);
        }
        if let Some(keeper) = &self.keeper {
            keeper.note(&change, self.graph.snapshot(), durable);
        }
        Ok(commit)
    }

    /// Whether the commit is to be acknowledged only once it is on disk.
    fn durability_of(&self, transaction: &Transaction) -> bool {
        let asked = match transaction.durability {
            Durability::AsTheStore => self.durability,
            other => other,
        };
        asked == Durability::OnDisk
    }

    fn can_keep(&self) -> Result<(), Refusal> {
        let refused = |reason: &str| Err(Refusal::NotDurable(reason.to_owned()));
        match &self.keeper {
            None => refused("the store keeps no state; start it with --state"),
            Some(keeper) => keeper.failure().map_or(Ok(()), refused),
        }
    }

    /// Tells those who waited for it that their commit is on disk, or that it will not be.
    fn answer_waiting(&mut self) -> Result<usize, InstanceError> {
        let Some(keeper) = &self.keeper else {
            return Ok(0);
        };
        // Looked at before what is durable: what was written before a failure counts.
        let failed = keeper.failure().is_some();
        let durable = keeper.durable();
        let before = self.waiting.len();
        let (told, waiting) = std::mem::take(&mut self.waiting)
            .into_iter()
            .partition(|(_, commit)| failed || commit.version <= durable);
        self.waiting = waiting;
        for (asker, mut commit) in told {
            commit.durable = commit.version <= durable;
            reply(&asker, &Ok(commit))?;
        }
        Ok(before - self.waiting.len())
    }

    /// Answers every request that has come, waiting up to `patience` for the first. How many.
    ///
    /// # Errors
    /// [`StoreError::Instance`] where the instance's shared memory is gone.
    pub fn serve(&mut self, patience: Duration) -> Result<usize, StoreError> {
        self.graph.announce();
        wait(&self.wake, patience, "waiting for requests")?;
        self.arena.serve_newcomers();
        let mut served = self.answer_waiting()?;
        while let Some(active) = self
            .server
            .receive()
            .map_err(|e| ipc("receiving a request", e))?
        {
            served += 1;
            let request = match postcard::from_bytes::<Request>(active.payload()) {
                Ok(request) => request,
                Err(error) => {
                    reply(&active, &Err(Refusal::Malformed(error.to_string())))?;
                    continue;
                }
            };
            let answer = match self.answered.get(&request.client) {
                Some((last, answer)) if *last == request.sequence => answer.clone(),
                _ => {
                    let answer = self.decide(&request.transaction, &request.agent, request.time);
                    let entry = (request.sequence, answer.clone());
                    self.answered.insert(request.client, entry);
                    answer
                }
            };
            match answer {
                Ok(commit) if self.durability_of(&request.transaction) => {
                    self.waiting.push((active, commit));
                }
                answer => reply(&active, &answer)?,
            }
        }
        if served > 0
            && let Err(error) = self.commits.notify()
        {
            tracing::debug!("waking the agents: {error}");
        }
        Ok(served)
    }

    /// Removes what processes that died left in the instance.
    pub fn clean_up_after_the_dead(&self) {
        let state = self.node.try_cleanup_dead_nodes();
        if state.cleanups + state.failed_cleanups > 0 {
            tracing::info!(
                "dead processes: {} cleaned, {} not",
                state.cleanups,
                state.failed_cleanups
            );
        }
    }
}

/// Answers a request.
fn reply(asker: &Asker, answer: &Answer) -> Result<(), InstanceError> {
    let bytes = postcard::to_stdvec(answer).map_err(|e| ipc("encoding an answer", e))?;
    match asker.loan_slice_uninit(bytes.len()) {
        // A client that went away meanwhile does not hear; that is its affair.
        Ok(response) => drop(response.write_from_slice(&bytes).send()),
        Err(error) => tracing::warn!("an answer was not sent: {error}"),
    }
    Ok(())
}

/// A number that no other store of this instance had: the time of day, in nanoseconds.
#[allow(
    clippy::disallowed_methods,
    reason = "the store's process owns the clock"
)]
fn new_epoch() -> Epoch {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    Epoch(since.as_nanos() as u64)
}
