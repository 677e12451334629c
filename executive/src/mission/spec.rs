//! What the executive is given and what it tells: missions, settings, a planner, its journal. This
//! file owns the figures that decide how long it waits and how often it tries.

use super::{MissionStatus, Preemption, Schedule};
use crate::{Effort, Limits, Options, Outcome};
use dsr::{ReadError, Snapshot, Time, Value};
use grammar::{Goal, Grammar};

/// What a scenario wants done.
#[derive(Debug, Clone, PartialEq)]
pub struct MissionSpec {
    /// Unique; the name of its node.
    pub name: String,
    /// What shall hold, in AGGL (`.aggt`).
    pub goal: String,
    /// The larger, the sooner; of equals, the one with the earlier deadline.
    pub priority: i64,
    /// It fails where its goal does not hold by then.
    pub deadline: Option<Time>,
    /// When it gives way to one of higher priority.
    pub preemption: Preemption,
    /// When it begins.
    pub schedule: Schedule,
}

impl MissionSpec {
    /// The attributes of its node, as it begins: queued.
    pub fn attributes(&self) -> Vec<(String, Value)> {
        let deadline = self
            .deadline
            .map(|deadline| ("deadline", Value::F64(deadline.seconds())));
        let others = [
            ("status", MissionStatus::Queued.name().into()),
            ("goal", self.goal.as_str().into()),
            ("priority", Value::I64(self.priority)),
            ("preemption", self.preemption.name().into()),
            ("request", "".into()),
            ("replans", Value::U64(0)),
            ("reason", "".into()),
        ];
        others
            .into_iter()
            .chain(deadline)
            .chain(self.schedule.attributes())
            .map(|(name, value)| (name.to_owned(), value))
            .collect()
    }
}

/// Makes plans.
pub trait Planner {
    /// A plan from the snapshot to the goal, or why there is none. Once `interrupted` says so, it
    /// ends at once, as at a limit.
    ///
    /// # Errors
    /// [`ReadError`] where the snapshot cannot be read.
    fn plan(
        &self,
        grammar: &Grammar,
        snapshot: &Snapshot,
        goal: &Goal,
        options: &Options,
        interrupted: &dyn Fn() -> bool,
    ) -> Result<Outcome, ReadError>;
}

/// The planner of this package, [`crate::plan`], held to a number of states, so that planning ends
/// without a clock and a run can be repeated to the bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RulePlanner {
    /// So many states are expanded at the most.
    pub expansions: u64,
}

impl Default for RulePlanner {
    fn default() -> Self {
        Self { expansions: 20_000 }
    }
}

impl Planner for RulePlanner {
    fn plan(
        &self,
        grammar: &Grammar,
        snapshot: &Snapshot,
        goal: &Goal,
        options: &Options,
        interrupted: &dyn Fn() -> bool,
    ) -> Result<Outcome, ReadError> {
        let elapsed = || if interrupted() { f64::INFINITY } else { 0.0 };
        let limits = Limits::new().with_expansions(self.expansions);
        let mut limits = limits.with_clock(f64::MAX, elapsed);
        crate::plan(grammar, snapshot, goal, options, &mut limits)
    }
}

/// What the executive can be told once, before it starts.
#[derive(Debug, Clone, PartialEq)]
pub struct Config {
    /// How to plan; what failed lately is made dearer besides.
    pub options: Options,
    /// Without a plan it tries again after this, seconds ...
    pub retry: f64,
    /// ... and fails the mission after this, seconds: what perception has not seen by then it does
    /// not wait for.
    pub patience: f64,
    /// Plans follow one another no faster than this, seconds.
    pub pause: f64,
    /// What a step that failed costs more, per failure ...
    pub penalty: f64,
    /// ... for so long, seconds. Within that time ...
    pub memory: f64,
    /// ... a step that failed so often is left out.
    pub tries: usize,
    /// An agent without which there is no plan is asked again for so long since it first left a step
    /// unanswered, seconds.
    pub silence: f64,
    /// So many steps that are over stay in the graph, per mission.
    pub history: usize,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            // A robot that waits for the best plan does nothing meanwhile.
            options: Options {
                effort: Effort::First,
                ..Options::default()
            },
            retry: 1.0,
            patience: 15.0,
            pause: 0.5,
            penalty: 100.0,
            memory: 600.0,
            tries: 3,
            silence: 60.0,
            history: 100,
        }
    }
}

/// A decision of the executive.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// When.
    pub time: Time,
    /// What it decided.
    pub what: String,
    /// Why; empty where that is plain.
    pub why: String,
}
