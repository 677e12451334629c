//! Groups as nodes of the graph. This file owns their names and attributes, and guarantees that a group
//! keeps its node while its members come and go, also over a restart of the agent.

use super::super::found::FoundGroup;
use super::super::groups::GroupTracker;
use super::{MOVED, TURNED, flat, is_near, polyline, remove};
use crate::social_mapping::features::Features;
use crate::social_mapping::map::Update;
use dsr::{EdgeRef, Node, Operation, ReadError, Snapshot, Time, Transaction, Value};
use nalgebra::Isometry2;
use std::collections::{BTreeMap, BTreeSet};

/// The type of groups. A graph whose schema does not know it has none.
pub const GROUP: &str = "group";
/// From a person to the group that the person is in.
pub const MEMBER: &str = "member_of";
/// How far a group reaches ahead, to the left, behind and to the right of its centre.
pub const EXTENT: &str = "extent";
/// What a group feels and wants, like a person's: the mean over those of whom it is known. Absent where it is of nobody.
pub const FEATURES: &str = "features";
/// The outline of a group's personal zone, like a person's.
const ZONE: &str = "personal_zone";
/// A group that is not found for so long is over, seconds.
const PATIENCE: f64 = 2.0;

/// The groups that the graph shall show.
#[derive(Debug, Clone)]
pub(super) struct GroupNodes {
    tracker: GroupTracker,
    resumed: bool,
}

/// A group found, under its number.
struct Lasting<'a> {
    members: BTreeSet<String>,
    /// As it was found; `None` where it is only remembered.
    found: Option<&'a FoundGroup>,
}

impl GroupNodes {
    pub(super) fn new() -> Self {
        Self {
            tracker: GroupTracker::new(PATIENCE),
            resumed: false,
        }
    }

    /// Adds what to write so that the graph shows the groups of `update`.
    pub(super) fn write(
        &mut self,
        now: Time,
        update: &Update,
        snapshot: &Snapshot,
        transaction: &mut Transaction,
    ) -> Result<(), ReadError> {
        let schema = snapshot.schema();
        if schema.find_type(GROUP).is_none() || schema.find_label(MEMBER).is_none() {
            return Ok(());
        }
        let mut shown: BTreeMap<u64, Node> = BTreeMap::new();
        for node in snapshot.nodes_of(GROUP) {
            let node = node?;
            if let Some(number) = number(&node.name()?) {
                shown.insert(number, node);
            }
        }
        if !self.resumed {
            let mut groups = Vec::new();
            for (number, node) in &shown {
                groups.push((*number, members(snapshot, node)?));
            }
            self.tracker.resume(now.seconds(), groups);
            self.resumed = true;
        }
        let found: Vec<BTreeSet<String>> = update
            .groups
            .iter()
            .map(|group| group.members.iter().cloned().collect())
            .collect();
        let lasting = self.tracker.update(now.seconds(), &found);
        let present: BTreeSet<&String> = update.people.iter().map(|p| &p.name).collect();
        let mut over = shown.clone();
        for (number, members) in lasting {
            let group = Lasting {
                found: found
                    .iter()
                    .position(|one| *one == members)
                    .map(|at| &update.groups[at]),
                members: members
                    .into_iter()
                    .filter(|m| present.contains(&m))
                    .collect(),
            };
            // Remembered of people who are gone, it is no group.
            if group.members.len() > 1 {
                over.remove(&number);
                show(transaction, snapshot, number, shown.get(&number), &group)?;
            }
        }
        for node in over.values() {
            transaction.delete_node(node.id());
        }
        Ok(())
    }
}

/// The name of a group's node.
fn name(number: u64) -> String {
    format!("{GROUP}_{number}")
}

fn number(name: &str) -> Option<u64> {
    name.strip_prefix(GROUP)?.strip_prefix('_')?.parse().ok()
}

/// Who is in a group, by the graph.
fn members(snapshot: &Snapshot, node: &Node<'_>) -> Result<BTreeSet<String>, ReadError> {
    let mut names = BTreeSet::new();
    let Some(label) = snapshot.schema().find_label(MEMBER) else {
        return Ok(names);
    };
    for edge in node.in_edges_of(label) {
        if let Some(person) = snapshot.find_node(edge?.from)? {
            names.insert(person.name()?);
        }
    }
    Ok(names)
}

fn show(
    transaction: &mut Transaction,
    snapshot: &Snapshot,
    number: u64,
    node: Option<&Node<'_>>,
    group: &Lasting<'_>,
) -> Result<(), ReadError> {
    let name = name(number);
    let had = match node {
        Some(node) => members(snapshot, node)?,
        None => BTreeSet::new(),
    };
    if node.is_none() {
        // Remembered groups have a node; a group without one has just been found.
        let Some(found) = group.found else {
            return Ok(());
        };
        let mut attributes = vec![
            (EXTENT.to_owned(), extent(found)),
            (ZONE.to_owned(), flat(&found.personal)),
        ];
        attributes.extend(features(found).map(|text| (FEATURES.to_owned(), text)));
        transaction.create_node(GROUP, &name, attributes);
        place(transaction, snapshot, &name, &found.entity.world_from_group)?;
    } else if let (Some(node), Some(found)) = (node, group.found) {
        let place_now = &found.entity.world_from_group;
        let still = snapshot.world_from(node.id())?.is_some_and(|was| {
            (was.translation.vector - place_now.translation.vector).norm() <= MOVED
                && was.rotation.angle_to(&place_now.rotation).abs() <= TURNED
        });
        if !still {
            place(transaction, snapshot, &name, place_now)?;
        }
        let same = polyline(node, ZONE)?.is_some_and(|old| is_near(&old, &found.personal));
        if !same {
            transaction.set(node.id(), EXTENT, extent(found));
            transaction.set(node.id(), ZONE, flat(&found.personal));
        }
        match features(found) {
            None => remove(transaction, node, &[FEATURES])?,
            Some(text) if node.value(FEATURES)?.as_ref() == Some(&text) => {}
            Some(text) => transaction.set(node.id(), FEATURES, text),
        }
    }
    for left in had.difference(&group.members) {
        transaction.delete_edge(left.as_str(), MEMBER, name.as_str());
    }
    for joined in group.members.difference(&had) {
        transaction.create_edge(joined.as_str(), MEMBER, name.as_str());
    }
    Ok(())
}

/// What is known of a group's features.
fn features(group: &FoundGroup) -> Option<Value> {
    let known = (!group.features.is_empty()).then(|| Features::text(&group.features));
    known.map(Value::from)
}

fn extent(group: &FoundGroup) -> Value {
    group.entity.extent.sides().into()
}

fn place(
    transaction: &mut Transaction,
    snapshot: &Snapshot,
    name: &str,
    world_from_group: &Isometry2<f64>,
) -> Result<(), ReadError> {
    if let Some(world) = snapshot.nodes_of("world").next().transpose()? {
        transaction.push(Operation::CreateEdge {
            edge: EdgeRef::new(world.id(), "pose", name),
            attributes: vec![("transform".to_owned(), (*world_from_group).into())],
        });
    }
    Ok(())
}
