//! When a search must stop. This file guarantees that without a clock the limits depend on the
//! work done alone, so that the same task stops at the same place everywhere.

use crate::task::{Micro, State};
use std::fmt;

/// Reads the seconds since the search began; see [`Limits::with_clock`].
type Clock<'a> = dyn FnMut() -> f64 + 'a;

/// How far a search may go.
///
/// ```
/// use executive::Limits;
///
/// let started = 17.0; // whatever the caller's clock says
/// let limits = Limits::new().with_expansions(10_000).with_clock(2.5, move || 18.0 - started);
/// ```
pub struct Limits<'a> {
    expansions: u64,
    bytes: usize,
    seconds: f64,
    clock: Option<Box<Clock<'a>>>,
    expanded: u64,
    /// Where the expansions of a part of the search end.
    cap: u64,
    /// The state with the least estimate so far, and that estimate.
    nearest: Option<(Micro, State)>,
    milestones: Milestones,
}

/// When planning came how far, in seconds by the clock of its [`Limits`]; without one nothing is known.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Milestones {
    /// The actions were made, and the search began.
    pub grounded: Option<f64>,
    /// There was a plan, to be made better from then on.
    pub first_plan: Option<f64>,
}

impl fmt::Debug for Limits<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Limits")
            .field("expansions", &self.expansions)
            .field("bytes", &self.bytes)
            .field("seconds", &self.seconds)
            .field("expanded", &self.expanded)
            .finish_non_exhaustive()
    }
}

impl Default for Limits<'_> {
    fn default() -> Self {
        Self::new()
    }
}

/// Which limit was met.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// As many states were expanded as allowed.
    Expansions,
    /// The memory allowed is in use.
    Memory,
    /// The time is over, or the caller cancelled.
    Time,
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Expansions => "as many states were expanded as allowed",
            Self::Memory => "the memory allowed is used up",
            Self::Time => "the time allowed is over",
        })
    }
}

impl<'a> Limits<'a> {
    /// No limit but 2 GB of memory.
    pub fn new() -> Self {
        Self {
            expansions: u64::MAX,
            bytes: 2_000_000_000,
            seconds: f64::INFINITY,
            clock: None,
            expanded: 0,
            cap: u64::MAX,
            nearest: None,
            milestones: Milestones::default(),
        }
    }

    /// Stops after `count` states were expanded.
    #[must_use]
    pub fn with_expansions(mut self, count: u64) -> Self {
        self.expansions = count;
        self
    }

    /// Stops before the states and queues of a search take more than `bytes`.
    #[must_use]
    pub fn with_bytes(mut self, bytes: usize) -> Self {
        self.bytes = bytes;
        self
    }

    /// Stops once `elapsed` gives more than `seconds`. It is asked every few states; giving
    /// infinity cancels the search.
    #[must_use]
    pub fn with_clock(mut self, seconds: f64, elapsed: impl FnMut() -> f64 + 'a) -> Self {
        self.seconds = seconds;
        self.clock = Some(Box::new(elapsed));
        self
    }

    /// How many states were expanded under these limits so far.
    pub fn expanded(&self) -> u64 {
        self.expanded
    }

    /// When planning under these limits came how far.
    pub fn milestones(&self) -> Milestones {
        self.milestones
    }

    /// Notes that a search begins, if it is the first.
    pub(crate) fn note_grounded(&mut self) {
        if self.milestones.grounded.is_none() {
            self.milestones.grounded = self.clock.as_mut().map(|elapsed| elapsed());
        }
    }

    /// Notes that there is a plan, if it is the first.
    pub(crate) fn note_plan(&mut self) {
        if self.milestones.first_plan.is_none() {
            self.milestones.first_plan = self.clock.as_mut().map(|elapsed| elapsed());
        }
    }

    /// Notes an estimate of how far a state is from the goal.
    pub(crate) fn note(&mut self, estimate: Micro, state: &[u64]) {
        if self
            .nearest
            .as_ref()
            .is_none_or(|(least, _)| estimate < *least)
        {
            self.nearest = Some((estimate, state.to_vec()));
        }
    }

    /// The state that was noted to be nearest to the goal.
    pub(crate) fn nearest(&self) -> Option<&[u64]> {
        self.nearest.as_ref().map(|(_, state)| state.as_slice())
    }

    /// Forgets what was noted of another task.
    pub(crate) fn forget_nearest(&mut self) {
        self.nearest = None;
    }

    /// Allows so many expansions more, until [`Self::uncap`].
    pub(crate) fn cap(&mut self, more: u64) {
        self.cap = self.expanded.saturating_add(more);
    }

    /// Whether as many states were expanded as these limits allow at all.
    pub(crate) fn is_spent(&self) -> bool {
        self.expanded >= self.expansions
    }

    pub(crate) fn uncap(&mut self) {
        self.cap = u64::MAX;
    }

    /// Whether the time is over.
    ///
    /// # Errors
    /// [`StopReason::Time`].
    pub(crate) fn check_time(&mut self) -> Result<(), StopReason> {
        if let Some(elapsed) = &mut self.clock
            && elapsed() > self.seconds
        {
            return Err(StopReason::Time);
        }
        Ok(())
    }

    /// Whether work that holds `bytes` may go on.
    ///
    /// # Errors
    /// [`StopReason::Memory`], [`StopReason::Time`].
    pub(crate) fn check(&mut self, bytes: usize) -> Result<(), StopReason> {
        if bytes > self.bytes {
            return Err(StopReason::Memory);
        }
        self.check_time()
    }

    /// Counts one expansion of a search that holds `bytes`.
    ///
    /// # Errors
    /// The limit that does not allow it.
    pub(crate) fn expand(&mut self, bytes: usize) -> Result<(), StopReason> {
        if self.expanded >= self.expansions.min(self.cap) {
            return Err(StopReason::Expansions);
        }
        if bytes > self.bytes {
            return Err(StopReason::Memory);
        }
        if self.expanded.is_multiple_of(16) {
            self.check_time()?;
        }
        self.expanded += 1;
        Ok(())
    }
}
