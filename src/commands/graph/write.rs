//! `cortex graph set`.

use super::path::Path;
use super::source::Source;
use crate::cli::GraphSource;
use crate::commands::output::{print, print_json};
use crate::{Answer, Failure};
use dsr::{Operation, Snapshot, Transaction, Value, ValueKind, json};
use serde_json::{Value as Json, json};

pub(super) fn set(source: &GraphSource, path: &str, value: &str) -> Result<Answer, Failure> {
    let mut graph = Source::open(source)?;
    let transaction = transaction(&graph.snapshot()?, path, value)?;
    let commit = graph.commit(&transaction)?;
    if source.json {
        print_json(&json!({"version": commit.version.0}))?;
    } else {
        print(&format!("version {}\n", commit.version))?;
    }
    Ok(Answer::Yes)
}

/// What sets an attribute to a value as it is written on the command line.
pub(crate) fn transaction(
    snapshot: &Snapshot,
    path: &str,
    value: &str,
) -> Result<Transaction, Failure> {
    let (thing, name) = Path::find_attribute(snapshot, path)?;
    let schema = snapshot.schema();
    let kind = match schema.attribute_id(&name) {
        Ok(id) => {
            let declared = schema.attributes().get(usize::from(id.0));
            let now = thing.attribute(snapshot, id).map_err(Failure::internal)?;
            // Where the schema leaves it open, the value that is there says what it is.
            let now = now.map(|attribute| attribute.value.kind());
            declared.and_then(|declared| declared.kind).or(now)
        }
        Err(_) if schema.is_open() => None,
        Err(error) => return Err(Failure::input(error)),
    };
    let value = parse(value, kind).map_err(|reason| {
        let unit = kind.map(|kind| format!("`{name}` is a {kind}"));
        Failure::input_with_help(reason, unit.unwrap_or_else(|| "write JSON".to_owned()))
    })?;
    let mut transaction = Transaction::new();
    transaction.push(Operation::SetAttribute {
        owner: thing.owner(snapshot),
        name,
        value,
    });
    Ok(transaction)
}

/// A value as it is written on the command line: JSON, and a bare word is a text, so that a shell
/// needs no quotes within quotes. Of a text, JSON is the text itself: settings are written as such.
fn parse(text: &str, kind: Option<ValueKind>) -> Result<Value, String> {
    let json: Json = serde_json::from_str(text).unwrap_or_else(|_| text.into());
    let names = |json: &Json| json.get("type").is_some() && json.get("value").is_some();
    if kind == Some(ValueKind::String) && !json.is_string() && !names(&json) {
        return Ok(text.into());
    }
    json::value_from_json(&json, kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_of_the_kind_that_the_schema_names() {
        for (text, kind, value) in [
            ("0.4", Some(ValueKind::F64), Value::F64(0.4)),
            ("4", Some(ValueKind::F64), Value::F64(4.0)),
            ("4", None, Value::I64(4)),
            ("4", Some(ValueKind::String), "4".into()),
            ("\"4\"", Some(ValueKind::String), "4".into()),
            ("true", Some(ValueKind::String), "true".into()),
            (
                r#"{"usage": "steps"}"#,
                Some(ValueKind::String),
                r#"{"usage": "steps"}"#.into(),
            ),
            (
                r#"{"type": "string", "value": "x"}"#,
                Some(ValueKind::String),
                "x".into(),
            ),
            ("true", None, Value::Bool(true)),
            ("going", None, "going".into()),
            ("7", Some(ValueKind::U64), Value::U64(7)),
            (
                "[1, 2]",
                Some(ValueKind::F64List),
                Value::F64List(vec![1.0, 2.0]),
            ),
        ] {
            assert_eq!(parse(text, kind), Ok(value), "{text}");
        }
        assert!(parse("fast", Some(ValueKind::F64)).is_err());
        assert!(parse("-1", Some(ValueKind::U32)).is_err());
    }
}
