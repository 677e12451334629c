//! Pages of hot attributes between processes: every owner publishes one, every session sees all. It
//! guarantees that an owner that dies, stops or comes again holds nobody up, and that what is read of
//! its page was written so.

use super::arena::Current;
use super::{
    InstanceError, Ipc, IpcNode, MAX_PROCESSES, Segment, ipc, now, one_at_a_time, service_name,
};
use crate::arena::Word;
use crate::hot::{self, Key, PAGE_WORDS};
use crate::value::hash;
use crate::{AttributeId, Epoch, Owner, SchemaError, Time, Transaction, Value};
use iceoryx2::port::publisher::Publisher as IpcPublisher;
use iceoryx2::port::subscriber::Subscriber as IpcSubscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use thiserror::Error;

/// How often an owner looks for sessions that joined.
const NEWCOMERS: Duration = Duration::from_millis(10);

/// Why an attribute cannot be written hot.
#[derive(Debug, Error)]
pub enum HotError {
    /// The schema does not have the attribute, or not with this value.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// The schema does not say that it is hot.
    #[error("`{attribute}` is not hot: give it `hot = RATE` in the schema, or commit it")]
    NotHot {
        /// The attribute.
        attribute: String,
    },
    /// The graph does not have the node or the edge, or that has no such attribute yet.
    #[error("there is no `{attribute}` of {owner}: commit its first value")]
    NotFound {
        /// The attribute.
        attribute: String,
        /// Of what.
        owner: Owner,
    },
    /// The session has as many hot attributes as there can be.
    #[error("a session can have {} hot attributes", hot::SLOTS)]
    Full,
    /// The instance or its graph cannot be used.
    #[error(transparent)]
    Attach(#[from] super::AttachError),
}

impl From<InstanceError> for HotError {
    fn from(error: InstanceError) -> Self {
        Self::Attach(error.into())
    }
}

type Factory = PortFactory<Ipc, [Word], ()>;

fn service(node: &IpcNode) -> Result<Factory, InstanceError> {
    let builder = node
        .service_builder(&service_name("graph/hot")?)
        .publish_subscribe::<[Word]>()
        .max_publishers(MAX_PROCESSES)
        .max_subscribers(MAX_PROCESSES)
        .max_nodes(MAX_PROCESSES)
        .history_size(1)
        .subscriber_max_buffer_size(1)
        .subscriber_max_borrowed_samples(2 * MAX_PROCESSES)
        .enable_safe_overflow(true);
    one_at_a_time(node, || builder.open_or_create()).map_err(|e| ipc("the hot attributes", e))
}

/// An owner's page.
#[derive(Debug)]
pub(super) struct OwnPage {
    publisher: IpcPublisher<Ipc, [Word], ()>,
    start: *const Word,
    newcomers_at: Mutex<Instant>,
}

// SAFETY: the page is a range of atomics, which any thread may use at any time, and the publisher
// that owns it is itself safe to send and share.
unsafe impl Send for OwnPage {}
// SAFETY: as above.
unsafe impl Sync for OwnPage {}

impl OwnPage {
    pub(super) fn open(node: &IpcNode, agent: &str) -> Result<Self, InstanceError> {
        let publisher = service(node)?
            .publisher_builder()
            .initial_max_slice_len(PAGE_WORDS)
            .allocation_strategy(AllocationStrategy::Static)
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .override_sample_preallocation(|_| 2)
            .create()
            .map_err(|e| ipc("a page of hot attributes", e))?;
        let loan = publisher.loan_slice_uninit(PAGE_WORDS);
        let loan = loan.map_err(|e| ipc("a page of hot attributes", e))?;
        let sample = loan.write_from_fn(|_| Word::default());
        let start = sample.payload().as_ptr();
        let page = Self {
            publisher,
            start,
            newcomers_at: Mutex::new(now()),
        };
        hot::format(page.words(), hash(agent));
        sample
            .send()
            .map_err(|e| ipc("a page of hot attributes", e))?;
        Ok(page)
    }

    pub(super) fn claim(&self, key: Key) -> Option<usize> {
        hot::claim(self.words(), key)
    }

    fn words(&self) -> &[Word] {
        // SAFETY: `start` points to the words of the one sample that the publisher ever loans, all
        // initialised; it stays in the publisher's history, so that its memory is never loaned again,
        // and mapped while the publisher lives. Others only ever touch it through atomics.
        unsafe { std::slice::from_raw_parts(self.start, PAGE_WORDS) }
    }

    /// Hands the page to sessions that joined since the last time, now and then.
    fn serve_newcomers(&self) {
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

/// An attribute that this process owns and writes as often as it likes, see
/// [`Session::hot`](super::Session::hot).
#[derive(Debug)]
pub struct HotAttribute {
    pub(super) page: Arc<OwnPage>,
    pub(super) slot: usize,
    pub(super) owner: Owner,
    pub(super) name: String,
    pub(super) schema: Arc<crate::Schema>,
    pub(super) attribute: AttributeId,
    pub(super) current: Current,
    /// Seconds between foldings.
    pub(super) interval: f64,
    pub(super) folded: Option<Time>,
    pub(super) last: Option<(Value, Time)>,
    pub(super) scratch: Vec<u64>,
}

impl HotAttribute {
    /// Gives out a value: whoever reads the attribute from now on reads this. It takes no message
    /// and waits for nobody.
    ///
    /// # Errors
    /// [`HotError::Schema`] where the schema forbids the value.
    pub fn set(&mut self, value: impl Into<Value>, time: Time) -> Result<(), HotError> {
        let value = value.into();
        self.schema.check_value(self.attribute, &value)?;
        let epoch = self.current.epoch().unwrap_or(Epoch(0));
        let written = (&value, time.nanoseconds());
        hot::write(
            self.page.words(),
            self.slot,
            epoch,
            written,
            &mut self.scratch,
        );
        self.page.serve_newcomers();
        self.last = Some((value, time));
        Ok(())
    }

    /// Adds the last value to a transaction that the owner is about to commit, where the rate that
    /// the schema gives says that it is time to fold it into the graph. Whether it did.
    pub fn fold_into(&mut self, transaction: &mut Transaction) -> bool {
        let Some((value, time)) = &self.last else {
            return false;
        };
        let due = self
            .folded
            .is_none_or(|before| time.seconds() - before.seconds() >= self.interval - 1e-9);
        if due && self.folded != Some(*time) {
            self.folded = Some(*time);
            transaction.push(crate::Operation::SetAttribute {
                owner: self.owner.clone(),
                name: self.name.clone(),
                value: value.clone(),
            });
            return true;
        }
        false
    }
}

/// The pages of all owners, as a session sees them.
#[derive(Debug)]
pub(super) struct HotSubscriber {
    subscriber: IpcSubscriber<Ipc, [Word], ()>,
    pages: Arc<Vec<Arc<Segment>>>,
}

impl HotSubscriber {
    pub(super) fn open(node: &IpcNode) -> Result<Self, InstanceError> {
        let subscriber = service(node)?
            .subscriber_builder()
            .create()
            .map_err(|e| ipc("the hot attributes", e))?;
        Ok(Self {
            subscriber,
            pages: Arc::default(),
        })
    }

    /// The pages that have come; `None` where there are none.
    pub(super) fn poll(&mut self) -> Result<Option<Arc<Vec<Arc<Segment>>>>, InstanceError> {
        while let Some(sample) = self
            .subscriber
            .receive()
            .map_err(|e| ipc("the hot attributes", e))?
        {
            let (start, len) = (sample.payload().as_ptr(), sample.payload().len());
            // SAFETY: the payload is `len` atomics in shared memory that stays mapped while the
            // sample lives, and moving the sample does not move it.
            let page = unsafe { Segment::in_shared_memory(start, len, Box::new(sample)) };
            let Some(owner) = hot::owner_of(page.words()) else {
                continue;
            };
            // An owner that came again has a new page.
            let others = self.pages.iter();
            let mut pages: Vec<Arc<Segment>> = others
                .filter(|page| hot::owner_of(page.words()) != Some(owner))
                .cloned()
                .collect();
            pages.push(Arc::new(page));
            self.pages = Arc::new(pages);
        }
        Ok((!self.pages.is_empty()).then(|| Arc::clone(&self.pages)))
    }
}
