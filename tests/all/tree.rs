//! The repository as the tests of its own order see it. This file guarantees that what lies in a
//! comment or a string is never taken for code.

use std::fs;
use std::path::{Path, PathBuf};

/// A file of the repository.
#[derive(Debug)]
pub(crate) struct SourceFile {
    /// Relative to the repository's root, with `/`.
    pub(crate) path: String,
    pub(crate) text: String,
}

impl SourceFile {
    /// Whether its name ends with `.` and this.
    pub(crate) fn is(&self, extension: &str) -> bool {
        Path::new(&self.path)
            .extension()
            .is_some_and(|found| found == extension)
    }
}

/// What the names of folders begin with that builds and runs write.
const WRITTEN: [&str; 4] = ["target", "report", "corpus", "artifacts"];

/// The repository's root.
pub(crate) fn root() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().unwrap_or(package).to_owned()
}

/// Every text file of the repository, by path.
pub(crate) fn files() -> Vec<SourceFile> {
    let mut files = Vec::new();
    collect(&root(), "", &mut files);
    files.sort_by(|a, b| a.path.cmp(&b.path));
    assert!(
        files.len() > 50,
        "only {} files: where is the repository?",
        files.len()
    );
    files
}

fn collect(folder: &Path, prefix: &str, files: &mut Vec<SourceFile>) {
    for entry in fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        let path = format!("{prefix}{name}");
        let kind = entry.file_type().unwrap();
        if kind.is_dir() {
            let hidden = name.starts_with('.') && name != ".ci" && name != ".cargo";
            let at_the_top = prefix.is_empty() || prefix == "fuzz/";
            let written = at_the_top && WRITTEN.iter().any(|w| name.starts_with(w));
            if !hidden && !written {
                collect(&entry.path(), &format!("{path}/"), files);
            }
        } else if kind.is_file()
            && name != ".git"
            && let Ok(text) = fs::read_to_string(entry.path())
        {
            files.push(SourceFile { path, text });
        }
    }
}

/// The fuzz targets are a workspace of their own, which the normal build leaves alone.
const FUZZ: &str = "fuzz/Cargo.toml";

/// The manifest of each package of the workspace, and its path.
pub(crate) fn manifests() -> Vec<(String, toml::Table)> {
    let manifests = files()
        .into_iter()
        .filter(|file| file.path.ends_with("Cargo.toml") && file.path != FUZZ);
    manifests
        .map(|file| (file.path, file.text.parse().unwrap()))
        .collect()
}

/// Every Rust file of the repository.
pub(crate) fn sources() -> Vec<SourceFile> {
    let mut files = files();
    files.retain(|file| file.is("rs"));
    files
}

/// A text file of the repository, which must be there.
pub(crate) fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Rust text with comments and the insides of strings and characters blanked out, line for line.
pub(crate) fn code(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let skipped = not_code(rest);
        if skipped == 0 {
            out.push(first);
            rest = &rest[first.len_utf8()..];
            continue;
        }
        let blank = |c: char| if c == '\n' { '\n' } else { ' ' };
        out.extend(rest[..skipped].chars().map(blank));
        rest = &rest[skipped..];
    }
    out
}

/// The length of the comment, string or character that the text begins with; 0 where it is code.
fn not_code(text: &str) -> usize {
    if text.starts_with("//") {
        return text.find('\n').unwrap_or(text.len());
    }
    if text.starts_with("/*") {
        return text.find("*/").map_or(text.len(), |end| end + 2);
    }
    let raw = text.strip_prefix("br").or_else(|| text.strip_prefix('r'));
    if let Some(after) = raw {
        let hashes = after.len() - after.trim_start_matches('#').len();
        if after[hashes..].starts_with('"') {
            let close = format!("\"{}", "#".repeat(hashes));
            let start = text.len() - after.len() + hashes + 1;
            let end = text[start..].find(&close);
            return end.map_or(text.len(), |end| start + end + close.len());
        }
        // `r` and `br` begin many words.
        return 0;
    }
    if let Some(after) = text.strip_prefix('"') {
        return 1 + quoted(after, '"');
    }
    if let Some(after) = text.strip_prefix('\'') {
        let mut letters = after.chars();
        let (first, second) = (letters.next(), letters.next());
        // Anything else is a lifetime.
        if first == Some('\\') || second == Some('\'') {
            return 1 + quoted(after, '\'');
        }
    }
    0
}

/// The length up to and with the closing `quote`.
fn quoted(text: &str, quote: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices() {
        if c == quote && !escaped {
            return at + 1;
        }
        escaped = c == '\\' && !escaped;
    }
    text.len()
}

/// The strings that the text holds in double quotes, as far as they have no escapes.
pub(crate) fn strings(text: &str) -> Vec<&str> {
    let mut strings = Vec::new();
    for line in text.lines() {
        strings.extend(line.split('"').skip(1).step_by(2));
    }
    strings
}

/// Asserts that there are none of these, and tells them all where there are.
pub(crate) fn assert_none(what: &str, found: impl IntoIterator<Item = String>) {
    let found: Vec<String> = found.into_iter().collect();
    assert!(found.is_empty(), "{what}:\n  {}", found.join("\n  "));
}

/// Rust code without its unit tests, for what holds of the program only.
pub(crate) fn program(code: &str) -> String {
    let Some((before, tests)) = code.split_once("#[cfg(test)]\nmod tests {") else {
        return code.to_owned();
    };
    // As formatted, the first brace at the beginning of a line ends the module.
    let after = tests.split_once("\n}\n").map_or("", |(_, after)| after);
    format!("{before}{after}")
}

/// Whether `word` stands in the text as a word of its own.
pub(crate) fn names(text: &str, word: &str) -> bool {
    let part_of_word = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(word).any(|(at, _)| {
        !text[..at].ends_with(part_of_word) && !text[at + word.len()..].starts_with(part_of_word)
    })
}

/// The rows of the markdown table below a heading, each cell trimmed; no rows where the section
/// says `None.` instead.
pub(crate) fn table(markdown: &str, heading: &str) -> Vec<Vec<String>> {
    let is_heading = |line: &&str| line.trim_start_matches('#').trim() == heading;
    let mut lines = markdown.lines().skip_while(|line| !is_heading(line));
    assert!(lines.next().is_some(), "no heading `{heading}`");
    let section: Vec<&str> = lines.take_while(|line| !line.starts_with('#')).collect();
    if section.contains(&"None.") {
        return Vec::new();
    }
    let rows = section
        .iter()
        .skip_while(|line| !line.starts_with('|'))
        .take_while(|line| line.starts_with('|'));
    let cells = |line: &&str| -> Vec<String> {
        let cells = line.trim_matches('|').split('|');
        cells.map(|cell| cell.trim().to_owned()).collect()
    };
    let rows: Vec<Vec<String>> = rows.map(cells).collect();
    assert!(rows.len() > 2, "no table below `{heading}`");
    rows[2..].to_vec()
}

/// The code spans of a line of markdown.
pub(crate) fn spans(line: &str) -> impl Iterator<Item = &str> {
    line.split('`').skip(1).step_by(2)
}

#[test]
fn comments_and_strings_are_not_code() {
    let text = "let a = \"b // \\\" c\"; // d\nlet 'e: '\\'' = r#\"f \" g\"#; /* h\n*/ i('j');";
    let code = code(text);
    for word in ["let", "a", "e", "i"] {
        assert!(names(&code, word), "{word} in {code}");
    }
    for word in ["b", "c", "d", "f", "g", "h", "j"] {
        assert!(!names(&code, word), "{word} in {code}");
    }
    assert_eq!(code.lines().count(), text.lines().count());
}

#[test]
fn a_table_is_read_cell_by_cell() {
    let markdown = "# A\n| a |\n|---|\n| 1 |\n## B\nText.\n\n| a | b |\n|---|---|\n| `1` | 2, 3 |\n\n| no |\n# C\nNone.";
    assert_eq!(table(markdown, "B"), [["`1`", "2, 3"]]);
    assert!(table(markdown, "C").is_empty());
    assert_eq!(spans("a `b` c `d`.").collect::<Vec<_>>(), ["b", "d"]);
}
