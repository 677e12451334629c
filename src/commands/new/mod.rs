//! `cortex new`: a folder to start from. It guarantees that nothing is written over, and that what a
//! template says is what the program reads or the workspace compiles.

use super::output::print;
use crate::cli::{New, NewThing};
use crate::{Answer, Failure};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// The program of the tutorial, which the workspace compiles.
const AGENT: &str = include_str!("../../../dsr/examples/careful.rs");
/// Its name there.
const CAREFUL: &str = "careful";
const AGENT_PACKAGE: &str = include_str!("templates/agent.toml");
const AGENT_README: &str = include_str!("templates/agent.md");
const AGENT_MANIFEST: &str = include_str!("templates/manifest.toml");
const SCENARIO: &str = include_str!("templates/scenario.toml");
const SCENARIO_README: &str = include_str!("templates/scenario.md");
const GOAL: &str = include_str!("templates/visit.aggt");
/// The rules of a scenario that comes with Cortex.
const RULES: &str = include_str!("../../../scenarios/plaza/rules.aggl");

pub(crate) fn run(arguments: &New) -> Result<Answer, Failure> {
    let (name, folder, files) = match &arguments.what {
        NewThing::Agent { name, cortex } => {
            let name = checked(name)?;
            let cortex = cortex.clone().map_or_else(find_source, Ok)?;
            (name, PathBuf::from(name), agent(name, &cortex)?)
        }
        NewThing::Scenario { name } => {
            let name = checked(name)?;
            (name, PathBuf::from(name), scenario(name))
        }
    };
    write(&folder, &files)?;
    let mut text = String::new();
    for (file, _) in &files {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{}", folder.join(file).display());
    }
    let _ = writeln!(text, "see {name}/README.md");
    print(&text)?;
    Ok(Answer::Yes)
}

/// A name that may be that of a folder, a package and an agent.
fn checked(name: &str) -> Result<&str, Failure> {
    let begins = name.starts_with(|c: char| c.is_ascii_lowercase());
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "_-".contains(c);
    if begins && name.chars().all(plain) {
        Ok(name)
    } else {
        Err(Failure::input_with_help(
            format!("`{name}` cannot be the name of a package"),
            "take small letters, digits, `_` and `-`, a letter first",
        ))
    }
}

/// Where Cortex's own source is: above this folder, or above the program.
fn find_source() -> Result<PathBuf, Failure> {
    let here = std::env::current_dir().ok();
    let program = std::env::current_exe().ok();
    let from = here
        .iter()
        .chain(&program)
        .flat_map(|path| path.ancestors());
    let mut with_source = from.filter(|folder| folder.join("dsr/Cargo.toml").is_file());
    with_source.next().map(Path::to_owned).ok_or_else(|| {
        Failure::input_with_help(
            "an agent is built with the package `dsr` of Cortex, which was not found",
            "say where its source is: --cortex DIR",
        )
    })
}

type Files = Vec<(String, String)>;

fn file(name: &str, text: impl Into<String>) -> (String, String) {
    (name.to_owned(), text.into())
}

fn agent(name: &str, cortex: &Path) -> Result<Files, Failure> {
    let cannot = |error| Failure::input(format!("cannot find {}: {error}", cortex.display()));
    let dsr = cortex.canonicalize().map_err(cannot)?.join("dsr");
    let of = |text: &str| {
        text.replace("NAME", name)
            .replace("DSR", &dsr.display().to_string())
    };
    let program = AGENT
        .replace(
            &format!("`cargo run -p dsr --example {CAREFUL}`"),
            "`cargo run`",
        )
        .replace(&format!("\"{CAREFUL}\""), &format!("\"{name}\""));
    Ok(vec![
        file("Cargo.toml", of(AGENT_PACKAGE)),
        file("src/main.rs", program),
        file(&format!("{name}.toml"), of(AGENT_MANIFEST)),
        file("README.md", of(AGENT_README)),
    ])
}

fn scenario(name: &str) -> Files {
    let of = |text: &str| text.replace("NAME", name);
    vec![
        file("scenario.toml", of(SCENARIO)),
        file(
            "rules.aggl",
            RULES.replace("name=plaza", &format!("name={name}")),
        ),
        file("missions/visit.aggt", GOAL),
        file("README.md", of(SCENARIO_README)),
    ]
}

fn write(folder: &Path, files: &Files) -> Result<(), Failure> {
    let failed = |path: &Path| {
        let path = path.display().to_string();
        move |error| Failure::input(format!("cannot write {path}: {error}"))
    };
    if folder.exists() {
        return Err(Failure::input_with_help(
            format!("{} is there already", folder.display()),
            "choose another name; nothing was written",
        ));
    }
    for (name, text) in files {
        let path = folder.join(name);
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(failed(parent))?;
        }
        std::fs::write(&path, text).map_err(failed(&path))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_of_a_new_agent_is_the_one_that_is_compiled_but_for_its_name() {
        let files = agent("polite", Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
        let (_, program) = &files[1];
        assert!(program.contains("Session::attach(&instance, \"polite\""));
        let differing = AGENT.lines().zip(program.lines()).filter(|(a, b)| a != b);
        assert_eq!(differing.count(), 2);
        let schema = scenarios::schema().unwrap();
        let (name, manifest) = &files[2];
        let manifest = dsr::Manifest::from_toml(name, manifest, &schema).unwrap();
        assert_eq!(manifest.agent(), "polite");
        let (_, package) = &files[0];
        let package: toml::Table = package.parse().unwrap();
        let dsr = package["dependencies"]["dsr"]["path"].as_str().unwrap();
        assert!(Path::new(dsr).join("Cargo.toml").is_file());
    }

    #[test]
    fn names_that_no_package_may_have_are_refused() {
        for bad in ["", "Polite", "a b", "../a", "1st"] {
            assert!(checked(bad).is_err(), "{bad}");
        }
        assert!(checked("polite_agent-2").is_ok());
    }
}
