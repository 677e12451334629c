//! `cortex rules match`: where left-hand sides hold in a world.

use super::amounts::{Amounts, amounts};
use super::{Names, World, find_rule, load, unmatched, words};
use crate::cli::WorldArgs;
use crate::commands::output::{print, print_json};
use crate::{Answer, Failure};
use dsr::Snapshot;
use grammar::{Binding, Grammar, MatchError, Rule, WHOLE_LIMIT};
use serde_json::{Value as Json, json};
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

/// What matching a rule came to.
struct Found {
    count: u64,
    /// Whether those are all; if not, so many nodes were tried that the rest was not looked for.
    complete: bool,
    /// The first of them.
    matches: Vec<Binding>,
    seconds: f64,
}

fn find(
    grammar: &Grammar,
    snapshot: &Snapshot,
    rule: &Rule,
    listed: usize,
) -> Result<Found, Failure> {
    #[allow(
        clippy::disallowed_methods,
        reason = "the verb tells how long matching took"
    )]
    let started = Instant::now();
    let search = grammar
        .matches(snapshot, rule, &Binding::new())
        .map_err(Failure::internal)?;
    let mut search = search.within_all(WHOLE_LIMIT);
    let mut matches = Vec::new();
    let mut complete = true;
    for one in search.by_ref().take(listed) {
        match one {
            Ok(found) => matches.push(found),
            Err(MatchError::Whole { .. }) => complete = false,
            Err(error) => return Err(unmatched(error)),
        }
    }
    let mut count = matches.len() as u64;
    if complete {
        let (more, all) = search.count_rest().map_err(unmatched)?;
        (count, complete) = (count + more, all);
    }
    Ok(Found {
        count,
        complete,
        matches,
        seconds: started.elapsed().as_secs_f64(),
    })
}

/// What was found, for people.
fn heading(rule: &Rule, found: &Found) -> String {
    let plural = if found.count == 1 { "match" } else { "matches" };
    let least = if found.complete { "" } else { "at least " };
    let milliseconds = found.seconds * 1e3;
    let (name, count) = (&rule.name, found.count);
    let mut text = format!("{name}: {least}{count} {plural} in {milliseconds:.3} ms\n");
    if !found.complete {
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "    stopped after {WHOLE_LIMIT} nodes had been tried: nothing joins the nodes of the rule, or \
             quantifiers are nested"
        );
    }
    text
}

/// Lists up to so many matches of one rule or each, or counts them only.
pub(super) fn matches(
    file: &Path,
    rule: Option<&str>,
    world: &WorldArgs,
    listed: Option<usize>,
    as_json: bool,
) -> Result<Answer, Failure> {
    let grammar = load(file, rule)?;
    let rules: Vec<&Rule> = match rule {
        Some(name) => vec![find_rule(&grammar, name)?],
        None => grammar.all_rules().collect(),
    };
    let snapshot = World::open(world)?.snapshot()?;
    let mut names = Names::new(&snapshot);
    let mut rows = Vec::new();
    for one in rules {
        let found = find(&grammar, &snapshot, one, listed.unwrap_or(0))?;
        let amounts = found
            .matches
            .iter()
            .map(|at| amounts(&grammar, &snapshot, one, at));
        let amounts = amounts.collect::<Result<Vec<_>, _>>()?;
        if as_json {
            let mut row = json!({
                "rule": &*one.name, "count": found.count, "complete": found.complete,
                "seconds": found.seconds,
            });
            if listed.is_some() {
                let named = found.matches.iter().map(|binding| names.of_all(binding));
                row["matches"] = json!(named.collect::<Result<Vec<_>, _>>()?);
                let missing = amounts.iter().map(Amounts::missing_json).enumerate();
                let missing = missing.filter_map(|(place, mut missing)| {
                    let any = missing
                        .as_object()
                        .is_some_and(|missing| !missing.is_empty());
                    missing["match"] = json!(place);
                    any.then_some(missing)
                });
                row["amounts_missing"] = missing.collect();
            }
            rows.push(row);
            continue;
        }
        print(&heading(one, &found))?;
        for (binding, amounts) in found.matches.iter().zip(&amounts) {
            print(&format!("    {}\n", words(one, &names.of_all(binding)?)))?;
            for (what, why) in amounts.missing() {
                print(&format!("        no {what}: {why}\n"))?;
            }
        }
        let more = found.count - found.matches.len() as u64;
        if listed.is_some() && more > 0 {
            print(&format!("    and {more} more (--limit N lists N)\n"))?;
        }
    }
    if as_json {
        // Asked for one rule, the answer is of one rule.
        let one = rule.is_some().then(|| rows.pop()).flatten();
        print_json(&one.unwrap_or(Json::Array(rows)))?;
    }
    Ok(Answer::Yes)
}
