//! Following the commits of an instance. This file guarantees that a subscriber which missed some is
//! told so.

use super::arena::Current;
use super::{InstanceError, Subscriber, bell, now, pause};
use crate::{Change, Epoch, Filter, Schema, Version};
use std::collections::VecDeque;
use std::time::Duration;

/// What a subscription gives.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Update {
    /// A commit that passes the filter.
    Change(Change),
    /// Commits were missed, the last of them of this version: read the snapshot.
    Gap(Version),
}

/// A subscription to commits. What a store had committed and not handed out when it was killed is a gap: it
/// is told with the next commit, or before that, once the session has looked at the new store's graph.
#[derive(Debug)]
pub struct Changes {
    pub(super) subscriber: Subscriber<Vec<Change>>,
    /// What has come and was not given out.
    pub(super) waiting: VecDeque<Change>,
    pub(super) current: Current,
    pub(super) filter: Filter,
    pub(super) epoch: Epoch,
    /// The first life of the store of the graph that it follows, where that is known.
    pub(super) lineage: Option<u64>,
    pub(super) seen: Version,
    /// Lives of the store that were followed before: a gap stands for whatever of them comes late.
    pub(super) past: Vec<Epoch>,
}

impl Changes {
    /// Waits up to `patience` for a commit by anybody.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn wait(&mut self, patience: Duration) -> Result<(), InstanceError> {
        let deadline = now() + patience;
        loop {
            let arena = self.current.arena();
            let heard = arena.as_deref().map_or(0, bell::listen);
            self.fetch()?;
            let left = deadline.saturating_duration_since(now());
            if !self.waiting.is_empty() || left.is_zero() {
                return Ok(());
            }
            // The bell of a store that died stays silent, and the next store has another.
            let nap = left.min(Duration::from_millis(20));
            match &arena {
                Some(arena) => bell::sleep(arena, heard, nap),
                None => pause(nap),
            }
        }
    }

    /// Follows another store from now on, and tells whether it goes on with the same graph, as far as
    /// this process sees it.
    fn turn_to(&mut self, epoch: Epoch) -> bool {
        let before = self.lineage;
        self.past.push(self.epoch);
        self.epoch = epoch;
        self.lineage = self.current.arena().and_then(|arena| {
            let root = arena.newest_root().ok()?;
            (arena.epoch() == Some(epoch)).then_some(root.lineage)
        });
        self.lineage.is_some() && self.lineage == before
    }

    /// What the store before the one that this process sees had committed and was not heard before it
    /// ended.
    fn missed(&mut self) -> Option<Update> {
        let arena = self.current.arena()?;
        let epoch = arena.epoch().filter(|epoch| *epoch != self.epoch)?;
        let first = Version(arena.first_shown());
        if self.turn_to(epoch) && first <= self.seen {
            return None;
        }
        self.seen = first;
        Some(Update::Gap(first))
    }

    fn fetch(&mut self) -> Result<(), InstanceError> {
        while let Some(changes) = self.subscriber.receive()? {
            self.waiting.extend(changes);
        }
        Ok(())
    }

    /// The next commit that passes the filter, or the news that some were missed.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn next(&mut self, schema: &Schema) -> Result<Option<Update>, InstanceError> {
        loop {
            let Some(change) = self.waiting.pop_front() else {
                match self.subscriber.receive()? {
                    Some(changes) => self.waiting.extend(changes),
                    None => return Ok(self.missed()),
                }
                continue;
            };
            // What the subscription started from is known already; another store's is not.
            let is_known = change.epoch == self.epoch && change.version <= self.seen;
            if is_known || self.past.contains(&change.epoch) {
                continue;
            }
            let same = change.epoch == self.epoch || self.turn_to(change.epoch);
            let follows = same && change.version == Version(self.seen.0 + 1);
            self.seen = change.version;
            if !follows {
                return Ok(Some(Update::Gap(change.version)));
            }
            if self.filter.passes(&change, schema) {
                return Ok(Some(Update::Change(change)));
            }
        }
    }
}
