//! How long a commit takes while others are stopped in the middle of their work, and while what they
//! left is cleaned up after they were killed there.

use super::commits::{commit, set};
use super::figure::Figure;
use super::hall::{Hall, Peer};
use super::{Effort, PATIENCE, peer};
use crate::Failure;
use dsr::Session;
use std::time::{Duration, Instant};

/// Longer than a store takes until it has cleaned up.
const LOOK: Duration = Duration::from_millis(600);
/// Commits of another that the graph shall have had before it is stopped.
const UNDER_WAY: u64 = 100;

/// Commits for a while: how long they took, and how many they were.
#[derive(Debug, Default)]
pub(super) struct Taken {
    nanoseconds: u128,
    pub(super) commits: u64,
}

impl Taken {
    pub(super) fn go_on(&mut self, session: &mut Session) -> Result<(), Failure> {
        let start = Instant::now();
        while start.elapsed() < LOOK {
            let transaction = set(self.commits * 7919, self.commits as f64);
            let asked = Instant::now();
            commit(session, &transaction)?;
            self.nanoseconds += asked.elapsed().as_nanos();
            self.commits += 1;
        }
        Ok(())
    }

    /// The mean, in which a single long pause shows, in us.
    pub(super) fn mean(&self) -> f64 {
        self.nanoseconds as f64 / 1e3 / self.commits.max(1) as f64
    }
}

/// Who is to be stopped: one that reads, one that follows, one that commits.
fn others(hall: &Hall, session: &mut Session) -> Result<[Peer; 3], Failure> {
    let [reader, follower] = ["reader", "follow"].map(|role| hall.ready(role, &[]));
    let mut committer = hall.ready("stamp", &[u64::MAX])?;
    committer.go()?;
    let mut version = || session.snapshot().map(|snapshot| snapshot.version().0);
    let start = version().map_err(Failure::internal)?;
    let deadline = Instant::now() + PATIENCE;
    while version().map_err(Failure::internal)? < start + UNDER_WAY {
        if Instant::now() > deadline {
            return Err(Failure::internal("the other committer does not commit"));
        }
    }
    Ok([reader?, follower?, committer])
}

/// Commits beside nobody, beside others that are stopped, and beside what is left of them, in turns.
pub(super) fn all(hall: &Hall, effort: Effort, figures: &mut Vec<Figure>) -> Result<(), Failure> {
    let mut session = hall.session("committer")?;
    session.set_spin(PATIENCE);
    let everywhere = peer::sit(0)?;
    let [mut alone, mut stopped, mut killed] = [(); 3].map(|()| Taken::default());
    for _ in 0..effort.joins {
        alone.go_on(&mut session)?;
        let others = others(hall, &mut session)?;
        for other in &others {
            other.stop()?;
        }
        stopped.go_on(&mut session)?;
        // Killed where they are stopped.
        drop(others);
        killed.go_on(&mut session)?;
    }
    peer::stand(&everywhere)?;
    for (name, taken) in [
        ("commit_ack_beside_stopped", stopped),
        ("commit_ack_beside_killed", killed),
    ] {
        figures.push(Figure {
            name,
            value: taken.mean(),
            unit: "us",
            raw: Some(alone.mean()),
            peer: format!("nobody beside it, mean of {}", alone.commits),
        });
    }
    Ok(())
}
