//! The elastic band: what it gains, what it never gives up.

use super::super::obstacles::nearest;
use super::*;
use nalgebra::Isometry2;
use proptest::prelude::*;

const RADIUS: f64 = 0.3;

fn line(points: &[(f64, f64)]) -> Vec<Point2<f64>> {
    points.iter().map(|&(x, y)| Point2::new(x, y)).collect()
}

fn settle(band: &mut Band, obstacles: &Obstacles, people: &[Person], updates: usize) -> BandState {
    let around = Surroundings {
        obstacles,
        people,
        grid: None,
        radius: RADIUS,
        speed: 0.6,
    };
    let mut state = BandState::Moving;
    for _ in 0..updates {
        state = band.update(&around, &Gains::default(), 1);
    }
    state
}

fn person(x: f64, y: f64, velocity: (f64, f64)) -> Person {
    let velocity = Vector2::new(velocity.0, velocity.1);
    Person {
        name: "p".into(),
        world_from_person: Isometry2::new(Vector2::new(x, y), velocity.y.atan2(velocity.x)),
        velocity,
        radius: 0.25,
    }
}

#[test]
fn a_slack_band_tightens_to_the_straight_line() {
    let mut band = Band::new(
        &line(&[(0.0, 0.0), (2.0, 1.5), (4.0, 0.0)]),
        &Gains::default(),
    );
    assert!((band.length() - 5.0).abs() < 1e-9);
    settle(&mut band, &Obstacles::new(), &[], 400);
    assert!(band.length() < 4.05, "{}", band.length());
}

#[test]
fn a_band_gains_clearance_from_an_obstacle_and_stays_free() {
    let mut obstacles = Obstacles::new();
    obstacles.push_wall([Point2::new(2.0, -2.0), Point2::new(2.0, -0.35)]);
    let mut band = Band::new(&line(&[(0.0, 0.0), (4.0, 0.0)]), &Gains::default());
    assert_eq!(settle(&mut band, &obstacles, &[], 200), BandState::Settled);
    let least = band
        .points()
        .iter()
        .map(|p| obstacles.clearance(*p))
        .fold(f64::MAX, f64::min);
    assert!(least > 0.5, "{least}");
}

#[test]
fn a_door_lets_the_band_through_its_middle() {
    let mut obstacles = Obstacles::new();
    obstacles.push_wall([Point2::new(2.0, -3.0), Point2::new(2.0, -0.35)]);
    obstacles.push_wall([Point2::new(2.0, 0.55), Point2::new(2.0, 3.0)]);
    let mut band = Band::new(&line(&[(0.0, 0.0), (4.0, 0.0)]), &Gains::default());
    assert_eq!(settle(&mut band, &obstacles, &[], 200), BandState::Settled);
    let nearest = |p: &&Point2<f64>| (p.x - 2.0).abs();
    let gate = band
        .points()
        .iter()
        .min_by(|a, b| nearest(a).total_cmp(&nearest(b)))
        .unwrap();
    assert!((gate.y - 0.1).abs() < 0.08, "{gate}");
}

#[test]
fn a_wall_across_the_band_breaks_it_only_after_some_updates() {
    let mut obstacles = Obstacles::new();
    obstacles.push_wall([Point2::new(2.0, -9.0), Point2::new(2.0, 9.0)]);
    let mut band = Band::new(&line(&[(0.0, 0.0), (4.0, 0.0)]), &Gains::default());
    assert_eq!(settle(&mut band, &obstacles, &[], 1), BandState::Moving);
    let BandState::Broken { at } = settle(&mut band, &obstacles, &[], 10) else {
        panic!("the band goes through a wall");
    };
    assert!((at.x - 2.0).abs() < RADIUS);
}

#[test]
fn the_band_bends_out_of_the_space_of_somebody_who_stands_beside_it() {
    let people = [person(2.0, -0.2, (0.0, 0.0))];
    let mut band = Band::new(&line(&[(0.0, 0.0), (4.0, 0.0)]), &Gains::default());
    settle(&mut band, &Obstacles::new(), &people, 200);
    let deepest = band
        .points()
        .iter()
        .map(|p| people[0].predicted(0.0).squared_deviation(*p))
        .fold(f64::MAX, f64::min);
    assert!(deepest > super::super::people::PERSONAL, "{deepest}");
}

#[test]
fn somebody_who_will_be_gone_does_not_bend_the_band() {
    // At 1.2 m/s they are 4 m away when the robot, at 0.6 m/s, has come 2 m.
    let people = [person(2.0, 0.0, (0.0, 1.2))];
    let straight = line(&[(0.0, 0.0), (4.0, 0.0)]);
    let mut band = Band::new(&straight, &Gains::default());
    settle(&mut band, &Obstacles::new(), &people, 50);
    assert!(band.points().iter().all(|p| p.y.abs() < 1e-9));
    // One who arrives when the robot does bends it, to the side they come from.
    let people = [person(2.0, -4.0, (0.0, 1.2))];
    settle(&mut band, &Obstacles::new(), &people, 50);
    let middle = band.points().iter().find(|p| p.x > 1.9).unwrap();
    assert!(middle.y < -0.05, "{middle}");
}

#[test]
fn what_the_robot_has_passed_is_dropped() {
    let mut band = Band::new(&line(&[(0.0, 0.0), (2.0, 0.0)]), &Gains::default());
    band.follow(Point2::new(0.6, 0.1), 1.5);
    assert_eq!(band.points()[0], Point2::new(0.6, 0.1));
    assert_eq!(band.points()[1], Point2::new(0.75, 0.0));
    assert_eq!(band.points().last(), Some(&Point2::new(2.0, 0.0)));
    band.follow(Point2::new(2.1, 0.0), 3.0);
    assert_eq!(band.points(), &line(&[(2.1, 0.0), (2.0, 0.0)])[..]);
}

#[test]
fn the_band_does_not_tighten_into_what_the_grid_holds_dearer() {
    let mut grid = CostGrid::covering([-1.0, -3.0, 5.0, 3.0], 0.05);
    for k in 0..grid.costs.len() {
        let place = grid.centre((k % grid.width, k / grid.width));
        if (1.0..3.0).contains(&place.x) && place.y < 0.8 {
            grid.costs[k] = 3.5;
        }
    }
    let obstacles = Obstacles::new();
    let around = Surroundings {
        obstacles: &obstacles,
        people: &[],
        grid: Some(&grid),
        radius: RADIUS,
        speed: 0.6,
    };
    let corners = [(0.0, 0.0), (0.5, 1.2), (3.5, 1.2), (4.0, 0.0)];
    let gains = Gains::default();
    let mut band = Band::new(&line(&corners), &gains);
    let before = band.length();
    for _ in 0..300 {
        band.update(&around, &gains, 1);
    }
    let dear = |p: &&Point2<f64>| grid.cost(grid.cell_at(**p).unwrap()) > 1.0;
    assert_eq!(band.points().iter().filter(dear).count(), 0);
    assert!(band.length() < before - 0.2, "{before} {}", band.length());
}

/// Somewhere between the points of a band the robot touches by no more than this, metres: a quarter
/// of a spacing away from the nearest place that is looked at.
const BETWEEN: f64 = 0.01;

/// Obstacles of single points, and a band from left to right that is clear of them.
fn free_band(corners: &[(f64, f64)], points: &[(f64, f64)]) -> (Band, Obstacles) {
    let band = Band::new(&line(corners), &Gains::default());
    let mut obstacles = Obstacles::new();
    for &(x, y) in points {
        let point = Point2::new(x, y);
        let clear = |pair: &[Point2<f64>]| {
            distance(&nearest(&[pair[0], pair[1]], point), &point) > RADIUS + 0.02
        };
        if band.points().windows(2).all(clear) {
            obstacles.push_point(point);
        }
    }
    (band, obstacles)
}

proptest! {
    #[test]
    fn a_free_band_settles_or_breaks_and_is_free_all_along_meanwhile(
        corners in proptest::collection::vec((0.0..6.0, -2.0..2.0), 2..5),
        points in proptest::collection::vec((0.0..6.0, -2.0..2.0), 0..30),
    ) {
        let (mut band, obstacles) = free_band(&corners, &points);
        let mut state = BandState::Moving;
        for _ in 0..1500 {
            state = settle(&mut band, &obstacles, &[], 1);
            if state != BandState::Moving {
                break;
            }
            prop_assert_eq!(band.radii().len(), band.points().len());
            for pair in band.points().windows(2) {
                for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
                    let place = pair[0] + (pair[1] - pair[0]) * share;
                    let clearance = obstacles.clearance(place);
                    prop_assert!(clearance > RADIUS - BETWEEN, "{clearance} at {place}");
                }
            }
        }
        prop_assert!(state != BandState::Moving);
    }

    #[test]
    fn no_force_moves_a_point_to_an_obstacle(
        corners in proptest::collection::vec((0.0..6.0, -2.0..2.0), 3..6),
        points in proptest::collection::vec((0.0..6.0, -2.0..2.0), 1..30),
        people in proptest::collection::vec((0.0..6.0, -2.0..2.0, -1.0..1.0, -1.0..1.0), 0..4),
    ) {
        let mut obstacles = Obstacles::new();
        for &(x, y) in &points {
            obstacles.push_point(Point2::new(x, y));
        }
        let people: Vec<_> =
            people.iter().map(|&(x, y, vx, vy)| person(x, y, (vx, vy))).collect();
        let gains = Gains::default();
        let around =
            Surroundings { obstacles: &obstacles, people: &people, grid: None, radius: RADIUS, speed: 0.6 };
        let mut band = Band::new(&line(&corners), &gains);
        for _ in 0..10 {
            band.space(gains.spacing, |_, _| true);
            for i in 1..band.points.len() - 1 {
                let old = obstacles.clearance(band.points[i]);
                band.relax(i, &obstacles, &around, &gains, 1.0);
                let new = obstacles.clearance(band.points[i]);
                prop_assert!(new >= RADIUS.min(old) - 1e-12, "{old} {new}");
            }
        }
    }

    #[test]
    fn points_stay_evenly_spaced(corners in proptest::collection::vec((0.0..6.0, -2.0..2.0), 2..8)) {
        let gains = Gains::default();
        let mut band = Band::new(&line(&corners), &gains);
        for _ in 0..20 {
            settle(&mut band, &Obstacles::new(), &[], 1);
            band.space(gains.spacing, |_, _| true);
            for pair in band.points.windows(2) {
                prop_assert!(distance(&pair[0], &pair[1]) <= gains.spacing + 1e-9);
            }
            let most = 4.0 * band.length() / gains.spacing + 3.0;
            prop_assert!((band.points.len() as f64) <= most);
        }
    }
}
