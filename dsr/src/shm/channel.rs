//! Channels of messages between the processes of an instance, beside the graph: sensor readings,
//! commands, grids. This file guarantees that a slow or dead receiver holds nobody up: where its
//! buffer is full the oldest message gives way.

use super::{
    InstanceError, Ipc, IpcNode, MAX_PROCESSES, ROOM, ipc, one_at_a_time, port, room_for,
    service_name,
};
use iceoryx2::port::publisher::Publisher as IpcPublisher;
use iceoryx2::port::subscriber::Subscriber as IpcSubscriber;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy};
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::marker::PhantomData;

/// Messages that a receiver may be behind before it loses the oldest.
pub(crate) const BUFFER: usize = 256;
/// Messages of one sender that can be under way at once: a buffer, which holds the same messages for
/// every receiver, and what they have taken out. Each receiver pays some 4 KiB for each of them.
const UNDER_WAY: usize = BUFFER + 2 * MAX_PROCESSES + 16;

/// Bytes of a message that has its place from the beginning; a larger one takes new memory.
const SMALL: usize = 4096;

fn service(node: &IpcNode, name: &str) -> Result<PortFactory<Ipc, [u8], ()>, InstanceError> {
    room_for(ROOM)?;
    let builder = node
        .service_builder(&service_name(name)?)
        .publish_subscribe::<[u8]>()
        .max_publishers(8)
        .max_subscribers(MAX_PROCESSES)
        .max_nodes(MAX_PROCESSES)
        .subscriber_max_buffer_size(BUFFER)
        .subscriber_max_borrowed_samples(2)
        .history_size(0)
        .enable_safe_overflow(true);
    one_at_a_time(node, || builder.clone().open_or_create())
        .map_err(|e| ipc(&format!("channel `{name}`"), e))
}

/// The sending end of a channel.
#[derive(Debug)]
pub struct Publisher<T> {
    port: IpcPublisher<Ipc, [u8], ()>,
    service: PortFactory<Ipc, [u8], ()>,
    message: PhantomData<fn(&T)>,
}

impl<T: Serialize> Publisher<T> {
    pub(crate) fn open(node: &IpcNode, name: &str) -> Result<Self, InstanceError> {
        let service = service(node, name)?;
        let make = || {
            service
                .publisher_builder()
                .initial_max_slice_len(SMALL)
                .allocation_strategy(AllocationStrategy::PowerOfTwo)
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .override_sample_preallocation(|worst| worst.min(UNDER_WAY))
                .create()
        };
        let port = port(node, make).map_err(|e| ipc(&format!("channel `{name}`"), e))?;
        Ok(Self {
            port,
            service,
            message: PhantomData,
        })
    }

    /// Whether anybody would get a message that is sent now.
    pub(crate) fn has_listeners(&self) -> bool {
        self.service.dynamic_config().number_of_subscribers() > 0
    }

    /// Sends a message to all who listen now.
    ///
    /// # Errors
    /// [`InstanceError::Ipc`] where shared memory is exhausted.
    pub fn send(&self, message: &T) -> Result<(), InstanceError> {
        let bytes = postcard::to_stdvec(message).map_err(|e| ipc("encoding a message", e))?;
        if bytes.len() > SMALL {
            room_for(ROOM + bytes.len() as u64)?;
        }
        let loan = self.port.loan_slice_uninit(bytes.len().max(1));
        let sample = loan.map_err(|e| ipc("sending a message", e))?;
        let padded = if bytes.is_empty() { &[0][..] } else { &bytes };
        sample
            .write_from_slice(padded)
            .send()
            .map_err(|e| ipc("sending a message", e))
            .map(|_| ())
    }
}

/// The receiving end of a channel.
#[derive(Debug)]
pub struct Subscriber<T> {
    port: IpcSubscriber<Ipc, [u8], ()>,
    message: PhantomData<fn() -> T>,
    malformed: u64,
}

impl<T: DeserializeOwned> Subscriber<T> {
    pub(crate) fn open(node: &IpcNode, name: &str) -> Result<Self, InstanceError> {
        let service = service(node, name)?;
        let make = || service.subscriber_builder().buffer_size(BUFFER).create();
        let port = port(node, make).map_err(|e| ipc(&format!("channel `{name}`"), e))?;
        Ok(Self {
            port,
            message: PhantomData,
            malformed: 0,
        })
    }

    /// The next message that has arrived; one that cannot be read is counted and passed over.
    ///
    /// # Errors
    /// [`InstanceError::Ipc`] where a sender's memory cannot be mapped.
    pub fn receive(&mut self) -> Result<Option<T>, InstanceError> {
        while let Some(sample) = self
            .port
            .receive()
            .map_err(|e| ipc("receiving a message", e))?
        {
            match postcard::from_bytes(sample.payload()) {
                Ok(message) => return Ok(Some(message)),
                Err(error) => {
                    self.malformed += 1;
                    tracing::warn!("a message of {} bytes: {error}", sample.payload().len());
                }
            }
        }
        Ok(None)
    }

    /// All messages that have arrived, oldest first.
    ///
    /// # Errors
    /// As [`Self::receive`].
    pub fn drain(&mut self) -> Result<Vec<T>, InstanceError> {
        let mut messages = Vec::new();
        while let Some(message) = self.receive()? {
            messages.push(message);
        }
        Ok(messages)
    }

    /// The newest message that has arrived.
    ///
    /// # Errors
    /// As [`Self::receive`].
    pub fn newest(&mut self) -> Result<Option<T>, InstanceError> {
        let mut newest = None;
        while let Some(message) = self.receive()? {
            newest = Some(message);
        }
        Ok(newest)
    }

    /// Messages so far that could not be read.
    pub fn malformed(&self) -> u64 {
        self.malformed
    }
}
