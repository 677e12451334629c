//! Leases between processes: how a reader asks the store to keep a version readable, and how the
//! store ends what nobody uses. This file guarantees that a lease ends at its deadline, when its
//! holder drops it, or when its holder's process ends, whichever comes first.

use super::presence::Presence;
use super::session::{REQUESTS_EVENT, event};
use super::{InstanceError, Ipc, IpcNode, MAX_PROCESSES, ipc, one_at_a_time, port, service_name};
use crate::arena::LeaseMark;
use crate::graph::LeaseRefusal;
use crate::{AttachError, Epoch, Graph, Snapshot, Version};
use iceoryx2::port::client::Client;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy};
use iceoryx2::service::port_factory::request_response;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::{Duration, Instant};
use thiserror::Error;

const LEASES: &str = "graph/leases";
/// How often the store looks whether holders of leases are alive.
const LOOK: Duration = Duration::from_millis(100);

/// Why there is no lease.
#[derive(Debug, Error)]
pub enum LeaseError {
    /// The store gave none.
    #[error("no lease: {0}")]
    Refused(#[from] LeaseRefusal),
    /// The snapshot is not of the store that runs now.
    #[error("no lease: the store was restarted")]
    StoreRestarted,
    /// No store answered in time.
    #[error("no lease: the store did not answer")]
    NoAnswer,
    /// The instance cannot be used.
    #[error(transparent)]
    Attach(#[from] AttachError),
}

impl From<InstanceError> for LeaseError {
    fn from(error: InstanceError) -> Self {
        Self::Attach(error.into())
    }
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Ask {
    /// Keep this version for so long.
    Keep {
        process: u32,
        epoch: Epoch,
        version: Version,
        time: Duration,
    },
    /// The lease with that token is not needed any more.
    End { epoch: Epoch, token: u64 },
}

/// The place and the token of a lease; `None` where the store has another epoch.
pub(super) type Answer = Result<Option<(u64, u64)>, LeaseRefusal>;
type Factory = request_response::PortFactory<Ipc, [u8], (), [u8], ()>;

fn service(node: &IpcNode) -> Result<Factory, InstanceError> {
    let builder = node
        .service_builder(&service_name(LEASES)?)
        .request_response::<[u8], [u8]>()
        .max_servers(2)
        .max_clients(MAX_PROCESSES)
        .max_nodes(MAX_PROCESSES)
        .max_active_requests_per_client(4);
    one_at_a_time(node, || builder.clone().open_or_create()).map_err(|e| ipc("leases", e))
}

/// The asking end.
#[derive(Debug)]
pub(super) struct Tenant {
    client: Client<Ipc, [u8], (), [u8], ()>,
    bell: Notifier<Ipc>,
}

impl Tenant {
    pub(super) fn open(node: &IpcNode) -> Result<Self, InstanceError> {
        let service = service(node)?;
        let make = || {
            service
                .client_builder()
                .initial_max_slice_len(64)
                .allocation_strategy(AllocationStrategy::PowerOfTwo)
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
        };
        let client = port(node, make).map_err(|e| ipc("the leases' client", e))?;
        let bell = event(node, REQUESTS_EVENT)?;
        let bell = port(node, || bell.notifier_builder().create())
            .map_err(|e| ipc("the leases' bell", e))?;
        Ok(Self { client, bell })
    }

    /// Asks, and rests between looks for the answer as `pause` does, until that says no.
    fn ask(
        &self,
        ask: &Ask,
        mut pause: impl FnMut() -> Result<bool, InstanceError>,
    ) -> Result<Option<Answer>, InstanceError> {
        let bytes = postcard::to_stdvec(ask).map_err(|e| ipc("encoding a request", e))?;
        let loan = self.client.loan_slice_uninit(bytes.len());
        let loan = loan.map_err(|e| ipc("asking for a lease", e))?;
        let pending = loan.write_from_slice(&bytes).send();
        let pending = pending.map_err(|e| ipc("asking for a lease", e))?;
        if let Err(error) = self.bell.notify() {
            tracing::debug!("waking the store: {error}");
        }
        loop {
            let answer = pending.receive().map_err(|e| ipc("a lease's answer", e))?;
            if let Some(answer) = answer {
                let answer = postcard::from_bytes(answer.payload());
                return answer.map(Some).map_err(|e| ipc("a lease's answer", e));
            }
            if !pause()? {
                return Ok(None);
            }
        }
    }

    pub(super) fn lease(
        self: &Arc<Self>,
        snapshot: &Snapshot,
        epoch: Epoch,
        time: Duration,
        pause: impl FnMut() -> Result<bool, InstanceError>,
    ) -> Result<Lease, LeaseError> {
        let ask = Ask::Keep {
            process: std::process::id(),
            epoch,
            version: snapshot.version(),
            time,
        };
        let answer = self.ask(&ask, pause)?.ok_or(LeaseError::NoAnswer)??;
        let (place, token) = answer.ok_or(LeaseError::StoreRestarted)?;
        let place = place as usize;
        Ok(Lease {
            snapshot: snapshot.leased(LeaseMark { place, token }),
            tenant: Arc::clone(self),
            epoch,
            token,
        })
    }
}

/// A version that stays readable for a time; see [`crate::Session::lease`].
#[derive(Debug)]
pub struct Lease {
    snapshot: Snapshot,
    tenant: Arc<Tenant>,
    epoch: Epoch,
    token: u64,
}

impl Lease {
    /// The version, read by this lease: also clones of it say
    /// [`crate::ReadError::SnapshotTooOld`] only once the lease has ended.
    pub fn snapshot(&self) -> &Snapshot {
        &self.snapshot
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        let (epoch, token) = (self.epoch, self.token);
        // Where this does not arrive, the lease ends at its deadline.
        if let Err(error) = self.tenant.ask(&Ask::End { epoch, token }, || Ok(false)) {
            tracing::debug!("ending a lease: {error}");
        }
    }
}

/// A lease that the store gave.
#[derive(Debug)]
struct Given {
    token: u64,
    holder: Presence,
    until: Instant,
}

/// The giving end.
#[derive(Debug)]
pub(super) struct Landlord {
    server: Server<Ipc, [u8], (), [u8], ()>,
    given: Vec<Given>,
    next_look: Instant,
}

impl Landlord {
    pub(super) fn open(node: &IpcNode, now: Instant) -> Result<Self, InstanceError> {
        let server = service(node)?
            .server_builder()
            .initial_max_slice_len(64)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| ipc("the leases' server", e))?;
        Ok(Self {
            server,
            given: Vec::new(),
            next_look: now,
        })
    }

    /// Answers who asks, and ends the leases that are over. How many were answered.
    pub(super) fn serve(
        &mut self,
        graph: &mut Graph,
        now: Instant,
    ) -> Result<usize, InstanceError> {
        let mut served = 0;
        while let Some(active) = self.server.receive().map_err(|e| ipc("leases", e))? {
            let Ok(ask) = postcard::from_bytes::<Ask>(active.payload()) else {
                tracing::warn!("a request for a lease that cannot be read");
                continue;
            };
            let answer = self.answer(graph, &ask, now);
            let bytes = postcard::to_stdvec(&answer).map_err(|e| ipc("encoding an answer", e))?;
            match active.loan_slice_uninit(bytes.len()) {
                // Whoever went away meanwhile does not hear.
                Ok(response) => drop(response.write_from_slice(&bytes).send()),
                Err(error) => tracing::warn!("an answer was not sent: {error}"),
            }
            served += 1;
        }
        if now >= self.next_look && !self.given.is_empty() {
            self.next_look = now + LOOK;
            self.given.retain(|lease| {
                let over = lease.until <= now || lease.holder.has_ended();
                if over {
                    graph.end_lease(lease.token);
                }
                !over && graph.has_lease(lease.token)
            });
        }
        Ok(served)
    }

    fn answer(&mut self, graph: &mut Graph, ask: &Ask, now: Instant) -> Answer {
        match *ask {
            Ask::Keep { epoch, .. } | Ask::End { epoch, .. } if epoch != graph.epoch() => Ok(None),
            Ask::End { token, .. } => {
                graph.end_lease(token);
                self.given.retain(|lease| lease.token != token);
                Ok(None)
            }
            Ask::Keep {
                process,
                version,
                time,
                ..
            } => {
                let longest = graph.longest_lease();
                if time > longest {
                    return Err(LeaseRefusal::TooLong { longest });
                }
                let holder = Presence::of(process).ok_or(LeaseRefusal::Ended)?;
                let mark = graph.lease(version)?;
                self.given.push(Given {
                    token: mark.token,
                    holder,
                    until: now + time,
                });
                Ok(Some((mark.place as u64, mark.token)))
            }
        }
    }
}
