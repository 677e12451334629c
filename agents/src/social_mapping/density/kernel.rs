//! Somebody's density on square cells, ready to be drawn. This file owns the arithmetic of a cell and
//! where somebody reaches, and guarantees that a cell's squared deviation has the same bits whoever asks.

#![allow(
    clippy::inline_always,
    reason = "only what is inlined into a function for a wide vector unit makes use of that"
)]

use super::super::four_sided::FourSided;
use crate::grid::Region;
use nalgebra::{Isometry2, Point2, Vector2};
use std::f32::consts::{LN_2, LOG2_E};
use std::ops::Range;

/// Side of a tile, cells: a row of it goes through a processor's vector units at once.
pub(super) const SIDE: usize = 8;
/// A value for each of a row of cells, or of tiles.
pub(super) type Lanes = [f32; SIDE];
/// A value for each cell, row by row from the lowest y.
pub(super) type Tile = [Lanes; SIDE];

const STEPS: Lanes = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
/// From the centre of a tile to those of its outermost cells, cells.
const CORNER: f32 = (SIDE - 1) as f32 / 2.0;

/// Somebody's place and widths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Source {
    /// Where the person stands and faces; finite.
    pub world_from_person: Isometry2<f64>,
    /// The widths of the density.
    pub shape: FourSided,
}

/// Where the cells lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub(super) origin: Point2<f64>,
    pub(super) resolution: f64,
    pub(super) width: usize,
    pub(super) height: usize,
}

/// A person in cells from the grid's corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Kernel {
    centre: [f32; 2],
    /// What a cell in x and y adds to the deviation ahead, ...
    ahead: [f32; 2],
    /// ... and to the left.
    left: [f32; 2],
    /// How many times as much it is behind, and to the right; negative.
    turned: [f32; 2],
    /// By how much the deviations within a tile differ from that at its centre at most.
    margin: f32,
    /// The middle of what it reaches of a row moves by this much in x for each row up.
    lean: f32,
    /// The square of half of what it reaches of a row: of its own, and how much less for each row squared.
    spread: [f32; 2],
    /// The cells that it reaches, those included that the last tiles have beyond the edge.
    cells: Region,
    /// Their tiles.
    pub(super) tiles: Region,
}

/// What became of a tile when somebody left it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Given {
    /// Whether there are cells of which it is not known whose they are.
    pub(super) open: bool,
    /// Whether any cell changed.
    pub(super) changed: bool,
}

/// The squared deviation at which the density is [`super::LEAST_DENSITY`].
pub(super) const LIMIT: f32 = 9.210_340_5;

/// Not those of `f32`, which look for NaN: these are one operation of a vector unit.
#[inline(always)]
pub(super) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
pub(super) fn less(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// A count of cells as a number. Only for i32 do vector units have this.
#[inline(always)]
fn count(cells: usize) -> f32 {
    (cells as u32).cast_signed() as f32
}

impl Kernel {
    pub(super) fn new(source: &Source, frame: &Frame) -> Self {
        let pose = &source.world_from_person;
        let centre = (pose.translation.vector - frame.origin.coords) / frame.resolution;
        let ahead = pose.rotation * Vector2::x();
        let deviation = source.shape.sides().map(|side| side / frame.resolution);
        let [front, left, rear, right] = deviation;
        let reach = f64::from(LIMIT).sqrt();
        // How far it reaches along a direction given in the person's own frame.
        let extent = |x: f64, y: f64| {
            let along = x * if x > 0.0 { front } else { rear };
            let across = y * if y > 0.0 { left } else { right };
            reach * along.hypot(across)
        };
        let span = |middle: f64, below: f64, above: f64, cells: usize| {
            // Whole tiles, so that those at the edge are full of what their people leave there.
            let cells = cells.next_multiple_of(SIDE);
            // A float to integer cast saturates, so far away is the edge.
            let start = ((middle - below).floor().max(0.0) as usize).min(cells);
            let end = ((middle + above).ceil().max(0.0) as usize).min(cells);
            (start, end.max(start))
        };
        let cells = Region {
            columns: span(
                centre.x,
                extent(-ahead.x, ahead.y),
                extent(ahead.x, -ahead.y),
                frame.width,
            ),
            rows: span(
                centre.y,
                extent(-ahead.y, -ahead.x),
                extent(ahead.y, ahead.x),
                frame.height,
            ),
        };
        let tiles = |(start, end): (usize, usize)| (start / SIDE, end.div_ceil(SIDE));
        // The ellipse around all four quarters: with x and y from its centre,
        // a x^2 + 2 b x y + c y^2 <= 1.
        let (along, across) = (reach * front.max(rear), reach * left.max(right));
        let a = (ahead.x / along).powi(2) + (ahead.y / across).powi(2);
        let b = ahead.x * ahead.y * (along.powi(-2) - across.powi(-2));
        let mut kernel = Self {
            centre: [centre.x as f32, centre.y as f32],
            ahead: [(ahead.x / front) as f32, (ahead.y / front) as f32],
            left: [(-ahead.y / left) as f32, (ahead.x / left) as f32],
            turned: [(-front / rear) as f32, (-left / right) as f32],
            margin: 0.0,
            lean: (-b / a) as f32,
            spread: [(1.0 / a) as f32, (along * across * a).powi(-2) as f32],
            cells,
            tiles: Region {
                columns: tiles(cells.columns),
                rows: tiles(cells.rows),
            },
        };
        let corners = [
            (CORNER, CORNER),
            (-CORNER, CORNER),
            (CORNER, -CORNER),
            (-CORNER, -CORNER),
        ];
        let furthest = corners.map(|(x, y)| kernel.squared(x, y)).into_iter();
        // More by what rounding may take.
        kernel.margin = furthest.fold(0.0, greater).sqrt() * 1.0001 + 1e-4;
        kernel
    }

    /// The squared deviation at so many cells from the person.
    #[inline(always)]
    fn squared(&self, x: f32, y: f32) -> f32 {
        self.both(
            x * self.ahead[0] + y * self.ahead[1],
            x * self.left[0] + y * self.left[1],
        )
    }

    /// The squared deviation of one ahead and one to the left.
    #[inline(always)]
    fn both(&self, along: f32, across: f32) -> f32 {
        // Of the two, one is not negative: without a branch, for vector units.
        let along = greater(along, along * self.turned[0]);
        let across = greater(across, across * self.turned[1]);
        along * along + across * across
    }

    /// What the columns of a tile add to the deviations ahead and to the left: the same for each of its rows.
    #[inline(always)]
    fn columns(&self, tile: usize) -> [Lanes; 2] {
        self.along(count(tile * SIDE) + (0.5 - self.centre[0]), 1.0)
    }

    /// What `x` and each `step` further add to the deviations ahead and to the left.
    #[inline(always)]
    fn along(&self, x: f32, step: f32) -> [Lanes; 2] {
        let (mut ahead, mut left) = ([0.0; SIDE], [0.0; SIDE]);
        for i in 0..SIDE {
            let x = x + STEPS[i] * step;
            ahead[i] = x * self.ahead[0];
            left[i] = x * self.left[0];
        }
        [ahead, left]
    }

    /// The squared deviations at the centres of a row of the cells that have these columns: to the bit those of
    /// [`Self::squared`].
    #[inline(always)]
    fn row(&self, row: usize, columns: &[Lanes; 2]) -> Lanes {
        self.at(count(row) + (0.5 - self.centre[1]), columns)
    }

    /// The squared deviations at `y` and these columns.
    #[inline(always)]
    fn at(&self, y: f32, [ahead, left]: &[Lanes; 2]) -> Lanes {
        let (y_ahead, y_left) = (y * self.ahead[1], y * self.left[1]);
        let mut squared = [0.0; SIDE];
        for i in 0..SIDE {
            squared[i] = self.both(ahead[i] + y_ahead, left[i] + y_left);
        }
        squared
    }

    /// Where the centre of a tile lies, in cells from the person.
    #[inline(always)]
    fn place_of_tile(&self, row: usize, tile: usize) -> [f32; 2] {
        const MIDDLE: f32 = SIDE as f32 / 2.0;
        [
            count(tile * SIDE) + (MIDDLE - self.centre[0]),
            count(row * SIDE) + (MIDDLE - self.centre[1]),
        ]
    }

    /// The squared deviations at the centres of a row of tiles.
    #[inline(always)]
    pub(super) fn at_tiles(&self, row: usize, first: usize) -> Lanes {
        let [x, y] = self.place_of_tile(row, first);
        self.at(y, &self.along(x, SIDE as f32))
    }

    /// What the deviations in each of a row of tiles are not below.
    ///
    /// The deviation is a convex function of the place, so it lies above its tangent at the centre of a tile.
    #[inline(always)]
    pub(super) fn least_in_tiles(&self, row: usize, first: usize) -> Lanes {
        let [x, y] = self.place_of_tile(row, first);
        let [ahead, left] = self.along(x, SIDE as f32);
        let (y_ahead, y_left) = (y * self.ahead[1], y * self.left[1]);
        let mut least = [0.0; SIDE];
        for i in 0..SIDE {
            let (along, across) = (ahead[i] + y_ahead, left[i] + y_left);
            let turned = [
                if along > 0.0 { 1.0 } else { self.turned[0] },
                if across > 0.0 { 1.0 } else { self.turned[1] },
            ];
            let (along, across) = (along * turned[0], across * turned[1]);
            let deviation = (along * along + across * across).sqrt();
            let (along, across) = (along * turned[0], across * turned[1]);
            let slope_x = along * self.ahead[0] + across * self.left[0];
            let slope_y = along * self.ahead[1] + across * self.left[1];
            // Of no account at the person: there, the deviation is the least that there is.
            let falls = CORNER * (slope_x.abs() + slope_y.abs()) / greater(deviation, 1e-6);
            // More by what rounding may take.
            least[i] = deviation - falls * 1.0001 - 1e-4;
        }
        least
    }

    /// The greatest deviation that it may have in a tile of which the centre has this squared one.
    #[inline(always)]
    pub(super) fn most(&self, squared: f32) -> f32 {
        squared.sqrt() + self.margin
    }

    /// The greatest deviation that it may have in a tile, and at most the limit.
    #[inline(always)]
    pub(super) fn bound_in(&self, row: usize, tile: usize) -> f32 {
        let [x, y] = self.place_of_tile(row, tile);
        less(self.most(self.squared(x, y)), LIMIT.sqrt())
    }

    /// Whether in a tile of which the centre has this squared deviation a cell may have less than `worst`.
    #[inline(always)]
    pub(super) fn may_win(&self, squared: f32, worst: f32) -> bool {
        let bound = worst + self.margin;
        squared < bound * bound
    }

    /// The tiles that it reaches of a row of them.
    #[inline(always)]
    pub(super) fn reach(&self, row: usize) -> Range<usize> {
        let (below, above) = self.tiles.rows;
        if !(below..above).contains(&row) {
            return 0..0;
        }
        let low = count(row * SIDE) + (0.5 - self.centre[1]);
        let high = low + (SIDE - 1) as f32;
        // Widest at the line nearest to the person; more by a cell than rounding may take.
        let nearest = greater(greater(low, -high), 0.0);
        let half = greater(self.spread[0] - self.spread[1] * nearest * nearest, 0.0).sqrt() + 1.0;
        let (one, other) = (self.lean * low, self.lean * high);
        let (start, end) = self.cells.columns;
        let end = end.min((self.centre[0] + greater(one, other) + half) as usize + 1);
        let start = start.max((self.centre[0] + less(one, other) - half) as usize);
        start.min(end) / SIDE..end.div_ceil(SIDE)
    }

    /// Lowers what no deviation in a tile of the row can exceed to what its own cannot.
    #[inline(always)]
    pub(super) fn bound_row(&self, row: usize, reach: Range<usize>, bounds: &mut [f32]) {
        for first in reach.step_by(SIDE) {
            let at = self.at_tiles(row, first);
            // Past its reach its own are beyond the limit, and lower nothing.
            for (bound, squared) in bounds[first..first + SIDE].iter_mut().zip(at) {
                *bound = less(*bound, self.most(squared));
            }
        }
    }

    /// Lowers the squared deviations on a row of tiles to its own, where these may be below the bounds.
    #[inline(always)]
    pub(super) fn draw_row(
        &self,
        row: usize,
        reach: Range<usize>,
        bounds: &[f32],
        tiles: &mut [Tile],
    ) {
        for first in reach.clone().step_by(SIDE) {
            let at = self.at_tiles(row, first);
            let bounds = &bounds[first..first + SIDE];
            let wins: [bool; SIDE] = std::array::from_fn(|i| self.may_win(at[i], bounds[i]));
            let here = first..reach.end.min(first + SIDE);
            for ((tile, cells), wins) in here.clone().zip(&mut tiles[here]).zip(wins) {
                if wins {
                    self.draw(row, tile, cells);
                }
            }
        }
    }

    /// Lowers the squared deviations in a tile to its own.
    #[inline(always)]
    pub(super) fn draw(&self, row: usize, tile: usize, cells: &mut Tile) {
        let columns = self.columns(tile);
        for (at, cells) in cells.iter_mut().enumerate() {
            let own = self.row(row * SIDE + at, &columns);
            for (cell, own) in cells.iter_mut().zip(own) {
                *cell = less(own, *cell);
            }
        }
    }

    /// Becomes `new` in a tile. The cells of which it may not be known whose they are without asking
    /// everybody have what `new` leaves of the limit then.
    #[inline(always)]
    pub(super) fn give_way(&self, new: &Self, row: usize, tile: usize, cells: &mut Tile) -> Given {
        let limit = LIMIT.to_bits();
        let (mut gone, mut changed) = ([0; SIDE], [0; SIDE]);
        let (old_columns, new_columns) = (self.columns(tile), new.columns(tile));
        for (at, cells) in cells.iter_mut().enumerate() {
            let (was, is) = (
                self.row(row * SIDE + at, &old_columns),
                new.row(row * SIDE + at, &new_columns),
            );
            for i in 0..SIDE {
                // All ones where the cell was this person's, who leaves: as a choice, it would be a branch.
                let mine = was[i].to_bits() == cells[i].to_bits();
                let leaves = u32::from(mine && is[i] > was[i]).wrapping_neg();
                gone[i] |= leaves;
                let others = (cells[i].to_bits() & !leaves) | (limit & leaves);
                let cell = less(is[i], f32::from_bits(others));
                changed[i] |= cell.to_bits() ^ cells[i].to_bits();
                cells[i] = cell;
            }
        }
        let any = |bits: [u32; SIDE]| bits.into_iter().fold(0, |all, one| all | one) != 0;
        Given {
            open: any(gone),
            changed: any(changed),
        }
    }
}

/// `exp(-squared / 2)` to within 3e-7 for 0 to 30, in operations that vector units have; 0 from the limit
/// on.
#[inline(always)]
pub(super) fn density(squared: f32) -> f32 {
    density_within(squared, LIMIT)
}

/// The same with another limit, at most 30.
#[inline(always)]
pub(in super::super) fn density_within(squared: f32, limit: f32) -> f32 {
    // 2^t with t = whole + part, part in [-1/2, 1/2]: the whole goes into the exponent's bits. Adding this
    // number leaves the whole in the last bits of the sum.
    const ROUND: f32 = 12_582_912.0;
    let t = squared * (-0.5 * LOG2_E);
    let shifted = t + ROUND;
    let part = t - (shifted - ROUND);
    let whole = shifted.to_bits().wrapping_sub(ROUND.to_bits());
    // 2^part but for 1.1e-7 of it; of the polynomials with its value and slope at 0, the one of which the
    // greatest relative error is least. Horner's form, from the highest power.
    let mut power = 0.001_330_026_4;
    for coefficient in [0.009_669_708, 0.055_505_6, 0.240_222_81, LN_2, 1.0] {
        power = power * part + coefficient;
    }
    // All ones within the limit: as a choice, it would be a branch.
    let within = u32::from(squared < limit).wrapping_neg();
    f32::from_bits((whole.wrapping_add(127) << 23) & within) * power
}
