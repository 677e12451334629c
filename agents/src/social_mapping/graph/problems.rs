//! What somebody entered and the map cannot use, told where it was entered. This file owns the attribute `problems`, and
//! guarantees that it is there for as long as something is wrong and no longer.

use super::StepError;
use crate::social_mapping::rejection::{Entered, Rejection};
use dsr::{Node, Operation, Owner, ReadError, Snapshot, Transaction, Value};

/// The attribute: a line for each thing that is wrong. At an activity or a person what is wrong with it; at the world
/// all of that, what is wrong with the settings, and why there is no map.
pub const PROBLEMS: &str = "problems";

/// Writes what is wrong now, and removes what was before.
pub(super) fn write(
    rejected: &[Rejection],
    stopped: Option<&StepError>,
    snapshot: &Snapshot,
    transaction: &mut Transaction,
) -> Result<(), ReadError> {
    let schema = snapshot.schema();
    if !schema.is_open() && schema.find_attribute(PROBLEMS).is_none() {
        return Ok(());
    }
    let entered: Vec<(Entered<'_>, String)> = rejected
        .iter()
        .filter_map(|one| Some((one.entered()?, one.to_string())))
        .collect();
    let no_map = stopped.map(|error| format!("there is no new map: {error}"));
    if let Some(world) = snapshot.nodes_of("world").next().transpose()? {
        let lines = no_map.iter().chain(entered.iter().map(|(_, said)| said));
        write_one(&world, &lines.cloned().collect::<Vec<_>>(), transaction)?;
    }
    for type_name in ["activity", "person"] {
        for node in snapshot.nodes_of(type_name) {
            let node = node?;
            let name = node.name()?;
            let here = |at: &Entered<'_>| match at {
                Entered::World => false,
                Entered::Activity(at) => type_name == "activity" && *at == name,
                Entered::Person(at) => type_name == "person" && *at == name,
            };
            let lines = entered.iter().filter(|(at, _)| here(at));
            let lines: Vec<String> = lines.map(|(_, said)| said.clone()).collect();
            write_one(&node, &lines, transaction)?;
        }
    }
    Ok(())
}

fn write_one(
    node: &Node<'_>,
    lines: &[String],
    transaction: &mut Transaction,
) -> Result<(), ReadError> {
    let text = (!lines.is_empty()).then(|| Value::from(lines.join("\n")));
    let before = node.value(PROBLEMS)?;
    match text {
        Some(text) if before.as_ref() != Some(&text) => {
            transaction.set(node.id(), PROBLEMS, text);
        }
        None if before.is_some() => transaction.push(Operation::RemoveAttribute {
            owner: Owner::Node(node.id().into()),
            name: PROBLEMS.to_owned(),
        }),
        Some(_) | None => {}
    }
    Ok(())
}
