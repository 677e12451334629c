//! Worlds of other systems: which format a text is in, and the transaction that makes, on an empty
//! graph with an open schema, what it says. Guarantees that nothing of a file is dropped in silence
//! but what [`read`] names, and that no text, however broken, makes it panic.

mod agm;
mod robocomp;

pub use agm::AgmError;
pub use robocomp::RobocompError;

use crate::{Transaction, json};
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;
use std::fmt;
use thiserror::Error;

/// Why a world cannot be read.
#[derive(Debug, Error)]
pub enum InterchangeError {
    /// Graph JSON, or text of no known format.
    #[error(transparent)]
    Json(#[from] json::JsonError),
    /// RoboComp DSR JSON.
    #[error(transparent)]
    Robocomp(#[from] RobocompError),
    /// AGM model XML.
    #[error(transparent)]
    Agm(#[from] AgmError),
}

/// What a text says of a world.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Import {
    /// Makes the world on an empty graph with an open schema.
    pub transaction: Transaction,
    /// What could not be kept.
    pub left_out: Vec<LeftOut>,
}

/// A link of a RoboComp file to a symbol that the file does not have.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// The link's label.
    pub label: String,
    /// The id of the symbol where it starts.
    pub from: u64,
    /// The id that no symbol has.
    pub to: u64,
}

impl From<Transaction> for Import {
    fn from(transaction: Transaction) -> Self {
        Self {
            transaction,
            left_out: Vec::new(),
        }
    }
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { label, from, to } = self;
        write!(
            f,
            "the link `{label}` of symbol {from} is left out: there is no symbol {to}"
        )
    }
}

/// What tells the JSON formats from each other.
#[derive(Deserialize)]
struct Probe {
    #[serde(rename = "DSRModel")]
    dsr_model: Option<IgnoredAny>,
}

/// The world that a text says: graph JSON (see [`crate::json`]), RoboComp DSR JSON or AGM model XML. A byte-order mark may come
/// first.
///
/// Of RoboComp's files, time stamps and agent ids of attributes are dropped, and what follows the
/// closing brace; a node's id, type, name, attributes and links are kept as they are.
///
/// # Errors
/// [`InterchangeError`], with the place.
///
/// # Example
/// ```
/// let xml = r#"<AGMModel>
///     <link src="1" dst="2" label="in"/>
///     <symbol id="1" type="robot"/>
///     <symbol id="2" type="room"><attribute key="imName" value="kitchen"/></symbol>
/// </AGMModel>"#;
/// let mut graph = dsr::Graph::in_memory(dsr::Schema::open());
/// graph.commit(&dsr::interchange::read(xml)?.transaction, "me", dsr::Time::default())?;
/// assert!(graph.snapshot().find_node_by_name("kitchen")?.is_some());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read(text: &str) -> Result<Import, InterchangeError> {
    let text = text.trim_start_matches('\u{feff}');
    if text.trim_start().starts_with('<') {
        return Ok(agm::read(text)?.into());
    }
    let mut values = serde_json::Deserializer::from_str(text).into_iter::<Probe>();
    match values.next() {
        Some(Ok(Probe { dsr_model: Some(_) })) => Ok(robocomp::read(text)?),
        _ => Ok(json::from_json(text)?.into()),
    }
}

/// The unique name of each node: the name that it asks for, if no other node asks for it or has it
/// as its id; else its id.
fn unique_names(wanted: &[(String, Option<String>)]) -> Vec<String> {
    let mut times: BTreeMap<&str, usize> = BTreeMap::new();
    for (id, name) in wanted {
        *times.entry(id).or_default() += 1;
        if let Some(name) = name.as_ref().filter(|name| *name != id) {
            *times.entry(name).or_default() += 1;
        }
    }
    let unique = |name: &&String| !name.is_empty() && times.get(name.as_str()) == Some(&1);
    let name =
        |(id, name): &(String, Option<String>)| name.as_ref().filter(unique).unwrap_or(id).clone();
    wanted.iter().map(name).collect()
}

#[cfg(test)]
mod tests;
