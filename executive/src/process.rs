//! The executive as a process: takes turns, gives its core the graph, and submits what the core
//! decided. It guarantees that a turn whose snapshot was overtaken is left out, not guessed, and that
//! running free it looks as soon as a commit concerns it, and not for one that does not.

use crate::{Executive, MissionSpec, Planner, RulePlanner};
use dsr::{
    AttachError, Begin, Changes, ClockError, Filter, InstanceError, ReadError, Session, Time,
    TurnError, Turns, Update, Version,
};
use grammar::Grammar;
use std::cell::RefCell;
use std::time::Duration;
use thiserror::Error;

/// The core is asked at least so often, seconds, however still the graph is: time-outs and new
/// attempts at planning do not show in it.
const PERIOD: f64 = 0.5;

/// How long a wait for a commit lasts at the most: whether the process shall end is asked after it.
const NAP: Duration = Duration::from_millis(20);

/// Why the executive cannot go on.
#[derive(Debug, Error)]
pub enum ProcessError {
    /// The graph cannot be seen.
    #[error(transparent)]
    Attach(#[from] AttachError),
    /// There are no turns.
    #[error(transparent)]
    Turn(#[from] TurnError),
    /// Commits cannot be heard.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// The clock cannot be heard.
    #[error(transparent)]
    Clock(#[from] ClockError),
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
    let mut looked = None;
    let changes = session.changes(Filter::default())?;
    let turns = begin()?;
    let mut pace = Pace {
        changes: (!turns.in_lockstep()).then_some(changes),
        turns,
        now: None,
    };
    while let Some(now) = pace.next(&mut session, &core, looked)? {
        let snapshot = session.snapshot()?;
        let decided = if pace.turns.in_lockstep() {
            core.step(now, &snapshot)
        } else {
            let asks = RefCell::new(Asks {
                session: &mut session,
                turns: &mut pace.turns,
                looked: snapshot.version(),
                found: false,
            });
            core.step_unless(now, &snapshot, &|| asks.borrow_mut().any())
        };
        for entry in core.take_journal() {
            tracing::info!(time = %entry.time, why = entry.why, "{}", entry.what);
        }
        let transactions = match decided {
            Ok(transactions) => transactions,
            Err(ReadError::SnapshotTooOld { version, oldest }) => {
                tracing::debug!(
                    "version {version} was overtaken by {oldest}: this turn is left out"
                );
                looked = None;
                continue;
            }
            Err(damaged) => return Err(damaged.into()),
        };
        looked = Some((snapshot.version(), now));
        for transaction in &transactions {
            session.submit(transaction, now)?;
        }
    }
    Ok(())
}

/// What may come up while a plan is sought.
struct Asks<'a> {
    session: &'a mut Session,
    turns: &'a mut Turns,
    looked: Version,
    found: bool,
}

impl Asks<'_> {
    /// Whether something is asked of a mission since the turn began, or the process shall end.
    fn any(&mut self) -> bool {
        if self.found || self.turns.ended() {
            return true;
        }
        // What cannot be read now, the next turn meets.
        let Ok(snapshot) = self.session.snapshot() else {
            return false;
        };
        if std::mem::replace(&mut self.looked, snapshot.version()) == snapshot.version() {
            return false;
        }
        let missions = crate::missions(&snapshot).unwrap_or_default();
        self.found = missions.iter().any(|mission| !mission.request.is_empty());
        self.found
    }
}

/// The version that was looked at last, and when.
type Looked = Option<(Version, Time)>;

/// What makes the executive look: whoever gives the turns, or else commits that concern it, and the
/// world's clock.
struct Pace {
    turns: Turns,
    /// `None` in lockstep: any commit since the last turn may concern it.
    changes: Option<Changes>,
    /// The newest time of the clock, running free.
    now: Option<Time>,
}

impl Pace {
    /// The time of the next turn; `None` when the process shall end.
    fn next<P: Planner>(
        &mut self,
        session: &mut Session,
        core: &Executive<P>,
        looked: Looked,
    ) -> Result<Option<Time>, ProcessError> {
        let due = |now: Time| match looked {
            Some((_, then)) => !(0.0..PERIOD).contains(&now.since(then)),
            None => true,
        };
        let Some(changes) = &mut self.changes else {
            while let Some(tick) = self.turns.next(session)? {
                let version = session.snapshot()?.version();
                if due(tick.time) || looked.is_none_or(|(known, _)| known != version) {
                    return Ok(Some(tick.time));
                }
            }
            return Ok(None);
        };
        while !self.turns.ended() {
            changes.wait(NAP)?;
            let snapshot = session.snapshot()?;
            let mut concerned = false;
            while let Some(update) = changes.next(snapshot.schema())? {
                concerned |= match update {
                    Update::Change(change) => core.concerns(&change, snapshot.schema()),
                    Update::Gap(_) => true,
                };
            }
            let tick = session.wait_for_tick(Duration::ZERO)?;
            self.now = tick.map(|tick| tick.time).or(self.now);
            if let Some(now) = self.now.filter(|now| concerned || due(*now)) {
                return Ok(Some(now));
            }
        }
        Ok(None)
    }
}
