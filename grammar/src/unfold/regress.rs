//! Conditions and values of a later step, said of the graph before the first one.
//!
//! Guarantee: the formula holds before the first step exactly where the original holds before its
//! own, provided that the steps between do what the [`Composition`] says.

use super::compose::{Composition, Impossible, Node, Outcome, attribute, impossible};
use crate::formula::{all, any, constant, negated, no};
use crate::{AttributePath, Condition, Effect, Expression, Name, PatternNode, Rule};
use std::collections::BTreeSet;

/// What a rule looks at, and what its quantified and conditional effects may change.
#[derive(Debug, Clone, Default)]
pub(super) struct Footprint {
    /// Labels and attributes of conditions, left side and values.
    pub(super) reads: BTreeSet<String>,
    /// Labels that the sides and unconditional effects take away.
    pub(super) cuts: BTreeSet<String>,
    /// Attributes that unconditional effects set.
    pub(super) sets: BTreeSet<String>,
    pub(super) linked: BTreeSet<String>,
    pub(super) unlinked: BTreeSet<String>,
    pub(super) assigned: BTreeSet<String>,
    /// Nodes may come, go or change type.
    pub(super) structure: bool,
    /// It has a `forall`.
    pub(super) quantified: bool,
}

impl Footprint {
    /// Of this, what may be changed.
    pub(super) fn changes_of(self) -> Self {
        Self {
            reads: BTreeSet::new(),
            cuts: BTreeSet::new(),
            sets: BTreeSet::new(),
            ..self
        }
    }

    pub(super) fn extend(&mut self, other: Self) {
        self.linked.extend(other.linked);
        self.unlinked.extend(other.unlinked);
        self.assigned.extend(other.assigned);
        self.structure |= other.structure;
        self.quantified |= other.quantified;
    }

    fn condition(&mut self, condition: &Condition) {
        match condition {
            Condition::Edge { label, .. } => {
                self.reads.insert(label.to_string());
            }
            Condition::Same(..) => {}
            Condition::Compare { left, right, .. } => {
                self.expression(left);
                self.expression(right);
            }
            Condition::Not(inner) => self.condition(inner),
            Condition::And(all) | Condition::Or(all) => all.iter().for_each(|c| self.condition(c)),
            Condition::Exists { body, .. } | Condition::Forall { body, .. } => self.condition(body),
            Condition::When {
                condition,
                consequence,
            } => {
                self.condition(condition);
                self.condition(consequence);
            }
        }
    }

    fn expression(&mut self, expression: &Expression) {
        match expression {
            Expression::Literal(_) => {}
            Expression::Attribute(path) => {
                self.reads.insert(attribute(path).to_owned());
                if let AttributePath::Edge { label, .. } = path {
                    self.reads.insert(label.to_string());
                }
            }
            Expression::Arithmetic { operands, .. } => {
                for operand in operands {
                    self.expression(operand);
                }
            }
        }
    }

    fn effect(&mut self, effect: &Effect, loose: bool) {
        match effect {
            Effect::Link { label, .. } if loose => {
                self.linked.insert(label.to_string());
            }
            Effect::Link { .. } => {}
            Effect::Unlink { label, .. } => {
                let set = if loose {
                    &mut self.unlinked
                } else {
                    &mut self.cuts
                };
                set.insert(label.to_string());
            }
            Effect::Assign { target, value } => {
                self.expression(value);
                // Whether a link is there decides whether its attribute is set.
                if let AttributePath::Edge { label, .. } = target {
                    self.reads.insert(label.to_string());
                }
                let set = if loose {
                    &mut self.assigned
                } else {
                    &mut self.sets
                };
                set.insert(attribute(target).to_owned());
            }
            Effect::Create { .. } | Effect::Delete { .. } | Effect::Retype { .. } => {
                self.structure |= loose;
            }
            Effect::Forall { body, .. } => {
                self.quantified = true;
                for effect in body {
                    self.effect(effect, true);
                }
            }
            Effect::When { condition, body } => {
                self.condition(condition);
                for effect in body {
                    self.effect(effect, true);
                }
            }
        }
    }
}

pub(super) fn footprint(rule: &Rule) -> Footprint {
    let mut footprint = Footprint::default();
    for edge in &rule.left.edges {
        footprint.reads.insert(edge.label.to_string());
        let kept = rule.right.edge(&edge.from, &edge.label, &edge.to);
        if !edge.negated && kept.is_none() {
            footprint.cuts.insert(edge.label.to_string());
        }
    }
    for edge in rule.right.edges.iter().filter(|edge| edge.negated) {
        footprint.cuts.insert(edge.label.to_string());
    }
    rule.precondition
        .iter()
        .for_each(|c| footprint.condition(c));
    rule.duration.iter().for_each(|d| footprint.expression(d));
    rule.effect.iter().for_each(|e| footprint.effect(e, false));
    footprint
}

/// Quantified variables that stand for a node of the rule here.
type Fixed = Vec<(Name, Name)>;

impl Composition<'_> {
    pub(super) fn condition(&self, condition: &Condition) -> Outcome<Condition> {
        self.regress(condition, &mut Fixed::new())
    }

    /// A value that must be there.
    pub(super) fn defined(&self, expression: &Expression) -> Outcome<Expression> {
        let value = self.value(expression, &Fixed::new())?;
        value.ok_or_else(|| Impossible(format!("`{expression}` never has a value then")))
    }

    pub(super) fn effect(&self, effect: &Effect) -> Outcome<Effect> {
        Ok(match effect {
            Effect::Assign { target, value } => Effect::Assign {
                target: target.clone(),
                value: self.defined(value)?,
            },
            Effect::Forall { variables, body } => Effect::Forall {
                variables: variables.clone(),
                body: body
                    .iter()
                    .map(|e| self.effect(e))
                    .collect::<Outcome<_>>()?,
            },
            Effect::When { condition, body } => Effect::When {
                condition: self.condition(condition)?,
                body: body
                    .iter()
                    .map(|e| self.effect(e))
                    .collect::<Outcome<_>>()?,
            },
            other => other.clone(),
        })
    }

    fn regress(&self, condition: &Condition, fixed: &mut Fixed) -> Outcome<Condition> {
        match self.budget.get().checked_sub(1) {
            Some(left) => self.budget.set(left),
            None => return impossible("its conditions would grow too long".to_owned()),
        }
        Ok(match condition {
            Condition::Edge { label, from, to } => {
                self.atom(label, &resolve(from, fixed), &resolve(to, fixed))
            }
            Condition::Same(a, b) => self.same(&resolve(a, fixed), &resolve(b, fixed)),
            Condition::Compare {
                operator,
                left,
                right,
            } => match (self.value(left, fixed)?, self.value(right, fixed)?) {
                (Some(left), Some(right)) => Condition::Compare {
                    operator: *operator,
                    left: Box::new(left),
                    right: Box::new(right),
                },
                _ => no(),
            },
            Condition::Not(inner) => negated(self.regress(inner, fixed)?),
            Condition::And(list) => all(self.regress_all(list, fixed)?),
            Condition::Or(list) => any(self.regress_all(list, fixed)?),
            Condition::When {
                condition,
                consequence,
            } => any(vec![
                negated(self.regress(condition, fixed)?),
                self.regress(consequence, fixed)?,
            ]),
            Condition::Exists { variables, body } => self.exists(variables, body, fixed)?,
            Condition::Forall { variables, body } => {
                let inverse = Condition::Not(body.clone());
                negated(self.exists(variables, &inverse, fixed)?)
            }
        })
    }

    fn regress_all(&self, list: &[Condition], fixed: &mut Fixed) -> Outcome<Vec<Condition>> {
        list.iter().map(|c| self.regress(c, fixed)).collect()
    }

    /// One quantified variable after the other: nodes that are as they were, then those that came
    /// or changed their type.
    fn exists(
        &self,
        variables: &[PatternNode],
        body: &Condition,
        fixed: &mut Fixed,
    ) -> Outcome<Condition> {
        let Some((variable, rest)) = variables.split_first() else {
            return self.regress(body, fixed);
        };
        let changed = |node: &&Node| node.created() || node.deleted || node.retyped;
        let mut unchanged = Vec::new();
        let mut cases = Vec::new();
        for node in self.nodes.iter().filter(changed) {
            if !node.created() {
                unchanged.push(negated(Condition::Same(
                    variable.variable.clone(),
                    node.variable.clone(),
                )));
            }
            if node.deleted {
                continue;
            }
            if self.types.is_empty() && node.now != variable.type_name {
                return impossible(format!(
                    "whether the new `{}` is a `{}` depends on the schema",
                    node.variable, variable.type_name
                ));
            }
            if self.types.is_subtype(&node.now, &variable.type_name) {
                fixed.push((variable.variable.clone(), node.variable.clone()));
                cases.push(self.exists(rest, body, fixed)?);
                fixed.pop();
            }
        }
        unchanged.push(self.exists(rest, body, fixed)?);
        cases.insert(
            0,
            Condition::Exists {
                variables: vec![variable.clone()],
                body: Box::new(all(unchanged)),
            },
        );
        Ok(any(cases))
    }

    fn is_new(&self, name: &str) -> bool {
        self.node(name).is_some_and(Node::created)
    }

    fn same(&self, a: &Name, b: &Name) -> Condition {
        match (self.node(a), self.node(b)) {
            (Some(_), Some(_)) => constant(a == b),
            // A quantified variable ranges over the nodes that were there.
            _ if self.is_new(a) || self.is_new(b) => no(),
            _ => Condition::Same(a.clone(), b.clone()),
        }
    }

    fn atom(&self, label: &Name, from: &Name, to: &Name) -> Condition {
        let before = || {
            if self.is_new(from) || self.is_new(to) {
                no()
            } else {
                Condition::Edge {
                    label: label.clone(),
                    from: from.clone(),
                    to: to.clone(),
                }
            }
        };
        if self.node(from).is_some() && self.node(to).is_some() {
            return match self.link(from, label, to) {
                Some(link) => constant(link.now),
                None => before(),
            };
        }
        let mut added = Vec::new();
        let mut kept = Vec::new();
        for link in self.links.iter().filter(|l| l.written && l.label == *label) {
            let here = all(vec![self.same(from, &link.from), self.same(to, &link.to)]);
            if link.now {
                added.push(here);
            } else {
                kept.push(negated(here));
            }
        }
        kept.insert(0, before());
        added.push(all(kept));
        any(added)
    }

    /// The value before the first step; `None` where there is none then.
    fn value(&self, expression: &Expression, fixed: &Fixed) -> Outcome<Option<Expression>> {
        match expression {
            Expression::Literal(_) => Ok(Some(expression.clone())),
            Expression::Arithmetic { operator, operands } => {
                let mut values = Vec::new();
                for operand in operands {
                    match self.value(operand, fixed)? {
                        Some(value) => values.push(value),
                        None => return Ok(None),
                    }
                }
                Ok(Some(Expression::Arithmetic {
                    operator: *operator,
                    operands: values,
                }))
            }
            Expression::Attribute(path) => self.attribute(path, fixed),
        }
    }

    fn attribute(&self, path: &AttributePath, fixed: &Fixed) -> Outcome<Option<Expression>> {
        let mut path = path.clone();
        let ends: Vec<Name> = match &mut path {
            AttributePath::Node { variable, .. } => {
                *variable = resolve(variable, fixed);
                vec![variable.clone()]
            }
            AttributePath::Edge { from, to, .. } => {
                *from = resolve(from, fixed);
                *to = resolve(to, fixed);
                vec![from.clone(), to.clone()]
            }
        };
        if let Some((_, value)) = self.assigned.iter().find(|(target, _)| *target == path) {
            if let AttributePath::Edge {
                from, label, to, ..
            } = &path
                && !self.link(from, label, to).is_some_and(|link| link.now)
            {
                return impossible(format!(
                    "`{}` is set on a link that may not be there",
                    attribute(&path)
                ));
            }
            return Ok(Some(value.clone()));
        }
        if ends.iter().any(|end| self.is_new(end)) {
            return Ok(None);
        }
        if let AttributePath::Edge {
            from, label, to, ..
        } = &path
            && self.link(from, label, to).is_some_and(|link| !link.now)
        {
            return Ok(None);
        }
        let quantified = ends.iter().any(|end| self.node(end).is_none());
        if quantified {
            let name = attribute(&path);
            let set = self
                .assigned
                .iter()
                .any(|(target, _)| attribute(target) == name);
            let moved = matches!(&path, AttributePath::Edge { label, .. }
                if self.links.iter().any(|l| l.written && l.label == *label));
            if set || moved {
                return impossible(format!(
                    "a quantified formula reads `{name}`, which an earlier step changes"
                ));
            }
        }
        Ok(Some(Expression::Attribute(path)))
    }
}

fn resolve(name: &Name, fixed: &Fixed) -> Name {
    let found = fixed.iter().rev().find(|(variable, _)| variable == name);
    found.map_or_else(|| name.clone(), |(_, node)| node.clone())
}
