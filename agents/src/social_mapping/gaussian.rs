//! Kirby's asymmetric Gaussian: how much a place belongs to a person (TD eq. 1 to 4, READING.md
//! items 1 and 2). This file owns the curve and its contours; both are exact, in the person's own
//! frame, so the surface is continuous everywhere.

use super::four_sided::{FourSided, WIDTHS};
use super::preset::{Named, Preset, named_or_table};
use nalgebra::{Isometry2, Point2};
use serde::{Deserialize, Serialize};

/// The standard deviations of a person's space to the front, the sides and the rear, metres.
///
/// In configuration also the name of a [`Preset`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AsymmetricGaussian {
    /// Along the heading.
    pub front: f64,
    /// To either side.
    pub side: f64,
    /// Against the heading.
    pub rear: f64,
}

#[derive(Deserialize)]
#[serde(remote = "AsymmetricGaussian", deny_unknown_fields)]
struct Widths {
    front: f64,
    side: f64,
    rear: f64,
}

named_or_table!(AsymmetricGaussian, Widths);

impl Preset for AsymmetricGaussian {
    const WHAT: &'static str = "widths";
    const PRESETS: &'static [Named<Self>] = &[
        ("hall", || Self::HALL),
        ("printed", || Self::PRINTED),
        ("adaptive_proxemics", Self::adaptive_proxemics),
    ];
}

impl AsymmetricGaussian {
    /// The widths with which Hall's distances come out: level 0.9 lies 0.46 m ahead and 0.5 lies
    /// 1.18 m ahead (READING.md item 2).
    pub const HALL: Self = Self {
        front: 1.0,
        side: 0.75,
        rear: 0.5,
    };
    /// The widths as paper TD prints them.
    pub const PRINTED: Self = Self {
        front: 2.0,
        side: 4.0 / 3.0,
        rear: 1.0,
    };

    /// The same to all sides, as paper AP has personal space: with the density .5 at 1.2 m (AP 1).
    pub fn adaptive_proxemics() -> Self {
        const PERSONAL: f64 = 1.2;
        let width = PERSONAL / (-2.0 * 0.5f64.ln()).sqrt();
        Self {
            front: width,
            side: width,
            rear: width,
        }
    }

    /// Whether all three widths are positive and finite.
    pub fn is_valid(&self) -> bool {
        [self.front, self.side, self.rear]
            .iter()
            .all(|side| WIDTHS.contains(side))
    }

    /// With a width for each of the four sides.
    pub fn four_sided(&self) -> FourSided {
        (*self).into()
    }

    /// See [`FourSided::squared_deviation`].
    pub fn squared_deviation(&self, place: Point2<f64>) -> f64 {
        self.four_sided().squared_deviation(place)
    }

    /// The density at `point` (world frame) of a person at `world_from_person`: 1 at the person,
    /// falling to 0. Equals Kirby's rotated form with its factor 2 (READING.md item 1).
    pub fn density(&self, world_from_person: &Isometry2<f64>, point: Point2<f64>) -> f64 {
        self.four_sided().density(world_from_person, point)
    }

    /// See [`FourSided::distance_at`].
    pub fn distance_at(&self, direction: f64, level: f64) -> Option<f64> {
        self.four_sided().distance_at(direction, level)
    }

    /// See [`FourSided::contour`].
    pub fn contour(
        &self,
        world_from_person: &Isometry2<f64>,
        level: f64,
        points: usize,
    ) -> Vec<Point2<f64>> {
        self.four_sided().contour(world_from_person, level, points)
    }
}

impl Default for AsymmetricGaussian {
    fn default() -> Self {
        Self::HALL
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;
    use proptest::prelude::*;

    fn pose() -> impl Strategy<Value = Isometry2<f64>> {
        (-20.0..20.0, -20.0..20.0, -4.0..4.0)
            .prop_map(|(x, y, heading)| Isometry2::new(Vector2::new(x, y), heading))
    }

    fn shape() -> impl Strategy<Value = AsymmetricGaussian> {
        (0.2..3.0, 0.2..3.0, 0.2..3.0).prop_map(|(front, side, rear)| AsymmetricGaussian {
            front,
            side,
            rear,
        })
    }

    /// Kirby's rotated form, as READING.md item 1 gives it.
    fn kirby(g: &AsymmetricGaussian, pose: &Isometry2<f64>, point: Point2<f64>) -> f64 {
        let t = pose.rotation.angle();
        let d = point - Point2::from(pose.translation.vector);
        let ahead = t.cos() * d.x + t.sin() * d.y >= 0.0;
        let s2 = if ahead { g.front } else { g.rear }.powi(2);
        let ss2 = g.side.powi(2);
        let a = t.cos().powi(2) / (2.0 * s2) + t.sin().powi(2) / (2.0 * ss2);
        let b = (2.0 * t).sin() / (4.0 * s2) - (2.0 * t).sin() / (4.0 * ss2);
        let c = t.sin().powi(2) / (2.0 * s2) + t.cos().powi(2) / (2.0 * ss2);
        (-(a * d.x * d.x + 2.0 * b * d.x * d.y + c * d.y * d.y)).exp()
    }

    #[test]
    fn presets_have_names_in_configuration() {
        let read = |text: &str| serde_json::from_str::<AsymmetricGaussian>(text);
        assert_eq!(read("\"printed\"").unwrap(), AsymmetricGaussian::PRINTED);
        let written = serde_json::to_string(&AsymmetricGaussian::HALL).unwrap();
        assert_eq!(read(&written).unwrap(), AsymmetricGaussian::HALL);
        let error = read("\"hal\"").unwrap_err().to_string();
        assert!(error.contains("there are no widths `hal`"), "{error}");
    }

    #[test]
    fn levels_outside_the_unit_interval_have_no_contour() {
        let hall = AsymmetricGaussian::HALL;
        for level in [0.0, 1.0, -0.5, 2.0, f64::NAN] {
            assert_eq!(hall.distance_at(0.0, level), None);
            assert!(hall.contour(&Isometry2::identity(), level, 24).is_empty());
        }
    }

    proptest! {
        #[test]
        fn density_is_kirbys_and_within_the_unit_interval(
            g in shape(), pose in pose(), x in -25.0..25.0f64, y in -25.0..25.0f64,
        ) {
            let point = Point2::new(x, y);
            let density = g.density(&pose, point);
            prop_assert!((0.0..=1.0).contains(&density));
            // On the lateral axis rounding may put the two forms on different halves.
            prop_assert!((density - kirby(&g, &pose, point)).abs() < 1e-9);
            let own = g.density(&pose, Point2::from(pose.translation.vector));
            prop_assert!((own - 1.0).abs() < 1e-12);
        }

        #[test]
        fn density_is_continuous_across_the_lateral_axis(
            g in shape(), pose in pose(), y in -5.0..5.0f64,
        ) {
            let ahead = g.density(&pose, pose * Point2::new(1e-7, y));
            let behind = g.density(&pose, pose * Point2::new(-1e-7, y));
            prop_assert!((ahead - behind).abs() < 1e-9);
        }

        #[test]
        fn contour_points_lie_on_their_level(
            g in shape(), pose in pose(), level in 0.02..0.98f64, points in 1usize..80,
        ) {
            let contour = g.contour(&pose, level, points);
            prop_assert!(contour.len() >= points && contour.len().is_multiple_of(4));
            for point in contour {
                prop_assert!((g.density(&pose, point) - level).abs() < 1e-9);
            }
        }

        #[test]
        fn distance_along_a_direction_meets_the_level(
            g in shape(), pose in pose(), level in 0.02..0.98f64, direction in -7.0..7.0f64,
        ) {
            let distance = g.distance_at(direction, level).unwrap();
            let point = pose * Point2::new(distance * direction.cos(), distance * direction.sin());
            prop_assert!((g.density(&pose, point) - level).abs() < 1e-9);
        }

        #[test]
        fn density_moves_and_turns_with_the_person(
            g in shape(), pose in pose(), motion in pose(),
            x in -5.0..5.0f64, y in -5.0..5.0f64,
        ) {
            let point = Point2::new(x, y);
            let moved = g.density(&(motion * pose), motion * point);
            prop_assert!((g.density(&pose, point) - moved).abs() < 1e-9);
        }
    }
}
