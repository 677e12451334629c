//! Whether conditions can hold together.
//!
//! Guarantee: a contradiction is only given where no graph and no binding meets the conditions; where there
//! are too many cases to look at, none is given.

use super::facts::{Compared, Facts, constant};
use super::order::Side;
use crate::{
    Arithmetic, AttributePath, Condition, Expression, Grammar, Name, Number, PatternNode, Rule,
};
use dsr::Schema;
use std::collections::BTreeMap;
use std::rc::Rc;

/// So many formulas are looked at for a rule.
const FORMULAS: usize = 1_000;

/// A node that a variable stands for: those of the match come first.
pub(super) type Node = usize;

type Scope = Rc<BTreeMap<Name, Node>>;

/// A formula that comes out one way or the other, and what its variables stand for.
#[derive(Clone)]
struct Asked<'r> {
    condition: &'r Condition,
    holds: bool,
    scope: Scope,
}

impl Asked<'_> {
    fn words(&self) -> String {
        if self.holds {
            self.condition.to_string()
        } else {
            format!("(not {})", self.condition)
        }
    }
}

/// A formula that must hold for whatever nodes its variables stand for.
#[derive(Clone)]
struct ForAll<'r> {
    variables: &'r [PatternNode],
    body: Asked<'r>,
}

#[derive(Clone)]
struct Case<'r> {
    facts: Facts<'r>,
    /// The types of the nodes.
    nodes: Vec<&'r Name>,
    asked: Vec<Asked<'r>>,
    /// Of each of these formulas, one part must hold.
    open: Vec<(Asked<'r>, Vec<Asked<'r>>)>,
    universal: Vec<ForAll<'r>>,
}

struct Search<'r> {
    grammar: &'r Grammar,
    bound: usize,
    left: usize,
}

/// Why a rule's left side and precondition hold nowhere, if that can be seen.
pub(super) fn contradiction(
    grammar: &Grammar,
    rule: &Rule,
    schema: Option<&Schema>,
) -> Option<String> {
    let mut scope = BTreeMap::new();
    let mut nodes = Vec::new();
    for node in rule.bound_nodes() {
        scope.insert(node.variable.clone(), nodes.len());
        nodes.push(&node.type_name);
    }
    let scope = Rc::new(scope);
    let mut search = Search {
        grammar,
        bound: nodes.len(),
        left: FORMULAS,
    };
    let mut case = Case {
        facts: Facts::new(schema),
        nodes,
        asked: Vec::new(),
        open: Vec::new(),
        universal: Vec::new(),
    };
    for edge in &rule.left.edges {
        if let (Some(&from), Some(&to)) = (scope.get(&edge.from), scope.get(&edge.to)) {
            let words = || format!("{}->{}({})", edge.from, edge.to, edge.label);
            let link = (from, &edge.label, to);
            if let Some(reason) = case.facts.link(link, !edge.negated, words) {
                return Some(reason);
            }
        }
    }
    case.asked
        .extend(rule.precondition.iter().map(|condition| Asked {
            condition,
            holds: true,
            scope: Rc::clone(&scope),
        }));
    search.close(case)
}

impl<'r> Search<'r> {
    /// Why a case cannot be, if that can be seen.
    fn close(&mut self, mut case: Case<'r>) -> Option<String> {
        loop {
            while let Some(asked) = case.asked.pop() {
                self.left = self.left.checked_sub(1)?;
                if let Some(reason) = self.add(asked, &mut case) {
                    return Some(reason);
                }
            }
            let Some(universal) = case.universal.pop() else {
                break;
            };
            self.instances(&universal, &mut case)?;
        }
        if let Some(reason) = case.facts.contradiction() {
            return Some(reason);
        }
        let (whole, parts) = case.open.pop()?;
        let mut reasons = Vec::new();
        for part in parts {
            let mut next = case.clone();
            next.asked.push(part);
            let reason = self.close(next)?;
            if !reasons.contains(&reason) {
                reasons.push(reason);
            }
        }
        reasons.truncate(3);
        match reasons.as_slice() {
            [one] => Some(one.clone()),
            [] => Some(format!("{} never holds", whole.words())),
            several => Some(several.join("; and otherwise ")),
        }
    }

    /// What a formula for all nodes asks of those that there are.
    fn instances(&mut self, universal: &ForAll<'r>, case: &mut Case<'r>) -> Option<()> {
        let types = &self.grammar.types;
        let mut scopes = vec![(*universal.body.scope).clone()];
        for variable in universal.variables {
            let mut next = Vec::new();
            for scope in scopes {
                for (node, exact) in case.nodes.iter().enumerate() {
                    if types.is_subtype(exact, &variable.type_name) {
                        self.left = self.left.checked_sub(1)?;
                        let mut scope = scope.clone();
                        scope.insert(variable.variable.clone(), node);
                        next.push(scope);
                    }
                }
            }
            scopes = next;
        }
        case.asked.extend(scopes.into_iter().map(|scope| Asked {
            scope: Rc::new(scope),
            ..universal.body.clone()
        }));
        Some(())
    }

    fn add(&self, asked: Asked<'r>, case: &mut Case<'r>) -> Option<String> {
        let Asked {
            condition: whole,
            holds,
            scope,
        } = asked;
        let condition = whole;
        let part = |condition, holds| Asked {
            condition,
            holds,
            scope: Rc::clone(&scope),
        };
        let words = || part(condition, holds).words();
        match (condition, holds) {
            (Condition::Edge { label, from, to }, _) => {
                let link = (*scope.get(from)?, label, *scope.get(to)?);
                let words = || format!("{from}->{to}({label})");
                return case.facts.link(link, holds, words);
            }
            (Condition::Same(a, b), _) => {
                let (one, other) = (*scope.get(a)?, *scope.get(b)?);
                // Matching is injective.
                let bound = one < self.bound && other < self.bound;
                let never = if holds {
                    one != other && bound
                } else {
                    one == other
                };
                return never.then(|| format!("{} never holds", words()));
            }
            (
                Condition::Compare {
                    operator,
                    left,
                    right,
                },
                _,
            ) => {
                let compared = |expression| {
                    Some(Compared {
                        expression,
                        key: key(expression, &scope)?,
                        side: side(expression, &scope),
                    })
                };
                let sides = [compared(left)?, compared(right)?];
                return case.facts.compare(*operator, sides, holds, words);
            }
            (Condition::Not(inner), _) => case.asked.push(part(inner, !holds)),
            (Condition::And(all), true) | (Condition::Or(all), false) => {
                case.asked
                    .extend(all.iter().rev().map(|one| part(one, holds)));
            }
            (Condition::Or(any), true) | (Condition::And(any), false) => {
                let parts = any.iter().map(|one| part(one, holds)).collect();
                case.open.push((part(condition, holds), parts));
            }
            (
                Condition::When {
                    condition,
                    consequence,
                },
                true,
            ) => {
                let parts = vec![part(condition, false), part(consequence, true)];
                case.open.push((part(whole, true), parts));
            }
            (
                Condition::When {
                    condition,
                    consequence,
                },
                false,
            ) => {
                case.asked
                    .extend([part(consequence, false), part(condition, true)]);
            }
            (Condition::Exists { variables, body }, true)
            | (Condition::Forall { variables, body }, false) => {
                let mut inner = (*scope).clone();
                for variable in variables {
                    inner.insert(variable.variable.clone(), case.nodes.len());
                    case.nodes.push(&variable.type_name);
                }
                case.asked.push(Asked {
                    condition: body,
                    holds,
                    scope: Rc::new(inner),
                });
            }
            (Condition::Exists { variables, body }, false)
            | (Condition::Forall { variables, body }, true) => {
                let body = part(body, holds);
                case.universal.push(ForAll { variables, body });
            }
        }
        None
    }
}

/// What tells expressions apart: the same for the same attribute of the same node.
fn key(expression: &Expression, scope: &Scope) -> Option<String> {
    Some(match expression {
        Expression::Literal(_) => expression.to_string(),
        Expression::Attribute(AttributePath::Node {
            variable,
            attribute,
        }) => format!("{}.{attribute}", scope.get(variable)?),
        Expression::Attribute(AttributePath::Edge {
            from,
            label,
            to,
            attribute,
        }) => {
            let (from, to) = (scope.get(from)?, scope.get(to)?);
            format!("e({from},{label},{to}).{attribute}")
        }
        Expression::Arithmetic { operator, operands } => {
            let operands = operands.iter().map(|operand| key(operand, scope));
            let operands: Vec<String> = operands.collect::<Option<_>>()?;
            format!("({} {})", operator.symbol(), operands.join(" "))
        }
    })
}

/// What an expression adds to what.
fn side(expression: &Expression, scope: &Scope) -> Side {
    if let Some(constant) = constant(expression) {
        return Side::Constant(constant);
    }
    let sum = match expression {
        Expression::Literal(_) => None,
        Expression::Attribute(_) => key(expression, scope).map(|base| Side::Sum {
            base,
            added: Vec::new(),
        }),
        Expression::Arithmetic { operator, operands } => sum(*operator, operands, scope),
    };
    sum.unwrap_or(Side::Other)
}

/// The same for arithmetic, if it is a sum of one attribute and constants.
fn sum(operator: Arithmetic, operands: &[Expression], scope: &Scope) -> Option<Side> {
    let number = |value: &Expression| constant(value).as_ref().and_then(Number::of);
    let place = operands.iter().position(|one| constant(one).is_none())?;
    let Side::Sum { base, mut added } = side(&operands[place], scope) else {
        return None;
    };
    match operator {
        Arithmetic::Add => {
            if place > 0 {
                let first: Option<Vec<Number>> = operands[..place].iter().map(number).collect();
                added.push(operator.compute(&first?)?);
            }
            for one in &operands[place + 1..] {
                added.push(number(one)?);
            }
        }
        Arithmetic::Subtract if place == 0 && operands.len() > 1 => {
            for one in &operands[1..] {
                added.push(Arithmetic::Subtract.compute(&[number(one)?])?);
            }
        }
        _ => return None,
    }
    Some(Side::Sum { base, added })
}
