//! What stands in the robot's way, as points the laser met and walls the map knows, world frame.
//! This file guarantees that a clearance is exact: the distance to the nearest of them.

use crate::messages::LaserScan;
use nalgebra::{Isometry2, Point2, distance_squared};

/// A straight wall from one end to the other, world frame, metres.
pub type Wall = [Point2<f64>; 2];

/// Points and walls that nothing may drive through.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Obstacles {
    points: Vec<Point2<f64>>,
    walls: Vec<Wall>,
}

impl Obstacles {
    /// Nothing in the way.
    pub fn new() -> Self {
        Self::default()
    }

    /// Forgets all points and walls, and keeps the memory.
    pub fn clear(&mut self) {
        self.points.clear();
        self.walls.clear();
    }

    /// Adds a point.
    pub fn push_point(&mut self, point: Point2<f64>) {
        self.points.push(point);
    }

    /// Adds a wall.
    pub fn push_wall(&mut self, wall: Wall) {
        self.walls.push(wall);
    }

    /// All points.
    pub fn points(&self) -> &[Point2<f64>] {
        &self.points
    }

    /// All walls.
    pub fn walls(&self) -> &[Wall] {
        &self.walls
    }

    /// The distance from `place` to the nearest obstacle, D of TD eq. 14, metres; infinite where
    /// there is none.
    pub fn clearance(&self, place: Point2<f64>) -> f64 {
        let to_points = self
            .points
            .iter()
            .map(|point| distance_squared(&place, point));
        let to_walls = self
            .walls
            .iter()
            .map(|wall| distance_squared(&place, &nearest(wall, place)));
        to_points
            .chain(to_walls)
            .fold(f64::INFINITY, f64::min)
            .sqrt()
    }

    /// Fills `near` with the obstacles of `self` that come closer to `place` than `reach` metres.
    pub(super) fn collect_near(&self, place: Point2<f64>, reach: f64, near: &mut Self) {
        near.clear();
        let reach = reach * reach;
        near.points.extend(
            self.points
                .iter()
                .filter(|p| distance_squared(&place, p) < reach),
        );
        let close = |wall: &&Wall| distance_squared(&place, &nearest(wall, place)) < reach;
        near.walls.extend(self.walls.iter().filter(close));
    }
}

/// The point of `wall` nearest to `place`.
pub fn nearest(wall: &Wall, place: Point2<f64>) -> Point2<f64> {
    let along = wall[1] - wall[0];
    let squared = along.norm_squared();
    let share = if squared > 0.0 {
        (place - wall[0]).dot(&along) / squared
    } else {
        0.0
    };
    wall[0] + along * share.clamp(0.0, 1.0)
}

/// Where the beams of `scan` met something, robot frame. Beams that met nothing, or that read no
/// sensible distance, yield nothing.
pub fn hits(scan: &LaserScan) -> impl Iterator<Item = Point2<f64>> + '_ {
    scan.ranges.iter().enumerate().filter_map(|(k, &range)| {
        let range = f64::from(range);
        let met = range > 0.0 && range < scan.range_max;
        let (sin, cos) = (scan.angle_min + scan.angle_step * k as f64).sin_cos();
        met.then(|| Point2::new(range * cos, range * sin))
    })
}

/// [`hits`] in the world frame, for a robot that stood at `world_from_robot` at that moment.
pub fn world_hits<'a>(
    scan: &'a LaserScan,
    world_from_robot: &'a Isometry2<f64>,
) -> impl Iterator<Item = Point2<f64>> + 'a {
    hits(scan).map(move |hit| world_from_robot * hit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::Time;
    use nalgebra::Vector2;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn the_nearest_point_of_a_wall_may_be_its_end() {
        let mut obstacles = Obstacles::new();
        assert_eq!(
            obstacles.clearance(Point2::origin()).to_bits(),
            f64::INFINITY.to_bits()
        );
        obstacles.push_wall([Point2::new(1.0, -1.0), Point2::new(1.0, 1.0)]);
        assert!((obstacles.clearance(Point2::new(0.0, 0.5)) - 1.0).abs() < 1e-12);
        assert!((obstacles.clearance(Point2::new(1.0, 1.5)) - 0.5).abs() < 1e-12);
        obstacles.push_point(Point2::new(0.0, 0.2));
        assert!((obstacles.clearance(Point2::new(0.0, 0.5)) - 0.3).abs() < 1e-12);
    }

    #[test]
    fn beams_that_met_nothing_are_no_obstacle() {
        let scan = LaserScan {
            time: Time::default(),
            angle_min: 0.0,
            angle_step: FRAC_PI_2,
            range_max: 10.0,
            ranges: vec![2.0, 10.0, 0.0, f32::NAN],
        };
        let world_from_robot = Isometry2::new(Vector2::new(1.0, 1.0), FRAC_PI_2);
        let hits: Vec<_> = world_hits(&scan, &world_from_robot).collect();
        assert_eq!(hits.len(), 1);
        assert!((hits[0] - Point2::new(1.0, 3.0)).norm() < 1e-12);
    }
}
