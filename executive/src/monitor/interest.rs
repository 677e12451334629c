//! What a judgement of a plan hangs on. This file guarantees that a commit which touches none of it
//! leaves the judgement as it is.
//!
//! A [`grammar::Watch`] keeps every match of its rules up to date. A plan's conditions speak of certain nodes:
//! to know whether a commit matters, it is enough to look whether it touches them, without a match.

use super::ground;
use crate::mission::record::Step;
use dsr::{AttributeId, Change, LabelId, NodeId, ReadError, Schema, Snapshot, Touch};
use grammar::{
    AttributePath, Binding, Condition, Effect, Expression, Goal, GoalConstants, Grammar, Name,
    Pattern,
};
use std::collections::{BTreeMap, BTreeSet};

/// The ends of a link; `None` is any node.
type Ends = (Option<NodeId>, Option<NodeId>);

/// What in the graph the judgement of a plan hangs on.
#[derive(Debug, Clone, Default)]
pub(crate) struct Interest {
    links: BTreeMap<LabelId, BTreeSet<Ends>>,
    attributes: BTreeSet<AttributeId>,
    nodes: BTreeSet<NodeId>,
    /// Whether it hangs on which nodes there are.
    population: bool,
    /// Labels and attributes that the schema does not have yet.
    unknown: BTreeSet<Name>,
}

impl Interest {
    /// Of the open steps of a plan and its goal.
    pub(crate) fn of(
        grammar: &Grammar,
        snapshot: &Snapshot,
        open: &[Step],
        goal: &Goal,
    ) -> Result<Self, ReadError> {
        let mut interest = Self::default();
        let schema = snapshot.schema();
        for step in open {
            let Some(ground) = ground(grammar, snapshot, step)? else {
                continue;
            };
            let (rule, binding) = (ground.rule, &ground.binding);
            interest.population |= binding.len() < rule.bound_nodes().count();
            interest.nodes.extend(binding.iter().map(|(_, id)| id));
            interest.pattern(&rule.left, binding, schema);
            interest.pattern(&rule.right, binding, schema);
            if let Some(condition) = &rule.precondition {
                interest.condition(condition, binding, &mut Vec::new(), schema);
            }
            // Links that the rule makes or removes in any case are looked for as its outcome.
            for effect in &rule.effect {
                if let Effect::Link { label, from, to } | Effect::Unlink { label, from, to } =
                    effect
                {
                    interest.link(label, binding.get(from), binding.get(to), schema);
                }
            }
            if let Some(duration) = &rule.duration {
                interest.value(duration, binding, &[], schema);
            }
        }
        let constants = match goal.find_constants(snapshot)? {
            GoalConstants::Found(constants) => constants,
            GoalConstants::Missing(_) => Binding::new(),
        };
        interest.population |= constants.len() < goal.pattern.nodes.len();
        interest.nodes.extend(constants.iter().map(|(_, id)| id));
        interest.pattern(&goal.pattern, &constants, schema);
        if let Some(condition) = &goal.precondition {
            interest.condition(condition, &constants, &mut Vec::new(), schema);
        }
        Ok(interest)
    }

    fn link(&mut self, label: &Name, from: Option<NodeId>, to: Option<NodeId>, schema: &Schema) {
        match schema.find_label(label) {
            Some(label) => {
                self.links.entry(label).or_default().insert((from, to));
            }
            None => {
                self.unknown.insert(label.clone());
            }
        }
    }

    fn pattern(&mut self, pattern: &Pattern, binding: &Binding, schema: &Schema) {
        for edge in &pattern.edges {
            let (from, to) = (binding.get(&edge.from), binding.get(&edge.to));
            self.link(&edge.label, from, to, schema);
        }
    }

    /// Variables in `scope` may be any node.
    fn condition(
        &mut self,
        condition: &Condition,
        binding: &Binding,
        scope: &mut Vec<Name>,
        schema: &Schema,
    ) {
        match condition {
            Condition::Edge { label, from, to } => {
                let [from, to] = [from, to].map(|variable| end(variable, binding, scope));
                self.link(label, from, to, schema);
            }
            Condition::Same(..) => {}
            Condition::Compare { left, right, .. } => {
                self.value(left, binding, scope, schema);
                self.value(right, binding, scope, schema);
            }
            Condition::Not(inner) => self.condition(inner, binding, scope, schema),
            Condition::And(parts) | Condition::Or(parts) => {
                for part in parts {
                    self.condition(part, binding, scope, schema);
                }
            }
            Condition::Exists { variables, body } | Condition::Forall { variables, body } => {
                self.population = true;
                let depth = scope.len();
                scope.extend(variables.iter().map(|node| node.variable.clone()));
                self.condition(body, binding, scope, schema);
                scope.truncate(depth);
            }
            Condition::When {
                condition,
                consequence,
            } => {
                self.condition(condition, binding, scope, schema);
                self.condition(consequence, binding, scope, schema);
            }
        }
    }

    fn value(&mut self, value: &Expression, binding: &Binding, scope: &[Name], schema: &Schema) {
        match value {
            Expression::Literal(_) => {}
            Expression::Attribute(path) => {
                let (AttributePath::Node { attribute, .. } | AttributePath::Edge { attribute, .. }) =
                    path;
                match schema.find_attribute(attribute) {
                    Some(attribute) => {
                        self.attributes.insert(attribute);
                    }
                    None => {
                        self.unknown.insert(attribute.clone());
                    }
                }
                if let AttributePath::Edge {
                    from, label, to, ..
                } = path
                {
                    let [from, to] = [from, to].map(|variable| end(variable, binding, scope));
                    self.link(label, from, to, schema);
                }
            }
            Expression::Arithmetic { operands, .. } => {
                for operand in operands {
                    self.value(operand, binding, scope, schema);
                }
            }
        }
    }

    /// Whether a commit touches any of it.
    pub(crate) fn touched_by(&self, change: &Change, schema: &Schema) -> bool {
        let known = |name: &Name| {
            schema.find_label(name).is_some() || schema.find_attribute(name).is_some()
        };
        let reads = |names: &[AttributeId]| names.iter().any(|n| self.attributes.contains(n));
        let meets = |one: Option<NodeId>, other: NodeId| one.is_none_or(|one| one == other);
        self.unknown.iter().any(known)
            || change.nodes.iter().any(|node| match node.touch {
                Touch::Updated => reads(&node.attributes),
                Touch::Created | Touch::Deleted | Touch::Replaced => {
                    self.population || self.nodes.contains(&node.node)
                }
            })
            || change.edges.iter().any(|edge| {
                let ends = self.links.get(&edge.edge.label);
                let looked_at =
                    |&(from, to): &Ends| meets(from, edge.edge.from) && meets(to, edge.edge.to);
                match edge.touch {
                    Touch::Updated => reads(&edge.attributes),
                    _ => ends.is_some_and(|ends| ends.iter().any(looked_at)),
                }
            })
    }
}

/// The node that a variable stands for; `None` if it may be any.
fn end(variable: &Name, binding: &Binding, scope: &[Name]) -> Option<NodeId> {
    if scope.contains(variable) {
        return None;
    }
    binding.get(variable)
}
