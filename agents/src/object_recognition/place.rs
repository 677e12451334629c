//! Where an object stands: an average that forgets slowly, and jumps when detections agree that the
//! object is elsewhere. The variance stays positive.

use super::config::Config;
use crate::perception::{HeadingEstimate, circular_mean, difference};
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};

/// A static Kalman filter of a planar pose with the same variance along both axes.
#[derive(Debug, Clone)]
pub(super) struct Place {
    position: Point2<f64>,
    variance: f64,
    heading: HeadingEstimate,
    time: Time,
    /// Detections in a row that agree with each other and not with this place.
    elsewhere: Vec<Isometry2<f64>>,
}

impl Place {
    pub(super) fn new(time: Time, pose: Isometry2<f64>, config: &Config) -> Self {
        Self {
            position: Point2::from(pose.translation.vector),
            variance: config.position_noise.powi(2),
            heading: HeadingEstimate::new(pose.rotation.angle(), config.heading_noise.powi(2)),
            time,
            elsewhere: Vec::new(),
        }
    }

    /// A place known from before, as sure as one can be.
    pub(super) fn settled(time: Time, pose: Isometry2<f64>, config: &Config) -> Self {
        let mut place = Self::new(time, pose, config);
        place.variance = config.least_spread.powi(2);
        place
    }

    pub(super) fn position(&self) -> Point2<f64> {
        self.position
    }

    pub(super) fn pose(&self) -> Isometry2<f64> {
        Isometry2::new(self.position.coords, self.heading.angle())
    }

    fn predict(&mut self, time: Time, config: &Config) {
        let dt = time.since(self.time).max(0.0);
        self.variance = (self.variance + config.drift * dt).max(config.least_spread.powi(2));
        self.heading.predict(config.heading_drift * dt);
        self.time = self.time.max(time);
    }

    /// Takes in a detection: averaged in where it agrees with the place, else remembered, until
    /// enough in a row agree on another place.
    pub(super) fn update(&mut self, time: Time, pose: Isometry2<f64>, config: &Config) {
        self.predict(time, config);
        if self.agrees(&pose, config) {
            self.elsewhere.clear();
            let noise = config.position_noise.powi(2);
            let gain = self.variance / (self.variance + noise);
            self.position += (pose.translation.vector - self.position.coords) * gain;
            self.variance *= 1.0 - gain;
            self.heading
                .update(pose.rotation.angle(), config.heading_noise.powi(2));
            return;
        }
        // Two detections of one place differ by the noise of both.
        let spread = std::f64::consts::SQRT_2 * config.moved_deviations * config.position_noise;
        self.elsewhere
            .retain(|other| (other.translation.vector - pose.translation.vector).norm() <= spread);
        self.elsewhere.push(pose);
        if self.elsewhere.len() as u32 >= config.moved_sightings {
            let count = self.elsewhere.len() as f64;
            let sum: Vector2<f64> = self.elsewhere.iter().map(|p| p.translation.vector).sum();
            let heading = circular_mean(self.elsewhere.iter().map(|p| p.rotation.angle()))
                .unwrap_or_else(|| pose.rotation.angle());
            *self = Self::new(time, Isometry2::new(sum / count, heading), config);
            self.variance /= count;
        }
    }

    /// Whether the detection can be of this place and heading.
    fn agrees(&self, pose: &Isometry2<f64>, config: &Config) -> bool {
        let deviation = (self.variance + config.position_noise.powi(2)).sqrt();
        let turn = (self.heading.variance() + config.heading_noise.powi(2)).sqrt();
        let distance = (pose.translation.vector - self.position.coords).norm();
        let turned = difference(pose.rotation.angle(), self.heading.angle()).abs();
        distance <= config.moved_deviations * deviation && turned <= config.moved_deviations * turn
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::perception::synthetic::Random;
    use std::f64::consts::PI;

    fn noisy(x: f64, heading: f64, random: &mut Random) -> Isometry2<f64> {
        let noise = Vector2::new(random.normal(), random.normal()) * 0.1;
        Isometry2::new(
            Vector2::new(x, 0.0) + noise,
            heading + 0.15 * random.normal(),
        )
    }

    #[test]
    fn many_looks_average_the_noise_out_also_across_pi() {
        let mut random = Random::new(1);
        let config = Config::default();
        let mut place = Place::new(Time::default(), noisy(2.0, PI, &mut random), &config);
        for step in 1..200 {
            let time = Time::from_seconds(f64::from(step) * 0.1);
            place.update(time, noisy(2.0, PI, &mut random), &config);
        }
        assert!(
            (place.position() - Point2::new(2.0, 0.0)).norm() < 0.03,
            "{place:?}"
        );
        assert!(
            difference(place.pose().rotation.angle(), PI).abs() < 0.05,
            "{place:?}"
        );
    }

    #[test]
    fn one_stray_detection_moves_nothing_and_three_that_agree_do() {
        let mut random = Random::new(2);
        let config = Config::default();
        let mut place = Place::new(Time::default(), noisy(2.0, 0.0, &mut random), &config);
        for step in 1..50 {
            place.update(
                Time::from_seconds(f64::from(step)),
                noisy(2.0, 0.0, &mut random),
                &config,
            );
        }
        let before = place.pose();
        place.update(
            Time::from_seconds(50.0),
            noisy(5.0, 1.0, &mut random),
            &config,
        );
        place.update(
            Time::from_seconds(51.0),
            noisy(-5.0, 1.0, &mut random),
            &config,
        );
        assert_eq!(place.pose(), before);
        for step in 52..55 {
            place.update(
                Time::from_seconds(f64::from(step)),
                noisy(3.0, 2.0, &mut random),
                &config,
            );
        }
        assert!(
            (place.position() - Point2::new(3.0, 0.0)).norm() < 0.2,
            "{place:?}"
        );
        assert!(
            (place.pose().rotation.angle() - 2.0).abs() < 0.3,
            "{place:?}"
        );
    }
}
