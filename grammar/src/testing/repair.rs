//! Makes random rules well-formed: every variable is bound where it is used.

use crate::{
    AttributePath, Comparison, Condition, Effect, Expression, Literal, Name, Pattern, PatternEdge,
    PatternNode, Rule,
};

/// The rule with unknown variables replaced by known ones, second declarations dropped, and
/// nothing in its header but a name. Links or formulas for which there is no variable go.
pub(crate) fn repaired(rule: Rule) -> Rule {
    let mut rule = rule;
    rule.name = "r".into();
    rule.cost = Expression::number(1.0);
    rule.duration = None;
    rule.dormant = false;
    rule.activates.clear();
    distinct(&mut rule.parameters);
    for side in [&mut rule.left, &mut rule.right] {
        pattern(side, &rule.parameters);
    }
    let before: Vec<Name> = rule
        .bound_nodes()
        .map(|node| node.variable.clone())
        .collect();
    let mut fresh = 0;
    rule.precondition = rule.precondition.take().filter(|_| !before.is_empty());
    if let Some(precondition) = &mut rule.precondition {
        condition(precondition, &mut before.clone(), &mut fresh);
    }
    let gone = |name: &&Name| rule.left.node(name).is_some() && rule.right.node(name).is_none();
    let mut after: Vec<Name> = before.iter().filter(|name| !gone(name)).cloned().collect();
    for node in &rule.right.nodes {
        if !after.contains(&node.variable) {
            after.push(node.variable.clone());
        }
    }
    if before.is_empty() || after.is_empty() {
        rule.effect.clear();
    }
    effects(
        &mut rule.effect,
        &mut before.clone(),
        &mut after,
        &mut fresh,
    );
    rule
}

fn distinct(nodes: &mut Vec<PatternNode>) {
    let mut seen: Vec<Name> = Vec::new();
    nodes.retain(|node| {
        let new = !seen.contains(&node.variable);
        seen.push(node.variable.clone());
        new
    });
}

fn pattern(side: &mut Pattern, parameters: &[PatternNode]) {
    distinct(&mut side.nodes);
    let scope: Vec<Name> = side
        .nodes
        .iter()
        .chain(parameters)
        .map(|node| node.variable.clone())
        .collect();
    if scope.is_empty() {
        side.edges.clear();
    }
    let mut seen: Vec<PatternEdge> = Vec::new();
    for mut edge in std::mem::take(&mut side.edges) {
        bind(&mut edge.from, &scope);
        bind(&mut edge.to, &scope);
        if !seen
            .iter()
            .any(|other| other.joins(&edge.from, &edge.label, &edge.to))
        {
            seen.push(edge);
        }
    }
    side.edges = seen;
}

fn bind(name: &mut Name, scope: &[Name]) {
    if !scope.contains(name) {
        let letter = usize::from(name.as_bytes()[0]);
        *name = scope[letter % scope.len()].clone();
    }
}

fn quantify(variables: &mut [PatternNode], scope: &mut Vec<Name>, fresh: &mut usize) {
    for variable in variables {
        *fresh += 1;
        variable.variable = format!("q{fresh}").as_str().into();
        scope.push(variable.variable.clone());
    }
}

fn condition(formula: &mut Condition, scope: &mut Vec<Name>, fresh: &mut usize) {
    match formula {
        Condition::Edge { from, to, .. } | Condition::Same(from, to) => {
            bind(from, scope);
            bind(to, scope);
        }
        Condition::Compare {
            operator,
            left,
            right,
        } => {
            for side in [left, right] {
                expression(side, scope);
                if !matches!(operator, Comparison::Equal | Comparison::NotEqual) {
                    numeric(side);
                }
            }
        }
        Condition::Not(inner) => condition(inner, scope, fresh),
        Condition::And(all) | Condition::Or(all) => {
            for inner in all {
                condition(inner, scope, fresh);
            }
        }
        Condition::Exists { variables, body } | Condition::Forall { variables, body } => {
            let outer = scope.len();
            quantify(variables, scope, fresh);
            condition(body, scope, fresh);
            scope.truncate(outer);
        }
        Condition::When {
            condition: first,
            consequence,
        } => {
            condition(first, scope, fresh);
            condition(consequence, scope, fresh);
        }
    }
}

fn expression(formula: &mut Expression, scope: &[Name]) {
    match formula {
        Expression::Literal(_) => {}
        Expression::Attribute(target) => path(target, scope),
        Expression::Arithmetic { operands, .. } => {
            for operand in operands {
                expression(operand, scope);
                numeric(operand);
            }
        }
    }
}

/// Where only numbers can stand: a number in place of another constant.
fn numeric(formula: &mut Expression) {
    if matches!(formula, Expression::Literal(_)) && formula.as_number().is_none() {
        *formula = Expression::Literal(Literal::Integer(1));
    }
}

fn path(target: &mut AttributePath, scope: &[Name]) {
    match target {
        AttributePath::Node { variable, .. } => bind(variable, scope),
        AttributePath::Edge { from, to, .. } => {
            bind(from, scope);
            bind(to, scope);
        }
    }
}

fn effects(list: &mut [Effect], before: &mut Vec<Name>, after: &mut Vec<Name>, fresh: &mut usize) {
    let outer = after.len();
    for effect in list {
        match effect {
            Effect::Link { from, to, .. } | Effect::Unlink { from, to, .. } => {
                bind(from, after);
                bind(to, after);
            }
            Effect::Assign { target, value } => {
                path(target, after);
                expression(value, before);
            }
            Effect::Create { variable, .. } => {
                *fresh += 1;
                *variable = format!("n{fresh}").as_str().into();
                after.push(variable.clone());
            }
            Effect::Delete { variable } | Effect::Retype { variable, .. } => bind(variable, after),
            Effect::Forall { variables, body } => {
                let sizes = (before.len(), after.len());
                quantify(variables, before, fresh);
                after.extend_from_slice(&before[sizes.0..]);
                effects(body, before, after, fresh);
                before.truncate(sizes.0);
                after.truncate(sizes.1);
            }
            Effect::When {
                condition: first,
                body,
            } => {
                condition(first, before, fresh);
                effects(body, before, after, fresh);
            }
        }
    }
    after.truncate(outer);
}
