//! A session's large values: those that it gives out, and those of others that it reads.

use super::{Session, unique_number};
use crate::shm::large::{LargeAttribute, LargeError, LargeReadError, LargeSample};
use crate::shm::{now, pause};
use crate::{LargeHandle, Owner};
use std::sync::Arc;
use std::time::Duration;

/// How often it looks whether a value has come.
const NAP: Duration = Duration::from_millis(1);

impl Session {
    /// Makes this process one that gives an attribute large values: grids, scans, images. The schema
    /// says that the attribute is `large`. Who may write it is up to the store, at the commit of each
    /// value's handle.
    ///
    /// # Errors
    /// [`LargeError`].
    pub fn large(&mut self, owner: Owner, name: &str) -> Result<LargeAttribute, LargeError> {
        let schema = Arc::clone(&self.snapshot()?.schema);
        let attribute = schema.attribute_id(name)?;
        let Some(large) = schema.large_type(attribute) else {
            let attribute = name.to_owned();
            return Err(LargeError::NotLarge { attribute });
        };
        let stream = self.own_streams.open(&self.node, unique_number(), large)?;
        Ok(LargeAttribute::new(
            stream,
            (owner, name),
            (schema, attribute),
        ))
    }

    /// The large value that a handle from the graph leads to, waiting up to `patience` for it to arrive.
    /// The first value of an owner that this session reads arrives with that owner's next turn.
    ///
    /// # Errors
    /// [`LargeReadError`].
    pub fn read_large(
        &mut self,
        handle: &LargeHandle,
        patience: Duration,
    ) -> Result<LargeSample, LargeReadError> {
        let deadline = now() + patience;
        loop {
            let found = self.readers.find(&self.node, handle);
            let left = deadline.saturating_duration_since(now());
            match found {
                Err(LargeReadError::NotArrived) if !left.is_zero() => {
                    // The owner may be this very session.
                    self.own_streams.serve_newcomers();
                    pause(left.min(NAP));
                }
                other => return other,
            }
        }
    }
}
