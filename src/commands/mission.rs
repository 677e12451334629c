//! `cortex mission`: the missions of a running instance. It writes what somebody wants into the graph;
//! the executive, which looks there, does it or says why not.

use super::graph::attach;
use super::output::{print, print_json};
use crate::cli::{Mission as Arguments, MissionAction, SubmitMission};
use crate::{Answer, Failure};
use dsr::{CommitError, Filter, Precondition, Session, Snapshot, Time, Transaction};
use executive::{
    Mission, MissionFile, MissionSpec, MissionStatus, PlannedMission, Preemption, Request, Schedule,
};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// How often a wait looks whether it was interrupted.
const LOOK: Duration = Duration::from_millis(100);

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let mut session = attach(&arguments.instance)?;
    match &arguments.action {
        MissionAction::List => list(&mut session, arguments.json),
        MissionAction::Show { name } => show(&mut session, name, arguments.json),
        MissionAction::Submit(submit) => self::submit(&mut session, submit, arguments.json),
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
fn find(missions: Vec<Mission>, name: &str) -> Result<Mission, Failure> {
    let names: Vec<String> = missions.iter().map(|m| m.name.clone()).collect();
    let found = missions.into_iter().find(|mission| mission.name == name);
    found.ok_or_else(|| {
        let help = match dsr::suggest(name, names.iter().map(String::as_str)) {
            Some(near) => format!("did you mean `{near}`?"),
            None if names.is_empty() => "there are no missions".to_owned(),
            None => format!("there are: {}", names.join(", ")),
        };
        Failure::input_with_help(format!("there is no mission `{name}`"), help)
    })
}

fn as_json(mission: &Mission, now: Time) -> Value {
    json!({
        "name": mission.name,
        "status": mission.status.name(),
        "priority": mission.priority,
        "deadline": mission.deadline.map(|deadline| deadline.since(now)),
        "begins": mission.schedule.begins.map(|begins| begins.since(now)),
        "period": mission.schedule.period,
        "after": mission.schedule.after,
        "preemption": mission.preemption.name(),
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
        let missions: Vec<Value> = missions.iter().map(|one| as_json(one, now)).collect();
        print_json(&json!(missions))?;
        return Ok(Answer::Yes);
    }
    let width = missions.iter().map(|m| m.name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for mission in &missions {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{}", line(mission, now, width));
    }
    if missions.is_empty() {
        text.push_str("no missions\n");
    }
    print(&text)?;
    Ok(Answer::Yes)
}

fn line(mission: &Mission, now: Time, width: usize) -> String {
    let mut line = format!(
        "{:width$}  {:9}  priority {}",
        mission.name,
        mission.status.name(),
        mission.priority
    );
    let schedule = &mission.schedule;
    if let Some(left) = schedule.begins.map(|begins| begins.since(now))
        && left > 0.0
    {
        let _ = write!(line, "  begins in {left:.0} s");
    }
    if let Some(period) = schedule.period {
        let _ = write!(line, "  every {period:.0} s");
    }
    if let Some(after) = &schedule.after {
        let _ = write!(line, "  after {after}");
    }
    if let Some(deadline) = mission.deadline
        && !mission.status.is_over()
    {
        let _ = write!(line, "  {:.0} s left", deadline.since(now));
    }
    if !mission.reason.is_empty() {
        let _ = write!(line, "  {}", mission.reason);
    }
    line
}

fn show(session: &mut Session, name: &str, machine: bool) -> Result<Answer, Failure> {
    let (snapshot, missions) = read(session)?;
    let mission = find(missions, name)?;
    if machine {
        let mut shown = as_json(&mission, snapshot.time());
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
    let mut text = line(&mission, snapshot.time(), mission.name.len());
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

fn submit(session: &mut Session, submit: &SubmitMission, machine: bool) -> Result<Answer, Failure> {
    let several = submit.file.extension().is_some_and(|end| end == "toml");
    if several && (submit.name.is_some() || submit.wait) {
        return Err(Failure::input_with_help(
            "a mission file has several missions with names of their own",
            "leave out --name and --wait",
        ));
    }
    let snapshot = session.snapshot().map_err(Failure::internal)?;
    let mut transaction = Transaction::new();
    let specs = if several {
        of_file(&snapshot, &submit.file, &mut transaction)?
    } else {
        vec![of_goal(&snapshot, submit)?]
    };
    for spec in &specs {
        let taken = snapshot.find_node_by_name(&spec.name);
        if taken.map_err(Failure::internal)?.is_some() {
            return Err(Failure::input_with_help(
                format!("there is already a node `{}`", spec.name),
                "give the mission another name with --name, or in its file",
            ));
        }
        transaction.create_node("mission", &spec.name, spec.attributes());
    }
    commit(session, &transaction, snapshot.time())?;
    if let [spec] = &specs[..]
        && submit.wait
    {
        return wait(session, &spec.name, machine);
    }
    let queued = |spec: &MissionSpec| json!({ "name": spec.name, "status": "queued" });
    if !machine {
        let lines = specs
            .iter()
            .map(|s| format!("mission {} is queued\n", s.name));
        print(&lines.collect::<String>())?;
    } else if several {
        print_json(&specs.iter().map(queued).collect())?;
    } else {
        print_json(&specs.iter().map(queued).next().unwrap_or_default())?;
    }
    Ok(Answer::Yes)
}

/// The mission that the flags describe.
fn of_goal(snapshot: &Snapshot, submit: &SubmitMission) -> Result<MissionSpec, Failure> {
    let goal = super::read_text(&submit.file)?;
    let stem = submit.file.file_stem().map(|stem| stem.to_string_lossy());
    let name = submit.name.clone().or(stem.map(Into::into));
    let name = name.ok_or_else(|| Failure::input("give the mission a --name"))?;
    check_goal(&goal, &submit.file.display().to_string(), snapshot)?;
    let policy = |policy: &Preemption| policy.name() == submit.preemption;
    let preemption = Preemption::ALL.into_iter().find(policy);
    Ok(MissionSpec {
        name,
        goal,
        priority: submit.priority,
        deadline: submit.deadline.map(|seconds| snapshot.time() + seconds),
        preemption: preemption.unwrap_or_default(),
        schedule: Schedule::default(),
    })
}

/// The missions of a file; what puts its rules in force becomes a part of the transaction.
fn of_file(
    snapshot: &Snapshot,
    path: &Path,
    transaction: &mut Transaction,
) -> Result<Vec<MissionSpec>, Failure> {
    let name = path.display().to_string();
    let file = MissionFile::from_toml(&name, &super::read_text(path)?)
        .map_err(|error| Failure::Input(error.into()))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    if let Some(rules) = &file.rules {
        let path = folder.join(rules);
        let (grammar, mut diagnostics) = super::read_grammar(&super::read_text(&path)?, &path);
        diagnostics.extend(grammar.check_schema(snapshot.schema()));
        if grammar::has_errors(&diagnostics) {
            return Err(Failure::Input(grammar::Defects { diagnostics }.into()));
        }
        *transaction = grammar.publish(snapshot).map_err(Failure::internal)?;
    }
    let spec = |mission: &PlannedMission| {
        let path = folder.join(&mission.goal);
        let goal = super::read_text(&path)?;
        check_goal(&goal, &path.display().to_string(), snapshot)?;
        Ok(mission.spec(snapshot.time(), goal))
    };
    file.missions.iter().map(spec).collect()
}

/// Whether the goal can be read, and says nothing that the graph's schema does not know.
pub(crate) fn check_goal(goal: &str, file: &str, snapshot: &Snapshot) -> Result<(), Failure> {
    let grammar = grammar::Grammar {
        types: grammar::Types::of_schema(snapshot.schema()),
        ..grammar::Grammar::default()
    };
    let bad = |defects: grammar::Defects| Failure::Input(defects.into());
    let parsed = grammar::parse_goal(goal, file, &grammar.types).map_err(bad)?;
    let source = grammar::SourceFile::new(file, goal);
    let diagnostics = grammar.check_goal_schema(&parsed, &source, snapshot.schema());
    if grammar::has_errors(&diagnostics) {
        return Err(bad(grammar::Defects { diagnostics }));
    }
    Ok(())
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
    let mission = find(missions, name)?;
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
    match follow(session, name, asked)? {
        Some(mission) => {
            print(&format!("mission {name} is {}\n", mission.status.name()))?;
            Ok(Answer::Yes)
        }
        None => Ok(Answer::No),
    }
}

/// Waits until a mission is over; the answer is whether it succeeded.
fn wait(session: &mut Session, name: &str, machine: bool) -> Result<Answer, Failure> {
    let Some(mission) = follow(session, name, |mission| mission.status.is_over())? else {
        return Ok(Answer::No);
    };
    let (snapshot, _) = read(session)?;
    if machine {
        print_json(&as_json(&mission, snapshot.time()))?;
    } else {
        print(&format!(
            "{}\n",
            line(&mission, snapshot.time(), name.len())
        ))?;
    }
    Ok(if mission.status == MissionStatus::Succeeded {
        Answer::Yes
    } else {
        Answer::No
    })
}

/// The mission as soon as it is as wanted; `None` where it or the instance is gone, or the user
/// interrupted.
fn follow(
    session: &mut Session,
    name: &str,
    wanted: impl Fn(&Mission) -> bool,
) -> Result<Option<Mission>, Failure> {
    let interrupted = super::interruption()?;
    let mut changes = session
        .changes(Filter::default())
        .map_err(Failure::internal)?;
    while !interrupted.load(Ordering::Acquire) && session.instance().exists() {
        let (_, missions) = read(session)?;
        let Some(mission) = missions.into_iter().find(|mission| mission.name == name) else {
            return Ok(None);
        };
        if wanted(&mission) {
            return Ok(Some(mission));
        }
        changes.wait(LOOK).map_err(Failure::internal)?;
        let snapshot = session.snapshot().map_err(Failure::internal)?;
        while changes
            .next(snapshot.schema())
            .map_err(Failure::internal)?
            .is_some()
        {}
    }
    Ok(None)
}
