//! What is wrong with a file, where, and what would be right.
//!
//! Guarantee: every diagnostic points into the file it speaks of, and renders with miette.

use crate::{SourceFile, Span};
use miette::{LabeledSpan, SourceCode};
use std::fmt;

/// One defect of a grammar or goal file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{problem}")]
pub struct Diagnostic {
    /// What is wrong.
    pub problem: Problem,
    /// Where.
    pub span: Span,
    /// The file that `span` lies in.
    pub file: SourceFile,
    /// An earlier place of the same file that belongs to it, and what it is.
    pub related: Option<(Span, String)>,
}

impl Diagnostic {
    /// Whether the file must not be used as it is, or may.
    pub fn severity(&self) -> Severity {
        self.problem.severity()
    }

    /// Line and column of its first character, counted from 1.
    pub fn line_and_column(&self) -> (usize, usize) {
        self.file.line_and_column(self.span.start)
    }
}

/// How bad a defect is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// Worth knowing; nothing is wrong.
    Note,
    /// Suspicious, but its meaning is clear.
    Warning,
    /// The file is wrong; what could be read of it is there nevertheless.
    Error,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Error => "error",
        })
    }
}

/// Every way in which a grammar or goal file can be wrong.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// The text does not follow the syntax.
    #[error("expected {expected}, found {found}")]
    Expected {
        /// What may stand here.
        expected: String,
        /// What stands here.
        found: String,
        /// What was probably meant.
        suggestion: Option<String>,
    },
    /// A character that no token begins with.
    #[error("unknown character {0:?}")]
    UnknownCharacter(char),
    /// A text in quotes that its line does not end.
    #[error("this text has no closing quote on its line")]
    UnclosedText,
    /// A bracket whose partner is missing.
    #[error("`{opening}` is never closed")]
    Unclosed {
        /// The bracket.
        opening: char,
    },
    /// A bracket that closes nothing.
    #[error("`{0}` closes nothing")]
    Stray(String),
    /// A word that belongs before a rule's name and stands after it.
    #[error("`{word}` stands before a rule's name, not here")]
    Misplaced {
        /// The word.
        word: String,
        /// The rule.
        rule: String,
    },
    /// A clause or modifier that only a rule can have, at a combo.
    #[error("a combo has no `{word}`, but the rules that are its steps may")]
    NotOfCombo {
        /// The word.
        word: String,
    },
    /// A number outside of what is allowed.
    #[error("{what} must be {range}, not {found}")]
    OutOfRange {
        /// Which number.
        what: &'static str,
        /// What it may be.
        range: &'static str,
        /// What it is.
        found: String,
    },
    /// A rule that binds more nodes than [`crate::NODE_LIMIT`].
    #[error("a rule binds at most {limit} nodes, and this one {found}")]
    TooLarge {
        /// The limit.
        limit: usize,
        /// How many it binds.
        found: usize,
    },
    /// Formulas nested deeper than [`crate::DEPTH_LIMIT`].
    #[error("nested more than {limit} deep")]
    TooDeep {
        /// The limit.
        limit: usize,
    },
    /// The same clause, block or header twice.
    #[error("{what} is given twice")]
    Repeated {
        /// What.
        what: String,
    },
    /// A name declared twice in one scope.
    #[error("{what} `{name}` is declared twice")]
    Duplicate {
        /// Kind of thing: variable, type, rule, alias, link.
        what: &'static str,
        /// Its name.
        name: String,
    },
    /// A variable that its scope does not have.
    #[error("no variable `{name}` {scope}")]
    UnknownVariable {
        /// As written.
        name: String,
        /// The scope, in words ("on the left side").
        scope: &'static str,
        /// What was probably meant.
        suggestion: Option<String>,
    },
    /// A type that is not declared.
    #[error("no type `{name}`")]
    UnknownType {
        /// As written.
        name: String,
        /// What was probably meant.
        suggestion: Option<String>,
    },
    /// A type or rule that none of the files that could be read has; one that is missing may.
    #[error(
        "no {what} `{name}` in the files that could be read: one that is missing may declare it"
    )]
    NotRead {
        /// Kind of thing: type, rule.
        what: &'static str,
        /// As written.
        name: String,
        /// What was probably meant.
        suggestion: Option<String>,
    },
    /// A type that others inherit from, that is not declared itself and looks like one that is.
    #[error("type `{name}` is not declared, and taken as one that inherits from nothing")]
    UndeclaredParent {
        /// As written.
        name: String,
        /// What was probably meant.
        suggestion: String,
    },
    /// A rule, combo step, alias or effect that is not there.
    #[error("no {what} `{name}`")]
    UnknownName {
        /// Kind of thing: rule, alias, effect.
        what: &'static str,
        /// As written.
        name: String,
        /// What was probably meant.
        suggestion: Option<String>,
    },
    /// A type that inherits from itself.
    #[error("type `{name}` inherits from itself")]
    CyclicType {
        /// The type.
        name: String,
    },
    /// The same link both wanted and starred on one side.
    #[error("the link `{link}` is both there and starred on the {side} side")]
    Contradiction {
        /// As written.
        link: String,
        /// `left` or `right`.
        side: &'static str,
    },
    /// A node used in an effect although the rule deletes it.
    #[error("`{name}` is deleted by this rule")]
    Deleted {
        /// The variable.
        name: String,
    },
    /// Variables that a combo equates although no node can be both.
    #[error("`{first}` is a `{first_type}` and `{second}` a `{second_type}`: never the same node")]
    Incompatible {
        /// One variable with its alias.
        first: String,
        /// Its type.
        first_type: String,
        /// The other variable with its alias.
        second: String,
        /// Its type.
        second_type: String,
    },
    /// An operand of the wrong kind: text in an addition, say.
    #[error("{operator} takes {expected}, not {found}")]
    WrongOperand {
        /// As written.
        operator: &'static str,
        /// What it takes.
        expected: &'static str,
        /// What stands there.
        found: &'static str,
    },
    /// A name that the graph's schema does not have.
    #[error("the schema has no {what} `{name}`")]
    NotInSchema {
        /// type, label or attribute.
        what: &'static str,
        /// As written.
        name: String,
        /// What was probably meant.
        suggestion: Option<String>,
    },
    /// A link that the schema allows between no nodes of these types.
    #[error("`{label}` never joins a `{from}` to a `{to}` by the schema")]
    WrongEnds {
        /// The label.
        label: String,
        /// Type of the node that it leaves.
        from: String,
        /// Type of the node that it enters.
        to: String,
    },
    /// A value that the schema does not let an attribute have.
    #[error("this can never be assigned: {reason}")]
    NeverAssigned {
        /// Why.
        reason: String,
    },
    /// A combo that no rule says what it does.
    #[error("this combo cannot be applied as one: {reason}")]
    NotUnfolded {
        /// Why.
        reason: String,
    },
    /// A cost or duration of what the schema says to be no number.
    #[error("a cost or duration is a number, and `{path}` is a {kind} by the schema")]
    NoNumber {
        /// The attribute, as it is written.
        path: String,
        /// Its kind.
        kind: String,
    },
    /// An attribute is assigned to a link that the rule neither needs nor makes.
    #[error(
        "nothing in this rule says that there is a link `{link}`: where there is none, nothing is assigned"
    )]
    MaybeNoLink {
        /// The link, as in a graph.
        link: String,
    },
    /// An attribute is assigned to a link that the rule takes away.
    #[error("this rule takes away the link `{link}`, so that nothing is assigned to it")]
    LinkTaken {
        /// The link, as in a graph.
        link: String,
    },
    /// A cost or duration that is no number of 0 or more at any match.
    #[error("this is a number of 0 or more at no match of the rule: {reason}")]
    NeverAmount {
        /// Why.
        reason: String,
    },
    /// A combo of which the steps are a rule only without optional ones.
    #[error("this combo is never applied with all its steps: {reason}")]
    NeverWhole {
        /// Why.
        reason: String,
    },
    /// A rule whose left side and precondition hold in no graph.
    #[error("this rule never matches: {reason}")]
    NeverMatches {
        /// Why.
        reason: String,
    },
    /// A variable that only asks for one more node.
    #[error("nothing uses `{name}`: it only asks for one more `{type_name}`")]
    UnusedVariable {
        /// The variable.
        name: String,
        /// Its type.
        type_name: String,
    },
    /// A rule that no rule can make applicable.
    #[error("this rule can never be applied: {reason}")]
    Unreachable {
        /// What is missing.
        reason: String,
    },
    /// A rule that can make another one inapplicable.
    #[error("`{first}` can disable `{second}` ({reason}) where there are {graph}")]
    Conflict {
        /// The rule that is applied.
        first: String,
        /// The rule that is not applicable afterwards.
        second: String,
        /// What it lacks then.
        reason: String,
        /// The smallest graph where both are applicable, in words.
        graph: String,
    },
    /// A rule of an agent that may not apply it.
    #[error("the manifest of `{agent}` gives no right to apply this rule")]
    NotGiven {
        /// The agent.
        agent: String,
    },
    /// An effect that the agent may have by no other right than the rule.
    #[error("{what}, which the manifest of `{agent}` gives only by this rule")]
    BeyondManifest {
        /// What it does.
        what: String,
        /// The agent.
        agent: String,
    },
    /// An included file that could not be read.
    #[error("cannot read the included file `{path}`: {reason}")]
    Include {
        /// As written.
        path: String,
        /// Why.
        reason: String,
    },
}

impl Problem {
    /// Whether the file must not be used as it is, or may.
    pub fn severity(&self) -> Severity {
        match self {
            Self::Incompatible { .. }
            | Self::NotRead { .. }
            | Self::UndeclaredParent { .. }
            | Self::NotUnfolded { .. }
            | Self::NeverWhole { .. }
            | Self::MaybeNoLink { .. }
            | Self::LinkTaken { .. }
            | Self::NeverAmount { .. }
            | Self::NeverMatches { .. }
            | Self::UnusedVariable { .. }
            | Self::BeyondManifest { .. }
            | Self::Unreachable { .. } => Severity::Warning,
            Self::Conflict { .. } => Severity::Note,
            _ => Severity::Error,
        }
    }

    /// What to do about it, where that is known.
    pub fn help(&self) -> Option<String> {
        match self {
            Self::Expected { suggestion, .. }
            | Self::UnknownVariable { suggestion, .. }
            | Self::UnknownType { suggestion, .. }
            | Self::NotRead { suggestion, .. }
            | Self::NotInSchema { suggestion, .. }
            | Self::UnknownName { suggestion, .. } => suggestion
                .as_ref()
                .map(|name| format!("did you mean `{name}`?")),
            Self::UndeclaredParent { suggestion, .. } => {
                Some(format!("did you mean `{suggestion}`?"))
            }
            Self::NotGiven { .. } => {
                Some("name it, or `agent(NAME)`, under `rules` in the manifest".to_owned())
            }
            Self::Misplaced { word, rule } => Some(format!("write `{word} {rule} : ...`")),
            Self::Stray(_) => Some("remove it, or look for a missing opening bracket".to_owned()),
            Self::Deleted { .. } => {
                Some("keep the node on the right side, or leave the effect out".to_owned())
            }
            _ => None,
        }
    }
}

impl miette::Diagnostic for Diagnostic {
    fn severity(&self) -> Option<miette::Severity> {
        Some(match self.problem.severity() {
            Severity::Note => miette::Severity::Advice,
            Severity::Warning => miette::Severity::Warning,
            Severity::Error => miette::Severity::Error,
        })
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.problem
            .help()
            .map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        Some(&self.file)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let here = match &self.problem {
            Problem::Expected { expected, .. } => format!("expected {expected}"),
            _ => "here".to_owned(),
        };
        let here = LabeledSpan::new_primary_with_span(Some(here), self.file.underlined(self.span));
        let related = self.related.as_ref().map(|(span, words)| {
            LabeledSpan::new_with_span(Some(words.clone()), self.file.underlined(*span))
        });
        Some(Box::new(std::iter::once(here).chain(related)))
    }
}
