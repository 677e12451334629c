//! What the page is told as things happen: a frame a tenth of a second at the most. It guarantees that a
//! frame holds only what changed since the one before, and that who comes in between can ask for the
//! rest.

use super::look::{Looker, Source};
use super::processes::Processes;
use crate::Failure;
use crate::commands::graph::name_of;
use crate::view::map::Map;
use crate::view::mission::missions;
use dsr::{Change, Changes, Filter, Snapshot, Touch, Update};
use serde_json::{Value as Json, json};
use std::collections::BTreeSet;

/// The last commits that a frame tells one by one.
const TOLD: usize = 40;
/// The nodes that a commit's line names.
const NAMED: usize = 4;
/// Frames between two looks at the processes.
const PROCESSES_EVERY: u64 = 10;

/// Puts frames together.
pub(super) struct Frames {
    changes: Changes,
    map: Option<Map>,
    missions: Option<Json>,
    processes: Processes,
    count: u64,
}

impl Frames {
    /// Follows the commits of a running instance; `None` of a recording, where nothing happens.
    pub(super) fn follow(looker: &mut Looker) -> Result<Option<Self>, Failure> {
        let Source::Live(session) = &mut looker.source else {
            return Ok(None);
        };
        let changes = session.changes(Filter::default());
        Ok(Some(Self {
            changes: changes.map_err(Failure::internal)?,
            map: None,
            missions: None,
            processes: Processes::of(session.instance()),
            count: 0,
        }))
    }

    /// What is new; `None` where nothing is.
    pub(super) fn next(&mut self, looker: &mut Looker) -> Result<Option<Json>, Failure> {
        let snapshot = looker.newest()?;
        let mut news = News::default();
        while let Some(update) = self
            .changes
            .next(snapshot.schema())
            .map_err(Failure::internal)?
        {
            match update {
                // Everything may have changed.
                Update::Gap(_) => news.structure = true,
                Update::Change(change) => news.take(change),
            }
        }
        self.count += 1;
        let mut frame = json!({"version": snapshot.version().0, "time": snapshot.time().seconds()});
        let look = self.count % PROCESSES_EVERY == 1;
        if news.is_empty() && !look {
            return Ok(None);
        }
        if look {
            frame["processes"] = self.processes.look();
        }
        frame["structure"] = json!(news.structure);
        frame["changed"] = json!(news.changed);
        frame["commits"] = news
            .commits
            .iter()
            .map(|change| line(&snapshot, change))
            .collect();
        frame["count"] = json!(news.count);
        // What is overtaken now comes with the next frame.
        if let Ok(map) = Map::of(&snapshot)
            && self.map.as_ref() != Some(&map)
        {
            frame["map"] = json!(map);
            self.map = Some(map);
        }
        if let Ok(missions) = missions(&snapshot)
            && self.missions.as_ref() != Some(&missions)
        {
            frame["missions"] = missions.clone();
            self.missions = Some(missions);
        }
        Ok(Some(frame))
    }
}

/// What commits did since the last frame.
#[derive(Default)]
struct News {
    structure: bool,
    changed: BTreeSet<u64>,
    commits: Vec<Change>,
    count: u64,
}

impl News {
    fn is_empty(&self) -> bool {
        self.count == 0 && !self.structure
    }

    fn take(&mut self, change: Change) {
        self.count += 1;
        for node in &change.nodes {
            self.structure |= node.touch != Touch::Updated;
            self.changed.insert(node.node.0);
        }
        for edge in &change.edges {
            self.structure |= edge.touch != Touch::Updated;
            self.changed.insert(edge.edge.to.0);
        }
        if self.commits.len() == TOLD {
            self.commits.remove(0);
        }
        self.commits.push(change);
    }
}

/// A commit in a line.
pub(super) fn line(snapshot: &Snapshot, change: &Change) -> Json {
    let schema = snapshot.schema();
    let mut what = BTreeSet::new();
    for node in &change.nodes {
        what.insert(name_of(snapshot, node.node));
    }
    for edge in &change.edges {
        let label = schema.label_name(edge.edge.label);
        what.insert(format!("{} -{label}->", name_of(snapshot, edge.edge.from)));
    }
    let more = what.len().saturating_sub(NAMED);
    let mut what: Vec<String> = what.into_iter().take(NAMED).collect();
    if more > 0 {
        what.push(format!("and {more} more"));
    }
    let rules: Vec<String> = change
        .rules
        .iter()
        .map(|applied| {
            let bound =
                |(variable, id): &(String, _)| format!("{variable}={}", name_of(snapshot, *id));
            let binding: Vec<String> = applied.binding.iter().map(bound).collect();
            format!("{}({})", applied.rule, binding.join(", "))
        })
        .collect();
    json!({
        "version": change.version.0, "time": change.time.seconds(), "agent": change.agent,
        "rules": rules, "what": what.join(", "),
    })
}
