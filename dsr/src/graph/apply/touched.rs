//! What a commit has touched so far. It guarantees that each node or edge is there once, in order, with
//! what became of it in all.

use crate::{AttributeId, Touch};
use std::collections::{BTreeMap, btree_map};

/// What became of one: what else is to be known of it, how, and which attributes.
type What<V> = (V, Touch, Vec<AttributeId>);

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

    pub(super) fn into_iter(self) -> impl Iterator<Item = (K, What<V>)> {
        self.one.into_iter().chain(self.several)
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
