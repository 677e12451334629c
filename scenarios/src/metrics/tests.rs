//! Figures that can be worked out by hand, and the laws that hold for every run.

use super::*;
use crate::scenario::Scenario;
use crate::world::Body;
use agents::social_mapping::{Agenda, SocialConfig, UsageCurve};
use nalgebra::Vector2;
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

const RADIUS: f64 = 0.25;

fn at(seconds: f64) -> Time {
    Time::from_seconds(1_800_000_000.0 + seconds)
}

fn sample(seconds: f64, x: f64, y: f64, speed: f64) -> Truth {
    Truth {
        time: at(seconds),
        world_from_robot: Isometry2::new(Vector2::new(x, y), 0.0),
        velocity: Vector2::new(speed, 0.0),
        lateral: 0.0,
        people: Vec::new(),
        collisions: Collisions::default(),
    }
}

fn with(mut sample: Truth, people: &[(&str, f64, f64)]) -> Truth {
    sample.people = people
        .iter()
        .map(|(name, x, y)| Body::standing(name, Point2::new(*x, *y), 0.0, 0.2))
        .collect();
    sample
}

fn square(name: &str, agenda: Vec<Agenda>) -> ObjectSpace {
    let corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)].map(|(x, y)| Point2::new(x, y));
    ObjectSpace::new(name, &corners, UsageCurve::default(), agenda)
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}

#[test]
fn nothing_recorded_gives_nothing() {
    assert_eq!(measure(&[], RADIUS, &[]), Metrics::default());
    let lost = sample(0.0, f64::NAN, 0.0, 0.0);
    assert_eq!(measure(&[lost], RADIUS, &[]), Metrics::default());
    assert_eq!(closest_encounter(&[], RADIUS), None);
}

#[test]
fn one_sample_has_distances_but_no_time() {
    let metrics = measure(
        &[with(sample(0.0, 0.0, 0.0, 1.0), &[("anna", 1.0, 0.0)])],
        RADIUS,
        &[],
    );
    assert_eq!((metrics.psi, metrics.psi_moving), (None, None));
    let robot = metrics.robot.unwrap();
    assert!(close(robot.path_length, 0.0) && close(robot.duration, 0.0) && close(robot.chc, 0.0));
    assert!(close(metrics.people[0].min_distance, 1.0));
    assert!(close(metrics.people[0].min_clearance, 0.55));
}

#[test]
fn each_moment_belongs_to_the_closest_zone_for_as_long_as_it_lasts() {
    // Anna at the origin faces +x: intimate to 0.46 m ahead, personal to 1.18, social to 2.15.
    let anna = [("anna", 0.0, 0.0)];
    let run = [
        with(sample(0.0, 3.0, 0.0, 0.5), &anna),
        with(sample(4.0, 2.0, 0.0, 0.5), &anna),
        with(sample(7.0, 1.0, 0.0, -0.5), &anna),
        with(sample(9.0, 0.4, 0.0, 0.0), &anna),
        with(sample(10.0, 9.0, 0.0, 0.5), &anna),
    ];
    let metrics = measure(&run, RADIUS, &[]);
    let psi = metrics.psi.unwrap();
    assert!(close(psi.public, 40.0) && close(psi.social, 30.0));
    assert!(close(psi.personal, 20.0) && close(psi.intimate, 10.0) && close(psi.objects, 0.0));
    // Backwards is moving, too; standing in the intimate zone is not, nor the last sample any time.
    let moving = metrics.psi_moving.unwrap();
    assert!(close(moving.public, 400.0 / 9.0) && close(moving.social, 300.0 / 9.0));
    assert!(close(moving.personal, 200.0 / 9.0) && close(moving.intimate, 0.0));
}

#[test]
fn a_robot_that_never_moves_has_no_share_of_moving() {
    let run = [sample(0.0, 0.0, 0.0, MOVING), sample(1.0, 0.0, 0.0, 0.0)];
    let metrics = measure(&run, RADIUS, &[]);
    assert!(metrics.psi.is_some());
    assert_eq!(metrics.psi_moving, None);
}

#[test]
fn spaces_count_once_and_only_while_an_activity_is_near() {
    // R(t) rises from 45 min before; the two spaces lie on each other.
    let minutes = |m: f64| at(60.0 * m);
    let agenda = vec![Agenda::new(minutes(60.0), minutes(70.0)).unwrap()];
    let spaces = [
        square("table", agenda.clone()),
        square("tv", agenda),
        square("bed", vec![]),
    ];
    let run = [
        sample(0.0, 1.0, 1.0, 0.5),         // inside, too early
        sample(60.0 * 20.0, 1.0, 1.0, 0.5), // inside, on the ramp
        sample(60.0 * 65.0, 3.0, 1.0, 0.5), // outside
        sample(60.0 * 80.0, 2.0, 1.0, 0.5), // on the edge, falling
        sample(60.0 * 100.0, 1.0, 1.0, 0.5),
    ];
    let psi = measure(&run, RADIUS, &spaces).psi.unwrap();
    assert!(close(psi.objects, 65.0), "{}", psi.objects);
    assert!(close(psi.public, 100.0));
    assert!(close(
        measure(&run, RADIUS, &spaces[2..]).psi.unwrap().objects,
        0.0
    ));
}

#[test]
fn people_are_measured_over_time_and_sorted_by_name() {
    let run = [
        with(
            sample(0.0, 0.0, 0.0, 0.5),
            &[("zoe", 5.0, 0.0), ("anna", 3.0, 0.0)],
        ),
        with(
            sample(1.0, 1.0, 0.0, 0.5),
            &[("zoe", 1.3, 0.4), ("anna", 9.0, 0.0)],
        ),
        with(sample(2.0, 2.0, 0.0, 0.5), &[("max", f64::NAN, 0.0)]),
        with(sample(3.0, 3.0, 0.0, 0.5), &[("ida", 3.2, 0.0)]),
    ];
    let people = measure(&run, RADIUS, &[]).people;
    let names: Vec<_> = people.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["anna", "ida", "zoe"]);
    assert!(close(people[0].min_distance, 3.0) && close(people[0].min_clearance, 2.55));
    assert!(close(people[1].min_distance, 0.2) && close(people[1].min_clearance, 0.0));
    assert!(close(people[2].min_distance, 0.5) && close(people[2].min_clearance, 0.05));
    let closest = closest_encounter(&run, RADIUS).unwrap();
    assert_eq!((closest.time, closest.person.as_str()), (at(3.0), "ida"));
}

#[test]
fn duplicate_times_and_disorder_weigh_nothing() {
    let anna = [("anna", 0.0, 0.0)];
    let run = [
        with(sample(2.0, 9.0, 0.0, 0.5), &anna),
        with(sample(0.0, 9.0, 0.0, 0.5), &anna),
        with(sample(1.0, 0.1, 0.0, 0.5), &anna), // for no time at all
        with(sample(1.0, 1.0, 0.0, 0.5), &anna),
    ];
    let metrics = measure(&run, RADIUS, &[]);
    let psi = metrics.psi.unwrap();
    assert!(close(psi.public, 50.0) && close(psi.personal, 50.0) && close(psi.intimate, 0.0));
    let robot = metrics.robot.unwrap();
    assert!(close(robot.duration, 2.0) && close(robot.path_length, 8.9 + 0.9 + 8.0));
}

#[test]
fn heading_changes_of_known_paths() {
    let polyline = |points: &[(f64, f64)]| -> Vec<Point2<f64>> {
        points.iter().map(|(x, y)| Point2::new(*x, *y)).collect()
    };
    let chc = |points: &[(f64, f64)]| heading_changes(&polyline(points), CHC_STEP);
    assert!(close(chc(&[(0.0, 0.0), (0.1, 0.1), (5.0, 5.0)]), 0.0));
    assert!(close(chc(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]), FRAC_PI_2));
    // Left and right again; across the seam of the angle; there and back.
    assert!(close(
        chc(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (2.0, 1.0)]),
        PI
    ));
    assert!(close(
        chc(&[(0.0, 0.0), (-1.0, 0.001), (-2.0, 0.0)]),
        2.0 * 0.001f64.atan()
    ));
    assert!(close(chc(&[(0.0, 0.0), (1.0, 0.0), (0.0, 0.0)]), PI));
    assert!(close(chc(&[(1.0, 1.0)]), 0.0) && close(chc(&[]), 0.0));

    let circle: Vec<_> = (0..=2000)
        .map(|i| {
            let (sin, cos) = (TAU * f64::from(i) / 2000.0).sin_cos();
            Point2::new(2.0 * cos, 2.0 * sin)
        })
        .collect();
    let turned = heading_changes(&circle, CHC_STEP);
    // The first chord's own turn and the rest shorter than a step are missing.
    assert!(
        (TAU - 2.0 * CHC_STEP / 2.0..=TAU).contains(&turned),
        "{turned}"
    );
}

#[test]
fn spaces_of_a_scenario_end_at_walls_and_follow_its_agenda() {
    let text = r#"
name = "two-rooms"
start = "2026-03-02T10:00:00"
duration = 60.0
[[room]]
name = "hall"
polygon = [[0, 0], [4, 0], [4, 3], [0, 3]]
[[room]]
name = "study"
polygon = [[4, 0], [8, 0], [8, 3], [4, 3]]
[[object]]
name = "screen"
class = "tv"
pose = [2.0, 1.5, 0.0]
size = [0.1, 1.0]
[[object]]
name = "fern"
class = "plant"
pose = [7.0, 1.0, 0.5]
size = [0.3, 0.3]
shape = "circle"
[robot]
pose = [1.0, 1.0, 0.0]
[[activity]]
name = "news"
object = "screen"
start = "11:00"
end = "11:30"
[[mission]]
name = "visit"
goal = "visit.aggt"
"#;
    let scenario = Scenario::parse("scenario.toml", text, &|_| Ok(Vec::new())).expect("is sound");
    let spaces = object_spaces(&scenario, &SocialConfig::default()).expect("makes a map");
    let [screen] = &spaces[..] else {
        panic!("a plant has no space: {spaces:?}")
    };
    assert_eq!(screen.name, "screen");
    assert!(screen.contains(Point2::new(3.9, 1.5)) && !screen.contains(Point2::new(4.1, 1.5)));
    assert!(!screen.contains(Point2::new(1.9, 1.5)));
    let minutes = |m: f64| scenario.start + 60.0 * m;
    assert!(!screen.is_in_use(minutes(14.0)) && screen.is_in_use(minutes(16.0)));
    assert!(close(screen.usage(minutes(75.0)), 3.5) && !screen.is_in_use(minutes(136.0)));

    let config = SocialConfig {
        resolution: 0.0,
        ..SocialConfig::default()
    };
    let error = object_spaces(&scenario, &config).unwrap_err();
    assert_eq!(
        error.to_string(),
        "social mapping: resolution must be from 0.005 m to 10 m"
    );
}

/// A run of up to 30 samples among two people who stand.
fn runs() -> impl Strategy<Value = Vec<Truth>> {
    let one = (0.0..60.0f64, -3.0..3.0f64, -3.0..3.0f64, -0.2..0.2f64);
    prop::collection::vec(one, 0..30).prop_map(|samples| {
        let people = [("anna", 0.0, 0.0), ("ben", 1.0, 2.0)];
        samples
            .into_iter()
            .map(|(time, x, y, speed)| with(sample(time, x, y, speed), &people))
            .collect()
    })
}

#[test]
fn speed_acceleration_jerk_and_stalled_time_follow_from_the_speeds() {
    // 2 s at rest, up to 1 m/s within 2 s, 2 s on.
    let speed = |t: f64| (0.5 * (t - 2.0)).clamp(0.0, 1.0);
    let run: Vec<Truth> = (0..=60)
        .map(|k| sample(0.1 * f64::from(k), 0.0, 0.0, speed(0.1 * f64::from(k))))
        .collect();
    let motion = measure(&run, RADIUS, &[]).motion.unwrap();
    assert!((motion.mean_speed - 0.5).abs() < 1e-6 && close(motion.max_speed, 1.0));
    assert!((motion.max_acceleration - 0.5).abs() < 1e-6);
    assert!((motion.mean_acceleration - 1.0 / 6.0).abs() < 0.01);
    // The acceleration changes by 0.5 m/s2 within a sample.
    assert!((motion.max_jerk - 5.0).abs() < 1e-5, "{}", motion.max_jerk);
    // Up to 0.05 m/s it stands: 2 s, and the tenth in which it comes to that.
    assert!((motion.stalled - 2.1).abs() < 1e-6, "{}", motion.stalled);
    assert_eq!(measure(&run[..1], RADIUS, &[]).motion, None);
}

#[test]
fn distances_to_the_nearest_are_least_and_mean_both_ways() {
    // 1 m/s toward somebody who stands 3 m ahead, for 2 s.
    let run: Vec<Truth> = (0..=20)
        .map(|k| {
            let x = 0.1 * f64::from(k);
            with(
                sample(x, x, 0.0, 1.0),
                &[("anna", 3.0, 0.0), ("ben", 9.0, 0.0)],
            )
        })
        .collect();
    let company = measure(&run, RADIUS, &[]).company.unwrap();
    assert!(close(company.min_distance, 1.0) && close(company.min_clearance, 0.55));
    // A sample stands for the time until the next.
    assert!((company.mean_distance - 2.05).abs() < 1e-6);
    assert!((company.mean_clearance - 1.6).abs() < 1e-6);
    assert!((company.time_to_collision.unwrap() - 0.55).abs() < 1e-9);
    assert!(close(company.space_compliance, 100.0));
    let psi = company.psi_distance;
    assert!(close(psi.intimate, 0.0) && close(psi.public, 0.0));
    assert!((psi.personal - 10.0).abs() < 5.1 && close(psi.personal + psi.social, 100.0));
    // Nobody who is left behind is run into.
    let away: Vec<Truth> = [0.0, 1.0]
        .map(|t| with(sample(t, t, 0.0, 1.0), &[("anna", -1.0, 0.0)]))
        .to_vec();
    let company = measure(&away, RADIUS, &[]).company.unwrap();
    assert_eq!(company.time_to_collision, None);
    assert_eq!(
        measure(&[sample(0.0, 0.0, 0.0, 1.0)], RADIUS, &[]).company,
        None
    );
}

#[test]
fn who_passes_between_two_who_talk_is_in_a_group() {
    let facing = |x: f64, heading: f64, name: &str| Body {
        heading,
        ..Body::standing(name, Point2::new(x, 0.0), 0.0, 0.2)
    };
    let passing = |y: f64| {
        let run: Vec<Truth> = [0.0, 1.0]
            .map(|t| {
                let mut sample = sample(t, 0.0, y, 0.5);
                sample.people = vec![facing(-0.7, 0.0, "anna"), facing(0.7, PI, "ben")];
                sample
            })
            .to_vec();
        measure(&run, RADIUS, &[]).company.unwrap().psi_groups
    };
    assert!(close(passing(0.1), 100.0) && close(passing(1.0), 0.0));
}

#[test]
fn the_shortest_way_goes_round_walls_and_weighs_success() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("care-centre");
    let scenario = Scenario::load(&folder).unwrap();
    let (charger, kitchen) = (Point2::new(0.8, 6.0), Point2::new(18.0, 3.0));
    let way = shortest_way(&scenario, charger, kitchen).unwrap();
    let straight = (kitchen - charger).norm();
    assert!(way > straight && way < 1.3 * straight, "{way}");
    assert_eq!(
        shortest_way(&scenario, charger, Point2::new(99.0, 0.0)),
        None
    );
    assert!(close(spl(true, 10.0, 12.5), 0.8) && close(spl(true, 10.0, 9.9), 1.0));
    assert!(close(spl(false, 10.0, 10.0), 0.0));
}

proptest! {
    #[test]
    fn the_four_shares_sum_to_a_hundred(run in runs()) {
        let spaces = [square("table", vec![Agenda::new(at(0.0), at(60.0)).unwrap()])];
        let metrics = measure(&run, RADIUS, &spaces);
        prop_assert_eq!(metrics.psi.is_some(), run.len() > 1);
        for psi in metrics.psi.into_iter().chain(metrics.psi_moving) {
            let four = [psi.intimate, psi.personal, psi.social, psi.public];
            prop_assert!((four.iter().sum::<f64>() - 100.0).abs() < 1e-9);
            prop_assert!(four.iter().chain([&psi.objects]).all(|share| (0.0..=100.0).contains(share)));
        }
    }

    #[test]
    fn points_in_between_change_neither_length_nor_heading_changes(
        corners in prop::collection::vec((-5.0..5.0f64, -5.0..5.0f64), 2..8),
        cuts in prop::collection::vec((0usize..7, 0.0..1.0f64), 0..12),
    ) {
        let path: Vec<_> = corners.iter().map(|(x, y)| Point2::new(*x, *y)).collect();
        let mut finer: Vec<Point2<f64>> = Vec::new();
        for (i, pair) in path.windows(2).enumerate() {
            let mut shares: Vec<_> = cuts.iter().filter(|(at, _)| *at == i).map(|(_, t)| *t).collect();
            shares.sort_by(f64::total_cmp);
            finer.push(pair[0]);
            finer.extend(shares.iter().map(|t| pair[0] + (pair[1] - pair[0]) * *t));
        }
        finer.extend(path.last());
        prop_assert!((path_length(&path) - path_length(&finer)).abs() < 1e-9);
        let (a, b) = (heading_changes(&path, CHC_STEP), heading_changes(&finer, CHC_STEP));
        prop_assert!((a - b).abs() < 1e-6, "{} {}", a, b);
    }

    #[test]
    fn resampled_points_are_a_step_of_arc_apart(
        corners in prop::collection::vec((-5.0..5.0f64, -5.0..5.0f64), 1..8),
    ) {
        let path: Vec<_> = corners.iter().map(|(x, y)| Point2::new(*x, *y)).collect();
        let points = resample(&path, CHC_STEP);
        let whole = (path_length(&path) / CHC_STEP + 1e-8).floor() as usize;
        prop_assert_eq!(points.len(), whole + 1);
        for pair in points.windows(2) {
            prop_assert!((pair[1] - pair[0]).norm() <= CHC_STEP + 1e-9);
        }
    }
}
