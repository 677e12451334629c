//! Planning without ground actions: in each state the rules are matched anew, so that what takes room is the states
//! that were met, not what might ever be done. States that bring something new go first (best-first width search,
//! Lipovetzky and Geffner 2017, whose lifted form is Correa and Seipp's of 2022), measured by what they lack of the
//! goal and of a way to it that ignores what rules take away. This file guarantees that a search that ends without
//! plan or limit has met every state.

mod novelty;
mod present;

use super::narrow::Relaxed;
use super::{Asked, Outcome, Status, covers, ground, raised, reason, search_in, solved};
use crate::ground::{
    Environment, Facts, Found, Instance, Join, Operator, Place, Problem, Scope, amount, evaluate,
    is_admitted, lacking,
};
use crate::search::{Limits, StopReason};
use fixedbitset::FixedBitSet;
use novelty::{Met, Novelty};
use present::{Present, State};
use rustc_hash::FxHashMap;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// What a search came to.
#[derive(Debug)]
enum Answer {
    /// A plan.
    Plan(Vec<Instance>),
    /// There is none.
    Nothing,
    /// A limit was met; what the nearest state lacked of the goal, in words.
    Stopped(StopReason, Vec<String>),
}

/// A way to the goal that ignores what rules take away, by which states are measured.
#[derive(Debug)]
struct Guide {
    /// The objects that the goal is about.
    goal: Option<Environment>,
    /// Its facts, each with its place in [`Node::passed`].
    facts: FxHashMap<u32, usize>,
}

/// A state that was met.
#[derive(Debug)]
struct Node {
    state: State,
    parent: usize,
    /// What led to it; at first nothing.
    by: Option<Instance>,
    guide: u32,
    /// How much of the goal it lacks, by its guide.
    lacks: u64,
    /// Which of its guide's facts held on the way to it.
    passed: FixedBitSet,
}

/// Which states come first: new ones, of those near ones, of those the first.
type Rank = (Novelty, u64, usize, usize);

struct Search<'a, 'l, 'c> {
    problem: &'a Problem,
    /// Rules at bindings that must not be used.
    excluded: &'a [(usize, Environment)],
    joins: Vec<Join>,
    goal: Join,
    present: Present<'a>,
    nodes: Vec<Node>,
    known: FxHashMap<State, usize>,
    open: BinaryHeap<Reverse<Rank>>,
    met: Met,
    guides: Vec<Guide>,
    /// What the nearest state lacked.
    least: u64,
    missing: Vec<String>,
    bytes: usize,
    limits: &'l mut Limits<'c>,
}

/// Plans without ground actions; what was found is made better among the actions on its objects.
///
/// # Errors
/// The outcome where only the expansions allowed for this way are used up, so that another may be tried.
pub(super) fn plan(asked: Asked<'_>, limits: &mut Limits<'_>) -> Result<Outcome, Outcome> {
    let (problem, options) = (asked.problem, asked.options);
    let raised = raised(problem, options).into_iter();
    let excluded: Vec<(usize, Environment)> = raised
        .filter(|(.., by)| by.is_infinite())
        .map(|(operator, binding, _)| (operator, binding))
        .collect();
    let steps = match search(problem, &excluded, asked.awake, limits) {
        Answer::Plan(steps) => {
            limits.note_plan();
            steps
        }
        Answer::Nothing => {
            let reason = reason::why_no_order(problem, options, limits.expanded());
            let unsolvable = Status::Unsolvable;
            return Ok(Outcome::without_plan(unsolvable, reason, limits.expanded()));
        }
        Answer::Stopped(stop, missing) => {
            let expanded = limits.expanded();
            let reason = reason::how_far_without_ground(stop, expanded, &missing);
            let outcome = Outcome::without_plan(Status::Limit, reason, expanded);
            let capped = stop == StopReason::Expansions && !limits.is_spent();
            return if capped { Err(outcome) } else { Ok(outcome) };
        }
    };
    let found = of_steps(asked, &steps, limits.expanded());
    let better = among_its_objects(asked, &steps, limits);
    Ok(match (found, better) {
        (Some(found), Some(better)) if found.cost <= better.cost => found,
        (found, better) => better.or(found).unwrap_or_else(|| {
            Outcome::without_plan(Status::Limit, String::new(), limits.expanded())
        }),
    })
}

/// The outcome of a plan that was found.
fn of_steps(asked: Asked<'_>, steps: &[Instance], expanded: u64) -> Option<Outcome> {
    let problem = asked.problem;
    let scope = Scope::Steps(steps.to_vec());
    // So little work that no limit is asked.
    let limits = &mut Limits::new();
    let reached = problem.reach(asked.awake, scope, limits).ok()?;
    let ground = ground(problem, asked.options, asked.awake, &reached, limits).ok()?;
    let (mut state, mut next) = (ground.task.initial().to_vec(), Vec::new());
    let mut actions = Vec::new();
    for step in 0..steps.len() {
        // Steps that cannot matter to the goal are no actions; some are several, by what they cost.
        let mut same = (0..).zip(&ground.actions);
        let applicable = same
            .find(|&(action, &index)| index == step && ground.task.is_applicable(&state, action));
        if let Some((action, _)) = applicable {
            ground.task.successor(&state, action, &mut next);
            std::mem::swap(&mut state, &mut next);
            actions.push(action);
        }
    }
    ground.task.plan_cost(&actions)?;
    Some(solved(
        problem, &reached, &ground, &actions, false, expanded,
    ))
}

/// The best plan that is found among the actions on the objects of some steps.
fn among_its_objects(
    asked: Asked<'_>,
    steps: &[Instance],
    limits: &mut Limits<'_>,
) -> Option<Outcome> {
    let problem = asked.problem;
    let mut objects = FixedBitSet::new();
    for step in steps {
        let operator = &problem.program.operators[step.operator];
        for &object in &step.objects[..operator.variables.len()] {
            objects.grow_and_insert(object as usize);
        }
    }
    let scope = Scope::At(objects, asked.many);
    let reached = problem.reach(asked.awake, scope, limits).ok()?;
    let outcome = (!reached.overflow).then(|| search_in(asked, &reached, limits))?;
    let optimal = false;
    (outcome.status == Status::Solved).then_some(Outcome { optimal, ..outcome })
}

/// Searches a plan. `excluded` are rules at bindings (as far as bound) that must not be used.
fn search(
    problem: &Problem,
    excluded: &[(usize, Environment)],
    awake: &[bool],
    limits: &mut Limits<'_>,
) -> Answer {
    let facts = &problem.world.facts;
    let operators = problem.program.operators.iter();
    let mut search = Search {
        problem,
        excluded,
        joins: operators.map(|o| Join::new(o, facts)).collect(),
        goal: Join::new(&problem.goal, facts),
        present: Present::new(problem, awake),
        nodes: Vec::new(),
        known: FxHashMap::default(),
        open: BinaryHeap::new(),
        met: Met::default(),
        guides: Vec::new(),
        least: u64::MAX,
        missing: Vec::new(),
        bytes: 0,
        limits,
    };
    match search.run() {
        Ok(Some(plan)) => Answer::Plan(plan),
        Ok(None) => Answer::Nothing,
        Err(stop) => Answer::Stopped(stop, search.missing),
    }
}

impl Search<'_, '_, '_> {
    fn run(&mut self) -> Result<Option<Vec<Instance>>, StopReason> {
        self.enter(Node {
            state: self.present.state().clone(),
            parent: 0,
            by: None,
            guide: 0,
            lacks: u64::MAX,
            passed: FixedBitSet::new(),
        });
        self.open.push(Reverse((1, u64::MAX, 0, 0)));
        while let Some(Reverse((.., node))) = self.open.pop() {
            let (present, met) = (self.present.bytes(), self.met.bytes());
            let queue = self.open.len() * size_of::<Rank>();
            self.limits.expand(self.bytes + present + met + queue)?;
            self.present.go(&self.nodes[node].state);
            if self.is_goal()? {
                return Ok(Some(self.way_to(node)));
            }
            if (self.guides.is_empty() || self.nodes[node].lacks < self.least)
                && !self.guide(node)?
            {
                continue;
            }
            for instance in self.successors()? {
                if let Some(last) = self.follow(node, instance) {
                    return Ok(Some(self.way_to(last)));
                }
            }
        }
        Ok(None)
    }

    fn enter(&mut self, node: Node) -> usize {
        let number = self.nodes.len();
        let objects = node.by.as_ref().map_or(0, |by| by.objects.len());
        self.bytes += 160 + 4 * (node.state.len() + objects) + node.passed.len() / 8;
        self.known.insert(node.state.clone(), number);
        self.nodes.push(node);
        number
    }

    fn way_to(&self, mut node: usize) -> Vec<Instance> {
        let mut way = Vec::new();
        while let Some(by) = &self.nodes[node].by {
            way.push(by.clone());
            node = self.nodes[node].parent;
        }
        way.reverse();
        way
    }

    /// Whether the goal holds in the present state, at any binding.
    fn is_goal(&mut self) -> Result<bool, StopReason> {
        let goal = &self.problem.goal;
        let found = self.bindings(None)?;
        let facts = self.present.facts();
        let mut found = found.into_iter();
        Ok(found.any(|mut environment| is_admitted(goal, &mut environment, facts)))
    }

    /// Bindings of a rule, or of the goal, in the present state.
    fn bindings(&mut self, operator: Option<usize>) -> Result<Vec<Environment>, StopReason> {
        let (pattern, join): (&Operator, &Join) = match operator {
            Some(number) => (&self.problem.program.operators[number], &self.joins[number]),
            None => (&self.problem.goal, &self.goal),
        };
        let mut found = Found::new(self.bytes, None, self.limits);
        join.all(pattern, self.present.facts(), &mut found);
        match found.stopped {
            Some(stop) => Err(stop),
            None => Ok(found.bindings),
        }
    }

    /// A new guide from the present state, which is nearer to the goal than any before; whether the goal may be
    /// reached from it at all.
    fn guide(&mut self, node: usize) -> Result<bool, StopReason> {
        let (facts, awake) = (self.present.facts(), self.present.awake());
        let way = self
            .problem
            .reach_from(facts, awake, Scope::Way, self.limits)?;
        if way.goals.is_empty() && !way.truncated {
            return Ok(false);
        }
        let relaxed = Relaxed::of(self.problem, &way, facts);
        let goal = way.goals.into_iter().next();
        let mut facts = FxHashMap::default();
        for atom in relaxed.facts {
            let next = facts.len();
            facts.entry(self.present.number(atom)).or_insert(next);
        }
        let guide = Guide { goal, facts };
        let entry = &mut self.nodes[node];
        entry.guide = self.guides.len() as u32;
        entry.passed = FixedBitSet::with_capacity(guide.facts.len());
        entry.lacks = lacks(self.problem, &guide, self.present.facts());
        self.least = entry.lacks;
        self.missing = match &guide.goal {
            Some(goal) => self.problem.missing(self.present.facts(), goal),
            None => Vec::new(),
        };
        self.guides.push(guide);
        Ok(true)
    }

    /// The rules at the bindings that hold in the present state.
    fn successors(&mut self) -> Result<Vec<Instance>, StopReason> {
        let mut all = Vec::new();
        for number in 0..self.problem.program.operators.len() {
            if !self.present.awake()[number] {
                continue;
            }
            let spare = self.present.next_spare(number);
            let Some(created) = self.problem.spare(number, spare) else {
                continue;
            };
            let operator = &self.problem.program.operators[number];
            for mut objects in self.bindings(Some(number))? {
                let bound = operator.bound;
                objects[bound..bound + created.len()].copy_from_slice(created);
                if is_admitted(operator, &mut objects, self.present.facts())
                    && self.is_allowed(number, &objects)
                {
                    all.push(Instance {
                        operator: number,
                        objects,
                        spare,
                    });
                }
            }
        }
        Ok(all)
    }

    /// Whether a rule has a cost at a binding, and is not excluded there.
    fn is_allowed(&self, number: usize, objects: &Environment) -> bool {
        let operator = &self.problem.program.operators[number];
        let facts = self.present.facts();
        let mut read = |place: Place| facts.value(place.at(objects)).cloned();
        let mut excluded = self.excluded.iter();
        amount(evaluate(&operator.cost, &mut read).as_ref()).is_some()
            && !excluded.any(|(operator, at)| *operator == number && covers(at, objects))
    }

    /// Enters the state that an instance leads to from the present one; gives it where the goal holds there.
    fn follow(&mut self, parent: usize, by: Instance) -> Option<usize> {
        let changed = self.present.changed_by(&by)?;
        self.present.change(&changed);
        let entered = self.meet(parent, by, &changed);
        self.present.change(&changed);
        entered
    }

    fn meet(&mut self, parent: usize, by: Instance, changed: &[u32]) -> Option<usize> {
        let state = self.present.state().clone();
        if self.known.contains_key(&state) {
            return None;
        }
        let Node {
            guide,
            lacks: lacked,
            ref passed,
            ..
        } = self.nodes[parent];
        let mut passed = passed.clone();
        let way = &self.guides[guide as usize];
        let holding = |atoms: &[u32]| -> Vec<u32> {
            let holding = atoms.iter().filter(|&&atom| self.present.holds(atom));
            holding.copied().collect()
        };
        let (gained, all) = (holding(changed), holding(&state));
        let before = passed.count_ones(..);
        for place in gained.iter().filter_map(|atom| way.facts.get(atom)) {
            passed.insert(*place);
        }
        let lacks = lacks(self.problem, way, self.present.facts());
        let after = passed.count_ones(..);
        let left = way.facts.len() - after;
        let same = (lacks, after) == (lacked, before);
        let gained = if same { &gained } else { &all };
        let novelty = self.met.novelty((guide, lacks, left), gained, &all);
        let done = lacks == 0 && way.goal.is_some();
        let node = self.enter(Node {
            state,
            parent,
            by: Some(by),
            guide,
            lacks,
            passed,
        });
        self.open.push(Reverse((novelty, lacks, left, node)));
        done.then_some(node)
    }
}

/// How much of the goal does not hold, by what a guide takes the goal to be about.
fn lacks(problem: &Problem, guide: &Guide, facts: &Facts) -> u64 {
    let Some(goal) = &guide.goal else {
        return 1;
    };
    lacking(&problem.goal, facts, &mut goal.clone())
}
