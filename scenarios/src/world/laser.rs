//! The laser: ranges from one turn of it. Each surface is tested only against the beams that can
//! meet it, so the cost is the beams times how many surfaces lie behind one another.

use super::obstacles::{Obstacles, cross};
use super::random::normal;
use crate::scenario::{Laser, Wall};
use agents::messages::LaserScan;
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};

/// A turn of the laser in progress, in the frame of the robot.
struct Sweep {
    directions: Vec<Vector2<f64>>,
    step: f64,
    ranges: Vec<f64>,
}

impl Sweep {
    fn new(beams: usize, range: f64) -> Self {
        let step = TAU / beams as f64;
        let directions = (0..beams)
            .map(|beam| {
                let angle = -PI + beam as f64 * step;
                Vector2::new(angle.cos(), angle.sin())
            })
            .collect();
        Self {
            directions,
            step,
            ranges: vec![range; beams],
        }
    }

    /// Shortens the beams from direction `from`, over `width` counter-clockwise, to what `hit` says.
    fn shorten(&mut self, from: f64, width: f64, hit: impl Fn(Vector2<f64>) -> Option<f64>) {
        let first = ((from + PI) / self.step).ceil() as i64;
        let last = ((from + width + PI) / self.step).floor() as i64;
        let beams = i64::try_from(self.ranges.len()).unwrap_or(i64::MAX);
        for beam in first..=last {
            let beam = beam.rem_euclid(beams) as usize;
            if let Some(distance) = hit(self.directions[beam]) {
                self.ranges[beam] = self.ranges[beam].min(distance);
            }
        }
    }

    fn segment(&mut self, a: Vector2<f64>, b: Vector2<f64>) {
        // Counter-clockwise as seen from the laser; a side subtends at most half a turn.
        let (a, b) = if cross(a, b) >= 0.0 { (a, b) } else { (b, a) };
        let from = a.y.atan2(a.x);
        let width = cross(a, b).atan2(a.dot(&b));
        let along = b - a;
        let height = cross(a, along);
        self.shorten(from, width, |beam| {
            let slope = cross(beam, along);
            let distance = height / slope;
            (slope.abs() > 1e-12 && distance >= 0.0).then_some(distance)
        });
    }

    fn disc(&mut self, centre: Vector2<f64>, radius: f64) {
        let away = centre.norm();
        if away <= radius {
            self.ranges.fill(0.0);
            return;
        }
        let half = (radius / away).asin();
        self.shorten(centre.y.atan2(centre.x) - half, 2.0 * half, |beam| {
            let nearest = beam.dot(&centre);
            let off = cross(beam, centre);
            let depth = radius * radius - off * off;
            (depth >= 0.0).then(|| nearest - depth.sqrt())
        });
    }
}

/// One turn of the laser at the robot's centre: `bodies` are the people, as discs.
pub(super) fn scan(
    laser: &Laser,
    world_from_robot: &Isometry2<f64>,
    obstacles: &Obstacles,
    bodies: impl Iterator<Item = (Point2<f64>, f64)>,
    random: &mut ChaCha8Rng,
    time: Time,
) -> LaserScan {
    let mut sweep = Sweep::new(laser.beams, laser.range);
    let robot_from_world = world_from_robot.inverse();
    let local = |point: Point2<f64>| (robot_from_world * point).coords;
    let near = |wall: &Wall| {
        let here = Point2::from(world_from_robot.translation.vector);
        super::obstacles::distance_to_segment(here, *wall) < laser.range
    };
    for [a, b] in obstacles.sides().filter(near) {
        sweep.segment(local(a), local(b));
    }
    for (centre, radius) in obstacles.discs().chain(bodies) {
        let centre = local(centre);
        if centre.norm() - radius < laser.range {
            sweep.disc(centre, radius);
        }
    }
    let nothing = laser.range as f32;
    let ranges = sweep.ranges.iter().map(|&range| {
        if range >= laser.range {
            return nothing;
        }
        (range + normal(random, laser.noise)).clamp(0.0, laser.range) as f32
    });
    LaserScan {
        time,
        angle_min: -PI,
        angle_step: sweep.step,
        range_max: f64::from(nothing),
        ranges: ranges.collect(),
    }
}

/// Makes beams of `scan` read as if they had met nothing, each with the laser's probability.
pub(super) fn drop_out(laser: &Laser, scan: &mut LaserScan, random: &mut ChaCha8Rng) {
    if laser.dropout_rate > 0.0 {
        for range in &mut scan.ranges {
            if random.random_bool(laser.dropout_rate) {
                *range = laser.range as f32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::random::stream;
    use proptest::prelude::*;

    fn beam(scan: &LaserScan, angle: f64) -> f64 {
        let index = ((angle - scan.angle_min) / scan.angle_step).round() as usize;
        f64::from(scan.ranges[index % scan.ranges.len()])
    }

    fn laser() -> Laser {
        Laser {
            beams: 360,
            range: 10.0,
            noise: 0.0,
            dropout_rate: 0.0,
            rate: 10.0,
        }
    }

    fn scan_of(walls: Vec<Wall>, bodies: &[(Point2<f64>, f64)], pose: Isometry2<f64>) -> LaserScan {
        scan_with(&laser(), walls, bodies, pose)
    }

    fn scan_with(
        laser: &Laser,
        walls: Vec<Wall>,
        bodies: &[(Point2<f64>, f64)],
        pose: Isometry2<f64>,
    ) -> LaserScan {
        let obstacles = Obstacles {
            walls,
            objects: Vec::new(),
        };
        let mut random = stream(1, "laser");
        scan(
            laser,
            &pose,
            &obstacles,
            bodies.iter().copied(),
            &mut random,
            Time::default(),
        )
    }

    #[test]
    fn a_beam_ends_at_the_first_surface_in_the_robots_frame() {
        let wall = [Point2::new(3.0, -5.0), Point2::new(3.0, 5.0)];
        let pose = Isometry2::new(Vector2::new(1.0, 0.0), PI / 2.0);
        let scan = scan_of(vec![wall], &[(Point2::new(1.0, -4.0), 0.5)], pose);
        assert!(
            (beam(&scan, -PI / 2.0) - 2.0).abs() < 1e-6,
            "the wall is to the right"
        );
        assert!((beam(&scan, PI) - 3.5).abs() < 1e-6, "the person is behind");
        assert!((beam(&scan, 0.0) - 10.0).abs() < 1e-6, "nothing is ahead");
        let diagonal = beam(&scan, -PI / 4.0);
        assert!((diagonal - 2.0 * 2.0_f64.sqrt()).abs() < 1e-6, "{diagonal}");
    }

    #[test]
    fn a_beam_that_meets_nothing_reads_the_greatest_range_to_the_bit() {
        // 5.6 is less as an f32 than as an f64.
        let laser = Laser {
            range: 5.6,
            ..laser()
        };
        let scan = scan_with(&laser, Vec::new(), &[], Isometry2::identity());
        let met = |range: &&f32| f64::from(**range) < scan.range_max;
        assert_eq!(scan.ranges.iter().filter(met).count(), 0);
    }

    proptest! {
        #[test]
        fn each_beam_equals_the_nearest_of_all_crossings(
            walls in prop::collection::vec(prop::array::uniform4(-8.0..8.0f64), 1..8),
            discs in prop::collection::vec((-8.0..8.0f64, -8.0..8.0f64, 0.1..0.6f64), 0..4),
            heading in -3.0..3.0f64,
        ) {
            let walls: Vec<Wall> =
                walls.iter().map(|w| [Point2::new(w[0], w[1]), Point2::new(w[2], w[3])]).collect();
            let bodies: Vec<_> = discs.iter().map(|d| (Point2::new(d.0, d.1), d.2)).collect();
            prop_assume!(bodies.iter().all(|(centre, radius)| centre.coords.norm() > radius + 0.01));
            let scan = scan_of(walls.clone(), &bodies, Isometry2::new(Vector2::zeros(), heading));
            for (index, range) in scan.ranges.iter().enumerate() {
                let angle = heading + scan.angle_min + index as f64 * scan.angle_step;
                let ray = Vector2::new(angle.cos(), angle.sin());
                let mut nearest = 10.0_f64;
                for [a, b] in &walls {
                    let along = b - a;
                    let slope = cross(ray, along);
                    let (t, u) = (cross(a.coords, along) / slope, cross(a.coords, ray) / slope);
                    if t >= 0.0 && (0.0..=1.0).contains(&u) { nearest = nearest.min(t); }
                }
                for (centre, radius) in &bodies {
                    let (ahead, off) = (ray.dot(&centre.coords), cross(ray, centre.coords));
                    if ahead > 0.0 && off.abs() < *radius {
                        nearest = nearest.min(ahead - (radius * radius - off * off).sqrt());
                    }
                }
                // A beam that only grazes an end may fall on either side of it.
                let grazes = walls.iter().flatten().any(|p| cross(ray, p.coords).abs() < 1e-6)
                    || bodies.iter().any(|(c, r)| (cross(ray, c.coords).abs() - r).abs() < 1e-6);
                prop_assert!(grazes || (f64::from(*range) - nearest).abs() < 1e-4,
                    "beam {index}: {range} instead of {nearest}");
            }
        }
    }
}
