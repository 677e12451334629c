//! What the page is told as things happen: at most one frame in 33 ms. It guarantees that a
//! frame holds only what changed since the one before, and that who comes in between can ask for the
//! rest.

use super::laser::Laser;
use super::look::{Looker, Source};
use super::news::Follower;
use super::processes::Processes;
use crate::Failure;
use crate::view::map::Map;
use crate::view::mission::missions;
use serde_json::{Value as Json, json};

/// Frames between two looks at the processes.
const PROCESSES_EVERY: u64 = 30;

/// Puts frames together.
pub(super) struct Frames {
    follower: Follower,
    laser: Laser,
    map: Option<Map>,
    missions: Option<Json>,
    processes: Processes,
    count: u64,
}

impl Frames {
    /// Follows a running instance; `None` of a recording, where nothing happens.
    pub(super) fn follow(looker: &mut Looker) -> Result<Option<Self>, Failure> {
        let Source::Live(session) = &mut looker.source else {
            return Ok(None);
        };
        Ok(Some(Self {
            follower: Follower::new(&session.snapshot().map_err(Failure::internal)?),
            laser: Laser::open(session).map_err(Failure::internal)?,
            map: None,
            missions: None,
            processes: Processes::of(session.instance()),
            count: 0,
        }))
    }

    /// What is new; `None` where nothing is.
    pub(super) fn next(&mut self, looker: &mut Looker) -> Result<Option<Json>, Failure> {
        let snapshot = looker.newest()?;
        let news = self.follower.next(&snapshot);
        let laser = self.laser.look().map_err(Failure::internal)?;
        self.count += 1;
        let look = self.count % PROCESSES_EVERY == 1;
        if news.count == 0 && laser.is_none() && !look {
            return Ok(None);
        }
        let mut frame = json!({
            "version": snapshot.version().0, "time": snapshot.time().seconds(),
            "structure": news.structure, "changed": news.changed, "commits": news.commits,
            "count": news.count,
        });
        if look {
            frame["processes"] = self.processes.look(&snapshot);
        }
        if let Some(laser) = laser {
            frame["laser"] = laser;
        }
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
