//! How near the robot came to people on the whole. This file owns the figures that are about all of
//! them together: the nearest at each moment, groups, and who would soon have been run into.

use super::{Truth, distances, is_finite, robot};
use agents::social_mapping::groups::Grouping;
use geo::{ConvexHull, Distance, Euclidean, MultiPoint};
use nalgebra::{Isometry2, Point2};
use serde::Serialize;

/// Between surfaces nearer than this, m, the robot does not leave people their space (Francis et al.
/// 2023, space compliance, with the usual threshold).
pub const COMPLIANT: f64 = 0.5;
/// Hall's distances between centres, m: the ends of intimate, personal and social space.
pub const HALL: [f64; 3] = [0.45, 1.2, 3.6];
/// Nobody is looked at who would be met later than this, s.
pub const FORESIGHT: f64 = 30.0;

/// The robot among people.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Company {
    /// Least distance of centres to anybody, m (TD `d_min`).
    pub min_distance: f64,
    /// Mean over time of the distance of centres to the nearest, m.
    pub mean_distance: f64,
    /// Least distance of surfaces to anybody, m; 0 in contact.
    pub min_clearance: f64,
    /// Mean over time of the distance of surfaces to the nearest, m.
    pub mean_clearance: f64,
    /// Share of the time in which no surface was nearer than [`COMPLIANT`], percent.
    pub space_compliance: f64,
    /// Shares of the time by the distance of the nearest one's centre.
    pub psi_distance: PsiDistance,
    /// Share of the time in which the robot's body was in the space between the members of a group,
    /// the convex hull of their centres, percent. Groups are those that social mapping finds by
    /// default in what was true.
    pub psi_groups: f64,
    /// The least time to a collision if both had gone on as they did, s, of those within
    /// [`FORESIGHT`]; `None` where nobody was on a collision course.
    pub time_to_collision: Option<f64>,
}

/// Shares of time, percent, by distance of centres whatever way anybody faces; they add up to 100.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct PsiDistance {
    /// Nearer than 0.45 m.
    pub intimate: f64,
    /// Nearer than 1.2 m.
    pub personal: f64,
    /// Nearer than 3.6 m.
    pub social: f64,
    /// Farther, or with nobody there.
    pub public: f64,
}

/// Of samples in order; `None` where nobody was ever there or no time passed. A sample stands for the
/// time until the next; means are of the time in which somebody was there.
pub(super) fn company(samples: &[&Truth], robot_radius: f64) -> Option<Company> {
    let mut shares = [0.0; 4];
    let (mut time, mut peopled) = (0.0, 0.0);
    let (mut distance_sum, mut clearance_sum) = (0.0, 0.0);
    let (mut compliant, mut grouped) = (0.0, 0.0);
    let (mut min_distance, mut min_clearance) = (f64::INFINITY, f64::INFINITY);
    let mut soonest = f64::INFINITY;
    for (k, sample) in samples.iter().enumerate() {
        let until = samples
            .get(k + 1)
            .map_or(0.0, |next| next.time.since(sample.time));
        let (distance, clearance) = distances(sample, robot_radius)
            .map(|(_, distance, clearance)| (distance, clearance))
            .fold((f64::INFINITY, f64::INFINITY), |least, one| {
                (least.0.min(one.0), least.1.min(one.1))
            });
        (min_distance, min_clearance) = (min_distance.min(distance), min_clearance.min(clearance));
        soonest = soonest.min(time_to_collision(sample, robot_radius));
        time += until;
        let zone = HALL.iter().position(|end| distance < *end).unwrap_or(3);
        shares[zone] += until;
        if distance.is_finite() {
            peopled += until;
            distance_sum += distance * until;
            clearance_sum += clearance * until;
        }
        compliant += if clearance < COMPLIANT { 0.0 } else { until };
        grouped += if until > 0.0 && in_a_group(sample, robot_radius) {
            until
        } else {
            0.0
        };
    }
    let percent = |part: f64| 100.0 * part / time;
    let [intimate, personal, social, public] = shares.map(percent);
    (peopled > 0.0).then(|| Company {
        min_distance,
        mean_distance: distance_sum / peopled,
        min_clearance,
        mean_clearance: clearance_sum / peopled,
        space_compliance: percent(compliant),
        psi_distance: PsiDistance {
            intimate,
            personal,
            social,
            public,
        },
        psi_groups: percent(grouped),
        time_to_collision: (soonest <= FORESIGHT).then_some(soonest),
    })
}

/// The least time until the robot's body touches somebody's, if both go on straight at the velocities
/// that they have; infinite where that will not be.
fn time_to_collision(sample: &Truth, robot_radius: f64) -> f64 {
    let heading = sample.world_from_robot.rotation;
    let velocity = heading * nalgebra::Vector2::new(sample.velocity.x, sample.lateral);
    let times = sample.people.iter().filter_map(|body| {
        let (apart, closing) = (body.position - robot(sample), body.velocity - velocity);
        let reach = body.radius + robot_radius;
        // |apart + closing t| = reach
        let (a, b) = (closing.norm_squared(), apart.dot(&closing));
        let c = apart.norm_squared() - reach * reach;
        if c <= 0.0 {
            return Some(0.0);
        }
        let root = b * b - a * c;
        (b < 0.0 && root >= 0.0).then(|| (-b - root.sqrt()) / a)
    });
    times
        .filter(|time| time.is_finite())
        .fold(f64::INFINITY, f64::min)
}

/// Whether the robot's body reaches into the space between people who stand together.
fn in_a_group(sample: &Truth, robot_radius: f64) -> bool {
    let sound = sample
        .people
        .iter()
        .filter(|body| is_finite(&body.position) && body.heading.is_finite());
    let poses: Vec<Isometry2<f64>> = sound
        .map(|body| Isometry2::new(body.position.coords, body.heading))
        .collect();
    // Of more people than can be grouped nothing is said.
    let groups = Grouping::default().groups(&poses).unwrap_or_default();
    let place = robot(sample);
    groups.iter().filter(|group| group.len() > 1).any(|group| {
        let members = group
            .iter()
            .map(|&k| Point2::from(poses[k].translation.vector));
        let members: MultiPoint = members.map(|p| geo::Point::new(p.x, p.y)).collect();
        let place = geo::Point::new(place.x, place.y);
        Euclidean.distance(&place, &members.convex_hull()) < robot_radius
    })
}
