//! Steps that lead to a pose, before a thing, and to people who stand together.

use super::*;
use crate::navigation::people::PERSONAL;
use dsr::planar_pose;
use std::f64::consts::FRAC_PI_2;

/// A node with a pose.
fn put(home: &mut Home, kind: &str, name: &str, pose: Isometry2<f64>) {
    let mut work = Transaction::new();
    work.create_node(kind, name, Vec::new());
    work.push(Operation::CreateEdge {
        edge: EdgeRef::new("home", "pose", name),
        attributes: vec![("transform".to_owned(), Value::Pose(planar_pose(&pose)))],
    });
    home.commit(&work);
}

fn turned(home: &Home, heading: f64) -> f64 {
    wrapped(home.robot.heading - heading).abs()
}

#[test]
fn a_pose_is_gone_to_with_its_heading() {
    let mut home = Home::new();
    let pose = Isometry2::new(Vector2::new(3.0, 2.5), FRAC_PI_2);
    put(&mut home, "place", "desk", pose);
    home.dispatch("goToPose", r#"{"robot":"shelly","place":"desk"}"#);
    home.run(30.0);
    assert_eq!(home.status(), "done");
    assert!(turned(&home, FRAC_PI_2) < 0.15 && home.has("shelly", "at", "desk"));
}

#[test]
fn a_thing_is_gone_before_and_faced() {
    let mut home = Home::new();
    let pose = Isometry2::new(Vector2::new(3.0, 3.9), -FRAC_PI_2);
    put(&mut home, "object", "board", pose);
    let mut work = Transaction::new();
    work.set("board", "size", Value::Vector(vec![0.2, 1.0]));
    home.commit(&work);
    home.dispatch("goToObject", r#"{"robot":"shelly","object":"board"}"#);
    home.run(30.0);
    assert_eq!(home.status(), "done");
    let gap = home.robot.position - Point2::new(3.0, 3.2);
    assert!(gap.norm() < 0.3 && turned(&home, FRAC_PI_2) < 0.3, "{gap}");
    assert!(home.has("shelly", "before", "board"));
}

#[test]
fn a_group_is_joined_outside_everybodys_space_and_faced() {
    let mut home = Home::new();
    home.person(2.4, 2.6, 0.0);
    put(
        &mut home,
        "person",
        "ben",
        Isometry2::new(Vector2::new(3.6, 2.6), PI),
    );
    put(
        &mut home,
        "group",
        "group_1",
        Isometry2::new(Vector2::new(3.0, 2.6), 0.0),
    );
    let mut work = Transaction::new();
    work.create_edge("ana", "member_of", "group_1");
    work.create_edge("ben", "member_of", "group_1");
    home.commit(&work);
    home.dispatch(
        "approachGroup",
        r#"{"robot":"shelly","p":"ana","group":"group_1"}"#,
    );
    home.run(40.0);
    assert_eq!(home.status(), "done");
    let place = home.robot.position;
    let way = Point2::new(3.0, 2.6) - place;
    assert!(
        way.norm() < 1.5 && turned(&home, way.y.atan2(way.x)) < 0.3,
        "{place}"
    );
    for (x, heading) in [(2.4, 0.0), (3.6, PI)] {
        let member = Person {
            name: String::new(),
            world_from_person: Isometry2::new(Vector2::new(x, 2.6), heading),
            velocity: Vector2::zeros(),
            radius: 0.25,
        };
        assert!(
            member.predicted(0.0).squared_deviation(place) > 0.85 * PERSONAL,
            "{place}"
        );
    }
    assert!(home.has("shelly", "joined", "group_1"));
}
