//! One commit under way: applies operations to a working root that nobody else sees. It guarantees
//! that whatever refuses, the published version is untouched, for the caller only has to drop the
//! working root.

mod attributes;
mod edges;
mod nodes;
mod touched;

use super::image::{AttributeImage, Image};
use super::{Graph, TransactionId};
use crate::arena::allocator::Full;
use crate::arena::record;
use crate::arena::{Address, Root};
use crate::rights::AgentRights;
use crate::{
    AttributeId, AttributeType, Commit, EdgeRef, LabelId, NodeId, NodeRef, Operation, Owner,
    Precondition, ReadError, Refusal, RuleApplication, Schema, SchemaError, Snapshot, Time, Touch,
    TypeId, Value, Version,
};
use std::sync::Arc;
pub(super) use touched::Effects;

/// The name that the store itself commits under, which no agent may use.
pub(crate) const STORE: &str = "store";

impl From<SchemaError> for Refusal {
    fn from(error: SchemaError) -> Self {
        Self::SchemaViolation(error.to_string())
    }
}

/// What a written attribute remembers.
#[derive(Debug, Clone, Copy, Default)]
struct Stamp {
    /// Of the node or edge.
    record: u64,
    /// Of the attribute.
    version: u64,
    time: i64,
    writer: u16,
}

/// A commit under way.
pub(super) struct Work<'a> {
    pub(super) graph: &'a mut Graph,
    pub(super) root: Root,
    /// The client whose last transaction this commit forgets.
    pub(super) forgotten: Option<u64>,
    stamp: Stamp,
    schema_changed: bool,
    created: Vec<NodeId>,
    /// What the agent may do; `None` where it may do everything.
    rights: Option<Arc<AgentRights>>,
    /// The operations are a rule's, which the agent may apply whatever it does.
    by_rule: bool,
}

impl<'a> Work<'a> {
    #[inline]
    pub(super) fn new(graph: &'a mut Graph, agent: &str, time: Time) -> Result<Self, Refusal> {
        let rights = match &graph.rights {
            Some(rights) if agent != STORE => Some(rights.of(agent)?),
            _ => None,
        };
        let mut work = Self::begin(graph)?;
        work.rights = rights;
        work.root.time = time.nanoseconds();
        let Self { graph, root, .. } = &mut work;
        graph.effects.clear();
        let writer = graph.writer_id(agent, root);
        let writer = writer.map_err(|Full| graph.full())?;
        root.agent = u64::from(writer) + 1;
        let rules = std::mem::take(&mut root.rules);
        if rules != 0 {
            // They are those of the version before.
            let words = record::blob_len(&graph.writer.arena, rules);
            graph.writer.retire(rules, words);
        }
        work.stamp = Stamp {
            record: root.version,
            version: root.version,
            time: root.time,
            writer,
        };
        Ok(work)
    }

    /// A commit after the newest version, in which trees have what there only the root leads to.
    #[inline]
    fn begin(graph: &'a mut Graph) -> Result<Self, Refusal> {
        let root = graph.prepared.take().unwrap_or(Root {
            version: graph.root.version + 1,
            ..graph.root
        });
        let mut work = Self {
            graph,
            root,
            forgotten: None,
            stamp: Stamp::default(),
            schema_changed: false,
            created: Vec::new(),
            rights: None,
            by_rule: false,
        };
        work.enter_late_node()?;
        work.enter_late_answer()?;
        Ok(work)
    }

    /// Does of the next commit what does not depend on what it will be.
    pub(super) fn prepare(graph: &'a mut Graph) -> Result<(), Refusal> {
        let Self { graph, root, .. } = Self::begin(graph)?;
        graph.prepared = Some(root);
        Ok(())
    }

    /// The root of a graph that is what the image says.
    pub(super) fn restore(graph: &'a mut Graph, image: &Image) -> Result<Root, Refusal> {
        let (frame, names) = (&image.frame, &image.schema);
        let mut work = Self::new(graph, STORE, frame.time)?;
        for node in &image.nodes {
            let type_name = names.type_name(node.type_id);
            work.stamp.record = node.version;
            work.create_node(Some(node.id), type_name, &node.name, &[])?;
            work.restore_attributes(names, &Owner::Node(node.id.into()), &node.attributes)?;
        }
        for edge in &image.edges {
            let key = EdgeRef {
                from: edge.key.from.into(),
                label: names.label_name(edge.key.label).to_owned(),
                to: edge.key.to.into(),
            };
            work.stamp.record = edge.version;
            work.create_edge(&key, &[])?;
            work.restore_attributes(names, &Owner::Edge(key), &edge.attributes)?;
        }
        let schema = work.graph.write_schema(&mut work.root);
        work.room(schema)?;
        let writers = frame.writers.clone();
        let writers = work.graph.write_writers(writers, &mut work.root);
        work.room(writers)?;
        for answered in &frame.answered {
            work.remember(answered.id, &answered.commit)?;
        }
        work.root.lineage = frame.lineage;
        work.root.version = frame.version.0;
        work.root.time = frame.time.nanoseconds();
        // The image does not say who made its version.
        work.root.agent = 0;
        work.root.next_id = frame.next_id.max(work.root.next_id);
        Ok(work.root)
    }

    fn restore_attributes(
        &mut self,
        names: &Schema,
        owner: &Owner,
        rows: &[AttributeImage],
    ) -> Result<(), Refusal> {
        for row in rows {
            self.stamp = Stamp {
                record: self.stamp.record,
                version: row.version,
                time: row.time,
                writer: row.writer,
            };
            let name = names.attribute_name(row.name);
            self.change_attribute(owner, name, Some(&row.value))?;
        }
        Ok(())
    }

    fn snapshot(&self) -> Snapshot {
        self.graph.snapshot_of(self.root)
    }

    fn schema(&self) -> &Schema {
        &self.graph.schema
    }

    pub(super) fn room<T>(&self, outcome: Result<T, Full>) -> Result<T, Refusal> {
        outcome.map_err(|Full| self.graph.full())
    }

    /// Asks the agent's rights, where it acts by itself.
    pub(super) fn may(
        &self,
        ask: impl FnOnce(&AgentRights, &Schema) -> Result<(), Refusal>,
    ) -> Result<(), Refusal> {
        match &self.rights {
            Some(rights) if !self.by_rule => ask(rights, self.schema()),
            _ => Ok(()),
        }
    }

    pub(super) fn require(&self, preconditions: &[Precondition]) -> Result<(), Refusal> {
        let conflict = |what: String| Err(Refusal::Conflict(what));
        for precondition in preconditions {
            match precondition {
                Precondition::NodeUnchangedSince { node, version } => {
                    let changed = Version(self.node(node)?.1.version);
                    if changed > *version {
                        return conflict(format!("{node} changed in version {changed}"));
                    }
                }
                Precondition::NodeExists { node } => {
                    if self.find(node)?.is_none() {
                        return conflict(format!("{node} is gone"));
                    }
                }
                Precondition::EdgeExists { edge } => {
                    if self.find_edge(edge)?.is_none() {
                        return conflict(format!("{edge} is gone"));
                    }
                }
                Precondition::EdgeAbsent { edge } => {
                    if self.find_edge(edge)?.is_some() {
                        return conflict(format!("{edge} is there"));
                    }
                }
                Precondition::AttributeEquals { owner, name, value } => {
                    let found = self.value_of(owner, name)?;
                    if found != *value {
                        return conflict(format!("`{name}` of {owner} is {found:?}"));
                    }
                }
            }
        }
        Ok(())
    }

    fn value_of(&self, owner: &Owner, name: &str) -> Result<Option<Value>, Refusal> {
        let attribute = self.schema().attribute_id(name)?;
        let table = match owner {
            Owner::Node(node) => self.node(node)?.1.table,
            Owner::Edge(edge) => self.edge(edge)?.2.table,
        };
        let place = table.find(attribute.0);
        let record = place.map(|place| read(table.attribute(&self.graph.writer.arena, place)));
        Ok(record.transpose()?.map(|record| record.value))
    }

    pub(super) fn apply(&mut self, operations: &[Operation]) -> Result<(), Refusal> {
        operations
            .iter()
            .try_for_each(|operation| self.apply_one(operation))
    }

    fn apply_one(&mut self, operation: &Operation) -> Result<(), Refusal> {
        match operation {
            Operation::CreateNode {
                id,
                type_name,
                name,
                attributes,
            } => self.create_node(*id, type_name, name, attributes),
            Operation::DeleteNode { node } => self.delete_node(node),
            Operation::RetypeNode { node, type_name } => self.retype_node(node, type_name),
            Operation::CreateEdge { edge, attributes } => self.create_edge(edge, attributes),
            Operation::DeleteEdge { edge } => {
                let (key, _, _) = self.edge(edge)?;
                self.may(|rights, schema| rights.edge(schema, key.label))?;
                self.delete_edge(key)
            }
            Operation::SetAttribute { owner, name, value } => {
                self.change_attribute(owner, name, Some(value))
            }
            Operation::RemoveAttribute { owner, name } => self.change_attribute(owner, name, None),
            Operation::ApplyRule { rule, binding } => self.apply_rule(rule, binding),
        }
    }

    fn apply_rule(&mut self, rule: &str, binding: &[(String, NodeRef)]) -> Result<(), Refusal> {
        let refused = |reason: &str| Refusal::RuleNotApplicable {
            rule: rule.to_owned(),
            reason: reason.to_owned(),
        };
        let rules = self
            .graph
            .rules
            .clone()
            .ok_or_else(|| refused("the graph has no grammar"))?;
        self.may(|rights, _| rights.rule(rule, rules.actor(rule)))?;
        let binding = binding
            .iter()
            .map(|(variable, node)| Ok((variable.clone(), self.node(node)?.1.id)))
            .map(|bound: Result<_, Refusal>| bound.map(|(variable, id)| (variable, NodeId(id))))
            .collect::<Result<Vec<_>, Refusal>>()?;
        let operations = rules.expand(&self.snapshot(), rule, &binding)?;
        if operations
            .iter()
            .any(|o| matches!(o, Operation::ApplyRule { .. }))
        {
            return Err(refused("a rule cannot apply rules"));
        }
        self.graph.effects.rules.push(RuleApplication {
            rule: rule.to_owned(),
            binding,
        });
        self.by_rule = true;
        let applied = self.apply(&operations);
        self.by_rule = false;
        applied
    }

    /// Whether the edges of nodes that were given another type still join what they may.
    fn check_retyped(&self) -> Result<(), Refusal> {
        let is_retyped = |how: Touch| how == Touch::Replaced;
        let nodes = &self.graph.effects.nodes;
        if !nodes.iter().any(|(_, (_, how, _))| is_retyped(*how)) {
            return Ok(());
        }
        let retyped = nodes.iter().filter(|(_, (_, how, _))| is_retyped(*how));
        let snapshot = self.snapshot();
        for (id, _) in retyped {
            let Some(node) = snapshot.find_node(*id).map_err(damaged)? else {
                continue;
            };
            for key in node.out_edges().chain(node.in_edges()) {
                let key = key.map_err(damaged)?;
                let kind = |id: NodeId| self.node(&id.into()).map(|(_, node)| TypeId(node.type_id));
                let (from, to) = (kind(key.from)?, kind(key.to)?);
                self.schema().check_ends(key.label, from, to)?;
            }
        }
        Ok(())
    }

    fn open_schema(&mut self) -> Option<&mut Schema> {
        if !self.graph.schema.is_open() {
            return None;
        }
        self.schema_changed = true;
        Some(Arc::make_mut(&mut self.graph.schema))
    }

    fn type_id(&mut self, name: &str) -> Result<TypeId, Refusal> {
        if let Some(id) = self.schema().find_type(name) {
            return Ok(id);
        }
        match self.open_schema() {
            Some(schema) => Ok(schema.add_type(name, &[])?),
            None => Ok(self.schema().type_id(name)?),
        }
    }

    fn label_id(&mut self, name: &str) -> Result<LabelId, Refusal> {
        if let Some(id) = self.schema().find_label(name) {
            return Ok(id);
        }
        match self.open_schema() {
            Some(schema) => Ok(schema.add_label(name, &[], &[])?),
            None => Ok(self.schema().label_id(name)?),
        }
    }

    fn attribute_id(&mut self, name: &str) -> Result<AttributeId, Refusal> {
        if let Some(id) = self.schema().find_attribute(name) {
            return Ok(id);
        }
        match self.open_schema() {
            Some(schema) => {
                let name = name.to_owned();
                let attribute = AttributeType {
                    name,
                    kind: None,
                    unit: None,
                    min: None,
                    max: None,
                    index: false,
                    history: 0,
                    hot: None,
                    large: None,
                };
                Ok(schema.add_attribute(attribute)?)
            }
            None => Ok(self.schema().attribute_id(name)?),
        }
    }

    /// Writes what comes after all operations, and tells what the commit will be once it is published.
    pub(super) fn finish(&mut self, id: Option<TransactionId>) -> Result<Commit, Refusal> {
        self.check_retyped()?;
        if self.schema_changed {
            let written = self.graph.write_schema(&mut self.root);
            self.room(written)?;
        }
        let rules = &self.graph.effects.rules;
        if !rules.is_empty() {
            // Encoding to memory cannot fail for these types; readers refuse an empty blob.
            let bytes = postcard::to_stdvec(rules).unwrap_or_default();
            let written = record::write_blob(&mut self.graph.writer, &bytes);
            self.root.rules = self.room(written)?;
        }
        let commit = Commit {
            version: Version(self.root.version),
            time: self.root.time(),
            created: std::mem::take(&mut self.created),
            durable: false,
        };
        if let Some(id) = id {
            self.remember(id, &commit)?;
        }
        Ok(commit)
    }

    /// Shows the version to everybody; `id` is what [`Self::finish`] got.
    pub(super) fn publish(self, id: Option<TransactionId>) {
        let (graph, root) = (self.graph, &self.root);
        graph.publish(root);
        if let Some(id) = id {
            graph.clients.insert(id.client, root.version);
        }
        if let Some(client) = self.forgotten {
            graph.clients.remove(&client);
        }
        graph.is_settled = false;
    }
}

/// The writer reads its own memory: an impossible place there is a damaged arena.
pub(super) fn read<T>(outcome: Result<T, Address>) -> Result<T, Refusal> {
    outcome.map_err(|address| damaged(ReadError::Damaged { address }))
}

fn damaged(error: ReadError) -> Refusal {
    Refusal::Malformed(error.to_string())
}
