//! The recogniser against synthetic cameras: 0.1 m of noise, 10 % misses, one false detection of a
//! known class a second and camera.

mod binding;

use super::*;
use crate::messages::PersonDetection;
use crate::perception::synthetic::{Random, Thing, USUAL, camera, look_at_things};
use std::f64::consts::PI;

const PERIOD: f64 = 1.0 / 10.0;

fn thing(class: &'static str, identity: Option<&'static str>, x: f64, y: f64) -> Thing {
    let pose = Isometry2::new(Vector2::new(x, y), 0.4);
    Thing {
        class,
        identity,
        pose,
        size: Vector2::new(0.8, 0.6),
    }
}

/// A recogniser and the two cameras that feed it, which share the middle of their views.
struct Run {
    recognizer: Recognizer,
    plan: FloorPlan,
    cameras: Vec<CameraFrame>,
    clutter: f64,
    bodies: Vec<Point2<f64>>,
    random: Random,
}

impl Run {
    fn new(seed: u64) -> Self {
        Self {
            recognizer: Recognizer::new(Config::default()),
            plan: FloorPlan::default(),
            cameras: vec![
                camera("east", 6.0, 0.0, PI, 0.5 * PI, 10.0),
                camera("west", -6.0, 0.0, 0.0, 0.5 * PI, 10.0),
            ],
            clutter: 1.0,
            bodies: Vec::new(),
            random: Random::new(seed),
        }
    }

    /// Runs over (`start`, `end`] seconds and gives what is recognised at the end.
    fn go(&mut self, start: f64, end: f64, things: &[Thing]) -> Vec<RecognizedObject> {
        let steps = ((end - start) / PERIOD).round() as u32;
        let errors = crate::perception::synthetic::Errors {
            clutter: self.clutter,
            ..USUAL
        };
        let mut recognized = Vec::new();
        for step in 1..=steps {
            let time = Time::from_seconds(start + f64::from(step) * PERIOD);
            let mut frames = self.cameras.clone();
            for frame in &mut frames {
                frame.time = time;
                look_at_things(frame, PERIOD, things, &self.plan, errors, &mut self.random);
                let camera_from_world = frame.world_from_camera.inverse();
                let people = self.bodies.iter().map(|&body| PersonDetection {
                    position: camera_from_world * body,
                    heading: None,
                    score: 0.9,
                    appearance: Vec::new(),
                });
                frame.people.extend(people);
            }
            recognized = self.recognizer.observe(time, &frames, &self.plan);
        }
        recognized
    }
}

fn names(objects: &[RecognizedObject]) -> Vec<&str> {
    objects.iter().map(|o| o.name.as_str()).collect()
}

#[test]
fn objects_of_one_class_are_told_apart_and_placed_well() {
    for seed in 0..10 {
        let things = [
            thing("table", None, 0.0, 0.0),
            thing("table", None, 0.0, 1.2),
            thing("tv", Some("television"), 1.0, -2.0),
        ];
        let found = Run::new(seed).go(0.0, 10.0, &things);
        assert_eq!(
            names(&found),
            ["table_1", "table_2", "television"],
            "seed {seed}"
        );
        for truth in &things {
            let nearest = found
                .iter()
                .filter(|o| o.class == truth.class)
                .map(|o| truth.pose.inv_mul(&o.pose))
                .min_by(|a, b| {
                    a.translation
                        .vector
                        .norm()
                        .total_cmp(&b.translation.vector.norm())
                })
                .unwrap();
            assert!(
                nearest.translation.vector.norm() < 0.06,
                "seed {seed}: {nearest}"
            );
            assert!(
                nearest.rotation.angle().abs() < 0.1,
                "seed {seed}: {nearest}"
            );
        }
        assert!(
            found
                .iter()
                .all(|o| o.confidence > 0.9 && (o.size.x - 0.8).abs() < 1e-9)
        );
    }
}

#[test]
fn false_detections_make_no_objects() {
    let things = [
        thing("table", None, 0.0, 0.0),
        thing("tv", Some("television"), 1.0, -2.0),
    ];
    for seed in 0..10 {
        let mut run = Run::new(seed);
        for second in 1..120 {
            let t = f64::from(second);
            let found = run.go(t, t + 1.0, &things);
            assert_eq!(
                names(&found),
                ["table_1", "television"],
                "seed {seed}, {t} s"
            );
        }
    }
}

#[test]
fn an_object_with_an_identity_is_followed_at_once_when_moved() {
    let mut run = Run::new(1);
    run.go(0.0, 5.0, &[thing("tv", Some("television"), 1.0, -2.0)]);
    let found = run.go(5.0, 5.5, &[thing("tv", Some("television"), -1.0, 2.0)]);
    assert_eq!(names(&found), ["television"]);
    assert!((found[0].pose.translation.vector - Vector2::new(-1.0, 2.0)).norm() < 0.2);
}

#[test]
fn an_object_without_identity_keeps_its_name_when_moved_in_view() {
    let mut run = Run::new(2);
    run.go(
        0.0,
        5.0,
        &[
            thing("table", None, 1.0, -2.0),
            thing("table", None, 0.0, 1.0),
        ],
    );
    let found = run.go(
        5.0,
        8.0,
        &[
            thing("table", None, -1.0, -1.0),
            thing("table", None, 0.0, 1.0),
        ],
    );
    assert_eq!(names(&found), ["table_1", "table_2"]);
    let moved = found
        .iter()
        .map(|o| o.pose.translation.vector - Vector2::new(-1.0, -1.0));
    assert!(moved.map(|d| d.norm()).fold(f64::INFINITY, f64::min) < 0.15);
}

#[test]
fn looks_in_vain_take_confidence_and_looks_elsewhere_do_not() {
    let things = [
        thing("table", None, 2.0, 0.0),
        thing("tv", Some("television"), 1.0, -2.0),
    ];
    let mut run = Run::new(3);
    run.clutter = 0.0;
    run.go(0.0, 5.0, &things);
    let cameras = std::mem::take(&mut run.cameras);
    run.cameras = vec![camera("away", 0.0, 8.0, PI / 2.0, 1.0, 5.0)];
    let away = run.go(5.0, 60.0, &[]);
    assert!(away.iter().all(|o| o.confidence > 0.99), "nobody looked");
    run.cameras = cameras;
    let soon = run.go(60.0, 61.0, &[]);
    assert!(
        soon.iter().all(|o| o.confidence > 0.95),
        "a second without it proves little"
    );
    let late = run.go(61.0, 75.0, &[]);
    assert_eq!(names(&late), ["television"], "the table is forgotten");
    assert!(
        late[0].confidence < 0.2,
        "the television was looked for in vain"
    );
    assert_eq!(late[0].last_seen, Time::from_seconds(5.0));
    let again = run.go(75.0, 77.0, &things);
    assert_eq!(
        names(&again),
        ["table_2", "television"],
        "a new name for a new table"
    );
}

#[test]
fn people_and_walls_in_between_prove_nothing() {
    let things = [thing("table", None, 0.0, 0.0)];
    let mut run = Run::new(4);
    run.clutter = 0.0;
    run.go(0.0, 5.0, &things);
    run.bodies = vec![Point2::new(-3.0, 0.0), Point2::new(3.0, 0.0)];
    assert!(run.go(5.0, 30.0, &[])[0].confidence > 0.99);
    run.bodies.clear();
    run.plan = FloorPlan::new(
        [],
        [-1.0, 1.0].map(|x| [Point2::new(x, -9.0), Point2::new(x, 9.0)]),
    );
    assert!(run.go(30.0, 60.0, &[])[0].confidence > 0.99);
}

#[test]
fn an_identity_read_later_renames_the_object_instead_of_doubling_it() {
    let mut run = Run::new(5);
    run.clutter = 0.0;
    assert_eq!(
        names(&run.go(0.0, 3.0, &[thing("table", None, 0.0, 0.0)])),
        ["table_1"]
    );
    let found = run.go(3.0, 5.0, &[thing("table", Some("desk"), 0.0, 0.0)]);
    assert_eq!(names(&found), ["desk"]);
    let unread = run.go(5.0, 8.0, &[thing("table", None, 0.0, 0.0)]);
    assert_eq!(
        names(&unread),
        ["desk"],
        "and keeps it when the marker is not read"
    );
}

#[test]
fn a_restarted_recogniser_adopts_objects_and_doubles_none() {
    let things = [
        thing("table", None, 0.0, 0.0),
        thing("tv", Some("television"), 1.0, -2.0),
    ];
    let mut run = Run::new(6);
    run.clutter = 0.0;
    let before = run.go(0.0, 5.0, &things);
    run.recognizer = Recognizer::new(Config::default());
    for object in &before {
        run.recognizer.adopt(object);
    }
    assert_eq!(names(&run.go(5.0, 8.0, &things)), names(&before));
    let more = run.go(
        8.0,
        10.0,
        &[
            things[0].clone(),
            things[1].clone(),
            thing("table", None, 0.0, 2.0),
        ],
    );
    assert_eq!(names(&more), ["table_1", "table_2", "television"]);
}

#[test]
fn an_object_is_in_the_room_around_it() {
    let mut run = Run::new(7);
    let corners = [(-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0)];
    let outline = corners.map(|(x, y)| Point2::new(x, y)).to_vec();
    run.plan = FloorPlan::new([("kitchen".to_owned(), outline)], []);
    let found = run.go(
        0.0,
        3.0,
        &[thing("table", None, 0.0, 0.0), thing("tv", None, 3.5, 0.5)],
    );
    let rooms: Vec<_> = found.iter().map(|o| o.in_room.as_deref()).collect();
    assert_eq!(rooms, [Some("kitchen"), None]);
}

#[test]
fn the_order_of_frames_changes_nothing_and_bad_frames_do_no_harm() {
    let things = [
        thing("table", None, 0.0, 0.0),
        thing("table", None, 0.4, 1.0),
    ];
    let mut run = Run::new(8);
    let mut other = Recognizer::new(Config::default());
    for step in 1..60 {
        let time = Time::from_seconds(f64::from(step) * PERIOD);
        let mut frames = run.cameras.clone();
        for frame in &mut frames {
            frame.time = time;
            look_at_things(frame, PERIOD, &things, &run.plan, USUAL, &mut run.random);
        }
        let found = run.recognizer.observe(time, &frames, &run.plan);
        frames.reverse();
        for frame in &mut frames {
            frame.objects.reverse();
        }
        let mut absurd = frames[0].clone();
        absurd.camera = "future".to_owned();
        absurd.time = time + 5.0;
        frames.push(absurd.clone());
        absurd.camera = "lost".to_owned();
        absurd.time = time;
        absurd.world_from_camera.translation.x = f64::NAN;
        frames.push(absurd);
        let mut nowhere = things[0].detection(&frames[0]);
        nowhere.camera_from_object.translation.x = f64::NAN;
        frames[0].objects.push(nowhere);
        frames.push(frames[0].clone());
        assert_eq!(found, other.observe(time, &frames, &run.plan));
    }
}
