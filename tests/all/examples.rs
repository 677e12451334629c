//! The examples in the book, read by the readers of the program. This file guarantees that what a
//! page shows as a whole file is one.

use crate::tree;
use dsr::Schema;
use scenarios::Scenario;

/// The contents of a page's fenced blocks in a language, at least one.
fn blocks(page: &str, language: &str) -> Vec<String> {
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
        let files = |_: &str| Ok(String::new());
        let scenario = Scenario::parse("scenario.toml", &text, &files);
        assert!(scenario.is_ok(), "{:?}", scenario.err());
    }
}

#[test]
fn every_key_of_a_scenario_is_described() {
    let page = tree::read("docs/src/scenario-files.md");
    let text = blocks("scenario-files", "toml").remove(0);
    let keys = text.lines().filter_map(|line| line.split_once(" = "));
    for (key, _) in keys.filter(|(key, _)| !key.contains(['{', '['])) {
        let described = format!("`{key}`");
        assert!(page.contains(&described), "{key} is not described");
    }
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
fn the_agent_of_the_tutorial_is_the_one_that_is_compiled() {
    let example = tree::read("dsr/examples/careful.rs");
    for text in blocks("your-own-agent", "rust") {
        assert!(example.contains(&text), "dsr/examples/careful.rs differs");
    }
}
