//! How a session asks the store for changes: the requests, their way there and back, and what can
//! come of them. It guarantees that a request which got lost is sent again, and applied once.

use super::super::{
    InstanceError, Ipc, IpcNode, MAX_PROCESSES, ROOM, bell, ipc, now, one_at_a_time, port,
    room_for, service_name,
};
use super::{AttachError, PATIENCE, Session, ring};
use crate::arena::Arena;
use crate::{Commit, Durability, Epoch, Refusal, Time, Transaction, Version};
use iceoryx2::port::client;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy};
use iceoryx2::service::port_factory::request_response;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;
use thiserror::Error;

const REQUESTS: &str = "graph/requests";
/// Answers that can be under way at once. iceoryx2 would make room for thousands, which costs each
/// client 14 MB of its own.
pub(in crate::shm) const ANSWERS: usize = 2 * MAX_PROCESSES;
/// Bytes of a request that has its place from the beginning; a larger one takes new memory.
const SMALL: usize = 4096;
/// Requests of one session that can be under way at once.
pub(super) const ASKED: usize = 4;
/// How often an asker looks whether its request has to be sent again.
pub(super) const RETRY: Duration = Duration::from_millis(250);
/// How long a session looks for an answer before it sleeps, unless told otherwise.
pub(super) const SPIN: Duration = Duration::from_micros(50);

/// Transactions on their way to the store.
#[derive(Debug, Default, Deserialize)]
pub(in crate::shm) struct Request {
    /// Which session asks.
    pub(in crate::shm) client: u64,
    /// The how-manyeth request of it: a repeated number is a repeated request.
    pub(in crate::shm) sequence: u64,
    pub(in crate::shm) agent: String,
    /// The process that asks.
    pub(in crate::shm) process: u32,
    pub(in crate::shm) time: Time,
    /// Each is applied whole or not at all, in this order.
    pub(in crate::shm) transactions: Vec<Transaction>,
}

/// A [`Request`] as its sender has it.
#[derive(Debug, Serialize)]
struct Asked<'a> {
    client: u64,
    sequence: u64,
    agent: &'a str,
    process: u32,
    time: Time,
    transactions: &'a [Transaction],
}

/// The store that a request is for.
#[derive(Debug)]
pub(super) struct Aim {
    pub(super) epoch: Epoch,
    pub(super) arena: Arc<Arena>,
    /// The first life of the store that its graph goes back to.
    lineage: u64,
}

/// The asking end of it.
pub(super) type Client = client::Client<Ipc, [u8], (), [u8], ()>;
/// Requests and answers are bytes: see [`Request`].
type RequestFactory = request_response::PortFactory<Ipc, [u8], (), [u8], ()>;

pub(in crate::shm) fn requests(node: &IpcNode) -> Result<RequestFactory, InstanceError> {
    let builder = node
        .service_builder(&service_name(REQUESTS)?)
        .request_response::<[u8], [u8]>()
        .max_servers(2)
        .max_clients(MAX_PROCESSES)
        .max_nodes(MAX_PROCESSES)
        .max_active_requests_per_client(ASKED);
    one_at_a_time(node, || builder.clone().open_or_create())
        .map_err(|e| ipc("the store's requests", e))
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
    /// The store was restarted with another graph meanwhile, and what was asked of the one before is
    /// gone with it; or, where many transactions were sent at once, restarted at all: which of
    /// them were applied is in the next snapshot.
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

impl Session {
    /// Asks the store for a change and waits for its answer. A request that got lost is sent
    /// again, also to a store that was restarted meanwhile and goes on with the same graph; it is
    /// applied once.
    ///
    /// # Errors
    /// [`CommitError`].
    pub fn commit(&mut self, transaction: &Transaction, time: Time) -> Result<Commit, CommitError> {
        self.sequence += 1;
        let aim = self.known_aim()?;
        let outcome = match self.ask_by_desk(&aim, transaction, time)? {
            Some(outcome) => outcome,
            None => {
                let answers = self.ask_by_message(aim, std::slice::from_ref(transaction), time)?;
                let alone = answers.into_iter().next();
                alone.ok_or_else(|| InstanceError::Ipc("the store gave no answer".to_owned()))?
            }
        };
        let commit = outcome?;
        if transaction.durability == Durability::OnDisk && !commit.durable {
            let version = commit.version;
            return Err(CommitError::NotDurable { version });
        }
        Ok(commit)
    }

    /// As [`Self::commit`] for many transactions in one request, which is faster by far: each is
    /// applied whole or refused by itself, makes a version of its own, and is answered, in the
    /// order given. Refusing one does not stop the next. Where one asks to be on disk first, all wait
    /// for it; [`Commit::durable`] says whether it is.
    ///
    /// # Errors
    /// [`CommitError`], but not for a refusal.
    pub fn commit_each(
        &mut self,
        transactions: &[Transaction],
        time: Time,
    ) -> Result<Vec<Result<Commit, Refusal>>, CommitError> {
        self.sequence += 1;
        let aim = self.aim()?;
        self.ask_by_message(aim, transactions, time)
    }

    /// The store that is asked now.
    fn aim(&mut self) -> Result<Aim, CommitError> {
        let found = self.arena()?.ok_or_else(|| self.no_store())?;
        self.aim_at(found)
    }

    /// The store that was there at the last look; who asks it looks whether it still is.
    fn known_aim(&mut self) -> Result<Aim, CommitError> {
        match self.arena.newest().cloned() {
            Some(found) => self.aim_at(found),
            None => self.aim(),
        }
    }

    fn aim_at(&mut self, (epoch, arena): (Epoch, Arc<Arena>)) -> Result<Aim, CommitError> {
        let lineage = self.lineage(epoch, &arena)?;
        Ok(Aim {
            epoch,
            arena,
            lineage,
        })
    }

    /// The port for requests by message. Its tables are a third of the memory that a session has for
    /// itself, and most never need it: it is opened for the first message.
    fn client(&mut self) -> Result<&Client, InstanceError> {
        let client = match self.client.take() {
            Some(client) => client,
            None => {
                room_for(ROOM)?;
                let requests = requests(&self.node)?;
                let make = || {
                    requests
                        .client_builder()
                        .initial_max_slice_len(SMALL)
                        .allocation_strategy(AllocationStrategy::PowerOfTwo)
                        .backpressure_strategy(BackpressureStrategy::DiscardData)
                        // The store may still read one that was sent again.
                        .override_request_preallocation(|worst| worst.min(2 * ASKED))
                        .create()
                };
                port(&self.node, make).map_err(|e| ipc("the store's client", e))?
            }
        };
        Ok(self.client.insert(client))
    }

    /// Asks by a message, under the number of the last request.
    fn ask_by_message(
        &mut self,
        aim: Aim,
        transactions: &[Transaction],
        time: Time,
    ) -> Result<Vec<Result<Commit, Refusal>>, CommitError> {
        let mut bytes = std::mem::take(&mut self.scratch);
        bytes.clear();
        let request = Asked {
            client: self.id,
            sequence: self.sequence,
            agent: &self.agent,
            process: std::process::id(),
            time,
            transactions,
        };
        let bytes =
            postcard::to_extend(&request, bytes).map_err(|e| ipc("encoding a request", e))?;
        if bytes.len() > SMALL {
            room_for(ROOM + bytes.len() as u64)?;
        }
        let answer = self.ask(aim, &bytes, transactions.len() == 1);
        self.scratch = bytes;
        let answers = answer?;
        if answers.len() != transactions.len() {
            return Err(InstanceError::Ipc("the store's answer is too short".to_owned()).into());
        }
        Ok(answers)
    }

    /// Sends a request until it is answered; to another store that goes on with the graph only if
    /// that one knows whether it was applied.
    fn ask(
        &mut self,
        mut aim: Aim,
        request: &[u8],
        is_known: bool,
    ) -> Result<Vec<Result<Commit, Refusal>>, CommitError> {
        let deadline = now() + PATIENCE;
        while now() < deadline {
            // A store that is about to show itself is waited for.
            if let Some((epoch, arena)) = self.arena()?
                && epoch != aim.epoch
            {
                if !is_known || self.lineage(epoch, &arena)? != aim.lineage {
                    return Err(CommitError::StoreRestarted);
                }
                (aim.epoch, aim.arena) = (epoch, arena);
            }
            let loan = self.client()?.loan_slice_uninit(request.len());
            let loan = loan.map_err(|e| ipc("sending a request", e))?;
            let pending = loan.write_from_slice(request).send();
            let pending = pending.map_err(|e| ipc("sending a request", e))?;
            let asleep = aim.arena.is_asleep();
            if asleep {
                ring(&self.wake_store);
            }
            let sent = now();
            loop {
                let heard = bell::listen(&aim.arena);
                if let Some(answer) = pending
                    .receive()
                    .map_err(|e| ipc("the store's answer", e))?
                {
                    let answers = postcard::from_bytes(answer.payload());
                    return Ok(answers.map_err(|e| ipc("the store's answer", e))?);
                }
                let waited = now() - sent;
                // A store that has to wake up first takes longer than is worth looking for.
                if !asleep && waited < self.spin {
                    std::hint::spin_loop();
                    continue;
                }
                let Some(left) = RETRY.checked_sub(waited) else {
                    break;
                };
                bell::sleep(&aim.arena, heard, left);
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
}
