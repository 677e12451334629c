//! Reading graph JSON; [`crate::json`] owns the format.

use super::Problem;
use super::place::{Fields, Span, Text};
use super::world::{Format, Word, World, WorldAttribute, WorldEdge, WorldNode};
use crate::json::{FORMAT, value_from_json};
use crate::{NodeId, NodeRef, Schema};
use serde::Deserialize;
use serde_json::Value as Json;
use serde_json::value::RawValue;

#[derive(Deserialize)]
struct File<'a> {
    #[serde(borrow)]
    format: &'a RawValue,
    #[serde(borrow)]
    nodes: Vec<NodeRow<'a>>,
    #[serde(default, borrow)]
    edges: Vec<EdgeRow<'a>>,
}

#[derive(Deserialize)]
struct NodeRow<'a> {
    #[serde(default, borrow)]
    id: Option<&'a RawValue>,
    #[serde(borrow)]
    r#type: &'a RawValue,
    #[serde(borrow)]
    name: &'a RawValue,
    #[serde(default, borrow)]
    attributes: Fields<'a>,
}

#[derive(Deserialize)]
struct EdgeRow<'a> {
    #[serde(borrow)]
    from: &'a RawValue,
    #[serde(borrow)]
    label: &'a RawValue,
    #[serde(borrow)]
    to: &'a RawValue,
    #[serde(default, borrow)]
    attributes: Fields<'a>,
}

struct Reader<'a, 'b> {
    text: &'b Text<'a>,
    schema: &'b Schema,
    problems: &'b mut Vec<Problem>,
}

pub(super) fn read(text: &Text<'_>, schema: &Schema, problems: &mut Vec<Problem>) -> Option<World> {
    let file: File<'_> = match serde_json::from_str(text.body()) {
        Ok(file) => file,
        Err(error) => {
            problems.push(text.broken(&error));
            return None;
        }
    };
    let mut reader = Reader {
        text,
        schema,
        problems,
    };
    let format = reader.word(file.format);
    if format.text != FORMAT {
        let message = format!("the format is `{}`, not `{FORMAT}`", format.text);
        reader.problem(format.span, message);
        return None;
    }
    let mut world = World::new(Format::Json);
    for row in file.nodes {
        let node = WorldNode {
            id: row.id.and_then(|id| reader.id(id)),
            type_name: reader.word(row.r#type),
            name: reader.word(row.name),
            attributes: reader.attributes(row.attributes),
        };
        world.nodes.push(node);
    }
    for row in file.edges {
        let edge = WorldEdge {
            from: reader.end(row.from),
            label: reader.word(row.label),
            to: reader.end(row.to),
            attributes: reader.attributes(row.attributes),
        };
        world.edges.push(edge);
    }
    Some(world)
}

impl Reader<'_, '_> {
    fn problem(&mut self, span: Span, message: impl Into<String>) {
        self.problems.push(self.text.problem(span, message));
    }

    fn word(&mut self, raw: &RawValue) -> Word {
        let span = self.text.span_of(raw.get());
        let text = serde_json::from_str(raw.get()).unwrap_or_else(|_| {
            self.problem(span.clone(), format!("{} is not a text", raw.get()));
            String::from("?")
        });
        Word { text, span }
    }

    fn id(&mut self, raw: &RawValue) -> Option<(NodeId, Span)> {
        let span = self.text.span_of(raw.get());
        match serde_json::from_str::<Option<u64>>(raw.get()) {
            Ok(id) => id.map(|id| (NodeId(id), span)),
            Err(_) => {
                self.problem(span, format!("{} is no node's id", raw.get()));
                None
            }
        }
    }

    /// An end of an edge: an id, or a name where the file has no ids.
    fn end(&mut self, raw: &RawValue) -> (NodeRef, Span) {
        match serde_json::from_str::<u64>(raw.get()) {
            Ok(id) => (NodeId(id).into(), self.text.span_of(raw.get())),
            Err(_) => {
                let name = self.word(raw);
                (NodeRef::Name(name.text), name.span)
            }
        }
    }

    fn attributes(&mut self, fields: Fields<'_>) -> Vec<WorldAttribute> {
        let mut attributes: Vec<WorldAttribute> = Vec::new();
        for (key, raw) in fields.0 {
            let (name, value) = (key.span(self.text, raw), self.text.span_of(raw.get()));
            if attributes.iter().any(|a| a.name.text == key.0) {
                self.problem(name, format!("the attribute `{}` is given twice", key.0));
                continue;
            }
            let known = self.schema.attributes();
            let known = known.iter().find(|known| known.name == key.0);
            // The text of a raw value is JSON.
            let json: Json = serde_json::from_str(raw.get()).unwrap_or_default();
            match value_from_json(&json, known.and_then(|known| known.kind)) {
                Err(reason) => self.problem(value, format!("attribute `{}`: {reason}", key.0)),
                Ok(read) => attributes.push(WorldAttribute {
                    name: Word {
                        text: key.0.into_owned(),
                        span: name,
                    },
                    value: read,
                    span: value,
                    time: None,
                    agent: None,
                }),
            }
        }
        attributes
    }
}
