//! The one place from which the inspector looks at a graph: a running instance or a recording, as of now
//! or as of any time that is still known. It guarantees that every answer is of one version.

use crate::Failure;
use crate::view::layout::Layout;
use dsr::{Graph, Session, Snapshot, Time, Version};

/// What is looked at.
pub(crate) enum Source {
    Live(Box<Session>),
    /// A recording, all of whose versions are readable.
    Recording(Box<Graph>),
}

/// What is looked at, and what is kept from one look to the next.
pub(super) struct Looker {
    pub(super) source: Source,
    pub(super) layout: Layout,
    /// The newest version that the layout has come to.
    placed: Option<Version>,
}

impl Looker {
    pub(super) fn new(source: Source) -> Self {
        Self {
            source,
            layout: Layout::default(),
            placed: None,
        }
    }

    /// The newest version.
    pub(super) fn newest(&mut self) -> Result<Snapshot, Failure> {
        match &mut self.source {
            Source::Live(session) => session.snapshot().map_err(Failure::internal),
            Source::Recording(graph) => Ok(graph.snapshot()),
        }
    }

    /// The graph as of a time, or the newest.
    pub(super) fn at(&mut self, at: Option<f64>) -> Result<Snapshot, Failure> {
        let newest = self.newest()?;
        match at {
            None => Ok(newest),
            Some(at) => as_of(&newest, Time::from_seconds(at)),
        }
    }

    /// From when to when the graph can be looked at.
    pub(super) fn range(&mut self) -> Result<[Time; 2], Failure> {
        let newest = self.newest()?;
        let oldest = oldest(&newest).map_or(newest.time(), |(_, time)| time);
        Ok([oldest, newest.time()])
    }

    /// The layout with every node of a snapshot in it.
    pub(super) fn placed(&mut self, snapshot: &Snapshot) -> Result<&Layout, Failure> {
        let version = snapshot.version();
        if self.placed != Some(version) {
            let past = self.placed.is_some_and(|placed| placed > version);
            let placed = self.layout.update(snapshot, past);
            placed.map_err(Failure::internal)?;
            self.placed = self.placed.max(Some(version));
        }
        Ok(&self.layout)
    }
}

/// The oldest version that can be read, and when it was committed. The ring of versions may give up the
/// very oldest while it is looked at; and a graph is empty, of no time, before its first commit.
fn oldest(newest: &Snapshot) -> Option<(u64, Time)> {
    let first = newest.oldest().0;
    let mut found = (first..=newest.version().0).take(64).filter_map(|version| {
        let snapshot = newest.at(Version(version)).ok()?;
        Some((version, snapshot.time()))
    });
    found.find(|(_, time)| *time > Time::default())
}

/// The last version that was committed by then; the oldest that can be read where none was.
fn as_of(newest: &Snapshot, then: Time) -> Result<Snapshot, Failure> {
    if newest.time() <= then {
        return Ok(newest.clone());
    }
    let Some((mut low, _)) = oldest(newest) else {
        return Ok(newest.clone());
    };
    let mut high = newest.version().0;
    // Always: the graph at `low` is of then or earlier, or the oldest; at `high` it is later.
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        match newest.at(Version(middle)) {
            Ok(snapshot) if snapshot.time() > then => high = middle,
            Ok(_) | Err(_) => low = middle,
        }
    }
    let found = newest
        .at(Version(low))
        .or_else(|_| newest.at(Version(high)));
    found.map_err(Failure::internal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::{Schema, Transaction};

    #[test]
    fn a_time_finds_the_last_version_that_was_committed_by_then() {
        let mut graph = Graph::in_memory(Schema::open());
        let mut versions = Vec::new();
        for second in 1..=50 {
            let mut transaction = Transaction::new();
            if second == 1 {
                transaction.create_node("clock", "clock", vec![]);
            }
            transaction.set("clock", "n", f64::from(second));
            let time = Time::from_seconds(f64::from(second));
            versions.push(graph.commit(&transaction, "test", time).unwrap().0.version);
        }
        let mut looker = Looker::new(Source::Recording(Box::new(graph)));
        for (at, expected) in [(7.0, 6), (7.5, 6), (50.0, 49), (99.0, 49), (49.999, 48)] {
            assert_eq!(
                looker.at(Some(at)).unwrap().version(),
                versions[expected],
                "{at}"
            );
        }
        assert_eq!(looker.at(None).unwrap().version(), versions[49]);
    }
}
