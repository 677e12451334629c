//! Which commit came in a plan's way. This file guarantees that the commit it names is the last one
//! before which the plan did not have this trouble.

use super::decision::{Cause, Occasion};
use super::record::{Mission, Step};
use super::{Executive, Planner, Turn};
use dsr::{ReadError, Version};

/// So many versions are looked back at the most.
const FAR: u64 = 256;

impl<P: Planner> Executive<P> {
    /// Why a plan with the steps `open` cannot go on, with the commit since which it cannot. It is
    /// looked for once, as long as the trouble lasts.
    pub(super) fn occasion(
        &mut self,
        turn: Turn,
        open: &[Step],
        why: &str,
    ) -> Result<Occasion, ReadError> {
        if let Some(traced) = self.search.traced.as_ref().filter(|known| known.why == why) {
            return Ok(traced.clone());
        }
        let newest = turn.snapshot.version().0;
        let sound = self.search.sound.map_or(0, |version| version.0);
        let mut occasion = Occasion::new(why);
        for version in (newest.saturating_sub(FAR)..newest).rev() {
            // Another trouble, or none: the next commit brought this one.
            let had_it = || {
                let past = turn.snapshot.at(Version(version))?;
                let judged = self
                    .monitor
                    .judge(&self.grammar, &past, turn.now, open, turn.goal);
                judged.map(|report| report.trouble() == Some(why))
            };
            match had_it() {
                Ok(true) if version > sound => {}
                Ok(_) => {
                    occasion.cause = Cause::find(turn.snapshot, Version(version + 1))?;
                    break;
                }
                Err(ReadError::SnapshotTooOld { .. }) => break,
                Err(error) => return Err(error),
            }
        }
        self.search.traced = Some(occasion.clone());
        Ok(occasion)
    }

    /// Nothing was in the plan's way in the version of this turn.
    pub(super) fn is_sound(&mut self, turn: Turn) {
        self.search.sound = Some(turn.snapshot.version());
        self.search.traced = None;
    }
}

/// Why the plan in force is over, if its agent has given up a step of it.
pub(super) fn given_up(turn: Turn, mission: &Mission) -> Result<Option<Occasion>, ReadError> {
    let first = mission.steps.iter().position(|step| step.status.is_open());
    let first = first.unwrap_or(mission.steps.len());
    let under_way = |step: &Step| step.status.is_under_way();
    if mission.steps.get(first).is_some_and(under_way) {
        return Ok(None);
    }
    let last = first
        .checked_sub(1)
        .and_then(|last| mission.steps.get(last));
    let failed = last.filter(|last| last.status.is_failure());
    let Some(failed) = failed else {
        return Ok(None);
    };
    let written = match failed.id {
        Some(id) => status_version(turn, id)?,
        None => None,
    };
    Ok(Some(Occasion {
        why: format!("{failed} {}: {}", failed.status.name(), failed.reason),
        cause: match written {
            Some(version) => Cause::find(turn.snapshot, version)?,
            None => None,
        },
    }))
}

/// The version that wrote a step's status.
fn status_version(turn: Turn, step: dsr::NodeId) -> Result<Option<Version>, ReadError> {
    let Some(name) = turn.snapshot.schema().find_attribute("status") else {
        return Ok(None);
    };
    let Some(node) = turn.snapshot.find_node(step)? else {
        return Ok(None);
    };
    Ok(node.attribute(name)?.map(|status| status.version))
}

#[cfg(test)]
mod tests;
