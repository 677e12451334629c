//! AGGL, the language of graph rules: parse, check, match, apply, print.
//!
//! A rule is a pair of typed graphs: wherever the left one is found in the shared graph, and the
//! rule's condition holds, it may be rewritten into the right one. This package reads rules and
//! goals, says what is wrong with them, finds their matches and computes what applying one
//! changes. It does no IO, reads no clock and starts no thread: included files come through a
//! function that the caller gives.
//!
//! ```
//! use dsr::{Graph, Schema, Time, Transaction};
//! use grammar::{Binding, parse_goal, parse_grammar};
//!
//! let mut graph = Graph::in_memory(Schema::open());
//! let mut world = Transaction::new();
//! world.create_node("robot", "shelly", vec![]);
//! world.create_node("room", "hall", vec![]);
//! world.create_node("room", "ward", vec![]);
//! world.create_edge("shelly", "in", "hall");
//! world.create_edge("hall", "connected", "ward");
//! graph.commit(&world, "world", Time::default())?;
//!
//! let (grammar, diagnostics) = parse_grammar(
//!     "name=doors
//!     ===
//!     changeRoom : active(1) agent(navigation)
//!     {
//!         { r:robot a:room b:room r->a(in) a->b(connected) }
//!         =>
//!         { r:robot a:room b:room r->b(in) a->b(connected) }
//!     }",
//!     "doors.aggl",
//! );
//! assert!(diagnostics.is_empty());
//! let snapshot = graph.snapshot();
//! let rule = grammar.rule("changeRoom").ok_or("no such rule")?;
//! let found = grammar.matches(&snapshot, rule, &Binding::new())?.next().ok_or("no match")??;
//!
//! graph.set_rules(std::sync::Arc::new(grammar.clone()));
//! let mut step = Transaction::new();
//! step.apply_rule("changeRoom", found.to_refs());
//! graph.commit(&step, "navigation", Time::default())?;
//!
//! let goal = "{ \"shelly\":robot \"ward\":room \"shelly\"->\"ward\"(in) }";
//! let goal = parse_goal(goal, "goal", &grammar.types)?;
//! assert!(grammar.goal_holds(&graph.snapshot(), &goal)?.is_some());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What the language means, where it could be taken otherwise
//! - Matching is injective. Quantified variables are not part of the match: they range over every
//!   node of their type, bound ones included.
//! - A node matches a type that its own inherits from, by the graph's schema, by the types block,
//!   or by both in turn. Without a types block any type name is allowed.
//! - Parameters are matched like nodes of the left side, and kept.
//! - A starred link on the right side is never created; it is deleted if it is there.
//! - `(= a b)` of two variables asks whether they are the same node; `(eq a b)`, which old files
//!   use, too. In all other uses `=` compares values.
//! - A comparison with an attribute that is missing, or of which order is asked and there is none,
//!   does not hold; its negation does. `/` is always real.
//! - Effects happen at once: conditions and values are read in the graph before the rule.
//!   Deleted nodes take their links along, or are refused if the rule is `strict` and did not
//!   delete those itself. See [`Grammar::apply`] for contradictions.
//! - In rules digit-leading names are variables like others; in goals they are ids of existing
//!   nodes, and names in quotes are unique names of existing nodes.
#![forbid(unsafe_code)]

mod analysis;
mod apply;
mod binding;
mod check;
mod diagnostic;
mod dot;
mod excerpt;
mod formula;
mod goal;
mod grammar;
mod lexer;
pub mod live;
mod load;
mod matching;
mod number;
mod parser;
mod print;
mod rename;
mod rewriter;
mod rule;
mod sound;
mod source;
#[cfg(test)]
mod testing;
mod unfold;

pub use analysis::{CONFLICT_LIMIT, Conflict, Conflicts, EFFORT_LIMIT, OVERLAY_LIMIT, Undecided};
pub use apply::{ApplyError, CHANGE_LIMIT};
pub use binding::Binding;
pub use check::NODE_LIMIT;
pub use diagnostic::{Diagnostic, Problem, Severity};
pub use goal::GoalConstants;
pub use grammar::{
    Combo, ComboStep, ComboVariable, Constant, Goal, Grammar, Include, Property, TypeDeclaration,
    Types,
};
pub use load::{
    Defects, Loader, SHOWN_LIMIT, format_goal, has_errors, load_grammar, parse_goal, parse_grammar,
};
pub use matching::{
    CHOICE_LIMIT, End, MatchDelta, MatchError, Matcher, Matches, Obstacle, RuleMatch, SEARCH_LIMIT,
    SearchPlan, SearchStep, SharedSteps, ValueError, WHOLE_LIMIT, Watch,
};
pub use number::Number;
pub use parser::DEPTH_LIMIT;
pub use rewriter::{RewriteError, Rewriter, WorkingGraph};
pub use rule::{
    Arithmetic, AttributePath, Comparison, Condition, Effect, Expression, Kind, Literal, Pattern,
    PatternEdge, PatternNode, Rule,
};
pub use sound::{Part, Region, Sound, Unsound};
pub use source::{Name, SourceFile, Span};
pub use unfold::{OPTIONAL_LIMIT, Unfolded, UnfoldedStep};
