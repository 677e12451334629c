//! Rules, conditions, effects and expressions against the variables in scope.
//!
//! Guarantee: every name in a condition, effect or expression was looked up in its scope.

use super::Check;
use crate::{AttributePath, Condition, Effect, Expression, Name, PatternNode, Problem, Rule};
use dsr::suggest;
use std::collections::{BTreeMap, BTreeSet};

/// No rule binds more nodes: a match keeps each apart from all others, which takes memory by their square.
pub const NODE_LIMIT: usize = 4_096;

/// The variables that may be used at a place.
pub(super) struct Scope {
    words: &'static str,
    bound: Vec<Name>,
    /// Where each is first among them.
    places: BTreeMap<Name, usize>,
    deleted: BTreeSet<Name>,
}

impl Scope {
    pub(super) fn new(words: &'static str) -> Self {
        Self {
            words,
            bound: Vec::new(),
            places: BTreeMap::new(),
            deleted: BTreeSet::new(),
        }
    }

    pub(super) fn words(&self) -> &'static str {
        self.words
    }

    pub(super) fn extend<'a>(&mut self, nodes: impl IntoIterator<Item = &'a PatternNode>) {
        for node in nodes {
            self.push(&node.variable);
        }
    }

    fn push(&mut self, name: &Name) {
        let place = self.bound.len();
        self.places.entry(name.clone()).or_insert(place);
        self.bound.push(name.clone());
    }

    /// Leaves all but the first so many.
    fn truncate(&mut self, size: usize) {
        for (place, name) in self.bound.drain(size..).enumerate() {
            if self.places.get(&name) == Some(&(size + place)) {
                self.places.remove(&name);
            }
        }
    }

    fn find(&self, name: &str) -> Option<&Name> {
        self.places.get(name).map(|&place| &self.bound[place])
    }

    pub(super) fn contains(&self, name: &str) -> bool {
        self.places.contains_key(name)
    }

    pub(super) fn is_deleted(&self, name: &str) -> bool {
        self.deleted.contains(name)
    }

    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.bound.iter().map(Name::as_str)
    }
}

impl Check<'_> {
    pub(super) fn rule(&mut self, rule: &Rule) {
        self.pattern(&rule.left, &rule.parameters, "left", "on the left side");
        self.pattern(&rule.right, &rule.parameters, "right", "on the right side");
        self.declarations(&rule.parameters);

        let mut before = Scope::new("on the left side or among the parameters");
        before.extend(rule.bound_nodes());
        let (limit, found) = (NODE_LIMIT, before.bound.len());
        if found > limit {
            self.report(&rule.name, Problem::TooLarge { limit, found });
        }
        for expression in [Some(&rule.cost), rule.duration.as_ref()]
            .into_iter()
            .flatten()
        {
            self.expression(expression, &before);
        }
        if let Some(condition) = &rule.precondition {
            self.condition(condition, &mut before);
        }

        let mut after = Scope::new("in this rule");
        let (left, right) = (rule.left.index(), rule.right.index());
        let kept = |node: &&PatternNode| {
            left.node(&node.variable).is_none() || right.node(&node.variable).is_some()
        };
        after.extend(rule.bound_nodes().filter(kept));
        let created = |node: &&PatternNode| !before.contains(&node.variable);
        after.extend(rule.right.nodes.iter().filter(created));
        let gone = before.bound.iter().filter(|name| !after.contains(name));
        after.deleted = gone.cloned().collect();
        self.effects(&rule.effect, &mut before, &mut after);
    }

    pub(super) fn condition(&mut self, condition: &Condition, scope: &mut Scope) {
        match condition {
            Condition::Edge { from, to, .. } => {
                self.variable(from, scope);
                self.variable(to, scope);
            }
            Condition::Same(first, second) => {
                self.variable(first, scope);
                self.variable(second, scope);
            }
            Condition::Compare { left, right, .. } => {
                self.expression(left, scope);
                self.expression(right, scope);
            }
            Condition::Not(inner) => self.condition(inner, scope),
            Condition::And(all) | Condition::Or(all) => {
                for inner in all {
                    self.condition(inner, scope);
                }
            }
            Condition::Exists { variables, body } | Condition::Forall { variables, body } => {
                let outer = self.quantify(variables, scope);
                self.condition(body, scope);
                scope.truncate(outer);
            }
            Condition::When {
                condition,
                consequence,
            } => {
                self.condition(condition, scope);
                self.condition(consequence, scope);
            }
        }
    }

    /// Brings quantified variables into scope. Gives the scope's size before.
    fn quantify(&mut self, variables: &[PatternNode], scope: &mut Scope) -> usize {
        self.declarations(variables);
        for variable in variables {
            if let Some(outer) = scope.find(&variable.variable).cloned() {
                self.duplicate("variable", &outer, &variable.variable);
            }
        }
        let before = scope.bound.len();
        scope.extend(variables);
        before
    }

    /// `before` is what conditions and values see, `after` what links and writes may name.
    fn effects(&mut self, effects: &[Effect], before: &mut Scope, after: &mut Scope) {
        let outer = after.bound.len();
        for effect in effects {
            match effect {
                Effect::Link { label, from, to } if self.is_misspelt(label, [from, to], after) => {}
                Effect::Link { from, to, .. } | Effect::Unlink { from, to, .. } => {
                    self.variable(from, after);
                    self.variable(to, after);
                }
                Effect::Assign { target, value } => {
                    self.path(target, after);
                    self.expression(value, before);
                }
                Effect::Create {
                    variable,
                    type_name,
                } => {
                    let known = after.find(variable).or_else(|| before.find(variable));
                    let known = known.or_else(|| after.deleted.get(variable));
                    if let Some(first) = known.cloned() {
                        self.duplicate("variable", &first, variable);
                    }
                    self.type_name(type_name);
                    after.push(variable);
                }
                Effect::Delete { variable } => self.variable(variable, after),
                Effect::Retype {
                    variable,
                    type_name,
                } => {
                    self.variable(variable, after);
                    self.type_name(type_name);
                }
                Effect::Forall { variables, body } => {
                    let outer = self.quantify(variables, before);
                    let size = after.bound.len();
                    after.extend(variables);
                    self.effects(body, before, after);
                    after.truncate(size);
                    before.truncate(outer);
                }
                Effect::When { condition, body } => {
                    self.condition(condition, before);
                    self.effects(body, before, after);
                }
            }
        }
        after.truncate(outer);
    }

    /// Reports a link between what are no nodes, where its label looks like an effect that takes a variable and a type.
    fn is_misspelt(&mut self, label: &Name, ends: [&Name; 2], scope: &Scope) -> bool {
        let suggestion = suggest(label, ["create", "retype"]);
        let misspelt = suggestion.is_some() && !ends.iter().all(|end| scope.contains(end));
        if misspelt {
            let name = label.to_string();
            self.report(
                label,
                Problem::UnknownName {
                    what: "effect",
                    name,
                    suggestion,
                },
            );
        }
        misspelt
    }

    fn path(&mut self, path: &AttributePath, scope: &Scope) {
        match path {
            AttributePath::Node { variable, .. } => self.variable(variable, scope),
            AttributePath::Edge { from, to, .. } => {
                self.variable(from, scope);
                self.variable(to, scope);
            }
        }
    }

    fn expression(&mut self, expression: &Expression, scope: &Scope) {
        match expression {
            Expression::Literal(_) => {}
            Expression::Attribute(path) => self.path(path, scope),
            Expression::Arithmetic { operands, .. } => {
                for operand in operands {
                    self.expression(operand, scope);
                }
            }
        }
    }
}
