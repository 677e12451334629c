//! One child process: its lifeline, what it says, what it costs. It guarantees that a child is
//! reaped, and that what it said is heard in order before its end is.

use dsr::{Tick, turn_line};
use std::ffi::OsString;
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{self, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::Sender;
use std::time::Duration;

/// Something that a child said or did.
#[derive(Debug)]
pub(crate) struct Event {
    pub(crate) member: usize,
    /// Which start of the supervisor's this child was.
    pub(crate) generation: u64,
    pub(crate) kind: EventKind,
}

#[derive(Debug)]
pub(crate) enum EventKind {
    Line(String),
    Ended,
}

#[derive(Debug)]
pub(crate) struct Child {
    process: process::Child,
    lifeline: Option<ChildStdin>,
    generation: u64,
    last_line: String,
    /// CPU seconds when last looked at.
    cpu: f64,
}

impl Child {
    pub(crate) fn spawn(
        executable: &Path,
        arguments: &[OsString],
        log: &Path,
        member: usize,
        generation: u64,
        send: Sender<Event>,
    ) -> std::io::Result<Self> {
        let log = File::options().create(true).append(true).open(log)?;
        let mut process = Command::new(executable)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(log)
            // Ctrl-C at the terminal is for the supervisor, which ends its children in order.
            .process_group(0)
            .spawn()?;
        let lifeline = process.stdin.take();
        if let Some(output) = process.stdout.take() {
            std::thread::Builder::new()
                .name(format!("hear-{member}"))
                .spawn(move || {
                    let tell = |kind| {
                        send.send(Event {
                            member,
                            generation,
                            kind,
                        })
                    };
                    for line in BufReader::new(output).lines() {
                        let Ok(line) = line else { break };
                        if tell(EventKind::Line(line)).is_err() {
                            return;
                        }
                    }
                    // Nobody listens any more when the supervisor has ended.
                    drop(tell(EventKind::Ended));
                })?;
        }
        Ok(Self {
            process,
            lifeline,
            generation,
            last_line: String::new(),
            cpu: 0.0,
        })
    }

    pub(crate) fn generation(&self) -> u64 {
        self.generation
    }

    pub(crate) fn said(&mut self, line: String) {
        self.last_line = line;
    }

    pub(crate) fn has_said(&self, line: &str) -> bool {
        self.last_line == line
    }

    /// A child that is gone does not hear it; its end is heard instead.
    pub(crate) fn give_turn(&mut self, tick: Tick) {
        if let Some(lifeline) = &mut self.lifeline {
            drop(lifeline.write_all(turn_line(tick).as_bytes()));
        }
    }

    /// CPU seconds so far.
    pub(crate) fn cpu_seconds(&self) -> f64 {
        cpu_seconds(self.process.id())
            .unwrap_or(self.cpu)
            .max(self.cpu)
    }

    pub(crate) fn note_cpu(&mut self) {
        self.cpu = self.cpu_seconds();
    }

    /// Reaps a child whose output has ended; its status and CPU seconds.
    pub(crate) fn reap(&mut self) -> (Option<ExitStatus>, f64) {
        self.lifeline = None;
        // The child keeps its account in /proc until it is reaped.
        self.note_cpu();
        self.wait_or_kill(Duration::from_secs(2));
        (self.process.try_wait().ok().flatten(), self.cpu)
    }

    /// Ends the child; its CPU seconds.
    pub(crate) fn end(&mut self, patience: Duration) -> f64 {
        self.note_cpu();
        self.lifeline = None;
        self.wait_or_kill(patience);
        self.cpu
    }

    #[allow(
        clippy::disallowed_methods,
        reason = "a child's end cannot be waited for with a time limit otherwise"
    )]
    fn wait_or_kill(&mut self, patience: Duration) {
        let deadline = super::now() + patience;
        while matches!(self.process.try_wait(), Ok(None)) {
            if super::now() > deadline {
                // It may have ended between the two, which is as good.
                drop(self.process.kill());
                drop(self.process.wait());
                return;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

/// User and system time of a process, from `/proc/PID/stat` (proc(5), fields 14 and 15).
pub(crate) fn cpu_seconds(pid: u32) -> Option<f64> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The second field, the command in parentheses, may hold anything.
    let (_, rest) = stat.rsplit_once(')')?;
    let mut fields = rest.split_whitespace().skip(11);
    let mut ticks = || fields.next()?.parse::<u64>().ok();
    let total = ticks()? + ticks()?;
    Some(total as f64 / rustix::param::clock_ticks_per_second() as f64)
}
