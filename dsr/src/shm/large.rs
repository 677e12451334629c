//! Large values between processes: each owner of an attribute sends its values through a stream of its
//! own, every value a piece of shared memory that is filled in place and counted by its readers. It
//! guarantees that a value is not written over while anybody holds it, and that no reader, however
//! slow, keeps the owner from sending the next.
//!
//! The rest of the stream's story, how a value is found again by its handle, is in `read`.

mod read;

pub(super) use read::Readers;
pub use read::{LargeReadError, LargeSample};

use super::arena::populate;
use super::{
    AttachError, InstanceError, Ipc, IpcNode, MAX_PROCESSES, free_bytes, ipc, one_at_a_time,
    service_name,
};
use crate::large::HANDLE_WORDS;
use crate::{
    AttributeId, LargeHandle, LargeType, Number, Operation, Owner, Schema, SchemaError, Transaction,
};
use iceoryx2::port::LoanError;
use iceoryx2::port::publisher::Publisher as IpcPublisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{Alignment, AllocationStrategy, BackpressureStrategy, ZeroCopySend};
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::service::builder::publish_subscribe::Builder;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::collections::BTreeMap;
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Weak};
use thiserror::Error;

/// How many of a stream's newest values wait for a reader that is slow or comes late.
pub(super) const KEPT: usize = 3;
/// How many values of one stream a session can hold at once, at least.
pub(super) const HELD: usize = 8;
/// A value begins where a cache line does.
const LINE: Alignment = Alignment::ALIGN_64;
/// Room that is left to the messages of others, in bytes.
const SPARE: u64 = 8 << 20;

/// Which value a sample is: its handle's words.
#[derive(Debug, Clone, Copy, Default, ZeroCopySend)]
#[repr(C)]
pub(super) struct Header {
    words: [u64; HANDLE_WORDS],
}

type Factory = PortFactory<Ipc, [u8], Header>;
type Loaned = SampleMut<Ipc, [u8], Header>;

fn builder(node: &IpcNode, stream: u64) -> Result<Builder<[u8], Header, Ipc>, InstanceError> {
    Ok(node
        .service_builder(&service_name(&format!("large/{stream:016x}"))?)
        .publish_subscribe::<[u8]>()
        .user_header::<Header>()
        .payload_alignment(LINE))
}

/// Why an attribute cannot be given a large value.
#[derive(Debug, Error)]
pub enum LargeError {
    /// The schema does not have the attribute, or not such a value of it.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// The schema does not say that its values are large.
    #[error("`{attribute}` has no large values: give it `kind = \"large\"` in the schema")]
    NotLarge {
        /// The attribute.
        attribute: String,
    },
    /// The shape has more than four dimensions, or one of 0.
    #[error("{shape:?} is no shape: 1 to 4 lengths, none of them 0")]
    BadShape {
        /// The shape.
        shape: Vec<u32>,
    },
    /// There is no room for it in shared memory.
    #[error("no room in /dev/shm for a value of {bytes} bytes")]
    OutOfMemory {
        /// How long it would be.
        bytes: usize,
    },
    /// The instance or its graph cannot be used.
    #[error(transparent)]
    Attach(#[from] AttachError),
}

impl From<InstanceError> for LargeError {
    fn from(error: InstanceError) -> Self {
        Self::Attach(error.into())
    }
}

/// The sending end of a stream.
#[derive(Debug)]
pub(super) struct Stream {
    publisher: IpcPublisher<Ipc, [u8], Header>,
    number: u64,
}

impl Stream {
    fn open(node: &IpcNode, number: u64, large: LargeType) -> Result<Self, InstanceError> {
        let builder = builder(node, number)?
            // Nobody but its owner can send on it.
            .max_publishers(1)
            .max_subscribers(MAX_PROCESSES)
            .max_nodes(MAX_PROCESSES)
            .history_size(KEPT)
            .subscriber_max_buffer_size(KEPT)
            // Those it holds, the newest that its session saw, and the one it looks at.
            .subscriber_max_borrowed_samples(HELD + 2)
            .enable_safe_overflow(true);
        let service = one_at_a_time(node, || builder.clone().create());
        let publisher = service
            .map_err(|e| ipc("a stream of large values", e))?
            .publisher_builder()
            .initial_max_slice_len(large.max_bytes as usize)
            // There is room for the case that every reader holds other values than all the rest;
            // memory is what of it was ever used at the same time.
            .allocation_strategy(AllocationStrategy::Static)
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| ipc("a stream of large values", e))?;
        Ok(Self { publisher, number })
    }

    /// Hands the newest values to sessions that have come to read the stream since the last time.
    fn serve_newcomers(&self) {
        if let Err(error) = self.publisher.update_connections() {
            tracing::debug!("a stream's connections: {error}");
        }
    }
}

/// The streams of a session's own, for as long as somebody has their attributes.
#[derive(Debug, Default)]
pub(super) struct OwnStreams(Vec<Weak<Stream>>);

impl OwnStreams {
    pub(super) fn open(
        &mut self,
        node: &IpcNode,
        number: u64,
        large: LargeType,
    ) -> Result<Arc<Stream>, InstanceError> {
        let stream = Arc::new(Stream::open(node, number, large)?);
        self.0.retain(|stream| stream.strong_count() > 0);
        self.0.push(Arc::downgrade(&stream));
        Ok(stream)
    }

    pub(super) fn serve_newcomers(&self) {
        for stream in self.0.iter().filter_map(Weak::upgrade) {
            stream.serve_newcomers();
        }
    }
}

/// An attribute that this process gives large values, see [`Session::large`](super::Session::large).
#[derive(Debug)]
pub struct LargeAttribute {
    stream: Arc<Stream>,
    owner: Owner,
    name: String,
    schema: Arc<Schema>,
    attribute: AttributeId,
    sent: u64,
    /// Where values have lain, and how many bytes there have memory behind them.
    backed: BTreeMap<usize, usize>,
}

impl LargeAttribute {
    pub(super) fn new(
        stream: Arc<Stream>,
        (owner, name): (Owner, &str),
        (schema, attribute): (Arc<Schema>, AttributeId),
    ) -> Self {
        Self {
            stream,
            owner,
            name: name.to_owned(),
            schema,
            attribute,
            sent: 0,
            backed: BTreeMap::new(),
        }
    }

    /// Memory for the next value, to be filled in place. What it holds at first is unspecified:
    /// zeros, or an earlier value of this attribute.
    ///
    /// # Errors
    /// [`LargeError::Schema`] where the schema does not allow so many bytes,
    /// [`LargeError::OutOfMemory`].
    pub fn loan(&mut self, bytes: usize) -> Result<LargeLoan<'_>, LargeError> {
        self.check(bytes, &[])?;
        let full = || LargeError::OutOfMemory { bytes };
        // iceoryx2 writes before the value which value it is.
        if free_bytes() < SPARE {
            return Err(full());
        }
        let loan = self.stream.publisher.loan_slice_uninit(bytes);
        let mut loan = loan.map_err(|error| match error {
            LoanError::OutOfMemory => full(),
            other => ipc("memory for a large value", other).into(),
        })?;
        let start: *const u8 = loan.payload_mut().as_mut_ptr().cast();
        let backed = self.backed.entry(start.addr()).or_default();
        if *backed < bytes {
            if free_bytes() < (bytes - *backed) as u64 + SPARE {
                return Err(full());
            }
            populate(start, bytes).map_err(|_| full())?;
            *backed = bytes;
        }
        // SAFETY: the payload is shared memory that the kernel has handed out zeroed, or that an
        // earlier value was written to; whatever its bytes are, they are `u8`.
        let sample = unsafe { loan.assume_init() };
        Ok(LargeLoan {
            sample,
            attribute: self,
        })
    }

    /// Whether a value may be so long and of that shape; its handle, if it is the next.
    fn check(&self, bytes: usize, shape: &[u32]) -> Result<LargeHandle, LargeError> {
        let next = LargeHandle::new(self.stream.number, self.sent + 1, bytes as u64, shape);
        let handle = next.ok_or_else(|| LargeError::BadShape {
            shape: shape.to_vec(),
        })?;
        self.schema.check_value(self.attribute, &handle.into())?;
        Ok(handle)
    }

    /// Hands the newest values to sessions that have begun to read the attribute since the last time.
    /// Sending does so, and so does [`Session::snapshot`](super::Session::snapshot) of this session.
    pub fn serve_newcomers(&self) {
        self.stream.serve_newcomers();
    }
}

/// The memory of a large value that nobody has seen yet; dropped, it is given back.
#[derive(Debug)]
pub struct LargeLoan<'a> {
    sample: Loaned,
    attribute: &'a mut LargeAttribute,
}

impl LargeLoan<'_> {
    /// The value as numbers, to be filled; `None` where its length is not that of whole ones.
    pub fn numbers_mut<T: Number>(&mut self) -> Option<&mut [T]> {
        // SAFETY: of the number types that implement `Number` every bit pattern is a value, and they
        // have no padding; `align_to_mut` leaves out what is not aligned.
        let (before, numbers, after) = unsafe { self.sample.payload_mut().align_to_mut::<T>() };
        (before.is_empty() && after.is_empty()).then_some(numbers)
    }

    /// Sends the value, and adds its handle to a transaction that the owner is about to commit: from
    /// that commit on, who reads the attribute finds it. `shape` is how many numbers it has along each
    /// dimension, the fastest last, or empty.
    ///
    /// # Errors
    /// [`LargeError::BadShape`]; [`LargeError::Schema`] where the shape is not that of so many
    /// bytes.
    pub fn send_into(
        mut self,
        transaction: &mut Transaction,
        shape: &[u32],
    ) -> Result<LargeHandle, LargeError> {
        let handle = self.attribute.check(self.len(), shape)?;
        self.sample.user_header_mut().words = handle.to_words();
        let sent = self.sample.send();
        sent.map_err(|e| ipc("sending a large value", e))?;
        self.attribute.sent = handle.sequence();
        transaction.push(Operation::SetAttribute {
            owner: self.attribute.owner.clone(),
            name: self.attribute.name.clone(),
            value: handle.into(),
        });
        Ok(handle)
    }
}

impl Deref for LargeLoan<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.sample.payload()
    }
}

impl DerefMut for LargeLoan<'_> {
    fn deref_mut(&mut self) -> &mut [u8] {
        self.sample.payload_mut()
    }
}
