//! The robot as others drive it, for comparison: down the cheapest path on the map, or as an agent of the
//! social-force model. This file guarantees that both keep the base's limits and obey the same laser guard
//! as our navigation, so that what differs is the method.

use super::STEP;
use super::social_force::{Agent, force};
use agents::grid::{BLOCKED, CostGrid};
use agents::messages::{LaserScan, Odometry, VelocityCommand};
use agents::navigation::control::{Guard, Motion, Unicycle, follow};
use agents::navigation::navigator::{Cause, Config, Inputs, Output, Status};
use agents::navigation::obstacles::{Obstacles, world_hits};
use agents::navigation::path::{Request, Search};
use agents::navigation::target::Target;
use dsr::Time;
use nalgebra::{Point2, Rotation2, Vector2, distance};

/// How the robot finds its way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Our navigation: path, band, control, and where it is social, anticipation.
    #[default]
    Navigation,
    /// The cheapest path (A*) on the map with people as obstacles, found anew with every map, and followed.
    AStar,
    /// An agent of the social-force model on its way along the cheapest path past walls and furniture.
    SocialForce,
}

/// A blocked start or goal gives way so far, m.
const TOLERANCE: f64 = 1.0;
/// The agent of the social-force model walks toward the path's farthest point that it sees, up to so far
/// ahead, m.
const AHEAD: f64 = 2.0;
/// From one look at the map to the next, s: as often as social mapping makes one in a trial.
const REPLAN: f64 = 0.5;
/// For so long the forces act before the velocity that they come to is aimed at, s.
const HORIZON: f64 = 0.5;
/// What the laser sees so near a body is that body, m.
const BESIDE: f64 = 0.2;
/// How far ahead of itself the agent aims at where its velocity leads, m.
const LEAD: f64 = 2.0;

/// One of the other methods, under way to a point.
#[derive(Debug, Clone)]
pub(super) struct Plain {
    forces: bool,
    config: Config,
    guard: Guard,
    search: Search,
    /// The map with obstacles as much larger as the guard keeps from them.
    grid: CostGrid,
    path: Vec<Point2<f64>>,
    planned: Option<Time>,
    last: Option<VelocityCommand>,
    plans: u64,
}

impl Plain {
    /// By A*, or by forces.
    pub(super) fn new(forces: bool, config: Config) -> Self {
        Self {
            forces,
            config,
            guard: config.guard,
            search: Search::default(),
            grid: CostGrid::covering([0.0; 4], 1.0),
            path: Vec::new(),
            planned: None,
            last: None,
            plans: 0,
        }
    }

    /// How often it has planned.
    pub(super) fn plans(&self) -> u64 {
        self.plans
    }

    /// One step, as [`agents::navigation::navigator::Navigator::step`] has it; only points are targets.
    pub(super) fn step(&mut self, now: Time, inputs: &Inputs) -> Output {
        let (motion, status) = match (inputs.odometry, inputs.scan, inputs.grid) {
            (None, ..) => (Motion::default(), Status::Waiting(Cause::NoOdometry)),
            (_, None, _) => (Motion::default(), Status::Waiting(Cause::NoScan)),
            (.., None) => (Motion::default(), Status::Waiting(Cause::NoGrid)),
            (Some(odometry), Some(scan), Some(grid)) => {
                self.drive(now, odometry, scan, grid, inputs)
            }
        };
        let command = motion.command(now);
        self.last = Some(command);
        Output { command, status }
    }

    fn drive(
        &mut self,
        now: Time,
        odometry: &Odometry,
        scan: &LaserScan,
        grid: &CostGrid,
        inputs: &Inputs,
    ) -> (Motion, Status) {
        let robot = Unicycle {
            position: odometry.world_from_robot.translation.vector.into(),
            heading: odometry.world_from_robot.rotation.angle(),
            motion: self.last.map_or_else(Motion::default, |last| Motion {
                linear: last.linear,
                lateral: last.lateral,
                angular: last.angular,
            }),
        };
        let goal = match inputs.task.map(|task| &task.target) {
            Some(Target::Point(goal)) => *goal,
            _ => return (Motion::default(), Status::Idle),
        };
        if distance(&robot.position, &goal) < self.config.goal_tolerance {
            return (Motion::default(), Status::Arrived);
        }
        if self.planned.is_none_or(|then| now.since(then) >= REPLAN) {
            self.planned = Some(now);
            self.plan(grid, robot.position, goal);
        }
        self.pass(robot.position);
        let limits = &inputs.limits;
        let (wanted, status) = match self.path.last() {
            None => (Motion::default(), Status::Waiting(Cause::NoPath)),
            Some(_) if self.forces => {
                let obstacles = obstacles(scan, &robot, inputs);
                let motion = self.yielding(&robot, goal, inputs, &obstacles);
                (motion, Status::Moving)
            }
            Some(_) => {
                let line = self.path.get(1..).unwrap_or_default();
                let top = limits.max_speed;
                (follow(&robot, line, top, limits, false), Status::Moving)
            }
        };
        let smooth = limits.reachable(robot.motion, wanted, STEP);
        (self.guard.slowed(smooth, scan, limits), status)
    }

    /// The cheapest path; the old one goes where there is none.
    fn plan(&mut self, grid: &CostGrid, robot: Point2<f64>, goal: Point2<f64>) {
        self.plans += 1;
        self.path.clear();
        self.grid = widened(grid, self.guard.margin);
        let grid = &self.grid;
        let (Some(start), Some(end)) = (grid.cell_at(robot), grid.cell_at(goal)) else {
            return;
        };
        let request = Request {
            start_tolerance: TOLERANCE,
            goal_tolerance: TOLERANCE,
            ..Request::new(start, end)
        };
        let Ok(found) = self.search.find(grid, &request) else {
            return;
        };
        self.path.push(robot);
        let cells = found.cells.iter().skip(1);
        self.path.extend(cells.map(|&cell| grid.centre(cell)));
        if found.cells.last() == Some(&end) {
            self.path.pop_if(|_| found.cells.len() > 1);
            self.path.push(goal);
        }
    }

    /// Drops the points that lie behind.
    fn pass(&mut self, robot: Point2<f64>) {
        let nearest = (0..self.path.len().min(20)).min_by(|&a, &b| {
            distance(&self.path[a], &robot).total_cmp(&distance(&self.path[b], &robot))
        });
        self.path.drain(..nearest.unwrap_or(0));
    }

    /// Whether nothing on the map lies between two places.
    fn sees(&self, from: Point2<f64>, to: Point2<f64>) -> bool {
        let grid = &self.grid;
        let steps = (distance(&from, &to) / grid.resolution).ceil().max(1.0);
        (1..=steps as usize).all(|k| {
            let place = from + (to - from) * (k as f64 / steps);
            grid.cell_at(place)
                .is_some_and(|cell| grid.cost(cell).is_finite())
        })
    }

    /// What the forces make of the robot's velocity, turned into what a differential base can do.
    fn yielding(
        &self,
        robot: &Unicycle,
        goal: Point2<f64>,
        inputs: &Inputs,
        obstacles: &Obstacles,
    ) -> Motion {
        let limits = &inputs.limits;
        let near = |point: &&Point2<f64>| distance(point, &robot.position) <= AHEAD;
        let ahead = self.path.iter().take_while(near);
        let ahead = ahead
            .filter(|point| self.sees(robot.position, **point))
            .last()
            .or(self.path.get(1))
            .unwrap_or(&goal);
        let braking = (limits.acceleration * distance(&goal, &robot.position)).sqrt();
        let turned = Rotation2::new(robot.heading);
        let heading = turned * Vector2::x();
        let agent = Agent {
            position: robot.position,
            velocity: turned * Vector2::new(robot.motion.linear, robot.motion.lateral),
            radius: limits.radius,
            wanted: (ahead - robot.position)
                .try_normalize(1e-9)
                .unwrap_or(heading)
                * limits.max_speed.min(braking),
        };
        let velocity = agent.velocity + force(&agent, inputs.people, obstacles) * HORIZON;
        let Some(direction) = velocity.try_normalize(1e-6) else {
            return Motion::default();
        };
        let line = [robot.position + direction * LEAD];
        let speed = velocity.norm().min(limits.max_speed);
        follow(robot, &line, speed, limits, false)
    }
}

/// The same map with everything that is blocked larger by `margin`, m.
fn widened(grid: &CostGrid, margin: f64) -> CostGrid {
    let mut wide = grid.clone();
    let reach = (margin / grid.resolution).round() as usize;
    for row in 0..grid.height {
        for column in 0..grid.width {
            if grid.cost((column, row)).is_finite() {
                continue;
            }
            let columns = column.saturating_sub(reach)..(column + reach + 1).min(grid.width);
            for row in row.saturating_sub(reach)..(row + reach + 1).min(grid.height) {
                let row = row * grid.width;
                wide.costs[row + columns.start..row + columns.end].fill(BLOCKED);
            }
        }
    }
    wide
}

/// Walls, and what the laser sees but people, who have a force of their own.
fn obstacles(scan: &LaserScan, robot: &Unicycle, inputs: &Inputs) -> Obstacles {
    let mut obstacles = Obstacles::new();
    let walls = inputs.walls.iter();
    walls.for_each(|&wall| obstacles.push_wall(wall));
    let body = |hit: &Point2<f64>| {
        let mut people = inputs.people.iter();
        people.any(|person| distance(&person.position(), hit) < person.radius + BESIDE)
    };
    let pose = robot.world_from_robot();
    let hits = world_hits(scan, &pose).filter(|hit| !body(hit));
    hits.for_each(|hit| obstacles.push_point(hit));
    obstacles
}
