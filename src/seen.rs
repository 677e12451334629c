//! A commit beside the graph after it and before it, and how it is told as JSON: to who watches, in
//! recordings and to the inspector. It guarantees that all of them get the same words.

use crate::commands::graph::name_of;
use dsr::{
    Attribute, AttributeId, Change, EdgeKey, Element, NodeId, NodeRef, ReadError, Snapshot, Touch,
    Version, json,
};
use serde_json::{Map, Value as Json, json};

/// The graph after a commit and before it, where they are still kept.
pub(crate) struct Seen {
    /// Where it is not kept any more, a newer one, for names alone.
    after: Snapshot,
    before: Option<Snapshot>,
    /// Whether `after` is what the commit left.
    is_kept: bool,
    /// Whether nodes have the names in `after` that they had: it is of the same store.
    has_names: bool,
}

/// The word for how something was touched.
pub(crate) fn touch_name(touch: Touch) -> &'static str {
    match touch {
        Touch::Created => "created",
        Touch::Deleted => "deleted",
        Touch::Updated => "updated",
        Touch::Replaced => "replaced",
    }
}

impl Seen {
    /// The graph as of a commit. Where that is not kept any more, or is another store's, there are no values.
    pub(crate) fn new(newest: Snapshot, change: &Change) -> Self {
        let has_names = newest.epoch() == change.epoch;
        let exact = has_names.then(|| Self::exactly(&newest, change.version).ok());
        exact.flatten().unwrap_or(Self {
            after: newest,
            before: None,
            is_kept: false,
            has_names,
        })
    }

    /// The graph as of that version, without what owners give out beside it.
    ///
    /// # Errors
    /// [`ReadError::SnapshotTooOld`] where it is not kept any more.
    pub(crate) fn exactly(newest: &Snapshot, version: Version) -> Result<Self, ReadError> {
        let newest = newest.committed();
        Ok(Self {
            before: newest.at(Version(version.0.saturating_sub(1))).ok(),
            after: newest.at(version)?,
            is_kept: true,
            has_names: true,
        })
    }

    pub(crate) fn after(&self) -> &Snapshot {
        &self.after
    }

    /// The name of a node; of one that the commit took away, as it was before.
    pub(crate) fn name(&self, id: NodeId) -> String {
        if !self.has_names {
            return NodeRef::Id(id).to_string();
        }
        let there = |snapshot: &&Snapshot| matches!(snapshot.find_node(id), Ok(Some(_)));
        let snapshot = Some(&self.after).filter(there).or(self.before.as_ref());
        name_of(snapshot.unwrap_or(&self.after), id)
    }

    pub(crate) fn of_node(
        &self,
        id: NodeId,
        name: AttributeId,
    ) -> Result<Option<Attribute>, ReadError> {
        match self.after.find_node(id)?.filter(|_| self.is_kept) {
            Some(node) => node.attribute(name),
            None => Ok(None),
        }
    }

    pub(crate) fn of_edge(
        &self,
        key: EdgeKey,
        name: AttributeId,
    ) -> Result<Option<Attribute>, ReadError> {
        match self.after.find_edge(key)?.filter(|_| self.is_kept) {
            Some(edge) => edge.attribute(name),
            None => Ok(None),
        }
    }

    /// What a commit set, with the values; without, where the version is not kept any more.
    pub(crate) fn set<'a>(
        &'a self,
        names: &'a [AttributeId],
        read: impl Fn(AttributeId) -> Result<Option<Attribute>, ReadError> + 'a,
    ) -> impl Iterator<Item = (&'a str, Option<Attribute>)> + 'a {
        let name = |id| self.after.schema().attribute_name(id);
        names
            .iter()
            .map(move |&id| (name(id), read(id).ok().flatten()))
    }

    /// The values that a commit left: all of what is new, else what was set; `null` for what was removed, and
    /// where the version is not kept any more.
    fn values(
        &self,
        element: Option<&Element<'_>>,
        touch: Touch,
        names: &[AttributeId],
    ) -> Result<Map<String, Json>, ReadError> {
        let schema = self.after.schema();
        let mut values = Map::new();
        if !self.is_kept {
            let names = names.iter().map(|&name| schema.attribute_name(name));
            return Ok(names.map(|name| (name.to_owned(), Json::Null)).collect());
        }
        let Some(element) = element else {
            return Ok(values);
        };
        if matches!(touch, Touch::Created | Touch::Replaced) {
            for attribute in element.attributes()? {
                let name = schema.attribute_name(attribute.name);
                values.insert(name.to_owned(), json::value_to_json(&attribute.value));
            }
            return Ok(values);
        }
        for &name in names {
            let value = element.attribute(name)?;
            let value = value.map_or(Json::Null, |found| json::value_to_json(&found.value));
            values.insert(schema.attribute_name(name).to_owned(), value);
        }
        Ok(values)
    }

    /// A commit as one JSON object.
    ///
    /// # Errors
    /// [`ReadError`].
    pub(crate) fn row(&self, change: &Change) -> Result<Json, ReadError> {
        let schema = self.after.schema();
        let rules = change.rules.iter().map(|rule| {
            let bound = |(var, id): &(String, NodeId)| (var.clone(), json!(self.name(*id)));
            let binding: Map<String, Json> = rule.binding.iter().map(bound).collect();
            let ids = rule
                .binding
                .iter()
                .map(|(var, id)| (var.clone(), json!(id.0)));
            json!({"rule": rule.rule, "binding": binding, "ids": ids.collect::<Map<_, _>>()})
        });
        let mut nodes = Vec::new();
        for touched in &change.nodes {
            let node = self.after.find_node(touched.node)?;
            let element = node.as_deref();
            nodes.push(json!({
                "id": touched.node.0, "name": self.name(touched.node),
                "type": schema.type_name(touched.type_id), "touch": touch_name(touched.touch),
                "attributes": self.values(element, touched.touch, &touched.attributes)?,
            }));
        }
        let mut edges = Vec::new();
        for touched in &change.edges {
            let key = touched.edge;
            let edge = self.after.find_edge(key)?;
            let element = edge.as_deref();
            edges.push(json!({
                "from": self.name(key.from), "from_id": key.from.0,
                "label": schema.label_name(key.label),
                "to": self.name(key.to), "to_id": key.to.0, "touch": touch_name(touched.touch),
                "attributes": self.values(element, touched.touch, &touched.attributes)?,
            }));
        }
        let mut row = json!({
            "version": change.version.0, "time": change.time.seconds(),
            "agent": change.agent, "rules": rules.collect::<Vec<_>>(),
            "nodes": nodes, "edges": edges,
        });
        if !self.is_kept {
            row["kept"] = json!(false);
        }
        Ok(row)
    }
}
