//! The simulated world: the same to the bit, and true to its scenario.

mod sensing;

use super::*;
use crate::scenario::{Entry, Face, Stream};

/// Two rooms side by side with a door, a table, a seat, a camera in each.
const SCENARIO: &str = r#"
name = "two-rooms"
start = "2026-03-02T10:00:00"
duration = 60.0

[[room]]
name = "hall"
polygon = [[0, 0], [6, 0], [6, 5], [0, 5]]

[[room]]
name = "study"
polygon = [[6, 0], [12, 0], [12, 5], [6, 5]]

[[door]]
rooms = ["hall", "study"]
position = [6.0, 2.5]
width = 1.2

[[object]]
name = "desk"
class = "table"
pose = [9.0, 2.5, 0.0]
size = [1.6, 0.8]

[[object]]
name = "chair"
class = "seat"
pose = [9.0, 3.3, -1.57]
size = [0.5, 0.5]

[[camera]]
name = "west"
pose = [0.1, 0.1, 0.7]
field_of_view = 1.8
range = 9.0
false_rate = 0.5

[robot]
pose = [1.0, 2.5, 0.0]

[[person]]
name = "ana"
pose = [1.0, 4.5, 0.0]
speed = 1.0
schedule = [{ after = 1.0, go = "chair" }]

[[person]]
name = "ben"
pose = [11.0, 0.5, 3.1]
schedule = [{ at = "10:00:01", go = [3.0, 1.0], face = "ana" }]
"#;

pub(super) fn scenario() -> Scenario {
    let read = |_: &str| Ok(Vec::new());
    Scenario::parse("scenario.toml", SCENARIO, &read).expect("a good scenario")
}

fn run(world: &mut World, seconds: f64, command: Option<(f64, f64)>) -> Vec<Outputs> {
    let steps = (seconds / 0.05).round() as usize;
    (0..steps)
        .map(|_| {
            let time = world.time();
            let velocity = command.map(|(linear, angular)| VelocityCommand {
                time,
                linear,
                lateral: 0.0,
                angular,
            });
            world.step(
                0.05,
                &Inputs {
                    velocity,
                    speech: Vec::new(),
                },
            )
        })
        .collect()
}

fn person<'a>(truth: &'a Truth, name: &str) -> &'a Body {
    truth
        .people
        .iter()
        .find(|person| person.name == name)
        .expect("the person is there")
}

#[test]
fn the_same_seed_gives_the_same_world_to_the_bit_and_another_does_not() {
    let of = |seed| {
        run(
            &mut World::new(&scenario(), seed, None),
            10.0,
            Some((0.5, 0.1)),
        )
    };
    let first = of(1);
    assert_eq!(first, of(1));
    assert_ne!(first, of(2));
}

#[test]
fn sensors_measure_at_their_rates() {
    let outputs = run(&mut World::new(&scenario(), 1, None), 10.0, None);
    let count = |measured: fn(&Outputs) -> usize| -> usize { outputs.iter().map(measured).sum() };
    assert_eq!(count(|o| usize::from(o.scan.is_some())), 100);
    assert_eq!(count(|o| usize::from(o.odometry.is_some())), 100);
    assert_eq!(count(|o| o.frames.len()), 100);
}

#[test]
fn another_camera_changes_nothing_for_people_and_other_sensors() {
    let mut more = scenario();
    let mut camera = more.cameras[0].clone();
    camera.name = "other".to_owned();
    more.cameras.insert(0, camera);
    let plain = run(&mut World::new(&scenario(), 4, None), 5.0, None);
    let richer = run(&mut World::new(&more, 4, None), 5.0, None);
    for (plain, richer) in plain.iter().zip(&richer) {
        assert_eq!(plain.truth, richer.truth);
        assert_eq!(plain.scan, richer.scan);
        assert_eq!(plain.frames.first(), richer.frames.get(1));
    }
}

#[test]
fn people_follow_their_schedule_through_the_door_and_keep_off_walls_and_each_other() {
    let mut world = World::new(&scenario(), 1, None);
    let outputs = run(&mut world, 25.0, None);
    for output in &outputs {
        let (ana, ben) = (person(&output.truth, "ana"), person(&output.truth, "ben"));
        assert!(
            (ana.position - ben.position).norm() >= 0.4 - 1e-9,
            "they overlap"
        );
        for one in [ana, ben] {
            let clearance = world.obstacles.clearance_of_walker(one.position);
            assert!(
                clearance >= 0.2 - 1e-9,
                "{} is in a wall by {clearance}",
                one.name
            );
            assert!(one.velocity.norm() <= 1.0 + 1e-9);
        }
    }
    let end = world.truth();
    let (ana, ben) = (person(&end, "ana"), person(&end, "ben"));
    assert!(
        (ana.position - Point2::new(9.0, 3.3)).norm() < 0.1,
        "{}",
        ana.position
    );
    assert!(
        (wrap(ana.heading + 1.57)).abs() < 1e-6,
        "sits as the chair faces"
    );
    assert!(
        (ben.position - Point2::new(3.0, 1.0)).norm() < 0.1,
        "{}",
        ben.position
    );
    let to_ana = ana.position - ben.position;
    assert!(
        wrap(to_ana.y.atan2(to_ana.x) - ben.heading).abs() < 1e-6,
        "looks at her"
    );
}

#[test]
fn a_person_spoken_to_turns_to_the_robot_for_six_seconds() {
    let mut scenario = scenario();
    scenario.people.truncate(1);
    scenario.people[0].schedule = vec![Entry {
        begin: crate::scenario::Begin::After(0.0),
        go: None,
        face: Some(Face::Heading(0.0)),
        leave: false,
    }];
    let mut world = World::new(&scenario, 1, None);
    run(&mut world, 1.0, None);
    let say = |toward| {
        let speech = Speech {
            time: Time::default(),
            toward,
            text: "hello".to_owned(),
        };
        Inputs {
            velocity: None,
            speech: vec![speech],
        }
    };
    let facing = |world: &World| {
        let truth = world.truth();
        let ana = person(&truth, "ana").clone();
        let to_robot = truth.world_from_robot.translation.vector - ana.position.coords;
        wrap(to_robot.y.atan2(to_robot.x) - ana.heading).abs()
    };
    world.step(0.05, &say(Point2::new(2.0, 4.5)));
    run(&mut world, 2.0, None);
    assert!(facing(&world) > 1.0, "the words went past her");
    world.step(0.05, &say(Point2::new(1.3, 4.3)));
    run(&mut world, 2.0, None);
    assert!(facing(&world) < 1e-6, "she looks at the robot");
    run(&mut world, 5.0, None);
    assert!(facing(&world) > 1.0, "she has turned back");
}

#[test]
fn a_robot_driven_blindly_stops_at_the_wall_and_people_wait_for_it() {
    let mut world = World::new(&scenario(), 1, None);
    let outputs = run(&mut world, 40.0, Some((0.7, 0.05)));
    let end = outputs.last().expect("outputs").truth.clone();
    assert!((1..=2).contains(&end.collisions.walls));
    assert_eq!(
        end.collisions.people, 0,
        "people walk round a robot that stands"
    );
    for output in &outputs {
        let robot = Point2::from(output.truth.world_from_robot.translation.vector);
        for one in &output.truth.people {
            assert!(
                (one.position - robot).norm() >= 0.45 - 1e-9,
                "{} in the robot",
                one.name
            );
        }
    }
}

#[test]
fn a_stream_keeps_its_number_and_its_people_enter_and_leave() {
    let mut scenario = scenario();
    scenario.people.clear();
    scenario.streams.push(Stream {
        name: "flow".to_owned(),
        from: Point2::new(0.5, 2.0),
        to: Point2::new(11.5, 2.0),
        width: 1.0,
        people: 5,
        speed: [1.0, 1.3],
        radius: 0.2,
    });
    scenario.robot.pose = Isometry2::new(Vector2::new(3.0, 4.5), 0.0);
    let mut world = World::new(&scenario, 1, None);
    let outputs = run(&mut world, 60.0, None);
    let last = &outputs.last().expect("outputs").truth;
    assert!(
        (3..=5).contains(&last.people.len()),
        "{} people",
        last.people.len()
    );
    let newest = |truth: &Truth| -> usize {
        let number = |body: &Body| body.name.trim_start_matches("flow_").parse::<usize>();
        truth
            .people
            .iter()
            .filter_map(|body| number(body).ok())
            .max()
            .unwrap_or(0)
    };
    assert!(
        newest(last) > 12,
        "only {} came through the door",
        newest(last)
    );
}

#[test]
fn recorded_people_replace_the_scenarios_and_the_world_outlives_them() {
    let tracks = Tracks::parse("plain.txt", "0 1 2 1\n10 1 2.5 1\n20 1 3 1\n").expect("good");
    let mut world = World::new(&scenario(), 1, Some(tracks));
    let outputs = run(&mut world, 3.0, None);
    let names: Vec<_> = outputs[0]
        .truth
        .people
        .iter()
        .map(|p| p.name.as_str())
        .collect();
    assert_eq!(names, ["person_1"]);
    assert!(outputs[59].truth.people.is_empty());
    assert!(outputs[59].scan.is_some() || outputs[58].scan.is_some());
}
