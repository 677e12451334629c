//! People's density over a region, cell by cell: the greatest of everybody's (READING.md item 5). This
//! file owns the fast way to draw it, and guarantees that a field updated for one person equals, bit
//! for bit, a field drawn anew.
//!
//! What is drawn is the squared deviation, of which the least is kept: it is a polynomial, so a row of
//! cells goes through the processor's vector units, and each cell needs a single exponential in the end.
//! Each cell remembers whose it is; when somebody moves, only the cells that were theirs are asked of the
//! others again.

use super::four_sided::FourSided;
use nalgebra::{Isometry2, Point2, Vector2};

/// Densities below this are 0: from about three standard deviations on.
pub const LEAST_DENSITY: f32 = 0.01;
/// Nobody's.
const NOBODY: u32 = u32::MAX;
/// Side of the squares in which it is kept who may reach them, cells.
const TILE: usize = 16;

/// Somebody's place and widths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Source {
    /// Where the person stands and faces; finite.
    pub world_from_person: Isometry2<f64>,
    /// The widths of the density.
    pub shape: FourSided,
}

/// Densities of square cells, row by row from the lowest y.
#[derive(Debug, Clone, PartialEq)]
pub struct DensityField {
    origin: Point2<f64>,
    resolution: f64,
    width: usize,
    height: usize,
    densities: Vec<f32>,
    deviations: Vec<f32>,
    owners: Vec<u32>,
    people: Vec<Kernel>,
    /// For each tile who may reach it, in order.
    reach: Vec<Vec<u32>>,
}

/// A person ready to be drawn: in cells from the grid's corner, all that a row needs.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Kernel {
    centre: [f32; 2],
    ahead: [f32; 2],
    /// One over front, left, rear, right, times the cell's side: deviations a cell.
    inverse: [f32; 4],
    columns: (usize, usize),
    rows: (usize, usize),
}

/// The squared deviation at which the density is [`LEAST_DENSITY`].
fn limit() -> f32 {
    -2.0 * LEAST_DENSITY.ln()
}

impl Kernel {
    fn new(source: &Source, field: (Point2<f64>, f64, usize, usize)) -> Self {
        let (origin, resolution, width, height) = field;
        let pose = &source.world_from_person;
        let centre = (pose.translation.vector - origin.coords) / resolution;
        let ahead = pose.rotation * Vector2::x();
        let reach = f64::from(limit()).sqrt() / resolution;
        // An ellipse's extent along an axis; of the four quarters, the larger on each axis bounds it.
        let [front, left, rear, right] = source.shape.sides();
        let (along, across) = (front.max(rear), left.max(right));
        let extent = Vector2::new(
            (along * ahead.x).hypot(across * ahead.y),
            (along * ahead.y).hypot(across * ahead.x),
        ) * reach;
        let span = |middle: f64, half: f64, count: usize| {
            // A float to integer cast saturates, so far away is the edge.
            let start = ((middle - half).floor().max(0.0) as usize).min(count);
            let end = ((middle + half).ceil().max(0.0) as usize).min(count);
            (start, end.max(start))
        };
        Self {
            centre: [centre.x as f32, centre.y as f32],
            ahead: [ahead.x as f32, ahead.y as f32],
            inverse: [front, left, rear, right].map(|side| (resolution / side) as f32),
            columns: span(centre.x, extent.x, width),
            rows: span(centre.y, extent.y, height),
        }
    }

    /// The squared deviation at the centre of a cell.
    #[inline]
    fn deviation(&self, column: f32, row: f32) -> f32 {
        let [front, left, rear, right] = self.inverse;
        let x = column + 0.5 - self.centre[0];
        let y = row + 0.5 - self.centre[1];
        let along = x * self.ahead[0] + y * self.ahead[1];
        let across = y * self.ahead[0] - x * self.ahead[1];
        // Of the two parts of each sum one is zero: without a branch, for vector units.
        let ahead = if along > 0.0 { along } else { 0.0 };
        let behind = if along < 0.0 { along } else { 0.0 };
        let leftwards = if across > 0.0 { across } else { 0.0 };
        let rightwards = if across < 0.0 { across } else { 0.0 };
        let along = ahead * front + behind * rear;
        let across = leftwards * left + rightwards * right;
        along * along + across * across
    }

    fn covers(&self, column: usize, row: usize) -> bool {
        (self.columns.0..self.columns.1).contains(&column)
            && (self.rows.0..self.rows.1).contains(&row)
    }
}

/// `exp(-squared / 2)` to within 3e-7 for 0 to 30, in operations that vector units have.
#[inline]
fn density(squared: f32) -> f32 {
    // 2^t with t = whole + part, part in [-1/2, 1/2]: the whole goes into the exponent's bits. Adding this
    // number leaves the whole in the last bits of the sum.
    const ROUND: f32 = 12_582_912.0;
    let t = squared * (-0.5 * std::f32::consts::LOG2_E);
    let shifted = t + ROUND;
    let part = t - (shifted - ROUND);
    let whole = shifted.to_bits().wrapping_sub(ROUND.to_bits());
    // Taylor's series of 2^part.
    let p = part * std::f32::consts::LN_2;
    let series = 1.0
        + p * (1.0
            + p * (0.5
                + p * (1.0 / 6.0 + p * (1.0 / 24.0 + p * (1.0 / 120.0 + p * (1.0 / 720.0))))));
    f32::from_bits(whole.wrapping_add(127) << 23) * series
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
        let cells = width * height;
        let tiles = width.div_ceil(TILE) * height.div_ceil(TILE);
        let frame = (origin, resolution, width, height);
        let people: Vec<Kernel> = people.iter().map(|one| Kernel::new(one, frame)).collect();
        let mut field = Self {
            origin,
            resolution,
            width,
            height,
            densities: vec![0.0; cells],
            deviations: vec![limit(); cells],
            owners: vec![NOBODY; cells],
            people: Vec::new(),
            reach: vec![Vec::new(); tiles],
        };
        for (index, kernel) in people.iter().enumerate() {
            field.draw(index as u32, kernel);
            field.note(index as u32, kernel);
        }
        field.people = people;
        for (density, (squared, owner)) in field
            .densities
            .iter_mut()
            .zip(field.deviations.iter().zip(&field.owners))
        {
            // No ones where the cell is nobody's: as a choice, it would be a branch.
            let mine = u32::from(*owner != NOBODY).wrapping_neg();
            *density = f32::from_bits(self::density(*squared).to_bits() & mine);
        }
        field
    }

    /// Columns and rows.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// The densities, row by row from the lowest y.
    pub fn densities(&self) -> &[f32] {
        &self.densities
    }

    /// The density at a cell.
    pub fn density(&self, column: usize, row: usize) -> f32 {
        self.densities[row * self.width + column]
    }

    /// Puts one person elsewhere. Only cells that the person had or has are touched.
    pub fn update(&mut self, index: usize, source: &Source) {
        let frame = (self.origin, self.resolution, self.width, self.height);
        let new = Kernel::new(source, frame);
        let Some(slot) = self.people.get_mut(index) else {
            return;
        };
        let old = std::mem::replace(slot, new);
        let me = index as u32;
        self.forget(me, &old);
        self.note(me, &new);
        for row in old.rows.0..old.rows.1 {
            let line = row * self.width;
            for column in old.columns.0..old.columns.1 {
                let cell = line + column;
                if self.owners[cell] != me {
                    continue;
                }
                // Whoever comes closer keeps the cell: nobody else was closer before.
                let was = self.deviations[cell];
                if new.covers(column, row) {
                    let is = new.deviation(column as f32, row as f32);
                    if is <= was {
                        self.set(cell, is, me);
                        continue;
                    }
                }
                self.ask_all(column, row);
            }
        }
        for row in new.rows.0..new.rows.1 {
            let line = row * self.width;
            let cells = line + new.columns.0..line + new.columns.1;
            let deviations = &mut self.deviations[cells.clone()];
            let owners = &mut self.owners[cells.clone()];
            let densities = &mut self.densities[cells];
            for (at, (squared, (owner, out))) in deviations
                .iter_mut()
                .zip(owners.iter_mut().zip(densities))
                .enumerate()
            {
                let is = new.deviation((new.columns.0 + at) as f32, row as f32);
                // Of equals the first has the cell, as when all are drawn in order.
                if is < *squared || (is <= *squared && me < *owner && *owner != NOBODY) {
                    *squared = is;
                    *owner = me;
                    *out = density(is);
                }
            }
        }
    }

    fn set(&mut self, cell: usize, squared: f32, owner: u32) {
        self.deviations[cell] = squared;
        self.owners[cell] = owner;
        self.densities[cell] = if owner == NOBODY {
            0.0
        } else {
            density(squared)
        };
    }

    /// Asks everybody who may reach a cell whose it is.
    fn ask_all(&mut self, column: usize, row: usize) {
        let mut best = (limit(), NOBODY);
        for index in &self.reach[self.tile(column, row)] {
            let kernel = &self.people[*index as usize];
            if kernel.covers(column, row) {
                let squared = kernel.deviation(column as f32, row as f32);
                if squared < best.0 {
                    best = (squared, *index);
                }
            }
        }
        self.set(row * self.width + column, best.0, best.1);
    }

    /// Draws one person over those before.
    fn draw(&mut self, index: u32, kernel: &Kernel) {
        let (start, end) = kernel.columns;
        for row in kernel.rows.0..kernel.rows.1 {
            let line = row * self.width;
            let deviations = &mut self.deviations[line + start..line + end];
            let owners = &mut self.owners[line + start..line + end];
            // Columns as i32, which vector units turn into numbers; a usize they do not.
            let cells = ((start as u32).cast_signed()..).zip(deviations.iter_mut().zip(owners));
            for (column, (squared, owner)) in cells {
                let is = kernel.deviation(column as f32, row as f32);
                // All ones where the cell changes hands: as a choice, it would be a branch.
                let mine = u32::from(is < *squared).wrapping_neg();
                *owner = (index & mine) | (*owner & !mine);
                *squared = if is < *squared { is } else { *squared };
            }
        }
    }

    fn tile(&self, column: usize, row: usize) -> usize {
        row / TILE * self.width.div_ceil(TILE) + column / TILE
    }

    fn tiles(&self, kernel: &Kernel) -> impl Iterator<Item = usize> + use<> {
        let across = self.width.div_ceil(TILE);
        let ((left, right), (bottom, top)) = (kernel.columns, kernel.rows);
        let (columns, rows) = (
            left / TILE..right.div_ceil(TILE),
            bottom / TILE..top.div_ceil(TILE),
        );
        let empty = left == right || bottom == top;
        let rows = if empty { 0..0 } else { rows };
        rows.flat_map(move |row| columns.clone().map(move |column| row * across + column))
    }

    fn note(&mut self, index: u32, kernel: &Kernel) {
        for tile in self.tiles(kernel) {
            let list = &mut self.reach[tile];
            let at = list.partition_point(|other| *other < index);
            list.insert(at, index);
        }
    }

    fn forget(&mut self, index: u32, kernel: &Kernel) {
        for tile in self.tiles(kernel) {
            self.reach[tile].retain(|other| *other != index);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
        for i in 0..3000 {
            let squared = i as f32 * 0.01;
            let exact = (-0.5 * f64::from(squared)).exp();
            assert!(
                (f64::from(density(squared)) - exact).abs() < 3e-7,
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
        fn who_moves_leaves_what_a_new_field_would_have(
            mut people in prop::collection::vec(source(), 1..7),
            moves in prop::collection::vec((any::<prop::sample::Index>(), source()), 1..8),
        ) {
            let mut updated = field(&people);
            for (index, there) in moves {
                let index = index.index(people.len());
                people[index] = there;
                updated.update(index, &there);
                prop_assert_eq!(&updated, &field(&people));
            }
        }
    }
}
