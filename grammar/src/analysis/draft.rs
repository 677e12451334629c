//! A graph in the making: nodes, links and values that rules ask for.
//!
//! Guarantee: a draft never has a link that something asked not to be there.

use crate::{AttributePath, Effect, Expression};
use dsr::{EdgeRef, Transaction, Value};
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

/// Names are shared: drafts are copied far more often than they are changed.
pub(super) type Link = (usize, Rc<str>, usize);

/// Variables and the nodes of the draft that they stand for, inner ones last.
#[derive(Debug, Clone, Default)]
pub(super) struct Places(Vec<(Rc<str>, usize)>);

impl Places {
    pub(super) fn get(&self, variable: &str) -> Option<usize> {
        let mut known = self.0.iter().rev();
        let found = known.find(|(name, _)| **name == *variable);
        found.map(|(_, node)| *node)
    }

    pub(super) fn insert(&mut self, variable: &Rc<str>, node: usize) {
        self.0.push((Rc::clone(variable), node));
    }

    /// The nodes, in the order in which they were put in.
    pub(super) fn nodes(&self) -> impl Iterator<Item = usize> {
        self.0.iter().map(|(_, node)| *node)
    }
}

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Owner {
    Node(usize),
    Link(Link),
}

/// What of it is the same in many drafts is there once.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Draft {
    /// Names and types.
    pub(super) nodes: Rc<Vec<(Rc<str>, Rc<str>)>>,
    pub(super) links: Rc<BTreeSet<Link>>,
    pub(super) absent: Rc<BTreeSet<Link>>,
    pub(super) values: Rc<BTreeMap<(Owner, Rc<str>), Value>>,
}

impl Draft {
    /// What makes this graph.
    pub(super) fn transaction(&self) -> Transaction {
        let name = |index: usize| &*self.nodes[index].0;
        let mut transaction = Transaction::new();
        for (name, type_name) in self.nodes.iter() {
            transaction.create_node(type_name, name, Vec::new());
        }
        for (from, label, to) in self.links.iter() {
            transaction.create_edge(name(*from), label, name(*to));
        }
        for ((owner, attribute), value) in self.values.iter() {
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
        let name = |index: usize| &*self.nodes[index].0;
        let mut words: Vec<String> = self
            .nodes
            .iter()
            .map(|(name, type_name)| format!("{name}:{type_name}"))
            .collect();
        for (from, label, to) in self.links.iter() {
            words.push(format!("{}->{}({label})", name(*from), name(*to)));
        }
        for ((owner, attribute), value) in self.values.iter() {
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

    /// The values alone, in words.
    pub(super) fn value_words(&self) -> String {
        if self.values.is_empty() {
            return String::new();
        }
        self.words()
    }

    /// With a number for each attribute of the match that the effects reckon with and nothing else asks for: a rule
    /// cannot be applied where one is missing.
    pub(super) fn with_numbers_for(mut self, effects: &[Effect], places: &Places) -> Self {
        let mut expressions: Vec<&Expression> = Vec::new();
        let mut effects: Vec<&Effect> = effects.iter().collect();
        while let Some(effect) = effects.pop() {
            match effect {
                Effect::Assign { value, .. } => expressions.push(value),
                Effect::Forall { body, .. } | Effect::When { body, .. } => effects.extend(body),
                _ => {}
            }
        }
        while let Some(expression) = expressions.pop() {
            match expression {
                Expression::Literal(_) => {}
                Expression::Arithmetic { operands, .. } => expressions.extend(operands),
                Expression::Attribute(path) => {
                    if let Some(owner) = owner(path, places)
                        && !self.values.contains_key(&owner)
                    {
                        let with = self.clone().with_value(owner, Value::I64(1));
                        self = with.into_iter().next().unwrap_or(self);
                    }
                }
            }
        }
        self
    }

    /// A name that no node has yet.
    pub(super) fn fresh(&self, name: &str) -> String {
        let mut fresh = name.to_owned();
        while self.nodes.iter().any(|(known, _)| **known == *fresh) {
            fresh.push_str("_2");
        }
        fresh
    }

    /// One more node, and its index.
    pub(super) fn add_node(&mut self, name: &str, type_name: &str) -> usize {
        let node = (Rc::from(name), Rc::from(type_name));
        Rc::make_mut(&mut self.nodes).push(node);
        self.nodes.len() - 1
    }

    /// Draws a link, or that it is not there; whether that goes with what is drawn.
    pub(super) fn add_link(&mut self, link: Link, there: bool) -> bool {
        let (wanted, other) = if there {
            (&mut self.links, &self.absent)
        } else {
            (&mut self.absent, &self.links)
        };
        let goes = !other.contains(&link);
        if goes && !wanted.contains(&link) {
            Rc::make_mut(wanted).insert(link);
        }
        goes
    }

    pub(super) fn with_link(mut self, link: Link, there: bool) -> Vec<Self> {
        let goes = self.add_link(link, there);
        Vec::from_iter(goes.then_some(self))
    }

    pub(super) fn with_value(mut self, owner: (Owner, Rc<str>), value: Value) -> Vec<Self> {
        match self.values.get(&owner) {
            Some(known) if *known != value => return Vec::new(),
            _ => {}
        }
        if let Owner::Link(link) = &owner.0
            && !self.add_link(link.clone(), true)
        {
            return Vec::new();
        }
        Rc::make_mut(&mut self.values).insert(owner, value);
        vec![self]
    }
}

/// What an attribute belongs to, and its name.
pub(super) fn owner(path: &AttributePath, places: &Places) -> Option<(Owner, Rc<str>)> {
    Some(match path {
        AttributePath::Node {
            variable,
            attribute,
        } => (Owner::Node(places.get(variable)?), Rc::from(&**attribute)),
        AttributePath::Edge {
            from,
            label,
            to,
            attribute,
        } => {
            let link = (places.get(from)?, Rc::from(&**label), places.get(to)?);
            (Owner::Link(link), Rc::from(&**attribute))
        }
    })
}
