//! `cortex mission`: the missions of a running instance. It writes what somebody wants into the graph;
//! the executive, which looks there, does it or says why not.

mod submit;

pub(crate) use submit::{check_goal, spec};

use super::graph::attach;
use super::output::{clock, print, print_json};
use crate::cli::{Mission as Arguments, MissionAction};
use crate::{Answer, Failure};
use dsr::{CommitError, Filter, Precondition, Session, Snapshot, Time, Transaction};
use executive::{Mission, MissionStatus, Request};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// How often a wait looks whether it was interrupted.
const LOOK: Duration = Duration::from_millis(100);

/// How long the executive may take to answer a request.
const PATIENCE: Duration = Duration::from_secs(5);

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let mut session = attach(&arguments.instance)?;
    match &arguments.action {
        MissionAction::List => list(&mut session, arguments.json),
        MissionAction::Show { name } => show(&mut session, name, arguments.json),
        MissionAction::Submit(submit) => submit::run(&mut session, submit, arguments.json),
        MissionAction::Cancel { name } => ask(&mut session, name, Request::Cancel),
        MissionAction::Pause { name } => ask(&mut session, name, Request::Pause),
        MissionAction::Resume { name } => ask(&mut session, name, Request::Resume),
    }
}

fn read(session: &mut Session) -> Result<(Snapshot, Vec<Mission>), Failure> {
    let snapshot = session.snapshot().map_err(Failure::internal)?;
    let missions = executive::missions_with_steps(&snapshot).map_err(Failure::internal)?;
    Ok((snapshot, missions))
}

/// The mission of that name among those there are.
fn find<'m>(missions: &'m [Mission], name: &str) -> Result<&'m Mission, Failure> {
    let names: Vec<&str> = missions.iter().map(|m| m.name.as_str()).collect();
    let found = missions.iter().find(|mission| mission.name == name);
    found.ok_or_else(|| {
        let help = match dsr::suggest(name, names.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None if names.is_empty() => "there are no missions".to_owned(),
            None => format!("there are: {}", names.join(", ")),
        };
        Failure::input_with_help(format!("there is no mission `{name}`"), help)
    })
}

/// As JSON, `all` being the missions there are.
fn as_json(mission: &Mission, now: Time, all: &[Mission]) -> Value {
    json!({
        "name": mission.name,
        "status": mission.status.name(),
        "priority": mission.priority,
        "deadline": mission.deadline.map(|deadline| deadline.since(now)),
        "begins": mission.schedule.begins.map(|begins| begins.since(now)),
        "period": mission.schedule.period,
        "after": mission.schedule.after,
        "preemption": mission.preemption.name(),
        "waits_for": mission.waits_for(now, all, clock),
        "request": mission.request,
        "replans": mission.replans,
        "reason": mission.reason,
        "goal": mission.goal,
    })
}

fn list(session: &mut Session, machine: bool) -> Result<Answer, Failure> {
    let (snapshot, missions) = read(session)?;
    let now = snapshot.time();
    if machine {
        let missions: Vec<Value> = missions
            .iter()
            .map(|one| as_json(one, now, &missions))
            .collect();
        print_json(&json!(missions))?;
        return Ok(Answer::Yes);
    }
    let width = missions.iter().map(|m| m.name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for mission in &missions {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{}", line(mission, now, &missions, width));
    }
    if missions.is_empty() {
        text.push_str("no missions\n");
    }
    print(&text)?;
    Ok(Answer::Yes)
}

/// A line about a mission, `all` being the missions there are.
fn line(mission: &Mission, now: Time, all: &[Mission], width: usize) -> String {
    let mut line = format!(
        "{:width$}  {:9}  priority {}",
        mission.name,
        mission.status.name(),
        mission.priority
    );
    let schedule = &mission.schedule;
    if let Some(period) = schedule.period.filter(|_| mission.can_be_cancelled()) {
        let _ = write!(line, "  every {period:.0} s");
    }
    for waits in mission.waits_for(now, all, clock) {
        let _ = write!(line, "  waits {waits}");
    }
    if let Some(deadline) = mission.deadline
        && !mission.status.is_over()
    {
        let left = deadline.since(now).max(0.0);
        let _ = write!(line, "  {left:.0} s left, until {}", clock(deadline));
    }
    if !mission.reason.is_empty() {
        let _ = write!(line, "  {}", mission.reason);
    }
    line
}

fn show(session: &mut Session, name: &str, machine: bool) -> Result<Answer, Failure> {
    let (snapshot, missions) = read(session)?;
    let mission = find(&missions, name)?;
    if machine {
        let mut shown = as_json(mission, snapshot.time(), &missions);
        let steps = mission.steps.iter().map(|step| {
            json!({
                "name": step.name, "index": step.index, "rule": step.rule, "binding": step.binding,
                "agent": step.agent, "status": step.status.name(), "reason": step.reason,
            })
        });
        shown["steps"] = steps.collect();
        print_json(&shown)?;
        return Ok(Answer::Yes);
    }
    let mut text = line(mission, snapshot.time(), &missions, mission.name.len());
    let preemption = mission.preemption.name();
    let _ = write!(
        text,
        "\ngives way {preemption}, {} replans\n\n{}\n",
        mission.replans,
        mission.goal.trim_end()
    );
    for step in &mission.steps {
        let why = match step.reason.as_str() {
            "" => String::new(),
            why => format!(": {why}"),
        };
        let (name, status) = (&step.name, step.status.name());
        let _ = writeln!(text, "{name}  {status:10}  {step} by {}{why}", step.agent);
    }
    print(&text)?;
    Ok(Answer::Yes)
}

fn commit(session: &mut Session, transaction: &Transaction, now: Time) -> Result<(), Failure> {
    match session.commit(transaction, now) {
        Ok(_) => Ok(()),
        Err(CommitError::Refused(refusal)) => Err(Failure::input(refusal)),
        Err(error) => Err(Failure::internal(error)),
    }
}

/// Writes a request, unless the mission is over: then there is nothing to be asked of it.
fn ask(session: &mut Session, name: &str, request: Request) -> Result<Answer, Failure> {
    let (snapshot, missions) = read(session)?;
    let mission = find(&missions, name)?;
    let status = mission.status;
    let sensible = match request {
        Request::Cancel => mission.can_be_cancelled(),
        Request::Pause => matches!(status, MissionStatus::Queued | MissionStatus::Running),
        Request::Resume => status == MissionStatus::Paused,
    };
    if !sensible {
        let word = request.name();
        print(&format!(
            "nothing to {word}: mission {name} is {}\n",
            status.name()
        ))?;
        return Ok(Answer::No);
    }
    let mut transaction = Transaction::new();
    transaction.set(mission.id, "request", request.name());
    let transaction = transaction.require(Precondition::NodeUnchangedSince {
        node: mission.id.into(),
        version: snapshot.version(),
    });
    commit(session, &transaction, snapshot.time())?;
    let asked = |mission: &Mission| mission.request.is_empty();
    match follow(session, name, Some(PATIENCE), asked)? {
        Followed::Until(mission) => {
            print(&format!("mission {name} is {}\n", mission.status.name()))?;
            Ok(Answer::Yes)
        }
        Followed::TooLong => {
            let word = request.name();
            print(&format!(
                "mission {name} is {}: the executive has not answered for {} s; it is asked to {word} the mission as \
                soon as it does\n",
                mission.status.name(),
                PATIENCE.as_secs()
            ))?;
            Ok(Answer::No)
        }
        Followed::Gone => Ok(Answer::No),
    }
}

/// Waits until a mission is over; the answer is whether it succeeded.
fn wait(session: &mut Session, name: &str, machine: bool) -> Result<Answer, Failure> {
    let over = |mission: &Mission| mission.status.is_over();
    let Followed::Until(mission) = follow(session, name, None, over)? else {
        return Ok(Answer::No);
    };
    let (snapshot, missions) = read(session)?;
    let now = snapshot.time();
    if machine {
        print_json(&as_json(&mission, now, &missions))?;
    } else {
        print(&format!("{}\n", line(&mission, now, &missions, name.len())))?;
    }
    Ok(if mission.status == MissionStatus::Succeeded {
        Answer::Yes
    } else {
        Answer::No
    })
}

/// What came of following a mission.
enum Followed {
    /// It is as wanted.
    Until(Box<Mission>),
    /// It is not, and patience is over.
    TooLong,
    /// It or the instance is gone, or the user interrupted.
    Gone,
}

/// Waits until the mission is as wanted, for so long at the most.
fn follow(
    session: &mut Session,
    name: &str,
    patience: Option<Duration>,
    wanted: impl Fn(&Mission) -> bool,
) -> Result<Followed, Failure> {
    #[allow(
        clippy::disallowed_methods,
        reason = "an executive that stands still answers never"
    )]
    let started = Instant::now();
    let interrupted = super::interruption()?;
    let mut changes = session
        .changes(Filter::default())
        .map_err(Failure::internal)?;
    while !interrupted.load(Ordering::Acquire) && session.instance().exists() {
        let (_, missions) = read(session)?;
        let Some(mission) = missions.into_iter().find(|mission| mission.name == name) else {
            return Ok(Followed::Gone);
        };
        if wanted(&mission) {
            return Ok(Followed::Until(Box::new(mission)));
        }
        if patience.is_some_and(|patience| started.elapsed() > patience) {
            return Ok(Followed::TooLong);
        }
        changes.wait(LOOK).map_err(Failure::internal)?;
        let snapshot = session.snapshot().map_err(Failure::internal)?;
        while changes
            .next(snapshot.schema())
            .map_err(Failure::internal)?
            .is_some()
        {}
    }
    Ok(Followed::Gone)
}
