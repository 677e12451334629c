//! Writing RoboComp DSR JSON. Guarantees that what was written makes the same graph when it is read
//! again, and that what was read from RoboComp is written with every attribute, of the same type and value.

use super::robocomp::DERIVED;
use crate::{Attribute, Edge, EdgeKey, Pose, ReadError, Snapshot, Time, Value, WriterId};
use serde_json::{Map, Value as Json, json};
use std::collections::{BTreeMap, BTreeSet};

/// Who writes what comes from a file that does not say who wrote it.
pub(crate) const FILE_AGENT: &str = "file";

/// A snapshot as RoboComp DSR JSON.
///
/// Each attribute has its `timestamp` (nanoseconds) and `agent_id`, but for what came from a file that
/// has none. RoboComp ignores the fields that it does not know, in which the rest is written:
///
/// - a value of a kind that RoboComp does not have is of the type nearest to it, with a `kind`
///   beside it that says which of our kinds it is;
/// - an edge `pose` is a link `RT` with `rt_translation` and `rt_rotation_euler_xyz`, and
///   `"cortex":"pose"`;
/// - `agents` has the names behind agent ids.
///
/// # Errors
/// [`ReadError`].
pub fn to_robocomp(snapshot: &Snapshot) -> Result<Json, ReadError> {
    let mut writer = Writer::new(snapshot)?;
    let mut symbols = BTreeMap::new();
    for node in snapshot.nodes() {
        let node = node?;
        let id = node.id().0;
        let mut links = Vec::new();
        for edge in node.edges() {
            links.push(writer.link(&edge?)?);
        }
        let symbol = json!({
            "id": id.to_string(),
            "type": node.type_name(),
            "name": node.name()?,
            "attribute": writer.attributes(node.attributes()?),
            "links": links,
        });
        symbols.insert(id, symbol);
    }
    let symbols: Map<String, Json> = symbols
        .into_iter()
        .map(|(id, symbol)| (id.to_string(), symbol))
        .collect();
    let mut model = json!({"symbols": symbols});
    if !writer.told.is_empty() {
        model["agents"] = json!(writer.told);
    }
    Ok(json!({"DSRModel": model}))
}

struct Writer<'a> {
    snapshot: &'a Snapshot,
    /// The id of each agent; `None` for the one that stands for files.
    agents: Vec<Option<u64>>,
    names: Vec<String>,
    /// Names behind ids that were used.
    told: BTreeMap<String, String>,
}

impl<'a> Writer<'a> {
    fn new(snapshot: &'a Snapshot) -> Result<Self, ReadError> {
        let names = snapshot.writers()?;
        // Those that wrote nothing that is still there are not told, so that they have no numbers.
        let mut used: BTreeSet<u16> = BTreeSet::new();
        for node in snapshot.nodes() {
            let node = node?;
            used.extend(node.attributes()?.iter().map(|a| a.writer.0));
            for edge in node.edges() {
                used.extend(edge?.attributes()?.iter().map(|a| a.writer.0));
            }
        }
        let named = |index: u16| Some((names.get(usize::from(index))?.as_str(), index));
        let used: BTreeMap<&str, u16> = used.into_iter().filter_map(named).collect();
        // An agent of RoboComp is named by its id; the others get those that are left, by name.
        let own = |name: &str| name.parse::<u64>().ok().filter(|id| id.to_string() == name);
        let taken: BTreeSet<u64> = used.keys().filter_map(|name| own(name)).collect();
        let mut free = (1..).filter(|id| !taken.contains(id));
        let mut agents = vec![None; names.len()];
        for (name, index) in used {
            agents[usize::from(index)] = match own(name) {
                Some(id) => Some(id),
                None if name == FILE_AGENT => None,
                None => free.next(),
            };
        }
        Ok(Self {
            snapshot,
            agents,
            names,
            told: BTreeMap::new(),
        })
    }

    fn link(&mut self, edge: &Edge<'_>) -> Result<Json, ReadError> {
        let (key, schema) = (edge.key(), self.snapshot.schema());
        let label = schema.label_name(key.label);
        let mut attributes = self.attributes(edge.attributes()?);
        let mut link = json!({"src": key.from.0.to_string(), "dst": key.to.0.to_string()});
        link["label"] = json!(label);
        if let Some(pose) = self.kinematic(edge)? {
            let millimetres = pose.translation.vector * 1000.0;
            // About the moving axes x, y, z: the inverse turns about the fixed ones.
            let (a, b, c) = pose.rotation.inverse().euler_angles();
            let rows = [[millimetres.x, millimetres.y, millimetres.z], [-a, -b, -c]];
            for (name, row) in DERIVED.into_iter().zip(rows) {
                let row = Value::F32List(row.iter().map(|&x| x as f32).collect());
                attributes.insert(name.to_owned(), typed(&row));
            }
            link["label"] = json!("RT");
            link["cortex"] = json!(label);
        }
        link["linkAttribute"] = Json::Object(attributes);
        Ok(link)
    }

    /// The pose of an edge that RoboComp can know as an `RT` edge.
    fn kinematic(&self, edge: &Edge<'_>) -> Result<Option<Pose>, ReadError> {
        let (key, schema) = (edge.key(), self.snapshot.schema());
        if schema.label_name(key.label) != "pose" {
            return Ok(None);
        }
        if let Some(label) = schema.find_label("RT")
            && self.snapshot.find_edge(EdgeKey { label, ..key })?.is_some()
        {
            return Ok(None);
        }
        for name in DERIVED {
            if edge.value(name)?.is_some() {
                return Ok(None);
            }
        }
        Ok(edge
            .value("transform")?
            .and_then(|value| value.as_pose().copied()))
    }

    fn attributes(&mut self, attributes: Vec<Attribute>) -> Map<String, Json> {
        let mut fields = Map::new();
        for attribute in attributes {
            let mut field = typed(&attribute.value);
            if attribute.time != Time::default() {
                field["timestamp"] = json!(attribute.time.nanoseconds().to_string());
            }
            if let Some(id) = self.agent(attribute.writer) {
                field["agent_id"] = json!(id);
            }
            let name = self.snapshot.schema().attribute_name(attribute.name);
            fields.insert(name.to_owned(), field);
        }
        fields
    }

    fn agent(&mut self, writer: WriterId) -> Option<u64> {
        let index = usize::from(writer.0);
        let id = (*self.agents.get(index)?)?;
        let name = self.names.get(index)?;
        if *name != id.to_string() {
            self.told.insert(id.to_string(), name.clone());
        }
        Some(id)
    }
}

/// A number that JSON has no word for is a text.
fn number(x: f64) -> Json {
    if x.is_finite() {
        json!(x)
    } else {
        json!(x.to_string())
    }
}

fn numbers(row: &[f64]) -> Json {
    row.iter().copied().map(number).collect()
}

fn singles(row: &[f32]) -> Json {
    row.iter().map(|&x| number(f64::from(x))).collect()
}

/// A value with its type.
fn typed(value: &Value) -> Json {
    let ours = |number: u8, json: Json| json!({"type": number, "value": json, "kind": value.kind().name()});
    let (number, json) = match value {
        Value::String(text) => (0, json!(text)),
        Value::I32(n) => (1, json!(n)),
        Value::F32(x) => (2, number(f64::from(*x))),
        Value::F32List(row) => (3, singles(row)),
        Value::Bool(b) => (4, json!(b)),
        Value::U8List(bytes) => (5, json!(bytes)),
        Value::U32(n) => (6, json!(n)),
        Value::U64(n) => (7, json!(n.to_string())),
        Value::F64(x) => (8, number(*x)),
        Value::U64List(row) => (9, row.iter().map(|n| json!(n.to_string())).collect()),
        Value::F32Vector(row) => match row.len() {
            2 => (10, singles(row)),
            3 => (11, singles(row)),
            4 => (12, singles(row)),
            6 => (13, singles(row)),
            _ => return ours(3, singles(row)),
        },
        Value::I64(n) => {
            let number = if i32::try_from(*n).is_ok() { 1 } else { 8 };
            return ours(number, json!(n));
        }
        Value::Vector(row) | Value::F64List(row) => return ours(3, numbers(row)),
        Value::Pose(pose) => {
            let (t, q) = (pose.translation.vector, pose.rotation.coords);
            let row = [t.x, t.y, t.z, q.x, q.y, q.z, q.w];
            return ours(3, numbers(&row));
        }
        Value::Large(handle) => {
            let row = handle.to_words().map(|word| json!(word.to_string()));
            return ours(9, row.into_iter().collect());
        }
    };
    json!({"type": number, "value": json})
}
