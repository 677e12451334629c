//! `cortex run`: a scenario from start to report.

use super::output;
use crate::cli::Run as Arguments;
use crate::conduct::{ConductError, Recording, Settings, conduct};
use crate::progress::Progress;
use crate::{Answer, Failure};
use executive::{Mission, MissionStep, StepStatus};
use scenarios::metrics::{Metrics, ObjectSpace, measure, object_spaces, shortest_way, spl};
use scenarios::picture::{Picture, Run, png};
use scenarios::report::{
    AgentReport, Baseline, FORMAT, MissionOutcome, MissionReport, Report, StepReport,
};
use scenarios::{Scenario, Tracks, Truth};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Pixels of map.png for each of map.svg.
const SCALE: f32 = 2.0;

/// What all runs of one command have in common.
struct Plan<'a> {
    arguments: &'a Arguments,
    scenario: &'a Scenario,
    folder: PathBuf,
    interrupted: &'a AtomicBool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    // Everything that can be wrong with the input is told before a process is started.
    let scenario = super::load_scenario(&arguments.scenario)?;
    let (schema, grammar) = super::load_rules(&scenario)?;
    crate::manifests::load(&scenario.folder, &schema)?;
    super::check_goals(&scenario, &grammar)?;
    if let Some(tracks) = &arguments.tracks {
        Tracks::load(tracks).map_err(|error| Failure::Input(error.into()))?;
    }
    if let Some(folder) = &arguments.state {
        super::store::check_state(folder, &scenario, schema)?;
    }
    if let Some(file) = &arguments.record {
        // The recorder writes on where there is something; this run begins anew.
        write(file, &[])?;
    }
    if let Some(address) = arguments.inspect {
        std::net::TcpListener::bind(address)
            .map_err(|error| Failure::input(format!("cannot listen on {address}: {error}")))?;
    }
    let spaces = object_spaces(&scenario, &scenario.social).map_err(Failure::input)?;
    let folder = arguments
        .report
        .clone()
        .unwrap_or_else(|| Path::new("reports").join(&scenario.name));
    let interrupted = super::interruption()?;
    let plan = Plan {
        arguments,
        scenario: &scenario,
        folder,
        interrupted: &interrupted,
    };
    let social = !arguments.no_social;
    let Some(recording) = plan.conduct(social, false)? else {
        return Ok(Answer::No);
    };
    let baseline = if social && !arguments.no_baseline {
        let Some(baseline) = plan.conduct(false, true)? else {
            return Ok(Answer::No);
        };
        Some(baseline)
    } else {
        None
    };
    plan.report(&recording, baseline.as_ref(), &spaces)?;
    Ok(if recording.succeeded() {
        Answer::Yes
    } else {
        Answer::No
    })
}

impl Plan<'_> {
    /// One run; `None` where the user interrupted it. The comparison without social behaviour goes
    /// in lockstep: it costs seconds, and what it shows does not hang on how busy the machine is.
    fn conduct(&self, social: bool, baseline: bool) -> Result<Option<Recording>, Failure> {
        let arguments = self.arguments;
        let name = &arguments.instance.instance;
        let (instance, logs, title) = if baseline {
            let title = format!("{} without social behaviour", self.scenario.name);
            (
                super::instance(&format!("{name}-baseline"))?,
                "logs-baseline",
                title,
            )
        } else {
            (super::instance(name)?, "logs", self.scenario.name.clone())
        };
        let logs = self.folder.join(logs);
        fresh_folder(&logs)?;
        let settings = Settings {
            instance,
            scenario: self.scenario,
            social,
            seed: arguments.seed,
            speed: arguments.speed,
            lockstep: arguments.lockstep || baseline,
            tracks: arguments.tracks.as_deref(),
            // What is remembered is of the run that counts.
            state: arguments
                .state
                .as_deref()
                .filter(|_| !baseline)
                .map(|folder| (folder, arguments.durable)),
            record: arguments.record.as_deref().filter(|_| !baseline),
            inspect: arguments.inspect.filter(|_| !baseline),
            logs,
        };
        let mut progress = Progress::new(&title, arguments.json);
        let recording = conduct(&settings, self.interrupted, &mut progress);
        let recording = recording.map_err(|error| match error {
            ConductError::Hold(_) => Failure::input(error),
            error => Failure::internal(error),
        })?;
        if recording.is_none() {
            progress.say("interrupted: every process has ended, nothing is reported");
        }
        Ok(recording)
    }

    fn report(
        &self,
        recording: &Recording,
        baseline: Option<&Recording>,
        spaces: &[ObjectSpace],
    ) -> Result<(), Failure> {
        let arguments = self.arguments;
        let radius = self.scenario.robot.radius;
        let measured = |recording: &Recording| measure(&recording.truths, radius, spaces);
        let metrics = measured(recording);
        let other = baseline.map(|other| (other, measured(other)));
        let picture = self.picture(recording, &metrics, other.as_ref(), spaces);
        let mission = MissionReport::of(recording.missions.iter().map(mission).collect());
        let shortest = |recording: &Recording| {
            let place = |truth: &Truth| truth.world_from_robot.translation.vector.into();
            let (first, last) = (recording.truths.first()?, recording.truths.last()?);
            shortest_way(self.scenario, place(first), place(last))
        };
        let weighted = |recording: &Recording, metrics: &Metrics| {
            let walked = metrics.robot.as_ref()?.path_length;
            Some(spl(recording.succeeded(), shortest(recording)?, walked))
        };
        let report = Report {
            format: FORMAT,
            scenario: self.scenario.name.clone(),
            seed: arguments.seed,
            social: !arguments.no_social,
            base: self.scenario.robot.base.name(),
            success: recording.succeeded(),
            timed_out: mission.as_ref().is_some_and(MissionReport::timed_out),
            shortest_path: shortest(recording),
            spl: weighted(recording, &metrics),
            mission,
            metrics,
            plan: plan(&recording.missions),
            replans: recording
                .missions
                .iter()
                .map(|mission| mission.replans)
                .sum(),
            agents: recording
                .accounts
                .iter()
                .map(|account| AgentReport {
                    name: account.name.clone(),
                    restarts: account.restarts,
                    cpu_seconds: (!arguments.lockstep).then_some(account.cpu_seconds),
                })
                .collect(),
            baseline: other.map(|(other, metrics)| Baseline {
                success: other.succeeded(),
                spl: weighted(other, &metrics),
                metrics,
            }),
        };
        let json = report.to_json().map_err(Failure::internal)?;
        write(&self.folder.join("report.json"), json.as_bytes())?;
        write(&self.folder.join("map.svg"), picture.as_bytes())?;
        let pixels = png(&picture, SCALE).map_err(Failure::internal)?;
        write(&self.folder.join("map.png"), &pixels)?;
        if arguments.json {
            return output::print(&json);
        }
        let folder = self.folder.display();
        output::print(&format!(
            "{}\nreport.json, map.svg and map.png are in {folder}\n",
            report.table()
        ))
    }

    fn picture(
        &self,
        recording: &Recording,
        metrics: &Metrics,
        baseline: Option<&(&Recording, Metrics)>,
        spaces: &[ObjectSpace],
    ) -> String {
        let social = !self.arguments.no_social;
        let baseline = baseline.map(|(other, metrics)| Run {
            social: false,
            success: other.succeeded(),
            samples: &other.truths,
            metrics,
        });
        let success = recording.succeeded();
        let run = Run {
            social,
            success,
            samples: &recording.truths,
            metrics,
        };
        let seed = self.arguments.seed;
        Picture {
            scenario: self.scenario,
            spaces,
            seed,
            run,
            baseline,
            at: None,
        }
        .svg()
    }
}

fn mission(mission: &Mission) -> MissionOutcome {
    let reason = (!mission.reason.is_empty()).then(|| mission.reason.clone());
    MissionOutcome {
        name: mission.name.clone(),
        goal: mission.goal.clone(),
        status: mission.status.name().to_owned(),
        reason,
    }
}

/// The steps of all missions in the order in which they were planned; those of plans that were given
/// up before they began are left out.
fn plan(missions: &[Mission]) -> Vec<StepReport> {
    let mut steps: Vec<_> = missions
        .iter()
        .flat_map(|mission| mission.steps.iter().map(move |step| (mission, step)))
        .filter(|(_, step)| step.status != StepStatus::Dropped)
        .collect();
    steps.sort_by_key(|(_, step)| step.id);
    let report = |(mission, step): (&Mission, &MissionStep)| StepReport {
        mission: mission.name.clone(),
        rule: step.rule.clone(),
        binding: step.binding.clone(),
        status: step.status.name().to_owned(),
    };
    steps.into_iter().map(report).collect()
}

/// Makes a folder, and takes out what an earlier run left in it.
fn fresh_folder(folder: &Path) -> Result<(), Failure> {
    let failed = |error| Failure::input(format!("cannot write to {}: {error}", folder.display()));
    if let Err(error) = std::fs::remove_dir_all(folder)
        && error.kind() != std::io::ErrorKind::NotFound
    {
        return Err(failed(error));
    }
    std::fs::create_dir_all(folder).map_err(failed)
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    std::fs::write(path, bytes)
        .map_err(|error| Failure::input(format!("cannot write {}: {error}", path.display())))
}
