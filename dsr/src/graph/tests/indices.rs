//! The indices of a snapshot against what a walk over its nodes and edges counts.

use crate::{
    AttributeId, AttributeType, EdgeKey, Graph, LabelId, NodeId, ReadError, Schema, Snapshot, Time,
    Transaction, TypeId, ValueRange,
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
        assert!(snapshot.has_edge(key)? && snapshot.has_edge_into(key)?);
        let targets = from
            .typed_targets_of(label)
            .collect::<Result<Vec<_>, _>>()?;
        assert!(targets.contains(&(key.to, to.type_id())));
        let sources = to.typed_sources_of(label).collect::<Result<Vec<_>, _>>()?;
        assert!(sources.contains(&(key.from, from.type_id())));
        let pieces =
            in_pieces(|next, visit| snapshot.edges_from(key.from)?.visit(label, next, visit))?;
        assert_eq!(pieces.concat(), targets);
        let pieces =
            in_pieces(|next, visit| snapshot.edges_into(key.to)?.visit(label, next, visit))?;
        assert_eq!(pieces.concat(), sources);
    }
    let one_by_one = snapshot.typed_edges_of_label(label);
    let (mut edges, mut visited) = (snapshot.typed_edges_of_label(label), Vec::new());
    while edges.visit_some(|key, types| visited.push((key, types)))? {}
    assert_eq!(visited, one_by_one.collect::<Result<Vec<_>, _>>()?);
    Ok(())
}

type Visit<'v> = &'v mut dyn FnMut(NodeId, TypeId);

/// All that is visited, by visit.
fn in_pieces(
    visit: impl Fn(NodeId, Visit<'_>) -> Result<Option<NodeId>, ReadError>,
) -> Result<Vec<Vec<(NodeId, TypeId)>>, ReadError> {
    let (mut all, mut next) = (Vec::new(), Some(NodeId(0)));
    while let Some(from) = next {
        let mut piece = Vec::new();
        next = visit(from, &mut |id, exact| piece.push((id, exact)))?;
        all.push(piece);
    }
    Ok(all)
}

#[test]
fn the_edges_of_a_hub_are_visited_in_pieces() {
    let mut graph = Graph::in_memory(Schema::open());
    let mut world = Transaction::new();
    world.create_node("hub", "hub", vec![]);
    for index in 0..500 {
        let name = format!("n{index}");
        world.create_node("leaf", &name, vec![]);
        for label in ["before", "on", "then"] {
            if label == "on" || index % 7 == 0 {
                world.create_edge("hub", label, name.as_str());
            }
        }
    }
    graph.commit(&world, "test", Time::default()).unwrap();
    let snapshot = graph.snapshot();
    let hub = snapshot.find_node_by_name("hub").unwrap().unwrap().id();
    for (label, count) in [("before", 72), ("on", 500), ("then", 72)] {
        let label = snapshot.schema().find_label(label).unwrap();
        types_at_ends(&snapshot, label).unwrap();
        let pieces = in_pieces(|from, visit| snapshot.edges_from(hub)?.visit(label, from, visit));
        let pieces = pieces.unwrap();
        assert_eq!(pieces.concat().len(), count);
        assert!(pieces.iter().all(|piece| piece.len() <= 32), "{pieces:?}");
    }
    let on = snapshot.schema().find_label("on").unwrap();
    let nobody = snapshot.edges_from(NodeId(9999)).unwrap();
    nobody.fetch();
    let visited = in_pieces(|from, visit| nobody.visit(on, from, visit));
    assert_eq!(visited.unwrap(), [[]]);
    assert!(!nobody.has(on, hub).unwrap());
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
