//! Graph JSON, format `dsr/1`: a whole graph as people and other programs read it. This file
//! guarantees that what was written can be read again without loss, by [`crate::interchange::read`].
//!
//! ```json
//! {"format":"dsr/1",
//!  "nodes":[{"id":1,"type":"room","name":"kitchen","attributes":{"area":12.5}}],
//!  "edges":[{"from":1,"label":"connected","to":2,"attributes":{}}]}
//! ```
//!
//! An attribute that is a bool, an `i64`, a finite `f64` or a string is a plain JSON value; any
//! other is `{"type":KIND,"value":...}` with a kind of [`ValueKind::name`]. Whole `f64` have a
//! decimal point. `u64` are strings, for most programs read JSON numbers as `f64`.

use crate::{LargeHandle, Pose, ReadError, Snapshot, Value, ValueKind};
use nalgebra::{Isometry2, Quaternion, Translation3, UnitQuaternion, Vector2};
use serde::Serialize;
use serde_json::{Map, Value as Json, json};

/// The name of the format.
pub const FORMAT: &str = "dsr/1";

#[derive(Debug, Serialize)]
struct NodeRow {
    id: u64,
    r#type: String,
    name: String,
    attributes: Map<String, Json>,
}

#[derive(Debug, Serialize)]
struct EdgeRow {
    from: u64,
    label: String,
    to: u64,
    attributes: Map<String, Json>,
}

/// A value as JSON.
pub fn value_to_json(value: &Value) -> Json {
    let typed = |json: Json| json!({"type": value.kind().name(), "value": json});
    // JSON has no word for these numbers.
    let number = |x: f64| {
        if x.is_finite() {
            json!(x)
        } else {
            json!(x.to_string())
        }
    };
    match value {
        Value::Bool(b) => json!(b),
        Value::I64(n) => json!(n),
        Value::F64(x) if x.is_finite() => json!(x),
        Value::String(text) => json!(text),
        Value::F64(x) => typed(number(*x)),
        Value::I32(n) => typed(json!(n)),
        Value::U32(n) => typed(json!(n)),
        Value::U64(n) => typed(json!(n.to_string())),
        Value::F32(x) => typed(number(f64::from(*x))),
        Value::Vector(row) | Value::F64List(row) => {
            typed(row.iter().copied().map(number).collect())
        }
        Value::F32Vector(row) | Value::F32List(row) => {
            typed(row.iter().map(|&x| number(f64::from(x))).collect())
        }
        Value::U8List(bytes) => typed(json!(bytes)),
        Value::U64List(row) => typed(row.iter().map(|n| json!(n.to_string())).collect()),
        Value::Pose(pose) => {
            let (t, q) = (pose.translation.vector, pose.rotation.coords);
            typed(json!({"translation": [t.x, t.y, t.z], "rotation": [q.x, q.y, q.z, q.w]}))
        }
        Value::Large(handle) => typed(json!({
            "stream": handle.stream().to_string(),
            "sequence": handle.sequence().to_string(),
            "bytes": handle.bytes().to_string(),
            "shape": handle.shape(),
        })),
    }
}

/// A value from JSON: the inverse of [`value_to_json`]. A plain whole number is an `i64` and a
/// plain array of numbers an `f64` vector (up to 6) or list, unless `expected` says otherwise. A pose
/// may also be an array: translation and rotation (i, j, k, w), or x, y and heading on the floor; so may
/// the handle of a large value: its words in the arena.
///
/// # Errors
/// What is wrong, in words.
pub fn value_from_json(json: &Json, expected: Option<ValueKind>) -> Result<Value, String> {
    let (kind, json) = match json {
        Json::Object(map) if map.contains_key("type") => {
            let name = map.get("type").and_then(Json::as_str).unwrap_or_default();
            let kind = ValueKind::from_name(name).ok_or_else(|| {
                let known = ValueKind::ALL.map(ValueKind::name);
                let help = crate::suggest(name, known).map(|k| format!(", did you mean `{k}`?"));
                format!("unknown kind of value `{name}`{}", help.unwrap_or_default())
            })?;
            (kind, map.get("value").unwrap_or(&Json::Null))
        }
        other => {
            let plain = expected.or(match other {
                Json::Bool(_) => Some(ValueKind::Bool),
                Json::Number(n) if n.is_i64() => Some(ValueKind::I64),
                Json::Number(n) if n.is_u64() => Some(ValueKind::U64),
                Json::Number(_) => Some(ValueKind::F64),
                Json::String(_) => Some(ValueKind::String),
                Json::Array(row) if (1..=6).contains(&row.len()) => Some(ValueKind::Vector),
                Json::Array(_) => Some(ValueKind::F64List),
                _ => None,
            });
            (
                plain.ok_or("null and untyped objects are no values")?,
                other,
            )
        }
    };
    decode(kind, json).ok_or_else(|| format!("{json} is not a {kind}"))
}

fn decode(kind: ValueKind, json: &Json) -> Option<Value> {
    // Infinity and NaN are written as text; a number that is too large is neither.
    let text = |text: &str| {
        let number = text.parse::<f64>().ok()?;
        (number.is_finite() || !text.contains(|c: char| c.is_ascii_digit())).then_some(number)
    };
    let number = |json: &Json| json.as_f64().or_else(|| text(json.as_str()?));
    let natural = |json: &Json| json.as_u64().or_else(|| json.as_str()?.parse::<u64>().ok());
    let numbers = || {
        json.as_array()?
            .iter()
            .map(number)
            .collect::<Option<Vec<_>>>()
    };
    let singles = || Some(numbers()?.into_iter().map(|x| x as f32).collect::<Vec<_>>());
    let six = |len: usize| (1..=6).contains(&len).then_some(());
    Some(match kind {
        ValueKind::Bool => Value::Bool(json.as_bool()?),
        ValueKind::I32 => Value::I32(i32::try_from(json.as_i64()?).ok()?),
        ValueKind::U32 => Value::U32(u32::try_from(natural(json)?).ok()?),
        ValueKind::I64 => Value::I64(json.as_i64()?),
        ValueKind::U64 => Value::U64(natural(json)?),
        ValueKind::F32 => Value::F32(number(json)? as f32),
        ValueKind::F64 => Value::F64(number(json)?),
        ValueKind::String => Value::String(json.as_str()?.to_owned()),
        ValueKind::Vector => {
            let row = numbers()?;
            six(row.len())?;
            Value::Vector(row)
        }
        ValueKind::F32Vector => {
            let row = singles()?;
            six(row.len())?;
            Value::F32Vector(row)
        }
        ValueKind::F64List => Value::F64List(numbers()?),
        ValueKind::F32List => Value::F32List(singles()?),
        ValueKind::U8List => {
            let byte = |json: &Json| u8::try_from(json.as_u64()?).ok();
            Value::U8List(json.as_array()?.iter().map(byte).collect::<Option<_>>()?)
        }
        ValueKind::U64List => Value::U64List(
            json.as_array()?
                .iter()
                .map(natural)
                .collect::<Option<_>>()?,
        ),
        ValueKind::Pose => {
            let row = |name: &str| {
                let row = json.get(name)?.as_array()?.iter().map(Json::as_f64);
                row.collect::<Option<Vec<_>>>()
            };
            let row = match json {
                Json::Array(_) => numbers()?,
                _ => [row("translation")?, row("rotation")?].concat(),
            };
            if let &[x, y, heading] = &row[..] {
                return Some(Isometry2::new(Vector2::new(x, y), heading).into());
            }
            let &[x, y, z, i, j, k, w] = &row[..] else {
                return None;
            };
            let quaternion = Quaternion::new(w, i, j, k);
            // Written by us it is of length one already, and stays what it was to the last bit.
            let rotation = if (quaternion.norm() - 1.0).abs() < 1e-12 {
                UnitQuaternion::new_unchecked(quaternion)
            } else {
                UnitQuaternion::try_new(quaternion, 1e-9)?
            };
            Value::Pose(Pose::from_parts(Translation3::new(x, y, z), rotation))
        }
        ValueKind::Large => {
            if let Json::Array(row) = json {
                let words: Option<Vec<u64>> = row.iter().map(natural).collect();
                return Some(LargeHandle::from_words(words?.try_into().ok()?).into());
            }
            let field = |name: &str| natural(json.get(name)?);
            let lengths = json.get("shape").and_then(Json::as_array)?.iter();
            let lengths = lengths.map(|length| u32::try_from(length.as_u64()?).ok());
            let shape = lengths.collect::<Option<Vec<u32>>>()?;
            let (stream, sequence) = (field("stream")?, field("sequence")?);
            Value::Large(LargeHandle::new(stream, sequence, field("bytes")?, &shape)?)
        }
    })
}

/// A snapshot as graph JSON: nodes by id, edges by source, label and target.
///
/// # Errors
/// [`ReadError`].
pub fn to_json(snapshot: &Snapshot) -> Result<Json, ReadError> {
    let schema = snapshot.schema();
    let attributes = |list: Vec<crate::Attribute>| -> Map<String, Json> {
        list.iter()
            .map(|a| {
                (
                    schema.attribute_name(a.name).to_owned(),
                    value_to_json(&a.value),
                )
            })
            .collect()
    };
    let (mut nodes, mut edges) = (Vec::new(), Vec::new());
    for node in snapshot.nodes() {
        let node = node?;
        nodes.push(NodeRow {
            id: node.id().0,
            r#type: node.type_name().to_owned(),
            name: node.name()?,
            attributes: attributes(node.attributes()?),
        });
        for key in node.out_edges() {
            let key = key?;
            let found = snapshot
                .find_edge(key)?
                .map(|edge| edge.attributes())
                .transpose()?;
            edges.push(EdgeRow {
                from: key.from.0,
                label: schema.label_name(key.label).to_owned(),
                to: key.to.0,
                attributes: attributes(found.unwrap_or_default()),
            });
        }
    }
    nodes.sort_by_key(|node| node.id);
    edges.sort_by(|a, b| (a.from, &a.label, a.to).cmp(&(b.from, &b.label, b.to)));
    Ok(json!({"format": FORMAT, "nodes": nodes, "edges": edges}))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_value_survives_json(value in crate::graph::tests::value()) {
            let text = value_to_json(&value).to_string();
            let back = value_from_json(&serde_json::from_str(&text).unwrap(), None).unwrap();
            prop_assert_eq!(back, value);
        }
    }

    #[test]
    fn a_number_that_is_too_large_is_not_taken_for_infinity() {
        let read = |text: &str| value_from_json(&text.into(), Some(ValueKind::F64));
        assert_eq!(read("inf"), Ok(Value::F64(f64::INFINITY)));
        assert_eq!(read("-1.5"), Ok(Value::F64(-1.5)));
        assert_eq!(read("1e400"), Err("\"1e400\" is not a f64".to_owned()));
    }
}
