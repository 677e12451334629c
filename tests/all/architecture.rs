//! Holds ARCHITECTURE.md against the code: what it says that nobody does, nobody does; and its
//! lists of exceptions name no file that needs none.

use crate::tree::{self, SourceFile, assert_none};
use std::collections::BTreeSet;

/// Lines that a file may have.
const LONGEST: usize = 500;
const CLOCKS: [&str; 3] = ["Instant::now", "SystemTime::now", "thread::sleep"];
/// What reaches beyond a process's own memory, beside the clocks.
const OUTSIDE: [&str; 18] = [
    "thread::spawn",
    "thread::Builder",
    "thread::scope",
    "fs::read",
    "fs::read_dir",
    "fs::read_to_string",
    "fs::write",
    "fs::create_dir_all",
    "fs::remove_file",
    "File::open",
    "File::create",
    "env::var",
    "env::var_os",
    "env::args",
    "Command::new",
    "io::stdin",
    "io::stdout",
    "io::stderr",
];

/// Asserts that exactly the files that the table below a heading allows are `found`. A path there
/// that ends with `/` allows a folder.
fn check_exceptions(heading: &str, found: &[&SourceFile]) {
    let rows = tree::table(&tree::read("ARCHITECTURE.md"), heading);
    let allowed: Vec<&str> = rows.iter().map(|row| row[0].trim_matches('`')).collect();
    assert!(
        rows.iter().all(|row| row.len() == 2 && !row[1].is_empty()),
        "`{heading}` gives a reason for each"
    );
    let holds = |allowed: &str, file: &SourceFile| {
        file.path == allowed || allowed.ends_with('/') && file.path.starts_with(allowed)
    };
    let more = found
        .iter()
        .filter(|file| !allowed.iter().any(|a| holds(a, file)))
        .map(|file| file.path.clone());
    assert_none(&format!("not in ARCHITECTURE.md below `{heading}`"), more);
    let stale = allowed
        .iter()
        .filter(|a| !found.iter().any(|file| holds(a, file)))
        .map(ToString::to_string);
    assert_none(
        &format!("needlessly in ARCHITECTURE.md below `{heading}`"),
        stale,
    );
}

fn is_test(file: &SourceFile) -> bool {
    let path = &file.path;
    path.starts_with("tests/") || path.ends_with("/tests.rs") || path.contains("/tests/")
}

/// For each file and each word that it names in its code, what to say about it.
fn naming<'a>(
    files: impl IntoIterator<Item = &'a SourceFile>,
    words: &[&str],
) -> impl Iterator<Item = String> {
    files.into_iter().flat_map(|file| {
        let code = tree::code(&file.text);
        let named = words.iter().filter(|word| tree::names(&code, word));
        named
            .map(|word| format!("{}: {word}", file.path))
            .collect::<Vec<_>>()
    })
}

#[test]
fn only_the_shells_touch_clock_disk_environment_and_threads() {
    let sources = tree::sources();
    let touches = |file: &&SourceFile| {
        let code = tree::code(&file.text);
        let program = tree::program(&code);
        CLOCKS
            .iter()
            .chain(&OUTSIDE)
            .any(|touch| tree::names(program, touch))
    };
    let found: Vec<&SourceFile> = sources
        .iter()
        .filter(|file| !is_test(file) && !file.path.contains("/examples/"))
        .filter(touches)
        .collect();
    check_exceptions("Shells", &found);
}

#[test]
fn tests_wait_for_events_and_read_no_clock() {
    let sources = tree::sources();
    let tests = sources.iter().filter(|file| is_test(file));
    assert_none("read a clock", naming(tests, &CLOCKS));
}

#[test]
fn only_shm_of_dsr_is_unsafe_or_names_iceoryx2() {
    let sources = tree::sources();
    let others = |file: &&SourceFile| !file.path.starts_with("dsr/src/shm/");
    assert!(sources.iter().any(|file| !others(&file)));
    let words = ["unsafe", "iceoryx2"];
    assert_none("outside shm", naming(sources.iter().filter(others), &words));
}

/// Paths of the files that the compiler is given: libraries, binaries, tests, examples.
fn crate_roots() -> BTreeSet<String> {
    let is_root = |path: &str| {
        ["src/lib.rs", "src/main.rs", "build.rs"]
            .iter()
            .any(|end| path.ends_with(end))
            || path.contains("examples/") && !path.contains("/src/")
    };
    let paths = tree::sources().into_iter().map(|file| file.path);
    let mut roots: BTreeSet<String> = paths.filter(|path| is_root(path)).collect();
    for (path, manifest) in tree::manifests() {
        let folder = path.trim_end_matches("Cargo.toml");
        for kind in ["bin", "test", "bench", "example"] {
            let targets = manifest.get(kind).and_then(toml::Value::as_array);
            for target in targets.into_iter().flatten() {
                let path = target.get("path").and_then(toml::Value::as_str);
                roots.extend(path.map(|path| format!("{folder}{path}")));
            }
        }
    }
    roots
}

#[test]
fn every_crate_forbids_unsafe_code_but_dsr_which_denies_it() {
    let roots = crate_roots();
    assert!(
        roots.contains("dsr/src/lib.rs") && roots.contains("tests/all/main.rs"),
        "{roots:?}"
    );
    let missing = roots.iter().filter_map(|path| {
        let level = if path == "dsr/src/lib.rs" {
            "deny"
        } else {
            "forbid"
        };
        let attribute = format!("#![{level}(unsafe_code)]");
        let there = tree::code(&tree::read(path)).contains(&attribute);
        (!there).then(|| format!("{path}: no {attribute}"))
    });
    assert_none("open to unsafe code", missing);
}

#[test]
fn every_package_takes_the_lints_of_the_workspace() {
    let others = tree::manifests().into_iter().filter(|(_, manifest)| {
        let lints = manifest.get("lints");
        lints.and_then(|lints| lints.get("workspace")) != Some(&toml::Value::Boolean(true))
    });
    assert_none("has lints of its own", others.map(|(path, _)| path));
}

#[test]
fn every_file_says_first_what_it_owns() {
    let silent = tree::sources().into_iter().filter(|file| {
        let said = file.text.strip_prefix("//! ").unwrap_or_default();
        said.find('\n').is_none_or(|length| length < 10)
    });
    assert_none("does not say what it owns", silent.map(|file| file.path));
}

#[test]
fn no_file_is_longer_than_one_can_read_at_a_sitting() {
    let sources = tree::sources();
    let long = |file: &&SourceFile| file.text.lines().count() > LONGEST;
    check_exceptions(
        "Long files",
        &sources.iter().filter(long).collect::<Vec<_>>(),
    );
}

#[test]
fn the_tree_holds_no_path_of_a_machine() {
    // In pieces, so that this file does not hold them.
    let machine = ["work", "root", "home", "Users", "tmp"].map(|folder| format!("/{folder}/"));
    // `a/tmp/b` and `../tmp/b` are relative.
    let relative =
        |before: &str| before.ends_with(|c: char| c.is_alphanumeric() || "._-$}/".contains(c));
    let mut found = Vec::new();
    for file in tree::files() {
        for path in &machine {
            let mut places = file.text.match_indices(path);
            if places.any(|(at, _)| !relative(&file.text[..at])) {
                found.push(format!("{}: {path}", file.path));
            }
        }
    }
    assert_none("names a place of one machine", found);
}

#[test]
fn nothing_is_unfinished_by_its_own_words() {
    let marks = [["TO", "DO"], ["FIX", "ME"], ["XX", "X"]].map(|word| word.concat());
    let files = tree::files();
    let marked = files.iter().filter(|file| {
        file.path != "Cargo.lock" && marks.iter().any(|mark| tree::names(&file.text, mark))
    });
    assert_none("is marked unfinished", marked.map(|file| file.path.clone()));
    let sources = tree::sources();
    let macros = ["todo!", "unimplemented!"];
    assert_none("is not written", naming(&sources, &macros));
}
