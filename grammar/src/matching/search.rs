//! Backtracking along a plan.
//!
//! Guarantee: every match comes exactly once, in an order that the graph and the plan alone
//! determine; matches are injective.

use super::domain::Domain;
use super::evaluate::{Environment, is_there, node};
use super::plan::{Source, Step, plan};
use super::program::{Link, Slot, Test};
use crate::{Binding, Name};
use dsr::{EdgeKey, NodeId, ReadError, Snapshot};
use std::fmt;

/// A pattern and conditions, ready to be looked for.
#[derive(Debug)]
pub(crate) struct Problem {
    /// Variables by slot.
    pub(crate) variables: Vec<Name>,
    /// By slot.
    pub(crate) domains: Vec<Domain>,
    pub(crate) links: Vec<Link>,
    pub(crate) tests: Vec<Test>,
    /// At least one slot per variable, more for quantified ones.
    pub(crate) environment: Environment,
}

/// One or two nodes for the slots that a step binds.
type Candidate = (NodeId, Option<NodeId>);
type Candidates<'a> = Box<dyn Iterator<Item = Result<Candidate, ReadError>> + 'a>;

/// The matches of a rule or goal, found one at a time.
///
/// Ends after the first [`ReadError`] (a snapshot that became too old, say).
pub struct Matches<'a> {
    snapshot: &'a Snapshot,
    problem: Problem,
    steps: Vec<Step>,
    levels: Vec<Candidates<'a>>,
    state: State,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Fresh,
    Running,
    Done,
}

impl fmt::Debug for Matches<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Matches")
            .field("problem", &self.problem)
            .field("steps", &self.steps)
            .field("state", &self.state)
            .finish_non_exhaustive()
    }
}

impl<'a> Matches<'a> {
    pub(crate) fn new(snapshot: &'a Snapshot, problem: Problem) -> Result<Self, ReadError> {
        let given: Vec<usize> = (0..problem.variables.len())
            .filter(|&slot| node(&problem.environment, slot).is_some())
            .collect();
        let Problem {
            domains,
            links,
            tests,
            ..
        } = &problem;
        let steps = plan(snapshot, domains, links, tests, &problem.environment)?;
        let mut matches = Self {
            snapshot,
            problem,
            steps,
            levels: Vec::new(),
            state: State::Fresh,
        };
        if !matches.given_holds(&given)? {
            matches.state = State::Done;
        }
        Ok(matches)
    }

    /// What can be said of the slots that are bound from the start.
    fn given_holds(&mut self, given: &[usize]) -> Result<bool, ReadError> {
        for (index, &slot) in given.iter().enumerate() {
            if !self.fits(slot, &given[..index])? {
                return Ok(false);
            }
        }
        let all_given = |slots: [usize; 2]| slots.iter().all(|slot| given.contains(slot));
        for link in &self.problem.links {
            if all_given([link.from, link.to])
                && is_there(self.snapshot, link, &self.problem.environment)? == link.negated
            {
                return Ok(false);
            }
        }
        let Problem {
            variables,
            tests,
            environment,
            ..
        } = &mut self.problem;
        for test in &*tests {
            let ready = (0..variables.len()).all(|slot| given.contains(&slot) || !test.reads(slot));
            if ready && !test.holds(self.snapshot, environment)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Whether the slot's node is there, of its type, and none of the others.
    fn fits(&self, slot: usize, others: &[usize]) -> Result<bool, ReadError> {
        let environment = &self.problem.environment;
        if others
            .iter()
            .any(|&other| environment[other] == environment[slot])
        {
            return Ok(false);
        }
        let Some(id) = node(environment, slot) else {
            return Ok(false);
        };
        let found = self.snapshot.find_node(id)?;
        Ok(found.is_some_and(|node| self.problem.domains[slot].contains(node.type_id())))
    }

    fn candidates(&self, depth: usize) -> Result<Candidates<'a>, ReadError> {
        let snapshot = self.snapshot;
        let environment = &self.problem.environment;
        let nothing = || -> Candidates<'a> { Box::new(std::iter::empty()) };
        let one = |id: NodeId| (id, None);
        Ok(match self.steps[depth].source {
            Source::Nodes { slot } => Box::new(
                self.problem.domains[slot]
                    .nodes(snapshot)
                    .map(move |id| id.map(one)),
            ),
            Source::Edges { link } => match self.problem.links[link].label {
                Some(label) => Box::new(
                    snapshot
                        .edges_of_label(label)
                        .map(|key| key.map(|key| (key.from, Some(key.to)))),
                ),
                None => nothing(),
            },
            Source::Out { link } => {
                let link = self.problem.links[link];
                let (Some(from), Some(label)) = (node(environment, link.from), link.label) else {
                    return Ok(nothing());
                };
                let Some(from) = snapshot.find_node(from)? else {
                    return Ok(nothing());
                };
                let edges = from.out_edges_of(label);
                Box::new(edges.map(move |key| key.map(|key: EdgeKey| one(key.to))))
            }
            Source::In { link } => {
                let link = self.problem.links[link];
                let (Some(to), Some(label)) = (node(environment, link.to), link.label) else {
                    return Ok(nothing());
                };
                let Some(to) = snapshot.find_node(to)? else {
                    return Ok(nothing());
                };
                let edges = to.in_edges_of(label);
                Box::new(edges.map(move |key| key.map(|key: EdgeKey| one(key.from))))
            }
        })
    }

    /// Puts a candidate into its slots and tests what can be tested now.
    fn accept(&mut self, depth: usize, candidate: Candidate) -> Result<bool, ReadError> {
        let step = &self.steps[depth];
        let slots = step.source.binds(&self.problem.links);
        let nodes = [Some(candidate.0), candidate.1];
        for (slot, node) in slots.iter().zip(nodes) {
            if let (Some(slot), Some(node)) = (slot, node) {
                self.problem.environment[*slot] = Slot::Node(node);
            }
        }
        if let [Some(first), Some(second)] = slots
            && self.problem.environment[first] == self.problem.environment[second]
        {
            return Ok(false);
        }
        for slot in slots.into_iter().flatten() {
            if !self.fits(slot, &step.bound)? {
                return Ok(false);
            }
        }
        for &index in &step.links {
            let link = &self.problem.links[index];
            if is_there(self.snapshot, link, &self.problem.environment)? == link.negated {
                return Ok(false);
            }
        }
        let Problem {
            tests, environment, ..
        } = &mut self.problem;
        for &index in &step.tests {
            if !tests[index].holds(self.snapshot, environment)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Where each step of the plan finds its candidates.
    #[cfg(test)]
    pub(super) fn sources(&self) -> impl Iterator<Item = String> {
        self.steps.iter().map(|step| format!("{:?}", step.source))
    }

    fn advance(&mut self) -> Result<Option<Binding>, ReadError> {
        if self.state == State::Fresh {
            self.state = State::Running;
            if self.steps.is_empty() {
                self.state = State::Done;
                return Ok(Some(self.binding()));
            }
            let first = self.candidates(0)?;
            self.levels.push(first);
        }
        while let Some(depth) = self.levels.len().checked_sub(1) {
            let Some(candidate) = self.levels[depth].next() else {
                self.levels.pop();
                continue;
            };
            if !self.accept(depth, candidate?)? {
                continue;
            }
            if depth + 1 == self.steps.len() {
                return Ok(Some(self.binding()));
            }
            let next = self.candidates(depth + 1)?;
            self.levels.push(next);
        }
        Ok(None)
    }

    fn binding(&self) -> Binding {
        let nodes = self.problem.variables.iter().enumerate();
        nodes
            .filter_map(|(slot, name)| Some((name.clone(), node(&self.problem.environment, slot)?)))
            .collect()
    }
}

impl Iterator for Matches<'_> {
    type Item = Result<Binding, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.state == State::Done {
            return None;
        }
        let next = self.advance();
        if !matches!(next, Ok(Some(_))) {
            self.state = State::Done;
        }
        next.transpose()
    }
}
