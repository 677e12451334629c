//! One simulated person: the way still to go, the direction to look, and the attention given to
//! the robot. A person never walks into a wall, a table, the robot or somebody else.

use super::Body;
use super::obstacles::Obstacles;
use super::route::FloorPlan;
use super::walking::{Disc, choose};
use crate::scenario::{Face, Person};
use dsr::Time;
use nalgebra::{Point2, Vector2};

/// How fast people turn, rad/s.
const TURN: f64 = 2.5;
/// Corners of the way count as reached this near, the end of it nearer, m.
const AT_CORNER: f64 = 0.3;
const AT_END: f64 = 0.08;
/// Whoever gets no further for this long looks for another way, s; this near to the end, m, they
/// leave it at that.
const PATIENCE: f64 = 2.5;
const NEAR_ENOUGH: f64 = 0.7;

/// What everybody sees of the world in one step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Walking<'a> {
    pub(super) now: Time,
    pub(super) dt: f64,
    pub(super) robot: Disc,
    /// The scenario's people, which [`Face::Person`] counts through.
    pub(super) people: &'a [Person],
    pub(super) obstacles: &'a Obstacles,
    pub(super) plan: &'a FloorPlan,
}

#[derive(Debug, Clone)]
pub(super) struct Walker {
    pub(super) body: Body,
    pub(super) present: bool,
    pub(super) face: Option<Face>,
    pub(super) attention_until: Option<Time>,
    speed: f64,
    /// Corners still to pass, the last first.
    way: Vec<Point2<f64>>,
    /// Least distance to the next corner so far, and for how long it has not shrunk.
    least: f64,
    stuck: f64,
}

impl Walker {
    pub(super) fn new(person: &Person) -> Self {
        let at = person.pose.translation.vector.into();
        let heading = person.pose.rotation.angle();
        Self::of(
            Body::standing(&person.name, at, heading, person.radius),
            person.speed,
        )
    }

    pub(super) fn of(body: Body, speed: f64) -> Self {
        Self {
            body,
            present: true,
            face: None,
            attention_until: None,
            speed,
            way: Vec::new(),
            least: f64::INFINITY,
            stuck: 0.0,
        }
    }

    /// Sets out for `goal`.
    pub(super) fn go(&mut self, goal: Point2<f64>, plan: &FloorPlan) {
        self.way = plan.route(self.body.position, goal);
        self.way.reverse();
        self.least = f64::INFINITY;
        self.stuck = 0.0;
    }

    pub(super) fn has_arrived(&self) -> bool {
        self.way.is_empty()
    }

    /// Takes its place among all bodies.
    pub(super) fn show(&self, bodies: &mut [Body]) {
        if let Some(body) = bodies.iter_mut().find(|body| body.name == self.body.name) {
            body.clone_from(&self.body);
        }
    }

    /// Moves on by one step among all `bodies`.
    pub(super) fn step(&mut self, world: &Walking<'_>, bodies: &[Body]) {
        if self.attention_until.is_some_and(|until| world.now < until) {
            self.body.velocity = Vector2::zeros();
            self.turn_to(world.robot.position, world.dt);
            return;
        }
        self.attention_until = None;
        self.pass_corners();
        let Some(corner) = self.way.last().copied() else {
            self.body.velocity = Vector2::zeros();
            self.look(world, bodies);
            return;
        };
        let to_go = corner - self.body.position;
        let last = self.way.len() == 1;
        // The last step is as short as it needs to be.
        let speed = if last {
            self.speed.min(to_go.norm() / world.dt)
        } else {
            self.speed
        };
        let wanted = to_go.normalize() * speed;
        let others: Vec<Disc> = bodies
            .iter()
            .filter(|other| other.name != self.body.name)
            .map(Body::disc)
            .chain([world.robot])
            .collect();
        let velocity = choose(&self.body, wanted, &others, world.obstacles);
        let next = self.body.position + velocity * world.dt;
        if self.may_stand(next, &others, world.obstacles) {
            self.body.position = next;
            self.body.velocity = velocity;
        } else {
            self.body.velocity = Vector2::zeros();
        }
        if self.body.velocity.norm() > 0.05 {
            let ahead = self.body.position + self.body.velocity;
            self.turn_to(ahead, world.dt);
        }
        self.mind_progress(corner, world);
    }

    fn pass_corners(&mut self) {
        while let Some(corner) = self.way.last() {
            let near = if self.way.len() == 1 {
                AT_END
            } else {
                AT_CORNER
            };
            if (corner - self.body.position).norm() > near {
                return;
            }
            self.way.pop();
            self.least = f64::INFINITY;
            self.stuck = 0.0;
        }
    }

    /// Whether stepping there enters nothing, or at least nothing deeper.
    fn may_stand(&self, next: Point2<f64>, others: &[Disc], obstacles: &Obstacles) -> bool {
        let here = self.body.position;
        let (before, after) = (
            obstacles.clearance_of_walker(here),
            obstacles.clearance_of_walker(next),
        );
        if after < self.body.radius && after < before {
            return false;
        }
        others.iter().all(|other| {
            let reach = self.body.radius + other.radius;
            let (before, after) = (other.position - here, other.position - next);
            after.norm() >= reach || after.norm() >= before.norm()
        })
    }

    /// Notices being stuck, and then takes a new way or is content.
    fn mind_progress(&mut self, corner: Point2<f64>, world: &Walking<'_>) {
        let distance = (corner - self.body.position).norm();
        if distance < self.least - 0.02 {
            self.least = distance;
            self.stuck = 0.0;
            return;
        }
        self.stuck += world.dt;
        if self.stuck < PATIENCE {
            return;
        }
        let Some(goal) = self.way.first().copied() else {
            return;
        };
        if (goal - self.body.position).norm() < NEAR_ENOUGH {
            self.way.clear();
        } else {
            self.go(goal, world.plan);
        }
    }

    fn look(&mut self, world: &Walking<'_>, bodies: &[Body]) {
        let target = match self.face {
            None => return,
            Some(Face::Heading(heading)) => {
                self.body.position + Vector2::new(heading.cos(), heading.sin())
            }
            Some(Face::Point(point)) => point,
            Some(Face::Person(person)) => {
                let name = &world.people[person].name;
                let Some(other) = bodies.iter().find(|other| other.name == *name) else {
                    return;
                };
                other.position
            }
        };
        self.turn_to(target, world.dt);
    }

    fn turn_to(&mut self, target: Point2<f64>, dt: f64) {
        let direction = target - self.body.position;
        if direction.norm() > 1e-6 {
            let turn = super::wrap(direction.y.atan2(direction.x) - self.body.heading);
            let turned = self.body.heading + turn.clamp(-TURN * dt, TURN * dt);
            self.body.heading = super::wrap(turned);
        }
    }
}
