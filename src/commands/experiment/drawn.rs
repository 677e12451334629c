//! Pictures of an experiment: people in an arrangement, drawn as `cortex social density` draws any situation.

use crate::Failure;
use agents::social_mapping::SocialConfig;
use agents::social_mapping::scene::{BODY_RADIUS, Manner, Person};
use dsr::Time;
use nalgebra::{Isometry2, Vector2};
use scenarios::picture::{Show, png, social};
use scenarios::situation::Situation;
use std::collections::BTreeMap;
use std::path::Path;

/// Pixels of a PNG for each of the SVG's.
const SCALE: f32 = 1.5;

/// A picture.
pub(super) struct Drawn {
    name: &'static str,
    svg: String,
}

impl Drawn {
    /// A picture that is an SVG already.
    pub(super) fn new(name: &'static str, svg: String) -> Self {
        Self { name, svg }
    }
}

/// Somebody's name, pose and features.
pub(super) type Placed = (String, Isometry2<f64>, BTreeMap<String, f64>);

/// Draws people on an open floor.
pub(super) fn draw(
    name: &'static str,
    people: &[Placed],
    config: &SocialConfig,
) -> Result<Drawn, Failure> {
    let person = |(name, pose, features): &Placed| Person {
        name: name.clone(),
        world_from_person: *pose,
        velocity: Vector2::zeros(),
        radius: BODY_RADIUS,
        manner: Manner {
            features: features.clone(),
            ..Manner::default()
        },
    };
    let people = people.iter().map(person).collect();
    let situation = Situation::of_people(name, Time::default(), people, config);
    let (update, _) = situation.map(config).map_err(Failure::internal)?;
    let svg = social(&situation, &update, config, Show::Density);
    Ok(Drawn { name, svg })
}

/// Writes pictures to a folder as SVG and PNG; the names of the files.
pub(super) fn write(pictures: &[Drawn], folder: &Path) -> Result<Vec<String>, Failure> {
    let cannot = |path: &Path, error: std::io::Error| {
        Failure::input(format!("cannot write {}: {error}", path.display()))
    };
    std::fs::create_dir_all(folder).map_err(|error| cannot(folder, error))?;
    let mut names = Vec::new();
    for picture in pictures {
        let pixels = png(&picture.svg, SCALE).map_err(Failure::internal)?;
        for (ending, bytes) in [("svg", picture.svg.as_bytes()), ("png", &pixels)] {
            let path = folder.join(format!("{}.{ending}", picture.name));
            std::fs::write(&path, bytes).map_err(|error| cannot(&path, error))?;
            names.push(path.display().to_string());
        }
    }
    Ok(names)
}
