//! When missions begin: at a time, after another, again and again. This file guarantees that a mission
//! that recurs begins once in each of its periods, however late the executive looks, and not for
//! periods that are over.

use super::record::{Mission, MissionStatus};
use dsr::{Time, Value};

/// When a mission begins; at once where nothing is said.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Schedule {
    /// Not before this.
    pub begins: Option<Time>,
    /// Again each time so many seconds after it began, until it is cancelled.
    pub period: Option<f64>,
    /// Not until the mission of this name has succeeded.
    pub after: Option<String>,
}

impl Schedule {
    /// As attributes of the mission's node.
    pub(super) fn attributes(&self) -> impl Iterator<Item = (&'static str, Value)> {
        let begins = self.begins.map(|time| ("begins", time.seconds().into()));
        let period = self.period.map(|seconds| ("period", seconds.into()));
        let after = self.after.as_deref().map(|name| ("after", name.into()));
        [begins, period, after].into_iter().flatten()
    }
}

impl Mission {
    /// Whether it waits for the robot or has it, and its time has come.
    pub(super) fn is_ready(&self, now: Time, all: &[Self]) -> bool {
        let after = self.schedule.after.as_deref();
        let succeeded = |name: &str| {
            let mut others = all.iter();
            others.any(|m| m.name == name && m.status == MissionStatus::Succeeded)
        };
        match self.status {
            MissionStatus::Running => true,
            MissionStatus::Queued => {
                self.schedule.begins.is_none_or(|begins| begins <= now)
                    && after.is_none_or(succeeded)
            }
            _ => false,
        }
    }

    /// Whether it will begin again when its time comes, if it is over.
    pub fn recurs(&self) -> bool {
        self.schedule.period.is_some() && self.status != MissionStatus::Cancelled
    }

    /// Whether there is something to be cancelled.
    pub fn can_be_cancelled(&self) -> bool {
        !self.status.is_over() || self.recurs()
    }

    /// Whether it will not succeed any more.
    pub fn is_hopeless(&self) -> bool {
        let given_up = matches!(
            self.status,
            MissionStatus::Failed | MissionStatus::Cancelled
        );
        given_up && !self.recurs()
    }

    /// What became of it so far: `is running`, `has failed`.
    pub fn outcome(&self) -> String {
        let word = match self.status {
            MissionStatus::Succeeded | MissionStatus::Failed => "has",
            MissionStatus::Cancelled => "was",
            MissionStatus::Queued | MissionStatus::Running | MissionStatus::Paused => "is",
        };
        format!("{word} {}", self.status.name())
    }

    /// What it waits for while it is queued, `all` being the missions there are; `clock` writes a time.
    pub fn waits_for(
        &self,
        now: Time,
        all: &[Self],
        clock: impl Fn(Time) -> String,
    ) -> Vec<String> {
        if self.status != MissionStatus::Queued {
            return Vec::new();
        }
        let mut waits = Vec::new();
        if let Some(begins) = self.schedule.begins.filter(|begins| *begins > now) {
            waits.push(format!("until {}", clock(begins)));
        }
        if let Some(after) = &self.schedule.after {
            match all.iter().find(|mission| mission.name == *after) {
                Some(other) if other.status == MissionStatus::Succeeded => {}
                Some(other) if other.is_hopeless() => waits.push(format!(
                    "for {after}, which {} and does not begin again",
                    other.outcome()
                )),
                Some(other) => waits.push(format!("for {after}, which {}", other.outcome())),
                None => waits.push(format!("for {after}, and there is no mission of that name")),
            }
        }
        let running = |mission: &&Self| mission.status == MissionStatus::Running;
        if waits.is_empty()
            && let Some(other) = all.iter().find(running)
        {
            waits.push(format!("for the robot, which {} has", other.name));
        }
        waits
    }

    /// Whether it is over for this time, and its next time has come.
    pub(super) fn is_due_again(&self, now: Time) -> bool {
        let done = matches!(
            self.status,
            MissionStatus::Succeeded | MissionStatus::Failed
        );
        done && self.next_time(now).is_some()
    }

    /// When the period that `now` lies in began, if it is not the one the mission is in.
    fn next_time(&self, now: Time) -> Option<Time> {
        let (begins, period) = self.schedule.begins.zip(self.schedule.period)?;
        let periods = (now.since(begins) / period).floor();
        (period > 0.0 && periods >= 1.0).then(|| begins + periods * period)
    }

    /// Begins the next time.
    pub(super) fn begin_again(&mut self, now: Time) {
        if let (Some(begins), Some(next)) = (self.schedule.begins, self.next_time(now)) {
            self.deadline = self.deadline.map(|deadline| deadline + next.since(begins));
            self.schedule.begins = Some(next);
            self.status = MissionStatus::Queued;
            "its time has come again".clone_into(&mut self.reason);
            self.steps.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::mission::testing::{GO_TO_WARD, GREET_ANA, House};
    use crate::{Mission, MissionSpec, Preemption, Schedule};
    use dsr::Value;
    use expect_test::expect;

    /// A house in which the robot shall go to the ward, by a schedule in seconds from its start.
    fn house(begins: Option<f64>, period: Option<f64>, after: Option<&str>) -> House {
        let mut house = House::new(&[]);
        let spec = MissionSpec {
            name: "go".to_owned(),
            goal: GO_TO_WARD.to_owned(),
            priority: 0,
            deadline: None,
            preemption: Preemption::default(),
            schedule: Schedule {
                begins: begins.map(|seconds| house.now + seconds),
                period,
                after: after.map(str::to_owned),
            },
        };
        house.change(|transaction| {
            transaction.create_node("mission", "go", spec.attributes());
        });
        house
    }

    fn mission(house: &House) -> Mission {
        let missions = crate::missions(&house.graph.snapshot()).unwrap();
        missions.into_iter().find(|m| m.name == "go").unwrap()
    }

    fn waits(house: &House) -> String {
        let missions = crate::missions(&house.graph.snapshot()).unwrap();
        let clock = |time: dsr::Time| format!("{:.0} s", time.seconds());
        mission(house)
            .waits_for(house.now, &missions, clock)
            .join(", ")
    }

    #[test]
    fn a_mission_waits_for_its_time() {
        let mut house = house(Some(5.0), None, None);
        house.run(8);
        expect!["until 1005 s"].assert_eq(&waits(&house));
        expect!["queued, 0: "].assert_eq(&house.mission("go"));
        house.run(10);
        expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("go"));
    }

    #[test]
    fn a_mission_waits_for_the_success_of_another() {
        let mut house = house(None, None, Some("greet"));
        house.run(4);
        expect!["queued, 0: "].assert_eq(&house.mission("go"));
        expect!["for greet, and there is no mission of that name"].assert_eq(&waits(&house));
        house.submit("greet", GREET_ANA);
        house.run(4);
        expect!["for greet, which is running"].assert_eq(&waits(&house));
        house.run(20);
        assert_eq!(waits(&house), "");
        expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("go"));
    }

    #[test]
    fn who_waits_in_vain_or_for_the_robot_says_so() {
        let mut vain = house(None, None, Some("greet"));
        vain.submit("greet", GREET_ANA);
        vain.change(|transaction| transaction.set("greet", "request", "cancel"));
        vain.run(2);
        expect!["for greet, which was cancelled and does not begin again"].assert_eq(&waits(&vain));
        let mut second = house(None, None, None);
        second.submit("greet", GREET_ANA);
        second.change(|transaction| transaction.set("greet", "priority", Value::I64(2)));
        second.run(3);
        expect!["for the robot, which greet has"].assert_eq(&waits(&second));
    }

    #[test]
    fn a_mission_recurs_once_in_each_period_and_leaves_out_those_that_were_missed() {
        let mut house = house(Some(1.0), Some(20.0), None);
        let began = mission(&house).schedule.begins.unwrap();
        house.run(10);
        expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("go"));
        house.change(|transaction| {
            transaction.delete_edge("shelly", "in", "ward");
            transaction.create_edge("shelly", "in", "hall");
        });
        house.run(10);
        assert!(house.holds("shelly", "in", "hall"), "it is not due yet");
        house.now = house.now + 60.0;
        house.run(12);
        assert!(house.holds("shelly", "in", "ward"));
        expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("go"));
        let again = mission(&house).schedule.begins.unwrap();
        assert!((again.since(began) % 20.0).abs() < 1e-9);
        assert!((0.0..20.0).contains(&house.now.since(again)), "{again}");
        house.change(|transaction| transaction.set("go", "request", "cancel"));
        house.run(60);
        expect!["cancelled, 0: cancelled on request"].assert_eq(&house.mission("go"));
    }
}
