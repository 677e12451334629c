//! The agents as processes: each takes turns, gives its core what has come in, and does what the
//! core decided. It guarantees that a turn whose snapshot was overtaken is left out, not guessed.

use crate::grid::shared::{GridReadError, GridUpdate, GridWriter, SharedGrid, follow_grid, world};
use crate::human_observer::HumanObserver;
use crate::messages::{
    CameraFrame, DETECTIONS, LASER, LaserScan, ODOMETRY, Odometry, SPEECH, Speech, VELOCITY,
    VelocityCommand,
};
use crate::navigation::graph::{Messages, Navigation};
use crate::navigation::map_age::MapState;
use crate::object_recognition::ObjectRecognition;
use crate::social_mapping::config::{ConfigError, SocialConfig};
use crate::social_mapping::graph::SocialMapping;
use dsr::{
    AttachError, Begin, InstanceError, LargeError, ReadError, Session, Snapshot, Time, Transaction,
    TurnError,
};
use thiserror::Error;

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

/// Runs social mapping until it shall end.
///
/// # Errors
/// [`ProcessError`].
pub fn social_mapping(mut session: Session, begin: Begin) -> Result<(), ProcessError> {
    let (mut writer, mut uncommitted): (Option<GridWriter>, Option<GridUpdate>) = (None, None);
    let mut stopped: Option<String> = None;
    let core = SocialMapping::new(SocialConfig::default(), MAP_PERIOD);
    let mut core = core.map_err(ProcessError::Config)?;
    let mut turns = begin()?;
    while let Some(tick) = turns.next(&mut session)? {
        let snapshot = session.snapshot()?;
        let Some(turn) = current(core.step(tick.time, &snapshot))? else {
            continue;
        };
        for rejection in &turn.rejected {
            if rejection.is_waiting() {
                tracing::info!(time = %tick.time, "{rejection}");
            } else {
                tracing::warn!(time = %tick.time, "{rejection}");
            }
        }
        let mut transaction = turn.transaction;
        let why = turn.stopped.map(|error| error.to_string());
        if let Some(why) = &why {
            if stopped.as_ref() != Some(why) {
                tracing::warn!(time = %tick.time, "there is no new map: {why}");
            }
            // The grid given out last is not said to hold still.
            session.submit(&transaction, tick.time)?;
        }
        stopped = why;
        if stopped.is_some() {
            continue;
        }
        uncommitted = match turn.grid {
            Some(grid) => Some(grid.after(uncommitted.as_ref())),
            None => uncommitted,
        };
        let mut withheld = false;
        if let Some(grid) = &uncommitted {
            if writer.is_none()
                && let Some(world) = current(world(&snapshot))?.flatten()
            {
                writer = Some(GridWriter::open(&mut session, world.id())?);
            }
            if let Some(writer) = &mut writer {
                let failure = match writer.give_out(grid, tick.time, &mut transaction) {
                    Ok(()) => None,
                    // It is the grid, not the graph: another one may have room.
                    Err(error @ (LargeError::Schema(_) | LargeError::OutOfMemory { .. })) => {
                        Some(error)
                    }
                    Err(error) => return Err(error.into()),
                };
                withheld = failure.is_some();
                core.given_out(failure.as_ref());
            }
        } else if let Some(writer) = &mut writer {
            writer.confirm(tick.time, &mut transaction);
        }
        if session.submit(&transaction, tick.time)?.is_some() {
            uncommitted = uncommitted.filter(|_| withheld);
        } else if let Some(writer) = writer.as_mut().filter(|_| !transaction.is_empty()) {
            writer.unsaid();
        }
    }
    Ok(())
}

/// Says in the log what the social grid is worth from now on.
fn tell_map(now: Time, state: MapState, age: Option<f64>) {
    let age = age.unwrap_or(f64::NAN);
    match state {
        MapState::Current => tracing::info!(time = %now, "the social grid is current again"),
        MapState::Old { .. } => {
            tracing::warn!(time = %now, "the social grid is {age:.1} s old: the robot goes slower");
        }
        MapState::Lost => {
            tracing::warn!(time = %now, "the social grid is {age:.1} s old: the robot stands until there is a newer one");
        }
    }
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
    let mut grid: Option<SharedGrid> = None;
    let mut map = MapState::default();
    let mut turns = begin()?;
    while let Some(tick) = turns.next(&mut session)? {
        pose = odometry.newest()?.or(pose);
        scan = scans.newest()?.or(scan);
        let snapshot = session.snapshot()?;
        match follow_grid(&mut session, &snapshot, &mut grid) {
            Ok(_) => {}
            Err(GridReadError::Read(error)) => drop(current::<()>(Err(error))?),
            Err(error) => tracing::debug!(time = %tick.time, "no new grid: {error}"),
        }
        let messages = Messages {
            odometry: pose.as_ref(),
            scan: scan.as_ref(),
            grid: grid.as_ref().map(|shared| &shared.grid),
        };
        let Some(effects) = current(core.step(tick.time, &messages, &snapshot))? else {
            continue;
        };
        let (state, age) = effects.map;
        if state.name() != map.name() {
            tell_map(tick.time, state, age);
            map = state;
        }
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
            lateral: 0.0,
            angular: 0.0,
        })?;
    }
    Ok(())
}
