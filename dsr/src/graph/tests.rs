//! The graph against a naive model of it: whatever transactions come, every version that can still
//! be read says what the model said at that version, and a refused transaction changes nothing.

mod cells;
mod cut;
mod full;
mod indices;
mod retype;

use super::*;
use crate::{EdgeKey, EdgeRef, Owner, ReadError, Value};
use indices::{indices, triples, valued, with_indices};
use proptest::prelude::*;
use std::collections::BTreeMap;

type Attributes = BTreeMap<String, Value>;

#[derive(Debug, Clone, Default, PartialEq)]
struct Model {
    nodes: BTreeMap<String, (String, Attributes)>,
    edges: BTreeMap<(String, String, String), Attributes>,
}

impl Model {
    /// Applies one operation, or tells that it must be refused.
    fn apply(&mut self, operation: &Operation) -> Result<(), ()> {
        let name = |node: &crate::NodeRef| match node {
            crate::NodeRef::Name(name) => name.clone(),
            crate::NodeRef::Id(_) => String::new(),
        };
        let key = |edge: &EdgeRef| (name(&edge.from), edge.label.clone(), name(&edge.to));
        match operation {
            Operation::CreateNode {
                type_name,
                name,
                attributes,
                ..
            } => {
                if self.nodes.contains_key(name) {
                    return Err(());
                }
                let attributes = attributes.iter().cloned().collect();
                self.nodes
                    .insert(name.clone(), (type_name.clone(), attributes));
            }
            Operation::DeleteNode { node } => {
                let node = name(node);
                self.nodes.remove(&node).ok_or(())?;
                self.edges
                    .retain(|(from, _, to), _| *from != node && *to != node);
            }
            Operation::RetypeNode { node, type_name } => {
                self.nodes
                    .get_mut(&name(node))
                    .ok_or(())?
                    .0
                    .clone_from(type_name);
            }
            Operation::CreateEdge { edge, attributes } => {
                let key = key(edge);
                if !self.nodes.contains_key(&key.0) || !self.nodes.contains_key(&key.2) {
                    return Err(());
                }
                self.edges
                    .entry(key)
                    .or_default()
                    .extend(attributes.iter().cloned());
            }
            Operation::DeleteEdge { edge } => {
                self.edges.remove(&key(edge)).ok_or(())?;
            }
            Operation::SetAttribute {
                owner,
                name: attribute,
                value,
            } => {
                self.attributes(owner, name, key)?
                    .insert(attribute.clone(), value.clone());
            }
            Operation::RemoveAttribute {
                owner,
                name: attribute,
            } => {
                self.attributes(owner, name, key)?.remove(attribute);
            }
            Operation::ApplyRule { .. } => return Err(()),
        }
        Ok(())
    }

    fn attributes(
        &mut self,
        owner: &Owner,
        name: impl Fn(&crate::NodeRef) -> String,
        key: impl Fn(&EdgeRef) -> (String, String, String),
    ) -> Result<&mut Attributes, ()> {
        match owner {
            Owner::Node(node) => self.nodes.get_mut(&name(node)).map(|n| &mut n.1).ok_or(()),
            Owner::Edge(edge) => self.edges.get_mut(&key(edge)).ok_or(()),
        }
    }

    /// What a snapshot says, through every way of reading it.
    #[allow(
        clippy::panic_in_result_fn,
        reason = "a wrong answer fails the test, an outlived version does not"
    )]
    fn of(snapshot: &Snapshot) -> Result<Self, ReadError> {
        let schema = snapshot.schema();
        let named = |attributes: Vec<crate::Attribute>| -> Attributes {
            let named = |a: crate::Attribute| (schema.attribute_name(a.name).to_owned(), a.value);
            attributes.into_iter().map(named).collect()
        };
        cells::agree(snapshot)?;
        let mut model = Self::default();
        let mut by_label: Vec<EdgeKey> = Vec::new();
        for label in (0..schema.labels().len() as u16).map(crate::LabelId) {
            let edges = snapshot
                .edges_of_label(label)
                .collect::<Result<Vec<_>, _>>()?;
            assert_eq!(edges.len() as u64, snapshot.count_of_label(label)?);
            by_label.extend(edges);
        }
        let (mut outgoing, mut incoming) = (Vec::new(), Vec::new());
        for node in snapshot.nodes() {
            let node = node?;
            let name = node.name()?;
            assert_eq!(
                snapshot.find_node_by_name(&name)?.map(|n| n.id()),
                Some(node.id())
            );
            outgoing.extend(node.out_edges().collect::<Result<Vec<_>, _>>()?);
            incoming.extend(node.in_edges().collect::<Result<Vec<_>, _>>()?);
            for attribute in node.attributes()? {
                assert_eq!(node.attribute(attribute.name)?.as_ref(), Some(&attribute));
            }
            let (kind, attributes) = (node.type_name().to_owned(), named(node.attributes()?));
            assert!(model.nodes.insert(name, (kind, attributes)).is_none());
        }
        let by_type: u64 = (0..schema.types().len() as u16)
            .map(|t| snapshot.nodes_of_type(crate::TypeId(t)).count() as u64)
            .sum();
        assert_eq!(by_type, snapshot.node_count());
        assert_eq!(model.nodes.len() as u64, snapshot.node_count());
        for edges in [&mut by_label, &mut outgoing, &mut incoming] {
            edges.sort();
        }
        assert_eq!(by_label, outgoing);
        assert_eq!(outgoing, incoming);
        assert_eq!(outgoing.len() as u64, snapshot.edge_count());
        assert_eq!(
            indices(snapshot)?,
            (valued(snapshot)?, triples(snapshot, &outgoing)?)
        );
        for key in outgoing {
            let name = |id| {
                snapshot
                    .find_node(id)?
                    .ok_or(ReadError::Damaged { address: 0 })?
                    .name()
            };
            let edge = snapshot
                .find_edge(key)?
                .ok_or(ReadError::Damaged { address: 0 })?;
            let label = schema.label_name(key.label).to_owned();
            let key = (name(key.from)?, label, name(key.to)?);
            model.edges.insert(key, named(edge.attributes()?));
        }
        Ok(model)
    }
}

pub(crate) fn value() -> impl Strategy<Value = Value> {
    prop_oneof![
        any::<bool>().prop_map(Value::Bool),
        any::<i32>().prop_map(Value::I32),
        any::<u32>().prop_map(Value::U32),
        any::<i64>().prop_map(Value::I64),
        any::<u64>().prop_map(Value::U64),
        (-1e9f32..1e9).prop_map(Value::F32),
        (-1e9..1e9).prop_map(Value::F64),
        ".{0,40}".prop_map(Value::String),
        prop::collection::vec(-1e3..1e3, 1..6).prop_map(Value::Vector),
        prop::collection::vec(-1e3f32..1e3, 1..6).prop_map(Value::F32Vector),
        prop::collection::vec(-1e3..1e3, 0..50).prop_map(Value::F64List),
        prop::collection::vec(-1e3f32..1e3, 0..50).prop_map(Value::F32List),
        prop::collection::vec(any::<u8>(), 0..50).prop_map(Value::U8List),
        prop::collection::vec(any::<u64>(), 0..50).prop_map(Value::U64List),
        (-10.0..10.0, -10.0..10.0, -3.0..3.0).prop_map(|(x, y, a)| nalgebra::Isometry2::new(
            [x, y].into(),
            a
        )
        .into()),
        crate::large::tests::handle().prop_map(Value::Large),
    ]
}

pub(crate) fn operation() -> impl Strategy<Value = Operation> {
    let node = || (0..60u32).prop_map(|i| format!("n{i}"));
    let kind = || (0..4u32).prop_map(|i| format!("t{i}"));
    let attribute = || (0..6u32).prop_map(|i| format!("a{i}"));
    let attributes = move || prop::collection::vec((attribute(), value()), 0..3);
    let edge = move || {
        (node(), 0..3u32, node()).prop_map(|(f, l, t)| EdgeRef::new(f, &format!("l{l}"), t))
    };
    let owner = move || {
        prop_oneof![
            node().prop_map(|n| Owner::Node(n.into())),
            edge().prop_map(Owner::Edge),
        ]
    };
    prop_oneof![
        6 => (kind(), node(), attributes()).prop_map(|(type_name, name, attributes)| {
            Operation::CreateNode { id: None, type_name, name, attributes }
        }),
        1 => node().prop_map(|n| Operation::DeleteNode { node: n.into() }),
        1 => (node(), kind())
            .prop_map(|(n, type_name)| Operation::RetypeNode { node: n.into(), type_name }),
        8 => (edge(), attributes())
            .prop_map(|(edge, attributes)| Operation::CreateEdge { edge, attributes }),
        2 => edge().prop_map(|edge| Operation::DeleteEdge { edge }),
        6 => (owner(), attribute(), value())
            .prop_map(|(owner, name, value)| Operation::SetAttribute { owner, name, value }),
        1 => (owner(), attribute())
            .prop_map(|(owner, name)| Operation::RemoveAttribute { owner, name }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    #[test]
    fn every_readable_version_is_what_the_model_was(
        transactions in prop::collection::vec(prop::collection::vec(operation(), 1..5), 1..200),
        history_bytes in prop_oneof![Just(0), Just(20_000), Just(64 << 20)],
    ) {
        let mut graph = Graph::in_memory(with_indices());
        graph.set_limits(Limits { history_bytes, ..Limits::default() });
        let mut model = Model::default();
        let mut past = vec![(graph.snapshot(), model.clone())];
        for operations in transactions {
            // Mostly operations that can succeed, so that the graph grows.
            let mut next = model.clone();
            let mut kept = Vec::new();
            let mut refused = false;
            for operation in operations {
                let mut trial = next.clone();
                if trial.apply(&operation).is_ok() {
                    next = trial;
                    kept.push(operation);
                } else if !refused && kept.len() > 2 {
                    refused = true;
                    kept.push(operation);
                }
            }
            let transaction = Transaction { operations: kept, ..Transaction::new() };
            let outcome = graph.commit(&transaction, "tester", Time::default());
            prop_assert_eq!(outcome.is_err(), refused, "{:?}", outcome);
            if !refused {
                model = next;
            }
            prop_assert_eq!(&Model::of(&graph.snapshot()).unwrap(), &model);
            past.push((graph.snapshot(), model.clone()));
        }
        let image = Image::of(&graph.snapshot()).unwrap();
        let mut restored = Graph::in_memory(Schema::open());
        restored.restore(&image).unwrap();
        prop_assert_eq!(&Image::of(&restored.snapshot()).unwrap(), &image);
        let mut readable = 0;
        for (snapshot, model) in past {
            match Model::of(&snapshot) {
                Ok(found) => {
                    prop_assert_eq!(found, model);
                    readable += 1;
                }
                Err(ReadError::SnapshotTooOld { .. }) => {}
                Err(other) => prop_assert!(false, "{}", other),
            }
        }
        prop_assert!(readable > 0, "the newest version can always be read");
    }
}

fn setting(name: &str, value: i64) -> Transaction {
    let mut transaction = Transaction::new();
    transaction.set("n", name, value);
    transaction
}

fn one_node() -> Graph {
    let mut graph = Graph::in_memory(Schema::open());
    let mut transaction = Transaction::new();
    transaction.create_node("thing", "n", vec![("x".into(), 0i64.into())]);
    graph.commit(&transaction, "a", Time::default()).unwrap();
    graph
}

#[test]
fn memory_stays_bounded_however_often_an_attribute_is_written() {
    let mut graph = one_node();
    graph.set_limits(Limits {
        history_bytes: 100_000,
        ..Limits::default()
    });
    for i in 0..20_000 {
        graph
            .commit(&setting("x", i), "a", Time::default())
            .unwrap();
    }
    let bytes = graph.bytes_in_use();
    assert!(bytes < 200_000, "{bytes} bytes");
    let snapshot = graph.snapshot();
    let node = snapshot.find_node_by_name("n").unwrap().unwrap();
    assert_eq!(node.value("x").unwrap(), Some(Value::I64(19_999)));
}

#[test]
fn a_snapshot_that_was_outlived_says_so_and_gives_nothing() {
    let mut graph = one_node();
    graph.set_limits(Limits {
        history_bytes: 0,
        ..Limits::default()
    });
    let old = graph.snapshot();
    for i in 0..10 {
        graph
            .commit(&setting("x", i), "a", Time::default())
            .unwrap();
    }
    let error = old.find_node_by_name("n").unwrap_err();
    assert!(matches!(error, ReadError::SnapshotTooOld { .. }), "{error}");
}

#[test]
fn two_agents_that_write_different_attributes_of_a_node_both_keep_what_they_wrote() {
    let mut graph = one_node();
    graph
        .commit(&setting("x", 1), "a", Time::default())
        .unwrap();
    graph
        .commit(&setting("y", 2), "b", Time::default())
        .unwrap();
    let snapshot = graph.snapshot();
    let node = snapshot.find_node_by_name("n").unwrap().unwrap();
    let written: Vec<_> = node
        .attributes()
        .unwrap()
        .into_iter()
        .map(|a| (a.value, snapshot.writer_name(a.writer).unwrap()))
        .collect();
    assert_eq!(
        written,
        [
            (Value::I64(1), "a".to_owned()),
            (Value::I64(2), "b".to_owned())
        ]
    );
}

#[test]
fn a_precondition_that_fails_is_a_conflict() {
    let mut graph = one_node();
    let seen = graph.snapshot().version();
    graph
        .commit(&setting("x", 1), "a", Time::default())
        .unwrap();
    let node = || crate::NodeRef::from("n");
    let stale = crate::Precondition::NodeUnchangedSince {
        node: node(),
        version: seen,
    };
    let owner = Owner::Node(node());
    let value = Some(Value::I64(0));
    let other = crate::Precondition::AttributeEquals {
        owner,
        name: "x".into(),
        value,
    };
    for precondition in [stale, other] {
        let transaction = setting("x", 2).require(precondition);
        let refusal = graph
            .commit(&transaction, "b", Time::default())
            .unwrap_err();
        assert!(matches!(refusal, Refusal::Conflict(_)), "{refusal}");
    }
}

#[test]
fn a_hub_of_ten_thousand_edges_comes_and_goes() {
    let mut graph = Graph::in_memory(Schema::open());
    let mut transaction = Transaction::new();
    transaction.create_node("t", "hub", vec![]);
    for i in 0..10_000 {
        transaction.create_node("t", &format!("n{i}"), vec![]);
        transaction.create_edge("hub", "l", format!("n{i}"));
    }
    graph.commit(&transaction, "a", Time::default()).unwrap();
    let label = graph.snapshot().schema().label_id("l").unwrap();
    assert_eq!(graph.snapshot().edges_of_label(label).count(), 10_000);
    let full = graph.bytes_in_use();
    let mut transaction = Transaction::new();
    transaction.delete_node("hub");
    graph.commit(&transaction, "a", Time::default()).unwrap();
    assert_eq!(graph.snapshot().edges_of_label(label).count(), 0);
    graph.set_limits(Limits {
        history_bytes: 0,
        ..Limits::default()
    });
    graph
        .commit(&Transaction::new(), "a", Time::default())
        .unwrap();
    assert!(
        graph.bytes_in_use() < full,
        "the memory of deleted edges is free again"
    );
}

#[test]
fn what_the_schema_does_not_have_is_refused_whole_and_told_with_the_right_name() {
    let schema = Schema::from_toml(
        "test",
        "[types]\nroom = []\nrobot = []\n\
         [labels]\nin = { from = [\"robot\"], to = [\"room\"] }\n\
         [attributes]\narea = { kind = \"f64\", min = 0.0 }\n",
    );
    let mut graph = Graph::in_memory(schema.unwrap());
    let mut good = Transaction::new();
    good.create_node("room", "kitchen", vec![("area".into(), 12.0.into())]);
    good.create_node("robot", "shelly", vec![]);
    graph.commit(&good, "a", Time::default()).unwrap();
    let before = Image::of(&graph.snapshot()).unwrap();
    let mut refused = |operation: &dyn Fn(&mut Transaction), told: &str| {
        // What comes first is good, and must not stay.
        let mut transaction = Transaction::new();
        transaction.create_edge("shelly", "in", "kitchen");
        operation(&mut transaction);
        let refusal = graph
            .commit(&transaction, "a", Time::default())
            .unwrap_err();
        assert_eq!(refusal.to_string(), told);
        assert_eq!(Image::of(&graph.snapshot()).unwrap(), before, "{told}");
    };
    refused(
        &|t| t.create_node("rom", "hall", vec![]),
        "against the schema: unknown node type `rom`, did you mean `room`?",
    );
    refused(
        &|t| t.create_edge("kitchen", "in", "shelly"),
        "against the schema: `in` does not join room to robot",
    );
    refused(
        &|t| t.set("kitchen", "are", 1.0),
        "against the schema: unknown attribute `are`, did you mean `area`?",
    );
    refused(
        &|t| t.set("kitchen", "area", "large"),
        "against the schema: `area` is a f64, not a string",
    );
    refused(
        &|t| t.set("kitchen", "area", -1.0),
        "against the schema: `area` must lie in [0, inf], not -1",
    );
    refused(&|t| t.delete_node("hall"), "there is no `hall`");
}

#[test]
fn a_snapshot_is_the_newest_until_the_next_commit() {
    let mut graph = Graph::in_memory(Schema::open());
    graph.announce();
    let snapshot = graph.snapshot();
    assert!(snapshot.is_newest());
    let node = Transaction::new();
    graph.commit(&node, "a", Time::default()).unwrap();
    assert!(!snapshot.is_newest());
    assert!(graph.snapshot().is_newest());
}
