//! One run of a scenario: starts its processes, follows it to the missions' end, and keeps what a
//! report is made of. It guarantees that whatever happens, every process has ended and nothing of
//! the instance is left when it returns.

use crate::progress::Progress;
use crate::supervise::{Hold, Notice, Policy, Program, SuperviseError, Supervisor};
use dsr::{Instance, ReadError, Session, Snapshot, Subscriber, Tick, Time};
use executive::{Mission, MissionStatus};
use scenarios::process::{TICK, TRUTH, tick_time};
use scenarios::{Scenario, Truth};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use thiserror::Error;

/// How long the store may take to show its graph.
const PATIENCE: Duration = Duration::from_secs(20);
/// How often a free run looks at its processes.
const LOOK: Duration = Duration::from_millis(20);

/// What to run, and how.
#[derive(Debug, Clone)]
pub(crate) struct Settings<'a> {
    pub(crate) instance: Instance,
    pub(crate) scenario: &'a Scenario,
    pub(crate) social: bool,
    pub(crate) seed: u64,
    pub(crate) speed: f64,
    pub(crate) lockstep: bool,
    pub(crate) tracks: Option<&'a Path>,
    /// Where the graph is kept, and whether every commit waits for it.
    pub(crate) state: Option<(&'a Path, bool)>,
    /// Where the run is recorded.
    pub(crate) record: Option<&'a Path>,
    /// Where its page is.
    pub(crate) inspect: Option<std::net::SocketAddr>,
    pub(crate) logs: PathBuf,
}

/// Why a run could not be brought to its end.
#[derive(Debug, Error)]
pub(crate) enum ConductError {
    #[error(transparent)]
    Supervise(#[from] SuperviseError),
    #[error(transparent)]
    Attach(#[from] dsr::AttachError),
    #[error(transparent)]
    Instance(#[from] dsr::InstanceError),
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error("{0}")]
    Hold(String),
}

/// What became of one process.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Account {
    pub(crate) name: String,
    pub(crate) restarts: u64,
    pub(crate) cpu_seconds: f64,
}

/// What a run left to report.
#[derive(Debug, Clone, Default)]
pub(crate) struct Recording {
    pub(crate) truths: Vec<Truth>,
    pub(crate) missions: Vec<Mission>,
    pub(crate) accounts: Vec<Account>,
}

impl Recording {
    /// Whether every mission has succeeded.
    pub(crate) fn succeeded(&self) -> bool {
        let succeeded = |mission: &Mission| mission.status == MissionStatus::Succeeded;
        !self.missions.is_empty() && self.missions.iter().all(succeeded)
    }
}

struct Conductor<'a> {
    settings: &'a Settings<'a>,
    // Dropped in this order: processes first, then what they share.
    supervisor: Supervisor,
    truth: Subscriber<Truth>,
    session: Session,
    _hold: Hold,
    store: usize,
    recorder: Option<usize>,
    agents: Vec<usize>,
    world: usize,
    /// When the world's time begins: the scenario's start, or later where a state goes on.
    start: Time,
    recording: Recording,
    /// Samples of the world that did not arrive.
    lost: u64,
    interrupted: &'a AtomicBool,
    progress: &'a mut Progress,
}

/// Runs the scenario to its end. `None` where the user interrupted it.
pub(crate) fn conduct(
    settings: &Settings<'_>,
    interrupted: &AtomicBool,
    progress: &mut Progress,
) -> Result<Option<Recording>, ConductError> {
    match run(settings, interrupted, progress) {
        Err(ConductError::Supervise(SuperviseError::Interrupted)) => Ok(None),
        other => other,
    }
}

fn run(
    settings: &Settings<'_>,
    interrupted: &AtomicBool,
    progress: &mut Progress,
) -> Result<Option<Recording>, ConductError> {
    let mut conductor = Conductor::start(settings, interrupted, progress)?;
    let ended = if settings.lockstep {
        conductor.in_lockstep()?
    } else {
        conductor.free()?
    };
    ended.then(|| conductor.finish()).transpose()
}

impl<'a> Conductor<'a> {
    fn start(
        settings: &'a Settings<'a>,
        interrupted: &'a AtomicBool,
        progress: &'a mut Progress,
    ) -> Result<Self, ConductError> {
        let hold = Hold::take(&settings.instance)
            .map_err(|report| ConductError::Hold(format!("{report}")))?;
        let executable = std::env::current_exe().map_err(|source| SuperviseError::Start {
            process: "cortex".to_owned(),
            source,
        })?;
        let session = Session::join(&settings.instance, "supervisor")?;
        let truth = session.subscriber(TRUTH)?;
        let mut conductor = Self {
            settings,
            supervisor: Supervisor::new(executable, &settings.logs),
            truth,
            session,
            _hold: hold,
            store: 0,
            recorder: None,
            agents: Vec::new(),
            world: 0,
            start: settings.scenario.start,
            recording: Recording::default(),
            lost: 0,
            interrupted,
            progress,
        };
        conductor.progress.say("starting the store");
        conductor.store = conductor.supervisor.start(conductor.store_program())?;
        conductor.until_ready(conductor.store)?;
        conductor.session.wait_for_store(PATIENCE)?;
        conductor.start = conductor.start.max(conductor.session.snapshot()?.time());
        // Before the agents, so that it sees all that they do; and so it ends after them.
        if let Some(file) = settings.record {
            let recorder = conductor
                .supervisor
                .start(conductor.recorder_program(file))?;
            conductor.until_ready(recorder)?;
            conductor.recorder = Some(recorder);
        }
        if let Some(address) = settings.inspect {
            let inspector = conductor
                .supervisor
                .start(conductor.inspector_program(address))?;
            conductor.until_ready(inspector)?;
            conductor
                .progress
                .say(&format!("look at it at http://{address}/"));
        }
        conductor.progress.say("starting the agents");
        for name in crate::commands::AGENTS {
            let program = conductor.agent_program(name, Policy::Restart);
            let index = conductor.supervisor.start(program)?;
            conductor.agents.push(index);
        }
        for index in conductor.agents.clone() {
            conductor.until_ready(index)?;
        }
        let world = conductor.agent_program("world", Policy::EndRun);
        conductor.world = conductor.supervisor.start(world)?;
        conductor.until_ready(conductor.world)?;
        Ok(conductor)
    }

    fn store_program(&self) -> Program {
        let settings = self.settings;
        let mut arguments: Vec<OsString> = vec!["store".into(), "--supervised".into()];
        arguments.extend(["--scenario".into(), settings.scenario.folder.clone().into()]);
        arguments.extend(["--instance".into(), settings.instance.name().into()]);
        if !settings.social {
            arguments.push("--no-social".into());
        }
        if let Some((folder, durable)) = settings.state {
            arguments.extend(["--state".into(), folder.into()]);
            if durable {
                arguments.push("--durable".into());
            }
        }
        Program {
            name: "store".to_owned(),
            arguments,
            policy: Policy::Restart,
        }
    }

    fn recorder_program(&self, file: &Path) -> Program {
        let mut arguments: Vec<OsString> =
            vec!["record".into(), file.into(), "--supervised".into()];
        arguments.extend(["--instance".into(), self.settings.instance.name().into()]);
        if self.settings.lockstep {
            arguments.push("--lockstep".into());
        }
        Program {
            name: crate::commands::record::RECORDER.to_owned(),
            arguments,
            policy: Policy::Restart,
        }
    }

    fn inspector_program(&self, address: std::net::SocketAddr) -> Program {
        let mut arguments: Vec<OsString> = vec!["inspect".into(), "--supervised".into()];
        arguments.extend(["--web".into(), address.to_string().into()]);
        arguments.extend(["--instance".into(), self.settings.instance.name().into()]);
        Program {
            name: "inspector".to_owned(),
            arguments,
            policy: Policy::Restart,
        }
    }

    fn agent_program(&self, name: &str, policy: Policy) -> Program {
        let settings = self.settings;
        let mut arguments: Vec<OsString> = vec!["agent".into(), name.into(), "--supervised".into()];
        arguments.extend(["--scenario".into(), settings.scenario.folder.clone().into()]);
        arguments.extend(["--instance".into(), settings.instance.name().into()]);
        if name == "world" {
            arguments.extend(["--seed".into(), settings.seed.to_string().into()]);
            arguments.extend(["--speed".into(), settings.speed.to_string().into()]);
            if let Some(tracks) = settings.tracks {
                arguments.extend(["--tracks".into(), tracks.into()]);
            }
        }
        if settings.lockstep {
            arguments.push("--lockstep".into());
        }
        Program {
            name: name.to_owned(),
            arguments,
            policy,
        }
    }

    fn until_ready(&mut self, index: usize) -> Result<(), ConductError> {
        let mut notices = Vec::new();
        let interrupted = self.interrupted;
        let outcome = self
            .supervisor
            .wait_until_ready(index, &mut notices, &|| interrupted.load(Ordering::Acquire));
        self.tell(notices);
        Ok(outcome?)
    }

    fn tell(&mut self, notices: Vec<Notice>) {
        for Notice(text) in notices {
            self.progress.say(&text);
        }
    }

    /// One process after the other takes its turn, tick by tick.
    fn in_lockstep(&mut self) -> Result<bool, ConductError> {
        let mut order = vec![self.world];
        order.extend(&self.agents);
        order.extend(self.recorder);
        let start = self.start;
        let ticks = (self.settings.scenario.duration / TICK).ceil() as u64;
        let interrupted = self.interrupted;
        for index in 1..=ticks {
            let tick = Tick {
                index,
                time: tick_time(start, index),
            };
            for &member in &order {
                let mut notices = Vec::new();
                let outcome = self.supervisor.take_turn(member, tick, &mut notices, &|| {
                    interrupted.load(Ordering::Acquire)
                });
                self.tell(notices);
                outcome?;
            }
            self.record()?;
            if self.missions_are_over(index % 20 == 0)? {
                return Ok(true);
            }
        }
        Ok(true)
    }

    /// The processes run by themselves; this one watches.
    fn free(&mut self) -> Result<bool, ConductError> {
        let mut round = 0u64;
        loop {
            let mut notices = Vec::new();
            let deadline = crate::supervise::now() + LOOK;
            loop {
                let left = deadline.saturating_duration_since(crate::supervise::now());
                if left.is_zero() {
                    break;
                }
                let heard = self.supervisor.hear(left, &mut notices);
                self.tell(std::mem::take(&mut notices));
                heard?;
            }
            if self.interrupted.load(Ordering::Acquire) {
                return Ok(false);
            }
            self.record()?;
            round += 1;
            if round.is_multiple_of(10) {
                self.supervisor.note_cpu();
            }
            let over = self.missions_are_over(round.is_multiple_of(10))?;
            let last = self.recording.truths.last().map(|truth| truth.time);
            let start = self.start;
            let late = last.is_some_and(|t| t.since(start) >= self.settings.scenario.duration);
            if over || late {
                return Ok(true);
            }
        }
    }

    /// Keeps what the world has told since the last time.
    fn record(&mut self) -> Result<(), ConductError> {
        for truth in self.truth.drain()? {
            if let Some(last) = self.recording.truths.last() {
                let missed = (truth.time.since(last.time) / TICK).round() as i64 - 1;
                self.lost += u64::try_from(missed).unwrap_or(0);
            }
            self.recording.truths.push(truth);
        }
        Ok(())
    }

    fn missions_are_over(&mut self, show: bool) -> Result<bool, ConductError> {
        // Steps are shown, and reported at the end; whether missions are over does not need them.
        let missions = self.session.read(executive::missions)?;
        if show {
            let what = missions.iter().find(|m| m.status == MissionStatus::Running);
            let id = what.map(|mission| mission.id);
            let in_hand = |snapshot: &Snapshot| match id {
                Some(id) => executive::steps(snapshot, id),
                None => Ok(Vec::new()),
            };
            let steps = self.session.read(in_hand)?;
            let start = self.start;
            let now = self
                .recording
                .truths
                .last()
                .map_or(0.0, |truth| truth.time.since(start));
            let step = steps.iter().rfind(|step| step.status.is_under_way());
            let text = match (what, step) {
                (Some(mission), Some(step)) => format!("{}: {}", mission.name, step.rule),
                (Some(mission), None) => mission.name.clone(),
                _ => String::new(),
            };
            self.progress
                .at(now, self.settings.scenario.duration, &text);
        }
        for mission in &missions {
            let known = self
                .recording
                .missions
                .iter()
                .find(|m| m.name == mission.name);
            if known.is_none_or(|known| known.status != mission.status) {
                let reason = if mission.reason.is_empty() {
                    String::new()
                } else {
                    format!(": {}", mission.reason)
                };
                self.progress.say(&format!(
                    "mission {} is {}{reason}",
                    mission.name,
                    mission.status.name()
                ));
            }
        }
        let all = missions.len() >= self.settings.scenario.missions.len();
        let at_end = |mission: &Mission| mission.status.is_over() && !mission.recurs();
        let ended = all && missions.iter().all(at_end);
        self.recording.missions = missions;
        Ok(ended)
    }

    /// Takes the last of what there is to report, then ends the processes.
    fn finish(mut self) -> Result<Recording, ConductError> {
        self.recording.missions = self.session.read(executive::missions_with_steps)?;
        let members = std::iter::once(self.store).chain(self.agents.clone());
        let others = std::iter::once(self.world).chain(self.recorder);
        let members: Vec<usize> = members.chain(others).collect();
        self.supervisor.stop();
        self.record()?;
        if self.lost > 0 {
            let (lost, all) = (self.lost, self.recording.truths.len());
            self.progress.say(&format!(
                "{lost} samples of the world were lost beside {all} that arrived: the figures are \
                 less exact; use a lower --speed"
            ));
        }
        self.recording.accounts = members
            .into_iter()
            .map(|index| {
                let (restarts, cpu_seconds) = self.supervisor.account(index);
                let name = self.supervisor.name(index).to_owned();
                Account {
                    name,
                    restarts,
                    cpu_seconds,
                }
            })
            .collect();
        Ok(std::mem::take(&mut self.recording))
    }
}
