//! From the graph to the scene. This file owns which nodes and attributes a scene is read from, and what
//! stands in for those that are absent.

use super::ReadError;
use crate::social_mapping::comfort::check_room;
use crate::social_mapping::config::SocialConfig;
use crate::social_mapping::features::Features;
use crate::social_mapping::object_space::Outline;
use crate::social_mapping::rejection::Rejection;
use crate::social_mapping::scene::{
    Activity, BODY_RADIUS, Manner, Object, Person, SocialScene, Wall,
};
use dsr::{Node, NodeId, Snapshot, Time, Value};
use nalgebra::{Point2, Vector2};
use std::collections::BTreeMap;

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
/// A person's `activity`, `features` (read as [`Features::parse`](crate::social_mapping::features::Features::parse)
/// says) and `task` shape their space; without `activity`, that of the room they are `in` (of several, which is reported, the first by name), and without `task`, the rule of
/// a running step bound to them that has cooperation zones. A world without `social` is social. A circle's diameter is its larger `size`. An activity that is not `cancelled` uses
/// the objects its `uses` edges lead to and the one its `object` names.
///
/// # Errors
/// [`ReadError`]: without a world with `bounds` and well-formed `walls`, and a robot with a `radius`,
/// there is no map.
pub fn scene(snapshot: &Snapshot, config: &SocialConfig) -> Result<SocialScene, ReadError> {
    let world = snapshot.nodes_of("world").next().transpose()?;
    let world = world.ok_or(ReadError::Missing { type_name: "world" })?;
    Ok(SocialScene {
        bounds: bounds(&world)?,
        walls: walls(&world)?,
        robot_radius: robot_radius(snapshot)?,
        ..contents(snapshot, config)?
    })
}

/// The scene without what there is no map without: bounds, walls and robot are left out.
pub(super) fn contents(
    snapshot: &Snapshot,
    config: &SocialConfig,
) -> Result<SocialScene, dsr::ReadError> {
    let world = snapshot.nodes_of("world").next().transpose()?;
    let social = world.map(|world| world.value("social")).transpose()?;
    let social = social.flatten().and_then(|value| value.as_bool());
    let mut scene = SocialScene {
        social: social.unwrap_or(true),
        ..SocialScene::default()
    };
    let tasks = tasks(snapshot, config)?;
    let mut names: BTreeMap<NodeId, String> = BTreeMap::new();
    for node in snapshot.nodes_of("person") {
        let node = node?;
        let Some(world_from_person) = snapshot.world_from(node.id())? else {
            continue;
        };
        let name = node.name()?;
        names.insert(node.id(), name.clone());
        let mut manner = manner(snapshot, &node, &config.features, &mut scene.rejected)?;
        if manner.task.is_none() {
            manner.task = tasks.get(&name).cloned();
        }
        scene.people.push(Person {
            name,
            world_from_person,
            velocity: vector(&node, "velocity", 0.0)?,
            radius: number(&node, "radius", BODY_RADIUS)?,
            manner,
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
            // Of a number and none, the greater is no diameter: such a size stays none.
            outline: if round && !size.iter().any(|side| side.is_nan()) {
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
    check_rooms(snapshot, &mut scene.rejected)?;
    Ok(scene)
}

/// What else the graph says of a person; what cannot be read is reported and left out.
fn manner(
    snapshot: &Snapshot,
    node: &Node<'_>,
    features: &Features,
    rejected: &mut Vec<Rejection>,
) -> Result<Manner, dsr::ReadError> {
    let text = |name| -> Result<Option<String>, dsr::ReadError> {
        let value = node.value(name)?;
        let text = value.as_ref().and_then(Value::as_str).map(str::to_owned);
        Ok(text.filter(|text| !text.is_empty()))
    };
    let mut manner = Manner {
        activity: text("activity")?,
        task: text("task")?,
        ..Manner::default()
    };
    let label = snapshot.schema().find_label("in");
    let mut rooms = Vec::new();
    for edge in label.into_iter().flat_map(|label| node.out_edges_of(label)) {
        if let Some(room) = snapshot.find_node(edge?.to)? {
            rooms.push(room.name()?);
        }
    }
    rooms.sort_unstable();
    if rooms.len() > 1 {
        rejected.push(Rejection::PersonRooms {
            name: node.name()?,
            rooms: rooms.join(", "),
            first: rooms[0].clone(),
        });
    }
    manner.room = rooms.into_iter().next();
    if let Some(text) = text("features")? {
        match features.parse(&text) {
            Ok(values) => manner.features = values,
            Err(error) => rejected.push(Rejection::PersonFeatures {
                name: node.name()?,
                error,
            }),
        }
    }
    Ok(manner)
}

/// What the robot is doing with whom: the rules of running steps that have cooperation zones, by the
/// names of those whom the steps bind.
fn tasks(
    snapshot: &Snapshot,
    config: &SocialConfig,
) -> Result<BTreeMap<String, String>, dsr::ReadError> {
    let mut tasks = BTreeMap::new();
    for node in snapshot.nodes_of("step") {
        let node = node?;
        let text = |name| -> Result<Option<String>, dsr::ReadError> {
            let value = node.value(name)?;
            Ok(value.as_ref().and_then(Value::as_str).map(str::to_owned))
        };
        let Some(rule) = text("rule")?.filter(|rule| config.cooperation.contains_key(rule)) else {
            continue;
        };
        if text("status")?.as_deref() != Some("running") {
            continue;
        }
        // A binding that cannot be read is navigation's to complain of.
        let binding: BTreeMap<String, String> = text("binding")?
            .and_then(|json| serde_json::from_str(&json).ok())
            .unwrap_or_default();
        tasks.extend(binding.into_values().map(|name| (name, rule.clone())));
    }
    Ok(tasks)
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

pub(super) fn bounds(world: &Node<'_>) -> Result<[f64; 4], ReadError> {
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

/// Reports the rooms whose outline is none.
fn check_rooms(snapshot: &Snapshot, rejected: &mut Vec<Rejection>) -> Result<(), dsr::ReadError> {
    for node in snapshot.nodes_of("room") {
        let node = node?;
        let Some(value) = node.value("polygon")? else {
            continue;
        };
        let problem = match value.as_f64s().map(<[f64]>::as_chunks::<2>) {
            Some((corners, [])) => {
                let corners: Vec<_> = corners.iter().map(|&[x, y]| Point2::new(x, y)).collect();
                check_room(&corners).err().map(|error| error.to_string())
            }
            _ => Some("it needs two numbers, x and y, for each corner".to_owned()),
        };
        if let Some(problem) = problem {
            let room = node.name()?;
            rejected.push(Rejection::Polygon { room, problem });
        }
    }
    Ok(())
}

fn read_activities(snapshot: &Snapshot, scene: &mut SocialScene) -> Result<(), dsr::ReadError> {
    let uses = snapshot.schema().find_label("uses");
    for node in snapshot.nodes_of("activity") {
        let node = node?;
        let cancelled = node.value("cancelled")?.and_then(|value| value.as_bool());
        if cancelled == Some(true) {
            continue;
        }
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
        let name = node.name()?;
        let activities = objects.into_iter().map(|object| Activity {
            name: name.clone(),
            object,
            start,
            end,
        });
        scene.activities.extend(activities);
    }
    Ok(())
}
