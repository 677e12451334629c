//! A robot among people who walk on whatever it does, as recorded pedestrians do: how much of the
//! time it spends in their spaces with social behaviour and without.

use super::*;
use crate::grid::{BLOCKED, FREE};
use crate::navigation::people::{INTIMATE, PERSONAL, SOCIAL};
use crate::navigation::testing::{odometry, scan};
use nalgebra::{Isometry2, Vector2};
use std::f64::consts::PI;

const STEP: f64 = 0.1;
const SIZE: (f64, f64) = (20.0, 14.0);

/// `SplitMix64`: the same people for the same seed on every machine.
struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        low + (high - low) * ((z ^ (z >> 31)) as f64 / u64::MAX as f64)
    }
}

/// Walkers both ways across the robot's way, who come in again at the far end.
fn walkers(seed: u64, count: usize) -> Vec<Person> {
    let mut random = Random(seed);
    (0..count)
        .map(|k| {
            let speed = random.between(1.0, 1.5);
            let direction = if random.between(0.0, 1.0) < 0.5 {
                1.0
            } else {
                -1.0
            };
            let position = Vector2::new(
                random.between(-5.0, SIZE.0 + 5.0),
                random.between(3.0, 11.0),
            );
            let heading = if direction > 0.0 { 0.0 } else { PI };
            Person {
                name: format!("walker{k}"),
                world_from_person: Isometry2::new(position, heading),
                velocity: Vector2::new(direction * speed, 0.0),
                radius: 0.25,
            }
        })
        .collect()
}

fn walk(people: &mut [Person]) {
    for person in people {
        let x = &mut person.world_from_person.translation.vector.x;
        *x = (*x + person.velocity.x * STEP + 5.0).rem_euclid(SIZE.0 + 10.0) - 5.0;
    }
}

/// The grid as social mapping makes it: walls for all, spaces where people are now for the social.
fn grid(people: &[Person], social: bool) -> CostGrid {
    let mut grid = CostGrid::covering([0.0, 0.0, SIZE.0, SIZE.1], 0.1);
    let (width, height) = (grid.width, grid.height);
    for row in 0..height {
        for column in 0..width {
            let edge = column < 3 || row < 3 || column + 3 >= width || row + 3 >= height;
            grid.costs[row * width + column] = if edge { BLOCKED } else { FREE };
        }
    }
    for person in people.iter().filter(|_| social) {
        let now = person.predicted(0.0);
        let Some((x, y)) = grid.cell_at(now.position) else {
            continue;
        };
        for row in y.saturating_sub(22)..(y + 22).min(height) {
            for column in x.saturating_sub(22)..(x + 22).min(width) {
                let q = now.squared_deviation(grid.centre((column, row)));
                let zone = if q < INTIMATE {
                    BLOCKED
                } else if q < PERSONAL {
                    4.0
                } else if q < SOCIAL {
                    2.0
                } else {
                    FREE
                };
                let cost = &mut grid.costs[row * width + column];
                *cost = cost.max(zone);
            }
        }
    }
    grid
}

/// Samples by zone on the way, and how the way ended.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
struct Tally {
    intimate: usize,
    personal: usize,
    all: usize,
    touching: usize,
    arrived: usize,
}

/// What a tracker makes of people: late and inexact.
fn perceived(people: &[Person], noise: f64, random: &mut Random) -> Vec<Person> {
    let mut off = |scale: f64| {
        Vector2::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0)) * (scale * noise)
    };
    let perceive = |person: &Person| {
        let velocity = person.velocity + off(0.3);
        let position = person.position() - person.velocity * (0.1 * noise) + off(0.1);
        Person {
            world_from_person: Isometry2::new(position.coords, velocity.y.atan2(velocity.x)),
            velocity,
            ..person.clone()
        }
    };
    people.iter().map(perceive).collect()
}

fn cross(seed: u64, noise: f64, social: bool) -> Tally {
    let limits = Limits {
        radius: 0.25,
        max_speed: 0.6,
        max_turn: 1.0,
        ..Limits::default()
    };
    let corners = [(0.0, 0.0), (SIZE.0, 0.0), SIZE, (0.0, SIZE.1)].map(|(x, y)| Point2::new(x, y));
    let walls: Vec<Wall> = (0..4).map(|k| [corners[k], corners[(k + 1) % 4]]).collect();
    let task = Task {
        id: "cross".into(),
        target: Target::Point(Point2::new(SIZE.0 / 2.0, SIZE.1 - 1.0)),
    };
    let mut people = walkers(seed, 14);
    let mut random = Random(seed + 1000);
    let mut robot = Unicycle {
        position: Point2::new(SIZE.0 / 2.0, 1.0),
        heading: PI / 2.0,
        motion: Motion::default(),
    };
    let mut navigator = Navigator::new(Config::default());
    let mut tally = Tally::default();
    let mut now = Time::from_seconds(1000.0);
    for _ in 0..1200 {
        let scan = scan(now, &robot, &people, &walls);
        let odometry = odometry(now, &robot);
        let known = perceived(&people, noise, &mut random);
        let grid = grid(&known, social);
        let output = navigator.step(
            now,
            &Inputs {
                odometry: Some(&odometry),
                scan: Some(&scan),
                grid: Some(&grid),
                map: MapState::Current,
                walls: &walls,
                people: &known,
                task: Some(&task),
                limits,
                social,
            },
        );
        assert!(
            !matches!(output.status, Status::Failed(_)),
            "seed {seed}: {output:?}"
        );
        if output.status == Status::Arrived {
            tally.arrived = 1;
            break;
        }
        let command = Motion {
            linear: output.command.linear,
            lateral: output.command.lateral,
            angular: output.command.angular,
        };
        robot = robot.advanced(command, STEP);
        walk(&mut people);
        now = now + STEP;
        let closest = people
            .iter()
            .map(|p| p.predicted(0.0).squared_deviation(robot.position));
        let closest = closest.fold(f64::INFINITY, f64::min);
        tally.all += 1;
        tally.intimate += usize::from(closest < INTIMATE);
        tally.personal += usize::from((INTIMATE..PERSONAL).contains(&closest));
        let touches = people
            .iter()
            .any(|p| distance(&p.position(), &robot.position) < p.radius + 0.25);
        tally.touching += usize::from(touches);
    }
    tally
}

fn cross_all(noise: f64, social: bool) -> Tally {
    (0..SEEDS)
        .map(|seed| cross(seed, noise, social))
        .fold(Tally::default(), |sum, one| Tally {
            intimate: sum.intimate + one.intimate,
            personal: sum.personal + one.personal,
            all: sum.all + one.all,
            touching: sum.touching + one.touching,
            arrived: sum.arrived + one.arrived,
        })
}

const SEEDS: u64 = 20;

/// All crossings must end, take at most twice as long, and spend a far smaller share of the time in
/// intimate and personal space than a robot to which people are obstacles.
fn check(noise: f64, most: f64) {
    let (with, without) = (cross_all(noise, true), cross_all(noise, false));
    assert_eq!(
        (with.arrived, without.arrived),
        (SEEDS as usize, SEEDS as usize)
    );
    let share = |tally: &Tally| (tally.intimate + tally.personal) as f64 / tally.all as f64;
    assert!(share(&without) > 0.05, "the crowd is no trial: {without:?}");
    assert!(
        share(&with) < most * share(&without),
        "{with:?} {without:?}"
    );
    assert!(
        with.intimate * 10 <= without.intimate,
        "{with:?} {without:?}"
    );
    assert!(
        with.touching * 10 <= without.touching,
        "{with:?} {without:?}"
    );
    assert!(with.all <= 2 * without.all, "{with:?} {without:?}");
}

#[test]
fn social_behaviour_keeps_out_of_peoples_spaces_and_still_arrives() {
    check(0.0, 0.05);
}

#[test]
fn it_does_so_too_with_what_a_tracker_makes_of_people() {
    check(1.0, 0.3);
}
