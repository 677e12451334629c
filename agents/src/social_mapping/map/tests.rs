//! The social grid: what each place costs, with and without social behaviour.

use super::*;
use crate::grid::{BLOCKED, FREE};
use crate::social_mapping::object_space::{Outline, UsageCurve};
use crate::social_mapping::scene::Activity;
use crate::social_mapping::zones::Proxemics;
use nalgebra::Vector2;
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};

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
fn the_space_of_a_walking_person_reaches_ahead_on_the_grid_only() {
    let mut scene = hall();
    scene.people.push(person("ana", pose(5.0, 5.05, FRAC_PI_2)));
    let standing = update(&scene);
    scene.people[0].velocity = Vector2::new(0.0, 1.2);
    let walking = update(&scene);
    assert_cost(&standing, 5.0, 7.35, FREE);
    assert_cost(&walking, 5.0, 7.35, 2.0);
    assert_cost(&walking, 5.0, 5.05 + 0.65, BLOCKED);
    assert_eq!(standing.people, walking.people);
    let config = SocialConfig {
        stretch: false,
        ..SocialConfig::default()
    };
    let plain = SocialMapper::new(config)
        .unwrap()
        .update(noon(), &scene)
        .unwrap();
    assert_eq!(plain.grid, standing.grid);
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
    let activity = |object: &str, start, end| Activity {
        object: object.into(),
        start: noon() + start,
        end: noon() + end,
    };
    scene.activities = vec![
        activity("plant", 0.0, 1.0),
        activity("hole", 0.0, 1.0),
        activity("plant", 1.0, 0.0),
    ];
    let map = update(&scene);
    let reports: Vec<String> = map.rejected.iter().map(ToString::to_string).collect();
    expect_test::expect![[r"
        person ghost is ignored: the pose is not finite
        person ana is taken to stand still: the velocity is not finite
        person ana is given the usual radius: -1 m is none
        object hole is ignored: its pose or size is not finite
        object flat is ignored: its pose or size is not finite
        an activity uses plant, which the map does not have or which has no space
        an activity uses hole, which the map does not have or which has no space
        an activity with plant is ignored: the activity ends at 1800000000.000 s, before it starts at 1800000001.000 s
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
        error(&|s| s.bounds[2] = 1e9),
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
    assert!(!mapper.update(noon(), &good).unwrap().changed);
}

#[test]
fn changed_means_that_a_cost_differs() {
    let mut scene = hall();
    scene.people.push(person("ana", pose(5.0, 5.0, 0.0)));
    let mut mapper = SocialMapper::new(SocialConfig::default()).unwrap();
    assert!(mapper.update(noon(), &scene).unwrap().changed);
    assert!(!mapper.update(noon(), &scene).unwrap().changed);
    scene.people[0].world_from_person = pose(5.0 + 1e-9, 5.0, 0.0);
    assert!(
        !mapper.update(noon(), &scene).unwrap().changed,
        "no cell can tell"
    );
    scene.people[0].world_from_person = pose(5.2, 5.0, 0.0);
    assert!(mapper.update(noon(), &scene).unwrap().changed);
    scene.people.clear();
    let map = mapper.update(noon(), &scene).unwrap();
    assert!(map.changed && map.grid.costs.iter().all(|c| *c == FREE));
}

fn any_pose() -> impl Strategy<Value = Isometry2<f64>> {
    (-1.0..13.0, -1.0..11.0, -4.0..4.0).prop_map(|(x, y, heading)| pose(x, y, heading))
}

prop_compose! {
    fn any_people()(all in prop::collection::vec(
        (any_pose(), -2.0..2.0, -2.0..2.0, 0.1..0.4f64), 0..6,
    )) -> Vec<Person> {
        all.into_iter().enumerate().map(|(i, (world_from_person, vx, vy, radius))| Person {
            name: format!("p{i}"),
            world_from_person,
            velocity: Vector2::new(vx, vy),
            radius,
        }).collect()
    }
}

prop_compose! {
    fn any_objects()(all in prop::collection::vec(
        (any_pose(), 0usize..4, any::<bool>(), 0.0..2.0, 0.0..2.0), 0..4,
    )) -> Vec<Object> {
        all.into_iter().enumerate().map(|(i, (world_from_object, class, round, x, y))| Object {
            name: format!("o{i}"),
            class: ["table", "tv", "bed", "plant"][class].to_owned(),
            world_from_object,
            outline: if round { Outline::Circle(x) } else { Outline::Rectangle(Vector2::new(x, y)) },
        }).collect()
    }
}

prop_compose! {
    fn any_scene()(
        people in any_people(),
        objects in any_objects(),
        walls in prop::sample::select(vec![
            vec![],
            vec![wall((3.0, 0.0), (3.0, 10.0)), wall((3.0, 4.0), (9.5, 6.2))],
        ]),
        interactions in prop::collection::vec((0usize..6, 0usize..6), 0..4),
        activities in prop::collection::vec((0usize..4, -4000.0..4000.0, 0.0..2000.0f64), 0..3),
        social in prop::bool::weighted(0.8),
    ) -> SocialScene {
        SocialScene {
            people,
            objects,
            walls,
            interactions: interactions.iter().map(|(a, b)| (format!("p{a}"), format!("p{b}"))).collect(),
            activities: activities.iter().map(|(o, start, length)| Activity {
                object: format!("o{o}"),
                start: noon() + *start,
                end: noon() + *start + *length,
            }).collect(),
            social,
            ..hall()
        }
    }
}

/// A scene, and how the one before is changed into it: afresh, by one person, by time alone.
#[derive(Debug, Clone)]
enum Turn {
    Another(SocialScene),
    OnePersonMoves(prop::sample::Index, Isometry2<f64>),
    OnePersonLeaves(prop::sample::Index),
    TimePasses(f64),
}

fn any_turn() -> impl Strategy<Value = Turn> {
    prop_oneof![
        any_scene().prop_map(Turn::Another),
        (any::<prop::sample::Index>(), any_pose()).prop_map(|(i, p)| Turn::OnePersonMoves(i, p)),
        any::<prop::sample::Index>().prop_map(Turn::OnePersonLeaves),
        (0.0..3000.0f64).prop_map(Turn::TimePasses),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn updating_equals_drawing_anew(
        start in any_scene(), turns in prop::collection::vec(any_turn(), 1..8),
    ) {
        let (mut scene, mut now) = (start, noon());
        let mut mapper = SocialMapper::new(SocialConfig::default()).unwrap();
        let mut before = mapper.update(now, &scene).unwrap();
        for turn in turns {
            match turn {
                Turn::Another(next) => scene = next,
                Turn::OnePersonMoves(i, to) if !scene.people.is_empty() => {
                    let i = i.index(scene.people.len());
                    scene.people[i].world_from_person = to;
                }
                Turn::OnePersonLeaves(i) if !scene.people.is_empty() => {
                    scene.people.remove(i.index(scene.people.len()));
                }
                Turn::TimePasses(seconds) => now = now + seconds,
                Turn::OnePersonMoves(..) | Turn::OnePersonLeaves(_) => {}
            }
            let updated = mapper.update(now, &scene).unwrap();
            let anew = SocialMapper::new(SocialConfig::default()).unwrap().update(now, &scene).unwrap();
            prop_assert!(updated.grid == anew.grid);
            prop_assert_eq!(&updated.people, &anew.people);
            prop_assert_eq!(&updated.objects, &anew.objects);
            prop_assert_eq!(&updated.rejected, &anew.rejected);
            // The walls drawn anew count as a change even where they look the same.
            prop_assert!(updated.changed || updated.grid == before.grid);
            prop_assert!(updated.grid.costs.iter().all(|c| *c >= FREE));
            before = updated;
        }
    }

    #[test]
    fn the_grid_and_the_zone_function_agree(people in any_people()) {
        let scene = SocialScene { people, ..hall() };
        let config = SocialConfig { stretch: false, ..SocialConfig::default() };
        let map = SocialMapper::new(config).unwrap().update(noon(), &scene).unwrap();
        let poses: Vec<_> = scene.people.iter().map(|p| p.world_from_person).collect();
        for row in 0..map.grid.height {
            for column in 0..map.grid.width {
                let cell = (column, row);
                let centre = map.grid.centre(cell);
                let touches = scene.people.iter().any(|p| {
                    (position(p) - centre).norm() <= p.radius + scene.robot_radius + 1e-9
                });
                if !touches {
                    let zone = Proxemics::default().zone_at(centre, &poses);
                    prop_assert!(map.grid.cost(cell).total_cmp(&zone.cost()).is_eq());
                }
            }
        }
    }
}
