//! A session's desk: how it asks for one transaction without a message. This file guarantees that what is
//! not answered there can be asked by a message under the same number, and is applied once all the same.

use super::commit::{Aim, RETRY};
use super::{CommitError, Session, ring};
use crate::arena::{Arena, Word};
use crate::desk::{self, Answered, DESK_WORDS, Owner, SLOTS};
use crate::shm::page::OwnPage;
use crate::shm::{IpcNode, bell, ipc, now, pause};
use crate::{Commit, Durability, Epoch, Refusal, Time, Transaction};
use std::time::{Duration, Instant};

pub(in crate::shm) const DESKS: &str = "graph/desks";
/// How often a session without a slot looks for one.
const LOOK: Duration = Duration::from_millis(10);
/// How long a new desk may take until the store has seen it, which looks every millisecond, before its owner
/// asks by a message.
const ARRIVAL: Duration = Duration::from_millis(20);
/// How often its owner looks whether it has.
const NAP: Duration = Duration::from_micros(100);
/// How many looks for an answer go by between two at the clock.
const ROUNDS: u32 = 64;

/// What a session writes its requests on.
#[derive(Debug)]
pub(super) struct Desk {
    /// `None` where there is no room for one: requests go by messages then.
    page: Option<OwnPage>,
    client: u64,
    /// Where the store of that epoch answers.
    slot: Option<(Epoch, usize)>,
    look_at: Instant,
    /// The bytes of an answer.
    answer: Vec<u8>,
}

impl Desk {
    pub(super) fn open(node: &IpcNode, owner: &Owner) -> Self {
        let mut fits = false;
        let page = OwnPage::open(node, DESKS, DESK_WORDS, |words| {
            fits = desk::format(words, owner);
        });
        if let Err(error) = &page {
            tracing::debug!("requests go by messages: {error}");
        }
        Self {
            page: page.ok().filter(|_| fits),
            client: owner.client,
            slot: None,
            look_at: now(),
            answer: Vec::new(),
        }
    }

    fn words(&self) -> &[Word] {
        self.page.as_ref().map_or(&[], OwnPage::words)
    }

    /// Where the store answers, once it has seen the desk.
    fn slot(&mut self, epoch: Epoch, arena: &Arena) -> Option<usize> {
        if let Some((of, slot)) = self.slot
            && of == epoch
            && is_of(arena, slot, self.client)
        {
            return Some(slot);
        }
        let time = now();
        if time < self.look_at {
            return None;
        }
        self.look_at = time + LOOK;
        self.page.as_ref()?.serve_newcomers();
        self.find_slot(epoch, arena)
    }

    fn find_slot(&mut self, epoch: Epoch, arena: &Arena) -> Option<usize> {
        let is_mine = |slot: &usize| is_of(arena, *slot, self.client);
        let slot = (0..SLOTS).find(is_mine);
        self.slot = slot.map(|slot| (epoch, slot));
        slot
    }

    /// Waits until the store has seen the new desk.
    fn arrive(&mut self, aim: &Aim) {
        let deadline = now() + ARRIVAL;
        while self.page.is_some()
            && self.find_slot(aim.epoch, &aim.arena).is_none()
            && now() < deadline
        {
            pause(NAP);
        }
    }
}

/// Whether a slot is that client's.
fn is_of(arena: &Arena, slot: usize, client: u64) -> bool {
    let words = arena.slot(slot);
    words.is_some_and(|words| desk::is_of(words, client))
}

impl Drop for Desk {
    fn drop(&mut self) {
        desk::close(self.words());
    }
}

impl Session {
    /// Whether the last request that could be was answered at the desk.
    #[cfg(test)]
    pub(in crate::shm) fn is_at_desk(&self) -> bool {
        let desk = self.desk.as_ref();
        desk.is_some_and(|desk| desk.slot.is_some())
    }

    /// Asks for a transaction by the desk, under the number of the last request. `None` where it has
    /// to be asked by a message.
    pub(super) fn ask_by_desk(
        &mut self,
        aim: &Aim,
        transaction: &Transaction,
        time: Time,
    ) -> Result<Option<Result<Commit, Refusal>>, CommitError> {
        if transaction.durability == Durability::OnDisk {
            return Ok(None);
        }
        let (client, sequence) = (self.id, self.sequence);
        let desk = self.desk.get_or_insert_with(|| {
            let owner = Owner {
                client,
                process: std::process::id(),
                agent: self.agent.clone(),
            };
            let mut desk = Desk::open(&self.node, &owner);
            ring(&self.wake_store);
            desk.arrive(aim);
            desk
        });
        let Some(slot) = desk.slot(aim.epoch, &aim.arena) else {
            return Ok(None);
        };
        let mut bytes = std::mem::take(&mut self.scratch);
        bytes.clear();
        let bytes = postcard::to_extend(&(time, transaction), bytes);
        self.scratch = bytes.map_err(|e| ipc("encoding a request", e))?;
        if !desk::lay(
            desk::request_of(desk.words()),
            sequence,
            aim.epoch,
            &self.scratch,
        ) {
            return Ok(None);
        }
        let is_asleep = aim.arena.is_asleep();
        if is_asleep {
            ring(&self.wake_store);
        }
        // Now that the store has something to do. One that was restarted takes nothing that is for the one before.
        let newest = self.newest_epoch()?;
        let Some(desk) = self.desk.as_mut().filter(|_| newest == Some(aim.epoch)) else {
            return Ok(None);
        };
        // A store that has to wake up first takes longer than is worth looking for.
        let spin = if is_asleep { Duration::ZERO } else { self.spin };
        let mut answer = std::mem::take(&mut desk.answer);
        let slot = aim.arena.slot(slot).unwrap_or(&[]);
        let mut look = || desk::answered(slot, sequence, &mut answer);
        let found = look_for(&mut look, spin)
            .or_else(|| sleep_for(&mut look, desk::request_of(desk.words()), &aim.arena));
        let outcome = (found == Some(Answered::Here)).then(|| postcard::from_bytes(&answer));
        desk.answer = answer;
        Ok(outcome
            .transpose()
            .map_err(|e| ipc("the store's answer", e))?)
    }
}

/// Looks for an answer for so long.
fn look_for(look: &mut impl FnMut() -> Option<Answered>, spin: Duration) -> Option<Answered> {
    if spin.is_zero() {
        return None;
    }
    let mut until = None;
    loop {
        for _ in 0..ROUNDS {
            if let Some(found) = look() {
                return Some(found);
            }
            std::hint::spin_loop();
        }
        let time = now();
        if time >= *until.get_or_insert(time + spin) {
            return None;
        }
    }
}

/// Sleeps until there is an answer, for so long as a request is waited for.
fn sleep_for(
    look: &mut impl FnMut() -> Option<Answered>,
    request: &[Word],
    arena: &Arena,
) -> Option<Answered> {
    let deadline = now() + RETRY;
    desk::set_asleep(request, true);
    let found = loop {
        let heard = bell::listen(arena);
        if let Some(found) = look() {
            break Some(found);
        }
        let left = deadline.saturating_duration_since(now());
        if left.is_zero() {
            break None;
        }
        bell::sleep(arena, heard, left);
    };
    desk::set_asleep(request, false);
    found
}
