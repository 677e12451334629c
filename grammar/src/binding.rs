//! Which node each variable of a rule stands for.
//!
//! Guarantee: a binding has each variable at most once and keeps the order in which they came.

use crate::Name;
use dsr::{NodeId, NodeRef};
use std::fmt;

/// Variables and the nodes they stand for, in order.
///
/// Bindings found by matching are in the order of [`crate::Rule::bound_nodes`].
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Binding(Vec<(Name, NodeId)>);

impl Binding {
    /// A binding of nothing.
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    /// A binding of variables of which no two are the same.
    pub(crate) fn of_distinct(pairs: impl Iterator<Item = (Name, NodeId)>) -> Self {
        Self(pairs.collect())
    }

    /// The node of this variable.
    pub fn get(&self, variable: &str) -> Option<NodeId> {
        self.0
            .iter()
            .find(|(name, _)| *name == *variable)
            .map(|&(_, node)| node)
    }

    /// Binds a variable, anew if it is bound already.
    pub fn insert(&mut self, variable: impl Into<Name>, node: NodeId) {
        let variable = variable.into();
        match self.0.iter_mut().find(|(name, _)| *name == variable) {
            Some((_, bound)) => *bound = node,
            None => self.0.push((variable, node)),
        }
    }

    /// All variables with their nodes, in order.
    pub fn iter(&self) -> impl Iterator<Item = (&Name, NodeId)> {
        self.0.iter().map(|(name, node)| (name, *node))
    }

    /// How many variables are bound.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether no variable is bound.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// As [`dsr::Transaction::apply_rule`] takes it.
    pub fn to_refs(&self) -> Vec<(String, NodeRef)> {
        self.iter()
            .map(|(name, node)| (name.to_string(), node.into()))
            .collect()
    }
}

impl<N: Into<Name>> FromIterator<(N, NodeId)> for Binding {
    fn from_iter<I: IntoIterator<Item = (N, NodeId)>>(pairs: I) -> Self {
        let mut binding = Self::new();
        for (variable, node) in pairs {
            binding.insert(variable, node);
        }
        binding
    }
}

impl fmt::Display for Binding {
    /// `robot = 3, room1 = 7`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, (variable, node)) in self.iter().enumerate() {
            let comma = if index == 0 { "" } else { ", " };
            write!(f, "{comma}{variable} = {node}")?;
        }
        Ok(())
    }
}
