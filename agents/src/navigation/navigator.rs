//! The pure core of the navigation agent: one step takes what the robot knows and gives a velocity.
//! This file guarantees that every command keeps the base's limits and obeys the laser guard, and
//! that a task ends: it is reached, or it fails with a reason.
//!
//! It plans anew when the task or the person it leads to has moved, when the path became blocked or
//! noticeably dearer, when the band broke, and when the robot makes no headway. Among people who
//! walk it also asks once a second whether a clearly cheaper way has opened. Never every step.

use super::anticipation::{Anticipation, Manoeuvre, Scene};
use super::band::{Band, BandState, Gains, Surroundings};
use super::control::{Guard, Limits, Motion, Unicycle, follow, turn_to, wrapped};
use super::ground::Ground;
use super::obstacles::{Obstacles, Wall, world_hits};
use super::path::PathError;
use super::people::{Person, Presence};
use super::planner::{Planner, price};
use super::target::{Destination, INSIDE, Region, Target, Task, has_moved, places_to_talk};
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
    /// How often to ask for a better way among people who walk, seconds.
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
    band: Band,
    anticipation: Anticipation,
    ground: Ground,
    obstacles: Obstacles,
    course: Option<Course>,
    last: Option<VelocityCommand>,
    plans: u64,
}

/// A task under way.
#[derive(Debug, Clone)]
struct Course {
    task: Task,
    region: Option<Region>,
    ended: Option<Status>,
    /// Where the band leads.
    destination: Option<Destination>,
    /// Where the person stood for whom the destination was chosen.
    person: Point2<f64>,
    planned: Option<Time>,
    /// The least price that the band has had since it was planned.
    price: f64,
    /// The shortest way that was left, and since when.
    shortest: f64,
    headway: Time,
    recoveries: u32,
    backing_until: Option<Time>,
    /// Since when there has been no way, or no sight of the person.
    hindered: Option<Time>,
    hindrance: Option<Hindrance>,
    at_place: bool,
}

/// What the robot sees and is, worked out once a step.
struct View<'a> {
    now: Time,
    robot: Unicycle,
    scan: &'a LaserScan,
    inputs: &'a Inputs<'a>,
}

/// A wanted motion, and how the task stands with it.
type Decision = (Motion, Status);

const STAND: Motion = Motion {
    linear: 0.0,
    angular: 0.0,
};

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

    /// How often a path has been planned.
    pub fn plans(&self) -> u64 {
        self.plans
    }

    /// One step.
    pub fn step(&mut self, now: Time, inputs: &Inputs) -> Output {
        let (motion, status) = match self.view(now, inputs) {
            Err(cause) => (STAND, Status::Waiting(cause)),
            Ok(view) => {
                let (wanted, status) = self.decide(&view);
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
        let command = VelocityCommand {
            time: now,
            linear: motion.linear,
            angular: motion.angular,
        };
        self.last = Some(command);
        Output { command, status }
    }

    /// What the robot sees, or what is missing for it to move at all.
    fn view<'a>(&self, now: Time, inputs: &'a Inputs<'a>) -> Result<View<'a>, Cause> {
        let fresh = |time: Time| now.since(time) <= self.config.patience;
        let odometry = inputs
            .odometry
            .filter(|o| fresh(o.time))
            .ok_or(Cause::NoOdometry)?;
        let scan = inputs.scan.filter(|s| fresh(s.time)).ok_or(Cause::NoScan)?;
        let moving = match self.last {
            Some(last) if fresh(last.time) => Motion {
                linear: last.linear,
                angular: last.angular,
            },
            _ => Motion {
                linear: odometry.linear,
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
        self.look_around(view);
        if let Some(until) = course.backing_until {
            if view.now < until {
                return (self.back_off(view), Status::Moving);
            }
            course.backing_until = None;
            course.planned = None;
        }
        self.band.follow(view.robot.position, 2.0);
        let decision = self
            .keep_planned(course, grid, view)
            .err()
            .and_then(|hindrance| {
                let since = *course.hindered.get_or_insert(view.now);
                let given_up = view.now.since(since) > self.config.unreachable_after;
                // A way found earlier still leads on; people who block a new one will walk away.
                let stands = self.band.points().is_empty() || given_up;
                stands.then(|| (STAND, hindrance.status(given_up)))
            });
        decision.unwrap_or_else(|| self.drive(course, view))
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
            .inputs
            .people
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
        if let Target::Person { name, .. } = &course.task.target {
            let person = view
                .inputs
                .people
                .iter()
                .find(|person| person.name == *name)?;
            if has_moved(course.person, person.position()) {
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

    /// Plans where there is a reason to.
    fn keep_planned(
        &mut self,
        course: &mut Course,
        grid: &CostGrid,
        view: &View,
    ) -> Result<(), Hindrance> {
        let person = match &course.task.target {
            Target::Person { name, .. } => {
                let found = view
                    .inputs
                    .people
                    .iter()
                    .find(|person| person.name == *name);
                Some(found.ok_or(Hindrance::NoPerson)?)
            }
            _ => None,
        };
        let age = course
            .planned
            .map_or(f64::INFINITY, |planned| view.now.since(planned));
        if age < 0.5 {
            return course.hindrance.map_or(Ok(()), Err);
        }
        let moved = person.is_some_and(|person| has_moved(course.person, person.position()));
        let now = price(grid, self.band.points());
        course.price = course.price.min(now.cost);
        let dearer = now.blocked || now.cost > 1.3 * course.price + 1.5;
        if self.band.points().is_empty() || moved || dearer || course.hindrance.is_some() {
            return self.plan(course, grid, view, person, Care::Map);
        }
        let walkers = view.inputs.people.iter().any(Person::is_walking);
        if view.inputs.social && walkers && age >= self.config.review {
            self.review(course, grid, view, person);
        }
        Ok(())
    }

    /// Takes a new way only where it is clearly cheaper than the one the robot is on.
    fn review(
        &mut self,
        course: &mut Course,
        grid: &CostGrid,
        view: &View,
        person: Option<&Person>,
    ) {
        let old = std::mem::take(&mut self.band);
        let kept = course.clone();
        let found = self.plan(course, grid, view, person, Care::Map);
        let new = self.planner.price(self.band.points());
        let before = self.planner.price(old.points());
        if found.is_err() || !before.blocked && new.cost > 0.85 * before.cost {
            self.band = old;
            *course = Course {
                planned: Some(view.now),
                ..kept
            };
        }
    }

    /// Plans a path and lays a band along it.
    fn plan(
        &mut self,
        course: &mut Course,
        grid: &CostGrid,
        view: &View,
        person: Option<&Person>,
        care: Care,
    ) -> Result<(), Hindrance> {
        self.plans += 1;
        course.planned = Some(view.now);
        let robot = view.robot.position;
        self.planner.load(grid);
        if view.inputs.social {
            self.planner
                .expect(view.inputs.people, robot, view.inputs.limits.max_speed);
        }
        if care == Care::Laser {
            let standing: Vec<Presence> = view
                .inputs
                .people
                .iter()
                .filter(|person| view.inputs.social && !person.is_walking())
                .map(|person| person.predicted(0.0))
                .collect();
            let reach = (view.inputs.limits.radius, 4.0);
            self.planner.block(&self.obstacles, &standing, robot, reach);
        }
        let found = self.line(course, grid, robot, person);
        course.hindrance = found.as_ref().err().copied();
        let (destination, line) = found?;
        course.hindered = None;
        let line_end = line[line.len() - 1];
        course.destination = Some(Destination {
            point: line_end,
            ..destination
        });
        course.person = person.map_or(robot, Person::position);
        course.at_place = false;
        self.band = Band::new(&line, &self.config.gains);
        self.relax(view, 20);
        course.price = price(grid, self.band.points()).cost;
        let length = self.band.length();
        if length > course.shortest + 0.5 {
            course.shortest = length;
        }
        Ok(())
    }

    /// The way to the first of the task's places that can be reached.
    fn line(
        &mut self,
        course: &Course,
        grid: &CostGrid,
        robot: Point2<f64>,
        person: Option<&Person>,
    ) -> Result<(Destination, Vec<Point2<f64>>), Hindrance> {
        let single = |point, heading| vec![(Destination { point, heading }, 1.0)];
        let places = match (&course.task.target, person) {
            (Target::Region { entry, .. }, _) => {
                let region = course.region.as_ref();
                let place = region.and_then(|region| region.place_inside(*entry, grid));
                let point = place.ok_or(Hindrance::RegionBlocked)?;
                vec![(
                    Destination {
                        point,
                        heading: None,
                    },
                    0.3,
                )]
            }
            (Target::Point(point), _) => single(*point, None),
            (Target::Pose(pose), _) => {
                single(pose.translation.vector.into(), Some(pose.rotation.angle()))
            }
            (Target::Person { .. }, None) => return Err(Hindrance::NoPerson),
            (Target::Person { distance, .. }, Some(person)) => {
                places_to_talk(person, *distance, robot)
                    .map(|place| (place, 0.15))
                    .collect()
            }
        };
        let mut first_error = None;
        for (place, tolerance) in places {
            match self.planner.line_to(robot, &place, tolerance) {
                Ok(line) => return Ok((place, line)),
                Err(error) => first_error = first_error.or(Some(error)),
            }
        }
        Err(first_error.map_or(Hindrance::RegionBlocked, Hindrance::NoPath))
    }

    /// Lets the band move.
    fn relax(&mut self, view: &View, iterations: usize) -> BandState {
        let people = if view.inputs.social {
            view.inputs.people
        } else {
            &[]
        };
        let limits = &view.inputs.limits;
        let around = Surroundings {
            obstacles: &self.obstacles,
            people,
            radius: limits.radius,
            speed: limits.max_speed,
        };
        self.band.update(&around, &self.config.gains, iterations)
    }

    /// Follows the band, watches the headway.
    fn drive(&mut self, course: &mut Course, view: &View) -> Decision {
        let broken = matches!(self.relax(view, 2), BandState::Broken { .. });
        let age = course
            .planned
            .map_or(0.0, |planned| view.now.since(planned));
        let left = self.band.length();
        if left < course.shortest - 0.2 {
            course.shortest = left;
            course.headway = view.now;
            course.recoveries = 0;
        }
        let waited = view.now.since(course.headway);
        if waited > self.config.give_up_after {
            return (STAND, Status::Failed(Failure::Stuck));
        }
        let due = self.config.recover_after * f64::from(course.recoveries + 1);
        if waited > due {
            course.recoveries += 1;
            // Every other time it makes room first, and plans when it has.
            if course.recoveries.is_multiple_of(2) {
                course.backing_until = Some(view.now + 2.0);
            }
        }
        if waited > due || broken && age >= 0.5 {
            let person = person_of(&course.task, view.inputs.people);
            if let Some(grid) = view.inputs.grid {
                // Without a new way the old one is as good as any.
                course.hindrance = self.plan(course, grid, view, person, Care::Laser).err();
            }
        }
        let limits = &view.inputs.limits;
        let line = self.band.points();
        if !view.inputs.social {
            let ahead = line.get(1..).unwrap_or_default();
            let motion = follow(&view.robot, ahead, limits.max_speed, limits, false);
            return (motion, Status::Moving);
        }
        self.ground
            .load(view.robot.position, &self.obstacles, limits.radius);
        let addressee = match &course.task.target {
            Target::Person { name, .. } => Some(name.as_str()),
            _ => None,
        };
        let scene = Scene {
            line,
            people: view.inputs.people,
            ground: &self.ground,
            limits,
            waited,
            addressee,
        };
        let choice = self.anticipation.choose(&view.robot, &scene);
        let stands = choice.motion.linear.abs() < 0.02
            && !matches!(choice.manoeuvre, Manoeuvre::Along(share) if share > 0.0);
        let status = if stands {
            Status::Waiting(Cause::People)
        } else {
            Status::Moving
        };
        (choice.motion, status)
    }

    /// Backs off slowly, or turns where there is no room behind.
    fn back_off(&self, view: &View) -> Motion {
        let (_, behind) = self.config.guard.allowed(view.scan, &view.inputs.limits);
        if behind > 0.05 {
            Motion {
                linear: -0.15,
                angular: 0.0,
            }
        } else {
            Motion {
                linear: 0.0,
                angular: 0.5,
            }
        }
    }
}

/// Whom a task leads to, where they are known.
fn person_of<'a>(task: &Task, people: &'a [Person]) -> Option<&'a Person> {
    match &task.target {
        Target::Person { name, .. } => people.iter().find(|person| person.name == *name),
        _ => None,
    }
}

/// What a new path takes account of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Care {
    /// The grid, which is right about all that does not walk.
    Map,
    /// Also what the laser sees: the grid has led the robot to where it cannot go on.
    Laser,
}

/// Why there is no way now.
#[derive(Debug, Clone, Copy)]
enum Hindrance {
    NoPath(PathError),
    RegionBlocked,
    NoPerson,
}

impl Hindrance {
    fn status(self, given_up: bool) -> Status {
        match self {
            Self::NoPath(error) if given_up => Status::Failed(Failure::NoPath(error)),
            Self::RegionBlocked if given_up => Status::Failed(Failure::RegionBlocked),
            Self::NoPerson if given_up => Status::Failed(Failure::PersonUnseen),
            Self::NoPath(_) | Self::RegionBlocked => Status::Waiting(Cause::NoPath),
            Self::NoPerson => Status::Waiting(Cause::NoPerson),
        }
    }
}

impl Course {
    fn new(task: &Task, now: Time) -> Self {
        let region = match &task.target {
            Target::Region { polygon, .. } => Some(Region::new(polygon)),
            _ => None,
        };
        Self {
            task: task.clone(),
            region,
            ended: None,
            destination: None,
            person: Point2::origin(),
            planned: None,
            price: f64::INFINITY,
            shortest: f64::INFINITY,
            headway: now,
            recoveries: 0,
            backing_until: None,
            hindered: None,
            hindrance: None,
            at_place: false,
        }
    }
}

#[cfg(test)]
mod crowd;
#[cfg(test)]
mod tests;
