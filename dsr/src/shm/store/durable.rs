//! What a store does with a state folder, and with what a killed store left in memory. This file guarantees
//! that a commit which is to be durable is acknowledged once it is on disk, and not before; and that none
//! which was acknowledged as durable is lost to an older graph in memory.

use super::super::orphan::{Orphan, OrphanError};
use super::super::session::{REQUESTS_EVENT, event};
use super::super::{InstanceError, ipc};
use super::answer::reply;
use super::{Store, StoreError, Waiting};
use crate::graph::Image;
use crate::state::{Keeper, Life};
use crate::{Durability, Epoch, Refusal, State, StateError, Transaction, Version};
use std::time::Duration;

/// What a killed store left in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Orphaned {
    image: Image,
    /// Its store's life and last version.
    last: (Epoch, Version),
}

impl Orphaned {
    /// Its last version.
    pub fn version(&self) -> Version {
        self.image.version()
    }

    /// The graph.
    pub fn image(&self) -> &Image {
        &self.image
    }
}

impl Store {
    /// From now on keeps the graph in a state folder, which first becomes what the graph is now.
    ///
    /// A commit that asks for it, or every one where `durability` is [`Durability::OnDisk`] and
    /// it does not ask for less, is acknowledged once it is on disk. The others get there within
    /// about `interval`.
    ///
    /// # Errors
    /// [`StoreError::State`] where the folder cannot be written to, or holds a newer version.
    pub fn keep(
        &mut self,
        mut state: State,
        interval: Duration,
        durability: Durability,
    ) -> Result<(), StoreError> {
        let snapshot = self.graph.snapshot();
        let life = Life {
            epoch: self.graph.epoch(),
            from: self.from,
        };
        state.replace(&Image::of(&snapshot).map_err(StateError::from)?, life)?;
        let bell = event(&self.node, REQUESTS_EVENT)?
            .notifier_builder()
            .create()
            .map_err(|e| ipc("the state's bell", e))?;
        let bell = move || {
            if let Err(error) = bell.notify() {
                tracing::debug!("waking the store: {error}");
            }
        };
        let keeper = Keeper::start(state, &snapshot, interval, Box::new(bell));
        self.keeper = Some(keeper.map_err(StoreError::Thread)?);
        self.durability = durability;
        Ok(())
    }

    /// The graph of the store before this one, if that was killed and its memory is still there: its last
    /// committed version. It comes from the state folder where a store had taken it over into that and ended
    /// before it showed itself.
    ///
    /// # Errors
    /// [`StoreError::Orphan`] where it cannot be read; [`StoreError::Diverged`] where the folder has something
    /// else.
    pub fn orphaned(&self, state: Option<&State>) -> Result<Option<Orphaned>, StoreError> {
        let Some(orphan) = Orphan::find(self.node.config())? else {
            return Ok(None);
        };
        let last = (orphan.epoch(), orphan.version());
        if let Some(state) = state
            && let Some(image) = state.load()?
        {
            match state.life()? {
                // The memory is never behind the disk.
                Some(life) if life.epoch == last.0 => {}
                Some(life) if life.from == Some(last) => return Ok(Some(Orphaned { image, last })),
                _ => return Err(StoreError::Diverged { version: last.1 }),
            }
        }
        let image = Image::of(&orphan.read()?).map_err(OrphanError::from)?;
        Ok(Some(Orphaned { image, last }))
    }

    /// Fills the empty graph with what a killed store left; versions go on from there.
    ///
    /// # Errors
    /// [`StoreError::Refused`].
    pub fn take_over(&mut self, orphaned: &Orphaned) -> Result<(), StoreError> {
        self.restore(&orphaned.image)?;
        self.from = Some(orphaned.last);
        Ok(())
    }

    /// Whether the commit is to be acknowledged only once it is on disk.
    pub(super) fn durability_of(&self, transaction: &Transaction) -> bool {
        let asked = match transaction.durability {
            Durability::AsTheStore => self.durability,
            other => other,
        };
        asked == Durability::OnDisk
    }

    pub(super) fn can_keep(&self) -> Result<(), Refusal> {
        let refused = |reason: &str| Err(Refusal::NotDurable(reason.to_owned()));
        match &self.keeper {
            None => refused("the store keeps no state; start it with --state"),
            Some(keeper) => keeper.failure().map_or(Ok(()), refused),
        }
    }

    /// Tells those who waited for it that their commits are on disk, or that they will not be.
    pub(super) fn answer_waiting(&mut self) -> Result<usize, InstanceError> {
        let Some(keeper) = self.keeper.as_ref().filter(|_| !self.waiting.is_empty()) else {
            return Ok(0);
        };
        // Looked at before what is durable: what was written before a failure counts.
        let failed = keeper.failure().is_some();
        let durable = keeper.durable();
        let before = self.waiting.len();
        let (told, waiting) = std::mem::take(&mut self.waiting)
            .into_iter()
            .partition(|asker| failed || asker.last <= durable);
        self.waiting = waiting;
        let told: Vec<Waiting> = told;
        for asker in told {
            if let Some(answered) = self.answered.get_mut(&asker.client)
                && answered.sequence == asker.sequence
            {
                for commit in answered.answers.iter_mut().flatten() {
                    commit.durable = commit.version <= durable;
                }
                reply(&asker.request, &answered.answers, &mut self.scratch)?;
            }
        }
        Ok(before - self.waiting.len())
    }
}
