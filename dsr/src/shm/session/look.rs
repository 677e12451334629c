//! Looking at the graph for longer than its history lasts. This file guarantees that a look gives
//! what was in one version, all of it, or an error.

use super::{PATIENCE, Session};
use crate::shm::lease::{Lease, LeaseError, Tenant};
use crate::shm::{now, pause};
use crate::{AttachError, LeaseRefusal, ReadError, Snapshot};
use std::sync::Arc;
use std::time::Duration;

/// How often a reader that was overtaken looks again before it asks for a lease.
const LOOKS: u32 = 3;
/// How often it asks for one.
const ASKS: u32 = 100;
/// How long that lease is.
const LOOK_TIME: Duration = Duration::from_mins(1);

/// How often it looks whether the store has answered.
const NAP: Duration = Duration::from_micros(100);

impl Session {
    /// Looks at the newest version, and again at a newer one where the look was overtaken; at last
    /// by a lease, where the store gives one, so that no writer is too fast. For what can be looked
    /// at again from the beginning.
    ///
    /// # Errors
    /// [`AttachError`]; [`ReadError::SnapshotTooOld`] in it where every look was overtaken.
    pub fn read<T>(
        &mut self,
        mut look: impl FnMut(&Snapshot) -> Result<T, ReadError>,
    ) -> Result<T, AttachError> {
        for _ in 0..LOOKS {
            match look(&self.snapshot()?) {
                Err(ReadError::SnapshotTooOld { .. }) => {}
                other => return Ok(other?),
            }
        }
        for _ in 0..ASKS {
            let snapshot = self.snapshot()?;
            match self.lease(&snapshot, LOOK_TIME) {
                Ok(lease) => return Ok(look(lease.snapshot())?),
                // Overtaken on the way to the store.
                Err(LeaseError::Refused(LeaseRefusal::TooOld { .. })) => {}
                Err(LeaseError::Attach(error)) => return Err(error),
                Err(error) => {
                    tracing::debug!("{error}");
                    break;
                }
            }
        }
        Ok(look(&self.snapshot()?)?)
    }

    /// Asks the store to keep a version readable for a time, however much is committed meanwhile:
    /// for a reader that takes longer than the history lasts. The lease ends when it is dropped,
    /// when its time is over, or when this process ends; and the store may revoke it where it
    /// holds too much memory. Reading by it then gives [`ReadError::SnapshotTooOld`], and never
    /// anything that the version was not.
    ///
    /// # Errors
    /// [`LeaseError`].
    pub fn lease(&mut self, snapshot: &Snapshot, time: Duration) -> Result<Lease, LeaseError> {
        let (epoch, arena) = self.arena()?.ok_or_else(|| self.no_store())?;
        if !Arc::ptr_eq(&arena, &snapshot.arena) {
            return Err(LeaseError::StoreRestarted);
        }
        let tenant = match &self.tenant {
            Some(tenant) => Arc::clone(tenant),
            None => Arc::clone(self.tenant.insert(Arc::new(Tenant::open(&self.node)?))),
        };
        let deadline = now() + PATIENCE;
        tenant.lease(snapshot, epoch, time, || {
            let left = deadline.saturating_duration_since(now());
            pause(left.min(NAP));
            Ok(!left.is_zero())
        })
    }
}
