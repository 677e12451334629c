//! The world simulator: rooms, a robot, cameras and people. A world is a function of its scenario,
//! its seed and its inputs, to the bit; it reads no clock and starts no process.
//!
//! All in the world frame, SI units and radians.

mod base;
mod camera;
mod crowd;
mod laser;
mod localisation;
mod obstacles;
mod random;
mod route;
#[cfg(test)]
mod tests;
mod timetable;
mod walker;
mod walking;

use crate::scenario::{Camera, Scenario};
use crate::tracks::Tracks;
use agents::messages::{CameraFrame, LaserScan, Odometry, Speech, VelocityCommand};
use base::Base;
use crowd::Crowd;
use dsr::Time;
use localisation::Drift;
use nalgebra::{Isometry2, Point2, Vector2};
use obstacles::Obstacles;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use random::stream;
use route::FloorPlan;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
pub use timetable::{Whereabouts, whereabouts};
use walking::Disc;

/// What reaches the world in one step.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Inputs {
    /// The newest command to the base, if one came since the last step.
    pub velocity: Option<VelocityCommand>,
    /// All that the robot said since the last step.
    pub speech: Vec<Speech>,
}

/// What the sensors deliver in one step, and what is true.
#[derive(Debug, Clone, PartialEq)]
pub struct Outputs {
    /// Images that arrived, as they were due; of one moment, in the order of the scenario's cameras.
    pub frames: Vec<CameraFrame>,
    /// A turn of the laser, where one became due.
    pub scan: Option<LaserScan>,
    /// A localisation, where one became due.
    pub odometry: Option<Odometry>,
    /// The state after the step. For metrics and pictures; no agent may see it.
    pub truth: Truth,
}

/// The true state of the world at one time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// When.
    pub time: Time,
    /// Where the robot is.
    pub world_from_robot: Isometry2<f64>,
    /// The robot's forward speed, m/s, and turning speed, rad/s.
    pub velocity: Vector2<f64>,
    /// Its speed to the left, m/s; 0 of a differential base.
    pub lateral: f64,
    /// Everybody in the world.
    pub people: Vec<Body>,
    /// Collisions of the robot so far.
    pub collisions: Collisions,
}

/// A person's body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Body {
    /// Who it is; unique at any time.
    pub name: String,
    /// Its centre.
    pub position: Point2<f64>,
    /// Where it faces.
    pub heading: f64,
    /// How it moves, m/s.
    pub velocity: Vector2<f64>,
    /// Its radius.
    pub radius: f64,
}

/// Contacts of the robot's body. A contact counts once, until there is a gap again.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Collisions {
    /// With walls.
    pub walls: u64,
    /// With furniture.
    pub objects: u64,
    /// With people, whoever walked into whom.
    pub people: u64,
}

impl Collisions {
    /// Contacts with anything.
    pub fn total(&self) -> u64 {
        self.walls + self.objects + self.people
    }
}

impl Body {
    pub(crate) fn standing(name: &str, position: Point2<f64>, heading: f64, radius: f64) -> Self {
        let name = name.to_owned();
        Self {
            name,
            position,
            heading,
            velocity: Vector2::zeros(),
            radius,
        }
    }

    fn disc(&self) -> Disc {
        let Self {
            position,
            velocity,
            radius,
            ..
        } = *self;
        Disc {
            position,
            velocity,
            radius,
            is_robot: false,
        }
    }
}

/// When a sensor measures.
#[derive(Debug, Clone, Copy)]
struct Beat {
    period: f64,
    next: Time,
}

impl Beat {
    fn new(rate: f64, start: Time) -> Self {
        let period = 1.0 / rate;
        Self {
            period,
            next: start + period,
        }
    }

    /// Whether a measurement is due, to the nearest step; notes that it was taken.
    fn is_due(&mut self, now: Time, dt: f64) -> bool {
        if self.next.since(now) > dt / 2.0 {
            return false;
        }
        while self.next.since(now) <= dt / 2.0 {
            self.next = self.next + self.period;
        }
        true
    }
}

/// A camera at work. What it sees and how long that takes are drawn apart: a delay changes no image.
#[derive(Debug, Clone)]
struct Eye {
    beat: Beat,
    sight: ChaCha8Rng,
    delays: ChaCha8Rng,
}

impl Eye {
    /// How long the next image takes to arrive, s.
    fn delay(&mut self, camera: &Camera) -> f64 {
        let jitter = camera.delay_jitter;
        let more = (jitter > 0.0).then(|| self.delays.random::<f64>() * jitter);
        camera.delay + more.unwrap_or_default()
    }
}

/// An image that was taken and has not arrived.
#[derive(Debug, Clone)]
struct UnderWay {
    due: Time,
    frame: CameraFrame,
}

/// A running world.
#[derive(Debug, Clone)]
pub struct World {
    scenario: Scenario,
    obstacles: Obstacles,
    plan: FloorPlan,
    now: Time,
    base: Base,
    crowd: Crowd,
    drift: Drift,
    localised: Time,
    laser: (Beat, ChaCha8Rng),
    dropouts: ChaCha8Rng,
    localisation: (Beat, ChaCha8Rng),
    cameras: Vec<Eye>,
    under_way: Vec<UnderWay>,
}

impl World {
    /// The world of `scenario` at its start. `tracks` take the place of the scenario's people.
    pub fn new(scenario: &Scenario, seed: u64, tracks: Option<Tracks>) -> Self {
        let start = scenario.start;
        let obstacles = Obstacles {
            walls: scenario.walls.clone(),
            objects: scenario.objects.clone(),
        };
        let plan = FloorPlan::new(scenario.bounds, &obstacles);
        let crowd = Crowd::new(scenario, seed, tracks, &plan);
        let robot = &scenario.robot;
        let mut wander = stream(seed, "localisation");
        let drift = Drift::new(&robot.localisation, &mut wander);
        let cameras = scenario.cameras.iter().map(|camera| {
            let name = &camera.name;
            Eye {
                beat: Beat::new(camera.rate, start),
                sight: stream(seed, &format!("camera/{name}")),
                delays: stream(seed, &format!("delay/{name}")),
            }
        });
        Self {
            obstacles,
            plan,
            now: start,
            base: Base::new(robot),
            crowd,
            drift,
            localised: start,
            laser: (Beat::new(robot.laser.rate, start), stream(seed, "laser")),
            dropouts: stream(seed, "dropouts"),
            localisation: (Beat::new(robot.localisation.rate, start), wander),
            cameras: cameras.collect(),
            under_way: Vec::new(),
            scenario: scenario.clone(),
        }
    }

    /// The simulated time.
    pub fn time(&self) -> Time {
        self.now
    }

    /// The true state now.
    pub fn truth(&self) -> Truth {
        Truth {
            time: self.now,
            world_from_robot: self.base.pose,
            velocity: self.base.velocity,
            lateral: self.base.lateral,
            people: self.crowd.bodies().to_vec(),
            collisions: self.base.collisions,
        }
    }

    /// Moves everything on by `dt` seconds: people, then the robot, then the sensors measure.
    pub fn step(&mut self, dt: f64, inputs: &Inputs) -> Outputs {
        let before = self.now;
        self.now = before + dt;
        if let Some(command) = inputs.velocity {
            self.base.take(before, command);
        }
        let robot = Disc {
            position: self.base.position(),
            velocity: self.base.pose.rotation
                * Vector2::new(self.base.velocity.x, self.base.lateral),
            radius: self.scenario.robot.radius,
            is_robot: true,
        };
        self.crowd.step(
            self.now,
            dt,
            robot,
            &inputs.speech,
            &self.obstacles,
            &self.plan,
        );
        let people = self.crowd.bodies();
        self.base
            .drive(&self.scenario.robot, self.now, dt, &self.obstacles, people);
        let frames = self.images(dt);
        Outputs {
            frames,
            scan: self.scan(dt),
            odometry: self.odometry(dt),
            truth: self.truth(),
        }
    }

    /// Takes the images that are due, and delivers those that have come so far.
    fn images(&mut self, dt: f64) -> Vec<CameraFrame> {
        for (camera, eye) in self.scenario.cameras.iter().zip(&mut self.cameras) {
            if eye.beat.is_due(self.now, dt) {
                let people = self.crowd.bodies();
                let sight = &mut eye.sight;
                let frame = camera::image(camera, &self.obstacles, people, sight, self.now);
                let due = self.now + eye.delay(camera);
                self.under_way.push(UnderWay { due, frame });
            }
        }
        self.under_way.sort_by_key(|image| image.due);
        let arrived = |image: &UnderWay| image.due.since(self.now) <= dt / 2.0;
        let count = self.under_way.partition_point(arrived);
        self.under_way
            .drain(..count)
            .map(|image| image.frame)
            .collect()
    }

    fn scan(&mut self, dt: f64) -> Option<LaserScan> {
        let (beat, random) = &mut self.laser;
        let people = self
            .crowd
            .bodies()
            .iter()
            .map(|body| (body.position, body.radius));
        let laser = &self.scenario.robot.laser;
        beat.is_due(self.now, dt).then(|| {
            let pose = &self.base.pose;
            let mut scan = laser::scan(laser, pose, &self.obstacles, people, random, self.now);
            laser::drop_out(laser, &mut scan, &mut self.dropouts);
            scan
        })
    }

    fn odometry(&mut self, dt: f64) -> Option<Odometry> {
        let (beat, random) = &mut self.localisation;
        beat.is_due(self.now, dt).then(|| {
            let since = self.now.since(self.localised);
            self.localised = self.now;
            Odometry {
                time: self.now,
                world_from_robot: self.drift.measure(&self.base.pose, since, random),
                linear: self.base.velocity.x,
                lateral: self.base.lateral,
                angular: self.base.velocity.y,
            }
        })
    }
}

/// The same angle in [-pi, pi).
pub(crate) fn wrap(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}
