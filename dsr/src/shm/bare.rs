//! What iceoryx2 takes by itself, to measure the graph against: a round trip of one word between two
//! processes, with nothing of ours in between. No part of the graph uses it.

use super::{Instance, InstanceError, ipc, now, service_name};
use iceoryx2::node::Node;
use iceoryx2::port::client::Client;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::server::Server;
use iceoryx2::service::ipc::Service;
use iceoryx2::service::port_factory::{event, request_response};
use std::time::Duration;

/// Its cheapest flavour: one thread, one word.
type Factory = request_response::PortFactory<Service, u64, (), u64, ()>;

fn service(node: &Node<Service>) -> Result<Factory, InstanceError> {
    node.service_builder(&service_name("bare/echo")?)
        .request_response::<u64, u64>()
        .open_or_create()
        .map_err(|e| ipc("the echo's service", e))
}

fn bell(node: &Node<Service>, name: &str) -> Result<event::PortFactory<Service>, InstanceError> {
    node.service_builder(&service_name(name)?)
        .event()
        .open_or_create()
        .map_err(|e| ipc("the echo's bell", e))
}

const ASK: &str = "bare/ask";
const ANSWER: &str = "bare/answer";

/// Sends back what a [`BareClient`] sends.
#[derive(Debug)]
pub struct BareServer {
    server: Server<Service, u64, (), u64, ()>,
    asked: Listener<Service>,
    answered: Notifier<Service>,
    _node: Node<Service>,
}

impl BareServer {
    /// Opens the answering end.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn open(instance: &Instance) -> Result<Self, InstanceError> {
        instance.create_folder()?;
        let node = instance.join_as::<Service>()?;
        let server = service(&node)?.server_builder().create();
        let asked = bell(&node, ASK)?.listener_builder().create();
        let answered = bell(&node, ANSWER)?.notifier_builder().create();
        Ok(Self {
            server: server.map_err(|e| ipc("the echo's server", e))?,
            asked: asked.map_err(|e| ipc("the echo's listener", e))?,
            answered: answered.map_err(|e| ipc("the echo's notifier", e))?,
            _node: node,
        })
    }

    /// Waits up to `patience` to be woken, then answers polling until nobody asked for `spin`. With
    /// no `spin`, it wakes the client after each answer.
    ///
    /// # Errors
    /// [`InstanceError::Ipc`].
    pub fn serve(&self, patience: Duration, spin: Duration) -> Result<(), InstanceError> {
        let woken = self.asked.timed_wait(|_| (), patience);
        woken.map_err(|e| ipc("waiting to be asked", e))?;
        let mut until = now() + spin;
        loop {
            let mut idle = true;
            while let Some(request) = self.server.receive().map_err(|e| ipc("the echo", e))? {
                let sent = request.send_copy(*request.payload());
                sent.map_err(|e| ipc("the echo", e))?;
                if spin.is_zero() {
                    let rung = self.answered.notify();
                    rung.map_err(|e| ipc("the echo's notifier", e))?;
                }
                idle = false;
            }
            let time = now();
            if !idle {
                until = time + spin;
            } else if time >= until {
                return Ok(());
            }
        }
    }
}

/// Sends a word and gets it back.
#[derive(Debug)]
pub struct BareClient {
    client: Client<Service, u64, (), u64, ()>,
    ask: Notifier<Service>,
    answered: Listener<Service>,
    _node: Node<Service>,
}

impl BareClient {
    /// Opens the asking end.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn open(instance: &Instance) -> Result<Self, InstanceError> {
        let node = instance.join_as::<Service>()?;
        let client = service(&node)?.client_builder().create();
        let ask = bell(&node, ASK)?.notifier_builder().create();
        let answered = bell(&node, ANSWER)?.listener_builder().create();
        Ok(Self {
            client: client.map_err(|e| ipc("the echo's client", e))?,
            ask: ask.map_err(|e| ipc("the echo's notifier", e))?,
            answered: answered.map_err(|e| ipc("the echo's listener", e))?,
            _node: node,
        })
    }

    /// Wakes the server, so that it polls.
    ///
    /// # Errors
    /// [`InstanceError::Ipc`].
    pub fn wake(&self) -> Result<(), InstanceError> {
        let rung = self.ask.notify();
        rung.map(|_| ()).map_err(|e| ipc("the echo's notifier", e))
    }

    /// One round trip, polling for the answer; false where none came within `patience`.
    ///
    /// # Errors
    /// [`InstanceError::Ipc`].
    pub fn poll(&self, word: u64, patience: Duration) -> Result<bool, InstanceError> {
        let sent = self
            .client
            .send_copy(word)
            .map_err(|e| ipc("the echo", e))?;
        let mut rounds = 0u32;
        let mut deadline = None;
        loop {
            if let Some(answer) = sent.receive().map_err(|e| ipc("the echo", e))? {
                return Ok(*answer == word);
            }
            // The clock is no part of the round trip.
            rounds += 1;
            if rounds.is_multiple_of(1 << 16)
                && now() > *deadline.get_or_insert_with(|| now() + patience)
            {
                return Ok(false);
            }
        }
    }

    /// One round trip in which both ends sleep until they are woken; false as in [`Self::poll`].
    ///
    /// # Errors
    /// [`InstanceError::Ipc`].
    pub fn block(&self, word: u64, patience: Duration) -> Result<bool, InstanceError> {
        let sent = self
            .client
            .send_copy(word)
            .map_err(|e| ipc("the echo", e))?;
        self.wake()?;
        let deadline = now() + patience;
        loop {
            if let Some(answer) = sent.receive().map_err(|e| ipc("the echo", e))? {
                return Ok(*answer == word);
            }
            let left = deadline.saturating_duration_since(now());
            if left.is_zero() {
                return Ok(false);
            }
            let woken = self.answered.timed_wait(|_| (), left);
            woken.map_err(|e| ipc("waiting for the echo", e))?;
        }
    }
}
