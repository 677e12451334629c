//! Values of expressions in words.
//!
//! Guarantee: an attribute is said to be missing exactly where a comparison with it does not hold for that.

use super::MatchError;
use super::environment::{Environment, node};
use super::evaluate::is_there;
use super::obstacle::{Obstacle, end};
use super::program::Compiler;
use crate::{AttributePath, Expression};
use dsr::{Snapshot, Value};

/// The attributes in expressions and their values: `a.x = 3, b.y is missing`.
pub(crate) fn values(
    snapshot: &Snapshot,
    compiler: &Compiler<'_>,
    environment: &Environment,
    expressions: &[&Expression],
) -> Result<String, MatchError> {
    let mut known = Vec::new();
    for path in expressions.iter().flat_map(|expression| expression.paths()) {
        let term = compiler.term(&Expression::Attribute(path.clone()))?;
        known.push(match term.value(snapshot, environment)? {
            Some(value) => format!("{path} = {}", words(&value)),
            None => match missing_link(snapshot, compiler, environment, path)? {
                Some(none) => format!("{path} is missing, as {none}"),
                None => format!("{path} is missing"),
            },
        });
    }
    known.dedup();
    Ok(known.join(", "))
}

/// That the link of an attribute is not there, if it is not.
fn missing_link(
    snapshot: &Snapshot,
    compiler: &Compiler<'_>,
    environment: &Environment,
    path: &AttributePath,
) -> Result<Option<String>, MatchError> {
    let AttributePath::Edge {
        from, label, to, ..
    } = path
    else {
        return Ok(None);
    };
    let link = compiler.ends(label, from, to)?;
    let ends = [link.from, link.to].map(|slot| node(environment, slot));
    let [Some(source), Some(target)] = ends else {
        return Ok(None);
    };
    if is_there(snapshot, &link, environment)? {
        return Ok(None);
    }
    let missing = Obstacle::MissingLink {
        from: end(snapshot, from, source)?,
        label: label.to_string(),
        to: end(snapshot, to, target)?,
    };
    Ok(Some(missing.to_string()))
}

/// A value as a message shows it.
pub(crate) fn words(value: &Value) -> String {
    match value {
        Value::Bool(value) => value.to_string(),
        Value::I32(value) => value.to_string(),
        Value::U32(value) => value.to_string(),
        Value::I64(value) => value.to_string(),
        Value::U64(value) => value.to_string(),
        Value::F32(value) => value.to_string(),
        Value::F64(value) => value.to_string(),
        Value::String(text) => format!("{text:?}"),
        Value::Vector(row) => format!("{row:?}"),
        other => format!("a {}", other.kind()),
    }
}
