//! The grid in the graph, as a large value of the world: who gives it out and who reads it use this file.
//! It owns the names of the attributes, and guarantees that a grid which is read in part equals one
//! that is read whole.

use super::{CostGrid, GridError, Region};
use dsr::{
    LargeAttribute, LargeError, LargeHandle, LargeReadError, Node, NodeId, Owner, ReadError,
    Session, Snapshot, Time, Transaction, Value,
};
use nalgebra::Point2;
use std::sync::Arc;
use std::time::Duration;
use thiserror::Error;

/// The attribute of the world that holds the social grid: its costs, row by row from the lowest y, each
/// row from the lowest x.
pub const SOCIAL_GRID: &str = "social_grid";
/// The attribute of the world that says where the social grid lies: x and y of its lower left corner and
/// the side of a cell, metres, world frame.
pub const SOCIAL_GRID_PLACE: &str = "social_grid_place";
/// The attribute of the world that says where the social grid differs from the one given out before it: the
/// first column and the one after the last, the first row and the one after the last.
pub const SOCIAL_GRID_DIRTY: &str = "social_grid_dirty";

/// The attribute of the world that says as of when the social grid is what its scene makes of it, seconds since 1970. It is
/// written with each grid, and once a [`CONFIRMED`] while the grid stays as it is: a grid whose time stands still is one
/// that nobody keeps.
pub const SOCIAL_GRID_TIME: &str = "social_grid_time";
/// How often a grid that stays as it is is said to hold, seconds.
pub const CONFIRMED: f64 = 1.0;

/// A grid to give out.
#[derive(Debug, Clone, PartialEq)]
pub struct GridUpdate {
    /// Outside of it, each cell costs what it did in the grid given out before.
    pub dirty: Region,
    /// The grid.
    pub grid: Arc<CostGrid>,
}

impl GridUpdate {
    /// This grid, for whoever was given none since the one before `earlier`.
    #[must_use]
    pub fn after(mut self, earlier: Option<&Self>) -> Self {
        if let Some(earlier) = earlier {
            let both = self.dirty.joined(&earlier.dirty);
            self.dirty = both.common(&self.grid.whole());
        }
        self
    }
}

/// A grid that was given out.
#[derive(Debug, Clone, PartialEq)]
pub struct SharedGrid {
    /// Which it is.
    pub handle: LargeHandle,
    /// Outside of it, each cell costs what it did in the grid given out before.
    pub dirty: Region,
    /// The grid.
    pub grid: CostGrid,
}

/// The world, once there is one.
///
/// # Errors
/// [`ReadError`].
pub fn world(snapshot: &Snapshot) -> Result<Option<Node<'_>>, ReadError> {
    snapshot.nodes_of("world").next().transpose()
}

/// What gives the grids of a world out.
#[derive(Debug)]
pub struct GridWriter {
    world: NodeId,
    grids: LargeAttribute,
    confirmed: Confirmed,
}

/// When it was last said that the grid holds.
#[derive(Debug, Clone, Copy, Default)]
struct Confirmed(Option<Time>);

impl Confirmed {
    /// Whether it is to be said again.
    fn is_due(self, now: Time) -> bool {
        // Also where the clock was set back.
        self.0
            .is_none_or(|last| !(0.0..CONFIRMED).contains(&now.since(last)))
    }
}

impl GridWriter {
    /// The writer for the node of the world.
    ///
    /// # Errors
    /// [`LargeError`].
    pub fn open(session: &mut Session, world: NodeId) -> Result<Self, LargeError> {
        let grids = session.large(Owner::Node(world.into()), SOCIAL_GRID)?;
        let confirmed = Confirmed::default();
        Ok(Self {
            world,
            grids,
            confirmed,
        })
    }

    /// Says in the transaction that the grid given out holds as of `now`, where that was not said for [`CONFIRMED`]. To be
    /// asked in each turn that made a map.
    pub fn confirm(&mut self, now: Time, transaction: &mut Transaction) {
        if self.confirmed.is_due(now) {
            self.tell(now, transaction);
        }
    }

    fn tell(&mut self, now: Time, transaction: &mut Transaction) {
        self.confirmed = Confirmed(Some(now));
        transaction.set(self.world, SOCIAL_GRID_TIME, now.seconds());
    }

    /// What was said last came to nobody: it is to be said again.
    pub fn unsaid(&mut self) {
        self.confirmed = Confirmed::default();
    }

    /// Sends the grid, and says in the transaction which it is, where it lies, what changed and that it holds as of `now`.
    ///
    /// # Errors
    /// [`LargeError`].
    pub fn give_out(
        &mut self,
        update: &GridUpdate,
        now: Time,
        transaction: &mut Transaction,
    ) -> Result<(), LargeError> {
        let grid = &update.grid;
        let mut loan = self.grids.loan(size_of_val(grid.costs.as_slice()))?;
        if let Some(costs) = loan.numbers_mut::<f32>() {
            costs.copy_from_slice(&grid.costs);
        }
        loan.send_into(transaction, &[grid.height as u32, grid.width as u32])?;
        let place = [grid.origin.x, grid.origin.y, grid.resolution];
        transaction.set(self.world, SOCIAL_GRID_PLACE, place);
        let Region { columns, rows } = update.dirty;
        let dirty = [columns.0, columns.1, rows.0, rows.1].map(|count| count as f64);
        transaction.set(self.world, SOCIAL_GRID_DIRTY, dirty);
        self.tell(now, transaction);
        Ok(())
    }
}

/// Why there is no new grid.
#[derive(Debug, Error)]
pub enum GridReadError {
    /// The snapshot cannot be read any more; take a new one.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The costs cannot be read, or not any more.
    #[error(transparent)]
    Large(#[from] LargeReadError),
    /// What lies beside the costs is absent or malformed.
    #[error("the social grid does not say where it lies, of which shape it is, or what changed")]
    Beside,
    /// The costs are no grid.
    #[error(transparent)]
    Grid(#[from] GridError),
}

/// Brings `grid` up to the social grid that a snapshot speaks of; whether that is another. Of one that follows the known
/// one, only the cells that may have changed are read.
///
/// # Errors
/// [`GridReadError`]; `grid` stays as it was.
pub fn follow_grid(
    session: &mut Session,
    snapshot: &Snapshot,
    grid: &mut Option<SharedGrid>,
) -> Result<bool, GridReadError> {
    let Some(world) = world(snapshot)? else {
        return Ok(false);
    };
    let value = world.value(SOCIAL_GRID)?;
    let handle = value.as_ref().and_then(Value::as_large);
    let known = grid.as_ref().map(|known| &known.handle);
    let Some(handle) = handle.filter(|handle| Some(*handle) != known) else {
        return Ok(false);
    };
    let (place, dirty) = (
        world.value(SOCIAL_GRID_PLACE)?,
        world.value(SOCIAL_GRID_DIRTY)?,
    );
    let costs = session.read_large(handle, Duration::ZERO)?;
    let (Some(costs), Some(&[x, y, resolution]), &[height, width], Some(dirty)) = (
        costs.numbers::<f32>(),
        place.as_ref().and_then(Value::as_f64s),
        handle.shape(),
        dirty.as_ref().and_then(region),
    ) else {
        return Err(GridReadError::Beside);
    };
    let given = Given {
        handle: *handle,
        origin: [x, y].into(),
        resolution,
        shape: [height as usize, width as usize],
        dirty,
        costs,
    };
    given.bring(grid)?;
    Ok(true)
}

/// A grid as it lies in shared memory.
struct Given<'a> {
    handle: LargeHandle,
    origin: Point2<f64>,
    resolution: f64,
    shape: [usize; 2],
    dirty: Region,
    costs: &'a [f32],
}

impl Given<'_> {
    /// Makes `known` this grid, from the one before it where it is that.
    fn bring(self, known: &mut Option<SharedGrid>) -> Result<(), GridError> {
        if let Some(known) = known.as_mut().filter(|known| self.follows(known)) {
            known.grid.take_over(&self.dirty, self.costs)?;
            known.dirty = self.dirty.common(&known.grid.whole());
            known.handle = self.handle;
            return Ok(());
        }
        let grid = CostGrid::new(self.origin, self.resolution, self.shape, self.costs)?;
        *known = Some(SharedGrid {
            handle: self.handle,
            dirty: self.dirty.common(&grid.whole()),
            grid,
        });
        Ok(())
    }

    /// Whether this is the very next grid after `known`, over the same cells.
    #[expect(
        clippy::float_cmp,
        reason = "asks for the same cells, not for similar ones"
    )]
    fn follows(&self, known: &SharedGrid) -> bool {
        let grid = &known.grid;
        known.handle.stream() == self.handle.stream()
            && known.handle.sequence().checked_add(1) == Some(self.handle.sequence())
            && grid.origin == self.origin
            && grid.resolution == self.resolution
            && [grid.height, grid.width] == self.shape
    }
}

fn region(dirty: &Value) -> Option<Region> {
    let [left, right, bottom, top] = *dirty.as_f64s()? else {
        return None;
    };
    // A float to integer cast saturates; whatever is no region within the grid is cut to it.
    Some(Region {
        columns: (left as usize, right as usize),
        rows: (bottom as usize, top as usize),
    })
}

#[cfg(test)]
mod tests {
    use super::super::FREE;
    use super::*;
    use proptest::prelude::*;

    fn region(columns: (usize, usize), rows: (usize, usize)) -> Region {
        Region { columns, rows }
    }

    const SIZE: [usize; 2] = [5, 7];

    fn handle(stream: u64, sequence: u64) -> LargeHandle {
        let [height, width] = SIZE.map(|side| side as u32);
        LargeHandle::new(
            stream,
            sequence,
            4 * u64::from(height * width),
            &[height, width],
        )
        .unwrap()
    }

    fn given(handle: LargeHandle, dirty: Region, costs: &[f32]) -> Given<'_> {
        Given {
            handle,
            origin: Point2::new(-1.0, 2.0),
            resolution: 0.1,
            shape: SIZE,
            dirty,
            costs,
        }
    }

    /// A grid of the same costs everywhere, read whole.
    fn read(handle: LargeHandle, cost: f32) -> SharedGrid {
        let mut known = None;
        let costs = [cost; SIZE[0] * SIZE[1]];
        given(handle, Region::default(), &costs)
            .bring(&mut known)
            .unwrap();
        known.unwrap()
    }

    proptest! {
        #[test]
        fn reading_what_changed_leaves_what_reading_all_does(
            changes in prop::collection::vec(((0..8usize, 0..8usize), (0..6usize, 0..6usize), 1.0..9.0f32), 1..12),
        ) {
            let mut costs = vec![FREE; SIZE[0] * SIZE[1]];
            let mut known = Some(read(handle(3, 0), FREE));
            for (number, (columns, rows, cost)) in (1..).zip(changes) {
                let whole = known.as_ref().unwrap().grid.whole();
                let dirty = region(columns, rows);
                for range in dirty.common(&whole).row_ranges(SIZE[1]).filter(|r| r.start < r.end) {
                    costs[range].fill(cost);
                }
                given(handle(3, number), dirty, &costs).bring(&mut known).unwrap();
                let mut whole = None;
                given(handle(3, number), dirty, &costs).bring(&mut whole).unwrap();
                prop_assert_eq!(&known, &whole);
            }
        }
    }

    #[test]
    fn that_a_grid_holds_is_said_once_a_second() {
        let mut confirmed = Confirmed::default();
        let mut said = Vec::new();
        for tick in [0, 3, 9, 10, 12, 21, 4, 5] {
            let now = Time::from_seconds(1000.0 + 0.1 * f64::from(tick));
            if confirmed.is_due(now) {
                confirmed = Confirmed(Some(now));
                said.push(tick);
            }
        }
        assert_eq!(said, [0, 10, 21, 4]);
    }

    #[test]
    fn only_the_next_grid_over_the_same_cells_is_read_in_part() {
        let costs = [4.0; SIZE[0] * SIZE[1]];
        let dirty = region((1, 3), (0, 2));
        let brought = |given: Given<'_>| {
            let mut known = Some(read(handle(3, 7), FREE));
            given.bring(&mut known).unwrap();
            let grid = known.unwrap().grid;
            grid.costs.iter().filter(|cost| **cost > FREE).count()
        };
        assert_eq!(brought(given(handle(3, 8), dirty, &costs)), dirty.area());
        for other in [handle(3, 9), handle(3, 6), handle(2, 8)] {
            assert_eq!(brought(given(other, dirty, &costs)), costs.len());
        }
        let moved = Given {
            origin: Point2::origin(),
            ..given(handle(3, 8), dirty, &costs)
        };
        assert_eq!(brought(moved), costs.len());
    }

    #[test]
    fn what_is_no_cost_leaves_the_grid_as_it_was() {
        let mut costs = [4.0; SIZE[0] * SIZE[1]];
        costs[2 * SIZE[1] + 2] = f32::NAN;
        let before = Some(read(handle(3, 7), FREE));
        let mut known = before.clone();
        let error = given(handle(3, 8), region((0, 4), (0, 4)), &costs).bring(&mut known);
        assert!(matches!(error, Err(GridError::Cost { index: 16, .. })));
        assert_eq!(known, before);
    }

    #[test]
    fn a_grid_that_nobody_got_leaves_its_change_to_the_next() {
        let update = |columns, side| GridUpdate {
            dirty: region(columns, (0, 1)),
            grid: Arc::new(CostGrid::covering([0.0, 0.0, side, side], 0.1)),
        };
        let next = update((0, 1), 0.4);
        assert_eq!(next.clone().after(None), next);
        let after = next.after(Some(&update((3, 9), 0.9)));
        assert_eq!(after.dirty, region((0, 4), (0, 1)), "within the newer grid");
    }
}
