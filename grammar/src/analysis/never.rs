//! Rules that match in no graph, or that cost nothing sayable wherever they match.
//!
//! Guarantee: a reason is only given where there is no match whatever the graph, or whatever the
//! graph that the schema allows.

use super::at;
use super::contradiction::contradiction;
use crate::matching::{MatchDomain, conjuncts};
use crate::parser::Finding;
use crate::{
    AttributePath, Comparison, Condition, Expression, Grammar, Literal, Name, Problem, Rule,
};
use dsr::{Schema, TypeId};

/// Why the rule never matches, if that can be seen.
pub(super) fn why_never(grammar: &Grammar, rule: &Rule, schema: Option<&Schema>) -> Option<String> {
    let conditions: Vec<&Condition> = rule.precondition.iter().flat_map(conjuncts).collect();
    contradiction(grammar, rule, &[], schema).or_else(|| types(grammar, rule, &conditions, schema?))
}

/// Reports a cost or duration that, at every match of the rule, has no value or one below 0.
pub(super) fn amounts(
    grammar: &Grammar,
    rule: &Rule,
    schema: Option<&Schema>,
    findings: &mut Vec<Finding>,
) {
    for amount in [Some(&rule.cost), rule.duration.as_ref()]
        .into_iter()
        .flatten()
    {
        let paths = amount.paths();
        let Some(AttributePath::Node { attribute, .. } | AttributePath::Edge { attribute, .. }) =
            paths.first()
        else {
            continue;
        };
        let links = paths.iter().filter_map(|path| match path {
            AttributePath::Edge {
                from, label, to, ..
            } => Some(Condition::Edge {
                from: from.clone(),
                label: label.clone(),
                to: to.clone(),
            }),
            AttributePath::Node { .. } => None,
        });
        let mut wanted: Vec<Condition> = links.collect();
        wanted.push(Condition::Compare {
            operator: Comparison::GreaterOrEqual,
            left: Box::new(amount.clone()),
            right: Box::new(Expression::Literal(Literal::Integer(0))),
        });
        if let Some(reason) = contradiction(grammar, rule, &wanted, schema) {
            findings.push(at(attribute, Problem::NeverAmount { reason }));
        }
    }
}

/// A node of which the links ask more than any type of the schema can have.
fn types(
    grammar: &Grammar,
    rule: &Rule,
    conditions: &[&Condition],
    schema: &Schema,
) -> Option<String> {
    if schema.is_open() {
        return None;
    }
    let mut candidates: Vec<(&Name, Vec<TypeId>)> = Vec::new();
    for node in rule.bound_nodes().chain(&rule.parameters) {
        let domain = MatchDomain::new(&grammar.types, schema, &node.type_name);
        if domain.types().is_empty() {
            return None;
        }
        match candidates
            .iter_mut()
            .find(|(name, _)| **name == node.variable)
        {
            Some((_, types)) => types.retain(|&id| domain.contains(id)),
            None => candidates.push((&node.variable, domain.types().to_vec())),
        }
    }
    let mut links: Vec<(&Name, dsr::LabelId, &Name)> = Vec::new();
    let by_sides = rule.left.edges.iter().filter(|edge| !edge.negated);
    let by_sides = by_sides.map(|edge| (&edge.from, &edge.label, &edge.to));
    let by_conditions = conditions.iter().filter_map(|condition| match condition {
        Condition::Edge { label, from, to } => Some((from, label, to)),
        _ => None,
    });
    for (from, label, to) in by_sides.chain(by_conditions) {
        links.push((from, schema.find_label(label)?, to));
    }
    loop {
        let before: usize = candidates.iter().map(|(_, types)| types.len()).sum();
        for &(from, label, to) in &links {
            let place = |name: &Name| candidates.iter().position(|(known, _)| *known == name);
            let (Some(from), Some(to)) = (place(from), place(to)) else {
                continue;
            };
            let fits = |a: TypeId, b: TypeId| schema.check_ends(label, a, b).is_ok();
            let sources = candidates[from].1.clone();
            let targets = candidates[to].1.clone();
            candidates[from]
                .1
                .retain(|&a| targets.iter().any(|&b| fits(a, b)));
            candidates[to]
                .1
                .retain(|&b| sources.iter().any(|&a| fits(a, b)));
        }
        if let Some((name, _)) = candidates.iter().find(|(_, types)| types.is_empty()) {
            return Some(format!(
                "no type of the schema can have all the links of `{name}`"
            ));
        }
        if candidates
            .iter()
            .map(|(_, types)| types.len())
            .sum::<usize>()
            == before
        {
            return None;
        }
    }
}
