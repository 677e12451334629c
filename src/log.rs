//! What a process writes into its log, as `RUST_LOG` says. It guarantees that a directive which names a process
//! of an instance counts for that process alone.

use crate::cli::Verb;
use tracing_subscriber::EnvFilter;

/// What counts where nothing is said.
const LEVEL: &str = "info";

/// The filter of the process that a verb is.
pub(crate) fn filter(verb: &Verb) -> EnvFilter {
    let said = std::env::var(EnvFilter::DEFAULT_ENV).unwrap_or_default();
    EnvFilter::try_new(directives(&said, name(verb))).unwrap_or_else(|_| LEVEL.into())
}

/// The name that a process goes by in its instance.
fn name(verb: &Verb) -> &str {
    match verb {
        Verb::Agent(agent) => &agent.name,
        Verb::Store(_) => "store",
        Verb::Record(_) => crate::commands::record::RECORDER,
        Verb::Inspect(_) => crate::manifests::INSPECTOR,
        Verb::Run(_) => "supervisor",
        _ => "cortex",
    }
}

/// The directives that hold for a process: where one gives it a level by its name, that counts in place
/// of the level for all.
fn directives(said: &str, name: &str) -> String {
    let given = || said.split(',').map(str::trim).filter(|d| !d.is_empty());
    let own = given().rev().find_map(|directive| {
        let (target, level) = directive.split_once('=')?;
        (target == name).then_some(level)
    });
    let for_all = given().rev().find(|directive| !directive.contains('='));
    let level = own.or(for_all).unwrap_or(LEVEL);
    let targets = given().filter(|directive| directive.contains('='));
    std::iter::once(level)
        .chain(targets)
        .collect::<Vec<_>>()
        .join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_by_name_is_for_that_process_alone() {
        let said = "warn, navigation=debug,dsr=error";
        assert_eq!(
            directives(said, "navigation"),
            "debug,navigation=debug,dsr=error"
        );
        assert_eq!(
            directives(said, "executive"),
            "warn,navigation=debug,dsr=error"
        );
        assert_eq!(directives("", "store"), "info");
        assert_eq!(directives("store=trace", "store"), "trace,store=trace");
        assert_eq!(directives("store=trace", "world"), "info,store=trace");
    }
}
