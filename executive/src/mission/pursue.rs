//! What becomes of the mission in hand in one turn. This file owns the decisions: when a mission is
//! over, when its plan goes on, when another is sought, and when it is given up.

use super::adopt::Sought;
use super::record::{Mission, Step};
use super::{Executive, MissionStatus, Planner, StepStatus, Turn, drop_open};
use crate::monitor::{Finding, Report};
use dsr::{ReadError, Snapshot, Time};
use grammar::MatchError;

impl<P: Planner> Executive<P> {
    /// Brings a mission on, as a record.
    pub(super) fn pursue(
        &mut self,
        now: Time,
        snapshot: &Snapshot,
        mission: &mut Mission,
    ) -> Result<(), ReadError> {
        let goal = match self.goal(&mission.goal) {
            Ok(goal) => goal,
            Err(why) => {
                self.finish(now, mission, MissionStatus::Failed, &why);
                return Ok(());
            }
        };
        let turn = Turn {
            now,
            snapshot,
            goal: &goal,
        };
        match self.grammar.goal_holds(snapshot, &goal) {
            Ok(None) => {}
            Ok(Some(_)) => {
                let open = open(mission);
                let judged = self
                    .monitor
                    .judge(&self.grammar, snapshot, now, &open, &goal)?;
                self.tick_off(now, mission, judged.over);
                self.finish(now, mission, MissionStatus::Succeeded, "the goal holds");
                return Ok(());
            }
            Err(MatchError::Read(error)) => return Err(error),
            Err(other) => {
                self.finish(now, mission, MissionStatus::Failed, &other.to_string());
                return Ok(());
            }
        }
        if mission.status == MissionStatus::Queued {
            mission.status = MissionStatus::Running;
            self.log(now, format!("mission `{}` begins", mission.name), "");
        }
        if let Some(why) = given_up(mission) {
            return self.replan(turn, mission, &why);
        }
        let open = open(mission);
        if open.is_empty()
            && mission
                .steps
                .last()
                .is_none_or(|s| s.status == StepStatus::Dropped)
        {
            let why = self.search.why.clone();
            return self.replan(turn, mission, &why);
        }
        let Report { over, next } =
            self.monitor
                .judge(&self.grammar, snapshot, now, &open, &goal)?;
        self.tick_off(now, mission, over);
        match next {
            Finding::Finished => {
                let obstacle = self.grammar.goal_obstacle(snapshot, &goal);
                let obstacle = obstacle
                    .ok()
                    .flatten()
                    .map_or_else(String::new, |o| format!(": {o}"));
                let why = format!("the plan was carried out and the goal does not hold{obstacle}");
                self.replan(turn, mission, &why)
            }
            Finding::Broken(why) => self.replan(turn, mission, &why),
            Finding::TimedOut(why) => {
                if let Some(step) = mission.steps.iter_mut().find(|step| step.status.is_open()) {
                    step.become_status(StepStatus::Failed, &why, now);
                    let why = format!("{step} failed: {why}");
                    return self.replan(turn, mission, &why);
                }
                Ok(())
            }
            Finding::Sound { dispatch, ahead } => {
                match ahead {
                    Some(why) if self.replace(turn, mission, &why)? => return Ok(()),
                    None if std::mem::take(&mut self.search.warned) => mission.reason.clear(),
                    _ => {}
                }
                if let Some(binding) = dispatch {
                    self.dispatch(now, mission, binding);
                }
                Ok(())
            }
        }
    }

    /// Plans anew where the plan in force, if there is one, cannot go on.
    fn replan(&mut self, turn: Turn, mission: &mut Mission, why: &str) -> Result<(), ReadError> {
        why.clone_into(&mut self.search.why);
        match self.seek(turn, mission)? {
            Sought::Plan(steps) => self.adopt(turn.now, mission, steps, why),
            Sought::Nothing(reason) => {
                drop_open(turn.now, mission, why, None);
                let since = *self.search.fruitless.get_or_insert(turn.now);
                if turn.now.since(since) >= self.config.patience {
                    self.finish(turn.now, mission, MissionStatus::Failed, &reason);
                } else if mission.reason != reason {
                    mission.reason.clone_from(&reason);
                    self.log(
                        turn.now,
                        format!("mission `{}` waits", mission.name),
                        reason,
                    );
                }
            }
            Sought::NotNow => drop_open(turn.now, mission, why, None),
        }
        Ok(())
    }

    /// Plans anew where the plan in force will come to nothing; whether there is another. If there
    /// is none, the step in hand goes on: what is in the way may go before its turn comes.
    fn replace(&mut self, turn: Turn, mission: &mut Mission, why: &str) -> Result<bool, ReadError> {
        match self.seek(turn, mission)? {
            // The planner sees a way where the monitor does not: the planner looks closer.
            Sought::Plan(steps) if same(&steps, &open(mission)) => Ok(false),
            Sought::Plan(steps) => {
                self.adopt(turn.now, mission, steps, why);
                Ok(true)
            }
            Sought::Nothing(reason) => {
                let reason = format!("{why}; {reason}");
                self.search.warned = true;
                if mission.reason != reason {
                    mission.reason.clone_from(&reason);
                    self.log(turn.now, "the step in hand goes on".to_owned(), reason);
                }
                Ok(false)
            }
            Sought::NotNow => Ok(false),
        }
    }
}

fn open(mission: &Mission) -> Vec<Step> {
    mission
        .steps
        .iter()
        .filter(|step| step.status.is_open())
        .cloned()
        .collect()
}

/// Whether two plans have the same steps.
fn same(one: &[Step], other: &[Step]) -> bool {
    let step = |(a, b): (&Step, &Step)| a.rule == b.rule && a.binding == b.binding;
    one.len() == other.len() && one.iter().zip(other).all(step)
}

/// Why the plan in force is over, if its agent has given up a step of it.
fn given_up(mission: &Mission) -> Option<String> {
    let first = mission.steps.iter().position(|step| step.status.is_open());
    let first = first.unwrap_or(mission.steps.len());
    if mission
        .steps
        .get(first)
        .is_some_and(|step| step.status.is_under_way())
    {
        return None;
    }
    let last = mission.steps.get(first.checked_sub(1)?)?;
    (last.status == StepStatus::Failed).then(|| format!("{last} failed: {}", last.reason))
}
