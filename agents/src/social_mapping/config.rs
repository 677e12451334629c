//! The figures of the social map. This file owns their defaults, and guarantees that figures which
//! pass [`SocialConfig::problems`] make a map of every sound scene.

use super::adaptation::WallAdaptation;
use super::features::Features;
use super::four_sided::FourSided;
use super::gaussian::AsymmetricGaussian;
use super::groups::Grouping;
use super::limits::{MOST_COST, is_length};
use super::object_space::{Space, UsageCurve};
use super::personal::{self, CooperationZone, MOST_ZONES};
use super::zones::{Levels, Proxemics};
use crate::names::suggestion;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// All figures of the social map; every one has the papers' or our documented default.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SocialConfig {
    /// Side of a cell, metres.
    pub resolution: f64,
    /// People's density and zones. Preset `hall` with levels .9/.5/.1.
    pub proxemics: Proxemics,
    /// Whether the space of walking people reaches further ahead, by [`FourSided::walking`]. Metrics keep the standing
    /// shape.
    pub stretch: bool,
    /// What a place right beside an obstacle costs more than a free one. The default stays below
    /// the cheapest space of an object, so the order of READING.md item 7 holds; 0 turns it off.
    pub clearance_cost: f64,
    /// Over which distance from the blocked cells that falls to nothing, metres.
    pub clearance_width: f64,
    /// Half the width of the space between two who interact, metres. It costs as much as personal
    /// space: a robot passes between two who talk only where there is no other way.
    pub between_half_width: f64,
    /// Two who interact from further than this leave no space between them, metres (the outer end
    /// of Hall's social distance).
    pub between_reach: f64,
    /// The space of each class of objects; a class not named has none.
    pub spaces: BTreeMap<String, Space>,
    /// R(t).
    pub usage: UsageCurve,
    /// R(t) of single objects, by name.
    pub usage_of: BTreeMap<String, UsageCurve>,
    /// Points of each polyline of a person or a group, from 3 to 1000.
    pub contour_points: usize,
    /// Widths of people who do something in particular, by its name (AP Fig. 2).
    pub activities: BTreeMap<String, FourSided>,
    /// What is usually done in a room, by the names of rooms and activities: counts for whoever is in it and of
    /// whom nothing else is known (AP 2.1).
    pub activity_in: BTreeMap<String, String>,
    /// Socialization features (TG 3.3.1).
    pub features: Features,
    /// Whether and how personal space gives way to walls (FD IV-C); not by default.
    pub walls: Option<WallAdaptation>,
    /// Where people want the robot, by what it does with them (AP 2.2); at most two zones each.
    pub cooperation: BTreeMap<String, Vec<CooperationZone>>,
    /// How groups are found.
    pub grouping: Grouping,
    /// Whether a group has a space of its own on the grid, beside its members' (TG 3.3.4).
    pub group_space: bool,
}

impl Default for SocialConfig {
    fn default() -> Self {
        let viewed = ["tv", "board"].map(|class| (class.to_owned(), Space::VIEWED));
        let around = ["table", "bed", "stretcher"].map(|c| (c.to_owned(), Space::USED_AROUND));
        Self {
            resolution: 0.1,
            proxemics: Proxemics::default(),
            stretch: true,
            clearance_cost: 0.4,
            clearance_width: 0.3,
            between_half_width: 0.5,
            between_reach: 3.6,
            spaces: viewed.into_iter().chain(around).collect(),
            usage: UsageCurve::default(),
            usage_of: BTreeMap::new(),
            contour_points: 24,
            activities: personal::activities(),
            activity_in: BTreeMap::new(),
            features: Features::default(),
            walls: None,
            cooperation: personal::cooperation(),
            grouping: Grouping::default(),
            group_space: false,
        }
    }
}

/// A configuration that makes no map.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("social mapping: {field} {requirement}")]
pub struct ConfigError {
    /// The field at fault.
    pub field: String,
    /// What it has to be.
    pub requirement: Cow<'static, str>,
}

impl SocialConfig {
    /// Paper AP's figures: personal space is a circle of 1.2 m, intimate space one of 0.4 m (AP 1), walking
    /// stretches it ahead (AP 2.1), and what lies outside costs as much as free space. The layers are AP's
    /// in any case. In configuration, `proxemics = "adaptive_proxemics"`.
    pub fn adaptive_proxemics() -> Self {
        Self {
            proxemics: Proxemics {
                shape: AsymmetricGaussian::adaptive_proxemics(),
                levels: Levels::adaptive_proxemics(),
            },
            ..Self::default()
        }
    }

    /// Everything that is wrong with the figures.
    pub fn problems(&self) -> Vec<ConfigError> {
        let length = "must be from 0 m to 1000 m";
        let curve = "needs 1 <= least <= most <= 1000, a ramp and steps every 0.001 s to 1e9 s, and a rise above 0 and at \
                     most 1000";
        let mut checks = vec![
            (
                "resolution".to_owned(),
                (0.005..=10.0).contains(&self.resolution),
                "must be from 0.005 m to 10 m",
            ),
            (
                "contour_points".to_owned(),
                (3..=1000).contains(&self.contour_points),
                "must be from 3 to 1000",
            ),
            (
                "proxemics.shape".to_owned(),
                self.proxemics.shape.is_valid(),
                "needs three widths from 0.001 m to 1000 m",
            ),
            (
                "proxemics.levels".to_owned(),
                self.proxemics.levels.is_valid(),
                "must satisfy 0 < social < personal < intimate < 1",
            ),
            (
                "clearance_cost".to_owned(),
                (0.0..=MOST_COST).contains(&self.clearance_cost),
                "must be from 0 to 1000",
            ),
            (
                "clearance_width".to_owned(),
                is_length(self.clearance_width),
                length,
            ),
            (
                "between_half_width".to_owned(),
                is_length(self.between_half_width),
                length,
            ),
            (
                "between_reach".to_owned(),
                is_length(self.between_reach),
                length,
            ),
            ("usage".to_owned(), self.usage.is_valid(), curve),
        ];
        checks.extend(
            self.usage_of
                .iter()
                .map(|(o, c)| (format!("usage_of.{o}"), c.is_valid(), curve)),
        );
        checks.extend(self.spaces.iter().map(|(class, space)| {
            let requirement =
                "needs lengths above 0 m and at most 1000 m, and an opening from 0 to 3.13";
            (format!("spaces.{class}"), space.is_valid(), requirement)
        }));
        checks.extend(self.activities.iter().map(|(name, shape)| {
            let requirement = "needs four widths from 0.001 m to 1000 m";
            (format!("activities.{name}"), shape.is_valid(), requirement)
        }));
        checks.extend(self.cooperation.iter().map(|(task, zones)| {
            let valid = zones.len() <= MOST_ZONES && zones.iter().all(CooperationZone::is_valid);
            let requirement =
                "needs at most two zones, each with a direction from -2 pi to 2 pi, and an opening above 0 and at most 2 pi";
            (format!("cooperation.{task}"), valid, requirement)
        }));
        checks.extend([
            (
                "walls".to_owned(),
                self.walls.is_none_or(|walls| walls.is_valid()),
                "needs a clearance and a margin from 0 m to 1000 m, margin < least <= most <= 1000 m, an exponent below 0, \
                 and with that and its factor widths from 0.001 m to 1000 m",
            ),
            (
                "grouping".to_owned(),
                self.grouping.is_valid(),
                "needs figures of at most 1e6, not negative but for bond; lengths above 0 m, of at most 1000 m; crowd_radius \
                 from 0.001 m to 10 m; field_of_view above 0 and at most pi",
            ),
        ]);
        let figures = checks
            .into_iter()
            .filter(|(_, sound, _)| !sound)
            .map(|(field, _, requirement)| (field, requirement.into()));
        let features = self.features.problems().into_iter();
        let features =
            features.map(|(path, requirement)| (format!("features.{path}"), requirement.into()));
        let activities: Vec<&str> = self.activities.keys().map(String::as_str).collect();
        let unknown = self.activity_in.iter().filter_map(|(room, activity)| {
            let none = unknown("the name of an activity", activity, &activities)?;
            Some((format!("activity_in.{room}"), none.into()))
        });
        figures
            .chain(features)
            .chain(unknown)
            .map(|(field, requirement)| ConfigError { field, requirement })
            .collect()
    }

    /// The names of rooms and, where `classes` are known, of classes of objects that there are not. What the
    /// defaults name may be missing.
    pub fn unknown_names(&self, rooms: &[String], classes: Option<&[&str]>) -> Vec<ConfigError> {
        let usual = Self::default();
        let rooms: Vec<&str> = rooms.iter().map(String::as_str).collect();
        let rooms = self
            .activity_in
            .keys()
            .filter_map(|name| Some(("activity_in", unknown("names of rooms", name, &rooms)?)));
        let classes = self
            .spaces
            .keys()
            .filter(|class| !usual.spaces.contains_key(*class))
            .filter_map(|name| Some(("spaces", unknown("classes of objects", name, classes?)?)));
        rooms
            .chain(classes)
            .map(|(field, requirement)| ConfigError {
                field: field.to_owned(),
                requirement: requirement.into(),
            })
            .collect()
    }
}

/// What is to be said of a name that is not among those known.
fn unknown(needed: &str, name: &str, known: &[&str]) -> Option<String> {
    let help = || suggestion(name, known.iter().copied());
    (!known.contains(&name)).then(|| format!("needs {needed}, and `{name}` is none{}", help()))
}

#[cfg(test)]
mod tests;
