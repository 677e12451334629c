//! What was decided about a mission, why, and by whose commit, as it stands in the graph. This file
//! guarantees that the list of a mission stays short: the oldest go first.

use super::record::Applied;
use dsr::{ReadError, Snapshot, Time, Version};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// So many decisions stay in the graph, per mission.
const KEPT: usize = 30;

/// A commit that brought something about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// The version of the graph that it made.
    pub version: Version,
    /// When, seconds since 1970 by the clock of the instance.
    pub time: f64,
    /// Who asked for it.
    pub agent: String,
    /// The rules that it applied, each as `rule(variable=node, ...)`.
    pub rules: Vec<String>,
}

impl Cause {
    /// The commit that made a version; `None` where it is not kept any more, or nobody made it.
    ///
    /// # Errors
    /// [`ReadError`] where the graph is damaged.
    pub fn find(newest: &Snapshot, version: Version) -> Result<Option<Self>, ReadError> {
        let found = newest.at(version).and_then(|past| Self::of(&past));
        match found {
            Err(ReadError::SnapshotTooOld { .. }) => Ok(None),
            found => found,
        }
    }

    fn of(past: &Snapshot) -> Result<Option<Self>, ReadError> {
        let Some(agent) = past.agent()? else {
            return Ok(None);
        };
        let mut rules = Vec::new();
        for applied in past.rules()? {
            let mut binding = BTreeMap::new();
            for (variable, id) in applied.binding {
                let name = match past.find_node(id)? {
                    Some(node) => node.name()?,
                    // The rule took it away.
                    None => id.0.to_string(),
                };
                binding.insert(variable, name);
            }
            rules.push(Applied(&applied.rule, &binding).to_string());
        }
        Ok(Some(Self {
            version: past.version(),
            time: past.time().seconds(),
            agent,
            rules,
        }))
    }
}

/// Why something is done, and the commit that gave occasion to it.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Occasion {
    pub(super) why: String,
    pub(super) cause: Option<Cause>,
}

impl Occasion {
    /// One that no commit gave: the clock did, or somebody's wish.
    pub(super) fn new(why: &str) -> Self {
        Self {
            why: why.to_owned(),
            cause: None,
        }
    }
}

/// What was decided about a mission.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// When, seconds since 1970 by the clock of the instance.
    pub time: f64,
    /// What.
    pub what: String,
    /// Why; empty where that is plain.
    pub why: String,
    /// The commit that gave occasion to it, where one did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cause: Option<Cause>,
}

/// Reads a list as the graph has it, oldest first; what cannot be read is none.
pub(super) fn parse(text: &str) -> Vec<Decision> {
    serde_json::from_str(text).unwrap_or_default()
}

/// Adds a decision to a list as the graph has it.
pub(super) fn note(list: &mut String, now: Time, what: String, occasion: &Occasion) {
    let mut decisions = parse(list);
    decisions.push(Decision {
        time: now.seconds(),
        what,
        why: occasion.why.clone(),
        cause: occasion.cause.clone(),
    });
    let surplus = decisions.len().saturating_sub(KEPT);
    decisions.drain(..surplus);
    // Text and finite numbers can always be written.
    *list = serde_json::to_string(&decisions).unwrap_or_default();
}
