//! Large values as their readers get them: by handle, in place, for as long as they hold them. It
//! guarantees that what a reader gets is what the handle's owner sent under that handle, whole, or an
//! answer that says why there is nothing.

use super::{Factory, HELD, Header, builder};
use crate::shm::presence::Presence;
use crate::shm::{InstanceError, Ipc, IpcNode, ipc};
use crate::{LargeHandle, Number};
use iceoryx2::port::ReceiveError;
use iceoryx2::port::subscriber::Subscriber as IpcSubscriber;
use iceoryx2::prelude::CallbackProgression;
use iceoryx2::sample::Sample;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;
use iceoryx2::service::port_factory::PortFactory as _;
use std::any::Any;
use std::fmt;
use std::ops::Deref;
use std::sync::Arc;
use thiserror::Error;

/// Streams that a session follows at once; beyond it, it gives up the one that was asked for longest
/// ago.
const STREAMS: usize = 32;

/// Why a handle leads to no value.
#[derive(Debug, Error)]
pub enum LargeReadError {
    /// The value has not come yet: its owner has not seen that this session wants it. Ask again.
    #[error("the value has not arrived yet; its owner hands it over in its next turn")]
    NotArrived,
    /// Its owner has sent several values since; read the attribute again.
    #[error("the value was overtaken: number {newest} of its stream is here")]
    Overtaken {
        /// The newest value of the stream that has arrived.
        newest: u64,
    },
    /// Its owner has ended or given the attribute up, and with it went what nobody held.
    #[error("the value is gone with the process that gave it out")]
    OwnerEnded,
    /// The stream's value of that number is another than the handle says.
    #[error("the handle is wrong: the value of that number is another")]
    Mismatch,
    /// The session holds as many values of this stream as it may.
    #[error(
        "the session holds all the values of this stream that it may, at least {HELD}; drop one"
    )]
    TooManyHeld,
    /// The instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
}

/// A large value, read in place in its owner's memory. It stays what it is for as long as this or a
/// clone of it lives, whatever becomes of its owner.
#[derive(Clone)]
pub struct LargeSample(Arc<Held>);

struct Held {
    handle: LargeHandle,
    start: *const u8,
    len: usize,
    /// Owns the memory.
    _sample: Box<dyn Any + Send>,
}

// SAFETY: the memory is a range of bytes that nobody writes while the sample lives; the sample may be
// sent, and is only touched again to drop it.
unsafe impl Send for Held {}
// SAFETY: shared, it gives nothing but shared bytes; nobody reaches the sample.
unsafe impl Sync for Held {}

impl LargeSample {
    /// The value that a sample holds; `None` where its header says what cannot be.
    fn of(sample: Sample<Ipc, [u8], Header>) -> Option<Self> {
        let handle = LargeHandle::from_words(sample.user_header().words);
        let (start, len) = (sample.payload().as_ptr(), sample.payload().len());
        (len as u64 == handle.bytes()).then(|| {
            Self(Arc::new(Held {
                handle,
                start,
                len,
                _sample: Box::new(sample),
            }))
        })
    }

    /// What the graph says of it.
    pub fn handle(&self) -> &LargeHandle {
        &self.0.handle
    }

    /// The value as numbers; `None` where its length is not that of whole ones.
    pub fn numbers<T: Number>(&self) -> Option<&[T]> {
        // SAFETY: of the number types that implement `Number` every bit pattern is a value;
        // `align_to` leaves out what is not aligned.
        let (before, numbers, after) = unsafe { self.align_to::<T>() };
        (before.is_empty() && after.is_empty()).then_some(numbers)
    }
}

impl Deref for LargeSample {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        // SAFETY: `start` and `len` are those of the sample's payload, which stays mapped and is given
        // to nobody for writing while the sample lives; moving the sample does not move it.
        unsafe { std::slice::from_raw_parts(self.0.start, self.0.len) }
    }
}

impl fmt::Debug for LargeSample {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("LargeSample").field(&self.0.handle).finish()
    }
}

/// The receiving end of a stream.
#[derive(Debug)]
struct Reader {
    stream: u64,
    service: Factory,
    subscriber: IpcSubscriber<Ipc, [u8], Header>,
    /// The newest that was taken out.
    last: Option<LargeSample>,
}

impl Reader {
    fn open(node: &IpcNode, stream: u64) -> Result<Self, LargeReadError> {
        use PublishSubscribeOpenError as Open;
        // Whoever has a handle comes after the stream was made: there is nobody to wait for.
        let service = builder(node, stream)?.open().map_err(|error| match error {
            Open::DoesNotExist | Open::IsMarkedForDestruction => LargeReadError::OwnerEnded,
            other => ipc("a stream of large values", other).into(),
        })?;
        let subscriber = service.subscriber_builder().create();
        Ok(Self {
            stream,
            subscriber: subscriber.map_err(|e| ipc("a stream of large values", e))?,
            service,
            last: None,
        })
    }

    fn find(&mut self, handle: &LargeHandle) -> Result<LargeSample, LargeReadError> {
        loop {
            if let Some(last) = &self.last {
                let newest = last.handle().sequence();
                if newest == handle.sequence() {
                    let same = last.handle() == handle;
                    return same.then(|| last.clone()).ok_or(LargeReadError::Mismatch);
                }
                if newest > handle.sequence() {
                    return Err(LargeReadError::Overtaken { newest });
                }
            }
            let sample = self.subscriber.receive().map_err(|error| match error {
                ReceiveError::ExceedsMaxBorrows => LargeReadError::TooManyHeld,
                ReceiveError::ConnectionFailure(_) => ipc("a large value", error).into(),
            })?;
            match sample {
                Some(sample) => self.last = LargeSample::of(sample).or(self.last.take()),
                None if self.owner_lives() => return Err(LargeReadError::NotArrived),
                None => return Err(LargeReadError::OwnerEnded),
            }
        }
    }

    fn owner_lives(&self) -> bool {
        let mut owner = None;
        self.service.dynamic_config().list_publishers(|publisher| {
            owner = publisher.node_id.pid::<Ipc>().ok();
            CallbackProgression::Stop
        });
        let process = owner.and_then(|process| Presence::of(process.value().cast_unsigned()));
        process.is_some_and(|process| !process.has_ended())
    }
}

/// The streams that a session follows, the one that was asked for last at the end.
#[derive(Debug, Default)]
pub(in crate::shm) struct Readers(Vec<Reader>);

impl Readers {
    pub(in crate::shm) fn find(
        &mut self,
        node: &IpcNode,
        handle: &LargeHandle,
    ) -> Result<LargeSample, LargeReadError> {
        let known = self.0.iter().position(|r| r.stream == handle.stream());
        let mut reader = match known {
            Some(index) => self.0.remove(index),
            None => Reader::open(node, handle.stream())?,
        };
        let found = reader.find(handle);
        // A stream that has ended is left, so that what remains of it can go.
        if !matches!(found, Err(LargeReadError::OwnerEnded)) {
            if self.0.len() >= STREAMS {
                self.0.remove(0);
            }
            self.0.push(reader);
        }
        found
    }
}
