//! The executive as a process: takes turns, gives its core the graph, and submits what the core
//! decided. It guarantees that a turn whose snapshot was overtaken is left out, not guessed.

use crate::{Executive, MissionSpec, Planner, RulePlanner};
use dsr::{AttachError, Begin, ReadError, Session, Time, TurnError, Version};
use grammar::Grammar;
use thiserror::Error;

/// The core is asked at least so often, seconds, however still the graph is: time-outs and new
/// attempts at planning do not show in it.
const PERIOD: f64 = 0.5;

/// Why the executive cannot go on.
#[derive(Debug, Error)]
pub enum ProcessError {
    /// The graph cannot be seen.
    #[error(transparent)]
    Attach(#[from] AttachError),
    /// There are no turns.
    #[error(transparent)]
    Turn(#[from] TurnError),
    /// The graph's memory is damaged.
    #[error(transparent)]
    Read(#[from] ReadError),
}

/// Runs the executive until it shall end.
///
/// # Errors
/// [`ProcessError`].
pub fn run(
    session: Session,
    begin: Begin,
    grammar: Grammar,
    missions: Vec<MissionSpec>,
) -> Result<(), ProcessError> {
    run_with(session, begin, grammar, missions, RulePlanner::default())
}

/// Runs the executive with a planner of the caller's until it shall end.
///
/// # Errors
/// [`ProcessError`].
pub fn run_with<P: Planner>(
    mut session: Session,
    begin: Begin,
    grammar: Grammar,
    missions: Vec<MissionSpec>,
    planner: P,
) -> Result<(), ProcessError> {
    let mut core = Executive::new(grammar, missions, planner);
    let mut looked: Option<(Version, Time)> = None;
    let mut turns = begin()?;
    while let Some(tick) = turns.next(&mut session)? {
        let snapshot = session.snapshot()?;
        let still = |(version, time)| {
            version == snapshot.version() && (0.0..PERIOD).contains(&tick.time.since(time))
        };
        if looked.is_some_and(still) {
            continue;
        }
        let decided = core.step(tick.time, &snapshot);
        for entry in core.take_journal() {
            tracing::info!(time = %entry.time, why = entry.why, "{}", entry.what);
        }
        let transactions = match decided {
            Ok(transactions) => transactions,
            Err(ReadError::SnapshotTooOld { version, oldest }) => {
                tracing::debug!(
                    "version {version} was overtaken by {oldest}: this turn is left out"
                );
                continue;
            }
            Err(damaged) => return Err(damaged.into()),
        };
        looked = Some((snapshot.version(), tick.time));
        for transaction in &transactions {
            session.submit(transaction, tick.time)?;
        }
    }
    Ok(())
}
