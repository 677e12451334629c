//! What a commit under way does to attributes. It guarantees that each written one passes the schema and
//! remembers version, time and writer, and that indices have what the nodes have.

use super::{Work, read, touch};
use crate::arena::Address;
use crate::arena::record::{AttributeRecord, row, split_row};
use crate::{AttributeId, NodeId, Owner, Refusal, Touch, TypeId, Value};

impl Work<'_> {
    /// Retires an attribute with its history.
    pub(super) fn retire_attribute(&mut self, address: Address) {
        let (mut count, mut older) = self.older(address);
        self.retire_record(address);
        while count > 0 {
            count -= 1;
            let next = self.older(older).1;
            self.retire_record(older);
            older = next;
        }
    }

    fn older(&self, address: Address) -> (u16, Address) {
        AttributeRecord::older(&self.graph.writer.arena, address).unwrap_or_default()
    }

    fn retire_record(&mut self, address: Address) {
        let words = AttributeRecord::len(&self.graph.writer.arena, address);
        self.graph.writer.retire(address, words);
    }

    /// What the next record of an attribute leads to when it takes the place of the one at `old`: the
    /// old one stays as history, and the oldest makes room for it.
    fn next_older(&mut self, old: Address, limit: usize) -> (u16, Address) {
        let (count, newest) = self.older(old);
        let version = AttributeRecord::version(&self.graph.writer.arena, old);
        if version == Some(self.stamp.version) {
            // Nobody ever saw it.
            self.retire_record(old);
            return (count, newest);
        }
        if usize::from(count) + 1 < limit {
            return (count + 1, old);
        }
        let oldest = (0..count).fold(old, |address, _| self.older(address).1);
        if oldest != old {
            self.retire_record(oldest);
        }
        (count, old)
    }

    /// The place in its index of an attribute in a node's table, where it has one.
    pub(super) fn indexed_place(&self, rows: &[u64], name: &str) -> Result<Option<u64>, Refusal> {
        let attribute = self.schema().find_attribute(name);
        let Some(attribute) = attribute.filter(|&found| self.schema().has_index(found)) else {
            return Ok(None);
        };
        let row = rows.iter().find(|&&row| split_row(row).0 == attribute.0);
        row.map_or(Ok(None), |&row| self.place_of(row))
    }

    /// The place of a row's value in an index.
    pub(super) fn place_of(&self, row: u64) -> Result<Option<u64>, Refusal> {
        let record = AttributeRecord::read(&self.graph.writer.arena, split_row(row).1);
        Ok(read(record)?.value.place())
    }

    /// Moves a node in the index of an attribute, if that has one.
    pub(super) fn index_value(
        &mut self,
        attribute: AttributeId,
        id: NodeId,
        before: Option<u64>,
        after: Option<u64>,
    ) -> Result<(), Refusal> {
        if before == after || !self.schema().has_index(attribute) {
            return Ok(());
        }
        for (place, member) in [(before, false), (after, true)] {
            if let Some(place) = place {
                let directory = self.root.values;
                self.root.values = self.index(directory, attribute.0, [place, id.0], member)?;
            }
        }
        Ok(())
    }

    /// Writes an attribute and enters it into a record's table.
    pub(super) fn set_row(
        &mut self,
        rows: &mut Vec<u64>,
        name: &str,
        value: &Value,
    ) -> Result<AttributeId, Refusal> {
        let attribute = self.attribute_id(name)?;
        self.schema().check_value(attribute, value)?;
        let at = rows.partition_point(|&r| split_row(r).0 < attribute.0);
        let old = rows.get(at).map(|&r| split_row(r));
        let old = old.filter(|(found, _)| *found == attribute.0);
        let older = match (self.schema().history(attribute), old) {
            (0, old) => {
                if let Some((_, old)) = old {
                    self.retire_attribute(old);
                }
                None
            }
            (_, None) => Some((0, 0)),
            (limit, Some((_, old))) => Some(self.next_older(old, limit)),
        };
        let record = AttributeRecord {
            value: value.clone(),
            version: self.stamp.version,
            time: self.stamp.time,
            writer: self.stamp.writer,
            older,
        };
        let address = self.graph.writer.write(&record.words());
        let address = self.room(address)?;
        if old.is_some() {
            rows[at] = row(attribute.0, address);
        } else {
            rows.insert(at, row(attribute.0, address));
        }
        Ok(attribute)
    }

    pub(super) fn change_attribute(
        &mut self,
        owner: &Owner,
        name: &str,
        value: Option<&Value>,
    ) -> Result<(), Refusal> {
        match owner {
            Owner::Node(node) => {
                let (address, mut record) = self.node(node)?;
                let len = record.words().len();
                let before = self.indexed_place(&record.rows, name)?;
                let name = self.change_row(&mut record.rows, name, value)?;
                let after = value.and_then(Value::place);
                self.index_value(name, NodeId(record.id), before, after)?;
                record.version = self.stamp.record;
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
                record.version = self.stamp.record;
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
}
