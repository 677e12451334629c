//! What a schema does not allow, in words that name the nearest known name.

use crate::{LargeHandle, NumberKind, ValueKind};
use thiserror::Error;

/// What a name stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NameKind {
    /// A node type.
    Type,
    /// An edge label.
    Label,
    /// An attribute.
    Attribute,
}

impl std::fmt::Display for NameKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Type => "node type",
            Self::Label => "edge label",
            Self::Attribute => "attribute",
        })
    }
}

/// Why the schema does not allow something.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SchemaError {
    /// The schema does not have the name.
    #[error("unknown {kind} `{name}`{}", did_you_mean(.suggestion.as_deref()))]
    UnknownName {
        /// What it should be the name of.
        kind: NameKind,
        /// The name.
        name: String,
        /// The nearest known name.
        suggestion: Option<String>,
    },
    /// The label does not join nodes of these types.
    #[error("`{label}` does not join {from} to {to}")]
    WrongEnds {
        /// The label.
        label: String,
        /// The type of the source.
        from: String,
        /// The type of the target.
        to: String,
    },
    /// The value is not of the attribute's kind.
    #[error("`{attribute}` is a {expected}, not a {found}")]
    WrongKind {
        /// The attribute.
        attribute: String,
        /// Its kind.
        expected: ValueKind,
        /// The value's.
        found: ValueKind,
    },
    /// The value is not a number, or outside the attribute's range.
    #[error("`{attribute}` must lie in [{min}, {max}], not {value}")]
    OutOfRange {
        /// The attribute.
        attribute: String,
        /// Least allowed.
        min: f64,
        /// Largest allowed.
        max: f64,
        /// The value.
        value: f64,
    },
    /// The large value is longer than the attribute's can be.
    #[error("`{attribute}` can have {max_bytes} bytes, not {bytes}; see `max_bytes` in the schema")]
    TooLarge {
        /// The attribute.
        attribute: String,
        /// How long a value can be.
        max_bytes: u64,
        /// How long this one is.
        bytes: u64,
    },
    /// The large value's length is not that of the numbers that it should consist of.
    #[error("`{attribute}` consists of {of}, and this is not so many: {handle}")]
    WrongShape {
        /// The attribute.
        attribute: String,
        /// What its values consist of.
        of: NumberKind,
        /// The value's handle.
        handle: LargeHandle,
    },
    /// The name cannot be one.
    #[error("`{0}` cannot be a name: names are not empty and at most 255 bytes")]
    BadName(String),
    /// There are more names than ids.
    #[error("the schema is full: no more than 65535 names of a kind")]
    Full,
}

fn did_you_mean(suggestion: Option<&str>) -> String {
    suggestion.map_or_else(String::new, |name| format!(", did you mean `{name}`?"))
}

/// The known name nearest to `name`, if it is near enough to be a misspelling of it.
pub fn suggest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    known
        .into_iter()
        .map(|candidate| (strsim::damerau_levenshtein(name, candidate), candidate))
        .filter(|(distance, candidate)| *distance <= candidate.chars().count().max(3) / 3)
        .min()
        .map(|(_, candidate)| candidate.to_owned())
}
