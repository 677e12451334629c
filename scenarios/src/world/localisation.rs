//! The robot's idea of where it is: the truth plus an error that wanders but stays bounded, as
//! wheel odometry corrected by a map does.

use super::random::normal;
use crate::scenario::Localisation;
use nalgebra::{Isometry2, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;

/// The error of a localiser: an Ornstein-Uhlenbeck process in x, y (robot frame) and heading.
#[derive(Debug, Clone)]
pub(super) struct Drift {
    deviation: Vector3<f64>,
    correlation_time: f64,
    error: Vector3<f64>,
}

impl Drift {
    pub(super) fn new(localisation: &Localisation, random: &mut ChaCha8Rng) -> Self {
        let Localisation {
            position_noise,
            heading_noise,
            correlation_time,
            ..
        } = *localisation;
        let deviation = Vector3::new(position_noise, position_noise, heading_noise);
        let error = deviation.map(|deviation| normal(random, deviation));
        Self {
            deviation,
            correlation_time,
            error,
        }
    }

    /// The pose measured `dt` seconds after the one before.
    pub(super) fn measure(
        &mut self,
        pose: &Isometry2<f64>,
        dt: f64,
        random: &mut ChaCha8Rng,
    ) -> Isometry2<f64> {
        // Exact for any dt: the variance stays what it is however often one measures.
        let keep = (-dt / self.correlation_time).exp();
        let fresh = (1.0 - keep * keep).sqrt();
        self.error = self.error.zip_map(&self.deviation, |error, deviation| {
            let moved = error * keep + normal(random, deviation * fresh);
            moved.clamp(-3.0 * deviation, 3.0 * deviation)
        });
        pose * Isometry2::new(Vector2::new(self.error.x, self.error.y), self.error.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Robot;
    use crate::world::random::stream;

    #[test]
    fn the_error_is_bounded_has_the_stated_width_and_wanders_slowly() {
        let localisation = Robot::default().localisation;
        let mut random = stream(3, "localisation");
        let mut drift = Drift::new(&localisation, &mut random);
        let mut errors = Vec::new();
        for _ in 0..20_000 {
            let measured = drift.measure(&Isometry2::identity(), 0.1, &mut random);
            errors.push(measured.translation.x);
        }
        let mean_square = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
        assert!(
            (mean_square.sqrt() - 0.015).abs() < 0.002,
            "{}",
            mean_square.sqrt()
        );
        assert!(errors.iter().all(|e| e.abs() <= 0.045 + 1e-12));
        let jumps = errors
            .windows(2)
            .map(|w| (w[1] - w[0]).powi(2))
            .sum::<f64>();
        let jump = (jumps / errors.len() as f64).sqrt();
        assert!(
            jump < 0.005,
            "one measurement to the next moves by {jump} m"
        );
    }
}
