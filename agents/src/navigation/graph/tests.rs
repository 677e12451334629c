//! Navigation on the graph: steps are carried out, resumed and reported.

mod map_age;
mod people;
mod places;

use super::people::ASKING;
use super::*;
use crate::grid::{BLOCKED, CostGrid};
use crate::navigation::control::{Motion, Unicycle};
use crate::navigation::obstacles::Wall;
use crate::navigation::people::Person;
use crate::navigation::testing::{odometry, scan};
use dsr::{Graph, Refusal, RuleEngine, Schema};
use nalgebra::{Isometry2, Vector2, distance};
use std::f64::consts::PI;
use std::sync::Arc;

const TICK: f64 = 0.1;

const SCHEMA: &str = include_str!("tests/schema.toml");

/// The rules, as far as their effects go.
#[derive(Debug)]
struct Rules;

impl RuleEngine for Rules {
    fn expand(
        &self,
        snapshot: &Snapshot,
        rule: &str,
        binding: &[(String, NodeId)],
    ) -> Result<Vec<Operation>, Refusal> {
        let refuse = |reason: &str| Refusal::RuleNotApplicable {
            rule: rule.to_owned(),
            reason: reason.to_owned(),
        };
        let node = |variable: &str| {
            let found = binding.iter().find(|(name, _)| name == variable);
            found.map(|(_, id)| *id).ok_or_else(|| refuse(variable))
        };
        let mut work = Transaction::new();
        match rule {
            "changeRoom" => {
                let label = snapshot.schema().find_label("in").unwrap();
                let key = dsr::EdgeKey {
                    from: node("robot")?,
                    label,
                    to: node("room1")?,
                };
                if snapshot.find_edge(key).unwrap().is_none() {
                    return Err(refuse("robot is not in room1"));
                }
                work.delete_edge(node("robot")?, "in", node("room1")?);
                work.create_edge(node("robot")?, "in", node("room2")?);
            }
            "approach" => work.create_edge(node("robot")?, "is_near", node("p")?),
            "takeTheAttention" => work.create_edge(node("p")?, "front", node("robot")?),
            "askForPermission" => work.create_edge(node("p")?, "allows", node("robot")?),
            "letPass" => work.create_edge(node("p")?, "passed", node("robot")?),
            "wait" => work.create_edge(node("p")?, "in", node("room")?),
            "escort" => work.create_edge(node("p")?, "in", node("room2")?),
            "follow" => work.create_edge(node("robot")?, "followed", node("p")?),
            "goToObject" => work.create_edge(node("robot")?, "before", node("object")?),
            "approachGroup" => work.create_edge(node("robot")?, "joined", node("group")?),
            "goToPlace" | "goToPose" => work.create_edge(node("robot")?, "at", node("place")?),
            _ => return Err(refuse("no such rule")),
        }
        Ok(work.operations)
    }
}

/// Two rooms of 5 m by 4 m side by side with a door of 1 m between them, a robot in the left one.
struct Home {
    graph: Graph,
    robot: Unicycle,
    navigation: Navigation,
    now: Time,
    walls: Vec<Wall>,
    grid: CostGrid,
    speeches: Vec<Speech>,
    /// Refused transactions.
    refused: Vec<Refusal>,
}

impl Home {
    fn new() -> Self {
        let walls = [
            [0.0, 0.0, 10.0, 0.0],
            [10.0, 0.0, 10.0, 4.0],
            [10.0, 4.0, 0.0, 4.0],
            [0.0, 4.0, 0.0, 0.0],
            [5.0, 0.0, 5.0, 1.5],
            [5.0, 2.5, 5.0, 4.0],
        ];
        let mut graph = Graph::in_memory(Schema::from_toml("test.toml", SCHEMA).unwrap());
        graph.set_rules(Arc::new(Rules));
        let mut work = Transaction::new();
        let number = |name: &str, value: f64| (name.to_owned(), Value::F64(value));
        let list = |name: &str, value: Vec<f64>| (name.to_owned(), Value::F64List(value));
        work.create_node("world", "home", vec![list("walls", walls.concat())]);
        let square = |x: f64| list("polygon", vec![x, 0.0, x + 5.0, 0.0, x + 5.0, 4.0, x, 4.0]);
        work.create_node("room", "left", vec![square(0.0)]);
        work.create_node("room", "right", vec![square(5.0)]);
        work.push(Operation::CreateEdge {
            edge: EdgeRef::new("right", "connected", "left"),
            attributes: vec![("door".to_owned(), Value::Vector(vec![5.0, 2.0]))],
        });
        let body = vec![
            number("radius", 0.25),
            number("max_speed", 0.6),
            number("max_turn", 1.0),
        ];
        work.create_node("robot", "shelly", body);
        work.create_edge("shelly", "in", "left");
        let robot = Unicycle {
            position: Point2::new(1.0, 1.0),
            heading: PI,
            motion: Motion::default(),
        };
        let walls: Vec<Wall> = walls
            .iter()
            .map(|&[ax, ay, bx, by]| [Point2::new(ax, ay), Point2::new(bx, by)])
            .collect();
        let mut grid = CostGrid::covering([0.0, 0.0, 10.0, 4.0], 0.1);
        let mut obstacles = crate::navigation::obstacles::Obstacles::new();
        for &wall in &walls {
            obstacles.push_wall(wall);
        }
        for k in 0..grid.costs.len() {
            if obstacles.clearance(grid.centre((k % grid.width, k / grid.width))) < 0.25 {
                grid.costs[k] = BLOCKED;
            }
        }
        let now = Time::from_seconds(1_800_000_000.0);
        let mut home = Self {
            graph,
            robot,
            navigation: Navigation::default(),
            now,
            walls,
            grid,
            speeches: Vec::new(),
            refused: Vec::new(),
        };
        home.commit(&work);
        home
    }

    fn commit(&mut self, transaction: &Transaction) {
        self.graph.commit(transaction, "test", self.now).unwrap();
    }

    fn person(&mut self, x: f64, y: f64, heading: f64) {
        let mut work = Transaction::new();
        let snapshot = self.graph.snapshot();
        if snapshot.find_node_by_name("ana").unwrap().is_none() {
            work.create_node(
                "person",
                "ana",
                vec![("radius".to_owned(), Value::F64(0.25))],
            );
        }
        let pose = planar_pose(&Isometry2::new(Vector2::new(x, y), heading));
        work.push(Operation::CreateEdge {
            edge: EdgeRef::new("home", "pose", "ana"),
            attributes: vec![("transform".to_owned(), Value::Pose(pose))],
        });
        self.commit(&work);
    }

    fn dispatch(&mut self, rule: &str, binding: &str) {
        let mut work = Transaction::new();
        let text = |name: &str, value: &str| (name.to_owned(), Value::String(value.to_owned()));
        let attributes = vec![
            text("rule", rule),
            text("agent", "navigation"),
            text("status", "dispatched"),
            text("binding", binding),
            ("index".to_owned(), Value::U64(0)),
        ];
        work.create_node("step", "step0", attributes);
        self.commit(&work);
    }

    fn tick(&mut self) -> Effects {
        let people: Vec<Person> = read::world(&self.graph.snapshot(), self.now)
            .unwrap()
            .unwrap()
            .people;
        let scan = scan(self.now, &self.robot, &people, &self.walls);
        let odometry = odometry(self.now, &self.robot);
        let messages = Messages {
            odometry: Some(&odometry),
            scan: Some(&scan),
            grid: Some(&self.grid),
        };
        let effects = self
            .navigation
            .step(self.now, &messages, &self.graph.snapshot())
            .unwrap();
        for transaction in &effects.transactions {
            self.refused
                .extend(self.graph.commit(transaction, "navigation", self.now).err());
        }
        self.speeches.extend(effects.speech.clone());
        let motion = Motion {
            linear: effects.command.linear,
            lateral: effects.command.lateral,
            angular: effects.command.angular,
        };
        self.robot = self.robot.advanced(motion, TICK);
        self.now = self.now + TICK;
        effects
    }

    fn run(&mut self, seconds: f64) {
        (0..(seconds / TICK) as usize).for_each(|_| drop(self.tick()));
    }

    fn text(&self, node: &str, attribute: &str) -> Option<String> {
        let snapshot = self.graph.snapshot();
        let node = snapshot.find_node_by_name(node).unwrap().unwrap();
        node.value(attribute)
            .unwrap()
            .map(|value| value.as_str().unwrap().to_owned())
    }

    fn status(&self) -> String {
        self.text("step0", "status").unwrap()
    }

    fn has(&self, from: &str, label: &str, to: &str) -> bool {
        let snapshot = self.graph.snapshot();
        let id = |name| snapshot.find_node_by_name(name).unwrap().unwrap().id();
        let label = snapshot.schema().find_label(label).unwrap();
        let key = dsr::EdgeKey {
            from: id(from),
            label,
            to: id(to),
        };
        snapshot.find_edge(key).unwrap().is_some()
    }
}

const CHANGE_ROOM: &str = r#"{"robot":"shelly","room1":"left","room2":"right"}"#;

#[test]
fn change_room_drives_through_the_door_and_applies_the_rule() {
    let mut home = Home::new();
    home.dispatch("changeRoom", CHANGE_ROOM);
    home.tick();
    assert_eq!(home.status(), "running");
    home.run(25.0);
    assert_eq!(home.status(), "done");
    assert!(home.has("shelly", "in", "right") && !home.has("shelly", "in", "left"));
    assert!(home.robot.position.x > 5.0 + INSIDE);
    assert_eq!(home.refused, []);
    // The graph knows where the robot stands, that it stands, and that it is on no path.
    let snapshot = home.graph.snapshot();
    let shelly = snapshot.find_node_by_name("shelly").unwrap().unwrap();
    let pose = snapshot.world_from(shelly.id()).unwrap().unwrap();
    assert!((pose.translation.vector - home.robot.position.coords).norm() <= MOVED + 1e-9);
    assert_eq!(
        shelly.value("path").unwrap(),
        Some(Value::F64List(Vec::new()))
    );
    let speed = shelly
        .value("velocity")
        .unwrap()
        .unwrap()
        .as_f64s()
        .unwrap()[0];
    assert!(speed.abs() <= CHANGED);
}

#[test]
fn the_band_has_a_bubble_at_each_point_and_lies_along_the_planned_path() {
    let mut home = Home::new();
    home.dispatch("changeRoom", CHANGE_ROOM);
    home.run(4.0);
    let list = |name: &str| -> Vec<f64> {
        let snapshot = home.graph.snapshot();
        let shelly = snapshot.find_node_by_name("shelly").unwrap().unwrap();
        let value = shelly.value(name).unwrap().unwrap();
        value.as_f64s().unwrap().to_vec()
    };
    let [path, bubbles, planned] = ["path", BUBBLES, PLANNED_PATH].map(list);
    assert!(path.len() > 4 && bubbles.len() == path.len() / 2);
    assert!(bubbles.iter().all(|radius| *radius > 0.0), "{bubbles:?}");
    // Both end where the robot is to be.
    assert_eq!(planned[planned.len() - 2..], path[path.len() - 2..]);
    assert!(planned[0] < path[0], "the robot has gone a part of the way");
    home.run(21.0);
    assert_eq!(home.status(), "done");
    let snapshot = home.graph.snapshot();
    let shelly = snapshot.find_node_by_name("shelly").unwrap().unwrap();
    for name in [BUBBLES, PLANNED_PATH] {
        let value = shelly.value(name).unwrap().unwrap();
        assert_eq!(value, Value::F64List(Vec::new()), "{name}");
    }
}

#[test]
fn a_navigation_started_anew_resumes_the_running_step_from_the_graph() {
    let mut home = Home::new();
    home.dispatch("changeRoom", CHANGE_ROOM);
    home.run(5.0);
    assert_eq!(home.status(), "running");
    // Also when it dies past the door, before the rule was applied.
    while home.robot.position.x < 5.1 {
        home.navigation = Navigation::default();
        home.run(2.0);
    }
    home.navigation = Navigation::default();
    home.run(5.0);
    assert_eq!(home.status(), "done");
    assert!(home.has("shelly", "in", "right"));
}

#[test]
fn approach_ends_in_front_of_the_person_and_facing_them() {
    let mut home = Home::new();
    home.person(3.5, 3.0, PI);
    home.dispatch("approach", r#"{"robot":"shelly","p":"ana"}"#);
    home.run(3.0);
    // Ana moves on meanwhile, and the robot goes to where she is now.
    home.person(3.5, 1.5, PI);
    home.run(20.0);
    assert_eq!(home.status(), "done");
    assert!(home.has("shelly", "is_near", "ana"));
    let ana = Point2::new(3.5, 1.5);
    let far = distance(&ana, &home.robot.position);
    assert!((1.18..1.5).contains(&far), "{far}");
    assert!((home.robot.position.y - 1.5).abs() < 0.3 && home.robot.position.x < 3.0);
    let way = ana - home.robot.position;
    assert!(wrapped(way.y.atan2(way.x) - home.robot.heading).abs() < 0.3);
}

#[test]
fn attention_is_asked_for_until_the_person_turns() {
    let mut home = Home::new();
    home.person(2.4, 1.0, 0.0);
    home.dispatch("takeTheAttention", r#"{"robot":"shelly","p":"ana"}"#);
    home.run(7.0);
    assert_eq!(
        (home.status().as_str(), home.speeches.len()),
        ("running", 3)
    );
    assert_eq!(home.speeches[0].toward, Point2::new(2.4, 1.0));
    assert!(
        wrapped(home.robot.heading).abs() < 0.2,
        "the robot faces her"
    );
    home.person(2.4, 1.0, PI - 0.5);
    home.run(0.5);
    assert_eq!(home.status(), "done");
    assert!(home.has("ana", "front", "shelly"));
    assert_eq!(home.speeches.len(), 3);
}

#[test]
fn who_never_turns_fails_the_step() {
    let mut home = Home::new();
    home.person(2.4, 1.0, 0.0);
    home.dispatch("takeTheAttention", r#"{"robot":"shelly","p":"ana"}"#);
    home.run(ASKING + 1.0);
    assert_eq!(home.status(), "failed");
    assert_eq!(
        home.text("step0", "reason").unwrap(),
        "ana did not turn to the robot"
    );
}

#[test]
fn a_place_is_driven_to_and_can_be_once_more_when_dispatched_again() {
    let mut home = Home::new();
    let mut work = Transaction::new();
    work.create_node("place", "window", vec![]);
    let pose = planar_pose(&Isometry2::new(Vector2::new(3.0, 3.0), 0.0));
    work.push(Operation::CreateEdge {
        edge: EdgeRef::new("home", "pose", "window"),
        attributes: vec![("transform".to_owned(), Value::Pose(pose))],
    });
    home.commit(&work);
    home.dispatch("goToPlace", r#"{"robot":"shelly","place":"window"}"#);
    for start in [
        home.robot,
        Unicycle {
            position: Point2::new(4.0, 1.0),
            ..home.robot
        },
    ] {
        home.robot = start;
        home.run(15.0);
        assert_eq!(home.status(), "done");
        assert!(distance(&home.robot.position, &Point2::new(3.0, 3.0)) < 0.2);
        assert!(home.has("shelly", "at", "window"));
        let mut work = Transaction::new();
        work.set("step0", "status", "dispatched");
        home.commit(&work);
    }
}

#[test]
fn a_step_that_makes_no_sense_fails_with_the_reason() {
    for (rule, binding, reason) in [
        (
            "changeRoom",
            "left",
            "the step's binding is not a JSON object of node names",
        ),
        (
            "changeRoom",
            r#"{"room2":"cellar"}"#,
            "`changeRoom` is bound to no other room",
        ),
        (
            "approach",
            r#"{"p":"nobody"}"#,
            "`approach` is bound to no person",
        ),
        (
            "goToPlace",
            r#"{"place":"left"}"#,
            "`goToPlace` is bound to no place",
        ),
        (
            "sing",
            r#"{"p":"shelly"}"#,
            "navigation does not know how to carry out `sing`",
        ),
    ] {
        let mut home = Home::new();
        home.dispatch(rule, binding);
        home.run(0.5);
        assert_eq!(home.status(), "failed");
        assert_eq!(home.text("step0", "reason").unwrap(), reason);
        assert_eq!(home.robot.position, Point2::new(1.0, 1.0));
    }
}

#[test]
fn a_rule_that_the_store_does_not_apply_fails_the_step() {
    let mut home = Home::new();
    home.dispatch(
        "changeRoom",
        r#"{"robot":"shelly","room1":"right","room2":"right"}"#,
    );
    home.run(30.0);
    assert_eq!(home.status(), "failed");
    let refusals = home.refused.iter();
    assert!(
        refusals
            .clone()
            .all(|r| matches!(r, Refusal::RuleNotApplicable { .. }))
    );
    assert!((2..8).contains(&refusals.count()));
    let reason = home.text("step0", "reason").unwrap();
    assert_eq!(
        reason,
        "`changeRoom` was carried out, and could not be applied"
    );
}

#[test]
fn the_room_is_corrected_where_no_step_explains_it() {
    let mut home = Home::new();
    home.robot.position = Point2::new(5.1, 2.0);
    home.run(2.0);
    assert!(
        home.has("shelly", "in", "left"),
        "on the threshold it is not plain"
    );
    home.robot.position = Point2::new(7.0, 2.0);
    home.run(0.3);
    assert!(home.has("shelly", "in", "left"), "not at the first glance");
    home.run(1.0);
    assert!(home.has("shelly", "in", "right") && !home.has("shelly", "in", "left"));
}

#[test]
fn a_graph_without_a_robot_moves_nothing() {
    let graph = Graph::in_memory(Schema::from_toml("test.toml", SCHEMA).unwrap());
    let effects = Navigation::default()
        .step(Time::default(), &Messages::default(), &graph.snapshot())
        .unwrap();
    assert_eq!(
        (effects.transactions.len(), effects.status),
        (0, Status::Idle)
    );
    assert_eq!(effects.command.linear.to_bits(), 0.0f64.to_bits());
}
