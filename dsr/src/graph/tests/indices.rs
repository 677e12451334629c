//! The indices of a snapshot against what a walk over its nodes and edges counts.

use crate::{
    AttributeId, AttributeType, EdgeKey, LabelId, NodeId, ReadError, Schema, Snapshot, TypeId,
    ValueRange,
};
use std::collections::BTreeMap;

pub(super) type Triples = BTreeMap<(LabelId, TypeId, TypeId), u64>;
pub(super) type Valued = BTreeMap<(AttributeId, NodeId), u64>;

/// What the indices say of values, and the counts of triples.
#[allow(clippy::panic_in_result_fn, reason = "a wrong answer fails the test")]
pub(super) fn indices(snapshot: &Snapshot) -> Result<(Valued, Triples), ReadError> {
    let (mut values, mut triples) = (Valued::new(), Triples::new());
    let schema = snapshot.schema();
    for attribute in (0..schema.attributes().len() as u16).map(AttributeId) {
        let mut found = Vec::new();
        for node in snapshot.nodes() {
            let node = node?;
            if let Some(held) = node.attribute(attribute)? {
                let range = ValueRange::Equal(held.value.clone());
                let same = snapshot.ids_by_value(attribute, &range);
                for id in same.collect::<Result<Vec<_>, _>>()? {
                    found.push(id);
                    let value = snapshot.find_node(id)?.map(|n| n.attribute(attribute));
                    let value = value.transpose()?.flatten();
                    let place = value.and_then(|held| held.value.place());
                    assert_eq!(place, held.value.place());
                    values.insert((attribute, id), place.unwrap_or(0));
                }
            }
        }
        let numbers = ValueRange::Between(f64::NEG_INFINITY, f64::INFINITY);
        let numbers = snapshot.ids_by_value(attribute, &numbers);
        for id in numbers.collect::<Result<Vec<_>, _>>()? {
            assert!(found.contains(&id), "{id} is in an index without a value");
        }
    }
    for label in (0..schema.labels().len() as u16).map(LabelId) {
        for triple in snapshot.triple_counts(label) {
            let triple = triple?;
            triples.insert((label, triple.from, triple.to), triple.count);
        }
        types_at_ends(snapshot, label)?;
    }
    Ok((values, triples))
}

/// Looks whether the types that are kept beside a label's edges are those of the nodes.
#[allow(clippy::panic_in_result_fn, reason = "a wrong answer fails the test")]
fn types_at_ends(snapshot: &Snapshot, label: LabelId) -> Result<(), ReadError> {
    let find = |id| {
        let node = snapshot.find_node(id)?;
        node.ok_or(ReadError::Damaged { address: 0 })
    };
    for edge in snapshot.typed_edges_of_label(label) {
        let (key, types) = edge?;
        let (from, to) = (find(key.from)?, find(key.to)?);
        assert_eq!(types, [from.type_id(), to.type_id()]);
        assert!(from.has_target(label, key.to)? && to.has_source(label, key.from)?);
        let targets = from
            .typed_targets_of(label)
            .collect::<Result<Vec<_>, _>>()?;
        assert!(targets.contains(&(key.to, to.type_id())));
        let sources = to.typed_sources_of(label).collect::<Result<Vec<_>, _>>()?;
        assert!(sources.contains(&(key.from, from.type_id())));
    }
    Ok(())
}

/// The same, counted.
pub(super) fn valued(snapshot: &Snapshot) -> Result<Valued, ReadError> {
    let mut values = Valued::new();
    for node in snapshot.nodes() {
        let node = node?;
        for attribute in node.attributes()? {
            if let Some(place) = attribute.value.place()
                && snapshot.schema().has_index(attribute.name)
            {
                values.insert((attribute.name, node.id()), place);
            }
        }
    }
    Ok(values)
}

pub(super) fn triples(snapshot: &Snapshot, edges: &[EdgeKey]) -> Result<Triples, ReadError> {
    let of = |id| {
        let node = snapshot.find_node(id)?;
        Ok::<_, ReadError>(node.ok_or(ReadError::Damaged { address: 0 })?.type_id())
    };
    let mut triples = Triples::new();
    for key in edges {
        *triples
            .entry((key.label, of(key.from)?, of(key.to)?))
            .or_default() += 1;
    }
    Ok(triples)
}

/// An open schema in which two of the attributes have an index.
pub(super) fn with_indices() -> Schema {
    let mut schema = Schema::open();
    for name in ["a0", "a1"] {
        let attribute = AttributeType {
            name: name.to_owned(),
            kind: None,
            unit: None,
            min: None,
            max: None,
            index: true,
            history: 0,
            hot: None,
            large: None,
        };
        schema.add_attribute(attribute).unwrap();
    }
    schema
}
