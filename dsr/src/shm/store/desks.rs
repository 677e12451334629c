//! The desks of all sessions, as the store sees them. It guarantees that what lies on a desk is taken
//! for nothing but bytes, that no desk holds up another, and that one whose owner has ended or has
//! closed it gives its slot back.

use super::{Answer, Store};
use crate::Time;
use crate::arena::Arena;
use crate::desk::{self, ANSWER_BYTES, SLOTS};
use crate::shm::page::Pages;
use crate::shm::presence::Presence;
use crate::shm::session::{DESKS, Request};
use crate::shm::{InstanceError, IpcNode, Segment};
use crate::wire::decode_laid;
use std::time::{Duration, Instant};

/// How often the store looks which owners have ended.
const LOOK: Duration = Duration::from_millis(100);

/// A session's desk.
#[derive(Debug)]
struct Desk {
    page: Segment,
    slot: usize,
    /// The state of the request that was seen last.
    seen: u64,
    holder: Presence,
    /// Who asks, and what it asked last.
    request: Request,
}

/// All desks that have a slot.
#[derive(Debug)]
pub(super) struct Desks {
    arriving: Pages,
    adopted: Vec<Desk>,
    next_look: Instant,
}

impl Desks {
    pub(super) fn open(node: &IpcNode, now: Instant) -> Result<Self, InstanceError> {
        Ok(Self {
            arriving: Pages::open(node, DESKS)?,
            adopted: Vec::new(),
            next_look: now,
        })
    }

    /// Gives slots to the desks that have come, and takes back those of owners that are gone.
    pub(super) fn adopt(&mut self, arena: &Arena, now: Instant) -> Result<(), InstanceError> {
        if now >= self.next_look {
            self.next_look = now + LOOK;
            self.release(arena);
        }
        while let Some(page) = self.arriving.receive()? {
            let Some(owner) = desk::owner_of(page.words()) else {
                continue;
            };
            // Who is not given a slot asks by messages.
            let Some(holder) = Presence::of(owner.process) else {
                continue;
            };
            if self.free_slot().is_none() {
                self.release(arena);
            }
            let known = |desk: &Desk| desk.request.client == owner.client;
            let slot = self.free_slot().filter(|_| !self.adopted.iter().any(known));
            let Some(slot) = slot else { continue };
            desk::assign(arena.slot(slot).unwrap_or(&[]), owner.client);
            self.adopted.push(Desk {
                page,
                slot,
                seen: 0,
                holder,
                request: Request {
                    client: owner.client,
                    sequence: 0,
                    agent: owner.agent,
                    process: owner.process,
                    time: Time::default(),
                    transactions: Vec::new(),
                },
            });
        }
        Ok(())
    }

    fn free_slot(&self) -> Option<usize> {
        (0..SLOTS).find(|slot| self.adopted.iter().all(|desk| desk.slot != *slot))
    }

    fn release(&mut self, arena: &Arena) {
        self.adopted.retain(|desk| {
            let stays = desk::is_open(desk.page.words()) && !desk.holder.has_ended();
            if !stays {
                desk::assign(arena.slot(desk.slot).unwrap_or(&[]), 0);
            }
            stays
        });
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.adopted.len()
    }

    /// Whether a request lies on a desk that the store has not seen.
    pub(super) fn has_requests(&self) -> bool {
        self.adopted.iter().any(Desk::has_request)
    }
}

impl Desk {
    #[inline]
    fn has_request(&self) -> bool {
        desk::state(desk::request_of(self.page.words())) != self.seen
    }
}

/// What becomes of a request on a desk.
enum Laid {
    /// Its sender has asked for something else since.
    GivenUp,
    /// The answer is to be had by a message.
    ByRequest,
    /// The answer has so many bytes.
    Answered(usize),
}

impl Store {
    /// Answers the requests that lie on desks. How many.
    pub(super) fn answer_desks(&mut self) -> usize {
        let mut served = 0;
        for index in 0..self.desks.adopted.len() {
            if self.desks.adopted[index].has_request() {
                served += usize::from(self.answer_desk(index));
            }
        }
        served
    }

    /// Answers what lies on a desk, if it is a request for this store.
    fn answer_desk(&mut self, index: usize) -> bool {
        let epoch = self.graph.epoch();
        let desk = &mut self.desks.adopted[index];
        let words = desk::request_of(desk.page.words());
        let state = desk::state(words);
        let taken = desk::take(words, state, epoch, &mut self.scratch);
        // One that was being written is looked at again.
        if state & 1 == 0 {
            desk.seen = state;
        }
        let Some(sequence) = taken else {
            return false;
        };
        let (slot, mut request) = (desk.slot, std::mem::take(&mut desk.request));
        request.sequence = sequence;
        let mut bytes = [0; ANSWER_BYTES];
        let outcome = self.decide_laid(&mut request, &mut bytes);
        let desk = &mut self.desks.adopted[index];
        desk.request = request;
        let slot = self.graph.arena().slot(slot).unwrap_or(&[]);
        match outcome {
            Laid::GivenUp => return false,
            Laid::ByRequest => desk::answer(slot, sequence, None),
            Laid::Answered(length) => desk::answer(slot, sequence, bytes.get(..length)),
        }
        if desk::is_asleep(desk::request_of(desk.page.words())) {
            self.news.answered();
        }
        desk.request.transactions.clear();
        self.ring_after_look();
        self.settle();
        true
    }

    /// Decides on the request whose bytes are in the scratch, and encodes the answer.
    fn decide_laid(&mut self, request: &mut Request, bytes: &mut [u8]) -> Laid {
        let encode = |answer: &Answer, bytes: &mut [u8]| match postcard::to_slice(answer, bytes) {
            Ok(encoded) => Laid::Answered(encoded.len()),
            // Too long for a slot.
            Err(_) => Laid::ByRequest,
        };
        match decode_laid(&self.scratch) {
            Err(refusal) => encode(&Err(refusal), bytes),
            // A slot cannot wait for the disk.
            Ok((_, transaction)) if self.durability_of(&transaction) => Laid::ByRequest,
            Ok((time, transaction)) => {
                request.time = time;
                request.transactions.clear();
                request.transactions.push(transaction);
                if !self.is_answered(request) {
                    return Laid::GivenUp;
                }
                let answered = self.answered.get(&request.client);
                match answered.map(|answered| answered.answers.as_slice()) {
                    Some([answer]) => encode(answer, bytes),
                    _ => Laid::ByRequest,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
