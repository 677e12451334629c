//! What is wrong with PDDL files. This file guarantees that each defect points into the file that
//! it speaks of.

use grammar::{SourceFile, Span};
use miette::{LabeledSpan, SourceCode};
use std::fmt;
use thiserror::Error;

/// Everything that is wrong with a domain and a problem, as one error.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Defects {
    list: Vec<Defect>,
}

/// One defect of a PDDL file.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{problem}")]
pub struct Defect {
    /// What is wrong.
    pub problem: Problem,
    /// Where.
    pub span: Span,
    /// The file that `span` lies in.
    pub file: SourceFile,
}

/// Every way in which a PDDL file can be wrong, or ask for more than the planner can do.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Problem {
    /// A bracket that is never closed.
    #[error("`(` is never closed")]
    Unclosed,
    /// A bracket that closes nothing.
    #[error("`)` closes nothing")]
    Stray,
    /// Text behind the definition.
    #[error("the definition ends before this")]
    AfterTheEnd,
    /// No definition at all.
    #[error("there is no `(define ...)` in this file")]
    Empty,
    /// Lists nested deeper than is read.
    #[error("nested more than {0} deep")]
    TooDeep(usize),
    /// Something else than may stand here.
    #[error("expected {expected}, found {found}")]
    Expected {
        /// What may stand here.
        expected: String,
        /// What stands here.
        found: String,
    },
    /// A name that is not declared.
    #[error("no {what} `{name}` is declared")]
    Unknown {
        /// Kind of thing.
        what: &'static str,
        /// As written.
        name: String,
        /// What was probably meant.
        suggestion: Option<String>,
    },
    /// A name declared twice.
    #[error("{what} `{name}` is declared twice")]
    Duplicate {
        /// Kind of thing.
        what: &'static str,
        /// As written.
        name: String,
    },
    /// More or fewer arguments than declared.
    #[error("`{name}` takes {takes} arguments, not {given}")]
    Arguments {
        /// Predicate or function.
        name: String,
        /// How many are declared.
        takes: usize,
        /// How many are given.
        given: usize,
    },
    /// An argument that is never of the type that is declared.
    #[error("`{name}` is a `{found}`, not a `{wanted}`")]
    WrongType {
        /// Variable or object.
        name: String,
        /// Its type.
        found: String,
        /// The type that is declared.
        wanted: String,
    },
    /// A type that inherits from itself.
    #[error("type `{0}` inherits from itself")]
    CyclicType(String),
    /// A requirement or construct that the planner does not have.
    #[error("{0} is not supported")]
    Unsupported(String),
    /// The problem is of another domain.
    #[error("this problem is for the domain `{wanted}`, the domain is `{found}`")]
    OtherDomain {
        /// Which the problem names.
        wanted: String,
        /// Which is given.
        found: String,
    },
    /// A part of a definition that is missing.
    #[error("there is no {0}")]
    Missing(&'static str),
}

impl Problem {
    pub(super) fn expected(expected: impl Into<String>, found: &str) -> Self {
        Self::Expected {
            expected: expected.into(),
            found: format!("`{found}`"),
        }
    }

    /// What to do about it, where that is known.
    pub fn help(&self) -> Option<String> {
        match self {
            Self::Unknown { suggestion, .. } => suggestion
                .as_ref()
                .map(|name| format!("did you mean `{name}`?")),
            _ => None,
        }
    }
}

impl Defects {
    pub(super) fn add(&mut self, file: &SourceFile, span: Span, problem: Problem) {
        self.list.push(Defect {
            problem,
            span,
            file: file.clone(),
        });
    }

    /// Whether nothing is wrong.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// The defects, in the order in which they were found.
    pub fn iter(&self) -> impl Iterator<Item = &Defect> {
        self.list.iter()
    }
}

impl fmt::Display for Defects {
    /// One line per defect: `file:line:column: problem`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, defect) in self.list.iter().enumerate() {
            if index > 0 {
                writeln!(f)?;
            }
            let (line, column) = defect.file.line_and_column(defect.span.start);
            write!(f, "{}:{line}:{column}: {defect}", defect.file.name())?;
            if let Some(help) = defect.problem.help() {
                write!(f, " ({help})")?;
            }
        }
        Ok(())
    }
}

impl std::error::Error for Defects {}

impl miette::Diagnostic for Defects {
    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn miette::Diagnostic> + 'a>> {
        Some(Box::new(self.list.iter().map(|defect| defect as _)))
    }
}

impl miette::Diagnostic for Defect {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let help = self.problem.help()?;
        Some(Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        Some(&self.file)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let here = match &self.problem {
            Problem::Expected { expected, .. } => format!("expected {expected}"),
            _ => "here".to_owned(),
        };
        let label = LabeledSpan::new_primary_with_span(Some(here), self.file.underlined(self.span));
        Some(Box::new(std::iter::once(label)))
    }
}
