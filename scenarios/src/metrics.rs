//! What a run was like for the people in it, from the recorded truth (TD section 6; READING.md items
//! 15 to 18). This file owns the definition of each figure; all are functions of the samples alone,
//! to the bit, and every figure returned is finite.
//!
//! World frame, SI units, radians; shares of time in percent.

mod company;
mod motion;
mod object_space;
mod shortest;
#[cfg(test)]
mod tests;
mod tracking;

pub use company::{COMPLIANT, Company, FORESIGHT, HALL, PsiDistance};
pub use motion::{Motion, TURNING};
pub(crate) use object_space::mapped;
pub use object_space::{ObjectSpace, SpacesError, object_spaces};
pub use shortest::{shortest_way, spl};
pub use tracking::{NEAR_ENOUGH, TrackingFigures, TrackingScore};

use crate::world::{Collisions, Truth, wrap};
use agents::social_mapping::{Zone, zone_at};
use dsr::Time;
use nalgebra::{Isometry2, Point2};
use serde::Serialize;
use std::collections::BTreeMap;

/// Heading changes are summed over the path resampled at this arc length, m.
pub const CHC_STEP: f64 = 0.2;
/// A robot whose speed is above this, m/s, counts as moving.
pub const MOVING: f64 = 0.05;

/// All figures of one run.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Metrics {
    /// The robot's way; `None` without samples.
    pub robot: Option<RobotMetrics>,
    /// How evenly it moved; `None` where no time passed.
    pub motion: Option<Motion>,
    /// How near it came to people on the whole; `None` where nobody was ever there.
    pub company: Option<Company>,
    /// Everybody who was ever there, sorted by name.
    pub people: Vec<PersonMetrics>,
    /// Shares of the time; `None` where no time passed.
    pub psi: Option<Psi>,
    /// Shares of the time in which the robot moved faster than [`MOVING`]; `None` where it never
    /// did. Recorded people do not see the robot, so whoever walks into it while it waits is not
    /// its doing.
    pub psi_moving: Option<Psi>,
}

/// How the robot moved.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RobotMetrics {
    /// Sum of the distances from sample to sample, m (TD `d_t`).
    pub path_length: f64,
    /// From the first sample to the last, s (TD tau).
    pub duration: f64,
    /// Cumulative heading changes, rad: the sum of the absolute wrapped changes of direction along
    /// the path resampled every [`CHC_STEP`] of arc length, without the rest that is shorter than
    /// a step. Turning in place does not count. Not comparable with the papers' figures, whose
    /// code filters its input (READING.md item 15).
    pub chc: f64,
    /// Collisions with anything.
    pub collisions: u64,
    /// With what.
    pub collisions_by_kind: Collisions,
}

/// How close the robot came to one person. Over the samples: between two of them both may have
/// come closer by no more than they moved.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PersonMetrics {
    /// Who.
    pub name: String,
    /// Least distance of the centres, m (the papers' `d_min`; READING.md item 17).
    pub min_distance: f64,
    /// Least distance of the bodies' surfaces, m; 0 in contact.
    pub min_clearance: f64,
}

/// Shares of time, percent. Each moment belongs to exactly one of the four zones, the closest of
/// all people's, by [`zone_at`] with its preset; so the four add up to 100 (READING.md item 16).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Psi {
    /// In somebody's intimate zone.
    pub intimate: f64,
    /// In somebody's personal zone and nobody's intimate one.
    pub personal: f64,
    /// In somebody's social zone and no closer one.
    pub social: f64,
    /// In nobody's zone.
    pub public: f64,
    /// In the space of an object in use, see [`ObjectSpace::is_in_use`]. Counted apart from the four.
    pub objects: f64,
}

/// When and with whom a run was closest.
#[derive(Debug, Clone, PartialEq)]
pub struct Encounter {
    /// The first such moment.
    pub time: Time,
    /// The person.
    pub person: String,
    /// Distance of the bodies' surfaces, m; 0 in contact.
    pub clearance: f64,
}

/// The figures of the run that `samples` record, for a robot of `robot_radius` among the `spaces`
/// of objects.
///
/// Samples may come in any order; those of one time weigh nothing but the last. A sample stands for
/// the time until the next one. Robot poses and people that are not finite are left out.
/// O(samples x (people + corners of spaces)).
pub fn measure(samples: &[Truth], robot_radius: f64, spaces: &[ObjectSpace]) -> Metrics {
    let samples = in_order(samples);
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return Metrics::default();
    };
    let path: Vec<_> = samples.iter().map(|sample| robot(sample)).collect();
    let (all, moving) = tally(&samples, spaces);
    Metrics {
        robot: Some(RobotMetrics {
            path_length: path_length(&path),
            duration: last.time.since(first.time),
            chc: heading_changes(&path, CHC_STEP),
            collisions: last.collisions.total(),
            collisions_by_kind: last.collisions,
        }),
        motion: motion::motion(&samples),
        company: company::company(&samples, robot_radius),
        people: people(&samples, robot_radius),
        psi: all.psi(),
        psi_moving: moving.psi(),
    }
}

/// The moment at which the robot was closest to somebody, if anybody was ever there.
pub fn closest_encounter(samples: &[Truth], robot_radius: f64) -> Option<Encounter> {
    let mut closest: Option<Encounter> = None;
    for sample in in_order(samples) {
        for (person, _, clearance) in distances(sample, robot_radius) {
            if closest.as_ref().is_none_or(|c| clearance < c.clearance) {
                closest = Some(Encounter {
                    time: sample.time,
                    person: person.to_owned(),
                    clearance,
                });
            }
        }
    }
    closest
}

/// The length of the polyline through `path`, m.
pub fn path_length(path: &[Point2<f64>]) -> f64 {
    path.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum()
}

/// The sum of the absolute heading changes, rad, along `path` resampled every `step` metres of arc
/// length; see [`RobotMetrics::chc`].
pub fn heading_changes(path: &[Point2<f64>], step: f64) -> f64 {
    let resampled = resample(path, step);
    let headings: Vec<f64> = resampled
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .filter(|way| way.norm() > 1e-9)
        .map(|way| way.y.atan2(way.x))
        .collect();
    headings
        .windows(2)
        .map(|pair| wrap(pair[1] - pair[0]).abs())
        .sum()
}

/// The points of `path` at arc lengths 0, `step`, 2 `step` ... up to its length.
fn resample(path: &[Point2<f64>], step: f64) -> Vec<Point2<f64>> {
    /// Rounding does not lose a point at the very end, m.
    const PLAY: f64 = 1e-9;
    let mut points: Vec<_> = path.first().copied().into_iter().collect();
    let mut travelled = 0.0;
    for pair in path.windows(2) {
        let way = pair[1] - pair[0];
        let length = way.norm();
        if length <= 0.0 {
            continue;
        }
        while let next = points.len() as f64 * step
            && next <= travelled + length + PLAY
        {
            points.push(pair[0] + way * ((next - travelled) / length).clamp(0.0, 1.0));
        }
        travelled += length;
    }
    points
}

/// The samples whose robot pose is finite, by time; equal times stay in their order.
pub(crate) fn in_order(samples: &[Truth]) -> Vec<&Truth> {
    let mut ordered: Vec<_> = samples
        .iter()
        .filter(|sample| is_finite(&robot(sample)))
        .collect();
    ordered.sort_by_key(|sample| sample.time);
    ordered
}

pub(crate) fn is_finite(point: &Point2<f64>) -> bool {
    point.x.is_finite() && point.y.is_finite()
}

/// The robot's centre.
pub(crate) fn robot(sample: &Truth) -> Point2<f64> {
    sample.world_from_robot.translation.vector.into()
}

/// Name, distance and clearance of everybody in a sample.
fn distances(sample: &Truth, robot_radius: f64) -> impl Iterator<Item = (&str, f64, f64)> {
    let robot = robot(sample);
    sample.people.iter().filter_map(move |body| {
        let distance = (body.position - robot).norm();
        let clearance = (distance - body.radius - robot_radius).max(0.0);
        (distance.is_finite() && body.radius.is_finite()).then_some((
            body.name.as_str(),
            distance,
            clearance,
        ))
    })
}

fn people(samples: &[&Truth], robot_radius: f64) -> Vec<PersonMetrics> {
    let mut least: BTreeMap<&str, (f64, f64)> = BTreeMap::new();
    for sample in samples {
        for (name, distance, clearance) in distances(sample, robot_radius) {
            let entry = least.entry(name).or_insert((distance, clearance));
            *entry = (entry.0.min(distance), entry.1.min(clearance));
        }
    }
    least
        .into_iter()
        .map(|(name, (min_distance, min_clearance))| PersonMetrics {
            name: name.to_owned(),
            min_distance,
            min_clearance,
        })
        .collect()
}

/// Time in zones and spaces, nanoseconds, so that the sums are exact.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    intimate: i128,
    personal: i128,
    social: i128,
    public: i128,
    objects: i128,
}

impl Tally {
    fn add(&mut self, zone: Zone, in_space: bool, nanoseconds: i128) {
        *match zone {
            Zone::Intimate => &mut self.intimate,
            Zone::Personal => &mut self.personal,
            Zone::Social => &mut self.social,
            Zone::Public => &mut self.public,
        } += nanoseconds;
        self.objects += if in_space { nanoseconds } else { 0 };
    }

    fn psi(&self) -> Option<Psi> {
        let total = self.intimate + self.personal + self.social + self.public;
        let share = |part: i128| 100.0 * part as f64 / total as f64;
        (total > 0).then(|| Psi {
            intimate: share(self.intimate),
            personal: share(self.personal),
            social: share(self.social),
            public: share(self.public),
            objects: share(self.objects),
        })
    }
}

/// The time of all samples, and of those in which the robot moves.
fn tally(samples: &[&Truth], spaces: &[ObjectSpace]) -> (Tally, Tally) {
    let (mut all, mut moving) = (Tally::default(), Tally::default());
    for pair in samples.windows(2) {
        let (now, next) = (pair[0], pair[1]);
        let [from, to] = [now, next].map(|sample| i128::from(sample.time.nanoseconds()));
        let nanoseconds = to - from;
        if nanoseconds == 0 {
            continue;
        }
        let place = robot(now);
        let bodies: Vec<_> = now
            .people
            .iter()
            .filter(|body| is_finite(&body.position) && body.heading.is_finite())
            .map(|body| Isometry2::new(body.position.coords, body.heading))
            .collect();
        let zone = zone_at(place, &bodies);
        let in_space = spaces
            .iter()
            .any(|space| space.is_in_use(now.time) && space.contains(place));
        all.add(zone, in_space, nanoseconds);
        if motion::speed(now).abs() > MOVING {
            moving.add(zone, in_space, nanoseconds);
        }
    }
    (all, moving)
}
