//! `cortex run`: a scenario from start to report.

use crate::cli::Run as Arguments;
use crate::conduct::{Settings, conduct};
use crate::progress::Progress;
use crate::{Answer, Failure};

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let scenario = super::load_scenario(&arguments.scenario)?;
    super::load_rules(&scenario)?;
    let instance = super::instance(&arguments.instance.instance)?;
    let interrupted = super::interruption()?;
    let folder = arguments.report.clone().unwrap_or_else(|| "reports/x".into());
    let logs = folder.join("logs");
    std::fs::create_dir_all(&logs).map_err(Failure::input)?;
    let mut progress = Progress::new(&scenario.name, false);
    let settings = Settings {
        instance,
        scenario: &scenario,
        social: !arguments.no_social,
        seed: arguments.seed,
        speed: arguments.speed,
        lockstep: arguments.lockstep,
        tracks: arguments.tracks.as_deref(),
        logs,
    };
    let recording = conduct(&settings, &interrupted, &mut progress).map_err(Failure::internal)?;
    let Some(recording) = recording else { return Ok(Answer::No) };
    eprintln!("{:?} {:?} {:?}", recording.missions, recording.steps, recording.accounts);
    Ok(if recording.succeeded() { Answer::Yes } else { Answer::No })
}
