//! The navigator as a whole: tasks from start to end among walls and people.

use super::*;
use crate::grid::BLOCKED;
use crate::navigation::control::Base;
use crate::navigation::people::{INTIMATE, PERSONAL};
use crate::navigation::testing::{odometry, scan};
use nalgebra::{Isometry2, Vector2};
use std::f64::consts::FRAC_PI_2;

const STEP: f64 = 0.1;

/// An empty hall of 8 m by 6 m with a robot at its left.
struct Hall {
    robot: Unicycle,
    now: Time,
    walls: Vec<Wall>,
    /// What the laser meets and the map does not know.
    unknown: Vec<Wall>,
    grid: CostGrid,
    people: Vec<Person>,
    base: Base,
    social: bool,
    map: MapState,
    navigator: Navigator,
    least_clearance: f64,
}

fn wall(ax: f64, ay: f64, bx: f64, by: f64) -> Wall {
    [Point2::new(ax, ay), Point2::new(bx, by)]
}

fn point(x: f64, y: f64) -> Task {
    Task {
        id: format!("{x} {y}"),
        target: Target::Point(Point2::new(x, y)),
    }
}

fn person(x: f64, y: f64, heading: f64) -> Person {
    Person {
        name: "ana".into(),
        world_from_person: Isometry2::new(Vector2::new(x, y), heading),
        velocity: Vector2::zeros(),
        radius: 0.25,
    }
}

impl Hall {
    fn new() -> Self {
        let walls = vec![
            wall(0.0, 0.0, 8.0, 0.0),
            wall(8.0, 0.0, 8.0, 6.0),
            wall(8.0, 6.0, 0.0, 6.0),
            wall(0.0, 6.0, 0.0, 0.0),
        ];
        let mut hall = Self {
            robot: Unicycle {
                position: Point2::new(1.0, 3.0),
                heading: 0.0,
                motion: Motion::default(),
            },
            now: Time::from_seconds(100.0),
            walls,
            unknown: Vec::new(),
            grid: CostGrid::covering([0.0, 0.0, 8.0, 6.0], 0.1),
            people: Vec::new(),
            base: Base::default(),
            social: false,
            map: MapState::Current,
            navigator: Navigator::default(),
            least_clearance: f64::INFINITY,
        };
        hall.block_walls();
        hall
    }

    /// Blocks what is too close to a wall of the map.
    fn block_walls(&mut self) {
        let mut obstacles = Obstacles::new();
        for &wall in &self.walls {
            obstacles.push_wall(wall);
        }
        for k in 0..self.grid.costs.len() {
            let cell = (k % self.grid.width, k / self.grid.width);
            if obstacles.clearance(self.grid.centre(cell)) < 0.25 {
                self.grid.costs[k] = BLOCKED;
            }
        }
    }

    fn step(&mut self, task: Option<&Task>) -> Output {
        let solid: Vec<Wall> = self.walls.iter().chain(&self.unknown).copied().collect();
        let scan = scan(self.now, &self.robot, &self.people, &solid);
        let odometry = odometry(self.now, &self.robot);
        let inputs = Inputs {
            odometry: Some(&odometry),
            scan: Some(&scan),
            grid: Some(&self.grid),
            map: self.map,
            walls: &self.walls,
            people: &self.people,
            task,
            limits: Limits {
                base: self.base,
                max_speed: 0.6,
                max_turn: 1.0,
                ..Limits::default()
            },
            social: self.social,
        };
        let output = self.navigator.step(self.now, &inputs);
        let motion = Motion {
            linear: output.command.linear,
            lateral: output.command.lateral,
            angular: output.command.angular,
        };
        self.robot = self.robot.advanced(motion, STEP);
        self.now = self.now + STEP;
        let mut obstacles = Obstacles::new();
        for wall in solid {
            obstacles.push_wall(wall);
        }
        self.least_clearance = self
            .least_clearance
            .min(obstacles.clearance(self.robot.position));
        output
    }

    /// Until the task has ended, at most so many seconds; its end and how long it took.
    fn run(&mut self, task: &Task, seconds: f64) -> (Status, f64) {
        let mut status = Status::Idle;
        for k in 0..(seconds / STEP) as usize {
            status = self.step(Some(task)).status;
            if matches!(status, Status::Arrived | Status::Failed(_)) {
                return (status, k as f64 * STEP);
            }
        }
        (status, seconds)
    }
}

#[test]
fn a_point_in_a_hall_is_reached_by_one_plan_and_without_detour() {
    let mut hall = Hall::new();
    let (status, took) = hall.run(&point(6.5, 4.0), 30.0);
    assert_eq!(status, Status::Arrived);
    assert!(distance(&hall.robot.position, &Point2::new(6.5, 4.0)) < 0.15);
    assert!(took < 14.0, "{took} s for 5.6 m at 0.6 m/s");
    assert_eq!(hall.navigator.plans(), 1);
    assert!(hall.navigator.path().is_empty());
    // It stays so, and stands.
    let output = hall.step(Some(&point(6.5, 4.0)));
    assert_eq!(output.status, Status::Arrived);
    assert_eq!(hall.step(None).status, Status::Idle);
}

#[test]
fn a_pose_is_met_with_its_heading() {
    let mut hall = Hall::new();
    let pose = Isometry2::new(Vector2::new(3.0, 2.0), -FRAC_PI_2);
    let task = Task {
        id: "pose".into(),
        target: Target::Pose(pose),
    };
    assert_eq!(hall.run(&task, 30.0).0, Status::Arrived);
    assert!(wrapped(hall.robot.heading + FRAC_PI_2).abs() <= 0.1);
}

#[test]
fn without_fresh_readings_the_robot_stands() {
    let mut hall = Hall::new();
    let task = point(6.5, 3.0);
    let odometry = odometry(hall.now, &hall.robot);
    let scan = scan(hall.now, &hall.robot, &[], &hall.walls);
    let inputs = Inputs {
        odometry: Some(&odometry),
        scan: Some(&scan),
        grid: None,
        map: MapState::Current,
        walls: &hall.walls,
        people: &[],
        task: Some(&task),
        limits: Limits::default(),
        social: true,
    };
    let no_grid = hall.navigator.step(hall.now, &inputs);
    let late = hall.navigator.step(hall.now + 0.6, &inputs);
    let no_scan = hall.navigator.step(
        hall.now,
        &Inputs {
            scan: None,
            ..inputs
        },
    );
    for (output, cause) in [
        (no_grid, Cause::NoGrid),
        (late, Cause::NoOdometry),
        (no_scan, Cause::NoScan),
    ] {
        assert_eq!(output.status, Status::Waiting(cause));
        assert_eq!((output.command.linear, output.command.angular), (0.0, 0.0));
    }
}

#[test]
fn by_a_lost_map_the_robot_stands_until_there_is_one_again() {
    let mut hall = Hall::new();
    let task = point(6.5, 3.0);
    for _ in 0..30 {
        hall.step(Some(&task));
    }
    hall.map = MapState::Lost;
    let mut output = hall.step(Some(&task));
    // Longer than it would look for a way out, or give up.
    for _ in 0..(100.0 / STEP) as usize {
        output = hall.step(Some(&task));
    }
    assert_eq!(output.status, Status::Waiting(Cause::OldGrid));
    assert!(output.command.linear.abs() < 1e-9);
    assert!(!hall.navigator.path().is_empty(), "its way is kept");
    hall.map = MapState::Current;
    assert_eq!(hall.run(&task, 30.0).0, Status::Arrived);
}

#[test]
fn an_omnidirectional_robot_arrives_without_turning_in_place_first() {
    let took = |base| {
        let mut hall = Hall::new();
        hall.robot.heading = FRAC_PI_2;
        hall.base = base;
        let (status, took) = hall.run(&point(6.5, 3.0), 40.0);
        assert_eq!(status, Status::Arrived, "{base:?}");
        took
    };
    let (plain, omni) = (took(Base::Differential), took(Base::Omnidirectional));
    assert!(omni < plain - 0.8, "{omni} {plain}");
}

#[test]
fn a_path_that_the_grid_closes_is_planned_anew() {
    let mut hall = Hall::new();
    let task = point(6.5, 3.0);
    for _ in 0..30 {
        hall.step(Some(&task));
    }
    assert_eq!(hall.navigator.plans(), 1);
    hall.walls.push(wall(4.5, 1.2, 4.5, 6.0));
    hall.block_walls();
    assert_eq!(hall.run(&task, 40.0).0, Status::Arrived);
    assert!(
        (2..6).contains(&hall.navigator.plans()),
        "{}",
        hall.navigator.plans()
    );
    assert!(hall.least_clearance > 0.25);
}

#[test]
fn a_door_that_opens_on_the_way_is_taken_and_a_change_elsewhere_is_not_heeded() {
    let mut hall = Hall::new();
    hall.walls.push(wall(4.0, 0.0, 4.0, 2.5));
    hall.walls.push(wall(4.0, 3.5, 4.0, 5.0));
    let without_door = hall.walls.clone();
    hall.walls.push(wall(4.0, 2.5, 4.0, 3.5));
    hall.block_walls();
    let task = point(6.5, 3.0);
    for _ in 0..5 {
        hall.step(Some(&task));
    }
    let highest = |hall: &Hall| {
        let path = hall.navigator.path().iter();
        path.map(|place| place.y).fold(0.0, f64::max)
    };
    assert!(highest(&hall) > 5.0, "the door is shut");
    // Something is put into a corner.
    hall.grid.costs[5 * 80 + 75] = BLOCKED;
    for _ in 0..12 {
        hall.step(Some(&task));
    }
    assert_eq!(hall.navigator.plans(), 1);
    hall.walls = without_door;
    hall.grid = CostGrid::covering([0.0, 0.0, 8.0, 6.0], 0.1);
    hall.block_walls();
    for _ in 0..15 {
        hall.step(Some(&task));
    }
    assert!(highest(&hall) < 4.5, "{}", highest(&hall));
    assert_eq!(hall.run(&task, 30.0).0, Status::Arrived);
    assert_eq!(hall.navigator.plans(), 2);
}

#[test]
fn an_activity_that_begins_on_the_way_is_driven_round() {
    let mut hall = Hall::new();
    let task = point(6.5, 3.0);
    for _ in 0..5 {
        hall.step(Some(&task));
    }
    // The space before an object in use (READING.md item 7).
    for k in 0..hall.grid.costs.len() {
        let place = hall.grid.centre((k % hall.grid.width, k / hall.grid.width));
        if (3.0..5.0).contains(&place.x) && (0.0..3.6).contains(&place.y) {
            hall.grid.costs[k] = hall.grid.costs[k].max(3.5);
        }
    }
    let mut lowest = f64::INFINITY;
    while hall.step(Some(&task)).status == Status::Moving {
        if (3.2..4.8).contains(&hall.robot.position.x) {
            lowest = lowest.min(hall.robot.position.y);
        }
    }
    assert!(lowest > 3.5, "{lowest}");
    assert_eq!(hall.navigator.plans(), 2);
}

#[test]
fn where_start_or_goal_are_blocked_the_nearest_places_that_can_be_reached_serve() {
    let mut hall = Hall::new();
    let disc = |hall: &mut Hall, x: f64, y: f64| {
        for k in 0..hall.grid.costs.len() {
            let cell = (k % hall.grid.width, k / hall.grid.width);
            if distance(&hall.grid.centre(cell), &Point2::new(x, y)) < 0.5 {
                hall.grid.costs[k] = BLOCKED;
            }
        }
    };
    disc(&mut hall, 1.0, 3.0);
    disc(&mut hall, 6.5, 3.0);
    assert_eq!(hall.run(&point(6.5, 3.0), 30.0).0, Status::Arrived);
    let gap = distance(&hall.robot.position, &Point2::new(6.5, 3.0));
    assert!(gap < 0.8, "{gap}");
}

#[test]
fn what_only_the_laser_sees_is_driven_round() {
    for base in Base::ALL {
        let mut hall = Hall::new();
        hall.base = base;
        hall.unknown.push(wall(4.0, 0.0, 4.0, 4.2));
        assert_eq!(
            hall.run(&point(6.5, 3.0), 60.0).0,
            Status::Arrived,
            "{base:?}"
        );
        assert!(
            hall.least_clearance > 0.25,
            "{base:?} {}",
            hall.least_clearance
        );
    }
}

#[test]
fn a_goal_beyond_a_wall_fails_with_the_reason() {
    let mut hall = Hall::new();
    hall.walls.push(wall(4.0, 0.0, 4.0, 6.0));
    hall.block_walls();
    let (status, took) = hall.run(&point(6.5, 3.0), 30.0);
    assert!(matches!(
        status,
        Status::Failed(Failure::NoPath(PathError::Unreachable { .. }))
    ));
    assert!((19.0..22.0).contains(&took), "{took}");
    // Another task is another chance.
    assert_eq!(hall.run(&point(2.5, 4.0), 30.0).0, Status::Arrived);
}

#[test]
fn a_robot_that_is_shut_in_says_so_and_touches_nothing() {
    let mut hall = Hall::new();
    hall.unknown = vec![
        wall(0.5, 2.5, 2.0, 2.5),
        wall(2.0, 2.5, 2.0, 3.5),
        wall(2.0, 3.5, 0.5, 3.5),
        wall(0.5, 3.5, 0.5, 2.5),
    ];
    let (status, took) = hall.run(&point(6.5, 3.0), 150.0);
    assert!(matches!(status, Status::Failed(_)), "{status:?}");
    assert!(took < 110.0, "{took}");
    assert!(hall.least_clearance > 0.25, "{}", hall.least_clearance);
}

#[test]
fn a_region_is_entered_well_beyond_its_entry() {
    let mut hall = Hall::new();
    let corners = [(4.0, 0.0), (8.0, 0.0), (8.0, 6.0), (4.0, 6.0)];
    let target = Target::Region {
        polygon: corners.map(|(x, y)| Point2::new(x, y)).to_vec(),
        entry: Some(Point2::new(4.0, 3.0)),
    };
    let task = Task {
        id: "room".into(),
        target,
    };
    assert_eq!(hall.run(&task, 30.0).0, Status::Arrived);
    assert!(
        (4.3..5.3).contains(&hall.robot.position.x),
        "{}",
        hall.robot.position
    );
}

#[test]
fn the_social_robot_keeps_out_of_the_space_of_one_who_stands() {
    let deepest = |social: bool| {
        let mut hall = Hall::new();
        hall.people.push(person(4.0, 3.9, -FRAC_PI_2));
        hall.social = social;
        let space = hall.people[0].predicted(0.0);
        if social {
            for k in 0..hall.grid.costs.len() {
                let cell = (k % hall.grid.width, k / hall.grid.width);
                let q = space.squared_deviation(hall.grid.centre(cell));
                let cost = if q < INTIMATE {
                    BLOCKED
                } else if q < PERSONAL {
                    4.0
                } else {
                    1.0
                };
                hall.grid.costs[k] = hall.grid.costs[k].max(cost);
            }
        }
        let task = point(7.0, 3.0);
        let mut deepest = f64::INFINITY;
        for _ in 0..400 {
            if hall.step(Some(&task)).status == Status::Arrived {
                return deepest;
            }
            deepest = deepest.min(space.squared_deviation(hall.robot.position));
        }
        panic!("social {social}: not arrived, {}", hall.robot.position);
    };
    let (with, without) = (deepest(true), deepest(false));
    assert!(with > PERSONAL && without < PERSONAL, "{with} {without}");
}

#[test]
fn the_social_robot_goes_slower_near_who_stands() {
    let fastest = |social: bool| {
        let mut hall = Hall::new();
        hall.people.push(person(4.0, 4.2, -FRAC_PI_2));
        hall.social = social;
        let task = point(7.0, 3.0);
        let mut fastest: f64 = 0.0;
        for _ in 0..400 {
            let output = hall.step(Some(&task));
            if output.status == Status::Arrived {
                break;
            }
            if (3.5..4.5).contains(&hall.robot.position.x) {
                fastest = fastest.max(output.command.linear);
            }
        }
        fastest
    };
    assert!(fastest(true) < 0.9 * fastest(false));
}

#[test]
fn equal_inputs_give_equal_commands_to_the_bit() {
    let commands = || {
        let mut hall = Hall::new();
        hall.social = true;
        hall.people.push(Person {
            velocity: Vector2::new(0.0, -1.0),
            ..person(4.0, 6.5, 4.7)
        });
        (0..150)
            .map(|_| {
                hall.people[0].world_from_person.translation.vector.y -= 0.1;
                let command = hall.step(Some(&point(6.5, 3.0))).command;
                (command.linear.to_bits(), command.angular.to_bits())
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(commands(), commands());
}
