//! The supervisor's processes: starts them, hears when one ends, restarts those that may be
//! restarted, and ends them all. It guarantees that no process that it started outlives it.

mod child;

pub(crate) use child::cpu_seconds;
use child::{Child, Event, EventKind};
use dsr::{Instance, Tick, done_line};
use std::ffi::OsString;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};
use thiserror::Error;

/// How long a process may take to join, to take a turn, or to end.
const PATIENCE: Duration = Duration::from_secs(20);
/// More restarts than this within [`RESTART_WINDOW`] mean that it will not work.
const RESTARTS: usize = 5;
const RESTART_WINDOW: Duration = Duration::from_secs(10);

/// What the supervisor cannot go on after.
#[derive(Debug, Error)]
pub(crate) enum SuperviseError {
    #[error("cannot start {process}: {source}")]
    Start {
        process: String,
        source: std::io::Error,
    },
    #[error("{process} ended ({status}) and cannot be restarted; {log}")]
    Ended {
        process: String,
        status: String,
        log: String,
    },
    #[error("{process} ended {RESTARTS} times within {} s; {log}", RESTART_WINDOW.as_secs())]
    KeepsEnding { process: String, log: String },
    #[error("{process} did not {what} within {} s; {log}", PATIENCE.as_secs())]
    Silent {
        process: String,
        what: &'static str,
        log: String,
    },
    #[error("interrupted")]
    Interrupted,
}

/// A process that the supervisor shall run.
#[derive(Debug, Clone)]
pub(crate) struct Program {
    /// Its name in reports and log files.
    pub(crate) name: String,
    /// What follows `cortex` on its command line.
    pub(crate) arguments: Vec<OsString>,
    /// What happens when it ends by itself.
    pub(crate) policy: Policy,
}

/// What the supervisor does about a process that ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Policy {
    /// Starts it again.
    Restart,
    /// Ends the run.
    EndRun,
}

/// Something that the user should hear of.
#[derive(Debug, Clone)]
pub(crate) struct Notice(pub(crate) String);

#[derive(Debug)]
struct Member {
    program: Program,
    child: Option<Child>,
    restarts: Vec<Instant>,
    ready: bool,
    /// CPU seconds of lives that have ended.
    spent: f64,
}

#[derive(Debug)]
pub(crate) struct Supervisor {
    executable: PathBuf,
    logs: PathBuf,
    members: Vec<Member>,
    events: Receiver<Event>,
    send: Sender<Event>,
    generation: u64,
}

#[allow(
    clippy::disallowed_methods,
    reason = "the supervisor owns the clock of its processes"
)]
pub(crate) fn now() -> Instant {
    Instant::now()
}

#[allow(
    clippy::disallowed_methods,
    reason = "other processes' ends cannot be waited for otherwise"
)]
fn wait_a_moment() {
    std::thread::sleep(Duration::from_millis(10));
}

impl Supervisor {
    /// A supervisor without processes, whose processes' logs go into `logs`.
    pub(crate) fn new(executable: PathBuf, logs: &Path) -> Self {
        let (send, events) = channel();
        let logs = logs.to_owned();
        Self {
            executable,
            logs,
            members: Vec::new(),
            events,
            send,
            generation: 0,
        }
    }

    /// Starts a process; does not wait for it to join.
    pub(crate) fn start(&mut self, program: Program) -> Result<usize, SuperviseError> {
        let index = self.members.len();
        let member = Member {
            program,
            child: None,
            restarts: Vec::new(),
            ready: false,
            spent: 0.0,
        };
        self.members.push(member);
        self.spawn(index)?;
        Ok(index)
    }

    fn spawn(&mut self, index: usize) -> Result<(), SuperviseError> {
        self.generation += 1;
        let member = &mut self.members[index];
        let log = self.logs.join(format!("{}.log", member.program.name));
        member.ready = false;
        let send = self.send.clone();
        let child = Child::spawn(
            &self.executable,
            &member.program.arguments,
            &log,
            index,
            self.generation,
            send,
        )
        .map_err(|source| {
            let process = member.program.name.clone();
            SuperviseError::Start { process, source }
        })?;
        member.child = Some(child);
        Ok(())
    }

    fn log_hint(&self, index: usize) -> String {
        let log = self
            .logs
            .join(format!("{}.log", self.members[index].program.name));
        let text = std::fs::read_to_string(&log).unwrap_or_default();
        let last: Vec<&str> = text.lines().rev().take(3).collect();
        let last: Vec<&str> = last.into_iter().rev().collect();
        format!("its log {} ends: {}", log.display(), last.join(" | "))
    }

    /// Waits until the process has joined.
    pub(crate) fn wait_until_ready(
        &mut self,
        index: usize,
        notices: &mut Vec<Notice>,
        interrupted: &dyn Fn() -> bool,
    ) -> Result<(), SuperviseError> {
        self.wait(index, "join", notices, interrupted, |member| member.ready)
    }

    fn wait(
        &mut self,
        index: usize,
        what: &'static str,
        notices: &mut Vec<Notice>,
        interrupted: &dyn Fn() -> bool,
        mut enough: impl FnMut(&Member) -> bool,
    ) -> Result<(), SuperviseError> {
        let deadline = now() + PATIENCE;
        while !enough(&self.members[index]) {
            if interrupted() {
                return Err(SuperviseError::Interrupted);
            }
            if now() > deadline {
                let process = self.members[index].program.name.clone();
                return Err(SuperviseError::Silent {
                    process,
                    what,
                    log: self.log_hint(index),
                });
            }
            self.hear(Duration::from_millis(50), notices)?;
        }
        Ok(())
    }

    /// Takes note of one thing that a process said or did, waiting up to `patience` for it.
    pub(crate) fn hear(
        &mut self,
        patience: Duration,
        notices: &mut Vec<Notice>,
    ) -> Result<(), SuperviseError> {
        match self.events.recv_timeout(patience) {
            Ok(event) => self.take_note(event, notices),
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => Ok(()),
        }
    }

    fn take_note(&mut self, event: Event, notices: &mut Vec<Notice>) -> Result<(), SuperviseError> {
        let member = &mut self.members[event.member];
        let Some(child) = member
            .child
            .as_mut()
            .filter(|c| c.generation() == event.generation)
        else {
            return Ok(());
        };
        match event.kind {
            EventKind::Line(line) if line == "ready" => {
                member.ready = true;
                Ok(())
            }
            EventKind::Line(line) => {
                child.said(line);
                Ok(())
            }
            EventKind::Ended => {
                let (status, spent) = child.reap();
                member.spent += spent;
                member.child = None;
                self.restart(event.member, status, notices)
            }
        }
    }

    fn restart(
        &mut self,
        index: usize,
        status: Option<ExitStatus>,
        notices: &mut Vec<Notice>,
    ) -> Result<(), SuperviseError> {
        let status = status.map_or_else(|| "no status".to_owned(), |status| status.to_string());
        let log = self.log_hint(index);
        let member = &mut self.members[index];
        let process = member.program.name.clone();
        if member.program.policy == Policy::EndRun {
            return Err(SuperviseError::Ended {
                process,
                status,
                log,
            });
        }
        member.restarts.push(now());
        let recent = member.restarts.iter().rev().take(RESTARTS);
        if recent.filter(|at| at.elapsed() < RESTART_WINDOW).count() >= RESTARTS {
            return Err(SuperviseError::KeepsEnding { process, log });
        }
        notices.push(Notice(format!(
            "{process} ended ({status}) and is restarted"
        )));
        self.spawn(index)
    }

    /// Gives the process a turn and waits until it has taken it; one that dies in its turn is
    /// restarted and given it again.
    pub(crate) fn take_turn(
        &mut self,
        index: usize,
        tick: Tick,
        notices: &mut Vec<Notice>,
        interrupted: &dyn Fn() -> bool,
    ) -> Result<(), SuperviseError> {
        let done = done_line(tick.index);
        let done = done.trim_end();
        loop {
            self.wait_until_ready(index, notices, interrupted)?;
            let lives = self.members[index].restarts.len();
            if let Some(child) = &mut self.members[index].child {
                child.give_turn(tick);
            }
            self.wait(index, "take its turn", notices, interrupted, |member| {
                member.restarts.len() > lives
                    || member
                        .child
                        .as_ref()
                        .is_some_and(|child| child.has_said(done))
            })?;
            if self.members[index].restarts.len() == lives {
                return Ok(());
            }
        }
    }

    /// How often the process was restarted, and the CPU seconds of all its lives.
    pub(crate) fn account(&self, index: usize) -> (u64, f64) {
        let member = &self.members[index];
        let running = member.child.as_ref().map_or(0.0, Child::cpu_seconds);
        (member.restarts.len() as u64, member.spent + running)
    }

    /// The process's name.
    pub(crate) fn name(&self, index: usize) -> &str {
        &self.members[index].program.name
    }

    /// Notes the CPU time of running processes, so that one that is killed does not lose it.
    pub(crate) fn note_cpu(&mut self) {
        for member in &mut self.members {
            if let Some(child) = &mut member.child {
                child.note_cpu();
            }
        }
    }

    /// Ends all processes, the last started first, each by ending its lifeline; one that does not
    /// end in time is killed.
    pub(crate) fn stop(&mut self) {
        for member in self.members.iter_mut().rev() {
            if let Some(mut child) = member.child.take() {
                member.spent += child.end(PATIENCE / 4);
            }
        }
    }
}

impl Drop for Supervisor {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Holds an instance for one supervisor: while it lives, no other can start the same instance.
#[derive(Debug)]
pub(crate) struct Hold {
    instance: Instance,
    path: PathBuf,
    _lock: std::fs::File,
}

impl Hold {
    /// Takes the instance and removes what a run that died left of it.
    pub(crate) fn take(instance: &Instance) -> Result<Self, miette::Report> {
        use miette::{IntoDiagnostic, WrapErr, miette};
        instance.create_folder().into_diagnostic()?;
        let path = instance.folder().with_extension("lock");
        let lock = std::fs::File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot open {}", path.display()))?;
        let operation = rustix::fs::FlockOperation::NonBlockingLockExclusive;
        rustix::fs::flock(&lock, operation).map_err(|_| {
            miette!(
                help = "end that run first, or give this one another --instance",
                "instance `{}` is running already",
                instance.name()
            )
        })?;
        // The run before may have removed the file between its opening here and its lock.
        let locked = lock.metadata().into_diagnostic()?.ino();
        if std::fs::metadata(&path).map(|m| m.ino()).ok() != Some(locked) {
            return Self::take(instance);
        }
        // What a supervisor that was killed had started is about to end.
        let deadline = now() + PATIENCE / 4;
        while !instance.remove_if_unused().into_diagnostic()? {
            if now() > deadline {
                let processes = instance.processes().into_diagnostic()?;
                drop(std::fs::remove_file(&path));
                return Err(miette!(
                    help = "end them, or give this run another --instance",
                    "instance `{}` is in use by the processes {processes:?}",
                    instance.name()
                ));
            }
            wait_a_moment();
        }
        Ok(Self {
            instance: instance.clone(),
            path,
            _lock: lock,
        })
    }
}

impl Drop for Hold {
    fn drop(&mut self) {
        // What cannot be removed is removed by the next run that takes the instance.
        if let Err(error) = self.instance.remove() {
            tracing::warn!("{error}");
        }
        drop(std::fs::remove_file(&self.path));
        if let Some(user) = self.path.parent() {
            // Succeeds when this was the user's last instance.
            drop(std::fs::remove_dir(user));
        }
    }
}
