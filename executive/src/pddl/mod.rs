//! PDDL, the language that other planners speak: domains and problems are read and planned with,
//! and what a grammar, a world and a goal ask of the planner is written.
//!
//! Read are STRIPS with types, equality, negation, disjunction, quantifiers over objects, conditional
//! effects and action costs (`McDermott` and others 1998, Fox and Long 2003). Guarantee: all that is
//! wrong with the files is told at once, each at its place, and a plan that comes out is one of the
//! definition by the semantics of PDDL (a deleted atom that the same action adds holds).
//!
//! ```
//! use executive::{Effort, Limits, pddl};
//! use grammar::SourceFile;
//!
//! let domain = SourceFile::new(
//!     "doors.pddl",
//!     "(define (domain doors) (:requirements :strips :typing) (:types door)
//!        (:predicates (open ?d - door))
//!        (:action push :parameters (?d - door) :precondition (not (open ?d)) :effect (open ?d)))",
//! );
//! let problem = SourceFile::new(
//!     "house.pddl",
//!     "(define (problem house) (:domain doors) (:objects front - door) (:init) (:goal (open front)))",
//! );
//! let definition = pddl::read(&domain, &problem)?;
//! let outcome = pddl::plan(&definition, Effort::Optimal, &mut Limits::new());
//! assert_eq!(pddl::plan_file(&outcome, None), "(push front)\n; cost = 1 (unit cost)\n");
//! # Ok::<(), pddl::Defects>(())
//! ```

mod defect;
mod definition;
mod expression;
mod facts;
mod instantiate;
mod names;
mod parse;
mod reach;
mod write;

pub use defect::{Defect, Defects, Problem};
pub use definition::Definition;
pub use write::{WriteError, Written, write};

use crate::plan::{Outcome, Status, Step};
use crate::search::{Answer, Effort, Limits, Reachability, search};
use crate::task::{Literal, from_micro};
use grammar::SourceFile;
use instantiate::{Ground, instantiate};
use reach::{Reached, reach};
use std::fmt::Write as _;

/// Reads a domain and a problem of it.
///
/// # Errors
/// [`Defects`]: everything that is wrong with either.
pub fn read(domain: &SourceFile, problem: &SourceFile) -> Result<Definition, Defects> {
    parse::read(domain, problem)
}

/// Plans from what holds at first to the goal. Without a metric every action costs 1.
pub fn plan(definition: &Definition, effort: Effort, limits: &mut Limits<'_>) -> Outcome {
    let reached = match reach(definition, limits) {
        Ok(reached) => reached,
        Err(stop) => {
            let reason = format!("stopped while grounding: {stop}");
            return Outcome::without_plan(Status::Limit, reason, limits.expanded());
        }
    };
    let ground = instantiate(definition, &reached);
    match search(&ground.task, effort, limits) {
        Answer::Solved {
            actions,
            cost,
            optimal,
        } => Outcome {
            status: Status::Solved,
            optimal,
            cost: Some(from_micro(cost)),
            steps: actions
                .iter()
                .map(|&action| step(definition, &reached, &ground, action))
                .collect(),
            expanded: limits.expanded(),
            reason: None,
            notes: left_out(&ground),
        },
        Answer::Unsolvable => {
            let reason = why_unsolvable(definition, &reached, &ground, limits.expanded());
            Outcome::without_plan(Status::Unsolvable, reason, limits.expanded())
        }
        Answer::Stopped(stop) => {
            let reason = format!(
                "stopped with no plan yet: {stop} ({} facts, {} actions, {} states expanded)",
                ground.task.facts(),
                ground.task.actions().len(),
                limits.expanded()
            );
            Outcome::without_plan(Status::Limit, reason, limits.expanded())
        }
    }
}

fn step(definition: &Definition, reached: &Reached, ground: &Ground, action: usize) -> Step {
    let (number, objects) = &reached.instances[ground.actions[action]];
    let schema = &definition.actions[*number];
    let names = objects
        .iter()
        .map(|&object| definition.objects.name(object as usize));
    let arguments: Vec<String> = names.map(str::to_owned).collect();
    Step {
        rule: schema.name.clone(),
        binding: schema
            .parameters
            .iter()
            .cloned()
            .zip(arguments.iter().cloned())
            .collect(),
        creates: std::collections::BTreeMap::new(),
        arguments,
        agent: None,
        cost: from_micro(ground.task.actions()[action].cost),
    }
}

fn why_unsolvable(
    definition: &Definition,
    reached: &Reached,
    ground: &Ground,
    expanded: u64,
) -> String {
    let reachability = Reachability::new(&ground.task);
    let mut missing: Vec<Literal> = Vec::new();
    ground.task.goal().each_literal(&mut |literal| {
        if !reachability.literal(literal) && !missing.contains(&literal) {
            missing.push(literal);
        }
    });
    let mut reasons: Vec<String> = Vec::new();
    for literal in missing.into_iter().take(4) {
        let (predicate, objects) = reached.facts.atom(ground.facts[literal.fact() as usize]);
        let predicate = definition.predicates.name(predicate);
        let atom = definition.written(predicate, objects);
        reasons.push(if literal.negated() {
            format!("{atom} holds, and nothing takes it away")
        } else {
            format!("{atom} cannot be reached")
        });
    }
    if reasons.is_empty() && !reachability.goal {
        reasons.extend(unreached(definition, reached).into_iter().take(4));
    }
    if reasons.is_empty() {
        reasons.push(if reachability.goal {
            format!("no order of actions works: all {expanded} states that matter were tried")
        } else {
            "no action brings about what the goal asks for".to_owned()
        });
    }
    reasons.extend(left_out(ground));
    reasons.join("; ")
}

/// What was left out for its cost, in words.
fn left_out(ground: &Ground) -> Vec<String> {
    let more = match ground.left_out {
        0 | 1 => None,
        2 => Some("so was another action".to_owned()),
        more => Some(format!("so were {} other actions", more - 1)),
    };
    ground.without_cost.iter().cloned().chain(more).collect()
}

/// The atoms that the goal asks for outright and that no action may bring about.
fn unreached(definition: &Definition, reached: &Reached) -> Vec<String> {
    fn walk(
        condition: &definition::Condition,
        definition: &Definition,
        reached: &Reached,
        reasons: &mut Vec<String>,
    ) {
        match condition {
            definition::Condition::All(parts) => {
                for part in parts {
                    walk(part, definition, reached, reasons);
                }
            }
            definition::Condition::Atom(atom) => {
                let constant = |term: &definition::Term| match term {
                    definition::Term::Object(object) => Some(*object),
                    definition::Term::Slot(_) => None,
                };
                let objects: Option<Vec<u32>> = atom.arguments.iter().map(constant).collect();
                let Some(objects) = objects else { return };
                if reached.facts.find(atom.predicate, &objects).is_none() {
                    let predicate = definition.predicates.name(atom.predicate);
                    let atom = definition.written(predicate, &objects);
                    reasons.push(format!("{atom} cannot be reached"));
                }
            }
            _ => {}
        }
    }
    let mut reasons = Vec::new();
    if let Some(goal) = &definition.goal {
        walk(goal, definition, reached, &mut reasons);
    }
    reasons
}

/// A plan as the planning competitions write it: a step a line, the cost behind them. `names` are
/// those of [`write()`], for a plan over the rules of a grammar.
pub fn plan_file(outcome: &Outcome, names: Option<&Written>) -> String {
    let mut text = String::new();
    let mut cost = outcome.cost.unwrap_or_default();
    let mut line = |words: &str| {
        // Writing to a string does not fail.
        let _ = writeln!(text, "({words})");
    };
    if let Some(written) = names.and_then(|names| names.plan(outcome)) {
        written.into_iter().for_each(&mut line);
    } else {
        for step in &outcome.steps {
            let words = std::iter::once(&step.rule).chain(&step.arguments);
            let words: Vec<&str> = words.map(String::as_str).collect();
            line(&words.join(" "));
        }
    }
    if let Some(names) = names {
        cost *= names.scale;
    }
    let unit = outcome
        .steps
        .iter()
        .all(|step| step.cost.to_bits() == 1.0f64.to_bits());
    let kind = if unit { "unit cost" } else { "general cost" };
    let _ = writeln!(text, "; cost = {cost} ({kind})");
    text
}

#[cfg(test)]
mod tests;
