//! What it takes to keep matches up to date while robots leave and enter rooms. It guarantees that in the end the
//! watch has as many matches as there are.

use super::indoor::Indoor;
use super::{Quantity, middle, read};
use crate::Failure;
use dsr::{Graph, NodeId, Time, Transaction};
use grammar::{Binding, Grammar, Watch};
use std::sync::Arc;
use std::time::Instant;

/// Rules of which all begin as `changeRoom` does: such as match nearly everywhere, and such as match where few people are.
const RELATED: [(&str, &str); 2] = [
    ("related", include_str!("related.aggl")),
    ("rare", include_str!("rare.aggl")),
];

/// What it takes a watch over all rules to take in that a robot left or entered a room.
pub(super) fn changing(
    grammar: &Arc<Grammar>,
    graph: &mut Graph,
    world: &Indoor,
    size: &str,
    quantities: &mut Vec<Quantity>,
) -> Result<(), Failure> {
    let mut times = deltas(grammar, &names(grammar), graph, world, 4000)?;
    for (what, share) in [("delta", 0.5), ("delta_99_percent", 0.99)] {
        let name = format!("{what}_{size}");
        quantities.push(Quantity::new(name, middle(&mut times, share), "us"));
    }
    Ok(())
}

/// The same for rules that begin alike: watched together, beside the sum of what it takes for each alone.
pub(super) fn related(
    graph: &mut Graph,
    world: &Indoor,
    size: &str,
    quantities: &mut Vec<Quantity>,
) -> Result<(), Failure> {
    let mean = |times: &[f64]| times.iter().sum::<f64>() / times.len() as f64;
    for (kind, text) in RELATED {
        let grammar = read(text)?;
        let names = names(&grammar);
        let mut alone = 0.0;
        for name in &names {
            alone += mean(&deltas(&grammar, &[name], graph, world, 2000)?);
        }
        let together = mean(&deltas(&grammar, &names, graph, world, 2000)?);
        let name = format!("delta_{}_{kind}_{size}", names.len());
        let mut quantity = Quantity::new(name, together, "us");
        quantity.peer = Some((alone, false));
        quantities.push(quantity);
    }
    Ok(())
}

fn names(grammar: &Grammar) -> Vec<&str> {
    let rules = grammar.rules.iter();
    rules.map(|rule| rule.name.as_str()).collect()
}

/// Microseconds that a watch of rules takes for each of so many changes.
fn deltas(
    grammar: &Arc<Grammar>,
    names: &[&str],
    graph: &mut Graph,
    world: &Indoor,
    turns: usize,
) -> Result<Vec<f64>, Failure> {
    let watch = Watch::new(Arc::clone(grammar), names, &graph.snapshot());
    let mut watch = watch.map_err(Failure::internal)?;
    let rooms = world.nodes.iter().filter(|kind| **kind == "room").count();
    let id = |index: usize| NodeId(index as u64 + 1);
    let mut places = places(graph, world)?;
    let mut times = Vec::new();
    for turn in 0..turns {
        let robot = turn / 2 % places.len();
        let (node, room) = places[robot];
        let mut transaction = Transaction::new();
        if turn % 2 == 0 {
            transaction.delete_edge(id(node), "in", id(room));
        } else {
            places[robot].1 = (room + 1) % rooms;
            transaction.create_edge(id(node), "in", id(places[robot].1));
        }
        let committed = graph.commit(&transaction, "bench", Time::default());
        let (_, change) = committed.map_err(Failure::internal)?;
        let snapshot = graph.snapshot();
        let started = Instant::now();
        let delta = watch
            .update(&change, &snapshot)
            .map_err(Failure::internal)?;
        times.push(started.elapsed().as_secs_f64() * 1e6);
        drop(delta);
    }
    let snapshot = graph.snapshot();
    for rule in grammar
        .rules
        .iter()
        .filter(|rule| names.contains(&rule.name.as_str()))
    {
        let fresh = grammar
            .matches(&snapshot, rule, &Binding::new())
            .map_err(Failure::internal)?;
        let fresh = fresh.count_all().map_err(Failure::internal)?;
        if fresh != watch.count(&rule.name) as u64 {
            let told = format!(
                "the watch has other matches of {} than there are",
                rule.name
            );
            return Err(Failure::internal(told));
        }
    }
    Ok(times)
}

/// By robot, its place and that of its room among the world's nodes.
fn places(graph: &Graph, world: &Indoor) -> Result<Vec<(usize, usize)>, Failure> {
    let start = graph.snapshot();
    let within = start.schema().find_label("in");
    let mut places = Vec::new();
    let nodes = world.nodes.iter().enumerate();
    for (robot, _) in nodes.filter(|(_, kind)| **kind == "robot") {
        let id = NodeId(robot as u64 + 1);
        let node = start.find_node(id).map_err(Failure::internal)?;
        let rooms = node
            .zip(within)
            .map(|(node, within)| node.targets_of(within));
        for room in rooms.into_iter().flatten() {
            places.push((robot, room.map_err(Failure::internal)?.0 as usize - 1));
        }
    }
    Ok(places)
}
