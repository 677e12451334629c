//! How a run goes on from a graph that an earlier run left on disk. This file guarantees that what
//! the scenario says of the building stands as the scenario says it now, and that what the agents
//! found out is not touched.

use crate::initial_graph::{WORLD, initial_graph};
use crate::scenario::Scenario;
use dsr::{EdgeKey, EdgeRef, NodeRef, Operation, Owner, ReadError, Snapshot, Transaction, Value};
use std::collections::BTreeSet;
use thiserror::Error;

/// Edges that say where a node of the scenario is; those that it does not have any more go.
const WHEREABOUTS: [&str; 2] = ["in", "at"];

/// Why a run cannot go on from a graph.
#[derive(Debug, Error)]
pub enum ResumeError {
    /// The graph is of another world.
    #[error("the graph that is there is one of scenario `{found}`, not of `{wanted}`")]
    OtherScenario {
        /// The scenario that left it.
        found: String,
        /// The one that shall go on.
        wanted: String,
    },
    /// The graph's memory cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
}

/// What is to be changed in `snapshot`, which an earlier run left, before a run goes on from it.
///
/// The world, rooms, doors, places, cameras and activities become what the scenario says, and the
/// robot is where the scenario begins, for the simulated robot is; missions that are over go, so
/// that they are set again. All else stays: objects with their places, people, and missions under
/// way. Frames of cameras that were under way when the earlier run ended are lost.
///
/// # Errors
/// [`ResumeError`].
pub fn resume(scenario: &Scenario, snapshot: &Snapshot) -> Result<Transaction, ResumeError> {
    check_scenario(scenario, snapshot)?;
    let initial = initial_graph(scenario);
    let mut transaction = Transaction::new();
    forget_missions(snapshot, &mut transaction)?;
    let mut wanted: BTreeSet<EdgeRef> = BTreeSet::new();
    let mut known = Vec::new();
    for operation in initial.operations {
        match operation {
            Operation::CreateNode {
                id,
                type_name,
                name,
                attributes,
            } => match snapshot.find_node_by_name(&name)? {
                None => transaction.push(Operation::CreateNode {
                    id,
                    type_name,
                    name,
                    attributes,
                }),
                Some(node) => {
                    if node.type_name() != type_name {
                        let node = NodeRef::Name(name.clone());
                        transaction.push(Operation::RetypeNode { node, type_name });
                    }
                    for (attribute, value) in attributes {
                        transaction.push(Operation::SetAttribute {
                            owner: Owner::Node(name.as_str().into()),
                            name: attribute,
                            value,
                        });
                    }
                    known.push(node);
                }
            },
            other => {
                if let Operation::CreateEdge { edge, .. } = &other {
                    wanted.insert(edge.clone());
                }
                transaction.push(other);
            }
        }
    }
    for node in known {
        for key in node.out_edges() {
            let edge = named(snapshot, key?)?;
            if WHEREABOUTS.contains(&edge.label.as_str()) && !wanted.contains(&edge) {
                transaction.push(Operation::DeleteEdge { edge });
            }
        }
    }
    Ok(transaction)
}

/// Whether a graph that an earlier run left is one of the scenario.
///
/// # Errors
/// [`ResumeError`].
pub fn check_scenario(scenario: &Scenario, snapshot: &Snapshot) -> Result<(), ResumeError> {
    let world = snapshot.find_node_by_name(WORLD)?;
    let found = world.map(|world| world.value("scenario")).transpose()?;
    match found.flatten() {
        Some(Value::String(found)) if found != scenario.name => Err(ResumeError::OtherScenario {
            found,
            wanted: scenario.name.clone(),
        }),
        _ => Ok(()),
    }
}

/// Missions that are over, with their steps.
fn forget_missions(snapshot: &Snapshot, transaction: &mut Transaction) -> Result<(), ReadError> {
    let schema = snapshot.schema();
    let (Some(mission), Some(has_step)) =
        (schema.find_type("mission"), schema.find_label("has_step"))
    else {
        return Ok(());
    };
    for node in snapshot.nodes_of_type(mission) {
        let node = node?;
        let over = match node.value("status")? {
            Some(Value::String(status)) => status == "succeeded" || status == "failed",
            _ => false,
        };
        if !over {
            continue;
        }
        for key in node.out_edges_of(has_step) {
            transaction.delete_node(key?.to);
        }
        transaction.delete_node(node.id());
    }
    Ok(())
}

/// The edge by names, as the scenario's operations name it.
fn named(snapshot: &Snapshot, key: EdgeKey) -> Result<EdgeRef, ReadError> {
    let name = |id| -> Result<NodeRef, ReadError> {
        let node = snapshot.find_node(id)?;
        let name = node.map(|node| node.name()).transpose()?;
        Ok(name.map_or(NodeRef::Id(id), NodeRef::Name))
    };
    Ok(EdgeRef {
        from: name(key.from)?,
        label: snapshot.schema().label_name(key.label).to_owned(),
        to: name(key.to)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::{Graph, Image, Schema, Time};

    const FLAT: &str = r#"
name = "flat"
start = "2026-03-02T10:00:00"
duration = 60.0
[[room]]
name = "hall"
polygon = [[0, 0], [4, 0], [4, 3], [0, 3]]
[[room]]
name = "study"
polygon = [[4, 0], [8, 0], [8, 3], [4, 3]]
[[door]]
rooms = ["hall", "study"]
position = [4.0, 1.5]
width = 1.0
[[place]]
name = "dock"
pose = [1.0, 1.1, 0.0]
[robot]
pose = [1.0, 1.0, 0.5]
"#;

    fn scenario(text: &str) -> Scenario {
        let read = |_: &str| Ok(Vec::new());
        Scenario::parse("scenario.toml", text, &read).expect("a good scenario")
    }

    fn commit(graph: &mut Graph, transaction: &Transaction) {
        graph
            .commit(transaction, "test", Time::default())
            .expect("the graph takes it");
    }

    fn started() -> Graph {
        let schema: Schema = crate::schema().expect("the schema as shipped");
        let mut graph = Graph::in_memory(schema);
        commit(&mut graph, &initial_graph(&scenario(FLAT)));
        graph
    }

    /// Names of nodes, and of edges as text.
    fn told(graph: &Graph) -> (BTreeSet<String>, BTreeSet<String>) {
        let snapshot = graph.snapshot();
        let (mut nodes, mut edges) = (BTreeSet::new(), BTreeSet::new());
        for node in snapshot.nodes() {
            let node = node.expect("readable");
            nodes.insert(node.name().expect("readable"));
            for key in node.out_edges() {
                let edge = named(&snapshot, key.expect("readable")).expect("readable");
                edges.insert(edge.to_string());
            }
        }
        (nodes, edges)
    }

    #[test]
    fn going_on_from_where_nothing_was_found_out_changes_nothing() {
        let mut graph = started();
        let before = told(&graph);
        let transaction = resume(&scenario(FLAT), &graph.snapshot()).expect("the same scenario");
        commit(&mut graph, &transaction);
        assert_eq!(told(&graph), before);
    }

    #[test]
    fn what_was_found_out_stays_and_the_robot_and_the_building_are_as_the_scenario_says() {
        let mut graph = started();
        let mut run = Transaction::new();
        run.create_node("tv", "screen", vec![]);
        run.create_edge("screen", "in", "study");
        run.create_node(
            "mission",
            "done",
            vec![("status".into(), "succeeded".into())],
        );
        run.create_node("mission", "open", vec![("status".into(), "running".into())]);
        for (mission, step) in [("done", "step1"), ("open", "step2")] {
            run.create_node("step", step, vec![]);
            run.create_edge(mission, "has_step", step);
        }
        run.delete_edge("robot", "in", "hall");
        run.delete_edge("robot", "at", "dock");
        run.create_edge("robot", "in", "study");
        commit(&mut graph, &run);
        let saved = Image::of(&graph.snapshot()).expect("readable");
        let mut graph = Graph::in_memory(crate::schema().expect("the schema as shipped"));
        graph.restore(&saved).expect("the same schema");
        let wider = FLAT.replace("[8, 0], [8, 3]", "[9, 0], [9, 3]")
            + "[[place]]\nname = \"desk\"\npose = [8.5, 1.0, 0.0]\n";
        let transaction = resume(&scenario(&wider), &graph.snapshot()).expect("the same name");
        commit(&mut graph, &transaction);
        let (nodes, edges) = told(&graph);
        for there in ["screen", "open", "step2", "desk"] {
            assert!(nodes.contains(there), "{there}");
        }
        for gone in ["done", "step1"] {
            assert!(!nodes.contains(gone), "{gone}");
        }
        for there in [
            "`robot` -in-> `hall`",
            "`robot` -at-> `dock`",
            "`screen` -in-> `study`",
        ] {
            assert!(edges.contains(there), "{there}");
        }
        assert!(!edges.contains("`robot` -in-> `study`"));
        let snapshot = graph.snapshot();
        let study = snapshot.find_node_by_name("study").expect("readable");
        let polygon = study
            .expect("the study")
            .value("polygon")
            .expect("readable");
        assert_eq!(
            polygon,
            Some(Value::F64List(vec![4.0, 0.0, 9.0, 0.0, 9.0, 3.0, 4.0, 3.0]))
        );
    }

    #[test]
    fn the_state_of_another_scenario_is_refused() {
        let graph = started();
        let other = scenario(&FLAT.replace("\"flat\"", "\"house\""));
        let error = resume(&other, &graph.snapshot()).expect_err("another scenario");
        assert!(
            matches!(error, ResumeError::OtherScenario { .. }),
            "{error}"
        );
    }
}
