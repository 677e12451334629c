//! A session's hot attributes: those that it gives out, and those of others that its snapshots show. It
//! guarantees that who gives one out has the store's leave, by a commit of the attribute.

use super::Session;
use crate::arena::Arena;
use crate::hot::{Hot, Key, claim};
use crate::shm::hot::{self, HotAttribute, HotError, HotSubscriber};
use crate::shm::{CommitError, InstanceError};
use crate::{
    AttachError, Attribute, AttributeId, EdgeKey, Epoch, NodeId, NodeRef, Operation, Owner,
    Precondition, ReadError, Refusal, Schema, Snapshot, Transaction,
};
use std::sync::Arc;

/// How often to ask for an attribute that others write at the same time.
const ASKS: u32 = 100;

impl Session {
    /// What owners give out beside a graph with that schema.
    pub(super) fn hot_of(
        &mut self,
        (epoch, arena): (Epoch, &Arena),
        schema: &Schema,
    ) -> Result<Option<Hot>, InstanceError> {
        if self.hot.is_none() && schema.has_hot() {
            let hot = self.hot.insert(HotSubscriber::open(&self.node)?);
            hot.poll(Some(arena))?;
        }
        let pages = self.hot.as_ref().and_then(HotSubscriber::pages);
        Ok(pages.map(|pages| Hot { pages, epoch }))
    }

    /// Makes this process the one that gives out an attribute beside the graph, so that it can be
    /// written a thousand times a second. The schema says that it is `hot`; the graph has a first
    /// value of it, which is committed again in this agent's name: readers believe the session that
    /// committed the attribute last, and no other.
    ///
    /// # Errors
    /// [`HotError`].
    pub fn hot(&mut self, owner: Owner, name: &str) -> Result<HotAttribute, HotError> {
        let mut asks = 0;
        let (schema, attribute, key) = loop {
            let snapshot = self.snapshot()?;
            let schema = Arc::clone(&snapshot.schema);
            let attribute = schema.attribute_id(name)?;
            if schema.hot_rate(attribute).is_none() {
                let attribute = name.to_owned();
                return Err(HotError::NotHot { attribute });
            }
            let find = |snapshot| find(snapshot, &owner, attribute).map_err(AttachError::from);
            let found = (find(&snapshot.committed())?, find(&snapshot)?);
            let (Some((key, committed)), Some((_, newest))) = found else {
                let attribute = name.to_owned();
                return Err(HotError::NotFound { attribute, owner });
            };
            let mut transaction = Transaction::new().require(Precondition::AttributeEquals {
                owner: owner.clone(),
                name: name.to_owned(),
                value: Some(committed.value),
            });
            transaction.push(Operation::SetAttribute {
                owner: owner.clone(),
                name: name.to_owned(),
                value: newest.value,
            });
            asks += 1;
            match self.commit(&transaction, newest.time) {
                Ok(_) => break (schema, attribute, key),
                Err(CommitError::Refused(Refusal::Conflict(_))) if asks < ASKS => {}
                Err(error) => return Err(error.into()),
            }
        };
        let page = match &self.page {
            Some(page) => Arc::clone(page),
            None => Arc::new(hot::page(&self.node, self.id)?),
        };
        self.page = Some(Arc::clone(&page));
        let slot = claim(page.words(), key).ok_or(HotError::Full)?;
        let rate = schema.hot_rate(attribute).unwrap_or(1.0);
        Ok(HotAttribute {
            page,
            slot,
            owner,
            name: name.to_owned(),
            schema,
            attribute,
            current: self.arena.current.clone(),
            interval: rate.recip(),
            folded: None,
            last: None,
            scratch: Vec::new(),
        })
    }
}

/// An attribute and its key in a page, where the graph has it.
fn find(
    snapshot: &Snapshot,
    owner: &Owner,
    attribute: AttributeId,
) -> Result<Option<(Key, Attribute)>, ReadError> {
    let find = |node: &NodeRef| match node {
        NodeRef::Id(id) => snapshot.find_node(*id),
        NodeRef::Name(name) => snapshot.find_node_by_name(name),
    };
    let id = |node| Ok(find(node)?.map(|node| node.id()));
    match owner {
        Owner::Node(node) => {
            let Some(node) = find(node)? else {
                return Ok(None);
            };
            let there = node.attribute(attribute)?;
            Ok(there.map(|found| (Key::of_node(node.id(), attribute), found)))
        }
        Owner::Edge(edge) => {
            let label = snapshot.schema().find_label(&edge.label);
            let ends: (Option<NodeId>, Option<NodeId>) = (id(&edge.from)?, id(&edge.to)?);
            let (Some(label), (Some(from), Some(to))) = (label, ends) else {
                return Ok(None);
            };
            let key = EdgeKey { from, label, to };
            let edge = snapshot.find_edge(key)?;
            let there = edge.map(|edge| edge.attribute(attribute)).transpose()?;
            Ok(there
                .flatten()
                .map(|found| (Key::of_edge(key, attribute), found)))
        }
    }
}
