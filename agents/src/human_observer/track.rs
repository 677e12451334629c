//! One track: a constant-velocity Kalman filter, a heading, and the evidence for and against
//! somebody being there. The covariance stays symmetric and positive definite (Joseph form).

use super::appearance::{self, Appearance};
use super::config::Tracking;
use super::scene::TrackedPerson;
use crate::perception::{HeadingEstimate, difference};
use dsr::Time;
use nalgebra::{Isometry2, Matrix2, Matrix2x4, Matrix4, Point2, Vector2, Vector4};

/// A possible person. The state is (x, y, vx, vy) in the world frame at `time`.
#[derive(Debug, Clone)]
pub(super) struct Track {
    /// The person's number, once confirmed.
    pub(super) id: Option<u64>,
    pub(super) time: Time,
    mean: Vector4<f64>,
    covariance: Matrix4<f64>,
    pub(super) heading: Option<HeadingEstimate>,
    pub(super) born: Time,
    pub(super) last_seen: Time,
    last_place: Point2<f64>,
    /// The number of the frame that last showed it.
    pub(super) last_frame: u64,
    /// Newest look in bit 0: 1 a hit, 0 a miss.
    looks: u32,
    look_count: u32,
    /// Probability that somebody is there.
    pub(super) existence: f64,
    /// Seconds that cameras looked and saw nobody since last seen, summed over the cameras.
    watched: f64,
    /// What the person looks like, where a detector told.
    pub(super) appearance: Option<Appearance>,
}

/// A detection in the world frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sighting {
    pub(super) time: Time,
    pub(super) position: Point2<f64>,
    pub(super) heading: Option<f64>,
    pub(super) score: f64,
    pub(super) appearance: Option<Appearance>,
}

/// How far a sighting lies from a track's prediction, and how far it may.
#[derive(Debug, Clone, Copy)]
pub(super) struct Innovation {
    residual: Vector2<f64>,
    covariance: Matrix2<f64>,
    inverse: Matrix2<f64>,
    /// Squared deviation of the heading in standard deviations, at most `HEADING_LIMIT`.
    heading: f64,
    /// What the looks say against it.
    appearance: f64,
}

/// Beyond three standard deviations a heading counts no further: detectors turn people round.
const HEADING_LIMIT: f64 = 9.0;

impl Innovation {
    /// The squared Mahalanobis distance.
    pub(super) fn distance(&self) -> f64 {
        self.residual.dot(&(self.inverse * self.residual))
    }

    /// Twice the negative logarithm of the residual's density, less 2 ln(2 pi), and what speaks
    /// against it by heading and looks: two people who pass close by differ in little else.
    pub(super) fn cost(&self) -> f64 {
        self.distance() + self.covariance.determinant().ln() + self.heading + self.appearance
    }
}

impl Track {
    pub(super) fn new(sighting: &Sighting, frame: u64, config: &Tracking) -> Self {
        let position = config.position_noise.powi(2);
        let velocity = config.speed_spread.powi(2);
        Self {
            id: None,
            time: sighting.time,
            mean: Vector4::new(sighting.position.x, sighting.position.y, 0.0, 0.0),
            covariance: Matrix4::from_diagonal(&Vector4::new(
                position, position, velocity, velocity,
            )),
            heading: sighting
                .heading
                .map(|angle| HeadingEstimate::new(angle, config.heading_noise.powi(2))),
            born: sighting.time,
            last_seen: sighting.time,
            last_place: sighting.position,
            last_frame: frame,
            looks: 1,
            look_count: 1,
            existence: 0.5,
            watched: 0.0,
            appearance: sighting.appearance.clone(),
        }
    }

    /// Somebody known from before.
    pub(super) fn resumed(person: &TrackedPerson, config: &Tracking) -> Self {
        let sighting = Sighting {
            time: person.last_seen,
            position: person.position(),
            heading: Some(person.pose.rotation.angle()),
            score: 1.0,
            appearance: None,
        };
        let mut track = Self::new(&sighting, 0, config);
        track.id = Some(person.id);
        track.existence = person.confidence.clamp(0.01, 0.999);
        track
            .mean
            .fixed_rows_mut::<2>(2)
            .copy_from(&person.velocity);
        let [xx, xy, yy] = person.covariance;
        // A covariance that is none (from a damaged graph) would poison the filter.
        if xx > 0.0 && yy > 0.0 && xx * yy > xy * xy && (xx + yy).is_finite() {
            let block = Matrix2::new(xx, xy, xy, yy);
            track
                .covariance
                .fixed_view_mut::<2, 2>(0, 0)
                .copy_from(&block);
        }
        track
    }

    /// The person at `now`, once confirmed and until gone.
    pub(super) fn person(&self, now: Time, config: &Tracking) -> Option<TrackedPerson> {
        let id = self.id.filter(|_| self.is_present(config))?;
        let mut track = self.clone();
        track.predict(now, config);
        Some(TrackedPerson {
            id,
            pose: Isometry2::new(
                track.position().coords,
                track.heading.map_or(0.0, HeadingEstimate::angle),
            ),
            velocity: track.velocity(),
            covariance: [
                track.covariance[(0, 0)],
                track.covariance[(0, 1)],
                track.covariance[(1, 1)],
            ],
            confidence: track.existence,
            last_seen: track.last_seen,
        })
    }

    pub(super) fn position(&self) -> Point2<f64> {
        Point2::new(self.mean[0], self.mean[1])
    }

    pub(super) fn velocity(&self) -> Vector2<f64> {
        self.mean.fixed_rows::<2>(2).into()
    }

    /// A sighting made at `time` further away than this cannot pass the gate, m: the ellipse's
    /// larger axis is below the root of its trace.
    pub(super) fn reach(&self, time: Time, config: &Tracking) -> f64 {
        let delay = self.time.since(time).max(0.0);
        let spread = (self.covariance[(0, 0)] + self.covariance[(1, 1)]).sqrt()
            + (self.covariance[(2, 2)] + self.covariance[(3, 3)]).sqrt() * delay
            + config.position_noise * std::f64::consts::SQRT_2;
        config.gate.sqrt() * spread + self.velocity().norm() * delay
    }

    /// Moves the track on to `time`; earlier times leave it as it is. Somebody unseen for longer
    /// than `coast_time` slows down: people turn and stop, and a track that runs on for ten seconds
    /// ends in another room.
    pub(super) fn predict(&mut self, time: Time, config: &Tracking) {
        let dt = time.since(self.time);
        if dt <= 0.0 {
            return;
        }
        let coasting = time.since(self.last_seen) > config.coast_time;
        let decay = if coasting {
            (-dt / config.velocity_decay).exp()
        } else {
            1.0
        };
        let reach = if coasting {
            config.velocity_decay * (1.0 - decay)
        } else {
            dt
        };
        let mut transition = Matrix4::identity();
        let mut noise = Matrix4::zeros();
        let q = config.acceleration_density;
        for axis in 0..2 {
            transition[(axis, axis + 2)] = reach;
            transition[(axis + 2, axis + 2)] = decay;
            noise[(axis, axis)] = q * dt.powi(3) / 3.0;
            noise[(axis, axis + 2)] = q * dt.powi(2) / 2.0;
            noise[(axis + 2, axis)] = q * dt.powi(2) / 2.0;
            noise[(axis + 2, axis + 2)] = q * dt;
        }
        self.mean = transition * self.mean;
        self.covariance = transition * self.covariance * transition.transpose() + noise;
        let excess = (self.covariance[(0, 0)] + self.covariance[(1, 1)])
            / (2.0 * config.greatest_spread.powi(2));
        if excess > 1.0 {
            self.covariance /= excess;
        }
        if let Some(heading) = &mut self.heading {
            heading.predict(config.heading_density * dt);
        }
        self.time = time;
    }

    /// The sighting seen from the track. A sighting older than the track's state measures where the
    /// track was then: `position - delay * velocity`.
    pub(super) fn innovation(&self, sighting: &Sighting, config: &Tracking) -> Option<Innovation> {
        let model = self.measurement(sighting);
        let noise = Matrix2::identity() * config.position_noise.powi(2);
        let covariance = model * self.covariance * model.transpose() + noise;
        let residual = sighting.position.coords - model * self.mean;
        let heading = match (self.heading, sighting.heading) {
            (Some(own), Some(seen)) => {
                let variance = own.variance() + config.heading_noise.powi(2);
                (difference(seen, own.angle()).powi(2) / variance).min(HEADING_LIMIT)
            }
            _ => 0.0,
        };
        Some(Innovation {
            residual,
            covariance,
            inverse: covariance.try_inverse()?,
            heading,
            appearance: self.unlike(sighting.appearance.as_ref(), config),
        })
    }

    /// What speaks against its looks being those.
    pub(super) fn unlike(&self, looks: Option<&Appearance>, config: &Tracking) -> f64 {
        appearance::cost(self.appearance.as_ref(), looks, &config.appearance)
    }

    fn measurement(&self, sighting: &Sighting) -> Matrix2x4<f64> {
        let delay = self.time.since(sighting.time).max(0.0);
        Matrix2x4::new(1.0, 0.0, -delay, 0.0, 0.0, 1.0, 0.0, -delay)
    }

    /// Takes in a sighting that frame number `frame` showed.
    pub(super) fn hit(
        &mut self,
        sighting: &Sighting,
        innovation: &Innovation,
        frame: u64,
        config: &Tracking,
    ) {
        let model = self.measurement(sighting);
        let gain = self.covariance * model.transpose() * innovation.inverse;
        self.mean += gain * innovation.residual;
        let rest = Matrix4::identity() - gain * model;
        let noise = config.position_noise.powi(2);
        self.covariance =
            rest * self.covariance * rest.transpose() + gain * gain.transpose() * noise;
        self.covariance = (self.covariance + self.covariance.transpose()) / 2.0;

        let speed = self.velocity().norm();
        let measured = match sighting.heading {
            Some(angle) => Some((angle, config.heading_noise)),
            // The direction of motion is as sure as the velocity is against its own noise.
            None if speed > config.walking_speed => {
                let spread = self.covariance.fixed_view::<2, 2>(2, 2).trace().sqrt();
                let velocity = self.velocity();
                Some((
                    velocity.y.atan2(velocity.x),
                    (spread / speed).max(config.heading_noise),
                ))
            }
            None => None,
        };
        if let Some((angle, noise)) = measured {
            match &mut self.heading {
                Some(heading) => heading.update(angle, noise.powi(2)),
                None => self.heading = Some(HeadingEstimate::new(angle, noise.powi(2))),
            }
        }

        match (&mut self.appearance, &sighting.appearance) {
            (Some(known), Some(image)) => known.take_in(image),
            (known @ None, Some(image)) => *known = Some(image.clone()),
            (_, None) => {}
        }

        self.last_seen = self.last_seen.max(sighting.time);
        self.last_place = self.position();
        self.last_frame = frame;
        self.watched = 0.0;
        self.look(true);
        // A detector that gives 1 is trusted ten times over, one that gives 0 not at all.
        let present = self.existence * (1.0 + 9.0 * sighting.score.clamp(0.0, 1.0));
        self.existence = (present / (present + 1.0 - self.existence)).min(0.999);
    }

    /// A camera looked at `time`, for the first time in `since` seconds, and did not see it. Cameras
    /// overlook somebody each for reasons of its own, so what they looked in vain adds up.
    pub(super) fn missed(&mut self, time: Time, since: f64, config: &Tracking) {
        let unseen = time.since(self.last_seen).max(0.0);
        self.watched += since.min(config.look_time).min(unseen);
        self.look(false);
        let present = self.existence * (1.0 - config.detection_probability);
        self.existence = present / (present + 1.0 - self.existence);
    }

    fn look(&mut self, hit: bool) {
        self.looks = self.looks << 1 | u32::from(hit);
        self.look_count = (self.look_count + 1).min(32);
    }

    /// Hits and misses among the last `confirmation_looks` looks.
    fn evidence(&self, config: &Tracking) -> (u32, u32) {
        let considered = config.confirmation_looks.clamp(1, 32);
        let hits = (self.looks & (u32::MAX >> (32 - considered))).count_ones();
        (hits, self.look_count.min(considered) - hits)
    }

    /// Hits among the last 32 looks.
    pub(super) fn hits(&self) -> u32 {
        self.looks.count_ones()
    }

    /// Whether the evidence makes a person of it.
    pub(super) fn is_confirmable(&self, config: &Tracking) -> bool {
        self.evidence(config).0 >= config.confirmation_hits
    }

    /// Whether the evidence speaks for the person being there, and not only for having been.
    pub(super) fn is_present(&self, config: &Tracking) -> bool {
        self.watched <= config.lost_in_view
    }

    /// For how long cameras have looked for it in vain, s, summed over the cameras.
    pub(super) fn watched(&self) -> f64 {
        self.watched
    }

    /// Whether the two headings differ by more than a right angle.
    pub(super) fn faces_away_from(&self, other: &Self) -> bool {
        match (self.heading, other.heading) {
            (Some(own), Some(other)) => {
                difference(own.angle(), other.angle()).abs() > std::f64::consts::FRAC_PI_2
            }
            _ => false,
        }
    }

    /// Whether it is a person seen a moment ago, so that the position can be relied on.
    pub(super) fn is_followed(&self, config: &Tracking) -> bool {
        self.id.is_some() && self.time.since(self.last_seen) <= config.look_time
    }

    /// Whether the evidence has run out at `now`.
    pub(super) fn is_dead(&self, now: Time, config: &Tracking) -> bool {
        let unseen = now.since(self.last_seen);
        if self.id.is_some() {
            unseen > config.lost_out_of_view
                || !self.is_present(config) && unseen > config.remembered
        } else {
            let misses = self.evidence(config).1;
            misses
                > config
                    .confirmation_looks
                    .saturating_sub(config.confirmation_hits)
                || unseen > config.tentative_time
        }
    }

    /// Whether a single detection no longer tells that it is the same person: cameras have looked in
    /// vain, or the gate has grown so wide that any false detection falls into it. Only a track with
    /// evidence of its own brings somebody lost back.
    pub(super) fn is_lost(&self, now: Time, config: &Tracking) -> bool {
        now.since(self.last_seen) > config.coast_time || !self.is_present(config)
    }

    /// How far `place` is from where the person should be, or was last seen (people come back
    /// through the door they left by), whichever is less, m.
    pub(super) fn distance_to(&self, place: Point2<f64>) -> f64 {
        (self.position() - place)
            .norm()
            .min((self.last_place - place).norm())
    }

    /// Where it was seen last.
    pub(super) fn last_place(&self) -> Point2<f64> {
        self.last_place
    }

    /// Takes the identity and the faith of `other`, who is the same person.
    pub(super) fn take_identity(&mut self, other: &Self) {
        self.id = other.id;
        self.born = self.born.min(other.born);
        self.existence = self.existence.max(other.existence);
        self.heading = self.heading.or(other.heading);
        if self.appearance.is_none() {
            self.appearance.clone_from(&other.appearance);
        }
    }
}
