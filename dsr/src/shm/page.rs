//! Pages of words between processes: each owner publishes one, which it goes on writing, and whoever
//! looks maps them read-only. It guarantees that an owner that dies, stops or comes again holds nobody
//! up; what the words mean is the affair of who asks.

use super::session::NEWS;
use super::{
    InstanceError, Ipc, IpcNode, MAX_PROCESSES, ROOM, Segment, ipc, now, one_at_a_time, pause,
    port, room_for, service_name,
};
use crate::arena::Word;
use iceoryx2::port::publisher::Publisher as IpcPublisher;
use iceoryx2::port::subscriber::Subscriber as IpcSubscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{Alignment, AllocationStrategy, BackpressureStrategy};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// How often an owner looks for processes that joined.
const NEWCOMERS: Duration = Duration::from_millis(10);
/// Pages that a process may hold at once: those of owners that have died take places of which iceoryx2 has
/// as many, and it would end a process that took more.
const MAX_HELD: usize = MAX_PROCESSES + 8;
/// Pages begin where a cache line does.
pub(super) const LINE: Alignment = Alignment::ALIGN_64;

type Factory = PortFactory<Ipc, [Word], ()>;

fn service(node: &IpcNode, name: &str) -> Result<Factory, InstanceError> {
    room_for(ROOM)?;
    let builder = node
        .service_builder(&service_name(name)?)
        .publish_subscribe::<[Word]>()
        .payload_alignment(LINE)
        .max_publishers(MAX_PROCESSES)
        .max_subscribers(MAX_PROCESSES)
        .max_nodes(MAX_PROCESSES)
        .history_size(1)
        .subscriber_max_buffer_size(1)
        .subscriber_max_borrowed_samples(MAX_HELD)
        .enable_safe_overflow(true);
    one_at_a_time(node, || builder.clone().open_or_create())
        .map_err(|e| ipc(&format!("pages `{name}`"), e))
}

/// An owner's page.
#[derive(Debug)]
pub(super) struct OwnPage {
    publisher: IpcPublisher<Ipc, [Word], ()>,
    start: *const Word,
    len: usize,
    newcomers_at: Mutex<Instant>,
}

// SAFETY: the page is a range of atomics, which any thread may use at any time, and the publisher
// that owns it is itself safe to send and share.
unsafe impl Send for OwnPage {}
// SAFETY: as above.
unsafe impl Sync for OwnPage {}

impl OwnPage {
    /// Publishes a page of `len` words, of zeros but for what `format` makes of them.
    pub(super) fn open(
        node: &IpcNode,
        name: &str,
        len: usize,
        format: impl FnOnce(&[Word]),
    ) -> Result<Self, InstanceError> {
        let failed = |e: &dyn std::fmt::Display| ipc(&format!("a page of `{name}`"), e);
        let service = service(node, name)?;
        let make = || {
            service
                .publisher_builder()
                .initial_max_slice_len(len)
                .allocation_strategy(AllocationStrategy::Static)
                .max_loaned_samples(1)
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .override_sample_preallocation(|_| 2)
                .create()
        };
        let publisher = port(node, make).map_err(|e| failed(&e))?;
        let loan = publisher.loan_slice_uninit(len).map_err(|e| failed(&e))?;
        let sample = loan.write_from_fn(|_| Word::default());
        let start = sample.payload().as_ptr();
        let page = Self {
            publisher,
            start,
            len,
            newcomers_at: Mutex::new(now()),
        };
        format(page.words());
        sample.send().map_err(|e| failed(&e))?;
        // From now on every session finds it.
        pause(NEWS);
        Ok(page)
    }

    pub(super) fn words(&self) -> &[Word] {
        // SAFETY: `start` points to the `len` words of the one sample that the publisher ever loans,
        // all initialised; it stays in the publisher's history, so that its memory is never loaned again,
        // and mapped while the publisher lives. Others only ever touch it through atomics.
        unsafe { std::slice::from_raw_parts(self.start, self.len) }
    }

    /// Hands the page to processes that joined since the last time, now and then.
    pub(super) fn serve_newcomers(&self) {
        let Ok(mut at) = self.newcomers_at.try_lock() else {
            return;
        };
        let time = now();
        if time >= *at {
            *at = time + NEWCOMERS;
            if let Err(error) = self.publisher.update_connections() {
                tracing::debug!("the page's connections: {error}");
            }
        }
    }
}

/// Where the pages of all owners arrive.
#[derive(Debug)]
pub(super) struct Pages {
    subscriber: IpcSubscriber<Ipc, [Word], ()>,
    name: String,
    held: Arc<()>,
}

impl Pages {
    pub(super) fn open(node: &IpcNode, name: &str) -> Result<Self, InstanceError> {
        let service = service(node, name)?;
        let subscriber = port(node, || service.subscriber_builder().create())
            .map_err(|e| ipc(&format!("pages `{name}`"), e))?;
        let name = name.to_owned();
        let held = Arc::default();
        Ok(Self {
            subscriber,
            name,
            held,
        })
    }

    /// The next page that has arrived; none before one is dropped where as many are held as can be.
    pub(super) fn receive(&self) -> Result<Option<Segment>, InstanceError> {
        // One is this.
        if Arc::strong_count(&self.held) > MAX_HELD {
            return Ok(None);
        }
        let sample = self.subscriber.receive();
        let sample = sample.map_err(|e| ipc(&format!("pages `{}`", self.name), e))?;
        let held = Arc::clone(&self.held);
        Ok(sample.map(|sample| {
            let (start, len) = (sample.payload().as_ptr(), sample.payload().len());
            // SAFETY: the payload is `len` atomics in shared memory that stays mapped while the
            // sample lives, and moving the sample does not move it.
            unsafe { Segment::in_shared_memory(start, len, Box::new((sample, held))) }
        }))
    }
}
