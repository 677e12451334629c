//! AGM model XML: symbols and links, all attributes strings. Guarantees that each error names its
//! line and column. A symbol's name is its attribute `imName` where no other symbol has it, else
//! its id; an `enabled` of a link is kept as an attribute of that name.

use super::unique_names;
use crate::{EdgeRef, NodeId, NodeRef, Operation, Transaction, Value};
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::BTreeMap;
use thiserror::Error;

/// More elements, attributes and texts than this in one file are refused.
const NODE_LIMIT: u32 = 8_000_000;

/// Why AGM model XML cannot be read.
#[derive(Debug, Error)]
pub enum AgmError {
    /// It is not XML.
    #[error("{0}")]
    Syntax(#[from] roxmltree::Error),
    /// An element that does not belong where it stands.
    #[error("line {line} column {column}: expected {expected}, found `<{found}>`")]
    Element {
        /// Line, from 1.
        line: u32,
        /// Column, from 1.
        column: u32,
        /// What may stand here.
        expected: &'static str,
        /// What stands here.
        found: String,
    },
    /// Something that an element must say is missing.
    #[error("line {line} column {column}: `<{element}>` has no `{attribute}`")]
    Missing {
        /// Line, from 1.
        line: u32,
        /// Column, from 1.
        column: u32,
        /// The element.
        element: String,
        /// What it does not say.
        attribute: &'static str,
    },
    /// Two symbols with one id.
    #[error("line {line} column {column}: there is a symbol `{id}` already")]
    Duplicate {
        /// Line, from 1.
        line: u32,
        /// Column, from 1.
        column: u32,
        /// The id.
        id: String,
    },
    /// A link that ends at a symbol that the file does not have.
    #[error("line {line} column {column}: there is no symbol `{id}` for the link `{label}`")]
    NoSuchSymbol {
        /// Line, from 1.
        line: u32,
        /// Column, from 1.
        column: u32,
        /// The link's label.
        label: String,
        /// The id.
        id: String,
    },
}

struct Symbol<'a> {
    id: &'a str,
    type_name: &'a str,
    attributes: BTreeMap<&'a str, &'a str>,
}

/// A symbol as operations name it.
struct Known {
    name: String,
    id: Option<NodeId>,
}

pub(super) fn read(text: &str) -> Result<Transaction, AgmError> {
    let options = ParsingOptions {
        nodes_limit: NODE_LIMIT,
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(text, options)?;
    let root = document.root_element();
    if root.tag_name().name() != "AGMModel" {
        return Err(unexpected(root, "`<AGMModel>`"));
    }
    let (mut symbols, mut links) = (Vec::new(), Vec::new());
    for element in root.children().filter(Node::is_element) {
        match element.tag_name().name() {
            "symbol" => symbols.push((element, symbol(element)?)),
            "link" => links.push(element),
            _ => return Err(unexpected(element, "`<symbol>` or `<link>`")),
        }
    }
    let wanted: Vec<(String, Option<String>)> = symbols
        .iter()
        .map(|(_, s)| {
            (
                s.id.to_owned(),
                s.attributes.get("imName").map(|&name| name.to_owned()),
            )
        })
        .collect();
    let mut known: BTreeMap<&str, Known> = BTreeMap::new();
    // Ids that the store chooses come after those that the file gives, so that they do not meet.
    let (mut numbered, mut others) = (Transaction::new(), Vec::new());
    for ((element, symbol), name) in symbols.iter().zip(unique_names(&wanted)) {
        let id = number(symbol.id).map(NodeId);
        let entry = Known {
            name: name.clone(),
            id,
        };
        if known.insert(symbol.id, entry).is_some() {
            let (line, column) = place(*element);
            return Err(AgmError::Duplicate {
                line,
                column,
                id: symbol.id.to_owned(),
            });
        }
        let node = Operation::CreateNode {
            id,
            type_name: symbol.type_name.to_owned(),
            name,
            attributes: values(&symbol.attributes),
        };
        match id {
            Some(_) => numbered.push(node),
            None => others.push(node),
        }
    }
    let mut transaction = numbered;
    transaction.operations.extend(others);
    for element in links {
        transaction.push(link(element, &known)?);
    }
    Ok(transaction)
}

/// The number that an id is, if writing the number gives the id again: `07` is a text.
fn number(id: &str) -> Option<u64> {
    id.parse::<u64>()
        .ok()
        .filter(|number| number.to_string() == id)
}

fn values(attributes: &BTreeMap<&str, &str>) -> Vec<(String, Value)> {
    attributes
        .iter()
        .map(|(&key, &value)| (key.to_owned(), value.into()))
        .collect()
}

fn place(element: Node<'_, '_>) -> (u32, u32) {
    let place = element.document().text_pos_at(element.range().start);
    (place.row, place.col)
}

fn unexpected(element: Node<'_, '_>, expected: &'static str) -> AgmError {
    let (line, column) = place(element);
    AgmError::Element {
        line,
        column,
        expected,
        found: element.tag_name().name().to_owned(),
    }
}

fn said<'a>(element: Node<'a, '_>, attribute: &'static str) -> Result<&'a str, AgmError> {
    element.attribute(attribute).ok_or_else(|| {
        let (line, column) = place(element);
        let element = element.tag_name().name().to_owned();
        AgmError::Missing {
            line,
            column,
            element,
            attribute,
        }
    })
}

/// The attributes below a symbol or link.
fn attributes<'a>(
    element: Node<'a, '_>,
    tag: &str,
    expected: &'static str,
) -> Result<BTreeMap<&'a str, &'a str>, AgmError> {
    let mut attributes = BTreeMap::new();
    for inner in element.children().filter(Node::is_element) {
        if inner.tag_name().name() != tag {
            return Err(unexpected(inner, expected));
        }
        attributes.insert(said(inner, "key")?, said(inner, "value")?);
    }
    Ok(attributes)
}

fn symbol<'a>(element: Node<'a, '_>) -> Result<Symbol<'a>, AgmError> {
    Ok(Symbol {
        id: said(element, "id")?,
        type_name: said(element, "type")?,
        attributes: attributes(element, "attribute", "`<attribute>`")?,
    })
}

fn link(element: Node<'_, '_>, known: &BTreeMap<&str, Known>) -> Result<Operation, AgmError> {
    let label = said(element, "label")?;
    let end = |attribute| -> Result<NodeRef, AgmError> {
        let id = said(element, attribute)?;
        let found = known.get(id).ok_or_else(|| {
            let (line, column) = place(element);
            AgmError::NoSuchSymbol {
                line,
                column,
                label: label.to_owned(),
                id: id.to_owned(),
            }
        })?;
        Ok(found
            .id
            .map_or_else(|| NodeRef::Name(found.name.clone()), NodeRef::Id))
    };
    let edge = EdgeRef {
        from: end("src")?,
        label: label.to_owned(),
        to: end("dst")?,
    };
    let mut attributes = attributes(element, "linkAttribute", "`<linkAttribute>`")?;
    if let Some(enabled) = element.attribute("enabled") {
        attributes.entry("enabled").or_insert(enabled);
    }
    Ok(Operation::CreateEdge {
        edge,
        attributes: values(&attributes),
    })
}
