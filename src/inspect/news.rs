//! What happened since somebody looked last, read off the graph and nothing else. It guarantees that
//! nobody who commits takes any longer for it: the store does not know of who looks.

use crate::commands::graph::name_of;
use dsr::{EdgeKey, NodeId, ReadError, Snapshot, Version};
use executive::Cause;
use serde_json::{Value as Json, json};
use std::collections::{BTreeMap, BTreeSet};

/// The last commits that are told one by one.
const TOLD: u64 = 40;
/// Rates are counted over so many commits,
const COUNTED: usize = 2000;
/// and over so many seconds.
const LATELY: f64 = 5.0;
/// So many commits are looked through for those that somebody asks for.
const SIFTED: u64 = 50_000;
/// So many edges of a node are looked through for those that a commit of long ago wrote.
const EDGES: usize = 500;
/// The nodes that a commit's line names.
const NAMED: usize = 4;

/// What commits did.
#[derive(Debug, Default)]
pub(super) struct News {
    /// Whether nodes or edges came or went, or everything may have changed.
    pub(super) structure: bool,
    /// The nodes that were written, or an edge that leads to them.
    pub(super) changed: BTreeSet<u64>,
    /// The last of them, oldest first, each as a line.
    pub(super) commits: Vec<Json>,
    /// How many there were.
    pub(super) count: u64,
}

/// Looks from one version to the next.
#[derive(Debug)]
pub(super) struct Follower {
    seen: Snapshot,
}

impl Follower {
    /// Begins with what comes after a version.
    pub(super) fn new(seen: &Snapshot) -> Self {
        Self {
            seen: seen.committed(),
        }
    }

    /// What happened until `newest`.
    pub(super) fn next(&mut self, newest: &Snapshot) -> News {
        let newest = newest.committed();
        let before = std::mem::replace(&mut self.seen, newest.clone());
        let (from, to) = (before.version(), newest.version());
        if before.epoch() == newest.epoch() && from == to {
            return News::default();
        }
        // Another store, or one that has overtaken this: everything may have changed.
        let found = if before.epoch() == newest.epoch() && from < to {
            look(&before, &newest).ok()
        } else {
            None
        };
        let mut news = found.unwrap_or_else(|| News {
            structure: true,
            ..News::default()
        });
        news.count = to.0.saturating_sub(from.0).max(1);
        news
    }
}

/// Edges that were written, as paths, by the version that did it last.
type Edges = BTreeMap<Version, BTreeSet<String>>;

fn look(before: &Snapshot, newest: &Snapshot) -> Result<News, ReadError> {
    let mut news = News {
        structure: before.node_count() != newest.node_count()
            || before.edge_count() != newest.edge_count(),
        ..News::default()
    };
    let mut edges = Edges::new();
    for id in newest.changed_since(before)? {
        let Some(node) = newest.find_node(id)? else {
            news.structure = true;
            continue;
        };
        news.structure |= before.find_node(id)?.is_none();
        if node.version()? > before.version() {
            news.changed.insert(id.0);
        }
        for edge in node.edges() {
            let edge = edge?;
            let version = edge.version()?;
            if version <= before.version() {
                continue;
            }
            let key = edge.key();
            news.changed.insert(key.to.0);
            news.structure |= before.find_edge(key)?.is_none();
            edges.entry(version).or_default().insert(path(newest, key));
        }
    }
    let first = newest
        .version()
        .0
        .saturating_sub(TOLD)
        .max(before.version().0);
    let none = BTreeSet::new();
    let mut earlier = newest.at(Version(first))?;
    for version in first + 1..=newest.version().0 {
        let at = newest.at(Version(version))?;
        let written = edges.get(&at.version()).unwrap_or(&none);
        news.commits.extend(line(&earlier, &at, Some(written))?);
        earlier = at;
    }
    Ok(news)
}

/// How often an agent commits, and when it last did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rate {
    /// A second.
    pub(super) commits: f64,
    /// Seconds since 1970.
    pub(super) last: f64,
}

/// The rates of the agents over the last seconds, by name.
pub(super) fn rates(snapshot: &Snapshot) -> BTreeMap<String, Rate> {
    let mut counts: BTreeMap<String, (u64, f64)> = BTreeMap::new();
    let newest = snapshot.time();
    let mut oldest = newest;
    for version in (1..=snapshot.version().0).rev().take(COUNTED) {
        // What is not kept any more ends the count, as does what is long ago.
        let Ok(at) = snapshot.at(Version(version)) else {
            break;
        };
        if newest.since(at.time()) > LATELY {
            break;
        }
        oldest = at.time();
        if let Ok(Some(agent)) = at.agent() {
            let time = at.time().seconds();
            counts.entry(agent).or_insert((0, time)).0 += 1;
        }
    }
    let passed = newest.since(oldest).max(1.0);
    let rate = |(agent, (count, last))| {
        let commits = count as f64 / passed;
        (agent, Rate { commits, last })
    };
    counts.into_iter().map(rate).collect()
}

/// Which commits are asked for: those that applied rules, those of an agent.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sieve<'a> {
    pub(super) rules: bool,
    pub(super) agent: Option<&'a str>,
}

impl Sieve<'_> {
    fn passes(&self, commit: &Snapshot) -> Result<bool, ReadError> {
        let by = |agent| commit.agent().map(|by| by.as_deref() == Some(agent));
        let ruled = !self.rules || !commit.rules()?.is_empty();
        Ok(ruled && self.agent.map_or(Ok(true), by)?)
    }
}

/// The last commits that led to a snapshot, newest first, as far as they are kept.
pub(super) fn commits(snapshot: &Snapshot, sieve: &Sieve<'_>, count: usize) -> Vec<Json> {
    let newest = snapshot.version().0;
    let versions = (newest.saturating_sub(SIFTED) + 1..=newest).rev();
    let found = versions.map_while(|version| {
        let at = snapshot.at(Version(version)).ok()?;
        if !sieve.passes(&at).ok()? {
            return Some(None);
        }
        let earlier = snapshot.at(Version(version.saturating_sub(1))).ok()?;
        line(&earlier, &at, None).ok()
    });
    found.flatten().take(count).collect()
}

/// A commit in a line: by whom, with which rules, and what it touched, the first of it as paths. The edges that it
/// wrote are looked up where nobody knows them.
fn line(
    before: &Snapshot,
    after: &Snapshot,
    edges: Option<&BTreeSet<String>>,
) -> Result<Option<Json>, ReadError> {
    let Some(cause) = Cause::find(after, after.version())? else {
        return Ok(None);
    };
    let mut what = edges.cloned().unwrap_or_default();
    let mut others = BTreeSet::new();
    for id in after.changed_since(before)? {
        match after.find_node(id)? {
            None => drop(what.insert(name_of(before, id))),
            Some(node) if node.version()? == after.version() => drop(what.insert(node.name()?)),
            Some(_) => drop(others.insert(id)),
        }
    }
    if edges.is_none() {
        for id in &others {
            what.extend(written_edges(after, *id)?);
        }
    }
    if what.is_empty() {
        // Which of their edges is not known: it was written over, deleted, or one of very many.
        what.extend(others.iter().map(|id| name_of(after, *id)));
    }
    let more = what.len().saturating_sub(NAMED);
    let what: Vec<String> = what.into_iter().take(NAMED).collect();
    Ok(Some(json!({
        "version": cause.version.0, "time": cause.time, "agent": cause.agent,
        "rules": cause.rules, "what": what, "more": more,
    })))
}

/// Paths of the edges from a node that a version wrote, as far as they are among the first.
fn written_edges(after: &Snapshot, from: NodeId) -> Result<Vec<String>, ReadError> {
    let Some(node) = after.find_node(from)? else {
        return Ok(Vec::new());
    };
    let mut paths = Vec::new();
    for edge in node.edges().take(EDGES) {
        let edge = edge?;
        if edge.version()? == after.version() {
            paths.push(path(after, edge.key()));
        }
    }
    Ok(paths)
}

fn path(snapshot: &Snapshot, key: EdgeKey) -> String {
    let label = snapshot.schema().label_name(key.label);
    let [from, to] = [key.from, key.to].map(|id| name_of(snapshot, id));
    format!("{from}-{label}->{to}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::{Graph, Schema, Time, Transaction};

    fn commit(graph: &mut Graph, agent: &str, fill: impl FnOnce(&mut Transaction)) -> Snapshot {
        let mut transaction = Transaction::new();
        fill(&mut transaction);
        graph.commit(&transaction, agent, Time::default()).unwrap();
        graph.snapshot()
    }

    #[test]
    fn each_commit_is_told_with_what_it_touched_and_by_whom() {
        let mut graph = Graph::in_memory(Schema::open());
        let first = commit(&mut graph, "setup", |transaction| {
            for name in ["kitchen", "cup", "ana"] {
                transaction.create_node("thing", name, vec![]);
            }
            transaction.create_edge("cup", "in", "kitchen");
        });
        let mut follower = Follower::new(&first);
        assert_eq!(follower.next(&first).count, 0);
        commit(&mut graph, "observer", |transaction| {
            transaction.set("ana", "age", 7.0);
        });
        let newest = commit(&mut graph, "mapper", |transaction| {
            let edge = dsr::EdgeRef::new("cup", "in", "kitchen");
            transaction.set_on_edge(edge, "since", 1.0);
        });
        let news = follower.next(&newest);
        let told: Vec<_> = news
            .commits
            .iter()
            .map(|line| (&line["agent"], &line["what"]))
            .collect();
        let expected = [("observer", "ana"), ("mapper", "cup-in->kitchen")];
        let expected = expected.map(|(agent, what)| (json!(agent), json!([what])));
        assert!(
            told.iter()
                .zip(&expected)
                .all(|(a, b)| (a.0, a.1) == (&b.0, &b.1)),
            "{told:?}"
        );
        assert_eq!(
            (news.count, news.structure, news.changed.len()),
            (2, false, 2)
        );
        let newest = commit(&mut graph, "observer", |transaction| {
            transaction.delete_node("ana");
        });
        let news = follower.next(&newest);
        assert!(news.structure);
        assert_eq!(news.commits[0]["what"], json!(["ana"]));
        let past = commits(&newest, &Sieve::default(), 2);
        let told: Vec<_> = past.iter().map(|line| &line["what"]).collect();
        assert_eq!(told, [&json!(["ana"]), &json!(["cup-in->kitchen"])]);
        let by = |agent, rules| {
            commits(
                &newest,
                &Sieve {
                    rules,
                    agent: Some(agent),
                },
                9,
            )
            .len()
        };
        assert_eq!(
            [
                by("observer", false),
                by("mapper", false),
                by("mapper", true)
            ],
            [2, 1, 0]
        );
    }

    #[test]
    fn an_agents_rate_is_of_the_last_seconds() {
        let mut graph = Graph::in_memory(Schema::open());
        let mut transaction = Transaction::new();
        transaction.create_node("thing", "cup", vec![]);
        for tick in 0..=200_u32 {
            let agent = if tick.is_multiple_of(4) {
                "slow"
            } else {
                "fast"
            };
            let time = Time::from_seconds(f64::from(tick) / 10.0);
            graph.commit(&transaction, agent, time).unwrap();
            transaction = Transaction::new();
            transaction.set("cup", "n", f64::from(tick));
        }
        let rates = rates(&graph.snapshot());
        let [slow, fast] = ["slow", "fast"].map(|agent| rates[agent]);
        assert!((slow.commits - 2.5).abs() < 0.2 && (fast.commits - 7.5).abs() < 0.2);
        assert!((slow.last - 20.0).abs() < 1e-6 && (fast.last - 19.9).abs() < 1e-6);
    }

    #[test]
    fn a_graph_that_cannot_be_compared_may_have_changed_everywhere() {
        let mut graph = Graph::in_memory(Schema::open());
        let first = commit(&mut graph, "one", |transaction| {
            transaction.create_node("thing", "cup", vec![]);
        });
        let second = commit(&mut graph, "one", |transaction| {
            transaction.set("cup", "n", 1.0);
        });
        let news = Follower::new(&second).next(&first);
        assert!(news.structure && news.commits.is_empty() && news.count == 1);
    }
}
