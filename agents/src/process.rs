//! The agents as processes: each takes turns, gives its core what has come in, and does what the
//! core decided. It guarantees that a turn whose snapshot was overtaken is left out, not guessed.

use crate::grid::{CostGrid, GridError};
use crate::human_observer::HumanObserver;
use crate::messages::{
    CameraFrame, DETECTIONS, LASER, LaserScan, ODOMETRY, Odometry, SPEECH, Speech, VELOCITY,
    VelocityCommand,
};
use crate::navigation::graph::{Messages, Navigation};
use crate::object_recognition::ObjectRecognition;
use crate::social_mapping::config::{ConfigError, SocialConfig};
use crate::social_mapping::graph::{SocialMapping, StepError};
use dsr::{
    AttachError, Begin, InstanceError, LargeAttribute, LargeError, LargeHandle, LargeReadError,
    NodeId, Owner, ReadError, Session, Snapshot, Time, Transaction, TurnError, Value,
};
use std::time::Duration;
use thiserror::Error;

/// The attribute of the world that holds the social grid: its costs, row by row from the lowest y, each
/// row from the lowest x.
pub const SOCIAL_GRID: &str = "social_grid";
/// The attribute of the world that says where the social grid lies: x and y of its lower left corner and
/// the side of a cell, metres, world frame.
pub const SOCIAL_GRID_PLACE: &str = "social_grid_place";
/// Seconds between updates of the social map.
const MAP_PERIOD: f64 = 0.1;

/// Why an agent cannot go on.
#[derive(Debug, Error)]
pub enum ProcessError {
    /// The graph cannot be seen.
    #[error(transparent)]
    Attach(#[from] AttachError),
    /// The instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// There are no turns.
    #[error(transparent)]
    Turn(#[from] TurnError),
    /// The graph's memory is damaged.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The social grid cannot be given out.
    #[error("the social grid: {0}")]
    Grid(#[from] LargeError),
    /// The social map's configuration is wrong.
    #[error("{} faults in the configuration, the first: {}", .0.len(), .0[0])]
    Config(Vec<ConfigError>),
}

/// What a core made of a snapshot, or nothing where the snapshot was overtaken.
fn current<T>(outcome: Result<T, ReadError>) -> Result<Option<T>, ReadError> {
    match outcome {
        Ok(done) => Ok(Some(done)),
        Err(ReadError::SnapshotTooOld { version, oldest }) => {
            tracing::debug!("version {version} was overtaken by {oldest}: this turn is left out");
            Ok(None)
        }
        Err(damaged) => Err(damaged),
    }
}

/// Takes turns with a core that makes a transaction of camera frames.
fn perceive(
    mut session: Session,
    begin: Begin,
    mut step: impl FnMut(Time, &[CameraFrame], &Snapshot) -> Result<Transaction, ReadError>,
) -> Result<(), ProcessError> {
    let mut frames = session.subscriber::<CameraFrame>(DETECTIONS)?;
    let mut turns = begin()?;
    while let Some(tick) = turns.next(&mut session)? {
        let seen = frames.drain()?;
        let snapshot = session.snapshot()?;
        if let Some(transaction) = current(step(tick.time, &seen, &snapshot))? {
            session.submit(&transaction, tick.time)?;
        }
    }
    Ok(())
}

/// Runs the human observer until it shall end.
///
/// # Errors
/// [`ProcessError`].
pub fn human_observer(session: Session, begin: Begin) -> Result<(), ProcessError> {
    let mut core = HumanObserver::new(crate::human_observer::Config::default());
    perceive(session, begin, |now, frames, snapshot| {
        core.step(now, frames, snapshot)
    })
}

/// Runs object recognition until it shall end.
///
/// # Errors
/// [`ProcessError`].
pub fn object_recognition(session: Session, begin: Begin) -> Result<(), ProcessError> {
    let mut core = ObjectRecognition::new(crate::object_recognition::Config::default());
    perceive(session, begin, |now, frames, snapshot| {
        core.step(now, frames, snapshot)
    })
}

/// The node of the world, once there is one.
fn world(snapshot: &Snapshot) -> Result<Option<NodeId>, ReadError> {
    let world = snapshot.nodes_of("world").next().transpose()?;
    Ok(world.map(|world| world.id()))
}

/// Sends the grid, and says in the transaction which it is and where it lies.
fn give_out(
    grid: &CostGrid,
    world: NodeId,
    grids: &mut LargeAttribute,
    transaction: &mut Transaction,
) -> Result<(), LargeError> {
    let mut loan = grids.loan(size_of_val(grid.costs.as_slice()))?;
    if let Some(costs) = loan.numbers_mut::<f32>() {
        costs.copy_from_slice(&grid.costs);
    }
    loan.send_into(transaction, &[grid.height as u32, grid.width as u32])?;
    let place = [grid.origin.x, grid.origin.y, grid.resolution];
    transaction.set(world, SOCIAL_GRID_PLACE, place);
    Ok(())
}

/// Why there is no new grid.
#[derive(Debug, Error)]
enum GridReadError {
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error(transparent)]
    Large(#[from] LargeReadError),
    #[error("it does not say where it lies, or of which shape it is")]
    Place,
    #[error(transparent)]
    Grid(#[from] GridError),
}

/// The social grid that a snapshot speaks of, where it is another than the known one.
fn newest_grid(
    session: &mut Session,
    snapshot: &Snapshot,
    known: Option<&LargeHandle>,
) -> Result<Option<(LargeHandle, CostGrid)>, GridReadError> {
    let Some(world) = world(snapshot)? else {
        return Ok(None);
    };
    let Some(world) = snapshot.find_node(world)? else {
        return Ok(None);
    };
    let (value, place) = (world.value(SOCIAL_GRID)?, world.value(SOCIAL_GRID_PLACE)?);
    let handle = value.as_ref().and_then(Value::as_large);
    let Some(handle) = handle.filter(|handle| Some(*handle) != known) else {
        return Ok(None);
    };
    let costs = session.read_large(handle, Duration::ZERO)?;
    let (Some(costs), Some(&[x, y, resolution]), &[height, width]) = (
        costs.numbers::<f32>(),
        place.as_ref().and_then(Value::as_f64s),
        handle.shape(),
    ) else {
        return Err(GridReadError::Place);
    };
    let shape = [height as usize, width as usize];
    let grid = CostGrid::new([x, y].into(), resolution, shape, costs)?;
    Ok(Some((*handle, grid)))
}

/// Runs social mapping until it shall end.
///
/// # Errors
/// [`ProcessError`].
pub fn social_mapping(mut session: Session, begin: Begin) -> Result<(), ProcessError> {
    let (mut grids, mut uncommitted) = (None, None);
    let core = SocialMapping::new(SocialConfig::default(), MAP_PERIOD);
    let mut core = core.map_err(ProcessError::Config)?;
    let mut turns = begin()?;
    while let Some(tick) = turns.next(&mut session)? {
        let snapshot = session.snapshot()?;
        let turn = match core.step(tick.time, &snapshot) {
            Ok(turn) => turn,
            Err(StepError::Read(error)) => {
                tracing::debug!("{error}: this turn is left out");
                continue;
            }
            Err(error) => {
                tracing::warn!(time = %tick.time, "no map: {error}");
                continue;
            }
        };
        for rejection in &turn.rejected {
            tracing::warn!(time = %tick.time, "{rejection}");
        }
        let mut transaction = turn.transaction;
        uncommitted = turn.grid.or(uncommitted);
        if let Some(grid) = &uncommitted
            && let Some(world) = world(&snapshot)?
        {
            let grids = match &mut grids {
                Some(grids) => grids,
                None => grids.insert(session.large(Owner::Node(world.into()), SOCIAL_GRID)?),
            };
            give_out(grid, world, grids, &mut transaction)?;
        }
        if session.submit(&transaction, tick.time)?.is_some() {
            uncommitted = None;
        }
    }
    Ok(())
}

/// Runs navigation until it shall end; the robot is told to stand at the end.
///
/// # Errors
/// [`ProcessError`].
pub fn navigation(mut session: Session, begin: Begin) -> Result<(), ProcessError> {
    let mut odometry = session.subscriber::<Odometry>(ODOMETRY)?;
    let mut scans = session.subscriber::<LaserScan>(LASER)?;
    let velocity = session.publisher::<VelocityCommand>(VELOCITY)?;
    let speech = session.publisher::<Speech>(SPEECH)?;
    let mut core = Navigation::new(crate::navigation::navigator::Config::default());
    let (mut pose, mut scan) = (None, None);
    let mut grid: Option<(LargeHandle, CostGrid)> = None;
    let mut turns = begin()?;
    while let Some(tick) = turns.next(&mut session)? {
        pose = odometry.newest()?.or(pose);
        scan = scans.newest()?.or(scan);
        let snapshot = session.snapshot()?;
        let known = grid.as_ref().map(|(handle, _)| handle);
        match newest_grid(&mut session, &snapshot, known) {
            Ok(newest) => grid = newest.or(grid),
            Err(GridReadError::Read(error)) => drop(current::<()>(Err(error))?),
            Err(error) => tracing::debug!(time = %tick.time, "no new grid: {error}"),
        }
        let messages = Messages {
            odometry: pose.as_ref(),
            scan: scan.as_ref(),
            grid: grid.as_ref().map(|(_, grid)| grid),
        };
        let Some(effects) = current(core.step(tick.time, &messages, &snapshot))? else {
            continue;
        };
        velocity.send(&effects.command)?;
        if let Some(words) = &effects.speech {
            speech.send(words)?;
        }
        for transaction in &effects.transactions {
            session.submit(transaction, tick.time)?;
        }
    }
    if let Some(last) = pose {
        velocity.send(&VelocityCommand {
            time: last.time,
            linear: 0.0,
            angular: 0.0,
        })?;
    }
    Ok(())
}
