//! What a commit under way does to edges. It guarantees that both ends of an edge, the edges of its
//! label and the counts per (label, type, type) agree on which there are.

use super::{Work, read};
use crate::arena::record::{self, EdgeRecord};
use crate::arena::table::Table;
use crate::arena::tree;
use crate::rights::Carrier;
use crate::{EdgeKey, EdgeRef, LabelId, NodeId, Refusal, Touch, TypeId, Value};

impl Work<'_> {
    /// The edge's key, and what its source keeps of it.
    pub(super) fn find_edge(&self, edge: &EdgeRef) -> Result<Option<(EdgeKey, u64)>, Refusal> {
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
        Ok(read(found)?.map(|end| (EdgeKey { from, label, to }, end)))
    }

    pub(super) fn edge(&self, edge: &EdgeRef) -> Result<(EdgeKey, u64, EdgeRecord), Refusal> {
        let (key, end) = self
            .find_edge(edge)?
            .ok_or_else(|| Refusal::NotFound(format!("edge {edge}")))?;
        Ok((key, end, self.edge_record(end)?))
    }

    fn edge_record(&self, end: u64) -> Result<EdgeRecord, Refusal> {
        let arena = &self.graph.writer.arena;
        read(EdgeRecord::read(arena, record::edge_of(end)))
    }

    pub(super) fn create_edge(
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
            Some((_, end)) => self.edge_record(end)?,
            None => EdgeRecord {
                from: from.id,
                to: to.id,
                label: label.0,
                version: 0,
                table: Table::default(),
            },
        };
        if existing.is_none() {
            self.may(|rights, schema| rights.edge(schema, label))?;
        }
        let len = record.len();
        record.version = self.stamp.record;
        let how = if existing.is_some() {
            Touch::Updated
        } else {
            Touch::Created
        };
        self.graph.effects.edges.touch(key, (), how, None);
        for (name, value) in attributes {
            let name = self.set_row(Carrier::Edge(label), &mut record.table, name, value)?;
            self.graph
                .effects
                .edges
                .touch(key, (), Touch::Updated, Some(name));
        }
        let end = existing.map_or(record::end(to.type_id, 0), |(_, end)| end);
        self.put_edge(key, (end, len), &record)?;
        if existing.is_none() {
            let (address, mut to) = self.node(&key.to.into())?;
            let into = [u64::from(label.0), key.from.0];
            let end = record::end(from.type_id, 0);
            let into = tree::insert(&mut self.graph.writer, to.into, into, end);
            to.into = self.room(into)?;
            let len = to.len();
            self.put_node(Some((address, len)), &to)?;
            let directory = self.root.labels;
            let types = [from.type_id, to.type_id];
            let ends = Some(record::ends(types));
            self.root.labels = self.index(directory, label.0, [key.from.0, key.to.0], ends)?;
            self.root.edge_count += 1;
            self.count_triple(label, types, true)?;
        }
        Ok(())
    }

    /// Writes an edge's record and hangs it on its source, which keeps `end` of it until now; the
    /// record that this leads to, if any, has `len` words.
    pub(super) fn put_edge(
        &mut self,
        key: EdgeKey,
        (end, len): (u64, usize),
        record: &EdgeRecord,
    ) -> Result<(), Refusal> {
        let old = Some((record::edge_of(end), len)).filter(|(address, _)| *address != 0);
        let put = self.graph.writer.put(old, |words| record.encode(words));
        let put = self.room(put)?;
        if old.is_some_and(|(address, _)| address == put) {
            return Ok(());
        }
        let (address, mut from) = self.node(&key.from.into())?;
        let out = [u64::from(key.label.0), key.to.0];
        let end = record::end(record::other_type(end), put);
        let out = tree::insert(&mut self.graph.writer, from.out, out, end);
        from.out = self.room(out)?;
        let len = from.len();
        self.put_node(Some((address, len)), &from)
    }

    pub(super) fn delete_edge(&mut self, key: EdgeKey) -> Result<(), Refusal> {
        let label = u64::from(key.label.0);
        let (address, mut from) = self.node(&key.from.into())?;
        let from_type = from.type_id;
        let found = tree::find(&self.graph.writer.arena, from.out, [label, key.to.0]);
        if let Some(end) = read(found)? {
            let record = self.edge_record(end)?;
            for address in record.table.blocks() {
                self.retire_attribute(address);
            }
            let edge = record::edge_of(end);
            self.graph.writer.retire(edge, record.len());
        }
        let out = tree::remove(&mut self.graph.writer, from.out, [label, key.to.0]);
        from.out = self.room(out)?;
        let len = from.len();
        self.put_node(Some((address, len)), &from)?;
        let (address, mut to) = self.node(&key.to.into())?;
        let into = tree::remove(&mut self.graph.writer, to.into, [label, key.from.0]);
        to.into = self.room(into)?;
        let len = to.len();
        self.put_node(Some((address, len)), &to)?;
        let directory = self.root.labels;
        self.root.labels = self.index(directory, key.label.0, [key.from.0, key.to.0], None)?;
        self.root.edge_count -= 1;
        self.count_triple(key.label, [from_type, to.type_id], false)?;
        self.graph
            .effects
            .edges
            .touch(key, (), Touch::Deleted, None);
        Ok(())
    }

    /// Writes anew which types an edge's source and target are of, wherever the edge is kept.
    pub(super) fn retype_ends(&mut self, key: EdgeKey, types: [u16; 2]) -> Result<(), Refusal> {
        let EdgeKey { from, label, to } = key;
        let (address, mut source) = self.node(&from.into())?;
        let out = [u64::from(label.0), to.0];
        let arena = &self.graph.writer.arena;
        let edge = read(tree::find(arena, source.out, out))?.map_or(0, record::edge_of);
        let end = record::end(types[1], edge);
        let out = tree::insert(&mut self.graph.writer, source.out, out, end);
        source.out = self.room(out)?;
        let len = source.len();
        self.put_node(Some((address, len)), &source)?;
        let (address, mut target) = self.node(&to.into())?;
        let into = [u64::from(label.0), from.0];
        let end = record::end(types[0], 0);
        let into = tree::insert(&mut self.graph.writer, target.into, into, end);
        target.into = self.room(into)?;
        let len = target.len();
        self.put_node(Some((address, len)), &target)?;
        let (members, count) = read(record::directory_entry(
            &self.graph.writer.arena,
            self.root.labels,
            label.0,
        ))?;
        let writer = &mut self.graph.writer;
        let members = tree::insert(writer, members, [from.0, to.0], record::ends(types));
        let directory = members.and_then(|members| {
            record::set_directory_entry(writer, self.root.labels, label.0, (members, count))
        });
        self.root.labels = self.room(directory)?;
        Ok(())
    }

    /// Counts an edge of these types more, or less.
    pub(super) fn count_triple(
        &mut self,
        label: LabelId,
        [from, to]: [u16; 2],
        more: bool,
    ) -> Result<(), Refusal> {
        let key = record::triple(label.0, from, to);
        let triples = self.root.triples;
        let writer = &mut self.graph.writer;
        let count = read(tree::find(writer.arena(), triples, key))?.unwrap_or(0);
        let triples = match if more {
            count + 1
        } else {
            count.saturating_sub(1)
        } {
            0 => tree::remove(writer, triples, key),
            count => tree::insert(writer, triples, key, count),
        };
        self.root.triples = self.room(triples)?;
        Ok(())
    }
}
