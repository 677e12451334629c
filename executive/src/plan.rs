//! Planning: from a grammar, a snapshot and a goal to steps, or to why there are none. This file
//! owns what the outcome says; it guarantees that each step of a plan is applicable after those
//! before it, and that the goal holds at the end.

use crate::ground::{Environment, Ground, Instance, Problem, ProblemError, Reached, build};
use crate::search::{Answer, Effort, Limits, Reachability, search};
use crate::task::{Literal, Micro, from_micro};
use dsr::{ReadError, Snapshot};
use grammar::{Goal, Grammar};
use serde::Serialize;
use std::collections::BTreeMap;

/// How planning ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// There is a plan.
    Solved,
    /// It is proved that there is none.
    Unsolvable,
    /// A limit was met before there was one.
    Limit,
}

/// A rule at a binding, as names.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// The rule.
    pub rule: String,
    /// The node, by name, that each variable of the rule's left side and parameters stands for. A
    /// node that an earlier step of the plan creates is called `rule.variable#n`: its `creates`.
    pub binding: BTreeMap<String, String>,
    /// What to call the nodes that it creates, by variable, until they are there.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub creates: BTreeMap<String, String>,
    /// The agent that carries it out, where the rule names one.
    pub agent: Option<String>,
    /// What it costs.
    pub cost: f64,
}

/// What planning came to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// How it ended.
    pub status: Status,
    /// Whether it is proved that no plan costs less.
    pub optimal: bool,
    /// What the plan costs; see [`crate::task::Task::cost_after`] for rules that may fail.
    pub cost: Option<f64>,
    /// The plan.
    pub steps: Vec<Step>,
    /// How many states were expanded.
    pub expanded: u64,
    /// Why there is no plan, or where it stopped.
    pub reason: Option<String>,
}

/// A rule at a binding that shall cost more than the rule says.
#[derive(Debug, Clone, PartialEq)]
pub struct Raised {
    /// The rule.
    pub rule: String,
    /// As in [`Step::binding`].
    pub binding: BTreeMap<String, String>,
    /// By how much; infinity excludes it.
    pub by: f64,
}

/// What is asked of the planner.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// How good the plan shall be.
    pub effort: Effort,
    /// How often each rule that creates nodes may be applied in a plan.
    pub spares: usize,
    /// Steps that have become dearer.
    pub raised: Vec<Raised>,
    /// Dormant rules that have been woken.
    pub awake: Vec<String>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            effort: Effort::default(),
            spares: 3,
            raised: Vec::new(),
            awake: Vec::new(),
        }
    }
}

impl Outcome {
    fn without_plan(status: Status, reason: String, expanded: u64) -> Self {
        Self {
            status,
            optimal: false,
            cost: None,
            steps: Vec::new(),
            expanded,
            reason: Some(reason),
        }
    }
}

/// Plans from what holds in `snapshot` to `goal`.
///
/// Combos, `passive` and `hierarchical` rules are not planned with: they sum up other rules, or
/// happen by themselves. A cost that reads an attribute which rules assign is the cost at first.
///
/// # Errors
/// [`ReadError`] where the snapshot cannot be read any more; a goal that names what is not there is
/// an [`Status::Unsolvable`] outcome.
///
/// # Example
/// ```
/// use dsr::{Graph, Schema, Time, Transaction};
/// use executive::{Limits, Options, Status, plan};
///
/// let (grammar, _) = grammar::parse_grammar(
///     "name=doors\n===\nopen : active(2) {
///         { d:door d->d(closed) } => { d:door d->d(open) } }\n",
///     "doors.aggl",
/// );
/// let mut graph = Graph::in_memory(Schema::open());
/// let mut transaction = Transaction::new();
/// transaction.create_node("door", "front", vec![]);
/// transaction.create_edge("front", "closed", "front");
/// graph.commit(&transaction, "me", Time::default())?;
/// let goal = grammar::parse_goal("{ d:door d->d(open) }", "goal", &grammar.types)?;
///
/// let snapshot = graph.snapshot();
/// let outcome = plan(&grammar, &snapshot, &goal, &Options::default(), &mut Limits::new())?;
/// assert_eq!((outcome.status, outcome.cost), (Status::Solved, Some(2.0)));
/// assert_eq!(outcome.steps[0].binding["d"], "front");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn plan(
    grammar: &Grammar,
    snapshot: &Snapshot,
    goal: &Goal,
    options: &Options,
    limits: &mut Limits<'_>,
) -> Result<Outcome, ReadError> {
    match Problem::read(grammar, snapshot, goal, options.spares) {
        Ok(problem) => Ok(solve(&problem, options, limits)),
        Err(ProblemError::Read(error)) => Err(error),
        Err(ProblemError::Goal(reason)) => Ok(Outcome::without_plan(Status::Unsolvable, reason, 0)),
    }
}

/// Plans for a problem that was read.
pub(crate) fn solve(problem: &Problem, options: &Options, limits: &mut Limits<'_>) -> Outcome {
    let awake = problem.awake(&options.awake);
    let reached = match problem.reach(&awake, limits) {
        Ok(reached) => reached,
        Err(stop) => {
            let reason = format!("stopped while grounding: {stop}");
            return Outcome::without_plan(Status::Limit, reason, limits.expanded());
        }
    };
    let raised: Vec<(usize, Environment, f64)> = options
        .raised
        .iter()
        .filter_map(|raised| {
            let operator = problem.operator(&raised.rule)?;
            let binding = raised.binding.iter();
            let binding = binding.map(|(v, n)| (v.as_str(), n.as_str()));
            let environment = problem.environment(operator, binding)?;
            Some((operator, environment, raised.by))
        })
        .collect();
    let extra = |instance: &Instance| -> f64 {
        let bound = problem.program.operators[instance.operator].bound;
        let same = raised.iter().filter(|(operator, environment, _)| {
            *operator == instance.operator && environment[..bound] == instance.objects[..bound]
        });
        same.map(|(_, _, by)| by).sum()
    };
    let ground = build(
        &problem.program,
        &problem.goal,
        &problem.world.facts,
        &awake,
        &reached,
        &extra,
    );
    match search(&ground.task, options.effort, limits) {
        Answer::Solved {
            actions, optimal, ..
        } => {
            let steps = actions
                .iter()
                .map(|&action| step(problem, &reached, &ground, action))
                .collect();
            Outcome {
                status: Status::Solved,
                optimal: optimal && !reached.truncated,
                cost: Some(from_micro(cost(&ground, &actions))),
                steps,
                expanded: limits.expanded(),
                reason: None,
            }
        }
        Answer::Unsolvable => {
            let reason = why_unsolvable(problem, options, &reached, &ground, limits.expanded());
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

/// What a plan costs by its rules alone.
fn cost(ground: &Ground, actions: &[usize]) -> Micro {
    actions.iter().fold(0, |before, &action| {
        let with_extra = ground.task.cost_after(before, action);
        with_extra - ground.task.actions()[action].cost + ground.costs[action]
    })
}

fn step(problem: &Problem, reached: &Reached, ground: &Ground, action: usize) -> Step {
    let instance = &reached.instances[ground.actions[action]];
    let operator = &problem.program.operators[instance.operator];
    let name = |(variable, object): (&crate::ground::Variable, &u32)| {
        (variable.name.clone(), problem.name(*object).to_owned())
    };
    let mut named = operator.variables.iter().zip(&instance.objects).map(name);
    Step {
        rule: operator.name.clone(),
        binding: named.by_ref().take(operator.bound).collect(),
        creates: named.collect(),
        agent: operator.agent.clone(),
        cost: from_micro(ground.costs[action]),
    }
}

fn why_unsolvable(
    problem: &Problem,
    options: &Options,
    reached: &Reached,
    ground: &Ground,
    expanded: u64,
) -> String {
    let mut reasons = problem.unreachable(reached);
    if reasons.is_empty() && !Reachability::new(&ground.task).goal {
        reasons.extend(unreachable_literals(problem, ground));
    }
    if reasons.is_empty() {
        reasons.push(if reached.goals.is_empty() {
            "no choice of nodes fits all of the goal at once".to_owned()
        } else if !Reachability::new(&ground.task).goal {
            "no rule brings about what the goal's condition asks for".to_owned()
        } else {
            format!("no order of steps works: all {expanded} states that matter were tried")
        });
    }
    if options.raised.iter().any(|raised| raised.by.is_infinite()) {
        reasons.push("steps that failed lately were left out".to_owned());
    }
    if problem.program.operators.iter().any(|o| o.creates()) {
        reasons.push(format!(
            "each rule was given {} new nodes at most",
            options.spares
        ));
    }
    if reached.truncated {
        reasons.push("attributes were followed through their first values only".to_owned());
    }
    reasons.extend(problem.program.notes.iter().cloned());
    reasons.extend(ground.notes.iter().cloned());
    reasons.join("; ")
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
    words.take(4).collect()
}

#[cfg(test)]
mod tests;
