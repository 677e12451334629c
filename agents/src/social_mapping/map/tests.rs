//! The social grid: what each place costs, with and without social behaviour.

use super::*;
use crate::grid::{BLOCKED, FREE};
use crate::social_mapping::object_space::{Outline, UsageCurve};
use crate::social_mapping::scene::{Activity, Manner, Wall};
use nalgebra::Vector2;
use std::f64::consts::{FRAC_PI_2, PI};

mod updating;

const NOON: f64 = 1_800_000_000.0;

fn noon() -> Time {
    Time::from_seconds(NOON)
}

fn pose(x: f64, y: f64, heading: f64) -> Isometry2<f64> {
    Isometry2::new(Vector2::new(x, y), heading)
}

fn person(name: &str, world_from_person: Isometry2<f64>) -> Person {
    Person {
        name: name.to_owned(),
        world_from_person,
        velocity: Vector2::zeros(),
        radius: 0.25,
        manner: Manner::default(),
    }
}

fn object(name: &str, class: &str, x: f64, y: f64, outline: Outline) -> Object {
    let world_from_object = pose(x, y, 0.0);
    Object {
        name: name.to_owned(),
        class: class.to_owned(),
        world_from_object,
        outline,
    }
}

fn wall(a: (f64, f64), b: (f64, f64)) -> Wall {
    [Point2::new(a.0, a.1), Point2::new(b.0, b.1)]
}

/// A hall of 12 m by 10 m, with nothing in it.
fn hall() -> SocialScene {
    SocialScene {
        bounds: [0.0, 0.0, 12.0, 10.0],
        robot_radius: 0.25,
        social: true,
        ..SocialScene::default()
    }
}

fn update(scene: &SocialScene) -> Update {
    SocialMapper::new(SocialConfig::default())
        .unwrap()
        .update(noon(), scene)
        .unwrap()
}

fn cost(update: &Update, x: f64, y: f64) -> f32 {
    update
        .grid
        .cost(update.grid.cell_at(Point2::new(x, y)).unwrap())
}

#[track_caller]
fn assert_cost(update: &Update, x: f64, y: f64, expected: f32) {
    let found = cost(update, x, y);
    assert!(
        found.total_cmp(&expected).is_eq() || (found - expected).abs() < 1e-6,
        "{found} at ({x}, {y})"
    );
}

#[test]
fn zones_cost_what_the_papers_say() {
    let mut scene = hall();
    scene.people.push(person("ana", pose(5.0, 5.05, 0.0)));
    let map = update(&scene);
    for (ahead, expected) in [(0.41, BLOCKED), (0.95, 4.0), (1.55, 2.0), (2.35, FREE)] {
        assert_cost(&map, 5.0 + ahead, 5.05, expected);
    }
    // Behind, the body and the robot's radius reach further than the intimate zone.
    assert_cost(&map, 5.0 - 0.45, 5.05, BLOCKED);
    assert_cost(&map, 5.0 - 0.75, 5.05, 2.0);
    let spaces = &map.people[0];
    assert_eq!(spaces.personal.len(), 24);
    assert!(spaces.intimate.iter().all(|p| p.x < 5.47) && spaces.social.iter().any(|p| p.x > 7.1));
}

#[test]
fn without_social_behaviour_people_are_mere_discs_and_objects_mere_furniture() {
    let mut scene = hall();
    scene.social = false;
    scene.people = vec![
        person("ana", pose(5.05, 5.05, 0.0)),
        person("bo", pose(6.55, 5.05, PI)),
    ];
    scene.interactions.push(("ana".into(), "bo".into()));
    scene.objects.push(object(
        "t",
        "table",
        2.0,
        2.0,
        Outline::Rectangle(Vector2::new(1.0, 1.0)),
    ));
    let map = update(&scene);
    assert_cost(&map, 5.45, 5.05, BLOCKED);
    assert_cost(&map, 5.65, 5.05, FREE);
    assert_cost(&map, 2.65, 2.0, BLOCKED);
    assert_cost(&map, 3.15, 2.0, FREE);
    assert!(map.people.is_empty() && map.objects.is_empty() && map.rejected.is_empty());
}

#[test]
fn walls_are_inflated_by_the_robot_and_dearer_beside_it() {
    let mut scene = hall();
    scene.walls.push(wall((0.0, 5.0), (12.0, 5.0)));
    let map = update(&scene);
    assert_cost(&map, 6.0, 5.25, BLOCKED);
    // The cell's centre is 0.35 m from the wall: 0.1 m of 0.3 m beyond the robot's radius.
    assert_cost(&map, 6.0, 5.35, 1.0 + 0.4 * 2.0 / 3.0);
    assert_cost(&map, 6.0, 5.65, FREE);
    assert!(SocialConfig::default().clearance_cost + 1.0 < UsageCurve::default().least);
}

#[test]
fn no_path_slips_through_a_slanted_wall_however_slim_the_robot() {
    let mut scene = hall();
    scene.robot_radius = 0.0;
    scene.walls.push(wall((0.0, 1.3), (12.0, 8.9)));
    let grid = update(&scene).grid;
    let mut reached = vec![false; grid.costs.len()];
    let mut open = vec![(5, 0)];
    while let Some((column, row)) = open.pop() {
        let index = grid.index((column, row));
        if reached[index] || grid.costs[index] == BLOCKED {
            continue;
        }
        reached[index] = true;
        let columns = column.saturating_sub(1)..(column + 2).min(grid.width);
        open.extend(columns.flat_map(|c| {
            (row.saturating_sub(1)..(row + 2).min(grid.height)).map(move |r| (c, r))
        }));
    }
    assert!(reached[grid.index((115, 5))] && !reached[grid.index((5, 95))]);
}

#[test]
fn objects_claim_their_space_as_their_agenda_says() {
    let mut scene = hall();
    let table = Outline::Rectangle(Vector2::new(2.0, 1.0));
    scene
        .objects
        .push(object("table", "table", 4.0, 4.0, table));
    scene
        .objects
        .push(object("plant", "plant", 9.0, 9.0, Outline::Circle(0.2)));
    scene.activities.push(Activity {
        name: "therapy".into(),
        object: "table".into(),
        start: noon() + 3600.0,
        end: noon() + 5400.0,
    });
    let mut mapper = SocialMapper::new(SocialConfig::default()).unwrap();
    for (after, usage) in [
        (0.0, 1.5),
        (2250.0, 2.5),
        (3600.0, 3.5),
        (5400.0, 3.5),
        (9000.0, 1.5),
    ] {
        let map = mapper.update(noon() + after, &scene).unwrap();
        assert!((map.objects[0].usage - usage).abs() < 1e-9);
        assert_cost(&map, 5.35, 4.0, usage as f32);
        assert_cost(&map, 4.0, 4.95, usage as f32);
        assert_cost(&map, 4.0, 4.0, BLOCKED);
        assert_cost(&map, 5.55, 4.0, FREE);
        assert_eq!(map.objects.len(), 1, "a plant is only in the way");
        assert_cost(&map, 9.35, 9.05, BLOCKED);
    }
}

#[test]
fn the_larger_cost_holds_where_spaces_overlap() {
    let mut scene = hall();
    scene.objects.push(object(
        "tv",
        "tv",
        2.0,
        5.0,
        Outline::Rectangle(Vector2::new(0.1, 1.0)),
    ));
    scene.people.push(person("ana", pose(4.0, 5.0, PI)));
    let map = update(&scene);
    assert_cost(&map, 3.05, 5.05, 4.0);
    assert_cost(&map, 2.45, 5.05, 2.0);
    assert_cost(&map, 5.35, 5.05, 1.5);
}

#[test]
fn a_wall_keeps_a_televisions_space_in_its_room() {
    let mut scene = hall();
    scene.objects.push(object(
        "tv",
        "tv",
        2.0,
        5.0,
        Outline::Rectangle(Vector2::new(0.1, 1.0)),
    ));
    scene.walls.push(wall((4.0, 0.0), (4.0, 10.0)));
    let map = update(&scene);
    assert_cost(&map, 3.35, 5.05, 1.5);
    assert_cost(&map, 4.65, 5.05, FREE);
    assert!(map.objects[0].space.iter().all(|p| p.x < 4.0 + 1e-9));
}

#[test]
fn the_robot_does_not_pass_between_two_who_talk_unless_it_must() {
    let mut scene = hall();
    scene.people = vec![
        person("ana", pose(3.0, 5.0, PI)),
        person("bo", pose(6.0, 5.0, 0.0)),
    ];
    // Back to back and 3 m apart, so that the middle is in nobody's own zone.
    assert_cost(&update(&scene), 4.5, 5.0, FREE);
    scene.interactions = vec![("bo".into(), "ana".into()), ("ana".into(), "bo".into())];
    let map = update(&scene);
    assert_cost(&map, 4.5, 5.45, 4.0);
    assert_cost(&map, 4.5, 5.55, FREE);
    assert!(map.rejected.is_empty());
}

#[test]
fn the_space_of_a_walking_person_reaches_ahead_on_the_grid_and_in_its_outline() {
    let mut scene = hall();
    scene.people.push(person("ana", pose(5.0, 5.05, FRAC_PI_2)));
    let standing = update(&scene);
    scene.people[0].velocity = Vector2::new(0.0, 1.2);
    let walking = update(&scene);
    assert_cost(&standing, 5.0, 7.35, FREE);
    assert_cost(&walking, 5.0, 7.35, 2.0);
    assert_cost(&walking, 5.0, 5.05 + 0.65, BLOCKED);
    // The outline is the edge of what the grid has: a cell further, another zone.
    let edge = walking.people[0].personal.iter().map(|p| p.y);
    let edge = edge.fold(f64::NEG_INFINITY, f64::max);
    assert!((edge - (5.05 + 1.6 * (-2.0 * 0.5f64.ln()).sqrt())).abs() < 1e-9);
    assert_cost(&walking, 5.0, edge - 0.1, 4.0);
    assert_cost(&walking, 5.0, edge + 0.1, 2.0);
    let config = SocialConfig {
        stretch: false,
        ..SocialConfig::default()
    };
    let plain = SocialMapper::new(config)
        .unwrap()
        .update(noon(), &scene)
        .unwrap();
    assert_eq!(plain.grid, standing.grid);
    assert_eq!(plain.people[0].personal, standing.people[0].personal);
}

#[test]
fn bad_items_are_left_out_or_mended_and_always_reported() {
    let mut scene = hall();
    let nan = f64::NAN;
    scene.people = vec![
        person("ghost", pose(nan, 5.0, 0.0)),
        Person {
            velocity: Vector2::new(nan, 0.0),
            radius: -1.0,
            ..person("ana", pose(3.0, 5.0, 0.0))
        },
        person("bo", pose(9.0, 5.0, PI)),
        person("voyager", pose(1e100, 5.0, 0.0)),
    ];
    scene.interactions = vec![("ana".into(), "bo".into()), ("ghost".into(), "ana".into())];
    scene.objects = vec![
        object("hole", "table", 2.0, nan, Outline::Circle(0.5)),
        object(
            "flat",
            "table",
            2.0,
            2.0,
            Outline::Rectangle(Vector2::new(-1.0, 2.0)),
        ),
        object("plant", "plant", 2.0, 8.0, Outline::Circle(0.1)),
    ];
    let activity = |name: &str, object: &str, start, end| Activity {
        name: name.into(),
        object: object.into(),
        start: noon() + start,
        end: noon() + end,
    };
    scene.activities = vec![
        activity("watering", "plant", 0.0, 1.0),
        activity("digging", "hole", 0.0, 1.0),
        activity("pruning", "plant", 1.0, 0.0),
        activity("looking", "plant", 1.0, 1.0),
        activity("potting", "plnat", 0.0, 1.0),
    ];
    let map = update(&scene);
    let reports: Vec<String> = map.rejected.iter().map(ToString::to_string).collect();
    expect_test::expect![[r"
        person ghost is ignored: the pose is no place within 1e8 m
        person ana is taken to stand still: the velocity is none of up to 100 m/s
        person ana is given the usual radius, 0.25 m: -1 m is none up to 10 m
        person voyager is ignored: the pose is no place within 1e8 m
        object hole is ignored: its pose is no place within 1e8 m, or its size none of up to 1000 m
        object flat is ignored: its pose is no place within 1e8 m, or its size none of up to 1000 m
        activity pruning is ignored: it ends at 1800000000.000 s, before it starts at 1800000001.000 s
        activity looking is ignored: it ends when it starts, at 1800000001.000 s
        activity watering has no effect: plant is of the class plant, which has no space
        activity digging waits: nothing called `hole` has been seen so far
        activity potting waits: nothing called `plnat` has been seen so far; did you mean `plant`?
        ana and bo interact at 6.0 m: too far for a space between them
        ana and ghost interact, but nobody called ghost has a place"]]
    .assert_eq(&reports.join("\n"));
    assert_cost(&map, 3.05, 5.05, BLOCKED);
    assert_cost(&map, 2.05, 8.05, BLOCKED);
}

#[test]
fn a_scene_that_makes_no_map_is_refused_and_the_map_survives() {
    let mut mapper = SocialMapper::new(SocialConfig::default()).unwrap();
    let good = hall();
    mapper.update(noon(), &good).unwrap();
    let mut error = |spoil: &dyn Fn(&mut SocialScene)| {
        let mut scene = good.clone();
        spoil(&mut scene);
        mapper.update(noon(), &scene).unwrap_err()
    };
    assert!(matches!(
        error(&|s| s.bounds[2] = 0.0),
        SceneError::Bounds { .. }
    ));
    assert!(matches!(
        error(&|s| s.bounds[0] = f64::NAN),
        SceneError::Bounds { .. }
    ));
    assert!(matches!(
        error(&|s| s.bounds[2] = 1e7),
        SceneError::TooLarge { .. }
    ));
    assert!(matches!(
        error(&|s| s.robot_radius = -0.1),
        SceneError::RobotRadius { .. }
    ));
    let gap = wall((0.0, 0.0), (f64::INFINITY, 0.0));
    assert!(matches!(
        error(&|s| s.walls.push(gap)),
        SceneError::Wall { index: 0 }
    ));
    // Its distance from any place would be no number, and a map without it open.
    let endless = wall((0.0, 0.0), (1e300, 0.0));
    assert!(matches!(
        error(&|s| s.walls.push(endless)),
        SceneError::Wall { index: 0 }
    ));
    assert!(matches!(
        error(&|s| s.bounds = [1e17, 0.0, 1.000_000_000_000_001e17, 10.0]),
        SceneError::Bounds { .. }
    ));
    assert!(mapper.update(noon(), &good).unwrap().dirty.is_empty());
}

#[test]
fn layers_build_on_each_other_in_aps_order() {
    let mut scene = hall();
    scene.walls.push(wall((0.0, 8.0), (12.0, 8.0)));
    let table = Outline::Rectangle(Vector2::new(2.0, 1.0));
    scene
        .objects
        .push(object("table", "table", 3.0, 2.0, table));
    scene.people = vec![person("ana", pose(8.05, 4.05, 0.0))];
    let mut mapper = SocialMapper::new(SocialConfig::default()).unwrap();
    assert_eq!(mapper.layer(Layer::Master), None);
    // On the wall and beside it, on the table and beside it, on ana and ahead of her.
    let places = [
        (6.05, 8.05),
        (6.05, 7.75),
        (3.05, 2.05),
        (4.15, 2.05),
        (8.05, 4.05),
        (9.05, 4.05),
    ];
    let mut rows = |scene: &SocialScene| {
        mapper.update(noon(), scene).unwrap();
        Layer::ALL
            .map(|layer| {
                let grid = mapper.layer(layer).unwrap();
                let cost = |(x, y)| grid.cost(grid.cell_at(Point2::new(x, y)).unwrap());
                let costs = places.map(|place| format!("{:4.1}", cost(place)));
                format!("{:14}{}", layer.name(), costs.join(" "))
            })
            .join("\n")
    };
    expect_test::expect![[r"
        static         inf  1.0  1.0  1.0  1.0  1.0
        obstacles      inf  1.0  inf  1.0  inf  1.0
        people_filter  inf  1.0  inf  1.0  1.0  1.0
        inflation      inf  inf  inf  inf  1.0  1.0
        social         1.0  1.0  1.5  1.5  inf  4.0
        master         inf  inf  inf  inf  inf  4.0"]]
    .assert_eq(&rows(&scene));
    scene.social = false;
    expect_test::expect![[r"
        static         inf  1.0  1.0  1.0  1.0  1.0
        obstacles      inf  1.0  inf  1.0  inf  1.0
        people_filter  inf  1.0  inf  1.0  inf  1.0
        inflation      inf  inf  inf  inf  inf  1.0
        social         1.0  1.0  1.0  1.0  1.0  1.0
        master         inf  inf  inf  inf  inf  1.0"]]
    .assert_eq(&rows(&scene));
}
