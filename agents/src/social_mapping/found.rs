//! The groups of a scene as the map has them: who is in them, the group as one entity, and its space.

use super::config::SocialConfig;
use super::four_sided::FourSided;
use super::groups::{GroupEntity, TooCrowded};
use super::scene::Person;
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
    /// The widths of its density: its extent and a person's widths, under the mean of its members'
    /// features (TG 3.3.4).
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
        let widths = config.features.apply(widths, &mean_features(&features));
        let outline =
            |level| widths.contour(&entity.world_from_group, level, config.contour_points);
        Some(FoundGroup {
            members: members.iter().map(|i| people[*i].name.clone()).collect(),
            entity,
            widths,
            personal: outline(config.proxemics.levels.personal),
        })
    });
    Ok(found.collect())
}
