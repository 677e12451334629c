//! The zones of one person on the grid, the fast way. This file guarantees that the cost of a cell has the same bits in
//! whichever part of the grid it is drawn: it is computed from the place of the cell and the person alone.

use super::super::four_sided::FourSided;
use super::super::zones::{Cuts, Zone};
use crate::grid::{CostGrid, FREE, Region};
use nalgebra::Isometry2;
use pulp::NullaryFnOnce;

/// Raises each cell of the window to the cost of its zone. The same sums as for one place, without a branch and in 32
/// bits, so that the widest vector unit that the processor has takes as many cells at once as it can. Lengths are
/// from the person, so 32 bits are exact to a millionth of the person's own space.
pub(super) struct RaiseZones<'a> {
    pub(super) grid: &'a mut CostGrid,
    pub(super) window: Region,
    pub(super) world_from_person: &'a Isometry2<f64>,
    pub(super) shape: &'a FourSided,
    pub(super) cuts: &'a Cuts,
}

/// Where of a row the ellipse around all four quarters of a zone may lie, metres from the person.
struct Reach {
    /// The middle moves by this much in x for each metre up.
    lean: f64,
    /// The square of half of the widest row, and how much less it is for each metre up squared.
    spread: [f64; 2],
}

impl Reach {
    fn new(shape: &FourSided, cos: f64, sin: f64, reach: f64) -> Self {
        let (along, across) = (
            reach * shape.front.max(shape.rear),
            reach * shape.left.max(shape.right),
        );
        // With x and y from the person, a x^2 + 2 b x y + c y^2 <= 1.
        let a = (cos / along).powi(2) + (sin / across).powi(2);
        let b = cos * sin * (along.powi(-2) - across.powi(-2));
        Self {
            lean: -b / a,
            spread: [1.0 / a, (along * across * a).powi(-2)],
        }
    }

    /// From where to where, in x.
    fn of_row(&self, y: f64) -> (f64, f64) {
        let middle = self.lean * y;
        let half = (self.spread[0] - self.spread[1] * y * y).max(0.0).sqrt();
        (middle - half, middle + half)
    }
}

impl NullaryFnOnce for RaiseZones<'_> {
    type Output = ();

    #[allow(
        clippy::inline_always,
        reason = "only what is inlined into a function for a wide vector unit makes use of that"
    )]
    #[inline(always)]
    fn call(self) {
        let Self {
            grid,
            window,
            world_from_person,
            shape,
            cuts,
        } = self;
        let heading = world_from_person.rotation;
        let reach = Reach::new(shape, heading.re, heading.im, cuts.social.sqrt());
        let [cos, sin] = [heading.re, heading.im].map(|x| x as f32);
        let [front, left, rear, right] = shape.sides().map(|side| side.recip() as f32);
        let [intimate, personal, social] =
            [cuts.intimate, cuts.personal, cuts.social].map(|cut| cut as f32);
        let costs = [Zone::Intimate, Zone::Personal, Zone::Social].map(Zone::cost);
        let resolution = grid.resolution;
        let step = resolution as f32;
        // The cell that the person is in, counted as the grid's, and how far beyond the person its middle lies.
        let place = (world_from_person.translation.vector - grid.origin.coords) / resolution;
        let own = place.x.floor();
        let beyond = ((own + 0.5 - place.x) * resolution) as f32;
        for row in window.rows.0..window.rows.1 {
            let y = (row as f64 + 0.5 - place.y) * resolution;
            let (start, end) = reach.of_row(y);
            // Wider by a cell than rounding may take. A float to integer cast saturates.
            let start = (place.x + start / resolution - 1.5).max(0.0) as usize;
            let end = (place.x + end / resolution + 1.5).max(0.0) as usize + 1;
            let (start, end) = (start.max(window.columns.0), end.min(window.columns.1));
            if start >= end {
                continue;
            }
            let y = y as f32;
            let (y_along, y_across) = (sin * y, cos * y);
            let first = grid.index((start, row));
            let cells = &mut grid.costs[first..first + end - start];
            // Zones are some thousand cells wide at most.
            let from_own = (start as f64 - own) as i32;
            for (at, cell) in cells.iter_mut().enumerate() {
                let x = (from_own + (at as u32).cast_signed()) as f32 * step + beyond;
                let (along, across) = (cos * x + y_along, y_across - sin * x);
                // Of the two parts of each sum one is zero.
                let ahead = if along > 0.0 { along } else { 0.0 };
                let behind = if along < 0.0 { along } else { 0.0 };
                let leftwards = if across > 0.0 { across } else { 0.0 };
                let rightwards = if across < 0.0 { across } else { 0.0 };
                let along = ahead * front + behind * rear;
                let across = leftwards * left + rightwards * right;
                let squared = along * along + across * across;
                let mut cost = FREE;
                cost = if squared <= social { costs[2] } else { cost };
                cost = if squared <= personal { costs[1] } else { cost };
                cost = if squared <= intimate { costs[0] } else { cost };
                *cell = if cost > *cell { cost } else { *cell };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Stamp;
    use super::*;
    use nalgebra::Vector2;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_cell_costs_what_its_zone_does_in_whichever_window_it_is_drawn(
            x in -3.0..9.0f64, y in -3.0..7.0f64, heading in -4.0..4.0f64, far in 0..2,
            sides in prop::array::uniform4(0.2..2.0f64), cut in (0..61usize, 0..41usize),
        ) {
            // A map of some town, far from the origin.
            let far = f64::from(far) * 4e6;
            let shape = FourSided::from_sides(sides);
            let cuts = Cuts::new(&super::super::super::zones::Levels::default());
            let stamp = Stamp::Zones {
                world_from_person: Isometry2::new(Vector2::new(far + x, y - far), heading),
                shape,
                cuts,
                open: Vec::new(),
                shut: [false; 4],
            };
            let empty = CostGrid::covering([far, -far, far + 6.1, 4.1 - far], 0.1);
            let (mut grid, whole) = (empty.clone(), empty.whole());
            stamp.draw(&mut grid, &whole);
            let Stamp::Zones { world_from_person, .. } = &stamp else { unreachable!() };
            for index in 0..grid.costs.len() {
                let centre = grid.centre((index % grid.width, index / grid.width));
                let place = world_from_person.inverse_transform_point(&centre);
                let squared = shape.squared_deviation(place);
                let edge = [cuts.intimate, cuts.personal, cuts.social]
                    .iter()
                    .any(|cut| (squared - cut).abs() < 1e-5 * cut);
                prop_assert!(edge || grid.costs[index].to_bits() == cuts.zone(squared).cost().to_bits());
            }
            let mut parts = empty;
            for columns in [(0, cut.0), (cut.0, whole.columns.1)] {
                for rows in [(0, cut.1), (cut.1, whole.rows.1)] {
                    stamp.draw(&mut parts, &Region { columns, rows });
                }
            }
            prop_assert!(parts == grid);
        }
    }
}
