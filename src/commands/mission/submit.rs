//! `cortex mission submit`: a goal, or the missions of a file, become nodes of the graph. It guarantees
//! that all of a file is submitted or nothing, and that all that is wrong with it is told at once.

use super::{commit, wait};
use crate::cli::SubmitMission;
use crate::commands::output::{print, print_json};
use crate::commands::{read_grammar, read_text};
use crate::{Answer, Failure};
use dsr::{Session, Snapshot, Time, Transaction};
use executive::{MissionSpec, Preemption, Schedule};
use grammar::{Defects, Diagnostic, Goal, SourceFile, Types};
use scenarios::scenario::{Earlier, Mission, MissionFile, Present};
use serde_json::json;
use std::path::Path;
use thiserror::Error;

pub(super) fn run(
    session: &mut Session,
    submit: &SubmitMission,
    machine: bool,
) -> Result<Answer, Failure> {
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
    let goal = read_text(&submit.file)?;
    let stem = submit.file.file_stem().map(|stem| stem.to_string_lossy());
    let name = submit.name.clone().or(stem.map(Into::into));
    let name = name.ok_or_else(|| Failure::input("give the mission a --name"))?;
    if name.is_empty() || name.contains(|c: char| c == '/' || c.is_whitespace() || c.is_control()) {
        return Err(Failure::input_with_help(
            format!(
                "`{name}` cannot be a mission's name: its steps and their paths could not be told"
            ),
            "give it a --name without spaces and `/`",
        ));
    }
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

/// All that is wrong with a mission file, and with the files that it names.
#[derive(Debug, Error)]
#[error("the missions of {file} cannot be submitted")]
struct Wrong {
    file: String,
    related: Vec<Box<dyn miette::Diagnostic + Send + Sync>>,
}

impl miette::Diagnostic for Wrong {
    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn miette::Diagnostic> + 'a>> {
        Some(Box::new(self.related.iter().map(|one| &**one as _)))
    }
}

/// The missions of a file; what puts its rules in force becomes a part of the transaction.
fn of_file(
    snapshot: &Snapshot,
    path: &Path,
    transaction: &mut Transaction,
) -> Result<Vec<MissionSpec>, Failure> {
    let now = snapshot.time();
    let earlier = executive::missions(snapshot).map_err(Failure::internal)?;
    let earlier = earlier.into_iter().map(|mission| Earlier {
        hopeless: mission.is_hopeless().then(|| mission.outcome()),
        name: mission.name,
    });
    let earlier: Vec<Earlier> = earlier.collect();
    let present = Present {
        now,
        missions: &earlier,
        has: &|name| matches!(snapshot.find_node_by_name(name), Ok(Some(_))),
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let name = path.display().to_string();
    let read = |name: &str| std::fs::read(folder.join(name));
    let (file, wrong) = MissionFile::parse(&name, &read_text(path)?, present, &read);
    // What could not be read has no text, and is told of already.
    let is_read = |text: &str| wrong.is_none() || !text.is_empty();
    let mut diagnostics = Vec::new();
    if let Some((rules, text)) = &file.rules
        && is_read(text)
    {
        let (grammar, defects) = read_grammar(text, &folder.join(rules));
        diagnostics.extend(defects);
        diagnostics.extend(grammar.check_schema(snapshot.schema()));
        if !grammar::has_errors(&diagnostics) {
            *transaction = grammar.publish(snapshot).map_err(Failure::internal)?;
        }
    }
    for mission in file
        .missions
        .iter()
        .filter(|mission| is_read(&mission.goal))
    {
        let path = folder.join(&mission.file).display().to_string();
        diagnostics.extend(goal_defects(&mission.goal, &path, snapshot));
    }
    let mut related: Vec<Box<dyn miette::Diagnostic + Send + Sync>> = Vec::new();
    if let Some(wrong) = wrong {
        related.push(wrong);
    }
    if grammar::has_errors(&diagnostics) {
        related.push(Box::new(Defects { diagnostics }));
    }
    if !related.is_empty() {
        let wrong = Wrong {
            file: name,
            related,
        };
        return Err(Failure::Input(wrong.into()));
    }
    Ok(file.missions.iter().map(|one| spec(one, now)).collect())
}

/// A mission of a scenario or of a mission file, whose deadlines count from `start`.
pub(crate) fn spec(mission: &Mission, start: Time) -> MissionSpec {
    let preemption = Preemption::ALL
        .into_iter()
        .find(|policy| policy.name() == mission.preemption);
    let begins = mission.begins.unwrap_or(start);
    let deadlines = [
        mission.deadline.map(|deadline| start + deadline),
        mission.within.map(|within| begins + within),
    ];
    MissionSpec {
        name: mission.name.clone(),
        goal: mission.goal.clone(),
        priority: mission.priority,
        deadline: deadlines.into_iter().flatten().min(),
        preemption: preemption.unwrap_or_default(),
        schedule: Schedule {
            begins: mission.begins,
            period: mission.period,
            after: mission.after.clone(),
        },
    }
}

/// Whether the goal can be read, and says nothing that the graph's schema does not know.
pub(crate) fn check_goal(goal: &str, file: &str, snapshot: &Snapshot) -> Result<(), Failure> {
    let diagnostics = goal_defects(goal, file, snapshot);
    if grammar::has_errors(&diagnostics) {
        return Err(Failure::Input(Defects { diagnostics }.into()));
    }
    Ok(())
}

/// All that is wrong with a goal.
fn goal_defects(goal: &str, file: &str, snapshot: &Snapshot) -> Vec<Diagnostic> {
    let grammar = grammar::Grammar {
        types: Types::of_schema(snapshot.schema()),
        ..grammar::Grammar::default()
    };
    let fits = |parsed: &Goal| {
        let source = SourceFile::new(file, goal);
        grammar.check_goal_schema(parsed, &source, snapshot.schema())
    };
    match grammar::parse_goal(goal, file, &grammar.types) {
        Ok(parsed) => fits(&parsed),
        Err(mut defects) => {
            // Types that are unknown hide no label that is: of what does not fit, the rest is told, too.
            if let Ok(parsed) = grammar::parse_goal(goal, file, &Types::default()) {
                let told: Vec<_> = defects.diagnostics.iter().map(|one| one.span).collect();
                let more = fits(&parsed).into_iter();
                let more = more.filter(|defect| !told.contains(&defect.span));
                defects.diagnostics.extend(more);
            }
            defects.diagnostics
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_type_hides_no_unknown_label() {
        let graph = dsr::Graph::in_memory(scenarios::schema().unwrap());
        let goal = "{ \"robot\":robt p:person p->\"robot\"(frnt) }";
        let told = goal_defects(goal, "call.aggt", &graph.snapshot());
        let told: Vec<String> = told.iter().map(ToString::to_string).collect();
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(
            told[0].contains("robt") && told[1].contains("frnt"),
            "{told:?}"
        );
    }
}
