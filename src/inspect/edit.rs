//! What the page changes, where that was allowed: each a transaction like any agent's, by the name of
//! the inspector. It guarantees that what the store refuses is told in the store's words.

use super::look::{Looker, Source};
use crate::Failure;
use crate::commands::output::clock;
use crate::commands::{graph, mission};
use agents::social_mapping::object_space::Agenda;
use dsr::{CommitError, NodeRef, Snapshot, Time, Transaction};
use executive::{MissionSpec, Preemption, Request, Schedule};
use serde::Deserialize;
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;

/// A change that somebody asks for.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Edit {
    /// Sets an attribute: a path and a value as `cortex graph set` takes them.
    Set { path: String, value: String },
    /// Applies a rule; each variable by the name of its node.
    Rule {
        rule: String,
        binding: BTreeMap<String, String>,
    },
    /// Submits a mission: a goal in AGGL.
    Mission {
        name: String,
        goal: String,
        #[serde(default)]
        priority: i64,
    },
    /// Changes when an activity takes place, in seconds since 1970, and whether it does.
    Activity {
        name: String,
        start: f64,
        end: f64,
        cancelled: bool,
    },
    /// Asks something of a mission: pause, resume or cancel.
    Request { mission: String, request: String },
}

/// Makes a change; the version that it made.
pub(super) fn edit(looker: &mut Looker, edit: &Edit) -> Result<Json, Failure> {
    let Source::Live(session) = &mut looker.source else {
        return Err(Failure::input("a recording is read, not written"));
    };
    let snapshot = session.snapshot().map_err(Failure::internal)?;
    let transaction = transaction(&snapshot, edit)?;
    match session.commit(&transaction, snapshot.time()) {
        Ok(commit) => Ok(json!({"version": commit.version.0})),
        Err(CommitError::Refused(refusal)) => Err(Failure::input(refusal)),
        Err(error) => Err(Failure::internal(error)),
    }
}

fn transaction(snapshot: &Snapshot, edit: &Edit) -> Result<Transaction, Failure> {
    let mut transaction = Transaction::new();
    match edit {
        Edit::Set { path, value } => return graph::setting(snapshot, path, value),
        Edit::Rule { rule, binding } => {
            let bound = binding.iter();
            let bound = bound.map(|(var, node)| (var.clone(), NodeRef::Name(node.clone())));
            transaction.apply_rule(rule, bound.collect());
        }
        Edit::Mission {
            name,
            goal,
            priority,
        } => {
            mission::check_goal(goal, "goal", snapshot)?;
            let spec = MissionSpec {
                name: name.clone(),
                goal: goal.clone(),
                priority: *priority,
                deadline: None,
                preemption: Preemption::default(),
                schedule: Schedule::default(),
            };
            transaction.create_node("mission", name, spec.attributes());
        }
        Edit::Activity {
            name,
            start,
            end,
            cancelled,
        } => {
            let [from, to] = [*start, *end].map(Time::from_seconds);
            if Agenda::new(from, to).is_err() {
                let [from, to] = [from, to].map(clock);
                return Err(Failure::input_with_help(
                    format!("{name} would begin at {from} and end at {to}"),
                    "let it end after it begins",
                ));
            }
            for (attribute, value) in [("start", *start), ("end", *end)] {
                transaction.set(name.as_str(), attribute, value);
            }
            transaction.set(name.as_str(), "cancelled", *cancelled);
        }
        Edit::Request { mission, request } => {
            let request = Request::find(request)
                .ok_or_else(|| Failure::input("ask to pause, resume or cancel"))?;
            transaction.set(mission.as_str(), "request", request.name());
        }
    }
    Ok(transaction)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::Graph;

    fn of(json: Json) -> Result<Transaction, Failure> {
        let mut graph = Graph::in_memory(scenarios::schema().unwrap());
        let mut robot = Transaction::new();
        robot.create_node("robot", "shelly", vec![]);
        graph.commit(&robot, "test", Time::default()).unwrap();
        transaction(&graph.snapshot(), &serde_json::from_value(json).unwrap())
    }

    #[test]
    fn what_is_asked_becomes_one_transaction_and_nonsense_is_refused() {
        let set =
            |value: &str| of(json!({"kind": "set", "path": "shelly.max_speed", "value": value}));
        assert_eq!(set("0.4").unwrap().operations.len(), 1);
        assert!(set("fast").is_err());
        let mission = |goal: &str| of(json!({"kind": "mission", "name": "m", "goal": goal}));
        assert!(mission("no goal at all").is_err());
        assert!(of(json!({"kind": "request", "mission": "m", "request": "explode"})).is_err());
        let activity = |end: f64| {
            of(
                json!({"kind": "activity", "name": "news", "start": 60.0, "end": end, "cancelled": true}),
            )
        };
        assert_eq!(activity(90.0).unwrap().operations.len(), 3);
        assert!(activity(50.0).is_err());
        let request = of(json!({"kind": "request", "mission": "m", "request": "cancel"}));
        assert_eq!(request.unwrap().operations.len(), 1);
    }
}
