//! The peers: a matcher and a database, in a program of their own, so that what they are made of
//! is no part of this one. A peer that takes too long is ended, and its time is a lower bound.

use crate::Failure;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// What a peer found of one pattern.
#[derive(Debug, Clone, Copy)]
pub(super) struct PeerFound {
    /// Seconds for all matches; where it was ended, for as long as it was left.
    pub(super) seconds: f64,
    /// `None` where it was ended.
    pub(super) count: Option<u64>,
}

/// How long a peer may take for one pattern.
const LIMIT: Duration = Duration::from_secs(20);

/// The peers' program.
pub(super) struct Peers(PathBuf);

impl Peers {
    /// Finds the program beside this one, or builds it in the workspace that this one was built
    /// from; `None` where neither is possible.
    pub(super) fn find() -> Option<Self> {
        let beside = std::env::current_exe().ok()?.with_file_name("cortex-peers");
        if !beside.is_file() {
            let workspace = Path::new(env!("CARGO_MANIFEST_DIR"));
            let release = beside.parent()?.file_name()? == "release";
            let built = Command::new("cargo")
                .args(["build", "--quiet", "--package", "peers", "--target-dir"])
                .arg(beside.parent()?.parent()?)
                .args(release.then_some("--release"))
                .current_dir(workspace)
                .stdin(Stdio::null())
                .status();
            built.ok().filter(std::process::ExitStatus::success)?;
        }
        beside.is_file().then_some(Self(beside))
    }

    /// All matches of `pattern` in the world of a file, by `engine`: `vf2`, `sqlite` or `sqlite_tuned`.
    pub(super) fn all(
        &self,
        engine: &str,
        world: &Path,
        pattern: &str,
    ) -> Result<PeerFound, Failure> {
        let mut child = Command::new(&self.0)
            .arg(engine)
            .arg(world)
            .arg(pattern)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(Failure::internal)?;
        let started = Instant::now();
        while child.try_wait().map_err(Failure::internal)?.is_none() {
            if started.elapsed() > LIMIT {
                child.kill().map_err(Failure::internal)?;
                child.wait().map_err(Failure::internal)?;
                return Ok(PeerFound {
                    seconds: LIMIT.as_secs_f64(),
                    count: None,
                });
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let output = child.wait_with_output().map_err(Failure::internal)?;
        let text = String::from_utf8_lossy(&output.stdout);
        let mut words = text.split_whitespace();
        let seconds = words.next().and_then(|word| word.parse().ok());
        let count = words.next().and_then(|word| word.parse().ok());
        match (seconds, count) {
            (Some(seconds), Some(count)) if output.status.success() => Ok(PeerFound {
                seconds,
                count: Some(count),
            }),
            _ => Err(Failure::internal(format!(
                "the peer {engine} said nothing of use"
            ))),
        }
    }
}
