//! The cost grid that social mapping makes and navigation plans on. This file owns its geometry:
//! which cell a point lies in and where a cell's centre is, the same for writer and reader; and its
//! bytes between processes, of which a reader survives any.

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

/// The first bytes of every grid: its name and the version of the layout.
const MAGIC: [u8; 8] = *b"cgrid\0\0\x01";
/// Bytes before the costs.
const HEADER: usize = 48;

/// Why bytes are no grid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GridDecodeError {
    /// They end within the header.
    #[error("a grid's header has {HEADER} bytes, here are {found}")]
    Short {
        /// How many there are.
        found: usize,
    },
    /// They do not begin with the mark of this layout.
    #[error("the bytes are not a grid of this version")]
    Magic,
    /// The header's geometry is impossible: no cells, no finite origin or no positive resolution.
    #[error("a grid of {width} x {height} cells of {resolution} m from {origin} is impossible")]
    Geometry {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
        /// Side of a cell, metres.
        resolution: f64,
        /// Lower left corner.
        origin: Point2<f64>,
    },
    /// The header announces another number of costs than follow.
    #[error("{width} x {height} cells need four bytes each, but {found} bytes follow the header")]
    Length {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
        /// How many follow.
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
    /// The grid as bytes, all little endian: the magic `"cgrid\0\0\x01"`, width and height (u64),
    /// origin x and y and resolution (f64), then the costs (f32) row by row.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEADER + 4 * self.costs.len());
        bytes.extend(MAGIC);
        bytes.extend((self.width as u64).to_le_bytes());
        bytes.extend((self.height as u64).to_le_bytes());
        for value in [self.origin.x, self.origin.y, self.resolution] {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend(self.costs.iter().flat_map(|cost| cost.to_le_bytes()));
        bytes
    }

    /// The grid that [`Self::to_bytes`] wrote.
    ///
    /// # Errors
    /// [`GridDecodeError`] for any other bytes; nothing is allocated before the lengths agree.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, GridDecodeError> {
        let (header, costs) = bytes
            .split_at_checked(HEADER)
            .ok_or(GridDecodeError::Short { found: bytes.len() })?;
        let (words, _) = header.as_chunks::<8>();
        let [magic, width, height, x, y, resolution] = *words else {
            return Err(GridDecodeError::Short { found: bytes.len() });
        };
        if magic != MAGIC {
            return Err(GridDecodeError::Magic);
        }
        let (width, height) = (u64::from_le_bytes(width), u64::from_le_bytes(height));
        let origin = Point2::new(f64::from_le_bytes(x), f64::from_le_bytes(y));
        let resolution = f64::from_le_bytes(resolution);
        let positive = resolution.is_finite() && resolution > 0.0;
        if width == 0 || height == 0 || !origin.iter().all(|c| c.is_finite()) || !positive {
            return Err(GridDecodeError::Geometry {
                width,
                height,
                resolution,
                origin,
            });
        }
        let expected = width
            .checked_mul(height)
            .and_then(|cells| cells.checked_mul(4));
        if expected != Some(costs.len() as u64) {
            return Err(GridDecodeError::Length {
                width,
                height,
                found: costs.len(),
            });
        }
        let (costs, _) = costs.as_chunks::<4>();
        let costs: Vec<f32> = costs.iter().map(|cost| f32::from_le_bytes(*cost)).collect();
        // Written so that a NaN is refused as well.
        if let Some(index) = costs
            .iter()
            .position(|cost| !matches!(cost, FREE..=BLOCKED))
        {
            return Err(GridDecodeError::Cost {
                index,
                cost: costs[index],
            });
        }
        Ok(Self {
            origin,
            resolution,
            width: width as usize,
            height: height as usize,
            costs,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::GridDecodeError as E;
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bytes_that_are_no_grid_are_refused_for_what_is_wrong() {
        let good = CostGrid::covering([0.0, 0.0, 0.4, 0.2], 0.1).to_bytes();
        let with = |at: usize, new: &[u8]| {
            let mut bytes = good.clone();
            bytes[at..at + new.len()].copy_from_slice(new);
            CostGrid::from_bytes(&bytes).unwrap_err()
        };
        assert_eq!(
            CostGrid::from_bytes(&good[..47]),
            Err(E::Short { found: 47 })
        );
        assert_eq!(with(7, &[2]), E::Magic);
        assert!(matches!(
            with(8, &0u64.to_le_bytes()),
            E::Geometry { width: 0, .. }
        ));
        assert!(matches!(
            with(24, &f64::NAN.to_le_bytes()),
            E::Geometry { .. }
        ));
        assert!(matches!(
            with(40, &(-0.1f64).to_le_bytes()),
            E::Geometry { .. }
        ));
        assert!(matches!(
            with(8, &u64::MAX.to_le_bytes()),
            E::Length { found: 32, .. }
        ));
        assert!(matches!(
            CostGrid::from_bytes(&good[..good.len() - 1]),
            Err(E::Length { .. })
        ));
        for cost in [f32::NAN, 0.5, -1.0, f32::NEG_INFINITY] {
            assert!(matches!(
                with(48 + 8, &cost.to_le_bytes()),
                E::Cost { index: 2, .. }
            ));
        }
    }

    proptest! {
        #[test]
        fn decoding_undoes_encoding(
            (width, costs) in (1usize..20, 1usize..20).prop_flat_map(|(width, height)| {
                let cost = prop_oneof![Just(BLOCKED), Just(FREE), 1.0f32..10.0];
                (Just(width), prop::collection::vec(cost, width * height))
            }),
            x in -1e3..1e3f64, y in -1e3..1e3f64, resolution in 0.01..1.0f64,
        ) {
            let height = costs.len() / width;
            let grid = CostGrid { origin: Point2::new(x, y), resolution, width, height, costs };
            prop_assert_eq!(CostGrid::from_bytes(&grid.to_bytes()), Ok(grid));
        }

        #[test]
        fn any_bytes_are_survived(mut bytes in prop::collection::vec(any::<u8>(), 0..200), known: bool) {
            if known && bytes.len() >= 8 {
                bytes[..8].copy_from_slice(&MAGIC);
            }
            if let Ok(grid) = CostGrid::from_bytes(&bytes) {
                prop_assert_eq!(grid.to_bytes(), bytes);
            }
        }
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
}
