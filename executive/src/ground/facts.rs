//! What holds, indexed for joining: links by label and end, types by object, values by place. This
//! file guarantees that the indices agree, and that what comes out of them depends only on the
//! order in which it went in.

use super::program::{Link, Object, Place};
use super::vocabulary::TypeSet;
use dsr::Value;
use rustc_hash::FxHashMap;
use std::collections::hash_map::Entry::Vacant;

/// Links, types and values.
#[derive(Debug, Clone, Default)]
pub(crate) struct Facts {
    /// Where each link is in `pairs`.
    links: FxHashMap<Link, u32>,
    out: FxHashMap<(u16, Object), Vec<Object>>,
    into: FxHashMap<(u16, Object), Vec<Object>>,
    pairs: Vec<Vec<(Object, Object)>>,
    /// Exact types of each object: one, or none, unless several states are looked at as one.
    types: Vec<Vec<u16>>,
    of_type: Vec<Vec<Object>>,
    values: FxHashMap<Place, Vec<Option<Value>>>,
}

impl Facts {
    pub(crate) fn new(labels: usize, types: usize, objects: usize) -> Self {
        Self {
            pairs: vec![Vec::new(); labels],
            types: vec![Vec::new(); objects],
            of_type: vec![Vec::new(); types],
            ..Self::default()
        }
    }

    /// Forgets links and types, but no value and no object.
    pub(crate) fn forget_structure(&mut self) {
        let values = std::mem::take(&mut self.values);
        let counts = (self.pairs.len(), self.of_type.len(), self.types.len());
        *self = Self::new(counts.0, counts.1, counts.2);
        self.values = values;
    }

    /// Makes room for one more object, which does not exist yet.
    pub(crate) fn add_object(&mut self) -> Object {
        self.types.push(Vec::new());
        self.types.len() as Object - 1
    }

    /// How many objects there may be, those that do not exist counted in.
    pub(crate) fn objects(&self) -> usize {
        self.types.len()
    }

    pub(crate) fn has_link(&self, link: Link) -> bool {
        self.links.contains_key(&link)
    }

    pub(crate) fn add_link(&mut self, link: Link) -> bool {
        let Vacant(entry) = self.links.entry(link) else {
            return false;
        };
        let Link { label, from, to } = link;
        let pairs = &mut self.pairs[usize::from(label)];
        entry.insert(pairs.len() as u32);
        pairs.push((from, to));
        self.out.entry((label, from)).or_default().push(to);
        self.into.entry((label, to)).or_default().push(from);
        true
    }

    pub(crate) fn remove_link(&mut self, link: Link) {
        let Some(place) = self.links.remove(&link) else {
            return;
        };
        let Link { label, from, to } = link;
        let pairs = &mut self.pairs[usize::from(label)];
        pairs.swap_remove(place as usize);
        if let Some(&(from, to)) = pairs.get(place as usize) {
            self.links.insert(Link { label, from, to }, place);
        }
        if let Some(targets) = self.out.get_mut(&(label, from)) {
            targets.retain(|&other| other != to);
        }
        if let Some(sources) = self.into.get_mut(&(label, to)) {
            sources.retain(|&other| other != from);
        }
    }

    /// Where links of a label lead from an object.
    pub(crate) fn targets(&self, label: u16, from: Object) -> &[Object] {
        self.out.get(&(label, from)).map_or(&[], Vec::as_slice)
    }

    /// Where links of a label to an object come from.
    pub(crate) fn sources(&self, label: u16, to: Object) -> &[Object] {
        self.into.get(&(label, to)).map_or(&[], Vec::as_slice)
    }

    /// All links of a label.
    pub(crate) fn pairs(&self, label: u16) -> &[(Object, Object)] {
        &self.pairs[usize::from(label)]
    }

    /// Every link at an object.
    pub(crate) fn links_at(&self, object: Object) -> Vec<Link> {
        let mut links = Vec::new();
        for label in 0..self.pairs.len() as u16 {
            let out = self.targets(label, object).iter().map(|&to| Link {
                label,
                from: object,
                to,
            });
            links.extend(out);
            let others = self.sources(label, object).iter();
            links.extend(others.filter(|&&from| from != object).map(|&from| Link {
                label,
                from,
                to: object,
            }));
        }
        links
    }

    /// The exact types that an object may have; none where it does not exist.
    pub(crate) fn types(&self, object: Object) -> &[u16] {
        &self.types[object as usize]
    }

    pub(crate) fn add_type(&mut self, object: Object, exact: u16) -> bool {
        let types = &mut self.types[object as usize];
        let new = !types.contains(&exact);
        if new {
            types.push(exact);
            self.of_type[usize::from(exact)].push(object);
        }
        new
    }

    /// Makes an object not be of an exact type, but leaves its links.
    pub(crate) fn remove_type(&mut self, object: Object, exact: u16) {
        self.types[object as usize].retain(|&other| other != exact);
        self.of_type[usize::from(exact)].retain(|&other| other != object);
    }

    /// Whether an object may be of one of `types`.
    pub(crate) fn is_of(&self, object: Object, types: &TypeSet) -> bool {
        self.types(object)
            .iter()
            .any(|&exact| types.contains(usize::from(exact)))
    }

    /// The objects that may be of one of `types`, each once.
    pub(crate) fn objects_of<'a>(
        &'a self,
        types: &'a TypeSet,
    ) -> impl Iterator<Item = Object> + use<'a> {
        types
            .ones()
            .filter(|&exact| exact < self.of_type.len())
            .flat_map(move |exact| {
                self.of_type[exact].iter().copied().filter(move |&object| {
                    let first = self
                        .types(object)
                        .iter()
                        .map(|&t| usize::from(t))
                        .filter(|&t| types.contains(t));
                    first.min() == Some(exact)
                })
            })
    }

    /// The values that a place may have; `None` in the list is no value.
    pub(crate) fn values(&self, place: Place) -> &[Option<Value>] {
        const MISSING: &[Option<Value>] = &[None];
        self.values.get(&place).map_or(MISSING, Vec::as_slice)
    }

    /// The value of a place that has one value only.
    pub(crate) fn value(&self, place: Place) -> Option<&Value> {
        self.values(place).first().and_then(Option::as_ref)
    }

    /// Makes a value the only one of its place.
    pub(crate) fn set_value(&mut self, place: Place, value: Option<Value>) {
        self.values.insert(place, vec![value]);
    }

    /// Adds a value to those that a place may have.
    pub(crate) fn add_value(&mut self, place: Place, value: Option<Value>) -> bool {
        let values = self.values.entry(place).or_insert_with(|| vec![None]);
        let new = !values.contains(&value);
        if new {
            values.push(value);
        }
        new
    }
}
