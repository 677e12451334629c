//! The world's clock, as a process of an instance hears it. This file guarantees that whoever waits
//! for a tick is woken by one that comes meanwhile.

use super::{Session, event};
use crate::Time;
use crate::shm::{InstanceError, Publisher, Subscriber, ipc, port, wait};
use serde::{Deserialize, Serialize};
use std::time::Duration;
use thiserror::Error;

const CLOCK: &str = "clock";
const CLOCK_EVENT: &str = "clock/tick";

/// Why there is no tick.
#[derive(Debug, Error)]
pub enum ClockError {
    /// The instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
}

/// A step of the world's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tick {
    /// How many came before it.
    pub index: u64,
    /// The world's time.
    pub time: Time,
}

impl Session {
    /// The world's end of the clock: sends ticks and wakes those who wait for them.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn clock(
        &self,
    ) -> Result<impl Fn(Tick) -> Result<(), InstanceError> + use<>, InstanceError> {
        let publisher = Publisher::<Tick>::open(&self.node, CLOCK)?;
        let event = event(&self.node, CLOCK_EVENT)?;
        let notifier = port(&self.node, || event.notifier_builder().create())
            .map_err(|e| ipc("the clock", e))?;
        Ok(move |tick| {
            publisher.send(&tick)?;
            notifier
                .notify()
                .map_err(|e| ipc("the clock", e))
                .map(|_| ())
        })
    }

    /// Every tick from now on, for who must miss none: [`Self::wait_for_tick`] gives the newest.
    ///
    /// # Errors
    /// [`InstanceError`].
    pub fn ticks(&self) -> Result<Subscriber<Tick>, InstanceError> {
        Subscriber::open(&self.node, CLOCK)
    }

    /// The newest tick since the last call, waiting up to `patience` for one.
    ///
    /// # Errors
    /// [`ClockError`].
    pub fn wait_for_tick(&mut self, patience: Duration) -> Result<Option<Tick>, ClockError> {
        if self.clock.is_none() {
            let event = event(&self.node, CLOCK_EVENT)?;
            let listener = port(&self.node, || event.listener_builder().create())
                .map_err(|e| ipc("the clock", e))?;
            self.clock = Some((listener, Subscriber::open(&self.node, CLOCK)?));
        }
        let Some((listener, ticks)) = &mut self.clock else {
            return Ok(None);
        };
        if let Some(tick) = ticks.newest()? {
            return Ok(Some(tick));
        }
        wait(listener, patience, "waiting for a tick")?;
        Ok(ticks.newest()?)
    }
}
