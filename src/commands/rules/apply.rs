//! `cortex rules apply`: what a rule changes. In a file's world it is only tried, on a graph of this
//! process; in a running system the store applies it.

use super::amounts::amounts;
use super::{Names, World, find_rule, load, unmatched, words};
use crate::cli::WorldArgs;
use crate::commands::graph::no_such;
use crate::commands::output::{print, print_json};
use crate::{Answer, Failure};
use dsr::{CommitError, NodeId, NodeRef, Operation, Owner, Snapshot, Time, Transaction, json};
use grammar::{ApplyError, Binding, Grammar, Rule};
use serde_json::{Map, Value as Json, json};
use std::fmt::Write as _;
use std::path::Path;

/// The binding that the user gave, by names or ids of nodes.
fn given(snapshot: &Snapshot, bind: &[(String, String)]) -> Result<Binding, Failure> {
    let mut binding = Binding::new();
    for (variable, node) in bind {
        let mut found = snapshot
            .find_node_by_name(node)
            .map_err(Failure::internal)?;
        if let (None, Ok(id)) = (&found, node.parse()) {
            found = snapshot.find_node(NodeId(id)).map_err(Failure::internal)?;
        }
        let found = found.ok_or_else(|| no_such(snapshot, node, "node"))?;
        if binding
            .get(variable)
            .is_some_and(|bound| bound != found.id())
        {
            return Err(Failure::input(format!(
                "`{variable}` is bound to two nodes"
            )));
        }
        binding.insert(variable.as_str(), found.id());
    }
    Ok(binding)
}

/// The one match that extends a binding, or why there is none.
fn the_match(
    grammar: &Grammar,
    snapshot: &Snapshot,
    rule: &Rule,
    given: &Binding,
) -> Result<Result<Binding, String>, Failure> {
    let found = grammar
        .matches(snapshot, rule, given)
        .map_err(Failure::input)?;
    let found: Vec<Binding> = found.take(2).collect::<Result<_, _>>().map_err(unmatched)?;
    let all_given = given.len() == rule.bound_nodes().count();
    match &found[..] {
        [one] => Ok(Ok(one.clone())),
        [] if all_given => {
            let why = grammar.obstacle(snapshot, rule, given).map_err(unmatched)?;
            Ok(Err(why.map_or_else(String::new, |why| why.to_string())))
        }
        [] if given.is_empty() => Ok(Err("its left-hand side holds nowhere".to_owned())),
        [] => {
            let why = grammar.partial_obstacle(snapshot, rule, given);
            let nowhere = "its left-hand side holds nowhere with this binding".to_owned();
            Ok(Err(match why.map_err(unmatched)? {
                Some(why) => format!("{nowhere}: {why}"),
                None => nowhere,
            }))
        }
        [first, second, ..] => {
            let mut names = Names::new(snapshot);
            let pair = [names.of_all(first)?, names.of_all(second)?].map(|m| words(rule, &m));
            let help = format!("choose with --bind, for example:\n{}\n{}", pair[0], pair[1]);
            Err(Failure::input_with_help(
                format!("`{}` matches more than once", rule.name),
                help,
            ))
        }
    }
}

pub(super) fn apply(
    file: &Path,
    name: &str,
    world: &WorldArgs,
    dry_run: bool,
    bind: &[(String, String)],
    as_json: bool,
) -> Result<Answer, Failure> {
    let grammar = load(file, Some(name))?;
    let rule = find_rule(&grammar, name)?;
    let mut world = World::open(world)?;
    let snapshot = world.snapshot()?;
    let given = given(&snapshot, bind)?;
    let applied = match the_match(&grammar, &snapshot, rule, &given)? {
        Ok(binding) => {
            let operations = operations(&grammar, &snapshot, rule, &binding)?;
            let committed = match operations {
                Ok(operations) => commit(&mut world, dry_run, rule, &binding, operations)?,
                Err(reason) => Err(reason),
            };
            committed.map(|(version, operations)| (binding, version, operations))
        }
        Err(reason) => Err(reason),
    };
    let (binding, version, operations) = match applied {
        Ok(applied) => applied,
        Err(reason) if as_json => {
            print_json(&json!({"rule": name, "applicable": false, "reason": reason}))?;
            return Ok(Answer::No);
        }
        Err(reason) => {
            print(&format!("{name} is not applicable: {reason}\n"))?;
            return Ok(Answer::No);
        }
    };
    let mut names = Names::new(&snapshot);
    let named = names.of_all(&binding)?;
    let mut rows = Vec::new();
    let mut text = format!("{name}  {}\n", words(rule, &named));
    for operation in &operations {
        let (row, line) = describe(&mut names, operation)?;
        rows.push(row);
        // Writing to a string does not fail.
        let _ = writeln!(text, "    {line}");
    }
    let amounts = amounts(&grammar, &snapshot, rule, &binding)?;
    if as_json {
        let mut object = json!({
            "rule": name, "applicable": true, "binding": named, "operations": rows,
            "committed": version.is_some(), "version": version,
        });
        amounts.put(&mut object);
        print_json(&object)?;
    } else {
        let _ = writeln!(text, "{}", amounts.words());
        if let Some(version) = version {
            // Writing to a string does not fail.
            let _ = writeln!(text, "version {version}");
        }
        print(&text)?;
    }
    Ok(Answer::Yes)
}

/// What the rule does at a match, or why it does not.
fn operations(
    grammar: &Grammar,
    snapshot: &Snapshot,
    rule: &Rule,
    binding: &Binding,
) -> Result<Result<Vec<Operation>, String>, Failure> {
    match grammar.apply(snapshot, &rule.name, binding) {
        Ok(operations) => Ok(Ok(operations)),
        Err(ApplyError::Match(error)) => Err(unmatched(error)),
        Err(refused) => Ok(Err(refused.to_string())),
    }
}

/// Operations that are in force from a version of a running system, or would be.
type Applied = (Option<u64>, Vec<Operation>);

/// Has the change made, or in a file's world tried; or says why the graph does not allow it.
fn commit(
    world: &mut World,
    dry_run: bool,
    rule: &Rule,
    binding: &Binding,
    operations: Vec<Operation>,
) -> Result<Result<Applied, String>, Failure> {
    match world {
        World::Live(_) if dry_run => Ok(Ok((None, operations))),
        World::Live(session) => {
            let mut transaction = Transaction::new();
            transaction.apply_rule(&rule.name, binding.to_refs());
            let time = session.snapshot().map_err(Failure::internal)?.time();
            match session.commit(&transaction, time) {
                Ok(commit) => Ok(Ok((Some(commit.version.0), operations))),
                Err(CommitError::Refused(refusal)) => Ok(Err(refusal.to_string())),
                Err(error) => Err(Failure::internal(error)),
            }
        }
        World::File(graph) => {
            let transaction = Transaction {
                operations: operations.clone(),
                ..Transaction::new()
            };
            let tried = graph.commit(&transaction, "rules", Time::default());
            Ok(tried
                .map(|_| (None, operations))
                .map_err(|refusal| refusal.to_string()))
        }
    }
}

/// An operation as JSON and as a line.
fn describe(names: &mut Names<'_>, operation: &Operation) -> Result<(Json, String), Failure> {
    let mut name = |node: &NodeRef| match node {
        NodeRef::Id(id) => names.of(*id),
        NodeRef::Name(name) => Ok(name.clone()),
    };
    let values = |list: &[(String, dsr::Value)]| -> Map<String, Json> {
        list.iter()
            .map(|(name, value)| (name.clone(), json::value_to_json(value)))
            .collect()
    };
    Ok(match operation {
        Operation::CreateNode {
            type_name,
            name,
            attributes,
            ..
        } => (
            json!({"do": "create_node", "node": name, "type": type_name, "attributes": values(attributes)}),
            format!("+ {name} : {type_name}"),
        ),
        Operation::DeleteNode { node } => {
            let node = name(node)?;
            (
                json!({"do": "delete_node", "node": node}),
                format!("- {node}"),
            )
        }
        Operation::RetypeNode { node, type_name } => {
            let node = name(node)?;
            let line = format!("{node} : {type_name}");
            (
                json!({"do": "retype_node", "node": node, "type": type_name}),
                line,
            )
        }
        Operation::CreateEdge { edge, attributes } => {
            let (from, label, to) = (name(&edge.from)?, &edge.label, name(&edge.to)?);
            let line = format!("+ {from} -{label}-> {to}");
            let attributes = values(attributes);
            (
                json!({"do": "create_edge", "from": from, "label": label, "to": to, "attributes": attributes}),
                line,
            )
        }
        Operation::DeleteEdge { edge } => {
            let (from, label, to) = (name(&edge.from)?, &edge.label, name(&edge.to)?);
            let line = format!("- {from} -{label}-> {to}");
            (
                json!({"do": "delete_edge", "from": from, "label": label, "to": to}),
                line,
            )
        }
        Operation::SetAttribute {
            owner,
            name: attribute,
            value,
        } => {
            let (mut row, owner) = owner_json(&mut name, owner)?;
            let value = json::value_to_json(value);
            let line = format!("{owner}.{attribute} = {value}");
            row["do"] = json!("set_attribute");
            row["attribute"] = json!(attribute);
            row["value"] = value;
            (row, line)
        }
        Operation::RemoveAttribute {
            owner,
            name: attribute,
        } => {
            let (mut row, owner) = owner_json(&mut name, owner)?;
            row["do"] = json!("remove_attribute");
            row["attribute"] = json!(attribute);
            (row, format!("- {owner}.{attribute}"))
        }
        Operation::ApplyRule { rule, .. } => (
            json!({"do": "apply_rule", "rule": rule}),
            format!("{rule}()"),
        ),
    })
}

fn owner_json(
    name: &mut dyn FnMut(&NodeRef) -> Result<String, Failure>,
    owner: &Owner,
) -> Result<(Json, String), Failure> {
    Ok(match owner {
        Owner::Node(node) => {
            let node = name(node)?;
            (json!({ "node": node }), node)
        }
        Owner::Edge(edge) => {
            let (from, label, to) = (name(&edge.from)?, &edge.label, name(&edge.to)?);
            let line = format!("{from}-{label}->{to}");
            (json!({"from": from, "label": label, "to": to}), line)
        }
    })
}
