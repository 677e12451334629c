//! `cortex social schedule`: puts a schedule file into effect in a running system. Either all of it is in
//! effect afterwards, or nothing has changed.

use crate::commands::graph::attach;
use crate::commands::output::print;
use crate::{Answer, Failure};
use dsr::{CommitError, Node, Operation, Owner, ReadError, Snapshot, Transaction};
use scenarios::activity_attributes;
use scenarios::scenario::{Activity, parse_schedule};
use scenarios::situation::time_of_day;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

pub(super) fn run(file: &Path, instance: &str) -> Result<Answer, Failure> {
    let text = crate::commands::read_text(file)?;
    let mut session = attach(instance)?;
    let snapshot = session.snapshot().map_err(Failure::internal)?;
    let activities = parse_schedule(&file.display().to_string(), &text, snapshot.time())
        .map_err(|invalid| Failure::Input((*invalid).into()))?;
    let (transaction, told) = change(&snapshot, &activities).map_err(Failure::internal)?;
    if !transaction.is_empty() {
        let committed = session.commit(&transaction, snapshot.time());
        committed.map_err(|error| match error {
            CommitError::Refused(refusal) => Failure::input(refusal),
            error => Failure::internal(error),
        })?;
    }
    print(&told)?;
    Ok(Answer::Yes)
}

/// What makes the graph's activities those of the file, and what to tell of it.
fn change(
    snapshot: &Snapshot,
    activities: &[Activity],
) -> Result<(Transaction, String), ReadError> {
    let mut there: BTreeMap<String, Node> = BTreeMap::new();
    for node in snapshot.nodes_of("activity") {
        let node = node?;
        there.insert(node.name()?, node);
    }
    let seen = snapshot.nodes_of("object").map(|node| node?.name());
    let seen = seen.collect::<Result<Vec<_>, _>>()?;
    let mut transaction = Transaction::new();
    let mut told = String::new();
    for activity in activities {
        let (attributes, name) = (activity_attributes(activity), &activity.name);
        let known = there.remove(name);
        let what = match known {
            None => {
                transaction.create_node("activity", name, attributes);
                "new"
            }
            Some(node) => {
                let before = transaction.operations.len();
                for (name, value) in attributes {
                    if node.value(&name)?.as_ref() != Some(&value) {
                        transaction.push(Operation::SetAttribute {
                            owner: Owner::Node(node.id().into()),
                            name,
                            value,
                        });
                    }
                }
                if transaction.operations.len() > before {
                    "changed"
                } else {
                    "as before"
                }
            }
        };
        let cancelled = if activity.cancelled {
            ", cancelled"
        } else {
            ""
        };
        let [start, end] = [activity.start, activity.end].map(time_of_day);
        // Writing to a string does not fail.
        let _ = writeln!(
            told,
            "{name}: {start} to {end} at {}{cancelled} ({what})",
            activity.object
        );
        if !seen.contains(&activity.object) {
            let object = &activity.object;
            let near = dsr::suggest(object, seen.iter().map(String::as_str));
            let near = near.map_or_else(String::new, |name| format!("; did you mean `{name}`?"));
            let _ = writeln!(
                told,
                "  nothing called `{object}` has been seen so far{near}"
            );
        }
    }
    for (name, node) in there {
        transaction.delete_node(node.id());
        let _ = writeln!(told, "{name}: no more");
    }
    Ok((transaction, told))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::{Graph, Time};

    const DAY: &str = r#"
[[activity]]
name = "news"
object = "tv"
start = "10:15"
end = "11:00"

[[activity]]
name = "handicraft"
object = "table"
start = "10:00"
end = "11:30"
"#;

    #[test]
    fn the_graphs_activities_become_those_of_the_file() {
        let day = Time::from_seconds(20_000.0 * 86_400.0 + 40_000.0);
        let read = |text: &str| parse_schedule("schedule.toml", text, day).unwrap();
        let schema = scenarios::schema().unwrap();
        let mut graph = Graph::in_memory(schema);
        let mut put = |text: &str| {
            let (transaction, told) = change(&graph.snapshot(), &read(text)).unwrap();
            let count = transaction.operations.len();
            if count > 0 {
                graph.commit(&transaction, "test", day).unwrap();
            }
            (count, told)
        };
        assert_eq!(put(DAY).0, 2);
        assert_eq!(put(DAY).0, 0);
        let later = DAY.replace("11:30\"", "11:45\"\ncancelled = true");
        let (count, told) = put(&later);
        assert_eq!(count, 2);
        assert!(
            told.contains("handicraft: 10:00:00 to 11:45:00 at table, cancelled (changed)"),
            "{told}"
        );
        assert!(told.contains("news: 10:15:00 to 11:00:00 at tv (as before)"));
        assert!(told.contains("nothing called `table` has been seen so far"));
        let (count, told) = put("");
        assert_eq!(count, 2);
        assert!(told.contains("news: no more"), "{told}");
    }
}
