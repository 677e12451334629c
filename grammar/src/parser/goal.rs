//! Goal files: one graph and a condition.
//!
//! Guarantee: every digit-leading or quoted node of the graph is a constant of the goal.

use super::{Finding, NodeNames, Parser};
use crate::lexer::unquote;
use crate::{Constant, Goal, Name, Problem};

/// A goal file as far as it could be read.
#[derive(Debug)]
pub(crate) struct ParsedGoal {
    /// For checking only if something is `broken`.
    pub(crate) goal: Option<Goal>,
    pub(crate) broken: bool,
    /// Words in the parts that could not be read.
    pub(crate) lost: Vec<Name>,
    pub(crate) findings: Vec<Finding>,
}

/// Reads a goal.
pub(crate) fn parse_goal_file(text: &str) -> ParsedGoal {
    let mut parser = Parser::new(text, 0, 0, NodeNames::Goal);
    let goal = parser.goal();
    let Parser {
        fatal,
        lost,
        findings,
        ..
    } = parser;
    ParsedGoal {
        goal,
        broken: fatal > 0,
        lost,
        findings,
    }
}

impl Parser<'_> {
    fn goal(&mut self) -> Option<Goal> {
        let pattern = self.graph("`{` and the goal's graph")?;
        let mut goal = Goal {
            pattern,
            ..Goal::default()
        };
        let expected = "`precondition` or the end of the goal";
        if self.is_word_at(self.at) && self.keyword_among(&["precondition"], expected).is_some() {
            self.bump();
            if let Some(opening) = self.expect("{", "`{`") {
                goal.precondition = self.condition_block(opening);
            }
            if self.peek().is_some() {
                self.expected("the end of the goal", &[]);
            }
        } else if self.peek().is_some() && !self.is_word_at(self.at) {
            self.expected(expected, &[]);
        }
        for node in &goal.pattern.nodes {
            let variable = &node.variable;
            let constant = if variable.starts_with('"') {
                Constant::Name(unquote(variable))
            } else if variable.starts_with(|c: char| c.is_ascii_digit()) {
                if let Ok(id) = variable.parse() {
                    Constant::Id(id)
                } else {
                    let span = variable.span();
                    let found = variable.to_string();
                    let (what, range) = ("a node's id", "a whole number below 2^64");
                    let problem = Problem::OutOfRange { what, range, found };
                    self.report(span.start..span.end, problem);
                    continue;
                }
            } else {
                continue;
            };
            goal.constants.insert(variable.to_string(), constant);
        }
        Some(goal)
    }
}
