//! The pure core of the navigation agent: one step takes what the robot knows and gives a velocity.
//! This file guarantees that every command keeps the base's limits and obeys the laser guard, and
//! that a task ends: it is reached, or it fails with a reason.
//!
//! It plans anew when the task or the person it leads to has moved, when the path became blocked or
//! noticeably dearer, when the band broke, and when the robot makes no headway. Where the costs of the
//! map have changed (somebody moved, an activity began or ended, a door opened) it asks once a second
//! whether a clearly cheaper way has opened. On a map that stays as it is, it plans once.

mod course;
mod drive;
mod replan;

use self::course::Course;
use self::drive::calmed;
use self::replan::person_of;
use super::anticipation::Anticipation;
use super::band::{Band, Gains};
use super::control::{Guard, Limits, Motion, Unicycle, turn_to, wrapped};
use super::ground::Ground;
use super::map_age::MapState;
use super::obstacles::{Obstacles, Wall, world_hits};
use super::path::PathError;
use super::people::{Person, Presence};
use super::planner::Planner;
use super::settled::Settled;
use super::target::{End, INSIDE, Target, Task, has_moved};
use crate::grid::CostGrid;
use crate::messages::{LaserScan, Odometry, VelocityCommand};
use dsr::Time;
use nalgebra::{Point2, distance};
use thiserror::Error;

/// What the navigation can be told once, before it starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// The elastic band's gains.
    pub gains: Gains,
    /// The laser guard.
    pub guard: Guard,
    /// A place is reached from so near, metres (READING.md item 14).
    pub goal_tolerance: f64,
    /// A heading is met to so many radians.
    pub heading_tolerance: f64,
    /// Readings older than this are worth nothing, seconds.
    pub patience: f64,
    /// How often to look whether the map has changed in favour of another way, seconds.
    pub review: f64,
    /// Without headway for so long the robot tries something else, seconds.
    pub recover_after: f64,
    /// Without headway for so long the task fails, seconds.
    pub give_up_after: f64,
    /// No way or no sight of the person for so long fails the task, seconds.
    pub unreachable_after: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            gains: Gains::default(),
            guard: Guard::default(),
            goal_tolerance: 0.15,
            heading_tolerance: 0.1,
            patience: 0.5,
            review: 1.0,
            recover_after: 8.0,
            give_up_after: 90.0,
            unreachable_after: 20.0,
        }
    }
}

/// All that the robot knows at one step.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    /// The latest odometry.
    pub odometry: Option<&'a Odometry>,
    /// The latest scan.
    pub scan: Option<&'a LaserScan>,
    /// The latest cost grid, widened by the robot's radius (layer `inflation`).
    pub grid: Option<&'a CostGrid>,
    /// What the grid is worth at its age.
    pub map: MapState,
    /// The walls of the map.
    pub walls: &'a [Wall],
    /// The people known, where they are now.
    pub people: &'a [Person],
    /// What to do.
    pub task: Option<&'a Task>,
    /// What the base can do.
    pub limits: Limits,
    /// Whether people are more than obstacles.
    pub social: bool,
}

/// How a task stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Status {
    /// There is nothing to do.
    Idle,
    /// On the way.
    Moving,
    /// On the way, and standing for a reason that passes.
    Waiting(Cause),
    /// Done; stays so until another task comes.
    Arrived,
    /// It cannot be done; stays so until another task comes.
    Failed(Failure),
}

/// Why the robot stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// No fresh odometry.
    NoOdometry,
    /// No fresh scan, without which it does not move.
    NoScan,
    /// No grid yet.
    NoGrid,
    /// The grid is too old to drive by.
    OldGrid,
    /// The person it leads to is not in sight.
    NoPerson,
    /// No way there at present.
    NoPath,
    /// It lets people pass.
    People,
}

/// Why a task cannot be done.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum Failure {
    /// There has been no way for long.
    #[error("no way: {0}")]
    NoPath(#[from] PathError),
    /// Every place in the region is blocked.
    #[error("every place in the region is blocked")]
    RegionBlocked,
    /// The person has not been seen for long.
    #[error("the person has not been in sight for long")]
    PersonUnseen,
    /// The robot has made no headway for long.
    #[error("no headway for long")]
    Stuck,
}

/// What one step comes to. The path is at [`Navigator::path`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Output {
    /// What the base shall do.
    pub command: VelocityCommand,
    /// How the task stands.
    pub status: Status,
}

/// Drives the robot to where its task says.
#[derive(Debug, Clone, Default)]
pub struct Navigator {
    config: Config,
    planner: Planner,
    settled: Settled,
    band: Band,
    anticipation: Anticipation,
    ground: Ground,
    obstacles: Obstacles,
    course: Option<Course>,
    last: Option<VelocityCommand>,
    plans: u64,
}

/// What the robot sees and is, worked out once a step.
struct View<'a> {
    now: Time,
    robot: Unicycle,
    scan: &'a LaserScan,
    inputs: &'a Inputs<'a>,
    /// The people known but for whom the robot keeps company: where that one will be depends on both,
    /// and what the laser sees keeps the two apart.
    others: &'a [Person],
}

/// A wanted motion, and how the task stands with it.
type Decision = (Motion, Status);

const STAND: Motion = Motion::new(0.0, 0.0);

impl Navigator {
    /// A navigator without a task.
    pub fn new(config: Config) -> Self {
        Self {
            config,
            ..Self::default()
        }
    }

    /// The band from the robot to the goal, world frame; empty where the robot is not under way.
    pub fn path(&self) -> &[Point2<f64>] {
        self.band.points()
    }

    /// The radius of the band's bubble about each point of it, metres.
    pub fn bubbles(&self) -> &[f64] {
        self.band.radii()
    }

    /// The path that the band was laid along, world frame; empty where the robot is not under way.
    pub fn planned(&self) -> &[Point2<f64>] {
        match &self.course {
            Some(course) if !self.band.points().is_empty() => &course.line,
            _ => &[],
        }
    }

    /// How often a path has been planned and taken.
    pub fn plans(&self) -> u64 {
        self.plans
    }

    /// One step.
    pub fn step(&mut self, now: Time, inputs: &Inputs) -> Output {
        let companion = inputs
            .task
            .filter(|task| task.target.is_company())
            .and_then(|task| task.target.person());
        let others: Vec<Person> = match companion {
            Some(name) => {
                let others = inputs.people.iter().filter(|person| person.name != name);
                others.cloned().collect()
            }
            None => Vec::new(),
        };
        let others = if companion.is_some() {
            &others
        } else {
            inputs.people
        };
        let (motion, status) = match self.view(now, inputs, others) {
            Err(cause) => (STAND, Status::Waiting(cause)),
            Ok(view) => {
                let (wanted, status) = self.decide(&view);
                let wanted = calmed(wanted, &view);
                let since = self
                    .last
                    .map_or(0.1, |last| now.since(last.time).clamp(0.01, 0.2));
                let smooth = inputs.limits.reachable(view.robot.motion, wanted, since);
                (
                    self.config.guard.slowed(smooth, view.scan, &inputs.limits),
                    status,
                )
            }
        };
        let under_way = matches!(status, Status::Moving | Status::Waiting(_));
        if !under_way {
            self.band = Band::default();
        }
        let status = if inputs.task.is_none() {
            Status::Idle
        } else {
            status
        };
        let command = motion.command(now);
        self.last = Some(command);
        Output { command, status }
    }

    /// One step of turning in place toward `place`, without a task.
    pub fn face(&mut self, now: Time, inputs: &Inputs, place: Option<Point2<f64>>) -> Output {
        self.course = None;
        self.band = Band::default();
        let wanted = self.view(now, inputs, inputs.people).map(|view| {
            let turn = place.map_or(STAND, |place| {
                let way = place - view.robot.position;
                turn_to(
                    &view.robot,
                    way.y.atan2(way.x),
                    self.config.heading_tolerance,
                )
            });
            (turn, view.robot.motion)
        });
        let (motion, status) = match wanted {
            Err(cause) => (STAND, Status::Waiting(cause)),
            Ok((wanted, now)) => (inputs.limits.reachable(now, wanted, 0.1), Status::Moving),
        };
        let command = motion.command(now);
        self.last = Some(command);
        Output { command, status }
    }

    /// What the robot sees, or what is missing for it to move at all.
    fn view<'a>(
        &self,
        now: Time,
        inputs: &'a Inputs<'a>,
        others: &'a [Person],
    ) -> Result<View<'a>, Cause> {
        let fresh = |time: Time| now.since(time) <= self.config.patience;
        let odometry = inputs
            .odometry
            .filter(|o| fresh(o.time))
            .ok_or(Cause::NoOdometry)?;
        let scan = inputs.scan.filter(|s| fresh(s.time)).ok_or(Cause::NoScan)?;
        let moving = match self.last {
            Some(last) if fresh(last.time) => Motion {
                linear: last.linear,
                lateral: last.lateral,
                angular: last.angular,
            },
            _ => Motion {
                linear: odometry.linear,
                lateral: odometry.lateral,
                angular: odometry.angular,
            },
        };
        let robot = Unicycle {
            position: odometry.world_from_robot.translation.vector.into(),
            heading: odometry.world_from_robot.rotation.angle(),
            motion: moving,
        };
        Ok(View {
            now,
            robot,
            scan,
            inputs,
            others,
        })
    }

    fn decide(&mut self, view: &View) -> Decision {
        let Some(task) = view.inputs.task else {
            self.course = None;
            return (STAND, Status::Idle);
        };
        let mut course = match self.course.take() {
            Some(course) if course.task.id == task.id => Course {
                task: task.clone(),
                ..course
            },
            _ => {
                self.band = Band::default();
                self.anticipation.reset();
                Course::new(task, view.now)
            }
        };
        let decision = match course.ended {
            Some(status) => (STAND, status),
            None => self.pursue(&mut course, view),
        };
        if matches!(decision.1, Status::Arrived | Status::Failed(_)) {
            course.ended = Some(decision.1);
        }
        self.course = Some(course);
        decision
    }

    fn pursue(&mut self, course: &mut Course, view: &View) -> Decision {
        if let Some(decision) = self.arrival(course, view) {
            return decision;
        }
        let Some(grid) = view.inputs.grid else {
            return (STAND, Status::Waiting(Cause::NoGrid));
        };
        if view.inputs.map == MapState::Lost {
            // Nobody is to blame for the way but the map.
            course.headway = view.now;
            return (STAND, Status::Waiting(Cause::OldGrid));
        }
        self.look_around(view);
        if let Some(until) = course.backing_until {
            if view.now < until {
                return (self.back_off(view), Status::Moving);
            }
            course.backing_until = None;
            course.planned = None;
        }
        self.band.follow(view.robot.position, 2.0);
        let mut settled = std::mem::take(&mut self.settled);
        let walkers = if view.inputs.social {
            view.inputs.people
        } else {
            &[]
        };
        settled.observe(view.now, grid, walkers);
        let decision = self.go_on(course, settled.with_berth(), view);
        self.settled = settled;
        decision
    }

    /// Plans where it must and drives where it can.
    fn go_on(&mut self, course: &mut Course, grid: &CostGrid, view: &View) -> Decision {
        let hindrance = self.keep_planned(course, grid, view).err();
        let stands = hindrance.and_then(|hindrance| {
            let since = *course.hindered.get_or_insert(view.now);
            let given_up = view.now.since(since) > self.config.unreachable_after;
            // A way found earlier still leads on; people who block a new one will walk away.
            let stands = self.band.points().is_empty() || given_up;
            stands.then(|| (STAND, hindrance.status(given_up)))
        });
        stands.unwrap_or_else(|| self.drive(course, grid, view))
    }

    /// Takes in the laser and the map. Whoever walks will be elsewhere when the robot gets there, so
    /// where people count, what the laser sees of walkers is left to the prediction.
    fn look_around(&mut self, view: &View) {
        let since = view
            .inputs
            .odometry
            .map_or(0.0, |o| view.scan.time.since(o.time));
        let then = view
            .robot
            .advanced(view.robot.motion, since)
            .world_from_robot();
        let walkers: Vec<Presence> = view
            .others
            .iter()
            .filter(|person| view.inputs.social && person.is_walking())
            .map(|person| person.predicted(0.0))
            .collect();
        let walks = |hit: &Point2<f64>| {
            walkers
                .iter()
                .any(|walker| distance(&walker.position, hit) < walker.radius + 0.25)
        };
        self.obstacles.clear();
        world_hits(view.scan, &then)
            .filter(|hit| !walks(hit))
            .for_each(|hit| self.obstacles.push_point(hit));
        view.inputs
            .walls
            .iter()
            .for_each(|&wall| self.obstacles.push_wall(wall));
    }

    /// Whether the robot is where it shall be, or is turning there.
    fn arrival(&self, course: &mut Course, view: &View) -> Option<Decision> {
        let place = view.robot.position;
        if let Some(region) = &course.region {
            let aim = course
                .destination
                .map_or(f64::INFINITY, |d| region.depth(d.point));
            return (region.depth(place) > INSIDE.min(0.7 * aim))
                .then_some((STAND, Status::Arrived));
        }
        let destination = course.destination?;
        if course.task.target.follows_people() {
            let anchor = course.task.target.anchor(view.inputs.people)?;
            if let Target::Company { until, .. } = &course.task.target {
                let person = person_of(&course.task, view.inputs.people)?;
                return self.company(course, view, person, until.as_ref());
            }
            if has_moved(course.person, anchor) {
                return None;
            }
        }
        let tolerance = self.config.goal_tolerance * if course.at_place { 2.0 } else { 1.0 };
        course.at_place = distance(&place, &destination.point) < tolerance;
        if !course.at_place {
            return None;
        }
        let heading = destination.heading.unwrap_or(view.robot.heading);
        if wrapped(heading - view.robot.heading).abs() <= self.config.heading_tolerance {
            return Some((STAND, Status::Arrived));
        }
        let turn = turn_to(&view.robot, heading, 0.5 * self.config.heading_tolerance);
        Some((turn, Status::Moving))
    }

    /// Whether the way together is at its end, or the companion stands and the robot beside them.
    fn company(
        &self,
        course: &Course,
        view: &View,
        person: &Person,
        until: Option<&End>,
    ) -> Option<Decision> {
        if until.is_some_and(|end| end.is_reached(view.robot.position, person.position())) {
            return Some((STAND, Status::Arrived));
        }
        let destination = course.destination?;
        let gap = distance(&view.robot.position, &destination.point);
        if person.is_walking() || gap > 2.0 * self.config.goal_tolerance {
            return None;
        }
        let heading = destination.heading.unwrap_or(view.robot.heading);
        let turn = turn_to(&view.robot, heading, self.config.heading_tolerance);
        Some((turn, Status::Waiting(Cause::People)))
    }
}

#[cfg(test)]
mod crowd;
#[cfg(test)]
mod tests;
