//! Places in a text. Guarantees that what was taken out of a text without a copy is found in it again.

use super::{Problem, Severity};
use serde::de::{self, Deserialize, Deserializer, MapAccess, Visitor};
use serde_json::value::RawValue;
use std::borrow::Cow;
use std::fmt;
use std::ops::Range;

pub(crate) type Span = Range<usize>;

/// A text with the byte-order mark that it may begin with.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Text<'a>(&'a str);

impl<'a> Text<'a> {
    pub(crate) fn new(text: &'a str) -> Self {
        Self(text)
    }

    /// Without the mark.
    pub(crate) fn body(&self) -> &'a str {
        self.0.trim_start_matches('\u{feff}')
    }

    /// Where a part of the text stands in it; its end for a text from elsewhere.
    pub(crate) fn span_of(&self, part: &str) -> Span {
        let from = (part.as_ptr() as usize).wrapping_sub(self.0.as_ptr() as usize);
        let to = from.saturating_add(part.len());
        if to <= self.0.len() {
            from..to
        } else {
            self.0.len()..self.0.len()
        }
    }

    /// The span of bytes of the body as one of the text.
    pub(crate) fn span_in_body(&self, span: &Span) -> Span {
        let mark = self.0.len() - self.body().len();
        span.start + mark..span.end + mark
    }

    /// Line and column of a byte, counted from 1; the column in characters.
    fn place_of(&self, byte: usize) -> (usize, usize) {
        let before = self.0.get(..byte).unwrap_or(self.0);
        let line = before.rsplit('\n').next().unwrap_or_default();
        let line = line.trim_start_matches('\u{feff}');
        (before.matches('\n').count() + 1, line.chars().count() + 1)
    }

    pub(crate) fn problem(&self, span: Span, message: impl Into<String>) -> Problem {
        Problem {
            severity: Severity::Error,
            message: message.into(),
            help: None,
            place: Some(self.place_of(span.start)),
            span: Some(span),
        }
    }

    /// What `serde_json` says, at the place where it says it.
    pub(crate) fn broken(&self, error: &serde_json::Error) -> Problem {
        let body = self.body();
        let lines = body
            .split_inclusive('\n')
            .take(error.line().saturating_sub(1));
        let start: usize = lines.map(str::len).sum();
        let byte = (start + error.column().saturating_sub(1)).min(body.len());
        let byte = (0..=byte)
            .rev()
            .find(|&byte| body.is_char_boundary(byte))
            .unwrap_or(0);
        let len = body[byte..].chars().next().map_or(0, char::len_utf8);
        let mut message = error.to_string();
        if let Some(end) = message.rfind(" at line ") {
            message.truncate(end);
        }
        self.problem(self.span_in_body(&(byte..byte + len)), message)
    }
}

/// The name of a field, borrowed from the text where it has no escapes.
#[derive(Debug, Clone)]
pub(crate) struct Key<'a>(pub(crate) Cow<'a, str>);

impl<'de: 'a, 'a> Deserialize<'de> for Key<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct KeyVisitor;
        impl<'de> Visitor<'de> for KeyVisitor {
            type Value = Key<'de>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a name")
            }
            fn visit_borrowed_str<E: de::Error>(self, name: &'de str) -> Result<Key<'de>, E> {
                Ok(Key(Cow::Borrowed(name)))
            }
            fn visit_str<E: de::Error>(self, name: &str) -> Result<Key<'de>, E> {
                Ok(Key(Cow::Owned(name.to_owned())))
            }
        }
        deserializer.deserialize_str(KeyVisitor)
    }
}

/// An object's fields in the order of the text, not yet read.
#[derive(Debug, Clone, Default)]
pub(crate) struct Fields<'a>(pub(crate) Vec<(Key<'a>, &'a RawValue)>);

impl<'de: 'a, 'a> Deserialize<'de> for Fields<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct FieldsVisitor;
        impl<'de> Visitor<'de> for FieldsVisitor {
            type Value = Fields<'de>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("attributes by name")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Fields<'de>, A::Error> {
                let mut fields = Vec::new();
                while let Some(key) = map.next_key()? {
                    fields.push((key, map.next_value()?));
                }
                Ok(Fields(fields))
            }
        }
        deserializer.deserialize_map(FieldsVisitor)
    }
}

impl Key<'_> {
    /// Where it stands, or at least what it is the name of.
    pub(crate) fn span(&self, text: &Text<'_>, value: &RawValue) -> Span {
        match self.0 {
            Cow::Borrowed(name) => text.span_of(name),
            Cow::Owned(_) => text.span_of(value.get()),
        }
    }
}
