//! What a commit has touched so far. It guarantees that each node or edge is there once, in order, with
//! what became of it in all.

use crate::{AttributeId, EdgeChange, EdgeKey, NodeChange, NodeId, RuleApplication, Touch, TypeId};
use smallvec::SmallVec;
use std::collections::{BTreeMap, btree_map};

/// What a commit did, for whoever asks before the next one.
#[derive(Debug, Default)]
pub(in crate::graph) struct Effects {
    pub(super) nodes: Touched<NodeId, TypeId>,
    pub(super) edges: Touched<EdgeKey, ()>,
    pub(in crate::graph) rules: Vec<RuleApplication>,
}

impl Effects {
    pub(super) fn clear(&mut self) {
        self.nodes.clear();
        self.edges.clear();
        self.rules.clear();
    }

    pub(in crate::graph) fn nodes(&self) -> Vec<NodeChange> {
        let change = |(&node, (type_id, touch, attributes)): (&_, &What<_>)| NodeChange {
            node,
            type_id: *type_id,
            touch: *touch,
            attributes: attributes.to_vec(),
        };
        self.nodes.iter().map(change).collect()
    }

    pub(in crate::graph) fn edges(&self) -> Vec<EdgeChange> {
        let change = |(&edge, ((), touch, attributes)): (&_, &What<_>)| EdgeChange {
            edge,
            touch: *touch,
            attributes: attributes.to_vec(),
        };
        self.edges.iter().map(change).collect()
    }
}

/// What became of one: what else is to be known of it, how, and which attributes.
type What<V> = (V, Touch, SmallVec<[AttributeId; 4]>);

/// Everything that was touched.
#[derive(Debug)]
pub(super) struct Touched<K, V> {
    /// The only one: most commits touch no other.
    one: Option<(K, What<V>)>,
    /// All, where there are several.
    several: BTreeMap<K, What<V>>,
}

impl<K, V> Default for Touched<K, V> {
    fn default() -> Self {
        Self {
            one: None,
            several: BTreeMap::new(),
        }
    }
}

impl<K: Ord, V> Touched<K, V> {
    /// Notes that something was touched.
    pub(super) fn touch(&mut self, key: K, value: V, how: Touch, what: Option<AttributeId>) {
        let new = |value| (value, how, what.into_iter().collect());
        match &mut self.one {
            Some((one, known)) if *one == key => return add(known, value, how, what),
            None if self.several.is_empty() => {
                self.one = Some((key, new(value)));
                return;
            }
            _ => self.several.extend(self.one.take()),
        }
        match self.several.entry(key) {
            btree_map::Entry::Vacant(entry) => drop(entry.insert(new(value))),
            btree_map::Entry::Occupied(mut entry) => add(entry.get_mut(), value, how, what),
        }
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (&K, &What<V>)> {
        let one = self.one.iter().map(|(key, what)| (key, what));
        one.chain(&self.several)
    }

    fn clear(&mut self) {
        self.one = None;
        self.several.clear();
    }
}

fn add<V>(known: &mut What<V>, value: V, how: Touch, what: Option<AttributeId>) {
    let (known, before, attributes) = known;
    *known = value;
    // Made and changed is made; gone and made again is another.
    *before = match (*before, how) {
        (Touch::Created, Touch::Updated | Touch::Replaced) => Touch::Created,
        (Touch::Deleted, Touch::Created) | (Touch::Replaced, Touch::Updated) => Touch::Replaced,
        (_, later) => later,
    };
    if let Some(what) = what
        && !attributes.contains(&what)
    {
        attributes.push(what);
    }
}
