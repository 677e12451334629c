//! How two graphs differ, by names: ids do not count. Guarantees that the transaction made of the
//! differences turns the one into the other.

use crate::json::value_to_json;
use crate::{
    Attribute, EdgeRef, NodeId, NodeRef, Operation, Owner, ReadError, Schema, Snapshot,
    Transaction, Value,
};
use std::collections::{BTreeMap, BTreeSet};

/// One difference.
#[derive(Debug, Clone, PartialEq)]
pub enum Difference {
    /// A node that only the second graph has.
    NodeAdded {
        /// Its id there.
        id: NodeId,
        /// Its name.
        name: String,
        /// Its type.
        type_name: String,
        /// Its attributes.
        attributes: Vec<(String, Value)>,
    },
    /// A node that only the first graph has.
    NodeRemoved {
        /// Its name.
        name: String,
        /// Its type.
        type_name: String,
    },
    /// A node of another type.
    NodeRetyped {
        /// Its name.
        name: String,
        /// The type in the first graph,
        before: String,
        /// and in the second.
        after: String,
    },
    /// An edge that only the second graph has.
    EdgeAdded {
        /// Which, by names.
        edge: EdgeRef,
        /// Its attributes.
        attributes: Vec<(String, Value)>,
    },
    /// An edge that only the first graph has.
    EdgeRemoved {
        /// Which, by names.
        edge: EdgeRef,
    },
    /// An attribute of what both have.
    Attribute {
        /// Of what, by names.
        owner: Owner,
        /// Which.
        name: String,
        /// The value in the first graph, if it is there,
        before: Option<Value>,
        /// and in the second.
        after: Option<Value>,
    },
}

type Values = BTreeMap<String, Value>;

struct NodeRow {
    id: NodeId,
    type_name: String,
    attributes: Values,
}

/// A graph by names.
struct Named {
    nodes: BTreeMap<String, NodeRow>,
    /// By source, label and target.
    edges: BTreeMap<(String, String, String), Values>,
}

fn values(schema: &Schema, attributes: Vec<Attribute>) -> Values {
    let named = |a: Attribute| (schema.attribute_name(a.name).to_owned(), a.value);
    attributes.into_iter().map(named).collect()
}

impl Named {
    fn of(snapshot: &Snapshot) -> Result<Self, ReadError> {
        let schema = snapshot.schema();
        let (mut nodes, mut names) = (BTreeMap::new(), BTreeMap::new());
        let mut edges = Vec::new();
        for node in snapshot.nodes() {
            let node = node?;
            let name = node.name()?;
            names.insert(node.id(), name.clone());
            let row = NodeRow {
                id: node.id(),
                type_name: node.type_name().to_owned(),
                attributes: values(schema, node.attributes()?),
            };
            nodes.insert(name, row);
            for edge in node.edges() {
                let edge = edge?;
                edges.push((edge.key(), values(schema, edge.attributes()?)));
            }
        }
        let name = |id| names.get(&id).cloned().unwrap_or_default();
        let edges = edges.into_iter().map(|(key, attributes)| {
            let label = schema.label_name(key.label).to_owned();
            ((name(key.from), label, name(key.to)), attributes)
        });
        Ok(Self {
            edges: edges.collect(),
            nodes,
        })
    }
}

/// Whether two values are the same; not-a-number is itself.
fn same(a: &Value, b: &Value) -> bool {
    a == b || a.kind() == b.kind() && value_to_json(a) == value_to_json(b)
}

fn compare(owner: &Owner, before: &Values, after: &Values, found: &mut Vec<Difference>) {
    let names: BTreeSet<&String> = before.keys().chain(after.keys()).collect();
    for name in names {
        let (before, after) = (before.get(name), after.get(name));
        if let (Some(a), Some(b)) = (before, after)
            && same(a, b)
        {
            continue;
        }
        found.push(Difference::Attribute {
            owner: owner.clone(),
            name: name.clone(),
            before: before.cloned(),
            after: after.cloned(),
        });
    }
}

/// What makes `after` another graph than `before`: nodes by name, then edges by source, label and
/// target.
///
/// # Errors
/// [`ReadError`].
pub fn differences(before: &Snapshot, after: &Snapshot) -> Result<Vec<Difference>, ReadError> {
    let (before, after) = (Named::of(before)?, Named::of(after)?);
    let mut found = Vec::new();
    let names: BTreeSet<&String> = before.nodes.keys().chain(after.nodes.keys()).collect();
    for name in names {
        match (before.nodes.get(name), after.nodes.get(name)) {
            (Some(a), Some(b)) => {
                if a.type_name != b.type_name {
                    found.push(Difference::NodeRetyped {
                        name: name.clone(),
                        before: a.type_name.clone(),
                        after: b.type_name.clone(),
                    });
                }
                let owner = Owner::Node(name.as_str().into());
                compare(&owner, &a.attributes, &b.attributes, &mut found);
            }
            (Some(a), None) => found.push(Difference::NodeRemoved {
                name: name.clone(),
                type_name: a.type_name.clone(),
            }),
            (None, Some(b)) => found.push(Difference::NodeAdded {
                id: b.id,
                name: name.clone(),
                type_name: b.type_name.clone(),
                attributes: b.attributes.clone().into_iter().collect(),
            }),
            (None, None) => {}
        }
    }
    let keys: BTreeSet<_> = before.edges.keys().chain(after.edges.keys()).collect();
    for key in keys {
        let edge = EdgeRef::new(key.0.as_str(), &key.1, key.2.as_str());
        match (before.edges.get(key), after.edges.get(key)) {
            (Some(a), Some(b)) => compare(&Owner::Edge(edge), a, b, &mut found),
            (Some(_), None) => found.push(Difference::EdgeRemoved { edge }),
            (None, Some(b)) => found.push(Difference::EdgeAdded {
                edge,
                attributes: b.clone().into_iter().collect(),
            }),
            (None, None) => {}
        }
    }
    Ok(found)
}

/// The transaction that brings `graph` to what `differences` from it lead to. Nodes, edges and
/// attributes that only `graph` has go only where `remove` says so. New nodes keep their ids where
/// those were never given.
///
/// # Errors
/// [`ReadError`].
pub fn bring_over(
    graph: &Snapshot,
    differences: &[Difference],
    remove: bool,
) -> Result<Transaction, ReadError> {
    let mut gone: BTreeSet<NodeRef> = BTreeSet::new();
    for difference in differences {
        if let Difference::NodeRemoved { name, .. } = difference {
            gone.insert(name.as_str().into());
        }
    }
    // What goes first, then nodes, then what needs them.
    let mut steps: [Transaction; 4] = Default::default();
    let [removals, nodes, edges, attributes] = &mut steps;
    for difference in differences {
        match difference.clone() {
            Difference::NodeRemoved { name, .. } if remove => removals.delete_node(name),
            Difference::EdgeRemoved { edge } if remove => {
                // Those of a node that goes go with it.
                if !gone.contains(&edge.from) && !gone.contains(&edge.to) {
                    removals.push(Operation::DeleteEdge { edge });
                }
            }
            Difference::NodeAdded {
                id,
                name,
                type_name,
                attributes,
            } => nodes.push(Operation::CreateNode {
                id: graph.find_node(id)?.is_none().then_some(id),
                type_name,
                name,
                attributes,
            }),
            Difference::NodeRetyped { name, after, .. } => nodes.push(Operation::RetypeNode {
                node: name.into(),
                type_name: after,
            }),
            Difference::EdgeAdded { edge, attributes } => {
                edges.push(Operation::CreateEdge { edge, attributes });
            }
            Difference::Attribute {
                owner,
                name,
                after: Some(value),
                ..
            } => attributes.push(Operation::SetAttribute { owner, name, value }),
            Difference::Attribute { owner, name, .. } if remove => {
                attributes.push(Operation::RemoveAttribute { owner, name });
            }
            // Only the graph has it, and nothing is taken away.
            Difference::NodeRemoved { .. }
            | Difference::EdgeRemoved { .. }
            | Difference::Attribute { .. } => {}
        }
    }
    // Nodes whose ids are given come before those whose ids the store chooses.
    nodes
        .operations
        .sort_by_key(|operation| matches!(operation, Operation::CreateNode { id: None, .. }));
    let mut transaction = Transaction::new();
    for step in steps {
        transaction.operations.extend(step.operations);
    }
    Ok(transaction)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Graph, Time, json};
    use proptest::prelude::*;

    /// Up to five nodes and their edges, each perhaps with attributes.
    fn graph() -> impl Strategy<Value = Graph> {
        let attributes = || prop::collection::btree_map("[xy]", 0..3i64, 0..3);
        let nodes = prop::collection::btree_map(0..5u64, ("[ab]", attributes()), 0..5);
        let edges = prop::collection::btree_map((0..5u64, "[lm]", 0..5u64), attributes(), 0..8);
        let ids = prop::bool::ANY;
        (nodes, edges, ids).prop_map(|(nodes, edges, ids)| {
            let named = |row: std::collections::BTreeMap<String, i64>| {
                row.into_iter()
                    .map(|(name, n)| (name, Value::I64(n)))
                    .collect::<Vec<_>>()
            };
            let mut transaction = Transaction::new();
            for (&n, (type_name, attributes)) in &nodes {
                transaction.push(Operation::CreateNode {
                    id: ids.then_some(NodeId(7 * n + 1)),
                    type_name: type_name.clone(),
                    name: format!("n{n}"),
                    attributes: named(attributes.clone()),
                });
            }
            for ((from, label, to), attributes) in edges {
                if nodes.contains_key(&from) && nodes.contains_key(&to) {
                    transaction.push(Operation::CreateEdge {
                        edge: EdgeRef::new(format!("n{from}"), &label, format!("n{to}")),
                        attributes: named(attributes),
                    });
                }
            }
            let mut graph = Graph::in_memory(Schema::open());
            graph.commit(&transaction, "test", Time::default()).unwrap();
            graph
        })
    }

    proptest! {
        #[test]
        fn what_differs_brings_one_graph_to_the_other(mut a in graph(), b in graph()) {
            let (before, after) = (a.snapshot(), b.snapshot());
            let found = differences(&before, &after).unwrap();
            let same = json::to_json(&before).unwrap()["edges"] == json::to_json(&after).unwrap()["edges"];
            prop_assert!(same || !found.is_empty() || before.edge_count() == after.edge_count());
            let transaction = bring_over(&before, &found, true).unwrap();
            a.commit(&transaction, "test", Time::default()).unwrap();
            prop_assert_eq!(differences(&a.snapshot(), &after).unwrap(), vec![]);
        }

        #[test]
        fn a_merge_takes_nothing_away(mut a in graph(), b in graph()) {
            let (before, after) = (a.snapshot(), b.snapshot());
            let found = differences(&before, &after).unwrap();
            let transaction = bring_over(&before, &found, false).unwrap();
            a.commit(&transaction, "test", Time::default()).unwrap();
            let left = differences(&a.snapshot(), &after).unwrap();
            let only_more = left.iter().all(|difference| match difference {
                Difference::NodeRemoved { .. } | Difference::EdgeRemoved { .. } => true,
                Difference::Attribute { after, .. } => after.is_none(),
                _ => false,
            });
            prop_assert!(only_more, "{left:?}");
        }
    }

    #[test]
    fn differences_are_told_by_name() {
        let graph = |text: &str| {
            let world = crate::interchange::read(text, &Schema::open()).unwrap();
            let mut graph = Graph::in_memory(Schema::open());
            graph.import(&world, "test", Time::default()).unwrap();
            graph.snapshot()
        };
        let a = graph(
            r#"{"format":"dsr/1","nodes":[{"id":1,"type":"room","name":"k","attributes":{"area":1.0,"x":{"type":"f64","value":"NaN"}}},
            {"id":2,"type":"cup","name":"c"}],"edges":[{"from":2,"label":"in","to":1}]}"#,
        );
        let b = graph(
            r#"{"format":"dsr/1","nodes":[{"id":9,"type":"hall","name":"k","attributes":{"area":2.0,"x":{"type":"f64","value":"NaN"}}},
            {"type":"cup","name":"d"}]}"#,
        );
        let found = differences(&a, &b).unwrap();
        let edge = EdgeRef::new("c", "in", "k");
        let (before, after) = ("room".to_owned(), "hall".to_owned());
        let cup = || "cup".to_owned();
        assert_eq!(
            found,
            [
                Difference::NodeRemoved {
                    name: "c".into(),
                    type_name: cup()
                },
                Difference::NodeAdded {
                    id: NodeId(10),
                    name: "d".into(),
                    type_name: cup(),
                    attributes: vec![]
                },
                Difference::NodeRetyped {
                    name: "k".into(),
                    before,
                    after
                },
                Difference::Attribute {
                    owner: Owner::Node("k".into()),
                    name: "area".into(),
                    before: Some(1.0.into()),
                    after: Some(2.0.into()),
                },
                Difference::EdgeRemoved { edge },
            ]
        );
    }
}
