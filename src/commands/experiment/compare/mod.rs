//! Ways of driving, held against each other in the same worlds: ours, ours as if people were obstacles, ours with
//! paper AP's zones, A*, and the social-force model. This file owns the worlds and the methods, and guarantees that
//! for a seed every method meets the same world.

mod figures;

use super::drives::scene;
use super::workers;
use crate::Failure;
use crate::bench::Chance;
use crate::progress::Progress;
use agents::navigation::navigator::Config;
use agents::navigation::target::Target;
use agents::social_mapping::SocialConfig;
pub(super) use figures::Comparison;
use figures::{FIGURES, Values};
use nalgebra::{Isometry2, Point2, Vector2};
use scenarios::metrics::{measure, object_spaces, shortest_way, spl};
use scenarios::trial::{Method, Trial};
use scenarios::{Scenario, Tracks};
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// How the comparison is called.
pub(super) const NAME: &str = "compare";

/// A drive may take so many times as long as the shortest way at top speed, and as many seconds more.
const PATIENCE: (f64, f64) = (4.0, 10.0);
/// The robot begins within so many metres of the scene's own place, facing anywhere.
const START: f64 = 0.3;
/// The end of a recording that is too short for a drive, s.
const REST: f64 = 30.0;

/// A way of driving.
struct Way {
    name: &'static str,
    method: Method,
    social: bool,
    adaptive: bool,
}

const WAYS: [Way; 5] = [
    Way {
        name: "cortex",
        method: Method::Navigation,
        social: true,
        adaptive: false,
    },
    Way {
        name: "adaptive_proxemics",
        method: Method::Navigation,
        social: true,
        adaptive: true,
    },
    Way {
        name: "no_social",
        method: Method::Navigation,
        social: false,
        adaptive: false,
    },
    Way {
        name: "a_star",
        method: Method::AStar,
        social: false,
        adaptive: false,
    },
    Way {
        name: "social_force",
        method: Method::SocialForce,
        social: false,
        adaptive: false,
    },
];

/// Somewhere to drive, from one place to another.
struct World {
    name: &'static str,
    about: &'static str,
    scenario: Scenario,
    goal: Point2<f64>,
    /// Whether every second seed drives back.
    both_ways: bool,
    tracks: Option<Tracks>,
}

fn worlds(recording: Option<&Path>) -> Result<Vec<World>, Failure> {
    let world = |name, about, text: &str, (x, y): (f64, f64)| {
        let scenario = scene(name, text)?;
        let goal = Point2::new(x, y);
        Ok::<_, Failure>(World {
            name,
            about,
            scenario,
            goal,
            both_ways: false,
            tracks: None,
        })
    };
    let square = |name, about| -> Result<World, Failure> {
        let text = include_str!("../../../../scenarios/plaza/scenario.toml");
        let mut world = world(name, about, text, (13.0, 8.0))?;
        world.both_ways = true;
        Ok(world)
    };
    let mut worlds = vec![
        world(
            "td-table1",
            "therapy at a table and a television (TD Table 1, path 2)",
            include_str!("../drives/scenes/table1.toml"),
            (13.77, 4.2),
        )?,
        world(
            "td-table2",
            "two therapy rooms and a corridor (TD Table 2, agenda known)",
            include_str!("../drives/scenes/table2.toml"),
            (11.9, 3.2),
        )?,
        world(
            "td-table4",
            "a therapist at a television (TD Table 4)",
            include_str!("../drives/scenes/table4.toml"),
            (6.55, 5.8),
        )?,
        world(
            "corridor",
            "a corridor in which somebody comes and somebody stands (after FD)",
            include_str!("../../../../scenarios/corridor/scenario.toml"),
            (13.2, 1.5),
        )?,
        world(
            "flat",
            "a flat in which somebody goes to and fro (after AP)",
            include_str!("../../../../scenarios/flat/scenario.toml"),
            (6.8, 3.9),
        )?,
        square(
            "plaza",
            "a square that sixteen simulated people at a time cross",
        )?,
    ];
    if let Some(path) = recording {
        let tracks = Tracks::load(path).map_err(|error| Failure::Input(error.into()))?;
        let mut recorded = square("recorded", "the same square with recorded pedestrians")?;
        recorded.tracks = Some(tracks);
        worlds.push(recorded);
    }
    Ok(worlds)
}

/// The world as one seed has it: where the robot begins and which part of a recording is played.
fn seeded(world: &World, seed: u64, seeds: u64) -> (Scenario, Point2<f64>) {
    let mut scenario = world.scenario.clone();
    let mut chance = Chance::new(seed);
    let mut ends = [
        Point2::from(scenario.robot.pose.translation.vector),
        world.goal,
    ];
    if world.both_ways && seed.is_multiple_of(2) {
        ends.reverse();
    }
    let (far, bearing) = (START * chance.share().sqrt(), TAU * chance.share());
    let offset = Vector2::new(bearing.cos(), bearing.sin()) * far;
    let heading = TAU * chance.share() - PI;
    let [start, goal] = ends;
    scenario.robot.pose = Isometry2::new(start.coords + offset, heading);
    if let Some(tracks) = &world.tracks {
        let last = (tracks.duration() - REST).max(0.0);
        scenario.tracks.offset = last * (seed - 1) as f64 / seeds as f64;
    }
    (scenario, goal)
}

/// Drives one way through one world.
fn drive(world: &World, way: &Way, seed: u64, seeds: u64) -> Result<Values, Failure> {
    let (mut scenario, goal) = seeded(world, seed, seeds);
    let start = Point2::from(scenario.robot.pose.translation.vector);
    let shortest = shortest_way(&scenario, start, goal)
        .ok_or_else(|| Failure::internal(format!("there is no way through {}", world.name)))?;
    scenario.duration = PATIENCE.0 * shortest / scenario.robot.max_speed + PATIENCE.1;
    // Everybody is judged by the spaces of the scene, whatever they went by.
    let spaces = object_spaces(&scenario, &scenario.social).map_err(Failure::internal)?;
    if way.adaptive {
        scenario.social.proxemics = SocialConfig::adaptive_proxemics().proxemics;
    }
    let trial = Trial {
        scenario: &scenario,
        seed,
        tracks: world.tracks.as_ref(),
        unmapped: &[],
        method: way.method,
        social: way.social,
        targets: vec![Target::Point(goal)],
        navigation: Config::default(),
        agenda_from: 0.0,
    };
    let drive = trial.drive().map_err(Failure::internal)?;
    let metrics = measure(&drive.samples, scenario.robot.radius, &spaces);
    let robot = metrics
        .robot
        .ok_or_else(|| Failure::internal("a drive of no time"))?;
    let spl = spl(drive.arrived, shortest, robot.path_length);
    Ok(FIGURES
        .iter()
        .map(|figure| (figure.of)(drive.arrived, spl, &metrics))
        .collect())
}

/// Drives all ways through all worlds with so many seeds.
pub(super) fn compare(
    seeds: u64,
    recording: Option<&Path>,
    progress: &Progress,
) -> Result<Comparison, Failure> {
    let worlds = worlds(recording)?;
    let each = WAYS.len() * seeds as usize;
    let driven = workers::each(worlds.len() * each, progress, |job| {
        let way = &WAYS[job % each / seeds as usize];
        let seed = (job % seeds as usize) as u64 + 1;
        drive(&worlds[job / each], way, seed, seeds)
    })?;
    let worlds = worlds
        .iter()
        .zip(driven.chunks(each))
        .map(|(world, drives)| figures::World {
            name: world.name,
            about: world.about,
            ways: drives
                .chunks(seeds as usize)
                .map(figures::summary)
                .collect(),
        });
    Ok(Comparison {
        seeds,
        ways: WAYS.map(|way| way.name).into(),
        worlds: worlds.collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_is_one_world_and_another_seed_another() {
        let worlds = worlds(None).unwrap();
        let plaza = &worlds[5];
        let (first, goal) = seeded(plaza, 1, 10);
        assert_eq!((first.clone(), goal), seeded(plaza, 1, 10));
        let (second, back) = seeded(plaza, 2, 10);
        let place = |scenario: &Scenario| Point2::from(scenario.robot.pose.translation.vector);
        assert!((place(&first) - back).norm() <= START && (place(&second) - goal).norm() <= START);
        assert_ne!(
            first.robot.pose.rotation.angle().to_bits(),
            second.robot.pose.rotation.angle().to_bits()
        );
    }

    #[test]
    fn a_recording_is_played_from_another_place_for_each_seed() {
        let line = |k: u32| format!("{} 7 {} 2.0\n", k * 10, 0.1 * f64::from(k));
        let text = (0..300).map(line).collect::<Vec<_>>().concat();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("tracks.txt");
        std::fs::write(&file, text).unwrap();
        let worlds = worlds(Some(&file)).unwrap();
        let offsets = [1, 2, 4].map(|seed| seeded(&worlds[6], seed, 4).0.tracks.offset);
        let last = 119.6 - REST;
        let expected = [0.0, 0.25 * last, 0.75 * last];
        for (offset, expected) in offsets.into_iter().zip(expected) {
            assert!((offset - expected).abs() < 1e-9, "{offset} {expected}");
        }
    }
}
