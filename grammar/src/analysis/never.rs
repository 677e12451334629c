//! Rules that match in no graph.
//!
//! Guarantee: a reason is only given where there is no match whatever the graph, or whatever the
//! graph that the schema allows.

use crate::matching::{MatchDomain, conjuncts};
use crate::{AttributePath, Comparison, Condition, Expression, Grammar, Literal, Name, Rule};
use dsr::{Schema, TypeId, ValueKind};

/// Why the rule never matches, if that can be seen.
pub(super) fn why_never(grammar: &Grammar, rule: &Rule, schema: Option<&Schema>) -> Option<String> {
    let conditions: Vec<&Condition> = rule.precondition.iter().flat_map(conjuncts).collect();
    conditions
        .iter()
        .find_map(|condition| alone(rule, condition))
        .or_else(|| links(rule, &conditions))
        .or_else(|| values(&conditions, schema))
        .or_else(|| types(grammar, rule, &conditions, schema?))
}

/// A condition that holds nowhere by itself.
fn alone(rule: &Rule, condition: &Condition) -> Option<String> {
    let bound = |name: &Name| rule.bound_nodes().any(|node| node.variable == *name);
    let never = match condition {
        // Matching is injective.
        Condition::Same(a, b) => a != b && bound(a) && bound(b),
        Condition::Not(inner) => match &**inner {
            Condition::Same(a, b) => a == b,
            Condition::And(all) => all.is_empty(),
            _ => false,
        },
        Condition::Or(any) => any.iter().all(|one| alone(rule, one).is_some()),
        Condition::Compare {
            operator,
            left,
            right,
        } => match (constant(left), constant(right)) {
            (Some(a), Some(b)) => !operator.holds(&a, &b),
            _ => false,
        },
        _ => false,
    };
    never.then(|| format!("{condition} never holds"))
}

fn constant(expression: &Expression) -> Option<dsr::Value> {
    match expression {
        Expression::Literal(Literal::Integer(n)) => Some((*n).into()),
        Expression::Literal(Literal::Real(x)) => Some((*x).into()),
        Expression::Literal(Literal::Text(text)) => Some(text.as_str().into()),
        Expression::Literal(Literal::Boolean(b)) => Some((*b).into()),
        _ => None,
    }
}

/// A link that must both be there and not.
fn links(rule: &Rule, conditions: &[&Condition]) -> Option<String> {
    let mut said: Vec<(&Name, &Name, &Name, bool)> = Vec::new();
    let by_sides = rule.left.edges.iter();
    let by_sides = by_sides.map(|edge| (&edge.from, &edge.label, &edge.to, !edge.negated));
    let by_conditions = conditions.iter().filter_map(|condition| match condition {
        Condition::Edge { label, from, to } => Some((from, label, to, true)),
        Condition::Not(inner) => match &**inner {
            Condition::Edge { label, from, to } => Some((from, label, to, false)),
            _ => None,
        },
        _ => None,
    });
    for (from, label, to, there) in by_sides.chain(by_conditions) {
        if said.contains(&(from, label, to, !there)) {
            return Some(format!(
                "`{from}->{to}({label})` would have to be there and not"
            ));
        }
        said.push((from, label, to, there));
    }
    None
}

/// What conditions ask of one attribute.
struct Asked<'a> {
    path: &'a AttributePath,
    /// Bounds, and whether they themselves are left out.
    low: (f64, bool),
    high: (f64, bool),
    words: Vec<String>,
}

/// Comparisons of one attribute with numbers that no number meets, or none that the schema allows.
#[allow(clippy::float_cmp, reason = "bounds are compared as they are written")]
fn values(conditions: &[&Condition], schema: Option<&Schema>) -> Option<String> {
    let mut asked: Vec<Asked> = Vec::new();
    for condition in conditions {
        let Condition::Compare {
            operator,
            left,
            right,
        } = condition
        else {
            continue;
        };
        let (path, number, operator) = match (&**left, &**right) {
            (Expression::Attribute(path), other) => (path, other.as_number(), *operator),
            (other, Expression::Attribute(path)) => (path, other.as_number(), mirrored(*operator)),
            _ => continue,
        };
        let Some(number) = number else { continue };
        let index = asked
            .iter()
            .position(|a| a.path == path)
            .unwrap_or_else(|| {
                asked.push(new_asked(path, schema));
                asked.len() - 1
            });
        let entry = &mut asked[index];
        entry
            .words
            .push(format!("({} {number})", operator.symbol()));
        let below = |entry: &mut Asked, open| {
            if number < entry.high.0 || (number == entry.high.0 && open) {
                entry.high = (number, open);
            }
        };
        let above = |entry: &mut Asked, open| {
            if number > entry.low.0 || (number == entry.low.0 && open) {
                entry.low = (number, open);
            }
        };
        match operator {
            Comparison::Equal => {
                below(entry, false);
                above(entry, false);
            }
            Comparison::NotEqual => continue,
            Comparison::Less => below(entry, true),
            Comparison::LessOrEqual => below(entry, false),
            Comparison::Greater => above(entry, true),
            Comparison::GreaterOrEqual => above(entry, false),
        }
        if entry.low.0 > entry.high.0
            || (entry.low.0 == entry.high.0 && (entry.low.1 || entry.high.1))
        {
            return Some(format!("no `{path}` is {}", entry.words.join(" and ")));
        }
        let kind = schema.and_then(|schema| declared(schema, path)?.kind);
        if kind.is_some_and(|kind| !numeric(kind)) {
            return Some(format!("`{path}` is no number by the schema"));
        }
    }
    None
}

fn new_asked<'a>(path: &'a AttributePath, schema: Option<&Schema>) -> Asked<'a> {
    let mut asked = Asked {
        path,
        low: (f64::NEG_INFINITY, false),
        high: (f64::INFINITY, false),
        words: Vec::new(),
    };
    if let Some(declared) = schema.and_then(|schema| declared(schema, path)) {
        if let Some(min) = declared.min {
            asked.low = (min, false);
            asked.words.push(format!("(>= {min}, by the schema)"));
        }
        if let Some(max) = declared.max {
            asked.high = (max, false);
            asked.words.push(format!("(<= {max}, by the schema)"));
        }
    }
    asked
}

fn declared<'s>(schema: &'s Schema, path: &AttributePath) -> Option<&'s dsr::AttributeType> {
    let (AttributePath::Node { attribute, .. } | AttributePath::Edge { attribute, .. }) = path;
    let id = schema.find_attribute(attribute)?;
    schema.attributes().get(usize::from(id.0))
}

fn numeric(kind: ValueKind) -> bool {
    use ValueKind::{F32, F64, I32, I64, U32, U64};
    matches!(kind, I32 | U32 | I64 | U64 | F32 | F64)
}

fn mirrored(operator: Comparison) -> Comparison {
    match operator {
        Comparison::Less => Comparison::Greater,
        Comparison::LessOrEqual => Comparison::GreaterOrEqual,
        Comparison::Greater => Comparison::Less,
        Comparison::GreaterOrEqual => Comparison::LessOrEqual,
        same => same,
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
