//! Types by number, with what inherits from them.
//!
//! Guarantee: it agrees with [`Types::is_subtype`](crate::Types::is_subtype), at the cost of a few words.

use crate::{Condition, Effect, Grammar, Rule};
use std::collections::BTreeMap;

/// A type's number.
pub(super) type Kind = usize;

/// The types that a grammar declares, inherits from or uses.
pub(super) struct Kinds<'g> {
    numbers: BTreeMap<&'g str, Kind>,
    names: Vec<&'g str>,
    /// By type, which inherit from it, itself included: a bit each.
    below: Vec<Vec<u64>>,
}

impl<'g> Kinds<'g> {
    /// Those of the grammar, declared ones first in the order written, and `used` ones.
    pub(super) fn new(grammar: &'g Grammar, used: impl Iterator<Item = &'g str>) -> Self {
        let mut numbers = BTreeMap::new();
        let mut names = Vec::new();
        let declarations = &grammar.types.declarations;
        let declared = declarations.iter().flat_map(|d| &d.names);
        let parents = declarations.iter().flat_map(|d| &d.parents);
        let written = declared.chain(parents).map(crate::Name::as_str);
        for name in written.chain(used) {
            numbers.entry(name).or_insert_with(|| {
                names.push(name);
                names.len() - 1
            });
        }
        let mut parents = vec![Vec::new(); names.len()];
        for declaration in declarations {
            for name in &declaration.names {
                let above = declaration.parents.iter().map(|parent| numbers[&**parent]);
                parents[numbers[&**name]].extend(above);
            }
        }
        let mut below = vec![vec![0_u64; names.len().div_ceil(64)]; names.len()];
        for kind in 0..names.len() {
            let mut reached = vec![kind];
            while let Some(next) = reached.pop() {
                let bit = 1 << (kind % 64);
                if below[next][kind / 64] & bit == 0 {
                    below[next][kind / 64] |= bit;
                    reached.extend(&parents[next]);
                }
            }
        }
        Self {
            numbers,
            names,
            below,
        }
    }

    /// What comparing two types costs.
    pub(super) fn words(&self) -> u64 {
        self.names.len().div_ceil(64).max(1) as u64
    }

    pub(super) fn find(&self, name: &str) -> Option<Kind> {
        self.numbers.get(name).copied()
    }

    pub(super) fn name(&self, kind: Kind) -> &'g str {
        self.names[kind]
    }

    pub(super) fn is_subtype(&self, sub: Kind, ancestor: Kind) -> bool {
        self.below[ancestor][sub / 64] & (1 << (sub % 64)) != 0
    }

    /// A type that is both: one of the two where that is, else the first declared.
    pub(super) fn common(&self, one: Kind, other: Kind) -> Option<Kind> {
        if self.is_subtype(one, other) {
            return Some(one);
        }
        if self.is_subtype(other, one) {
            return Some(other);
        }
        let words = self.below[one].iter().zip(&self.below[other]);
        let mut both = words.map(|(a, b)| a & b).enumerate();
        both.find(|(_, word)| *word != 0)
            .map(|(index, word)| 64 * index + word.trailing_zeros() as usize)
    }
}

/// The types that a rule names.
pub(super) fn types_of(rule: &Rule) -> impl Iterator<Item = &str> {
    let nodes = rule
        .bound_nodes()
        .chain(&rule.parameters)
        .chain(&rule.right.nodes);
    let mut names: Vec<&str> = nodes.map(|node| &*node.type_name).collect();
    let mut conditions: Vec<&Condition> = rule.precondition.iter().collect();
    let mut effects: Vec<&Effect> = rule.effect.iter().collect();
    while let Some(effect) = effects.pop() {
        match effect {
            Effect::Create { type_name, .. } | Effect::Retype { type_name, .. } => {
                names.push(type_name);
            }
            Effect::Forall { variables, body } => {
                names.extend(variables.iter().map(|node| &*node.type_name));
                effects.extend(body);
            }
            Effect::When { condition, body } => {
                conditions.push(condition);
                effects.extend(body);
            }
            _ => {}
        }
    }
    while let Some(condition) = conditions.pop() {
        match condition {
            Condition::Not(inner) => conditions.push(inner),
            Condition::And(all) | Condition::Or(all) => conditions.extend(all),
            Condition::Exists { variables, body } | Condition::Forall { variables, body } => {
                names.extend(variables.iter().map(|node| &*node.type_name));
                conditions.push(body);
            }
            Condition::When {
                condition,
                consequence,
            } => conditions.extend([&**condition, &**consequence]),
            Condition::Edge { .. } | Condition::Same(..) | Condition::Compare { .. } => {}
        }
    }
    names.into_iter()
}
