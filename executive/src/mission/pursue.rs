//! What becomes of the mission in hand in one turn. This file owns the decisions: when a mission is
//! over, when its plan goes on, when another is sought, and when it is given up.

use super::adopt::Sought;
use super::culprit::given_up;
use super::decision::Occasion;
use super::record::{Mission, Step};
use super::{Executive, MissionStatus, Planner, StepStatus, Turn, drop_open};
use crate::monitor::{Finding, Interest, Report, shortcut};
use dsr::{ReadError, Snapshot, Time};
use grammar::MatchError;

impl<P: Planner> Executive<P> {
    /// Brings a mission on, as a record.
    pub(super) fn pursue(
        &mut self,
        now: Time,
        snapshot: &Snapshot,
        mission: &mut Mission,
        interrupted: &dyn Fn() -> bool,
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
            interrupted,
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
        if let Some(occasion) = given_up(turn, mission)? {
            return self.replan(turn, mission, &occasion);
        }
        self.follow(turn, mission)
    }

    /// Goes on with the plan in force, or seeks another.
    fn follow(&mut self, turn: Turn, mission: &mut Mission) -> Result<(), ReadError> {
        let Turn {
            now,
            snapshot,
            goal,
            ..
        } = turn;
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
                .judge(&self.grammar, snapshot, now, &open, goal)?;
        self.tick_off(now, mission, over);
        let may_pass = matches!(next, Finding::Broken(_) | Finding::Sound { .. });
        let next = if may_pass && !self.search.missed {
            let found = shortcut(&self.grammar, snapshot, now, &open[over..], goal)?;
            found.unwrap_or(next)
        } else {
            next
        };
        match next {
            Finding::Finished => {
                let obstacle = self.grammar.goal_obstacle(snapshot, goal);
                let obstacle = obstacle
                    .ok()
                    .flatten()
                    .map_or_else(String::new, |o| format!(": {o}"));
                let why = format!("the plan was carried out and the goal does not hold{obstacle}");
                self.search.missed = true;
                self.replan(turn, mission, &Occasion::new(&why))
            }
            Finding::Broken(why) => {
                let occasion = self.occasion(turn, &open, &why)?;
                self.replan(turn, mission, &occasion)
            }
            Finding::TimedOut(limit) => {
                let Some(step) = mission.steps.iter_mut().find(|step| step.status.is_open()) else {
                    return Ok(());
                };
                let (status, what) = match step.status {
                    StepStatus::Running => (StepStatus::Failed, "end"),
                    _ => (StepStatus::Unanswered, "take"),
                };
                let why = format!("{} did not {what} it in {limit:.0} s", step.agent);
                step.become_status(status, &why, now);
                let why = format!("{step} {}: {why}", status.name());
                self.replan(turn, mission, &Occasion::new(&why))
            }
            Finding::Shortcut { skipped, binding } => {
                self.is_sound(turn);
                self.skip(now, mission, skipped);
                self.dispatch(now, mission, binding);
                Ok(())
            }
            Finding::Sound { dispatch, ahead } => {
                match ahead {
                    Some(why) => {
                        let occasion = self.occasion(turn, &open, &why)?;
                        if self.replace(turn, mission, &occasion)? {
                            return Ok(());
                        }
                    }
                    None => {
                        self.is_sound(turn);
                        if std::mem::take(&mut self.search.warned) {
                            mission.reason.clear();
                        }
                    }
                }
                if let Some(binding) = dispatch {
                    self.dispatch(now, mission, binding);
                }
                Ok(())
            }
        }
    }

    /// What the next turn hangs on where nothing else happens to the mission.
    pub(super) fn interest(
        &mut self,
        snapshot: &Snapshot,
        mission: &Mission,
    ) -> Result<Interest, ReadError> {
        match self.goal(&mission.goal) {
            Ok(goal) => Interest::of(&self.grammar, snapshot, &open(mission), &goal),
            Err(_) => Ok(Interest::default()),
        }
    }

    /// Drops the first `skipped` open steps: the one after them is possible already.
    fn skip(&mut self, now: Time, mission: &mut Mission, skipped: usize) {
        let mut open = mission
            .steps
            .iter_mut()
            .filter(|step| step.status.is_open());
        let passed: Vec<&mut Step> = open.by_ref().take(skipped).collect();
        let Some(next) = open.next().map(|step| step.to_string()) else {
            return;
        };
        let why = format!("{next} is possible already");
        for step in passed {
            step.become_status(StepStatus::Dropped, &why, now);
        }
        let what = format!("{skipped} steps are left out");
        mission.note(now, what.clone(), &Occasion::new(&why));
        self.log(now, format!("mission `{}`: {what}", mission.name), why);
    }

    /// Plans anew where the plan in force, if there is one, cannot go on.
    fn replan(
        &mut self,
        turn: Turn,
        mission: &mut Mission,
        occasion: &Occasion,
    ) -> Result<(), ReadError> {
        let why = occasion.why.as_str();
        self.search.why.clone_from(occasion);
        match self.seek(turn, mission)? {
            Sought::Plan(steps) => self.adopt(turn.now, mission, steps, occasion),
            Sought::Never(reason) => {
                self.finish(turn.now, mission, MissionStatus::Failed, &reason);
            }
            Sought::Nothing(reason) => {
                drop_open(turn.now, mission, why, None);
                let since = *self.search.fruitless.get_or_insert(turn.now);
                if turn.now.since(since) >= self.config.patience {
                    self.finish(turn.now, mission, MissionStatus::Failed, &reason);
                } else if mission.reason != reason {
                    mission.reason.clone_from(&reason);
                    let noted = Occasion {
                        why: reason.clone(),
                        cause: occasion.cause.clone(),
                    };
                    mission.note(turn.now, "waits", &noted);
                    let what = format!("mission `{}` waits", mission.name);
                    self.log(turn.now, what, reason);
                }
            }
            Sought::NotNow => drop_open(turn.now, mission, why, None),
        }
        Ok(())
    }

    /// Plans anew where the plan in force will come to nothing; whether there is another. If there
    /// is none, the step in hand goes on: what is in the way may go before its turn comes.
    fn replace(
        &mut self,
        turn: Turn,
        mission: &mut Mission,
        occasion: &Occasion,
    ) -> Result<bool, ReadError> {
        match self.seek(turn, mission)? {
            // The planner sees a way where the monitor does not: the planner looks closer.
            Sought::Plan(steps) if same(&steps, &open(mission)) => Ok(false),
            Sought::Plan(steps) => {
                self.adopt(turn.now, mission, steps, occasion);
                Ok(true)
            }
            Sought::Nothing(reason) | Sought::Never(reason) => {
                let reason = format!("{}; {reason}", occasion.why);
                self.search.warned = true;
                if mission.reason != reason {
                    mission.reason.clone_from(&reason);
                    let what = "the step in hand goes on";
                    let noted = Occasion {
                        why: reason.clone(),
                        cause: occasion.cause.clone(),
                    };
                    mission.note(turn.now, what, &noted);
                    self.log(turn.now, what.to_owned(), reason);
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
    one.len() == other.len() && one.iter().zip(other).all(|(a, b)| a.is_alike(b))
}

#[cfg(test)]
mod tests;
