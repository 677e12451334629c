//! The cheapest plan by uniform-cost search over copies of the graph: slow, and plainly right.

use crate::{Options, Outcome, Plan, PlanStep, Planner};
use dsr::{EdgeRef, Graph, NodeId, Operation, ReadError, Snapshot, Time, Transaction};
use grammar::{Binding, Goal, Grammar};
use std::cell::Cell;
use std::collections::BTreeSet;
use std::rc::Rc;
use std::sync::Arc;

/// Searches whole graphs.
#[derive(Debug, Clone, Default)]
pub(crate) struct Exhaustive {
    /// How often it was asked.
    pub(crate) asked: Rc<Cell<usize>>,
}

/// What of the graph the rules are about.
fn copy(snapshot: &Snapshot, grammar: &Grammar) -> Graph {
    let schema = snapshot.schema();
    let mut graph = Graph::in_memory(schema.clone());
    graph.set_rules(Arc::new(grammar.clone()));
    let mut transaction = Transaction::new();
    let about = |name: &str| name != "mission" && name != "step";
    let nodes: Vec<_> = snapshot.nodes().map(Result::unwrap).collect();
    for node in nodes.iter().filter(|node| about(node.type_name())) {
        transaction.push(Operation::CreateNode {
            id: Some(node.id()),
            type_name: node.type_name().to_owned(),
            name: node.name().unwrap(),
            attributes: Vec::new(),
        });
    }
    for node in nodes.iter().filter(|node| about(node.type_name())) {
        for edge in node.out_edges().map(Result::unwrap) {
            let edge = EdgeRef::new(edge.from, schema.label_name(edge.label), edge.to);
            transaction.push(Operation::CreateEdge {
                edge,
                attributes: Vec::new(),
            });
        }
    }
    graph
        .commit(&transaction, "planner", Time::default())
        .unwrap();
    graph
}

fn key(snapshot: &Snapshot) -> Vec<(NodeId, u16, NodeId)> {
    let mut key: Vec<_> = (snapshot.nodes().map(Result::unwrap))
        .flat_map(|node| node.out_edges().map(Result::unwrap).collect::<Vec<_>>())
        .map(|edge| (edge.from, edge.label.0, edge.to))
        .collect();
    key.sort_unstable();
    key
}

fn pairs(binding: &Binding) -> Vec<(String, NodeId)> {
    binding
        .iter()
        .map(|(variable, node)| (variable.to_string(), node))
        .collect()
}

impl Planner for Exhaustive {
    fn plan(
        &self,
        grammar: &Grammar,
        snapshot: &Snapshot,
        goal: &Goal,
        options: &Options,
    ) -> Result<Outcome, ReadError> {
        self.asked.set(self.asked.get() + 1);
        let mut frontier: Vec<(f64, Vec<PlanStep>, Graph)> =
            vec![(0.0, Vec::new(), copy(snapshot, grammar))];
        let mut seen = BTreeSet::new();
        while let Some(best) =
            (0..frontier.len()).min_by(|&a, &b| frontier[a].0.total_cmp(&frontier[b].0))
        {
            let (cost, steps, graph) = frontier.remove(best);
            let here = graph.snapshot();
            if grammar.goal_holds(&here, goal).unwrap().is_some() {
                return Ok(Outcome::Solved(Plan {
                    steps,
                    cost,
                    optimal: true,
                }));
            }
            if !seen.insert(key(&here)) {
                continue;
            }
            for rule in &grammar.rules {
                for binding in grammar.matches(&here, rule, &Binding::new()).unwrap() {
                    let binding = binding.unwrap();
                    let mut next = copy(&here, grammar);
                    let mut transaction = Transaction::new();
                    transaction.apply_rule(&rule.name, binding.to_refs());
                    next.commit(&transaction, "planner", Time::default())
                        .unwrap();
                    let extra = |(name, at, extra): &(String, Vec<(String, NodeId)>, f64)| {
                        (rule.name == **name && *at == pairs(&binding)).then_some(*extra)
                    };
                    let own = grammar.cost(&here, rule, &binding).unwrap()
                        + options.penalties.iter().filter_map(extra).sum::<f64>();
                    let mut steps = steps.clone();
                    let (rule, binding) = (rule.name.to_string(), pairs(&binding));
                    steps.push(PlanStep {
                        rule,
                        binding,
                        cost: own,
                    });
                    frontier.push((cost + own, steps, next));
                }
            }
        }
        let obstacle = grammar.goal_obstacle(snapshot, goal).unwrap();
        let reason = obstacle.map_or_else(String::new, |obstacle| obstacle.to_string());
        Ok(Outcome::Unsolvable { reason })
    }
}
