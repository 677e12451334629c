//! The peers: a matcher and a database, in a program of their own, so that what they are made of
//! is no part of this one. A peer that takes too long is ended, and its time is a lower bound.

use crate::Failure;
use crate::commands::output::tell;
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

/// What it is called.
const PROGRAM: &str = "cortex-peers";

/// The peers' program.
pub(super) struct Peers(PathBuf);

/// The folder of target files that cargo made for this program, if it is still there: one that it marked.
fn target_folder(this: &Path) -> Option<&Path> {
    let folder = this.parent()?.parent()?;
    folder.join("CACHEDIR.TAG").is_file().then_some(folder)
}

/// Builds the program in the workspace that this one was built from, as this one was built, and beside it where that is
/// a folder of target files. Gives the path, or why there is none.
fn build(this: &Path) -> Result<PathBuf, String> {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR"));
    if !sources.join("peers").is_dir() {
        let sources = sources.display();
        return Err(format!(
            "the sources that this program is of, {sources}, are not there"
        ));
    }
    let mut cargo = Command::new("cargo");
    cargo
        .args(["build", "--quiet", "--package", "peers"])
        .arg("--message-format=json-render-diagnostics")
        .args((!cfg!(debug_assertions)).then_some("--release"))
        .current_dir(sources)
        .stdin(Stdio::null())
        .stderr(Stdio::inherit());
    if let Some(folder) = target_folder(this) {
        cargo.arg("--target-dir").arg(folder);
    }
    let output = cargo.output();
    let output = output.map_err(|error| format!("cargo cannot be started: {error}"))?;
    if !output.status.success() {
        return Err(format!("cargo ended with {}", output.status));
    }
    let told = String::from_utf8_lossy(&output.stdout);
    let built = told.lines().rev().find_map(|line| {
        let message: serde_json::Value = serde_json::from_str(line).ok()?;
        let is_it = message["target"]["name"] == PROGRAM;
        is_it.then(|| message["executable"].as_str().map(PathBuf::from))?
    });
    built.ok_or_else(|| "cargo did not say where it is".to_owned())
}

impl Peers {
    /// Finds the program beside this one, or builds it in the workspace that this one was built from.
    pub(super) fn find() -> Result<Self, Failure> {
        let this = std::env::current_exe().map_err(Failure::internal)?;
        let beside = this.with_file_name(PROGRAM);
        if beside.is_file() {
            return Ok(Self(beside));
        }
        tell(&format!(
            "building {PROGRAM}, which rules are measured beside\n"
        ));
        let why = match build(&this) {
            Ok(built) => return Ok(Self(built)),
            Err(why) => why,
        };
        let what = format!(
            "the program that rules are measured beside, {}, is not there and could not be built: {why}",
            beside.display()
        );
        let help = "`cargo build --release --workspace` where Cortex's sources are builds both, and `cargo install \
                    --path peers` puts it beside an installed `cortex`";
        Err(Failure::input_with_help(what, help))
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
