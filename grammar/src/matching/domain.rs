//! Which nodes a typed variable may stand for.
//!
//! Guarantee: a type matches itself and whatever inherits from it by the graph's schema, by the
//! grammar's types block, or by both in turn.

use crate::Types;
use dsr::{Schema, TypeId};
use std::collections::BTreeSet;
use std::sync::Arc;

/// The exact types that a variable's type stands for, in a schema.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Domain {
    /// Ascending.
    types: Arc<[TypeId]>,
    /// Those of them below 64, one bit each.
    low: u64,
}

impl Domain {
    pub(crate) fn new(types: &Types, schema: &Schema, type_name: &str) -> Self {
        if types.is_empty() {
            let by_schema = schema.find_type(type_name);
            return Self::of(by_schema.map_or(&[], |id| schema.subtypes(id)));
        }
        let mut names: BTreeSet<&str> = BTreeSet::from([type_name]);
        let mut members: BTreeSet<TypeId> = BTreeSet::new();
        let mut open = vec![type_name];
        while let Some(name) = open.pop() {
            let by_schema = schema
                .find_type(name)
                .map(|id| schema.subtypes(id))
                .unwrap_or_default();
            for &id in by_schema {
                members.insert(id);
                let name = schema.type_name(id);
                if names.insert(name) {
                    open.push(name);
                }
            }
            for declaration in &types.declarations {
                if declaration.parents.iter().any(|parent| parent == name) {
                    for sub in &declaration.names {
                        if names.insert(sub) {
                            open.push(sub);
                        }
                    }
                }
            }
        }
        Self::of(&members.into_iter().collect::<Vec<_>>())
    }

    /// The domain of these types, ascending.
    fn of(types: &[TypeId]) -> Self {
        let low = types.iter().filter(|id| id.0 < 64);
        Self {
            low: low.fold(0, |bits, id| bits | 1 << id.0),
            types: types.into(),
        }
    }

    /// The types that belong to both.
    pub(crate) fn and(&self, other: &Self) -> Self {
        let both = self.types.iter().filter(|&&id| other.contains(id));
        Self::of(&both.copied().collect::<Vec<_>>())
    }

    /// Whether a node of this exact type belongs to it.
    pub(crate) fn contains(&self, exact: TypeId) -> bool {
        if exact.0 < 64 {
            self.low >> exact.0 & 1 == 1
        } else {
            self.types.binary_search(&exact).is_ok()
        }
    }

    /// Whether a node can belong to both.
    pub(crate) fn meets(&self, other: &Self) -> bool {
        self.low & other.low != 0 || self.types.iter().any(|&id| other.contains(id))
    }

    /// The exact types, ascending.
    pub(crate) fn types(&self) -> &Arc<[TypeId]> {
        &self.types
    }
}
