//! Numbers for the names that a grammar and a goal use. This file guarantees that a type stands for
//! the same exact types as in the grammar's own matching: by the graph's schema, by the grammar's
//! types block, or by both in turn.

use dsr::Schema;
use fixedbitset::FixedBitSet;
use grammar::Types;
use rustc_hash::FxHashMap;
use std::collections::BTreeSet;

/// Names, each with a number.
#[derive(Debug, Clone, Default)]
pub(crate) struct Names {
    list: Vec<String>,
    index: FxHashMap<String, u16>,
}

impl Names {
    /// The number of a name, which is new if the name is.
    pub(crate) fn intern(&mut self, name: &str) -> u16 {
        if let Some(&known) = self.index.get(name) {
            return known;
        }
        let new = self.list.len() as u16;
        self.list.push(name.to_owned());
        self.index.insert(name.to_owned(), new);
        new
    }

    pub(crate) fn find(&self, name: &str) -> Option<u16> {
        self.index.get(name).copied()
    }

    pub(crate) fn name(&self, number: u16) -> &str {
        &self.list[usize::from(number)]
    }

    pub(crate) fn len(&self) -> usize {
        self.list.len()
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = (u16, &str)> {
        (0..).zip(self.list.iter().map(String::as_str))
    }
}

/// Exact types, by number.
pub(crate) type TypeSet = FixedBitSet;

/// The names that matter to a grammar and a goal.
#[derive(Debug, Clone, Default)]
pub(crate) struct Vocabulary {
    pub(crate) labels: Names,
    pub(crate) types: Names,
    pub(crate) attributes: Names,
}

impl Vocabulary {
    /// The exact types that `type_name` stands for. Every name must be interned before.
    pub(crate) fn type_set(&self, types: &Types, schema: &Schema, type_name: &str) -> TypeSet {
        let mut set = TypeSet::with_capacity(self.types.len());
        let mut seen: BTreeSet<&str> = BTreeSet::from([type_name]);
        let mut open = vec![type_name];
        while let Some(name) = open.pop() {
            if let Some(number) = self.types.find(name) {
                set.insert(usize::from(number));
            }
            let by_schema = schema.find_type(name).map(|id| schema.subtypes(id));
            for &id in by_schema.unwrap_or_default() {
                let sub = schema.type_name(id);
                if seen.insert(sub) {
                    open.push(sub);
                }
            }
            for declaration in &types.declarations {
                if declaration.parents.iter().any(|parent| *parent == *name) {
                    for sub in &declaration.names {
                        if seen.insert(sub) {
                            open.push(sub);
                        }
                    }
                }
            }
        }
        set
    }
}
