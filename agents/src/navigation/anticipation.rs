//! Which way and how fast to go among people who walk: path-velocity decomposition with evasions.
//! Candidate manoeuvres are rolled forward with the robot's own control law against people who
//! walk on as they do now, and the one is taken that intrudes least on their spaces for the time it
//! takes, and least on what else the grid holds dear. This file guarantees that waiting cannot last forever: time weighs more the more of it
//! has been lost.
//!
//! The rates and times were chosen on the recorded pedestrians of UCY zara01 and on the scenarios
//! that come with Cortex.

use super::control::{Limits, Motion, Unicycle, follow};
use super::ground::Ground;
use super::people::{INTIMATE, PERSONAL, Person, Presence, SOCIAL};
use crate::grid::{CostGrid, FREE};
use nalgebra::{Point2, Rotation2, Vector2, distance, distance_squared};
use std::f64::consts::TAU;

/// How far ahead the manoeuvres are rolled, seconds, and in how many steps.
const HORIZON: f64 = 6.0;
const STEPS: usize = 30;
const STEP: f64 = HORIZON / STEPS as f64;
/// People farther away than this do not count, metres: within the horizon a walker and the robot
/// close about as much.
const SIGHT: f64 = 10.0;
/// The robot has come to a point when it is so near, metres.
const REACHED: f64 = 0.2;

/// What a second costs, by where it is spent, in seconds of travel: in intimate space, in personal
/// space, at its border from outside, and touching.
const INTIMATE_RATE: f64 = 24.0;
const PERSONAL_RATE: f64 = 12.0;
const BORDER_RATE: f64 = 4.0;
const CONTACT_RATE: f64 = 40.0;
/// Up to this squared deviation a place counts as near the border of the personal space.
const BORDER: f64 = 2.4;
/// The same around those who stand.
const STANDING_BORDER: f64 = 1.7;
/// What a second at the inner edge of social space costs.
const SOCIAL_RATE: f64 = 0.2;
/// A cell that costs more than social space is in somebody's or some object's space; a blocked one counts
/// as the dearest that is not (READING.md item 7): obstacles have their own rule.
const SOCIAL_COST: f32 = 2.0;
const DEAREST: f32 = 4.0;
/// How fast a prediction loses weight, seconds.
const TRUST: f64 = 10.0;
/// After so many lost seconds time weighs double.
const PATIENCE: f64 = 5.0;
/// What a way through an obstacle costs, seconds: there will be one around it.
const HIDDEN: f64 = 4.0;
/// A new manoeuvre must be better than the last by so much, so that the robot does not dither.
const LOYALTY: f64 = 0.4;

/// Something the robot can do in the next seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Manoeuvre {
    /// Follow the line at this share of the top speed.
    Along(f64),
    /// Stand for so many seconds, then follow the line.
    WaitThenGo(f64),
    /// Follow the line for so many seconds, then stand.
    GoThenWait(f64),
    /// Leave the line for a place, world frame.
    Aside {
        /// Where to.
        to: Point2<f64>,
        /// Whether to come back to the line at once rather than stand there.
        resume: bool,
        /// Whether to drive there with the rear ahead.
        backwards: bool,
    },
}

/// What the choice depends on.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// The line to follow, from the robot to the goal.
    pub line: &'a [Point2<f64>],
    /// Everybody near.
    pub people: &'a [Person],
    /// Where the robot cannot be for other reasons.
    pub ground: &'a Ground,
    /// What places cost that the line was planned on; without it, a place costs nothing but people.
    pub grid: Option<&'a CostGrid>,
    /// What the base can do.
    pub limits: &'a Limits,
    /// The time that the robot has lost, seconds.
    pub lost: f64,
    /// Whom the robot is on its way to talk to: it may come up to the border of their space, and ahead
    /// of them, where they want it, to that of the intimate one.
    pub addressee: Option<&'a str>,
}

/// Somebody at one moment, and from where on the border of their space counts.
#[derive(Debug, Clone, Copy)]
struct Seen {
    presence: Presence,
    border: f64,
    /// Whether the person wants the robot ahead of them.
    wanted: bool,
}

/// The manoeuvre taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Which.
    pub manoeuvre: Manoeuvre,
    /// What the robot should do now for it; the base's limits apply afterwards.
    pub motion: Motion,
}

/// Predictions and memory that serve one choice after the other.
#[derive(Debug, Clone, Default)]
pub struct Anticipation {
    /// Where everybody near who walks is, step by step.
    walking: Vec<Seen>,
    walkers: usize,
    /// Everybody near who stands.
    standing: Vec<Seen>,
    /// From each point of the line to its end: metres, and what the spaces of those who stand cost.
    to_end: Vec<(f64, f64)>,
    last: Option<Manoeuvre>,
}

impl Anticipation {
    /// Forgets the last choice.
    pub fn reset(&mut self) {
        self.last = None;
    }

    /// The best manoeuvre from `robot` on. With nobody near it is to follow the line at top speed.
    pub fn choose(&mut self, robot: &Unicycle, scene: &Scene) -> Choice {
        self.predict(robot, scene);
        let full = Manoeuvre::Along(1.0);
        let mut best = (self.judge(robot, scene, full, f64::INFINITY), full);
        let trivial = self.walkers + self.standing.len() == 0;
        if !trivial {
            for manoeuvre in candidates(robot, scene.line, self.last) {
                // Who goes on waiting would begin to wait anew each time.
                let lasting = matches!(manoeuvre, Manoeuvre::Along(_) | Manoeuvre::Aside { .. });
                let bonus = if lasting && self.last == Some(manoeuvre) {
                    LOYALTY
                } else {
                    0.0
                };
                let cost = self.judge(robot, scene, manoeuvre, best.0 + bonus) - bonus;
                if cost < best.0 {
                    best = (cost, manoeuvre);
                }
            }
        }
        let mut manoeuvre = best.1;
        if let Manoeuvre::Aside { to, .. } = manoeuvre
            && distance(&robot.position, &to) < REACHED
        {
            manoeuvre = full;
        }
        self.last = (!trivial).then_some(manoeuvre);
        let motion = Rollout::new(best.1).wanted(robot, scene, 0.0);
        Choice {
            manoeuvre: best.1,
            motion,
        }
    }

    fn predict(&mut self, robot: &Unicycle, scene: &Scene) {
        let near = |person: &&Person| distance(&person.position(), &robot.position) < SIGHT;
        let seen = |person: &Person, time: f64| Seen {
            presence: person.predicted(time),
            border: border(person, scene),
            wanted: scene.addressee == Some(&person.name),
        };
        let people = || scene.people.iter().filter(near);
        self.standing.clear();
        self.standing
            .extend(people().filter(|p| !p.is_walking()).map(|p| seen(p, 0.0)));
        self.walkers = people().filter(|p| p.is_walking()).count();
        self.walking.clear();
        for step in 1..=STEPS {
            let walkers = people().filter(|p| p.is_walking());
            self.walking
                .extend(walkers.map(|p| seen(p, step as f64 * STEP)));
        }
        self.to_end.clear();
        self.to_end.resize(scene.line.len(), (0.0, 0.0));
        for k in (1..scene.line.len()).rev() {
            let (length, cost) = self.to_end[k];
            let step = distance(&scene.line[k - 1], &scene.line[k]);
            let rate = self.standing_rate(scene.line[k - 1], scene);
            self.to_end[k - 1] = (length + step, cost + rate * step / pace(scene));
        }
    }

    /// What `manoeuvre` costs in seconds of travel, or at least `limit` where it is no better.
    fn judge(&self, robot: &Unicycle, scene: &Scene, manoeuvre: Manoeuvre, limit: f64) -> f64 {
        let mut rollout = Rollout::new(manoeuvre);
        let mut robot = *robot;
        let mut cost = 0.0;
        let mut stuck = false;
        for step in 0..STEPS {
            let time = step as f64 * STEP;
            let wanted = if stuck {
                Motion::default()
            } else {
                rollout.wanted(&robot, scene, time)
            };
            let motion = scene.limits.reachable(robot.motion, wanted, STEP);
            let next = robot.advanced(motion, STEP);
            if scene.ground.is_blocked(next.position) && !scene.ground.is_blocked(robot.position) {
                stuck = true;
                cost += 3.0;
                robot.motion = Motion::default();
            } else {
                robot = next;
            }
            let walking = &self.walking[step * self.walkers..(step + 1) * self.walkers];
            let radius = scene.limits.radius;
            let met = (-time / TRUST).exp() * intrusion(robot.position, walking, radius);
            // Who stands will still stand there later: putting it off gains nothing.
            cost += STEP * met.max(self.standing_rate(robot.position, scene));
            if cost >= limit {
                return cost;
            }
            // What happens after the task has ended is no matter of how to carry it out.
            if scene
                .line
                .last()
                .is_some_and(|end| distance(end, &robot.position) < REACHED)
            {
                return cost;
            }
        }
        cost + self.remaining(robot.position, rollout.next, scene)
    }

    /// What a second at `place` costs for those who stand, and for what is in use there.
    fn standing_rate(&self, place: Point2<f64>, scene: &Scene) -> f64 {
        let people = intrusion(place, &self.standing, scene.limits.radius);
        people.max(scene.grid.map_or(0.0, |grid| dearness(place, grid)))
    }

    /// What it costs to get from `place` to the goal: straight to a point of the line within a few
    /// metres on from point `next`, and then along the line; the least over those points.
    fn remaining(&self, place: Point2<f64>, next: usize, scene: &Scene) -> f64 {
        let second = (1.0 + scene.lost / PATIENCE) / scene.limits.max_speed.max(0.05);
        let through = |join: usize| {
            let way = scene.line[join] - place;
            let length = way.norm();
            let pieces = (length / 0.25).ceil().max(1.0) as usize;
            let (mut hidden, mut spaces) = (0.0, 0.0);
            for j in 1..pieces {
                let at = place + way * (j as f64 / pieces as f64);
                hidden = if scene.ground.is_blocked(at) {
                    HIDDEN
                } else {
                    hidden
                };
                spaces += self.standing_rate(at, scene);
            }
            let (rest, cost) = self.to_end[join];
            let spaces = cost + spaces * length / pieces as f64 / pace(scene);
            hidden + spaces + (length + rest) * second
        };
        let last = (next + 16).min(scene.line.len().saturating_sub(1));
        let joins = (next.min(last)..=last).step_by(4);
        joins
            .filter(|&join| join < scene.line.len())
            .map(through)
            .fold(f64::INFINITY, f64::min)
    }
}

/// The pace at which standing people's spaces are passed, m/s: less than the top speed, as turns
/// and starts take time; were it more, putting the passage off would look like a gain.
fn pace(scene: &Scene) -> f64 {
    0.7 * scene.limits.max_speed.max(0.05)
}

/// Up to which squared deviation a place counts as near the border of the person's space: less
/// far out where the border is not a prediction, and not at all for whom the robot comes to see.
fn border(person: &Person, scene: &Scene) -> f64 {
    if scene.addressee == Some(&person.name) {
        PERSONAL
    } else if person.is_walking() {
        BORDER
    } else {
        STANDING_BORDER
    }
}

/// What a second at `place` costs by the grid, beyond the time: as much more as the path planner holds a
/// metre there dearer. Social space and less is left to where people are.
fn dearness(place: Point2<f64>, grid: &CostGrid) -> f64 {
    let cost = grid.cell_at(place).map_or(FREE, |cell| grid.cost(cell));
    if cost > SOCIAL_COST {
        f64::from(cost.min(DEAREST) - FREE)
    } else {
        0.0
    }
}

/// What a second at `place` costs while `seen` are there: the closest zone counts.
fn intrusion(place: Point2<f64>, seen: &[Seen], radius: f64) -> f64 {
    let mut worst: f64 = 0.0;
    for Seen {
        presence,
        border,
        wanted,
    } in seen
    {
        let squared = distance_squared(&presence.position, &place);
        if squared > 6.0 {
            continue;
        }
        let q = presence.squared_deviation(place);
        let q = if *wanted && q >= INTIMATE && presence.wants_at(place) {
            SOCIAL
        } else {
            q
        };
        let mut rate = if q < INTIMATE {
            INTIMATE_RATE
        } else if q < PERSONAL {
            PERSONAL_RATE * (1.5 - 0.5 * q / PERSONAL)
        } else if q < *border {
            SOCIAL_RATE + (BORDER_RATE - SOCIAL_RATE) * (border - q) / (border - PERSONAL)
        } else if q < SOCIAL {
            SOCIAL_RATE * (SOCIAL - q) / (SOCIAL - PERSONAL)
        } else {
            0.0
        };
        if squared < (radius + presence.radius).powi(2) {
            rate += CONTACT_RATE;
        }
        worst = worst.max(rate);
    }
    worst
}

/// Everything worth trying beside following the line at top speed; `last` first.
fn candidates(
    robot: &Unicycle,
    line: &[Point2<f64>],
    last: Option<Manoeuvre>,
) -> impl Iterator<Item = Manoeuvre> {
    let along = [0.75, 0.5, 0.25, 0.0].map(Manoeuvre::Along);
    let wait = [0.5, 1.0, 1.5, 2.0, 3.0, 4.0].map(Manoeuvre::WaitThenGo);
    let go = [1.0, 1.5, 2.0, 3.0].map(Manoeuvre::GoThenWait);
    let ahead = line
        .get(2)
        .or(line.last())
        .map_or(Vector2::x(), |p| p - robot.position);
    let ahead = ahead.try_normalize(1e-9).unwrap_or_else(Vector2::x);
    let (position, heading) = (
        robot.position,
        Vector2::new(robot.heading.cos(), robot.heading.sin()),
    );
    let aside = (0..12).flat_map(move |k| {
        let direction = Rotation2::new(TAU * f64::from(k) / 12.0) * ahead;
        let behind = direction.dot(&heading) < -0.3;
        [0.6, 1.2, 2.0].into_iter().flat_map(move |far| {
            let to = position + direction * far;
            let ways = if behind {
                &[false, true][..]
            } else {
                &[false][..]
            };
            ways.iter().flat_map(move |&backwards| {
                [true, false].map(|resume| Manoeuvre::Aside {
                    to,
                    resume,
                    backwards,
                })
            })
        })
    });
    last.into_iter()
        .chain(along)
        .chain(wait)
        .chain(go)
        .chain(aside)
}

/// A manoeuvre on its way.
struct Rollout {
    manoeuvre: Manoeuvre,
    /// The next point of the line.
    next: usize,
    /// Whether the place aside has been reached.
    arrived: bool,
}

impl Rollout {
    fn new(manoeuvre: Manoeuvre) -> Self {
        Self {
            manoeuvre,
            next: 1,
            arrived: false,
        }
    }

    /// What the robot wants to do `time` seconds into the manoeuvre.
    fn wanted(&mut self, robot: &Unicycle, scene: &Scene, time: f64) -> Motion {
        let top = scene.limits.max_speed;
        match self.manoeuvre {
            Manoeuvre::Along(share) => self.along(robot, scene, share * top),
            Manoeuvre::WaitThenGo(wait) if time < wait - 0.5 * STEP => {
                // Turning toward the way on is no harm and saves time.
                Motion::new(0.0, self.along(robot, scene, top).angular)
            }
            Manoeuvre::WaitThenGo(_) => self.along(robot, scene, top),
            Manoeuvre::GoThenWait(go) if time < go - 0.5 * STEP => self.along(robot, scene, top),
            Manoeuvre::GoThenWait(_) => Motion::default(),
            Manoeuvre::Aside {
                to,
                resume,
                backwards,
            } => {
                self.arrived |= distance(&robot.position, &to) < REACHED;
                if !self.arrived {
                    // Only who means to stand there brakes for it.
                    let beyond = to + (to - robot.position);
                    let line = [to, beyond];
                    let line = if resume { &line[..] } else { &line[..1] };
                    follow(robot, line, top, scene.limits, backwards)
                } else if resume {
                    self.along(robot, scene, top)
                } else {
                    Motion::default()
                }
            }
        }
    }

    fn along(&mut self, robot: &Unicycle, scene: &Scene, speed: f64) -> Motion {
        self.pass(robot.position, scene.line);
        follow(
            robot,
            &scene.line[self.next.min(scene.line.len())..],
            speed,
            scene.limits,
            false,
        )
    }

    /// Moves on to the first point of `line` that still lies ahead of `place`.
    fn pass(&mut self, place: Point2<f64>, line: &[Point2<f64>]) {
        while self.next + 1 < line.len() {
            let way = line[self.next + 1] - line[self.next];
            let passed = way.dot(&(place - line[self.next])) > 0.0;
            if !passed && distance_squared(&place, &line[self.next]) > 0.04 {
                break;
            }
            self.next += 1;
        }
    }
}

#[cfg(test)]
mod tests;
