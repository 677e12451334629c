//! How a mission gets its plan: the planner is asked, with what failed lately made dear, and the
//! answer becomes steps. This file guarantees that a step under way which the new plan begins with
//! too goes on as the same node, and that no two steps of a mission ever have the same name.

use super::record::{Mission, Step};
use super::{Entry, Executive, MissionStatus, Planner, StepStatus, Turn, drop_open};
use crate::monitor::names;
use crate::{Options, Outcome, Plan};
use dsr::{NodeId, ReadError, Time};
use grammar::Binding;

/// What came of seeking a plan.
pub(super) enum Sought {
    /// Steps to be adopted; they have no names or indices yet.
    Plan(Vec<Step>),
    /// There is none, and why.
    Nothing(String),
    /// The last one was sought too short a time ago.
    NotNow,
}

/// What failed lately: a rule, where, and how often.
struct Failure {
    rule: String,
    binding: Vec<(String, NodeId)>,
    times: usize,
    reason: String,
}

impl<P: Planner> Executive<P> {
    /// Seeks a plan for the mission.
    pub(super) fn seek(&mut self, turn: Turn, mission: &Mission) -> Result<Sought, ReadError> {
        if self.search.not_before.is_some_and(|time| turn.now < time) {
            return Ok(Sought::NotNow);
        }
        let failures = self.failures(turn, mission)?;
        let mut options = self.config.options.clone();
        options.penalties.extend(failures.iter().map(|failure| {
            let extra = self.config.penalty * failure.times as f64;
            (failure.rule.clone(), failure.binding.clone(), extra)
        }));
        let sought = match self.outcome(turn, &options)? {
            Outcome::Solved(plan) => self.steps(turn, &plan, &failures)?,
            Outcome::Unsolvable { reason } => Sought::Nothing(format!("no plan: {reason}")),
            Outcome::Limit { reason } => Sought::Nothing(format!("no plan found: {reason}")),
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

    fn outcome(&self, turn: Turn, options: &Options) -> Result<Outcome, ReadError> {
        self.planner
            .plan(&self.grammar, turn.snapshot, turn.goal, options)
    }

    fn failures(&self, turn: Turn, mission: &Mission) -> Result<Vec<Failure>, ReadError> {
        let mut failures: Vec<Failure> = Vec::new();
        for step in &mission.steps {
            let past = turn.now.since(step.since) > self.config.memory;
            if step.status != StepStatus::Failed || past {
                continue;
            }
            let (binding, missing) = step.nodes(turn.snapshot)?;
            if !missing.is_empty() {
                continue;
            }
            let binding = pairs(&binding);
            let known = failures
                .iter_mut()
                .find(|failure| failure.rule == step.rule && same(&failure.binding, &binding));
            match known {
                Some(failure) => {
                    failure.times += 1;
                    failure.reason.clone_from(&step.reason);
                }
                None => failures.push(Failure {
                    rule: step.rule.clone(),
                    binding: self.ordered(&step.rule, binding),
                    times: 1,
                    reason: step.reason.clone(),
                }),
            }
        }
        Ok(failures)
    }

    /// A binding in the order of the rule's left side, as the planner has it.
    fn ordered(&self, rule: &str, mut binding: Vec<(String, NodeId)>) -> Vec<(String, NodeId)> {
        if let Some(rule) = self.grammar.rule(rule) {
            let place = |variable: &str| rule.bound_nodes().position(|n| n.variable == *variable);
            binding.sort_by_key(|(variable, _)| place(variable));
        }
        binding
    }

    fn steps(&self, turn: Turn, plan: &Plan, failures: &[Failure]) -> Result<Sought, ReadError> {
        if plan.steps.is_empty() {
            let reason = "no plan: the planner takes the goal to hold, the graph does not";
            return Ok(Sought::Nothing(reason.to_owned()));
        }
        let mut steps = Vec::new();
        for planned in &plan.steps {
            let agent = self
                .grammar
                .rule(&planned.rule)
                .and_then(|rule| rule.agent.as_ref());
            let Some(agent) = agent else {
                let rule = &planned.rule;
                let reason = format!("no plan: `{rule}` names no agent that would carry it out");
                return Ok(Sought::Nothing(reason));
            };
            let binding: Binding = planned
                .binding
                .iter()
                .map(|(v, node)| (v.as_str(), *node))
                .collect();
            let step = Step {
                id: None,
                name: String::new(),
                index: 0,
                rule: planned.rule.clone(),
                agent: agent.to_string(),
                binding: names(turn.snapshot, &binding)?,
                status: StepStatus::Pending,
                since: turn.now,
                reason: String::new(),
            };
            let failed = failures.iter().find(|failure| {
                failure.rule == planned.rule
                    && same(&failure.binding, &planned.binding)
                    && failure.times >= self.config.tries
            });
            if let Some(Failure { times, reason, .. }) = failed {
                let reason =
                    format!("no plan without {step}, which failed {times} times: {reason}");
                return Ok(Sought::Nothing(reason));
            }
            steps.push(step);
        }
        Ok(Sought::Plan(steps))
    }

    /// Puts a new plan into force.
    pub(super) fn adopt(
        &mut self,
        now: Time,
        mission: &mut Mission,
        mut planned: Vec<Step>,
        why: &str,
    ) {
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
        self.journal.push(Entry {
            time: now,
            what,
            why: why.to_owned(),
        });

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
            None => planned[0].status = StepStatus::Dispatched,
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
    }
}

fn pairs(binding: &Binding) -> Vec<(String, NodeId)> {
    binding
        .iter()
        .map(|(variable, node)| (variable.to_string(), node))
        .collect()
}

/// Whether two bindings are the same, in whatever order.
fn same(one: &[(String, NodeId)], other: &[(String, NodeId)]) -> bool {
    one.len() == other.len() && one.iter().all(|pair| other.contains(pair))
}
