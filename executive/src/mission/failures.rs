//! What went wrong lately with the steps of a mission: those that failed, and agents that did not take
//! what they were given. This file guarantees that an agent is waited for no more often than a step is
//! tried where there is another way, however many steps there are that it could be given.

use super::Config;
use super::record::{Step, StepStatus};
use crate::Raised;
use dsr::Time;
use grammar::Grammar;
use std::collections::{BTreeMap, BTreeSet};

/// What went wrong lately, the newest of each kind with how often it did.
#[derive(Debug)]
pub(super) struct Failures<'a> {
    /// Rules at bindings that failed.
    steps: Vec<(&'a Step, usize)>,
    /// Steps that their agents did not take, one for each agent that has taken none since, and how many there
    /// were of this mission: none where other missions tell of the agent.
    unanswered: Vec<(&'a Step, usize)>,
    /// When the first and the last of those of this mission were given up.
    silent: Option<(Time, Time)>,
}

/// What becomes of an agent that left as many steps unanswered as a step is tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Silent {
    /// Plans do without it.
    LeftOut,
    /// It is asked where there is no other way.
    Asked,
}

impl<'a> Failures<'a> {
    /// What went wrong with the steps of a mission, and what the `recent` ones of all missions tell of agents,
    /// within the executive's memory.
    pub(super) fn of(own: &'a [Step], recent: &'a [Step], now: Time, config: &Config) -> Self {
        let mut failures = Self {
            steps: Vec::new(),
            unanswered: Vec::new(),
            silent: None,
        };
        let others = recent
            .iter()
            .filter(|step| !own.iter().any(|own| own.name == step.name));
        let others = others.map(|step| (step, 0));
        let mut all: Vec<(&Step, usize)> = others.chain(own.iter().map(|step| (step, 1))).collect();
        all.retain(|(step, _)| now.since(step.since) <= config.memory);
        all.sort_by_key(|(step, _)| step.since);
        let mut answering = BTreeSet::new();
        for (step, counts) in all.into_iter().rev() {
            match step.status {
                StepStatus::Failed => {
                    answering.insert(&step.agent);
                    if counts > 0 {
                        count(&mut failures.steps, step, 1, Step::is_alike);
                    }
                }
                StepStatus::Done | StepStatus::Running => {
                    answering.insert(&step.agent);
                }
                StepStatus::Unanswered if !answering.contains(&step.agent) => {
                    count(&mut failures.unanswered, step, counts, |a, b| {
                        a.agent == b.agent
                    });
                    if counts > 0 {
                        let last = failures.silent.map_or(step.since, |(_, last)| last);
                        failures.silent = Some((step.since, last));
                    }
                }
                _ => {}
            }
        }
        failures
    }

    /// What shall cost more in the next plan, or be left out.
    pub(super) fn raised(&self, grammar: &Grammar, config: &Config, silent: Silent) -> Vec<Raised> {
        let by = |times: usize, may_be_left_out: bool| {
            if may_be_left_out && times >= config.tries {
                f64::INFINITY
            } else {
                config.penalty * times.max(1) as f64
            }
        };
        let steps = self.steps.iter().map(|&(step, times)| Raised {
            rule: step.rule.clone(),
            binding: step.binding.clone(),
            by: by(times, true),
        });
        let agents = self.unanswered.iter().flat_map(|&(step, times)| {
            let rules = grammar.rules.iter();
            let rules = rules.filter(|rule| rule.agent.as_deref() == Some(step.agent.as_str()));
            rules.map(move |rule| Raised {
                rule: rule.name.to_string(),
                binding: BTreeMap::new(),
                by: by(times, silent == Silent::LeftOut),
            })
        });
        steps.chain(agents).collect()
    }

    /// Whether agents that are left out may be asked again, where there is no other way: so long since the first
    /// silence, and after a pause.
    pub(super) fn may_ask_again(&self, now: Time, config: &Config) -> bool {
        self.silent.is_some_and(|(first, last)| {
            now.since(first) < config.silence || now.since(last) > config.patience
        })
    }

    /// Whether agents are left out.
    pub(super) fn leaves_out_agents(&self, config: &Config) -> bool {
        too_often(&self.unanswered, config).next().is_some()
    }

    /// What is left out of the next plan, in words.
    pub(super) fn left_out<'s>(&'s self, config: &Config) -> impl Iterator<Item = String> + 's {
        let steps = too_often(&self.steps, config);
        let steps =
            steps.map(|(step, times)| format!("{step} failed {times} times: {}", step.reason));
        let agents = too_often(&self.unanswered, config);
        steps.chain(agents.map(|(step, times)| {
            let agent = &step.agent;
            format!("agent {agent} did not take {times} steps, the last of them {step}")
        }))
    }
}

/// Those that went wrong as often as a step is tried.
fn too_often<'s>(
    known: &'s [(&'s Step, usize)],
    config: &Config,
) -> impl Iterator<Item = &'s (&'s Step, usize)> + use<'s> {
    let tries = config.tries;
    known.iter().filter(move |(_, times)| *times >= tries)
}

/// Counts a step with the one of its kind.
fn count<'a>(
    known: &mut Vec<(&'a Step, usize)>,
    step: &'a Step,
    by: usize,
    same: fn(&Step, &Step) -> bool,
) {
    match known.iter_mut().find(|(known, _)| same(known, step)) {
        Some((_, times)) => *times += by,
        None => known.push((step, by)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use expect_test::expect;

    /// Steps of two agents, as they stand, one a second: the last is the newest.
    fn failures(outcomes: &[(&str, &str, StepStatus)]) -> String {
        let step = |(second, &(agent, room, status)): (usize, &(&str, &str, StepStatus))| Step {
            id: None,
            name: second.to_string(),
            index: second as u64,
            rule: format!("{agent}s"),
            agent: agent.to_owned(),
            binding: [("room".to_owned(), room.to_owned())].into(),
            status,
            since: Time::from_seconds(1000.0 + second as f64),
            reason: "why".to_owned(),
        };
        let steps: Vec<Step> = outcomes.iter().enumerate().map(step).collect();
        let rules = "name=carry\n===\ntypes { (room) }\n===\n
            walks : active(1) agent(walk) { { room:room } => { room:room } }
            drives : active(1) agent(drive) { { room:room } => { room:room } }
            moves : active(1) agent(drive) { { room:room } => { room:room } }\n";
        let rules = crate::testing::read(rules);
        let config = Config::default();
        let now = Time::from_seconds(1100.0);
        let failures = Failures::of(&steps, &[], now, &config);
        let raised = failures
            .raised(&rules, &config, Silent::LeftOut)
            .into_iter();
        let raised = raised.map(|one| format!("{} {:?} by {}", one.rule, one.binding, one.by));
        let lines: Vec<String> = raised.chain(failures.left_out(&config)).collect();
        lines.join("\n")
    }

    #[test]
    fn an_agent_that_takes_nothing_is_left_out_with_all_its_rules() {
        use StepStatus::{Done, Failed, Unanswered};
        let twice = [
            ("drive", "hall", Unanswered),
            ("drive", "attic", Unanswered),
        ];
        expect![[r"
            drives {} by 200
            moves {} by 200"]]
        .assert_eq(&failures(&twice));
        let thrice = [
            &twice[..],
            &[("drive", "ward", Unanswered), ("walk", "hall", Failed)],
        ];
        expect![[r#"
            walks {"room": "hall"} by 100
            drives {} by inf
            moves {} by inf
            agent drive did not take 3 steps, the last of them drives(room=ward)"#]]
        .assert_eq(&failures(&thrice.concat()));
        // One that takes a step again is there.
        for taken in [Done, Failed] {
            let again = [&thrice.concat()[..], &[("drive", "hall", taken)]].concat();
            assert!(!failures(&again).contains("moves"), "{taken:?}");
        }
    }
}
