//! The recogniser on a graph in memory.

use super::*;
use crate::perception::synthetic::{Errors, edges, home, names as nodes, place};
use dsr::{Graph, Operation, Transaction};

const AGENT: &str = "object_recognition";
const EXACT: Errors = Errors {
    position: 0.0,
    heading: 0.0,
    miss: 0.0,
    clutter: 0.0,
};

struct Home {
    graph: Graph,
    agent: ObjectRecognition,
    run: Run,
    errors: Errors,
    time: f64,
}

impl Home {
    fn new(errors: Errors) -> Self {
        let agent = ObjectRecognition::new(Config::default());
        Self {
            graph: home(),
            agent,
            run: Run::new(1),
            errors,
            time: 0.0,
        }
    }

    /// Steps for `seconds`, each committed; all that was written.
    fn go(&mut self, seconds: f64, things: &[Thing]) -> Vec<Operation> {
        let mut written = Vec::new();
        for _ in 0..(seconds / PERIOD).round() as u32 {
            self.time += PERIOD;
            let now = Time::from_seconds(self.time);
            let mut frames = self.run.cameras.clone();
            for frame in &mut frames {
                frame.time = now;
                let (plan, random) = (&self.run.plan, &mut self.run.random);
                look_at_things(frame, PERIOD, things, plan, self.errors, random);
            }
            let transaction = self
                .agent
                .step(now, &frames, &self.graph.snapshot())
                .unwrap();
            self.graph.commit(&transaction, AGENT, now).unwrap();
            written.extend(transaction.operations);
        }
        written
    }

    fn load(&mut self, world: &Transaction) {
        self.graph
            .commit(world, "loader", Time::from_seconds(self.time))
            .unwrap();
    }

    fn objects(&self) -> Vec<String> {
        nodes(&self.graph.snapshot(), "object")
    }

    fn pose_of(&self, name: &str) -> Isometry2<f64> {
        let snapshot = self.graph.snapshot();
        let node = snapshot.find_node_by_name(name).unwrap().unwrap();
        snapshot.world_from(node.id()).unwrap().unwrap()
    }
}

#[test]
fn objects_appear_with_type_pose_and_room_and_are_written_only_when_they_change() {
    let mut home = Home::new(EXACT);
    let things = [
        thing("table", None, -2.0, 0.0),
        thing("tv", Some("television"), 2.0, 0.0),
        thing("samovar", None, 0.5, 2.0),
    ];
    home.go(2.0, &things);
    assert_eq!(home.objects(), ["samovar_1", "table_1", "television"]);
    let snapshot = home.graph.snapshot();
    assert_eq!(
        (
            nodes(&snapshot, "tv").len(),
            nodes(&snapshot, "table").len()
        ),
        (1, 1)
    );
    let rooms = [
        ("samovar_1", "east"),
        ("table_1", "west"),
        ("television", "east"),
    ];
    let rooms = rooms.map(|(object, room)| (object.to_owned(), room.to_owned()));
    assert_eq!(edges(&snapshot, "in"), rooms);
    let television = things[1].pose.inv_mul(&home.pose_of("television"));
    assert!(
        television.translation.vector.norm() < 0.01 && television.rotation.angle().abs() < 0.02
    );

    let written = home.go(1.0, &things);
    let only_last_seen = written
        .iter()
        .all(|o| matches!(o, Operation::SetAttribute { name, .. } if name == "last_seen"));
    assert!(
        only_last_seen && (3..=6).contains(&written.len()),
        "{written:?}"
    );
}

#[test]
fn a_described_object_is_moved_and_never_deleted_and_its_name_not_given_again() {
    let mut home = Home::new(EXACT);
    let mut world = Transaction::new();
    let shape = ("shape".to_owned(), "circle".into());
    world.create_node("tv", "television", vec![shape.clone()]);
    world.create_node("table", "table_1", vec![shape]);
    // The television hangs from the robot, which stands at (0, -3).
    place(&mut world, "shelly", "television", Isometry2::identity());
    home.load(&world);
    home.go(
        2.0,
        &[
            thing("tv", Some("television"), 1.0, 1.0),
            thing("table", None, -2.0, 1.0),
        ],
    );
    assert_eq!(home.objects(), ["table_1", "table_2", "television"]);
    let television = home.pose_of("television").translation.vector;
    assert!((television - Vector2::new(1.0, 1.0)).norm() < 0.01);
    let pose_edges = edges(&home.graph.snapshot(), "pose");
    assert!(pose_edges.contains(&("shelly".to_owned(), "television".to_owned())));
    home.go(15.0, &[]);
    assert_eq!(
        home.objects(),
        ["table_1", "television"],
        "the table made here is gone"
    );

    // The same after a restart in the middle.
    home.go(2.0, &[thing("table", None, -2.0, 1.0)]);
    home.agent = ObjectRecognition::new(Config::default());
    home.go(1.0, &[thing("table", None, -2.0, 1.0)]);
    assert_eq!(home.objects(), ["table_1", "table_3", "television"]);
    home.agent = ObjectRecognition::new(Config::default());
    home.go(15.0, &[]);
    assert_eq!(home.objects(), ["table_1", "television"]);
}

#[test]
fn noise_doubles_nothing_over_restarts() {
    let mut home = Home::new(USUAL);
    let things = [
        thing("table", None, -2.0, 0.0),
        thing("table", None, -2.0, 1.5),
        thing("tv", Some("television"), 2.0, 0.0),
    ];
    home.go(3.0, &things);
    for restart in 0..5 {
        home.agent = ObjectRecognition::new(Config::default());
        home.time += f64::from(restart);
        home.go(3.0, &things);
        assert_eq!(
            home.objects(),
            ["table_1", "table_2", "television"],
            "restart {restart}"
        );
    }
    for truth in &things {
        let off = home.objects().into_iter().map(|name| {
            (home.pose_of(&name).translation.vector - truth.pose.translation.vector).norm()
        });
        assert!(off.fold(f64::INFINITY, f64::min) < 0.06);
    }
}

#[test]
fn an_identity_that_names_something_else_is_not_written() {
    let mut home = Home::new(EXACT);
    home.go(1.0, &[thing("table", Some("shelly"), 1.0, 1.0)]);
    assert_eq!(home.objects(), [""; 0]);
    assert_eq!(
        home.pose_of("shelly").translation.vector,
        Vector2::new(0.0, -3.0)
    );
}

#[test]
fn an_object_changes_rooms_with_its_place() {
    let mut home = Home::new(EXACT);
    let room = |home: &Home| edges(&home.graph.snapshot(), "in")[0].1.clone();
    home.go(1.0, &[thing("tv", Some("television"), 1.0, 1.0)]);
    assert_eq!(room(&home), "east");
    home.go(1.0, &[thing("tv", Some("television"), -1.0, 1.0)]);
    assert_eq!(room(&home), "west");
    assert_eq!(edges(&home.graph.snapshot(), "in").len(), 1);
}

#[test]
fn places_survive_a_restart_and_answer_where_something_is() {
    let mut home = Home::new(EXACT);
    let at = |x| thing("mug", Some("mug_of_ana"), x, 0.0);
    home.go(3.0, &[at(-2.0)]);
    home.time += 3600.0;
    home.go(3.0, &[at(2.0)]);
    let answer = |home: &Home| {
        let snapshot = home.graph.snapshot();
        let found = whereabouts(&snapshot, "mug_of_ana").unwrap().unwrap();
        let row = |w: &Whereabouts| (w.room.clone().unwrap(), w.place.visits);
        let sum: f64 = found.iter().map(|w| w.place.probability).sum();
        assert!(sum <= 1.0, "{found:?}");
        found.iter().map(row).collect::<Vec<_>>()
    };
    let told = |rows: [(&str, u32); 2]| rows.map(|(room, visits)| (room.to_owned(), visits));
    assert_eq!(answer(&home), told([("east", 1), ("west", 1)]));
    let learned = home.agent.objects()[0].stay.unwrap();
    assert!(learned < Config::default().memory.stay, "it was carried on");
    home.agent = ObjectRecognition::new(Config::default());
    home.go(PERIOD, &[]);
    assert_eq!(answer(&home), told([("east", 1), ("west", 1)]));
    assert_eq!(home.agent.objects()[0].stay, Some(learned));
    // Looked for where it was seen last, but not where it was before, and not found.
    home.run.cameras.truncate(1);
    home.run.cameras[0].range = 5.0;
    home.go(12.0, &[]);
    assert_eq!(answer(&home)[0].0, "west");
    let snapshot = home.graph.snapshot();
    assert_eq!(whereabouts(&snapshot, "teapot").unwrap(), None);
}

#[test]
fn a_class_stands_for_all_its_objects_and_an_object_without_memory_is_at_its_pose() {
    let mut home = Home::new(EXACT);
    let mut world = Transaction::new();
    world.create_node("tv", "television", Vec::new());
    let pose = Isometry2::new(Vector2::new(1.0, 1.0), 0.5);
    place(&mut world, "world", "television", pose);
    home.load(&world);
    home.go(2.0, &[thing("samovar", None, -2.0, 0.0)]);
    let found = |what| whereabouts(&home.graph.snapshot(), what).unwrap().unwrap();
    assert_eq!(found("samovar")[0].object, "samovar_1");
    let tv = &found("tv")[0];
    assert_eq!((tv.object.as_str(), tv.place.pose), ("television", pose));
    assert!((tv.place.probability - 1.0).abs() < 1e-12);
}
