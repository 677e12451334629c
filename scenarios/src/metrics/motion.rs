//! How evenly the robot moved. This file owns the figures of speed, acceleration and jerk: mean
//! magnitudes over time and greatest ones, by differences from sample to sample of the speed that the
//! base had, and not of what it was told.

use super::{MOVING, Truth};
use serde::Serialize;

/// A robot that turns faster than this, rad/s, does not stand.
pub const TURNING: f64 = 0.05;

/// How the robot moved (Francis et al., "Principles and Guidelines for Evaluating Social Robot
/// Navigation Algorithms", 2023, table 3: velocity, acceleration and jerk based, stalled time).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Motion {
    /// Mean of the speed's magnitude, m/s: forwards, and of an omnidirectional base whichever way.
    pub mean_speed: f64,
    /// Its greatest, m/s.
    pub max_speed: f64,
    /// Mean of the magnitude of the change of forward speed, m/s^2.
    pub mean_acceleration: f64,
    /// Its greatest, m/s^2.
    pub max_acceleration: f64,
    /// Mean of the magnitude of the change of acceleration, m/s^3.
    pub mean_jerk: f64,
    /// Its greatest, m/s^3.
    pub max_jerk: f64,
    /// The time in which it moved slower than [`MOVING`] and turned slower than [`TURNING`], s.
    pub stalled: f64,
}

/// Values at times, s; each stands until the next.
type Series = Vec<(f64, f64)>;

/// The change per second between values; each lies half-way.
fn change(of: &Series) -> Series {
    let between = |pair: &[(f64, f64)]| {
        let (from, to) = (pair[0], pair[1]);
        let time = to.0 - from.0;
        (time > 0.0).then(|| (from.0 + 0.5 * time, (to.1 - from.1) / time))
    };
    of.windows(2).filter_map(between).collect()
}

/// Mean over time, as the trapezoid rule has it, and greatest of the magnitudes.
fn magnitudes(of: &Series) -> (f64, f64) {
    let (mut sum, mut time) = (0.0, 0.0);
    for pair in of.windows(2) {
        let length = pair[1].0 - pair[0].0;
        sum += 0.5 * (pair[0].1.abs() + pair[1].1.abs()) * length;
        time += length;
    }
    let greatest = of.iter().map(|(_, value)| value.abs()).fold(0.0, f64::max);
    (if time > 0.0 { sum / time } else { greatest }, greatest)
}

/// Forward speed, negative backwards; of a robot that goes sideways, too, how fast its centre moves.
pub(super) fn speed(sample: &Truth) -> f64 {
    if sample.lateral == 0.0 {
        sample.velocity.x
    } else {
        sample.velocity.x.hypot(sample.lateral)
    }
}

/// Of samples in order; `None` where no time passed.
pub(super) fn motion(samples: &[&Truth]) -> Option<Motion> {
    let (first, last) = (samples.first()?, samples.last()?);
    let sound = samples.iter().filter(|sample| speed(sample).is_finite());
    let mut speeds: Series = Vec::new();
    for sample in sound {
        let time = sample.time.since(first.time);
        // Of samples of one time the last counts.
        speeds.pop_if(|(known, _)| time <= *known);
        speeds.push((time, speed(sample)));
    }
    if last.time <= first.time || speeds.len() < 2 {
        return None;
    }
    let accelerations = change(&speeds);
    let (mean_speed, max_speed) = magnitudes(&speeds);
    let (mean_acceleration, max_acceleration) = magnitudes(&accelerations);
    let (mean_jerk, max_jerk) = magnitudes(&change(&accelerations));
    let stands = |sample: &Truth| speed(sample).abs() < MOVING && sample.velocity.y.abs() < TURNING;
    let stalled = samples
        .windows(2)
        .filter(|pair| stands(pair[0]))
        .map(|pair| pair[1].time.since(pair[0].time));
    Some(Motion {
        mean_speed,
        max_speed,
        mean_acceleration,
        max_acceleration,
        mean_jerk,
        max_jerk,
        stalled: stalled.sum(),
    })
}
