//! How a mission gets its plan: the planner is asked, with what failed lately made dear, and the
//! answer becomes steps. This file guarantees that a step under way which the new plan begins with
//! too goes on as the same node, and that no two steps of a mission ever have the same name.

use super::decision::Occasion;
use super::failures::{Failures, Silent};
use super::outcomes;
use super::record::{Mission, Step};
use super::{Executive, MissionStatus, Planner, StepStatus, Turn, drop_open};
use crate::{Outcome, Status};
use dsr::{ReadError, Time};
use std::collections::BTreeSet;

/// What came of seeking a plan.
pub(super) enum Sought {
    /// Steps to be adopted; they have no names or indices yet.
    Plan(Vec<Step>),
    /// There is none, and why.
    Nothing(String),
    /// There is none, why, and it has been waited for long enough.
    Never(String),
    /// The last one was sought too short a time ago, or seeking it was interrupted.
    NotNow,
}

impl<P: Planner> Executive<P> {
    /// Seeks a plan for the mission.
    pub(super) fn seek(&mut self, turn: Turn, mission: &Mission) -> Result<Sought, ReadError> {
        if self.search.not_before.is_some_and(|time| turn.now < time) {
            return Ok(Sought::NotNow);
        }
        let recent = outcomes::recent(turn.snapshot)?;
        let failures = Failures::of(&mission.steps, &recent, turn.now, &self.config);
        let grammar = outcomes::learned(&self.grammar, &recent);
        let plan = |silent: Silent| {
            let mut options = self.config.options.clone();
            let raised = failures.raised(&self.grammar, &self.config, silent);
            options.raised.extend(raised);
            self.planner.plan(
                &grammar,
                turn.snapshot,
                turn.goal,
                &options,
                turn.interrupted,
            )
        };
        let mut outcome = plan(Silent::LeftOut)?;
        let mut given_up = false;
        let left_out = failures.leaves_out_agents(&self.config);
        if outcome.status != Status::Solved && left_out && !(turn.interrupted)() {
            let asking = plan(Silent::Asked)?;
            let is_way = asking.status == Status::Solved;
            if is_way && failures.may_ask_again(turn.now, &self.config) {
                outcome = asking;
            } else {
                given_up = is_way;
            }
        }
        if outcome.status == Status::Limit && (turn.interrupted)() {
            return Ok(Sought::NotNow);
        }
        let sought = match outcome.status {
            Status::Solved => steps(turn.now, &outcome),
            Status::Unsolvable | Status::Limit => {
                let reason = outcome.reason.unwrap_or_default();
                let mut words = vec![format!("no plan: {reason}")];
                words.extend(failures.left_out(&self.config));
                let words = words.join("; ");
                if given_up {
                    Sought::Never(words)
                } else {
                    Sought::Nothing(words)
                }
            }
        };
        let found = matches!(sought, Sought::Plan(_));
        let wait = if found {
            self.config.pause
        } else {
            self.config.retry
        };
        self.search.not_before = Some(turn.now + wait);
        Ok(sought)
    }

    /// Puts a new plan into force.
    pub(super) fn adopt(
        &mut self,
        now: Time,
        mission: &mut Mission,
        mut planned: Vec<Step>,
        occasion: &Occasion,
    ) {
        let why = occasion.why.as_str();
        let again = !mission.steps.is_empty();
        mission.replans += u64::from(again);
        mission.status = MissionStatus::Running;
        why.clone_into(&mut mission.reason);
        let mut index = mission.steps.last().map_or(0, |step| step.index + 1);
        let attempt = mission.replans + 1;
        let words: Vec<String> = planned.iter().map(ToString::to_string).collect();
        let what = format!(
            "mission `{}` has plan {attempt}: {}",
            mission.name,
            words.join(", ")
        );
        self.log(now, what, why);
        mission.note(now, format!("plan {attempt}"), occasion);

        let in_hand = mission.steps.iter().position(|step| step.status.is_open());
        let kept = in_hand.filter(|&place| {
            let (step, first) = (&mission.steps[place], &planned[0]);
            step.status.is_under_way() && step.rule == first.rule && step.binding == first.binding
        });
        drop_open(
            now,
            mission,
            why,
            kept.map(|place| mission.steps[place].index),
        );
        match kept {
            Some(place) => {
                // Last in the order, so that it stands right before the rest of its new plan.
                let mut step = mission.steps.remove(place);
                step.index = index;
                mission.steps.push(step);
                planned.remove(0);
                index += 1;
            }
            None => {
                planned[0].status = StepStatus::Dispatched;
                let what = format!("{} is dispatched to {}", planned[0], planned[0].agent);
                self.log(now, what, "");
            }
        }
        for mut step in planned {
            step.name = format!("{}/{attempt}/{index}", mission.name);
            step.index = index;
            index += 1;
            mission.steps.push(step);
        }
        let over = mission
            .steps
            .iter()
            .filter(|step| !step.status.is_open())
            .count();
        let mut surplus = over.saturating_sub(self.config.history);
        mission.steps.retain(|step| {
            let goes = surplus > 0 && !step.status.is_open();
            surplus -= usize::from(goes);
            !goes
        });
        self.search.fruitless = None;
        self.search.warned = false;
        self.search.sound = None;
        self.search.traced = None;
    }
}

/// The steps of a plan, for the graph.
fn steps(now: Time, plan: &Outcome) -> Sought {
    if plan.steps.is_empty() {
        let reason = "no plan: the planner takes the goal to hold, the graph does not";
        return Sought::Nothing(reason.to_owned());
    }
    let created: BTreeSet<&String> = plan
        .steps
        .iter()
        .flat_map(|planned| planned.creates.values())
        .collect();
    let mut steps = Vec::new();
    for planned in &plan.steps {
        let Some(agent) = &planned.agent else {
            let rule = &planned.rule;
            let reason = format!("no plan: `{rule}` names no agent that would carry it out");
            return Sought::Nothing(reason);
        };
        // Nodes that earlier steps create have no name yet; they are chosen at dispatch.
        let there = planned
            .binding
            .iter()
            .filter(|(_, node)| !created.contains(node));
        steps.push(Step {
            id: None,
            name: String::new(),
            index: 0,
            rule: planned.rule.clone(),
            agent: agent.clone(),
            binding: there.map(|(v, node)| (v.clone(), node.clone())).collect(),
            status: StepStatus::Pending,
            since: now,
            reason: String::new(),
        });
    }
    Sought::Plan(steps)
}
