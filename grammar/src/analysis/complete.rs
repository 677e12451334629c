//! A graph in the making: nodes, links and values that rules ask for.
//!
//! Guarantee: a draft never has a link that something asked not to be there.

use crate::{AttributePath, Comparison, Condition, Expression, Literal, Types};
use dsr::{EdgeRef, Transaction, Value};
use std::collections::{BTreeMap, BTreeSet};

/// How many ways to meet a condition are followed.
const WAYS: usize = 8;

pub(super) type Link = (usize, String, usize);
/// Variables and the nodes of the draft that they stand for.
pub(super) type Places = BTreeMap<String, usize>;

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Owner {
    Node(usize),
    Link(Link),
}

#[derive(Debug, Clone, Default)]
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

/// Ways to make a condition come out as `holds`. What a `forall` asks is left to be seen.
pub(super) fn ways(
    types: &Types,
    draft: Draft,
    places: &Places,
    condition: &Condition,
    holds: bool,
) -> Vec<Draft> {
    let mut found = match (condition, holds) {
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
            true,
        ) => compared(draft, places, *operator, left, right),
        (Condition::Not(inner), _) => ways(types, draft, places, inner, !holds),
        (Condition::And(all), true) | (Condition::Or(all), false) => {
            let mut drafts = vec![draft];
            for condition in all {
                drafts = drafts
                    .into_iter()
                    .flat_map(|draft| ways(types, draft, places, condition, holds))
                    .take(WAYS)
                    .collect();
            }
            drafts
        }
        (Condition::Or(any), true) | (Condition::And(any), false) => any
            .iter()
            .flat_map(|condition| ways(types, draft.clone(), places, condition, holds))
            .collect(),
        (
            Condition::When {
                condition,
                consequence,
            },
            true,
        ) => {
            let mut without = ways(types, draft.clone(), places, condition, false);
            without.extend(ways(types, draft, places, consequence, true));
            without
        }
        (
            Condition::When {
                condition,
                consequence,
            },
            false,
        ) => ways(types, draft, places, condition, true)
            .into_iter()
            .flat_map(|draft| ways(types, draft, places, consequence, false))
            .collect(),
        (Condition::Exists { variables, body }, true)
        | (Condition::Forall { variables, body }, false) => {
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
                        if types.is_subtype(exact, &variable.type_name) {
                            next.push((draft.clone(), choose(index)));
                        }
                    }
                    let mut more = draft.clone();
                    let name = more.fresh(&variable.variable);
                    more.nodes.push((name, variable.type_name.to_string()));
                    let place = choose(more.nodes.len() - 1);
                    next.push((more, place));
                }
                next.truncate(WAYS * WAYS);
                drafts = next;
            }
            let meet = |(draft, places): (Draft, Places)| ways(types, draft, &places, body, holds);
            drafts.into_iter().flat_map(meet).collect()
        }
        // A missing attribute will do; what a quantifier forbids is left to be seen.
        (Condition::Compare { .. } | Condition::Exists { .. }, false)
        | (Condition::Forall { .. }, true) => vec![draft],
    };
    found.sort_by_key(|draft| (draft.nodes.len(), draft.links.len()));
    found.truncate(WAYS);
    found
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
        Expression::Literal(literal) => Some(match literal {
            Literal::Integer(n) => (*n).into(),
            Literal::Real(x) => (*x).into(),
            Literal::Text(text) => text.as_str().into(),
            Literal::Boolean(b) => (*b).into(),
        }),
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
