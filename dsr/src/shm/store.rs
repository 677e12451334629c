//! The store's process: takes requests, lets the graph's single writer decide, answers, and tells
//! everybody what changed. It guarantees that a request that was answered is not applied again.

mod answer;
mod desks;
mod durable;
mod news;

pub use durable::Orphaned;

use super::arena::ArenaPublisher;
use super::gate::{self, Gate};
use super::lease::Landlord;
use super::leftovers::Cleaner;
use super::orphan::{self, Orphan, OrphanError};
use super::presence::Names;
use super::session::{ANSWERS, CHANGES, NEWS, REQUESTS_EVENT, Request, event, requests};
use super::{Instance, InstanceError, Ipc, IpcNode, Publisher, bell, ipc, now, pause, wait};
use crate::arena::allocator::Full;
use crate::graph::{Image, STORE};
use crate::state::Keeper;
use crate::{
    Change, Commit, Durability, Epoch, Graph, Refusal, Schema, StateError, Time, Transaction,
    TransactionId, Version,
};
use answer::{Answered, reply};
use desks::Desks;
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy};
use news::News;
use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::fs::OpenOptionsExt;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
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
    /// The instance has a store.
    #[error("instance `{instance}` has a store already; end it, or use another instance")]
    InUse {
        /// The instance's name.
        instance: String,
    },
    /// What a killed store left in memory and what is in the state folder went different ways.
    #[error(
        "a killed store left version {version} of a graph in memory, and the state folder has another graph"
    )]
    Diverged {
        /// The version in memory.
        version: Version,
    },
    /// What a killed store left cannot be read.
    #[error(transparent)]
    Orphan(#[from] OrphanError),
    /// The operating system gave no thread.
    #[error("what dead processes leave cannot be removed: {0}")]
    Cleaner(std::io::Error),
}

/// What became of a transaction.
type Answer = Result<Commit, Refusal>;
/// A request that awaits its answer.
type Asker = ActiveRequest<Ipc, [u8], (), [u8], ()>;

/// Who is to be told once version `last` is on disk.
#[derive(Debug)]
struct Waiting {
    request: Asker,
    client: u64,
    sequence: u64,
    last: Version,
}

/// How long the store looks for the next request before it sleeps, unless told otherwise.
const SPIN: Duration = Duration::from_micros(50);
/// How often a store that does not come to sleep looks for processes that joined.
const NEWCOMERS: Duration = Duration::from_millis(1);
/// How many looks at desks go by between two at everything else, which takes a tenth of the time of all
/// of them: who asks by a desk does not wait for it.
const LOOKS: usize = 1024;
/// How often it looks at what is over: old versions, leases.
const LOOK: Duration = Duration::from_millis(10);

/// The store of an instance: one process holds it, and it alone writes the graph.
#[derive(Debug)]
pub struct Store {
    // Dropped first: no port of this store is dead yet.
    _cleaner: Cleaner,
    graph: Graph,
    arena: ArenaPublisher,
    server: Server<Ipc, [u8], (), [u8], ()>,
    wake: Listener<Ipc>,
    changes: Publisher<Vec<Change>>,
    /// Changes that were committed since the last was answered.
    unsent: Vec<Change>,
    /// The last request of each client. What was applied the graph itself knows too; this also
    /// knows what was refused.
    answered: BTreeMap<u64, Answered>,
    round: u64,
    names: Names,
    landlord: Landlord,
    desks: Desks,
    /// Looks at the desks since the last one at everything else.
    looks: usize,
    /// Whether anything was answered since then.
    is_busy: bool,
    news: News,
    began: Instant,
    next_look: Instant,
    /// Where answers are put together; empty between uses.
    scratch: Vec<u8>,
    last_time: Time,
    keeper: Option<Keeper>,
    durability: Durability,
    /// What it went on from in memory: a killed store's life, and its last version.
    from: Option<(Epoch, Version)>,
    /// Who is to be told of a commit once it is on disk.
    waiting: Vec<Waiting>,
    spin: Duration,
    /// Whether other processes can see the graph.
    announced: bool,
    /// Until when to look for the next request.
    awake_until: Instant,
    newcomers_at: Instant,
    // Dropped last: the ports above belong to it.
    node: IpcNode,
    /// That it is the instance's only store. The kernel gives it back where the process is killed.
    _lock: Gate,
}

/// Makes sure that an instance has one store. One that was just killed may take a moment to be gone.
fn lock_for_store(instance: &Instance) -> Result<Gate, StoreError> {
    let path = instance.folder().join("store.lock");
    let made = File::options()
        .create(true)
        .truncate(false)
        .write(true)
        .mode(0o600)
        .open(&path);
    let locked = made.and_then(|_| gate::lock(&path));
    let locked = locked.map_err(|source| InstanceError::Io { path, source })?;
    locked.ok_or_else(|| StoreError::InUse {
        instance: instance.name().to_owned(),
    })
}

impl Store {
    /// Opens the store of an instance with an empty graph.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn open(instance: &Instance, schema: Schema) -> Result<Self, StoreError> {
        instance.create_folder()?;
        let node = instance.join()?;
        // As a member: nobody removes the folder any more.
        let lock = lock_for_store(instance)?;
        // A store that was killed has left its ports behind, which count.
        let cleaner = Cleaner::start(&node).map_err(StoreError::Cleaner)?;
        let arena = ArenaPublisher::open(&node)?;
        let before = Orphan::find(node.config())?.map(|orphan| orphan.epoch());
        let epoch = new_epoch().max(before.map_or(Epoch(0), |before| Epoch(before.0 + 1)));
        let (memory, growth) = arena.arena(epoch);
        let graph =
            Graph::on(memory, growth, schema, epoch).map_err(|Full| StoreError::OutOfMemory)?;
        let server = requests(&node)?
            .server_builder()
            .initial_max_slice_len(answer::SMALL)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .override_response_preallocation(|worst| worst.min(ANSWERS))
            .create()
            .map_err(|e| ipc("the store's server", e))?;
        let wake = event(&node, REQUESTS_EVENT)?
            .listener_builder()
            .create()
            .map_err(|e| ipc("the store's listener", e))?;
        let changes = Publisher::open(&node, CHANGES)?;
        let began = now();
        let landlord = Landlord::open(&node, began)?;
        let desks = Desks::open(&node, began)?;
        let last_time = Time::default();
        Ok(Self {
            _cleaner: cleaner,
            graph,
            arena,
            server,
            wake,
            changes,
            unsent: Vec::new(),
            answered: BTreeMap::new(),
            round: 0,
            names: Names::default(),
            landlord,
            desks,
            looks: 0,
            is_busy: false,
            news: News::default(),
            began,
            next_look: began,
            scratch: Vec::new(),
            last_time,
            keeper: None,
            durability: Durability::InMemory,
            from: None,
            waiting: Vec::new(),
            spin: SPIN,
            announced: false,
            awake_until: now(),
            newcomers_at: now(),
            node,
            _lock: lock,
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

    /// The graph's writer, for what the store's own process does before it serves.
    pub fn graph_mut(&mut self) -> &mut Graph {
        &mut self.graph
    }

    /// Commits in the store's own name.
    ///
    /// # Errors
    /// [`Refusal`].
    pub fn commit(&mut self, transaction: &Transaction, time: Time) -> Result<Commit, Refusal> {
        let answer = self.decide(transaction, STORE, time, None);
        self.tell();
        self.ring_at_last();
        self.settle();
        answer
    }

    fn ring_after_look(&mut self) {
        if self.news.is_due_after_look() {
            bell::ring(self.graph.arena());
        }
    }

    fn ring_at_last(&mut self) {
        if self.news.is_due_at_last() {
            bell::ring(self.graph.arena());
        }
    }

    fn decide(
        &mut self,
        transaction: &Transaction,
        agent: &str,
        time: Time,
        id: Option<TransactionId>,
    ) -> Answer {
        // Agents at the edge of a tick may be a tick apart; the graph's time does not run back.
        self.last_time = self.last_time.max(time);
        let durable = self.durability_of(transaction);
        if durable {
            self.can_keep()?;
        }
        let commit = self
            .graph
            .commit_once(transaction, agent, self.last_time, id)?;
        let follow = self.changes.has_listeners();
        if follow || self.keeper.is_some() {
            let change = self.graph.last_change();
            if let Some(keeper) = &self.keeper {
                keeper.note(&change, self.graph.snapshot(), durable);
            }
            if follow {
                self.unsent.push(change);
            }
        }
        Ok(commit)
    }

    /// Sends what was committed to whoever follows.
    fn tell(&mut self) {
        if self.unsent.is_empty() || !self.changes.has_listeners() {
            return;
        }
        self.news.committed();
        if let Err(error) = self.changes.send(&self.unsent) {
            // The commits stand; who listens sees the gap and reads the snapshot.
            tracing::warn!("{} changes were not sent: {error}", self.unsent.len());
        }
    }

    /// Does what is left to do after commits were answered: nobody waits for it.
    fn settle(&mut self) {
        self.unsent.clear();
        self.graph.settle();
    }

    /// How long the store looks for the next request before it sleeps: longer answers bursts
    /// faster, zero burns nothing.
    pub fn set_spin(&mut self, spin: Duration) {
        self.spin = spin;
    }

    /// Answers every request that has come, waiting up to `patience` for the first. How many.
    ///
    /// After a request the store looks for the next one for a short while (see
    /// [`Self::set_spin`]); then it sleeps until somebody wakes it.
    ///
    /// # Errors
    /// [`StoreError::Instance`] where the instance's shared memory is gone.
    pub fn serve(&mut self, patience: Duration) -> Result<usize, StoreError> {
        if !self.announced {
            // What is acknowledged from now on every session sees: by then none goes on with the
            // memory of a store before this one.
            self.arena.serve_newcomers();
            pause(NEWS);
            self.graph.announce();
            self.announced = true;
            // This one has all that is worth having of it.
            orphan::forget(self.node.config(), self.graph.epoch());
        }
        loop {
            let mut served = self.answer_desks();
            self.looks += 1 + self.desks.count();
            // Who shall burn nothing does not look again and again.
            if self.looks >= LOOKS || self.spin.is_zero() {
                self.looks = 0;
                served += self.answer_all()?;
                let time = now();
                if time >= self.newcomers_at {
                    self.welcome(time)?;
                }
                if self.is_busy || served > 0 {
                    self.is_busy = false;
                    self.awake_until = time + self.spin;
                } else if time >= self.awake_until {
                    break;
                }
            }
            self.ring_after_look();
            if served > 0 {
                self.is_busy = true;
                return Ok(served);
            }
            std::hint::spin_loop();
        }
        self.ring_at_last();
        self.sleep(patience)?;
        self.welcome(now())?;
        let served = self.answer_desks() + self.answer_all()?;
        self.ring_after_look();
        self.is_busy = served > 0;
        Ok(served)
    }

    /// Sees to the processes that joined.
    fn welcome(&mut self, time: Instant) -> Result<(), StoreError> {
        self.newcomers_at = time + NEWCOMERS;
        self.arena.serve_newcomers();
        Ok(self.desks.adopt(self.graph.arena(), time)?)
    }

    /// Sleeps until somebody rings, for `patience` at the most.
    fn sleep(&mut self, patience: Duration) -> Result<(), StoreError> {
        let arena = self.graph.arena();
        // Who sends a request after this sees that it must ring; what was sent before is seen here.
        arena.set_asleep(true);
        let waiting = self.server.has_requests();
        let slept = match waiting.map(|waiting| waiting || self.desks.has_requests()) {
            Ok(false) => wait(&self.wake, patience, "waiting for requests"),
            Ok(true) => Ok(()),
            Err(error) => Err(ipc("looking for requests", error)),
        };
        arena.set_asleep(false);
        Ok(slept?)
    }

    /// Answers every request that is there.
    fn answer_all(&mut self) -> Result<usize, StoreError> {
        let mut served = self.answer_waiting()?;
        let time = now();
        if time >= self.next_look {
            self.next_look = time + LOOK;
            self.graph
                .set_clock(time.saturating_duration_since(self.began));
        }
        served += self.landlord.serve(&mut self.graph, time)?;
        while let Some(active) = self
            .server
            .receive()
            .map_err(|e| ipc("receiving a request", e))?
        {
            served += 1;
            let request = match postcard::from_bytes::<Request>(active.payload()) {
                Ok(request) => request,
                Err(error) => {
                    let refusal = [Answer::Err(Refusal::Malformed(error.to_string()))];
                    reply(&active, &refusal, &mut self.scratch)?;
                    continue;
                }
            };
            if !self.is_answered(&request) {
                continue;
            }
            let Some(answered) = self.answered.get(&request.client) else {
                continue;
            };
            let durable = request
                .transactions
                .iter()
                .any(|transaction| self.durability_of(transaction));
            let last = answered
                .answers
                .iter()
                .flatten()
                .map(|commit| commit.version);
            match last.max().filter(|_| durable) {
                Some(last) => self.waiting.push(Waiting {
                    request: active,
                    client: request.client,
                    sequence: request.sequence,
                    last,
                }),
                None => reply(&active, &answered.answers, &mut self.scratch)?,
            }
            self.settle();
        }
        if served > 0 {
            self.news.answered();
        }
        Ok(served)
    }
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
