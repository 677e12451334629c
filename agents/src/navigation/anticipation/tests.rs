//! Anticipation: whom the robot waits for and whom it goes round.

use super::*;
use crate::navigation::control::Base;
use nalgebra::Isometry2;

const LIMITS: Limits = Limits {
    base: Base::Differential,
    radius: 0.25,
    max_speed: 0.6,
    max_turn: 1.0,
    acceleration: 0.8,
    turn_acceleration: 2.5,
};

fn person(x: f64, y: f64, (vx, vy): (f64, f64)) -> Person {
    Person {
        name: "ana".into(),
        world_from_person: Isometry2::new(Vector2::new(x, y), f64::atan2(vy, vx)),
        velocity: Vector2::new(vx, vy),
        radius: 0.25,
    }
}

/// Carries out the choices for some seconds while people walk on; the deepest that the robot gets
/// into anybody's space, and where it ends.
fn carry_out(mut people: Vec<Person>, line: &[Point2<f64>], seconds: f64) -> (f64, Point2<f64>) {
    let mut anticipation = Anticipation::default();
    let ground = Ground::default();
    let mut robot = Unicycle {
        position: line[0],
        heading: 0.0,
        motion: Motion::default(),
    };
    let mut deepest = f64::INFINITY;
    for step in 0..(seconds / 0.1) as usize {
        let mut line = line.to_vec();
        line.retain(|point| point.x > robot.position.x);
        line.insert(0, robot.position);
        let scene = Scene {
            line: &line,
            people: &people,
            ground: &ground,
            limits: &LIMITS,
            lost: step as f64 * 0.1,
            grid: None,
            addressee: None,
        };
        let choice = anticipation.choose(&robot, &scene);
        robot = robot.advanced(LIMITS.reachable(robot.motion, choice.motion, 0.1), 0.1);
        for person in &mut people {
            person.world_from_person.translation.vector += person.velocity * 0.1;
            deepest = deepest.min(person.predicted(0.0).squared_deviation(robot.position));
        }
    }
    (deepest, robot.position)
}

fn straight(to: f64) -> Vec<Point2<f64>> {
    (0..=(to * 4.0) as usize)
        .map(|k| Point2::new(k as f64 * 0.25, 0.0))
        .collect()
}

#[test]
fn with_nobody_near_the_line_is_followed_at_top_speed() {
    let robot = Unicycle {
        position: Point2::origin(),
        heading: 0.0,
        motion: Motion::default(),
    };
    let (line, ground) = (straight(5.0), Ground::default());
    let far = [person(30.0, 0.0, (-1.0, 0.0))];
    let scene = Scene {
        line: &line,
        people: &far,
        ground: &ground,
        limits: &LIMITS,
        lost: 0.0,
        grid: None,
        addressee: None,
    };
    let choice = Anticipation::default().choose(&robot, &scene);
    assert_eq!(choice.manoeuvre, Manoeuvre::Along(1.0));
    assert!((choice.motion.linear - 0.6).abs() < 1e-9);
}

#[test]
fn the_robot_lets_a_crossing_walker_pass_and_goes_on() {
    // At top speed both would be at x = 2 after 3.3 s.
    let (deepest, end) = carry_out(vec![person(2.0, -4.3, (0.0, 1.3))], &straight(5.0), 12.0);
    assert!(deepest > PERSONAL, "{deepest}");
    assert!(end.x > 4.6, "{end}");
}

#[test]
fn the_robot_steps_aside_for_somebody_who_comes_straight_at_it() {
    let (deepest, end) = carry_out(vec![person(7.0, 0.0, (-1.3, 0.0))], &straight(5.0), 14.0);
    assert!(deepest > PERSONAL, "{deepest}");
    assert!(end.x > 4.6, "{end}");
}

#[test]
fn somebody_who_stands_in_the_only_way_is_waited_for_but_not_forever() {
    // The line leads through the edge of a space that never moves away.
    let (_, end) = carry_out(vec![person(2.5, 0.8, (0.0, 0.0))], &straight(5.0), 60.0);
    assert!(end.x > 4.6, "{end}");
}
