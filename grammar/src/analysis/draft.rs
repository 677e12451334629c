//! A graph in the making: nodes, links and values that rules ask for.
//!
//! Guarantee: a draft never has a link that something asked not to be there.

use super::values::{Asked, Key, Term, Unknown, Values, values};
use crate::{AttributePath, Comparison, Effect, PatternNode, Types};
use dsr::{EdgeRef, Schema, Transaction};
use std::collections::BTreeSet;
use std::rc::Rc;

/// So many effects are looked at, each as often as it may happen.
const EFFECTS: usize = 500;

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
    /// What values must meet.
    asked: Rc<Vec<Asked>>,
    pub(super) values: Rc<Values>,
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

    /// With values that meet all that is asked, if any were found; and what it cost, in comparisons looked at.
    pub(super) fn with_values(mut self, schema: Option<&Schema>) -> (Option<Self>, u64) {
        if self.asked.is_empty() {
            return (Some(self), 0);
        }
        let links = &self.links;
        let nowhere = |key: &Key| matches!(&key.0, Owner::Link(link) if !links.contains(link));
        let (found, tried) = values(&self.asked, schema, &nowhere);
        let cost = (tried + 1) * self.asked.len() as u64;
        let with = found.map(|found| {
            self.values = Rc::new(found);
            self
        });
        (with, cost)
    }

    /// Asks that what effects assign has a value: a rule cannot be applied where one has none.
    pub(super) fn with_effects(
        mut self,
        effects: &[Effect],
        places: &Places,
        types: &Types,
    ) -> Self {
        let mut open: Vec<(&Effect, Places)> = Vec::new();
        open.extend(effects.iter().map(|effect| (effect, places.clone())));
        let mut left = EFFECTS;
        while let (Some((effect, places)), Some(rest)) = (open.pop(), left.checked_sub(1)) {
            left = rest;
            match effect {
                Effect::Assign { value, .. } => {
                    let (operator, holds) = (Comparison::Equal, true);
                    let both = [value, value].map(|side| Term::of(side, &places));
                    if let [Some(one), Some(other)] = both {
                        let sides = [one, other];
                        self = self
                            .clone()
                            .with_asked(operator, sides, holds)
                            .unwrap_or(self);
                    }
                }
                Effect::Forall { variables, body } => {
                    for places in self.choices(variables, &places, types) {
                        open.extend(body.iter().map(|effect| (effect, places.clone())));
                    }
                }
                Effect::When { body, .. } => {
                    open.extend(body.iter().map(|effect| (effect, places.clone())));
                }
                _ => {}
            }
        }
        self
    }

    /// Nodes that there are for quantified variables.
    fn choices(&self, variables: &[PatternNode], places: &Places, types: &Types) -> Vec<Places> {
        let mut all = vec![places.clone()];
        for variable in variables {
            let name: Rc<str> = Rc::from(&*variable.variable);
            let fits = |exact: &str| types.is_subtype(exact, &variable.type_name);
            let nodes = || self.nodes.iter().enumerate();
            let fitting = || nodes().filter(|(_, (_, exact))| fits(exact));
            let with = |places: &Places, node| {
                let mut places = places.clone();
                places.insert(&name, node);
                places
            };
            let next = all
                .iter()
                .flat_map(|p| fitting().map(|(node, _)| with(p, node)));
            all = next.take(EFFECTS).collect();
        }
        all
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

    /// Gives a node a narrower type.
    pub(super) fn narrow(&mut self, node: usize, type_name: &str) {
        Rc::make_mut(&mut self.nodes)[node].1 = Rc::from(type_name);
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

    /// Asks that a comparison comes out one way or the other, unless it is known that it cannot.
    pub(super) fn with_asked(
        mut self,
        operator: Comparison,
        sides: [Term; 2],
        holds: bool,
    ) -> Option<Self> {
        let asked = Asked {
            operator,
            sides,
            holds,
        };
        if let Some(met) = asked.is_met(&|_| Err(Unknown)) {
            return met.then_some(self);
        }
        if holds {
            for key in asked.keys() {
                if let Owner::Link(link) = &key.0
                    && !self.add_link(link.clone(), true)
                {
                    return None;
                }
            }
        }
        if !self.asked.contains(&asked) {
            Rc::make_mut(&mut self.asked).push(asked);
        }
        Some(self)
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
