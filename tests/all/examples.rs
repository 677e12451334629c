//! The examples in the book, read by the readers of the program. This file guarantees that what a
//! page shows as a whole file is one.

use crate::support::{Program, Run, within};
use crate::tree::{self, assert_none};
use dsr::{Schema, Session, Time, Transaction};
use scenarios::Scenario;
use scenarios::scenario::ProblemKind;
use std::collections::BTreeSet;
use std::fs;
use std::process::Command;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(20);

/// The contents of a page's fenced blocks in a language, at least one.
pub(crate) fn blocks(page: &str, language: &str) -> Vec<String> {
    let text = tree::read(&format!("docs/src/{page}.md"));
    let opening = format!("```{language}\n");
    let blocks: Vec<String> = text
        .split(&opening)
        .skip(1)
        .filter_map(|rest| rest.split_once("```"))
        .map(|(block, _)| block.to_owned())
        .collect();
    assert!(!blocks.is_empty(), "{page} has no example in {language}");
    blocks
}

#[test]
fn grammars_and_goals_are_read_without_a_complaint() {
    for text in blocks("aggl", "aggl") {
        if text.trim_start().starts_with('{') {
            let goal = grammar::parse_goal(&text, "goal.aggt", &grammar::Types::default());
            assert!(goal.is_ok(), "{:?}", goal.err());
        } else {
            let (grammar, diagnostics) = grammar::parse_grammar(&text, "example.aggl");
            assert!(diagnostics.is_empty(), "{diagnostics:?}");
            assert!(!grammar.rules.is_empty());
        }
    }
}

#[test]
fn scenarios_are_read_without_a_complaint() {
    for text in blocks("scenario-files", "toml") {
        let files = |_: &str| Ok(Vec::new());
        let scenario = Scenario::parse("scenario.toml", &text, &files);
        assert!(scenario.is_ok(), "{:?}", scenario.err());
    }
}

/// Tables that the example does without.
const MORE_TABLES: &str = r#"
[robot.laser]
[robot.localisation]
[[wall]]
from = [3.0, 0.2]
to = [3.5, 0.2]
[[stream]]
name = "crowd"
from = [1.0, 1.0]
to = [7.0, 1.0]
[tracks]
"#;

/// Every key that the reader of scenarios knows: what it suggests for one that it does not know.
fn known_keys() -> BTreeSet<String> {
    let wrong = "of_no_use = 1";
    let example = blocks("scenario-files", "toml").remove(0) + MORE_TABLES;
    let example = example.replace("{ after", &format!("{{ {wrong}, after"));
    let mut text = format!("{wrong}\n");
    for line in example.lines() {
        text.push_str(line);
        text.push('\n');
        if line.starts_with('[') {
            text.push_str(wrong);
            text.push('\n');
        }
    }
    let files = |_: &str| Ok(Vec::new());
    let invalid = Scenario::parse("scenario.toml", &text, &files).unwrap_err();
    let mut keys = BTreeSet::new();
    for problem in invalid.problems {
        let ProblemKind::UnknownKey { help, .. } = problem.kind else {
            panic!("{problem}")
        };
        let known = help.strip_prefix("known are: ").unwrap();
        keys.extend(known.split(", ").map(str::to_owned));
    }
    keys
}

#[test]
fn every_key_of_a_scenario_is_described() {
    let page = tree::read("docs/src/scenario-files.md");
    let keys = known_keys();
    assert!(
        keys.len() > 50 && keys.contains("correlation_time"),
        "{keys:?}"
    );
    let described = |key: &String| {
        let (alone, dotted) = (format!("`{key}`"), format!(".{key}`"));
        let (table, tables) = (format!("[{key}]"), format!(".{key}]"));
        [alone, dotted, table, tables]
            .iter()
            .any(|name| page.contains(name))
    };
    assert_none(
        "is not described",
        keys.into_iter().filter(|key| !described(key)),
    );
}

#[test]
fn schemas_are_read_without_a_complaint() {
    for text in blocks("schema-files", "toml") {
        let schema = Schema::from_toml("schema.toml", &text);
        assert!(schema.is_ok(), "{:?}", schema.err());
    }
}

#[test]
fn every_kind_of_value_is_described() {
    let page = tree::read("docs/src/schema-files.md");
    for kind in dsr::ValueKind::ALL {
        assert!(page.contains(&format!("`{kind}`")), "{kind}");
    }
}

#[test]
fn the_programs_that_pages_show_are_those_that_are_compiled() {
    for (page, example) in [
        ("your-own-agent", "dsr/examples/careful.rs"),
        ("shared-graph", "dsr/examples/scan.rs"),
    ] {
        let program = tree::read(example);
        for text in blocks(page, "rust") {
            assert!(program.contains(&text), "{example} differs");
        }
    }
}

#[test]
fn the_agent_in_thirty_lines_keeps_the_robot_at_one_of_its_two_speeds() {
    let arguments = ["scenarios/care-centre", "--no-baseline"];
    let mut run = Run::new("careful", &arguments).start();
    run.until("mission invite is running");
    let instance = dsr::Instance::new(run.instance_name()).unwrap();
    let mut session = Session::attach(&instance, "cortex-graph", PATIENCE).unwrap();
    let mut transaction = Transaction::new();
    transaction.set("robot", "max_speed", 0.1);
    session.commit(&transaction, Time::default()).unwrap();
    let mut agent = Command::new(env!("CARGO_BIN_EXE_careful"))
        .arg(instance.name())
        .spawn()
        .unwrap();
    let set = within(PATIENCE, || {
        let snapshot = session.snapshot().unwrap();
        let robot = snapshot.find_node_by_name("robot").unwrap().unwrap();
        let speed = robot.value("max_speed").unwrap();
        (speed == Some(0.7.into()) || speed == Some(0.35.into())).then_some(())
    });
    agent.kill().unwrap();
    agent.wait().unwrap();
    assert!(set.is_some());
    drop(session);
    run.interrupt();
    run.wait_until_no_process_is_left();
}

#[test]
fn the_plan_of_the_tutorial_is_the_one_that_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let [rules, news, ..] = &blocks("your-own-mission", "aggl")[..] else {
        panic!("no rules and goal");
    };
    let world = &blocks("your-own-mission", "json")[0];
    let files = [
        ("home.aggl", rules),
        ("home.json", world),
        ("news.aggt", news),
    ];
    let paths = files.map(|(name, text)| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        path.display().to_string()
    });
    let [rules, world, goal] = &paths;
    assert!(Program::run(&["rules", "check", rules]).status.success());
    let output = Program::run(&["plan", rules, world, goal]);
    let told = String::from_utf8(output.stdout).unwrap();
    let shown = &blocks("your-own-mission", "text")[0];
    assert!(told.starts_with(shown.as_str()), "{told}");
}
