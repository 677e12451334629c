//! Control of a differential or omnidirectional base along a line (paper TD 5.3). This file guarantees that no command
//! exceeds the base's limits, and that the robot can stop before whatever its laser sees, whatever
//! the other parts of the navigation believe.

use super::obstacles::hits;
use crate::messages::{LaserScan, VelocityCommand};
use dsr::Time;
use nalgebra::{Isometry2, Point2, Rotation2, Vector2, distance};

/// How a base moves, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Motion {
    /// Forward speed, m/s; negative backwards.
    pub linear: f64,
    /// Speed to the left, m/s; 0 of a differential base.
    pub lateral: f64,
    /// Turning speed, rad/s, counter-clockwise.
    pub angular: f64,
}

impl Motion {
    /// As a command to the base.
    pub const fn command(self, time: Time) -> VelocityCommand {
        VelocityCommand {
            time,
            linear: self.linear,
            lateral: self.lateral,
            angular: self.angular,
        }
    }

    /// Forwards and turning.
    pub const fn new(linear: f64, angular: f64) -> Self {
        Self {
            linear,
            lateral: 0.0,
            angular,
        }
    }

    /// How fast the centre moves, whichever way, m/s.
    pub fn speed(&self) -> f64 {
        self.linear.hypot(self.lateral)
    }

    /// The same way at `most` m/s at most.
    #[must_use]
    pub fn capped(self, most: f64) -> Self {
        if self.lateral == 0.0 {
            return Self::new(self.linear.clamp(-most, most), self.angular);
        }
        let way = Vector2::new(self.linear, self.lateral).cap_magnitude(most);
        Self {
            linear: way.x,
            lateral: way.y,
            ..self
        }
    }
}

/// How a base can move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Base {
    /// Forwards, backwards and turning.
    #[default]
    Differential,
    /// Also sideways.
    Omnidirectional,
}

impl Base {
    /// All bases.
    pub const ALL: [Self; 2] = [Self::Differential, Self::Omnidirectional];

    /// Its name in scenario files, in the graph and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Differential => "differential",
            Self::Omnidirectional => "omnidirectional",
        }
    }

    /// The base of that name.
    pub fn find(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|base| base.name() == name)
    }
}

/// What the base can do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Which ways it goes.
    pub base: Base,
    /// Radius of the footprint, metres.
    pub radius: f64,
    /// Largest speed, m/s, whichever way.
    pub max_speed: f64,
    /// Largest turning speed, rad/s.
    pub max_turn: f64,
    /// Largest change of the velocity, m/s^2, speeding up and braking alike.
    pub acceleration: f64,
    /// Largest change of the turning speed, rad/s^2.
    pub turn_acceleration: f64,
}

impl Default for Limits {
    /// The authors' robot (READING.md item 14); the accelerations are ours.
    fn default() -> Self {
        Self {
            base: Base::Differential,
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
        let angular = toward(
            now.angular,
            wanted.angular,
            self.max_turn,
            self.turn_acceleration,
        );
        if self.base == Base::Differential {
            let linear = toward(now.linear, wanted.linear, self.max_speed, self.acceleration);
            return Motion::new(linear, angular);
        }
        let moving = |motion: Motion| Vector2::new(motion.linear, motion.lateral);
        let change = moving(wanted.capped(self.max_speed)) - moving(now);
        let velocity = moving(now) + change.cap_magnitude(self.acceleration * seconds);
        Motion {
            linear: velocity.x,
            lateral: velocity.y,
            angular,
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
        let (ahead, left) = (Vector2::new(cos, sin), Vector2::new(-sin, cos));
        let velocity = ahead * motion.linear + left * motion.lateral;
        Self {
            position: self.position + velocity * seconds,
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
/// it stands at the end. `backwards` drives with the rear ahead. An omnidirectional base goes straight at
/// the point and turns to face its way meanwhile, or backwards keeps its heading. Limits apply afterwards.
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
    // Half the deceleration leaves room for the delay of the loop.
    let braking = (limits.acceleration * remaining).sqrt();
    if limits.base == Base::Omnidirectional {
        let way = Rotation2::new(-robot.heading) * to_aim.normalize() * speed.min(braking);
        return Motion {
            linear: way.x,
            lateral: way.y,
            angular: if backwards { 0.0 } else { TURN_GAIN * error },
        };
    }
    let straight = (1.0 - error.abs() / TURN_IN_PLACE).max(0.0);
    let linear = speed.min(braking) * straight;
    Motion::new(if backwards { -linear } else { linear }, TURN_GAIN * error)
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
    Motion::new(0.0, angular)
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

/// So far a turning base carries its way round at the most, radians, and in so many steps it is looked along.
const MOST_SWEPT: f64 = std::f64::consts::FRAC_PI_2;
const SWEPT_WAYS: u32 = 6;

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
        let along = |way| self.allowed_along(scan, limits, way);
        (along(Vector2::x()), along(-Vector2::x()))
    }

    /// The same along `way`, a unit vector in the robot's frame.
    fn allowed_along(&self, scan: &LaserScan, limits: &Limits, way: Vector2<f64>) -> f64 {
        let half_width = limits.radius + self.side_margin;
        let half_length = limits.radius + self.margin;
        let mut allowed = f64::INFINITY;
        for hit in hits(scan) {
            let (ahead, left) = (hit.coords.dot(&way), way.perp(&hit.coords));
            let aside = left.abs() / half_width;
            if aside >= 1.0 || ahead < 0.0 {
                continue;
            }
            // What must stay empty is an ellipse, longer ahead than it is wide.
            let room = ahead - half_length * (1.0 - aside * aside).sqrt();
            let speed = self.speed_within(room, limits);
            // Driving straight on does not meet what lies outside the robot's own width.
            let speed = if left.abs() < limits.radius {
                speed
            } else {
                speed.max(CREEP)
            };
            allowed = speed.min(allowed);
        }
        allowed
    }

    /// The speed v at which delay and braking take `room` metres: v delay + v^2 / 2a = room.
    fn speed_within(&self, room: f64, limits: &Limits) -> f64 {
        let lag = limits.acceleration * self.delay;
        if room <= 0.0 {
            return 0.0;
        }
        (lag * lag + 2.0 * limits.acceleration * room).sqrt() - lag
    }

    /// `wanted`, slowed to what [`Guard::allowed`] says. An omnidirectional base that turns carries the way it
    /// goes round with it: it may go as fast as lets it stand wherever in that sector it is by then.
    pub fn slowed(&self, wanted: Motion, scan: &LaserScan, limits: &Limits) -> Motion {
        let Some(way) = Vector2::new(wanted.linear, wanted.lateral).try_normalize(1e-9) else {
            return wanted;
        };
        let stands_in = self.delay + wanted.speed() / limits.acceleration;
        let turn = match limits.base {
            Base::Differential => 0.0,
            Base::Omnidirectional => (wanted.angular * stands_in).clamp(-MOST_SWEPT, MOST_SWEPT),
        };
        let ways = if turn.abs() < 1e-3 { 0 } else { SWEPT_WAYS };
        let allowed = (0..=ways)
            .map(|part| turn * f64::from(part) / f64::from(SWEPT_WAYS))
            .map(|angle| self.allowed_along(scan, limits, Rotation2::new(angle) * way))
            .fold(f64::INFINITY, f64::min);
        wanted.capped(allowed)
    }
}

#[cfg(test)]
mod tests;
