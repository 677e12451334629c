//! What a commit under way does to attributes. It guarantees that each written one passes the schema and
//! remembers version, time and writer, and that indices have what the nodes have.

use super::{Work, read};
use crate::arena::Address;
use crate::arena::record::{NodeInPlace, SINCE, VERSION};
use crate::arena::table::{AttributeRecord, Place, Stored, Table};
use crate::interchange::Stamp;
use crate::rights::Carrier;
use crate::{AttributeId, NodeId, NodeRef, Owner, Refusal, Touch, TypeId, Value};

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
    pub(super) fn indexed_place(&self, table: &Table, name: &str) -> Result<Option<u64>, Refusal> {
        let attribute = self.schema().find_attribute(name);
        let Some(attribute) = attribute.filter(|&found| self.schema().has_index(found)) else {
            return Ok(None);
        };
        let place = table.find(attribute.0);
        place.map_or(Ok(None), |place| self.place_of(table, place))
    }

    /// The place in an index of an attribute's value.
    pub(super) fn place_of(&self, table: &Table, place: Place) -> Result<Option<u64>, Refusal> {
        let record = table.attribute(&self.graph.writer.arena, place);
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
        for (place, word) in [(before, None), (after, Some(0))] {
            if let Some(place) = place {
                let directory = self.root.values;
                self.root.values = self.index(directory, attribute.0, [place, id.0], word)?;
            }
        }
        Ok(())
    }

    /// Writes an attribute and enters it into a record's table.
    pub(super) fn set_row(
        &mut self,
        carrier: Carrier,
        table: &mut Table,
        name: &str,
        value: &Value,
    ) -> Result<AttributeId, Refusal> {
        let attribute = self.attribute_id(name)?;
        self.check_write(carrier, attribute, value)?;
        let place = table.find(attribute.0);
        let older = match (self.schema().history(attribute), place) {
            (0, _) => None,
            (limit, Some(Place::At(old))) => Some(self.next_older(old, limit)),
            _ => Some((0, 0)),
        };
        let (stamp, writer) = (self.stamp, &mut self.graph.writer);
        let mut words = std::mem::take(&mut writer.scratch);
        words.clear();
        let (version, time, writer_id) = (stamp.version, stamp.time, stamp.writer);
        AttributeRecord::encode(&mut words, value, (version, time, writer_id), older);
        // What may become history lies in a block of its own, to which the next record leads.
        let stored = if older.is_none() && Table::holds(words.len()) {
            Ok(Stored::InTable(&words))
        } else {
            writer.write(&words).map(Stored::At)
        };
        let gone = stored.map(|stored| table.set(attribute.0, stored));
        writer.scratch = words;
        let gone = self.room(gone)?;
        if older.is_none()
            && let Some(gone) = gone
        {
            self.retire_attribute(gone);
        }
        Ok(attribute)
    }

    /// Whether this commit may give the attribute that value.
    fn check_write(
        &self,
        carrier: Carrier,
        attribute: AttributeId,
        value: &Value,
    ) -> Result<(), Refusal> {
        self.may(|rights, schema| rights.attribute(schema, carrier, attribute))?;
        Ok(self.schema().check_value(attribute, value)?)
    }

    /// Says of an attribute that this commit wrote when and by whom it was written.
    pub(in crate::graph) fn stamp(&mut self, stamp: &Stamp) -> Result<(), Refusal> {
        let Some(value) = self.value_of(&stamp.owner, &stamp.name)? else {
            return Ok(());
        };
        let own = self.stamp;
        if let Some(time) = stamp.time {
            self.stamp.time = time.nanoseconds();
        }
        if let Some(agent) = &stamp.agent {
            let writer = self.graph.writer_id(agent, &mut self.root);
            self.stamp.writer = self.room(writer)?;
        }
        let written = self.change_attribute(&stamp.owner, &stamp.name, Some(&value));
        self.stamp = own;
        written
    }

    /// Sets an attribute of a node that takes as much room as before in the node's record, as most do: of that
    /// only a few words change. False, and nothing is done, where it is not such a one.
    fn overwrite(&mut self, node: &NodeRef, name: &str, value: &Value) -> Result<bool, Refusal> {
        let schema = self.schema();
        let Some(name) = schema
            .find_attribute(name)
            .filter(|&name| !schema.has_index(name) && schema.history(name) == 0)
        else {
            return Ok(false);
        };
        let address = self.address(node)?;
        let words = self.graph.writer.arena.from(address).unwrap_or(&[]);
        let Some((node, at)) = NodeInPlace::with_small(words, name.0) else {
            return Ok(false);
        };
        let (id, type_id) = (NodeId(node.id), TypeId(node.type_id));
        self.check_write(Carrier::Node(type_id), name, value)?;
        let (stamp, since, writer) = (self.stamp, self.root.version, &mut self.graph.writer);
        let mut words = std::mem::take(&mut writer.scratch);
        words.clear();
        let head = (stamp.version, stamp.time, stamp.writer);
        AttributeRecord::encode(&mut words, value, head, None);
        let fits = words.len() == at.len();
        let own = fits.then(|| writer.copy(address, node.len)).transpose();
        if let Ok(Some(own)) = own {
            writer.overwrite(own, VERSION, &[stamp.record]);
            writer.overwrite(own, SINCE, &[since]);
            writer.overwrite(own, at.start, &words);
        }
        writer.scratch = words;
        let Some(own) = self.room(own)? else {
            return Ok(false);
        };
        if own != address {
            self.lead_late(id.0, own)?;
        }
        let nodes = &mut self.graph.effects.nodes;
        nodes.touch(id, type_id, Touch::Updated, Some(name));
        Ok(true)
    }

    pub(super) fn change_attribute(
        &mut self,
        owner: &Owner,
        name: &str,
        value: Option<&Value>,
    ) -> Result<(), Refusal> {
        match owner {
            Owner::Node(node) => {
                if let Some(value) = value
                    && self.overwrite(node, name, value)?
                {
                    return Ok(());
                }
                let (address, mut record) = self.node(node)?;
                let len = record.len();
                let before = self.indexed_place(&record.table, name)?;
                let carrier = Carrier::Node(TypeId(record.type_id));
                let name = self.change_row(carrier, &mut record.table, name, value)?;
                let after = value.and_then(Value::place);
                self.index_value(name, NodeId(record.id), before, after)?;
                record.version = self.stamp.record;
                self.put_node(Some((address, len)), &record)?;
                let type_id = TypeId(record.type_id);
                self.graph.effects.nodes.touch(
                    NodeId(record.id),
                    type_id,
                    Touch::Updated,
                    Some(name),
                );
            }
            Owner::Edge(edge) => {
                let (key, end, mut record) = self.edge(edge)?;
                let len = record.len();
                let carrier = Carrier::Edge(key.label);
                let name = self.change_row(carrier, &mut record.table, name, value)?;
                record.version = self.stamp.record;
                self.put_edge(key, (end, len), &record)?;
                self.graph
                    .effects
                    .edges
                    .touch(key, (), Touch::Updated, Some(name));
            }
        }
        Ok(())
    }

    fn change_row(
        &mut self,
        carrier: Carrier,
        table: &mut Table,
        name: &str,
        value: Option<&Value>,
    ) -> Result<AttributeId, Refusal> {
        let Some(value) = value else {
            let attribute = self.attribute_id(name)?;
            self.may(|rights, schema| rights.attribute(schema, carrier, attribute))?;
            if let Some(Place::At(address)) = table.remove(attribute.0) {
                self.retire_attribute(address);
            }
            return Ok(attribute);
        };
        self.set_row(carrier, table, name, value)
    }
}
