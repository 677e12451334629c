//! A recorded commit as the transaction that makes it again. It guarantees that rules stay on record
//! with the nodes that they were bound to, though what they changed is taken from the recording.

use dsr::{
    EdgeRef, Element, NodeId, NodeRef, Operation, Owner, ReadError, Refusal, RuleEngine, Snapshot,
    Transaction, Value, json,
};
use serde::Deserialize;
use serde_json::{Map, Value as Json};
use std::collections::{BTreeMap, BTreeSet};
use thiserror::Error;

/// A row of the topic of commits.
#[derive(Debug, Clone, Deserialize)]
pub(crate) struct CommitRow {
    pub(crate) version: u64,
    pub(crate) agent: String,
    rules: Vec<RuleRow>,
    nodes: Vec<NodeRow>,
    edges: Vec<EdgeRow>,
}

#[derive(Debug, Clone, Deserialize)]
struct RuleRow {
    rule: String,
    ids: BTreeMap<String, u64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum TouchRow {
    Created,
    Deleted,
    Updated,
    Replaced,
}

#[derive(Debug, Clone, Deserialize)]
struct NodeRow {
    id: u64,
    name: String,
    r#type: String,
    touch: TouchRow,
    attributes: Map<String, Json>,
}

#[derive(Debug, Clone, Deserialize)]
struct EdgeRow {
    from_id: u64,
    label: String,
    to_id: u64,
    touch: TouchRow,
    attributes: Map<String, Json>,
}

/// Why a row cannot be made again.
#[derive(Debug, Error)]
pub(crate) enum RowError {
    #[error("attribute `{name}`: {reason}")]
    Value { name: String, reason: String },
    #[error(transparent)]
    Read(#[from] ReadError),
}

/// Goes by every rule and lets it change nothing: what it changed is recorded.
#[derive(Debug)]
pub(crate) struct RecordedRules;

impl RuleEngine for RecordedRules {
    fn expand(
        &self,
        _: &Snapshot,
        _: &str,
        _: &[(String, NodeId)],
    ) -> Result<Vec<Operation>, Refusal> {
        Ok(Vec::new())
    }
}

fn node_ref(id: u64) -> NodeRef {
    NodeRef::Id(NodeId(id))
}

fn values(attributes: &Map<String, Json>) -> Result<Vec<(String, Value)>, RowError> {
    let given = attributes.iter().filter(|(_, value)| !value.is_null());
    given
        .map(|(name, value)| {
            let value = json::value_from_json(value, None).map_err(|reason| RowError::Value {
                name: name.clone(),
                reason,
            })?;
            Ok((name.clone(), value))
        })
        .collect()
}

/// The operations of a transaction, in the order in which none stands in the way of another.
struct Rebuilt<'a> {
    graph: &'a Snapshot,
    transaction: Transaction,
}

impl Rebuilt<'_> {
    fn there(&self, id: u64) -> Result<bool, ReadError> {
        Ok(self.graph.find_node(NodeId(id))?.is_some())
    }

    fn edge(&self, row: &EdgeRow) -> Result<Option<dsr::Edge<'_>>, ReadError> {
        let Some(label) = self.graph.schema().find_label(&row.label) else {
            return Ok(None);
        };
        self.graph.find_edge(dsr::EdgeKey {
            from: NodeId(row.from_id),
            label,
            to: NodeId(row.to_id),
        })
    }

    fn rules(&mut self, rows: &[RuleRow]) {
        for row in rows {
            let bound = row.ids.iter().map(|(var, id)| (var.clone(), node_ref(*id)));
            self.transaction.apply_rule(&row.rule, bound.collect());
        }
    }

    /// What makes the attributes of what is there those of a row; where `whole`, and no others.
    fn attributes(
        &mut self,
        owner: &Owner,
        element: Option<&Element<'_>>,
        row: &Map<String, Json>,
        whole: bool,
    ) -> Result<(), RowError> {
        for (name, value) in values(row)? {
            self.transaction.push(Operation::SetAttribute {
                owner: owner.clone(),
                name,
                value,
            });
        }
        let Some(element) = element else {
            return Ok(());
        };
        for attribute in element.attributes()? {
            let name = self.graph.schema().attribute_name(attribute.name);
            let gone = match row.get(name) {
                Some(value) => value.is_null(),
                None => whole,
            };
            if gone {
                self.transaction.push(Operation::RemoveAttribute {
                    owner: owner.clone(),
                    name: name.to_owned(),
                });
            }
        }
        Ok(())
    }
}

impl CommitRow {
    /// The transaction that does to `graph`, the version before, what this commit did.
    ///
    /// # Errors
    /// [`RowError`].
    pub(super) fn transaction(&self, graph: &Snapshot) -> Result<Transaction, RowError> {
        let mut made = Rebuilt {
            graph,
            transaction: Transaction::new(),
        };
        // All before the rest or all after it: they stay in their order.
        let mut before = true;
        for id in self.rules.iter().flat_map(|rule| rule.ids.values()) {
            before &= made.there(*id)?;
        }
        if before {
            made.rules(&self.rules);
        }
        self.take_away(&mut made)?;
        for row in &self.nodes {
            self::node(&mut made, row)?;
        }
        for row in self
            .edges
            .iter()
            .filter(|row| row.touch != TouchRow::Deleted)
        {
            self::edge(&mut made, row)?;
        }
        if before {
            return Ok(made.transaction);
        }
        let passing = self.passing(&made)?;
        let any = graph.schema().types().first();
        for &id in &passing {
            made.transaction.push(Operation::CreateNode {
                id: Some(NodeId(id)),
                type_name: any.map_or("thing", |known| &known.name).to_owned(),
                name: format!("passing-{id}"),
                attributes: Vec::new(),
            });
        }
        made.rules(&self.rules);
        for id in passing {
            made.transaction.delete_node(node_ref(id));
        }
        Ok(made.transaction)
    }

    /// The nodes that rules were bound to and that are not there after this commit: rules stay on record with
    /// them, so they have to be there while these are applied.
    fn passing(&self, made: &Rebuilt<'_>) -> Result<BTreeSet<u64>, ReadError> {
        let mut passing = BTreeSet::new();
        for &id in self.rules.iter().flat_map(|rule| rule.ids.values()) {
            let stays = match self.nodes.iter().find(|row| row.id == id) {
                Some(row) => row.touch != TouchRow::Deleted,
                None => made.there(id)?,
            };
            if !stays {
                passing.insert(id);
            }
        }
        Ok(passing)
    }

    fn take_away(&self, made: &mut Rebuilt<'_>) -> Result<(), RowError> {
        let deleted = self
            .nodes
            .iter()
            .filter(|row| row.touch == TouchRow::Deleted);
        let gone: BTreeSet<u64> = deleted.map(|row| row.id).collect();
        for row in self
            .edges
            .iter()
            .filter(|row| row.touch == TouchRow::Deleted)
        {
            // Those of a node that goes go with it.
            let with_node = gone.contains(&row.from_id) || gone.contains(&row.to_id);
            if !with_node && made.edge(row)?.is_some() {
                let (from, to) = (node_ref(row.from_id), node_ref(row.to_id));
                made.transaction.delete_edge(from, &row.label, to);
            }
        }
        for row in &self.nodes {
            let there = made.graph.find_node(NodeId(row.id))?;
            let goes = match there {
                None => false,
                Some(_) if row.touch == TouchRow::Deleted => true,
                Some(node) => row.touch == TouchRow::Replaced && node.name()? != row.name,
            };
            if goes {
                made.transaction.delete_node(node_ref(row.id));
            }
        }
        Ok(())
    }
}

fn node(made: &mut Rebuilt<'_>, row: &NodeRow) -> Result<(), RowError> {
    if row.touch == TouchRow::Deleted {
        return Ok(());
    }
    let graph = made.graph;
    let before = graph.find_node(NodeId(row.id))?;
    let same = match &before {
        Some(node) => node.name()? == row.name,
        None => false,
    };
    let Some(before) = before.filter(|_| same) else {
        made.transaction.push(Operation::CreateNode {
            id: Some(NodeId(row.id)),
            type_name: row.r#type.clone(),
            name: row.name.clone(),
            attributes: values(&row.attributes)?,
        });
        return Ok(());
    };
    if before.type_name() != row.r#type {
        made.transaction.push(Operation::RetypeNode {
            node: node_ref(row.id),
            type_name: row.r#type.clone(),
        });
    }
    let whole = row.touch != TouchRow::Updated;
    let owner = Owner::Node(node_ref(row.id));
    made.attributes(&owner, Some(&before), &row.attributes, whole)
}

fn edge(made: &mut Rebuilt<'_>, row: &EdgeRow) -> Result<(), RowError> {
    let edge = EdgeRef::new(node_ref(row.from_id), &row.label, node_ref(row.to_id));
    let graph = made.graph;
    let label = graph.schema().find_label(&row.label);
    let key = label.map(|label| dsr::EdgeKey {
        from: NodeId(row.from_id),
        label,
        to: NodeId(row.to_id),
    });
    let before = key.map(|key| graph.find_edge(key)).transpose()?.flatten();
    let Some(before) = before else {
        made.transaction.push(Operation::CreateEdge {
            edge,
            attributes: values(&row.attributes)?,
        });
        return Ok(());
    };
    let whole = row.touch != TouchRow::Updated;
    made.attributes(&Owner::Edge(edge), Some(&before), &row.attributes, whole)
}
