//! Holds what people read against what is there: paths, links, verbs and flags. This file guarantees
//! that a command shown in the documentation is one that the program understands.

use crate::tree::{self, SourceFile, assert_none};
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

/// Written by a run, or brought by the user.
const NOT_IN_THE_TREE: [&str; 2] = ["report.json", "obsmat.txt"];
/// What ends the name of a file of the tree.
const EXTENSIONS: [&str; 6] = [".rs", ".toml", ".md", ".aggl", ".aggt", ".json"];

/// What is written for people: everything in markdown.
fn pages() -> Vec<SourceFile> {
    let mut pages = tree::files();
    pages.retain(|file| file.is("md"));
    let known = [
        "README.md",
        "ARCHITECTURE.md",
        "CONTRIBUTING.md",
        "CHANGELOG.md",
    ];
    for path in known {
        assert!(pages.iter().any(|page| page.path == path), "no {path}");
    }
    pages
}

/// The lines of a page that are not in a fenced block.
fn prose(text: &str) -> Vec<&str> {
    let mut inside = false;
    let mut prose = Vec::new();
    for line in text.lines() {
        if line.starts_with("```") {
            inside = !inside;
        } else if !inside {
            prose.push(line);
        }
    }
    prose
}

/// The lines of a page's blocks for the shell.
fn shell(text: &str) -> Vec<&str> {
    let mut inside = None;
    let mut lines = Vec::new();
    for line in text.lines() {
        if let Some(fence) = line.strip_prefix("```") {
            inside = if inside.is_some() { None } else { Some(fence) };
        } else if inside == Some("sh") {
            lines.push(line);
        }
    }
    lines
}

fn folder(path: &str) -> &str {
    path.rfind('/').map_or("", |slash| &path[..=slash])
}

#[test]
fn every_link_leads_somewhere() {
    let mut checked = 0;
    let mut broken = Vec::new();
    for page in pages() {
        for line in prose(&page.text) {
            let links = line.split("](").skip(1);
            for link in links.filter_map(|rest| rest.split(')').next()) {
                let target = link.split('#').next().unwrap_or_default();
                if target.is_empty() || target.contains("://") {
                    continue;
                }
                checked += 1;
                let path = tree::root().join(folder(&page.path)).join(target);
                if !path.exists() {
                    broken.push(format!("{}: {link}", page.path));
                }
            }
        }
    }
    assert!(checked > 5, "only {checked} links");
    assert_none("leads nowhere", broken);
}

/// Whether a code span is the path of a file: letters, digits and `._-/` only, and either with a
/// folder or with an ending of ours. `DIR/` and `a/NAME` stand for something.
fn is_path(span: &str) -> bool {
    let letters = span
        .chars()
        .all(|c| c.is_ascii_alphanumeric() || "._-/".contains(c));
    let stands_for = span.split('/').any(|part| {
        !part.is_empty() && !part.contains('.') && part.chars().all(|c| c.is_ascii_uppercase())
    });
    let has_name = span.trim_start_matches('.').len() > 1 && !span.starts_with('/');
    let file = EXTENSIONS
        .iter()
        .any(|end| span.ends_with(end) && span.len() > end.len());
    letters && !stands_for && has_name && (span.contains('/') || file)
}

#[test]
fn every_path_named_is_there() {
    let files = tree::files();
    let paths: BTreeSet<&str> = files.iter().map(|file| file.path.as_str()).collect();
    let names: BTreeSet<&str> = paths
        .iter()
        .filter_map(|path| path.rsplit('/').next())
        .collect();
    // Services and units have a `/` too; those that the code knows are right.
    let sources = tree::sources();
    let strings: BTreeSet<&str> = sources
        .iter()
        .flat_map(|file| tree::strings(&file.text))
        .collect();
    let mut checked = 0;
    let mut missing = Vec::new();
    for page in pages() {
        let spans = prose(&page.text).into_iter().flat_map(tree::spans);
        for span in spans.filter(|span| is_path(span)) {
            if NOT_IN_THE_TREE.contains(&span) || span.starts_with("reports/") {
                continue;
            }
            checked += 1;
            let there = tree::root().join(span).exists()
                || tree::root().join(folder(&page.path)).join(span).exists()
                || !span.contains('/') && names.contains(span)
                || strings.contains(span);
            if !there {
                missing.push(format!("{}: {span}", page.path));
            }
        }
    }
    assert!(checked > 20, "only {checked} paths");
    assert_none("is not there", missing);
}

/// The words after `cortex`, where a command runs it.
fn arguments(command: &str) -> Option<Vec<&str>> {
    let command = command.split(" #").next().unwrap_or(command).trim();
    let words: Vec<&str> = command.split_whitespace().collect();
    match &words[..] {
        ["cortex", rest @ ..] => Some(rest.to_vec()),
        ["cargo", "run", rest @ ..] => {
            let after = rest.iter().position(|word| *word == "--")?;
            Some(rest[after + 1..].to_vec())
        }
        _ => None,
    }
}

/// The program's help on some verbs; `None` where it knows no such verbs.
fn help(verbs: &[&str]) -> Option<String> {
    let output = Command::new(env!("CARGO_BIN_EXE_cortex-under-test"))
        .args(verbs)
        .arg("--help")
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    (output.status.success() && text.contains("Usage:")).then_some(text)
}

/// What is wrong with the arguments of a command that a page shows.
fn wrong(words: &[&str]) -> Option<String> {
    let mut rest = words.iter();
    let mut verbs: Vec<&str> = Vec::new();
    let known = loop {
        let Some(known) = help(&verbs) else {
            return Some(format!("no verb {}", verbs.join(" ")));
        };
        if !known.contains("\nCommands:\n") {
            break known;
        }
        match rest.next() {
            Some(verb) if !verb.starts_with('-') => verbs.push(verb),
            _ => return None,
        }
    };
    let words: Vec<&str> = rest.map(|word| word.trim_matches(['[', ']'])).collect();
    let unknown = words
        .iter()
        .filter(|word| word.starts_with("--"))
        .find(|flag| !tree::names(&known, flag));
    let missing = words
        .iter()
        .filter(|word| word.starts_with("scenarios/"))
        .find(|path| !tree::root().join(path).exists());
    unknown
        .map(|flag| format!("no flag {flag}"))
        .or(missing.map(|path| format!("no {path}")))
}

#[test]
fn every_command_shown_is_understood() {
    let mut shown = BTreeMap::new();
    let pages = pages();
    for page in &pages {
        let spans = prose(&page.text).into_iter().flat_map(tree::spans);
        for command in spans.chain(shell(&page.text)) {
            if let Some(words) = arguments(command).filter(|words| !words.is_empty()) {
                shown.insert(words, (&page.path, command));
            }
        }
    }
    assert!(shown.len() > 10, "only {} commands", shown.len());
    let wrong = shown.into_iter().filter_map(|(words, (page, command))| {
        wrong(&words).map(|why| format!("{page}: `{command}`: {why}"))
    });
    assert_none("is not understood", wrong);
}

#[test]
fn the_readme_gives_the_two_commands() {
    let readme = tree::read("README.md");
    for command in [
        "cargo run --release -- run scenarios/care-centre",
        "cargo test --release --workspace",
    ] {
        let times = shell(&readme)
            .iter()
            .filter(|line| **line == command)
            .count();
        assert_eq!(times, 1, "`{command}`");
    }
    let tests = readme
        .lines()
        .filter(|line| line.starts_with("cargo test"))
        .count();
    assert_eq!(tests, 1, ".ci/run takes the one line that begins so");
}

#[test]
fn the_book_has_every_page_once() {
    let summary = tree::read("docs/src/SUMMARY.md");
    let pages = pages().into_iter().filter_map(|page| {
        let name = page.path.strip_prefix("docs/src/")?.to_owned();
        let times = summary.matches(&format!("]({name})")).count();
        (times != usize::from(name != "SUMMARY.md")).then(|| format!("{name}: {times} times"))
    });
    assert_none("is not in the summary once", pages);
}
