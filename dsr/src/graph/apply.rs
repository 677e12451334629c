//! One commit under way: applies operations to a working root that nobody else sees. It guarantees
//! that whatever refuses, the published version is untouched, for the caller only has to drop the
//! working root.

use super::Graph;
use super::image::{AttributeImage, Image};
use crate::arena::allocator::Full;
use crate::arena::record::{self, AttributeRecord, EdgeRecord, NodeRecord, row, split_row};
use crate::arena::{Address, Root, tree, trie};
use crate::snapshot::name_hash;
use crate::{
    AttributeId, AttributeType, Change, EdgeChange, EdgeKey, EdgeRef, LabelId, NodeChange, NodeId,
    NodeRef, Operation, Owner, Precondition, ReadError, Refusal, RuleApplication, Schema,
    SchemaError, Snapshot, Time, Touch, TypeId, Value, Version,
};
use std::collections::BTreeMap;
use std::sync::Arc;

impl From<SchemaError> for Refusal {
    fn from(error: SchemaError) -> Self {
        Self::SchemaViolation(error.to_string())
    }
}

/// What a commit has touched so far.
type Touched<K, V> = BTreeMap<K, (V, Touch, Vec<AttributeId>)>;

/// What a written attribute remembers.
#[derive(Debug, Clone, Copy)]
struct Stamp {
    version: u64,
    time: i64,
    writer: u16,
}

pub(super) struct Work<'a> {
    graph: &'a mut Graph,
    root: Root,
    agent: String,
    stamp: Stamp,
    schema_changed: bool,
    nodes: Touched<NodeId, TypeId>,
    edges: Touched<EdgeKey, ()>,
    created: Vec<NodeId>,
    rules: Vec<RuleApplication>,
}

fn touch<K: Ord, V>(
    touched: &mut Touched<K, V>,
    key: K,
    value: V,
    how: Touch,
    what: Option<AttributeId>,
) {
    match touched.entry(key) {
        std::collections::btree_map::Entry::Vacant(entry) => {
            entry.insert((value, how, what.into_iter().collect()));
        }
        std::collections::btree_map::Entry::Occupied(mut entry) => {
            let (known, before, attributes) = entry.get_mut();
            *known = value;
            // Made and changed is made; gone and made again is changed.
            *before = match (*before, how) {
                (Touch::Created, Touch::Updated) => Touch::Created,
                (Touch::Deleted, Touch::Created) => Touch::Updated,
                (_, later) => later,
            };
            if let Some(what) = what
                && !attributes.contains(&what)
            {
                attributes.push(what);
            }
        }
    }
}

impl<'a> Work<'a> {
    pub(super) fn new(graph: &'a mut Graph, agent: &str, time: Time) -> Result<Self, Refusal> {
        let mut root = graph.root;
        root.version += 1;
        root.time = time.nanoseconds();
        let writer = graph
            .writer_id(agent, &mut root)
            .map_err(|Full| graph.full())?;
        Ok(Self {
            graph,
            root,
            agent: agent.to_owned(),
            stamp: Stamp {
                version: root.version,
                time: root.time,
                writer,
            },
            schema_changed: false,
            nodes: BTreeMap::new(),
            edges: BTreeMap::new(),
            created: Vec::new(),
            rules: Vec::new(),
        })
    }

    /// The root of a graph that is what the image says.
    pub(super) fn restore(graph: &'a mut Graph, image: &Image) -> Result<Root, Refusal> {
        let (nodes, edges, writers) = image.parts();
        let (version, time, next_id) = image.stamp();
        let mut work = Self::new(graph, "store", time)?;
        for node in nodes {
            let type_name = work.schema().type_name(node.type_id).to_owned();
            work.create_node(Some(node.id), &type_name, &node.name, &[])?;
            work.restore_attributes(&Owner::Node(node.id.into()), &node.attributes)?;
        }
        for edge in edges {
            let label = work.schema().label_name(edge.key.label).to_owned();
            let key = EdgeRef {
                from: edge.key.from.into(),
                label,
                to: edge.key.to.into(),
            };
            work.create_edge(&key, &[])?;
            work.restore_attributes(&Owner::Edge(key), &edge.attributes)?;
        }
        let schema = work.graph.write_schema(&mut work.root);
        work.room(schema)?;
        let writers = work.graph.write_writers(writers.to_vec(), &mut work.root);
        work.room(writers)?;
        work.root.version = version.0;
        work.root.time = time.nanoseconds();
        work.root.next_id = next_id.max(work.root.next_id);
        Ok(work.root)
    }

    fn restore_attributes(
        &mut self,
        owner: &Owner,
        rows: &[AttributeImage],
    ) -> Result<(), Refusal> {
        for row in rows {
            self.stamp = Stamp {
                version: row.version,
                time: row.time,
                writer: row.writer,
            };
            let name = self.schema().attribute_name(row.name).to_owned();
            self.change_attribute(owner, &name, Some(&row.value))?;
        }
        Ok(())
    }

    fn snapshot(&self) -> Snapshot {
        self.graph.snapshot_of(self.root)
    }

    fn schema(&self) -> &Schema {
        &self.graph.schema
    }

    fn room<T>(&self, outcome: Result<T, Full>) -> Result<T, Refusal> {
        outcome.map_err(|Full| self.graph.full())
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
        let rows = match owner {
            Owner::Node(node) => self.node(node)?.1.rows,
            Owner::Edge(edge) => self.edge(edge)?.2.rows,
        };
        let address = rows
            .iter()
            .map(|&r| split_row(r))
            .find(|(a, _)| *a == attribute.0);
        address
            .map(|(_, at)| read(AttributeRecord::read(&self.graph.writer.arena, at)))
            .transpose()
            .map(|found| found.map(|record| record.value))
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
        self.rules.push(RuleApplication {
            rule: rule.to_owned(),
            binding,
        });
        self.apply(&operations)
    }

    // Names.

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
                };
                Ok(schema.add_attribute(attribute)?)
            }
            None => Ok(self.schema().attribute_id(name)?),
        }
    }

    // Nodes.

    fn find(&self, node: &NodeRef) -> Result<Option<NodeId>, Refusal> {
        let snapshot = self.snapshot();
        let found = match node {
            NodeRef::Id(id) => snapshot.find_node(*id),
            NodeRef::Name(name) => snapshot.find_node_by_name(name),
        };
        Ok(found.map_err(damaged)?.map(|node| node.id()))
    }

    fn node(&self, node: &NodeRef) -> Result<(Address, NodeRecord), Refusal> {
        let id = match node {
            NodeRef::Id(id) => *id,
            NodeRef::Name(_) => self
                .find(node)?
                .ok_or_else(|| Refusal::NotFound(node.to_string()))?,
        };
        let arena = &self.graph.writer.arena;
        let address = read(trie::find(arena, self.root.nodes, id.0))?
            .ok_or_else(|| Refusal::NotFound(node.to_string()))?;
        Ok((address, read(NodeRecord::read(arena, address))?))
    }

    fn put_node(
        &mut self,
        old: Option<(Address, usize)>,
        node: &NodeRecord,
    ) -> Result<(), Refusal> {
        let words = node.words();
        let writer = &mut self.graph.writer;
        let put = match old {
            Some((address, len)) => writer.replace(address, len, &words),
            None => writer.write(&words),
        };
        let put = put.and_then(|at| trie::insert(writer, self.root.nodes, node.id, at));
        self.root.nodes = self.room(put)?;
        Ok(())
    }

    fn create_node(
        &mut self,
        id: Option<NodeId>,
        type_name: &str,
        name: &str,
        attributes: &[(String, Value)],
    ) -> Result<(), Refusal> {
        if name.is_empty() || name.len() > 255 {
            return Err(SchemaError::BadName(name.to_owned()).into());
        }
        let type_id = self.type_id(type_name)?;
        let id = id.unwrap_or(NodeId(self.root.next_id));
        for taken in [NodeRef::Id(id), name.into()] {
            if self.find(&taken)?.is_some() {
                return Err(Refusal::AlreadyExists(taken.to_string()));
            }
        }
        if id.0 == u64::MAX {
            return Err(Refusal::SchemaViolation(format!(
                "{id} cannot be a node's id"
            )));
        }
        self.root.next_id = self.root.next_id.max(id.0 + 1);
        let mut node = NodeRecord {
            id: id.0,
            type_id: type_id.0,
            name: 0,
            version: self.stamp.version,
            out: 0,
            into: 0,
            rows: Vec::new(),
        };
        touch(&mut self.nodes, id, type_id, Touch::Created, None);
        for (name, value) in attributes {
            let name = self.set_row(&mut node.rows, name, value)?;
            touch(&mut self.nodes, id, type_id, Touch::Updated, Some(name));
        }
        let blob = record::write_blob(&mut self.graph.writer, name.as_bytes());
        node.name = self.room(blob)?;
        self.put_node(None, &node)?;
        let names = tree::insert(
            &mut self.graph.writer,
            self.root.names,
            [name_hash(name), id.0],
            0,
        );
        self.root.names = self.room(names)?;
        self.index_type(type_id, id, true)?;
        self.root.node_count += 1;
        self.created.push(id);
        Ok(())
    }

    /// Adds the node to, or takes it from, the members of its type.
    fn index_type(&mut self, type_id: TypeId, id: NodeId, member: bool) -> Result<(), Refusal> {
        let directory = self.root.types;
        self.root.types = self.index(directory, type_id.0, [id.0, 0], member)?;
        Ok(())
    }

    fn index(
        &mut self,
        directory: Address,
        id: u16,
        key: tree::Key,
        member: bool,
    ) -> Result<Address, Refusal> {
        let entry = record::directory_entry(&self.graph.writer.arena, directory, id);
        let (members, count) = read(entry)?;
        let writer = &mut self.graph.writer;
        let entry = if member {
            tree::insert(writer, members, key, 0).map(|root| (root, count + 1))
        } else {
            tree::remove(writer, members, key).map(|root| (root, count.saturating_sub(1)))
        };
        let directory =
            entry.and_then(|entry| record::set_directory_entry(writer, directory, id, entry));
        self.room(directory)
    }

    fn delete_node(&mut self, node: &NodeRef) -> Result<(), Refusal> {
        let (_, found) = self.node(node)?;
        let id = NodeId(found.id);
        let edges = {
            let snapshot = self.snapshot();
            let handle = snapshot.find_node(id).map_err(damaged)?;
            let handle = handle.ok_or_else(|| Refusal::NotFound(node.to_string()))?;
            let edges = handle.out_edges().chain(handle.in_edges());
            edges
                .collect::<Result<std::collections::BTreeSet<_>, _>>()
                .map_err(damaged)?
        };
        for edge in edges {
            self.delete_edge(edge)?;
        }
        let (address, node) = self.node(&id.into())?;
        for &row in &node.rows {
            self.retire_attribute(split_row(row).1);
        }
        let name = read(record::read_blob(&self.graph.writer.arena, node.name))?;
        let hash = name_hash(&String::from_utf8_lossy(&name));
        let writer = &mut self.graph.writer;
        let words = record::blob_len(writer.arena(), node.name);
        writer.retire(node.name, words);
        writer.retire(address, node.words().len());
        let nodes = trie::remove(writer, self.root.nodes, id.0);
        let names = tree::remove(writer, self.root.names, [hash, id.0]);
        self.root.nodes = self.room(nodes)?;
        self.root.names = self.room(names)?;
        self.index_type(TypeId(node.type_id), id, false)?;
        self.root.node_count -= 1;
        touch(
            &mut self.nodes,
            id,
            TypeId(node.type_id),
            Touch::Deleted,
            None,
        );
        Ok(())
    }

    fn retype_node(&mut self, node: &NodeRef, type_name: &str) -> Result<(), Refusal> {
        let type_id = self.type_id(type_name)?;
        let (address, mut node) = self.node(node)?;
        let id = NodeId(node.id);
        self.index_type(TypeId(node.type_id), id, false)?;
        self.index_type(type_id, id, true)?;
        let len = node.words().len();
        node.type_id = type_id.0;
        node.version = self.stamp.version;
        self.put_node(Some((address, len)), &node)?;
        touch(&mut self.nodes, id, type_id, Touch::Updated, None);
        Ok(())
    }

    // Edges.

    fn find_edge(&self, edge: &EdgeRef) -> Result<Option<(EdgeKey, Address)>, Refusal> {
        let Some(label) = self.schema().find_label(&edge.label) else {
            // An unknown label is a misspelling, unless names are free.
            return match self.schema().label_id(&edge.label) {
                Err(error) if !self.schema().is_open() => Err(error.into()),
                _ => Ok(None),
            };
        };
        let (Some(from), Some(to)) = (self.find(&edge.from)?, self.find(&edge.to)?) else {
            return Ok(None);
        };
        let out = self.node(&from.into())?.1.out;
        let found = tree::find(&self.graph.writer.arena, out, [u64::from(label.0), to.0]);
        Ok(read(found)?.map(|address| (EdgeKey { from, label, to }, address)))
    }

    fn edge(&self, edge: &EdgeRef) -> Result<(EdgeKey, Address, EdgeRecord), Refusal> {
        let (key, address) = self
            .find_edge(edge)?
            .ok_or_else(|| Refusal::NotFound(format!("edge {edge}")))?;
        let record = read(EdgeRecord::read(&self.graph.writer.arena, address))?;
        Ok((key, address, record))
    }

    fn create_edge(
        &mut self,
        edge: &EdgeRef,
        attributes: &[(String, Value)],
    ) -> Result<(), Refusal> {
        let label = self.label_id(&edge.label)?;
        let (_, from) = self.node(&edge.from)?;
        let (_, to) = self.node(&edge.to)?;
        self.schema()
            .check_ends(label, TypeId(from.type_id), TypeId(to.type_id))?;
        let key = EdgeKey {
            from: NodeId(from.id),
            label,
            to: NodeId(to.id),
        };
        let existing = self.find_edge(edge)?;
        let mut record = match existing {
            Some((_, address)) => read(EdgeRecord::read(&self.graph.writer.arena, address))?,
            None => EdgeRecord {
                from: from.id,
                to: to.id,
                label: label.0,
                version: 0,
                rows: vec![],
            },
        };
        let len = record.words().len();
        record.version = self.stamp.version;
        let how = if existing.is_some() {
            Touch::Updated
        } else {
            Touch::Created
        };
        touch(&mut self.edges, key, (), how, None);
        for (name, value) in attributes {
            let name = self.set_row(&mut record.rows, name, value)?;
            touch(&mut self.edges, key, (), Touch::Updated, Some(name));
        }
        self.put_edge(key, existing.map(|(_, address)| (address, len)), &record)?;
        if existing.is_none() {
            let (address, mut to) = self.node(&key.to.into())?;
            let into = [u64::from(label.0), key.from.0];
            let into = tree::insert(&mut self.graph.writer, to.into, into, 0);
            to.into = self.room(into)?;
            let len = to.words().len();
            self.put_node(Some((address, len)), &to)?;
            let directory = self.root.labels;
            self.root.labels = self.index(directory, label.0, [key.from.0, key.to.0], true)?;
            self.root.edge_count += 1;
        }
        Ok(())
    }

    /// Writes an edge's record and hangs it on its source.
    fn put_edge(
        &mut self,
        key: EdgeKey,
        old: Option<(Address, usize)>,
        record: &EdgeRecord,
    ) -> Result<(), Refusal> {
        let words = record.words();
        let put = match old {
            Some((address, len)) => self.graph.writer.replace(address, len, &words),
            None => self.graph.writer.write(&words),
        };
        let put = self.room(put)?;
        if old.is_some_and(|(address, _)| address == put) {
            return Ok(());
        }
        let (address, mut from) = self.node(&key.from.into())?;
        let out = [u64::from(key.label.0), key.to.0];
        let out = tree::insert(&mut self.graph.writer, from.out, out, put);
        from.out = self.room(out)?;
        let len = from.words().len();
        self.put_node(Some((address, len)), &from)
    }

    fn delete_edge(&mut self, key: EdgeKey) -> Result<(), Refusal> {
        let label = u64::from(key.label.0);
        let (address, mut from) = self.node(&key.from.into())?;
        let found = tree::find(&self.graph.writer.arena, from.out, [label, key.to.0]);
        if let Some(edge) = read(found)? {
            let record = read(EdgeRecord::read(&self.graph.writer.arena, edge))?;
            for &row in &record.rows {
                self.retire_attribute(split_row(row).1);
            }
            self.graph.writer.retire(edge, record.words().len());
        }
        let out = tree::remove(&mut self.graph.writer, from.out, [label, key.to.0]);
        from.out = self.room(out)?;
        let len = from.words().len();
        self.put_node(Some((address, len)), &from)?;
        let (address, mut to) = self.node(&key.to.into())?;
        let into = tree::remove(&mut self.graph.writer, to.into, [label, key.from.0]);
        to.into = self.room(into)?;
        let len = to.words().len();
        self.put_node(Some((address, len)), &to)?;
        let directory = self.root.labels;
        self.root.labels = self.index(directory, key.label.0, [key.from.0, key.to.0], false)?;
        self.root.edge_count -= 1;
        touch(&mut self.edges, key, (), Touch::Deleted, None);
        Ok(())
    }

    // Attributes.

    fn retire_attribute(&mut self, address: Address) {
        let words = AttributeRecord::len(&self.graph.writer.arena, address);
        self.graph.writer.retire(address, words);
    }

    /// Writes an attribute and enters it into a record's table.
    fn set_row(
        &mut self,
        rows: &mut Vec<u64>,
        name: &str,
        value: &Value,
    ) -> Result<AttributeId, Refusal> {
        let attribute = self.attribute_id(name)?;
        self.schema().check_value(attribute, value)?;
        let record = AttributeRecord {
            value: value.clone(),
            version: self.stamp.version,
            time: self.stamp.time,
            writer: self.stamp.writer,
        };
        let address = self.graph.writer.write(&record.words());
        let address = self.room(address)?;
        let at = rows.partition_point(|&r| split_row(r).0 < attribute.0);
        match rows.get(at).map(|&r| split_row(r)) {
            Some((found, old)) if found == attribute.0 => {
                self.retire_attribute(old);
                rows[at] = row(attribute.0, address);
            }
            _ => rows.insert(at, row(attribute.0, address)),
        }
        Ok(attribute)
    }

    fn change_attribute(
        &mut self,
        owner: &Owner,
        name: &str,
        value: Option<&Value>,
    ) -> Result<(), Refusal> {
        match owner {
            Owner::Node(node) => {
                let (address, mut record) = self.node(node)?;
                let len = record.words().len();
                let name = self.change_row(&mut record.rows, name, value)?;
                record.version = self.stamp.version;
                self.put_node(Some((address, len)), &record)?;
                let type_id = TypeId(record.type_id);
                touch(
                    &mut self.nodes,
                    NodeId(record.id),
                    type_id,
                    Touch::Updated,
                    Some(name),
                );
            }
            Owner::Edge(edge) => {
                let (key, address, mut record) = self.edge(edge)?;
                let len = record.words().len();
                let name = self.change_row(&mut record.rows, name, value)?;
                record.version = self.stamp.version;
                self.put_edge(key, Some((address, len)), &record)?;
                touch(&mut self.edges, key, (), Touch::Updated, Some(name));
            }
        }
        Ok(())
    }

    fn change_row(
        &mut self,
        rows: &mut Vec<u64>,
        name: &str,
        value: Option<&Value>,
    ) -> Result<AttributeId, Refusal> {
        let Some(value) = value else {
            let attribute = self.attribute_id(name)?;
            if let Some(at) = rows.iter().position(|&r| split_row(r).0 == attribute.0) {
                self.retire_attribute(split_row(rows.remove(at)).1);
            }
            return Ok(attribute);
        };
        self.set_row(rows, name, value)
    }

    pub(super) fn finish(mut self) -> Result<(Root, Vec<NodeId>, Change), Refusal> {
        if self.schema_changed {
            let written = self.graph.write_schema(&mut self.root);
            self.room(written)?;
        }
        let change = Change {
            epoch: self.graph.epoch,
            version: Version(self.root.version),
            time: self.root.time(),
            agent: self.agent,
            rules: self.rules,
            nodes: self
                .nodes
                .into_iter()
                .map(|(node, (type_id, touch, attributes))| NodeChange {
                    node,
                    type_id,
                    touch,
                    attributes,
                })
                .collect(),
            edges: self
                .edges
                .into_iter()
                .map(|(edge, ((), touch, attributes))| EdgeChange {
                    edge,
                    touch,
                    attributes,
                })
                .collect(),
        };
        Ok((self.root, self.created, change))
    }
}

/// The writer reads its own memory: an impossible place there is a damaged arena.
fn read<T>(outcome: Result<T, Address>) -> Result<T, Refusal> {
    outcome.map_err(|address| damaged(ReadError::Damaged { address }))
}

fn damaged(error: ReadError) -> Refusal {
    Refusal::Malformed(error.to_string())
}
