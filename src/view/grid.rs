//! Where the social grid is: its handle in the graph, and where it lies on the map.

use dsr::{LargeHandle, ReadError, Snapshot, Value};

/// The grid's handle, with x and y of its lower left corner and the side of a cell, metres; `None`
/// where the graph has none.
///
/// # Errors
/// [`ReadError`].
pub(crate) fn find(snapshot: &Snapshot) -> Result<Option<(LargeHandle, [f64; 3])>, ReadError> {
    let Some(world) = snapshot.nodes_of("world").next().transpose()? else {
        return Ok(None);
    };
    let handle = world.value("social_grid")?;
    let place = world.value("social_grid_place")?;
    let handle = handle.as_ref().and_then(Value::as_large).copied();
    let place = place.as_ref().and_then(Value::as_f64s);
    let place = place.and_then(|place| <[f64; 3]>::try_from(place).ok());
    Ok(handle.zip(place))
}
