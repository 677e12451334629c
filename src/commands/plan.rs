//! `cortex plan`: the steps that lead from a world to a goal, or why there are none.

use super::graph::{attach, read_graph};
use super::output::{print, print_json, tell};
use crate::cli::Plan as Arguments;
use crate::{Answer, Failure};
use dsr::{Graph, Image, Schema, Snapshot};
use executive::pddl::{self, WriteError, Written};
use executive::{Effort, Limits, Milestones, Options, Outcome, Raised, Status, plan};
use grammar::live::Published;
use grammar::{Grammar, SourceFile};
use serde_json::json;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    #[allow(
        clippy::disallowed_methods,
        reason = "the verb tells how long planning took"
    )]
    let started = Instant::now();
    let mut limits = Limits::new().with_bytes(arguments.memory_limit as usize * 1_000_000);
    let seconds = arguments.time_limit.unwrap_or(f64::INFINITY);
    limits = limits.with_clock(seconds, move || started.elapsed().as_secs_f64());
    let effort = match (arguments.optimal, arguments.time_limit) {
        (true, _) => Effort::Optimal,
        (false, Some(_)) => Effort::Anytime,
        (false, None) => Effort::First,
    };
    let (outcome, names) = match arguments.pddl.as_deref() {
        Some([domain, problem]) => {
            let read = |path: &PathBuf| {
                let text = super::read_text(path)?;
                Ok::<_, Failure>(SourceFile::new(&path.display().to_string(), &text))
            };
            let definition = pddl::read(&read(domain)?, &read(problem)?)
                .map_err(|defects| Failure::Input(defects.into()))?;
            (pddl::plan(&definition, effort, &mut limits), None)
        }
        _ => by_rules(arguments, effort, &mut limits)?,
    };
    let seconds = started.elapsed().as_secs_f64();
    if let Some(file) = &arguments.output
        && outcome.status == Status::Solved
    {
        write_file(file, &pddl::plan_file(&outcome, names.as_ref()))?;
    }
    if arguments.json {
        let mut answer = json!(outcome);
        let Milestones {
            grounded,
            first_plan,
        } = limits.milestones();
        answer["seconds"] = json!(seconds);
        answer["grounded"] = json!(grounded);
        answer["first_plan"] = json!(first_plan);
        print_json(&answer)?;
    } else {
        print(&told(&outcome, seconds))?;
    }
    Ok(if outcome.status == Status::Solved {
        Answer::Yes
    } else {
        Answer::No
    })
}

/// Plans over the rules of a grammar, and writes what was asked in PDDL where that is wanted.
fn by_rules(
    arguments: &Arguments,
    effort: Effort,
    limits: &mut Limits<'_>,
) -> Result<(Outcome, Option<Written>), Failure> {
    let (grammar, snapshot, goal, raised) = match (arguments.files.as_slice(), &arguments.instance)
    {
        ([domain, world, goal], None) => {
            let grammar = super::load_grammar(&super::read_text(domain)?, domain)?;
            (grammar, read_graph(world)?.snapshot(), goal, Vec::new())
        }
        ([goal], Some(instance)) => {
            let (grammar, snapshot, raised) = of_instance(instance)?;
            (grammar, snapshot, goal, raised)
        }
        (_, None) => return Err(Failure::input("a grammar, a world and a goal are needed")),
        (_, Some(_)) => {
            return Err(Failure::input_with_help(
                "a running system has its grammar and its world",
                "give the goal alone",
            ));
        }
    };
    let name = goal.display().to_string();
    let goal = grammar::parse_goal(&super::read_text(goal)?, &name, &grammar.types)
        .map_err(|defects| Failure::Input(defects.into()))?;
    let options = Options {
        effort,
        spares: arguments.spares.into(),
        raised,
        ..Options::default()
    };
    let mut written = None;
    if arguments.write_pddl.is_some() {
        written = match pddl::write(&grammar, &snapshot, &goal, &options, limits) {
            Ok(written) => Some(written),
            // Planning says the same of these.
            Err(WriteError::Goal(_) | WriteError::Stopped(_)) => None,
            Err(WriteError::Read(error)) => return Err(Failure::internal(error)),
        };
    }
    if let (Some(folder), Some(written)) = (&arguments.write_pddl, &written) {
        std::fs::create_dir_all(folder).map_err(|error| {
            Failure::input(format!("cannot make {}: {error}", folder.display()))
        })?;
        write_file(&folder.join("domain.pddl"), &written.domain)?;
        write_file(&folder.join("problem.pddl"), &written.problem)?;
        for note in &written.notes {
            tell(&format!("{note}\n"));
        }
    }
    let outcome = plan(&grammar, &snapshot, &goal, &options, limits).map_err(Failure::internal)?;
    Ok((outcome, written))
}

/// The rules and a copy of the graph of a running system, and what its executive found to be dearer: what is planned with may take longer than
/// the system keeps a version.
fn of_instance(name: &str) -> Result<(Grammar, Snapshot, Vec<Raised>), Failure> {
    let mut session = attach(name)?;
    let (published, image) = session
        .read(|snapshot| Ok((Published::find(snapshot)?, Image::of(snapshot)?)))
        .map_err(Failure::internal)?;
    let mut graph = Graph::in_memory(Schema::open());
    graph.restore(&image).map_err(Failure::internal)?;
    let snapshot = graph.snapshot();
    let published = published.ok_or_else(|| {
        Failure::input_with_help(
            format!("`{name}` goes by no rules"),
            "load some with `cortex rules load`",
        )
    })?;
    let grammar = published
        .read(snapshot.schema())
        .map_err(|defects| Failure::Input(defects.into()))?;
    // As the executive would plan for a new mission.
    let (learned, raised) =
        executive::experience(&grammar, &snapshot).map_err(Failure::internal)?;
    Ok((learned, snapshot, raised))
}

fn write_file(path: &Path, text: &str) -> Result<(), Failure> {
    std::fs::write(path, text)
        .map_err(|error| Failure::input(format!("cannot write {}: {error}", path.display())))
}

/// The outcome for people.
fn told(outcome: &Outcome, seconds: f64) -> String {
    let mut text = String::new();
    let effort = format!("{} states expanded in {seconds:.3} s", outcome.expanded);
    let reason = outcome.reason.as_deref().unwrap_or_default();
    for note in &outcome.notes {
        // Writing to a string does not fail.
        let _ = writeln!(text, "note: {note}");
    }
    let _ = match outcome.status {
        Status::Unsolvable => writeln!(text, "unsolvable: {reason}\n{effort}"),
        Status::Limit => writeln!(text, "{reason}\n{effort}"),
        Status::Solved => {
            for (number, step) in (1..).zip(&outcome.steps) {
                let pairs = step.binding.iter().chain(&step.creates);
                let pairs: Vec<String> = pairs.map(|(var, node)| format!("{var}={node}")).collect();
                let by = step
                    .agent
                    .as_ref()
                    .map_or_else(String::new, |by| format!("  by {by}"));
                let _ = writeln!(text, "{number:3}  {}  {}{by}", step.rule, pairs.join(" "));
            }
            let best = if outcome.optimal {
                "optimal"
            } else {
                "best found"
            };
            let cost = outcome.cost.unwrap_or_default();
            writeln!(
                text,
                "{} steps, cost {cost} ({best}), {effort}",
                outcome.steps.len()
            )
        }
    };
    text
}
