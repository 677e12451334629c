//! Whether a goal holds, and where.
//!
//! Guarantee: a goal holds exactly where its constants exist and its graph and condition match
//! injectively.

use crate::matching::Problem;
use crate::{Binding, Constant, Goal, Grammar, MatchError, Matches, Obstacle, PatternNode};
use dsr::{NodeId, ReadError, Snapshot};
use std::sync::Arc;

impl Goal {
    /// The nodes that its constants stand for.
    ///
    /// # Errors
    /// [`Obstacle::NoConstant`] in [`GoalConstants::Missing`] is no error; a [`ReadError`] is.
    pub fn find_constants(&self, snapshot: &Snapshot) -> Result<GoalConstants, ReadError> {
        let mut binding = Binding::new();
        for node in &self.pattern.nodes {
            let Some(constant) = self.constants.get(&*node.variable) else {
                continue;
            };
            let found = match constant {
                Constant::Id(id) => snapshot.find_node(NodeId(*id))?,
                Constant::Name(name) => snapshot.find_node_by_name(name)?,
            };
            let Some(found) = found else {
                let constant = node.variable.to_string();
                return Ok(GoalConstants::Missing(Obstacle::NoConstant { constant }));
            };
            binding.insert(node.variable.clone(), found.id());
        }
        Ok(GoalConstants::Found(binding))
    }
}

/// What a snapshot has of a goal's constants.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum GoalConstants {
    /// All of them.
    Found(Binding),
    /// Not this one.
    Missing(Obstacle),
}

impl Grammar {
    /// A binding of the goal's nodes, constants included, at which the goal holds; `None` if it
    /// does not hold.
    ///
    /// # Errors
    /// [`MatchError`] where the snapshot cannot be read or the goal uses undeclared variables.
    pub fn goal_holds(
        &self,
        snapshot: &Snapshot,
        goal: &Goal,
    ) -> Result<Option<Binding>, MatchError> {
        let GoalConstants::Found(constants) = goal.find_constants(snapshot)? else {
            return Ok(None);
        };
        let problem = self.goal_problem(snapshot, goal, &constants)?;
        Matches::new(snapshot, problem)?.next().transpose()
    }

    /// What keeps the goal from holding; `None` if it holds. Where a goal has variables and
    /// no constant is to blame, this only says that nothing matches.
    ///
    /// # Errors
    /// [`MatchError`], as for [`Self::goal_holds`].
    pub fn goal_obstacle(
        &self,
        snapshot: &Snapshot,
        goal: &Goal,
    ) -> Result<Option<Obstacle>, MatchError> {
        let constants = match goal.find_constants(snapshot)? {
            GoalConstants::Found(constants) => constants,
            GoalConstants::Missing(obstacle) => return Ok(Some(obstacle)),
        };
        let problem = self.goal_problem(snapshot, goal, &constants)?;
        if constants.len() < goal.pattern.nodes.len() {
            let found = Matches::new(snapshot, problem)?.next().transpose()?;
            let of = "goal".to_owned();
            return Ok(found.is_none().then_some(Obstacle::NoMatch { of }));
        }
        let nodes: Vec<&PatternNode> = goal.pattern.nodes.iter().collect();
        let (edges, condition) = (&goal.pattern.edges, goal.precondition.as_ref());
        self.explain(snapshot, problem, &nodes, edges, condition)
    }

    fn goal_problem(
        &self,
        snapshot: &Snapshot,
        goal: &Goal,
        constants: &Binding,
    ) -> Result<Problem, MatchError> {
        let nodes: Vec<&PatternNode> = goal.pattern.nodes.iter().collect();
        let (edges, condition) = (&goal.pattern.edges, goal.precondition.as_ref());
        let query = self.query(snapshot.schema(), &nodes, &[], edges, condition)?;
        Arc::new(query).at("the goal", constants)
    }
}

#[cfg(test)]
mod tests;
