//! The verbs: each reads its input, calls the packages, and prints what came of it.

mod agent;
mod graph;
mod output;
mod run;
mod store;

pub(crate) use agent::AGENTS;

use crate::cli::Verb;
use crate::{Answer, Failure};
use dsr::{Instance, Schema};
use grammar::{Grammar, SourceFile};
use scenarios::Scenario;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

pub(crate) fn perform(verb: Verb) -> Result<Answer, Failure> {
    match verb {
        Verb::Run(arguments) => run::run(&arguments),
        Verb::Agent(arguments) => agent::run(&arguments),
        Verb::Store(arguments) => store::run(&arguments),
        Verb::Graph(arguments) => graph::run(&arguments),
    }
}

fn instance(name: &str) -> Result<Instance, Failure> {
    Instance::new(name).map_err(Failure::input)
}

fn load_scenario(folder: &Path) -> Result<Scenario, Failure> {
    Scenario::load(folder).map_err(|error| Failure::Input(error.into()))
}

/// Reads a grammar with all that it includes; whatever is wrong with any of it is bad input.
fn load_grammar(text: &str, path: &Path) -> Result<Grammar, Failure> {
    let name = path.display().to_string();
    let mut include = |from: &str, what: &str| -> Result<SourceFile, String> {
        let file = Path::new(from).parent().unwrap_or(Path::new("")).join(what);
        let text = std::fs::read_to_string(&file).map_err(|error| error.to_string())?;
        Ok(SourceFile::new(&file.display().to_string(), &text))
    };
    let (grammar, diagnostics) = grammar::load_grammar(text, &name, &mut include);
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
