//! The grid in the graph, as a large value of the world: who gives it out and who reads it use this file.
//! It owns the names of the attributes, and guarantees that a reader knows which cells may have changed.

use super::{CostGrid, GridError, Region};
use dsr::{
    LargeAttribute, LargeError, LargeHandle, LargeReadError, Node, NodeId, Owner, ReadError,
    Session, Snapshot, Transaction, Value,
};
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

impl SharedGrid {
    /// Where it may differ from the grid that a reader `knows`, if any: who missed one takes all as changed.
    pub fn changed_since(&self, knows: Option<&LargeHandle>) -> Region {
        let known = knows.filter(|known| known.stream() == self.handle.stream());
        match known.map(LargeHandle::sequence) {
            Some(known) if known == self.handle.sequence() => Region::default(),
            Some(known) if known.checked_add(1) == Some(self.handle.sequence()) => self.dirty,
            _ => self.grid.whole(),
        }
    }
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
}

impl GridWriter {
    /// The writer for the node of the world.
    ///
    /// # Errors
    /// [`LargeError`].
    pub fn open(session: &mut Session, world: NodeId) -> Result<Self, LargeError> {
        let grids = session.large(Owner::Node(world.into()), SOCIAL_GRID)?;
        Ok(Self { world, grids })
    }

    /// Sends the grid, and says in the transaction which it is, where it lies and what changed.
    ///
    /// # Errors
    /// [`LargeError`].
    pub fn give_out(
        &mut self,
        update: &GridUpdate,
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

/// The social grid that a snapshot speaks of, where it is another than the one that the reader `knows`.
///
/// # Errors
/// [`GridReadError`].
pub fn newest_grid(
    session: &mut Session,
    snapshot: &Snapshot,
    knows: Option<&LargeHandle>,
) -> Result<Option<SharedGrid>, GridReadError> {
    let Some(world) = world(snapshot)? else {
        return Ok(None);
    };
    let value = world.value(SOCIAL_GRID)?;
    let handle = value.as_ref().and_then(Value::as_large);
    let Some(handle) = handle.filter(|handle| Some(*handle) != knows) else {
        return Ok(None);
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
    let shape = [height as usize, width as usize];
    let grid = CostGrid::new([x, y].into(), resolution, shape, costs)?;
    Ok(Some(SharedGrid {
        handle: *handle,
        dirty: dirty.common(&grid.whole()),
        grid,
    }))
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
    use super::*;

    fn region(columns: (usize, usize), rows: (usize, usize)) -> Region {
        Region { columns, rows }
    }

    #[test]
    fn whoever_missed_a_grid_takes_all_as_changed() {
        let grid = CostGrid::covering([0.0, 0.0, 0.4, 0.2], 0.1);
        let handle = |stream, sequence| LargeHandle::new(stream, sequence, 32, &[2, 4]).unwrap();
        let shared = SharedGrid {
            handle: handle(3, 7),
            dirty: region((0, 1), (0, 1)),
            grid,
        };
        assert!(shared.changed_since(Some(&handle(3, 7))).is_empty());
        assert_eq!(shared.changed_since(Some(&handle(3, 6))), shared.dirty);
        let whole = shared.grid.whole();
        for (stream, sequence) in [(3, 5), (3, 8), (3, u64::MAX), (2, 6)] {
            let known = handle(stream, sequence);
            assert_eq!(shared.changed_since(Some(&known)), whole);
        }
        assert_eq!(shared.changed_since(None), whole);
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
