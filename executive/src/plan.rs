//! Planning: from a grammar, a snapshot and a goal to steps, or to why there are none. This file
//! owns what the outcome says; it guarantees that each step of a plan is applicable after those
//! before it, and that the goal holds at the end.

mod lifted;
mod narrow;
mod reason;

use crate::ground::{
    Environment, Ground, Instance, Object, Operator, Problem, ProblemError, Reached, Scope,
    UNBOUND, build,
};
use crate::search::{Answer, Effort, Limits, Reachability, StopReason, search};
use crate::task::{Micro, from_micro};
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
    /// It is proved that there is none, as far as [`Options::spares`] go; the reason says so where
    /// they matter.
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
    /// The nodes of the binding, then of what it creates, in the order in which the rule names them.
    #[serde(skip)]
    pub arguments: Vec<String>,
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
    /// What was left out of planning, with the plan as without: where rules have a cost that is none.
    pub notes: Vec<String>,
}

/// A rule at a binding that shall cost more than the rule says.
#[derive(Debug, Clone, PartialEq)]
pub struct Raised {
    /// The rule.
    pub rule: String,
    /// As in [`Step::binding`]; a variable that is left out stands for any node.
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
    pub(crate) fn without_plan(status: Status, reason: String, expanded: u64) -> Self {
        Self {
            status,
            optimal: false,
            cost: None,
            steps: Vec::new(),
            expanded,
            reason: Some(reason),
            notes: Vec::new(),
        }
    }
}

/// Plans from what holds in `snapshot` to `goal`.
///
/// Combos, `passive` and `hierarchical` rules are not planned with: they sum up other rules, or
/// happen by themselves.
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
    plan_above(MANY_ACTIONS, grammar, snapshot, goal, options, limits)
}

/// More ground actions than this are not made before few of them were tried.
const MANY_ACTIONS: usize = 100_000;

/// Plans, with so many ground actions as are made before other ways are tried.
pub(crate) fn plan_above(
    many: usize,
    grammar: &Grammar,
    snapshot: &Snapshot,
    goal: &Goal,
    options: &Options,
    limits: &mut Limits<'_>,
) -> Result<Outcome, ReadError> {
    let mut options = options.clone();
    options.awake.extend(grammar.awake(snapshot)?);
    let options = &options;
    let mut spares = options.spares.min(FEW_SPARES);
    let mut best: Option<Outcome> = None;
    let mut tried = false;
    loop {
        let problem = match Problem::read(grammar, snapshot, goal, spares) {
            Ok(problem) => problem,
            Err(ProblemError::Read(error)) => return Err(error),
            Err(ProblemError::Goal(reason)) => {
                return Ok(Outcome::without_plan(Status::Unsolvable, reason, 0));
            }
        };
        let few = Options {
            spares,
            ..options.clone()
        };
        let asked = Asked {
            problem: &problem,
            options: &few,
            awake: &problem.awake(&few.awake),
            many,
        };
        let outcome = solve(asked, limits);
        if outcome.status == Status::Unsolvable && spares > 0 && !tried {
            tried = true;
            // As many new nodes as any rule can tell apart: more of them are more of the same.
            let operators = problem.program.operators.iter().chain([&problem.goal]);
            let told_apart = operators.map(|o| o.slots).max().unwrap_or_default();
            if let Ok(problem) = Problem::read(grammar, snapshot, goal, told_apart)
                && let Some(outcome) = prove(&problem, options, limits)
            {
                return Ok(outcome);
            }
        }
        // More new nodes change nothing where none are made, or a first plan was all that was asked.
        let settled = spares >= options.spares
            || !problem.program.operators.iter().any(Operator::creates)
            || outcome.optimal
            || outcome.status == Status::Limit
            || outcome.status == Status::Solved && options.effort == Effort::First;
        let better = match (&best, &outcome) {
            (Some(best), outcome) => outcome.cost.is_some() && outcome.cost <= best.cost,
            (None, _) => true,
        };
        if settled || outcome.status == Status::Solved && better {
            let kept = if better { Some(outcome) } else { best.take() };
            if settled {
                return Ok(kept.unwrap_or_else(|| {
                    Outcome::without_plan(Status::Limit, String::new(), limits.expanded())
                }));
            }
            best = kept;
        }
        spares = (2 * spares).min(options.spares);
    }
}

/// So many new nodes are offered to each rule at first, then twice as many and so on: what more
/// could be made costs nothing until it is needed.
const FEW_SPARES: usize = 2;

/// A problem that was read, and how it shall be solved.
#[derive(Debug, Clone, Copy)]
struct Asked<'a> {
    problem: &'a Problem,
    options: &'a Options,
    /// Which rules are awake at first.
    awake: &'a [bool],
    /// So many ground actions are made before other ways are tried.
    many: usize,
}

fn solve(asked: Asked<'_>, limits: &mut Limits<'_>) -> Outcome {
    let Asked { problem, awake, .. } = asked;
    // A plan of least cost may need any of the actions.
    let most = match asked.options.effort {
        Effort::Optimal => usize::MAX,
        Effort::First | Effort::Anytime => asked.many,
    };
    match problem.reach(awake, Scope::All(most), limits) {
        Ok(reached) if !reached.overflow => return search_in(asked, &reached, limits),
        Ok(_) => {}
        Err(stop) => return stopped_while_grounding(stop, limits),
    }
    match narrow::plan(asked, limits) {
        Ok(Some(outcome)) => return outcome,
        Ok(None) => {}
        Err(stop) => return stopped_while_grounding(stop, limits),
    }
    limits.cap(LIFTED_FIRST);
    let outcome = lifted::plan(asked, limits);
    limits.uncap();
    if let Ok(outcome) = outcome {
        return outcome;
    }
    match problem.reach(awake, Scope::All(MOST_ACTIONS), limits) {
        Ok(reached) if !reached.overflow => search_in(asked, &reached, limits),
        Ok(_) | Err(StopReason::Memory) => {
            lifted::plan(asked, limits).unwrap_or_else(|outcome| outcome)
        }
        Err(stop) => stopped_while_grounding(stop, limits),
    }
}

fn stopped_while_grounding(stop: StopReason, limits: &Limits<'_>) -> Outcome {
    let reason = format!("stopped while grounding: {stop}");
    Outcome::without_plan(Status::Limit, reason, limits.expanded())
}

/// So many states are expanded without ground actions before all of these are made.
const LIFTED_FIRST: u64 = 20_000;

/// More ground actions than this are not made at all, but to prove a plan to be the best.
const MOST_ACTIONS: usize = 1_000_000;

/// Searches among what was reached.
fn search_in(asked: Asked<'_>, reached: &Reached, limits: &mut Limits<'_>) -> Outcome {
    let Asked {
        problem, options, ..
    } = asked;
    let ground = match ground(problem, options, asked.awake, reached, limits) {
        Ok(ground) => ground,
        Err(stop) => return stopped_while_grounding(stop, limits),
    };
    match search(&ground.task, options.effort, limits) {
        Answer::Solved {
            actions,
            optimal,
            cost,
        } => {
            let optimal = optimal
                && !reached.truncated
                && spares_suffice(problem, options, reached, &ground, cost);
            let expanded = limits.expanded();
            solved(problem, reached, &ground, &actions, optimal, expanded)
        }
        Answer::Unsolvable => {
            let spares = Some(options.spares);
            let expanded = limits.expanded();
            let reason =
                reason::why_unsolvable(problem, options, spares, reached, Some(&ground), expanded);
            Outcome::without_plan(Status::Unsolvable, reason, expanded)
        }
        Answer::Stopped(stop) => {
            let reason = reason::how_far(problem, &ground, stop, limits);
            Outcome::without_plan(Status::Limit, reason, limits.expanded())
        }
    }
}

/// The outcome that some actions are.
fn solved(
    problem: &Problem,
    reached: &Reached,
    ground: &Ground,
    actions: &[usize],
    optimal: bool,
    expanded: u64,
) -> Outcome {
    let steps = actions.iter();
    Outcome {
        status: Status::Solved,
        optimal,
        cost: Some(from_micro(plain_cost(ground, actions))),
        steps: steps
            .map(|&action| step(problem, reached, ground, action))
            .collect(),
        expanded,
        reason: None,
        notes: ground
            .unpriced
            .iter()
            .map(|one| problem.unpriced(one))
            .collect(),
    }
}

/// Whether some nodes are those of a binding, which may leave some open.
fn covers(binding: &[Object], objects: &[Object]) -> bool {
    let mut pairs = binding.iter().zip(objects);
    pairs.all(|(bound, object)| *bound == UNBOUND || bound == object)
}

/// What the options say of steps that are dearer than their rules say, or excluded.
fn raised(problem: &Problem, options: &Options) -> Vec<(usize, Environment, f64)> {
    let all = options.raised.iter();
    all.filter_map(|raised| {
        let operator = problem.operator(&raised.rule)?;
        let binding = raised.binding.iter();
        let binding = binding.map(|(v, n)| (v.as_str(), n.as_str()));
        let environment = problem.environment(operator, binding)?;
        Some((operator, environment, raised.by))
    })
    .collect()
}

/// The ground task, in which some steps are dearer than their rules say.
fn ground(
    problem: &Problem,
    options: &Options,
    awake: &[bool],
    reached: &Reached,
    limits: &mut Limits<'_>,
) -> Result<Ground, StopReason> {
    let raised = raised(problem, options);
    let extra = |instance: &Instance| -> f64 {
        let same = raised.iter().filter(|(operator, binding, _)| {
            *operator == instance.operator && covers(binding, &instance.objects)
        });
        same.map(|(_, _, by)| by).sum()
    };
    build(
        &problem.program,
        &problem.goal,
        &problem.world.facts,
        awake,
        reached,
        &extra,
        limits,
    )
}

/// The outcome where even the relaxed task does not reach the goal.
fn prove(problem: &Problem, options: &Options, limits: &mut Limits<'_>) -> Option<Outcome> {
    let awake = problem.awake(&options.awake);
    let reached = problem
        .reach(&awake, Scope::All(MANY_ACTIONS), limits)
        .ok()?;
    let ground = ground(problem, options, &awake, &reached, limits).ok()?;
    if reached.overflow || reached.truncated || Reachability::new(&ground.task).goal {
        return None;
    }
    let expanded = limits.expanded();
    let reason = reason::why_unsolvable(problem, options, None, &reached, Some(&ground), expanded);
    Some(Outcome::without_plan(Status::Unsolvable, reason, expanded))
}

/// What a plan costs by its rules alone.
fn plain_cost(ground: &Ground, actions: &[usize]) -> Micro {
    actions.iter().fold(0, |before, &action| {
        let with_extra = ground.task.cost_after(before, action);
        with_extra - ground.task.actions()[action].cost + ground.costs[action]
    })
}

/// Whether a plan that creates more nodes than there are spares would cost at least `cost`.
fn spares_suffice(
    problem: &Problem,
    options: &Options,
    reached: &Reached,
    ground: &Ground,
    cost: Micro,
) -> bool {
    let more = options.spares as u64 + 1;
    let mut actions = ground.task.actions().iter().zip(&ground.actions);
    actions.all(|(action, &index)| {
        let operator = &problem.program.operators[reached.instances[index].operator];
        !operator.creates() || action.cost.saturating_mul(more) >= cost
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
        arguments: problem.arguments(instance),
        agent: operator.agent.clone(),
        cost: from_micro(ground.costs[action]),
    }
}

#[cfg(test)]
mod tests;
