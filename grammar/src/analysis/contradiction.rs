//! Whether conditions can hold together.
//!
//! Guarantee: a contradiction is only given where no graph and no binding meets the conditions; where there
//! are too many cases to look at, none is given.

use super::facts::{Compared, Facts};
use super::side::{key, side};
use crate::matching::conjuncts;
use crate::{Condition, Grammar, Name, PatternEdge, PatternNode, Rule, Types};
use dsr::Schema;
use std::collections::BTreeMap;
use std::rc::Rc;

/// So many formulas are looked at for a rule.
const FORMULAS: usize = 1_000;
/// Formulas for all nodes are said of so many beside those of the match.
const NODES: usize = 8;

/// A node that a variable stands for: those of the match come first.
pub(super) type Node = usize;

pub(super) type Scope = Rc<BTreeMap<Name, Node>>;

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
    /// It was said of so many nodes.
    seen: usize,
}

#[derive(Clone)]
struct Case<'r> {
    facts: Facts<'r>,
    /// The types of the nodes, of which each has all.
    nodes: Vec<Vec<&'r Name>>,
    asked: Vec<Asked<'r>>,
    /// Of each of these formulas, one part must hold.
    open: Vec<(Asked<'r>, Vec<Asked<'r>>)>,
    universal: Vec<ForAll<'r>>,
}

struct Search<'r> {
    types: &'r Types,
    bound: usize,
    left: usize,
}

/// Nodes, and what must hold of them all together.
pub(super) struct Together<'r> {
    pub(super) types: &'r Types,
    pub(super) schema: Option<&'r Schema>,
    /// Variables that stand for different nodes, and the types that each has.
    pub(super) nodes: Vec<(&'r Name, Vec<&'r Name>)>,
    /// Of left sides.
    pub(super) links: Vec<&'r PatternEdge>,
    pub(super) conditions: Vec<&'r Condition>,
}

/// Why a rule's left side and precondition, and `more`, hold nowhere, if that can be seen.
pub(super) fn contradiction(
    grammar: &Grammar,
    rule: &Rule,
    more: &[Condition],
    schema: Option<&Schema>,
) -> Option<String> {
    let nodes = rule.bound_nodes();
    let together = Together {
        types: &grammar.types,
        schema,
        nodes: nodes.map(|n| (&n.variable, vec![&n.type_name])).collect(),
        links: rule.left.edges.iter().collect(),
        conditions: rule.precondition.iter().chain(more).collect(),
    };
    together.contradiction().0
}

impl<'r> Together<'r> {
    /// Why they hold in no graph, if that can be seen; and how many formulas were looked at.
    pub(super) fn contradiction(self) -> (Option<String>, usize) {
        let mut search = Search {
            types: self.types,
            bound: self.nodes.len(),
            left: FORMULAS,
        };
        let reason = self.close(&mut search);
        (reason, FORMULAS - search.left)
    }

    fn close(self, search: &mut Search<'r>) -> Option<String> {
        let mut scope = BTreeMap::new();
        let mut nodes = Vec::new();
        for (name, types) in self.nodes {
            scope.insert(name.clone(), nodes.len());
            nodes.push(types);
        }
        let scope = Rc::new(scope);
        let mut case = Case {
            facts: Facts::new(self.schema),
            nodes,
            asked: Vec::new(),
            open: Vec::new(),
            universal: Vec::new(),
        };
        for edge in self.links {
            if let (Some(&from), Some(&to)) = (scope.get(&edge.from), scope.get(&edge.to)) {
                let words = || format!("{}->{}({})", edge.from, edge.to, edge.label);
                let link = (from, &edge.label, to);
                if let Some(reason) = case.facts.link(link, !edge.negated, words) {
                    return Some(reason);
                }
            }
        }
        let asked = self.conditions.into_iter().map(|condition| Asked {
            condition,
            holds: true,
            scope: Rc::clone(&scope),
        });
        case.asked.extend(asked);
        search.close(case)
    }
}

impl<'r> Case<'r> {
    /// Nodes for variables of which the body comes out as `holds` for some.
    fn chosen(
        &mut self,
        variables: &'r [PatternNode],
        body: &'r Condition,
        holds: bool,
        scope: &BTreeMap<Name, Node>,
    ) -> BTreeMap<Name, Node> {
        let mut inner = scope.clone();
        for variable in variables {
            let name = &variable.variable;
            let same = holds.then(|| same_as(name, body)).flatten();
            let outside = same.filter(|same| variables.iter().all(|v| v.variable != **same));
            let known = outside.and_then(|same| scope.get(same)).copied();
            let node = known.unwrap_or(self.nodes.len());
            if known.is_none() {
                self.nodes.push(Vec::new());
            }
            self.nodes[node].push(&variable.type_name);
            inner.insert(name.clone(), node);
        }
        inner
    }
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
            // Nodes that formulas for all of them ask for are enough after a few.
            let count = case.nodes.len().min(self.bound + NODES);
            let mut universal = case.universal.iter_mut();
            let Some(next) = universal.find(|next| next.seen < count) else {
                if self.narrow(&mut case) {
                    continue;
                }
                break;
            };
            let before = std::mem::replace(&mut next.seen, count);
            let next = next.clone();
            self.instances(&next, before, &mut case)?;
        }
        if let Some(reason) = case.facts.contradiction() {
            return Some(reason);
        }
        let fewest = (0..case.open.len()).min_by_key(|index| case.open[*index].1.len())?;
        let (whole, parts) = case.open.remove(fewest);
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

    /// Leaves out what is known not to hold, and asks for what is the only part left; whether there was any.
    fn narrow(&self, case: &mut Case<'r>) -> bool {
        let mut open = std::mem::take(&mut case.open);
        open.retain_mut(|(_, parts)| {
            let mut holds = false;
            parts.retain(|part| {
                let known = self.known(part.condition, part.holds, &part.scope, case);
                holds |= known == Some(true);
                known != Some(false)
            });
            if let ([one], false) = (&parts[..], holds) {
                case.asked.push(one.clone());
                return false;
            }
            !holds
        });
        case.open = open;
        !case.asked.is_empty()
    }

    /// Whether a formula comes out as `holds`, by what is known.
    fn known(
        &self,
        condition: &Condition,
        holds: bool,
        scope: &Scope,
        case: &Case<'r>,
    ) -> Option<bool> {
        let known = |condition, holds| self.known(condition, holds, scope, case);
        let all = |parts: &mut dyn Iterator<Item = Option<bool>>| {
            let mut all = Some(true);
            for part in parts {
                match part {
                    Some(false) => return Some(false),
                    Some(true) => {}
                    None => all = None,
                }
            }
            all
        };
        match condition {
            Condition::Edge { label, from, to } => {
                let link = (*scope.get(from)?, &**label, *scope.get(to)?);
                Some(case.facts.known_link(link)? == holds)
            }
            Condition::Same(a, b) => {
                let (one, other) = (*scope.get(a)?, *scope.get(b)?);
                let bound = one < self.bound && other < self.bound;
                (bound || one == other).then_some((one == other) == holds)
            }
            Condition::Compare {
                operator,
                left,
                right,
            } => {
                let keys = [key(left, scope)?, key(right, scope)?];
                Some(case.facts.known_comparison(*operator, keys)? == holds)
            }
            Condition::Not(inner) => known(inner, !holds),
            Condition::And(list) | Condition::Or(list) => {
                let every = matches!(condition, Condition::And(_)) == holds;
                let mut parts = list.iter().map(|part| known(part, holds == every));
                let whole = all(&mut parts)?;
                Some(whole == every)
            }
            Condition::When {
                condition,
                consequence,
            } => {
                let broken = [known(condition, true), known(consequence, false)];
                Some(all(&mut broken.into_iter())? != holds)
            }
            Condition::Exists { .. } | Condition::Forall { .. } => None,
        }
    }

    /// What a formula for all nodes asks of those that there are and it was not said of `before`.
    fn instances(
        &mut self,
        universal: &ForAll<'r>,
        before: usize,
        case: &mut Case<'r>,
    ) -> Option<()> {
        let mut scopes = vec![((*universal.body.scope).clone(), false)];
        for variable in universal.variables {
            let mut next = Vec::new();
            for (scope, has_new) in scopes {
                for (node, types) in case.nodes.iter().enumerate().take(universal.seen) {
                    let mut types = types.iter();
                    if types.any(|exact| self.types.is_subtype(exact, &variable.type_name)) {
                        self.left = self.left.checked_sub(1)?;
                        let mut scope = scope.clone();
                        scope.insert(variable.variable.clone(), node);
                        next.push((scope, has_new || node >= before));
                    }
                }
            }
            scopes = next;
        }
        let new = scopes.into_iter().filter(|(_, has_new)| *has_new);
        case.asked.extend(new.map(|(scope, _)| Asked {
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
                let scope = Rc::new(case.chosen(variables, body, holds, &scope));
                case.asked.push(Asked {
                    condition: body,
                    holds,
                    scope,
                });
            }
            (Condition::Exists { variables, body }, false)
            | (Condition::Forall { variables, body }, true) => {
                let body = part(body, holds);
                let seen = 0;
                case.universal.push(ForAll {
                    variables,
                    body,
                    seen,
                });
            }
        }
        None
    }
}

/// A variable that must be the same node for a formula to hold.
fn same_as<'r>(name: &Name, body: &'r Condition) -> Option<&'r Name> {
    conjuncts(body).into_iter().find_map(|part| match part {
        Condition::Same(a, b) if a == name && b != name => Some(b),
        Condition::Same(a, b) if b == name && a != name => Some(a),
        _ => None,
    })
}
