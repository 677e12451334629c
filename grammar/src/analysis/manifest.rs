//! What rules do that an agent's manifest does not give.
//!
//! Guarantee: an effect is reported where the rule says it, once per rule and name; a rule of
//! which nothing is reported does nothing that the agent could not do without it.

use super::at;
use crate::parser::Finding;
use crate::{
    AttributePath, Diagnostic, Effect, Grammar, Name, PatternNode, Problem, Rule, SourceFile, Span,
};
use dsr::{Manifest, Schema};
use std::collections::BTreeSet;

/// All that can be said of a grammar under a manifest, whose file is `file`.
pub(super) fn check(
    grammar: &Grammar,
    schema: Option<&Schema>,
    manifest: &Manifest,
    file: &SourceFile,
) -> Vec<Diagnostic> {
    let mut findings = Vec::new();
    for rule in &grammar.rules {
        let given = manifest.gives_rule(&rule.name, rule.agent.as_deref());
        let actor = rule.agent.as_ref();
        let mine = actor.filter(|actor| **actor == *manifest.agent());
        if let Some(actor) = mine.filter(|_| !given) {
            let agent = manifest.agent().to_owned();
            findings.push(at(actor, Problem::NotGiven { agent }));
        }
        if given {
            let mut beyond = Beyond {
                grammar,
                schema,
                manifest,
                told: BTreeSet::new(),
                findings: &mut findings,
            };
            beyond.rule(rule);
        }
    }
    let mut diagnostics = crate::load::diagnostics(findings, &grammar.files);
    let combos = || grammar.combos.iter().map(|combo| &combo.name);
    let known = || {
        let rules = grammar.all_rules().map(|rule| &rule.name);
        rules.chain(combos()).map(Name::as_str)
    };
    for (name, place) in manifest.named_rules() {
        if !known().any(|rule| rule == name) {
            diagnostics.push(Diagnostic {
                problem: Problem::UnknownName {
                    what: "rule",
                    name: name.to_owned(),
                    suggestion: dsr::suggest(name, known()),
                },
                span: Span {
                    file: 0,
                    start: place.start,
                    end: place.end,
                },
                file: file.clone(),
                related: None,
            });
        }
    }
    diagnostics
}

/// Looks for what one rule does beyond the manifest.
struct Beyond<'a> {
    grammar: &'a Grammar,
    schema: Option<&'a Schema>,
    manifest: &'a Manifest,
    /// What was reported.
    told: BTreeSet<String>,
    findings: &'a mut Vec<Finding>,
}

impl Beyond<'_> {
    fn rule(&mut self, rule: &Rule) {
        let mut types: Vec<PatternNode> = rule.bound_nodes().cloned().collect();
        for node in &rule.right.nodes {
            match rule.bound_nodes().find(|b| b.variable == node.variable) {
                None => {
                    types.push(node.clone());
                    self.node(&node.type_name, "creates");
                }
                Some(before) if before.type_name != node.type_name => {
                    self.node(&before.type_name, "retypes");
                    self.node(&node.type_name, "retypes to");
                }
                Some(_) => {}
            }
        }
        for node in &rule.left.nodes {
            if rule.right.node(&node.variable).is_none() {
                self.node(&node.type_name, "deletes");
            }
        }
        for edge in rule.left.edges.iter().filter(|edge| !edge.negated) {
            let kept = rule.right.edge(&edge.from, &edge.label, &edge.to);
            if kept.is_none_or(|kept| kept.negated) {
                self.link(&edge.label, "removes");
            }
        }
        for edge in rule.right.edges.iter().filter(|edge| !edge.negated) {
            let there = rule.left.edge(&edge.from, &edge.label, &edge.to);
            if there.is_none_or(|there| there.negated) {
                self.link(&edge.label, "makes");
            }
        }
        self.effects(&rule.effect, &mut types);
    }

    fn effects(&mut self, effects: &[Effect], types: &mut Vec<PatternNode>) {
        let outer = types.len();
        for effect in effects {
            match effect {
                Effect::Link { label, .. } => self.link(label, "makes"),
                Effect::Unlink { label, .. } => self.link(label, "removes"),
                Effect::Assign { target, .. } => self.attribute(target, types),
                Effect::Create {
                    variable,
                    type_name,
                } => {
                    self.node(type_name, "creates");
                    types.push(PatternNode::new(variable.clone(), type_name.clone()));
                }
                Effect::Delete { variable } => {
                    if let Some(type_name) = type_of(variable, types) {
                        // Where the effect is, not where the variable is declared.
                        let place = Name::new(type_name.as_str(), variable.span());
                        self.node(&place, "deletes");
                    }
                }
                Effect::Retype {
                    variable,
                    type_name,
                } => {
                    if let Some(before) = type_of(variable, types) {
                        let place = Name::new(before.as_str(), variable.span());
                        self.node(&place, "retypes");
                    }
                    self.node(type_name, "retypes to");
                }
                Effect::Forall { variables, body } => {
                    let scope = types.len();
                    types.extend(variables.iter().cloned());
                    self.effects(body, types);
                    types.truncate(scope);
                }
                Effect::When { body, .. } => self.effects(body, types),
            }
        }
        types.truncate(outer);
    }

    /// Whether nodes of a type are of the general one, by the schema or by the types block.
    fn is_a(&self, type_name: &str, general: &str) -> bool {
        let by_schema = |schema: &Schema| {
            let types = schema.find_type(type_name).zip(schema.find_type(general));
            types.is_some_and(|(sub, general)| schema.is_subtype(sub, general))
        };
        self.grammar.types.is_subtype(type_name, general) || self.schema.is_some_and(by_schema)
    }

    fn node(&mut self, type_name: &Name, does: &str) {
        let given = |general: &str| self.is_a(type_name, general);
        if !self.manifest.gives_nodes(given) {
            self.tell(type_name, format!("this {does} a `{type_name}`"));
        }
    }

    fn link(&mut self, label: &Name, does: &str) {
        if !self.manifest.gives_edges(label) {
            self.tell(label, format!("this {does} a link `{label}`"));
        }
    }

    fn attribute(&mut self, target: &AttributePath, types: &[PatternNode]) {
        let (given, attribute) = match target {
            AttributePath::Node {
                variable,
                attribute,
            } => {
                let is_a = |general: &str| {
                    let exact = type_of(variable, types);
                    exact.is_some_and(|exact| self.is_a(exact, general))
                };
                (self.manifest.gives_attribute(is_a, attribute), attribute)
            }
            AttributePath::Edge {
                label, attribute, ..
            } => {
                let is_a = |owner: &str| *label == *owner;
                (self.manifest.gives_attribute(is_a, attribute), attribute)
            }
        };
        if !given {
            self.tell(attribute, format!("this writes `{target}`"));
        }
    }

    fn tell(&mut self, name: &Name, what: String) {
        if self.told.insert(what.clone()) {
            let agent = self.manifest.agent().to_owned();
            let problem = Problem::BeyondManifest { what, agent };
            self.findings.push(at(name, problem));
        }
    }
}

/// The type of the innermost variable of that name.
fn type_of<'a>(variable: &Name, types: &'a [PatternNode]) -> Option<&'a Name> {
    let mut inner = types.iter().rev();
    let node = inner.find(|node| node.variable == *variable)?;
    Some(&node.type_name)
}
