//! Navigation on the shared graph: it carries out the `step` nodes that the executive dispatches to
//! it, and tells where the robot is. This file guarantees that all it must remember stands in the
//! graph: a navigation that is started anew goes on with the step that runs.

mod people;
mod read;

pub use self::read::{
    AGENT, BASE, BUBBLES, MAP_HOLD_AFTER, MAP_SLOW_AFTER, MAP_STATE, PLANNED_PATH, StepError,
    TALKING_DISTANCE,
};

use self::read::{Step, Work, World};
use super::control::{Base, wrapped};
use super::map_age::MapState;
use super::navigator::{Config, Inputs, Navigator, Output, Status};
use super::target::{INSIDE, Region, Target, Task};
use crate::grid::CostGrid;
use crate::messages::{LaserScan, Odometry, Speech, VelocityCommand};
use dsr::{
    EdgeRef, NodeId, NodeRef, Operation, Owner, Precondition, ReadError, Snapshot, Time,
    Transaction, Value, planar_pose,
};
use nalgebra::Point2;

/// The robot's pose is written when it differs from the graph's by more than this, metres ...
const MOVED: f64 = 0.01;
/// ... or this, radians.
const TURNED: f64 = std::f64::consts::PI / 180.0;
/// Its velocity, by more than this, m/s or rad/s.
const CHANGED: f64 = 0.02;
/// Its path, by more than this, metres, and not more often than so, seconds.
const BENT: (f64, f64) = (0.05, 0.25);
/// A rule that the store did not apply is submitted again after this, seconds, and given up after
/// the second figure.
const RETRY: (f64, f64) = (1.0, 5.0);
/// The robot is in another room than the graph says when it was measured there for so long, seconds.
const SETTLED: f64 = 0.5;

/// The latest messages.
#[derive(Debug, Clone, Copy, Default)]
pub struct Messages<'a> {
    /// From the base.
    pub odometry: Option<&'a Odometry>,
    /// From the laser.
    pub scan: Option<&'a LaserScan>,
    /// From social mapping.
    pub grid: Option<&'a CostGrid>,
}

/// What one turn wants done.
#[derive(Debug, Clone, PartialEq)]
pub struct Effects {
    /// For the base.
    pub command: VelocityCommand,
    /// For the loudspeaker.
    pub speech: Option<Speech>,
    /// For the store, in this order; a refusal of one does not hold up the next.
    pub transactions: Vec<Transaction>,
    /// How the navigation stands.
    pub status: Status,
    /// What the social grid is worth, and how many seconds ago it held, where it says when.
    pub map: (MapState, Option<f64>),
}

/// The navigation agent without its process.
#[derive(Debug, Clone, Default)]
pub struct Navigation {
    navigator: Navigator,
    attempt: Option<Attempt>,
    attempts: u64,
    path_written: Option<Time>,
    /// The room where the robot was measured though the graph says another, and since when.
    elsewhere: Option<(NodeId, Time)>,
}

/// One carrying out of a step.
#[derive(Debug, Clone)]
struct Attempt {
    step: NodeId,
    task: String,
    /// Whether the graph has shown the step as running.
    running: bool,
    began: Time,
    asked: Option<Time>,
    /// Where the robot stands aside.
    aside: Option<Point2<f64>>,
    /// When its end was first and last submitted.
    ended: Option<(Time, Time)>,
}

/// How far a step is.
enum Progress {
    UnderWay,
    Done,
    Failed(String),
}

impl Navigation {
    /// A navigation that knows nothing yet.
    pub fn new(config: Config) -> Self {
        Self {
            navigator: Navigator::new(config),
            ..Self::default()
        }
    }

    /// The navigator inside.
    pub fn navigator(&self) -> &Navigator {
        &self.navigator
    }

    /// One turn. While the graph has no world or no robot, the robot stands.
    ///
    /// # Errors
    /// [`ReadError`]: take a new snapshot; until then the base stops by itself.
    pub fn step(
        &mut self,
        now: Time,
        messages: &Messages,
        snapshot: &Snapshot,
    ) -> Result<Effects, ReadError> {
        let Some(world) = read::world(snapshot, now)? else {
            return Ok(Effects {
                command: VelocityCommand {
                    time: now,
                    linear: 0.0,
                    lateral: 0.0,
                    angular: 0.0,
                },
                speech: None,
                transactions: Vec::new(),
                status: Status::Idle,
                map: (MapState::Current, None),
            });
        };
        let step = read::step(snapshot)?;
        let mut transactions = Vec::new();
        let mut speech = None;
        let output = match &step {
            None => {
                self.attempt = None;
                self.navigator.step(now, &inputs(messages, &world, None))
            }
            Some(step) => {
                self.begin(step, now);
                if !step.running {
                    transactions.push(set_status(step, "dispatched", "running"));
                }
                let (output, progress) = match read::work(snapshot, &world, step)? {
                    Ok(work) => self.carry_out(&work, now, messages, &world, &mut speech),
                    Err(error) => {
                        let output = self.navigator.step(now, &inputs(messages, &world, None));
                        (output, Progress::Failed(error.to_string()))
                    }
                };
                transactions.extend(self.end(step, progress, now));
                output
            }
        };
        transactions.extend(self.report(snapshot, &world, messages, now)?);
        transactions.extend(self.localise(&world, messages, step.as_ref(), now));
        Ok(Effects {
            command: output.command,
            speech,
            transactions,
            status: output.status,
            map: (world.map, world.map_age),
        })
    }

    /// Notices a step that it has not carried out before, or that was dispatched once more.
    fn begin(&mut self, step: &Step, now: Time) {
        let same =
            |attempt: &Attempt| attempt.step == step.id && (step.running || !attempt.running);
        if !self.attempt.as_ref().is_some_and(same) {
            self.attempts += 1;
            self.attempt = Some(Attempt {
                step: step.id,
                task: format!("{} #{}", step.name, self.attempts),
                running: false,
                began: now,
                asked: None,
                aside: None,
                ended: None,
            });
        }
        if let Some(attempt) = &mut self.attempt {
            attempt.running |= step.running;
        }
    }

    fn carry_out(
        &mut self,
        work: &Work,
        now: Time,
        messages: &Messages,
        world: &World,
        speech: &mut Option<Speech>,
    ) -> (Output, Progress) {
        match work {
            Work::Drive(target) => self.drive(target, now, messages, world),
            Work::Ask { person, words } => self.ask((person, words), now, messages, world, speech),
            Work::Wait(name) => self.wait(name, now, messages, world),
            Work::LetPass(name) => self.let_pass(name, now, messages, world),
        }
    }

    /// Takes the robot to a target.
    fn drive(
        &mut self,
        target: &Target,
        now: Time,
        messages: &Messages,
        world: &World,
    ) -> (Output, Progress) {
        let attempt = self.attempt.as_ref();
        let task = Task {
            id: attempt.map_or_else(String::new, |attempt| attempt.task.clone()),
            target: target.clone(),
        };
        let inputs = inputs(messages, world, Some(&task));
        let output = self.navigator.step(now, &inputs);
        let progress = match output.status {
            Status::Arrived => Progress::Done,
            Status::Failed(failure) => Progress::Failed(failure.to_string()),
            _ => Progress::UnderWay,
        };
        (output, progress)
    }

    /// Tells the graph how the step ended: the rule is applied and the step done in one
    /// transaction, which the store takes whole or not at all.
    fn end(&mut self, step: &Step, progress: Progress, now: Time) -> Option<Transaction> {
        let attempt = self.attempt.as_mut()?;
        if matches!(progress, Progress::UnderWay) {
            return None;
        }
        let (first, last) = *attempt.ended.get_or_insert((now, now));
        if now != last && now.since(last) < RETRY.0 {
            return None;
        }
        attempt.ended = Some((first, now));
        let refused = now.since(first) >= RETRY.1;
        Some(match progress {
            Progress::Done if !refused => {
                let mut transaction = set_status(step, "running", "done");
                let binding = step.binding.iter();
                let binding =
                    binding.map(|(variable, node)| (variable.clone(), node.as_str().into()));
                transaction.operations.insert(
                    0,
                    Operation::ApplyRule {
                        rule: step.rule.clone(),
                        binding: binding.collect(),
                    },
                );
                transaction
            }
            Progress::Done => failed(
                step,
                &format!("`{}` was carried out, and could not be applied", step.rule),
            ),
            Progress::Failed(reason) => failed(step, &reason),
            Progress::UnderWay => return None,
        })
    }

    /// Writes where the robot is, how it moves, and its path, where the graph says otherwise.
    fn report(
        &mut self,
        snapshot: &Snapshot,
        world: &World,
        messages: &Messages,
        now: Time,
    ) -> Result<Option<Transaction>, ReadError> {
        let mut transaction = Transaction::new();
        let robot = &world.robot;
        if let Some(odometry) = messages.odometry {
            let pose = odometry.world_from_robot;
            let told = read::edge_pose(snapshot, world.id, robot.id)?;
            let differs = told.is_none_or(|told| {
                (told.translation.vector - pose.translation.vector).norm() > MOVED
                    || wrapped(told.rotation.angle() - pose.rotation.angle()).abs() > TURNED
            });
            if differs {
                transaction.push(Operation::CreateEdge {
                    edge: EdgeRef::new(world.id, "pose", robot.id),
                    attributes: vec![("transform".to_owned(), Value::Pose(planar_pose(&pose)))],
                });
            }
            let mut moving = vec![odometry.linear, odometry.angular];
            if robot.limits.base == Base::Omnidirectional {
                moving.push(odometry.lateral);
            }
            let told = &robot.velocity;
            let changed = |(new, told): (&f64, &f64)| (new - told).abs() > CHANGED;
            if moving.len() != told.len() || moving.iter().zip(told).any(changed) {
                transaction.set(robot.id, "velocity", Value::Vector(moving));
            }
        }
        let knows = |name| snapshot.schema().find_attribute(name).is_some();
        if robot.map_state.as_deref() != Some(world.map.name()) && knows(MAP_STATE) {
            transaction.set(robot.id, MAP_STATE, world.map.name());
        }
        let path = coordinates(self.navigator.path());
        let planned = coordinates(self.navigator.planned());
        let bent = path.len() != robot.path.len()
            || path
                .iter()
                .zip(&robot.path)
                .any(|(new, told)| (new - told).abs() > BENT.0)
            || knows(PLANNED_PATH) && planned != robot.planned;
        let due = self
            .path_written
            .is_none_or(|written| now.since(written) >= BENT.1);
        if bent && (due || path.is_empty()) {
            self.path_written = Some(now);
            transaction.set(robot.id, "path", Value::F64List(path));
            if knows(BUBBLES) {
                let bubbles = self.navigator.bubbles().to_vec();
                transaction.set(robot.id, BUBBLES, Value::F64List(bubbles));
            }
            if knows(PLANNED_PATH) && planned != robot.planned {
                transaction.set(robot.id, PLANNED_PATH, Value::F64List(planned));
            }
        }
        Ok((!transaction.is_empty()).then_some(transaction))
    }

    /// Corrects the room that the graph has the robot in, where it is plainly in another and no
    /// step takes it there.
    fn localise(
        &mut self,
        world: &World,
        messages: &Messages,
        step: Option<&Step>,
        now: Time,
    ) -> Option<Transaction> {
        let place = Point2::from(messages.odometry?.world_from_robot.translation.vector);
        let explained = step
            .is_some_and(|step| matches!(step.rule.as_str(), "changeRoom" | "escort" | "follow"));
        let there = |room: &&read::Room| {
            room.polygon.len() >= 3 && Region::new(&room.polygon).depth(place) > INSIDE
        };
        let found = if explained {
            None
        } else {
            world.rooms.iter().find(there)
        };
        let Some(room) = found.filter(|room| Some(room.id) != world.robot.room) else {
            self.elsewhere = None;
            return None;
        };
        let since = match self.elsewhere {
            Some((known, since)) if known == room.id => since,
            _ => now,
        };
        self.elsewhere = Some((room.id, since));
        if now.since(since) < SETTLED {
            return None;
        }
        self.elsewhere = None;
        let mut transaction = Transaction::new();
        if let Some(old) = world.robot.room {
            transaction.delete_edge(world.robot.id, "in", old);
        }
        transaction.create_edge(world.robot.id, "in", room.id);
        Some(transaction)
    }
}

fn coordinates(line: &[Point2<f64>]) -> Vec<f64> {
    line.iter().flat_map(|point| [point.x, point.y]).collect()
}

fn inputs<'a>(messages: &Messages<'a>, world: &'a World, task: Option<&'a Task>) -> Inputs<'a> {
    let mut limits = world.robot.limits;
    limits.max_speed *= world.map.share();
    Inputs {
        odometry: messages.odometry,
        scan: messages.scan,
        grid: messages.grid,
        map: world.map,
        walls: &world.walls,
        people: &world.people,
        task,
        limits,
        social: world.social,
    }
}

/// Moves a step from one status to the next; a conflict where it is elsewhere already.
fn set_status(step: &Step, from: &str, to: &str) -> Transaction {
    let mut transaction = Transaction::new().require(Precondition::AttributeEquals {
        owner: Owner::Node(NodeRef::Id(step.id)),
        name: "status".to_owned(),
        value: Some(from.into()),
    });
    transaction.set(step.id, "status", to);
    transaction
}

fn failed(step: &Step, reason: &str) -> Transaction {
    let mut transaction = set_status(step, "running", "failed");
    transaction.set(step.id, "reason", reason);
    transaction
}

#[cfg(test)]
mod tests;
