//! From a person's step in the world to the velocity that takes account of it, on a running system: store,
//! world and agents are processes of their own, at the speed of the clock. It guarantees that a command
//! counts only where its turn began after the step was in the graph.

use super::super::PATIENCE;
use super::super::figure::Figure;
use super::super::hall::Hall;
use crate::Failure;
use agents::messages::{CameraFrame, DETECTIONS, VELOCITY, VelocityCommand};
use dsr::{Filter, Session, Time, Update};
use scenarios::Truth;
use scenarios::process::TRUTH;
use std::collections::VecDeque;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const SCENARIO: &str = include_str!("reaction/scenario.toml");
const RULES: &str = include_str!("reaction/rules.aggl");
const GOAL: &str = include_str!("reaction/east.aggt");
/// What is called for, ms.
const BAR: f64 = 100.0;
/// The first seconds, in which processes start and nobody is known yet, are left out.
const START: Duration = Duration::from_secs(3);

/// The scenario's folder, and the run that goes on in it; neither outlives this.
struct Running {
    folder: PathBuf,
    child: Child,
}

impl Running {
    fn start(instance: &str) -> Result<Self, Failure> {
        let folder = std::env::temp_dir().join(format!("cortex-{instance}"));
        let write = |name: &str, text: &str| {
            std::fs::write(folder.join(name), text).map_err(Failure::internal)
        };
        std::fs::create_dir_all(&folder).map_err(Failure::internal)?;
        write("scenario.toml", SCENARIO)?;
        write("rules.aggl", RULES)?;
        write("east.aggt", GOAL)?;
        let program = std::env::current_exe().map_err(Failure::internal)?;
        let child = Command::new(program)
            .arg("run")
            .arg(&folder)
            .args(["--no-baseline", "--instance", instance, "--report"])
            .arg(folder.join("report"))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .map_err(Failure::internal)?;
        Ok(Self { folder, child })
    }

    fn goes_on(&mut self) -> Result<bool, Failure> {
        let ended = self.child.try_wait().map_err(Failure::internal)?;
        Ok(ended.is_none())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended already, which is as good.
        drop(self.child.kill());
        drop(self.child.wait());
        drop(std::fs::remove_dir_all(&self.folder));
    }
}

/// An image on its way to a command.
struct Step {
    imaged: Time,
    sent: Instant,
    /// The tick at which it was in the graph.
    known: Option<Time>,
}

/// Follows every image that shows people to the first command that takes account of it; milliseconds.
fn follow(session: &mut Session, running: &mut Running) -> Result<Vec<f64>, Failure> {
    let mut frames = session
        .subscriber::<CameraFrame>(DETECTIONS)
        .map_err(Failure::internal)?;
    let mut commands = session
        .subscriber::<VelocityCommand>(VELOCITY)
        .map_err(Failure::internal)?;
    let mut truths = session
        .subscriber::<Truth>(TRUTH)
        .map_err(Failure::internal)?;
    let mut changes = session
        .changes(Filter::default())
        .map_err(Failure::internal)?;
    let schema = session
        .snapshot()
        .map_err(Failure::internal)?
        .schema()
        .clone();
    let (began, mut tick) = (Instant::now(), Time::default());
    let mut waiting: VecDeque<Step> = VecDeque::new();
    let mut samples = Vec::new();
    while running.goes_on()? {
        for frame in frames.drain().map_err(Failure::internal)? {
            let newer = waiting.back().is_none_or(|last| last.imaged < frame.time);
            if newer && !frame.people.is_empty() {
                waiting.push_back(Step {
                    imaged: frame.time,
                    sent: Instant::now(),
                    known: None,
                });
            }
        }
        if let Some(truth) = truths.newest().map_err(Failure::internal)? {
            tick = truth.time;
        }
        while let Some(update) = changes.next(&schema).map_err(Failure::internal)? {
            if let Update::Change(change) = update
                && change.agent == "human_observer"
            {
                let shown = waiting.iter_mut().filter(|step| step.imaged <= change.time);
                shown.for_each(|step| step.known = step.known.or(Some(tick)));
            }
        }
        for command in commands.drain().map_err(Failure::internal)? {
            let counts = |step: &Step| step.known.is_some_and(|known| command.time > known);
            while waiting.front().is_some_and(counts) {
                let Some(step) = waiting.pop_front() else {
                    break;
                };
                if began.elapsed() > START {
                    samples.push(step.sent.elapsed().as_secs_f64() * 1e3);
                }
            }
        }
        std::thread::sleep(Duration::from_micros(200));
    }
    Ok(samples)
}

/// The middle one and the slowest hundredth.
pub(super) fn reaction(figures: &mut Vec<Figure>) -> Result<(), Failure> {
    let hall = Hall::open()?;
    let mut running = Running::start(hall.name())?;
    // A run begins only where nobody is yet.
    let began = Instant::now();
    while hall.processes()?.is_empty() && running.goes_on()? && began.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(10));
    }
    let mut session = hall.session("reaction")?;
    let mut samples = follow(&mut session, &mut running)?;
    drop((session, running, hall));
    if samples.is_empty() {
        return Err(Failure::internal("no command followed a person's step"));
    }
    samples.sort_by(f64::total_cmp);
    let share = |part: usize| samples[(samples.len() * part / 100).min(samples.len() - 1)];
    for (name, part) in [("reaction", 50), ("reaction_99_percent", 99)] {
        figures.push(Figure {
            name,
            value: share(part),
            unit: "ms",
            raw: Some(BAR),
            peer: format!("what is called for; {} images", samples.len()),
        });
    }
    Ok(())
}
