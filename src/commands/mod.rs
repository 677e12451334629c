//! The verbs: each reads its input, calls the packages, and prints what came of it.

mod agent;
mod bench;
mod doctor;
mod experiment;
pub(crate) mod graph;
mod inspect;
pub(crate) mod mission;
mod new;
pub(crate) mod output;
mod path;
mod plan;
pub(crate) mod record;
mod replay;
mod rules;
mod run;
mod shell;
mod social;
mod store;
mod where_is;
pub(crate) mod why;

pub(crate) use agent::AGENTS;
pub(crate) use output::value_text;

use crate::cli::Verb;
use crate::{Answer, Failure};
use dsr::{Instance, Schema};
use grammar::{Diagnostic, Grammar, SourceFile};
use scenarios::Scenario;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

pub(crate) fn perform(verb: Verb) -> Result<Answer, Failure> {
    match verb {
        Verb::Run(arguments) => run::run(&arguments),
        Verb::Agent(arguments) => agent::run(&arguments),
        Verb::Store(arguments) => store::run(&arguments),
        Verb::Graph(arguments) => graph::run(&arguments),
        Verb::Rules(arguments) => rules::run(&arguments),
        Verb::Plan(arguments) => plan::run(&arguments),
        Verb::Mission(arguments) => mission::run(&arguments),
        Verb::Why(arguments) => why::run(&arguments),
        Verb::Inspect(arguments) => inspect::run(&arguments),
        Verb::Record(arguments) => record::run(&arguments),
        Verb::Replay(arguments) => replay::run(&arguments),
        Verb::Bench(arguments) => bench::run(&arguments),
        Verb::Path(arguments) => path::run(&arguments),
        Verb::BenchPeer(arguments) => {
            crate::bench::play(&arguments.role, &arguments.instance, &arguments.numbers)
        }
        Verb::Social(arguments) => social::run(&arguments),
        Verb::Where(arguments) => where_is::run(&arguments),
        Verb::Experiment(arguments) => experiment::run(&arguments),
        Verb::Doctor(arguments) => doctor::run(&arguments),
        Verb::New(arguments) => new::run(&arguments),
        Verb::Completions(arguments) => shell::completions(&arguments),
        Verb::Man(arguments) => shell::man(&arguments),
    }
}

fn instance(name: &str) -> Result<Instance, Failure> {
    Instance::new(name).map_err(Failure::input)
}

/// The failure for an instance that is not there.
pub(crate) fn not_running(name: &str) -> Failure {
    Failure::input_with_help(
        format!("no instance `{name}` is running"),
        "start one with `cortex run SCENARIO`, or look at a file with --file",
    )
}

fn load_scenario(folder: &Path) -> Result<Scenario, Failure> {
    Scenario::load(folder).map_err(|error| Failure::Input(error.into()))
}

/// Reads a text file that the user named.
pub(crate) fn read_text(path: &Path) -> Result<String, Failure> {
    let bytes = std::fs::read(path)
        .map_err(|error| Failure::input(format!("cannot read {}: {error}", path.display())))?;
    String::from_utf8(bytes).map_err(|error| {
        let good = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = good.split(|byte| *byte == b'\n').count();
        let (path, place) = (path.display(), good.len() + 1);
        Failure::input(format!(
            "{path}:{line}: byte {place} of the file is not UTF-8 text"
        ))
    })
}

/// Reads a grammar with all that it includes, each path relative to the file it stands in, and
/// tells all that is wrong with any of it.
fn read_grammar(text: &str, path: &Path) -> (Grammar, Vec<Diagnostic>) {
    // A file that is reached on two ways is one file, under the name that it was first reached by.
    let mut names: BTreeMap<PathBuf, String> = BTreeMap::new();
    let main = path.display().to_string();
    if let Ok(real) = path.canonicalize() {
        names.insert(real, main.clone());
    }
    let mut include = |what: &str, from: &str| -> Result<SourceFile, String> {
        let file = Path::new(from).parent().unwrap_or(Path::new("")).join(what);
        let read = || {
            let real = file.canonicalize()?;
            Ok((std::fs::read_to_string(&real)?, real))
        };
        let (text, real) = read().map_err(|error: std::io::Error| error.to_string())?;
        let name = names
            .entry(real)
            .or_insert_with(|| file.display().to_string());
        Ok(SourceFile::new(name, &text))
    };
    grammar::load_grammar(text, &main, &mut include)
}

/// As [`read_grammar`]; whatever is wrong with any of it is bad input.
fn load_grammar(text: &str, path: &Path) -> Result<Grammar, Failure> {
    let (grammar, diagnostics) = read_grammar(text, path);
    if grammar::has_errors(&diagnostics) {
        return Err(Failure::Input(grammar::Defects { diagnostics }.into()));
    }
    Ok(grammar)
}

/// The scenario's schema and grammar.
fn load_rules(scenario: &Scenario) -> Result<(Schema, Grammar), Failure> {
    let grammar = load_grammar(&scenario.rules, &scenario.folder.join("rules.aggl"))?;
    let schema = scenarios::schema().map_err(|error| Failure::Internal(error.into()))?;
    Ok((schema, grammar))
}

/// Whether every mission's goal can be read under the grammar's types.
fn check_goals(scenario: &Scenario, grammar: &Grammar) -> Result<(), Failure> {
    for mission in &scenario.missions {
        let file = scenario.folder.join(&mission.file).display().to_string();
        grammar::parse_goal(&mission.goal, &file, &grammar.types)
            .map_err(|defects| Failure::Input(defects.into()))?;
    }
    Ok(())
}

/// A flag that the first Ctrl-C or termination request sets; the second ends the program at once.
fn interruption() -> Result<Arc<AtomicBool>, Failure> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        // In this order: the flag is not set yet when the first signal comes.
        signal_hook::flag::register_conditional_shutdown(signal, 1, Arc::clone(&flag))
            .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&flag)))
            .map_err(Failure::internal)?;
    }
    Ok(flag)
}
