//! What a commit under way does to nodes. It guarantees that a node, its name, the members of its type
//! and the edges that touch it never disagree.

use super::{Work, damaged, read};
use crate::arena::record::{self, NodeInPlace, NodeRecord};
use crate::arena::table::Table;
use crate::arena::{Address, cells, late, tree, trie};
use crate::graph::Writer;
use crate::rights::Carrier;
use crate::value::hash;
use crate::{AttributeId, NodeId, NodeRef, Refusal, SchemaError, Touch, TypeId, Value};

impl Work<'_> {
    pub(super) fn find(&self, node: &NodeRef) -> Result<Option<NodeId>, Refusal> {
        match node {
            NodeRef::Id(id) => {
                let found = late::find(&self.graph.writer.arena, &self.root, id.0);
                Ok(read(found)?.map(|_| *id))
            }
            NodeRef::Name(name) => {
                let snapshot = self.snapshot();
                let found = snapshot.find_node_by_name(name);
                Ok(found.map_err(damaged)?.map(|node| node.id()))
            }
        }
    }

    pub(super) fn node(&self, node: &NodeRef) -> Result<(Address, NodeRecord), Refusal> {
        let address = self.address(node)?;
        let record = NodeRecord::read(&self.graph.writer.arena, address);
        Ok((address, read(record)?))
    }

    /// Where a node's record lies.
    pub(super) fn address(&self, node: &NodeRef) -> Result<Address, Refusal> {
        let id = match node {
            NodeRef::Id(id) => *id,
            NodeRef::Name(_) => self
                .find(node)?
                .ok_or_else(|| Refusal::NotFound(node.to_string()))?,
        };
        let Writer { arena, moved, .. } = &self.graph.writer;
        // The cells do not know what this commit did.
        if moved.is_empty()
            && let Some((address, _)) = cells::find(arena, &self.root, id.0)
        {
            return Ok(address);
        }
        read(late::find(arena, &self.root, id.0))?
            .ok_or_else(|| Refusal::NotFound(node.to_string()))
    }

    pub(super) fn put_node(
        &mut self,
        old: Option<(Address, usize)>,
        node: &NodeRecord,
    ) -> Result<(), Refusal> {
        let (since, writer) = (self.root.version, &mut self.graph.writer);
        // The trie leads there until the next commit.
        let seen = old.is_some_and(|(address, _)| !writer.is_own(address));
        let in_place_of = old.filter(|_| !seen);
        let put = writer.put(in_place_of, |words| node.encode(since, words));
        let new = self.room(put)?;
        match old {
            Some((old, _)) if old == new => Ok(()),
            Some((old, _)) if seen || old == self.root.late_node => self.lead_late(node.id, new),
            _ => {
                self.graph.writer.moved.push((node.id, new));
                self.enter(node.id, new)
            }
        }
    }

    /// Leads to the record at `new` of a node that was there before this commit: the cell does and the root,
    /// and the trie in the next commit. Of several such nodes all but the last are entered now.
    pub(super) fn lead_late(&mut self, id: u64, new: Address) -> Result<(), Refusal> {
        self.graph.writer.moved.push((id, new));
        if self.late_id()? != Some(id) {
            self.enter_late_node()?;
        }
        self.root.late_node = new;
        Ok(())
    }

    fn late_id(&self) -> Result<Option<u64>, Refusal> {
        let late = read(late::node(&self.graph.writer.arena, &self.root))?;
        Ok(late.map(|(id, _)| id))
    }

    /// Enters into the trie the node that only the root leads to, and retires the record that the trie
    /// led to.
    pub(super) fn enter_late_node(&mut self) -> Result<(), Refusal> {
        let (Some(id), late) = (self.late_id()?, self.root.late_node) else {
            return Ok(());
        };
        self.root.late_node = 0;
        let writer = &mut self.graph.writer;
        if let Some(old) = read(trie::find(&writer.arena, self.root.nodes, id))? {
            let record = writer.arena.from(old).and_then(NodeInPlace::at);
            writer.retire(old, record.map_or(0, |record| record.len));
        }
        self.enter(id, late)
    }

    fn enter(&mut self, id: u64, record: Address) -> Result<(), Refusal> {
        let nodes = trie::insert(&mut self.graph.writer, self.root.nodes, id, record);
        self.root.nodes = self.room(nodes)?;
        Ok(())
    }

    pub(super) fn create_node(
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
        self.may(|rights, schema| rights.node(schema, type_id))?;
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
            version: self.stamp.record,
            out: 0,
            into: 0,
            table: Table::default(),
        };
        self.graph
            .effects
            .nodes
            .touch(id, type_id, Touch::Created, None);
        for (name, value) in attributes {
            let before = self.indexed_place(&node.table, name)?;
            let name = self.set_row(Carrier::Node(type_id), &mut node.table, name, value)?;
            self.index_value(name, id, before, value.place())?;
            self.graph
                .effects
                .nodes
                .touch(id, type_id, Touch::Updated, Some(name));
        }
        let blob = record::write_blob(&mut self.graph.writer, name.as_bytes());
        node.name = self.room(blob)?;
        cells::reach(&mut self.graph.writer, &mut self.root, id.0);
        self.put_node(None, &node)?;
        let names = tree::insert(
            &mut self.graph.writer,
            self.root.names,
            [hash(name), id.0],
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
        let word = member.then_some(0);
        self.root.types = self.index(directory, type_id.0, [id.0, 0], word)?;
        Ok(())
    }

    /// Adds `key` with a word to the tree that a directory keeps for `id`, or takes it out.
    pub(super) fn index(
        &mut self,
        directory: Address,
        id: u16,
        key: tree::Key,
        word: Option<u64>,
    ) -> Result<Address, Refusal> {
        let entry = record::directory_entry(&self.graph.writer.arena, directory, id);
        let (members, count) = read(entry)?;
        let writer = &mut self.graph.writer;
        let entry = match word {
            Some(word) => tree::insert(writer, members, key, word).map(|root| (root, count + 1)),
            None => tree::remove(writer, members, key).map(|root| (root, count.saturating_sub(1))),
        };
        let directory =
            entry.and_then(|entry| record::set_directory_entry(writer, directory, id, entry));
        self.room(directory)
    }

    pub(super) fn delete_node(&mut self, node: &NodeRef) -> Result<(), Refusal> {
        let (_, found) = self.node(node)?;
        self.may(|rights, schema| rights.node(schema, TypeId(found.type_id)))?;
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
        for (name, place) in node.table.iter() {
            let attribute = AttributeId(name);
            if self.schema().has_index(attribute) {
                let place = self.place_of(&node.table, place)?;
                self.index_value(attribute, id, place, None)?;
            }
        }
        for address in node.table.blocks() {
            self.retire_attribute(address);
        }
        if self.root.late_node == address {
            self.enter_late_node()?;
        }
        let name = read(record::read_blob(&self.graph.writer.arena, node.name))?;
        let hash = hash(&String::from_utf8_lossy(&name));
        let writer = &mut self.graph.writer;
        let words = record::blob_len(writer.arena(), node.name);
        writer.retire(node.name, words);
        writer.retire(address, node.len());
        writer.moved.push((id.0, 0));
        let nodes = trie::remove(writer, self.root.nodes, id.0);
        let names = tree::remove(writer, self.root.names, [hash, id.0]);
        self.root.nodes = self.room(nodes)?;
        self.root.names = self.room(names)?;
        self.index_type(TypeId(node.type_id), id, false)?;
        self.root.node_count -= 1;
        self.graph
            .effects
            .nodes
            .touch(id, TypeId(node.type_id), Touch::Deleted, None);
        Ok(())
    }

    pub(super) fn retype_node(&mut self, node: &NodeRef, type_name: &str) -> Result<(), Refusal> {
        let type_id = self.type_id(type_name)?;
        let (_, node) = self.node(node)?;
        let id = NodeId(node.id);
        if type_id.0 == node.type_id {
            return Ok(());
        }
        for kind in [TypeId(node.type_id), type_id] {
            self.may(|rights, schema| rights.node(schema, kind))?;
        }
        self.index_type(TypeId(node.type_id), id, false)?;
        self.index_type(type_id, id, true)?;
        self.retype_edges(id, node.type_id, type_id.0)?;
        // An edge from the node to itself has changed its record.
        let (address, mut node) = self.node(&id.into())?;
        let len = node.len();
        node.type_id = type_id.0;
        node.version = self.stamp.record;
        self.put_node(Some((address, len)), &node)?;
        self.graph
            .effects
            .nodes
            .touch(id, type_id, Touch::Replaced, None);
        Ok(())
    }

    /// Says of the node's edges at their other ends, in the index of their labels and in the counts
    /// that it is of another type.
    fn retype_edges(&mut self, id: NodeId, old: u16, new: u16) -> Result<(), Refusal> {
        let edges = {
            let snapshot = self.snapshot();
            let node = snapshot.find_node(id).map_err(damaged)?;
            let edges = node.iter().flat_map(|node| {
                let into = node
                    .in_edges()
                    .filter(|key| !matches!(key, Ok(key) if key.from == id));
                node.out_edges().chain(into)
            });
            edges.collect::<Result<Vec<_>, _>>().map_err(damaged)?
        };
        for key in edges {
            let other = if key.from == id { key.to } else { key.from };
            let other = if other == id {
                None
            } else {
                Some(self.node(&other.into())?.1.type_id)
            };
            let ends = |this: u16| match other {
                None => [this, this],
                Some(other) if key.from == id => [this, other],
                Some(other) => [other, this],
            };
            self.count_triple(key.label, ends(old), false)?;
            self.count_triple(key.label, ends(new), true)?;
            self.retype_ends(key, ends(new))?;
        }
        Ok(())
    }
}
