//! Object recognition on the graph. Objects are nodes of their name; everything written is the
//! difference to the snapshot.
//!
//! Written: `pose` (moved by 1 cm or 1 degree), `size` (1 cm), `confidence` (0.05), `last_seen`
//! (every 0.5 s), `in`, `places` with `places_at` (another order, 0.02, 5 cm or 10 s), and `stay` (1 s); the type
//! and `shape` only of nodes made here. Only nodes made here, of objects without identity, are ever deleted:
//! others belong to whoever described the world.

use super::{Config, Place, RecognizedObject, Recognizer};
use crate::messages::CameraFrame;
use crate::perception::graph::{
    Difference, LAST_SEEN_PERIOD, floor_plan, number, numbers, targets,
};
use dsr::{Node, ReadError, Schema, Snapshot, Time, Transaction, Value};
use nalgebra::{Isometry2, Vector2};
use std::collections::{BTreeMap, BTreeSet};

/// Sizes are written when they changed by more than this, m.
const SIZE_STEP: f64 = 0.01;
/// Confidences are written when they changed by more than this.
const CONFIDENCE_STEP: f64 = 0.05;

/// A place's probability, its position (m) and heading (rad), and when it was last seen there (s) are
/// written when one of them changed by more than this.
const PLACE_STEP: [f64; FIGURES] = [0.05, 0.05, 0.1, 0.02, 0.5, 10.0];
/// How long it stays is written when it changed by more than this, s.
const STAY_STEP: f64 = 1.0;
/// What stands for a place: x, y, heading, probability, visits, `last_seen`.
const FIGURES: usize = 6;

/// Object recognition as an agent: frames and a snapshot in, a transaction out.
#[derive(Debug)]
pub struct ObjectRecognition {
    recognizer: Recognizer,
    objects: Vec<RecognizedObject>,
    adopted: bool,
    /// Names of nodes made for objects without identity, until they are gone from the graph.
    made: BTreeSet<String>,
}

/// The objects that a recogniser has put into or found in the graph (they have `last_seen`), in
/// order of name.
///
/// # Errors
/// [`ReadError`].
pub fn objects(snapshot: &Snapshot) -> Result<Vec<RecognizedObject>, ReadError> {
    let mut objects = Vec::new();
    for (name, node) in object_nodes(snapshot)? {
        let (Some(pose), Some(last_seen)) =
            (snapshot.world_from(node.id())?, number(&node, "last_seen")?)
        else {
            continue;
        };
        let size = numbers(&node, "size")?;
        let class = node.type_name().to_owned();
        objects.push(RecognizedObject {
            identified: !(made_here(snapshot, &node)? && is_numbered(&name)),
            in_room: targets(snapshot, &node, "in")?.into_iter().next(),
            name,
            class,
            pose,
            size: match size[..] {
                [x, y] => Vector2::new(x, y),
                _ => Vector2::zeros(),
            },
            confidence: number(&node, "confidence")?.unwrap_or(0.5),
            last_seen: Time::from_seconds(last_seen),
            places: places(&node)?,
            remembered: Time::from_seconds(number(&node, "places_at")?.unwrap_or(last_seen)),
            stay: number(&node, "stay")?,
        });
    }
    Ok(objects)
}

/// Where the node says that its object may be, the likeliest place first.
pub(super) fn places(node: &Node) -> Result<Vec<Place>, ReadError> {
    let figures = numbers(node, "places")?;
    let places = figures.chunks_exact(FIGURES).map(|place| Place {
        pose: Isometry2::new(Vector2::new(place[0], place[1]), place[2]),
        probability: place[3],
        visits: place[4].clamp(0.0, f64::from(u32::MAX)) as u32,
        last_seen: Time::from_seconds(place[5]),
    });
    Ok(places.collect())
}

/// The same as `places` has it.
fn listed(places: &[Place]) -> Vec<f64> {
    let figures = places.iter().flat_map(|place| {
        let at = place.pose.translation.vector;
        let heading = place.pose.rotation.angle();
        let seen = place.last_seen.seconds();
        [
            at.x,
            at.y,
            heading,
            place.probability,
            f64::from(place.visits),
            seen,
        ]
    });
    figures.collect()
}

pub(super) fn object_nodes(snapshot: &Snapshot) -> Result<BTreeMap<String, Node<'_>>, ReadError> {
    snapshot
        .nodes_of("object")
        .map(|node| {
            let node = node?;
            Ok((node.name()?, node))
        })
        .collect()
}

/// Whether the node was made by a recogniser: `shape` is written only with the node, so whoever
/// wrote it made the node, and only a recogniser writes `last_seen`.
fn made_here(snapshot: &Snapshot, node: &Node) -> Result<bool, ReadError> {
    let writer = |name| {
        let attribute = snapshot
            .schema()
            .find_attribute(name)
            .map(|id| node.attribute(id));
        Ok(attribute
            .transpose()?
            .flatten()
            .map(|attribute| attribute.writer))
    };
    let maker = writer("shape")?;
    Ok(maker.is_some() && maker == writer("last_seen")?)
}

/// Whether the name is one that the recogniser gives: a class and a number.
fn is_numbered(name: &str) -> bool {
    name.rsplit_once('_')
        .is_some_and(|(_, number)| number.parse::<u64>().is_ok())
}

/// The type of the node of an object: its class where that is a kind of `object`, else `object`.
fn node_type<'a>(schema: &Schema, class: &'a str) -> &'a str {
    match (schema.find_type(class), schema.find_type("object")) {
        (Some(special), Some(general)) if schema.is_subtype(special, general) => class,
        _ => "object",
    }
}

impl ObjectRecognition {
    /// A recogniser that knows no objects yet.
    pub fn new(config: Config) -> Self {
        Self {
            recognizer: Recognizer::new(config),
            objects: Vec::new(),
            adopted: false,
            made: BTreeSet::new(),
        }
    }

    /// The objects of the last step, in order of name.
    pub fn objects(&self) -> &[RecognizedObject] {
        &self.objects
    }

    /// Takes in `frames` and says what has to change in the graph at `now`.
    ///
    /// The first step adopts the objects that a recogniser put into the graph before. Without a
    /// `world` node nothing is written, because nothing can be placed. A refused transaction needs
    /// no care: the next step makes it again.
    ///
    /// # Errors
    /// [`ReadError`], where the snapshot was overtaken.
    pub fn step(
        &mut self,
        now: Time,
        frames: &[CameraFrame],
        snapshot: &Snapshot,
    ) -> Result<Transaction, ReadError> {
        let plan = floor_plan(snapshot)?;
        let nodes = object_nodes(snapshot)?;
        if !self.adopted {
            for object in objects(snapshot)? {
                if !object.identified {
                    self.made.insert(object.name.clone());
                }
                self.recognizer.adopt(&object);
            }
            self.adopted = true;
        }
        for name in nodes.keys() {
            self.recognizer.reserve(name);
        }
        self.objects = self.recognizer.observe(now, frames, &plan);
        self.transaction(snapshot, &nodes)
    }

    fn transaction(
        &mut self,
        snapshot: &Snapshot,
        nodes: &BTreeMap<String, Node>,
    ) -> Result<Transaction, ReadError> {
        let Some(mut difference) = Difference::new(snapshot)? else {
            return Ok(Transaction::new());
        };
        for object in &self.objects {
            let node = nodes.get(&object.name);
            match node {
                Some(node) => update(&mut difference, node, object)?,
                // The name of a node that is no object: whatever the marker says, it is not this.
                None if snapshot.find_node_by_name(&object.name)?.is_some() => continue,
                None => create(&mut difference, snapshot.schema(), object),
            }
            let rooms = object.in_room.iter().cloned().collect();
            difference.edges(&object.name, node, "in", &rooms, &BTreeSet::new())?;
            if !object.identified {
                self.made.insert(object.name.clone());
            }
        }
        let current: BTreeSet<&String> = self.objects.iter().map(|object| &object.name).collect();
        self.made
            .retain(|name| current.contains(name) || nodes.contains_key(name));
        for name in self.made.iter().filter(|name| !current.contains(name)) {
            difference.transaction.delete_node(name.as_str());
        }
        Ok(difference.transaction)
    }
}

fn create(difference: &mut Difference, schema: &Schema, object: &RecognizedObject) {
    let attributes = vec![
        ("shape".to_owned(), "rectangle".into()),
        ("size".to_owned(), <[f64; 2]>::from(object.size).into()),
        ("confidence".to_owned(), object.confidence.into()),
        ("last_seen".to_owned(), object.last_seen.seconds().into()),
    ];
    difference.create(
        node_type(schema, &object.class),
        &object.name,
        object.pose,
        attributes,
    );
}

fn update(
    difference: &mut Difference,
    node: &Node,
    object: &RecognizedObject,
) -> Result<(), ReadError> {
    difference.place(node, object.pose)?;
    difference.vector(node, "size", object.size.into(), SIZE_STEP)?;
    difference.number(node, "confidence", object.confidence, CONFIDENCE_STEP)?;
    difference.number(
        node,
        "last_seen",
        object.last_seen.seconds(),
        LAST_SEEN_PERIOD,
    )?;
    let (known, new) = (numbers(node, "places")?, listed(&object.places));
    let same = known.len() == new.len()
        && known
            .iter()
            .zip(&new)
            .zip(PLACE_STEP.iter().cycle())
            .all(|((known, new), step)| (known - new).abs() <= *step);
    if !same {
        let at = object.remembered.seconds();
        difference.transaction.set(node.id(), "places_at", at);
        let places = Value::F64List(new);
        difference.transaction.set(node.id(), "places", places);
    }
    if let Some(stay) = object.stay {
        difference.number(node, "stay", stay, STAY_STEP)?;
    }
    Ok(())
}
