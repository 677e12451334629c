//! What the navigation reads from the graph: the map, the people, the robot's body, and the step it
//! shall carry out. This file owns the names of the nodes and attributes that it goes by.

use crate::grid::shared::SOCIAL_GRID_TIME;
use crate::navigation::control::{Base, Limits};
use crate::navigation::map_age::{MapPatience, MapState};
use crate::navigation::obstacles::Wall;
use crate::navigation::people::Person;
use crate::navigation::target::{Company, End, Target, places_before};
use dsr::{EdgeKey, Node, NodeId, ReadError, Snapshot, Time, Value, pose_on_floor};
use nalgebra::{Isometry2, Point2, Vector2};
use std::collections::BTreeMap;
use thiserror::Error;

/// The agent's name in `step` nodes.
pub const AGENT: &str = "navigation";
/// The robot's attribute that says what the social grid is worth at its age: `current`, `old` or `lost`.
pub const MAP_STATE: &str = "map_state";
/// The robot's attributes that say from which age of the grid on it drives slower, and stands, seconds. They may be set
/// while running; where they are absent, [`MapPatience`] has the usual figures.
pub const MAP_SLOW_AFTER: &str = "map_slow_after";
/// The robot's attribute with the radius of the band's bubble about each point of `path`, metres.
pub const BUBBLES: &str = "bubbles";
/// The robot's attribute with the path that the band was laid along.
pub const PLANNED_PATH: &str = "planned_path";
/// The robot's attribute that says which ways its base goes: the name of a [`Base`].
pub const BASE: &str = "base";
/// See [`MAP_SLOW_AFTER`].
pub const MAP_HOLD_AFTER: &str = "map_hold_after";
/// How far from a person the robot stops to talk, metres: outside personal space, which ends 1.18 m
/// ahead of people, and well within `is_near` (2 m).
pub const TALKING_DISTANCE: f64 = 1.3;
/// The radius of a person whose node has none, metres.
const BODY_RADIUS: f64 = 0.25;
/// A person is taken to walk on since they were last seen for no longer than this, seconds.
const WALKS_ON: f64 = 1.0;

/// The graph as the navigation sees it.
#[derive(Debug, Clone)]
pub(super) struct World {
    pub(super) id: NodeId,
    pub(super) robot: Robot,
    pub(super) social: bool,
    /// How many seconds ago the social grid held, where it says when.
    pub(super) map_age: Option<f64>,
    /// What it is worth. One that does not say when it held counts as current.
    pub(super) map: MapState,
    pub(super) walls: Vec<Wall>,
    pub(super) people: Vec<Person>,
    pub(super) rooms: Vec<Room>,
}

/// The robot's node.
#[derive(Debug, Clone)]
pub(super) struct Robot {
    pub(super) id: NodeId,
    pub(super) limits: Limits,
    /// What `velocity` says now.
    pub(super) velocity: Vec<f64>,
    /// What `path` and `planned_path` say now.
    pub(super) path: Vec<f64>,
    pub(super) planned: Vec<f64>,
    pub(super) room: Option<NodeId>,
    /// What `map_state` says now.
    pub(super) map_state: Option<String>,
}

/// A room's node.
#[derive(Debug, Clone)]
pub(super) struct Room {
    pub(super) id: NodeId,
    pub(super) name: String,
    pub(super) polygon: Vec<Point2<f64>>,
}

/// A step of a plan that navigation shall carry out.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Step {
    pub(super) id: NodeId,
    pub(super) name: String,
    pub(super) rule: String,
    pub(super) running: bool,
    index: u64,
    pub(super) binding: BTreeMap<String, String>,
}

/// What a step asks for.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Work {
    /// To get somewhere.
    Drive(Target),
    /// To be looked at by a person, who is asked with these words.
    Ask { person: String, words: &'static str },
    /// To stand until the person of that name is in the robot's room.
    Wait(String),
    /// To stand aside until the person of that name has passed.
    LetPass(String),
}

/// Why a step cannot be carried out.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum StepError {
    /// The step's `binding` is no JSON object of names.
    #[error("the step's binding is not a JSON object of node names")]
    Binding,
    /// Navigation does not know what to do for the rule.
    #[error("navigation does not know how to carry out `{rule}`")]
    UnknownRule {
        /// The rule.
        rule: String,
    },
    /// The binding names no node that the rule needs.
    #[error("`{rule}` is bound to no {role}")]
    Unbound {
        /// The rule.
        rule: String,
        /// What it needs.
        role: &'static str,
    },
    /// The node it is bound to does not say where it is.
    #[error("the graph does not say where `{node}` is")]
    Nowhere {
        /// The node.
        node: String,
    },
}

fn number(node: &Node, name: &str) -> Result<Option<f64>, ReadError> {
    Ok(node
        .value(name)?
        .and_then(|value| value.as_f64())
        .filter(|value| value.is_finite()))
}

fn text(node: &Node, name: &str) -> Result<Option<String>, ReadError> {
    Ok(node
        .value(name)?
        .and_then(|value| value.as_str().map(str::to_owned)))
}

fn numbers(node: &Node, name: &str) -> Result<Vec<f64>, ReadError> {
    Ok(node
        .value(name)?
        .and_then(|value| value.as_f64s().map(<[f64]>::to_vec))
        .unwrap_or_default())
}

fn vector(node: &Node, name: &str) -> Result<Option<Vector2<f64>>, ReadError> {
    let row = numbers(node, name)?;
    Ok(match row[..] {
        [x, y] if x.is_finite() && y.is_finite() => Some(Vector2::new(x, y)),
        _ => None,
    })
}

/// Where the graph says that a node of that name is.
fn place_of(snapshot: &Snapshot, node: NodeId) -> Result<Option<Isometry2<f64>>, ReadError> {
    let finite = |pose: &Isometry2<f64>| pose.translation.vector.iter().all(|v| v.is_finite());
    Ok(snapshot.world_from(node)?.filter(finite))
}

/// Reads the world; `None` while there is no world or no robot in the graph.
pub(super) fn world(snapshot: &Snapshot, now: Time) -> Result<Option<World>, ReadError> {
    let Some(world) = snapshot.nodes_of("world").next().transpose()? else {
        return Ok(None);
    };
    let Some(robot) = snapshot.nodes_of("robot").next().transpose()? else {
        return Ok(None);
    };
    let walls = numbers(&world, "walls")?;
    let walls = walls.as_chunks::<4>().0.iter();
    let mut people = Vec::new();
    for node in snapshot.nodes_of("person") {
        people.extend(person(snapshot, &node?, now)?);
    }
    let mut rooms = Vec::new();
    for node in snapshot.nodes_of("room") {
        let node = node?;
        let polygon = numbers(&node, "polygon")?;
        let corners = polygon.as_chunks::<2>().0.iter();
        rooms.push(Room {
            id: node.id(),
            name: node.name()?,
            polygon: corners.map(|&[x, y]| Point2::new(x, y)).collect(),
        });
    }
    let held = number(&world, SOCIAL_GRID_TIME)?;
    let map_age = held.map(|held| now.since(Time::from_seconds(held)));
    let usual = MapPatience::default();
    let patience = MapPatience {
        slow_after: number(&robot, MAP_SLOW_AFTER)?.unwrap_or(usual.slow_after),
        hold_after: number(&robot, MAP_HOLD_AFTER)?.unwrap_or(usual.hold_after),
    };
    Ok(Some(World {
        id: world.id(),
        robot: self::robot(snapshot, &robot)?,
        map_age,
        map: map_age.map_or(MapState::Current, |age| patience.judge(age)),
        social: world
            .value("social")?
            .and_then(|value| value.as_bool())
            .unwrap_or(true),
        walls: walls
            .map(|&[ax, ay, bx, by]| [Point2::new(ax, ay), Point2::new(bx, by)])
            .collect(),
        people,
        rooms,
    }))
}

fn robot(snapshot: &Snapshot, node: &Node) -> Result<Robot, ReadError> {
    let usual = Limits::default();
    let mut room = None;
    if let Some(label) = snapshot.schema().find_label("in") {
        room = node
            .out_edges_of(label)
            .next()
            .transpose()?
            .map(|edge| edge.to);
    }
    let positive = |value: Option<f64>, usual: f64| value.filter(|v| *v > 0.0).unwrap_or(usual);
    Ok(Robot {
        id: node.id(),
        limits: Limits {
            base: text(node, BASE)?
                .and_then(|name| Base::find(&name))
                .unwrap_or_default(),
            radius: positive(number(node, "radius")?, usual.radius),
            max_speed: positive(number(node, "max_speed")?, usual.max_speed),
            max_turn: positive(number(node, "max_turn")?, usual.max_turn),
            ..usual
        },
        velocity: numbers(node, "velocity")?,
        path: numbers(node, "path")?,
        planned: numbers(node, PLANNED_PATH)?,
        room,
        map_state: text(node, MAP_STATE)?,
    })
}

fn person(snapshot: &Snapshot, node: &Node, now: Time) -> Result<Option<Person>, ReadError> {
    let Some(mut world_from_person) = place_of(snapshot, node.id())? else {
        return Ok(None);
    };
    let velocity = vector(node, "velocity")?.unwrap_or_default();
    if let Some(seen) = number(node, "last_seen")? {
        let since = now.since(Time::from_seconds(seen)).clamp(0.0, WALKS_ON);
        world_from_person.translation.vector += velocity * since;
    }
    Ok(Some(Person {
        name: node.name()?,
        world_from_person,
        velocity,
        radius: number(node, "radius")?.unwrap_or(BODY_RADIUS),
    }))
}

/// The step that navigation is to carry out: one that is running, else the first dispatched.
pub(super) fn step(snapshot: &Snapshot) -> Result<Option<Step>, ReadError> {
    let mut best: Option<Step> = None;
    for node in snapshot.nodes_of("step") {
        let node = node?;
        let running = match text(&node, "status")?.as_deref() {
            Some("running") => true,
            Some("dispatched") => false,
            _ => continue,
        };
        if text(&node, "agent")?.as_deref() != Some(AGENT) {
            continue;
        }
        let found = Step {
            id: node.id(),
            name: node.name()?,
            rule: text(&node, "rule")?.unwrap_or_default(),
            running,
            index: node
                .value("index")?
                .and_then(|v| v.as_f64())
                .unwrap_or_default() as u64,
            binding: text(&node, "binding")?
                .and_then(|json| serde_json::from_str(&json).ok())
                .unwrap_or_default(),
        };
        let rank = |step: &Step| (!step.running, step.index, step.id);
        if best.as_ref().is_none_or(|best| rank(&found) < rank(best)) {
            best = Some(found);
        }
    }
    Ok(best)
}

/// What `step` asks for. Which node plays which part goes by the types of the bound nodes, and for
/// the two rooms of `changeRoom` by the variable `room2`, or else by where the robot is not.
pub(super) fn work(
    snapshot: &Snapshot,
    world: &World,
    step: &Step,
) -> Result<Result<Work, StepError>, ReadError> {
    if step.binding.is_empty() {
        return Ok(Err(StepError::Binding));
    }
    let unbound = |role| StepError::Unbound {
        rule: step.rule.clone(),
        role,
    };
    Ok(match step.rule.as_str() {
        "changeRoom" => {
            let named = step.binding.get("room2");
            let bound = |room: &&Room| match named {
                Some(name) => room.name == *name,
                None => {
                    step.binding.values().any(|name| *name == room.name)
                        && Some(room.id) != world.robot.room
                }
            };
            match world.rooms.iter().find(bound) {
                None => Err(unbound("other room")),
                Some(room) if room.polygon.len() < 3 => Err(StepError::Nowhere {
                    node: room.name.clone(),
                }),
                Some(room) => Ok(Work::Drive(Target::Region {
                    polygon: room.polygon.clone(),
                    entry: door(snapshot, world.robot.room, room.id)?,
                })),
            }
        }
        "approach" | "goToPerson" | "takeTheAttention" | "askForPermission" | "escort"
        | "follow" | "wait" | "letPass" => match bound_of_type(snapshot, step, "person")? {
            None => Err(unbound("person")),
            Some(person) => {
                let end = match step.binding.get("room2") {
                    Some(name) => end(snapshot, world, name)?,
                    None => None,
                };
                Ok(with_person(step, person.name()?, end.as_ref()))
            }
        },
        "goToPlace" => match bound_of_type(snapshot, step, "place")? {
            None => Err(unbound("place")),
            Some(place) => match place_of(snapshot, place.id())? {
                Some(pose) => Ok(Work::Drive(Target::Point(pose.translation.vector.into()))),
                None => Err(StepError::Nowhere {
                    node: place.name()?,
                }),
            },
        },
        "goToPose" => match bound_of_type(snapshot, step, "place")? {
            None => Err(unbound("place")),
            Some(place) => match place_of(snapshot, place.id())? {
                Some(pose) => Ok(Work::Drive(Target::Pose(pose))),
                None => Err(StepError::Nowhere {
                    node: place.name()?,
                }),
            },
        },
        "goToObject" => match bound_of_type(snapshot, step, "object")? {
            None => Err(unbound("object")),
            Some(object) => match place_of(snapshot, object.id())? {
                Some(pose) => {
                    let size = vector(&object, "size")?.unwrap_or_default();
                    let places = places_before(&pose, size, world.robot.limits.radius);
                    Ok(Work::Drive(Target::Places(places)))
                }
                None => Err(StepError::Nowhere {
                    node: object.name()?,
                }),
            },
        },
        "approachGroup" => match bound_of_type(snapshot, step, "group")? {
            None => Err(unbound("group")),
            Some(group) => Ok(Work::Drive(Target::Group {
                members: members(snapshot, &group)?,
            })),
        },
        rule => Err(StepError::UnknownRule {
            rule: rule.to_owned(),
        }),
    })
}

/// The names of those who are in a group.
fn members(snapshot: &Snapshot, group: &Node) -> Result<Vec<String>, ReadError> {
    let mut names = Vec::new();
    if let Some(label) = snapshot.schema().find_label("member_of") {
        for edge in group.in_edges_of(label) {
            if let Some(person) = snapshot.find_node(edge?.from)? {
                names.push(person.name()?);
            }
        }
    }
    Ok(names)
}

/// Where a way together to the room of that name ends.
fn end(snapshot: &Snapshot, world: &World, name: &str) -> Result<Option<End>, ReadError> {
    let Some(room) = world.rooms.iter().find(|room| room.name == name) else {
        return Ok(None);
    };
    Ok(Some(End {
        polygon: room.polygon.clone(),
        entry: door(snapshot, world.robot.room, room.id)?,
    }))
}

/// What a rule asks for that is about somebody.
fn with_person(step: &Step, name: String, until: Option<&End>) -> Work {
    let company = |place| {
        Work::Drive(Target::Company {
            name: name.clone(),
            place,
            until: until.cloned(),
        })
    };
    match step.rule.as_str() {
        "takeTheAttention" => Work::Ask {
            person: name,
            words: "Excuse me, may I have a moment?",
        },
        "askForPermission" => Work::Ask {
            person: name,
            words: "Excuse me, may I pass?",
        },
        "escort" => company(Company::Beside),
        "follow" => company(Company::Behind),
        "wait" => Work::Wait(name),
        "letPass" => Work::LetPass(name),
        _ => Work::Drive(Target::Person {
            name,
            distance: TALKING_DISTANCE,
        }),
    }
}

fn bound_of_type<'a>(
    snapshot: &'a Snapshot,
    step: &Step,
    type_name: &str,
) -> Result<Option<Node<'a>>, ReadError> {
    let Some(wanted) = snapshot.schema().find_type(type_name) else {
        return Ok(None);
    };
    for name in step.binding.values() {
        if let Some(node) = snapshot.find_node_by_name(name)?
            && snapshot.schema().is_subtype(node.type_id(), wanted)
        {
            return Ok(Some(node));
        }
    }
    Ok(None)
}

/// The middle of the door between two rooms.
fn door(
    snapshot: &Snapshot,
    from: Option<NodeId>,
    to: NodeId,
) -> Result<Option<Point2<f64>>, ReadError> {
    let (Some(label), Some(from)) = (snapshot.schema().find_label("connected"), from) else {
        return Ok(None);
    };
    for (from, to) in [(from, to), (to, from)] {
        if let Some(edge) = snapshot.find_edge(EdgeKey { from, label, to })?
            && let Some([x, y]) = edge.value("door")?.as_ref().and_then(Value::as_f64s)
        {
            return Ok(Some(Point2::new(*x, *y)));
        }
    }
    Ok(None)
}

/// The pose that a `pose` edge says, where the graph has that edge.
pub(super) fn edge_pose(
    snapshot: &Snapshot,
    from: NodeId,
    to: NodeId,
) -> Result<Option<Isometry2<f64>>, ReadError> {
    let Some(label) = snapshot.schema().find_label("pose") else {
        return Ok(None);
    };
    let Some(edge) = snapshot.find_edge(EdgeKey { from, label, to })? else {
        return Ok(None);
    };
    Ok(edge
        .value("transform")?
        .and_then(|value| value.as_pose().map(pose_on_floor)))
}
