//! Social mapping on the graph: what is read, and what is written when.

use super::*;
use crate::grid::{BLOCKED, CostGrid, FREE};
use crate::social_mapping::object_space::Outline;
use crate::social_mapping::zones::Zone;
use dsr::{EdgeRef, Graph, Schema};
use nalgebra::{Isometry2, Vector2};
use std::f64::consts::PI;

mod people;
mod problems;

const NOON: f64 = 1_800_000_000.0;

const SCHEMA: &str = r#"
[types]
thing = []
world = ["thing"]
person = ["thing"]
robot = ["thing"]
object = ["thing"]
activity = ["thing"]
group = ["thing"]
room = ["thing"]
step = ["thing"]
table = ["object"]
tv = ["object"]
[labels]
pose = { from = ["thing"], to = ["thing"] }
interacting = { from = ["person"], to = ["person", "object"] }
uses = { from = ["activity"], to = ["object"] }
in = { from = ["person"], to = ["room"] }
member_of = { from = ["person"], to = ["group"] }
[attributes]
transform = { kind = "pose" }
bounds = { kind = "vector" }
walls = { kind = "f64_list" }
social = { kind = "bool" }
radius = { kind = "f64" }
velocity = { kind = "vector" }
shape = { kind = "string" }
size = { kind = "vector" }
start = { kind = "f64" }
end = { kind = "f64" }
object = { kind = "string" }
intimate_zone = { kind = "f64_list" }
personal_zone = { kind = "f64_list" }
social_zone = { kind = "f64_list" }
space = { kind = "f64_list" }
usage = { kind = "f64" }
extent = { kind = "vector" }
passages = { kind = "string" }
activity = { kind = "string" }
features = { kind = "string" }
task = { kind = "string" }
status = { kind = "string" }
rule = { kind = "string" }
binding = { kind = "string" }
cancelled = { kind = "bool" }
social_settings = { kind = "string" }
social_scenario_settings = { kind = "string" }
problems = { kind = "string" }
polygon = { kind = "f64_list" }
"#;

fn noon() -> Time {
    Time::from_seconds(NOON)
}

fn pose(x: f64, y: f64, heading: f64) -> Isometry2<f64> {
    Isometry2::new(Vector2::new(x, y), heading)
}

/// An in-memory graph and its world.
struct Centre(Graph);

impl Centre {
    /// A world of 12 m by 10 m with one inner wall, a robot, ana, bo and a table.
    fn new() -> Self {
        let mut centre = Self(Graph::in_memory(
            Schema::from_toml("test.toml", SCHEMA).unwrap(),
        ));
        let walls = Value::F64List(vec![0.0, 8.0, 12.0, 8.0]);
        centre.add(
            "world",
            "world",
            None,
            &[("bounds", [0.0, 0.0, 12.0, 10.0].into()), ("walls", walls)],
        );
        centre.add(
            "robot",
            "robot",
            Some(pose(1.0, 1.0, 0.0)),
            &[("radius", 0.25.into())],
        );
        centre.add("person", "ana", Some(pose(5.0, 5.0, 0.0)), &[]);
        centre.add(
            "person",
            "bo",
            Some(pose(7.0, 5.0, PI)),
            &[("radius", 0.3.into())],
        );
        let table = [("shape", "rectangle".into()), ("size", [2.0, 1.0].into())];
        centre.add("table", "table", Some(pose(3.0, 2.0, 0.0)), &table);
        centre
    }

    fn commit(&mut self, transaction: &Transaction) {
        self.0.commit(transaction, "test", noon()).unwrap();
    }

    fn add(
        &mut self,
        type_name: &str,
        name: &str,
        at: Option<Isometry2<f64>>,
        attributes: &[(&str, Value)],
    ) {
        let mut transaction = Transaction::new();
        let attributes = attributes
            .iter()
            .map(|(n, v)| ((*n).to_owned(), v.clone()))
            .collect();
        transaction.create_node(type_name, name, attributes);
        if at.is_some() {
            transaction.create_edge("world", "pose", name);
        }
        self.commit(&transaction);
        if let Some(at) = at {
            self.place(name, at);
        }
    }

    fn place(&mut self, name: &str, at: Isometry2<f64>) {
        let mut transaction = Transaction::new();
        transaction.set_on_edge(EdgeRef::new("world", "pose", name), "transform", at);
        self.commit(&transaction);
    }

    fn set(&mut self, name: &str, attribute: &str, value: impl Into<Value>) {
        let mut transaction = Transaction::new();
        transaction.set(name, attribute, value);
        self.commit(&transaction);
    }

    fn value(&self, name: &str, attribute: &str) -> Option<Value> {
        let snapshot = self.0.snapshot();
        snapshot
            .find_node_by_name(name)
            .unwrap()
            .unwrap()
            .value(attribute)
            .unwrap()
    }

    /// One turn, its transaction committed; what it wrote of people and objects, as node.attribute.
    fn turn(&mut self, agent: &mut SocialMapping, now: Time) -> (Turn, Vec<String>) {
        let snapshot = self.0.snapshot();
        let turn = agent.step(now, &snapshot).unwrap();
        let name = |owner: &Owner| match owner {
            Owner::Node(dsr::NodeRef::Id(id)) => {
                let name = snapshot.find_node(*id).unwrap().unwrap().name().unwrap();
                (!name.starts_with(GROUP)).then_some(name)
            }
            _ => None,
        };
        let operations = turn.transaction.operations.iter();
        let written = operations.filter_map(|operation| match operation {
            Operation::SetAttribute {
                owner,
                name: attribute,
                ..
            } => Some(format!("{}.{attribute}", name(owner)?)),
            Operation::RemoveAttribute {
                owner,
                name: attribute,
            } => Some(format!("-{}.{attribute}", name(owner)?)),
            _ => None,
        });
        let written = written.collect();
        self.commit(&turn.transaction);
        (turn, written)
    }
}

fn agent() -> SocialMapping {
    SocialMapping::new(SocialConfig::default(), 0.1).unwrap()
}

const POLYLINES: [&str; 6] = [
    "ana.intimate_zone",
    "ana.personal_zone",
    "ana.social_zone",
    "bo.intimate_zone",
    "bo.personal_zone",
    "bo.social_zone",
];

#[test]
fn the_scene_is_what_the_graph_says() {
    let mut centre = Centre::new();
    centre.add("person", "lost", None, &[]);
    centre.add(
        "activity",
        "therapy",
        None,
        &[
            ("start", NOON.into()),
            ("end", (NOON + 60.0).into()),
            ("object", "table".into()),
        ],
    );
    centre.add(
        "activity",
        "someday",
        None,
        &[("start", f64::NAN.into()), ("end", NOON.into())],
    );
    centre.add(
        "tv",
        "tv",
        Some(pose(0.0, 5.0, 0.0)),
        &[("shape", "circle".into()), ("size", [0.5, 0.4].into())],
    );
    let mut relate = Transaction::new();
    relate.create_edge("ana", "interacting", "bo");
    relate.create_edge("ana", "interacting", "table");
    relate.create_edge("therapy", "uses", "table");
    relate.create_edge("therapy", "uses", "tv");
    relate.set("ana", "velocity", [0.5, -0.1]);
    centre.commit(&relate);

    let scene = scene(&centre.0.snapshot(), &SocialConfig::default()).unwrap();
    assert_eq!(
        scene.bounds.map(f64::to_bits),
        [0.0, 0.0, 12.0, 10.0].map(f64::to_bits)
    );
    assert_eq!(
        scene.walls,
        [[Point2::new(0.0, 8.0), Point2::new(12.0, 8.0)]]
    );
    assert!((scene.robot_radius - 0.25).abs() < 1e-12 && scene.social);
    let people: Vec<_> = scene
        .people
        .iter()
        .map(|p| (p.name.as_str(), p.radius))
        .collect();
    assert_eq!(people, [("ana", 0.25), ("bo", 0.3)]);
    assert_eq!(scene.people[0].velocity, Vector2::new(0.5, -0.1));
    assert!((scene.people[1].world_from_person.rotation.angle().abs() - PI).abs() < 1e-9);
    assert_eq!(scene.interactions, [("ana".to_owned(), "bo".to_owned())]);
    let objects: Vec<_> = scene
        .objects
        .iter()
        .map(|o| (o.name.as_str(), o.class.as_str(), o.outline))
        .collect();
    assert_eq!(
        objects,
        [
            ("table", "table", Outline::Rectangle(Vector2::new(2.0, 1.0))),
            ("tv", "tv", Outline::Circle(0.25)),
        ]
    );
    let used: Vec<_> = scene
        .activities
        .iter()
        .map(|a| (a.object.as_str(), a.start))
        .collect();
    assert_eq!(used, [("table", noon()), ("tv", noon())]);
    assert_eq!(
        scene.rejected,
        [Rejection::ActivityTime {
            activity: "someday".into()
        }]
    );
}

#[test]
fn a_graph_that_tells_too_little_is_an_error_that_says_what_is_missing() {
    let report = |spoil: &dyn Fn(&mut Centre)| {
        let mut centre = Centre::new();
        spoil(&mut centre);
        agent()
            .step(noon(), &centre.0.snapshot())
            .unwrap()
            .stopped
            .unwrap()
            .to_string()
    };
    let gone = |name: &'static str| {
        move |centre: &mut Centre| {
            let mut transaction = Transaction::new();
            transaction.delete_node(name);
            centre.commit(&transaction);
        }
    };
    assert_eq!(report(&gone("world")), "the graph has no world yet");
    assert_eq!(report(&gone("robot")), "the graph has no robot yet");
    assert_eq!(
        report(&|centre| centre.set("world", "bounds", [0.0, 1.0])),
        "the attribute bounds of world must be four numbers: xmin, ymin, xmax, ymax",
    );
    assert_eq!(
        report(&|centre| centre.set("world", "walls", Value::F64List(vec![1.0; 6]))),
        "the attribute walls of world must be numbers x1, y1, x2, y2 for each wall",
    );
    assert_eq!(
        report(&|centre| centre.set("robot", "radius", f64::NAN)),
        "the robot's radius is NaN m, where it may be from 0 m to 10 m",
    );
}

#[test]
fn polylines_are_written_once_and_again_when_the_person_moved_or_turned_noticeably() {
    let (mut centre, mut agent) = (Centre::new(), agent());
    let mut now = noon();
    let mut turn = |centre: &mut Centre| {
        now = now + 0.1;
        centre.turn(&mut agent, now).1
    };
    let first = turn(&mut centre);
    assert_eq!(first[..6], POLYLINES);
    assert_eq!(first[6..], ["table.space", "table.usage"]);
    assert_eq!(turn(&mut centre), [""; 0]);
    centre.place("ana", pose(5.04, 5.0, 0.08));
    assert_eq!(turn(&mut centre), [""; 0]);
    // What counts is how far it is from where it was written, not from the turn before.
    centre.place("ana", pose(5.08, 5.0, 0.08));
    assert_eq!(turn(&mut centre), POLYLINES[..3]);
    centre.place("bo", pose(7.0, 5.0, -PI + 0.08));
    assert_eq!(turn(&mut centre), [""; 0]);
    centre.place("bo", pose(7.0, 5.0, -PI + 0.1));
    assert_eq!(turn(&mut centre), POLYLINES[3..]);

    let value = centre.value("ana", "personal_zone").unwrap();
    let row = value.as_f64s().unwrap();
    assert_eq!(row.len(), 48);
    let ana = pose(5.08, 5.0, 0.08);
    for point in row.as_chunks::<2>().0 {
        let density = SocialConfig::default()
            .proxemics
            .shape
            .density(&ana, (*point).into());
        assert!((density - 0.5).abs() < 1e-9);
    }
}

#[test]
fn usage_is_written_to_the_hundredth_and_reaches_both_ends() {
    let (mut centre, mut agent) = (Centre::new(), agent());
    centre.add(
        "activity",
        "therapy",
        None,
        &[
            ("start", (NOON + 2700.0).into()),
            ("end", (NOON + 3600.0).into()),
            ("object", "table".into()),
        ],
    );
    let mut writes = 0;
    for second in 0..=2700 {
        let (_, written) = centre.turn(&mut agent, noon() + f64::from(second));
        writes += usize::from(written.iter().any(|name| name == "table.usage"));
        if second == 0 {
            assert_eq!(centre.value("table", "usage"), Some(1.5.into()));
        }
    }
    assert_eq!(centre.value("table", "usage"), Some(3.5.into()));
    assert_eq!(writes, 201);
}

#[test]
fn the_grid_goes_out_when_it_changes() {
    let (mut centre, mut agent) = (Centre::new(), agent());
    let mut given =
        |centre: &mut Centre, after: f64| centre.turn(&mut agent, noon() + after).0.grid;
    let first = given(&mut centre, 0.0).unwrap();
    let cost = |grid: &CostGrid, x, y| grid.cost(grid.cell_at(Point2::new(x, y)).unwrap());
    assert!(cost(&first.grid, 6.0, 8.0).total_cmp(&BLOCKED).is_eq());
    assert!(cost(&first.grid, 10.05, 2.05).total_cmp(&FREE).is_eq());
    assert_eq!(first.dirty, first.grid.whole());
    assert_eq!(given(&mut centre, 0.5), None);
    assert_eq!(given(&mut centre, 1.0), None);
    centre.place("ana", pose(10.0, 2.0, 0.0));
    assert_eq!(
        given(&mut centre, 1.05),
        None,
        "the period is a tenth of a second"
    );
    let moved = given(&mut centre, 1.1).unwrap();
    let intimate = Zone::Intimate.cost();
    assert!(cost(&moved.grid, 10.05, 2.05).total_cmp(&intimate).is_eq());
    // From behind where ana was to ahead of where she is; the table's corner of the map is as it was.
    assert!(
        moved.dirty.columns.0 > 35 && moved.dirty.rows.1 < 70,
        "{moved:?}"
    );
    assert_eq!(given(&mut centre, 1.2), None);
}

#[test]
fn without_social_behaviour_the_polylines_go() {
    let (mut centre, mut agent) = (Centre::new(), agent());
    centre.turn(&mut agent, noon());
    centre.set("world", "social", false);
    let (_, written) = centre.turn(&mut agent, noon() + 0.1);
    let mut expected: Vec<String> = POLYLINES.iter().map(|name| format!("-{name}")).collect();
    expected.extend(["-table.space".to_owned(), "-table.usage".to_owned()]);
    assert_eq!(written, expected);
    assert_eq!(centre.value("ana", "social_zone"), None);
    assert_eq!(centre.turn(&mut agent, noon() + 0.2).1, [""; 0]);
}

#[test]
fn what_was_rejected_is_told_once() {
    let (mut centre, mut agent) = (Centre::new(), agent());
    centre.set("bo", "radius", -2.0);
    let told = |(turn, _): (Turn, Vec<String>)| turn.rejected;
    let report = Rejection::PersonRadius {
        name: "bo".into(),
        radius: -2.0,
    };
    assert_eq!(
        told(centre.turn(&mut agent, noon())),
        std::slice::from_ref(&report)
    );
    assert_eq!(told(centre.turn(&mut agent, noon() + 0.1)), []);
    centre.set("ana", "radius", 0.0);
    let second = told(centre.turn(&mut agent, noon() + 0.2));
    assert_eq!(
        second,
        [
            Rejection::PersonRadius {
                name: "ana".into(),
                radius: 0.0
            },
            report
        ]
    );
}
