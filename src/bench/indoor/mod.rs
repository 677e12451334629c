//! Indoor planning tasks of any size: rooms with doors, people, things to hand over and people to
//! inform. This file guarantees that the same numbers give the same task everywhere.

use super::chance::Chance;
use serde_json::json;
use std::fmt::Write as _;

/// The rules of all tasks.
pub(super) const RULES: &str = include_str!("indoor.aggl");

/// How large a task is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Size {
    pub(super) rooms: u32,
    pub(super) people: u32,
    /// Things that somebody shall be handed.
    pub(super) deliveries: u32,
    /// People who shall be informed.
    pub(super) informed: u32,
}

/// A world and a goal, as text.
#[derive(Debug)]
pub(super) struct Task {
    pub(super) world: String,
    pub(super) goal: String,
}

/// The task of a size: every room has a door to one before it, a third of them to another one, too.
pub(super) fn task(size: Size) -> Task {
    let mut chance = Chance::new(u64::from(size.rooms) << 32 | u64::from(size.people));
    let mut nodes = vec![json!({"type": "robot", "name": "shelly", "attributes": {}, "id": 1})];
    let mut edges = Vec::new();
    let mut add = |kind: &str, name: String| {
        let id = nodes.len() + 1;
        nodes.push(json!({"id": id, "type": kind, "name": name, "attributes": {}}));
        id
    };
    let rooms: Vec<usize> = (0..size.rooms)
        .map(|i| add("room", format!("room{i}")))
        .collect();
    let people: Vec<usize> = (0..size.people)
        .map(|i| add("person", format!("person{i}")))
        .collect();
    let things: Vec<usize> = (0..size.deliveries)
        .map(|i| add("object", format!("thing{i}")))
        .collect();
    let mut door = |a: usize, b: usize, distance: u32| {
        for (from, to) in [(a, b), (b, a)] {
            let attributes = json!({"distance": f64::from(distance)});
            edges.push(
                json!({"from": from, "label": "connected", "to": to, "attributes": attributes}),
            );
        }
    };
    for room in 1..size.rooms {
        // A neighbour among the last few makes corridors rather than a star.
        let back = 1 + chance.below(room.min(6));
        door(
            rooms[room as usize],
            rooms[(room - back) as usize],
            2 + chance.below(9),
        );
    }
    for room in 0..size.rooms / 3 {
        let (a, b) = (3 * room, chance.below(size.rooms));
        if a.abs_diff(b) > 6 {
            door(rooms[a as usize], rooms[b as usize], 2 + chance.below(9));
        }
    }
    for &who in [1].iter().chain(&people).chain(&things) {
        let room = rooms[chance.below(size.rooms) as usize];
        edges.push(json!({"from": who, "label": "in", "to": room, "attributes": {}}));
    }
    let mut goal = "{\n".to_owned();
    let mut wanted = String::new();
    // Writing to a string does not fail.
    for thing in 0..size.deliveries {
        let _ = writeln!(goal, "\t\"thing{thing}\":object");
        let to = chance.below(size.people);
        let _ = writeln!(wanted, "\t\"person{to}\"->\"thing{thing}\"(has)");
    }
    for person in 0..size.people {
        let named = wanted.contains(&format!("\"person{person}\""));
        if person < size.informed || named {
            let _ = writeln!(goal, "\t\"person{person}\":person");
        }
        if person < size.informed {
            let _ = writeln!(wanted, "\t\"person{person}\"->\"person{person}\"(informed)");
        }
    }
    let world = json!({"format": "dsr/1", "nodes": nodes, "edges": edges});
    Task {
        world: world.to_string(),
        goal: goal + &wanted + "}\n",
    }
}

/// Rooms in a square, each with a door to its neighbours, and the robot in a corner, wanted in the
/// opposite one.
pub(super) fn grid(side: u32) -> Task {
    let mut nodes = vec![json!({"id": 1, "type": "robot", "name": "shelly", "attributes": {}})];
    let mut edges = vec![json!({"from": 1, "label": "in", "to": 2, "attributes": {}})];
    for index in 0..side * side {
        let (id, x, y) = (index + 2, index % side, index / side);
        nodes.push(
            json!({"id": id, "type": "room", "name": format!("room{index}"), "attributes": {}}),
        );
        let right = (x + 1 < side).then_some(id + 1);
        let below = (y + 1 < side).then_some(id + side);
        for other in [right, below].into_iter().flatten() {
            for (from, to) in [(id, other), (other, id)] {
                let attributes = json!({"distance": 1.0});
                edges.push(
                    json!({"from": from, "label": "connected", "to": to, "attributes": attributes}),
                );
            }
        }
    }
    let last = side * side - 1;
    Task {
        world: json!({"format": "dsr/1", "nodes": nodes, "edges": edges}).to_string(),
        goal: format!(
            "{{\n\t\"shelly\":robot\n\t\"room{last}\":room\n\t\"shelly\"->\"room{last}\"(in)\n}}\n"
        ),
    }
}
