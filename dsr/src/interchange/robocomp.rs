//! Reading RoboComp DSR JSON: symbols by id, typed attributes, links at their source. Guarantees that
//! a value of each of its 14 types comes in as the kind that holds it without loss.
//!
//! It reads what is met in the wild: ids as numbers or texts, symbols as a map or a list, numbers as
//! texts with a decimal comma, `null` (as Qt writes not-a-number), text after the closing brace. Links to
//! symbols that the file does not have, as RoboComp leaves them behind, are left out and told.
//! `kind`, `cortex` and `agents` are ours: see [`super::to_robocomp`].

use super::place::{Fields, Span, Text};
use super::world::{Format, LeftOut, Word, World, WorldAttribute, WorldEdge, WorldNode};
use super::{Problem, unique_names};
use crate::json::value_from_json;
use crate::{NodeId, Time, Value, ValueKind};
use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::Value as Json;
use serde_json::value::RawValue;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

#[derive(Deserialize)]
struct File<'a> {
    #[serde(rename = "DSRModel", borrow)]
    model: Model<'a>,
}

#[derive(Deserialize)]
struct Model<'a> {
    #[serde(default, borrow)]
    symbols: Symbols<'a>,
    /// The names behind agent ids.
    #[serde(default)]
    agents: BTreeMap<String, String>,
}

/// A list, or a map whose keys repeat the ids.
#[derive(Default)]
struct Symbols<'a>(Vec<(Option<&'a RawValue>, Symbol<'a>)>);

#[derive(Deserialize)]
struct Symbol<'a> {
    #[serde(default, borrow)]
    id: Option<&'a RawValue>,
    #[serde(borrow)]
    r#type: &'a RawValue,
    #[serde(default, borrow)]
    name: Option<&'a RawValue>,
    #[serde(default, alias = "attributes", borrow)]
    attribute: Fields<'a>,
    #[serde(default, borrow)]
    links: Vec<Link<'a>>,
}

#[derive(Deserialize)]
struct Link<'a> {
    #[serde(default, borrow)]
    src: Option<&'a RawValue>,
    #[serde(borrow)]
    dst: &'a RawValue,
    #[serde(borrow)]
    label: &'a RawValue,
    #[serde(default, rename = "linkAttribute", alias = "linkAttributes", borrow)]
    attributes: Fields<'a>,
    /// The label that the edge has with us.
    #[serde(default)]
    cortex: Option<String>,
}

#[derive(Deserialize)]
struct Attribute {
    r#type: Json,
    #[serde(default)]
    value: Json,
    #[serde(default)]
    kind: Option<String>,
    #[serde(default, alias = "time_stamp")]
    timestamp: Json,
    #[serde(default)]
    agent_id: Json,
}

impl<'de: 'a, 'a> Deserialize<'de> for Symbols<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct SymbolsVisitor;
        impl<'de> Visitor<'de> for SymbolsVisitor {
            type Value = Symbols<'de>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("symbols, as a map by id or as a list")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Symbols<'de>, A::Error> {
                let mut symbols = Vec::new();
                while let Some(symbol) = list.next_element::<Symbol<'de>>()? {
                    symbols.push((None, symbol));
                }
                Ok(Symbols(symbols))
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Symbols<'de>, A::Error> {
                let mut symbols = Vec::new();
                while let Some(key) = map.next_key::<&'de RawValue>()? {
                    symbols.push((Some(key), map.next_value()?));
                }
                Ok(Symbols(symbols))
            }
        }
        deserializer.deserialize_any(SymbolsVisitor)
    }
}

/// What each type of attribute holds, by its number.
const KINDS: [&str; 14] = [
    "a string",
    "a 32-bit integer",
    "a single-precision number",
    "a list of single-precision numbers",
    "true or false",
    "a list of bytes",
    "an unsigned 32-bit integer",
    "an unsigned 64-bit integer",
    "a number",
    "a list of unsigned 64-bit integers",
    "two numbers",
    "three numbers",
    "four numbers",
    "six numbers",
];

/// Attributes that we add to a pose for RoboComp's sake.
pub(super) const DERIVED: [&str; 2] = ["rt_translation", "rt_rotation_euler_xyz"];

struct Reader<'a, 'b> {
    text: &'b Text<'a>,
    agents: BTreeMap<String, String>,
    problems: &'b mut Vec<Problem>,
}

pub(super) fn read(text: &Text<'_>, problems: &mut Vec<Problem>) -> Option<World> {
    // Not `from_str`: what follows the closing brace is none of ours.
    let mut deserializer = serde_json::Deserializer::from_str(text.body());
    let file = match File::deserialize(&mut deserializer) {
        Ok(file) => file,
        Err(error) => {
            problems.push(text.broken(&error));
            return None;
        }
    };
    let mut reader = Reader {
        text,
        agents: file.model.agents,
        problems,
    };
    Some(reader.world(file.model.symbols.0))
}

impl Reader<'_, '_> {
    fn world(&mut self, symbols: Vec<(Option<&RawValue>, Symbol<'_>)>) -> World {
        let mut world = World::new(Format::Robocomp);
        let mut ids = Vec::new();
        let mut wanted = Vec::new();
        for (key, symbol) in &symbols {
            let place = symbol.id.or(*key).unwrap_or(symbol.r#type);
            let id = match symbol.id.or(*key) {
                Some(id) => self.id(id),
                None => {
                    let span = self.text.span_of(symbol.r#type.get());
                    self.problem(span, "this symbol has no `id`");
                    None
                }
            };
            ids.push((id.unwrap_or(u64::MAX - 1), self.text.span_of(place.get())));
            let name = symbol.name.map(|name| self.word(name).text);
            wanted.push((id.map(|id| id.to_string()).unwrap_or_default(), name));
        }
        self.twice(&wanted, &symbols);
        let known: BTreeSet<u64> = ids.iter().map(|(id, _)| *id).collect();
        let mut links = Vec::new();
        let names = unique_names(&wanted);
        for ((_, symbol), ((id, span), name)) in symbols.into_iter().zip(ids.into_iter().zip(names))
        {
            let place = symbol.name.map(|name| self.text.span_of(name.get()));
            links.push((id, symbol.links));
            let node = WorldNode {
                type_name: self.word(symbol.r#type),
                name: Word {
                    text: name,
                    span: place.unwrap_or_else(|| span.clone()),
                },
                attributes: self.attributes(symbol.attribute),
                id: Some((NodeId(id), span)),
            };
            world.nodes.push(node);
        }
        for (symbol, links) in links {
            for link in links {
                self.link(symbol, link, &known, &mut world);
            }
        }
        world
    }

    /// Names that two symbols ask for.
    fn twice(
        &mut self,
        wanted: &[(String, Option<String>)],
        symbols: &[(Option<&RawValue>, Symbol<'_>)],
    ) {
        let mut first: BTreeMap<&str, &str> = BTreeMap::new();
        for ((id, name), (_, symbol)) in wanted.iter().zip(symbols) {
            let (Some(name), Some(raw)) = (name, symbol.name) else {
                continue;
            };
            if name.is_empty() {
                continue;
            }
            match first.get(name.as_str()) {
                None => {
                    first.insert(name, id);
                }
                Some(other) => {
                    let message = format!("the symbols {other} and {id} are both named `{name}`");
                    self.problem(self.text.span_of(raw.get()), message);
                }
            }
        }
    }

    fn link(&mut self, symbol: u64, link: Link<'_>, known: &BTreeSet<u64>, world: &mut World) {
        let label = self.word(link.label);
        let dst = self.text.span_of(link.dst.get());
        let (src, place) = match link.src {
            None => (Some(symbol), label.span.clone()),
            Some(src) => (self.id(src), self.text.span_of(src.get())),
        };
        let (Some(src), Some(to)) = (src, self.id(link.dst)) else {
            return;
        };
        if src != symbol {
            let message = format!(
                "symbol {symbol} has a link `{}` that starts at {src}",
                label.text
            );
            self.problem(place, message);
            return;
        }
        if !known.contains(&to) {
            world.left_out.push(LeftOut {
                label: label.text,
                from: symbol,
                to,
                span: dst,
            });
            return;
        }
        let mut attributes = self.attributes(link.attributes);
        let label = match link.cortex {
            None => label,
            Some(text) => {
                attributes.retain(|a| !DERIVED.contains(&a.name.text.as_str()));
                Word { text, ..label }
            }
        };
        world.edges.push(WorldEdge {
            from: (NodeId(symbol).into(), place),
            label,
            to: (NodeId(to).into(), dst),
            attributes,
        });
    }

    fn problem(&mut self, span: Span, message: impl Into<String>) {
        self.problems.push(self.text.problem(span, message));
    }

    fn word(&mut self, raw: &RawValue) -> Word {
        let span = self.text.span_of(raw.get());
        let text = serde_json::from_str(raw.get()).unwrap_or_else(|_| {
            self.problem(span.clone(), format!("{} is not a text", brief(raw.get())));
            String::from("?")
        });
        Word { text, span }
    }

    /// A number, or a text that is one.
    fn id(&mut self, raw: &RawValue) -> Option<u64> {
        let id = raw.get().trim_matches('"').parse();
        if id.is_err() {
            let message = format!("{} is no symbol's id", brief(raw.get()));
            self.problem(self.text.span_of(raw.get()), message);
        }
        id.ok()
    }

    fn attributes(&mut self, fields: Fields<'_>) -> Vec<WorldAttribute> {
        let mut attributes: Vec<WorldAttribute> = Vec::new();
        for (key, raw) in fields.0 {
            let name = key.span(self.text, raw);
            let span = self.text.span_of(raw.get());
            if attributes.iter().any(|a| a.name.text == key.0) {
                self.problem(name, format!("the attribute `{}` is given twice", key.0));
                continue;
            }
            match self.attribute(raw) {
                Err(reason) => self.problem(span, format!("attribute `{}`: {reason}", key.0)),
                Ok((value, time, agent)) => attributes.push(WorldAttribute {
                    name: Word {
                        text: key.0.into_owned(),
                        span: name,
                    },
                    value,
                    span,
                    time,
                    agent,
                }),
            }
        }
        attributes
    }

    fn attribute(&self, raw: &RawValue) -> Result<(Value, Option<Time>, Option<String>), String> {
        let read: Attribute = serde_json::from_str(raw.get()).map_err(|error| {
            let message = error.to_string();
            let end = message.rfind(" at line ").unwrap_or(message.len());
            message[..end].to_owned()
        })?;
        let value = value(&read)?;
        let stamp = |json: &Json, what| match json {
            Json::Null => Ok(None),
            json => match natural(json) {
                Some(number) => Ok(Some(number)),
                None => Err(format!("{} is no {what}", brief(&json.to_string()))),
            },
        };
        let time = stamp(&read.timestamp, "time stamp")?;
        let time = time.map(|t| i64::try_from(t).map_err(|_| format!("{t} is no time stamp")));
        let agent = stamp(&read.agent_id, "agent's id")?.map(|agent| {
            let number = agent.to_string();
            self.agents.get(&number).cloned().unwrap_or(number)
        });
        Ok((value, time.transpose()?.map(Time::from_nanoseconds), agent))
    }
}

fn value(read: &Attribute) -> Result<Value, String> {
    if let Some(name) = &read.kind {
        let kind = ValueKind::from_name(name).ok_or(format!("unknown kind of value `{name}`"))?;
        let json = serde_json::json!({"type": kind.name(), "value": read.value});
        return value_from_json(&json, None);
    }
    let number = natural(&read.r#type).and_then(|number| usize::try_from(number).ok());
    let known = number.and_then(|number| Some((number, *KINDS.get(number)?)));
    let (number, kind) = known.ok_or_else(|| {
        let number = &read.r#type;
        format!("unknown type {number} of an attribute: RoboComp has 0 to 13")
    })?;
    decode(number, &read.value).ok_or_else(|| {
        format!(
            "{} is not {kind} (type {number})",
            brief(&read.value.to_string())
        )
    })
}

/// A value as an error shows it.
fn brief(text: &str) -> String {
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

fn natural(json: &Json) -> Option<u64> {
    json.as_u64().or_else(|| json.as_str()?.parse().ok())
}

fn integer(json: &Json) -> Option<i64> {
    json.as_i64().or_else(|| json.as_str()?.parse().ok())
}

fn real(json: &Json) -> Option<f64> {
    match json {
        Json::Null => Some(f64::NAN),
        Json::String(text) => text.replace(',', ".").parse().ok(),
        other => other.as_f64(),
    }
}

fn single(json: &Json) -> Option<f32> {
    let number = real(json)?;
    let single = number as f32;
    // Too large for single precision is another number, not this one.
    (single.is_infinite() == number.is_infinite()).then_some(single)
}

fn list<T>(json: &Json, of: impl Fn(&Json) -> Option<T>) -> Option<Vec<T>> {
    json.as_array()?.iter().map(of).collect()
}

fn vector(json: &Json, len: usize) -> Option<Value> {
    list(json, single)
        .filter(|row| row.len() == len)
        .map(Value::F32Vector)
}

fn decode(number: usize, json: &Json) -> Option<Value> {
    Some(match number {
        0 => Value::String(json.as_str()?.to_owned()),
        1 => Value::I32(i32::try_from(integer(json)?).ok()?),
        2 => Value::F32(single(json)?),
        3 => Value::F32List(list(json, single)?),
        4 => Value::Bool(match json {
            Json::String(text) => text.parse().ok()?,
            Json::Number(_) => match json.as_u64()? {
                0 => false,
                1 => true,
                _ => return None,
            },
            other => other.as_bool()?,
        }),
        5 => Value::U8List(list(json, |byte| u8::try_from(natural(byte)?).ok())?),
        6 => Value::U32(u32::try_from(natural(json)?).ok()?),
        7 => Value::U64(natural(json)?),
        8 => Value::F64(real(json)?),
        9 => Value::U64List(list(json, natural)?),
        10 => vector(json, 2)?,
        11 => vector(json, 3)?,
        12 => vector(json, 4)?,
        13 => vector(json, 6)?,
        _ => return None,
    })
}
