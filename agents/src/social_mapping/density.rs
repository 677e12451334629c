//! People's density over a region, cell by cell: the greatest of everybody's (READING.md item 5). This
//! file owns the fast way to draw it, and guarantees that a field updated for one person equals, bit
//! for bit, a field drawn anew.
//!
//! What is drawn is the squared deviation, of which the least is kept: it is a polynomial, so a row of
//! cells goes through the processor's vector units, and each cell needs a single exponential in the end.
//! Compiled for the widest vector unit that this processor has; each has the same bits, as no operation is
//! fused with another. The cells are kept by tiles, each with the greatest deviation in it, so that when somebody moves, the
//! tiles in which others are closer everywhere are known without looking at their cells.

#![allow(
    clippy::inline_always,
    reason = "only what is inlined into a function for a wide vector unit makes use of that"
)]

mod kernel;

pub use kernel::Source;
pub(super) use kernel::density_within;

use crate::grid::Region;
use kernel::{Frame, Kernel, LIMIT, Lanes, SIDE, Tile, greater};
use nalgebra::Point2;
use pulp::{Arch, NullaryFnOnce};

/// Densities below this are 0: from about three standard deviations on.
pub const LEAST_DENSITY: f32 = 0.01;

/// Densities of square cells, row by row from the lowest y. Of each, `f32` and the polynomial of the
/// exponential leave 2e-5 of error at most, for widths of some cells to some hundred.
#[derive(Debug, Clone, PartialEq)]
pub struct DensityField {
    frame: Frame,
    densities: Vec<f32>,
    /// The least squared deviation of anybody for each cell, tile by tile; the limit where nobody is near.
    tiles: Vec<Tile>,
    /// The greatest deviation in each tile.
    worst: Vec<f32>,
    people: Vec<Kernel>,
}

impl DensityField {
    /// The densities of `width` x `height` cells of `resolution` metres from the lower left corner
    /// `origin`. Linear in the cells that people reach.
    pub fn new(
        origin: Point2<f64>,
        resolution: f64,
        [width, height]: [usize; 2],
        people: &[Source],
    ) -> Self {
        let frame = Frame {
            origin,
            resolution,
            width,
            height,
        };
        let tiles = width.div_ceil(SIDE) * height.div_ceil(SIDE);
        let mut field = Self {
            frame,
            densities: vec![0.0; width * height],
            tiles: vec![[[LIMIT; SIDE]; SIDE]; tiles],
            worst: vec![0.0; tiles],
            people: Vec::new(),
        };
        field.draw(people);
        field
    }

    /// Draws others instead of those of before, into the memory that it has: what [`Self::new`] would
    /// return.
    pub fn draw(&mut self, people: &[Source]) {
        let frame = self.frame;
        self.people.clear();
        self.people
            .extend(people.iter().map(|one| Kernel::new(one, &frame)));
        Arch::new().dispatch(All(self));
    }

    #[inline(always)]
    fn draw_all(&mut self) {
        let across = self.across();
        let mut bounds = vec![0.0; across + SIDE];
        // One row of tiles after the other, so that everybody's cells of it are in the nearest cache.
        for row in 0..self.frame.height.div_ceil(SIDE) {
            let tiles = &mut self.tiles[row * across..(row + 1) * across];
            tiles.fill([[LIMIT; SIDE]; SIDE]);
            // First how great no deviation in a tile can be, then only whoever may have less somewhere in it.
            bounds.fill(LIMIT.sqrt());
            let mut near = Vec::with_capacity(self.people.len());
            for kernel in &self.people {
                let reach = kernel.reach(row);
                if !reach.is_empty() {
                    kernel.bound_row(row, reach.clone(), &mut bounds);
                    near.push((kernel, reach));
                }
            }
            for (kernel, reach) in &near {
                kernel.draw_row(row, reach.clone(), &bounds, tiles);
            }
            for tile in 0..across {
                self.finish(row, tile);
            }
        }
    }

    /// Columns and rows.
    pub fn size(&self) -> [usize; 2] {
        [self.frame.width, self.frame.height]
    }

    /// The densities, row by row from the lowest y.
    pub fn densities(&self) -> &[f32] {
        &self.densities
    }

    /// The density at a cell.
    pub fn density(&self, column: usize, row: usize) -> f32 {
        self.densities[row * self.frame.width + column]
    }

    /// Puts one person elsewhere. Only tiles in which the person was or is the closest may be touched.
    pub fn update(&mut self, index: usize, source: &Source) {
        Arch::new().dispatch(One(self, index, source));
    }

    #[expect(
        clippy::needless_bitwise_bool,
        reason = "where the second is asked only after the first, that is a branch"
    )]
    #[inline(always)]
    fn updated(&mut self, index: usize, source: &Source) {
        let new = Kernel::new(source, &self.frame);
        let Some(slot) = self.people.get_mut(index) else {
            return;
        };
        let old = std::mem::replace(slot, new);
        let reach = old.tiles.joined(&new.tiles);
        let Region { columns, rows } = reach;
        let across = self.across();
        // What becomes of a tile is known only when it is looked at, and a processor that guesses loses more than it
        // takes to write down all: so no step here branches on it.
        let mut touched = Listed::new(reach.area());
        for row in rows.0..rows.1 {
            for first in (columns.0..columns.1).step_by(SIDE) {
                let count = SIDE.min(columns.1 - first);
                let mut worst = [0.0; SIDE];
                worst[..count].copy_from_slice(&self.worst[row * across + first..][..count]);
                let (was, is) = (
                    old.least_in_tiles(row, first),
                    new.least_in_tiles(row, first),
                );
                let concerns: [bool; SIDE] =
                    std::array::from_fn(|i| (was[i] < worst[i]) | (is[i] < worst[i]));
                for (tile, concerns) in (first..columns.1).zip(concerns) {
                    touched.push([row as u32, tile as u32], concerns);
                }
            }
        }
        // Tiles with cells that the person leaves to others, and those that are as they shall be.
        let mut open = Listed::new(touched.len);
        let mut done = Listed::new(touched.len);
        for [row, tile] in touched.all() {
            let cells = &mut self.tiles[row * across + tile];
            let given = old.give_way(&new, row, tile, cells);
            let place = [row as u32, tile as u32];
            open.push(place, given.open);
            done.push(place, given.changed & !given.open);
        }
        self.fill(index, &new, &open);
        for [row, tile] in done.all().chain(open.all()) {
            self.finish(row, tile);
        }
    }

    /// Draws everybody but one in the open tiles, as far as they may have less there than that one.
    #[inline(always)]
    fn fill(&mut self, but: usize, own: &Kernel, open: &Listed) {
        let across = self.across();
        let around = open.around();
        let ((left, right), (bottom, top)) = (around.columns, around.rows);
        let stride = right.saturating_sub(left) + SIDE;
        // Nothing is less than what is no number: so are tiles that are not open.
        let mut bounds = vec![f32::NAN; stride * top.saturating_sub(bottom)];
        let mut spans = vec![(usize::MAX, 0); top.saturating_sub(bottom)];
        for [row, tile] in open.all() {
            bounds[(row - bottom) * stride + tile - left] = own.bound_in(row, tile);
            let (first, last) = &mut spans[row - bottom];
            (*first, *last) = ((*first).min(tile), (*last).max(tile + 1));
        }
        for (other, kernel) in self.people.iter().enumerate() {
            let here = kernel.tiles.common(&around);
            if other == but || here.is_empty() {
                continue;
            }
            for row in here.rows.0..here.rows.1 {
                let (first, last) = spans[row - bottom];
                let (first, last) = (first.max(here.columns.0), last.min(here.columns.1));
                for first in (first..last).step_by(SIDE) {
                    let least = kernel.least_in_tiles(row, first);
                    let bounds = &bounds[(row - bottom) * stride + first - left..][..SIDE];
                    let wins: [bool; SIDE] = std::array::from_fn(|i| least[i] < bounds[i]);
                    for (tile, wins) in (first..last).zip(wins) {
                        if wins {
                            kernel.draw(row, tile, &mut self.tiles[row * across + tile]);
                        }
                    }
                }
            }
        }
    }

    /// Tiles in a row.
    #[inline(always)]
    fn across(&self) -> usize {
        self.frame.width.div_ceil(SIDE)
    }

    /// Makes densities of the deviations in a tile.
    #[inline(always)]
    fn finish(&mut self, row: usize, tile: usize) {
        let at = row * self.across() + tile;
        let cells = &self.tiles[at];
        let mut most: Lanes = [0.0; SIDE];
        for line in cells {
            most = std::array::from_fn(|i| greater(line[i], most[i]));
        }
        // By halves: one after the other, each would wait for the one before.
        let most: [f32; 4] = std::array::from_fn(|i| greater(most[i], most[i + 4]));
        let most = greater(greater(most[0], most[2]), greater(most[1], most[3]));
        self.worst[at] = most.sqrt();
        let mut shown = [0.0; SIDE * SIDE];
        for (density, squared) in shown.iter_mut().zip(cells.as_flattened()) {
            *density = kernel::density(*squared);
        }
        let width = self.frame.width;
        let lines = self.densities[row * SIDE * width..].chunks_exact_mut(width);
        for (line, shown) in lines.zip(shown.as_chunks::<SIDE>().0) {
            let line = &mut line[tile * SIDE..];
            match line.first_chunk_mut() {
                Some(line) => *line = *shown,
                None => line.copy_from_slice(&shown[..line.len()]),
            }
        }
    }
}

/// Rows and columns of tiles, written down without a branch.
struct Listed {
    places: Vec<[u32; 2]>,
    len: usize,
}

impl Listed {
    /// None yet, and at most so many.
    #[inline(always)]
    fn new(most: usize) -> Self {
        Self {
            places: vec![[0; 2]; most + 1],
            len: 0,
        }
    }

    #[inline(always)]
    fn push(&mut self, place: [u32; 2], really: bool) {
        self.places[self.len] = place;
        self.len += usize::from(really);
    }

    #[inline(always)]
    fn all(&self) -> impl Iterator<Item = [usize; 2]> {
        let places = self.places[..self.len].iter();
        places.map(|place| place.map(|count| count as usize))
    }

    /// The region around all.
    #[inline(always)]
    fn around(&self) -> Region {
        let tile = |[row, tile]: [usize; 2]| Region {
            columns: (tile, tile + 1),
            rows: (row, row + 1),
        };
        let all = self.all().map(tile);
        all.fold(Region::default(), |all, one| all.joined(&one))
    }
}

/// Drawing all, for the widest vector unit.
struct All<'a>(&'a mut DensityField);

impl NullaryFnOnce for All<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.0.draw_all();
    }
}

/// Moving one person, for the widest vector unit.
struct One<'a>(&'a mut DensityField, usize, &'a Source);

impl NullaryFnOnce for One<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.0.updated(self.1, self.2);
    }
}

#[cfg(test)]
mod tests {
    use super::super::four_sided::FourSided;
    use super::*;
    use nalgebra::{Isometry2, Vector2};
    use proptest::prelude::*;

    fn source() -> impl Strategy<Value = Source> {
        (
            (-1.0..7.0f64, -1.0..6.0f64, -4.0..4.0f64),
            (0.3..1.5f64, 0.3..1.5f64, 0.3..1.5f64, 0.3..1.5f64),
        )
            .prop_map(|((x, y, heading), (a, b, c, d))| Source {
                world_from_person: Isometry2::new(Vector2::new(x, y), heading),
                shape: FourSided::from_sides([a, b, c, d]),
            })
    }

    const SIZE: [usize; 2] = [61, 47];

    fn field(people: &[Source]) -> DensityField {
        DensityField::new(Point2::new(0.5, -0.25), 0.1, SIZE, people)
    }

    #[test]
    fn the_fast_exponential_is_one() {
        assert!((kernel::LIMIT + 2.0 * LEAST_DENSITY.ln()).abs() < 1e-6);
        assert!(kernel::density(0.0).to_bits() == 1.0f32.to_bits());
        for i in 0..921 {
            let squared = i as f32 * 0.01;
            let exact = (-0.5 * f64::from(squared)).exp();
            assert!(
                (f64::from(kernel::density(squared)) - exact).abs() < 3e-7,
                "{squared}"
            );
        }
    }

    #[test]
    fn nobody_and_somebody_far_away_leave_it_empty() {
        assert!(field(&[]).densities().iter().all(|d| *d == 0.0));
        let far = Source {
            world_from_person: Isometry2::new(Vector2::new(1e9, 0.0), 0.0),
            shape: FourSided::HALL,
        };
        assert!(field(&[far]).densities().iter().all(|d| *d == 0.0));
    }

    proptest! {
        #[test]
        fn a_cell_has_the_greatest_density_at_its_centre(people in prop::collection::vec(source(), 0..6)) {
            let field = field(&people);
            for row in 0..SIZE[1] {
                for column in 0..SIZE[0] {
                    let centre = Point2::new(
                        0.5 + (column as f64 + 0.5) * 0.1,
                        -0.25 + (row as f64 + 0.5) * 0.1,
                    );
                    let exact = people
                        .iter()
                        .map(|one| one.shape.density(&one.world_from_person, centre))
                        .fold(0.0, f64::max);
                    let found = f64::from(field.density(column, row));
                    let cut = found == 0.0 && exact < f64::from(LEAST_DENSITY) + 1e-5;
                    prop_assert!(cut || (found - exact).abs() < 2e-5, "{} {}", found, exact);
                }
            }
        }

        #[test]
        fn drawing_again_and_moving_leave_what_a_new_field_would_have(
            mut people in prop::collection::vec(source(), 1..16),
            moves in prop::collection::vec((any::<prop::sample::Index>(), source(), 0..3), 1..8),
        ) {
            let mut updated = field(&[]);
            updated.draw(&people);
            prop_assert!(updated == field(&people));
            for (index, mut there, far) in moves {
                let index = index.index(people.len());
                let here = people[index];
                if far < 2 {
                    // A step of the same person, or to where somebody else stands.
                    there.shape = here.shape;
                    let from = if far == 0 { here } else { people[0] };
                    let step = Isometry2::translation(0.1 * f64::from(far), 0.0);
                    there.world_from_person = from.world_from_person * step;
                }
                people[index] = there;
                updated.update(index, &there);
                // Without the cells in the message: there are thousands.
                prop_assert!(updated == field(&people));
            }
        }
    }
}
