//! What comes to missions from outside: requests, deadlines, and missions of higher priority. This
//! file guarantees that a step of a mission that no longer has the robot is dropped in the
//! transaction that takes the robot away.

use super::decision::Occasion;
use super::record::{self, Mission, Request};
use super::{Executive, MissionStatus, Planner, Preemption, drop_open};
use dsr::{ReadError, Snapshot, Time, Transaction};

impl<P: Planner> Executive<P> {
    /// Does what was asked, ends what is late, and takes the robot from a mission for a more
    /// important one; `missions` are as they stand thereafter.
    pub(super) fn attend(
        &mut self,
        now: Time,
        snapshot: &Snapshot,
        missions: &mut [Mission],
    ) -> Result<Vec<Transaction>, ReadError> {
        let mut transactions = Vec::new();
        let mut write = |before: &Mission, after: &mut Mission| {
            transactions.extend(record::difference(before, after, snapshot.version()));
            after.steps.clear();
        };
        for mission in missions.iter_mut() {
            let late = !mission.status.is_over()
                && mission.deadline.is_some_and(|deadline| now > deadline);
            let again = mission.is_due_again(now);
            if mission.request.is_empty() && !late && !again {
                continue;
            }
            mission.steps = record::steps(snapshot, mission.id)?;
            let before = mission.clone();
            self.answer(now, mission);
            if again && mission.is_due_again(now) {
                mission.begin_again(now);
                let why = mission.reason.clone();
                mission.note(now, mission.status.name(), &Occasion::new(&why));
                self.log(now, format!("mission `{}` is queued", mission.name), why);
            }
            if late && !mission.status.is_over() {
                let open = mission.steps.iter().find(|step| step.status.is_open());
                let why = match open {
                    Some(step) => {
                        format!(
                            "its deadline passed while {step} was {}",
                            step.status.name()
                        )
                    }
                    None => "its deadline passed".to_owned(),
                };
                self.finish(now, mission, MissionStatus::Failed, &why);
            }
            write(&before, mission);
        }
        let Some(at) = missions
            .iter()
            .position(|mission| mission.status == MissionStatus::Running)
        else {
            return Ok(transactions);
        };
        let running = &missions[at];
        let urgent = missions
            .iter()
            .filter(|mission| {
                mission.is_ready(now, missions) && mission.priority > running.priority
            })
            .min_by_key(|mission| self.rank(mission));
        let Some(urgent) = urgent.map(|mission| mission.name.clone()) else {
            return Ok(transactions);
        };
        let running = &mut missions[at];
        running.steps = record::steps(snapshot, running.id)?;
        let in_hand = running.steps.iter().any(|step| step.status.is_under_way());
        let gives_way = match running.preemption {
            Preemption::AtOnce => true,
            Preemption::BetweenSteps => !in_hand,
            Preemption::Never => false,
        };
        if gives_way {
            let before = running.clone();
            let why = format!("mission `{urgent}` comes first");
            self.interrupt(now, running, MissionStatus::Queued, &why);
            write(&before, running);
        }
        Ok(transactions)
    }

    /// Does what is asked of a mission, as far as it makes sense.
    fn answer(&mut self, now: Time, mission: &mut Mission) {
        let request = std::mem::take(&mut mission.request);
        if request.is_empty() {
            return;
        }
        match (Request::find(&request), mission.status) {
            (Some(Request::Cancel), _) if mission.can_be_cancelled() => {
                let why = "cancelled on request";
                self.finish(now, mission, MissionStatus::Cancelled, why);
            }
            (Some(Request::Pause), MissionStatus::Queued | MissionStatus::Running) => {
                self.interrupt(now, mission, MissionStatus::Paused, "paused on request");
            }
            (Some(Request::Resume), MissionStatus::Paused) => {
                self.interrupt(now, mission, MissionStatus::Queued, "resumed on request");
            }
            (Some(_), status) => {
                let what = format!("mission `{}` stays {}", mission.name, status.name());
                self.log(now, what, format!("`{request}` makes no sense"));
            }
            (None, _) => {
                let what = format!("mission `{}` goes on", mission.name);
                self.log(now, what, format!("`{request}` is no request"));
            }
        }
    }

    /// Takes the robot from a mission that is not over.
    fn interrupt(&mut self, now: Time, mission: &mut Mission, status: MissionStatus, why: &str) {
        drop_open(now, mission, why, None);
        mission.status = status;
        why.clone_into(&mut mission.reason);
        mission.note(now, status.name(), &Occasion::new(why));
        let what = format!("mission `{}` is {}", mission.name, status.name());
        self.log(now, what, why);
    }
}

#[cfg(test)]
mod tests;
