//! Earlier versions, as far back as the store keeps them, and who made each with which rules.

use super::Snapshot;
use crate::arena::{Address, ReadError, late, record, trie};
use crate::{NodeId, RuleApplication, Version, WriterId};
use std::collections::BTreeSet;

impl Snapshot {
    /// The graph as of an earlier version, or of this one.
    ///
    /// # Errors
    /// [`ReadError::SnapshotTooOld`] where the store keeps it no more.
    pub fn at(&self, version: Version) -> Result<Self, ReadError> {
        let root = self.arena.root_of(version.0)?;
        // Names are only ever added to a schema, so that this one has all names of an earlier one.
        let schema = std::sync::Arc::clone(&self.schema);
        Ok(Self::new(std::sync::Arc::clone(&self.arena), root, schema))
    }

    /// The oldest version that [`Self::at`] still gives.
    pub fn oldest(&self) -> Version {
        Version(self.arena.oldest_root(self.root.version))
    }

    /// The nodes that differ from an earlier version of the same store's graph, by id: made or deleted since, or
    /// with other attributes or edges, or with another attribute of an edge that starts there. It takes as long as
    /// there are such nodes, however many others there are.
    ///
    /// # Errors
    /// [`ReadError`], of either version.
    pub fn changed_since(&self, before: &Self) -> Result<Vec<NodeId>, ReadError> {
        let found = self.may_differ(before);
        before.check()?;
        self.genuine(found)
    }

    fn may_differ(&self, before: &Self) -> Result<Vec<NodeId>, Address> {
        let (arena, roots) = (&self.arena, [&before.root, &self.root]);
        let mut found = Vec::new();
        let links = roots.map(|root| root.nodes);
        trie::differences(arena, links, trie::LEVELS, &mut found)?;
        let mut ids = BTreeSet::from_iter(found);
        for root in roots {
            ids.extend(late::node(arena, root)?.map(|(id, _)| id));
        }
        let mut differing = Vec::new();
        for id in ids {
            let [old, new] = roots.map(|root| late::find(arena, root, id));
            if old? != new? {
                differing.push(NodeId(id));
            }
        }
        Ok(differing)
    }

    /// The agent that made this version; `None` for the first of a store.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn agent(&self) -> Result<Option<String>, ReadError> {
        match self.root.agent.checked_sub(1) {
            None => Ok(None),
            Some(writer) => self.writer_name(WriterId(writer as u16)).map(Some),
        }
    }

    /// The rules that were applied to make this version.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn rules(&self) -> Result<Vec<RuleApplication>, ReadError> {
        let address = self.root.rules;
        if address == 0 {
            return Ok(Vec::new());
        }
        let bytes = self.genuine(record::read_blob(&self.arena, address))?;
        postcard::from_bytes(&bytes).map_err(|_| ReadError::Damaged { address })
    }
}

#[cfg(test)]
mod tests {
    use crate::{
        Graph, NodeId, Operation, ReadError, Refusal, RuleApplication, RuleEngine, Schema,
        Snapshot, Time, Transaction, Value, Version,
    };
    use std::sync::Arc;

    /// Knows one rule: `age` sets the attribute `n` of `x` to -1.
    #[derive(Debug)]
    struct Ages;

    impl RuleEngine for Ages {
        fn expand(
            &self,
            _: &Snapshot,
            _: &str,
            binding: &[(String, NodeId)],
        ) -> Result<Vec<Operation>, Refusal> {
            let mut transaction = Transaction::new();
            transaction.set(binding[0].1, "n", -1.0);
            Ok(transaction.operations)
        }
    }

    fn set(n: f64) -> Transaction {
        let mut transaction = Transaction::new();
        transaction.set("a", "n", n);
        transaction
    }

    fn n(snapshot: &Snapshot) -> Option<Value> {
        let node = snapshot.find_node_by_name("a").unwrap().unwrap();
        node.value("n").unwrap()
    }

    #[test]
    fn what_differs_between_two_versions_is_found_without_the_rest() {
        let mut graph = Graph::in_memory(Schema::open());
        let mut transaction = Transaction::new();
        for index in 0..300 {
            transaction.create_node("thing", &format!("n{index}"), vec![]);
        }
        transaction.create_edge("n7", "near", "n8");
        let mut commit = |transaction: &Transaction| {
            graph.commit(transaction, "one", Time::default()).unwrap();
            graph.snapshot()
        };
        let first = commit(&transaction);
        let mut one = Transaction::new();
        one.set("n40", "n", 1.0);
        let second = commit(&one);
        let mut several = Transaction::new();
        several.delete_node("n41");
        several.create_node("thing", "new", vec![]);
        several.set_on_edge(crate::EdgeRef::new("n7", "near", "n8"), "n", 2.0);
        let third = commit(&several);
        let mut again = Transaction::new();
        again.set("n40", "n", 3.0);
        let fourth = commit(&again);
        let changed = |later: &Snapshot, earlier: &Snapshot| -> Vec<String> {
            let name = |id| match later.find_node(id).unwrap() {
                Some(node) => node.name().unwrap(),
                None => format!(
                    "without {}",
                    earlier.find_node(id).unwrap().unwrap().name().unwrap()
                ),
            };
            let found = later.changed_since(earlier).unwrap();
            found.into_iter().map(name).collect()
        };
        assert_eq!(changed(&second, &first), ["n40"]);
        assert_eq!(changed(&third, &second), ["n7", "without n41", "new"]);
        assert_eq!(
            changed(&fourth, &first),
            ["n7", "n40", "without n41", "new"]
        );
        assert!(changed(&fourth, &fourth).is_empty());
    }

    #[test]
    fn earlier_versions_are_as_they_were_and_know_who_made_them() {
        let mut graph = Graph::in_memory(Schema::open());
        graph.set_rules(Arc::new(Ages));
        let mut transaction = Transaction::new();
        transaction.create_node("thing", "a", vec![]);
        graph.commit(&transaction, "one", Time::default()).unwrap();
        graph.commit(&set(3.0), "two", Time::default()).unwrap();
        let mut transaction = Transaction::new();
        transaction.apply_rule("age", vec![("x".into(), "a".into())]);
        graph
            .commit(&transaction, "three", Time::default())
            .unwrap();
        graph.commit(&set(5.0), "one", Time::default()).unwrap();
        let newest = graph.snapshot();
        assert_eq!(
            (newest.version(), newest.oldest()),
            (Version(5), Version(1))
        );
        let told: Vec<_> = (2..=5)
            .map(|version| {
                let snapshot = newest.at(Version(version)).unwrap();
                let rules = snapshot.rules().unwrap();
                let rules: Vec<String> = rules.into_iter().map(|r| r.rule).collect();
                (n(&snapshot), snapshot.agent().unwrap().unwrap(), rules)
            })
            .collect();
        let row = |n: Option<f64>, agent: &str, rules: &[&str]| {
            let rules = rules.iter().map(ToString::to_string).collect::<Vec<_>>();
            (n.map(Value::F64), agent.to_owned(), rules)
        };
        assert_eq!(
            told,
            [
                row(None, "one", &[]),
                row(Some(3.0), "two", &[]),
                row(Some(-1.0), "three", &["age"]),
                row(Some(5.0), "one", &[]),
            ]
        );
        let applied = newest.at(Version(4)).unwrap().rules().unwrap();
        let id = newest.find_node_by_name("a").unwrap().unwrap().id();
        let binding = vec![("x".to_owned(), id)];
        let rule = "age".to_owned();
        assert_eq!(applied, [RuleApplication { rule, binding }]);
        assert!(newest.at(Version(6)).is_err(), "it is not made yet");
        assert_eq!(newest.at(Version(1)).unwrap().agent().unwrap(), None);
    }

    #[test]
    fn a_version_whose_memory_was_reused_is_too_old() {
        let mut graph = Graph::in_memory(Schema::open());
        graph.set_limits(crate::Limits {
            history_bytes: 4096,
            ..crate::Limits::default()
        });
        let mut transaction = Transaction::new();
        transaction.create_node("thing", "a", vec![]);
        graph.commit(&transaction, "one", Time::default()).unwrap();
        for i in 0..5000 {
            graph
                .commit(&set(f64::from(i)), "one", Time::default())
                .unwrap();
        }
        let newest = graph.snapshot();
        let oldest = newest.oldest();
        assert!(oldest > Version(4000), "{oldest}");
        let at = |version: u64| n(&newest.at(Version(version)).unwrap());
        for version in oldest.0..=newest.version().0 {
            assert_eq!(at(version), Some(Value::F64(version as f64 - 3.0)));
        }
        let too_old = newest.at(Version(oldest.0 - 1)).unwrap_err();
        assert!(
            matches!(too_old, ReadError::SnapshotTooOld { .. }),
            "{too_old}"
        );
        assert!(newest.at(Version(3)).is_err(), "the ring has turned since");
    }
}
