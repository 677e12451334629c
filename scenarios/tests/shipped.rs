//! The scenarios that come with Cortex load, are consistent with their rules and the vocabulary,
//! and their people do what they should.

use dsr::{Graph, Time};
use grammar::{Goal, Grammar};
use nalgebra::{Point2, Vector2};
use scenarios::{Inputs, Scenario, Tracks, Truth, World, initial_graph, schema};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

const TICK: f64 = 0.05;
const SHIPPED: [&str; 9] = [
    "apartment",
    "care-centre",
    "company",
    "corridor",
    "flat",
    "home",
    "plaza",
    "reception",
    "therapy-centre",
];

#[test]
fn every_folder_with_a_scenario_is_listed_and_has_its_picture() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found: Vec<String> = std::fs::read_dir(root)
        .expect("the folder of the scenarios")
        .map(|entry| entry.expect("an entry").path())
        .filter(|folder| folder.join("scenario.toml").exists())
        .filter_map(|folder| Some(folder.file_name()?.to_str()?.to_owned()))
        .collect();
    found.sort();
    assert_eq!(found, SHIPPED);
    let list = std::fs::read_to_string(root.join("README.md")).expect("the list");
    for name in SHIPPED {
        assert!(list.contains(&format!("({name}/README.md)")), "{name}");
        let page = root.join(name).join("README.md");
        let page = std::fs::read_to_string(page).expect("its page");
        assert!(page.contains(&format!("images/{name}.png")), "{name}");
        let picture = root.join(format!("../docs/src/images/{name}.png"));
        assert!(picture.exists(), "{name}");
    }
}

fn load(name: &str) -> Scenario {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    Scenario::load(&folder).unwrap_or_else(|error| panic!("{:?}", miette::Report::new(error)))
}

fn rules(scenario: &Scenario) -> (Grammar, Vec<Goal>) {
    let (grammar, diagnostics) = grammar::parse_grammar(&scenario.rules, "rules.aggl");
    assert!(diagnostics.is_empty(), "{diagnostics:?}");
    let goals = scenario.missions.iter().map(|mission| {
        grammar::parse_goal(&mission.goal, &mission.file, &grammar.types)
            .unwrap_or_else(|defects| panic!("{defects}"))
    });
    let goals = goals.collect();
    (grammar, goals)
}

/// The truth after each tick, with the robot standing still.
fn watch(world: &mut World, seconds: f64, mut each: impl FnMut(&Truth)) {
    for _ in 0..(seconds / TICK) as usize {
        each(&world.step(TICK, &Inputs::default()).truth);
    }
}

#[test]
fn each_scenario_says_what_its_rules_and_the_vocabulary_know() {
    for name in SHIPPED {
        let scenario = load(name);
        assert_eq!(scenario.name, name);
        let vocabulary = schema().expect("the schema as shipped");
        let mut graph = Graph::in_memory(vocabulary.clone());
        graph
            .commit(&initial_graph(&scenario), "world", scenario.start)
            .expect("the graph takes it");
        let (grammar, goals) = rules(&scenario);
        for wanted in ["changeRoom", "goToPlace", "approach", "takeTheAttention"] {
            assert!(grammar.rule(wanted).is_some(), "{name} lacks {wanted}");
        }
        for rule in &grammar.rules {
            for node in rule.left.nodes.iter().chain(&rule.right.nodes) {
                assert!(
                    vocabulary.find_type(&node.type_name).is_some(),
                    "{}",
                    node.type_name
                );
            }
            for edge in rule.left.edges.iter().chain(&rule.right.edges) {
                assert!(
                    vocabulary.find_label(&edge.label).is_some(),
                    "{}",
                    edge.label
                );
            }
        }
        for goal in &goals {
            assert!(!goal.pattern.nodes.is_empty());
        }
        for supertype in ["thing", "object"] {
            for declared in grammar.types.names() {
                let general = vocabulary.type_id(supertype).expect("a type");
                let special = vocabulary
                    .type_id(declared)
                    .expect("a type of the vocabulary");
                assert_eq!(
                    grammar.types.is_subtype(declared, supertype),
                    vocabulary.is_subtype(special, general),
                    "{declared} below {supertype}"
                );
            }
        }
    }
}

#[test]
fn people_of_the_care_centre_go_about_and_stay_out_of_walls_and_furniture() {
    let scenario = load("care-centre");
    let mut world = World::new(&scenario, 1, None);
    let mut rooms_of_diego = Vec::new();
    let mut longest_stop: f64 = 0.0;
    let mut stop = 0.0;
    watch(&mut world, scenario.duration, |truth| {
        assert_eq!(truth.people.len(), scenario.people.len());
        for (at, one) in truth.people.iter().enumerate() {
            let room = scenario.find_room(one.position);
            assert!(
                room.is_some(),
                "{} is outside at {}",
                one.name,
                one.position
            );
            for other in &truth.people[..at] {
                let gap = (one.position - other.position).norm() - one.radius - other.radius;
                assert!(gap > -1e-9, "{} in {}", one.name, other.name);
            }
            for object in scenario
                .objects
                .iter()
                .filter(|object| object.class != "seat")
            {
                let gap = object.distance(one.position) - one.radius;
                assert!(gap > -1e-9, "{} in {}", one.name, object.name);
            }
        }
        let diego = truth
            .people
            .iter()
            .find(|person| person.name == "diego")
            .expect("diego");
        let room = scenario
            .find_room(diego.position)
            .expect("a room")
            .name
            .clone();
        if rooms_of_diego.last() != Some(&room) {
            rooms_of_diego.push(room);
        }
        stop = if diego.velocity.norm() > 0.05 {
            0.0
        } else {
            stop + TICK
        };
        longest_stop = longest_stop.max(stop);
    });
    let ways = rooms_of_diego.windows(3).filter(|way| {
        ["kitchen", "office"].contains(&way[0].as_str()) && way[1] == "corridor" && way[0] != way[2]
    });
    assert!(ways.count() >= 3, "{rooms_of_diego:?}");
    assert!(longest_stop < 12.0, "diego is stuck for {longest_stop} s");
    assert_eq!(world.truth().collisions.total(), 0);
}

#[test]
fn the_cameras_see_whoever_is_in_a_room_that_has_one() {
    for (name, expected) in [("care-centre", 0.85), ("plaza", 0.8)] {
        let scenario = load(name);
        let mut world = World::new(&scenario, 1, None);
        let mut seen: BTreeMap<String, [f64; 2]> = BTreeMap::new();
        for _ in 0..1200 {
            let output = world.step(TICK, &Inputs::default());
            if output.frames.is_empty() {
                continue;
            }
            let found: Vec<Point2<f64>> = output
                .frames
                .iter()
                .flat_map(|f| f.people.iter().map(|p| f.world_from_camera * p.position))
                .collect();
            for person in &output.truth.people {
                let near = |p: &Point2<f64>| (p - person.position).norm() < 0.35;
                let count = seen.entry(person.name.clone()).or_default();
                count[0] += f64::from(u8::from(found.iter().any(near)));
                count[1] += 1.0;
            }
        }
        for (person, [seen, there]) in &seen {
            let share = seen / there;
            assert!(
                share > expected || *there < 20.0,
                "{name}: {person} {share} of the time"
            );
        }
        let objects: Vec<_> = scenario
            .objects
            .iter()
            .map(|object| object.name.as_str())
            .collect();
        let mut known = BTreeSet::new();
        for _ in 0..200 {
            for frame in world.step(TICK, &Inputs::default()).frames {
                known.extend(
                    frame
                        .objects
                        .into_iter()
                        .filter_map(|object| object.identity),
                );
            }
        }
        let unseen: Vec<_> = objects
            .into_iter()
            .filter(|name| !known.contains(*name))
            .collect();
        let allowed: &[&str] = if name == "care-centre" {
            &["toilet"]
        } else {
            &[]
        };
        assert_eq!(unseen, allowed, "{name}: nobody sees these");
    }
}

#[test]
fn the_plaza_is_crossed_all_the_time_and_nobody_runs_into_the_robot() {
    let scenario = load("plaza");
    let mut world = World::new(&scenario, 1, None);
    let mut newest = 0;
    watch(&mut world, 120.0, |truth| {
        assert!(
            truth.people.len() >= 10,
            "only {} people at {}",
            truth.people.len(),
            truth.time
        );
        let numbers = truth
            .people
            .iter()
            .filter_map(|p| p.name.rsplit('_').next()?.parse().ok());
        newest = newest.max(numbers.max().unwrap_or(0));
        for (at, one) in truth.people.iter().enumerate() {
            for other in &truth.people[..at] {
                let gap = (one.position - other.position).norm() - one.radius - other.radius;
                assert!(gap > -1e-9, "{} in {}", one.name, other.name);
            }
        }
    });
    assert!(newest > 50, "only {newest} people came in one stream");
    assert_eq!(world.truth().collisions.total(), 0);
}

#[test]
fn a_recording_in_the_coordinates_of_zara01_crosses_the_robots_way() {
    let scenario = load("plaza");
    // Someone who walks down the middle of that recording's street.
    let line = |step: i32| format!("{} 1 -0.5 {}", step * 10, 19.0 - 0.5 * f64::from(step));
    let text: Vec<String> = (0..28).map(line).collect();
    let tracks = Tracks::parse("street.txt", &text.join("\n")).expect("good lines");
    let mut world = World::new(&scenario, 1, Some(tracks));
    let mut crossed = false;
    watch(&mut world, 15.0, |truth| {
        for person in &truth.people {
            assert!(
                scenario.find_room(person.position).is_some(),
                "{}",
                person.position
            );
            crossed |= (person.position - Point2::new(8.0, 8.0)).norm() < 0.3;
            assert!((person.velocity - Vector2::new(0.0, -1.25)).norm() < 0.05);
        }
    });
    assert!(
        crossed,
        "the recording does not meet the line from west to east"
    );
    assert!(world.time() > Time::default());
}
