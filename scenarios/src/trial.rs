//! One drive of the robot through a scenario to its targets: the world, social mapping and navigation in one
//! process, without a graph. What experiments repeat many times over. This file guarantees that a trial is
//! a function of its scenario and seed, to the bit.
//!
//! People and objects are known as they are, so that a trial shows what planning and control do (TD
//! section 6.1); the laser and the localisation have the scenario's noise.

mod plain;
mod social_force;

pub use plain::Method;

use crate::metrics::mapped;
use crate::scenario::{Scenario, Wall};
use crate::tracks::Tracks;
use crate::world::{Inputs as WorldInputs, Truth, World};
use agents::navigation::map_age::MapState;
use agents::navigation::navigator::{Config, Inputs, Navigator, Output, Status};
use agents::navigation::people::Person;
use agents::navigation::target::{Company, Target, Task};
use agents::social_mapping::scene::{Activity, Manner, Person as MappedPerson, SceneError};
use agents::social_mapping::{ConfigError, SocialMapper, SocialScene};
use dsr::Time;
use nalgebra::Isometry2;
use plain::Plain;

/// From one turn of everything to the next, s.
const STEP: f64 = 0.1;
/// Social mapping takes a turn every so many steps.
const MAPPING: usize = 5;

/// A trial to make.
#[derive(Debug, Clone)]
pub struct Trial<'a> {
    /// Where and among whom.
    pub scenario: &'a Scenario,
    /// What its noise grows from.
    pub seed: u64,
    /// Recorded pedestrians who take the place of the scenario's.
    pub tracks: Option<&'a Tracks>,
    /// Walls that the map does not show; only the laser sees them.
    pub unmapped: &'a [Wall],
    /// How the robot finds its way.
    pub method: Method,
    /// Whether people and objects are more than obstacles; only to our navigation.
    pub social: bool,
    /// What the robot is to get to, one after the other.
    pub targets: Vec<Target>,
    /// The figures of navigation.
    pub navigation: Config,
    /// From this second on the robot knows the scenario's agenda; before, it knows none.
    pub agenda_from: f64,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// What was true, step by step.
    pub samples: Vec<Truth>,
    /// Whether the robot got to all targets within the scenario's duration.
    pub arrived: bool,
    /// After how many samples it got to each target.
    pub legs: Vec<usize>,
    /// How many paths it took up.
    pub plans: u64,
}

/// Why a trial cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrialError {
    /// The figures of social mapping are unusable.
    #[error("{}", .problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
    Config {
        /// All that is wrong with them.
        problems: Vec<ConfigError>,
    },
    /// The scenario makes no map.
    #[error(transparent)]
    Scene(#[from] SceneError),
}

/// Whatever drives the robot.
enum Driver {
    Navigation(Box<Navigator>),
    Plain(Box<Plain>),
}

impl Driver {
    fn new(method: Method, config: Config) -> Self {
        match method {
            Method::Navigation => Self::Navigation(Box::new(Navigator::new(config))),
            Method::AStar => Self::Plain(Box::new(Plain::new(false, config))),
            Method::SocialForce => Self::Plain(Box::new(Plain::new(true, config))),
        }
    }

    fn step(&mut self, now: Time, inputs: &Inputs) -> Output {
        match self {
            Self::Navigation(navigator) => navigator.step(now, inputs),
            Self::Plain(plain) => plain.step(now, inputs),
        }
    }

    fn plans(&self) -> u64 {
        match self {
            Self::Navigation(navigator) => navigator.plans(),
            Self::Plain(plain) => plain.plans(),
        }
    }
}

impl Trial<'_> {
    /// Drives until the robot is there or the scenario's time is up.
    ///
    /// # Errors
    /// [`TrialError`] where there is no social map of the scenario.
    pub fn drive(&self) -> Result<Drive, TrialError> {
        let scenario = self.scenario;
        let mut walled = scenario.clone();
        walled.walls.extend(self.unmapped);
        let mut world = World::new(&walled, self.seed, self.tracks.cloned());
        let mut mapper = SocialMapper::new(scenario.social.clone())
            .map_err(|problems| TrialError::Config { problems })?;
        let mut scene = self.scene();
        let mut driver = Driver::new(self.method, self.navigation);
        let robot = &scenario.robot;
        let limits = robot.limits();
        let mut samples = vec![world.truth()];
        let (mut scan, mut odometry, mut grid) = (None, None, None);
        let mut command = None;
        let mut legs = Vec::new();
        for step in 0..(scenario.duration / STEP) as usize {
            let outputs = world.step(
                STEP,
                &WorldInputs {
                    velocity: command,
                    speech: Vec::new(),
                },
            );
            scan = outputs.scan.or(scan);
            odometry = outputs.odometry.or(odometry);
            let truth = outputs.truth;
            let Some(target) = self.targets.get(legs.len()) else {
                break;
            };
            let task = Task {
                id: format!("leg {}", legs.len()),
                target: target.clone(),
            };
            if step % MAPPING == 0 {
                if step as f64 * STEP >= self.agenda_from && scene.activities.is_empty() {
                    scene.activities = self.agenda();
                }
                // The social forces are all that there is of people in that model.
                let people = truth.people.iter();
                let people = people.filter(|_| self.method != Method::SocialForce);
                scene.people = people.map(|body| mapped_person(body, target)).collect();
                grid = Some(mapper.update(truth.time, &scene)?.grid);
            }
            let people: Vec<Person> = truth.people.iter().map(known_person).collect();
            let now = truth.time;
            samples.push(truth);
            let output = driver.step(
                now,
                &Inputs {
                    odometry: odometry.as_ref(),
                    scan: scan.as_ref(),
                    grid: grid.as_deref(),
                    map: MapState::Current,
                    walls: &scenario.walls,
                    people: &people,
                    task: Some(&task),
                    limits,
                    social: self.is_social(),
                },
            );
            command = Some(output.command);
            match output.status {
                Status::Arrived => legs.push(samples.len()),
                Status::Failed(_) => break,
                _ => {}
            }
        }
        Ok(Drive {
            samples,
            arrived: legs.len() == self.targets.len(),
            legs,
            plans: driver.plans(),
        })
    }

    fn is_social(&self) -> bool {
        self.social && self.method == Method::Navigation
    }

    fn agenda(&self) -> Vec<Activity> {
        let activities = self.scenario.activities.iter().map(|activity| Activity {
            name: activity.name.clone(),
            object: activity.object.clone(),
            start: activity.start,
            end: activity.end,
        });
        activities.collect()
    }

    /// All that does not move.
    fn scene(&self) -> SocialScene {
        SocialScene {
            bounds: self.scenario.bounds,
            walls: self.scenario.walls.clone(),
            robot_radius: self.scenario.robot.radius,
            social: self.is_social(),
            objects: self.scenario.objects.iter().map(mapped).collect(),
            ..SocialScene::default()
        }
    }
}

/// Somebody as social mapping knows them; who is approached or escorted wants the robot nearer.
fn mapped_person(body: &crate::world::Body, target: &Target) -> MappedPerson {
    let task = match target {
        Target::Person { .. } => Some("approach"),
        Target::Company {
            place: Company::Beside,
            ..
        } => Some("escort"),
        Target::Company { .. } => Some("follow"),
        _ => None,
    };
    let meant = target.person() == Some(&body.name);
    MappedPerson {
        name: body.name.clone(),
        world_from_person: Isometry2::new(body.position.coords, body.heading),
        velocity: body.velocity,
        radius: body.radius,
        manner: Manner {
            task: task.filter(|_| meant).map(str::to_owned),
            ..Manner::default()
        },
    }
}

fn known_person(body: &crate::world::Body) -> Person {
    Person {
        name: body.name.clone(),
        world_from_person: Isometry2::new(body.position.coords, body.heading),
        velocity: body.velocity,
        radius: body.radius,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point2, Vector2};

    /// A drive of ours to a point, with social behaviour.
    fn to(scenario: &Scenario, x: f64, y: f64) -> Trial<'_> {
        Trial {
            scenario,
            seed: 1,
            tracks: None,
            unmapped: &[],
            method: Method::Navigation,
            social: true,
            targets: vec![Target::Point(Point2::new(x, y))],
            navigation: Config::default(),
            agenda_from: 0.0,
        }
    }

    #[test]
    fn a_trial_gets_there_and_is_the_same_to_the_bit() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("care-centre");
        let mut scenario = Scenario::load(&folder).unwrap();
        scenario.duration = 40.0;
        let trial = Trial {
            seed: 3,
            ..to(&scenario, 4.0, 6.0)
        };
        let drive = trial.drive().unwrap();
        assert!(drive.arrived);
        let last = drive.samples.last().unwrap().world_from_robot;
        assert!((last.translation.vector - Vector2::new(4.0, 6.0)).norm() < 0.3);
        assert_eq!(trial.drive().unwrap(), drive);
    }

    #[test]
    fn an_omnidirectional_robot_gets_there_among_people_and_goes_sideways() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("corridor");
        let mut scenario = Scenario::load(&folder).unwrap();
        scenario.robot.base = crate::scenario::Base::Omnidirectional;
        let trial = to(&scenario, 13.2, 1.5);
        let drive = trial.drive().unwrap();
        assert!(drive.arrived);
        let samples = &drive.samples;
        assert!(samples.iter().any(|sample| sample.lateral.abs() > 0.05));
        let top = scenario.robot.max_speed + 1e-9;
        assert!(samples.iter().all(|s| s.velocity.x.hypot(s.lateral) <= top));
        assert_eq!(samples.last().unwrap().collisions.total(), 0);
    }

    #[test]
    fn the_other_methods_get_there_too_and_touch_nothing() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("corridor");
        let scenario = Scenario::load(&folder).unwrap();
        for method in [Method::AStar, Method::SocialForce] {
            let trial = Trial {
                method,
                social: false,
                ..to(&scenario, 13.2, 1.5)
            };
            let drive = trial.drive().unwrap();
            assert!(drive.arrived, "{method:?}");
            let last = drive.samples.last().unwrap();
            assert_eq!(last.collisions.total(), 0, "{method:?}");
        }
    }

    #[test]
    fn recorded_pedestrians_take_the_place_of_the_scenarios() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("plaza");
        let mut scenario = Scenario::load(&folder).unwrap();
        scenario.duration = 5.0;
        let line = |k: u32| format!("{} 7 {} 2.0\n", k * 10, 0.2 * f64::from(k));
        let text = (0..40).map(line).collect::<Vec<_>>().concat();
        let tracks = Tracks::parse("recorded", &text).unwrap();
        let trial = Trial {
            tracks: Some(&tracks),
            method: Method::AStar,
            social: false,
            ..to(&scenario, 13.0, 8.0)
        };
        let drive = trial.drive().unwrap();
        let all = drive.samples.iter().flat_map(|sample| &sample.people);
        let names: std::collections::BTreeSet<&str> = all.map(|body| body.name.as_str()).collect();
        assert_eq!(names.into_iter().collect::<Vec<_>>(), ["person_7"]);
    }
}
