//! The cost grid that social mapping makes and navigation plans on. This file owns its geometry:
//! which cell a point lies in and where a cell's centre is, the same for writer and reader; and it
//! guarantees that what is no grid is refused.

pub mod shared;

use nalgebra::Point2;

/// A rectangular grid of traversal costs in the world frame (READING.md item 7).
///
/// Cell (column, row) covers `origin + resolution * [column, column+1) x [row, row+1)`; cells are
/// stored row by row from the lowest y. A cost is at least 1; infinity blocks the cell.
#[derive(Debug, Clone, PartialEq)]
pub struct CostGrid {
    /// The lower left corner of cell (0, 0), world frame, metres.
    pub origin: Point2<f64>,
    /// Side of a cell, metres.
    pub resolution: f64,
    /// Number of columns (along x).
    pub width: usize,
    /// Number of rows (along y).
    pub height: usize,
    /// `width * height` costs.
    pub costs: Vec<f32>,
}

/// The cost of a cell that nothing may enter.
pub const BLOCKED: f32 = f32::INFINITY;
/// The cost of a free cell.
pub const FREE: f32 = 1.0;

/// Column and row of a cell.
pub type Cell = (usize, usize);

/// A rectangle of cells: first column and row, and those after the last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Region {
    /// Along x.
    pub columns: (usize, usize),
    /// Along y.
    pub rows: (usize, usize),
}

impl Region {
    /// Whether it has no cells.
    pub fn is_empty(&self) -> bool {
        self.columns.0 >= self.columns.1 || self.rows.0 >= self.rows.1
    }

    /// Whether the two have a cell in common.
    pub fn meets(&self, other: &Self) -> bool {
        self.columns.0 < other.columns.1
            && other.columns.0 < self.columns.1
            && self.rows.0 < other.rows.1
            && other.rows.0 < self.rows.1
    }

    /// The cells in both.
    #[must_use]
    pub fn common(&self, other: &Self) -> Self {
        let both = |a: (usize, usize), b: (usize, usize)| (a.0.max(b.0), a.1.min(b.1));
        Self {
            columns: both(self.columns, other.columns),
            rows: both(self.rows, other.rows),
        }
    }

    /// How many cells it has.
    pub fn area(&self) -> usize {
        let length = |(start, end): (usize, usize)| end.saturating_sub(start);
        length(self.columns) * length(self.rows)
    }

    /// The smallest region around both. An empty one adds nothing.
    #[must_use]
    pub fn joined(&self, other: &Self) -> Self {
        if self.is_empty() {
            return *other;
        }
        if other.is_empty() {
            return *self;
        }
        let join = |a: (usize, usize), b: (usize, usize)| (a.0.min(b.0), a.1.max(b.1));
        Self {
            columns: join(self.columns, other.columns),
            rows: join(self.rows, other.rows),
        }
    }

    /// Where each of its rows stands in the costs of a grid with `width` columns.
    pub fn row_ranges(&self, width: usize) -> impl Iterator<Item = std::ops::Range<usize>> + use<> {
        let (start, end) = self.columns;
        (self.rows.0..self.rows.1).map(move |row| row * width + start..row * width + end)
    }
}

impl CostGrid {
    /// A grid of free cells that covers `bounds` (xmin, ymin, xmax, ymax; metres).
    pub fn covering(bounds: [f64; 4], resolution: f64) -> Self {
        let width = ((bounds[2] - bounds[0]) / resolution).ceil().max(1.0) as usize;
        let height = ((bounds[3] - bounds[1]) / resolution).ceil().max(1.0) as usize;
        Self {
            origin: Point2::new(bounds[0], bounds[1]),
            resolution,
            width,
            height,
            costs: vec![FREE; width * height],
        }
    }

    /// All its cells.
    pub fn whole(&self) -> Region {
        Region {
            columns: (0, self.width),
            rows: (0, self.height),
        }
    }

    /// The cell that `point` (world frame) lies in, if the grid covers it.
    pub fn cell_at(&self, point: Point2<f64>) -> Option<Cell> {
        let column = ((point.x - self.origin.x) / self.resolution).floor();
        let row = ((point.y - self.origin.y) / self.resolution).floor();
        let inside =
            column >= 0.0 && row >= 0.0 && column < self.width as f64 && row < self.height as f64;
        inside.then_some((column as usize, row as usize))
    }

    /// The centre of `cell`, world frame.
    pub fn centre(&self, cell: Cell) -> Point2<f64> {
        Point2::new(
            self.origin.x + (cell.0 as f64 + 0.5) * self.resolution,
            self.origin.y + (cell.1 as f64 + 0.5) * self.resolution,
        )
    }

    /// Where `cell` stands in `costs`.
    pub fn index(&self, cell: Cell) -> usize {
        cell.1 * self.width + cell.0
    }

    /// The cost of `cell`.
    pub fn cost(&self, cell: Cell) -> f32 {
        self.costs[self.index(cell)]
    }
}

/// Why numbers are no grid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GridError {
    /// The geometry is impossible: no cells, no finite origin or no positive resolution.
    #[error("a grid of {width} x {height} cells of {resolution} m from {origin} is impossible")]
    Geometry {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Side of a cell, metres.
        resolution: f64,
        /// Lower left corner.
        origin: Point2<f64>,
    },
    /// There are more or fewer costs than cells.
    #[error("{width} x {height} cells need a cost each, but here are {found}")]
    Length {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// How many costs there are.
        found: usize,
    },
    /// A cost is below 1 or not a number.
    #[error("cell {index} has the cost {cost}")]
    Cost {
        /// Where it stands in the costs.
        index: usize,
        /// Its value.
        cost: f32,
    },
}

impl CostGrid {
    /// The grid of `width` columns whose cell (0, 0) has its lower left corner at `origin` (world
    /// frame, metres), with the costs of the cells row by row from the lowest y.
    ///
    /// # Errors
    /// [`GridError`] for what no [`CostGrid`] is.
    pub fn new(
        origin: Point2<f64>,
        resolution: f64,
        [height, width]: [usize; 2],
        costs: &[f32],
    ) -> Result<Self, GridError> {
        let positive = resolution.is_finite() && resolution > 0.0;
        if width == 0 || height == 0 || !origin.iter().all(|c| c.is_finite()) || !positive {
            return Err(GridError::Geometry {
                width,
                height,
                resolution,
                origin,
            });
        }
        if width.checked_mul(height) != Some(costs.len()) {
            return Err(GridError::Length {
                width,
                height,
                found: costs.len(),
            });
        }
        check(costs, 0)?;
        Ok(Self {
            origin,
            resolution,
            width,
            height,
            costs: costs.to_vec(),
        })
    }

    /// Takes the cells of a region, as far as it lies on the grid, from `costs`, which are those of all cells.
    ///
    /// # Errors
    /// [`GridError`] where there are more or fewer costs than cells, or one in the region is none; nothing changes then.
    pub fn take_over(&mut self, region: &Region, costs: &[f32]) -> Result<(), GridError> {
        if costs.len() != self.costs.len() {
            return Err(GridError::Length {
                width: self.width,
                height: self.height,
                found: costs.len(),
            });
        }
        let region = region.common(&self.whole());
        if region.is_empty() {
            return Ok(());
        }
        for range in region.row_ranges(self.width) {
            check(&costs[range.clone()], range.start)?;
        }
        for range in region.row_ranges(self.width) {
            self.costs[range.clone()].copy_from_slice(&costs[range]);
        }
        Ok(())
    }
}

/// Whether all of these are costs; the first stands at `first` in the grid.
fn check(costs: &[f32], first: usize) -> Result<(), GridError> {
    // Written so that a NaN is refused as well.
    let wrong = |cost: &f32| !matches!(cost, FREE..=BLOCKED);
    match costs.iter().position(wrong) {
        Some(index) => Err(GridError::Cost {
            index: first + index,
            cost: costs[index],
        }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::GridError as E;
    use super::*;

    #[test]
    fn numbers_that_are_no_grid_are_refused_for_what_is_wrong() {
        let costs = CostGrid::covering([0.0, 0.0, 0.4, 0.2], 0.1).costs;
        let new = |origin, resolution, shape, costs: &[f32]| {
            CostGrid::new(origin, resolution, shape, costs).unwrap_err()
        };
        let origin = Point2::origin();
        let geometry = |error| matches!(error, E::Geometry { .. });
        assert!(geometry(new(origin, 0.1, [2, 0], &costs)));
        assert!(geometry(new(origin, 0.1, [0, 4], &[])));
        assert!(geometry(new(
            Point2::new(f64::NAN, 0.0),
            0.1,
            [2, 4],
            &costs
        )));
        assert!(geometry(new(origin, -0.1, [2, 4], &costs)));
        let length = |error| matches!(error, E::Length { found: 8, .. });
        assert!(length(new(origin, 0.1, [2, 5], &costs)));
        assert!(length(new(origin, 0.1, [usize::MAX, 2], &costs)));
        for cost in [f32::NAN, 0.5, -1.0, f32::NEG_INFINITY] {
            let mut costs = costs.clone();
            costs[2] = cost;
            assert!(matches!(
                new(origin, 0.1, [2, 4], &costs),
                E::Cost { index: 2, .. }
            ));
        }
        let grid = CostGrid::new(origin, 0.1, [2, 4], &costs).unwrap();
        assert_eq!(grid, CostGrid::covering([0.0, 0.0, 0.4, 0.2], 0.1));
    }

    #[test]
    fn the_centre_of_a_cell_lies_in_it_and_outside_is_nowhere() {
        let grid = CostGrid::covering([-1.0, 2.0, 3.02, 4.0], 0.05);
        assert_eq!((grid.width, grid.height), (81, 40));
        for cell in [(0, 0), (80, 39), (17, 5)] {
            assert_eq!(grid.cell_at(grid.centre(cell)), Some(cell));
        }
        assert_eq!(grid.cell_at(Point2::new(-1.01, 3.0)), None);
        assert_eq!(grid.cell_at(Point2::new(0.0, 4.01)), None);
    }

    #[test]
    fn regions_join_and_meet_as_sets_of_cells_do() {
        let region = |columns, rows| Region { columns, rows };
        let (one, other) = (region((1, 4), (0, 2)), region((3, 9), (1, 5)));
        assert!(one.meets(&other) && !one.meets(&region((4, 9), (0, 9))));
        assert_eq!(one.common(&other), region((3, 4), (1, 2)));
        assert_eq!(one.joined(&other), region((1, 9), (0, 5)));
        assert_eq!(one.joined(&Region::default()), one);
        assert_eq!(Region::default().joined(&one), one);
        assert_eq!(
            (one.area(), one.common(&region((4, 9), (0, 9))).area()),
            (6, 0)
        );
        assert_eq!(one.row_ranges(10).collect::<Vec<_>>(), [1..4, 11..14]);
    }
}
