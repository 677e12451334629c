//! Where the nodes of a graph are drawn: by type and room, in clusters that grow from their middle. It
//! guarantees that a node stays where it is for as long as it keeps type and room, whatever comes and
//! goes beside it.

use dsr::{NodeId, ReadError, Snapshot};
use std::collections::{BTreeMap, BTreeSet};

/// The distance between neighbours in a cluster.
const STEP: f64 = 26.0;
/// The angle by which each node of a cluster is turned against the one before, as in a sunflower.
const GOLDEN: f64 = 2.399_963_229_728_653;

/// What belongs together: nodes of one type in one room, or in none.
type Key = (Option<NodeId>, String);

#[derive(Debug, Default)]
struct Cluster {
    middle: [f64; 2],
    /// From the middle outwards; `None` is free.
    slots: Vec<Option<NodeId>>,
    free: BTreeSet<usize>,
}

/// Places of nodes.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    clusters: BTreeMap<Key, Cluster>,
    /// Which cluster a node is in, and in which slot.
    nodes: BTreeMap<NodeId, (Key, usize)>,
    row: Row,
}

/// Where the next cluster goes: rows from left to right.
#[derive(Debug, Default)]
struct Row {
    x: f64,
    y: f64,
    height: f64,
    wide: f64,
}

fn reach(count: usize) -> f64 {
    STEP * (count as f64 + 1.0).sqrt() + STEP
}

fn slot([x, y]: [f64; 2], index: usize) -> [f64; 2] {
    let (r, angle) = (STEP * (index as f64).sqrt() * 0.9, index as f64 * GOLDEN);
    [x + r * angle.cos(), y + r * angle.sin()]
}

impl Layout {
    /// Makes room for what is new in a snapshot, and forgets what is gone; of a `past` one, what is gone
    /// then keeps its place for when the user comes back.
    ///
    /// # Errors
    /// [`ReadError`].
    pub(crate) fn update(&mut self, snapshot: &Snapshot, past: bool) -> Result<(), ReadError> {
        let label = snapshot.schema().find_label("in");
        let mut keys = BTreeMap::new();
        for node in snapshot.nodes() {
            let node = node?;
            let mut room = None;
            if let Some(label) = label {
                room = node.targets_of(label).next().transpose()?;
            }
            // A room is the middle of what is in it.
            if node.type_name() == "room" {
                room = Some(node.id());
            }
            keys.insert(node.id(), (room, node.type_name().to_owned()));
        }
        let gone: Vec<NodeId> = self
            .nodes
            .iter()
            .filter(|(id, (key, _))| !past && keys.get(id) != Some(key))
            .map(|(id, _)| *id)
            .collect();
        for id in gone {
            self.leave(id);
        }
        let mut fresh: BTreeMap<Key, Vec<NodeId>> = BTreeMap::new();
        for (id, key) in keys {
            if !self.nodes.contains_key(&id) {
                fresh.entry(key).or_default().push(id);
            }
        }
        if self.clusters.is_empty() {
            // About as wide as high, all in all, for what is there at first.
            let side = |ids: &Vec<NodeId>| 2.0 * reach(ids.len() + ids.len() / 2);
            let area: f64 = fresh.values().map(|ids| side(ids).powi(2)).sum();
            self.row.wide = (1.4 * area.sqrt()).max(800.0);
        }
        for (key, ids) in fresh {
            self.enter(&key, &ids);
        }
        Ok(())
    }

    fn leave(&mut self, id: NodeId) {
        if let Some((key, slot)) = self.nodes.remove(&id)
            && let Some(cluster) = self.clusters.get_mut(&key)
        {
            cluster.slots[slot] = None;
            cluster.free.insert(slot);
        }
    }

    fn enter(&mut self, key: &Key, ids: &[NodeId]) {
        if !self.clusters.contains_key(key) {
            // With room for half as many again.
            let radius = reach(ids.len() + ids.len() / 2);
            let middle = self.row.place(radius);
            let cluster = Cluster {
                middle,
                ..Cluster::default()
            };
            self.clusters.insert(key.clone(), cluster);
        }
        let Some(cluster) = self.clusters.get_mut(key) else {
            return;
        };
        for &id in ids {
            let slot = match cluster.free.pop_first() {
                Some(slot) => slot,
                None => {
                    cluster.slots.push(None);
                    cluster.slots.len() - 1
                }
            };
            cluster.slots[slot] = Some(id);
            self.nodes.insert(id, (key.clone(), slot));
        }
    }

    /// Where a node is drawn, in pixels at no magnification.
    pub(crate) fn place(&self, id: NodeId) -> Option<[f64; 2]> {
        let (key, index) = self.nodes.get(&id)?;
        Some(slot(self.clusters.get(key)?.middle, *index))
    }
}

impl Row {
    /// The middle of a place of that radius.
    fn place(&mut self, radius: f64) -> [f64; 2] {
        if self.x > 0.0 && self.x + 2.0 * radius > self.wide {
            (self.x, self.y) = (0.0, self.y + self.height);
            self.height = 0.0;
        }
        let middle = [self.x + radius, self.y + radius];
        self.x += 2.0 * radius;
        self.height = self.height.max(2.0 * radius);
        middle
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::{Graph, Schema, Time, Transaction};

    fn graph(count: usize) -> Graph {
        let mut graph = Graph::in_memory(Schema::open());
        let mut transaction = Transaction::new();
        for index in 0..count {
            transaction.create_node("cup", &format!("cup{index}"), vec![]);
            transaction.create_node("plate", &format!("plate{index}"), vec![]);
        }
        graph.commit(&transaction, "test", Time::default()).unwrap();
        graph
    }

    #[test]
    fn nobody_moves_when_others_come_and_go_and_nobody_lies_on_another() {
        let mut graph = graph(40);
        let mut layout = Layout::default();
        layout.update(&graph.snapshot(), false).unwrap();
        let places = |graph: &Graph, layout: &Layout| -> BTreeMap<NodeId, [f64; 2]> {
            let snapshot = graph.snapshot();
            let ids = snapshot.nodes().map(|node| node.unwrap().id());
            ids.map(|id| (id, layout.place(id).unwrap())).collect()
        };
        let before = places(&graph, &layout);
        let past = graph.snapshot();
        let mut change = Transaction::new();
        change.delete_node("cup7");
        change.create_node("cup", "new", vec![]);
        change.create_node("bowl", "bowl", vec![]);
        graph.commit(&change, "test", Time::default()).unwrap();
        layout.update(&graph.snapshot(), false).unwrap();
        layout.update(&past, true).unwrap();
        let after = places(&graph, &layout);
        for (id, place) in &before {
            if let Some(later) = after.get(id) {
                let moved = (place[0] - later[0]).hypot(place[1] - later[1]);
                assert!(moved < 1e-9, "{id}");
            }
        }
        let all: Vec<&[f64; 2]> = after.values().collect();
        for (index, one) in all.iter().enumerate() {
            for other in &all[index + 1..] {
                let distance = (one[0] - other[0]).hypot(one[1] - other[1]);
                assert!(distance > STEP / 2.0, "{one:?} {other:?}");
            }
        }
    }
}
