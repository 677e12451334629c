//! Control of a differential base along a line (paper TD 5.3). This file guarantees that no command
//! exceeds the base's limits, and that the robot can stop before whatever its laser sees, whatever
//! the other parts of the navigation believe.

use super::obstacles::hits;
use crate::messages::LaserScan;
use nalgebra::{Isometry2, Point2, Vector2, distance};

/// How a differential base moves: forward m/s, turning rad/s counter-clockwise.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Motion {
    /// Forward speed, m/s; negative backwards.
    pub linear: f64,
    /// Turning speed, rad/s, counter-clockwise.
    pub angular: f64,
}

/// What the base can do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Radius of the footprint, metres.
    pub radius: f64,
    /// Largest forward speed, m/s.
    pub max_speed: f64,
    /// Largest turning speed, rad/s.
    pub max_turn: f64,
    /// Largest change of the forward speed, m/s^2, speeding up and braking alike.
    pub acceleration: f64,
    /// Largest change of the turning speed, rad/s^2.
    pub turn_acceleration: f64,
}

impl Default for Limits {
    /// The authors' robot (READING.md item 14); the accelerations are ours.
    fn default() -> Self {
        Self {
            radius: 0.25,
            max_speed: 0.3,
            max_turn: 0.6,
            acceleration: 0.8,
            turn_acceleration: 2.5,
        }
    }
}

impl Limits {
    /// The command nearest to `wanted` that the base can follow `seconds` after moving as `now`.
    pub fn reachable(&self, now: Motion, wanted: Motion, seconds: f64) -> Motion {
        let toward = |now: f64, wanted: f64, top: f64, change: f64| {
            let wanted = wanted.clamp(-top, top);
            wanted.clamp(now - change * seconds, now + change * seconds)
        };
        Motion {
            linear: toward(now.linear, wanted.linear, self.max_speed, self.acceleration),
            angular: toward(
                now.angular,
                wanted.angular,
                self.max_turn,
                self.turn_acceleration,
            ),
        }
    }
}

/// Above this heading error the robot turns in place, radians (READING.md item 14).
pub const TURN_IN_PLACE: f64 = 0.7;
/// Turning speed per heading error, 1/s.
const TURN_GAIN: f64 = 2.0;
/// How far ahead on the line the robot aims at rest, metres, and how much farther per m/s.
const LOOK_AHEAD: (f64, f64) = (0.35, 0.5);

/// A pose and how it changes; what the control law and its predictions work on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unicycle {
    /// Where the centre is, world frame.
    pub position: Point2<f64>,
    /// Where the robot faces, radians.
    pub heading: f64,
    /// How it moves.
    pub motion: Motion,
}

impl Unicycle {
    /// The robot `seconds` later, having moved at `motion` all that time.
    #[must_use]
    pub fn advanced(&self, motion: Motion, seconds: f64) -> Self {
        // At the mean heading: exact in direction, and short by (turn^2 / 24) of the arc.
        let (sin, cos) = (self.heading + 0.5 * motion.angular * seconds).sin_cos();
        Self {
            position: self.position + Vector2::new(cos, sin) * (motion.linear * seconds),
            heading: self.heading + motion.angular * seconds,
            motion,
        }
    }

    /// The pose as an isometry.
    pub fn world_from_robot(&self) -> Isometry2<f64> {
        Isometry2::new(self.position.coords, self.heading)
    }
}

/// The smaller of the two turns from heading to heading, in (-pi, pi].
pub fn wrapped(angle: f64) -> f64 {
    let turn = angle.rem_euclid(std::f64::consts::TAU);
    if turn > std::f64::consts::PI {
        turn - std::f64::consts::TAU
    } else {
        turn
    }
}

/// What the robot should do to follow `line` (from itself to the goal) at up to `speed` m/s: aim at
/// a point ahead, slow down in turns and turn in place above [`TURN_IN_PLACE`], and brake so that
/// it stands at the end. `backwards` drives with the rear ahead. Limits apply afterwards.
///
/// Returns no motion where the line has no length.
pub fn follow(
    robot: &Unicycle,
    line: &[Point2<f64>],
    speed: f64,
    limits: &Limits,
    backwards: bool,
) -> Motion {
    let reach = LOOK_AHEAD.0 + LOOK_AHEAD.1 * robot.motion.linear.abs();
    let Some((aim, remaining)) = ahead(robot.position, line, reach, 2.0) else {
        return Motion::default();
    };
    let to_aim = aim - robot.position;
    if to_aim.norm() < 1e-6 {
        return Motion::default();
    }
    let facing = if backwards {
        robot.heading + std::f64::consts::PI
    } else {
        robot.heading
    };
    let error = wrapped(to_aim.y.atan2(to_aim.x) - facing);
    let straight = (1.0 - error.abs() / TURN_IN_PLACE).max(0.0);
    // Half the deceleration leaves room for the delay of the loop.
    let braking = (limits.acceleration * remaining).sqrt();
    let linear = speed.min(braking) * straight;
    Motion {
        linear: if backwards { -linear } else { linear },
        angular: TURN_GAIN * error,
    }
}

/// The point `reach` metres along `line`, and how long the line is up to `horizon` metres.
fn ahead(
    robot: Point2<f64>,
    line: &[Point2<f64>],
    reach: f64,
    horizon: f64,
) -> Option<(Point2<f64>, f64)> {
    let mut aim = *line.last()?;
    let mut found = false;
    let mut along = 0.0;
    let mut from = robot;
    for &to in line {
        let step = distance(&from, &to);
        if !found && along + step >= reach {
            aim = from + (to - from) * ((reach - along) / step.max(1e-9));
            found = true;
        }
        along += step;
        from = to;
        if found && along >= horizon {
            break;
        }
    }
    Some((aim, along))
}

/// The turn in place toward `heading`, or none where it is met within `tolerance` radians.
pub fn turn_to(robot: &Unicycle, heading: f64, tolerance: f64) -> Motion {
    let error = wrapped(heading - robot.heading);
    let angular = if error.abs() <= tolerance {
        0.0
    } else {
        TURN_GAIN * error
    };
    Motion {
        linear: 0.0,
        angular,
    }
}

/// How fast the robot passes right beside somebody who stands, m/s, and from which gap between the two
/// surfaces on it passes at top speed, metres: the outer end of Hall's personal distance.
const CALM: f64 = 0.25;
const AT_EASE: f64 = 1.2;

/// The greatest speed of a robot with that `top` speed, m/s, at a `gap` of so many metres from the surface
/// of somebody who stands: from 0.25 m/s at no gap it grows with the gap, to the top speed at 1.2 m. TD asks
/// for such a law (section 1) and gives none; this one is ours.
pub fn speed_near(gap: f64, top: f64) -> f64 {
    let calm = CALM.min(top);
    calm + (top - calm) * (gap / AT_EASE).clamp(0.0, 1.0)
}

/// The speed at which the robot may brush past something, m/s.
const CREEP: f64 = 0.1;

/// How the laser alone limits the speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guard {
    /// What must remain between the footprint and an obstacle ahead when the robot stands, metres.
    pub margin: f64,
    /// What the robot's path is widened by on either side, metres; less than `margin`, since a wall
    /// that the robot drives along is no danger.
    pub side_margin: f64,
    /// From a reading to the base acting on it, seconds.
    pub delay: f64,
}

impl Default for Guard {
    fn default() -> Self {
        Self {
            margin: 0.1,
            side_margin: 0.02,
            delay: 0.15,
        }
    }
}

impl Guard {
    /// How fast the robot may drive forwards, and backwards, so that it can still stop before
    /// everything the laser sees in its way; both at least 0. Turning in place is always allowed, and
    /// so is driving away from what is already too close.
    pub fn allowed(&self, scan: &LaserScan, limits: &Limits) -> (f64, f64) {
        let half_width = limits.radius + self.side_margin;
        let half_length = limits.radius + self.margin;
        let (mut forwards, mut backwards) = (f64::INFINITY, f64::INFINITY);
        for hit in hits(scan) {
            let aside = hit.y.abs() / half_width;
            if aside >= 1.0 {
                continue;
            }
            // What must stay empty is an ellipse, longer ahead than it is wide.
            let room = hit.x.abs() - half_length * (1.0 - aside * aside).sqrt();
            let speed = self.speed_within(room, limits);
            // Driving straight on does not meet what lies outside the robot's own width.
            let speed = if hit.y.abs() < limits.radius {
                speed
            } else {
                speed.max(CREEP)
            };
            let way = if hit.x >= 0.0 {
                &mut forwards
            } else {
                &mut backwards
            };
            *way = speed.min(*way);
        }
        (forwards, backwards)
    }

    /// The speed v at which delay and braking take `room` metres: v delay + v^2 / 2a = room.
    fn speed_within(&self, room: f64, limits: &Limits) -> f64 {
        let lag = limits.acceleration * self.delay;
        if room <= 0.0 {
            return 0.0;
        }
        (lag * lag + 2.0 * limits.acceleration * room).sqrt() - lag
    }

    /// `wanted`, slowed to what [`Guard::allowed`] says.
    pub fn slowed(&self, wanted: Motion, scan: &LaserScan, limits: &Limits) -> Motion {
        let (forwards, backwards) = self.allowed(scan, limits);
        Motion {
            linear: wanted.linear.clamp(-backwards, forwards),
            ..wanted
        }
    }
}

#[cfg(test)]
mod tests;
