//! The care centre asks what its README says: the straight ways lead through people's and objects'
//! spaces, and there is a way without.

use agents::grid::CostGrid;
use agents::social_mapping::{Outline, SocialConfig, SocialMapper, SocialScene, scene};
use nalgebra::{Isometry2, Point2};
use scenarios::scenario::Shape;
use scenarios::{Scenario, World};
use std::collections::VecDeque;
use std::path::Path;

/// The social map at the start, without the two who only pass through.
fn map(scenario: &Scenario) -> CostGrid {
    let truth = World::new(scenario, 1, None).truth();
    let passing = ["diego", "lucia"];
    let people = truth
        .people
        .iter()
        .filter(|person| !passing.contains(&person.name.as_str()));
    let people = people.map(|person| scene::Person {
        name: person.name.clone(),
        world_from_person: Isometry2::new(person.position.coords, person.heading),
        velocity: person.velocity,
        radius: person.radius,
        manner: scene::Manner::default(),
    });
    let objects = scenario.objects.iter().map(|object| scene::Object {
        name: object.name.clone(),
        class: object.class.clone(),
        world_from_object: object.pose,
        outline: match object.shape {
            Shape::Circle => Outline::Circle(object.size.x / 2.0),
            Shape::Rectangle => Outline::Rectangle(object.size),
        },
    });
    let activities = scenario.activities.iter().map(|activity| scene::Activity {
        name: activity.name.clone(),
        object: activity.object.clone(),
        start: activity.start,
        end: activity.end,
    });
    let talking = vec![("rosa".to_owned(), "jose".to_owned())];
    let interactions = if scenario.people.is_empty() {
        Vec::new()
    } else {
        talking
    };
    let scene = SocialScene {
        bounds: scenario.bounds,
        walls: scenario.walls.clone(),
        robot_radius: scenario.robot.radius,
        social: true,
        people: people.collect(),
        interactions,
        objects: objects.collect(),
        activities: activities.collect(),
        rejected: Vec::new(),
    };
    let mut mapper = SocialMapper::new(SocialConfig::default()).expect("the default figures");
    let update = mapper
        .update(scenario.start, &scene)
        .expect("a sound scene");
    assert!(update.rejected.is_empty(), "{:?}", update.rejected);
    (*update.grid).clone()
}

/// Whether cells that cost at most `limit` lead from one point to the other.
fn leads(grid: &CostGrid, from: Point2<f64>, to: Point2<f64>, limit: f32) -> bool {
    let (Some(start), Some(goal)) = (grid.cell_at(from), grid.cell_at(to)) else {
        return false;
    };
    let mut reached = vec![false; grid.costs.len()];
    let mut open = VecDeque::from([start]);
    reached[grid.index(start)] = true;
    while let Some((column, row)) = open.pop_front() {
        for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
            let next = (column.checked_add_signed(dx), row.checked_add_signed(dy));
            let (Some(column), Some(row)) = next else {
                continue;
            };
            if column >= grid.width || row >= grid.height {
                continue;
            }
            let index = grid.index((column, row));
            if !reached[index] && grid.costs[index] <= limit {
                reached[index] = true;
                open.push_back((column, row));
            }
        }
    }
    reached[grid.index(goal)]
}

/// The greatest cost along a straight line.
fn worst(grid: &CostGrid, from: Point2<f64>, to: Point2<f64>) -> f32 {
    (0..=200)
        .filter_map(|part| grid.cell_at(from + (to - from) * (f64::from(part) / 200.0)))
        .map(|cell| grid.cost(cell))
        .fold(0.0, f32::max)
}

#[test]
fn the_straight_way_is_rude_and_a_polite_one_exists() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("care-centre");
    let scenario = Scenario::load(&folder).expect("the care centre loads");
    let grid = map(&scenario);
    let mut deserted = scenario.clone();
    deserted.people.clear();
    deserted.activities.clear();
    let deserted = map(&deserted);
    let charger = Point2::new(0.8, 6.0);
    let before_door = Point2::new(12.9, 6.9);
    let behind_door = Point2::new(13.2, 8.1);
    let by_the_window = Point2::new(19.2, 9.3);
    for (from, to, rude) in [
        (charger, before_door, 4.0),
        (behind_door, by_the_window, 3.5),
    ] {
        assert!(
            worst(&deserted, from, to) <= 1.5,
            "walls stand on the way from {from}"
        );
        assert!(
            worst(&grid, from, to) >= rude,
            "nobody is on the way from {from}"
        );
    }
    let near_walls = 1.0 + SocialConfig::default().clearance_cost as f32;
    assert!(
        leads(&grid, charger, behind_door, near_walls),
        "no polite way to the day room"
    );
    let south_east = Point2::new(18.9, 8.3);
    assert!(
        leads(&grid, behind_door, south_east, near_walls),
        "no way round the television"
    );
    assert!(
        leads(&grid, charger, by_the_window, 2.0),
        "nobody gets to Carmen"
    );
}
