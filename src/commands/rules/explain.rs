//! `cortex rules explain`: in which order a rule's nodes are looked for, and what that comes to.

use super::{find_rule, load, unmatched};
use crate::commands::graph::read_graph;
use crate::commands::output::{print, print_json};
use crate::{Answer, Failure};
use grammar::{Binding, Rule, SearchPlan, SearchStep, SharedSteps, WHOLE_LIMIT};
use serde_json::{Value as Json, json};
use std::fmt::Write as _;
use std::path::Path;

pub(super) fn explain(
    file: &Path,
    rule: Option<&str>,
    world: Option<&Path>,
    as_json: bool,
) -> Result<Answer, Failure> {
    let grammar = load(file, rule)?;
    let rules: Vec<&Rule> = match rule {
        Some(name) => vec![find_rule(&grammar, name)?],
        None => grammar.rules.iter().collect(),
    };
    let graph = world.map(read_graph).transpose()?;
    let snapshot = graph.as_ref().map(dsr::Graph::snapshot);
    let plans = rules
        .iter()
        .map(|rule| grammar.search_plan(snapshot.as_ref(), rule, &Binding::new()))
        .collect::<Result<Vec<_>, _>>()
        .map_err(unmatched)?;
    let shared = grammar.shared_steps(snapshot.as_ref()).map_err(unmatched)?;
    let of = |plan: &SearchPlan| -> Vec<&SharedSteps> {
        let shared = shared.iter();
        shared
            .filter(|shared| shared.rules.contains(&plan.rule))
            .collect()
    };
    if as_json {
        let rows = plans.iter().map(|plan| plan_json(plan, &of(plan)));
        let mut rows: Vec<Json> = rows.collect();
        // Asked for one rule, the answer is of one rule.
        let one = rule.is_some().then(|| rows.pop()).flatten();
        print_json(&one.unwrap_or(Json::Array(rows)))?;
        return Ok(Answer::Yes);
    }
    let tables = plans
        .iter()
        .map(|plan| table(plan) + &sharing(plan, &of(plan)));
    let tables: Vec<String> = tables.collect();
    print(&tables.join("\n"))?;
    Ok(Answer::Yes)
}

/// So many sets of rules that share steps with a rule are shown.
const SHOWN: usize = 5;

/// The other rules of a set.
fn others<'a>(plan: &SearchPlan, shared: &'a SharedSteps) -> Vec<&'a str> {
    let rules = shared.rules.iter().map(String::as_str);
    rules.filter(|rule| *rule != plan.rule).collect()
}

/// What a watch of all rules does once for this one and others, in words.
fn sharing(plan: &SearchPlan, shared: &[&SharedSteps]) -> String {
    let mut text = String::new();
    for set in shared.iter().take(SHOWN) {
        let (label, steps) = (&set.label, set.steps.join(", "));
        let others = others(plan, set).join(" ");
        let first = &set.rules[0];
        let named = if *first == plan.rule {
            String::new()
        } else {
            format!(" (in the names of {first})")
        };
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "    watched with {others}, once where `{label}` changes{named}: {steps}"
        );
    }
    if shared.len() > SHOWN {
        let _ = writeln!(text, "    and {} more such sets", shared.len() - SHOWN);
    }
    text
}

fn plan_json(plan: &SearchPlan, shared: &[&SharedSteps]) -> Json {
    let set = |set: &&SharedSteps| {
        json!({
            "label": set.label, "with": others(plan, set), "names_of": set.rules[0], "steps": set.steps,
        })
    };
    let step = |step: &SearchStep| {
        json!({
            "binds": step.binds,
            "source": step.source,
            "checks": step.checks,
            "expected": {"candidates": step.candidates, "passing": step.passing},
            "found": step.found.map(|[candidates, passing]| {
                json!({"candidates": candidates, "passing": passing})
            }),
        })
    };
    json!({
        "rule": plan.rule,
        "cost": plan.cost,
        "counted": plan.counted,
        "given_up": plan.given_up,
        "checks": plan.checks,
        "steps": plan.steps.iter().map(step).collect::<Vec<_>>(),
        "shared": shared.iter().map(set).collect::<Vec<_>>(),
    })
}

/// Small numbers need digits, large ones only their size.
fn about(number: f64) -> String {
    if number < 10.0 {
        format!("{number:.1}")
    } else {
        format!("{number:.0}")
    }
}

fn table(plan: &SearchPlan) -> String {
    let counts = if plan.counted {
        "by the graph's counts"
    } else {
        "by assumed counts: no world was given"
    };
    let mut text = format!("{}, {counts}: cost {}\n", plan.rule, about(plan.cost));
    let mut rows = vec![[
        "binds".to_owned(),
        "from".to_owned(),
        "candidates".to_owned(),
        "passing".to_owned(),
        "if".to_owned(),
    ]];
    if !plan.checks.is_empty() {
        let [none, dash] = [String::new(), "-".to_owned()];
        let checks = plan.checks.join(" ");
        rows.push([none.clone(), dash, none.clone(), none, checks]);
    }
    for step in &plan.steps {
        let cell = |expected: f64, found: Option<u64>| match found {
            Some(found) => format!("{} ({found})", about(expected)),
            None => about(expected),
        };
        rows.push([
            step.binds.join(" "),
            step.source.clone(),
            cell(step.candidates, step.found.map(|found| found[0])),
            cell(step.passing, step.found.map(|found| found[1])),
            step.checks.join(" "),
        ]);
    }
    let mut widths = [0; 5];
    for row in &rows {
        for (width, cell) in widths.iter_mut().zip(row) {
            *width = (*width).max(cell.chars().count());
        }
    }
    for row in &rows {
        let cells: Vec<String> = row
            .iter()
            .zip(widths)
            .map(|(cell, width)| format!("{cell:width$}"))
            .collect();
        // Writing to a string does not fail.
        let _ = writeln!(text, "    {}", cells.join("  ").trim_end());
    }
    if let Some(limit) = plan.given_up {
        let whole = if limit == WHOLE_LIMIT {
            ""
        } else {
            " for one match"
        };
        let tried = format!("nodes had been tried{whole}; found is what was found until then");
        // Writing to a string does not fail.
        let _ = writeln!(text, "    given up after {limit} {tried}");
    }
    text
}
