//! Speed control: lines are followed within the limits, and nothing too close is driven at.

use super::*;
use dsr::Time;
use proptest::prelude::*;
use std::f64::consts::PI;

fn limits() -> Limits {
    Limits {
        radius: 0.25,
        max_speed: 0.8,
        max_turn: 1.0,
        ..Limits::default()
    }
}

/// The scan of a robot at `robot` among `discs` (centre, radius), 720 beams all round.
fn scan(robot: &Unicycle, discs: &[(Point2<f64>, f64)]) -> LaserScan {
    let angle_step = PI / 360.0;
    let beam = |k: usize| {
        let direction = robot.heading - PI + angle_step * k as f64;
        let direction = Vector2::new(direction.cos(), direction.sin());
        let range = discs.iter().filter_map(|(centre, radius)| {
            let to = centre - robot.position;
            let along = to.dot(&direction);
            let miss = radius * radius - (to.norm_squared() - along * along);
            (along > 0.0 && miss > 0.0).then(|| along - miss.sqrt())
        });
        range.fold(10.0, f64::min) as f32
    };
    LaserScan {
        time: Time::default(),
        angle_min: -PI,
        angle_step,
        range_max: 10.0,
        ranges: (0..720).map(beam).collect(),
    }
}

fn at(x: f64, y: f64, heading: f64) -> Unicycle {
    Unicycle {
        position: Point2::new(x, y),
        heading,
        motion: Motion::default(),
    }
}

#[test]
fn near_somebody_who_stands_the_speed_grows_with_the_gap() {
    let near = |gap| speed_near(gap, 0.7);
    assert!((near(-0.1) - 0.25).abs() < 1e-12 && (near(0.6) - 0.475).abs() < 1e-12);
    assert!((near(1.2) - 0.7).abs() < 1e-12 && (near(9.0) - 0.7).abs() < 1e-12);
    assert!(
        (speed_near(0.0, 0.1) - 0.1).abs() < 1e-12,
        "never faster than the top speed"
    );
}

#[test]
fn a_line_is_followed_to_its_end_within_the_limits() {
    let line = [
        Point2::new(0.0, 0.0),
        Point2::new(2.0, 0.0),
        Point2::new(2.0, 2.0),
    ];
    let mut robot = at(0.0, 0.0, PI / 2.0);
    let limits = limits();
    let mut farthest: f64 = 0.0;
    let mut rest = line.to_vec();
    for _ in 0..200 {
        while rest.len() > 1 && distance(&robot.position, &rest[0]) < 0.3 {
            rest.remove(0);
        }
        let wanted = follow(&robot, &rest, 0.8, &limits, false);
        let motion = limits.reachable(robot.motion, wanted, 0.05);
        assert!(motion.linear.abs() <= 0.8 && motion.angular.abs() <= 1.0);
        assert!((motion.linear - robot.motion.linear).abs() <= 0.8 * 0.05 + 1e-12);
        robot = robot.advanced(motion, 0.05);
        let off = if robot.position.y < 0.3 {
            robot.position.y
        } else {
            robot.position.x - 2.0
        };
        farthest = farthest.max(off.abs());
    }
    assert!(
        distance(&robot.position, &line[2]) < 0.1,
        "{:?}",
        robot.position
    );
    assert!(robot.motion.linear.abs() < 0.05);
    assert!(farthest < 0.5, "{farthest}");
}

#[test]
fn a_large_heading_error_is_turned_in_place() {
    let line = [Point2::new(0.0, 1.0)];
    let turn = follow(&at(0.0, 0.0, 0.0), &line, 0.8, &limits(), false);
    assert_eq!(turn.linear.to_bits(), 0.0f64.to_bits());
    assert!(turn.angular > 0.0);
    let back = follow(&at(0.0, 0.0, -PI / 2.0), &line, 0.8, &limits(), true);
    assert!(back.linear < -0.5 && back.angular.abs() < 1e-9);
}

#[test]
fn what_is_too_close_stops_the_way_toward_it_and_no_other() {
    let guard = Guard::default();
    let robot = at(0.0, 0.0, 0.0);
    let ahead = [(Point2::new(0.5, 0.0), 0.2)];
    let (forwards, backwards) = guard.allowed(&scan(&robot, &ahead), &limits());
    assert_eq!(forwards.to_bits(), 0.0f64.to_bits());
    assert!(backwards.is_infinite());
    let wanted = Motion::new(0.5, 0.7);
    let slowed = guard.slowed(wanted, &scan(&robot, &ahead), &limits());
    assert_eq!(slowed, Motion::new(0.0, 0.7));
    let behind = [(Point2::new(-0.5, 0.0), 0.2)];
    let (forwards, backwards) = guard.allowed(&scan(&robot, &behind), &limits());
    assert!(forwards.is_infinite() && backwards <= 0.0);
    // A wall so near beside the robot that it lies in the margin lets it creep on.
    let beside: Vec<_> = (-20..20)
        .map(|k| (Point2::new(f64::from(k) * 0.1, 0.36), 0.1))
        .collect();
    let (forwards, _) = guard.allowed(&scan(&robot, &beside), &limits());
    assert!((0.05..0.5).contains(&forwards), "{forwards}");
}

fn omnidirectional() -> Limits {
    Limits {
        base: Base::Omnidirectional,
        ..limits()
    }
}

#[test]
fn an_omnidirectional_base_goes_sideways_at_once_and_turns_meanwhile() {
    let line = [Point2::new(0.0, 3.0)];
    let limits = omnidirectional();
    let wanted = follow(&at(0.0, 0.0, 0.0), &line, 0.8, &limits, false);
    assert!(wanted.linear.abs() < 1e-9 && (wanted.lateral - 0.8).abs() < 1e-9);
    assert!(wanted.angular > 0.5);
    let backwards = follow(&at(0.0, 0.0, 0.0), &line, 0.8, &limits, true);
    assert!((backwards.lateral - 0.8).abs() < 1e-9 && backwards.angular.abs() < 1e-12);
    let mut robot = at(0.0, 0.0, 0.0);
    for _ in 0..120 {
        let wanted = follow(&robot, &line, 0.8, &limits, false);
        let motion = limits.reachable(robot.motion, wanted, 0.05);
        let change = Vector2::new(
            motion.linear - robot.motion.linear,
            motion.lateral - robot.motion.lateral,
        );
        assert!(motion.speed() <= 0.8 + 1e-12 && change.norm() <= 0.8 * 0.05 + 1e-12);
        robot = robot.advanced(motion, 0.05);
        assert!(robot.position.x.abs() < 0.15, "no arc: {}", robot.position);
    }
    assert!(
        distance(&robot.position, &line[0]) < 0.1,
        "{}",
        robot.position
    );
    assert!((robot.heading - PI / 2.0).abs() < 0.1, "{}", robot.heading);
}

#[test]
fn a_differential_base_is_never_told_to_go_sideways() {
    let wanted = Motion {
        lateral: 0.5,
        ..Motion::new(0.5, 0.1)
    };
    let reached = limits().reachable(Motion::default(), wanted, 0.1);
    assert_eq!(reached.lateral.to_bits(), 0.0f64.to_bits());
}

#[test]
fn what_is_beside_stops_the_way_to_that_side_and_no_other() {
    let (guard, robot) = (Guard::default(), at(0.0, 0.0, 0.3));
    let left = Rotation2::new(0.3) * Vector2::new(0.0, 0.5);
    let scan = scan(&robot, &[(left.into(), 0.2)]);
    let toward = |lateral| Motion {
        lateral,
        ..Motion::new(0.0, 0.2)
    };
    let slowed = guard.slowed(toward(0.6), &scan, &omnidirectional());
    assert!(slowed.speed() < 1e-9 && (slowed.angular - 0.2).abs() < 1e-12);
    assert_eq!(
        guard.slowed(toward(-0.6), &scan, &omnidirectional()),
        toward(-0.6)
    );
}

#[test]
fn angles_wrap_to_the_smaller_turn() {
    for (angle, turn) in [
        (3.0 * PI, PI),
        (-0.5, -0.5),
        (PI + 0.5, 0.5 - PI),
        (-PI, PI),
    ] {
        assert!((wrapped(angle) - turn).abs() < 1e-12, "{angle}");
    }
}

/// Discs `(centre, radius)` that lie at least `free` beside a robot at the origin.
fn beside(discs: Vec<((f64, f64), f64)>, free: f64) -> Vec<(Point2<f64>, f64)> {
    discs
        .into_iter()
        .map(|((x, y), radius)| (Point2::new(x, y), radius))
        .filter(|(centre, radius)| centre.coords.norm() > radius + free)
        .collect()
}

/// How near a robot that obeys the guard comes to the surface of any disc in 6 s, wanting to move so all the time.
/// `follow` tells how the base moves that moved so and is commanded this.
fn least_gap(
    limits: &Limits,
    discs: &[(Point2<f64>, f64)],
    heading: f64,
    wanted: Motion,
    follow: impl Fn(Motion, Motion) -> Motion,
) -> f64 {
    let guard = Guard::default();
    let mut robot = at(0.0, 0.0, heading);
    let mut least = f64::INFINITY;
    for _ in 0..120 {
        let reached = limits.reachable(robot.motion, wanted, 0.05);
        let command = guard.slowed(reached, &scan(&robot, discs), limits);
        robot = robot.advanced(follow(robot.motion, command), 0.05);
        for (centre, radius) in discs {
            least = least.min(distance(centre, &robot.position) - radius - limits.radius);
        }
    }
    least
}

proptest! {
    /// The same whichever way an omnidirectional base goes.
    #[test]
    fn the_guard_stops_an_omnidirectional_robot_too(
        discs in proptest::collection::vec(((-3.0..3.0, -3.0..3.0), 0.05..0.5), 1..8),
        heading in -PI..PI,
        velocity in (-0.6..0.6, -0.6..0.6),
        angular in -0.3..0.3,
    ) {
        let wanted = Motion { linear: velocity.0, lateral: velocity.1, angular };
        let at_once = |_, command| command;
        let gap = least_gap(&omnidirectional(), &beside(discs, 0.25), heading, wanted, at_once);
        prop_assert!(gap > -0.01, "{gap}");
    }

    /// Nor while it turns, on a base that brakes no faster than it can.
    #[test]
    fn the_guard_stops_an_omnidirectional_robot_that_turns(
        discs in proptest::collection::vec(((-3.0..3.0, -3.0..3.0), 0.05..0.5), 1..8),
        heading in -PI..PI,
        velocity in (-0.6..0.6, -0.6..0.6),
        angular in -1.2..1.2,
    ) {
        let limits = omnidirectional();
        let wanted = Motion { linear: velocity.0, lateral: velocity.1, angular };
        let as_it_can = |now, command| limits.reachable(now, command, 0.05);
        let gap = least_gap(&limits, &beside(discs, 0.35), heading, wanted, as_it_can);
        prop_assert!(gap > -0.01, "{gap}");
    }

    /// Whatever speed is asked for, a robot that obeys the guard never touches what it can see.
    #[test]
    fn the_guard_stops_the_robot_before_every_obstacle(
        discs in proptest::collection::vec(((-3.0..3.0, -3.0..3.0), 0.05..0.5), 1..8),
        heading in -PI..PI,
        linear in -0.8..0.8,
        angular in -0.3..0.3,
    ) {
        let at_once = |_, command| command;
        let wanted = Motion::new(linear, angular);
        let gap = least_gap(&limits(), &beside(discs, 0.25), heading, wanted, at_once);
        prop_assert!(gap > -0.01, "{gap}");
    }
}
