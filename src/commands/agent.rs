//! `cortex agent`: one agent, or the world, as a process of its own.

use crate::cli::Agent as Arguments;
use crate::{Answer, Failure};
use dsr::{AttachError, Begin, Instance, Pace, Session, Turns};
use scenarios::{Scenario, Tracks, World};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How long an agent waits for the store when it starts.
const PATIENCE: Duration = Duration::from_secs(20);

/// How often it looks whether it shall end while it waits.
const LOOK: Duration = Duration::from_millis(100);

/// The agents, in the order of their turns.
pub(crate) const AGENTS: [&str; 5] = [
    "human_observer",
    "object_recognition",
    "social_mapping",
    "navigation",
    "executive",
];

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let instance = super::instance(&arguments.instance.instance)?;
    let name = arguments.name.as_str();
    let known = || AGENTS.into_iter().chain(["world"]);
    if !known().any(|known| known == name) {
        let help = dsr::suggest(name, known()).map_or_else(
            || format!("one of {}", known().collect::<Vec<_>>().join(", ")),
            |known| format!("did you mean `{known}`?"),
        );
        return Err(Failure::input_with_help(
            format!("there is no agent `{name}`"),
            help,
        ));
    }
    let pace = match (arguments.lockstep, arguments.supervised) {
        (true, _) => Pace::Lockstep,
        (false, true) => Pace::Free,
        (false, false) => Pace::Alone,
    };
    let taken_part = take_part(arguments, &instance, pace);
    if pace == Pace::Alone {
        instance.leave().map_err(Failure::internal)?;
    }
    taken_part.map(|()| Answer::Yes)
}

/// Joins and takes turns until it shall end.
fn take_part(arguments: &Arguments, instance: &Instance, pace: Pace) -> Result<(), Failure> {
    let name = arguments.name.as_str();
    let scenario = || -> Result<Scenario, Failure> {
        let folder = arguments.scenario.as_ref().ok_or_else(|| {
            Failure::input_with_help(format!("{name} needs a scenario"), "add --scenario DIR")
        })?;
        super::load_scenario(folder)
    };
    let stop = super::interruption()?;
    let attach = {
        let stop = Arc::clone(&stop);
        move || attach(instance, name, &stop)
    };
    let begin: Begin = Box::new(move || Turns::begin(pace, stop));
    // Input is read before anything is joined, so that what is wrong with it is told at once.
    match name {
        "world" => {
            let mut scenario = scenario()?;
            let tracks = arguments.tracks.as_deref().map(Tracks::load).transpose();
            let tracks = tracks.map_err(|error| Failure::Input(error.into()))?;
            let Some(mut session) = attach()? else {
                return Ok(());
            };
            // A graph that an earlier run left is further on, and time does not run back.
            let saved = session.snapshot().map_err(Failure::internal)?.time();
            scenario.start = scenario.start.max(saved);
            let world = World::new(&scenario, arguments.seed, tracks);
            scenarios::process::run(session, begin, world, arguments.speed)
                .map_err(Failure::internal)
        }
        "executive" => {
            let scenario = scenario()?;
            let (_, grammar) = super::load_rules(&scenario)?;
            let missions = scenario
                .missions
                .iter()
                .map(|one| super::mission::spec(one, scenario.start))
                .collect();
            let Some(session) = attach()? else {
                return Ok(());
            };
            executive::process::run(session, begin, grammar, missions).map_err(Failure::internal)
        }
        _ => {
            let Some(session) = attach()? else {
                return Ok(());
            };
            let run = match name {
                "human_observer" => agents::process::human_observer,
                "object_recognition" => agents::process::object_recognition,
                "social_mapping" => agents::process::social_mapping,
                _ => agents::process::navigation,
            };
            run(session, begin).map_err(Failure::internal)
        }
    }
}

/// Joins the instance and waits for its store; `None` where the user ended it meanwhile.
fn attach(instance: &Instance, name: &str, stop: &AtomicBool) -> Result<Option<Session>, Failure> {
    let mut session = Session::join(instance, name).map_err(Failure::internal)?;
    let mut patience = PATIENCE;
    loop {
        match session.wait_for_store(LOOK) {
            Ok(()) => return Ok(Some(session)),
            Err(AttachError::NoStore { .. }) if patience > LOOK => patience -= LOOK,
            Err(error) => return Err(Failure::internal(error)),
        }
        if stop.load(Ordering::Acquire) {
            return Ok(None);
        }
    }
}
