//! The recorder: follows an instance from the side and writes what it sees to a file. It guarantees
//! that every commit is in the file, or that the file says where some are missing and what the graph
//! was after them; and that what it saw is in the file a second later.

use super::channels::{self, Channels};
use super::digest::digest;
use super::draw;
use super::file::{RecordError, RecordFile};
use super::scene::Scene;
use super::{
    COMMITS, DIGEST, LASER_SCAN, LOG, MISSIONS, PATH, SCENE, SNAPSHOT, SOCIAL_GRID, TRANSFORMS,
};
use crate::seen::Seen;
use crate::view::map::{Map, Point};
use crate::view::mission::missions;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dsr::{
    Change, Changes, EdgeChange, Filter, Image, LargeHandle, ReadError, Session, Snapshot, Time,
    Turns, Update, Version,
};
use foxglove::messages::{FrameTransforms, Log, log};
use serde_json::{Value as Json, json};
use std::path::Path;
use std::time::{Duration, Instant};

/// So many commits lie between two digests of the graph.
const DIGEST_EVERY: u64 = 1000;
/// What people see is written so often, simulated seconds.
const SHOW_EVERY: f64 = 0.2;
/// The social grid is written so often at the most, simulated seconds.
const GRID_EVERY: f64 = 1.0;
/// What was seen reaches the file within this time.
const FLUSH_EVERY: Duration = Duration::from_secs(1);
/// How long to wait for commits before looking whether the recording shall end.
const LOOK: Duration = Duration::from_millis(50);
/// How long commits that everybody can see may take to be told.
const TOLD: Duration = Duration::from_secs(2);

/// A recording under way.
pub(crate) struct Recorder {
    file: RecordFile,
    changes: Changes,
    channels: Channels,
    session: Session,
    /// The version that the recording has come to.
    version: Version,
    since_digest: u64,
    shown: Shown,
    flushed: Instant,
}

/// What people were shown last.
#[derive(Default)]
struct Shown {
    at: Option<Time>,
    scene: Scene,
    missions: Option<Json>,
    path: Vec<Point>,
    grid: Option<(LargeHandle, Time)>,
}

impl Recorder {
    /// Begins a recording of the instance that the session has joined with the whole graph.
    ///
    /// # Errors
    /// [`RecordError`].
    pub(crate) fn begin(mut session: Session, path: &Path) -> Result<Self, RecordError> {
        let changes = session.changes(Filter::default())?;
        let mut recorder = Self {
            file: RecordFile::create(path)?,
            changes,
            channels: Channels::open(&session)?,
            session,
            version: Version(0),
            since_digest: 0,
            shown: Shown::default(),
            flushed: now(),
        };
        recorder.snapshot(false)?;
        recorder.show()?;
        recorder.file.flush()?;
        Ok(recorder)
    }

    /// Writes the whole graph as it is now.
    fn snapshot(&mut self, missed: bool) -> Result<(), RecordError> {
        let whole = self.session.read(|snapshot| {
            let snapshot = snapshot.committed();
            let transforms = all_transforms(&snapshot)?;
            Ok((Image::of(&snapshot)?, digest(&snapshot)?, transforms))
        })?;
        let (image, (graph, sha256), transforms) = whole;
        let time = image.time();
        self.version = image.version();
        let row = json!({
            "version": self.version.0, "time": time.seconds(), "missed": missed,
            "graph": graph, "image": STANDARD.encode(image.to_bytes()),
        });
        self.file.json(SNAPSHOT, time, &row)?;
        self.digest(time, &graph, &sha256, false)?;
        self.file.message(TRANSFORMS, time, &transforms)?;
        if missed {
            let text = format!("commits up to version {} were missed", self.version);
            self.log(time, log::Level::Warning, "recorder", text)?;
        }
        Ok(())
    }

    fn digest(
        &mut self,
        time: Time,
        graph: &Json,
        sha256: &str,
        last: bool,
    ) -> Result<(), RecordError> {
        let count = |what: &str| graph[what].as_array().map_or(0, Vec::len);
        let row = json!({
            "version": self.version.0, "nodes": count("nodes"), "edges": count("edges"),
            "sha256": sha256, "last": last,
        });
        self.since_digest = 0;
        self.file.json(DIGEST, time, &row)
    }

    fn log(
        &mut self,
        time: Time,
        level: log::Level,
        name: &str,
        message: String,
    ) -> Result<(), RecordError> {
        let entry = Log {
            timestamp: Some(draw::timestamp(time)),
            level: level as i32,
            message,
            name: name.to_owned(),
            ..Log::default()
        };
        self.file.message(LOG, time, &entry)
    }

    /// Writes what was committed since the last time, and what people see of it.
    ///
    /// # Errors
    /// [`RecordError`].
    pub(crate) fn take(&mut self) -> Result<(), RecordError> {
        // What was sent stands before the commits that came of it.
        self.channels.take(&mut self.file)?;
        loop {
            let schema = self.session.snapshot()?.shared_schema().clone();
            match self.changes.next(&schema)? {
                None => break,
                Some(Update::Gap(version)) if version <= self.version => {}
                Some(Update::Gap(_)) => self.snapshot(true)?,
                Some(Update::Change(change)) if change.version <= self.version => {}
                Some(Update::Change(change)) => match self.commit(&change) {
                    // It was committed so long ago that the graph keeps it no more.
                    Err(RecordError::Read(_)) => self.snapshot(true)?,
                    other => other?,
                },
            }
        }
        self.show()?;
        if self.flushed.elapsed() >= FLUSH_EVERY {
            self.file.flush()?;
            self.flushed = now();
        }
        Ok(())
    }

    /// As [`Self::take`], until nothing that can be seen is missing.
    fn catch_up(&mut self) -> Result<(), RecordError> {
        let deadline = now() + TOLD;
        loop {
            self.take()?;
            if self.session.snapshot()?.version() <= self.version {
                return Ok(());
            }
            if now() > deadline {
                return self.snapshot(true);
            }
            self.changes.wait(Duration::from_millis(5))?;
        }
    }

    fn commit(&mut self, change: &Change) -> Result<(), RecordError> {
        let newest = self.session.snapshot()?;
        let seen = Seen::exactly(&newest, change.version)?;
        let row = seen.row(change)?;
        let mut transforms = Vec::new();
        for touched in &change.edges {
            transforms.extend(transform(&seen, touched)?);
        }
        self.file.json(COMMITS, change.time, &row)?;
        self.version = change.version;
        if !transforms.is_empty() {
            let message = FrameTransforms { transforms };
            self.file.message(TRANSFORMS, change.time, &message)?;
        }
        for rule in &change.rules {
            let bound = |(variable, id): &(String, _)| format!("{variable}={}", seen.name(*id));
            let binding: Vec<String> = rule.binding.iter().map(bound).collect();
            let text = format!("{}({})", rule.rule, binding.join(", "));
            self.log(change.time, log::Level::Info, &change.agent, text)?;
        }
        self.since_digest += 1;
        if self.since_digest >= DIGEST_EVERY {
            let (graph, sha256) = digest(seen.after())?;
            self.digest(change.time, &graph, &sha256, false)?;
        }
        Ok(())
    }

    /// Writes what people see, where it is time and it changed.
    fn show(&mut self) -> Result<(), RecordError> {
        let snapshot = self.session.snapshot()?;
        let time = snapshot.time();
        if self.shown.at.is_some_and(|at| time.since(at) < SHOW_EVERY) {
            return Ok(());
        }
        // A look that was overtaken is made up for by the next.
        let Ok((map, missions)) = look(&snapshot) else {
            return Ok(());
        };
        self.shown.at = Some(time);
        if let Some(update) = self.shown.scene.update(&map, time) {
            self.file.message(SCENE, time, &update)?;
        }
        let path = map.robots.first().map_or(&[][..], |robot| &robot.path);
        if path != self.shown.path {
            self.file
                .message(PATH, time, &draw::path(time, &map.frame, path))?;
            self.shown.path = path.to_vec();
        }
        if let (Some(scan), Some(robot)) = (self.channels.scan.take(), map.robots.first()) {
            let scan = draw::scan(&scan, &robot.name);
            self.file.message(LASER_SCAN, time, &scan)?;
        }
        if self.shown.missions.as_ref() != Some(&missions) {
            self.file
                .json(MISSIONS, time, &json!({"missions": missions}))?;
            let before = self.shown.missions.replace(missions.clone());
            for text in mission_news(before.as_ref(), &missions) {
                self.log(time, log::Level::Info, "executive", text)?;
            }
        }
        self.show_grid(&snapshot, &map.frame)
    }

    fn show_grid(&mut self, snapshot: &Snapshot, frame: &str) -> Result<(), RecordError> {
        let time = snapshot.time();
        let shown = self.shown.grid.as_ref();
        if shown.is_some_and(|(_, at)| time.since(*at) < GRID_EVERY) {
            return Ok(());
        }
        let Ok(Some((handle, place))) = crate::view::grid::find(snapshot) else {
            return Ok(());
        };
        if shown.is_some_and(|(shown, _)| *shown == handle) {
            return Ok(());
        }
        // One that has not arrived, or is gone already, is followed by another.
        if let Ok(sample) = self.session.read_large(&handle, Duration::ZERO)
            && let (Some(costs), &[_, columns]) = (sample.numbers::<f32>(), handle.shape())
        {
            let grid = draw::grid(time, frame, place, columns, costs);
            self.file.message(SOCIAL_GRID, time, &grid)?;
            self.shown.grid = Some((handle, time));
        }
        Ok(())
    }

    /// Ends the recording with a digest of the graph as it is left.
    ///
    /// # Errors
    /// [`RecordError`].
    pub(crate) fn finish(mut self) -> Result<(), RecordError> {
        // What agents send at their end is told by nobody's commit.
        self.channels.take(&mut self.file)?;
        self.catch_up()?;
        let last = self.session.read(|snapshot| {
            let (graph, sha256) = digest(snapshot)?;
            Ok((snapshot.time(), graph, sha256))
        })?;
        self.digest(last.0, &last.1, &last.2, true)?;
        self.file.finish()
    }
}

/// Follows an instance until the recorder's process shall end; then ends the file.
///
/// # Errors
/// [`RecordError`].
pub(crate) fn follow(mut recorder: Recorder, mut turns: Turns) -> Result<(), RecordError> {
    if turns.in_lockstep() {
        while let Some(tick) = turns.next(&mut recorder.session)? {
            recorder.catch_up()?;
            channels::tick(&mut recorder.file, tick)?;
        }
    } else {
        while !turns.ended() && recorder.session.instance().exists() {
            recorder.changes.wait(LOOK)?;
            recorder.take()?;
        }
    }
    recorder.finish()
}

#[allow(
    clippy::disallowed_methods,
    reason = "what was recorded reaches the disk in real time"
)]
fn now() -> Instant {
    Instant::now()
}

fn look(snapshot: &Snapshot) -> Result<(Map, Json), ReadError> {
    Ok((Map::of(snapshot)?, missions(snapshot)?))
}

/// The transform that a commit gave, where the edge is one of the tree of poses.
fn transform(
    seen: &Seen,
    touched: &EdgeChange,
) -> Result<Option<foxglove::messages::FrameTransform>, ReadError> {
    let snapshot = seen.after();
    let key = touched.edge;
    if !["pose", "RT"].contains(&snapshot.schema().label_name(key.label)) {
        return Ok(None);
    }
    let Some(edge) = snapshot.find_edge(key)? else {
        return Ok(None);
    };
    let pose = snapshot.pose_of(&edge).ok();
    let (parent, child) = (seen.name(key.from), seen.name(key.to));
    Ok(pose.map(|pose| draw::transform(snapshot.time(), parent, child, &pose)))
}

/// Every transform of the graph.
fn all_transforms(snapshot: &Snapshot) -> Result<FrameTransforms, ReadError> {
    let name = |id| crate::commands::graph::name_of(snapshot, id);
    let mut transforms = Vec::new();
    for label in ["pose", "RT"] {
        let Some(label) = snapshot.schema().find_label(label) else {
            continue;
        };
        for key in snapshot.edges_of_label(label) {
            let key = key?;
            let Some(edge) = snapshot.find_edge(key)? else {
                continue;
            };
            if let Ok(pose) = snapshot.pose_of(&edge) {
                let (parent, child) = (name(key.from), name(key.to));
                transforms.push(draw::transform(snapshot.time(), parent, child, &pose));
            }
        }
    }
    Ok(FrameTransforms { transforms })
}

/// What became of missions and steps between two looks.
fn mission_news(before: Option<&Json>, after: &Json) -> Vec<String> {
    let known = |name: &Json| {
        let missions = before?.as_array()?;
        missions.iter().find(|mission| mission["name"] == *name)
    };
    let mut news = Vec::new();
    let mut tell = |what: String, before: Option<&Json>, after: &Json| {
        if before.is_none_or(|before| before["status"] != after["status"]) {
            let text = |key: &str| after[key].as_str().unwrap_or_default().to_owned();
            let reason = match text("reason") {
                reason if reason.is_empty() => reason,
                reason => format!(": {reason}"),
            };
            news.push(format!("{what} is {}{reason}", text("status")));
        }
    };
    for mission in after.as_array().into_iter().flatten() {
        let name = mission["name"].as_str().unwrap_or_default();
        let known = known(&mission["name"]);
        tell(format!("mission {name}"), known, mission);
        for step in mission["steps"].as_array().into_iter().flatten() {
            let steps = known.and_then(|known| known["steps"].as_array());
            let step_before = steps.and_then(|s| s.iter().find(|s| s["name"] == step["name"]));
            let (name, rule) = (&step["name"], &step["rule"]);
            let (name, rule) = (
                name.as_str().unwrap_or_default(),
                rule.as_str().unwrap_or_default(),
            );
            tell(format!("step {name} {rule}"), step_before, step);
        }
    }
    news
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mission_is_told_when_it_comes_and_when_its_status_changes() {
        let missions = |status: &str, step: &str| {
            json!([{"name": "tidy", "status": status, "reason": "", "steps": [
                {"name": "tidy/0/0", "rule": "grasp", "status": step, "reason": "late"}]}])
        };
        let first = mission_news(None, &missions("running", "pending"));
        assert_eq!(
            first,
            [
                "mission tidy is running",
                "step tidy/0/0 grasp is pending: late"
            ]
        );
        let then = mission_news(
            Some(&missions("running", "pending")),
            &missions("running", "running"),
        );
        assert_eq!(then, ["step tidy/0/0 grasp is running: late"]);
    }
}
