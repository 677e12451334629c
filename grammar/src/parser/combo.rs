//! Combo rules: steps, and which of their variables are one node.
//!
//! Guarantee: a broken line is reported, and the other lines are still read.

use super::Parser;
use super::rule::{Action, Header};
use crate::{Combo, ComboStep, ComboVariable, Problem};
use dsr::suggest;
use std::ops::Range;

const STEP: &str = "a step `rule as alias`, or `where:`";

impl Parser<'_> {
    /// After the `{` of a combo.
    pub(super) fn combo_body(&mut self, header: Header, opening: Range<usize>) -> Option<Action> {
        let told = self.findings.len();
        let mut steps = Vec::new();
        let mut equalities = Vec::new();
        let mut where_seen = false;
        while !self.eat("}") {
            if self.peek().is_none() {
                self.unclosed(opening, '{');
                return None;
            }
            let before = self.at;
            let read = if self.at_where(where_seen) {
                let range = self.where_word();
                if std::mem::replace(&mut where_seen, true) {
                    self.repeated(range, "`where:`".to_owned());
                }
                Some(())
            } else if where_seen {
                self.equality().map(|equality| equalities.push(equality))
            } else {
                self.combo_step().map(|step| steps.push(step))
            };
            if read.is_none() {
                self.skip_broken_line(before);
            }
        }
        if steps.is_empty() && self.findings.len() == told {
            let expected = "a step `rule as alias`".to_owned();
            let (found, suggestion) = ("none".to_owned(), None);
            let problem = Problem::Expected {
                expected,
                found,
                suggestion,
            };
            self.report(opening, problem);
        }
        for word in header.modifiers.iter().chain(&header.clauses) {
            let (span, word) = (word.span(), word.to_string());
            self.report(span.start..span.end, Problem::NotOfCombo { word });
        }
        Some(Action::Combo(Combo {
            name: header.name,
            cost: header.constant_cost.as_number().unwrap_or_default(),
            kind: header.kind,
            steps,
            equalities,
            comments: Vec::new(),
        }))
    }

    /// Whether `where:` stands here. Before there was one, any other word before a colon is meant to be one.
    fn at_where(&self, seen: bool) -> bool {
        let colon = self.is_symbol_at(self.at + 1, ":");
        if self.is_word("where") {
            let step = self.token_text(self.at + 1) == "as";
            return colon || !(seen || step);
        }
        colon && !seen && self.is_word_at(self.at)
    }

    fn where_word(&mut self) -> Range<usize> {
        if !self.is_word("where") {
            self.expected(STEP, &["where"]);
        }
        let range = self.bump();
        self.expect(":", "`:` after `where`");
        range
    }

    fn combo_step(&mut self) -> Option<ComboStep> {
        let rule = self.name(STEP)?;
        let goes_on = |parser: &Self| parser.peek().is_some_and(|token| !token.first_on_line);
        let expected = "`as` and an alias";
        if !goes_on(self) {
            self.expected(expected, &[]);
            return None;
        }
        self.keyword_among(&["as"], expected)?;
        self.bump();
        let alias = self.name("an alias")?;
        // On the next line it would be the rule of the next step.
        let optional = goes_on(self) && self.is_optional();
        if optional {
            self.keyword_among(
                &["optional"],
                "`optional`, or the next step on its own line",
            );
            self.bump();
        }
        Some(ComboStep {
            rule,
            alias,
            optional,
        })
    }

    /// Whether the word is `optional` or meant to be: no step begins with it.
    fn is_optional(&self) -> bool {
        let (word, next) = (self.token_text(self.at), self.token_text(self.at + 1));
        let misspelt = || suggest(word, ["optional"]).is_some() && !matches!(next, "as" | ":");
        self.is_word_at(self.at) && (word == "optional" || misspelt())
    }

    fn equality(&mut self) -> Option<Vec<ComboVariable>> {
        let bracketed = self.eat("(");
        let mut variables = vec![self.combo_variable()?];
        while self.eat("=") {
            variables.push(self.combo_variable()?);
        }
        if variables.len() < 2 {
            self.expected("`=` and another `alias.variable`", &[]);
            return None;
        }
        if bracketed {
            self.expect(")", "`)`")?;
        }
        Some(variables)
    }

    fn combo_variable(&mut self) -> Option<ComboVariable> {
        let alias = self.name("`alias.variable`")?;
        self.expect(".", "`.` and a variable")?;
        let variable = self.name("a variable")?;
        Some(ComboVariable { alias, variable })
    }
}
