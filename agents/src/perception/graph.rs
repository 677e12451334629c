//! The graph as perception reads and writes it. Writing is always the difference between what is
//! believed and what a snapshot says, so a refused transaction is simply made again from the next
//! snapshot, and nothing is written that has not changed.

use super::{FloorPlan, difference};
use dsr::{EdgeRef, Node, NodeId, NodeRef, Operation, ReadError, Snapshot, Transaction, Value};
use nalgebra::{Isometry2, Point2};
use std::collections::BTreeSet;

/// A pose is written when it moved by more than this, m: a tenth of the detectors' noise.
const MOVED: f64 = 0.01;
/// Or turned by more than this: 1 degree.
const TURNED: f64 = std::f64::consts::PI / 180.0;
/// `last_seen` is written when it is older than this, s: it changes with every frame, and nobody
/// needs it more exactly.
pub(crate) const LAST_SEEN_PERIOD: f64 = 0.5;

/// Rooms (`polygon` of the `room` nodes) and walls (`walls` of the `world` node).
///
/// # Errors
/// [`ReadError`].
pub(crate) fn floor_plan(snapshot: &Snapshot) -> Result<FloorPlan, ReadError> {
    let mut rooms = Vec::new();
    for room in snapshot.nodes_of("room") {
        let room = room?;
        rooms.push((room.name()?, points(&room, "polygon")?));
    }
    let mut walls = Vec::new();
    if let Some(world) = first_of_type(snapshot, "world")? {
        walls.extend(
            points(&world, "walls")?
                .chunks_exact(2)
                .map(|ends| [ends[0], ends[1]]),
        );
    }
    Ok(FloorPlan::new(rooms, walls))
}

/// The node of that type with the least id.
///
/// # Errors
/// [`ReadError`].
pub(crate) fn first_of_type<'a>(
    snapshot: &'a Snapshot,
    type_name: &str,
) -> Result<Option<Node<'a>>, ReadError> {
    let mut first: Option<Node<'a>> = None;
    for node in snapshot.nodes_of(type_name) {
        let node = node?;
        if first.is_none_or(|known| node.id() < known.id()) {
            first = Some(node);
        }
    }
    Ok(first)
}

/// An attribute that lists points as x, y, x, y, ...; empty where it is missing.
///
/// # Errors
/// [`ReadError`].
pub(crate) fn points(node: &Node, attribute: &str) -> Result<Vec<Point2<f64>>, ReadError> {
    let numbers = numbers(node, attribute)?;
    Ok(numbers
        .chunks_exact(2)
        .map(|xy| Point2::new(xy[0], xy[1]))
        .collect())
}

/// An attribute that is a row of numbers; empty where it is missing.
///
/// # Errors
/// [`ReadError`].
pub(crate) fn numbers(node: &Node, attribute: &str) -> Result<Vec<f64>, ReadError> {
    let value = node.value(attribute)?;
    Ok(value
        .as_ref()
        .and_then(Value::as_f64s)
        .map(<[f64]>::to_vec)
        .unwrap_or_default())
}

/// An attribute that is a number.
///
/// # Errors
/// [`ReadError`].
pub(crate) fn number(node: &Node, attribute: &str) -> Result<Option<f64>, ReadError> {
    Ok(node.value(attribute)?.as_ref().and_then(Value::as_f64))
}

/// The names of the nodes that edges of `label` lead to from `node`.
///
/// # Errors
/// [`ReadError`].
pub(crate) fn targets(
    snapshot: &Snapshot,
    node: &Node,
    label: &str,
) -> Result<BTreeSet<String>, ReadError> {
    let mut names = BTreeSet::new();
    if let Some(label) = snapshot.schema().find_label(label) {
        for key in node.out_edges_of(label) {
            if let Some(target) = snapshot.find_node(key?.to)? {
                names.insert(target.name()?);
            }
        }
    }
    Ok(names)
}

/// A transaction in the making: what has to change in a snapshot.
#[derive(Debug)]
pub(crate) struct Difference<'a> {
    snapshot: &'a Snapshot,
    world: NodeId,
    pub(crate) transaction: Transaction,
}

impl<'a> Difference<'a> {
    /// Nothing to change yet. `None` where the graph has no `world` node to place things in, as
    /// before its first import.
    ///
    /// # Errors
    /// [`ReadError`].
    pub(crate) fn new(snapshot: &'a Snapshot) -> Result<Option<Self>, ReadError> {
        let world = first_of_type(snapshot, "world")?;
        let transaction = Transaction::new();
        Ok(world.map(|world| Self {
            snapshot,
            world: world.id(),
            transaction,
        }))
    }

    /// Makes a node that stands at `pose` (world frame).
    pub(crate) fn create(
        &mut self,
        type_name: &str,
        name: &str,
        pose: Isometry2<f64>,
        attributes: Vec<(String, Value)>,
    ) {
        self.transaction.create_node(type_name, name, attributes);
        self.create_pose(self.world, name, pose);
    }

    fn create_pose(&mut self, parent: NodeId, node: impl Into<NodeRef>, pose: Isometry2<f64>) {
        self.transaction.push(Operation::CreateEdge {
            edge: EdgeRef::new(parent, "pose", node),
            attributes: vec![("transform".to_owned(), pose.into())],
        });
    }

    /// Moves `node` to `pose` (world frame), whatever it hangs from in the kinematic tree.
    pub(crate) fn place(&mut self, node: &Node, pose: Isometry2<f64>) -> Result<(), ReadError> {
        let Some(current) = self.snapshot.world_from(node.id())? else {
            self.create_pose(self.world, node.id(), pose);
            return Ok(());
        };
        let moved = (current.translation.vector - pose.translation.vector).norm();
        let turned = difference(pose.rotation.angle(), current.rotation.angle()).abs();
        // Not "above": a pose that is no number must be overwritten.
        if moved <= MOVED && turned <= TURNED {
            return Ok(());
        }
        let label = self.snapshot.schema().find_label("pose");
        let edge = label
            .and_then(|label| node.in_edges_of(label).next())
            .transpose()?;
        let parent = edge.map_or(self.world, |edge| edge.from);
        let world_from_parent = self.snapshot.world_from(parent)?.unwrap_or_default();
        let edge = EdgeRef::new(parent, "pose", node.id());
        self.transaction
            .set_on_edge(edge, "transform", world_from_parent.inv_mul(&pose));
        Ok(())
    }

    /// Sets a number that differs from the graph's by more than `tolerance`.
    pub(crate) fn number(
        &mut self,
        node: &Node,
        attribute: &str,
        value: f64,
        tolerance: f64,
    ) -> Result<(), ReadError> {
        let known = number(node, attribute)?;
        if known.is_none_or(|known| (known - value).abs() > tolerance) {
            self.transaction.set(node.id(), attribute, value);
        }
        Ok(())
    }

    /// Sets a vector of which a component differs from the graph's by more than `tolerance`.
    pub(crate) fn vector<const N: usize>(
        &mut self,
        node: &Node,
        attribute: &str,
        value: [f64; N],
        tolerance: f64,
    ) -> Result<(), ReadError> {
        let known = numbers(node, attribute)?;
        let same = known.len() == N
            && known
                .iter()
                .zip(&value)
                .all(|(known, value)| (known - value).abs() <= tolerance);
        if !same {
            self.transaction.set(node.id(), attribute, value);
        }
        Ok(())
    }

    /// Makes the edges of `label` from `name` lead to the nodes `wanted` and no others, except that
    /// those to `foreign` nodes stay as they are. `node` is `None` where the transaction makes it.
    pub(crate) fn edges(
        &mut self,
        name: &str,
        node: Option<&Node>,
        label: &str,
        wanted: &BTreeSet<String>,
        foreign: &BTreeSet<String>,
    ) -> Result<(), ReadError> {
        let known = match node {
            Some(node) => targets(self.snapshot, node, label)?,
            None => BTreeSet::new(),
        };
        for gone in known
            .difference(wanted)
            .filter(|name| !foreign.contains(*name))
        {
            self.transaction.delete_edge(name, label, gone.as_str());
        }
        for new in wanted.difference(&known) {
            self.transaction.create_edge(name, label, new.as_str());
        }
        Ok(())
    }
}
