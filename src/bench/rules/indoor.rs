//! An indoor world of any size: a building of rooms with people, tables, cups and robots. It
//! guarantees that equal sizes give equal worlds, with at most one link from a node to another.

use crate::Failure;
use dsr::{Graph, NodeId, Schema, Time, Transaction};
use std::fmt::Write as _;

const SCHEMA: &str = r#"
[types]
thing = []
room = ["thing"]
person = ["thing"]
robot = ["thing"]
table = ["thing"]
cup = ["thing"]
[labels]
in = { from = ["thing"], to = ["room"] }
connected = { from = ["room"], to = ["room"] }
on = { from = ["cup"], to = ["table"] }
wants = { from = ["person"], to = ["cup"] }
has = { from = ["person"], to = ["cup"] }
sees = { from = ["person"], to = ["cup"] }
is_near = { from = ["person"], to = ["person"] }
"#;

/// Nodes and edges of a world; a node's place in the list, plus one, is its id.
pub(super) struct Indoor {
    pub(super) nodes: Vec<&'static str>,
    pub(super) edges: Vec<(usize, &'static str, usize)>,
}

/// Spreads numbers, the same way each time.
fn spread(number: usize) -> usize {
    let mut mixed = (number as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    mixed ^= mixed >> 29;
    mixed = mixed.wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (mixed >> 32) as usize
}

impl Indoor {
    /// A world of `size` nodes: of a thousand, 50 rooms, 250 people, 70 tables, 1 robot, and cups.
    pub(super) fn new(size: usize) -> Self {
        let mut world = Self {
            nodes: Vec::with_capacity(size),
            edges: Vec::new(),
        };
        let width = (size / 20).isqrt().max(2);
        let rooms = world.add("room", width * width);
        let people = world.add("person", size / 4);
        let tables = world.add("table", size * 7 / 100);
        let robots = world.add("robot", (size / 2000).max(1));
        let cups = world.add("cup", size - world.nodes.len());
        for (index, room) in rooms.clone().enumerate() {
            let right = (index % width + 1 < width).then_some(room + 1);
            let below = (index + width < rooms.len()).then_some(room + width);
            for next in [right, below].into_iter().flatten() {
                world.edges.push((room, "connected", next));
                world.edges.push((next, "connected", room));
            }
        }
        let any =
            |rooms: &std::ops::Range<usize>, seed: usize| rooms.start + spread(seed) % rooms.len();
        // People, tables and the first half of the cups are somewhere; the rest stands on tables.
        let mut place = vec![0; size];
        for thing in people.clone().chain(tables.clone()) {
            place[thing] = any(&rooms, thing);
            world.edges.push((thing, "in", place[thing]));
        }
        for cup in cups.clone() {
            if cup % 2 == 0 {
                place[cup] = any(&rooms, cup);
                world.edges.push((cup, "in", place[cup]));
            } else {
                let table = any(&tables, cup);
                place[cup] = place[table];
                world.edges.push((cup, "on", table));
            }
        }
        // Every tenth person has company.
        for person in people.clone().filter(|person| person % 10 == 0) {
            let mut others = (person + 1..people.end).chain(people.start..person);
            if let Some(other) = others.find(|&other| place[other] == place[person]) {
                world.edges.push((person, "is_near", other));
            }
        }
        // Five wishes a robot: for a cup in the same room, for one on a table in the next room, and
        // for any. Robots are where the first two sorts of wish can be granted.
        let mut wishing: Vec<usize> = (0..5 * robots.len())
            .map(|wish| any(&people, 7 * wish + 3))
            .collect();
        wishing.sort_unstable();
        wishing.dedup();
        let mut robot = robots.clone();
        for (wish, person) in wishing.into_iter().enumerate() {
            let home = place[person];
            let near = |cup: &usize| match wish % 5 {
                0 => cup.is_multiple_of(2) && place[*cup] == home,
                1 => cup % 2 == 1 && place[*cup] + 1 == home && !home.is_multiple_of(width),
                _ => true,
            };
            let first = any(&cups, wish);
            let mut all = (first..cups.end).chain(cups.start..first);
            let cup = all.find(near).unwrap_or(first);
            world.edges.push((person, "wants", cup));
            if wish % 5 < 2
                && let Some(robot) = robot.next()
            {
                place[robot] = place[cup];
                world.edges.push((robot, "in", place[cup]));
            }
        }
        for robot in robot {
            world.edges.push((robot, "in", any(&rooms, robot)));
        }
        world
    }

    fn add(&mut self, kind: &'static str, count: usize) -> std::ops::Range<usize> {
        let first = self.nodes.len();
        self.nodes.extend(std::iter::repeat_n(kind, count));
        first..first + count
    }

    /// The world as a graph of this process.
    pub(super) fn graph(&self) -> Result<Graph, Failure> {
        let schema = Schema::from_toml("indoor", SCHEMA).map_err(Failure::internal)?;
        let mut graph = Graph::in_memory(schema);
        let id = |index: usize| NodeId(index as u64 + 1);
        let mut commit = |transaction: &Transaction| {
            let done = graph.commit(transaction, "bench", Time::default());
            done.map(drop).map_err(Failure::internal)
        };
        for (chunk, kinds) in self.nodes.chunks(1000).enumerate() {
            let mut transaction = Transaction::new();
            for (index, kind) in kinds.iter().enumerate() {
                let name = format!("{kind}_{}", 1000 * chunk + index + 1);
                transaction.create_node(kind, &name, vec![]);
            }
            commit(&transaction)?;
        }
        for edges in self.edges.chunks(1000) {
            let mut transaction = Transaction::new();
            for &(from, label, to) in edges {
                transaction.create_edge(id(from), label, id(to));
            }
            commit(&transaction)?;
        }
        Ok(graph)
    }

    /// The world for other programs: a line `n TYPE` per node, from id 1 on, and a line
    /// `e FROM LABEL TO` per edge.
    pub(super) fn lines(&self) -> String {
        let mut text = String::new();
        // Writing to a string does not fail.
        for kind in &self.nodes {
            let _ = writeln!(text, "n {kind}");
        }
        for (from, label, to) in &self.edges {
            let _ = writeln!(text, "e {} {label} {}", from + 1, to + 1);
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn a_world_has_its_size_and_no_two_links_from_one_node_to_another() {
        for size in [100, 1000, 3000] {
            let world = Indoor::new(size);
            assert_eq!(world.nodes.len(), size);
            let pairs: BTreeSet<_> = world.edges.iter().map(|(a, _, b)| (a, b)).collect();
            assert_eq!(pairs.len(), world.edges.len());
        }
    }
}
