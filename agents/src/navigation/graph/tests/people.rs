//! Steps that are about somebody: asking, waiting, letting pass, and going with them.

use super::*;

/// Ana, who walks for so many seconds.
fn walk(home: &mut Home, from: (f64, f64), velocity: (f64, f64), seconds: f64) {
    let heading = velocity.1.atan2(velocity.0);
    for k in 0..(seconds / TICK) as usize {
        let time = k as f64 * TICK;
        home.person(
            from.0 + velocity.0 * time,
            from.1 + velocity.1 * time,
            heading,
        );
        let mut work = Transaction::new();
        work.set(
            "ana",
            "velocity",
            Value::Vector(vec![velocity.0, velocity.1]),
        );
        home.commit(&work);
        home.tick();
    }
    let mut work = Transaction::new();
    work.set("ana", "velocity", Value::Vector(vec![0.0, 0.0]));
    home.commit(&work);
}

#[test]
fn leave_to_pass_is_asked_for_in_its_own_words() {
    let mut home = Home::new();
    home.person(2.4, 1.0, 0.0);
    home.dispatch("askForPermission", r#"{"robot":"shelly","p":"ana"}"#);
    home.run(4.0);
    assert_eq!(home.speeches[0].text, "Excuse me, may I pass?");
    assert_eq!(home.status(), "running");
    home.person(2.4, 1.0, PI);
    home.run(0.5);
    assert_eq!(home.status(), "done");
    assert!(home.has("ana", "allows", "shelly"));
}

#[test]
fn an_escort_goes_through_the_door_behind_and_ends_when_both_are_there() {
    let binding = r#"{"robot":"shelly","p":"ana","room1":"left","room2":"right"}"#;
    for rule in ["escort", "follow"] {
        let mut home = Home::new();
        home.person(1.6, 2.0, 0.0);
        home.dispatch(rule, binding);
        home.run(2.0);
        walk(&mut home, (1.6, 2.0), (0.4, 0.0), 16.0);
        assert_eq!(home.status(), "done", "{rule}");
        assert!(home.robot.position.x > 5.0 + INSIDE && home.robot.position.x < 8.0);
    }
}

#[test]
fn who_is_waited_for_ends_the_step_by_coming() {
    let mut home = Home::new();
    home.person(7.0, 2.0, PI);
    home.dispatch("wait", r#"{"robot":"shelly","p":"ana","room":"left"}"#);
    let stood = home.robot.position;
    home.run(3.0);
    assert_eq!(home.status(), "running");
    walk(&mut home, (7.0, 2.0), (-0.8, 0.0), 4.0);
    assert_eq!(home.status(), "done");
    assert_eq!(home.robot.position, stood);
    assert!(home.has("ana", "in", "left"));
}

#[test]
fn the_robot_steps_out_of_the_way_of_who_is_let_pass() {
    let mut home = Home::new();
    home.robot.position = Point2::new(2.0, 2.0);
    home.robot.heading = 0.0;
    home.person(9.0, 2.0, PI);
    home.dispatch("letPass", r#"{"robot":"shelly","p":"ana"}"#);
    walk(&mut home, (9.0, 2.0), (-0.7, 0.0), 9.0);
    assert!(
        (home.robot.position.y - 2.0).abs() > 0.7,
        "{}",
        home.robot.position
    );
    assert_eq!(home.status(), "running");
    walk(&mut home, (2.7, 2.0), (-0.7, 0.0), 3.0);
    assert_eq!(home.status(), "done");
    assert!(home.has("ana", "passed", "shelly"));
}
