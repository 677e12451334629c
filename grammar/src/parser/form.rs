//! Brackets: from tokens to nested lists of words, numbers and paths.
//!
//! Guarantee: every bracket is paired or reported, and nothing is nested deeper than
//! [`DEPTH_LIMIT`].

use super::{DEPTH_LIMIT, Parser};
use crate::lexer::TokenKind;
use crate::{AttributePath, Name, PatternNode, Problem, Span};
use std::ops::Range;

/// A formula whose brackets are paired and whose words have no meaning yet.
#[derive(Debug)]
pub(super) enum Form {
    List(Vec<Form>, Span),
    Word(Name),
    /// A number, which can also name a node if it is digits.
    Number(Name),
    Text(Name),
    Typed(PatternNode),
    Path(AttributePath, Span),
}

impl Form {
    pub(super) fn span(&self) -> Span {
        match self {
            Self::List(_, span) | Self::Path(_, span) => *span,
            Self::Word(name) | Self::Number(name) | Self::Text(name) => name.span(),
            Self::Typed(node) => node.variable.span().to(node.type_name.span()),
        }
    }
}

impl Parser<'_> {
    /// The formulas of a block, after its `{`.
    pub(super) fn forms(&mut self, opening: Range<usize>) -> Vec<Form> {
        let mut forms = Vec::new();
        loop {
            if self.eat("}") {
                return forms;
            }
            if self.peek().is_none() || self.is_symbol("{") || self.at_section() {
                self.unclosed(opening, '{');
                return forms;
            }
            if self.is_symbol(")") {
                let range = self.bump();
                self.report(range, Problem::Stray(")".to_owned()));
            } else if self.is_symbol("(") {
                forms.extend(self.form(0));
            } else {
                self.expected("a formula `( ... )` or `}`", &[]);
                while self.peek().is_some() && !["(", "{", "}"].iter().any(|s| self.is_symbol(s)) {
                    self.bump();
                }
            }
        }
    }

    /// One formula; a word or number by itself is one, too. Reads at least one token.
    pub(super) fn form(&mut self, depth: usize) -> Option<Form> {
        let token = self.peek()?.clone();
        let at = self.at;
        match token.kind {
            TokenKind::Symbol("(") => self.list(depth),
            TokenKind::Word if self.begins_edge_path(at) => self.edge_path(),
            TokenKind::Word | TokenKind::Number
                if self.is_symbol_at(at + 1, ":")
                    && (token.kind == TokenKind::Word || self.is_digits(at)) =>
            {
                let variable = self.bump_name();
                self.bump();
                let type_name = self.name("a type")?;
                Some(Form::Typed(PatternNode::new(variable, type_name)))
            }
            TokenKind::Word => {
                let name = self.bump_name();
                self.maybe_path(name, Form::Word)
            }
            TokenKind::Number => {
                self.number("a number")?;
                let name = Name::new(&self.text[token.range.clone()], self.span(token.range));
                if self.is_digits(at) {
                    return self.maybe_path(name, Form::Number);
                }
                Some(Form::Number(name))
            }
            TokenKind::Text => {
                let name = self.bump_name();
                self.maybe_path(name, Form::Text)
            }
            TokenKind::Symbol(_) => Some(Form::Word(self.bump_name())),
            TokenKind::Path => {
                self.expected("a formula", &[]);
                self.bump();
                None
            }
        }
    }

    fn list(&mut self, depth: usize) -> Option<Form> {
        let opening = self.bump();
        if depth >= DEPTH_LIMIT {
            self.report(opening, Problem::TooDeep { limit: DEPTH_LIMIT });
            self.skip_brackets();
            return None;
        }
        let mut items = Vec::new();
        let mut whole = true;
        while !self.is_symbol(")") {
            if self.peek().is_none() || self.is_symbol("{") || self.is_symbol("}") {
                self.unclosed(opening, '(');
                return None;
            }
            match self.form(depth + 1) {
                Some(item) => items.push(item),
                None => whole = false,
            }
        }
        let closing = self.bump();
        // A list that lost an item would only bring on errors about what it lacks.
        whole.then(|| Form::List(items, self.span(opening.start..closing.end)))
    }

    /// Skips to the bracket that closes the one just read.
    fn skip_brackets(&mut self) {
        let mut depth = 1_usize;
        while self.peek().is_some() && !self.is_symbol("{") && !self.is_symbol("}") {
            if self.is_symbol("(") {
                depth += 1;
            } else if self.is_symbol(")") {
                depth -= 1;
            }
            self.bump();
            if depth == 0 {
                break;
            }
        }
    }

    fn maybe_path(&mut self, variable: Name, otherwise: impl FnOnce(Name) -> Form) -> Option<Form> {
        if !self.eat(".") {
            return Some(otherwise(variable));
        }
        let attribute = self.word("an attribute's name")?;
        let span = variable.span().to(attribute.span());
        Some(Form::Path(
            AttributePath::Node {
                variable,
                attribute,
            },
            span,
        ))
    }

    /// `e(`, without a blank between.
    fn begins_edge_path(&self, at: usize) -> bool {
        self.token_text(at) == "e"
            && self.is_symbol_at(at + 1, "(")
            && self.tokens[at].range.end == self.tokens[at + 1].range.start
    }

    fn edge_path(&mut self) -> Option<Form> {
        let start = self.bump();
        self.bump();
        let Some((from, label, to)) = self.edge_ends() else {
            self.skip_brackets();
            return None;
        };
        self.expect(".", "`.` and an attribute")?;
        let attribute = self.word("an attribute's name")?;
        let span = self.span(start).to(attribute.span());
        Some(Form::Path(
            AttributePath::Edge {
                from,
                label,
                to,
                attribute,
            },
            span,
        ))
    }

    /// `a, label, b)`.
    fn edge_ends(&mut self) -> Option<(Name, Name, Name)> {
        let from = self.node("the node that the link leaves")?;
        self.expect(",", "`,` and the link's label")?;
        let label = self.name("the link's label")?;
        self.expect(",", "`,` and the node that the link enters")?;
        let to = self.node("the node that the link enters")?;
        self.expect(")", "`)`")?;
        Some((from, label, to))
    }
}
