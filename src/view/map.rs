//! The map: walls, rooms, people with their zones, groups, objects with their spaces, the robot and
//! where it goes. Lengths in metres and angles in radians, in the world's frame.

use super::sight::outline;
use dsr::{Element, Node, ReadError, Snapshot, Value};
use serde::Serialize;

/// A point x, y.
pub(crate) type Point = [f64; 2];
/// A place x, y with a heading.
pub(crate) type Place = [f64; 3];

/// What lies where.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct Map {
    /// The name of the world's node, and so of its frame.
    pub(crate) frame: String,
    /// Lower left and upper right, where the world has them.
    pub(crate) bounds: Option<[f64; 4]>,
    /// Ends of each wall.
    pub(crate) walls: Vec<[f64; 4]>,
    pub(crate) rooms: Vec<Room>,
    pub(crate) places: Vec<Thing>,
    pub(crate) cameras: Vec<Thing>,
    pub(crate) people: Vec<Person>,
    pub(crate) groups: Vec<Group>,
    pub(crate) objects: Vec<Object>,
    pub(crate) robots: Vec<Robot>,
    pub(crate) problems: Vec<Problem>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Room {
    pub(crate) name: String,
    pub(crate) outline: Vec<Point>,
}

/// Something that is only at a place; a camera also sees.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Thing {
    pub(crate) name: String,
    pub(crate) place: Place,
    /// A camera's opening angle and range,
    pub(crate) sees: Option<[f64; 2]>,
    /// and the outline of what it sees between the walls.
    pub(crate) view: Vec<Point>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Person {
    pub(crate) name: String,
    pub(crate) place: Place,
    pub(crate) radius: f64,
    /// Outlines of the intimate, the personal and the social zone; empty where there is none.
    pub(crate) zones: [Vec<Point>; 3],
    /// Names of people and objects that the person attends to.
    pub(crate) interacting: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Group {
    pub(crate) name: String,
    pub(crate) place: Place,
    pub(crate) outline: Vec<Point>,
    pub(crate) members: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Object {
    pub(crate) name: String,
    pub(crate) r#type: String,
    pub(crate) place: Place,
    pub(crate) circle: bool,
    /// Along its own x and y.
    pub(crate) size: [f64; 2],
    /// The outline of its space, and R(t).
    pub(crate) space: Vec<Point>,
    pub(crate) usage: Option<f64>,
    /// Where else it may be, the likeliest first: x, y, heading and probability of each.
    pub(crate) places: Vec<[f64; 4]>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Robot {
    pub(crate) name: String,
    pub(crate) place: Place,
    pub(crate) radius: f64,
    /// The elastic band that is still to go, the radii of its bubbles, and the path that it was laid along.
    pub(crate) path: Vec<Point>,
    pub(crate) bubbles: Vec<f64>,
    pub(crate) planned: Vec<Point>,
}

/// What was entered at a node and cannot be used, as an agent says there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Problem {
    pub(crate) node: String,
    pub(crate) text: String,
}

fn number(element: &Element<'_>, name: &str) -> Result<Option<f64>, ReadError> {
    Ok(element.value(name)?.and_then(|value| value.as_f64()))
}

fn numbers(element: &Element<'_>, name: &str) -> Result<Vec<f64>, ReadError> {
    let value = element.value(name)?;
    Ok(value
        .as_ref()
        .and_then(Value::as_f64s)
        .map_or_else(Vec::new, <[f64]>::to_vec))
}

fn rows<const N: usize>(numbers: &[f64]) -> Vec<[f64; N]> {
    numbers.as_chunks().0.to_vec()
}

fn points(element: &Element<'_>, name: &str) -> Result<Vec<Point>, ReadError> {
    Ok(rows(&numbers(element, name)?))
}

fn place(snapshot: &Snapshot, node: &Node<'_>) -> Result<Option<Place>, ReadError> {
    let found = snapshot.world_from(node.id())?;
    Ok(found.map(|pose| {
        let at = pose.translation.vector;
        [at.x, at.y, pose.rotation.angle()]
    }))
}

/// Names of the nodes that edges of a label lead to, by name.
fn names_of(
    snapshot: &Snapshot,
    node: &Node<'_>,
    label: &str,
    outwards: bool,
) -> Result<Vec<String>, ReadError> {
    let Some(label) = snapshot.schema().find_label(label) else {
        return Ok(Vec::new());
    };
    let ids = if outwards {
        node.targets_of(label)
    } else {
        node.sources_of(label)
    };
    let mut names = Vec::new();
    for id in ids {
        if let Some(other) = snapshot.find_node(id?)? {
            names.push(other.name()?);
        }
    }
    names.sort_unstable();
    Ok(names)
}

/// The nodes of a type that are somewhere, by name.
fn placed<T>(
    snapshot: &Snapshot,
    type_name: &str,
    make: impl Fn(&Node<'_>, String, Place) -> Result<T, ReadError>,
) -> Result<Vec<T>, ReadError> {
    let mut found = Vec::new();
    for node in snapshot.nodes_of(type_name) {
        let node = node?;
        if let Some(place) = place(snapshot, &node)? {
            let name = node.name()?;
            found.push((name.clone(), make(&node, name, place)?));
        }
    }
    found.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(found.into_iter().map(|(_, made)| made).collect())
}

impl Map {
    /// The map as of a snapshot.
    ///
    /// # Errors
    /// [`ReadError`].
    pub(crate) fn of(snapshot: &Snapshot) -> Result<Self, ReadError> {
        let mut map = Self {
            frame: "world".to_owned(),
            ..Self::default()
        };
        if let Some(world) = snapshot.nodes_of("world").next().transpose()? {
            map.frame = world.name()?;
            map.bounds = rows(&numbers(&world, "bounds")?).first().copied();
            map.walls = rows(&numbers(&world, "walls")?);
        }
        for room in snapshot.nodes_of("room") {
            let room = room?;
            map.rooms.push(Room {
                name: room.name()?,
                outline: points(&room, "polygon")?,
            });
        }
        map.rooms.sort_by(|a, b| a.name.cmp(&b.name));
        map.places = placed(snapshot, "place", |_, name, place| {
            Ok(Thing {
                name,
                place,
                sees: None,
                view: Vec::new(),
            })
        })?;
        map.cameras = placed(snapshot, "camera", |node, name, place| {
            let sees = number(node, "field_of_view")?.zip(number(node, "range")?);
            let view = sees.map(|(angle, range)| outline(place, angle, range, &map.walls));
            Ok(Thing {
                name,
                place,
                sees: sees.map(|(angle, range)| [angle, range]),
                view: view.unwrap_or_default(),
            })
        })?;
        map.people = placed(snapshot, "person", |node, name, at| {
            person(snapshot, node, name, at)
        })?;
        map.groups = placed(snapshot, "group", |node, name, place| {
            Ok(Group {
                name,
                place,
                outline: points(node, "personal_zone")?,
                members: names_of(snapshot, node, "member_of", false)?,
            })
        })?;
        map.objects = placed(snapshot, "object", object)?;
        map.robots = placed(snapshot, "robot", |node, name, place| {
            Ok(Robot {
                name,
                place,
                radius: number(node, "radius")?.unwrap_or(0.25),
                path: points(node, "path")?,
                bubbles: numbers(node, "bubbles")?,
                planned: points(node, "planned_path")?,
            })
        })?;
        map.problems = problems(snapshot)?;
        Ok(map)
    }
}

fn person(
    snapshot: &Snapshot,
    node: &Node<'_>,
    name: String,
    place: Place,
) -> Result<Person, ReadError> {
    Ok(Person {
        name,
        place,
        radius: number(node, "radius")?.unwrap_or(0.25),
        zones: [
            points(node, "intimate_zone")?,
            points(node, "personal_zone")?,
            points(node, "social_zone")?,
        ],
        interacting: names_of(snapshot, node, "interacting", true)?,
    })
}

fn object(node: &Node<'_>, name: String, place: Place) -> Result<Object, ReadError> {
    let shape = node.value("shape")?;
    let size = numbers(node, "size")?;
    Ok(Object {
        name,
        r#type: node.type_name().to_owned(),
        place,
        circle: shape.as_ref().and_then(Value::as_str) == Some("circle"),
        size: rows(&size).first().copied().unwrap_or([0.5, 0.5]),
        space: points(node, "space")?,
        usage: number(node, "usage")?,
        // Beside these, visits and when it was last seen there.
        places: rows::<6>(&numbers(node, "places")?)
            .into_iter()
            .map(|[x, y, heading, probability, ..]| [x, y, heading, probability])
            .collect(),
    })
}

fn problems(snapshot: &Snapshot) -> Result<Vec<Problem>, ReadError> {
    let mut found = Vec::new();
    for kind in ["world", "activity", "person"] {
        for node in snapshot.nodes_of(kind) {
            let node = node?;
            let value = node.value("problems")?;
            if let Some(text) = value.as_ref().and_then(Value::as_str)
                && !text.is_empty()
            {
                let (node, text) = (node.name()?, text.to_owned());
                found.push(Problem { node, text });
            }
        }
    }
    found.sort_by(|a, b| a.node.cmp(&b.node));
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::{EdgeRef, Graph, Operation, Schema, Time, Transaction, planar_pose};
    use nalgebra::{Isometry2, Vector2};

    #[test]
    fn who_is_somewhere_is_on_the_map_and_who_is_nowhere_is_not() {
        let mut graph = Graph::in_memory(scenarios::schema().unwrap());
        let mut transaction = Transaction::new();
        let walls = Value::F64List(vec![0.0, 0.0, 4.0, 0.0]);
        transaction.create_node("world", "w", vec![("walls".into(), walls)]);
        for name in ["ana", "bob"] {
            transaction.create_node("person", name, vec![]);
        }
        transaction.create_edge("ana", "interacting", "bob");
        let pose = Isometry2::new(Vector2::new(1.0, 2.0), 0.5);
        transaction.push(Operation::CreateEdge {
            edge: EdgeRef::new("w", "pose", "ana"),
            attributes: vec![("transform".into(), Value::Pose(planar_pose(&pose)))],
        });
        graph.commit(&transaction, "test", Time::default()).unwrap();
        let mut cup = Transaction::new();
        let places = Value::F64List(vec![
            1.0, 2.0, 0.0, 0.7, 3.0, 5.0, 2.0, 2.0, 0.0, 0.3, 1.0, 4.0,
        ]);
        cup.create_node("object", "cup", vec![("places".into(), places)]);
        cup.push(Operation::CreateEdge {
            edge: EdgeRef::new("w", "pose", "cup"),
            attributes: vec![("transform".into(), Value::Pose(planar_pose(&pose)))],
        });
        cup.set("w", "problems", "the walls cross");
        graph.commit(&cup, "test", Time::default()).unwrap();
        let map = Map::of(&graph.snapshot()).unwrap();
        let places = &map.objects[0].places;
        assert_eq!(places[..], [[1.0, 2.0, 0.0, 0.7], [2.0, 2.0, 0.0, 0.3]]);
        assert_eq!(
            (&*map.problems[0].node, &*map.problems[0].text),
            ("w", "the walls cross")
        );
        assert_eq!(map.frame, "w");
        assert_eq!(map.walls, [[0.0, 0.0, 4.0, 0.0]]);
        let [ana] = &map.people[..] else {
            panic!("{:?}", map.people)
        };
        assert_eq!(ana.name, "ana");
        assert!((ana.place[2] - 0.5).abs() < 1e-12);
        assert_eq!(ana.interacting, ["bob"]);
    }

    #[test]
    fn an_empty_graph_is_an_empty_map() {
        let graph = Graph::in_memory(Schema::open());
        let map = Map::of(&graph.snapshot()).unwrap();
        assert!(map.people.is_empty() && map.walls.is_empty());
    }
}
