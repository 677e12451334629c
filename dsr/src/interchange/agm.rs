//! AGM model XML: symbols and links, all attributes strings. A symbol's name is its attribute
//! `imName` where no other symbol has it, else its id; an `enabled` of a link is kept as an attribute of
//! that name.

use super::place::{Span, Text};
use super::world::{Format, Word, World, WorldAttribute, WorldEdge, WorldNode};
use super::{Problem, unique_names};
use crate::{NodeId, NodeRef};
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::BTreeMap;

/// More elements, attributes and texts than this in one file are refused.
const NODE_LIMIT: u32 = 8_000_000;

struct Reader<'a, 'b> {
    text: &'b Text<'a>,
    problems: &'b mut Vec<Problem>,
}

pub(super) fn read(text: &Text<'_>, problems: &mut Vec<Problem>) -> Option<World> {
    let options = ParsingOptions {
        nodes_limit: NODE_LIMIT,
        ..ParsingOptions::default()
    };
    let document = match Document::parse_with_options(text.body(), options) {
        Ok(document) => document,
        Err(error) => {
            problems.push(broken(text, &error));
            return None;
        }
    };
    let mut reader = Reader { text, problems };
    let root = document.root_element();
    if root.tag_name().name() != "AGMModel" {
        reader.unexpected(root, "`<AGMModel>`");
        return None;
    }
    Some(reader.world(root))
}

/// What roxmltree says, at the place where it says it.
fn broken(text: &Text<'_>, error: &roxmltree::Error) -> Problem {
    let place = error.pos();
    let body = text.body();
    let lines = body
        .split_inclusive('\n')
        .take(place.row.saturating_sub(1) as usize);
    let start: usize = lines.map(str::len).sum();
    let rest = body.get(start..).unwrap_or_default();
    let column = place.col.saturating_sub(1) as usize;
    let at = rest
        .char_indices()
        .nth(column)
        .map_or(rest.len(), |(at, _)| at);
    let byte = (start + at).min(body.len());
    let len = body[byte..].chars().next().map_or(0, char::len_utf8);
    let message = error.to_string();
    let end = message.rfind(" at ").unwrap_or(message.len());
    text.problem(text.span_in_body(&(byte..byte + len)), &message[..end])
}

impl Reader<'_, '_> {
    fn world(&mut self, root: Node<'_, '_>) -> World {
        let mut world = World::new(Format::Agm);
        let (mut symbols, mut links) = (Vec::new(), Vec::new());
        for element in root.children().filter(Node::is_element) {
            match element.tag_name().name() {
                "symbol" => symbols.push(element),
                "link" => links.push(element),
                _ => self.unexpected(element, "`<symbol>` or `<link>`"),
            }
        }
        let mut read = Vec::new();
        for element in symbols {
            let (id, kind) = (self.said(element, "id"), self.said(element, "type"));
            let attributes = self.attributes(element, "attribute", "`<attribute>`");
            if let (Some(id), Some(kind)) = (id, kind) {
                read.push((id, kind, attributes));
            }
        }
        let name_of = |attributes: &[WorldAttribute]| {
            let name = attributes.iter().find(|a| a.name.text == "imName");
            name.map(|name| name.value.as_str().unwrap_or_default().to_owned())
        };
        let wanted: Vec<(String, Option<String>)> = read
            .iter()
            .map(|(id, _, attributes)| (id.text.clone(), name_of(attributes)))
            .collect();
        let mut known: BTreeMap<String, NodeRef> = BTreeMap::new();
        for ((id, type_name, attributes), name) in read.into_iter().zip(unique_names(&wanted)) {
            let number = number(&id.text).map(NodeId);
            let reference = number.map_or_else(|| NodeRef::Name(name.clone()), NodeRef::Id);
            if known.insert(id.text.clone(), reference).is_some() {
                self.problem(id.span, format!("there is a symbol `{}` already", id.text));
                continue;
            }
            world.nodes.push(WorldNode {
                id: number.map(|number| (number, id.span.clone())),
                type_name,
                name: Word {
                    text: name,
                    span: id.span,
                },
                attributes,
            });
        }
        for element in links {
            let edge = self.link(element, &known);
            world.edges.extend(edge);
        }
        world
    }

    fn link(
        &mut self,
        element: Node<'_, '_>,
        known: &BTreeMap<String, NodeRef>,
    ) -> Option<WorldEdge> {
        let label = self.said(element, "label");
        let ends = ["src", "dst"].map(|name| self.said(element, name));
        let mut attributes = self.attributes(element, "linkAttribute", "`<linkAttribute>`");
        let label = label?;
        let [from, to] = ends.map(|end| {
            let id = end?;
            let Some(found) = known.get(&id.text) else {
                let message = format!(
                    "there is no symbol `{}` for the link `{}`",
                    id.text, label.text
                );
                self.problem(id.span, message);
                return None;
            };
            Some((found.clone(), id.span))
        });
        let given = attributes.iter().any(|a| a.name.text == "enabled");
        if let Some(enabled) = element.attribute_node("enabled").filter(|_| !given) {
            let span = self.shift(enabled.range_value());
            attributes.push(attribute(
                Word {
                    text: "enabled".to_owned(),
                    span: self.shift(enabled.range_qname()),
                },
                Word {
                    text: enabled.value().to_owned(),
                    span,
                },
            ));
        }
        Some(WorldEdge {
            from: from?,
            label,
            to: to?,
            attributes,
        })
    }

    /// The attributes below a symbol or link; of one that is given twice the last.
    fn attributes(
        &mut self,
        element: Node<'_, '_>,
        tag: &str,
        expected: &str,
    ) -> Vec<WorldAttribute> {
        let mut attributes: Vec<WorldAttribute> = Vec::new();
        for inner in element.children().filter(Node::is_element) {
            if inner.tag_name().name() != tag {
                self.unexpected(inner, expected);
                continue;
            }
            let (key, value) = (self.said(inner, "key"), self.said(inner, "value"));
            if let (Some(key), Some(value)) = (key, value) {
                attributes.retain(|known| known.name.text != key.text);
                attributes.push(attribute(key, value));
            }
        }
        attributes
    }

    fn said(&mut self, element: Node<'_, '_>, name: &str) -> Option<Word> {
        match element.attribute_node(name) {
            Some(found) => Some(Word {
                text: found.value().to_owned(),
                span: self.shift(found.range_value()),
            }),
            None => {
                let message = format!("`<{}>` has no `{name}`", element.tag_name().name());
                self.problem(self.tag(element), message);
                None
            }
        }
    }

    fn unexpected(&mut self, element: Node<'_, '_>, expected: &str) {
        let found = element.tag_name().name();
        self.problem(
            self.tag(element),
            format!("expected {expected}, found `<{found}>`"),
        );
    }

    fn problem(&mut self, span: Span, message: impl Into<String>) {
        self.problems.push(self.text.problem(span, message));
    }

    fn shift(&self, span: Span) -> Span {
        self.text.span_in_body(&span)
    }

    /// An element's opening bracket and name.
    fn tag(&self, element: Node<'_, '_>) -> Span {
        let start = element.range().start;
        self.shift(start..start + 1 + element.tag_name().name().len())
    }
}

fn attribute(name: Word, value: Word) -> WorldAttribute {
    WorldAttribute {
        name,
        value: value.text.into(),
        span: value.span,
        time: None,
        agent: None,
    }
}

/// The number that an id is, if writing the number gives the id again: `07` is a text.
fn number(id: &str) -> Option<u64> {
    id.parse::<u64>()
        .ok()
        .filter(|number| number.to_string() == id)
}
