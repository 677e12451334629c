//! Angles on the circle. Every angle that leaves this file lies in (-pi, pi].

use std::f64::consts::{PI, TAU};

/// `angle` brought into (-pi, pi].
pub fn wrap(angle: f64) -> f64 {
    let wrapped = angle.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}

/// The turn from `from` to `to` the short way round, in (-pi, pi].
pub fn difference(to: f64, from: f64) -> f64 {
    wrap(to - from)
}

/// The circular mean of `angles` (READING.md item 20): the direction of the sum of their unit
/// vectors. `None` where there are no angles or they cancel (a sum shorter than 1e-9), because then
/// every direction is as good as another.
pub fn circular_mean(angles: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (sine, cosine) = angles
        .into_iter()
        .fold((0.0, 0.0), |(s, c), a: f64| (s + a.sin(), c + a.cos()));
    (sine.hypot(cosine) > 1e-9).then(|| sine.atan2(cosine))
}

/// A direction and how sure of it we are: a one-dimensional Kalman filter on the circle.
///
/// The direction is taken to wander like Brownian motion. The innovation is wrapped, so headings
/// either side of pi average to pi and not to 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadingEstimate {
    angle: f64,
    variance: f64,
}

impl HeadingEstimate {
    /// The estimate after one measurement of `angle` with `variance` (rad^2).
    pub fn new(angle: f64, variance: f64) -> Self {
        Self {
            angle: wrap(angle),
            variance,
        }
    }

    /// The direction, in (-pi, pi].
    pub fn angle(self) -> f64 {
        self.angle
    }

    /// Its variance, rad^2.
    pub fn variance(self) -> f64 {
        self.variance
    }

    /// Lets time pass: `growth` (rad^2) is the diffusion times the time passed. The variance stops
    /// at pi^2 / 3, that of a direction nobody knows anything about.
    pub fn predict(&mut self, growth: f64) {
        self.variance = (self.variance + growth).min(PI * PI / 3.0);
    }

    /// Takes in a measurement of `angle` with `variance` (rad^2).
    pub fn update(&mut self, angle: f64, variance: f64) {
        let gain = self.variance / (self.variance + variance);
        self.angle = wrap(self.angle + gain * difference(angle, self.angle));
        self.variance *= 1.0 - gain;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn wrapping_keeps_the_direction_and_lands_in_the_half_open_interval(a in -50.0f64..50.0) {
            let w = wrap(a);
            prop_assert!(w > -PI && w <= PI);
            prop_assert!((w.sin() - a.sin()).abs() < 1e-9 && (w.cos() - a.cos()).abs() < 1e-9);
        }

        #[test]
        fn the_mean_turns_with_its_angles(
            angles in prop::collection::vec(-1.0f64..1.0, 1..8), turn in -PI..PI
        ) {
            let mean = circular_mean(angles.iter().copied()).unwrap();
            let turned = circular_mean(angles.iter().map(|a| a + turn)).unwrap();
            prop_assert!(difference(turned, mean + turn).abs() < 1e-9);
        }
    }

    #[test]
    fn opposite_directions_have_no_mean() {
        assert_eq!(circular_mean([0.5, 0.5 + PI]), None);
        assert_eq!(circular_mean([]), None);
    }

    #[test]
    fn headings_either_side_of_pi_smooth_to_pi() {
        let mut heading = HeadingEstimate::new(PI - 0.1, 0.02);
        heading.update(-PI + 0.1, 0.02);
        assert!(
            difference(heading.angle(), PI).abs() < 1e-9,
            "{}",
            heading.angle()
        );
        assert!((heading.variance() - 0.01).abs() < 1e-12);
    }
}
