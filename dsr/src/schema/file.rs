//! Schema files: TOML with the tables `types`, `labels` and `attributes`. This file guarantees
//! that every name a schema file uses is defined in it, and points at the one that is not.

use super::{AttributeType, NodeType, Schema, SchemaError, suggest};
use crate::{LargeType, NumberKind, TypeId, ValueKind};
use miette::{Diagnostic, NamedSource, SourceSpan};
use petgraph::algo::toposort;
use petgraph::graph::DiGraph;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::Range;
use thiserror::Error;
use toml::Spanned;

/// How many values of an attribute can be kept.
const HISTORY: std::ops::RangeInclusive<u64> = 2..=4096;
/// How many times a second a hot attribute may be folded into the graph.
const HOT: std::ops::RangeInclusive<f64> = 0.01..=1000.0;

/// What is wrong with a schema file, and where.
#[derive(Debug, Clone, Error, Diagnostic)]
#[error("{message}")]
#[diagnostic(code(schema))]
pub struct SchemaFileError {
    message: String,
    #[source_code]
    text: NamedSource<String>,
    #[label("here")]
    span: Option<SourceSpan>,
    #[help]
    help: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    open: bool,
    #[serde(default)]
    types: BTreeMap<Spanned<String>, Vec<Spanned<String>>>,
    #[serde(default)]
    labels: BTreeMap<Spanned<String>, LabelEnds>,
    #[serde(default)]
    attributes: BTreeMap<Spanned<String>, AttributeRow>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LabelEnds {
    #[serde(default)]
    from: Vec<Spanned<String>>,
    #[serde(default)]
    to: Vec<Spanned<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AttributeRow {
    kind: Spanned<String>,
    unit: Option<String>,
    min: Option<f64>,
    max: Option<f64>,
    index: Option<Spanned<bool>>,
    history: Option<Spanned<u64>>,
    hot: Option<Spanned<f64>>,
    of: Option<Spanned<String>>,
    max_bytes: Option<Spanned<u64>>,
}

/// What is wrong with a history of so many values.
fn why_no_history(history: u64) -> Option<String> {
    let (least, most) = (HISTORY.start(), HISTORY.end());
    let wrong = !HISTORY.contains(&history);
    wrong.then(|| format!("a history has {least} to {most} values"))
}

/// What is wrong with that rate of a hot attribute.
fn why_not_hot(kind: ValueKind, rate: f64) -> Option<String> {
    if !crate::hot::has_fixed_size(kind) {
        return Some(format!("a {} cannot be hot", kind.name()));
    }
    let (least, most) = (HOT.start(), HOT.end());
    let wrong = !HOT.contains(&rate);
    wrong.then(|| format!("a hot attribute is folded in {least} to {most} times a second"))
}

/// Why a row cannot be so, where it says so, and what would be right.
type Wrong = (String, Range<usize>, Option<String>);

fn value_kind(name: &Spanned<String>) -> Result<ValueKind, Wrong> {
    ValueKind::from_name(name.get_ref()).ok_or_else(|| {
        let known = ValueKind::ALL.map(ValueKind::name).join(", ");
        let message = format!("unknown kind of value `{}`", name.get_ref());
        (message, name.span(), Some(format!("one of {known}")))
    })
}

/// What a row says of large values.
fn large_type(kind: ValueKind, row: &AttributeRow) -> Result<Option<LargeType>, Wrong> {
    let spans = [
        row.of.as_ref().map(Spanned::span),
        row.max_bytes.as_ref().map(Spanned::span),
    ];
    if kind != ValueKind::Large {
        return match spans.into_iter().flatten().next() {
            None => Ok(None),
            Some(span) => {
                let message = format!("a {} is in the graph itself", kind.name());
                Err((message, span, Some("kind = \"large\" has it".to_owned())))
            }
        };
    }
    let mut large = LargeType::default();
    if let Some(asked) = &row.of {
        large.of = NumberKind::from_name(asked.get_ref()).ok_or_else(|| {
            let known = NumberKind::ALL.map(NumberKind::name).join(", ");
            let message = format!("unknown kind of number `{}`", asked.get_ref());
            (message, asked.span(), Some(format!("one of {known}")))
        })?;
    }
    if let Some(asked) = &row.max_bytes {
        large.max_bytes = *asked.get_ref();
        if !(1..=LargeType::MAX_BYTES).contains(&large.max_bytes) {
            let most = LargeType::MAX_BYTES;
            let message = format!("a large value has 1 to {most} bytes at the most");
            return Err((message, asked.span(), None));
        }
    }
    Ok(Some(large))
}

impl Schema {
    /// Reads a schema file: `types` maps each type to its parents, `labels` each label to the
    /// types it may start `from` and end at (`to`), `attributes` each attribute to its `kind`
    /// (see [`ValueKind::name`]), `unit`, `min`, `max`, `index`, `history` and `hot`, and of large values
    /// `of` and `max_bytes`. `open = true` lets other names in.
    ///
    /// # Errors
    /// Broken TOML, an unknown key, kind or type name, an index of what has no order and is no
    /// text, a history that is too short or too long, a rate of what cannot be hot, large
    /// values of what is no number; with its place in the file.
    pub fn from_toml(file_name: &str, text: &str) -> Result<Self, SchemaFileError> {
        let error = |message: String, span: Option<Range<usize>>, help| SchemaFileError {
            message,
            text: NamedSource::new(file_name, text.to_owned()),
            span: span.map(Into::into),
            help,
        };
        let file: File =
            toml::from_str(text).map_err(|e| error(e.message().to_owned(), e.span(), None))?;
        let mut schema = Self::open();
        schema.parts.open = file.open;
        let names: Vec<&str> = file
            .types
            .keys()
            .map(|name| name.get_ref().as_str())
            .collect();
        let refused = |e: SchemaError, span| error(e.to_string(), Some(span), None);
        // Parents may stand below their children, so that ids are given first.
        for name in file.types.keys() {
            schema
                .add_type(name.get_ref(), &[])
                .map_err(|e| refused(e, name.span()))?;
        }
        let look_up = |schema: &Self, list: &[Spanned<String>]| -> Result<Vec<TypeId>, _> {
            list.iter()
                .map(|name| {
                    schema.find_type(name.get_ref()).ok_or_else(|| {
                        let help = suggest(name.get_ref(), names.iter().copied())
                            .map(|known| format!("did you mean `{known}`?"));
                        let message = format!("unknown node type `{}`", name.get_ref());
                        error(message, Some(name.span()), help)
                    })
                })
                .collect()
        };
        for (index, parents) in file.types.values().enumerate() {
            schema.parts.types[index].parents = look_up(&schema, parents)?;
        }
        schema.index_subtypes();
        if let Some(name) = in_a_circle(schema.types()).and_then(|at| file.types.keys().nth(at)) {
            let message = format!("`{}` is its own ancestor", name.get_ref());
            return Err(error(message, Some(name.span()), None));
        }
        for (name, ends) in &file.labels {
            let (from, to) = (look_up(&schema, &ends.from)?, look_up(&schema, &ends.to)?);
            schema
                .add_label(name.get_ref(), &from, &to)
                .map_err(|e| refused(e, name.span()))?;
        }
        for (name, row) in file.attributes {
            let kind = value_kind(&row.kind)
                .map_err(|(message, span, help)| error(message, Some(span), help))?;
            let large = large_type(kind, &row)
                .map_err(|(message, span, help)| error(message, Some(span), help))?;
            let index = row.index.as_ref().is_some_and(|index| *index.get_ref());
            if let Some(asked) = row.index.filter(|_| index && !kind.can_have_index()) {
                let message = format!("a {} cannot have an index", kind.name());
                let help = "numbers, bools and strings can".to_owned();
                return Err(error(message, Some(asked.span()), Some(help)));
            }
            let history = row.history.as_ref().map_or(0, |history| *history.get_ref());
            if let Some(asked) = row.history
                && let Some(message) = why_no_history(history)
            {
                return Err(error(message, Some(asked.span()), None));
            }
            let hot = row.hot.as_ref().map(|rate| *rate.get_ref());
            if let Some(asked) = row.hot
                && let Some(message) = why_not_hot(kind, *asked.get_ref())
            {
                let help = "poses, vectors, numbers and bools can be".to_owned();
                return Err(error(message, Some(asked.span()), Some(help)));
            }
            let attribute = AttributeType {
                name: name.get_ref().clone(),
                kind: Some(kind),
                unit: row.unit,
                min: row.min,
                max: row.max,
                index,
                history: history as u16,
                hot,
                large,
            };
            schema
                .add_attribute(attribute)
                .map_err(|e| refused(e, name.span()))?;
        }
        Ok(schema)
    }
}

/// The place of a type that descends from itself.
fn in_a_circle(types: &[NodeType]) -> Option<usize> {
    let steps = (0..).zip(types).flat_map(|(child, of): (u32, _)| {
        let parents = of.parents.iter();
        parents.map(move |parent| (child, u32::from(parent.0)))
    });
    let order = toposort(&DiGraph::<(), ()>::from_edges(steps), None);
    order.err().map(|circle| circle.node_id().index())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place_of(text: &str) -> (String, String) {
        let error = Schema::from_toml("s.toml", text).unwrap_err();
        let span = error.span.unwrap();
        let place = &text[span.offset()..span.offset() + span.len()];
        (error.to_string(), place.to_owned())
    }

    #[test]
    fn an_unknown_parent_is_pointed_at() {
        let (message, place) = place_of("[types]\nthing = []\nroom = [\"thnig\"]\n");
        assert_eq!(message, "unknown node type `thnig`");
        assert_eq!(place, "\"thnig\"");
    }

    #[test]
    fn a_circle_of_types_is_refused() {
        let (message, _) = place_of("[types]\na = [\"b\"]\nb = [\"a\"]\n");
        assert!(message.contains("its own ancestor"), "{message}");
    }

    #[test]
    fn an_index_of_what_cannot_have_one_is_pointed_at() {
        let (message, place) = place_of("[attributes]\nx = { kind = \"pose\", index = true }\n");
        assert_eq!(
            (message.as_str(), place.as_str()),
            ("a pose cannot have an index", "true")
        );
    }

    #[test]
    fn a_history_of_one_value_is_pointed_at() {
        let (message, place) = place_of("[attributes]\nx = { kind = \"pose\", history = 1 }\n");
        assert_eq!(
            (message.as_str(), place.as_str()),
            ("a history has 2 to 4096 values", "1")
        );
    }

    #[test]
    fn what_cannot_be_hot_is_pointed_at() {
        let (message, place) = place_of("[attributes]\nx = { kind = \"string\", hot = 10.0 }\n");
        assert_eq!(
            (message.as_str(), place.as_str()),
            ("a string cannot be hot", "10.0")
        );
        let (message, _) = place_of("[attributes]\nx = { kind = \"pose\", hot = 0.0 }\n");
        assert!(message.contains("0.01 to 1000 times a second"), "{message}");
    }

    #[test]
    fn what_large_values_cannot_be_is_pointed_at() {
        let of = |row: &str| place_of(&format!("[attributes]\nx = {{ {row} }}\n"));
        let (message, place) = of("kind = \"large\", of = \"f23\"");
        assert_eq!(
            (message.as_str(), place.as_str()),
            ("unknown kind of number `f23`", "\"f23\"")
        );
        let (message, place) = of("kind = \"large\", max_bytes = 0");
        assert!(message.contains("1 to 1073741824 bytes"), "{message}");
        assert_eq!(place, "0");
        let (message, place) = of("kind = \"u8_list\", max_bytes = 10");
        assert_eq!(
            (message.as_str(), place.as_str()),
            ("a u8_list is in the graph itself", "10")
        );
    }

    #[test]
    fn an_unknown_kind_is_pointed_at() {
        let (message, place) = place_of("[attributes]\nx = { kind = \"f65\" }\n");
        assert_eq!(
            (message.as_str(), place.as_str()),
            ("unknown kind of value `f65`", "\"f65\"")
        );
    }
}
