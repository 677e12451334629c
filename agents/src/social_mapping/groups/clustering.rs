//! Paper TD's groups (TD 4.1, eq. 5 to 8; READING.md items 5 and 10): the Gaussians of people are
//! summed, and who stand in one region above the threshold, linked by neighbours, are a group.

use super::super::gaussian::AsymmetricGaussian;
use super::super::limits::{MOST_FIGURE, MOST_LENGTH};
use super::mesh::Mesh;
use super::union::Union;
use nalgebra::{Isometry2, Point2};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// The paper's thresholds; it prints none of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GaussianClustering {
    /// Density of a person.
    pub shape: AsymmetricGaussian,
    /// `Omega_d`: neighbours are at most so far apart, metres. Hall's far personal distance.
    pub distance: f64,
    /// `Omega_theta`: each of two neighbours has the other within this angle of the heading,
    /// radians (READING.md item 10). Half of what a person sees of other persons with certainty.
    pub field_of_view: f64,
    /// `k` of eq. 7: how many neighbours at the full distance raise the density to the threshold.
    pub neighbours: f64,
}

impl Default for GaussianClustering {
    fn default() -> Self {
        Self {
            shape: AsymmetricGaussian::HALL,
            distance: 1.2,
            field_of_view: std::f64::consts::FRAC_PI_2,
            neighbours: 1.0,
        }
    }
}

/// The region above the threshold is looked for along the way from neighbour to neighbour in steps
/// of so many metres.
const STEP: f64 = 0.05;

impl GaussianClustering {
    pub(super) fn is_valid(&self) -> bool {
        self.shape.is_valid()
            && [
                (self.distance, MOST_LENGTH),
                (self.field_of_view, PI),
                (self.neighbours, MOST_FIGURE),
            ]
            .into_iter()
            .all(|(x, most)| x > 0.0 && x <= most)
    }

    /// `phi = 1 + k delta` (eq. 7), delta being what a neighbour at the full distance ahead adds
    /// (eq. 6).
    pub fn threshold(&self) -> f64 {
        let delta = self
            .shape
            .density(&Isometry2::identity(), Point2::new(self.distance, 0.0));
        1.0 + self.neighbours * delta
    }

    /// The groups of people with finite poses, as indices in order.
    pub(super) fn groups(&self, people: &[Isometry2<f64>]) -> Vec<Vec<usize>> {
        let places: Vec<Point2<f64>> = people
            .iter()
            .map(|pose| pose.translation.vector.into())
            .collect();
        // Beyond four standard deviations a density of 3e-4 decides nothing.
        let reach = 4.0 * self.shape.front.max(self.shape.side).max(self.shape.rear);
        let nearby = super::near::Near::new(&places, reach);
        let density = |point: Point2<f64>| -> f64 {
            nearby
                .around(point)
                .map(|index| self.shape.density(&people[index], point))
                .sum()
        };
        let threshold = self.threshold();
        let sees = |from: usize, to: usize| {
            let place = people[from].inverse_transform_point(&places[to]);
            place.y.atan2(place.x).abs() <= self.field_of_view
        };
        let mut union = Union::new(people.len());
        for (a, b) in Mesh::new(&places).edges {
            let way = places[b] - places[a];
            if way.norm() > self.distance || !sees(a, b) || !sees(b, a) {
                continue;
            }
            let steps = (way.norm() / STEP).ceil().max(1.0) as usize;
            let inside = |i: usize| {
                density(places[a] + way * (i as f64 / steps as f64)) >= threshold - 1e-12
            };
            if (0..=steps).all(inside) {
                union.join(a, b);
            }
        }
        union.groups()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::facing_centre;
    use super::*;

    #[test]
    fn two_face_to_face_are_one_region_back_to_back_or_far_they_are_not() {
        let model = GaussianClustering::default();
        assert!((model.threshold() - 1.486_75).abs() < 1e-4);
        assert_eq!(model.groups(&facing_centre(0.0, 0.0, 0.5, 2)), [vec![0, 1]]);
        assert!(model.groups(&facing_centre(0.0, 0.0, 0.65, 2)).is_empty());
        let mut away = facing_centre(0.0, 0.0, 0.5, 2);
        away.swap(0, 1);
        let backs: Vec<_> = away
            .iter()
            .zip(facing_centre(0.0, 0.0, 0.5, 2))
            .map(|(turned, at)| Isometry2::from_parts(at.translation, turned.rotation))
            .collect();
        assert!(model.groups(&backs).is_empty());
    }
}
