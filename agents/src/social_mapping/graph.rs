//! Social mapping on the shared graph: what it reads there and what it writes. This file owns the
//! names of the nodes and attributes, and guarantees that a turn in which nothing moved noticeably
//! writes nothing.

use super::config::{ConfigError, SocialConfig};
use super::map::{ObjectUse, PersonSpaces, SocialMapper, Update};
use super::object_space::Outline;
use super::scene::{
    Activity, BODY_RADIUS, Object, Person, Rejection, SceneError, SocialScene, Wall,
};
use crate::grid::CostGrid;
use dsr::{Node, NodeId, Operation, Owner, Snapshot, Time, Transaction, Value};
use nalgebra::{Point2, Vector2};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The attributes that hold a person's polylines, from the closest zone outwards: each a list
/// x, y, x, y, ... in the world frame, closed, the first point not repeated.
/// (`social` alone is the world's switch, and an attribute has one kind in the whole graph.)
pub const ZONES: [&str; 3] = ["intimate_zone", "personal_zone", "social_zone"];
/// The attribute that holds the polyline of an object's space, like a person's.
pub const SPACE: &str = "space";
/// The attribute that holds R(t).
pub const USAGE: &str = "usage";

/// A polyline is written again when its person moved further than this, metres ...
const MOVED: f64 = 0.05;
/// ... or turned further than this, radians.
const TURNED: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// Why no scene could be read from the graph.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReadError {
    /// The snapshot cannot be read any more; take a new one.
    #[error(transparent)]
    Snapshot(#[from] dsr::ReadError),
    /// There is no node of a type that the map cannot be made without.
    #[error("the graph has no {type_name} yet")]
    Missing {
        /// The type.
        type_name: &'static str,
    },
    /// An attribute that the map cannot be made without is absent or malformed.
    #[error("the attribute {attribute} of {node} must be {expected}")]
    Attribute {
        /// The node's name.
        node: String,
        /// The attribute.
        attribute: &'static str,
        /// What it has to be.
        expected: &'static str,
    },
}

/// Why a turn made no map.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StepError {
    /// The graph does not tell enough.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The graph tells what cannot be.
    #[error(transparent)]
    Scene(#[from] SceneError),
}

/// A number that may be absent, but if it is there must be one: NaN otherwise, which the mapper
/// reports.
fn number(node: &Node<'_>, name: &str, absent: f64) -> Result<f64, dsr::ReadError> {
    let value = node.value(name)?;
    Ok(value.map_or(absent, |value| value.as_f64().unwrap_or(f64::NAN)))
}

/// Two numbers, like [`number`].
fn vector(node: &Node<'_>, name: &str, absent: f64) -> Result<Vector2<f64>, dsr::ReadError> {
    let value = node.value(name)?;
    Ok(match value.as_ref().map(Value::as_f64s) {
        None => Vector2::repeat(absent),
        Some(Some([x, y])) => Vector2::new(*x, *y),
        Some(_) => Vector2::repeat(f64::NAN),
    })
}

/// The social scene that the graph describes.
///
/// People and objects without a pose are nowhere and not in the scene. A person without `velocity`
/// stands, one without `radius` has [`BODY_RADIUS`]. The robot's radius is that of the largest robot.
/// A world without `social` is social. A circle's diameter is its larger `size`. An activity uses
/// the objects its `uses` edges lead to and the one its `object` names.
///
/// # Errors
/// [`ReadError`]: without a world with `bounds` and well-formed `walls`, and a robot with a `radius`,
/// there is no map.
pub fn scene(snapshot: &Snapshot) -> Result<SocialScene, ReadError> {
    let world = snapshot.nodes_of("world").next().transpose()?;
    let world = world.ok_or(ReadError::Missing { type_name: "world" })?;
    let mut scene = SocialScene {
        bounds: bounds(&world)?,
        walls: walls(&world)?,
        robot_radius: robot_radius(snapshot)?,
        social: world
            .value("social")?
            .and_then(|value| value.as_bool())
            .unwrap_or(true),
        ..SocialScene::default()
    };
    let mut names: BTreeMap<NodeId, String> = BTreeMap::new();
    for node in snapshot.nodes_of("person") {
        let node = node?;
        let Some(world_from_person) = snapshot.world_from(node.id())? else {
            continue;
        };
        names.insert(node.id(), node.name()?);
        scene.people.push(Person {
            name: node.name()?,
            world_from_person,
            velocity: vector(&node, "velocity", 0.0)?,
            radius: number(&node, "radius", BODY_RADIUS)?,
        });
    }
    for node in snapshot.nodes_of("object") {
        let node = node?;
        let Some(world_from_object) = snapshot.world_from(node.id())? else {
            continue;
        };
        let size = vector(&node, "size", f64::NAN)?;
        let shape = node.value("shape")?;
        let round = shape.as_ref().and_then(Value::as_str) == Some("circle");
        scene.objects.push(Object {
            name: node.name()?,
            class: node.type_name().to_owned(),
            world_from_object,
            outline: if round {
                Outline::Circle(size.max() / 2.0)
            } else {
                Outline::Rectangle(size)
            },
        });
    }
    if let Some(label) = snapshot.schema().find_label("interacting") {
        for edge in snapshot.edges_of_label(label) {
            let edge = edge?;
            if let (Some(one), Some(other)) = (names.get(&edge.from), names.get(&edge.to)) {
                scene.interactions.push((one.clone(), other.clone()));
            }
        }
    }
    read_activities(snapshot, &mut scene)?;
    Ok(scene)
}

fn attribute_error(node: &Node<'_>, attribute: &'static str, expected: &'static str) -> ReadError {
    match node.name() {
        Ok(node) => ReadError::Attribute {
            node,
            attribute,
            expected,
        },
        Err(error) => error.into(),
    }
}

fn bounds(world: &Node<'_>) -> Result<[f64; 4], ReadError> {
    let value = world.value("bounds")?;
    let row = value
        .as_ref()
        .and_then(Value::as_f64s)
        .and_then(|row| row.try_into().ok());
    row.ok_or_else(|| attribute_error(world, "bounds", "four numbers: xmin, ymin, xmax, ymax"))
}

fn walls(world: &Node<'_>) -> Result<Vec<Wall>, ReadError> {
    let Some(value) = world.value("walls")? else {
        return Ok(Vec::new());
    };
    match value.as_f64s().map(<[f64]>::as_chunks::<4>) {
        Some((walls, [])) => {
            let wall = |&[ax, ay, bx, by]: &[f64; 4]| [Point2::new(ax, ay), Point2::new(bx, by)];
            Ok(walls.iter().map(wall).collect())
        }
        _ => Err(attribute_error(
            world,
            "walls",
            "numbers x1, y1, x2, y2 for each wall",
        )),
    }
}

fn robot_radius(snapshot: &Snapshot) -> Result<f64, ReadError> {
    let mut largest: Option<f64> = None;
    for robot in snapshot.nodes_of("robot") {
        let robot = robot?;
        let radius = robot.value("radius")?.and_then(|value| value.as_f64());
        let radius = radius.ok_or_else(|| attribute_error(&robot, "radius", "a number"))?;
        // Not `f64::max`, which would hide a NaN from the mapper's check.
        largest = Some(largest.map_or(radius, |known| if radius < known { known } else { radius }));
    }
    largest.ok_or(ReadError::Missing { type_name: "robot" })
}

fn read_activities(snapshot: &Snapshot, scene: &mut SocialScene) -> Result<(), ReadError> {
    let uses = snapshot.schema().find_label("uses");
    for node in snapshot.nodes_of("activity") {
        let node = node?;
        let (start, end) = (
            number(&node, "start", f64::NAN)?,
            number(&node, "end", f64::NAN)?,
        );
        if !(start.is_finite() && end.is_finite()) {
            scene.rejected.push(Rejection::ActivityTime {
                activity: node.name()?,
            });
            continue;
        }
        let mut objects = Vec::new();
        if let Some(Value::String(name)) = node.value("object")? {
            objects.push(name);
        }
        for edge in uses.into_iter().flat_map(|label| node.out_edges_of(label)) {
            if let Some(object) = snapshot.find_node(edge?.to)? {
                objects.push(object.name()?);
            }
        }
        objects.sort_unstable();
        objects.dedup();
        let (start, end) = (Time::from_seconds(start), Time::from_seconds(end));
        let activities = objects
            .into_iter()
            .map(|object| Activity { object, start, end });
        scene.activities.extend(activities);
    }
    Ok(())
}

/// What to write so that the graph shows `update`: a person's three polylines where the person
/// moved by more than 5 cm or 5 degrees since they were written, an object's space where a point of
/// it moved by more than 5 cm, R(t) to the hundredth. Polylines of whom the map does not have are
/// removed.
///
/// # Errors
/// [`dsr::ReadError`].
pub fn transaction(update: &Update, snapshot: &Snapshot) -> Result<Transaction, dsr::ReadError> {
    let mut transaction = Transaction::new();
    let people: BTreeMap<&str, &PersonSpaces> = update
        .people
        .iter()
        .map(|person| (person.name.as_str(), person))
        .collect();
    for node in snapshot.nodes_of("person") {
        let node = node?;
        match people.get(node.name()?.as_str()) {
            Some(person) => write_zones(&mut transaction, &node, person)?,
            None => remove(&mut transaction, &node, &ZONES)?,
        }
    }
    let objects: BTreeMap<&str, &ObjectUse> = update
        .objects
        .iter()
        .map(|object| (object.name.as_str(), object))
        .collect();
    for node in snapshot.nodes_of("object") {
        let node = node?;
        match objects.get(node.name()?.as_str()) {
            Some(object) => write_use(&mut transaction, &node, object)?,
            None => remove(&mut transaction, &node, &[SPACE, USAGE])?,
        }
    }
    Ok(transaction)
}

fn write_zones(
    transaction: &mut Transaction,
    node: &Node<'_>,
    person: &PersonSpaces,
) -> Result<(), dsr::ReadError> {
    let rings = [&person.intimate, &person.personal, &person.social];
    let mut stale = false;
    for (name, ring) in ZONES.iter().zip(rings) {
        stale = stale || !polyline(node, name)?.is_some_and(|old| is_same_zone(&old, ring));
    }
    if stale {
        for (name, ring) in ZONES.iter().zip(rings) {
            transaction.set(node.id(), name, flat(ring));
        }
    }
    Ok(())
}

fn write_use(
    transaction: &mut Transaction,
    node: &Node<'_>,
    object: &ObjectUse,
) -> Result<(), dsr::ReadError> {
    if !polyline(node, SPACE)?.is_some_and(|old| is_near(&old, &object.space)) {
        transaction.set(node.id(), SPACE, flat(&object.space));
    }
    let usage = Value::F64(object.rounded_usage());
    if node.value(USAGE)?.as_ref() != Some(&usage) {
        transaction.set(node.id(), USAGE, usage);
    }
    Ok(())
}

fn remove(
    transaction: &mut Transaction,
    node: &Node<'_>,
    names: &[&str],
) -> Result<(), dsr::ReadError> {
    for name in names {
        if node.value(name)?.is_some() {
            transaction.push(Operation::RemoveAttribute {
                owner: Owner::Node(node.id().into()),
                name: (*name).to_owned(),
            });
        }
    }
    Ok(())
}

fn polyline(node: &Node<'_>, name: &str) -> Result<Option<Vec<Point2<f64>>>, dsr::ReadError> {
    let value = node.value(name)?;
    Ok(value.as_ref().and_then(Value::as_f64s).map(|row| {
        let (points, _) = row.as_chunks::<2>();
        points.iter().map(|[x, y]| Point2::new(*x, *y)).collect()
    }))
}

fn flat(polyline: &[Point2<f64>]) -> Value {
    Value::F64List(
        polyline
            .iter()
            .flat_map(|point| [point.x, point.y])
            .collect(),
    )
}

/// Whether two outlines of a zone are of the same shape at about the same pose. A contour starts at
/// the person's right and has the left half way round, so it tells its person's pose.
fn is_same_zone(old: &[Point2<f64>], new: &[Point2<f64>]) -> bool {
    let sides = |ring: &[Point2<f64>]| Some((*ring.first()?, *ring.get(ring.len() / 2)?));
    let (Some((old_right, old_left)), Some((right, left))) = (sides(old), sides(new)) else {
        return old.is_empty() && new.is_empty();
    };
    let (was, is) = (old_left - old_right, left - right);
    let moved = (left + right.coords).coords / 2.0 - (old_left + old_right.coords).coords / 2.0;
    old.len() == new.len()
        && moved.norm() <= MOVED
        && was.perp(&is).atan2(was.dot(&is)).abs() <= TURNED
        && (was.norm() - is.norm()).abs() <= MOVED
}

fn is_near(old: &[Point2<f64>], new: &[Point2<f64>]) -> bool {
    old.len() == new.len() && old.iter().zip(new).all(|(a, b)| (a - b).norm() <= MOVED)
}

/// What a turn brought.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Turn {
    /// The grid, where it changed.
    pub grid: Option<Arc<CostGrid>>,
    /// What to write into the graph; often nothing.
    pub transaction: Transaction,
    /// What was left out or mended, where that differs from the turn before.
    pub rejected: Vec<Rejection>,
}

/// The agent's turns: reads the graph, updates the map, says what to write and send.
#[derive(Debug, Clone)]
pub struct SocialMapping {
    mapper: SocialMapper,
    period: f64,
    updated: Option<Time>,
    unsent: bool,
    rejected: Vec<Rejection>,
}

impl SocialMapping {
    /// An agent that updates its map at most once a `period`, seconds; 0 for each turn.
    ///
    /// # Errors
    /// All problems of the figures.
    pub fn new(config: SocialConfig, period: f64) -> Result<Self, Vec<ConfigError>> {
        let mapper = SocialMapper::new(config)?;
        Ok(Self {
            mapper,
            period,
            updated: None,
            unsent: false,
            rejected: Vec::new(),
        })
    }

    /// One turn at `now` on the graph as of `snapshot`.
    ///
    /// # Errors
    /// [`StepError`]; the next turn starts where the last good one ended.
    pub fn step(&mut self, now: Time, snapshot: &Snapshot) -> Result<Turn, StepError> {
        if !is_due(self.updated, now, self.period) {
            return Ok(Turn::default());
        }
        let update = self.mapper.update(now, &scene(snapshot)?)?;
        // Reading may fail yet, and the next update would not call the change a change.
        self.unsent |= update.changed;
        let transaction = transaction(&update, snapshot).map_err(ReadError::from)?;
        self.updated = Some(now);
        let send = std::mem::take(&mut self.unsent);
        let rejected = if update.rejected == self.rejected {
            Vec::new()
        } else {
            self.rejected.clone_from(&update.rejected);
            update.rejected
        };
        Ok(Turn {
            grid: send.then_some(update.grid),
            transaction,
            rejected,
        })
    }
}

/// Whether `period` has passed. A time before the last is another epoch, in which all is due.
fn is_due(last: Option<Time>, now: Time, period: f64) -> bool {
    last.is_none_or(|last| now < last || now.since(last) >= period - 1e-6)
}

#[cfg(test)]
mod tests;
