//! From a file and its includes to a checked [`Grammar`].
//!
//! Guarantee: the diagnostics are complete, in the order of the files and of their lines, and
//! every rule without a syntax error is in the grammar, whatever else is wrong.

use crate::parser::{Broken, Finding, Item, ParsedFile, ParsedGoal, parse_file, parse_goal_file};
use crate::{Diagnostic, Goal, Grammar, Name, Problem, Severity, SourceFile, Types, check};
use std::fmt;

/// More files than this in one grammar are refused.
const FILE_LIMIT: usize = 256;

/// Finds the text of an included file: given the path as written and the name of the file that
/// includes it, gives the found file (its name tells whether it was read before) or says why not.
pub type Loader<'a> = dyn FnMut(&str, &str) -> Result<SourceFile, String> + 'a;

/// Reads a grammar that stands alone: an `include` in it is reported as unreadable.
///
/// `file_name` is what messages call the file.
///
/// # Example
/// ```
/// let text = "name=doors\n===\n\
///     open : active(1) {\n\
///         { d:door d->d(closed) } => { d:door d->d(open) }\n\
///     }\n";
/// let (grammar, diagnostics) = grammar::parse_grammar(text, "doors.aggl");
/// assert!(diagnostics.is_empty());
/// assert_eq!(grammar.rules[0].left.edges[0].label, "closed");
/// ```
pub fn parse_grammar(text: &str, file_name: &str) -> (Grammar, Vec<Diagnostic>) {
    load_grammar(text, file_name, &mut |_, _| {
        Err("no other files are at hand".to_owned())
    })
}

/// Reads a grammar and, through `loader`, the files it includes (each once, however often and
/// from wherever it is included).
pub fn load_grammar(
    text: &str,
    file_name: &str,
    loader: &mut Loader<'_>,
) -> (Grammar, Vec<Diagnostic>) {
    let mut reading = Reading {
        loader,
        grammar: Grammar {
            files: vec![SourceFile::new(file_name, text)],
            ..Grammar::default()
        },
        findings: Vec::new(),
        broken: Vec::new(),
        missing: false,
    };
    reading.read(0);
    let Reading {
        mut grammar,
        mut findings,
        broken,
        missing,
        ..
    } = reading;
    findings.extend(check::check_grammar(&grammar, &broken, missing));
    let (unfolded, not_unfolded) = crate::unfold::unfold(&grammar);
    grammar.unfolded = unfolded;
    findings.extend(not_unfolded);
    findings.sort_by_key(|finding| finding.span);
    let diagnostics = diagnostics(findings, &grammar.files);
    (grammar, diagnostics)
}

/// Reads a goal (`.aggt`): a graph, and a `precondition { ... }` if there is one.
///
/// Node names that begin with a digit are the ids of existing nodes, names in quotes
/// (`"r2":room`) the unique names of existing nodes, others variables. Type names are checked
/// against `types` unless that is empty.
///
/// # Errors
/// [`Defects`] with everything that is wrong with it.
///
/// # Example
/// ```
/// let goal = grammar::parse_goal(
///     "{ \"robot\":robot r:room \"robot\"->r(in) }",
///     "mission.aggt",
///     &grammar::Types::default(),
/// )?;
/// assert_eq!(goal.constants.len(), 1);
/// # Ok::<(), grammar::Defects>(())
/// ```
pub fn parse_goal(text: &str, file_name: &str, types: &Types) -> Result<Goal, Defects> {
    let file = SourceFile::new(file_name, text);
    let ParsedGoal {
        goal,
        broken,
        lost,
        mut findings,
    } = parse_goal_file(text);
    if let Some(goal) = &goal {
        findings.extend(check::check_goal(goal, types, &lost));
    }
    findings.sort_by_key(|finding| finding.span);
    let diagnostics = diagnostics(findings, std::slice::from_ref(&file));
    match goal {
        Some(goal) if !broken && !has_errors(&diagnostics) => Ok(goal),
        _ => Err(Defects { diagnostics }),
    }
}

/// A goal's canonical text, its comments before it.
///
/// # Errors
/// [`Defects`] with everything that is wrong with it.
pub fn format_goal(text: &str, file_name: &str) -> Result<String, Defects> {
    let goal = parse_goal(text, file_name, &Types::default())?;
    let comments = crate::lexer::lex(text, 0).comments.into_iter();
    let lines = comments.map(|(_, words)| format!("{}\n", format!("# {words}").trim_end()));
    Ok(lines.chain([goal.to_string()]).collect())
}

/// Whether any of them is an error, so that the file must not be used.
pub fn has_errors(diagnostics: &[Diagnostic]) -> bool {
    diagnostics
        .iter()
        .any(|diagnostic| diagnostic.severity() == Severity::Error)
}

/// Of one error's defects no more than this are shown.
pub const SHOWN_LIMIT: usize = 100;

/// Everything that is wrong with a file, as one error.
///
/// Shown are at most [`SHOWN_LIMIT`] of the defects, the most severe before others, and how many more there are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Defects {
    /// In the order of the file.
    pub diagnostics: Vec<Diagnostic>,
}

impl Defects {
    /// Those that are shown, in the order of the file.
    fn shown(&self) -> impl Iterator<Item = &Diagnostic> {
        let mut places: Vec<usize> = (0..self.diagnostics.len()).collect();
        if places.len() > SHOWN_LIMIT {
            places.sort_by_key(|&place| std::cmp::Reverse(self.diagnostics[place].severity()));
            places.truncate(SHOWN_LIMIT);
            places.sort_unstable();
        }
        places.into_iter().map(|place| &self.diagnostics[place])
    }
}

impl fmt::Display for Defects {
    /// One line per defect: `file:line:column: severity: message`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, diagnostic) in self.shown().enumerate() {
            if index > 0 {
                writeln!(f)?;
            }
            let (line, column) = diagnostic.line_and_column();
            let (file, severity) = (diagnostic.file.name(), diagnostic.severity());
            write!(f, "{file}:{line}:{column}: {severity}: {diagnostic}")?;
            if let Some(help) = diagnostic.problem.help() {
                write!(f, " ({help})")?;
            }
        }
        match self.diagnostics.len().saturating_sub(SHOWN_LIMIT) {
            0 => Ok(()),
            more => write!(f, "\nand {more} more"),
        }
    }
}

impl std::error::Error for Defects {}

impl miette::Diagnostic for Defects {
    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn miette::Diagnostic> + 'a>> {
        Some(Box::new(self.shown().map(|diagnostic| diagnostic as _)))
    }
}

/// Findings with the files that they lie in.
pub(crate) fn diagnostics(findings: Vec<Finding>, files: &[SourceFile]) -> Vec<Diagnostic> {
    let diagnostic = |finding: Finding| {
        let file = files.get(finding.span.file as usize)?.clone();
        let Finding {
            span,
            problem,
            related,
        } = finding;
        let related = related.filter(|(place, _)| place.file == span.file);
        Some(Diagnostic {
            problem,
            span,
            file,
            related,
        })
    };
    findings.into_iter().filter_map(diagnostic).collect()
}

struct Reading<'a, 'b> {
    loader: &'a mut Loader<'b>,
    grammar: Grammar,
    findings: Vec<Finding>,
    broken: Vec<Broken>,
    missing: bool,
}

impl Reading<'_, '_> {
    fn read(&mut self, index: usize) {
        let file = self.grammar.files[index].clone();
        let parsed = parse_file(file.text(), index as u32);
        let ParsedFile {
            properties,
            types,
            items,
            comments,
            broken,
            regions,
            findings,
        } = parsed;
        if index == 0 {
            self.grammar.properties = properties;
            self.grammar.comments = comments;
        }
        self.grammar.types.declarations.extend(types.declarations);
        self.broken.extend(broken);
        self.grammar.regions.extend(regions);
        self.findings.extend(findings);
        for item in items {
            match item {
                Item::Rule(rule) => self.grammar.rules.push(*rule),
                Item::Combo(combo) => self.grammar.combos.push(combo),
                Item::Include(include) => {
                    let path = include.path.clone();
                    self.grammar.includes.push(include);
                    self.follow(&path, file.name());
                }
            }
        }
    }

    fn follow(&mut self, path: &Name, from: &str) {
        let reason = match (self.loader)(path, from) {
            Ok(file)
                if self
                    .grammar
                    .files
                    .iter()
                    .any(|read| read.name() == file.name()) =>
            {
                return;
            }
            Ok(_) if self.grammar.files.len() >= FILE_LIMIT => {
                format!("this would be more than {FILE_LIMIT} files")
            }
            Ok(file) => {
                self.grammar.files.push(file);
                return self.read(self.grammar.files.len() - 1);
            }
            Err(reason) => reason,
        };
        self.missing = true;
        let problem = Problem::Include {
            path: path.to_string(),
            reason,
        };
        self.findings.push(Finding {
            span: path.span(),
            problem,
            related: None,
        });
    }
}

#[cfg(test)]
mod tests;
