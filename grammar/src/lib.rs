//! AGGL, the language of graph rules: parse, check, match, apply, print.
//!
//! A rule is a pair of typed graphs: wherever the left one is found in the shared graph, and the
//! rule's condition holds, it may be rewritten into the right one. This package reads rules and
//! goals, says what is wrong with them, finds their matches and computes what applying one
//! changes. It does no IO, reads no clock and starts no thread: included files come through a
//! function that the caller gives.
#![forbid(unsafe_code)]

mod apply;
mod binding;
mod check;
mod diagnostic;
mod goal;
mod grammar;
mod lexer;
mod load;
mod matching;
mod parser;
mod print;
mod rule;
mod source;
#[cfg(test)]
mod testing;

pub use apply::ApplyError;
pub use binding::Binding;
pub use diagnostic::{Diagnostic, Problem, Severity};
pub use goal::GoalConstants;
pub use grammar::{
    Combo, ComboStep, ComboVariable, Constant, Goal, Grammar, Include, Property, TypeDeclaration,
    Types,
};
pub use load::{Defects, Loader, has_errors, load_grammar, parse_goal, parse_grammar};
pub use matching::{End, MatchError, Matches, Obstacle, ValueError};
pub use parser::DEPTH_LIMIT;
pub use rule::{
    Arithmetic, AttributePath, Comparison, Condition, Effect, Expression, Kind, Literal, Pattern,
    PatternEdge, PatternNode, Rule,
};
pub use source::{Name, SourceFile, Span};
