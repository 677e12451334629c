//! Where a rule's left side is found, and why it is not.
//!
//! Guarantee: matching is injective and subtype-aware, and reads the snapshot in place.

mod ahead;
mod candidates;
mod choice;
mod domain;
mod environment;
mod evaluate;
mod explain;
mod frame;
mod host;
mod matcher;
mod matches;
mod obstacle;
mod plan;
mod planned;
mod program;
mod query;
mod search;
mod statistics;
mod values;
mod watch;

pub use environment::{CHOICE_LIMIT, SEARCH_LIMIT, WHOLE_LIMIT};
pub use explain::{SearchPlan, SearchStep};
pub use matcher::Matcher;
pub use matches::Matches;
pub use obstacle::{End, Obstacle};
pub use watch::{MatchDelta, RuleMatch, SharedSteps, Watch};

pub(crate) use ahead::Ahead;
pub(crate) use choice::Choices;
pub(crate) use domain::Domain as MatchDomain;
pub(crate) use environment::{Environment, Interrupt};
pub(crate) use frame::{Frame, Slots};
pub(crate) use host::{Host, Way};
pub(crate) use plan::Plan;
pub(crate) use planned::Planned;
pub(crate) use program::{Compiler, Link, Slot, Term, Test};
pub(crate) use query::Problem;
pub(crate) use values::words;

use crate::{Binding, Condition, Expression, Grammar, Number, PatternEdge, PatternNode, Rule};
use dsr::{ReadError, Snapshot, Value};
use std::sync::Arc;

/// Why a match, condition or expression could not be looked at.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MatchError {
    /// The snapshot cannot be read (any more).
    #[error(transparent)]
    Read(#[from] ReadError),
    /// So many nodes were tried that it was given up: quantifiers are nested, or nothing joins the
    /// nodes of a pattern. See [`CHOICE_LIMIT`] and [`SEARCH_LIMIT`].
    #[error("given up after {limit} nodes had been tried for its variables")]
    Limit {
        /// How many.
        limit: u64,
    },
    /// So many nodes were tried for all matches that no more are looked for; there may be more. See
    /// [`Matches::within_all`].
    #[error("stopped after {limit} nodes had been tried: there may be more matches")]
    Whole {
        /// How many.
        limit: u64,
    },
    /// Something uses a variable that is not in scope; checking the grammar reports the place.
    #[error("no variable `{variable}` is in scope")]
    UnknownVariable {
        /// The variable.
        variable: String,
    },
    /// The grammar has no such rule.
    #[error("no rule `{rule}`{}", did_you_mean(.suggestion.as_deref()))]
    NoRule {
        /// As asked for.
        rule: String,
        /// What was probably meant.
        suggestion: Option<String>,
    },
    /// A binding has a variable that the rule does not have.
    #[error("rule `{rule}` has no variable `{variable}` to bind{}", did_you_mean(.suggestion.as_deref()))]
    NotOfRule {
        /// The rule.
        rule: String,
        /// The variable.
        variable: String,
        /// What was probably meant.
        suggestion: Option<String>,
    },
}

impl From<Interrupt> for MatchError {
    fn from(interrupt: Interrupt) -> Self {
        match interrupt {
            Interrupt::Read(error) => Self::Read(error),
            Interrupt::Limit(limit) => Self::Limit { limit },
            Interrupt::Whole(limit) => Self::Whole { limit },
        }
    }
}

fn did_you_mean(suggestion: Option<&str>) -> String {
    suggestion.map_or_else(String::new, |name| format!(", did you mean `{name}`?"))
}

/// Why an expression has no value.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ValueError {
    /// It could not be looked at.
    #[error(transparent)]
    Match(#[from] MatchError),
    /// An attribute is missing or is no number, or the arithmetic has no result.
    #[error("`{expression}` has no value{}", because(.values))]
    Undefined {
        /// The expression.
        expression: String,
        /// The attributes in it and what they are.
        values: String,
    },
    /// A cost or duration that is negative or no number.
    #[error("`{expression}` is {value}, but must be a number that is 0 or more")]
    NotACost {
        /// The expression.
        expression: String,
        /// Its value.
        value: String,
    },
}

impl From<ReadError> for ValueError {
    fn from(error: ReadError) -> Self {
        Self::Match(error.into())
    }
}

fn because(values: &str) -> String {
    if values.is_empty() {
        String::new()
    } else {
        format!(": {values}")
    }
}

impl Grammar {
    /// The matches of a rule's left side, parameters and precondition that extend `partial`,
    /// found one at a time; each binds [`Rule::bound_nodes`] in that order.
    ///
    /// Matching is injective, and a node matches a type that its own inherits from (by the
    /// graph's schema or by the grammar's types block).
    ///
    /// # Errors
    /// [`MatchError`] where `partial` or the rule uses variables that the rule does not have, or
    /// the snapshot cannot be read; the iterator gives one that comes up later.
    ///
    /// # Complexity
    /// Backtracking along a plan that starts where the snapshot's counts of nodes per type and
    /// edges per label promise the fewest candidates, and follows links both ways.
    pub fn matches<'a>(
        &self,
        snapshot: &'a Snapshot,
        rule: &Rule,
        partial: &Binding,
    ) -> Result<Matches<'a>, MatchError> {
        let problem = self.rule_problem(snapshot, rule, partial)?;
        Ok(Matches::new(snapshot, problem)?)
    }

    /// What keeps the rule from being applied at `binding`: `None` if its left side and
    /// precondition hold there.
    ///
    /// # Errors
    /// [`MatchError`], as for [`Self::matches`].
    pub fn obstacle(
        &self,
        snapshot: &Snapshot,
        rule: &Rule,
        binding: &Binding,
    ) -> Result<Option<Obstacle>, MatchError> {
        let problem = self.rule_problem(snapshot, rule, binding)?;
        let nodes: Vec<&PatternNode> = rule.bound_nodes().collect();
        self.explain(
            snapshot,
            problem,
            &nodes,
            &rule.left.edges,
            rule.precondition.as_ref(),
        )
    }

    /// What of the rule's right side does not hold at `binding` (which binds the left side):
    /// `None` if the state that the rule aims at is reached. Nodes that the rule creates may be
    /// any that fit; effect blocks are not looked at.
    ///
    /// # Errors
    /// [`MatchError`], as for [`Self::matches`].
    pub fn outcome_obstacle(
        &self,
        snapshot: &Snapshot,
        rule: &Rule,
        binding: &Binding,
    ) -> Result<Option<Obstacle>, MatchError> {
        let kept = |variable: &str| rule.right.node(variable).is_some();
        for node in &rule.left.nodes {
            if !kept(&node.variable)
                && let Some(id) = binding.get(&node.variable)
                && snapshot.find_node(id)?.is_some()
            {
                let end = obstacle::end(snapshot, &node.variable, id)?;
                return Ok(Some(Obstacle::StillThere { node: end }));
            }
        }
        let extra = rule
            .parameters
            .iter()
            .filter(|node| !kept(&node.variable) && rule.left.node(&node.variable).is_none());
        let nodes: Vec<&PatternNode> = rule.right.nodes.iter().chain(extra).collect();
        let known = |variable: &str| nodes.iter().any(|node| node.variable == *variable);
        let mut edges = rule.right.edges.clone();
        for edge in rule.left.edges.iter().filter(|edge| !edge.negated) {
            let on_right = rule.right.edge(&edge.from, &edge.label, &edge.to).is_some();
            if !on_right && known(&edge.from) && known(&edge.to) {
                edges.push(PatternEdge {
                    negated: true,
                    ..edge.clone()
                });
            }
        }
        let kept = binding.iter().filter(|(variable, _)| known(variable));
        let binding = kept
            .map(|(variable, node)| (variable.clone(), node))
            .collect();
        let query = self.query(snapshot.schema(), &nodes, &[], &edges, None)?;
        let problem = Arc::new(query).at(&rule.name, &binding)?;
        if binding.len() == nodes.len() {
            return self.explain(snapshot, problem, &nodes, &edges, None);
        }
        match Matches::new(snapshot, problem)?.next().transpose()? {
            Some(_) => Ok(None),
            None => Ok(Some(Obstacle::NoMatch {
                of: format!("right side of `{}`", rule.name),
            })),
        }
    }

    /// The rule's cost at a binding of its left side.
    ///
    /// # Errors
    /// [`ValueError`] where it is no number, or negative.
    pub fn cost(
        &self,
        snapshot: &Snapshot,
        rule: &Rule,
        binding: &Binding,
    ) -> Result<f64, ValueError> {
        self.amount(snapshot, rule, &rule.cost, binding)
    }

    /// How long the rule is expected to take at a binding of its left side, seconds; `None` if
    /// it does not say.
    ///
    /// # Errors
    /// [`ValueError`] where it is no number, or negative.
    pub fn duration(
        &self,
        snapshot: &Snapshot,
        rule: &Rule,
        binding: &Binding,
    ) -> Result<Option<f64>, ValueError> {
        let duration = rule.duration.as_ref();
        duration
            .map(|duration| self.amount(snapshot, rule, duration, binding))
            .transpose()
    }

    fn amount(
        &self,
        snapshot: &Snapshot,
        rule: &Rule,
        expression: &Expression,
        binding: &Binding,
    ) -> Result<f64, ValueError> {
        if let Some(constant) = expression.as_number().filter(|constant| *constant >= 0.0) {
            return Ok(constant);
        }
        let value = self.value(snapshot, rule, expression, binding)?;
        match Number::of(&value).map(Number::real) {
            Some(amount) if amount >= 0.0 && amount.is_finite() => Ok(amount),
            _ => Err(ValueError::NotACost {
                expression: expression.to_string(),
                value: words(&value),
            }),
        }
    }

    /// The value of an expression over a rule's variables, at a binding.
    ///
    /// # Errors
    /// [`ValueError`] where it has none.
    pub fn value(
        &self,
        snapshot: &Snapshot,
        rule: &Rule,
        expression: &Expression,
        binding: &Binding,
    ) -> Result<Value, ValueError> {
        let mut compiler = Compiler::new(&self.types, snapshot.schema());
        let mut environment = Environment::new(0, CHOICE_LIMIT);
        for node in rule.bound_nodes() {
            compiler.declare(&node.variable);
            let bound = binding.get(&node.variable);
            environment.push(bound.map_or(Slot::Unbound, Slot::Node));
        }
        let term = compiler.term(expression)?;
        match term.value(snapshot, &environment)? {
            Some(value) => Ok(value),
            None => Err(ValueError::Undefined {
                expression: expression.to_string(),
                values: values::values(snapshot, &compiler, &environment, &[expression])?,
            }),
        }
    }

    fn rule_problem(
        &self,
        snapshot: &Snapshot,
        rule: &Rule,
        binding: &Binding,
    ) -> Result<Problem, MatchError> {
        let query = self.rule_query(snapshot.schema(), rule)?;
        Arc::new(query).at(&rule.name, binding)
    }
}

/// The conditions that must all hold for this one to hold.
pub(crate) fn conjuncts(condition: &Condition) -> Vec<&Condition> {
    match condition {
        Condition::And(all) => all.iter().flat_map(conjuncts).collect(),
        other => vec![other],
    }
}

#[cfg(test)]
mod tests;
