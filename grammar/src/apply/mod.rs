//! What applying a rule changes.
//!
//! Guarantee: a rule is only ever turned into operations at a binding at which its left side and
//! precondition hold, and the operations make the right side and the effects hold.

mod change;
mod effect;

use crate::matching::{CHOICE_LIMIT, Compiler, Environment, Interrupt, Link, Slot};
use crate::{Binding, Grammar, MatchError, Obstacle, Rule};
pub use change::CHANGE_LIMIT;
pub(crate) use change::convert;
use change::{Changes, End};
use dsr::{Change, NodeId, Operation, ReadError, Refusal, RuleEngine, Snapshot};
use std::sync::Arc;

/// Why a rule cannot be applied.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ApplyError {
    /// The grammar has no such rule.
    #[error("no rule `{rule}`{}", did_you_mean(.suggestion.as_deref()))]
    NoRule {
        /// As asked for.
        rule: String,
        /// What was probably meant.
        suggestion: Option<String>,
    },
    /// The left side or the precondition does not hold.
    #[error("{0}")]
    Obstacle(Box<Obstacle>),
    /// The rule is dormant, and no rule that activates it has been applied.
    #[error("`{rule}` is dormant and has not been activated")]
    Asleep {
        /// The rule, or the step of a combo.
        rule: String,
    },
    /// The rule is `strict` and would leave links hanging.
    #[error(
        "{variable} ({node}) cannot be deleted: the rule is strict and the node has a link `{label}` that the rule does not delete"
    )]
    Dangling {
        /// The variable of the node to be deleted.
        variable: String,
        /// The node's name.
        node: String,
        /// The label of a link that would hang.
        label: String,
    },
    /// An assigned expression has no value.
    #[error("`{expression}` has no value")]
    Undefined {
        /// The expression.
        expression: String,
    },
    /// Effects set one thing to two values; effects happen at once, so that neither comes last.
    #[error("the rule sets the {what} both to {first} and to {second}")]
    Contradiction {
        /// What is set.
        what: String,
        /// To one value
        first: String,
        /// and to another.
        second: String,
    },
    /// Quantified effects would change more, or go through more nodes, than one rule may.
    #[error("its effects go beyond {changes} changes or {choices} choices of nodes")]
    TooMuch {
        /// [`CHANGE_LIMIT`].
        changes: usize,
        /// [`CHOICE_LIMIT`].
        choices: u64,
    },
    /// The rule could not be looked at.
    #[error(transparent)]
    Match(#[from] MatchError),
}

impl From<Interrupt> for ApplyError {
    fn from(interrupt: Interrupt) -> Self {
        match interrupt {
            Interrupt::Read(error) => error.into(),
            Interrupt::Limit(_) | Interrupt::Whole(_) => Self::TooMuch {
                changes: CHANGE_LIMIT,
                choices: CHOICE_LIMIT,
            },
        }
    }
}

impl From<ReadError> for ApplyError {
    fn from(error: ReadError) -> Self {
        Self::Match(error.into())
    }
}

fn did_you_mean(suggestion: Option<&str>) -> String {
    suggestion.map_or_else(String::new, |name| format!(", did you mean `{name}`?"))
}

impl Grammar {
    /// The operations that rule `name` makes at `binding`, which binds its left side.
    ///
    /// They come in this order: links deleted, nodes deleted, nodes retyped, nodes created, links
    /// created, attributes set, rules woken. Created nodes are named after their type, with the first number
    /// that makes the name unique in this snapshot. Conditions and values in effects are read in
    /// `snapshot`, before any change.
    ///
    /// Where the parts of a rule contradict each other: what the right side or a linking effect
    /// wants is there afterwards even if an effect unlinks it; a deleted node is gone with
    /// whatever else was said of it; two values for one attribute, or two types for one node, are
    /// refused.
    ///
    /// # Errors
    /// [`ApplyError`]; an [`Obstacle`] in it says what does not hold.
    pub fn apply(
        &self,
        snapshot: &Snapshot,
        name: &str,
        binding: &Binding,
    ) -> Result<Vec<Operation>, ApplyError> {
        let Some(rule) = self.rule(name) else {
            let suggestion = dsr::suggest(name, self.all_rules().map(|rule| &*rule.name));
            return Err(ApplyError::NoRule {
                rule: name.to_owned(),
                suggestion,
            });
        };
        if let Some(asleep) = self.asleep(snapshot, rule)? {
            return Err(ApplyError::Asleep { rule: asleep });
        }
        if let Some(obstacle) = self.obstacle(snapshot, rule, binding)? {
            return Err(ApplyError::Obstacle(Box::new(obstacle)));
        }
        let mut compiler = Compiler::new(&self.types, snapshot.schema());
        let mut environment = Environment::new(0, CHOICE_LIMIT);
        for node in rule.bound_nodes() {
            compiler.declare(&node.variable);
            let bound = binding.get(&node.variable);
            environment.push(bound.map_or(Slot::Unbound, Slot::Node));
        }
        let mut changes = Changes::new(snapshot);
        sides(
            rule,
            snapshot,
            &mut compiler,
            &mut environment,
            &mut changes,
        )?;
        let effects = compiler.effects(&rule.effect)?;
        environment.extend_to(compiler.slots());
        for effect in &effects {
            effect.run(snapshot, &mut environment, &mut changes)?;
        }
        if rule.strict {
            no_dangling(rule, snapshot, binding, &changes)?;
        }
        let mut operations = changes.into_operations()?;
        operations.extend(self.waking(snapshot, rule)?);
        Ok(operations)
    }
}

/// What the two sides say.
fn sides(
    rule: &Rule,
    snapshot: &Snapshot,
    compiler: &mut Compiler<'_>,
    environment: &mut Environment,
    changes: &mut Changes<'_>,
) -> Result<(), ApplyError> {
    for node in &rule.right.nodes {
        let Some(left) = rule
            .bound_nodes()
            .find(|left| left.variable == node.variable)
        else {
            compiler.declare(&node.variable);
            environment.push(Slot::New(changes.create(&node.type_name)));
            continue;
        };
        if left.type_name != node.type_name {
            let slot = compiler.slot(&node.variable)?;
            changes.retype(environment[slot], &node.type_name)?;
        }
    }
    for node in &rule.left.nodes {
        if rule.right.node(&node.variable).is_none() {
            changes.delete(environment[compiler.slot(&node.variable)?]);
        }
    }
    for edge in rule.left.edges.iter().filter(|edge| !edge.negated) {
        let kept = rule.right.edge(&edge.from, &edge.label, &edge.to);
        if kept.is_none_or(|kept| kept.negated) {
            let Link { from, to, .. } = compiler.link(edge)?;
            changes.unlink(environment[from], &edge.label, environment[to]);
        }
    }
    for edge in &rule.right.edges {
        let Link { from, to, .. } = compiler.link(edge)?;
        if edge.negated {
            changes.unlink(environment[from], &edge.label, environment[to]);
        } else {
            changes.link(environment[from], &edge.label, environment[to]);
        }
    }
    snapshot.check()?;
    Ok(())
}

/// Refuses a strict rule that deletes a node with links that it does not delete itself.
fn no_dangling(
    rule: &Rule,
    snapshot: &Snapshot,
    binding: &Binding,
    changes: &Changes<'_>,
) -> Result<(), ApplyError> {
    let schema = snapshot.schema();
    for id in changes.deleted() {
        let Some(node) = snapshot.find_node(id)? else {
            continue;
        };
        for key in node.out_edges().chain(node.in_edges()) {
            let key = key?;
            let label = schema.label_name(key.label);
            if changes.unlinks(End::Node(key.from), label, End::Node(key.to)) {
                continue;
            }
            let bound = binding.iter().find(|(_, bound)| *bound == id);
            return Err(ApplyError::Dangling {
                variable: bound
                    .map_or(&rule.name, |(variable, _)| variable)
                    .to_string(),
                node: node.name()?,
                label: label.to_owned(),
            });
        }
    }
    Ok(())
}

impl RuleEngine for Grammar {
    fn successor(
        &self,
        after: &Snapshot,
        change: &Change,
    ) -> Result<Option<Arc<dyn RuleEngine>>, Refusal> {
        let successor = Self::successor(after, change)?;
        Ok(successor.map(|grammar| Arc::new(grammar) as _))
    }

    fn expand(
        &self,
        snapshot: &Snapshot,
        rule: &str,
        binding: &[(String, NodeId)],
    ) -> Result<Vec<Operation>, Refusal> {
        let binding = binding
            .iter()
            .map(|(variable, node)| (variable.as_str(), *node))
            .collect();
        self.apply(snapshot, rule, &binding)
            .map_err(|error| Refusal::RuleNotApplicable {
                rule: rule.to_owned(),
                reason: error.to_string(),
            })
    }

    fn actor(&self, rule: &str) -> Option<&str> {
        self.rule(rule)?.agent.as_deref()
    }
}

#[cfg(test)]
mod tests;
