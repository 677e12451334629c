//! Socialization features: how a person's mood, wishes or role widen and narrow the space around them
//! (TG 3.3.1 and 3.3.3; READING.md item 4). A feature has named levels in (0, 1], the more positive
//! the greater, and an influence in [-1, 1] on each of the four sides.

use super::four_sided::FourSided;
use crate::names::suggestion;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What influence does to a width.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InfluenceLaw {
    /// `sigma^2 <- sigma^2 max(1 - iv, LEAST_SHARE)`: with a positive influence, a happier person lets
    /// come closer, as the paper's text says.
    #[default]
    PositiveIsCloser,
    /// `sigma^2 <- iv sigma^2` where `iv > 0`, as the paper prints it; elsewhere the width stays.
    Printed,
}

/// What of a variance is left at least.
pub const LEAST_SHARE: f64 = 0.04;

/// How a feature acts on each side, each in [-1, 1].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Influence {
    /// Ahead.
    pub front: f64,
    /// To the left.
    pub left: f64,
    /// Behind.
    pub rear: f64,
    /// To the right.
    pub right: f64,
}

impl Influence {
    /// Front, left, rear, right.
    pub fn sides(&self) -> [f64; 4] {
        [self.front, self.left, self.rear, self.right]
    }
}

/// A feature.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Feature {
    /// Names of its values, each in (0, 1].
    pub levels: BTreeMap<String, f64>,
    /// How it acts.
    pub influence: Influence,
}

/// Features by name, and how they act.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Features {
    /// What influence does.
    pub law: InfluenceLaw,
    /// The features.
    pub known: BTreeMap<String, Feature>,
}

impl Default for Features {
    /// The paper's features (Tables 1 and 2, with the influences of Figs 14a and 14b), and a role of
    /// ours: who works here is passed closer than a resident, a visitor not as close.
    fn default() -> Self {
        let feature = |levels: &[(&str, f64)], [front, left, rear, right]: [f64; 4]| Feature {
            levels: levels.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect(),
            influence: Influence {
                front,
                left,
                rear,
                right,
            },
        };
        let needs = [("not_need", 0.1), ("neutral", 0.5), ("need", 0.9)];
        let emotions = [
            ("angry", 0.14),
            ("disgusted", 0.28),
            ("fearful", 0.42),
            ("sad", 0.56),
            ("neutral", 0.7),
            ("surprised", 0.84),
            ("happy", 0.98),
        ];
        let roles = [("visitor", 0.1), ("resident", 0.3), ("staff", 0.8)];
        let known = [
            ("emotional_state", feature(&emotions, [0.9, 0.5, 0.0, 0.5])),
            ("food_need", feature(&needs, [0.0, 0.5, 0.0, 0.0])),
            ("beverage_need", feature(&needs, [0.0, 0.0, 0.0, 0.5])),
            ("role", feature(&roles, [0.5, 0.5, 0.5, 0.5])),
        ];
        Self {
            law: InfluenceLaw::default(),
            known: known
                .map(|(name, feature)| (name.to_owned(), feature))
                .into_iter()
                .collect(),
        }
    }
}

/// Why a person's features cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FeatureError {
    /// Not `feature=value`.
    #[error("`{text}` is not feature=value")]
    Form {
        /// What is there.
        text: String,
    },
    /// No such feature.
    #[error("there is no feature called `{name}`{help}")]
    Unknown {
        /// The name given.
        name: String,
        /// The nearest name, or all.
        help: String,
    },
    /// Given more than once.
    #[error("{feature} is given twice")]
    Twice {
        /// The feature.
        feature: String,
    },
    /// Neither a level's name nor a number in (0, 1].
    #[error(
        "`{value}` is no value of {feature}, which is a number above 0 and at most 1 or the name of a level{help}"
    )]
    Value {
        /// The feature.
        feature: String,
        /// The value given.
        value: String,
        /// The nearest name of a level, or all.
        help: String,
    },
}

impl Features {
    /// Each level and influence that is outside of its range, by the path to it, and what it must be.
    pub fn problems(&self) -> Vec<(String, &'static str)> {
        let mut found = Vec::new();
        for (name, feature) in &self.known {
            for (level, value) in &feature.levels {
                if !(*value > 0.0 && *value <= 1.0) {
                    found.push((
                        format!("known.{name}.levels.{level}"),
                        "must be above 0 and at most 1",
                    ));
                }
            }
            for (side, value) in ["front", "left", "rear", "right"]
                .iter()
                .zip(feature.influence.sides())
            {
                // Also what is no number.
                if !(-1.0..=1.0).contains(&value) {
                    found.push((
                        format!("known.{name}.influence.{side}"),
                        "must be from -1 to 1",
                    ));
                }
            }
        }
        found
    }

    /// Reads `emotional_state=happy, food_need=0.9`: any number of features, separated by commas,
    /// each a level's name or a number.
    ///
    /// # Errors
    /// [`FeatureError`], the first.
    pub fn parse(&self, text: &str) -> Result<BTreeMap<String, f64>, FeatureError> {
        let mut values = BTreeMap::new();
        for part in text.split(',').map(str::trim).filter(|p| !p.is_empty()) {
            let (name, value) = part.split_once('=').ok_or_else(|| FeatureError::Form {
                text: part.to_owned(),
            })?;
            let (name, value) = (name.trim(), value.trim());
            let feature = self.known.get(name).ok_or_else(|| FeatureError::Unknown {
                name: name.to_owned(),
                help: suggestion(name, self.known.keys().map(String::as_str)),
            })?;
            let number = feature.levels.get(value).copied();
            let number = number.or_else(|| value.parse().ok().filter(|v| *v > 0.0 && *v <= 1.0));
            let number = number.ok_or_else(|| FeatureError::Value {
                feature: name.to_owned(),
                value: value.to_owned(),
                help: suggestion(value, feature.levels.keys().map(String::as_str)),
            })?;
            if values.insert(name.to_owned(), number).is_some() {
                return Err(FeatureError::Twice {
                    feature: name.to_owned(),
                });
            }
        }
        Ok(values)
    }

    /// The text that [`Self::parse`] reads these values from, to a thousandth.
    pub fn text(values: &BTreeMap<String, f64>) -> String {
        let one = |(name, value): (&String, &f64)| {
            // Not rounded to 0, which is no value.
            let value = (value * 1e3).round().max(1.0) / 1e3;
            format!("{name}={value}")
        };
        values.iter().map(one).collect::<Vec<_>>().join(", ")
    }

    /// The influence value to each side, `iv = FV . IV` (front, left, rear, right). Features that
    /// are not known have none.
    pub fn influence(&self, values: &BTreeMap<String, f64>) -> [f64; 4] {
        let mut sum = [0.0; 4];
        for (name, value) in values {
            let Some(feature) = self.known.get(name) else {
                continue;
            };
            for (sum, side) in sum.iter_mut().zip(feature.influence.sides()) {
                *sum += value * side;
            }
        }
        sum
    }

    /// `shape` under these values of features. Without any it is unchanged.
    #[must_use]
    pub fn apply(&self, shape: FourSided, values: &BTreeMap<String, f64>) -> FourSided {
        if values.is_empty() {
            return shape;
        }
        let (influence, sides) = (self.influence(values), shape.sides());
        FourSided::from_sides(std::array::from_fn(|side| {
            sides[side] * share(self.law, influence[side]).sqrt()
        }))
    }
}

/// What is left of a variance under an influence value.
fn share(law: InfluenceLaw, influence: f64) -> f64 {
    match law {
        InfluenceLaw::PositiveIsCloser => (1.0 - influence).max(LEAST_SHARE),
        InfluenceLaw::Printed if influence > 0.0 => influence,
        InfluenceLaw::Printed => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apply(features: &Features, text: &str) -> FourSided {
        features.apply(FourSided::HALL, &features.parse(text).unwrap())
    }

    #[test]
    fn the_happier_the_closer_ahead_and_not_at_all_behind() {
        let features = Features::default();
        let [angry, neutral, happy] = ["angry", "neutral", "happy"]
            .map(|mood| apply(&features, &format!("emotional_state={mood}")));
        assert!(angry.front > neutral.front && neutral.front > happy.front);
        assert!((happy.front - (1.0f64 - 0.98 * 0.9).sqrt()).abs() < 1e-12);
        assert!((happy.rear - 0.5).abs() < 1e-12);
    }

    #[test]
    fn food_comes_from_the_left_and_drink_from_the_right() {
        let features = Features::default();
        let hungry = apply(&features, "food_need=need, beverage_need=not_need");
        assert!(hungry.left < hungry.right && (hungry.front - 1.0).abs() < 1e-12);
        let both = apply(&features, "food_need=0.9,beverage_need=0.9");
        assert!((both.left - both.right).abs() < 1e-12);
        assert_eq!(apply(&features, ""), FourSided::HALL);
    }

    #[test]
    fn the_printed_law_scales_variances_and_spares_influences_that_are_not_positive() {
        let features = Features {
            law: InfluenceLaw::Printed,
            ..Features::default()
        };
        let happy = apply(&features, "emotional_state=happy");
        assert!((happy.front - (0.98f64 * 0.9).sqrt()).abs() < 1e-12);
        assert!((happy.rear - 0.5).abs() < 1e-12);
    }

    #[test]
    fn the_closest_that_anybody_lets_come_has_a_floor() {
        let mut features = Features::default();
        for feature in features.known.values_mut() {
            feature.influence.front = 1.0;
        }
        let open = apply(&features, "emotional_state=1, food_need=1, role=1");
        assert!((open.front - 0.2).abs() < 1e-12);
        assert_eq!(features.problems(), []);
        features
            .known
            .entry("role".into())
            .or_default()
            .influence
            .left = 1.5;
        features
            .known
            .entry("food_need".into())
            .or_default()
            .levels
            .insert("some".into(), 0.0);
        let told = features.problems().into_iter().map(|(path, _)| path);
        assert_eq!(
            told.collect::<Vec<_>>(),
            ["known.food_need.levels.some", "known.role.influence.left"]
        );
    }

    #[test]
    fn values_are_written_as_they_are_read() {
        let features = Features::default();
        let text = "emotional_state=0.7, food_need=0.001";
        let values = features.parse(text).unwrap();
        assert_eq!(Features::text(&values), text);
        let least = [("role".to_owned(), 1e-9)].into();
        assert_eq!(Features::text(&least), "role=0.001");
    }

    #[test]
    fn what_cannot_be_read_says_what_could() {
        let refused = |text: &str| Features::default().parse(text).unwrap_err().to_string();
        assert_eq!(refused("happy"), "`happy` is not feature=value");
        assert_eq!(
            refused("emotional_state=happy, role=staff, emotional_state=sad"),
            "emotional_state is given twice"
        );
        assert_eq!(
            refused("mood=happy"),
            "there is no feature called `mood`; known are: beverage_need, emotional_state, food_need, role"
        );
        assert_eq!(
            refused("food_need=0"),
            "`0` is no value of food_need, which is a number above 0 and at most 1 or the name of a level; \
             known are: need, neutral, not_need"
        );
    }
}
