//! A laser and a base for tests.

use super::control::Unicycle;
use super::obstacles::Wall;
use super::people::Person;
use crate::messages::{LaserScan, Odometry};
use dsr::Time;
use nalgebra::Vector2;
use std::f64::consts::PI;

/// What the base tells.
pub(crate) fn odometry(now: Time, robot: &Unicycle) -> Odometry {
    Odometry {
        time: now,
        world_from_robot: robot.world_from_robot(),
        linear: robot.motion.linear,
        lateral: robot.motion.lateral,
        angular: robot.motion.angular,
    }
}

/// 360 beams against the outer walls and everybody's body.
pub(crate) fn scan(now: Time, robot: &Unicycle, people: &[Person], walls: &[Wall]) -> LaserScan {
    let step = PI / 180.0;
    let beam = |k: usize| {
        let angle = robot.heading - PI + step * k as f64;
        let way = Vector2::new(angle.cos(), angle.sin());
        let bodies = people.iter().filter_map(|person| {
            let to = person.position() - robot.position;
            let along = to.dot(&way);
            let miss = person.radius.powi(2) - (to.norm_squared() - along * along);
            (along > 0.0 && miss > 0.0).then(|| along - miss.sqrt())
        });
        let walls = walls.iter().filter_map(|[from, to]| {
            let (along, across) = (to - from, robot.position - from);
            let parallel = way.perp(&along);
            let range = along.perp(&across) / parallel;
            let share = way.perp(&across) / parallel;
            (parallel.abs() > 1e-9 && range > 0.0 && (0.0..=1.0).contains(&share)).then_some(range)
        });
        bodies.chain(walls).fold(10.0, f64::min) as f32
    };
    LaserScan {
        time: now,
        angle_min: -PI,
        angle_step: step,
        range_max: 10.0,
        ranges: (0..360).map(beam).collect(),
    }
}
