//! Playing a recording: into a graph of this process, or into whatever else takes commits. It guarantees
//! that a graph which differs from the recorded one is noticed at the next digest.

use super::digest::digest;
use super::read::{DigestRow, Item, PlayError, Recording};
use super::replayed::{CommitRow, RecordedRules};
use dsr::{Graph, Image, Limits, Schema, Snapshot, Time, Transaction, Version};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// What a recording is played into.
pub(crate) trait Target {
    /// The graph as it is; nothing before the first [`Self::restore`].
    fn snapshot(&mut self) -> Result<Snapshot, PlayError>;
    /// Makes the graph what the image is.
    fn restore(&mut self, image: &Image) -> Result<(), PlayError>;
    /// Commits, and gives the version that it made.
    fn commit(
        &mut self,
        transaction: &Transaction,
        agent: &str,
        time: Time,
        version: u64,
    ) -> Result<Version, PlayError>;
}

/// A version whose graph is not the recorded one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Mismatch {
    pub(crate) version: u64,
    pub(crate) recorded: String,
    pub(crate) replayed: String,
}

/// What playing a recording showed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Verdict {
    pub(crate) commits: u64,
    /// How many digests were compared.
    pub(crate) digests: u64,
    /// How often commits were missed while it was recorded.
    pub(crate) missed: u64,
    /// The last version played, and the last one whose digest was compared.
    pub(crate) version: u64,
    pub(crate) compared: u64,
    pub(crate) mismatches: Vec<Mismatch>,
    /// How many ticks there were, and messages of each channel.
    pub(crate) ticks: u64,
    pub(crate) messages: BTreeMap<&'static str, u64>,
    /// Whether the recording was ended, rather than cut off.
    pub(crate) ended: bool,
}

impl Verdict {
    /// Whether every digest was that of the graph that came of playing.
    pub(crate) fn is_identical(&self) -> bool {
        self.digests > 0 && self.mismatches.is_empty()
    }
}

/// A recording being played into a target.
pub(crate) struct Player<T> {
    pub(crate) target: T,
    verdict: Verdict,
    began: bool,
}

impl<T: Target> Player<T> {
    pub(crate) fn new(target: T) -> Self {
        Self {
            target,
            verdict: Verdict::default(),
            began: false,
        }
    }

    /// Plays one item.
    ///
    /// # Errors
    /// [`PlayError`].
    pub(crate) fn play(&mut self, item: &Item) -> Result<(), PlayError> {
        match item {
            Item::Snapshot { image, missed } => {
                self.began = true;
                self.verdict.missed += u64::from(*missed);
                self.verdict.version = image.version().0;
                self.target.restore(image)
            }
            Item::Commit { .. } | Item::Digest(_) if !self.began => Err(PlayError::NoGraph),
            Item::Commit { time, row } => self.commit(*time, row),
            Item::Digest(row) => self.compare(row),
            Item::Tick => {
                self.verdict.ticks += 1;
                Ok(())
            }
            Item::Message(channel) => {
                *self.verdict.messages.entry(channel).or_default() += 1;
                Ok(())
            }
        }
    }

    fn commit(&mut self, time: Time, row: &CommitRow) -> Result<(), PlayError> {
        let version = row.version;
        let before = self.target.snapshot()?;
        let transaction = row.transaction(&before);
        let transaction = transaction.map_err(|source| PlayError::Row { version, source })?;
        let made = self
            .target
            .commit(&transaction, &row.agent, time, version)?;
        self.verdict.commits += 1;
        self.verdict.version = made.0;
        Ok(())
    }

    fn compare(&mut self, row: &DigestRow) -> Result<(), PlayError> {
        let snapshot = self.target.snapshot()?;
        let (_, replayed) = digest(&snapshot)?;
        self.verdict.digests += 1;
        self.verdict.compared = row.version;
        self.verdict.ended |= row.last;
        if replayed != row.sha256 || snapshot.version().0 != row.version {
            self.verdict.mismatches.push(Mismatch {
                version: row.version,
                recorded: row.sha256.clone(),
                replayed,
            });
        }
        Ok(())
    }

    /// What playing has shown so far.
    pub(crate) fn verdict(&self) -> &Verdict {
        &self.verdict
    }
}

/// A graph of this process, all of whose versions stay readable.
pub(crate) struct Heap(Graph);

impl Heap {
    pub(crate) fn new() -> Self {
        Self(empty())
    }

    pub(crate) fn into_graph(self) -> Graph {
        self.0
    }
}

fn empty() -> Graph {
    let mut graph = Graph::in_memory(Schema::open());
    graph.set_limits(Limits {
        history_bytes: 1 << 30,
        history_age: Duration::MAX,
        ..Limits::default()
    });
    graph.set_rules(Arc::new(RecordedRules));
    graph
}

impl Target for Heap {
    fn snapshot(&mut self) -> Result<Snapshot, PlayError> {
        Ok(self.0.snapshot())
    }

    fn restore(&mut self, image: &Image) -> Result<(), PlayError> {
        self.0 = empty();
        let version = image.version().0;
        let restored = self.0.restore(image);
        restored.map_err(|refusal| PlayError::Refused { version, refusal })
    }

    fn commit(
        &mut self,
        transaction: &Transaction,
        agent: &str,
        time: Time,
        version: u64,
    ) -> Result<Version, PlayError> {
        let made = self.0.commit(transaction, agent, time);
        let made = made.map_err(|refusal| PlayError::Refused { version, refusal })?;
        Ok(made.0.version)
    }
}

/// When a moment of a recording is: seconds since 1970; what lies before the recording counts from its
/// beginning, and what is less than 0 back from its end.
fn moment(path: &Path, start: Time, at: f64) -> Result<Time, PlayError> {
    if at < 0.0 {
        return Ok(end(path)? + at);
    }
    let absolute = Time::from_seconds(at);
    Ok(if absolute < start {
        start + at
    } else {
        absolute
    })
}

/// When the last commit of a recording was.
pub(crate) fn end(path: &Path) -> Result<Time, PlayError> {
    let mut recording = Recording::open(path)?;
    let mut end = Time::default();
    while let Some(item) = recording.next()? {
        end = item.time().unwrap_or(end);
    }
    Ok(end)
}

/// Plays a recording into a graph of this process, up to and with time `at` where one is given.
///
/// # Errors
/// [`PlayError`].
pub(crate) fn played(path: &Path, at: Option<f64>) -> Result<Graph, PlayError> {
    let mut recording = Recording::open(path)?;
    let mut player = Player::new(Heap::new());
    let mut until = None;
    while let Some(item) = recording.next()? {
        if let (Some(at), Some(time)) = (at, item.time()) {
            let until = match until {
                Some(until) => until,
                None => *until.insert(moment(path, time, at)?),
            };
            if time > until && player.began {
                break;
            }
        }
        player.play(&item)?;
    }
    if !player.began {
        return Err(PlayError::NoGraph);
    }
    Ok(player.target.into_graph())
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::{Change, EdgeRef, NodeId, Operation, RuleEngine, Value};
    use proptest::prelude::*;

    /// What a graph goes through, as it would be recorded.
    fn recorded(transactions: &[Transaction]) -> (Vec<Item>, Graph) {
        let mut graph = Graph::in_memory(Schema::open());
        graph.set_rules(Arc::new(Grows));
        let mut first = Transaction::new();
        for name in ["a", "b", "c"] {
            first.create_node("thing", name, vec![("n".into(), 1.5.into())]);
        }
        first.create_edge("a", "on", "b");
        graph.commit(&first, "setup", Time::default()).unwrap();
        let image = Box::new(Image::of(&graph.snapshot()).unwrap());
        let mut items = vec![Item::Snapshot {
            image,
            missed: false,
        }];
        for (index, transaction) in transactions.iter().enumerate() {
            let time = Time::from_seconds(index as f64);
            // What the graph refuses is not there to be recorded.
            if let Ok((_, change)) = graph.commit(transaction, "somebody", time) {
                items.push(item(&graph, &change));
                items.push(compared(&graph));
            }
        }
        (items, graph)
    }

    fn item(graph: &Graph, change: &Change) -> Item {
        let seen = crate::seen::Seen::exactly(&graph.snapshot(), change.version).unwrap();
        let row = seen.row(change).unwrap().to_string();
        let row = serde_json::from_str(&row).unwrap();
        let time = change.time;
        Item::Commit { time, row }
    }

    fn compared(graph: &Graph) -> Item {
        let snapshot = graph.snapshot();
        let (version, sha256) = (snapshot.version().0, digest(&snapshot).unwrap().1);
        let last = false;
        Item::Digest(DigestRow {
            version,
            sha256,
            last,
        })
    }

    /// Knows one rule, which gives `x` a number.
    #[derive(Debug)]
    struct Grows;

    impl RuleEngine for Grows {
        fn expand(
            &self,
            _: &Snapshot,
            _: &str,
            binding: &[(String, NodeId)],
        ) -> Result<Vec<Operation>, dsr::Refusal> {
            let mut transaction = Transaction::new();
            transaction.set(binding[0].1, "n", 7.25);
            Ok(transaction.operations)
        }
    }

    fn play_all(items: &[Item]) -> Player<Heap> {
        let mut player = Player::new(Heap::new());
        for item in items {
            player.play(item).unwrap();
        }
        player
    }

    fn operation() -> impl Strategy<Value = Operation> {
        let name = || prop::sample::select(vec!["a", "b", "c", "d", "e"]);
        let kind = prop::sample::select(vec!["thing", "other"]);
        let make = (name(), kind.clone(), 0..3i64).prop_map(|(name, kind, n)| {
            let attributes = vec![("m".to_owned(), Value::I64(n))];
            Operation::CreateNode {
                id: None,
                type_name: kind.to_owned(),
                name: name.to_owned(),
                attributes,
            }
        });
        let delete = name().prop_map(|node| Operation::DeleteNode { node: node.into() });
        let retype = (name(), kind).prop_map(|(node, kind)| Operation::RetypeNode {
            node: node.into(),
            type_name: kind.to_owned(),
        });
        let edge = move || (name(), name()).prop_map(|(from, to)| EdgeRef::new(from, "on", to));
        let join = (edge(), 0..3i64).prop_map(|(edge, n)| Operation::CreateEdge {
            edge,
            attributes: vec![("k".to_owned(), Value::I64(n))],
        });
        let part = edge().prop_map(|edge| Operation::DeleteEdge { edge });
        let name = || prop::sample::select(vec!["a", "b", "c", "d", "e"]);
        let set = (name(), -2.0..2.0f64).prop_map(|(node, x)| Operation::SetAttribute {
            owner: dsr::Owner::Node(node.into()),
            name: "n".to_owned(),
            value: x.into(),
        });
        let unset = name().prop_map(|node| Operation::RemoveAttribute {
            owner: dsr::Owner::Node(node.into()),
            name: "n".to_owned(),
        });
        let rule = (name(), name()).prop_map(|(x, y)| Operation::ApplyRule {
            rule: "grow".to_owned(),
            binding: vec![("x".to_owned(), x.into()), ("y".to_owned(), y.into())],
        });
        prop_oneof![make, delete, retype, join, part, set, unset, rule]
    }

    proptest! {
        #[test]
        fn whatever_was_committed_comes_out_again(
            commits in prop::collection::vec(prop::collection::vec(operation(), 1..4), 1..12)
        ) {
            let transactions: Vec<Transaction> = commits
                .into_iter()
                .map(|operations| Transaction { operations, ..Transaction::new() })
                .collect();
            let (items, graph) = recorded(&transactions);
            let mut player = play_all(&items);
            prop_assert!(player.verdict().mismatches.is_empty(), "{:?}", player.verdict());
            let replayed = player.target.snapshot().unwrap();
            let original = graph.snapshot();
            prop_assert_eq!(replayed.version(), original.version());
            // An image does not say who made its version.
            if player.verdict().commits > 0 {
                prop_assert_eq!(replayed.agent().unwrap(), original.agent().unwrap());
            }
            prop_assert_eq!(replayed.rules().unwrap(), original.rules().unwrap());
        }
    }

    #[test]
    fn rules_stay_on_record_in_order_with_nodes_that_their_commit_made_and_removed() {
        for y in ["a", "d"] {
            let mut transaction = Transaction::new();
            transaction.create_node("thing", "d", Vec::new());
            transaction.apply_rule(
                "grow",
                vec![("x".into(), "b".into()), ("y".into(), y.into())],
            );
            transaction.apply_rule(
                "grow",
                vec![("x".into(), "d".into()), ("y".into(), y.into())],
            );
            transaction.apply_rule(
                "grow",
                vec![("x".into(), "b".into()), ("y".into(), "c".into())],
            );
            transaction.delete_node("d");
            transaction.delete_node("a");
            let (items, graph) = recorded(&[transaction]);
            let mut player = play_all(&items);
            assert!(player.verdict().mismatches.is_empty());
            let replayed = player.target.snapshot().unwrap();
            assert_eq!(replayed.rules().unwrap().len(), 3);
            assert_eq!(replayed.rules(), graph.snapshot().rules());
        }
    }

    #[test]
    fn a_graph_that_came_out_otherwise_is_noticed_at_the_next_digest() {
        let set = |x: f64| {
            let mut transaction = Transaction::new();
            transaction.set("a", "n", x);
            transaction
        };
        let (mut items, _) = recorded(&[set(2.0), set(3.0)]);
        let (other, _) = recorded(&[set(2.5)]);
        items.splice(1..2, other.into_iter().skip(1).take(1));
        let player = play_all(&items);
        let verdict = player.verdict();
        assert!(!verdict.is_identical());
        // The second commit makes up for it.
        assert_eq!((verdict.digests, verdict.mismatches.len()), (2, 1));
    }

    #[test]
    fn a_recording_without_a_graph_cannot_be_played() {
        let (items, _) = recorded(&[Transaction::new()]);
        let mut player = Player::new(Heap::new());
        assert!(matches!(player.play(&items[1]), Err(PlayError::NoGraph)));
    }
}
