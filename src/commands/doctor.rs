//! `cortex doctor`: what on this host keeps instances from running well, and what to do about it.

use super::output::{print, print_json};
use crate::cli::Doctor as Arguments;
use crate::{Answer, Failure};
use dsr::Instance;
use serde_json::{Value, json};
use std::fs;

/// Where the graph lies.
const SHARED_MEMORY: &str = "/dev/shm";
/// The free shared memory, in bytes, that a run of a scenario goes well with.
const ENOUGH: u64 = 1 << 30;
/// Files that a process with many channels holds open.
const FILES: u64 = 1024;
/// The first kernel that makes pages when asked to, so that a full memory is a refusal.
const KERNEL: (u32, u32) = (5, 14);

/// Something that was looked at.
struct Finding {
    check: String,
    found: String,
    /// What to do, where something is wrong.
    mend: Option<String>,
}

impl Finding {
    fn new(check: &str, found: String, mend: Option<&str>) -> Self {
        Self {
            check: check.to_owned(),
            found,
            mend: mend.map(str::to_owned),
        }
    }

    fn to_json(&self) -> Value {
        json!({
            "check": self.check,
            "ok": self.mend.is_none(),
            "found": self.found,
            "mend": self.mend,
        })
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let mut findings = vec![shared_memory()?, open_files(), kernel()];
    findings.extend(runtime_folder()?);
    for instance in Instance::all().map_err(Failure::internal)? {
        findings.push(look_at(&instance, arguments.mend)?);
    }
    if arguments.json {
        print_json(&findings.iter().map(Finding::to_json).collect())?;
    } else {
        for finding in &findings {
            let state = if finding.mend.is_none() { "ok" } else { "--" };
            print(&format!("{state}  {}: {}\n", finding.check, finding.found))?;
            if let Some(mend) = &finding.mend {
                print(&format!("      {mend}\n"))?;
            }
        }
    }
    let well = findings.iter().all(|finding| finding.mend.is_none());
    Ok(if well { Answer::Yes } else { Answer::No })
}

fn shared_memory() -> Result<Finding, Failure> {
    let memory = rustix::fs::statvfs(SHARED_MEMORY).map_err(Failure::internal)?;
    let (free, all) = (
        memory.f_bavail * memory.f_frsize,
        memory.f_blocks * memory.f_frsize,
    );
    let found = format!(
        "{} of {} MiB free in {SHARED_MEMORY}",
        free >> 20,
        all >> 20
    );
    let mend = "free some, or make it larger: mount -o remount,size=2g /dev/shm";
    Ok(Finding::new(
        "shared memory",
        found,
        (free < ENOUGH).then_some(mend),
    ))
}

fn open_files() -> Finding {
    let limit = rustix::process::getrlimit(rustix::process::Resource::Nofile).current;
    let found = limit.map_or_else(
        || "no limit".to_owned(),
        |limit| format!("{limit} a process"),
    );
    let few = limit.is_some_and(|limit| limit < FILES);
    Finding::new(
        "open files",
        found,
        few.then_some("raise the limit: ulimit -n 4096"),
    )
}

fn kernel() -> Finding {
    let release = fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    let mut numbers = release
        .split(['.', '-'])
        .map_while(|part| part.parse().ok());
    let version = numbers.next().zip(numbers.next());
    let mend = "with Linux before 5.14, a full /dev/shm can end a process; keep some free";
    let old = version.is_none_or(|version| version < KERNEL);
    Finding::new(
        "kernel",
        format!("Linux {}", release.trim()),
        old.then_some(mend),
    )
}

/// Looks whether the folder of all instances is one that a store will use, if it is there.
fn runtime_folder() -> Result<Option<Finding>, Failure> {
    let any = Instance::new("any").map_err(Failure::input)?;
    let Some(folder) = any.folder().parent() else {
        return Ok(None);
    };
    if fs::symlink_metadata(folder).is_err() {
        return Ok(None);
    }
    let wrong = any.check_folder().is_err();
    let mend = "it must be a folder of yours with mode 700: remove it, or set CORTEX_RUNTIME_DIR";
    Ok(Some(Finding::new(
        "runtime folder",
        folder.display().to_string(),
        wrong.then_some(mend),
    )))
}

/// Looks at an instance, and, where that is wanted, mends what is wrong with it.
fn look_at(instance: &Instance, mend: bool) -> Result<Finding, Failure> {
    let check = format!("instance {}", instance.name());
    if mend {
        instance.close_to_others().map_err(Failure::input)?;
        if instance.remove_if_unused().map_err(Failure::input)? {
            return Ok(Finding::new(
                &check,
                "it was left over; removed".to_owned(),
                None,
            ));
        }
    }
    let processes = instance.processes().map_err(Failure::internal)?;
    let open = instance.open_to_others().map_err(Failure::internal)?;
    let orphaned = instance.orphaned().map_err(Failure::internal)?;
    let close = "cortex doctor --mend";
    let (found, mend) = match (open.first(), orphaned) {
        (Some(path), _) => (
            format!("other users can open {}", path.display()),
            Some(close),
        ),
        (None, Some(version)) => (
            format!("its store was killed and left version {version} of its graph"),
            Some(
                "cortex store goes on with it; where no process runs, cortex doctor --mend removes it",
            ),
        ),
        (None, None) if processes.is_empty() => (
            "no process of it runs; it was left over".to_owned(),
            Some(close),
        ),
        (None, None) => (format!("{} processes", processes.len()), None),
    };
    Ok(Finding::new(&check, found, mend))
}
