//! A graph in the making: nodes, links and values that rules ask for.
//!
//! Guarantee: a draft never has a link that something asked not to be there.

use crate::{AttributePath, Comparison, Condition, Expression, PatternNode, Types};
use dsr::{EdgeRef, Transaction, Value};
use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};

/// How many ways to meet a condition are followed.
const WAYS: usize = 16;
/// How many formulas are looked at for one graph, each as often as there are ways to come to it.
const FORMULAS: usize = 1_000;

pub(super) type Link = (usize, String, usize);
/// Variables and the nodes of the draft that they stand for.
pub(super) type Places = BTreeMap<String, usize>;

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Owner {
    Node(usize),
    Link(Link),
}

#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Draft {
    /// Names and types.
    pub(super) nodes: Vec<(String, String)>,
    pub(super) links: BTreeSet<Link>,
    pub(super) absent: BTreeSet<Link>,
    values: BTreeMap<(Owner, String), Value>,
}

impl Draft {
    /// What makes this graph.
    pub(super) fn transaction(&self) -> Transaction {
        let name = |index: usize| self.nodes[index].0.as_str();
        let mut transaction = Transaction::new();
        for (name, type_name) in &self.nodes {
            transaction.create_node(type_name, name, Vec::new());
        }
        for (from, label, to) in &self.links {
            transaction.create_edge(name(*from), label, name(*to));
        }
        for ((owner, attribute), value) in &self.values {
            match owner {
                Owner::Node(node) => transaction.set(name(*node), attribute, value.clone()),
                Owner::Link((from, label, to)) => {
                    let edge = EdgeRef::new(name(*from), label, name(*to));
                    transaction.set_on_edge(edge, attribute, value.clone());
                }
            }
        }
        transaction
    }

    /// As patterns are written.
    pub(super) fn words(&self) -> String {
        let name = |index: usize| self.nodes[index].0.as_str();
        let mut words: Vec<String> = self
            .nodes
            .iter()
            .map(|(name, type_name)| format!("{name}:{type_name}"))
            .collect();
        for (from, label, to) in &self.links {
            words.push(format!("{}->{}({label})", name(*from), name(*to)));
        }
        for ((owner, attribute), value) in &self.values {
            let owner = match owner {
                Owner::Node(node) => name(*node).to_owned(),
                Owner::Link((from, label, to)) => {
                    format!("e({}, {label}, {})", name(*from), name(*to))
                }
            };
            words.push(format!(
                "{owner}.{attribute}={}",
                crate::matching::words(value)
            ));
        }
        words.join(" ")
    }

    /// A name that no node has yet.
    pub(super) fn fresh(&self, name: &str) -> String {
        let mut fresh = name.to_owned();
        while self.nodes.iter().any(|(known, _)| *known == fresh) {
            fresh.push_str("_2");
        }
        fresh
    }

    fn with_link(mut self, link: Link, there: bool) -> Vec<Self> {
        let (wanted, other) = if there {
            (&mut self.links, &self.absent)
        } else {
            (&mut self.absent, &self.links)
        };
        if other.contains(&link) {
            return Vec::new();
        }
        wanted.insert(link);
        vec![self]
    }

    fn with_value(mut self, owner: (Owner, String), value: Value) -> Vec<Self> {
        match self.values.get(&owner) {
            Some(known) if *known != value => return Vec::new(),
            _ => {}
        }
        if let Owner::Link(link) = &owner.0 {
            if self.absent.contains(link) {
                return Vec::new();
            }
            self.links.insert(link.clone());
        }
        self.values.insert(owner, value);
        vec![self]
    }
}

/// Finds ways to make conditions come out one way or the other, and so that little would change it.
pub(super) struct Ways<'t> {
    types: &'t Types,
    /// So many formulas are still looked at.
    left: Cell<usize>,
}

impl<'t> Ways<'t> {
    pub(super) fn new(types: &'t Types) -> Self {
        Self {
            types,
            left: Cell::new(FORMULAS),
        }
    }

    /// How many formulas were looked at until now.
    pub(super) fn looked_at(&self) -> u64 {
        (FORMULAS - self.left.get()) as u64
    }

    /// Ways to make a condition come out as `holds`, the smallest first.
    pub(super) fn to(
        &self,
        draft: Draft,
        places: &Places,
        condition: &Condition,
        holds: bool,
    ) -> Vec<Draft> {
        let Some(left) = self.left.get().checked_sub(1) else {
            return vec![draft];
        };
        self.left.set(left);
        let mut found = self.all(draft, places, condition, holds);
        found.sort_by_key(|draft| (draft.nodes.len(), draft.links.len()));
        found.dedup();
        found.truncate(WAYS);
        found
    }

    fn all(&self, draft: Draft, places: &Places, condition: &Condition, holds: bool) -> Vec<Draft> {
        match (condition, holds) {
            (Condition::Edge { label, from, to }, _) => {
                let (Some(&from), Some(&to)) = (places.get(&**from), places.get(&**to)) else {
                    return vec![draft];
                };
                draft.with_link((from, label.to_string(), to), holds)
            }
            (Condition::Same(a, b), _) => {
                let same = places.get(&**a) == places.get(&**b);
                if same == holds {
                    vec![draft]
                } else {
                    Vec::new()
                }
            }
            (
                Condition::Compare {
                    operator,
                    left,
                    right,
                },
                _,
            ) => {
                if holds {
                    return compared(draft, places, *operator, left, right);
                }
                // A missing attribute will do, too.
                let mut found = vec![draft.clone()];
                found.extend(compared(draft, places, operator.negated(), left, right));
                found
            }
            (Condition::Not(inner), _) => self.to(draft, places, inner, !holds),
            (Condition::And(all), true) | (Condition::Or(all), false) => {
                let all = all.iter().map(|condition| (condition, holds));
                self.every(draft, places, all)
            }
            (Condition::Or(any), true) | (Condition::And(any), false) => {
                let mut found = Vec::new();
                for one in any {
                    found.extend(self.to(draft.clone(), places, one, holds));
                    // As the only one: so that without it the whole comes out the other way.
                    let only = any.iter().map(|c| (c, (c == one) == holds));
                    found.extend(self.every(draft.clone(), places, only));
                }
                found
            }
            (
                Condition::When {
                    condition,
                    consequence,
                },
                true,
            ) => {
                let (condition, consequence) = (&**condition, &**consequence);
                let mut found = self.to(draft.clone(), places, condition, false);
                found.extend(self.to(draft.clone(), places, consequence, true));
                for both in [true, false] {
                    let both = [(condition, both), (consequence, both)];
                    found.extend(self.every(draft.clone(), places, both.into_iter()));
                }
                found
            }
            (
                Condition::When {
                    condition,
                    consequence,
                },
                false,
            ) => {
                let broken = [(&**condition, true), (&**consequence, false)];
                self.every(draft, places, broken.into_iter())
            }
            (Condition::Exists { variables, body }, true)
            | (Condition::Forall { variables, body }, false) => {
                self.by_some(draft, places, (variables, body), holds)
            }
            (Condition::Exists { variables, body }, false)
            | (Condition::Forall { variables, body }, true) => {
                self.by_each(draft, places, (variables, body), holds)
            }
        }
    }

    /// A formula holds for some nodes; and for these alone, so that without them it comes out the other way.
    fn by_some(
        &self,
        draft: Draft,
        places: &Places,
        (variables, body): (&[PatternNode], &Condition),
        holds: bool,
    ) -> Vec<Draft> {
        let mut found = Vec::new();
        for (draft, chosen) in self.chosen(draft, places, variables, true) {
            for draft in self.to(draft, &chosen, body, holds) {
                found.push(draft.clone());
                let mut only = vec![draft.clone()];
                for (_, other) in self.chosen(draft, places, variables, false) {
                    if other != chosen {
                        let more = only.into_iter();
                        let more = more.flat_map(|d| self.to(d, &other, body, !holds));
                        only = more.take(WAYS).collect();
                    }
                }
                found.extend(only);
            }
        }
        found
    }

    /// A formula holds for all nodes: as it is, by all that are there, and so that it hinges on some of them.
    fn by_each(
        &self,
        draft: Draft,
        places: &Places,
        (variables, body): (&[PatternNode], &Condition),
        holds: bool,
    ) -> Vec<Draft> {
        let mut found = vec![draft.clone()];
        let mut by_all = vec![draft.clone()];
        for (_, places) in self.chosen(draft.clone(), places, variables, false) {
            let more = by_all.into_iter();
            let more = more.flat_map(|draft| self.to(draft, &places, body, holds));
            by_all = more.take(WAYS).collect();
        }
        found.extend(by_all);
        for (draft, places) in self.chosen(draft, places, variables, true) {
            found.extend(self.to(draft, &places, body, holds));
        }
        found
    }

    fn every<'c>(
        &self,
        draft: Draft,
        places: &Places,
        all: impl Iterator<Item = (&'c Condition, bool)>,
    ) -> Vec<Draft> {
        let mut drafts = vec![draft];
        for (condition, holds) in all {
            drafts = drafts
                .into_iter()
                .flat_map(|draft| self.to(draft, places, condition, holds))
                .take(WAYS)
                .collect();
        }
        drafts
    }

    /// The draft with nodes for quantified variables: those that are there and, if `more`, new ones.
    fn chosen(
        &self,
        draft: Draft,
        places: &Places,
        variables: &[PatternNode],
        more: bool,
    ) -> Vec<(Draft, Places)> {
        let mut drafts = vec![(draft, places.clone())];
        for variable in variables {
            let mut next = Vec::new();
            for (draft, places) in drafts {
                let choose = |node: usize| {
                    let mut places = places.clone();
                    places.insert(variable.variable.to_string(), node);
                    places
                };
                for (index, (_, exact)) in draft.nodes.iter().enumerate() {
                    if self.types.is_subtype(exact, &variable.type_name) {
                        next.push((draft.clone(), choose(index)));
                    }
                }
                if more {
                    let mut wider = draft.clone();
                    let name = wider.fresh(&variable.variable);
                    wider.nodes.push((name, variable.type_name.to_string()));
                    let place = choose(wider.nodes.len() - 1);
                    next.push((wider, place));
                }
            }
            next.truncate(WAYS * WAYS);
            drafts = next;
        }
        drafts
    }
}

fn owner(path: &AttributePath, places: &Places) -> Option<(Owner, String)> {
    Some(match path {
        AttributePath::Node {
            variable,
            attribute,
        } => (
            Owner::Node(*places.get(&**variable)?),
            attribute.to_string(),
        ),
        AttributePath::Edge {
            from,
            label,
            to,
            attribute,
        } => {
            let link = (
                *places.get(&**from)?,
                label.to_string(),
                *places.get(&**to)?,
            );
            (Owner::Link(link), attribute.to_string())
        }
    })
}

/// Values that meet a comparison of attributes with each other or with a constant.
fn compared(
    draft: Draft,
    places: &Places,
    operator: Comparison,
    left: &Expression,
    right: &Expression,
) -> Vec<Draft> {
    let value = |expression: &Expression| match expression {
        Expression::Attribute(path) => {
            owner(path, places).and_then(|owner| draft.values.get(&owner).cloned())
        }
        Expression::Literal(literal) => Some(literal.value()),
        Expression::Arithmetic { .. } => None,
    };
    let known = (value(left), value(right));
    let tries = |other: &Value| -> Vec<Value> {
        match other.as_f64() {
            Some(x) => vec![other.clone(), (x - 1.0).into(), (x + 1.0).into()],
            None => vec![other.clone(), "other".into()],
        }
    };
    let (path, tried): (&AttributePath, Vec<Value>) = match (left, right, &known) {
        (_, _, (Some(a), Some(b))) => {
            return if operator.holds(a, b) {
                vec![draft]
            } else {
                Vec::new()
            };
        }
        (Expression::Attribute(path), _, (None, Some(b))) => {
            let fits = |a: &Value| operator.holds(a, b);
            (path, tries(b).into_iter().filter(fits).collect())
        }
        (_, Expression::Attribute(path), (Some(a), None)) => {
            let fits = |b: &Value| operator.holds(a, b);
            (path, tries(a).into_iter().filter(fits).collect())
        }
        (Expression::Attribute(first), Expression::Attribute(_), (None, None)) => {
            let Some(first) = owner(first, places) else {
                return vec![draft];
            };
            return draft
                .with_value(first, Value::I64(1))
                .into_iter()
                .flat_map(|draft| compared(draft, places, operator, left, right))
                .collect();
        }
        // What arithmetic comes to is left to be seen.
        _ => return vec![draft],
    };
    let Some(owner) = owner(path, places) else {
        return vec![draft];
    };
    tried
        .into_iter()
        .flat_map(|value| draft.clone().with_value(owner.clone(), value))
        .collect()
}
