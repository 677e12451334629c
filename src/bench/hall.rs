//! The instance in which is measured, and the processes in it. It guarantees that none of them is left.

use crate::Failure;
use dsr::{Instance, Session};
use rustix::process::{Pid, Signal};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};

/// An instance of its own.
#[derive(Debug)]
pub(super) struct Hall {
    instance: Instance,
}

/// A process of the program in one of the roles of `peer`.
#[derive(Debug)]
pub(super) struct Peer {
    role: String,
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Hall {
    pub(super) fn open() -> Result<Self, Failure> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("bench-{}-{count}", std::process::id());
        let instance = Instance::new(&name).map_err(Failure::internal)?;
        Ok(Self { instance })
    }

    pub(super) fn name(&self) -> &str {
        self.instance.name()
    }

    pub(super) fn instance(&self) -> &Instance {
        &self.instance
    }

    pub(super) fn processes(&self) -> Result<Vec<u32>, Failure> {
        self.instance.processes().map_err(Failure::internal)
    }

    pub(super) fn session(&self, agent: &str) -> Result<Session, Failure> {
        Session::attach(&self.instance, agent, super::PATIENCE).map_err(Failure::internal)
    }

    /// A store of a graph of that many nodes, which polls.
    pub(super) fn store(&self, nodes: u64) -> Result<Peer, Failure> {
        self.ready("store", &[nodes, 2000])
    }

    /// The same, which sleeps when it has nothing to do.
    pub(super) fn sleeping_store(&self, nodes: u64) -> Result<Peer, Failure> {
        self.ready("store", &[nodes, 0])
    }

    /// Starts a peer and waits until it has joined.
    pub(super) fn ready(&self, role: &str, numbers: &[u64]) -> Result<Peer, Failure> {
        let mut peer = self.start(role, numbers)?;
        match peer.line()?.as_str() {
            "ready" => Ok(peer),
            other => Err(Failure::internal(format!("the {role} said `{other}`"))),
        }
    }

    /// Starts a peer.
    pub(super) fn start(&self, role: &str, numbers: &[u64]) -> Result<Peer, Failure> {
        let program = std::env::current_exe().map_err(Failure::internal)?;
        let mut child = Command::new(program)
            .args(["bench-peer", role, self.instance.name()])
            .args(numbers.iter().map(ToString::to_string))
            // What a peer logs is no part of the figures.
            .env("RUST_LOG", "warn")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(Failure::internal)?;
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let output = output.ok_or_else(|| Failure::internal("a peer without output"))?;
        Ok(Peer {
            role: role.to_owned(),
            child,
            input,
            output: BufReader::new(output),
        })
    }
}

impl Drop for Hall {
    fn drop(&mut self) {
        // What cannot be removed is told by the next start in its place; there is none here.
        if let Err(error) = self.instance.remove() {
            tracing::warn!("{error}");
        }
    }
}

impl Peer {
    /// Tells it to go on.
    pub(super) fn go(&mut self) -> Result<(), Failure> {
        let input = self.input.as_mut();
        let input = input.ok_or_else(|| Failure::internal("a peer without input"))?;
        input.write_all(b"go\n").map_err(Failure::internal)
    }

    /// The next line that it says.
    pub(super) fn line(&mut self) -> Result<String, Failure> {
        let mut line = String::new();
        let read = self.output.read_line(&mut line);
        match read.map_err(Failure::internal)? {
            0 => Err(Failure::internal(format!("the {} ended early", self.role))),
            _ => Ok(line.trim_end().to_owned()),
        }
    }

    /// The numbers of the next line that it says.
    pub(super) fn numbers<const N: usize>(&mut self) -> Result<[u64; N], Failure> {
        let line = self.line()?;
        let numbers: Vec<u64> = line
            .split(' ')
            .filter_map(|word| word.parse().ok())
            .collect();
        numbers
            .try_into()
            .map_err(|_| Failure::internal(format!("the {} said `{line}`", self.role)))
    }

    /// Stops it where it is.
    pub(super) fn stop(&self) -> Result<(), Failure> {
        let process = Pid::from_child(&self.child);
        rustix::process::kill_process(process, Signal::STOP).map_err(Failure::internal)
    }

    /// Ends its input, and waits for its end.
    pub(super) fn end(mut self) -> Result<(), Failure> {
        drop(self.input.take());
        let status = self.child.wait().map_err(Failure::internal)?;
        if status.success() {
            Ok(())
        } else {
            Err(Failure::internal(format!(
                "the {} failed: {status}",
                self.role
            )))
        }
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It may have ended already, which is as good.
        drop(self.child.kill());
        drop(self.child.wait());
    }
}
