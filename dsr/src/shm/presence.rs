//! Whether another process is still there. This file guarantees that a process that has ended is
//! never taken for a later one of the same number.

use crate::Refusal;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::process::{Pid, PidfdFlags, pidfd_open};
use std::collections::BTreeMap;

/// A process that was there once.
#[derive(Debug)]
pub(super) struct Presence {
    process: u32,
    handle: OwnedFd,
}

impl Presence {
    /// The process of that number, if there is one.
    pub(super) fn of(process: u32) -> Option<Self> {
        let id = Pid::from_raw(process.cast_signed())?;
        let handle = pidfd_open(id, PidfdFlags::empty()).ok()?;
        Some(Self { process, handle })
    }

    /// Whether it has ended.
    pub(super) fn has_ended(&self) -> bool {
        let mut ask = [PollFd::new(&self.handle, PollFlags::IN)];
        let at_once = Timespec {
            tv_sec: 0,
            tv_nsec: 0,
        };
        matches!(poll(&mut ask, Some(&at_once)), Ok(n) if n > 0)
    }
}

/// Which process goes by which agent's name.
#[derive(Debug, Default)]
pub(super) struct Names {
    holders: BTreeMap<String, Presence>,
}

impl Names {
    /// Gives the name to the process, unless another has it that is alive.
    pub(super) fn claim(&mut self, agent: &str, process: u32) -> Result<(), Refusal> {
        if let Some(holder) = self.holders.get(agent) {
            if holder.process == process {
                return Ok(());
            }
            if !holder.has_ended() {
                return Err(Refusal::NotAllowed(format!(
                    "agent `{agent}` is process {}, and only one process may be it at a time",
                    holder.process
                )));
            }
        }
        let Some(holder) = Presence::of(process) else {
            return Err(Refusal::NotAllowed(format!(
                "there is no process {process}, which asks as `{agent}`"
            )));
        };
        self.holders.insert(agent.to_owned(), holder);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::{Command, Stdio};

    #[test]
    fn a_name_is_one_processes_until_it_ends() {
        let mut other = Command::new("cat").stdin(Stdio::piped()).spawn().unwrap();
        let mut names = Names::default();
        let this = std::process::id();
        names.claim("driver", other.id()).unwrap();
        names.claim("driver", other.id()).unwrap();
        names.claim("watcher", this).unwrap();
        let refused = names.claim("driver", this).unwrap_err();
        assert!(matches!(refused, Refusal::NotAllowed(_)), "{refused}");
        other.kill().unwrap();
        // Ended, but for its parent's asking.
        let ended = |names: &Names| names.holders["driver"].has_ended();
        while !ended(&names) {
            std::thread::yield_now();
        }
        names.claim("driver", this).unwrap();
        other.wait().unwrap();
    }
}
