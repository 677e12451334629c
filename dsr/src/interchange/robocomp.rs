//! RoboComp DSR JSON: symbols by id, typed attributes, links at their source. Guarantees that a
//! value of each of its 14 types comes in as the kind that holds it without loss, and that each
//! error names its line and column or the symbol and link that it is about.
//!
//! Links to symbols that the file does not have, as RoboComp leaves them behind, are left out and
//! told. `null` in the place of a real number is read as not-a-number, which is how Qt writes it.

use super::{Import, LeftOut, unique_names};
use crate::{EdgeRef, NodeId, Operation, Value};
use serde::Deserialize;
use serde::de::{self, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::Value as Json;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use thiserror::Error;

/// Why RoboComp DSR JSON cannot be read.
#[derive(Debug, Error)]
pub enum RobocompError {
    /// It is not JSON, or not of this shape.
    #[error("{0}")]
    Syntax(#[from] serde_json::Error),
    /// Two symbols with one id.
    #[error("two symbols have the id {0}")]
    Duplicate(u64),
    /// Two symbols with one name.
    #[error("the symbols {first} and {second} are both named `{name}`")]
    DuplicateName {
        /// The id of one,
        first: u64,
        /// and of the other.
        second: u64,
        /// The name.
        name: String,
    },
    /// A link that does not start at the symbol it stands in.
    #[error("symbol {symbol} has a link `{label}` that starts at {src}")]
    ForeignLink {
        /// The symbol's id.
        symbol: u64,
        /// The link's label.
        label: String,
        /// Where the link says that it starts.
        src: u64,
    },
}

#[derive(Deserialize)]
struct File {
    #[serde(rename = "DSRModel")]
    model: Model,
}

#[derive(Deserialize)]
struct Model {
    #[serde(default)]
    symbols: Symbols,
}

/// A list, or a map whose keys repeat the ids.
#[derive(Default)]
struct Symbols(Vec<Symbol>);

#[derive(Deserialize)]
struct Symbol {
    id: Option<Id>,
    r#type: String,
    #[serde(default)]
    name: Option<String>,
    #[serde(default, alias = "attributes")]
    attribute: BTreeMap<String, Attribute>,
    #[serde(default)]
    links: Vec<Link>,
}

#[derive(Deserialize)]
struct Link {
    src: Option<Id>,
    dst: Id,
    label: String,
    #[serde(default, rename = "linkAttribute", alias = "linkAttributes")]
    attributes: BTreeMap<String, Attribute>,
}

/// A number, or a text that is one.
#[derive(Debug, Clone, Copy)]
struct Id(u64);

#[derive(Deserialize)]
struct RawAttribute {
    r#type: u8,
    value: Json,
}

/// Read in one step, so that an error has the place of the attribute.
#[derive(Deserialize)]
#[serde(try_from = "RawAttribute")]
struct Attribute(Value);

impl<'de> Deserialize<'de> for Id {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct IdVisitor;
        impl Visitor<'_> for IdVisitor {
            type Value = Id;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the id of a symbol, a number that is 0 or more")
            }
            fn visit_u64<E: de::Error>(self, id: u64) -> Result<Id, E> {
                Ok(Id(id))
            }
            fn visit_i64<E: de::Error>(self, id: i64) -> Result<Id, E> {
                u64::try_from(id)
                    .map(Id)
                    .map_err(|_| E::custom(format!("{id} is no symbol's id")))
            }
            fn visit_str<E: de::Error>(self, id: &str) -> Result<Id, E> {
                id.parse()
                    .map(Id)
                    .map_err(|_| E::custom(format!("`{id}` is no symbol's id")))
            }
        }
        deserializer.deserialize_any(IdVisitor)
    }
}

impl<'de> Deserialize<'de> for Symbols {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct SymbolsVisitor;
        impl<'de> Visitor<'de> for SymbolsVisitor {
            type Value = Symbols;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("symbols, as a map by id or as a list")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Symbols, A::Error> {
                let mut symbols = Vec::new();
                while let Some(symbol) = list.next_element::<Symbol>()? {
                    if symbol.id.is_none() {
                        return Err(de::Error::missing_field("id"));
                    }
                    symbols.push(symbol);
                }
                Ok(Symbols(symbols))
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Symbols, A::Error> {
                let mut symbols = Vec::new();
                while let Some(key) = map.next_key::<String>()? {
                    let mut symbol = map.next_value::<Symbol>()?;
                    if symbol.id.is_none() {
                        let id = key.parse().map(Id);
                        let wrong = |_| de::Error::custom(format!("`{key}` is no symbol's id"));
                        symbol.id = Some(id.map_err(wrong)?);
                    }
                    symbols.push(symbol);
                }
                Ok(Symbols(symbols))
            }
        }
        deserializer.deserialize_any(SymbolsVisitor)
    }
}

impl TryFrom<RawAttribute> for Attribute {
    type Error = String;
    fn try_from(raw: RawAttribute) -> Result<Self, String> {
        let RawAttribute {
            r#type: number,
            value,
        } = raw;
        let kind = KINDS.get(usize::from(number)).ok_or_else(|| {
            format!("unknown type {number} of an attribute: RoboComp has 0 to 13")
        })?;
        let decoded = decode(number, &value);
        decoded
            .map(Attribute)
            .ok_or_else(|| format!("{} is not {kind} (type {number})", brief(&value)))
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

/// A value as an error shows it.
fn brief(value: &Json) -> String {
    let text = value.to_string();
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
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
        Json::String(text) => text.parse().ok(),
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

fn decode(number: u8, json: &Json) -> Option<Value> {
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

fn values(attributes: BTreeMap<String, Attribute>) -> Vec<(String, Value)> {
    attributes
        .into_iter()
        .map(|(name, Attribute(value))| (name, value))
        .collect()
}

pub(super) fn read(text: &str) -> Result<Import, RobocompError> {
    // Not `from_str`: what follows the closing brace is none of ours.
    let file = File::deserialize(&mut serde_json::Deserializer::from_str(text))?;
    let symbols = file.model.symbols.0;
    let id_of = |symbol: &Symbol| symbol.id.map_or(0, |Id(id)| id);
    let mut ids = BTreeSet::new();
    let mut by_name: BTreeMap<&str, u64> = BTreeMap::new();
    for symbol in &symbols {
        let id = id_of(symbol);
        if !ids.insert(id) {
            return Err(RobocompError::Duplicate(id));
        }
        let name = symbol.name.as_deref().filter(|name| !name.is_empty());
        if let Some(name) = name
            && let Some(first) = by_name.insert(name, id)
        {
            let name = name.to_owned();
            return Err(RobocompError::DuplicateName {
                first,
                second: id,
                name,
            });
        }
    }
    let wanted: Vec<(String, Option<String>)> = symbols
        .iter()
        .map(|symbol| (id_of(symbol).to_string(), symbol.name.clone()))
        .collect();
    let mut import = Import::default();
    let mut links = Vec::new();
    for (symbol, name) in symbols.into_iter().zip(unique_names(&wanted)) {
        let id = id_of(&symbol);
        links.push((id, symbol.links));
        import.transaction.push(Operation::CreateNode {
            id: Some(NodeId(id)),
            type_name: symbol.r#type,
            name,
            attributes: values(symbol.attribute),
        });
    }
    for (symbol, links) in links {
        for Link {
            src,
            dst: Id(to),
            label,
            attributes,
        } in links
        {
            if let Some(Id(src)) = src.filter(|Id(src)| *src != symbol) {
                return Err(RobocompError::ForeignLink { symbol, label, src });
            }
            if !ids.contains(&to) {
                import.left_out.push(LeftOut {
                    label,
                    from: symbol,
                    to,
                });
                continue;
            }
            let edge = EdgeRef {
                from: NodeId(symbol).into(),
                label,
                to: NodeId(to).into(),
            };
            import.transaction.push(Operation::CreateEdge {
                edge,
                attributes: values(attributes),
            });
        }
    }
    Ok(import)
}
