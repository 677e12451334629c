//! The human observer on the graph. People are nodes `person_<id>`; everything written is the
//! difference to the snapshot, and edges that others own are left alone.
//!
//! Written: `pose` from the world (moved by 1 cm or 1 degree), `velocity` (0.05 m/s),
//! `position_covariance` (a quarter), `confidence` (0.05), `last_seen` (every 0.5 s), and the edges
//! `in`, `is_near` (robot to person) and `interacting` (between people in both directions, since
//! each faces the other). `front` is made by a rule, when the robot has taken somebody's attention;
//! the observer only deletes it, when the person has been turned away or gone for two seconds.

use super::{Config, Object, Observer, Scene, Shape, Surroundings, TrackedPerson};
use crate::messages::CameraFrame;
use crate::perception::graph::{
    Difference, LAST_SEEN_PERIOD, first_of_type, floor_plan, number, numbers, points, targets,
};
use dsr::{Node, ReadError, Snapshot, Time, Transaction, Value};
use nalgebra::Vector2;
use std::collections::{BTreeMap, BTreeSet};

/// Velocities are written when a component changed by more than this, m/s.
const VELOCITY_STEP: f64 = 0.05;
/// Confidences are written when they changed by more than this.
const CONFIDENCE_STEP: f64 = 0.05;
/// Covariances are written when they changed by more than this share.
const COVARIANCE_STEP: f64 = 0.25;

type PersonNodes<'a> = (BTreeMap<u64, Node<'a>>, BTreeSet<String>);

/// The world's attribute that holds the observer's figures, as JSON: those of [`Config`] that differ
/// from the default.
pub const SETTINGS: &str = "observer_settings";

/// The human observer as an agent: frames and a snapshot in, a transaction out.
#[derive(Debug)]
pub struct HumanObserver {
    observer: Observer,
    front_end: f64,
    body_radius: f64,
    scene: Scene,
    adopted: bool,
    /// Since when the graph says that somebody is in front of the robot.
    fronts: BTreeMap<u64, Time>,
}

/// The figures that the world's node has; none where it has none, or some that cannot be read.
fn settings(snapshot: &Snapshot) -> Result<Option<Config>, ReadError> {
    let Some(world) = first_of_type(snapshot, "world")? else {
        return Ok(None);
    };
    let value = world.value(SETTINGS)?;
    let Some(text) = value.as_ref().and_then(Value::as_str) else {
        return Ok(None);
    };
    let read = serde_json::from_str::<Config>(text).map_err(|error| error.to_string());
    let usable = read.and_then(|config| match config.problem() {
        None => Ok(config),
        Some(problem) => Err(problem.to_owned()),
    });
    Ok(usable
        .inspect_err(|problem| tracing::warn!("the world's {SETTINGS} are left out: {problem}"))
        .ok())
}

/// Rooms, walls, the robot and the objects of the graph. Objects that are nowhere are left out.
///
/// # Errors
/// [`ReadError`].
pub fn surroundings(snapshot: &Snapshot) -> Result<Surroundings, ReadError> {
    let world_from_robot = match first_of_type(snapshot, "robot")? {
        Some(robot) => snapshot.world_from(robot.id())?,
        None => None,
    };
    let mut objects = Vec::new();
    for node in snapshot.nodes_of("object") {
        let node = node?;
        if let Some(world_from_object) = snapshot.world_from(node.id())? {
            objects.push(object(&node, world_from_object)?);
        }
    }
    objects.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(Surroundings {
        plan: floor_plan(snapshot)?,
        world_from_robot,
        objects,
    })
}

fn object(node: &Node, world_from_object: nalgebra::Isometry2<f64>) -> Result<Object, ReadError> {
    let round = node.value("shape")?.as_ref().and_then(Value::as_str) == Some("circle");
    let size = numbers(node, "size")?;
    Ok(Object {
        name: node.name()?,
        class: node.type_name().to_owned(),
        world_from_object,
        shape: if round {
            Shape::Circle
        } else {
            Shape::Rectangle
        },
        size: match size[..] {
            [x, y, ..] => Vector2::new(x, y),
            _ => Vector2::zeros(),
        },
        space: points(node, "space")?,
    })
}

/// The name of the node of the person with `id`.
pub fn person_name(id: u64) -> String {
    format!("person_{id}")
}

/// The id of the person whose node has that name, if the observer made it.
pub fn person_id(name: &str) -> Option<u64> {
    let id = name.strip_prefix("person_")?.parse().ok()?;
    (person_name(id) == name).then_some(id)
}

/// The people the graph knows, as far as the observer made them, in order of id.
///
/// # Errors
/// [`ReadError`].
pub fn people(snapshot: &Snapshot) -> Result<Vec<TrackedPerson>, ReadError> {
    let mut people = Vec::new();
    for (id, node) in person_nodes(snapshot)?.0 {
        let Some(pose) = snapshot.world_from(node.id())? else {
            continue;
        };
        let velocity = numbers(&node, "velocity")?;
        let covariance = numbers(&node, "position_covariance")?;
        people.push(TrackedPerson {
            id,
            pose,
            velocity: match velocity[..] {
                [x, y] => Vector2::new(x, y),
                _ => Vector2::zeros(),
            },
            covariance: <[f64; 3]>::try_from(covariance).unwrap_or_default(),
            confidence: number(&node, "confidence")?.unwrap_or(0.5),
            last_seen: number(&node, "last_seen")?
                .map_or_else(|| snapshot.time(), Time::from_seconds),
        });
    }
    Ok(people)
}

/// The nodes of people: those that the observer made by id, and the names of all others, which it
/// leaves alone.
fn person_nodes(snapshot: &Snapshot) -> Result<PersonNodes<'_>, ReadError> {
    let (mut own, mut foreign) = (BTreeMap::new(), BTreeSet::new());
    for node in snapshot.nodes_of("person") {
        let node = node?;
        let name = node.name()?;
        match person_id(&name) {
            Some(id) => {
                own.insert(id, node);
            }
            None => {
                foreign.insert(name);
            }
        }
    }
    Ok((own, foreign))
}

impl HumanObserver {
    /// An observer that knows nobody yet.
    pub fn new(config: Config) -> Self {
        Self {
            front_end: config.relations.front_end,
            body_radius: config.tracking.body_radius,
            observer: Observer::new(config),
            scene: Scene::default(),
            adopted: false,
            fronts: BTreeMap::new(),
        }
    }

    /// The people and relations of the last step.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The tracker, for what it counts.
    pub fn observer(&self) -> &Observer {
        &self.observer
    }

    /// Takes in `frames` and says what has to change in the graph at `now`.
    ///
    /// The first step takes up the figures that the world's node has (in place of those given), and
    /// adopts the people whom the graph has already, so that a restarted observer
    /// goes on where it was. Without a `world` node nothing is written, because nothing can be
    /// placed. A refused transaction needs no care: the next step makes it again.
    ///
    /// # Errors
    /// [`ReadError`], where the snapshot was overtaken; the frames are then lost to the graph
    /// until the next step, not to the tracker, except in the first step.
    pub fn step(
        &mut self,
        now: Time,
        frames: &[CameraFrame],
        snapshot: &Snapshot,
    ) -> Result<Transaction, ReadError> {
        let surroundings = surroundings(snapshot)?;
        if !self.adopted {
            if let Some(config) = settings(snapshot)? {
                *self = Self::new(config);
            }
            for person in people(snapshot)? {
                self.observer.adopt(&person);
            }
            self.adopted = true;
        }
        self.scene = self.observer.observe(now, frames, &surroundings);
        self.transaction(now, snapshot)
    }

    fn transaction(&mut self, now: Time, snapshot: &Snapshot) -> Result<Transaction, ReadError> {
        let Some(mut difference) = Difference::new(snapshot)? else {
            return Ok(Transaction::new());
        };
        let (nodes, foreign) = person_nodes(snapshot)?;
        for person in &self.scene.people {
            match nodes.get(&person.id) {
                Some(node) => update(&mut difference, node, person)?,
                None => self.create(&mut difference, person),
            }
        }
        for person in &self.scene.people {
            self.relate(&mut difference, person, nodes.get(&person.id), &foreign)?;
        }
        if let Some(robot) = first_of_type(snapshot, "robot")? {
            let near = self
                .scene
                .near_robot
                .iter()
                .map(|&id| person_name(id))
                .collect();
            difference.edges(&robot.name()?, Some(&robot), "is_near", &near, &foreign)?;
        }
        self.end_fronts(&mut difference, now, snapshot, &nodes)?;
        // Last, because with a node go its edges.
        for (id, node) in &nodes {
            if self.scene.find(*id).is_none() {
                difference.transaction.delete_node(node.id());
            }
        }
        Ok(difference.transaction)
    }

    fn create(&self, difference: &mut Difference, person: &TrackedPerson) {
        let attributes = vec![
            (
                "velocity".to_owned(),
                <[f64; 2]>::from(person.velocity).into(),
            ),
            ("radius".to_owned(), self.body_radius.into()),
            ("confidence".to_owned(), person.confidence.into()),
            ("last_seen".to_owned(), person.last_seen.seconds().into()),
            ("position_covariance".to_owned(), person.covariance.into()),
        ];
        difference.create("person", &person_name(person.id), person.pose, attributes);
    }

    /// The edges `in` and `interacting` of one person.
    fn relate(
        &self,
        difference: &mut Difference,
        person: &TrackedPerson,
        node: Option<&Node>,
        foreign: &BTreeSet<String>,
    ) -> Result<(), ReadError> {
        let name = person_name(person.id);
        let rooms: BTreeSet<String> = self
            .scene
            .in_room
            .get(&person.id)
            .cloned()
            .into_iter()
            .collect();
        difference.edges(&name, node, "in", &rooms, &BTreeSet::new())?;
        let others = self
            .scene
            .interacting
            .iter()
            .filter_map(|&(a, b)| match person.id {
                id if id == a => Some(person_name(b)),
                id if id == b => Some(person_name(a)),
                _ => None,
            });
        let objects = self
            .scene
            .interacting_with
            .iter()
            .filter(|(id, _)| *id == person.id);
        let partners: BTreeSet<String> = others
            .chain(objects.map(|(_, object)| object.clone()))
            .collect();
        difference.edges(&name, node, "interacting", &partners, foreign)
    }

    /// Deletes the `front` edges of people who are no longer in front of the robot. An edge is given
    /// two seconds from when it is first seen: a rule may make it before the person turns round.
    fn end_fronts(
        &mut self,
        difference: &mut Difference,
        now: Time,
        snapshot: &Snapshot,
        nodes: &BTreeMap<u64, Node>,
    ) -> Result<(), ReadError> {
        let mut fronts = BTreeMap::new();
        for (&id, node) in nodes {
            let robots = targets(snapshot, node, "front")?;
            if robots.is_empty() || self.scene.find(id).is_none() {
                continue;
            }
            let since = self.fronts.get(&id).copied().unwrap_or(now);
            fronts.insert(id, since);
            let holds = self.scene.front.binary_search(&id).is_ok();
            if !holds && now.since(since) > self.front_end {
                for robot in robots {
                    difference
                        .transaction
                        .delete_edge(node.id(), "front", robot);
                }
            }
        }
        self.fronts = fronts;
        Ok(())
    }
}

fn update(
    difference: &mut Difference,
    node: &Node,
    person: &TrackedPerson,
) -> Result<(), ReadError> {
    difference.place(node, person.pose)?;
    difference.vector(node, "velocity", person.velocity.into(), VELOCITY_STEP)?;
    let scale = person.covariance[0].max(person.covariance[2]);
    difference.vector(
        node,
        "position_covariance",
        person.covariance,
        COVARIANCE_STEP * scale,
    )?;
    difference.number(node, "confidence", person.confidence, CONFIDENCE_STEP)?;
    difference.number(
        node,
        "last_seen",
        person.last_seen.seconds(),
        LAST_SEEN_PERIOD,
    )
}
