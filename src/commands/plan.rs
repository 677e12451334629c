//! `cortex plan`: the steps that lead from a world to a goal, or why there are none.

use super::graph::read_graph;
use super::output::{print, print_json};
use crate::cli::Plan as Arguments;
use crate::{Answer, Failure};
use executive::{Effort, Limits, Options, Outcome, Status, plan};
use serde_json::json;
use std::fmt::Write as _;
use std::time::Instant;

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let grammar = super::load_grammar(&super::read_text(&arguments.domain)?, &arguments.domain)?;
    let goal = super::read_text(&arguments.goal)?;
    let name = arguments.goal.display().to_string();
    let goal = grammar::parse_goal(&goal, &name, &grammar.types)
        .map_err(|defects| Failure::Input(defects.into()))?;
    let graph = read_graph(&arguments.world)?;
    let effort = match (arguments.optimal, arguments.time_limit) {
        (true, _) => Effort::Optimal,
        (false, Some(_)) => Effort::Anytime,
        (false, None) => Effort::First,
    };
    let options = Options {
        effort,
        ..Options::default()
    };
    let bytes = (arguments.memory_limit as usize).saturating_mul(1_000_000);
    #[allow(
        clippy::disallowed_methods,
        reason = "the verb tells how long planning took"
    )]
    let started = Instant::now();
    let mut limits = Limits::new().with_bytes(bytes);
    if let Some(seconds) = arguments.time_limit {
        limits = limits.with_clock(seconds, move || started.elapsed().as_secs_f64());
    }
    let outcome = plan(&grammar, &graph.snapshot(), &goal, &options, &mut limits);
    let outcome = outcome.map_err(Failure::internal)?;
    let seconds = started.elapsed().as_secs_f64();
    if arguments.json {
        let mut answer = json!(outcome);
        answer["seconds"] = json!(seconds);
        print_json(&answer)?;
    } else {
        print(&told(&outcome, seconds))?;
    }
    Ok(if outcome.status == Status::Solved {
        Answer::Yes
    } else {
        Answer::No
    })
}

/// The outcome for people.
fn told(outcome: &Outcome, seconds: f64) -> String {
    let mut text = String::new();
    let effort = format!("{} states expanded in {seconds:.3} s", outcome.expanded);
    let reason = outcome.reason.as_deref().unwrap_or_default();
    // Writing to a string does not fail.
    let _ = match outcome.status {
        Status::Unsolvable => writeln!(text, "unsolvable: {reason}\n{effort}"),
        Status::Limit => writeln!(text, "{reason}\n{effort}"),
        Status::Solved => {
            for (number, step) in (1..).zip(&outcome.steps) {
                let pairs = step.binding.iter().chain(&step.creates);
                let pairs: Vec<String> = pairs.map(|(var, node)| format!("{var}={node}")).collect();
                let by = step
                    .agent
                    .as_ref()
                    .map_or_else(String::new, |by| format!("  by {by}"));
                let _ = writeln!(text, "{number:3}  {}  {}{by}", step.rule, pairs.join(" "));
            }
            let best = if outcome.optimal {
                "optimal"
            } else {
                "best found"
            };
            let cost = outcome.cost.unwrap_or_default();
            writeln!(
                text,
                "{} steps, cost {cost} ({best}), {effort}",
                outcome.steps.len()
            )
        }
    };
    text
}
