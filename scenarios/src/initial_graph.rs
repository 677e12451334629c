//! What the shared graph says when a run begins: all that a centre's staff would enter beforehand.
//! Objects and people are not in it; the agents must perceive them.

use crate::scenario::{Activity, Door, Scenario};
use agents::human_observer::SETTINGS as OBSERVER_SETTINGS;
use agents::social_mapping::graph::{SCENARIO_SETTINGS, SETTINGS};
use dsr::{EdgeRef, Operation, Schema, SchemaFileError, Transaction, Value};
use nalgebra::{Isometry2, Point2};

/// The name of the one node of type `world`.
pub const WORLD: &str = "world";
/// A robot this near to a place is `at` it, m.
const AT_PLACE: f64 = 0.3;
const SCHEMA: &str = include_str!("schema.toml");

/// The vocabulary that all agents agree on.
///
/// # Errors
/// None as shipped, which a test holds.
pub fn schema() -> Result<Schema, SchemaFileError> {
    Schema::from_toml("schema.toml", SCHEMA)
}

/// The graph at the start: the world with walls and bounds, rooms and how they are connected,
/// places, cameras, the robot, activities. The world is social; a run without social behaviour
/// sets its attribute `social` to false.
pub fn initial_graph(scenario: &Scenario) -> Transaction {
    let mut graph = Transaction::new();
    let walls = scenario.walls.iter().flat_map(|wall| flat(wall)).collect();
    let mut world = vec![
        attribute("walls", Value::F64List(walls)),
        attribute("bounds", scenario.bounds),
        attribute("social", true),
        attribute("scenario", scenario.name.as_str()),
    ];
    // Figures that JSON cannot have are in no scenario.
    if let Ok(settings) = serde_json::to_string(&scenario.social) {
        world.push(attribute(SETTINGS, settings.as_str()));
        world.push(attribute(SCENARIO_SETTINGS, settings.as_str()));
    }
    if let Ok(settings) = serde_json::to_string(&scenario.human_observer) {
        world.push(attribute(OBSERVER_SETTINGS, settings.as_str()));
    }
    graph.create_node("world", WORLD, world);
    for room in &scenario.rooms {
        let polygon = Value::F64List(flat(&room.polygon));
        graph.create_node("room", &room.name, vec![attribute("polygon", polygon)]);
    }
    for door in &scenario.doors {
        connect(&mut graph, scenario, door);
    }
    for place in &scenario.places {
        graph.create_node("place", &place.name, Vec::new());
        put(&mut graph, scenario, &place.name, &place.pose);
    }
    for camera in &scenario.cameras {
        let attributes = vec![
            attribute("field_of_view", camera.field_of_view),
            attribute("range", camera.range),
        ];
        graph.create_node("camera", &camera.name, attributes);
        put(&mut graph, scenario, &camera.name, &camera.pose);
    }
    add_robot(&mut graph, scenario);
    for activity in &scenario.activities {
        graph.create_node("activity", &activity.name, activity_attributes(activity));
    }
    graph
}

/// What the graph says of an activity.
pub fn activity_attributes(activity: &Activity) -> Vec<(String, Value)> {
    vec![
        attribute("start", activity.start.seconds()),
        attribute("end", activity.end.seconds()),
        attribute("object", activity.object.as_str()),
        attribute("cancelled", activity.cancelled),
    ]
}

fn add_robot(graph: &mut Transaction, scenario: &Scenario) {
    let robot = &scenario.robot;
    let attributes = vec![
        attribute("radius", robot.radius),
        attribute("max_speed", robot.max_speed),
        attribute("max_turn", robot.max_turn),
        attribute("base", robot.base.name()),
        attribute("velocity", [0.0, 0.0]),
    ];
    graph.create_node("robot", &robot.name, attributes);
    put(graph, scenario, &robot.name, &robot.pose);
    let distance =
        |pose: &Isometry2<f64>| (pose.translation.vector - robot.pose.translation.vector).norm();
    if let Some(place) = scenario
        .places
        .iter()
        .find(|place| distance(&place.pose) < AT_PLACE)
    {
        graph.create_edge(robot.name.as_str(), "at", place.name.as_str());
    }
}

/// Places a node in the world, and in the room that it stands in.
fn put(graph: &mut Transaction, scenario: &Scenario, name: &str, pose: &Isometry2<f64>) {
    graph.push(Operation::CreateEdge {
        edge: EdgeRef::new(WORLD, "pose", name),
        attributes: vec![attribute("transform", *pose)],
    });
    if let Some(room) = scenario.find_room(pose.translation.vector.into()) {
        graph.create_edge(name, "in", room.name.as_str());
    }
}

/// Both ways through a door.
fn connect(graph: &mut Transaction, scenario: &Scenario, door: &Door) {
    let [one, other] = door.rooms.map(|at| &scenario.rooms[at]);
    let distance =
        (one.centroid() - door.position).norm() + (other.centroid() - door.position).norm();
    for (from, to) in [(one, other), (other, one)] {
        graph.push(Operation::CreateEdge {
            edge: EdgeRef::new(from.name.as_str(), "connected", to.name.as_str()),
            attributes: vec![
                attribute("distance", distance),
                attribute("door", [door.position.x, door.position.y]),
            ],
        });
    }
}

fn attribute(name: &str, value: impl Into<Value>) -> (String, Value) {
    (name.to_owned(), value.into())
}

fn flat(points: &[Point2<f64>]) -> Vec<f64> {
    points.iter().flat_map(|point| [point.x, point.y]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::CLASSES;
    use dsr::{Graph, Time};

    #[test]
    fn the_schema_is_sound_and_knows_every_class_of_object() {
        let schema = schema().expect("the schema as shipped");
        let object = schema.type_id("object").expect("objects");
        let mut names: Vec<_> = schema
            .subtypes(object)
            .iter()
            .map(|class| schema.type_name(*class))
            .collect();
        names.sort_unstable();
        let mut classes = CLASSES.to_vec();
        classes.sort_unstable();
        assert_eq!(names, classes);
    }

    #[test]
    fn a_graph_takes_the_scenario_and_shows_its_rooms_and_robot() {
        let text = r#"
name = "flat"
start = "2026-03-02T10:00:00"
duration = 60.0
[[room]]
name = "hall"
polygon = [[0, 0], [4, 0], [4, 3], [0, 3]]
[[room]]
name = "study"
polygon = [[4, 0], [8, 0], [8, 3], [4, 3]]
[[door]]
rooms = ["hall", "study"]
position = [4.0, 1.5]
width = 1.0
[[place]]
name = "dock"
pose = [1.0, 1.1, 0.0]
[[object]]
name = "screen"
class = "tv"
pose = [6.0, 2.8, -1.5708]
size = [0.1, 1.0]
[[camera]]
name = "eye"
pose = [7.9, 0.1, 2.4]
field_of_view = 1.6
range = 8.0
[robot]
pose = [1.0, 1.0, 0.5]
[[person]]
name = "ana"
pose = [2.0, 2.0, 0.0]
[[activity]]
name = "news"
object = "screen"
start = "10:05"
end = "10:30"
"#;
        let read = |_: &str| Ok(Vec::new());
        let scenario = Scenario::parse("scenario.toml", text, &read).expect("a good scenario");
        let mut graph = Graph::in_memory(schema().expect("the schema as shipped"));
        graph
            .commit(&initial_graph(&scenario), "world", Time::default())
            .expect("the graph takes it");
        let snapshot = graph.snapshot();
        let find = |name: &str| snapshot.find_node_by_name(name).expect("readable");
        let robot = find("robot").expect("the robot").id();
        let pose = snapshot
            .world_from(robot)
            .expect("readable")
            .expect("a pose");
        assert!((pose.rotation.angle() - 0.5).abs() < 1e-12);
        assert!(
            find("ana").is_none() && find("screen").is_none(),
            "these are to be perceived"
        );
        assert!(find("news").is_some() && find("eye").is_some());
        let edge = |from: &str, label: &str, to: &str| {
            let label = snapshot.schema().label_id(label).expect("a label");
            let (from, to) = (find(from)?.id(), find(to)?.id());
            snapshot
                .find_edge(dsr::EdgeKey { from, label, to })
                .expect("readable")
        };
        assert!(edge("robot", "in", "hall").is_some() && edge("robot", "at", "dock").is_some());
        for (from, to) in [("hall", "study"), ("study", "hall")] {
            let door = edge(from, "connected", to).expect("connected");
            assert_eq!(
                door.value("distance").expect("readable"),
                Some(Value::F64(4.0))
            );
        }
    }
}
