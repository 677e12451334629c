//! Cameras that err, for the tests: noise, misses and false detections drawn from a seed.

use super::{FloorPlan, difference, sees};
use crate::messages::{CameraFrame, ObjectDetection, PersonDetection};
use dsr::{EdgeRef, Graph, Schema, Snapshot, Time, Transaction, Value};
use nalgebra::{Isometry2, Point2, UnitComplex, Vector2};
use std::f64::consts::TAU;

/// A small linear congruential generator (Knuth's MMIX constants), the high bits used.
#[derive(Debug)]
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// In [0, 1).
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Normal with mean 0 and deviation 1.
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (TAU * self.uniform()).cos()
    }
}

/// How cameras err.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Errors {
    pub(crate) position: f64,
    pub(crate) heading: f64,
    pub(crate) miss: f64,
    /// False detections per second and camera.
    pub(crate) clutter: f64,
}

/// The errors that issue bars are stated for: 0.1 m, 10 % misses, 1 false detection a second.
pub(crate) const USUAL: Errors = Errors {
    position: 0.1,
    heading: 0.15,
    miss: 0.1,
    clutter: 1.0,
};

/// An empty frame of a camera at (x, y) that looks along `heading`.
pub(crate) fn camera(
    name: &str,
    x: f64,
    y: f64,
    heading: f64,
    view: f64,
    range: f64,
) -> CameraFrame {
    CameraFrame {
        camera: name.to_owned(),
        time: Time::default(),
        world_from_camera: Isometry2::new(Vector2::new(x, y), heading),
        field_of_view: view,
        range,
        people: Vec::new(),
        objects: Vec::new(),
    }
}

/// What `camera` shows of `people` (poses in the world) at `time`, `period` seconds after its last
/// frame.
pub(crate) fn look(
    camera: &CameraFrame,
    time: Time,
    period: f64,
    people: &[Isometry2<f64>],
    plan: &FloorPlan,
    errors: Errors,
    random: &mut Random,
) -> CameraFrame {
    let mut frame = CameraFrame {
        time,
        ..camera.clone()
    };
    for person in people {
        let place = Point2::from(person.translation.vector);
        if sees(camera, plan, place, 0.0) && random.uniform() >= errors.miss {
            let local = camera.world_from_camera.inverse() * person;
            let noise = Vector2::new(random.normal(), random.normal()) * errors.position;
            frame.people.push(PersonDetection {
                position: Point2::from(local.translation.vector + noise),
                heading: Some(local.rotation.angle() + random.normal() * errors.heading),
                score: 0.9,
                appearance: Vec::new(),
            });
        }
    }
    if random.uniform() < errors.clutter * period {
        let (distance, angle) = somewhere(camera, random);
        frame.people.push(PersonDetection {
            position: Point2::new(distance * angle.cos(), distance * angle.sin()),
            heading: Some(difference(random.uniform() * TAU, 0.0)),
            score: 0.6,
            appearance: Vec::new(),
        });
    }
    frame
}

/// A place evenly spread over the view: distance and direction.
fn somewhere(camera: &CameraFrame, random: &mut Random) -> (f64, f64) {
    let distance = camera.range * random.uniform().sqrt();
    (distance, (random.uniform() - 0.5) * camera.field_of_view)
}

/// An object as it truly is.
#[derive(Debug, Clone)]
pub(crate) struct Thing {
    pub(crate) class: &'static str,
    pub(crate) identity: Option<&'static str>,
    pub(crate) pose: Isometry2<f64>,
    pub(crate) size: Vector2<f64>,
}

impl Thing {
    /// The detection of it without any error.
    pub(crate) fn detection(&self, frame: &CameraFrame) -> ObjectDetection {
        ObjectDetection {
            class: self.class.to_owned(),
            identity: self.identity.map(str::to_owned),
            camera_from_object: frame.world_from_camera.inverse() * self.pose,
            size: self.size,
            score: 0.9,
        }
    }
}

/// Adds what `frame`'s camera shows of `things`; false detections have one of their classes.
pub(crate) fn look_at_things(
    frame: &mut CameraFrame,
    period: f64,
    things: &[Thing],
    plan: &FloorPlan,
    errors: Errors,
    random: &mut Random,
) {
    for thing in things {
        let place = Point2::from(thing.pose.translation.vector);
        if sees(frame, plan, place, 0.0) && random.uniform() >= errors.miss {
            let mut detection = thing.detection(frame);
            let noise = Vector2::new(random.normal(), random.normal()) * errors.position;
            let turn = UnitComplex::new(random.normal() * errors.heading);
            let local = &mut detection.camera_from_object;
            local.translation.vector += noise;
            local.rotation = turn * local.rotation;
            frame.objects.push(detection);
        }
    }
    if !things.is_empty() && random.uniform() < errors.clutter * period {
        let (distance, angle) = somewhere(frame, random);
        let like = &things[(random.uniform() * things.len() as f64) as usize];
        let place = Vector2::new(distance * angle.cos(), distance * angle.sin());
        frame.objects.push(ObjectDetection {
            class: like.class.to_owned(),
            identity: None,
            camera_from_object: Isometry2::new(place, random.uniform() * TAU),
            size: like.size,
            score: 0.6,
        });
    }
}

/// The part of the vocabulary of a scenario's schema that perception reads and writes.
const SCHEMA: &str = r#"
[types]
thing = []
world = ["thing"]
room = ["thing"]
person = ["thing"]
robot = ["thing"]
object = ["thing"]
table = ["object"]
tv = ["object"]

[labels]
pose = { from = ["thing"], to = ["thing"] }
in = { from = ["person", "robot", "object"], to = ["room"] }
is_near = { from = ["robot"], to = ["person"] }
interacting = { from = ["person"], to = ["person", "object"] }
front = { from = ["person"], to = ["robot"] }

[attributes]
transform = { kind = "pose" }
walls = { kind = "f64_list" }
observer_settings = { kind = "string" }
polygon = { kind = "f64_list" }
velocity = { kind = "vector" }
radius = { kind = "f64" }
confidence = { kind = "f64", min = 0.0, max = 1.0 }
last_seen = { kind = "f64" }
position_covariance = { kind = "vector" }
shape = { kind = "string" }
size = { kind = "vector" }
places = { kind = "f64_list" }
places_at = { kind = "f64" }
stay = { kind = "f64" }
space = { kind = "f64_list" }
"#;

/// A world of two rooms, `west` (x from -6 to 0) and `east` (to 6), 10 m deep, with a robot at
/// (0, -3) that faces east.
pub(crate) fn home() -> Graph {
    let mut graph = Graph::in_memory(Schema::from_toml("schema.toml", SCHEMA).unwrap());
    let mut world = Transaction::new();
    let walls = Value::F64List(vec![-6.0, -5.0, 6.0, -5.0, -6.0, 5.0, 6.0, 5.0]);
    world.create_node("world", "world", vec![("walls".to_owned(), walls)]);
    for (name, x) in [("west", -6.0), ("east", 0.0)] {
        let outline = vec![x, -5.0, x + 6.0, -5.0, x + 6.0, 5.0, x, 5.0];
        world.create_node(
            "room",
            name,
            vec![("polygon".to_owned(), Value::F64List(outline))],
        );
    }
    world.create_node("robot", "shelly", Vec::new());
    place(
        &mut world,
        "world",
        "shelly",
        Isometry2::new(Vector2::new(0.0, -3.0), 0.0),
    );
    graph.commit(&world, "loader", Time::default()).unwrap();
    graph
}

/// Adds the `pose` edge by which `node` hangs from `parent`.
pub(crate) fn place(
    transaction: &mut Transaction,
    parent: &str,
    node: &str,
    parent_from_node: Isometry2<f64>,
) {
    transaction.create_edge(parent, "pose", node);
    transaction.set_on_edge(
        EdgeRef::new(parent, "pose", node),
        "transform",
        parent_from_node,
    );
}

/// The names at the ends of the edges of `label`, in order.
pub(crate) fn edges(snapshot: &Snapshot, label: &str) -> Vec<(String, String)> {
    let name = |id| snapshot.find_node(id).unwrap().unwrap().name().unwrap();
    let label = snapshot.schema().label_id(label).unwrap();
    let keys = snapshot.edges_of_label(label).map(Result::unwrap);
    let mut edges: Vec<_> = keys.map(|key| (name(key.from), name(key.to))).collect();
    edges.sort_unstable();
    edges
}

/// The names of the nodes of a type, in order.
pub(crate) fn names(snapshot: &Snapshot, type_name: &str) -> Vec<String> {
    let nodes = snapshot.nodes_of(type_name);
    let mut names: Vec<_> = nodes.map(|node| node.unwrap().name().unwrap()).collect();
    names.sort_unstable();
    names
}
