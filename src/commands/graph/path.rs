//! Paths: `NODE`, `NODE.ATTRIBUTE`, `FROM-LABEL->TO` and `FROM-LABEL->TO.ATTRIBUTE`, with nodes by name or
//! id. A node's name may hold dots and dashes: the longest name that is there wins.

use super::source::{find_node, name_of, no_such, node_ref};
use crate::Failure;
use dsr::{Attribute, AttributeId, EdgeKey, EdgeRef, NodeId, Owner, ReadError, Snapshot, Version};

/// A node or an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::commands) enum Thing {
    Node(NodeId),
    Edge(EdgeKey),
}

/// What a path names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::commands) struct Path {
    pub(in crate::commands) thing: Thing,
    /// The name of an attribute, which the thing need not have.
    pub(in crate::commands) attribute: Option<String>,
}

impl Thing {
    pub(super) fn owner(self, snapshot: &Snapshot) -> Owner {
        match self {
            Self::Node(id) => Owner::Node(id.into()),
            Self::Edge(key) => {
                let label = snapshot.schema().label_name(key.label);
                Owner::Edge(EdgeRef::new(key.from, label, key.to))
            }
        }
    }

    /// As messages name it.
    pub(in crate::commands) fn describe(self, snapshot: &Snapshot) -> String {
        match self {
            Self::Node(id) => name_of(snapshot, id),
            Self::Edge(key) => {
                let label = snapshot.schema().label_name(key.label);
                let (from, to) = (name_of(snapshot, key.from), name_of(snapshot, key.to));
                format!("{from} -{label}-> {to}")
            }
        }
    }

    pub(in crate::commands) fn attribute(
        self,
        snapshot: &Snapshot,
        name: AttributeId,
    ) -> Result<Option<Attribute>, ReadError> {
        match self {
            Self::Node(id) => match snapshot.find_node(id)? {
                Some(node) => node.attribute(name),
                None => Ok(None),
            },
            Self::Edge(key) => match snapshot.find_edge(key)? {
                Some(edge) => edge.attribute(name),
                None => Ok(None),
            },
        }
    }

    /// The values that the schema keeps, newest first.
    pub(super) fn kept(
        self,
        snapshot: &Snapshot,
        name: AttributeId,
    ) -> Result<Vec<Attribute>, ReadError> {
        match self {
            Self::Node(id) => match snapshot.find_node(id)? {
                Some(node) => node.history(name),
                None => Ok(Vec::new()),
            },
            Self::Edge(key) => match snapshot.find_edge(key)? {
                Some(edge) => edge.history(name),
                None => Ok(Vec::new()),
            },
        }
    }
}

/// What stands before the last dot, and behind it.
fn attribute_of(text: &str) -> Option<(&str, String)> {
    let (owner, attribute) = text.rsplit_once('.')?;
    Some((owner, attribute.to_owned()))
}

impl Path {
    pub(in crate::commands) fn find(snapshot: &Snapshot, path: &str) -> Result<Self, Failure> {
        match path.split_once("->") {
            Some((start, to)) => edge(snapshot, path, start, to),
            None => {
                if let Some(id) = node_ref(snapshot, path)? {
                    return Ok(Self {
                        thing: Thing::Node(id),
                        attribute: None,
                    });
                }
                let Some((node, attribute)) = attribute_of(path) else {
                    return Err(no_such(snapshot, path, "node"));
                };
                Ok(Self {
                    thing: Thing::Node(find_node(snapshot, node)?),
                    attribute: Some(attribute),
                })
            }
        }
    }

    /// What a path names now or, where it is gone, named in a version that is kept: the newest such.
    pub(in crate::commands) fn find_kept(
        newest: &Snapshot,
        path: &str,
    ) -> Result<(Self, Option<Snapshot>), Failure> {
        let missing = match Self::find(newest, path) {
            Ok(found) => return Ok((found, None)),
            Err(missing) => missing,
        };
        let find = |version: &Snapshot| Self::find(version, path).ok();
        let (found, last) = last_with(newest, find).ok_or(missing)?;
        Ok((found, Some(last)))
    }

    /// As [`Self::find`], of an attribute.
    pub(super) fn find_attribute(
        snapshot: &Snapshot,
        path: &str,
    ) -> Result<(Thing, String), Failure> {
        let found = Self::find(snapshot, path)?;
        let attribute = found.attribute.ok_or_else(|| {
            Failure::input_with_help(
                format!("`{path}` names no attribute"),
                "write NODE.ATTRIBUTE, or FROM-LABEL->TO.ATTRIBUTE for an edge",
            )
        })?;
        Ok((found.thing, attribute))
    }
}

/// What the newest of the versions before this one that are kept has, and that version.
pub(in crate::commands) fn last_with<T>(
    newest: &Snapshot,
    has: impl Fn(&Snapshot) -> Option<T>,
) -> Option<(T, Snapshot)> {
    let before = (newest.oldest().0..newest.version().0).rev();
    let mut kept = before.map_while(|version| newest.at(Version(version)).ok());
    kept.find_map(|version| Some((has(&version)?, version)))
}

fn edge(snapshot: &Snapshot, path: &str, start: &str, to: &str) -> Result<Path, Failure> {
    // Names and labels may both hold dashes: take the first split that names a label.
    let mut splits: Vec<(&str, &str)> = start
        .match_indices('-')
        .map(|(at, _)| (start[..at].trim_end(), &start[at + 1..]))
        .collect();
    splits.reverse();
    let known = |(_, label): &(&str, &str)| snapshot.schema().find_label(label).is_some();
    let Some((from, label)) = splits.iter().find(|s| known(s)).or(splits.first()).copied() else {
        return Err(Failure::input_with_help(
            format!("`{path}` names no edge"),
            "write FROM-LABEL->TO or FROM-LABEL->TO.ATTRIBUTE",
        ));
    };
    let label_id = snapshot.schema().label_id(label).map_err(Failure::input)?;
    let from = find_node(snapshot, from)?;
    let to = to.trim_start();
    let (to, attribute) = match (node_ref(snapshot, to)?, attribute_of(to)) {
        (Some(to), _) => (to, None),
        (None, Some((to, attribute))) => (find_node(snapshot, to)?, Some(attribute)),
        (None, None) => return Err(no_such(snapshot, to, "node")),
    };
    let key = EdgeKey {
        from,
        label: label_id,
        to,
    };
    if snapshot
        .find_edge(key)
        .map_err(Failure::internal)?
        .is_none()
    {
        let edge = Thing::Edge(key).describe(snapshot);
        return Err(Failure::input(format!("there is no edge {edge}")));
    }
    Ok(Path {
        thing: Thing::Edge(key),
        attribute,
    })
}
