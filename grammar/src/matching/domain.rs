//! Which nodes a typed variable may stand for.
//!
//! Guarantee: a type matches itself and whatever inherits from it by the graph's schema, by the
//! grammar's types block, or by both in turn.

use crate::Types;
use dsr::{NodeId, ReadError, Schema, Snapshot, TypeId};
use std::collections::BTreeSet;

/// The exact types that a variable's type stands for, in a schema.
#[derive(Debug, Clone)]
pub(crate) struct Domain {
    /// Ascending.
    types: Vec<TypeId>,
    /// Types of which the others are subtypes in the schema.
    roots: Vec<TypeId>,
}

impl Domain {
    pub(crate) fn new(types: &Types, schema: &Schema, type_name: &str) -> Self {
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
        Self::of(members.into_iter().collect(), schema)
    }

    /// The domain of these types, ascending, of which every subtype is among them.
    fn of(types: Vec<TypeId>, schema: &Schema) -> Self {
        // Of types that inherit from each other (a circle), the first stands for all.
        let covered = |&id: &TypeId| {
            types.iter().any(|&other| {
                other != id
                    && schema.is_subtype(id, other)
                    && !(schema.is_subtype(other, id) && id < other)
            })
        };
        let roots = types.iter().copied().filter(|id| !covered(id)).collect();
        Self { types, roots }
    }

    /// The types that belong to both.
    pub(crate) fn and(&self, other: &Self, schema: &Schema) -> Self {
        Self::of(
            self.types
                .iter()
                .copied()
                .filter(|&id| other.contains(id))
                .collect(),
            schema,
        )
    }

    /// Whether a node of this exact type belongs to it.
    pub(crate) fn contains(&self, exact: TypeId) -> bool {
        self.types.binary_search(&exact).is_ok()
    }

    /// The exact types, ascending.
    pub(crate) fn types(&self) -> &[TypeId] {
        &self.types
    }

    /// How many nodes belong to it; where a type has several roots above it, more.
    pub(crate) fn count(&self, snapshot: &Snapshot) -> Result<u64, ReadError> {
        self.roots
            .iter()
            .try_fold(0, |sum, &root| Ok(sum + snapshot.count_of_type(root)?))
    }

    /// Every node that belongs to it, each once.
    pub(crate) fn nodes<'a>(
        &self,
        snapshot: &'a Snapshot,
    ) -> impl Iterator<Item = Result<NodeId, ReadError>> + use<'a> {
        let roots = self.roots.clone();
        (0..roots.len()).flat_map(move |index| {
            let earlier = roots[..index].to_vec();
            let schema = snapshot.schema();
            snapshot
                .nodes_of_type(roots[index])
                .filter_map(move |node| match node {
                    Ok(node) => {
                        let seen = earlier
                            .iter()
                            .any(|&e| schema.is_subtype(node.type_id(), e));
                        (!seen).then(|| Ok(node.id()))
                    }
                    Err(error) => Some(Err(error)),
                })
        })
    }
}
