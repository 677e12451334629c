//! The arena in shared memory: each segment is one giant sample that the store sends once and goes
//! on writing through atomics, while every reader keeps the sample it received.
//!
//! iceoryx2 does not promise that a sample may be written after it was sent; its version is pinned
//! and `tests/all/graph.rs` holds the construct.

use super::page::LINE;
use super::{
    InstanceError, Ipc, IpcNode, MAX_PROCESSES, MAX_STORES, Segment, ipc, one_at_a_time, port,
    service_name,
};
use crate::Epoch;
use crate::arena::allocator::{Full, Growth};
use crate::arena::{Arena, Word};
use iceoryx2::port::publisher::Publisher as IpcPublisher;
use iceoryx2::port::subscriber::Subscriber as IpcSubscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy, ZeroCopySend};
use iceoryx2::sample::Sample;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use rustix::mm::{Advice, madvise};
use std::sync::{Arc, PoisonError, RwLock};

/// log2 of the words in a segment: 256 MiB.
pub(super) const SHIFT: u32 = 25;
/// Segments that an arena may grow to: 4 GiB in all. Each costs every process some 4 KiB.
pub(super) const CAPACITY: usize = 16;

// SAFETY: a word is an `AtomicU64`: no pointer, no padding, any bits are a valid value, and
// `repr(transparent)` fixes its layout for every process on the host.
unsafe impl ZeroCopySend for Word {}

/// Which segment of which arena a sample is.
#[derive(Debug, Clone, Copy, Default, ZeroCopySend)]
#[repr(C)]
pub(crate) struct SegmentHeader {
    epoch: u64,
    index: u64,
}

type Factory = PortFactory<Ipc, [Word], SegmentHeader>;

fn service(node: &IpcNode) -> Result<Factory, InstanceError> {
    let builder = node
        .service_builder(&service_name("graph/arena")?)
        .publish_subscribe::<[Word]>()
        .user_header::<SegmentHeader>()
        .payload_alignment(LINE)
        .max_publishers(MAX_STORES)
        .max_subscribers(MAX_PROCESSES)
        .max_nodes(MAX_PROCESSES)
        .history_size(CAPACITY)
        .subscriber_max_buffer_size(CAPACITY)
        // Of each store.
        .subscriber_max_borrowed_samples(CAPACITY)
        .enable_safe_overflow(true);
    one_at_a_time(node, || builder.clone().open_or_create())
        .map_err(|e| ipc("the arena's service", e))
}

/// The store's end: makes segments and sends them to every process.
#[derive(Debug)]
pub(crate) struct ArenaPublisher {
    publisher: Arc<IpcPublisher<Ipc, [Word], SegmentHeader>>,
}

impl ArenaPublisher {
    pub(crate) fn open(node: &IpcNode) -> Result<Self, InstanceError> {
        let publisher = service(node)?
            .publisher_builder()
            .initial_max_slice_len(1 << SHIFT)
            .allocation_strategy(AllocationStrategy::Static)
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            // Every segment is sent once and lives in the history; more are never loaned.
            .override_sample_preallocation(|_| CAPACITY + 1)
            .create()
            .map_err(|e| ipc("the arena's publisher", e))?;
        Ok(Self {
            publisher: Arc::new(publisher),
        })
    }

    /// An arena without segments, and what adds them.
    pub(crate) fn arena(&self, epoch: Epoch) -> (Arc<Arena>, Box<dyn Growth>) {
        let growth = SharedGrowth {
            publisher: Arc::clone(&self.publisher),
            epoch,
            starts: Vec::new(),
        };
        (Arc::new(Arena::new(CAPACITY, SHIFT)), Box::new(growth))
    }

    /// Hands the segments to processes that joined since the last call.
    pub(crate) fn serve_newcomers(&self) {
        // A connection that cannot be made is one whose process is gone.
        if let Err(error) = self.publisher.update_connections() {
            tracing::debug!("the arena's connections: {error}");
        }
    }
}

#[derive(Debug)]
struct SharedGrowth {
    publisher: Arc<IpcPublisher<Ipc, [Word], SegmentHeader>>,
    epoch: Epoch,
    /// Where the segments begin.
    starts: Vec<*const Word>,
}

// SAFETY: the places are those of the segments below, which any thread may use.
unsafe impl Send for SharedGrowth {}

impl Growth for SharedGrowth {
    fn grow(&mut self, arena: &Arena, index: usize) -> Result<(), Full> {
        if index >= CAPACITY {
            return Err(Full);
        }
        let mut sample = self
            .publisher
            .loan_slice_uninit(1 << SHIFT)
            .map_err(|_| Full)?;
        *sample.user_header_mut() = SegmentHeader {
            epoch: self.epoch.0,
            index: index as u64,
        };
        let (start, len) = (sample.payload_mut().as_mut_ptr().cast::<Word>(), 1 << SHIFT);
        // SAFETY: the payload is fresh shared memory, which the kernel hands out zeroed, and a
        // word of zeros is a valid `Word`; no sample of this publisher is ever given back, so
        // this one was not in use before.
        let sample = unsafe { sample.assume_init() };
        sample.send().map_err(|_| Full)?;
        self.starts.push(start);
        let publisher = Box::new(Arc::clone(&self.publisher));
        // SAFETY: `start` points to `len` initialised words in the publisher's data segment, which
        // stays mapped while the publisher lives; the sample stays in its history for ever, so the
        // memory is never loaned again. Others only ever touch it through atomics.
        let segment = unsafe { Segment::in_shared_memory(start, len, publisher) };
        arena.attach(index, segment);
        Ok(())
    }

    fn reserve(&mut self, index: usize, from: usize, to: usize) -> Result<(), Full> {
        // Pages come into being when they are first touched, and touching one when there is no
        // room for it kills the process. So leave room to spare for the messages of the others,
        // and have the kernel make the pages now, which it may refuse.
        const SPARE: u64 = 8 << 20;
        let needed = ((to - from) * size_of::<Word>()) as u64;
        if super::free_bytes() < needed + SPARE {
            return Err(Full);
        }
        let start = *self.starts.get(index).ok_or(Full)?;
        populate(start.wrapping_add(from), to - from).map_err(|_| Full)
    }
}

/// Makes sure that `len` elements at `start`, in shared memory, are backed by memory.
pub(super) fn populate<T>(start: *const T, len: usize) -> rustix::io::Result<()> {
    let page = rustix::param::page_size();
    let end = start.wrapping_add(len).addr().next_multiple_of(page);
    let first = start.addr() - start.addr() % page;
    let place = start.cast_mut().with_addr(first).cast();
    // SAFETY: the advice changes no content. The range lies, but for the rest of its first and
    // last page, which belong to the same mapping, in a segment that stays mapped.
    let made = unsafe { madvise(place, end - first, Advice::LinuxPopulateWrite) };
    match made {
        // A kernel before 5.14 cannot; the room was asked for just now.
        Err(rustix::io::Errno::INVAL) => Ok(()),
        other => other,
    }
}

/// A segment as a reader sees it: mapped read-only.
fn received(sample: Sample<Ipc, [Word], SegmentHeader>) -> Segment {
    let (start, len) = (sample.payload().as_ptr(), sample.payload().len());
    // SAFETY: the payload is `len` atomics in shared memory that stays mapped while the sample
    // lives, and moving the sample does not move it.
    unsafe { Segment::in_shared_memory(start, len, Box::new(sample)) }
}

/// The newest store's arena, for those who wait for its bell.
#[derive(Debug, Clone, Default)]
pub(super) struct Current(Arc<RwLock<Option<Arc<Arena>>>>);

impl Current {
    pub(super) fn arena(&self) -> Option<Arc<Arena>> {
        let found = self.0.read().unwrap_or_else(PoisonError::into_inner);
        found.clone()
    }

    pub(super) fn epoch(&self) -> Option<Epoch> {
        self.arena()?.epoch()
    }

    fn set(&self, arena: Arc<Arena>) {
        *self.0.write().unwrap_or_else(PoisonError::into_inner) = Some(arena);
    }
}

/// A reader's end: receives segments, and notices a new store.
#[derive(Debug)]
pub(crate) struct ArenaSubscriber {
    subscriber: IpcSubscriber<Ipc, [Word], SegmentHeader>,
    arena: Option<(Epoch, Arc<Arena>)>,
    /// That of a store which does not show it yet: it may be filling it.
    coming: Option<(Epoch, Arc<Arena>)>,
    pub(super) current: Current,
    /// Segments of an epoch whose first segment is not here yet.
    early: Vec<Sample<Ipc, [Word], SegmentHeader>>,
}

impl ArenaSubscriber {
    pub(crate) fn open(node: &IpcNode) -> Result<Self, InstanceError> {
        let service = service(node)?;
        let make = || service.subscriber_builder().buffer_size(CAPACITY).create();
        let subscriber = port(node, make).map_err(|e| ipc("the arena's subscriber", e))?;
        Ok(Self {
            subscriber,
            arena: None,
            coming: None,
            current: Current::default(),
            early: Vec::new(),
        })
    }

    /// The newest arena that has shown itself, of those that had begun to arrive at the last
    /// [`Self::poll`].
    pub(super) fn newest(&mut self) -> Option<&(Epoch, Arc<Arena>)> {
        if let Some((epoch, arena)) = &self.coming
            && arena.epoch() == Some(*epoch)
        {
            self.current.set(Arc::clone(arena));
            self.arena = self.coming.take();
        }
        self.arena.as_ref()
    }

    /// Takes what has arrived.
    pub(crate) fn poll(&mut self) -> Result<(), InstanceError> {
        while let Some(sample) = self.subscriber.receive().map_err(|e| ipc("the arena", e))? {
            let header = *sample.user_header();
            let known = [&self.arena, &self.coming].into_iter().flatten();
            let known = known
                .map(|(epoch, arena)| (epoch.0, arena))
                .find(|(epoch, _)| *epoch == header.epoch);
            if let Some((_, arena)) = known {
                arena.attach(header.index as usize, received(sample));
            } else if header.index == 0 {
                // A first segment of another epoch: a new store, whose arena replaces the old.
                let arena = Arc::new(Arena::new(CAPACITY, SHIFT));
                arena.attach(0, received(sample));
                for early in self.early.drain(..) {
                    if early.user_header().epoch == header.epoch {
                        let index = early.user_header().index as usize;
                        arena.attach(index, received(early));
                    }
                }
                self.coming = Some((Epoch(header.epoch), arena));
            } else {
                self.early.push(sample);
            }
        }
        Ok(())
    }
}
