//! The groups of a scene as the map has them: who is in them, the group as one entity, and its space.

use super::config::SocialConfig;
use super::four_sided::FourSided;
use super::groups::{GroupEntity, TooCrowded};
use super::personal::shape_of;
use super::scene::{Person, is_pose};
use nalgebra::{Isometry2, Point2};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Some who stand together.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundGroup {
    /// Their names, in the scene's order.
    pub members: Vec<String>,
    /// The group as one.
    pub entity: GroupEntity,
    /// The mean of each feature over those members of whom it is known (TG 3.3.4).
    pub features: BTreeMap<String, f64>,
    /// The widths of its density: its extent and a person's widths, under its features.
    pub widths: FourSided,
    /// Outline of its personal zone, like a person's.
    pub personal: Vec<Point2<f64>>,
}

/// The mean of each feature over those of whom it is known.
fn mean_features(all: &[&BTreeMap<String, f64>]) -> BTreeMap<String, f64> {
    let mut sums: BTreeMap<String, (f64, f64)> = BTreeMap::new();
    for (name, value) in all.iter().copied().flatten() {
        let sum = sums.entry(name.clone()).or_default();
        *sum = (sum.0 + value, sum.1 + 1.0);
    }
    let means = sums
        .into_iter()
        .map(|(name, (sum, count))| (name, sum / count));
    means.collect()
}

/// The region around the outlines of everybody's zones and of the spaces of groups, as they are on the grid of a place
/// without walls: xmin, ymin, xmax, ymax. `None` with nobody at a place.
pub fn extent(config: &SocialConfig, people: &[Person]) -> Option<[f64; 4]> {
    let sound = people
        .iter()
        .filter(|person| is_pose(&person.world_from_person));
    let sound: Vec<Cow<'_, Person>> = sound.map(Cow::Borrowed).collect();
    let levels = &config.proxemics.levels;
    let mut outline: Vec<Point2<f64>> = Vec::new();
    for person in &sound {
        let shape = shape_of(config, person, &[]);
        let pose = &person.world_from_person;
        outline.extend(shape.contour(pose, levels.social, EXTENT_POINTS));
    }
    // More people than can be searched are in no group, and no group has a space.
    let groups = found_groups(config, &sound).unwrap_or_default();
    let level = if config.group_space {
        levels.social
    } else {
        levels.personal
    };
    for group in groups {
        let pose = &group.entity.world_from_group;
        outline.extend(group.widths.contour(pose, level, EXTENT_POINTS));
    }
    let low = outline.iter().map(|p| p.coords).reduce(|a, b| a.inf(&b))?;
    let high = outline.iter().map(|p| p.coords).reduce(|a, b| a.sup(&b))?;
    Some([low.x, low.y, high.x, high.y])
}

/// Points of an outline by which its extent is taken: to a thousandth of it.
const EXTENT_POINTS: usize = 72;

/// The groups of those present.
///
/// # Errors
/// [`TooCrowded`]: nobody is in a group then.
pub(super) fn found_groups(
    config: &SocialConfig,
    people: &[Cow<'_, Person>],
) -> Result<Vec<FoundGroup>, TooCrowded> {
    let poses: Vec<Isometry2<f64>> = people.iter().map(|p| p.world_from_person).collect();
    let groups = config.grouping.groups(&poses)?;
    let person = FourSided::from(config.proxemics.shape);
    let found = groups.into_iter().filter_map(|members| {
        let poses: Vec<Isometry2<f64>> = members.iter().map(|i| poses[*i]).collect();
        let entity = GroupEntity::new(&poses)?;
        let features: Vec<_> = members
            .iter()
            .map(|i| &people[*i].manner.features)
            .collect();
        let widths = entity.widths(&person);
        let features = mean_features(&features);
        let widths = config.features.apply(widths, &features);
        let outline =
            |level| widths.contour(&entity.world_from_group, level, config.contour_points);
        Some(FoundGroup {
            members: members.iter().map(|i| people[*i].name.clone()).collect(),
            entity,
            features,
            widths,
            personal: outline(config.proxemics.levels.personal),
        })
    });
    Ok(found.collect())
}
