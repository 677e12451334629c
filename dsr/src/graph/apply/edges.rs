//! What a commit under way does to edges. It guarantees that both ends of an edge, the edges of its
//! label and the counts per (label, type, type) agree on which there are.

use super::{Work, read, touch};
use crate::arena::record::{self, EdgeRecord};
use crate::arena::table::Table;
use crate::arena::{Address, tree};
use crate::rights::Carrier;
use crate::{EdgeKey, EdgeRef, LabelId, NodeId, Refusal, Touch, TypeId, Value};

impl Work<'_> {
    pub(super) fn find_edge(&self, edge: &EdgeRef) -> Result<Option<(EdgeKey, Address)>, Refusal> {
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

    pub(super) fn edge(&self, edge: &EdgeRef) -> Result<(EdgeKey, Address, EdgeRecord), Refusal> {
        let (key, address) = self
            .find_edge(edge)?
            .ok_or_else(|| Refusal::NotFound(format!("edge {edge}")))?;
        let record = read(EdgeRecord::read(&self.graph.writer.arena, address))?;
        Ok((key, address, record))
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
            Some((_, address)) => read(EdgeRecord::read(&self.graph.writer.arena, address))?,
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
        touch(&mut self.edges, key, (), how, None);
        for (name, value) in attributes {
            let name = self.set_row(Carrier::Edge(label), &mut record.table, name, value)?;
            touch(&mut self.edges, key, (), Touch::Updated, Some(name));
        }
        self.put_edge(key, existing.map(|(_, address)| (address, len)), &record)?;
        if existing.is_none() {
            let (address, mut to) = self.node(&key.to.into())?;
            let into = [u64::from(label.0), key.from.0];
            let into = tree::insert(&mut self.graph.writer, to.into, into, 0);
            to.into = self.room(into)?;
            let len = to.len();
            self.put_node(Some((address, len)), &to)?;
            let directory = self.root.labels;
            self.root.labels = self.index(directory, label.0, [key.from.0, key.to.0], true)?;
            self.root.edge_count += 1;
            self.count_triple(label, [from.type_id, to.type_id], true)?;
        }
        Ok(())
    }

    /// Writes an edge's record and hangs it on its source.
    pub(super) fn put_edge(
        &mut self,
        key: EdgeKey,
        old: Option<(Address, usize)>,
        record: &EdgeRecord,
    ) -> Result<(), Refusal> {
        let put = self.graph.writer.put(old, |words| record.encode(words));
        let put = self.room(put)?;
        if old.is_some_and(|(address, _)| address == put) {
            return Ok(());
        }
        let (address, mut from) = self.node(&key.from.into())?;
        let out = [u64::from(key.label.0), key.to.0];
        let out = tree::insert(&mut self.graph.writer, from.out, out, put);
        from.out = self.room(out)?;
        let len = from.len();
        self.put_node(Some((address, len)), &from)
    }

    pub(super) fn delete_edge(&mut self, key: EdgeKey) -> Result<(), Refusal> {
        let label = u64::from(key.label.0);
        let (address, mut from) = self.node(&key.from.into())?;
        let from_type = from.type_id;
        let found = tree::find(&self.graph.writer.arena, from.out, [label, key.to.0]);
        if let Some(edge) = read(found)? {
            let record = read(EdgeRecord::read(&self.graph.writer.arena, edge))?;
            for address in record.table.blocks() {
                self.retire_attribute(address);
            }
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
        self.root.labels = self.index(directory, key.label.0, [key.from.0, key.to.0], false)?;
        self.root.edge_count -= 1;
        self.count_triple(key.label, [from_type, to.type_id], false)?;
        touch(&mut self.edges, key, (), Touch::Deleted, None);
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
