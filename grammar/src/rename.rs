//! A rule with other variables.
//!
//! Guarantee: no variable is captured: each quantified or created variable gets a name that
//! nothing else in the rule, or in the rules renamed before with the same [`Renaming`], has.

use crate::{AttributePath, Condition, Effect, Expression, Name, Pattern, PatternNode, Rule};
use std::collections::BTreeSet;

/// Old names and new ones, innermost last.
pub(crate) struct Renaming<'a> {
    scope: Vec<(Name, Name)>,
    taken: &'a mut BTreeSet<String>,
    alias: &'a str,
}

impl<'a> Renaming<'a> {
    /// `scope` renames what the rule binds or creates by its sides; `taken` are all new names.
    pub(crate) fn new(
        scope: Vec<(Name, Name)>,
        taken: &'a mut BTreeSet<String>,
        alias: &'a str,
    ) -> Self {
        Self {
            scope,
            taken,
            alias,
        }
    }

    /// All names that were given, old and new.
    pub(crate) fn into_names(self) -> Vec<(Name, Name)> {
        self.scope
    }

    pub(crate) fn rule(&mut self, rule: &Rule) -> Rule {
        Rule {
            left: self.pattern(&rule.left),
            right: self.pattern(&rule.right),
            parameters: self.nodes(&rule.parameters),
            cost: self.expression(&rule.cost),
            duration: rule.duration.as_ref().map(|d| self.expression(d)),
            precondition: rule.precondition.as_ref().map(|c| self.condition(c)),
            effect: self.effects(&rule.effect),
            ..rule.clone()
        }
    }

    fn name(&self, name: &Name) -> Name {
        let renamed = self.scope.iter().rev().find(|(old, _)| old == name);
        renamed.map_or_else(|| name.clone(), |(_, new)| new.clone())
    }

    /// A new variable inside the rule.
    fn declare(&mut self, name: &Name) -> Name {
        let mut new = name.to_string();
        if self.taken.contains(&new) {
            new = format!("{}_{name}", self.alias);
        }
        while self.taken.contains(&new) {
            new.push('_');
        }
        self.taken.insert(new.clone());
        let new = Name::new(new, name.span());
        self.scope.push((name.clone(), new.clone()));
        new
    }

    fn nodes(&self, nodes: &[PatternNode]) -> Vec<PatternNode> {
        let renamed = |node: &PatternNode| PatternNode {
            variable: self.name(&node.variable),
            ..node.clone()
        };
        nodes.iter().map(renamed).collect()
    }

    fn pattern(&self, pattern: &Pattern) -> Pattern {
        let mut edges = pattern.edges.clone();
        for edge in &mut edges {
            edge.from = self.name(&edge.from);
            edge.to = self.name(&edge.to);
        }
        Pattern {
            nodes: self.nodes(&pattern.nodes),
            edges,
        }
    }

    pub(crate) fn quantify(&mut self, variables: &[PatternNode]) -> Vec<PatternNode> {
        let renamed = |node: &PatternNode| PatternNode {
            variable: self.declare(&node.variable),
            ..node.clone()
        };
        variables.iter().map(renamed).collect()
    }

    pub(crate) fn condition(&mut self, condition: &Condition) -> Condition {
        match condition {
            Condition::Edge { label, from, to } => Condition::Edge {
                label: label.clone(),
                from: self.name(from),
                to: self.name(to),
            },
            Condition::Same(a, b) => Condition::Same(self.name(a), self.name(b)),
            Condition::Compare {
                operator,
                left,
                right,
            } => Condition::Compare {
                operator: *operator,
                left: Box::new(self.expression(left)),
                right: Box::new(self.expression(right)),
            },
            Condition::Not(inner) => Condition::Not(Box::new(self.condition(inner))),
            Condition::And(all) => Condition::And(all.iter().map(|c| self.condition(c)).collect()),
            Condition::Or(any) => Condition::Or(any.iter().map(|c| self.condition(c)).collect()),
            Condition::Exists { variables, body } => {
                let outer = self.scope.len();
                let variables = self.quantify(variables);
                let body = Box::new(self.condition(body));
                self.scope.truncate(outer);
                Condition::Exists { variables, body }
            }
            Condition::Forall { variables, body } => {
                let outer = self.scope.len();
                let variables = self.quantify(variables);
                let body = Box::new(self.condition(body));
                self.scope.truncate(outer);
                Condition::Forall { variables, body }
            }
            Condition::When {
                condition,
                consequence,
            } => Condition::When {
                condition: Box::new(self.condition(condition)),
                consequence: Box::new(self.condition(consequence)),
            },
        }
    }

    pub(crate) fn expression(&self, expression: &Expression) -> Expression {
        match expression {
            Expression::Literal(_) => expression.clone(),
            Expression::Attribute(path) => Expression::Attribute(self.path(path)),
            Expression::Arithmetic { operator, operands } => Expression::Arithmetic {
                operator: *operator,
                operands: operands.iter().map(|o| self.expression(o)).collect(),
            },
        }
    }

    pub(crate) fn path(&self, path: &AttributePath) -> AttributePath {
        let mut path = path.clone();
        match &mut path {
            AttributePath::Node { variable, .. } => *variable = self.name(variable),
            AttributePath::Edge { from, to, .. } => {
                *from = self.name(from);
                *to = self.name(to);
            }
        }
        path
    }

    /// Nodes created in a list of effects are in scope to its end.
    fn effects(&mut self, effects: &[Effect]) -> Vec<Effect> {
        let outer = self.scope.len();
        let renamed = effects.iter().map(|effect| self.effect(effect)).collect();
        self.scope.truncate(outer);
        renamed
    }

    fn effect(&mut self, effect: &Effect) -> Effect {
        match effect {
            Effect::Link { label, from, to } => Effect::Link {
                label: label.clone(),
                from: self.name(from),
                to: self.name(to),
            },
            Effect::Unlink { label, from, to } => Effect::Unlink {
                label: label.clone(),
                from: self.name(from),
                to: self.name(to),
            },
            Effect::Assign { target, value } => Effect::Assign {
                target: self.path(target),
                value: self.expression(value),
            },
            Effect::Create {
                variable,
                type_name,
            } => Effect::Create {
                variable: self.declare(variable),
                type_name: type_name.clone(),
            },
            Effect::Delete { variable } => Effect::Delete {
                variable: self.name(variable),
            },
            Effect::Retype {
                variable,
                type_name,
            } => Effect::Retype {
                variable: self.name(variable),
                type_name: type_name.clone(),
            },
            Effect::Forall { variables, body } => {
                let outer = self.scope.len();
                let variables = self.quantify(variables);
                let body = self.effects(body);
                self.scope.truncate(outer);
                Effect::Forall { variables, body }
            }
            Effect::When { condition, body } => Effect::When {
                condition: self.condition(condition),
                body: self.effects(body),
            },
        }
    }
}
