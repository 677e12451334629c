//! What is wrong with a world, and where. Guarantees that a problem of a text has the line and column
//! that an editor shows.

use miette::{Diagnostic, NamedSource, SourceSpan};
use std::fmt;
use std::ops::Range;
use std::sync::Arc;
use thiserror::Error;

/// How bad a problem is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Suspicious, but its meaning is clear.
    Warning,
    /// It is wrong.
    Error,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Warning => "warning",
            Self::Error => "error",
        })
    }
}

/// One thing that is wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// How bad it is.
    pub severity: Severity,
    /// What is wrong.
    pub message: String,
    /// What would be right.
    pub help: Option<String>,
    /// Bytes of the text; `None` where it is not about a place.
    pub span: Option<Range<usize>>,
    /// Line and column of its first character, counted from 1.
    pub place: Option<(usize, usize)>,
}

impl Problem {
    /// A problem that has no place in a text.
    pub(crate) fn of_graph(severity: Severity, message: String) -> Self {
        Self {
            severity,
            message,
            help: None,
            span: None,
            place: None,
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((line, column)) = self.place {
            write!(f, "line {line} column {column}: ")?;
        }
        f.write_str(&self.message)?;
        self.help
            .as_ref()
            .map_or(Ok(()), |help| write!(f, ", {help}"))
    }
}

/// Why a world cannot be read: all that is wrong with its text, in the order of the text.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{}", .problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
pub struct InterchangeError {
    /// At least one.
    pub problems: Vec<Problem>,
}

impl InterchangeError {
    pub(super) fn new(mut problems: Vec<Problem>) -> Self {
        problems.sort_by_key(|problem| problem.span.clone().map(|span| (span.start, span.end)));
        problems.dedup();
        Self { problems }
    }

    /// The problems as reports that show the lines they are about.
    pub fn in_file(self, name: &str, text: &str) -> Problems {
        Problems::new(name, text, self.problems)
    }
}

/// Problems of a file, ready to be shown with its lines.
#[derive(Debug, Error, Diagnostic)]
#[error("{name}: {count} problem{}", if *.count == 1 { "" } else { "s" })]
#[diagnostic(code(world))]
pub struct Problems {
    name: String,
    count: usize,
    #[related]
    reports: Vec<Report>,
}

impl Problems {
    /// Problems of the file of that name and text.
    pub fn new(name: &str, text: &str, problems: Vec<Problem>) -> Self {
        let text = Arc::new(text.to_owned());
        let report = |problem: Problem| Report {
            severity: match problem.severity {
                Severity::Warning => miette::Severity::Warning,
                Severity::Error => miette::Severity::Error,
            },
            text: NamedSource::new(name, Arc::clone(&text)),
            span: problem.span.map(Into::into),
            message: problem.message,
            help: problem.help,
        };
        Self {
            name: name.to_owned(),
            count: problems.len(),
            reports: problems.into_iter().map(report).collect(),
        }
    }
}

#[derive(Debug)]
struct Report {
    severity: miette::Severity,
    message: String,
    help: Option<String>,
    text: NamedSource<Arc<String>>,
    span: Option<SourceSpan>,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Report {}

impl Diagnostic for Report {
    fn severity(&self) -> Option<miette::Severity> {
        Some(self.severity)
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let help = self.help.as_ref()?;
        Some(Box::new(help))
    }

    fn source_code(&self) -> Option<&dyn miette::SourceCode> {
        self.span.as_ref()?;
        Some(&self.text)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = miette::LabeledSpan> + '_>> {
        let label = miette::LabeledSpan::new_with_span(None, self.span?);
        Some(Box::new(std::iter::once(label)))
    }
}
