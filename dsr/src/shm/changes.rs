//! Following the commits of an instance. This file guarantees that a subscriber which missed some is
//! told so.

use super::{InstanceError, Ipc, Subscriber};
use crate::{Change, Epoch, Filter, Schema, Version};
use iceoryx2::port::listener::Listener;
use std::time::Duration;

/// What a subscription gives.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Update {
    /// A commit that passes the filter.
    Change(Change),
    /// Commits were missed, the last of them of this version: read the snapshot.
    Gap(Version),
}

/// A subscription to commits.
#[derive(Debug)]
pub struct Changes {
    pub(super) subscriber: Subscriber<Change>,
    pub(super) listener: Listener<Ipc>,
    pub(super) filter: Filter,
    pub(super) epoch: Epoch,
    pub(super) seen: Version,
}

impl Changes {
    /// Waits up to `patience` for a commit by anybody.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn wait(&self, patience: Duration) -> Result<(), InstanceError> {
        super::wait(&self.listener, patience, "waiting for a commit")
    }

    /// The next commit that passes the filter, or the news that some were missed.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn next(&mut self, schema: &Schema) -> Result<Option<Update>, InstanceError> {
        while let Some(change) = self.subscriber.receive()? {
            // What the subscription started from is known already; another store's is not.
            if change.epoch == self.epoch && change.version <= self.seen {
                continue;
            }
            let follows = change.version == Version(self.seen.0 + 1);
            self.epoch = change.epoch;
            self.seen = change.version;
            if !follows {
                return Ok(Some(Update::Gap(change.version)));
            }
            if self.filter.passes(&change, schema) {
                return Ok(Some(Update::Change(change)));
            }
        }
        Ok(None)
    }
}
