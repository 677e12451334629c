//! The Gaussian with a width of its own to each of the four sides (TG eq. 6 to 8, READING.md item 4).
//! This file owns the curve of every personal space: Kirby's (TD eq. 1 to 4) is the case in which
//! left equals right. Curve and contours are closed form, in the person's own frame, so the surface
//! is continuous everywhere.

use super::gaussian::AsymmetricGaussian;
use nalgebra::{Isometry2, Point2};
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI};

/// How long a walking person's way ahead counts as theirs, seconds. With the `hall` widths a runner
/// (2 m/s) gets the front width 2.0 m that AP prints for running.
pub const LOOK_AHEAD: f64 = 0.5;
/// Speeds above this stretch a space no further, m/s: faster "people" are tracking errors.
pub const FASTEST: f64 = 2.0;

/// The widths that a space may be given, metres: a millimetre to a kilometre, so that squares and quotients of
/// them are numbers.
pub const WIDTHS: std::ops::RangeInclusive<f64> = 1e-3..=1e3;

/// The standard deviations of a space ahead, to the left, behind and to the right, metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FourSided {
    /// Along the heading.
    pub front: f64,
    /// To the left of the heading.
    pub left: f64,
    /// Against the heading.
    pub rear: f64,
    /// To the right of the heading.
    pub right: f64,
}

impl From<AsymmetricGaussian> for FourSided {
    fn from(kirby: AsymmetricGaussian) -> Self {
        Self {
            front: kirby.front,
            left: kirby.side,
            rear: kirby.rear,
            right: kirby.side,
        }
    }
}

impl FourSided {
    /// Preset `hall`, see [`AsymmetricGaussian::HALL`].
    pub const HALL: Self = Self {
        front: 1.0,
        left: 0.75,
        rear: 0.5,
        right: 0.75,
    };

    /// The same width to all sides.
    pub fn round(width: f64) -> Self {
        Self {
            front: width,
            left: width,
            rear: width,
            right: width,
        }
    }

    /// The space of a person who walks with `forward_speed` along the heading, m/s: the front
    /// grows by [`LOOK_AHEAD`] times the speed. AP updates the front width with the velocity and
    /// prints no law; this one meets its figure for running. Who walks backwards keeps their space.
    #[must_use]
    pub fn walking(&self, forward_speed: f64) -> Self {
        let stretch = LOOK_AHEAD * forward_speed.clamp(0.0, FASTEST);
        Self {
            front: self.front + stretch,
            ..*self
        }
    }

    /// Whether all four are [`WIDTHS`].
    pub fn is_valid(&self) -> bool {
        self.sides().iter().all(|side| WIDTHS.contains(side))
    }

    /// Front, left, rear, right: counter-clockwise.
    pub fn sides(&self) -> [f64; 4] {
        [self.front, self.left, self.rear, self.right]
    }

    /// From front, left, rear, right.
    pub fn from_sides([front, left, rear, right]: [f64; 4]) -> Self {
        Self {
            front,
            left,
            rear,
            right,
        }
    }

    /// The squared distance of a place from the person in units of the standard deviations;
    /// `place` is in the person's own frame (x ahead, y left), metres.
    pub fn squared_deviation(&self, place: Point2<f64>) -> f64 {
        let along = if place.x >= 0.0 {
            self.front
        } else {
            self.rear
        };
        let across = if place.y >= 0.0 {
            self.left
        } else {
            self.right
        };
        (place.x / along).powi(2) + (place.y / across).powi(2)
    }

    /// The density at `point` (world frame) of a person at `world_from_person`: 1 at the person,
    /// falling to 0.
    pub fn density(&self, world_from_person: &Isometry2<f64>, point: Point2<f64>) -> f64 {
        let place = world_from_person.inverse_transform_point(&point);
        (-0.5 * self.squared_deviation(place)).exp()
    }

    /// How far from the person the density falls to `level`, metres, in `direction` (radians
    /// counter-clockwise from the heading). `None` where `level` is not in (0, 1).
    pub fn distance_at(&self, direction: f64, level: f64) -> Option<f64> {
        let deviations = deviations_at(level)?;
        let (sin, cos) = direction.sin_cos();
        let along = if cos >= 0.0 { self.front } else { self.rear };
        let across = if sin >= 0.0 { self.left } else { self.right };
        Some(deviations / (cos / along).hypot(sin / across))
    }

    /// The contour at `level`: four quarters of ellipses, world frame, counter-clockwise from the
    /// right-hand side, closed (the first point is not repeated).
    ///
    /// `points` is rounded up to a multiple of four, so that the extremes on the axes are among
    /// them. Empty where `level` is not in (0, 1).
    pub fn contour(
        &self,
        world_from_person: &Isometry2<f64>,
        level: f64,
        points: usize,
    ) -> Vec<Point2<f64>> {
        let Some(deviations) = deviations_at(level) else {
            return Vec::new();
        };
        let half = (points.max(4).div_ceil(4)) * 2;
        (0..2 * half)
            .map(|i| {
                let (sin, cos) = (-FRAC_PI_2 + PI * i as f64 / half as f64).sin_cos();
                let along = if i <= half { self.front } else { self.rear };
                let across = if i >= half / 2 && 2 * i <= 3 * half {
                    self.left
                } else {
                    self.right
                };
                world_from_person * Point2::new(deviations * along * cos, deviations * across * sin)
            })
            .collect()
    }
}

/// How many standard deviations from the person the density is `level`.
fn deviations_at(level: f64) -> Option<f64> {
    (level > 0.0 && level < 1.0).then(|| squared_deviation_at(level).sqrt())
}

/// The squared deviation at which the density is `level`.
pub(super) fn squared_deviation_at(level: f64) -> f64 {
    -2.0 * level.ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;
    use proptest::prelude::*;

    fn shape() -> impl Strategy<Value = FourSided> {
        (0.2..3.0, 0.2..3.0, 0.2..3.0, 0.2..3.0)
            .prop_map(|(a, b, c, d)| FourSided::from_sides([a, b, c, d]))
    }

    #[test]
    fn each_side_has_its_width() {
        let shape = FourSided::from_sides([2.0, 1.5, 0.5, 0.75]);
        let level = (-0.5f64).exp();
        for (quarter, width) in shape.sides().into_iter().enumerate() {
            let direction = quarter as f64 * FRAC_PI_2;
            let reach = shape.distance_at(direction, level).unwrap();
            assert!((reach - width).abs() < 1e-12, "{quarter}: {reach}");
        }
        let points = shape.contour(&Isometry2::identity(), level, 8);
        assert_eq!(points.len(), 8);
        let extremes = [(0.0, -0.75), (2.0, 0.0), (0.0, 1.5), (-0.5, 0.0)];
        for (point, (x, y)) in points.iter().step_by(2).zip(extremes) {
            assert!((point - Point2::new(x, y)).norm() < 1e-12, "{point}");
        }
    }

    #[test]
    fn a_runner_has_the_front_that_ap_prints() {
        let runner = FourSided::HALL.walking(2.0);
        assert!((runner.front - 2.0).abs() < 1e-12);
        assert_eq!(FourSided::HALL.walking(-1.0), FourSided::HALL);
        assert_eq!(FourSided::HALL.walking(40.0), runner);
    }

    proptest! {
        #[test]
        fn the_contour_lies_on_its_level(
            g in shape(), x in -9.0..9.0f64, y in -9.0..9.0f64, heading in -4.0..4.0f64,
            level in 0.01..0.99f64, points in 1usize..40,
        ) {
            let pose = Isometry2::new(Vector2::new(x, y), heading);
            let contour = g.contour(&pose, level, points);
            prop_assert!(contour.len() >= points && contour.len().is_multiple_of(4));
            for point in contour {
                prop_assert!((g.density(&pose, point) - level).abs() < 1e-9);
                let place = pose.inverse_transform_point(&point);
                let reach = g.distance_at(place.y.atan2(place.x), level).unwrap();
                prop_assert!((reach - place.coords.norm()).abs() < 1e-9);
            }
        }

        #[test]
        fn the_density_is_continuous_across_both_axes(
            g in shape(), a in -5.0..5.0f64, along: bool,
        ) {
            let at = |b: f64| {
                let place = if along { Point2::new(a, b) } else { Point2::new(b, a) };
                g.density(&Isometry2::identity(), place)
            };
            prop_assert!((at(1e-7) - at(-1e-7)).abs() < 1e-6);
        }
    }
}
