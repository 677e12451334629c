//! How large a figure may be, whoever gives it: configuration, graph, recording. This file guarantees that no sum,
//! square or quotient of figures within these limits overflows, so that what may be entered has a finite cost.

use std::ops::RangeInclusive;

/// The most that a place may cost which can be entered.
pub const MOST_COST: f64 = 1000.0;
/// The longest length that a figure may be, metres.
pub const MOST_LENGTH: f64 = 1000.0;
/// How long a duration may be, seconds: a millisecond to some thirty years.
pub const DURATIONS: RangeInclusive<f64> = 1e-3..=1e9;
/// The greatest radius of a body, a person's or a robot's, metres.
pub const LARGEST_BODY: f64 = 10.0;
/// Nobody is faster, m/s: what is, was measured wrongly.
pub const MOST_SPEED: f64 = 100.0;
/// The greatest figure without a unit of its own, such as a bond's.
pub const MOST_FIGURE: f64 = 1e6;

/// Whether it is a length from 0 to [`MOST_LENGTH`].
pub(super) fn is_length(x: f64) -> bool {
    (0.0..=MOST_LENGTH).contains(&x)
}
