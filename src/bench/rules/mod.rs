//! Measuring rules: matches, changes of matches, rewriting and parsing, beside other engines on
//! the same worlds in the same run. It guarantees that every engine found as many matches.

mod indoor;
mod peers;
mod watching;

use super::quantity::Quantity;
use crate::Failure;
use dsr::{Graph, NodeId, Snapshot, Time, Transaction};
use grammar::{Binding, Grammar, Matcher, Rewriter, WorkingGraph, parse_grammar};
use indoor::Indoor;
use peers::Peers;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

const RULES: &str = include_str!("patterns.aggl");
const SIZES: [(usize, &str); 3] = [(1000, "1k"), (10_000, "10k"), (100_000, "100k")];
/// How long one quantity is measured.
const SPAN: Duration = Duration::from_millis(200);

/// Microseconds that `work` takes: the median of as many runs as fit into the span.
fn median<T>(mut work: impl FnMut() -> Result<T, Failure>) -> Result<f64, Failure> {
    let mut times = Vec::new();
    let begun = Instant::now();
    while times.len() < 5 || begun.elapsed() < SPAN && times.len() < 100_000 {
        let started = Instant::now();
        let done = work()?;
        times.push(started.elapsed().as_secs_f64() * 1e6);
        drop(done);
    }
    Ok(middle(&mut times, 0.5))
}

fn middle(times: &mut [f64], share: f64) -> f64 {
    times.sort_by(f64::total_cmp);
    let at = (times.len() as f64 * share) as usize;
    times
        .get(at.min(times.len().saturating_sub(1)))
        .copied()
        .unwrap_or(0.0)
}

/// Rules that are part of the program.
fn read(text: &str) -> Result<Arc<Grammar>, Failure> {
    let (grammar, diagnostics) = parse_grammar(text, "patterns.aggl");
    if grammar::has_errors(&diagnostics) {
        return Err(Failure::Internal(grammar::Defects { diagnostics }.into()));
    }
    Ok(Arc::new(grammar))
}

/// All quantities.
pub(crate) fn rules() -> Result<Vec<Quantity>, Failure> {
    let grammar = read(RULES)?;
    let peers = Peers::find()?;
    let folder = Folder::new()?;
    let mut quantities = Vec::new();
    for (size, name) in SIZES {
        let world = Indoor::new(size);
        let file = folder.0.join(name);
        std::fs::write(&file, world.lines()).map_err(Failure::internal)?;
        let mut graph = world.graph()?;
        matching(
            &grammar,
            &graph.snapshot(),
            (name, &file, &peers),
            &mut quantities,
        )?;
        rewriting(&grammar, &mut graph, &world, name, &mut quantities)?;
        watching::changing(&grammar, &mut graph, &world, name, &mut quantities)?;
        watching::related(&mut graph, &world, name, &mut quantities)?;
    }
    parsing(&mut quantities)?;
    Ok(quantities)
}

/// A folder that goes with this value.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Result<Self, Failure> {
        let path = std::env::temp_dir().join(format!("cortex-bench-{}", std::process::id()));
        std::fs::create_dir(&path).map_err(Failure::internal)?;
        Ok(Self(path))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        drop(std::fs::remove_dir_all(&self.0));
    }
}

/// All matches, the first match, and a search with its planning.
fn matching(
    grammar: &Arc<Grammar>,
    snapshot: &Snapshot,
    (size, file, peers): (&str, &PathBuf, &Peers),
    quantities: &mut Vec<Quantity>,
) -> Result<(), Failure> {
    let mut matcher = Matcher::new(Arc::clone(grammar));
    let free = Binding::new();
    for rule in &grammar.rules {
        let name = &rule.name;
        let mut all = || {
            let matches = matcher
                .matches(snapshot, name, &free)
                .map_err(Failure::internal)?;
            matches.count_all().map_err(Failure::internal)
        };
        let count = all()?;
        let whole = median(&mut all)?;
        let first = median(|| {
            let mut matches = matcher
                .matches(snapshot, name, &free)
                .map_err(Failure::internal)?;
            Ok(matches.next())
        })?;
        let planned = median(|| {
            let matches = grammar
                .matches(snapshot, rule, &free)
                .map_err(Failure::internal)?;
            matches.count_all().map_err(Failure::internal)
        })?;
        let named = |what: &str| format!("{what}_{name}_{size}");
        quantities.push(Quantity::new(named("matches"), count as f64, "matches"));
        quantities.push(Quantity::new(named("first"), first, "us"));
        quantities.push(Quantity::new(named("plan_and_all"), planned, "us"));
        quantities.push(Quantity::new(named("all"), whole, "us"));
        for engine in ["vf2", "sqlite", "sqlite_tuned"] {
            let found = peers.all(engine, file, &words(rule))?;
            if found.count.is_some_and(|found| found != count) {
                let told = format!("{engine} finds {found:?} matches of {name}, not {count}");
                return Err(Failure::internal(told));
            }
            let mut beside = Quantity::new(format!("{}_{engine}", named("all")), whole, "us");
            beside.peer = Some((found.seconds * 1e6, found.count.is_none()));
            quantities.push(beside);
        }
    }
    Ok(())
}

/// A rule's left side, as the peers read it.
fn words(rule: &grammar::Rule) -> String {
    let nodes = rule.left.nodes.iter();
    let nodes = nodes.map(|node| format!("{}:{}", node.variable, node.type_name));
    let edges = rule.left.edges.iter();
    let edges = edges.map(|edge| format!("{}-{}-{}", edge.from, edge.label, edge.to));
    nodes.chain(edges).collect::<Vec<_>>().join(" ")
}

/// Millions of `changeRoom` a second, each found and made for one robot after the other: in a
/// working graph, and for comparison as commits to a graph of this process, by name and binding.
fn rewriting(
    grammar: &Arc<Grammar>,
    graph: &mut Graph,
    world: &Indoor,
    size: &str,
    quantities: &mut Vec<Quantity>,
) -> Result<(), Failure> {
    let snapshot = graph.snapshot();
    let mut working = WorkingGraph::of(&snapshot).map_err(Failure::internal)?;
    let rewriter = Rewriter::new(grammar, "changeRoom", &snapshot);
    let mut rewriter = rewriter.map_err(Failure::internal)?;
    let slot = rewriter.slot("r").unwrap_or_default();
    let kinds = world.nodes.iter().enumerate();
    let robots = kinds.filter(|(_, kind)| **kind == "robot");
    let robots: Vec<NodeId> = robots.map(|(index, _)| NodeId(index as u64 + 1)).collect();
    let mut done = 0_u32;
    let started = Instant::now();
    while started.elapsed() < SPAN {
        for robot in robots.iter().cycle().take(1000) {
            let rewritten = rewriter.rewrite(&mut working, &[(slot, *robot)]);
            done += u32::from(rewritten.map_err(Failure::internal)?);
        }
    }
    let rate = f64::from(done) / started.elapsed().as_secs_f64() / 1e6;
    quantities.push(Quantity::new(format!("rewrites_{size}"), rate, "million/s"));

    graph.set_rules(Arc::clone(grammar) as Arc<dyn dsr::RuleEngine>);
    let mut matcher = Matcher::new(Arc::clone(grammar));
    let mut done = 0_u32;
    let started = Instant::now();
    while started.elapsed() < SPAN {
        let robot = robots[done as usize % robots.len()];
        let at: Binding = [("r", robot)].into_iter().collect();
        let snapshot = graph.snapshot();
        let found = matcher.matches(&snapshot, "changeRoom", &at);
        let found = found.map_err(Failure::internal)?.next().transpose();
        let Some(found) = found.map_err(Failure::internal)? else {
            return Err(Failure::internal("a robot cannot leave its room"));
        };
        let mut transaction = Transaction::new();
        transaction.apply_rule("changeRoom", found.to_refs());
        let committed = graph.commit(&transaction, "bench", Time::default());
        committed.map_err(Failure::internal)?;
        done += 1;
    }
    let rate = f64::from(done) / started.elapsed().as_secs_f64() / 1e6;
    quantities.push(Quantity::new(format!("commits_{size}"), rate, "million/s"));
    Ok(())
}

/// Megabytes of rules a second.
fn parsing(quantities: &mut Vec<Quantity>) -> Result<(), Failure> {
    let (head, rules) = RULES.rsplit_once("===").unwrap_or_default();
    let mut text = format!("{head}===");
    let names = ["changeRoom", "deliver", "wants_here", "near_far"];
    for copy in 0..500 {
        let mut renamed = rules.to_owned();
        for name in names {
            renamed = renamed.replace(&format!("{name} :"), &format!("{name}{copy} :"));
        }
        text.push_str(&renamed);
    }
    let time = median(|| read(&text))?;
    quantities.push(Quantity::new(
        "parse".to_owned(),
        text.len() as f64 / time,
        "MB/s",
    ));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peers_read_a_left_side_as_words() {
        let (grammar, _) = parse_grammar(RULES, "patterns.aggl");
        let expected = "r:robot a:room b:room r-in-a a-connected-b";
        assert_eq!(words(&grammar.rules[0]), expected);
    }
}
