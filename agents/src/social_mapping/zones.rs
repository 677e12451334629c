//! Hall's zones around people: contour levels of their densities (TD 4.1, READING.md items 5, 6, 7,
//! 16). This file owns which zone a place is in; the map and the metrics ask the same function.

use super::four_sided::squared_deviation_at;
use super::gaussian::AsymmetricGaussian;
use super::preset::{Named, Preset, named_or_table};
use crate::grid::{BLOCKED, FREE};
use nalgebra::{Isometry2, Point2};
use serde::{Deserialize, Serialize};

/// How close to people a place is. Ordered: a closer zone is greater.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Zone {
    /// Everything else.
    #[default]
    Public,
    /// Within the social contour, outside the personal one.
    Social,
    /// Within the personal contour, outside the intimate one.
    Personal,
    /// Within the intimate contour: no robot enters.
    Intimate,
}

impl Zone {
    /// The zones, from the closest outwards.
    pub const ALL: [Self; 4] = [Self::Intimate, Self::Personal, Self::Social, Self::Public];

    /// What crossing a cell of this zone costs (READING.md item 7).
    pub fn cost(self) -> f32 {
        match self {
            Self::Public => FREE,
            Self::Social => 2.0,
            Self::Personal => 4.0,
            Self::Intimate => BLOCKED,
        }
    }
}

/// The densities at which the zones end. In configuration also the name of a [`Preset`] (READING.md item 6).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Levels {
    /// Intimate at and above this density.
    pub intimate: f64,
    /// Personal at and above this density.
    pub personal: f64,
    /// Social at and above this density.
    pub social: f64,
}

#[derive(Deserialize)]
#[serde(remote = "Levels", deny_unknown_fields)]
struct LevelsTable {
    intimate: f64,
    personal: f64,
    social: f64,
}

named_or_table!(Levels, LevelsTable);

impl Preset for Levels {
    const WHAT: &'static str = "levels";
    const PRESETS: &'static [Named<Self>] = &[
        ("hall", Self::default),
        ("authors_9_6_3", || Self::of([0.9, 0.6, 0.3])),
        ("authors_8_5_2", || Self::of([0.8, 0.5, 0.2])),
        ("adaptive_proxemics", Self::adaptive_proxemics),
    ];
}

impl Default for Levels {
    fn default() -> Self {
        Self {
            intimate: 0.9,
            personal: 0.5,
            social: 0.1,
        }
    }
}

impl Levels {
    fn of([intimate, personal, social]: [f64; 3]) -> Self {
        Self {
            intimate,
            personal,
            social,
        }
    }

    /// Paper AP's: with its widths, personal space ends at 1.2 m and intimate space at 0.4 m (AP 1); what lies outside
    /// is like free space, so a social zone ends just outside of the personal one.
    pub fn adaptive_proxemics() -> Self {
        const INTIMATE: f64 = 0.4;
        const PERSONAL: f64 = 0.5;
        let width = AsymmetricGaussian::adaptive_proxemics().front;
        let intimate = (-0.5 * (INTIMATE / width).powi(2)).exp();
        Self::of([intimate, PERSONAL, 0.999 * PERSONAL])
    }

    /// Whether the zones are nested: 0 < social < personal < intimate < 1.
    pub fn is_valid(&self) -> bool {
        0.0 < self.social
            && self.social < self.personal
            && self.personal < self.intimate
            && self.intimate < 1.0
    }

    /// The density at which `zone` ends; `None` for the public zone, which has no end.
    pub fn level(&self, zone: Zone) -> Option<f64> {
        match zone {
            Zone::Public => None,
            Zone::Social => Some(self.social),
            Zone::Personal => Some(self.personal),
            Zone::Intimate => Some(self.intimate),
        }
    }
}

/// The model of people's space: a density and the levels that cut it into zones. In configuration also the name of a
/// [`Preset`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Proxemics {
    /// The density of a standing person.
    pub shape: AsymmetricGaussian,
    /// Where the zones end.
    pub levels: Levels,
}

#[derive(Deserialize)]
#[serde(remote = "Proxemics", deny_unknown_fields)]
struct ProxemicsTable {
    #[serde(default)]
    shape: AsymmetricGaussian,
    #[serde(default)]
    levels: Levels,
}

named_or_table!(Proxemics, ProxemicsTable);

impl Preset for Proxemics {
    const WHAT: &'static str = "proxemics";
    const PRESETS: &'static [Named<Self>] = &[
        ("hall", Self::default),
        ("printed", || Self {
            shape: AsymmetricGaussian::PRINTED,
            ..Self::default()
        }),
        ("adaptive_proxemics", || Self {
            shape: AsymmetricGaussian::adaptive_proxemics(),
            levels: Levels::adaptive_proxemics(),
        }),
    ];
}

impl Proxemics {
    /// The zone of `point` (world frame) among people at the poses `people` (`world_from_person`).
    ///
    /// Zones are nested per person, and of several people's zones the closest holds: the maximum
    /// of the densities decides, not their sum (READING.md items 5 and 16). Each point is in exactly
    /// one zone, so shares of time in the four add up to one. Poses must be finite: a person whose
    /// pose is not has no space. Linear in the number of people.
    pub fn zone_at(&self, point: Point2<f64>, people: &[Isometry2<f64>]) -> Zone {
        let cuts = Cuts::new(&self.levels);
        people
            .iter()
            .map(|pose| {
                let place = pose.inverse_transform_point(&point);
                cuts.zone(self.shape.squared_deviation(place))
            })
            .max()
            .unwrap_or_default()
    }

    /// The density at `point`: the greatest of all people's, 0 with nobody there.
    pub fn density_at(&self, point: Point2<f64>, people: &[Isometry2<f64>]) -> f64 {
        people
            .iter()
            .map(|pose| self.shape.density(pose, point))
            .fold(0.0, f64::max)
    }

    /// The outline of `zone` around one person, as [`AsymmetricGaussian::contour`] gives it; empty
    /// for the public zone.
    pub fn contour(
        &self,
        zone: Zone,
        world_from_person: &Isometry2<f64>,
        points: usize,
    ) -> Vec<Point2<f64>> {
        match self.levels.level(zone) {
            Some(level) => self.shape.contour(world_from_person, level, points),
            None => Vec::new(),
        }
    }
}

/// The zone of `point` among `people` with the default model, preset `hall` with levels .9/.5/.1;
/// see [`Proxemics::zone_at`].
pub fn zone_at(point: Point2<f64>, people: &[Isometry2<f64>]) -> Zone {
    Proxemics::default().zone_at(point, people)
}

/// The levels as squared deviations: one comparison a cell, no exponential.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cuts {
    pub(super) intimate: f64,
    pub(super) personal: f64,
    pub(super) social: f64,
}

impl Cuts {
    pub(super) fn new(levels: &Levels) -> Self {
        Self {
            intimate: squared_deviation_at(levels.intimate),
            personal: squared_deviation_at(levels.personal),
            social: squared_deviation_at(levels.social),
        }
    }

    pub(super) fn zone(&self, squared_deviation: f64) -> Zone {
        if squared_deviation <= self.intimate {
            Zone::Intimate
        } else if squared_deviation <= self.personal {
            Zone::Personal
        } else if squared_deviation <= self.social {
            Zone::Social
        } else {
            Zone::Public
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;
    use proptest::prelude::*;

    #[test]
    fn hall_puts_intimate_at_0_46_m_and_personal_at_1_18_m() {
        let Proxemics { shape, levels } = Proxemics::default();
        let ahead = |level| shape.distance_at(0.0, level).unwrap();
        assert!((ahead(levels.intimate) - 0.46).abs() < 0.005);
        assert!((ahead(levels.personal) - 1.18).abs() < 0.005);
        assert!((ahead(levels.social) - 2.15).abs() < 0.005);
        let person = [Isometry2::new(
            Vector2::new(3.0, 1.0),
            std::f64::consts::FRAC_PI_2,
        )];
        let zone = |ahead: f64| zone_at(Point2::new(3.0, 1.0 + ahead), &person);
        assert_eq!(zone(0.45), Zone::Intimate);
        assert_eq!(zone(0.47), Zone::Personal);
        assert_eq!(zone(1.17), Zone::Personal);
        assert_eq!(zone(1.19), Zone::Social);
        assert_eq!(zone(2.16), Zone::Public);
        assert_eq!(zone(-0.24), Zone::Personal);
        let printed = AsymmetricGaussian::PRINTED;
        assert!((printed.distance_at(0.0, 0.9).unwrap() - 0.92).abs() < 0.005);
        assert!((printed.distance_at(0.0, 0.5).unwrap() - 2.35).abs() < 0.006);
    }

    #[test]
    fn the_closest_zone_of_several_people_holds() {
        // Half way between two people the sum of their densities would be 1.03: intimate.
        let people = [
            Isometry2::new(Vector2::new(0.0, 0.0), 0.0),
            Isometry2::new(Vector2::new(2.3, 0.0), std::f64::consts::PI),
        ];
        let middle = Point2::new(1.15, 0.0);
        let density = Proxemics::default().density_at(middle, &people);
        assert!((density - 0.516).abs() < 0.001);
        assert_eq!(zone_at(middle, &people), Zone::Personal);
        assert_eq!(zone_at(middle, &[]), Zone::Public);
    }

    proptest! {
        #[test]
        fn zones_are_nested_and_agree_with_the_density(
            x in -4.0..4.0f64, y in -4.0..4.0f64, heading in -4.0..4.0f64,
            px in -4.0..4.0f64, py in -4.0..4.0f64,
        ) {
            let model = Proxemics::default();
            let people = [
                Isometry2::new(Vector2::new(px, py), heading),
                Isometry2::new(Vector2::new(py, px), heading + 1.0),
            ];
            let point = Point2::new(x, y);
            let density = model.density_at(point, &people);
            let zone = model.zone_at(point, &people);
            for inner in [Zone::Intimate, Zone::Personal, Zone::Social] {
                let level = model.levels.level(inner).unwrap();
                if (density - level).abs() > 1e-9 {
                    prop_assert_eq!(density >= level, zone >= inner);
                }
            }
            // One more person never takes a place out of a zone.
            prop_assert!(zone >= model.zone_at(point, &people[..1]));
        }

        #[test]
        fn each_contour_lies_inside_the_next(heading in -4.0..4.0f64) {
            let model = Proxemics::default();
            let pose = Isometry2::new(Vector2::new(1.0, 2.0), heading);
            let ring = |zone| model.contour(zone, &pose, 24);
            prop_assert!(ring(Zone::Intimate).iter().all(|p| model.zone_at(*p, &[pose]) >= Zone::Personal));
            let personal = ring(Zone::Personal);
            let social = ring(Zone::Social);
            for (inner, outer) in personal.iter().zip(&social) {
                let centre = Point2::from(pose.translation.vector);
                prop_assert!((inner - centre).norm() < (outer - centre).norm());
            }
        }
    }
}
