//! The `cortex` program as the tests drive it. It guarantees that a run that a test started is over
//! when the test is, however the test ends.

use super::{TestInstance, root};
use rustix::process::{Pid, Signal, kill_process};
use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStderr, Command, ExitStatus, Output, Stdio};
use tempfile::TempDir;

/// The program, run to its end.
pub(crate) struct Program;

impl Program {
    pub(crate) fn command(arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cortex-under-test"));
        command
            .args(arguments)
            .current_dir(root())
            .stdin(Stdio::null());
        command
    }

    pub(crate) fn run(arguments: &[&str]) -> Output {
        Self::command(arguments).output().unwrap()
    }
}

/// A `cortex run` that is about to start, in an instance and with a report folder of its own.
pub(crate) struct Run {
    instance: TestInstance,
    arguments: Vec<String>,
}

impl Run {
    pub(crate) fn new(test: &str, arguments: &[&str]) -> Self {
        let arguments = arguments.iter().map(|&a| a.to_owned()).collect();
        Self {
            instance: TestInstance::new(test),
            arguments,
        }
    }

    /// As [`Self::new`], in an instance that another run of this test used.
    pub(crate) fn on(instance: &str, arguments: &[&str]) -> Self {
        let arguments = arguments.iter().map(|&a| a.to_owned()).collect();
        Self {
            instance: TestInstance::named(instance),
            arguments,
        }
    }

    pub(crate) fn start(self) -> Started {
        let folder = tempfile::tempdir().unwrap();
        let report = folder.path().to_str().unwrap().to_owned();
        let mut arguments: Vec<&str> = vec!["run", "--instance", self.instance.name()];
        arguments.extend(["--report", &report]);
        arguments.extend(self.arguments.iter().map(String::as_str));
        let mut child = Program::command(&arguments)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let said = BufReader::new(child.stderr.take().unwrap());
        Started {
            child,
            said,
            heard: String::new(),
            folder,
            instance: self.instance,
        }
    }

    /// Runs it to its end, which must be a success; its report's folder.
    pub(crate) fn succeed(self) -> TempDir {
        self.start().succeed()
    }
}

/// A `cortex run` that has been started.
pub(crate) struct Started {
    child: Child,
    said: BufReader<ChildStderr>,
    heard: String,
    folder: TempDir,
    instance: TestInstance,
}

impl Started {
    pub(crate) fn instance_name(&self) -> &str {
        self.instance.name()
    }

    /// Waits until it says something that contains `words`.
    pub(crate) fn until(&mut self, words: &str) {
        let mut line = String::new();
        while !line.contains(words) {
            line.clear();
            assert!(
                self.said.read_line(&mut line).unwrap() > 0,
                "it ended without saying `{words}`; it said:\n{}\n{}",
                self.heard,
                self.logs()
            );
            self.heard.push_str(&line);
        }
    }

    fn logs(&self) -> String {
        let mut logs = String::new();
        for log in fs::read_dir(self.folder.path().join("logs"))
            .into_iter()
            .flatten()
        {
            let path = log.unwrap().path();
            let text = fs::read_to_string(&path).unwrap();
            let from = text.char_indices().rev().nth(2000).map_or(0, |(at, _)| at);
            let _ = write!(logs, "--- {}\n{}", path.display(), &text[from..]);
        }
        logs
    }

    /// The processes of its instance, but for itself: id and command line.
    pub(crate) fn processes(&self) -> Vec<(u32, String)> {
        processes_of(self.instance.name())
            .into_iter()
            .filter(|(id, _)| *id != self.child.id())
            .collect()
    }

    /// Kills the process of that name with signal 9.
    pub(crate) fn kill(&self, name: &str) {
        self.send(Signal::KILL, name);
    }

    /// Stops the process of that name where it is.
    pub(crate) fn stop(&self, name: &str) {
        self.send(Signal::STOP, name);
    }

    /// Lets it go on.
    pub(crate) fn resume(&self, name: &str) {
        self.send(Signal::CONT, name);
    }

    /// One that is just being started again is waited for.
    fn send(&self, what: Signal, name: &str) {
        let find = || {
            self.processes().into_iter().find(|(_, line)| {
                let words: Vec<&str> = line.split(' ').collect();
                words.get(1) == Some(&name) || words.get(2) == Some(&name)
            })
        };
        // Each look takes a millisecond or more.
        for _ in 0..10_000 {
            if let Some((id, _)) = find() {
                return signal(id, what);
            }
            std::thread::yield_now();
        }
        panic!("no process {name}: {:?}", self.processes());
    }

    pub(crate) fn kill_supervisor(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    pub(crate) fn interrupt(&self) {
        signal(self.child.id(), Signal::INT);
    }

    fn wait(&mut self) -> ExitStatus {
        self.said.read_to_string(&mut self.heard).unwrap();
        self.child.wait().unwrap()
    }

    pub(crate) fn exit_code(&mut self) -> i32 {
        let status = self.wait();
        status
            .code()
            .unwrap_or_else(|| panic!("{status}: {}", self.heard))
    }

    pub(crate) fn succeed(mut self) -> TempDir {
        let status = self.wait();
        assert!(
            status.success(),
            "{status}: {}\n{}",
            self.heard,
            self.logs()
        );
        self.assert_nothing_is_left();
        std::mem::replace(&mut self.folder, tempfile::tempdir().unwrap())
    }

    pub(crate) fn assert_nothing_is_left(&self) {
        assert_eq!(self.processes(), Vec::new());
        let memory = self.instance.0.shared_memory().unwrap();
        assert!(memory.is_empty(), "{memory:?}");
        assert!(!self.instance.0.folder().exists());
    }

    /// Waits until every process of the instance has ended by itself.
    pub(crate) fn wait_until_no_process_is_left(&mut self) {
        // Its processes hold the writing end of what it said: that ends with the last of them.
        self.said.read_to_string(&mut self.heard).unwrap();
        for (id, _) in self.processes() {
            let process = Pid::from_raw(id.cast_signed()).unwrap();
            // Not our child, so that it can only be asked about.
            while rustix::process::test_kill_process(process).is_ok() {
                std::thread::yield_now();
            }
        }
    }
}

impl Drop for Started {
    fn drop(&mut self) {
        // It may have ended already, which is as good.
        drop(self.child.kill());
        drop(self.child.wait());
        for (id, _) in self.processes() {
            signal(id, Signal::KILL);
        }
    }
}

fn signal(id: u32, signal: Signal) {
    if let Some(process) = Pid::from_raw(id.cast_signed()) {
        // It may have ended already, which is as good.
        let _ = kill_process(process, signal);
    }
}

/// Processes whose command line names the instance.
fn processes_of(instance: &str) -> Vec<(u32, String)> {
    let mut found = Vec::new();
    for entry in fs::read_dir("/proc").unwrap() {
        let name = entry.unwrap().file_name();
        let Some(id) = name.to_str().and_then(|name| name.parse::<u32>().ok()) else {
            continue;
        };
        // A process that ends meanwhile has no command line any more.
        let line = fs::read(format!("/proc/{id}/cmdline")).unwrap_or_default();
        let words: Vec<String> = line
            .split(|&b| b == 0)
            .map(|w| String::from_utf8_lossy(w).into_owned())
            .collect();
        let named = words
            .windows(2)
            .any(|w| w[0] == "--instance" && w[1] == instance);
        if named && id != std::process::id() {
            found.push((id, words.join(" ")));
        }
    }
    found
}
