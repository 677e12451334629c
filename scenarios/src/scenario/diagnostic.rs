//! What can be wrong with a scenario. Every problem carries the bytes it is about, so that the
//! report underlines them; all problems of a file come in one report.

use super::occupancy::MapError;
use miette::{Diagnostic, LabeledSpan, NamedSource, SourceSpan};
use std::fmt;
use std::path::PathBuf;
use thiserror::Error;

/// Why a scenario could not be loaded.
#[derive(Debug, Error, Diagnostic)]
pub enum LoadError {
    /// The file could not be read at all.
    #[error("cannot read {}", path.display())]
    #[diagnostic(help("a scenario is a folder with a file scenario.toml in it"))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file was read, and what it says is wrong.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Invalid(#[from] Box<Invalid>),
}

/// All that is wrong with one file.
#[derive(Debug, Error, Diagnostic)]
#[error("{file} has {} problem{}", problems.len(), if problems.len() == 1 { "" } else { "s" })]
pub struct Invalid {
    /// The file, as shown to its author.
    pub file: String,
    /// Its text.
    #[source_code]
    pub text: NamedSource<String>,
    /// In the order of the file.
    #[related]
    pub problems: Vec<Problem>,
}

impl Invalid {
    pub(crate) fn new(file: &str, text: &str, mut problems: Vec<Problem>) -> Self {
        problems.sort_by_key(|problem| (problem.span.offset(), problem.span.len()));
        for problem in &mut problems {
            let before = &text[..text.floor_char_boundary(problem.span.offset())];
            problem.line = before.matches('\n').count() + 1;
            problem.column = before.chars().rev().take_while(|&c| c != '\n').count() + 1;
        }
        Self {
            file: file.to_owned(),
            text: NamedSource::new(file, text.to_owned()),
            problems,
        }
    }
}

/// One thing that is wrong, and where.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// What is wrong.
    pub kind: ProblemKind,
    /// Where, in bytes of the text.
    pub span: SourceSpan,
    /// The line it begins in, from 1.
    pub line: usize,
    /// The character of that line it begins at, from 1.
    pub column: usize,
}

impl Problem {
    pub(crate) fn new(kind: ProblemKind, span: std::ops::Range<usize>) -> Self {
        Self {
            kind,
            span: span.into(),
            line: 0,
            column: 0,
        }
    }
}

/// What is wrong with a piece of the file.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ProblemKind {
    /// Not TOML, or not a line of the expected format.
    #[error("{message}")]
    Syntax {
        /// What the parser said.
        message: String,
    },
    /// A key nobody reads.
    #[error("unknown key `{key}` in {table}")]
    UnknownKey {
        /// The key.
        key: String,
        /// What it was found in.
        table: String,
        /// The nearest key that exists, or all that exist.
        help: String,
    },
    /// A key that must be there.
    #[error("{table} lacks `{key}`")]
    MissingKey {
        /// The key.
        key: String,
        /// What lacks it.
        table: String,
    },
    /// A value of another type.
    #[error("`{key}` must be {expected}")]
    WrongType {
        /// Whose value.
        key: String,
        /// What it must be.
        expected: &'static str,
    },
    /// A number that is no quantity: NaN or infinite.
    #[error("`{key}` must be a finite number")]
    NotFinite {
        /// Whose value.
        key: String,
    },
    /// A number outside its range.
    #[error("`{key}` must be {allowed}")]
    OutOfRange {
        /// Whose value.
        key: String,
        /// What is allowed.
        allowed: &'static str,
    },
    /// A figure of social mapping that cannot be.
    #[error("{message}")]
    Figure {
        /// What it has to be.
        message: String,
    },
    /// A name that names nothing.
    #[error("there is no {kind} called `{name}`")]
    UnknownName {
        /// What was looked for.
        kind: &'static str,
        /// By this name.
        name: String,
        /// The nearest name that exists, or all that exist.
        help: String,
    },
    /// A name that is taken.
    #[error("the name `{name}` is used twice")]
    DuplicateName {
        /// The name.
        name: String,
        /// The line of its first use.
        line: usize,
    },
    /// A name that a node of the graph has.
    #[error("there is already a node `{name}`")]
    TakenName {
        /// The name.
        name: String,
    },
    /// A name that could not be written in a rule or a path.
    #[error("`{name}` is not a name")]
    BadName {
        /// As written.
        name: String,
    },
    /// Not an area.
    #[error("room `{room}` has {corners} corners, a polygon needs at least 3")]
    TooFewCorners {
        /// The room.
        room: String,
        /// How many it has.
        corners: usize,
    },
    /// An outline that crosses itself or has no area.
    #[error("the outline of room `{room}` crosses itself or encloses nothing")]
    CrossedOutline {
        /// The room.
        room: String,
    },
    /// A door in the middle of a room, or nowhere.
    #[error("this door is not on a wall of room `{room}`: the nearest is {distance:.2} m away")]
    DoorOffWall {
        /// The room.
        room: String,
        /// From the door's middle to the outline, m.
        distance: f64,
    },
    /// A door that does not fit into its wall.
    #[error("this door is {width} m wide, the wall of room `{room}` leaves room for {space:.2} m")]
    DoorTooWide {
        /// The room.
        room: String,
        /// As asked for, m.
        width: f64,
        /// The widest that fits about that middle, m.
        space: f64,
    },
    /// A door from a room to itself.
    #[error("a door joins two different rooms, this one has `{room}` on both sides")]
    DoorToItself {
        /// The room.
        room: String,
    },
    /// Something that must be in a room and is not.
    #[error("{what} is in no room")]
    OutsideRooms {
        /// What it is.
        what: String,
    },
    /// Something that stands inside a wall or another thing.
    #[error("{what} does not fit here: {obstacle} is in the way")]
    NoSpace {
        /// What it is.
        what: String,
        /// What is in the way.
        obstacle: String,
    },
    /// A duration that is no duration.
    #[error("this activity ends before it starts")]
    EndsBeforeStart,
    /// A duration of nothing.
    #[error("this activity ends when it starts")]
    EndsAtStart,
    /// A schedule that says nothing, or two things at once.
    #[error("{message}")]
    BadEntry {
        /// What is wrong with it.
        message: &'static str,
    },
    /// A mission that can begin only after its own success.
    #[error("mission `{mission}` waits for itself{}{}", if .by.is_empty() { "" } else { ", by way of " }, .by.join(" and "))]
    WaitsForItself {
        /// The mission.
        mission: String,
        /// Those between it and itself.
        by: Vec<String>,
    },
    /// A mission that waits for one that will not succeed.
    #[error("mission `{mission}` {outcome}, and does not begin again")]
    WaitsInVain {
        /// The mission that is waited for.
        mission: String,
        /// What became of it.
        outcome: String,
    },
    /// Neither a time nor a date with a time.
    #[error("`{text}` is not {expected}")]
    NotATime {
        /// As written.
        text: String,
        /// What it must be.
        expected: &'static str,
    },
    /// An occupancy map that cannot be used.
    #[error("map `{path}`: {error}")]
    Map {
        /// As written.
        path: String,
        /// What is wrong with it.
        error: MapError,
    },
    /// A file that the scenario names and that cannot be read.
    #[error("cannot read `{path}`: {reason}")]
    UnreadableFile {
        /// As written.
        path: String,
        /// What the system said.
        reason: String,
    },
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.kind.fmt(f)
    }
}

impl std::error::Error for Problem {}

impl Diagnostic for Problem {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        match &self.kind {
            ProblemKind::UnknownKey { help, .. } | ProblemKind::UnknownName { help, .. } => {
                (!help.is_empty()).then(|| Box::new(help) as Box<dyn fmt::Display>)
            }
            ProblemKind::DuplicateName { line, .. } => {
                Some(Box::new(format!("first used in line {line}")))
            }
            ProblemKind::BadName { .. } => {
                Some(Box::new("letters, digits and _, beginning with a letter"))
            }
            _ => None,
        }
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        Some(Box::new(std::iter::once(LabeledSpan::new_with_span(
            None, self.span,
        ))))
    }
}
