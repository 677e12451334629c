//! How crowded it is around a place: the sum of everybody's weights there, falling with the distance as a Gaussian
//! does. This file owns the fast way to add them up; the sum depends on the places and their order alone.

use super::super::density::density_within;
use nalgebra::Point2;
use pulp::{Arch, NullaryFnOnce};

/// Whose weight is below `exp(-8)`, from four radii on, does not count.
const LIMIT: f32 = 16.0;
/// Weights added at once.
const LANES: usize = 8;

/// People sorted into square cells, row by row, so that who is in neighbouring cells of a row stands in one stretch.
#[derive(Debug)]
pub(super) struct Crowd {
    /// The reach of a weight and the side of a cell, metres.
    reach: f64,
    /// Of a squared distance, to squared deviations.
    scale: f64,
    /// Row and column of each person's cell, in order.
    cells: Vec<[i64; 2]>,
    x: Vec<f64>,
    y: Vec<f64>,
}

impl Crowd {
    /// Sorts finite places; `radius` is the standard deviation of a weight, metres.
    pub(super) fn new(places: &[Point2<f64>], radius: f64) -> Self {
        let reach = f64::from(LIMIT).sqrt() * radius;
        let mut sorted: Vec<([i64; 2], Point2<f64>)> = places
            .iter()
            .map(|place| (cell(*place, reach), *place))
            .collect();
        // Stable: of one cell in the order given.
        sorted.sort_by_key(|(cell, _)| *cell);
        Self {
            reach,
            scale: radius.powi(-2),
            cells: sorted.iter().map(|(cell, _)| *cell).collect(),
            x: sorted.iter().map(|(_, place)| place.x).collect(),
            y: sorted.iter().map(|(_, place)| place.y).collect(),
        }
    }

    /// The weight of somebody at this squared distance, metres^2: 1 at the place itself.
    pub(super) fn weight(&self, squared: f64) -> f64 {
        f64::from(density_within((squared * self.scale) as f32, LIMIT))
    }

    /// The sum of everybody's weights at a place.
    pub(super) fn around(&self, place: Point2<f64>) -> f64 {
        Arch::new().dispatch(Around { crowd: self, place })
    }
}

/// Row and column of the cell of a place.
fn cell(place: Point2<f64>, side: f64) -> [i64; 2] {
    [place.y, place.x].map(|x| (x / side).floor() as i64)
}

/// Adding up, for the widest vector unit.
struct Around<'a> {
    crowd: &'a Crowd,
    place: Point2<f64>,
}

impl NullaryFnOnce for Around<'_> {
    type Output = f64;

    #[allow(
        clippy::inline_always,
        reason = "only what is inlined into a function for a wide vector unit makes use of that"
    )]
    #[inline(always)]
    fn call(self) -> f64 {
        let Self { crowd, place } = self;
        let weight = |x: f64, y: f64| {
            let (dx, dy) = (x - place.x, y - place.y);
            density_within(((dx * dx + dy * dy) * crowd.scale) as f32, LIMIT)
        };
        let [row, column] = cell(place, crowd.reach);
        let mut sums = [0.0f32; LANES];
        for row in row.saturating_sub(1)..=row.saturating_add(1) {
            let first = [row, column.saturating_sub(1)];
            let last = [row, column.saturating_add(1)];
            let start = crowd.cells.partition_point(|cell| *cell < first);
            let end = start + crowd.cells[start..].partition_point(|cell| *cell <= last);
            let (x, x_rest) = crowd.x[start..end].as_chunks::<LANES>();
            let (y, y_rest) = crowd.y[start..end].as_chunks::<LANES>();
            for (x, y) in x.iter().zip(y) {
                for i in 0..LANES {
                    sums[i] += weight(x[i], y[i]);
                }
            }
            for (i, (x, y)) in x_rest.iter().zip(y_rest).enumerate() {
                sums[i] += weight(*x, *y);
            }
        }
        sums.into_iter().map(f64::from).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_is_the_sum_of_all_weights_but_the_least(
            places in prop::collection::vec((-20.0..20.0f64, -20.0..20.0f64), 0..80),
            x in -20.0..20.0f64, y in -20.0..20.0f64, far in 0..2,
        ) {
            let far = 9e7 * f64::from(far);
            let at = |(x, y): (f64, f64)| Point2::new(x + far, y - far);
            let places: Vec<_> = places.into_iter().map(at).collect();
            let place = at((x, y));
            let crowd = Crowd::new(&places, 2.0);
            let exact: f64 = places
                .iter()
                .map(|one| (-0.5 * (one - place).norm_squared() / 4.0).exp())
                .filter(|weight| *weight > (-8.0f64).exp())
                .sum();
            // Somebody just at the reach may count or not.
            prop_assert!((crowd.around(place) - exact).abs() < 4e-4 + 1e-6 * exact);
            prop_assert!((crowd.weight(2.0) - (-0.25f64).exp()).abs() < 1e-6);
        }
    }
}
