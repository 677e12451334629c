//! Who may write what: each agent's manifest, and the check of an operation against it. This file
//! guarantees that what no manifest gives is not allowed, whoever asks.

mod file;

pub use file::ManifestError;

use crate::{AttributeId, LabelId, Refusal, Schema, TypeId};
use rustc_hash::FxHashSet;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Stands for every name.
const ANY: &str = "*";

/// An attribute that an agent may write: of the nodes of a type, or of the edges of a label.
#[derive(Debug, Clone, PartialEq, Eq)]
struct AttributeRight {
    /// A type (with its subtypes), a label, or `*`.
    owner: String,
    /// Or `*`.
    attribute: String,
}

/// Rules that an agent may apply.
#[derive(Debug, Clone, PartialEq, Eq)]
enum RuleRight {
    /// `*`: every rule.
    Every,
    /// `agent(NAME)`: the rules that the grammar gives to that agent.
    Of(String),
    /// The rule of that name, and where in the manifest it stands.
    Named(String, Range<usize>),
}

/// What one agent may write to the graph; everybody may read all of it.
///
/// See the book's page on manifests for the file format that [`Self::from_toml`] reads.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Manifest {
    agent: String,
    nodes: Vec<String>,
    edges: Vec<String>,
    attributes: Vec<AttributeRight>,
    rules: Vec<RuleRight>,
    several: bool,
}

impl Manifest {
    /// The manifest of an agent that may write everything, in as many processes as there are: for
    /// the tools of the person at the terminal.
    pub fn everything(agent: &str) -> Self {
        let any = || vec![ANY.to_owned()];
        Self {
            agent: agent.to_owned(),
            nodes: any(),
            edges: any(),
            attributes: vec![AttributeRight {
                owner: ANY.to_owned(),
                attribute: ANY.to_owned(),
            }],
            rules: vec![RuleRight::Every],
            several: true,
        }
    }

    /// Whose it is.
    pub fn agent(&self) -> &str {
        &self.agent
    }

    /// Whether several processes may go by the agent's name at once.
    pub fn several(&self) -> bool {
        self.several
    }

    /// Whether it gives the right to create, delete and retype nodes of a type, of which `is_a` says
    /// whether it is the named one or inherits from it.
    pub fn gives_nodes(&self, is_a: impl Fn(&str) -> bool) -> bool {
        self.nodes.iter().any(|given| given == ANY || is_a(given))
    }

    /// Whether it gives the right to create and delete edges of a label.
    pub fn gives_edges(&self, label: &str) -> bool {
        self.edges
            .iter()
            .any(|given| given == ANY || given == label)
    }

    /// Whether it gives the right to write an attribute of what `is_a` says is, or inherits from, the
    /// named type, or has the named label.
    pub fn gives_attribute(&self, is_a: impl Fn(&str) -> bool, attribute: &str) -> bool {
        self.attributes.iter().any(|given| {
            (given.attribute == ANY || given.attribute == attribute)
                && (given.owner == ANY || is_a(&given.owner))
        })
    }

    /// Whether it gives the right to apply a rule, which the grammar gives to `actor`.
    pub fn gives_rule(&self, rule: &str, actor: Option<&str>) -> bool {
        self.rules.iter().any(|right| match right {
            RuleRight::Every => true,
            RuleRight::Of(agent) => actor == Some(agent),
            RuleRight::Named(name, _) => name == rule,
        })
    }

    /// The rules that it gives by name, each with its place in the manifest's text.
    pub fn named_rules(&self) -> impl Iterator<Item = (&str, Range<usize>)> {
        self.rules.iter().filter_map(|right| match right {
            RuleRight::Named(name, place) => Some((name.as_str(), place.clone())),
            _ => None,
        })
    }
}

/// The manifests of all agents of an instance, as a schema understands them.
#[derive(Debug, Clone, Default)]
pub struct Rights {
    agents: BTreeMap<String, Arc<AgentRights>>,
}

impl Rights {
    /// The rights that the manifests give; of two of one agent the later counts.
    pub fn new(manifests: impl IntoIterator<Item = Manifest>, schema: &Schema) -> Self {
        let rights = |manifest: Manifest| {
            let agent = manifest.agent.clone();
            (agent, Arc::new(AgentRights::new(manifest, schema)))
        };
        Self {
            agents: manifests.into_iter().map(rights).collect(),
        }
    }

    /// The manifest of an agent.
    pub fn find(&self, agent: &str) -> Option<&Manifest> {
        self.agents.get(agent).map(|rights| &rights.manifest)
    }

    /// The rights of an agent.
    ///
    /// # Errors
    /// [`Refusal::NotAllowed`] where it has no manifest.
    pub(crate) fn of(&self, agent: &str) -> Result<Arc<AgentRights>, Refusal> {
        self.agents.get(agent).map(Arc::clone).ok_or_else(|| {
            Refusal::NotAllowed(format!(
                "agent `{agent}` has no manifest, so that it may only read"
            ))
        })
    }
}

/// What carries an attribute, by number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Carrier {
    Node(TypeId),
    Edge(LabelId),
}

/// A manifest, and what it says of the names that the schema had from the beginning.
#[derive(Debug, Clone)]
pub(crate) struct AgentRights {
    manifest: Manifest,
    nodes: FxHashSet<TypeId>,
    edges: FxHashSet<LabelId>,
    attributes: FxHashSet<(Carrier, AttributeId)>,
}

impl AgentRights {
    fn new(manifest: Manifest, schema: &Schema) -> Self {
        let types = || (0..schema.types().len() as u16).map(TypeId);
        let labels = || (0..schema.labels().len() as u16).map(LabelId);
        let carriers = || {
            types()
                .map(Carrier::Node)
                .chain(labels().map(Carrier::Edge))
        };
        let attributes = || (0..schema.attributes().len() as u16).map(AttributeId);
        let mut rights = Self {
            manifest,
            nodes: FxHashSet::default(),
            edges: FxHashSet::default(),
            attributes: FxHashSet::default(),
        };
        rights.nodes = types().filter(|&t| rights.gives_type(schema, t)).collect();
        rights.edges = labels()
            .filter(|&l| rights.gives_label(schema, l))
            .collect();
        let pairs = carriers().flat_map(|c| attributes().map(move |a| (c, a)));
        rights.attributes = pairs
            .filter(|&(c, a)| rights.gives_attribute(schema, c, a))
            .collect();
        rights
    }

    fn gives_type(&self, schema: &Schema, type_id: TypeId) -> bool {
        self.manifest
            .gives_nodes(|name| is_of(schema, type_id, name))
    }

    fn gives_label(&self, schema: &Schema, label: LabelId) -> bool {
        self.manifest.gives_edges(schema.label_name(label))
    }

    fn gives_attribute(&self, schema: &Schema, carrier: Carrier, attribute: AttributeId) -> bool {
        let name = schema.attribute_name(attribute);
        let is_a = |owner: &str| match carrier {
            Carrier::Node(type_id) => is_of(schema, type_id, owner),
            Carrier::Edge(label) => owner == schema.label_name(label),
        };
        self.manifest.gives_attribute(is_a, name)
    }

    fn refused(&self, what: &str) -> Refusal {
        let agent = &self.manifest.agent;
        Refusal::NotAllowed(format!(
            "the manifest of `{agent}` gives no right to {what}"
        ))
    }

    /// Whether the agent may create, delete and retype nodes of that type.
    pub(crate) fn node(&self, schema: &Schema, type_id: TypeId) -> Result<(), Refusal> {
        // The names of an open schema come as they are used.
        if self.nodes.contains(&type_id) || self.gives_type(schema, type_id) {
            return Ok(());
        }
        let name = schema.type_name(type_id);
        Err(self.refused(&format!("create, delete or retype nodes of type `{name}`")))
    }

    /// Whether the agent may create and delete edges of that label.
    pub(crate) fn edge(&self, schema: &Schema, label: LabelId) -> Result<(), Refusal> {
        if self.edges.contains(&label) || self.gives_label(schema, label) {
            return Ok(());
        }
        let name = schema.label_name(label);
        Err(self.refused(&format!("create or delete edges `{name}`")))
    }

    /// Whether the agent may set and remove that attribute there.
    pub(crate) fn attribute(
        &self,
        schema: &Schema,
        carrier: Carrier,
        attribute: AttributeId,
    ) -> Result<(), Refusal> {
        if self.attributes.contains(&(carrier, attribute))
            || self.gives_attribute(schema, carrier, attribute)
        {
            return Ok(());
        }
        let owner = match carrier {
            Carrier::Node(type_id) => schema.type_name(type_id),
            Carrier::Edge(label) => schema.label_name(label),
        };
        let name = schema.attribute_name(attribute);
        Err(self.refused(&format!("write the attribute `{owner}.{name}`")))
    }

    /// Whether the agent may apply the rule, which the grammar gives to `actor`.
    pub(crate) fn rule(&self, rule: &str, actor: Option<&str>) -> Result<(), Refusal> {
        if self.manifest.gives_rule(rule, actor) {
            return Ok(());
        }
        Err(self.refused(&format!("apply the rule `{rule}`")))
    }
}

/// Whether the type is the one that a manifest names, or a subtype of it.
fn is_of(schema: &Schema, type_id: TypeId, name: &str) -> bool {
    schema
        .find_type(name)
        .is_some_and(|general| schema.is_subtype(type_id, general))
}

#[cfg(test)]
mod tests;
