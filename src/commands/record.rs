//! `cortex record`: the process that writes a recording of an instance.

use super::output::tell;
use crate::cli::Record as Arguments;
use crate::recording::{Recorder, follow};
use crate::{Answer, Failure};
use dsr::{Pace, Session, Turns};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The name that the recorder goes by.
pub(crate) const RECORDER: &str = "recorder";
/// How long to wait for an instance that may be starting.
const PATIENCE: Duration = Duration::from_secs(20);

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let instance = super::instance(&arguments.instance.instance)?;
    let pace = match (arguments.lockstep, arguments.supervised) {
        (true, _) => Pace::Lockstep,
        (false, true) => Pace::Free,
        (false, false) => Pace::Alone,
    };
    if pace == Pace::Alone && !instance.exists() {
        return Err(super::not_running(instance.name()));
    }
    let stop = super::interruption()?;
    let file = free_name(&arguments.file);
    if file != arguments.file {
        let (taken, file) = (arguments.file.display(), file.display());
        tell(&format!(
            "{taken} is there already; this goes into {file}\n"
        ));
    }
    let session = Session::attach(&instance, RECORDER, PATIENCE).map_err(Failure::internal)?;
    let recorder = Recorder::begin(session, &file).map_err(Failure::internal)?;
    let turns = Turns::begin(pace, stop).map_err(Failure::internal)?;
    follow(recorder, turns).map_err(Failure::internal)?;
    Ok(Answer::Yes)
}

/// The name itself where there is no such file or it is empty, else the first of `run-2.mcap`, `run-3.mcap`
/// and so on that is free: a recorder that is started again goes on beside what it had written.
fn free_name(path: &Path) -> PathBuf {
    let taken = |path: &Path| std::fs::metadata(path).is_ok_and(|found| found.len() > 0);
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let ending = path
        .extension()
        .map(|e| format!(".{}", e.to_string_lossy()));
    let name = |count: usize| match count {
        1 => path.to_owned(),
        _ => path.with_file_name(format!("{stem}-{count}{}", ending.as_deref().unwrap_or(""))),
    };
    (1..=9999)
        .map(name)
        .find(|path| !taken(path))
        .unwrap_or_else(|| path.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_that_is_there_is_never_written_over() {
        let folder = std::env::temp_dir().join(format!("cortex-names-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = |name: &str| folder.join(name);
        assert_eq!(free_name(&file("run.mcap")), file("run.mcap"));
        std::fs::write(file("run.mcap"), "x").unwrap();
        assert_eq!(free_name(&file("run.mcap")), file("run-2.mcap"));
        std::fs::write(file("run-2.mcap"), "x").unwrap();
        assert_eq!(free_name(&file("run.mcap")), file("run-3.mcap"));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
