//! The missions with their plans and what was decided about them, as JSON that recordings and the
//! inspector share.

use dsr::{ReadError, Snapshot};
use executive::{Mission, MissionStep};
use serde_json::{Value as Json, json};

/// All missions with their steps, by name.
///
/// # Errors
/// [`ReadError`].
pub(crate) fn missions(snapshot: &Snapshot) -> Result<Json, ReadError> {
    let missions = executive::missions_with_steps(snapshot)?;
    Ok(missions.iter().map(mission).collect())
}

fn mission(mission: &Mission) -> Json {
    json!({
        "name": mission.name, "status": mission.status.name(), "reason": mission.reason,
        "goal": mission.goal, "priority": mission.priority, "replans": mission.replans,
        "deadline": mission.deadline.map(dsr::Time::seconds),
        "steps": mission.steps.iter().map(step).collect::<Vec<_>>(),
        "decisions": mission.decisions(),
    })
}

fn step(step: &MissionStep) -> Json {
    json!({
        "name": step.name, "index": step.index, "rule": step.rule, "agent": step.agent,
        "binding": step.binding, "status": step.status.name(),
        "since": step.since.seconds(), "reason": step.reason,
    })
}
