//! Leases: versions that stay readable although they are older than the history. This file
//! guarantees that a reader with a lease either reads what its version was or is told that the
//! lease has ended, whatever was committed meanwhile.
//!
//! What a lease costs is what its version reaches and newer ones do not, so that a writer at full
//! speed costs it no more than one that wrote every node once.

use super::Graph;
use crate::Version;
use crate::arena::{LEASES, LeaseMark};
use serde::{Deserialize, Serialize};
use std::time::Duration;
use thiserror::Error;

/// Why the store gave no lease.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error, Serialize, Deserialize)]
pub enum LeaseRefusal {
    /// The version cannot be read any more.
    #[error("version {version} is too old: the oldest that can still be read is {oldest}")]
    TooOld {
        /// The version asked for.
        version: Version,
        /// The oldest that can be read.
        oldest: Version,
    },
    /// The store has not made this version.
    #[error("this store has no version {version}")]
    NoVersion {
        /// The version asked for.
        version: Version,
    },
    /// There are as many leases as there may be.
    #[error("{LEASES} leases are given already")]
    TooMany,
    /// Leases hold as much memory as they may.
    #[error("leases hold {bytes} bytes already")]
    Full {
        /// How many bytes.
        bytes: usize,
    },
    /// The store gives none so long.
    #[error("the store gives leases of {} s at the most", .longest.as_secs_f64())]
    TooLong {
        /// How long one may be.
        longest: Duration,
    },
    /// The process that asks has ended.
    #[error("the process that asks has ended")]
    Ended,
}

/// A lease that was given.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leased {
    mark: LeaseMark,
    version: u64,
}

impl Graph {
    /// Tells the graph the time since some point, by which versions grow old.
    pub fn set_clock(&mut self, now: Duration) {
        self.writer.allocator.set_clock(now);
        self.reclaim(self.limits.history_bytes);
    }

    /// Keeps a version readable, for whoever reads it with the mark.
    pub(crate) fn lease(&mut self, version: Version) -> Result<LeaseMark, LeaseRefusal> {
        let oldest = Version(self.writer.arena.oldest());
        if version < oldest {
            return Err(LeaseRefusal::TooOld { version, oldest });
        }
        if version.0 > self.root.version {
            return Err(LeaseRefusal::NoVersion { version });
        }
        let bytes = self.writer.allocator.held_bytes();
        if bytes >= self.limits.lease_bytes {
            return Err(LeaseRefusal::Full { bytes });
        }
        let taken = |place: usize| self.leases.iter().any(|lease| lease.mark.place == place);
        let place = (0..LEASES).find(|&place| !taken(place));
        let place = place.ok_or(LeaseRefusal::TooMany)?;
        self.last_token += 1;
        let token = self.last_token;
        let mark = LeaseMark { place, token };
        let version = version.0;
        self.leases.push(Leased { mark, version });
        self.writer.arena.set_lease(place, token);
        self.writer.allocator.lease(version);
        Ok(mark)
    }

    /// Ends the lease with that token, if it is still there.
    pub(crate) fn end_lease(&mut self, token: u64) {
        let mut leases = self.leases.iter();
        if let Some(at) = leases.position(|lease| lease.mark.token == token) {
            let lease = self.leases.swap_remove(at);
            self.writer.arena.set_lease(lease.mark.place, 0);
            self.writer.allocator.end_lease(lease.version);
        }
    }

    /// Whether the lease with that token has neither ended nor been revoked.
    pub(crate) fn has_lease(&self, token: u64) -> bool {
        self.leases.iter().any(|lease| lease.mark.token == token)
    }

    /// How long a lease may be.
    pub(crate) fn longest_lease(&self) -> Duration {
        self.limits.lease_time
    }

    /// Revokes leases, those of the oldest versions first, until they hold at most so much.
    pub(super) fn revoke_beyond(&mut self, bytes: usize) {
        while self.writer.allocator.held_bytes() > bytes {
            let oldest = self.leases.iter().min_by_key(|lease| lease.version);
            let Some(token) = oldest.map(|lease| lease.mark.token) else {
                return;
            };
            self.end_lease(token);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Limits, ReadError, Schema, Snapshot, Time, Transaction};

    const NODES: i64 = 50;

    /// A graph without history, and its version in which every node has the value 0.
    fn graph() -> (Graph, Snapshot) {
        let mut graph = Graph::in_memory(Schema::open());
        graph.set_limits(Limits {
            history_bytes: 0,
            ..Limits::default()
        });
        let mut transaction = Transaction::new();
        for i in 0..NODES {
            transaction.create_node("thing", &format!("n{i}"), vec![("x".into(), 0i64.into())]);
        }
        graph.commit(&transaction, "a", Time::default()).unwrap();
        let snapshot = graph.snapshot();
        (graph, snapshot)
    }

    /// Writes one number to all nodes, a commit each.
    fn write(graph: &mut Graph, number: i64) {
        for i in 0..NODES {
            let mut transaction = Transaction::new();
            transaction.set(format!("n{i}"), "x", number);
            graph.commit(&transaction, "a", Time::default()).unwrap();
        }
    }

    fn values(snapshot: &Snapshot) -> Result<Vec<i64>, ReadError> {
        let value = |node: crate::Node<'_>| Ok(node.value("x")?.and_then(|x| x.as_f64()));
        let numbers = snapshot.nodes().map(|node| value(node?));
        let numbers: Vec<Option<f64>> = numbers.collect::<Result<_, ReadError>>()?;
        Ok(numbers.into_iter().map(|x| x.unwrap() as i64).collect())
    }

    fn all(number: i64) -> Vec<i64> {
        vec![number; NODES as usize]
    }

    #[test]
    fn a_leased_version_is_read_whatever_is_written_and_its_memory_comes_back() {
        let (mut graph, snapshot) = graph();
        let before = graph.bytes_in_use();
        let mark = graph.lease(snapshot.version()).unwrap();
        let leased = snapshot.leased(mark);
        write(&mut graph, 1);
        write(&mut graph, 2);
        let held = graph.writer.allocator.held_bytes();
        assert!(held > 0);
        for number in 3..40 {
            write(&mut graph, number);
        }
        let later = graph.writer.allocator.held_bytes();
        assert_eq!(later, held, "it holds its version, however much is written");
        assert_eq!(values(&leased).unwrap(), all(0));
        let outlived = values(&snapshot).unwrap_err();
        assert!(matches!(outlived, ReadError::SnapshotTooOld { .. }));
        graph.end_lease(mark.token);
        let ended = values(&leased).unwrap_err();
        assert!(matches!(ended, ReadError::SnapshotTooOld { .. }), "{ended}");
        assert_eq!(graph.writer.allocator.held_bytes(), 0);
        write(&mut graph, 40);
        assert!(graph.bytes_in_use() < before + before / 4);
    }

    #[test]
    fn several_leases_each_read_their_own_version() {
        let (mut graph, _) = graph();
        let mut leased = Vec::new();
        for number in 0..4 {
            let snapshot = graph.snapshot();
            let mark = graph.lease(snapshot.version()).unwrap();
            leased.push((number, mark, snapshot.leased(mark)));
            write(&mut graph, number + 1);
        }
        // Ended from the middle: the others do not notice.
        for at in [1, 1, 0, 0] {
            write(&mut graph, 9);
            for (number, _, snapshot) in &leased {
                assert_eq!(values(snapshot).unwrap(), all(*number));
            }
            let (_, mark, _) = leased.remove(at);
            graph.end_lease(mark.token);
        }
        assert_eq!(graph.writer.allocator.held_bytes(), 0);
    }

    #[test]
    fn a_lease_that_holds_too_much_is_revoked_and_the_next_refused() {
        let (mut graph, snapshot) = graph();
        let mut limits = Limits {
            history_bytes: 0,
            lease_bytes: 2_000,
            ..Limits::default()
        };
        graph.set_limits(limits);
        let mark = graph.lease(snapshot.version()).unwrap();
        let leased = snapshot.leased(mark);
        write(&mut graph, 1);
        assert!(!graph.has_lease(mark.token), "it was revoked");
        let revoked = values(&leased).unwrap_err();
        assert!(matches!(revoked, ReadError::SnapshotTooOld { .. }));
        let old = graph.lease(snapshot.version()).unwrap_err();
        assert!(matches!(old, LeaseRefusal::TooOld { .. }), "{old}");
        limits.lease_bytes = 0;
        graph.set_limits(limits);
        let version = graph.snapshot().version();
        let full = graph.lease(version).unwrap_err();
        assert!(matches!(full, LeaseRefusal::Full { .. }), "{full}");
        let version = Version(version.0 + 1);
        let none = graph.lease(version).unwrap_err();
        assert_eq!(none, LeaseRefusal::NoVersion { version });
    }

    #[test]
    fn places_for_leases_are_given_back() {
        let (mut graph, snapshot) = graph();
        let version = snapshot.version();
        for _ in 0..3 {
            let marks: Vec<_> = (0..LEASES).map(|_| graph.lease(version).unwrap()).collect();
            assert_eq!(graph.lease(version).unwrap_err(), LeaseRefusal::TooMany);
            for mark in marks {
                graph.end_lease(mark.token);
            }
        }
    }

    #[test]
    fn a_version_is_given_up_by_age_and_by_bytes_and_never_otherwise() {
        const BYTES: usize = 1 << 20;
        let (mut graph, _) = graph();
        graph.set_limits(Limits {
            history_bytes: BYTES,
            history_age: Duration::from_secs(10),
            ..Limits::default()
        });
        graph.set_clock(Duration::from_secs(100));
        let first = graph.snapshot();
        write(&mut graph, 1);
        graph.set_clock(Duration::from_secs(109));
        assert_eq!(values(&first).unwrap(), all(0));
        let second = graph.snapshot();
        write(&mut graph, 2);
        graph.set_clock(Duration::from_secs(111));
        values(&first).unwrap_err();
        assert_eq!(values(&second).unwrap(), all(1));
        let before = graph.bytes_in_use() as usize;
        let mut number = 2;
        while graph.bytes_in_use() as usize + 100_000 < before + BYTES {
            assert_eq!(values(&second).unwrap(), all(1));
            number += 1;
            write(&mut graph, number);
        }
        for _ in 0..20 {
            number += 1;
            write(&mut graph, number);
        }
        values(&second).unwrap_err();
        // The newest can always be read, however old.
        graph.set_clock(Duration::from_secs(1_000));
        assert_eq!(values(&graph.snapshot()).unwrap(), all(number));
    }
}
