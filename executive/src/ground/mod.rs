//! From a snapshot, a grammar and a goal to a ground task: rules are matched along links, not tried
//! on every choice of nodes. This module guarantees that the plans of the task are the plans of the
//! rules, as long as no rule is applied more often than it has spare objects for what it creates.

mod build;
mod choices;
mod compile;
mod effects;
mod explain;
mod facts;
mod join;
mod program;
mod reach;
mod simulate;
mod truth;
mod value;
mod vocabulary;
mod words;
mod world;

pub(crate) use build::{Atom, Ground, Unpriced, build};
pub(crate) use facts::Facts;
pub(crate) use join::{Found, Plan as Join};
pub(crate) use program::{Environment, Link, Object, Operator, Place, UNBOUND, Variable};
pub(crate) use reach::{Arrival, Instance, Reached, Scope, reach};
pub(crate) use simulate::{changes, is_admitted};
pub(crate) use truth::lacking;
pub(crate) use value::{amount, evaluate};

use crate::search::{Limits, StopReason};
use crate::task::MOST_COST;
use dsr::{ReadError, Snapshot};
use grammar::{Goal, GoalConstants, Grammar};
use program::Program;
use thiserror::Error;
use words::Words;
use world::World;

/// Why a goal cannot be looked at.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub(crate) enum ProblemError {
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The goal itself is at fault.
    #[error("{0}")]
    Goal(String),
}

/// A goal, the rules that may lead to it, and the world they start from.
#[derive(Debug)]
pub(crate) struct Problem {
    pub(crate) program: Program,
    pub(crate) goal: Operator,
    pub(crate) world: World,
    /// Names of objects: nodes, then spares.
    names: Vec<String>,
    /// Objects for what rules create: by operator, by application, by variable.
    spares: Vec<Vec<Vec<Object>>>,
}

impl Problem {
    /// Reads what the goal and the rules can speak of. Each rule may create nodes `spares` times.
    pub(crate) fn read(
        grammar: &Grammar,
        snapshot: &Snapshot,
        goal: &Goal,
        spares: usize,
    ) -> Result<Self, ProblemError> {
        let (program, mut wanted) =
            compile::compile(grammar, goal, snapshot.schema()).map_err(ProblemError::Goal)?;
        let world = World::read(snapshot, &program, &wanted)?;
        let constants = match goal.find_constants(snapshot)? {
            GoalConstants::Found(constants) => constants,
            GoalConstants::Missing(obstacle) => {
                return Err(ProblemError::Goal(obstacle.to_string()));
            }
        };
        for (slot, variable) in wanted.variables.iter().enumerate() {
            let Some(node) = constants.get(&variable.name) else {
                continue;
            };
            let Some(object) = world.object(node) else {
                let reason = format!("{} is not of the type that the goal says", variable.name);
                return Err(ProblemError::Goal(reason));
            };
            wanted.fixed.push((slot, object));
        }
        let mut problem = Self {
            names: world.names.clone(),
            spares: Vec::new(),
            goal: wanted,
            program,
            world,
        };
        problem.make_spares(spares);
        Ok(problem)
    }

    fn make_spares(&mut self, count: usize) {
        for operator in &self.program.operators {
            let mut applications = Vec::new();
            let count = if operator.creates() { count } else { 0 };
            for application in 1..=count {
                let mut objects = Vec::new();
                for variable in &operator.variables[operator.bound..] {
                    objects.push(self.world.facts.add_object());
                    let rule = &operator.name;
                    self.names
                        .push(format!("{rule}.{}#{application}", variable.name));
                }
                applications.push(objects);
            }
            self.spares.push(applications);
        }
    }

    /// Which operators are not dormant, those of the rules in `woken` counted in.
    pub(crate) fn awake(&self, woken: &[String]) -> Vec<bool> {
        let operators = self.program.operators.iter();
        operators
            .map(|o| !o.dormant || woken.contains(&o.name))
            .collect()
    }

    /// The objects for what an operator creates when it takes a spare; nothing for one that creates nothing, and
    /// `None` where there are not so many spares.
    pub(crate) fn spare(&self, operator: usize, spare: usize) -> Option<&[Object]> {
        if !self.program.operators[operator].creates() {
            return Some(&[]);
        }
        self.spares[operator].get(spare).map(Vec::as_slice)
    }

    /// What may come to hold.
    pub(crate) fn reach(
        &self,
        awake: &[bool],
        scope: Scope,
        limits: &mut Limits<'_>,
    ) -> Result<Reached, StopReason> {
        self.reach_from(&self.world.facts, awake, scope, limits)
    }

    /// What may come to hold from other facts.
    pub(crate) fn reach_from(
        &self,
        facts: &Facts,
        awake: &[bool],
        scope: Scope,
        limits: &mut Limits<'_>,
    ) -> Result<Reached, StopReason> {
        reach(
            &self.program,
            &self.goal,
            facts,
            &self.spares,
            awake.to_vec(),
            scope,
            limits,
        )
    }

    /// The name of an object.
    pub(crate) fn name(&self, object: Object) -> &str {
        &self.names[object as usize]
    }

    /// The names of what the variables of an instance's rule stand for.
    pub(crate) fn arguments(&self, instance: &Instance) -> Vec<String> {
        let count = self.program.operators[instance.operator].variables.len();
        let objects = instance.objects[..count].iter();
        objects
            .map(|&object| self.name(object).to_owned())
            .collect()
    }

    pub(crate) fn words(&self) -> Words<'_> {
        Words {
            vocabulary: &self.program.vocabulary,
            names: &self.names,
        }
    }

    /// A link of the graph in words; other atoms have none.
    pub(crate) fn atom(&self, atom: Atom) -> Option<String> {
        let Atom::Link(link) = atom else {
            return None;
        };
        let label = self.program.vocabulary.labels.name(link.label);
        Some(format!(
            "{} -{label}-> {}",
            self.name(link.from),
            self.name(link.to)
        ))
    }

    /// What of the goal does not hold at a binding, in words.
    pub(crate) fn missing(&self, facts: &Facts, environment: &Environment) -> Vec<String> {
        let (goal, words) = (&self.goal, self.words());
        let links = goal.links.iter();
        let links = links.filter(|link| !facts.has_link(link.at(environment)));
        let links = links.map(|&link| words.link(link, goal, environment));
        let absent = goal.absent.iter();
        let absent = absent.filter(|link| facts.has_link(link.at(environment)));
        let absent = absent.map(|&link| format!("without {}", words.link(link, goal, environment)));
        let tests = goal.tests.iter();
        let tests = tests.filter(|test| !truth::holds(test, facts, &mut environment.clone()));
        let tests = tests.map(|test| words.test(test, goal, environment));
        links.chain(absent).chain(tests).collect()
    }

    /// Why a rule was left out at some bindings, in words.
    pub(crate) fn unpriced(&self, unpriced: &Unpriced) -> String {
        let operator = &self.program.operators[unpriced.operator];
        let (rule, objects) = (&operator.name, &unpriced.objects);
        let variables = operator.variables[..operator.bound].iter().zip(objects);
        let binding: Vec<String> = variables
            .map(|(variable, &object)| format!("{}={}", variable.name, self.name(object)))
            .collect();
        let binding = binding.join(", ");
        let cost = self.words().term(&operator.cost, operator, objects);
        let is = match unpriced.value.as_ref().map(dsr::Value::as_f64) {
            None => "has no value".to_owned(),
            Some(None) => "is no number".to_owned(),
            Some(Some(amount)) => format!("is {amount}, and costs are from 0 to {MOST_COST}"),
        };
        let others = match unpriced.times {
            1 => String::new(),
            2 => " (and at another binding)".to_owned(),
            times => format!(" (and at {} other bindings)", times - 1),
        };
        format!("{rule}({binding}) was left out, since its cost {cost} {is}{others}")
    }

    /// The operator of a rule.
    pub(crate) fn operator(&self, rule: &str) -> Option<usize> {
        let mut operators = self.program.operators.iter();
        operators.position(|operator| operator.name == rule)
    }

    /// What an operator's variables stand for by names of nodes, [`UNBOUND`] where there is none.
    pub(crate) fn environment<'n>(
        &self,
        operator: usize,
        binding: impl IntoIterator<Item = (&'n str, &'n str)>,
    ) -> Option<Environment> {
        let operator = &self.program.operators[operator];
        let mut environment = operator.environment();
        for (variable, name) in binding {
            let variables = &operator.variables[..operator.bound];
            let slot = variables.iter().position(|v| v.name == variable)?;
            environment[slot] = self.world.object_named(name)?;
        }
        environment.truncate(operator.bound);
        Some(environment)
    }
}

#[cfg(test)]
mod tests;
