//! What the tests share: instances that leave nothing behind and processes that end with them.

mod program;

pub(crate) use crate::tree::root;
pub(crate) use program::{Program, Run};

use dsr::Instance;
use rustix::process::{Pid, Signal, kill_process};
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::channel;
use std::time::Duration;

/// A number from the environment that makes a test longer than it usually is.
pub(crate) fn size(variable: &str, usually: usize) -> usize {
    std::env::var(variable).map_or(usually, |text| text.parse().unwrap())
}

/// How often a test repeats what may go wrong: `CORTEX_ROUNDS`, or so often.
pub(crate) fn rounds(usually: usize) -> u64 {
    size("CORTEX_ROUNDS", usually) as u64
}

/// Lets others go on for so long.
pub(crate) fn pause(time: Duration) {
    // Nobody sends anything: to receive is to pause.
    let (_silent, pause) = channel::<()>();
    assert!(pause.recv_timeout(time).is_err());
}

/// Asks again and again until there is an answer, or the time is over.
pub(crate) fn within<T>(patience: Duration, mut ask: impl FnMut() -> Option<T>) -> Option<T> {
    const PAUSE: Duration = Duration::from_millis(5);
    let rounds = patience.as_millis() / PAUSE.as_millis();
    (0..=rounds).find_map(|round| {
        if round > 0 {
            pause(PAUSE);
        }
        ask()
    })
}

/// An instance of a test's own; whatever is left of it is removed at the end.
pub(crate) struct TestInstance(pub(crate) Instance);

impl TestInstance {
    pub(crate) fn new(test: &str) -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("t{}-{count}-{test}", std::process::id());
        Self(Instance::new(&name).unwrap())
    }

    /// The instance of that name, which another run of the same test used.
    pub(crate) fn named(name: &str) -> Self {
        Self(Instance::new(name).unwrap())
    }

    pub(crate) fn name(&self) -> &str {
        self.0.name()
    }
}

impl Drop for TestInstance {
    fn drop(&mut self) {
        self.0.remove().unwrap();
    }
}

/// A process of a test; killed if the test does not end it.
pub(crate) struct Process {
    child: Child,
    output: BufReader<ChildStdout>,
}

impl Process {
    /// Starts `peer` in a role and waits until it has joined.
    pub(crate) fn peer(role: &str, instance: &TestInstance) -> Self {
        let mut process = Self::start(role, instance, &[]);
        assert_eq!(process.line(), "ready");
        process
    }

    pub(crate) fn start(role: &str, instance: &TestInstance, rest: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_peer"))
            .args([role, instance.name()])
            .args(rest)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let output = BufReader::new(child.stdout.take().unwrap());
        Self { child, output }
    }

    /// The next line that it says.
    pub(crate) fn line(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        line.trim_end().to_owned()
    }

    /// Kills it with signal 9, and gives all that it said before.
    pub(crate) fn kill_and_hear(mut self) -> String {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
        let mut said = String::new();
        self.output.read_to_string(&mut said).unwrap();
        said
    }

    /// Stops it where it is.
    pub(crate) fn stop(&self) {
        self.signal(Signal::STOP);
    }

    /// Lets it go on.
    pub(crate) fn resume(&self) {
        self.signal(Signal::CONT);
    }

    fn signal(&self, signal: Signal) {
        let id = Pid::from_raw(self.child.id().cast_signed()).unwrap();
        kill_process(id, signal).unwrap();
    }

    /// Kills it with signal 9.
    pub(crate) fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Ends its input, waits for its end, and gives what it said last.
    pub(crate) fn finish(mut self) -> String {
        drop(self.child.stdin.take());
        let mut rest = String::new();
        self.output.read_to_string(&mut rest).unwrap();
        assert!(self.child.wait().unwrap().success(), "{rest}");
        rest.trim_end().to_owned()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended already, which is as good.
        drop(self.child.kill());
        drop(self.child.wait());
    }
}
