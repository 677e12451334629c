//! Changes collected from the parts of a rule, and turned into operations.
//!
//! Guarantee: operations come in a fixed order, each can be carried out after those before it,
//! and none is superfluous in the snapshot that they were made for.

use super::ApplyError;
use crate::matching::{CHOICE_LIMIT, Slot, words};
use crate::{Comparison, Name, Number};
use dsr::{
    EdgeKey, EdgeRef, NodeId, NodeRef, Operation, Owner, ReadError, Snapshot, Value, ValueKind,
};
use std::collections::{BTreeMap, BTreeSet};

/// How many changes quantified effects of one application may make.
pub const CHANGE_LIMIT: usize = 100_000;

/// A node that is there, or one that is being created.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum End {
    Node(NodeId),
    New(usize),
}

type LinkKey = (End, String, End);

/// What carries an assigned attribute.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Target {
    Node(End),
    Link(LinkKey),
}

/// What a rule changes at one binding.
#[derive(Debug)]
pub(super) struct Changes<'a> {
    snapshot: &'a Snapshot,
    /// Types of created nodes.
    created: Vec<String>,
    deleted: BTreeSet<End>,
    retyped: BTreeMap<End, String>,
    wanted: BTreeSet<LinkKey>,
    unwanted: BTreeSet<LinkKey>,
    assigned: BTreeMap<(Target, String), Value>,
}

fn end(slot: Slot) -> Option<End> {
    match slot {
        Slot::Unbound => None,
        Slot::Node(id) => Some(End::Node(id)),
        Slot::New(index) => Some(End::New(index)),
    }
}

impl<'a> Changes<'a> {
    pub(super) fn new(snapshot: &'a Snapshot) -> Self {
        Self {
            snapshot,
            created: Vec::new(),
            deleted: BTreeSet::new(),
            retyped: BTreeMap::new(),
            wanted: BTreeSet::new(),
            unwanted: BTreeSet::new(),
            assigned: BTreeMap::new(),
        }
    }

    /// Looks whether there are more changes than one rule may make.
    pub(super) fn limit(&self) -> Result<(), ApplyError> {
        let changes = self.created.len()
            + self.deleted.len()
            + self.retyped.len()
            + self.wanted.len()
            + self.unwanted.len()
            + self.assigned.len();
        if changes > CHANGE_LIMIT {
            return Err(ApplyError::TooMuch {
                changes: CHANGE_LIMIT,
                choices: CHOICE_LIMIT,
            });
        }
        Ok(())
    }

    /// A new node; gives the number that stands for it.
    pub(super) fn create(&mut self, type_name: &str) -> usize {
        self.created.push(type_name.to_owned());
        self.created.len() - 1
    }

    pub(super) fn delete(&mut self, node: Slot) {
        self.deleted.extend(end(node));
    }

    pub(super) fn retype(&mut self, node: Slot, type_name: &str) -> Result<(), ApplyError> {
        let Some(node) = end(node) else { return Ok(()) };
        match self.retyped.insert(node, type_name.to_owned()) {
            Some(before) if before != type_name => Err(ApplyError::Contradiction {
                what: "type of one node".to_owned(),
                first: before,
                second: type_name.to_owned(),
            }),
            _ => Ok(()),
        }
    }

    pub(super) fn link(&mut self, from: Slot, label: &str, to: Slot) {
        if let (Some(from), Some(to)) = (end(from), end(to)) {
            self.wanted.insert((from, label.to_owned(), to));
        }
    }

    pub(super) fn unlink(&mut self, from: Slot, label: &str, to: Slot) {
        if let (Some(from), Some(to)) = (end(from), end(to)) {
            self.unwanted.insert((from, label.to_owned(), to));
        }
    }

    pub(super) fn assign_node(
        &mut self,
        node: Slot,
        attribute: &Name,
        value: Value,
    ) -> Result<(), ApplyError> {
        match end(node) {
            Some(node) => self.assign(Target::Node(node), attribute, value),
            None => Ok(()),
        }
    }

    fn assign(&mut self, target: Target, attribute: &Name, value: Value) -> Result<(), ApplyError> {
        let key = (target, attribute.to_string());
        match self.assigned.get(&key) {
            Some(before) if !Comparison::Equal.holds(before, &value) => {
                Err(ApplyError::Contradiction {
                    what: format!("`{attribute}` of one thing"),
                    first: words(before),
                    second: words(&value),
                })
            }
            _ => {
                self.assigned.insert(key, value);
                Ok(())
            }
        }
    }

    pub(super) fn assign_link(
        &mut self,
        (from, label, to): (Slot, &str, Slot),
        attribute: &Name,
        value: Value,
    ) -> Result<(), ApplyError> {
        match (end(from), end(to)) {
            (Some(from), Some(to)) => {
                self.assign(Target::Link((from, label.to_owned(), to)), attribute, value)
            }
            _ => Ok(()),
        }
    }

    /// Nodes of the graph that are deleted.
    pub(super) fn deleted(&self) -> impl Iterator<Item = NodeId> {
        self.deleted.iter().filter_map(|end| match end {
            End::Node(id) => Some(*id),
            End::New(_) => None,
        })
    }

    /// Whether the rule itself says that the link goes.
    pub(super) fn unlinks(&self, from: End, label: &str, to: End) -> bool {
        self.unwanted.contains(&(from, label.to_owned(), to))
    }

    fn is_there(&self, (from, label, to): &LinkKey) -> Result<bool, ReadError> {
        let label = self.snapshot.schema().find_label(label);
        match (from, label, to) {
            (&End::Node(from), Some(label), &End::Node(to)) => Ok(self
                .snapshot
                .find_edge(EdgeKey { from, label, to })?
                .is_some()),
            _ => Ok(false),
        }
    }

    fn goes(&self, (from, _, to): &LinkKey) -> bool {
        self.deleted.contains(from) || self.deleted.contains(to)
    }

    /// A name for each created node: its type and the first number that nothing is called by.
    fn names(&self) -> Result<Vec<String>, ReadError> {
        let mut names: Vec<String> = Vec::new();
        // Where to go on: names of one type are taken in turn.
        let mut next: BTreeMap<&str, u64> = BTreeMap::new();
        for type_name in &self.created {
            let schema = self.snapshot.schema();
            let of_type = schema
                .find_type(type_name)
                .map(|id| self.snapshot.count_of_type(id));
            let first = of_type.transpose()?.unwrap_or(0) + 1;
            let number = next.entry(type_name).or_insert(first);
            let name = loop {
                let name = format!("{type_name}_{number}");
                *number += 1;
                if self.snapshot.find_node_by_name(&name)?.is_none() {
                    break name;
                }
            };
            names.push(name);
        }
        Ok(names)
    }

    pub(super) fn into_operations(self) -> Result<Vec<Operation>, ReadError> {
        let names = self.names()?;
        let node = |end: &End| match end {
            End::Node(id) => NodeRef::Id(*id),
            End::New(index) => NodeRef::Name(names[*index].clone()),
        };
        let edge = |(from, label, to): &LinkKey| EdgeRef::new(node(from), label, node(to));
        let mut operations = Vec::new();
        for key in self.unwanted.difference(&self.wanted) {
            if !self.goes(key) && self.is_there(key)? {
                operations.push(Operation::DeleteEdge { edge: edge(key) });
            }
        }
        for id in self.deleted() {
            operations.push(Operation::DeleteNode { node: id.into() });
        }
        for (end, type_name) in &self.retyped {
            if let End::Node(id) = end
                && !self.deleted.contains(end)
                && self
                    .snapshot
                    .find_node(*id)?
                    .is_some_and(|n| n.type_name() != type_name)
            {
                let type_name = type_name.clone();
                operations.push(Operation::RetypeNode {
                    node: (*id).into(),
                    type_name,
                });
            }
        }
        for (index, type_name) in self.created.iter().enumerate() {
            if self.deleted.contains(&End::New(index)) {
                continue;
            }
            let retyped = self.retyped.get(&End::New(index));
            operations.push(Operation::CreateNode {
                id: None,
                type_name: retyped.unwrap_or(type_name).clone(),
                name: names[index].clone(),
                attributes: Vec::new(),
            });
        }
        for key in &self.wanted {
            if !self.goes(key) && !self.is_there(key)? {
                let attributes = Vec::new();
                operations.push(Operation::CreateEdge {
                    edge: edge(key),
                    attributes,
                });
            }
        }
        for ((target, name), value) in &self.assigned {
            let owner = match target {
                Target::Node(end) if self.deleted.contains(end) => continue,
                Target::Node(end) => Owner::Node(node(end)),
                Target::Link(key) => {
                    let stays = self.wanted.contains(key)
                        || (!self.unwanted.contains(key) && self.is_there(key)?);
                    if self.goes(key) || !stays {
                        continue;
                    }
                    Owner::Edge(edge(key))
                }
            };
            let value = self.fitted(target, name, value)?;
            operations.push(Operation::SetAttribute {
                owner,
                name: name.clone(),
                value,
            });
        }
        Ok(operations)
    }

    /// A number in the kind that the schema, or the attribute's value so far, asks for, where
    /// that loses nothing; any other value as it is.
    fn fitted(&self, target: &Target, name: &str, value: &Value) -> Result<Value, ReadError> {
        let schema = self.snapshot.schema();
        let Some(attribute) = schema.find_attribute(name) else {
            return Ok(value.clone());
        };
        let declared = schema
            .attributes()
            .get(usize::from(attribute.0))
            .and_then(|a| a.kind);
        let kind = match (declared, target) {
            (Some(kind), _) => Some(kind),
            (None, Target::Node(End::Node(id))) => match self.snapshot.find_node(*id)? {
                Some(node) => node.attribute(attribute)?.map(|found| found.value.kind()),
                None => None,
            },
            (None, Target::Link((End::Node(from), label, End::Node(to)))) => {
                let label = schema.find_label(label);
                let key = label.map(|label| EdgeKey {
                    from: *from,
                    label,
                    to: *to,
                });
                match key
                    .map(|key| self.snapshot.find_edge(key))
                    .transpose()?
                    .flatten()
                {
                    Some(edge) => edge.attribute(attribute)?.map(|found| found.value.kind()),
                    None => None,
                }
            }
            _ => None,
        };
        let converted = kind.and_then(|kind| convert(value, kind));
        Ok(converted.unwrap_or_else(|| value.clone()))
    }
}

/// The number as another kind, if it is the same number there.
pub(crate) fn convert(value: &Value, kind: ValueKind) -> Option<Value> {
    use Number::{Real, Whole};
    let number = Number::of(value)?;
    let whole = match number {
        Whole(n) => Some(n),
        Real(x) if x.fract() == 0.0 && x.abs() < 1e15 => Some(x as i128),
        Real(_) => None,
    };
    let real = number.real();
    let exact = match number {
        Whole(n) => real as i128 == n,
        Real(_) => true,
    };
    match kind {
        ValueKind::I32 => whole.and_then(|n| i32::try_from(n).ok()).map(Value::I32),
        ValueKind::U32 => whole.and_then(|n| u32::try_from(n).ok()).map(Value::U32),
        ValueKind::I64 => whole.and_then(|n| i64::try_from(n).ok()).map(Value::I64),
        ValueKind::U64 => whole.and_then(|n| u64::try_from(n).ok()).map(Value::U64),
        // Single precision is chosen by whoever declares it: the nearest number is what it means.
        ValueKind::F32 => Some(Value::F32(real as f32)),
        ValueKind::F64 => exact.then_some(Value::F64(real)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_take_the_declared_kind_only_where_nothing_is_lost() {
        assert_eq!(
            convert(&Value::I64(3), ValueKind::F64),
            Some(Value::F64(3.0))
        );
        assert_eq!(
            convert(&Value::F64(3.0), ValueKind::U64),
            Some(Value::U64(3))
        );
        assert_eq!(convert(&Value::F64(3.5), ValueKind::I64), None);
        assert_eq!(convert(&Value::I64(-1), ValueKind::U64), None);
        assert_eq!(convert(&Value::U64((1 << 53) + 1), ValueKind::F64), None);
        assert_eq!(convert(&Value::Bool(true), ValueKind::F64), None);
    }
}
