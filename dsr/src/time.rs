//! Points in time. Everything in Cortex that has a time has this one; it is never read from a
//! clock inside a core, but handed in by the process that owns the clock.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::{Add, Sub};

/// A point in time: nanoseconds since 1970-01-01T00:00:00 UTC.
///
/// Under simulation it is the simulated time, which starts at the scenario's `start`.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
pub struct Time(i64);

impl Time {
    /// The point `nanoseconds` after 1970-01-01T00:00:00 UTC.
    pub const fn from_nanoseconds(nanoseconds: i64) -> Self {
        Self(nanoseconds)
    }

    /// The point `seconds` after 1970-01-01T00:00:00 UTC, rounded to the nanosecond.
    pub fn from_seconds(seconds: f64) -> Self {
        Self((seconds * 1e9).round() as i64)
    }

    /// Nanoseconds since 1970-01-01T00:00:00 UTC.
    pub const fn nanoseconds(self) -> i64 {
        self.0
    }

    /// Seconds since 1970-01-01T00:00:00 UTC.
    pub fn seconds(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// Seconds from `earlier` to `self`; negative where `self` comes first.
    pub fn since(self, earlier: Self) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 * 1e-9
    }
}

/// `seconds` later.
impl Add<f64> for Time {
    type Output = Self;
    fn add(self, seconds: f64) -> Self {
        Self(self.0.saturating_add(Self::from_seconds(seconds).0))
    }
}

/// `seconds` earlier.
impl Sub<f64> for Time {
    type Output = Self;
    fn sub(self, seconds: f64) -> Self {
        self + -seconds
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} s", self.seconds())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_add_and_subtract_exactly_to_the_nanosecond() {
        let t = Time::from_seconds(1_800_000_000.25);
        assert_eq!((t + 0.1) - 0.1, t);
        assert_eq!((t + 2.5).since(t).to_bits(), 2.5f64.to_bits());
    }
}
