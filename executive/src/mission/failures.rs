//! What went wrong lately with the steps of a mission: those that failed, and agents that did not take
//! what they were given. This file guarantees that an agent is waited for as often as a step is tried,
//! however many steps there are that it could be given.

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
    /// Steps that their agents did not take, one for each agent that has taken none since.
    unanswered: Vec<(&'a Step, usize)>,
}

impl<'a> Failures<'a> {
    /// What went wrong with `steps`, oldest first, within the executive's memory.
    pub(super) fn of(steps: &'a [Step], now: Time, config: &Config) -> Self {
        let mut failures = Self {
            steps: Vec::new(),
            unanswered: Vec::new(),
        };
        let mut answering = BTreeSet::new();
        for step in steps.iter().rev() {
            if now.since(step.since) > config.memory {
                continue;
            }
            let (known, same): (_, fn(&Step, &Step) -> bool) = match step.status {
                StepStatus::Failed => (&mut failures.steps, Step::is_alike),
                StepStatus::Unanswered if !answering.contains(&step.agent) => {
                    (&mut failures.unanswered, |a, b| a.agent == b.agent)
                }
                StepStatus::Done | StepStatus::Running => {
                    answering.insert(&step.agent);
                    continue;
                }
                _ => continue,
            };
            if step.status == StepStatus::Failed {
                answering.insert(&step.agent);
            }
            match known.iter_mut().find(|(known, _)| same(known, step)) {
                Some((_, times)) => *times += 1,
                None => known.push((step, 1)),
            }
        }
        failures
    }

    /// What shall cost more in the next plan, or be left out.
    pub(super) fn raised(&self, grammar: &Grammar, config: &Config) -> Vec<Raised> {
        let by = |times: usize| {
            if times >= config.tries {
                f64::INFINITY
            } else {
                config.penalty * times as f64
            }
        };
        let steps = self.steps.iter().map(|&(step, times)| Raised {
            rule: step.rule.clone(),
            binding: step.binding.clone(),
            by: by(times),
        });
        let agents = self.unanswered.iter().flat_map(|&(step, times)| {
            let rules = grammar.rules.iter();
            let rules = rules.filter(|rule| rule.agent.as_deref() == Some(step.agent.as_str()));
            rules.map(move |rule| Raised {
                rule: rule.name.to_string(),
                binding: BTreeMap::new(),
                by: by(times),
            })
        });
        steps.chain(agents).collect()
    }

    /// What is left out of the next plan, in words.
    pub(super) fn left_out<'s>(&'s self, config: &Config) -> impl Iterator<Item = String> + 's {
        let tries = config.tries;
        let often = move |times: usize| times >= tries;
        let steps = self.steps.iter().filter(move |(_, times)| often(*times));
        let steps =
            steps.map(|(step, times)| format!("{step} failed {times} times: {}", step.reason));
        let agents = self
            .unanswered
            .iter()
            .filter(move |(_, times)| often(*times));
        steps.chain(agents.map(|(step, times)| {
            let agent = &step.agent;
            format!("agent {agent} did not take {times} steps, the last of them {step}")
        }))
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
        let failures = Failures::of(&steps, Time::from_seconds(1100.0), &config);
        let raised = failures.raised(&rules, &config).into_iter();
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
