//! What must hold before a rule for a formula to hold after it.
//!
//! Guarantee: where an answer is given, it holds of a graph exactly if the formula holds of the graph after the rule,
//! provided that the rule can be applied. Where no formula says that, there is none.

use super::changes::{Change, Changes, What};
use crate::formula::{all, any, negated, no, yes};
use crate::{AttributePath, Condition, Expression, Name, PatternNode, Types};
use std::cell::Cell;

/// So many formulas are written for two rules laid over each other.
const FORMULAS: usize = 2_000;
/// In so many ways a value can come about.
const CASES: usize = 32;

/// What variables stand for where a formula is looked at.
#[derive(Clone, Default)]
struct Scope {
    /// Quantified variables that stand for a node with another name.
    fixed: Vec<(Name, Name)>,
    /// Quantified variables, with the types of their nodes.
    quantified: Vec<PatternNode>,
}

impl Scope {
    fn resolve(&self, name: &Name) -> Name {
        let found = self.fixed.iter().rev().find(|(old, _)| old == name);
        found.map_or_else(|| name.clone(), |(_, new)| new.clone())
    }

    fn with(&self, variable: &PatternNode) -> Self {
        let mut scope = self.clone();
        scope.quantified.push(variable.clone());
        scope
    }

    fn and_fixed(&self, variable: &Name, node: &Name) -> Self {
        let mut scope = self.clone();
        scope.fixed.push((variable.clone(), node.clone()));
        scope
    }
}

/// One way for a value to come about.
#[derive(Clone)]
struct Case {
    /// There are such nodes,
    variables: Vec<PatternNode>,
    /// of which this holds before the rule;
    conditions: Vec<Condition>,
    /// then this is the value, said of the graph before.
    value: Expression,
}

/// Says of the graph before a rule what is asked of the graph after it.
pub(super) struct After<'a, 'c> {
    types: &'a Types,
    changes: &'c Changes<'a>,
    left: Cell<usize>,
}

impl<'a, 'c> After<'a, 'c> {
    pub(super) fn new(types: &'a Types, changes: &'c Changes<'a>) -> Self {
        Self {
            types,
            changes,
            left: Cell::new(FORMULAS),
        }
    }

    /// How many formulas were written until now.
    pub(super) fn written(&self) -> u64 {
        (FORMULAS - self.left.get()) as u64
    }

    /// When the formula holds after the rule.
    pub(super) fn condition(&self, condition: &Condition) -> Option<Condition> {
        self.formula(condition, &Scope::default())
    }

    /// When the link is there after the rule.
    pub(super) fn link(&self, label: &Name, from: &Name, to: &Name) -> Option<Condition> {
        self.edge((from, label, to), &Scope::default())
    }

    /// When a node of a match is gone after the rule, or of a type that is none of these any more.
    pub(super) fn is_lost(&self, node: &Name, types: &[&Name]) -> Option<Condition> {
        let scope = Scope::default();
        let mut ways = vec![self.is_deleted(node, &scope)?];
        for change in self.changes.all() {
            if let What::Retype(of, becomes) = &change.what
                && !types.iter().all(|t| self.types.is_subtype(becomes, t))
            {
                ways.push(self.happens(change, &[(of, node)], &scope)?);
            }
        }
        Some(any(ways))
    }

    fn spend(&self) -> Option<()> {
        self.left.set(self.left.get().checked_sub(1)?);
        Some(())
    }

    fn formula(&self, condition: &Condition, scope: &Scope) -> Option<Condition> {
        self.spend()?;
        let several = |list: &[Condition]| -> Option<Vec<Condition>> {
            list.iter().map(|one| self.formula(one, scope)).collect()
        };
        Some(match condition {
            Condition::Edge { label, from, to } => {
                self.edge((&scope.resolve(from), label, &scope.resolve(to)), scope)?
            }
            Condition::Same(a, b) => self.same(&scope.resolve(a), &scope.resolve(b)),
            Condition::Compare {
                operator,
                left,
                right,
            } => {
                let mut ways = Vec::new();
                let rights = self.cases(right, scope)?;
                for one in self.cases(left, scope)? {
                    for other in &rights {
                        let mut conditions = one.conditions.clone();
                        conditions.extend(other.conditions.iter().cloned());
                        conditions.push(Condition::Compare {
                            operator: *operator,
                            left: Box::new(one.value.clone()),
                            right: Box::new(other.value.clone()),
                        });
                        let variables = one.variables.iter().chain(&other.variables);
                        ways.push(exists(variables.cloned().collect(), all(conditions)));
                    }
                }
                any(ways)
            }
            Condition::Not(inner) => negated(self.formula(inner, scope)?),
            Condition::And(list) => all(several(list)?),
            Condition::Or(list) => any(several(list)?),
            Condition::When {
                condition,
                consequence,
            } => any(vec![
                negated(self.formula(condition, scope)?),
                self.formula(consequence, scope)?,
            ]),
            Condition::Exists { variables, body } => self.some(variables, body, true, scope)?,
            Condition::Forall { variables, body } => {
                negated(self.some(variables, body, false, scope)?)
            }
        })
    }

    /// That for some nodes the body comes out as `holds`.
    fn some(
        &self,
        variables: &[PatternNode],
        body: &Condition,
        holds: bool,
        scope: &Scope,
    ) -> Option<Condition> {
        let Some((variable, rest)) = variables.split_first() else {
            let body = self.formula(body, scope)?;
            return Some(if holds { body } else { negated(body) });
        };
        self.spend()?;
        let asks_for = |type_name: &str| self.types.is_subtype(type_name, &variable.type_name);
        let name = &variable.variable;
        // Nodes that are there and stay what they are.
        let inside = scope.with(variable);
        let mut stays = vec![negated(self.is_deleted(name, &inside)?)];
        let mut cases = Vec::new();
        for change in self.changes.all() {
            match &change.what {
                What::Retype(node, becomes) => {
                    stays.push(negated(self.happens(change, &[(node, name)], &inside)?));
                    if asks_for(becomes) {
                        let (change, node) = self.apart(change, node);
                        let inside = change
                            .variables
                            .iter()
                            .fold(scope.clone(), |s, v| s.with(v));
                        let inside = inside.and_fixed(name, &node);
                        let mut conditions = change.conditions.clone();
                        conditions.push(negated(self.is_deleted(&node, &inside)?));
                        conditions.push(self.some(rest, body, holds, &inside)?);
                        cases.push(exists(change.variables, all(conditions)));
                    }
                }
                What::Create(node, type_name) if asks_for(type_name) => {
                    if !change.always() {
                        // How many there will be, no formula says.
                        return None;
                    }
                    let inside = scope.and_fixed(name, node);
                    let other = self.ways(&inside, |what| match what {
                        What::Delete(of) | What::Retype(of, _) => Some(vec![(of, node)]),
                        _ => None,
                    })?;
                    let there = self.some(rest, body, holds, &inside)?;
                    cases.push(all(vec![negated(other), there]));
                }
                _ => {}
            }
        }
        stays.push(self.some(rest, body, holds, &inside)?);
        cases.insert(0, exists(vec![variable.clone()], all(stays)));
        Some(any(cases))
    }

    /// A change with variables of its own that nothing else has, and what it calls a node then.
    fn apart(&self, change: &Change, node: &Name) -> (Change, Name) {
        let (change, names) = self.changes.apart(change, &[]);
        let new = names.iter().find(|(old, _)| old == node);
        let node = new.map_or_else(|| node.clone(), |(_, new)| new.clone());
        (change, node)
    }

    fn is_deleted(&self, node: &Name, scope: &Scope) -> Option<Condition> {
        self.ways(scope, |what| match what {
            What::Delete(gone) => Some(vec![(gone, node)]),
            _ => None,
        })
    }

    /// That one of the changes happens that is of what is asked: those for which there are pairs of names that must
    /// stand for the same node.
    fn ways<'n>(
        &self,
        scope: &Scope,
        is: impl Fn(&'n What) -> Option<Vec<(&'n Name, &'n Name)>>,
    ) -> Option<Condition>
    where
        'c: 'n,
    {
        let mut ways = Vec::new();
        for change in self.changes.all() {
            if let Some(pairs) = is(&change.what) {
                ways.push(self.happens(change, &pairs, scope)?);
            }
        }
        Some(any(ways))
    }

    /// When a change happens to these nodes: pairs of what the change and what the formula calls them.
    fn happens(
        &self,
        change: &Change,
        pairs: &[(&Name, &Name)],
        scope: &Scope,
    ) -> Option<Condition> {
        let (change, sames) = self.met(change, pairs, scope)?;
        let conditions = change.conditions.into_iter().chain(sames);
        Some(exists(change.variables, all(conditions.collect())))
    }

    /// A change at these nodes, and what must be the same for that.
    fn met(
        &self,
        change: &Change,
        pairs: &[(&Name, &Name)],
        scope: &Scope,
    ) -> Option<(Change, Vec<Condition>)> {
        self.spend()?;
        let mut put: Vec<(Name, Name)> = Vec::new();
        for (own, other) in pairs {
            let quantified = change.variables.iter().find(|node| node.variable == **own);
            let is_put = put.iter().any(|(name, _)| name == *own);
            if let Some(node) = quantified
                && !is_put
                && !self.is_new(other)
                && self.is_surely(other, &node.type_name, scope)
            {
                put.push(((*own).clone(), (*other).clone()));
            }
        }
        let (change, names) = self.changes.apart(change, &put);
        let renamed = |name: &Name| {
            let new = names.iter().find(|(old, _)| old == name);
            new.map_or_else(|| name.clone(), |(_, new)| new.clone())
        };
        let sames = pairs
            .iter()
            .map(|(own, other)| self.same(&renamed(own), other));
        let sames = sames.collect();
        Some((change, sames))
    }

    /// Whether whatever a variable stands for is of a type.
    fn is_surely(&self, name: &Name, type_name: &str, scope: &Scope) -> bool {
        let mut quantified = scope.quantified.iter().rev();
        if let Some(node) = quantified.find(|node| node.variable == *name) {
            return self.types.is_subtype(&node.type_name, type_name);
        }
        let mut known = self.changes.types_of(name).iter();
        known.any(|known| self.types.is_subtype(known, type_name))
    }

    fn is_new(&self, name: &Name) -> bool {
        self.changes.is_new(name)
    }

    fn same(&self, a: &Name, b: &Name) -> Condition {
        if a == b {
            return yes();
        }
        let is_known = |name| self.changes.is_bound(name) || self.is_new(name);
        // Nodes of matches that are not the same were laid beside each other.
        if is_known(a) && is_known(b) || self.is_new(a) || self.is_new(b) {
            return no();
        }
        Condition::Same(a.clone(), b.clone())
    }

    fn edge(&self, (from, label, to): (&Name, &Name, &Name), scope: &Scope) -> Option<Condition> {
        self.spend()?;
        let added = self.ways(scope, |what| match what {
            What::Link(a, of, b) if of == label => Some(vec![(a, from), (b, to)]),
            _ => None,
        })?;
        if added == yes() {
            return Some(added);
        }
        let removed = self.ways(scope, |what| match what {
            What::Unlink(a, of, b) if of == label => Some(vec![(a, from), (b, to)]),
            _ => None,
        })?;
        let before = if self.is_new(from) || self.is_new(to) {
            no()
        } else {
            Condition::Edge {
                label: label.clone(),
                from: from.clone(),
                to: to.clone(),
            }
        };
        Some(any(vec![all(vec![before, negated(removed)]), added]))
    }

    /// The ways for a value to come about; none where it is missing.
    fn cases(&self, expression: &Expression, scope: &Scope) -> Option<Vec<Case>> {
        self.spend()?;
        let found = match expression {
            Expression::Literal(_) => vec![Case {
                variables: Vec::new(),
                conditions: Vec::new(),
                value: expression.clone(),
            }],
            Expression::Attribute(path) => self.attribute(path, scope)?,
            Expression::Arithmetic { operator, operands } => {
                let mut rows = vec![(Vec::new(), Vec::new(), Vec::new())];
                for operand in operands {
                    let cases = self.cases(operand, scope)?;
                    let mut next = Vec::new();
                    for (variables, conditions, values) in rows {
                        for case in &cases {
                            let mut row: (Vec<_>, Vec<_>, Vec<_>) =
                                (variables.clone(), conditions.clone(), values.clone());
                            row.0.extend(case.variables.iter().cloned());
                            row.1.extend(case.conditions.iter().cloned());
                            row.2.push(case.value.clone());
                            next.push(row);
                        }
                    }
                    rows = next;
                    if rows.len() > CASES {
                        return None;
                    }
                }
                let row = |(variables, conditions, operands)| Case {
                    variables,
                    conditions,
                    value: Expression::Arithmetic {
                        operator: *operator,
                        operands,
                    },
                };
                rows.into_iter().map(row).collect()
            }
        };
        (found.len() <= CASES).then_some(found)
    }

    fn attribute(&self, path: &AttributePath, scope: &Scope) -> Option<Vec<Case>> {
        let (path, is_new, mut there) = match path {
            AttributePath::Node {
                variable,
                attribute,
            } => {
                let variable = scope.resolve(variable);
                let is_new = self.is_new(&variable);
                let attribute = attribute.clone();
                let path = AttributePath::Node {
                    variable,
                    attribute,
                };
                (path, is_new, Vec::new())
            }
            AttributePath::Edge {
                from,
                label,
                to,
                attribute,
            } => {
                let (from, to) = (scope.resolve(from), scope.resolve(to));
                let is_new = self.is_new(&from) || self.is_new(&to);
                let there = self.edge((&from, label, &to), scope)?;
                let path = AttributePath::Edge {
                    from,
                    label: label.clone(),
                    to,
                    attribute: attribute.clone(),
                };
                (path, is_new, vec![there])
            }
        };
        let mut found = Vec::new();
        let mut otherwise = Vec::new();
        for change in self.changes.all() {
            let What::Assign(assigned) = &change.what else {
                continue;
            };
            let Some(pairs) = ends_of_same(&assigned.0, &path) else {
                continue;
            };
            let unless = negated(self.happens(change, &pairs, scope)?);
            if unless == yes() {
                continue;
            }
            let (change, sames) = self.met(change, &pairs, scope)?;
            let What::Assign(assigned) = change.what else {
                continue;
            };
            let conditions = change.conditions.into_iter().chain(sames);
            found.push(Case {
                variables: change.variables,
                conditions: there.iter().cloned().chain(conditions).collect(),
                value: assigned.1,
            });
            otherwise.push(unless);
        }
        if !is_new && !otherwise.contains(&no()) {
            there.extend(otherwise);
            found.push(Case {
                variables: Vec::new(),
                conditions: there,
                value: Expression::Attribute(path),
            });
        }
        Some(found)
    }
}

/// What two paths call the ends of what they are of, if the attribute can be the same one.
fn ends_of_same<'n>(
    one: &'n AttributePath,
    other: &'n AttributePath,
) -> Option<Vec<(&'n Name, &'n Name)>> {
    use AttributePath::{Edge, Node};
    match (one, other) {
        (
            Node {
                variable,
                attribute,
            },
            Node {
                variable: node,
                attribute: of,
            },
        ) if attribute == of => Some(vec![(variable, node)]),
        (
            Edge {
                from,
                label,
                to,
                attribute,
            },
            Edge {
                from: start,
                label: word,
                to: end,
                attribute: of,
            },
        ) if attribute == of && label == word => Some(vec![(from, start), (to, end)]),
        _ => None,
    }
}

/// The formula, for some nodes if there are variables.
fn exists(variables: Vec<PatternNode>, body: Condition) -> Condition {
    if variables.is_empty() || body == no() {
        return body;
    }
    Condition::Exists {
        variables,
        body: Box::new(body),
    }
}
