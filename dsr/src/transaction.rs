//! What an agent asks of the store: a list of operations that is applied whole or not at all, and
//! the store's answer. This file owns the wire's vocabulary of change; names, not numbers, cross
//! it, so that a request says the same under every schema.

use crate::{NodeId, Time, Value, Version};
use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;

/// A node as a request names it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum NodeRef {
    /// By id.
    Id(NodeId),
    /// By its unique name; a node that the same transaction creates further up counts.
    Name(String),
}

impl From<NodeId> for NodeRef {
    fn from(id: NodeId) -> Self {
        Self::Id(id)
    }
}
impl From<&str> for NodeRef {
    fn from(name: &str) -> Self {
        Self::Name(name.to_owned())
    }
}
impl From<String> for NodeRef {
    fn from(name: String) -> Self {
        Self::Name(name)
    }
}
impl fmt::Display for NodeRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Id(id) => write!(f, "node {id}"),
            Self::Name(name) => write!(f, "`{name}`"),
        }
    }
}

/// An edge as a request names it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct EdgeRef {
    /// Where it starts.
    pub from: NodeRef,
    /// Its label.
    pub label: String,
    /// Where it ends.
    pub to: NodeRef,
}

impl EdgeRef {
    /// The edge `from -label-> to`.
    pub fn new(from: impl Into<NodeRef>, label: &str, to: impl Into<NodeRef>) -> Self {
        Self {
            from: from.into(),
            label: label.to_owned(),
            to: to.into(),
        }
    }
}
impl fmt::Display for EdgeRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} -{}-> {}", self.from, self.label, self.to)
    }
}

/// What carries an attribute.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Owner {
    /// A node.
    Node(NodeRef),
    /// An edge.
    Edge(EdgeRef),
}

impl fmt::Display for Owner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Node(node) => node.fmt(f),
            Self::Edge(edge) => edge.fmt(f),
        }
    }
}

/// One change to the graph.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Operation {
    /// Makes a node. Its id is chosen by the store unless given (as imports do).
    CreateNode {
        /// The id it shall have.
        id: Option<NodeId>,
        /// Its type.
        type_name: String,
        /// Its name, which no other node has.
        name: String,
        /// Its attributes.
        attributes: Vec<(String, Value)>,
    },
    /// Removes a node and the edges that touch it.
    DeleteNode {
        /// Which.
        node: NodeRef,
    },
    /// Gives a node another type.
    RetypeNode {
        /// Which.
        node: NodeRef,
        /// The new type.
        type_name: String,
    },
    /// Makes an edge, or sets the attributes of the one that is there.
    CreateEdge {
        /// Which.
        edge: EdgeRef,
        /// Its attributes.
        attributes: Vec<(String, Value)>,
    },
    /// Removes an edge.
    DeleteEdge {
        /// Which.
        edge: EdgeRef,
    },
    /// Sets one attribute and leaves the others alone.
    SetAttribute {
        /// Of what.
        owner: Owner,
        /// Which.
        name: String,
        /// To what.
        value: Value,
    },
    /// Removes one attribute.
    RemoveAttribute {
        /// Of what.
        owner: Owner,
        /// Which.
        name: String,
    },
    /// Applies a rule of the grammar: the store checks that its left-hand side holds at the
    /// binding in the state that the operations before it made, and does what its right says.
    ApplyRule {
        /// The rule's name.
        rule: String,
        /// The node that each of the rule's variables stands for.
        binding: Vec<(String, NodeRef)>,
    },
}

/// What must hold in the current version for a transaction to be applied.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Precondition {
    /// The node is there and was last changed at or before that version.
    NodeUnchangedSince {
        /// Which.
        node: NodeRef,
        /// The last version that the asker has seen.
        version: Version,
    },
    /// The node is there.
    NodeExists {
        /// Which.
        node: NodeRef,
    },
    /// The edge is there.
    EdgeExists {
        /// Which.
        edge: EdgeRef,
    },
    /// The edge is not there.
    EdgeAbsent {
        /// Which.
        edge: EdgeRef,
    },
    /// The attribute has that value, or is not there for `None`.
    AttributeEquals {
        /// Of what.
        owner: Owner,
        /// Which.
        name: String,
        /// The expected value.
        value: Option<Value>,
    },
}

/// When the store acknowledges a commit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Durability {
    /// As the store was told to do by default.
    #[default]
    AsTheStore,
    /// Once everybody can see it. It reaches the disk with the next group of commits, if the
    /// store keeps a state folder.
    InMemory,
    /// Once it is on disk, so that it outlives every process and the machine's power.
    OnDisk,
}

/// A list of operations that the store applies whole or not at all.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Transaction {
    /// What must hold first.
    pub preconditions: Vec<Precondition>,
    /// What to do, in this order.
    pub operations: Vec<Operation>,
    /// When to acknowledge it.
    pub durability: Durability,
}

impl Transaction {
    /// A transaction that does nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Whether it would do nothing.
    pub fn is_empty(&self) -> bool {
        self.operations.is_empty()
    }

    /// Adds a precondition.
    #[must_use]
    pub fn require(mut self, precondition: Precondition) -> Self {
        self.preconditions.push(precondition);
        self
    }

    /// Asks for an acknowledgement only once the commit is on disk.
    #[must_use]
    pub fn durable(mut self) -> Self {
        self.durability = Durability::OnDisk;
        self
    }

    /// Adds an operation.
    pub fn push(&mut self, operation: Operation) {
        self.operations.push(operation);
    }

    /// Adds the making of a node.
    pub fn create_node(&mut self, type_name: &str, name: &str, attributes: Vec<(String, Value)>) {
        self.push(Operation::CreateNode {
            id: None,
            type_name: type_name.to_owned(),
            name: name.to_owned(),
            attributes,
        });
    }

    /// Adds the removal of a node.
    pub fn delete_node(&mut self, node: impl Into<NodeRef>) {
        self.push(Operation::DeleteNode { node: node.into() });
    }

    /// Adds the making of an edge without attributes.
    pub fn create_edge(&mut self, from: impl Into<NodeRef>, label: &str, to: impl Into<NodeRef>) {
        self.push(Operation::CreateEdge {
            edge: EdgeRef::new(from, label, to),
            attributes: Vec::new(),
        });
    }

    /// Adds the removal of an edge.
    pub fn delete_edge(&mut self, from: impl Into<NodeRef>, label: &str, to: impl Into<NodeRef>) {
        self.push(Operation::DeleteEdge {
            edge: EdgeRef::new(from, label, to),
        });
    }

    /// Adds the setting of a node's attribute.
    pub fn set(&mut self, node: impl Into<NodeRef>, name: &str, value: impl Into<Value>) {
        self.push(Operation::SetAttribute {
            owner: Owner::Node(node.into()),
            name: name.to_owned(),
            value: value.into(),
        });
    }

    /// Adds the setting of an edge's attribute.
    pub fn set_on_edge(&mut self, edge: EdgeRef, name: &str, value: impl Into<Value>) {
        self.push(Operation::SetAttribute {
            owner: Owner::Edge(edge),
            name: name.to_owned(),
            value: value.into(),
        });
    }

    /// Adds the application of a rule.
    pub fn apply_rule(&mut self, rule: &str, binding: Vec<(String, NodeRef)>) {
        self.push(Operation::ApplyRule {
            rule: rule.to_owned(),
            binding,
        });
    }
}

/// The store's yes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Commit {
    /// The version that the transaction made.
    pub version: Version,
    /// Its time.
    pub time: Time,
    /// The ids of the nodes that it created, in the order of its operations.
    pub created: Vec<NodeId>,
    /// Whether it is known to be on disk.
    pub durable: bool,
}

/// The store's no: nothing was changed.
#[derive(Debug, Clone, PartialEq, Error, Serialize, Deserialize)]
pub enum Refusal {
    /// A precondition does not hold any more; read again and decide anew.
    #[error("conflict: {0}")]
    Conflict(String),
    /// The agent's manifest does not give it this right.
    #[error("not allowed: {0}")]
    NotAllowed(String),
    /// A name that the schema does not have, or an edge, value or range that it forbids.
    #[error("against the schema: {0}")]
    SchemaViolation(String),
    /// A node or edge that the transaction speaks of is not there.
    #[error("there is no {0}")]
    NotFound(String),
    /// A node of that id or name is there already.
    #[error("there is already {0}")]
    AlreadyExists(String),
    /// The rule's left-hand side does not hold at the binding, or there is no such rule.
    #[error("rule `{rule}` is not applicable: {reason}")]
    RuleNotApplicable {
        /// Which rule.
        rule: String,
        /// What does not hold.
        reason: String,
    },
    /// The arena has no room for it; the graph is as it was.
    #[error("the graph's memory is full ({bytes} bytes in use)")]
    OutOfMemory {
        /// Bytes in use.
        bytes: u64,
    },
    /// A durable acknowledgement was asked for, and the store keeps nothing on disk.
    #[error("the commit cannot be made durable: {0}")]
    NotDurable(String),
    /// The request could not be read.
    #[error("malformed request: {0}")]
    Malformed(String),
}
