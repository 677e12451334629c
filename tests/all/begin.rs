//! What `cortex new`, `cortex completions` and `cortex man` write: a folder that the program itself reads and
//! runs, scripts that know every verb.

use crate::support::{Program, Run, root};
use std::fs;
use std::path::Path;

fn new(folder: &Path, arguments: &[&str]) -> (String, Option<i32>) {
    let output = Program::command(&[&["new"], arguments].concat())
        .current_dir(folder)
        .output()
        .unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    (said, output.status.code())
}

#[test]
fn a_new_scenario_runs_to_its_end_and_its_rules_are_sound() {
    let folder = tempfile::tempdir().unwrap();
    let (said, code) = new(folder.path(), &["scenario", "flat"]);
    assert_eq!(code, Some(0));
    assert!(said.contains("flat/scenario.toml"), "{said}");
    let (_, again) = new(folder.path(), &["scenario", "flat"]);
    assert_eq!(again, Some(2), "nothing is written over");
    let flat = folder.path().join("flat");
    let rules = flat.join("rules.aggl");
    let checked = Program::run(&["rules", "check", rules.to_str().unwrap()]);
    assert_eq!(checked.status.code(), Some(0));
    let arguments = [flat.to_str().unwrap(), "--lockstep", "--no-baseline"];
    let report = Run::new("flat", &arguments).succeed();
    let report = fs::read_to_string(report.path().join("report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["success"], true);
}

#[test]
fn a_new_agent_is_a_package_that_cargo_reads() {
    let folder = tempfile::tempdir().unwrap();
    let cortex = root();
    let cortex = cortex.to_str().unwrap();
    let (_, code) = new(folder.path(), &["agent", "polite", "--cortex", cortex]);
    assert_eq!(code, Some(0));
    let package = folder.path().join("polite");
    // What the workspace resolved does for the package, which needs a part of it.
    fs::copy(root().join("Cargo.lock"), package.join("Cargo.lock")).unwrap();
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let output = std::process::Command::new(cargo)
        .args(["metadata", "--format-version=1", "--offline", "--no-deps"])
        .current_dir(&package)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(metadata["packages"][0]["name"], "polite");
    let (_, code) = new(folder.path(), &["agent", "Not A Name"]);
    assert_eq!(code, Some(2));
}

#[test]
fn shells_and_manuals_know_every_verb() {
    let help = String::from_utf8(Program::run(&["--help"]).stdout).unwrap();
    let verbs: Vec<&str> = help
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| line.starts_with("  "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|verb| *verb != "help")
        .collect();
    assert!(verbs.len() > 15, "{verbs:?}");
    for shell in ["bash", "zsh", "fish"] {
        let script = Program::run(&["completions", shell]).stdout;
        let script = String::from_utf8(script).unwrap();
        for verb in &verbs {
            assert!(script.contains(verb), "{shell} does not know {verb}");
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let written = Program::run(&["man", folder.path().to_str().unwrap()]);
    assert_eq!(written.status.code(), Some(0));
    for verb in &verbs {
        let page = folder.path().join(format!("cortex-{verb}.1"));
        assert!(page.is_file(), "{}", page.display());
    }
}
