//! Why there is no plan, in words. This file guarantees that what it calls unreachable is, and that
//! a search which was stopped is not taken for one that failed.

use super::Options;
use crate::ground::{Ground, Operator, Problem, Reached};
use crate::search::{Limits, Reachability, StopReason};
use crate::task::{Formula, Literal};

/// So many literals are told.
const MOST: usize = 4;

/// How far a search came before it was stopped.
pub(super) fn how_far(
    problem: &Problem,
    ground: &Ground,
    stop: StopReason,
    limits: &Limits<'_>,
) -> String {
    let mut reason = format!(
        "stopped with no plan yet: {stop} ({} facts, {} actions, {} states expanded)",
        ground.task.facts(),
        ground.task.actions().len(),
        limits.expanded()
    );
    let Some(nearest) = limits.nearest() else {
        return reason;
    };
    let mut missing = Vec::new();
    lacking(ground.task.goal(), nearest, &mut missing);
    let words = missing.into_iter().filter_map(|literal| {
        let atom = problem.atom(ground.atoms[literal.fact() as usize])?;
        Some(if literal.negated() {
            format!("without {atom}")
        } else {
            atom
        })
    });
    let words: Vec<String> = words.collect();
    lacked(&mut reason, &words);
    reason
}

/// How far a search without ground actions came before it was stopped.
pub(super) fn how_far_without_ground(
    stop: StopReason,
    expanded: u64,
    missing: &[String],
) -> String {
    let mut reason = format!(
        "stopped with no plan yet: {stop} (more actions than are made, {expanded} states expanded)"
    );
    lacked(&mut reason, missing);
    reason
}

fn lacked(reason: &mut String, missing: &[String]) {
    if !missing.is_empty() {
        reason.push_str("; the nearest state still lacked ");
        reason.push_str(&missing[..missing.len().min(MOST)].join(", "));
    }
}

/// The literals that keep a formula from holding; of a choice, those of the part that lacks least.
fn lacking(formula: &Formula, state: &[u64], missing: &mut Vec<Literal>) {
    match formula {
        Formula::Literal(literal) => {
            if !literal.holds(state) && !missing.contains(literal) {
                missing.push(*literal);
            }
        }
        Formula::And(parts) => parts.iter().for_each(|part| lacking(part, state, missing)),
        Formula::Or(parts) => {
            let alone = parts.iter().map(|part| {
                let mut own = Vec::new();
                lacking(part, state, &mut own);
                own
            });
            if let Some(least) = alone.min_by_key(Vec::len) {
                missing.extend(least);
            }
        }
    }
}

pub(super) fn why_unsolvable(
    problem: &Problem,
    options: &Options,
    spares: Option<usize>,
    reached: &Reached,
    ground: Option<&Ground>,
    expanded: u64,
) -> String {
    let mut reasons = problem.unreachable(reached);
    let hopeless = ground.filter(|ground| !Reachability::new(&ground.task).goal);
    if let Some(ground) = hopeless.filter(|_| reasons.is_empty()) {
        reasons.extend(unreachable_literals(problem, ground));
    }
    if reasons.is_empty() {
        reasons.push(if reached.goals.is_empty() {
            "no choice of nodes fits all of the goal at once".to_owned()
        } else if hopeless.is_some() {
            "no rule brings about what the goal's condition asks for".to_owned()
        } else {
            no_order(expanded)
        });
    }
    let truncated = reached.truncated;
    append_reservations(&mut reasons, problem, options, spares, truncated);
    let unpriced = ground.into_iter().flat_map(|ground| &ground.unpriced);
    reasons.extend(unpriced.map(|unpriced| problem.unpriced(unpriced)));
    reasons.join("; ")
}

fn no_order(expanded: u64) -> String {
    format!("no order of steps works: all {expanded} states that matter were tried")
}

/// Why there is no plan where every state was met.
pub(super) fn why_no_order(problem: &Problem, options: &Options, expanded: u64) -> String {
    let mut reasons = vec![no_order(expanded)];
    let spares = Some(options.spares);
    append_reservations(&mut reasons, problem, options, spares, false);
    reasons.join("; ")
}

/// Under which conditions there is no plan.
fn append_reservations(
    reasons: &mut Vec<String>,
    problem: &Problem,
    options: &Options,
    spares: Option<usize>,
    truncated: bool,
) {
    if options.raised.iter().any(|raised| raised.by.is_infinite()) {
        reasons.push("steps that failed lately were left out".to_owned());
    }
    if let Some(spares) = spares
        && problem.program.operators.iter().any(Operator::creates)
    {
        reasons.push(format!("each rule was given {spares} new nodes at most"));
    }
    if truncated {
        reasons.push("attributes were followed through their first values only".to_owned());
    }
    reasons.extend(problem.program.notes.iter().cloned());
}

/// The literals of the goal that even the relaxed task cannot reach.
fn unreachable_literals(problem: &Problem, ground: &Ground) -> Vec<String> {
    let reachability = Reachability::new(&ground.task);
    let mut missing: Vec<Literal> = Vec::new();
    ground.task.goal().each_literal(&mut |literal| {
        if !reachability.literal(literal) && !missing.contains(&literal) {
            missing.push(literal);
        }
    });
    let words = missing.into_iter().filter_map(|literal| {
        let atom = problem.atom(ground.atoms[literal.fact() as usize])?;
        Some(if literal.negated() {
            format!("{atom} holds, and nothing takes it away")
        } else {
            format!("{atom} cannot be reached")
        })
    });
    words.take(MOST).collect()
}
