//! A house in a store of its own, where an executive and an agent take turns.
//!
//! ```text
//! hall -- kitchen -- ward     ana is in the ward, the robot in the hall
//!    \--- garden ----/
//! ```

use super::RULES;
use crate::testing::{centre, read};
use crate::{
    Config, Decision, Executive, MissionSpec, Options, Outcome, Planner, Preemption, RulePlanner,
    Schedule,
};
use dsr::{Change, EdgeKey, Graph, Node, NodeId, ReadError, Snapshot, Time, Transaction, Value};
use grammar::{Goal, Grammar};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::rc::Rc;

/// The planner, counting how often it is asked.
#[derive(Debug, Clone, Default)]
pub(in crate::mission) struct Counting {
    planner: RulePlanner,
    pub(in crate::mission) asked: Rc<Cell<usize>>,
}

impl Planner for Counting {
    fn plan(
        &self,
        grammar: &Grammar,
        snapshot: &Snapshot,
        goal: &Goal,
        options: &Options,
        interrupted: &dyn Fn() -> bool,
    ) -> Result<Outcome, ReadError> {
        self.asked.set(self.asked.get() + 1);
        self.planner
            .plan(grammar, snapshot, goal, options, interrupted)
    }
}

/// How the agent takes its steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::mission) enum Agent {
    /// Begins in one turn, is done in the next.
    Works,
    /// Begins, and never ends.
    Hangs,
    /// Does nothing at all.
    Silent,
    /// Begins, and fails at rules of that name.
    FailsAt(&'static str),
}

/// The house.
pub(in crate::mission) struct House {
    pub(in crate::mission) graph: Graph,
    pub(in crate::mission) executive: Executive<Counting>,
    pub(in crate::mission) planner: Counting,
    pub(in crate::mission) now: Time,
    pub(in crate::mission) agent: Agent,
    pub(in crate::mission) journal: Vec<String>,
    missions: Vec<MissionSpec>,
}

/// Seconds from turn to turn.
const TURN: f64 = 0.5;

impl House {
    /// A house with missions `(name, goal, priority)`.
    pub(in crate::mission) fn new(missions: &[(&str, &str, i64)]) -> Self {
        let graph = centre(&read(RULES));
        let missions: Vec<MissionSpec> = missions
            .iter()
            .map(|&(name, goal, priority)| {
                let (name, goal) = (name.to_owned(), goal.to_owned());
                MissionSpec {
                    name,
                    goal,
                    priority,
                    deadline: None,
                    preemption: Preemption::default(),
                    schedule: Schedule::default(),
                }
            })
            .collect();
        let planner = Counting::default();
        let mut house = Self {
            graph,
            executive: Executive::new(read(RULES), missions.clone(), planner.clone()),
            planner,
            now: Time::from_seconds(1000.0),
            agent: Agent::Works,
            journal: Vec::new(),
            missions,
        };
        house.change(|transaction| {
            for room in ["hall", "kitchen", "garden", "ward"] {
                transaction.create_node("room", room, vec![]);
            }
            transaction.create_node("robot", "shelly", vec![]);
            transaction.create_node("person", "ana", vec![]);
            let doors = [
                ("hall", "kitchen"),
                ("kitchen", "ward"),
                ("hall", "garden"),
                ("garden", "ward"),
            ];
            for (a, b) in doors {
                transaction.create_edge(a, "connected", b);
                transaction.create_edge(b, "connected", a);
            }
            transaction.create_edge("shelly", "in", "hall");
            transaction.create_edge("ana", "in", "ward");
        });
        house
    }

    /// Somebody changes the graph.
    pub(in crate::mission) fn change(&mut self, change: impl FnOnce(&mut Transaction)) -> Change {
        self.try_change(change).unwrap()
    }

    /// The same, of what the schema may forbid.
    pub(in crate::mission) fn try_change(
        &mut self,
        change: impl FnOnce(&mut Transaction),
    ) -> Option<Change> {
        let mut transaction = Transaction::new();
        change(&mut transaction);
        let committed = self.graph.commit(&transaction, "world", self.now);
        committed.ok().map(|(_, change)| change)
    }

    /// Somebody submits a mission.
    pub(in crate::mission) fn submit(&mut self, name: &str, goal: &str) {
        let goal = vec![("goal".to_owned(), goal.into())];
        self.change(|transaction| transaction.create_node("mission", name, goal));
    }

    /// The door is closed.
    pub(in crate::mission) fn close(&mut self, a: &str, b: &str) {
        self.change(|transaction| {
            transaction.delete_edge(a, "connected", b);
            transaction.delete_edge(b, "connected", a);
        });
    }

    /// The executive is started anew.
    pub(in crate::mission) fn restart(&mut self) {
        self.executive = Executive::new(read(RULES), self.missions.clone(), self.planner.clone());
    }

    /// The executive is started anew with other settings.
    pub(in crate::mission) fn configure(&mut self, config: Config) {
        let (missions, planner) = (self.missions.clone(), self.planner.clone());
        self.executive = Executive::with_config(read(RULES), missions, planner, config);
    }

    /// The executive's turn; what it would have written.
    pub(in crate::mission) fn decide(&mut self) -> Vec<Transaction> {
        self.now = self.now + TURN;
        let transactions = self
            .executive
            .step(self.now, &self.graph.snapshot())
            .unwrap();
        let entries = self.executive.take_journal();
        self.journal
            .extend(entries.into_iter().map(|entry| match &*entry.why {
                "" => entry.what,
                why => format!("{} ({why})", entry.what),
            }));
        transactions
    }

    /// The executive's turn; how many transactions it made.
    pub(in crate::mission) fn turn(&mut self) -> usize {
        let transactions = self.decide();
        for transaction in &transactions {
            self.graph
                .commit(transaction, "executive", self.now)
                .unwrap();
        }
        transactions.len()
    }

    /// So many turns of both.
    pub(in crate::mission) fn run(&mut self, turns: usize) {
        for _ in 0..turns {
            self.turn();
            self.act();
        }
    }

    /// The agent's turn.
    pub(in crate::mission) fn act(&mut self) {
        let snapshot = self.graph.snapshot();
        let steps = snapshot.nodes_of_type(snapshot.schema().find_type("step").unwrap());
        let mut transaction = Transaction::new();
        for step in steps.map(Result::unwrap) {
            let rule = text(&step, "rule");
            match (&*text(&step, "status"), self.agent) {
                (_, Agent::Silent) => {}
                ("dispatched", _) => transaction.set(step.id(), "status", "running"),
                ("running", Agent::FailsAt(name)) if name == rule => {
                    transaction.set(step.id(), "status", "failed");
                    transaction.set(step.id(), "reason", "it is too far");
                }
                ("running", Agent::Works | Agent::FailsAt(_)) => {
                    let binding: BTreeMap<String, String> =
                        serde_json::from_str(&text(&step, "binding")).unwrap();
                    let binding = binding
                        .into_iter()
                        .map(|(v, node)| (v, node.into()))
                        .collect();
                    transaction.apply_rule(&rule, binding);
                    transaction.set(step.id(), "status", "done");
                }
                _ => {}
            }
        }
        if !transaction.is_empty() {
            self.graph
                .commit(&transaction, "navigation", self.now)
                .unwrap();
        }
    }

    /// The mission as `status, replans: reason`.
    pub(in crate::mission) fn mission(&self, name: &str) -> String {
        let snapshot = self.graph.snapshot();
        let mission = snapshot.find_node_by_name(name).unwrap().unwrap();
        let replans = mission
            .value("replans")
            .unwrap()
            .and_then(|v| v.as_f64())
            .unwrap();
        let (status, reason) = (text(&mission, "status"), text(&mission, "reason"));
        format!("{status}, {replans}: {reason}")
    }

    /// What was decided about the mission.
    pub(in crate::mission) fn decisions(&self, name: &str) -> Vec<Decision> {
        let missions = crate::missions(&self.graph.snapshot()).unwrap();
        let mission = missions.into_iter().find(|mission| mission.name == name);
        mission.unwrap().decisions()
    }

    /// The steps in their order, as `name rule(nodes) status: reason`.
    pub(in crate::mission) fn steps(&self) -> String {
        let snapshot = self.graph.snapshot();
        let steps = snapshot.nodes_of_type(snapshot.schema().find_type("step").unwrap());
        let mut lines: Vec<(u64, String)> = steps
            .map(Result::unwrap)
            .map(|step| {
                let Some(Value::U64(index)) = step.value("index").unwrap() else {
                    panic!()
                };
                let binding: BTreeMap<String, String> =
                    serde_json::from_str(&text(&step, "binding")).unwrap();
                let nodes: Vec<String> = binding.into_values().collect();
                let (name, rule) = (step.name().unwrap(), text(&step, "rule"));
                let (status, reason) = (text(&step, "status"), text(&step, "reason"));
                let line = format!("{name} {rule}({}) {status}: {reason}", nodes.join(", "));
                (index, line.trim_end_matches([':', ' ']).to_owned())
            })
            .collect();
        lines.sort();
        let lines: Vec<String> = lines.into_iter().map(|(_, line)| line).collect();
        lines.join("\n")
    }

    /// Whether the edge is there.
    pub(in crate::mission) fn holds(&self, from: &str, label: &str, to: &str) -> bool {
        let snapshot = self.graph.snapshot();
        let id = |name| find(&snapshot, name);
        let label = snapshot.schema().find_label(label).unwrap();
        snapshot
            .find_edge(EdgeKey {
                from: id(from),
                label,
                to: id(to),
            })
            .unwrap()
            .is_some()
    }
}

fn find(snapshot: &Snapshot, name: &str) -> NodeId {
    snapshot.find_node_by_name(name).unwrap().unwrap().id()
}

fn text(node: &Node, name: &str) -> String {
    node.value(name)
        .unwrap()
        .and_then(|v| v.as_str().map(str::to_owned))
        .unwrap_or_default()
}
