//! The observer on a graph in memory.

use super::*;
use crate::perception::graph::number;
use crate::perception::synthetic::{edges, home, names, place};
use dsr::{EdgeRef, Graph, Operation, Transaction};

const AGENT: &str = "human_observer";
const EXACT: Errors = Errors {
    position: 0.0,
    heading: 0.0,
    miss: 0.0,
    clutter: 0.0,
};

/// An observer, its cameras and the graph that it writes to.
struct Home {
    graph: Graph,
    agent: HumanObserver,
    run: Run,
    time: f64,
}

impl Home {
    fn new(errors: Errors) -> Self {
        let mut run = Run::new(corners(9.0), 1);
        run.errors = errors;
        let agent = HumanObserver::new(Config::default());
        Self {
            graph: home(),
            agent,
            run,
            time: 0.0,
        }
    }

    /// One step with people at these places; the transaction that it wants.
    fn step(&mut self, people: &[Isometry2<f64>]) -> Transaction {
        self.time += PERIOD;
        let frames = self.run.frames(self.time, &|_| {
            people.iter().copied().map(Some).collect::<Vec<_>>()
        });
        let now = Time::from_seconds(self.time);
        self.agent
            .step(now, &frames, &self.graph.snapshot())
            .unwrap()
    }

    /// Steps for `seconds`, each committed.
    fn go(&mut self, seconds: f64, people: &[Isometry2<f64>]) {
        for _ in 0..(seconds / PERIOD).round() as u32 {
            let transaction = self.step(people);
            self.commit(AGENT, &transaction);
        }
    }

    fn commit(&mut self, agent: &str, transaction: &Transaction) {
        self.graph
            .commit(transaction, agent, Time::from_seconds(self.time))
            .unwrap();
    }

    fn edges(&self, label: &str) -> Vec<(String, String)> {
        edges(&self.graph.snapshot(), label)
    }

    fn people(&self) -> Vec<String> {
        names(&self.graph.snapshot(), "person")
    }
}

fn edge(from: &str, to: &str) -> (String, String) {
    (from.to_owned(), to.to_owned())
}

#[test]
fn people_appear_with_pose_room_and_attributes_and_move() {
    let mut home = Home::new(USUAL);
    home.go(1.0, &[pose(-2.0, 1.0, 0.5)]);
    assert_eq!(home.people(), ["person_1"]);
    assert_eq!(home.edges("in"), [edge("person_1", "west")]);
    let read = |home: &Home| people(&home.graph.snapshot()).unwrap().remove(0);
    let person = read(&home);
    assert!((person.position() - Point2::new(-2.0, 1.0)).norm() < 0.2);
    assert!(home.time - person.last_seen.seconds() < 0.6);
    assert!(person.covariance[0] > 0.0 && person.confidence > 0.9);
    let snapshot = home.graph.snapshot();
    let node = snapshot.find_node_by_name("person_1").unwrap().unwrap();
    assert_eq!(number(&node, "radius").unwrap(), Some(0.25));

    for step in 1..=45 {
        let x = -2.0 + 1.0 * f64::from(step) * PERIOD;
        home.go(PERIOD, &[pose(x, 1.0, 0.0)]);
    }
    let person = read(&home);
    assert!(
        (person.position() - Point2::new(1.0, 1.0)).norm() < 0.2,
        "{person:?}"
    );
    assert!(
        (person.velocity - Vector2::new(1.0, 0.0)).norm() < 0.3,
        "{person:?}"
    );
    assert_eq!(home.edges("in"), [edge("person_1", "east")]);
}

#[test]
fn nothing_is_written_while_nothing_changes() {
    let mut home = Home::new(EXACT);
    let still = [pose(-2.0, 1.0, 0.5), pose(2.0, 1.0, 1.0)];
    home.go(6.0, &still);
    let mut operations = Vec::new();
    for _ in 0..15 {
        let transaction = home.step(&still);
        operations.extend(transaction.operations.clone());
        home.commit(AGENT, &transaction);
    }
    let only_last_seen = operations
        .iter()
        .all(|o| matches!(o, Operation::SetAttribute { name, .. } if name == "last_seen"));
    assert!(only_last_seen, "{operations:?}");
    assert!(
        (2..=4).contains(&operations.len()),
        "every half second for two: {operations:?}"
    );
}

#[test]
fn the_dead_are_deleted_with_all_their_edges() {
    let mut home = Home::new(EXACT);
    home.go(2.0, &[pose(-0.5, -2.0, 0.0), pose(0.5, -2.0, PI)]);
    assert_eq!(
        home.edges("is_near"),
        [edge("shelly", "person_1"), edge("shelly", "person_2")]
    );
    let both = [edge("person_1", "person_2"), edge("person_2", "person_1")];
    assert_eq!(home.edges("interacting"), both);
    home.go(2.0, &[]);
    assert_eq!(home.people(), [""; 0]);
    assert_eq!(home.edges("is_near"), []);
    assert_eq!(home.edges("in"), []);
}

#[test]
fn somebody_interacts_with_an_object_of_the_graph() {
    let mut home = Home::new(EXACT);
    let mut world = Transaction::new();
    let size = ("size".to_owned(), [1.0, 1.0].into());
    world.create_node(
        "table",
        "desk",
        vec![("shape".to_owned(), "circle".into()), size],
    );
    place(&mut world, "world", "desk", pose(2.0, 2.0, 0.0));
    home.commit("loader", &world);
    home.go(2.0, &[pose(2.0, 1.2, PI / 2.0)]);
    assert_eq!(home.edges("interacting"), [edge("person_1", "desk")]);
    home.go(1.0, &[pose(2.0, 1.2, -PI / 2.0)]);
    assert_eq!(home.edges("interacting"), []);
}

#[test]
fn a_restarted_observer_goes_on_with_the_people_of_the_graph() {
    let mut home = Home::new(USUAL);
    home.go(2.0, &[pose(-2.0, 1.0, 0.0), pose(2.0, 1.0, 0.0)]);
    for pause in [0.0, 1.5, 4.0] {
        home.agent = HumanObserver::new(Config::default());
        home.time += pause;
        for _ in 0..30 {
            home.go(PERIOD, &[pose(-2.0, 1.0, 0.0), pose(2.0, 1.0, 0.0)]);
            assert_eq!(home.people(), ["person_1", "person_2"], "after {pause} s");
        }
        let seen = people(&home.graph.snapshot()).unwrap();
        assert!(
            seen.iter().all(|p| home.time - p.last_seen.seconds() < 0.6),
            "after {pause} s"
        );
    }
    home.go(
        1.0,
        &[
            pose(-2.0, 1.0, 0.0),
            pose(2.0, 1.0, 0.0),
            pose(0.0, 3.0, 0.0),
        ],
    );
    assert_eq!(home.people(), ["person_1", "person_2", "person_3"]);
}

#[test]
fn front_is_never_made_and_ends_two_seconds_after_turning_away() {
    let mut home = Home::new(EXACT);
    let before_the_robot = |heading: f64| [pose(1.5, -3.0, heading)];
    home.go(2.0, &before_the_robot(PI));
    assert_eq!(home.agent.scene().front, [1]);
    assert_eq!(home.edges("front"), [], "that is for the rule");
    let take_attention = |home: &mut Home| {
        let mut rule = Transaction::new();
        rule.create_edge("person_1", "front", "shelly");
        home.commit("navigation", &rule);
    };
    take_attention(&mut home);
    home.go(4.0, &before_the_robot(PI));
    assert_eq!(home.edges("front"), [edge("person_1", "shelly")]);
    home.go(1.8, &before_the_robot(0.0));
    assert_eq!(home.edges("front"), [edge("person_1", "shelly")]);
    home.go(1.0, &before_the_robot(0.0));
    assert_eq!(home.edges("front"), []);
    // Taken while the person looks away: two seconds to turn round.
    take_attention(&mut home);
    home.go(1.8, &before_the_robot(0.0));
    assert_eq!(home.edges("front"), [edge("person_1", "shelly")]);
    home.go(3.0, &before_the_robot(PI));
    assert_eq!(home.edges("front"), [edge("person_1", "shelly")]);
    home.go(3.0, &[pose(4.0, 3.0, PI)]);
    assert_eq!(home.edges("front"), [], "left");
}

#[test]
fn a_refused_transaction_is_made_again_and_foreign_people_are_left_alone() {
    let mut home = Home::new(EXACT);
    let mut world = Transaction::new();
    world.create_node("person", "maria", Vec::new());
    world.create_edge("maria", "in", "west");
    world.create_edge("shelly", "is_near", "maria");
    home.commit("loader", &world);
    for _ in 0..20 {
        home.step(&[pose(2.0, 1.0, 0.0)]);
    }
    home.go(PERIOD, &[pose(2.0, 1.0, 0.0)]);
    assert_eq!(home.people(), ["maria", "person_1"]);
    let mut world = Transaction::new();
    world.create_edge("person_1", "interacting", "maria");
    home.commit("therapist", &world);
    home.go(2.0, &[pose(2.0, 1.0, 0.0)]);
    home.go(3.0, &[]);
    assert_eq!(home.people(), ["maria"]);
    assert_eq!(home.edges("in"), [edge("maria", "west")]);
    assert_eq!(home.edges("is_near"), [edge("shelly", "maria")]);
}

#[test]
fn an_interaction_with_somebody_foreign_stays_theirs() {
    let mut home = Home::new(EXACT);
    home.go(1.0, &[pose(2.0, 1.0, 0.0)]);
    let mut world = Transaction::new();
    world.create_node("person", "maria", Vec::new());
    world.create_edge("person_1", "interacting", "maria");
    home.commit("therapist", &world);
    home.go(2.0, &[pose(2.0, 1.0, 0.0)]);
    assert_eq!(home.edges("interacting"), [edge("person_1", "maria")]);
}

#[test]
fn an_empty_graph_takes_nothing_and_loses_nobody() {
    let mut home = Home::new(EXACT);
    let furnished = std::mem::replace(&mut home.graph, Graph::in_memory(dsr::Schema::open()));
    home.go(1.0, &[pose(2.0, 1.0, 0.0)]);
    assert_eq!(home.graph.snapshot().node_count(), 0);
    home.graph = furnished;
    home.go(PERIOD, &[pose(2.0, 1.0, 0.0)]);
    assert_eq!(home.people(), ["person_1"]);
}

#[test]
fn a_damaged_pose_in_the_graph_is_written_over() {
    let mut home = Home::new(EXACT);
    home.go(1.0, &[pose(2.0, 1.0, 0.0)]);
    let mut wrong = Transaction::new();
    let edge = EdgeRef::new("world", "pose", "person_1");
    wrong.set_on_edge(edge, "transform", pose(5.0, 5.0, 0.0));
    wrong.set("person_1", "velocity", [9.0, 9.0]);
    home.commit("intruder", &wrong);
    home.go(PERIOD, &[pose(2.0, 1.0, 0.0)]);
    let person = people(&home.graph.snapshot()).unwrap().remove(0);
    assert!((person.position() - Point2::new(2.0, 1.0)).norm() < 0.02);
    assert!(person.velocity.norm() < 0.1);
}

#[test]
fn the_figures_of_the_world_are_taken_up_where_they_can_be_used() {
    for (settings, association) in [
        (
            r#"{"tracking":{"association":"nearest"}}"#,
            Association::Nearest,
        ),
        (
            r#"{"tracking":{"association":"nearest","position_noise":-1}}"#,
            Association::Evidence,
        ),
        ("none", Association::Evidence),
    ] {
        let mut home = Home::new(USUAL);
        let mut change = Transaction::new();
        change.set("world", SETTINGS, settings);
        home.commit("loader", &change);
        home.go(PERIOD, &[]);
        assert_eq!(
            home.agent.observer().config.association,
            association,
            "{settings}"
        );
    }
}
