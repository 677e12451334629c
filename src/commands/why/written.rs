//! Who wrote what: attributes, edges and nodes with the commit on their record, and the step of a mission
//! that it was made for.

use super::{Known, Told, Untold};
use crate::Failure;
use crate::commands::graph::{Thing, last_with};
use crate::commands::output::{clock, value_text};
use dsr::{ReadError, Snapshot, Time, Value as Content, Version, json as encoding};
use executive::{Cause, Mission, MissionStep};
use serde_json::{Value, json};
use std::fmt::{self, Write as _};

/// What a commit did to something.
#[derive(Clone, Copy)]
enum Did {
    Write,
    Remove,
}

impl Did {
    const fn word(self) -> &'static str {
        match self {
            Self::Write => "written",
            Self::Remove => "removed",
        }
    }
}

/// A commit as far as it is on record.
pub(super) struct Written {
    version: Version,
    time: Time,
    agent: String,
    /// `None` where the version is not kept any more.
    rules: Option<Vec<String>>,
}

impl fmt::Display for Written {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (time, agent, version) = (clock(self.time), &self.agent, self.version);
        write!(f, "at {time} by {agent}, version {version}")?;
        match self.rules.as_deref() {
            None => f.write_str(", which is not kept any more: its rules are not known"),
            Some([]) => f.write_str(", by no rule"),
            Some(rules) => write!(f, ", by {}", rules.join(", ")),
        }
    }
}

fn kind(thing: Thing) -> &'static str {
    match thing {
        Thing::Edge(_) => "edge",
        Thing::Node(_) => "node",
    }
}

impl Written {
    /// The commit that wrote an attribute last, and the value.
    pub(super) fn of_attribute(
        snapshot: &Snapshot,
        thing: Thing,
        name: &str,
    ) -> Result<Option<(Content, Self)>, ReadError> {
        let Some(name) = snapshot.schema().find_attribute(name) else {
            return Ok(None);
        };
        let Some(attribute) = thing.attribute(snapshot, name)? else {
            return Ok(None);
        };
        let cause = Cause::find(snapshot, attribute.version)?;
        let written = Self {
            version: attribute.version,
            time: attribute.time,
            agent: snapshot.writer_name(attribute.writer)?,
            rules: cause.map(|cause| cause.rules),
        };
        Ok(Some((attribute.value, written)))
    }

    /// A commit that is kept.
    fn of_version(snapshot: &Snapshot, version: Version) -> Result<Option<Self>, ReadError> {
        let cause = Cause::find(snapshot, version)?;
        Ok(cause.map(|cause| Self {
            version,
            time: Time::from_seconds(cause.time),
            agent: cause.agent,
            rules: Some(cause.rules),
        }))
    }

    pub(super) fn json(&self) -> Value {
        json!({
            "version": self.version.0, "time": self.time.seconds(), "agent": self.agent,
            "rules": self.rules,
        })
    }
}

impl Known<'_> {
    /// The step that a commit was made for: one that it ended, one whose rule it applied, or one that
    /// its agent had in hand then.
    fn step_of(&self, written: &Written) -> Result<Option<(&Mission, &MissionStep)>, ReadError> {
        let steps = || {
            let missions = self.missions.iter();
            missions.flat_map(|m| m.steps.iter().map(move |step| (m, step)))
        };
        let rules = written.rules.as_deref().unwrap_or_default();
        let mut by_rule = None;
        for (mission, step) in steps() {
            if step.agent != written.agent {
                continue;
            }
            if let Some(id) = step.id
                && let Some((_, status)) =
                    Written::of_attribute(self.snapshot, Thing::Node(id), "status")?
                && status.version == written.version
            {
                return Ok(Some((mission, step)));
            }
            if rules.contains(&step.to_string()) && step.since >= written.time {
                by_rule.get_or_insert((mission, step));
            }
        }
        if by_rule.is_some() {
            return Ok(by_rule);
        }
        let then = match self.snapshot.at(written.version) {
            Ok(then) => then,
            Err(ReadError::SnapshotTooOld { .. }) => return Ok(None),
            Err(error) => return Err(error),
        };
        for mission in executive::missions(&then)? {
            let in_hand = executive::steps(&then, mission.id)?.into_iter();
            let mut in_hand =
                in_hand.filter(|step| step.status.is_under_way() && step.agent == written.agent);
            if let Some(step) = in_hand.next() {
                return Ok(steps().find(|(_, known)| known.name == step.name));
            }
        }
        Ok(None)
    }

    /// Tells a commit and the step that it was made for.
    fn made(
        &self,
        what: &str,
        did: Did,
        written: Option<&Written>,
    ) -> Result<(String, Value), Untold> {
        let did = did.word();
        let Some(written) = written else {
            let text = format!("{what}\n  {did} by a commit that is not kept any more\n");
            return Ok((text, json!({ did: null, "step": null, "mission": null })));
        };
        let mut text = format!("{what}\n  {did} {written}\n");
        let step = self.step_of(written)?;
        if let Some((mission, step)) = step {
            let _ = writeln!(
                text,
                "  for step {} of mission {}: {step}",
                step.name, mission.name
            );
        }
        let json = json!({
            did: written.json(), "step": step.map(|(_, step)| &step.name),
            "mission": step.map(|(mission, _)| &mission.name),
        });
        Ok((text, json))
    }

    /// Why an attribute is as it is.
    pub(super) fn attribute(&self, thing: Thing, name: &str) -> Result<Told, Untold> {
        let path = format!("{}.{name}", thing.describe(self.snapshot));
        let known = self.snapshot.schema().attribute_id(name);
        known.map_err(|error| Untold::Said(Failure::input(error)))?;
        let Some((value, written)) = Written::of_attribute(self.snapshot, thing, name)? else {
            let has = |version: &Snapshot| {
                let id = version.schema().find_attribute(name)?;
                thing.attribute(version, id).ok().flatten()
            };
            let (text, mut json) = match last_with(self.snapshot, has) {
                Some((_, last)) => self.removed(&format!("{path} has no value"), &last)?,
                None => {
                    let oldest = self.snapshot.oldest();
                    let text =
                        format!("{path} has no value, and had none since version {oldest}\n");
                    (
                        text,
                        json!({ "written": null, "step": null, "mission": null }),
                    )
                }
            };
            json["kind"] = json!("attribute");
            json["path"] = json!(path);
            json["value"] = Value::Null;
            return Ok(Told { text, json });
        };
        let what = format!("{path} = {}", value_text(&value));
        let (text, mut json) = self.made(&what, Did::Write, Some(&written))?;
        json["kind"] = json!("attribute");
        json["path"] = json!(path);
        json["value"] = encoding::value_to_json(&value);
        Ok(Told { text, json })
    }

    /// Tells what took something away that the version `last` had, and the next had not.
    fn removed(&self, what: &str, last: &Snapshot) -> Result<(String, Value), Untold> {
        let written = Written::of_version(self.snapshot, Version(last.version().0 + 1))?;
        self.made(what, Did::Remove, written.as_ref())
    }

    /// Why an edge or a node is not there any more, which the version `last` was the last to have.
    pub(super) fn gone(&self, thing: Thing, last: &Snapshot) -> Result<Told, Untold> {
        let name = thing.describe(last);
        let (text, mut json) = self.removed(&format!("{name} is gone"), last)?;
        json["kind"] = json!(kind(thing));
        json["path"] = json!(name);
        Ok(Told { text, json })
    }

    /// Why an edge or a node is there.
    pub(super) fn thing(&self, thing: Thing) -> Result<Told, Untold> {
        let name = thing.describe(self.snapshot);
        let version = match thing {
            Thing::Edge(key) => {
                let edge = self.snapshot.find_edge(key)?;
                edge.map(|edge| edge.version()).transpose()?
            }
            Thing::Node(id) => {
                let node = self.snapshot.find_node(id)?;
                node.map(|node| node.version()).transpose()?
            }
        };
        let written = match version {
            Some(version) => Written::of_version(self.snapshot, version)?,
            None => None,
        };
        let (text, mut json) = self.made(&name, Did::Write, written.as_ref())?;
        json["kind"] = json!(kind(thing));
        json["path"] = json!(name);
        Ok(Told { text, json })
    }
}
