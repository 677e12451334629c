//! What a file says of a world, with the place of everything that can be wrong.

use super::place::{Span, Text};
use super::{Problem, Severity};
use crate::{EdgeRef, NodeId, NodeRef, Operation, Owner, Schema, SchemaError, Time, Transaction};
use crate::{TypeId, Value, suggest};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// A format that worlds are read from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Graph JSON.
    Json,
    /// RoboComp DSR JSON.
    Robocomp,
    /// AGM model XML.
    Agm,
}

/// What a file says of a world.
#[derive(Debug, Clone, PartialEq)]
pub struct World {
    pub(super) format: Format,
    pub(super) nodes: Vec<WorldNode>,
    pub(super) edges: Vec<WorldEdge>,
    /// What could not be kept.
    pub left_out: Vec<LeftOut>,
}

/// A link of a RoboComp file to a symbol that the file does not have.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// The link's label.
    pub label: String,
    /// The id of the symbol where it starts.
    pub from: u64,
    /// The id that no symbol has.
    pub to: u64,
    pub(super) span: Span,
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            label, from, to, ..
        } = self;
        write!(
            f,
            "the link `{label}` of symbol {from} is left out: there is no symbol {to}"
        )
    }
}

/// What a file says of when and by whom an attribute was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stamp {
    /// Of what.
    pub owner: Owner,
    /// Which attribute.
    pub name: String,
    /// When.
    pub time: Option<Time>,
    /// By whom.
    pub agent: Option<String>,
}

/// A name and where it stands.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Word {
    pub(super) text: String,
    pub(super) span: Span,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct WorldNode {
    pub(super) id: Option<(NodeId, Span)>,
    pub(super) type_name: Word,
    pub(super) name: Word,
    pub(super) attributes: Vec<WorldAttribute>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct WorldEdge {
    pub(super) from: (NodeRef, Span),
    pub(super) label: Word,
    pub(super) to: (NodeRef, Span),
    pub(super) attributes: Vec<WorldAttribute>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct WorldAttribute {
    pub(super) name: Word,
    pub(super) value: Value,
    pub(super) span: Span,
    pub(super) time: Option<Time>,
    pub(super) agent: Option<String>,
}

impl WorldNode {
    fn owner(&self) -> NodeRef {
        match &self.id {
            Some((id, _)) => NodeRef::Id(*id),
            None => NodeRef::Name(self.name.text.clone()),
        }
    }
}

impl WorldEdge {
    fn key(&self) -> EdgeRef {
        EdgeRef {
            from: self.from.0.clone(),
            label: self.label.text.clone(),
            to: self.to.0.clone(),
        }
    }
}

fn values(attributes: &[WorldAttribute]) -> Vec<(String, Value)> {
    let value = |a: &WorldAttribute| (a.name.text.clone(), a.value.clone());
    attributes.iter().map(value).collect()
}

impl World {
    pub(super) fn new(format: Format) -> Self {
        Self {
            format,
            nodes: Vec::new(),
            edges: Vec::new(),
            left_out: Vec::new(),
        }
    }

    /// The format that it was read from.
    pub fn format(&self) -> Format {
        self.format
    }

    /// Makes the world on an empty graph.
    pub fn transaction(&self) -> Transaction {
        let mut transaction = Transaction::new();
        // Ids that the store chooses come after those that the file gives, so that they do not
        // meet.
        let (numbered, others): (Vec<_>, Vec<_>) =
            self.nodes.iter().partition(|node| node.id.is_some());
        for node in numbered.into_iter().chain(others) {
            transaction.push(Operation::CreateNode {
                id: node.id.as_ref().map(|(id, _)| *id),
                type_name: node.type_name.text.clone(),
                name: node.name.text.clone(),
                attributes: values(&node.attributes),
            });
        }
        for edge in &self.edges {
            transaction.push(Operation::CreateEdge {
                edge: edge.key(),
                attributes: values(&edge.attributes),
            });
        }
        transaction
    }

    /// When and by whom attributes were written, where the file says so.
    pub fn stamps(&self) -> Vec<Stamp> {
        let nodes = self.nodes.iter().flat_map(|node| {
            let owner = Owner::Node(node.owner());
            node.attributes.iter().map(move |a| (owner.clone(), a))
        });
        let edges = self.edges.iter().flat_map(|edge| {
            let owner = Owner::Edge(edge.key());
            edge.attributes.iter().map(move |a| (owner.clone(), a))
        });
        let stamped = nodes.chain(edges);
        stamped
            .filter(|(_, a)| a.time.is_some() || a.agent.is_some())
            .map(|(owner, a)| Stamp {
                owner,
                name: a.name.text.clone(),
                time: a.time,
                agent: a.agent.clone(),
            })
            .collect()
    }

    /// What contradicts itself, whatever the schema.
    pub(super) fn check_references(&self, text: &Text<'_>, problems: &mut Vec<Problem>) {
        let (mut ids, mut names) = (BTreeSet::new(), BTreeSet::new());
        for node in &self.nodes {
            if let Some((id, span)) = &node.id {
                if !ids.insert(*id) {
                    let message = format!("there are two nodes with the id {id}");
                    problems.push(text.problem(span.clone(), message));
                }
                if id.0 == u64::MAX {
                    let message = format!("{id} cannot be a node's id");
                    problems.push(text.problem(span.clone(), message));
                }
            }
            if !names.insert(node.name.text.as_str()) {
                let message = format!("there are two nodes with the name `{}`", node.name.text);
                problems.push(text.problem(node.name.span.clone(), message));
            }
            if node.name.text.is_empty() || node.name.text.len() > 255 {
                let error = SchemaError::BadName(node.name.text.clone());
                problems.push(text.problem(node.name.span.clone(), error.to_string()));
            }
        }
        for edge in &self.edges {
            for (end, span) in [&edge.from, &edge.to] {
                let (known, help) = match end {
                    NodeRef::Id(id) => (ids.contains(id), None),
                    NodeRef::Name(name) => {
                        let help = || suggest(name, names.iter().copied());
                        let known = names.contains(name.as_str());
                        (known, (!known).then(help).flatten())
                    }
                };
                if !known {
                    let message = format!(
                        "an edge `{}` ends at {end}, which is not in the file",
                        edge.label.text
                    );
                    let mut problem = text.problem(span.clone(), message);
                    problem.help = help.map(|name| format!("did you mean `{name}`?"));
                    problems.push(problem);
                }
            }
        }
    }

    /// All that the schema does not allow, each with its place in `text`, the text that the world was
    /// read from. Links that were left out are among it, as warnings.
    pub fn check(&self, text: &str, schema: &Schema) -> Vec<Problem> {
        let text = Text::new(text);
        let mut problems = Vec::new();
        let mut types: BTreeMap<NodeRef, TypeId> = BTreeMap::new();
        let refused = |span: &Span, error: SchemaError| {
            let (message, help) = match error {
                SchemaError::UnknownName {
                    kind,
                    name,
                    suggestion,
                } => (
                    format!("unknown {kind} `{name}`"),
                    suggestion.map(|name| format!("did you mean `{name}`?")),
                ),
                other => (other.to_string(), None),
            };
            Problem {
                help,
                ..text.problem(span.clone(), message)
            }
        };
        let open = schema.is_open();
        for node in &self.nodes {
            let kind = &node.type_name;
            match schema.type_id(&kind.text) {
                Ok(id) => {
                    types.insert(NodeRef::Name(node.name.text.clone()), id);
                    types.insert(node.owner(), id);
                }
                Err(_) if open && !kind.text.is_empty() => {}
                Err(error) => problems.push(refused(&kind.span, error)),
            }
        }
        for edge in &self.edges {
            match schema.label_id(&edge.label.text) {
                Err(_) if open && !edge.label.text.is_empty() => {}
                Err(error) => problems.push(refused(&edge.label.span, error)),
                Ok(label) => {
                    if let (Some(&from), Some(&to)) =
                        (types.get(&edge.from.0), types.get(&edge.to.0))
                        && let Err(error) = schema.check_ends(label, from, to)
                    {
                        problems.push(refused(&edge.label.span, error));
                    }
                }
            }
        }
        let nodes = self.nodes.iter().flat_map(|node| &node.attributes);
        let edges = self.edges.iter().flat_map(|edge| &edge.attributes);
        for attribute in nodes.chain(edges) {
            match schema.attribute_id(&attribute.name.text) {
                Err(_) if open && !attribute.name.text.is_empty() => {}
                Err(error) => problems.push(refused(&attribute.name.span, error)),
                Ok(id) => {
                    if let Err(error) = schema.check_value(id, &attribute.value) {
                        problems.push(refused(&attribute.span, error));
                    }
                }
            }
        }
        problems.extend(self.left_out.iter().map(|left_out| Problem {
            severity: Severity::Warning,
            ..text.problem(left_out.span.clone(), left_out.to_string())
        }));
        problems.sort_by_key(|problem| problem.span.clone().map(|span| (span.start, span.end)));
        problems
    }
}
