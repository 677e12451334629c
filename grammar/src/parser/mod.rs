//! From tokens to the syntax tree, by recursive descent with recovery.
//!
//! Guarantee: a broken rule never hides the next one, or an include. The beginning of each is found before
//! anything is parsed, and no rule reads past the next beginning.

mod combo;
mod file;
mod form;
mod formula;
mod goal;
mod pattern;
mod rule;

pub(crate) use file::{Item, ParsedFile, parse_file};
pub(crate) use goal::{ParsedGoal, parse_goal_file};
pub(crate) use rule::{Action, Broken};

use crate::lexer::{Lexed, Token, TokenKind, lex, quote, unquote};
use crate::{Name, Problem, Span};
use dsr::suggest;
use std::ops::Range;

/// How deep formulas and expressions may be nested.
pub const DEPTH_LIMIT: usize = 64;

/// A problem, its place, and an earlier place that belongs to it.
#[derive(Debug, Clone)]
pub(crate) struct Finding {
    pub(crate) span: Span,
    pub(crate) problem: Problem,
    pub(crate) related: Option<(Span, String)>,
}

/// Names that may stand where a node is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum NodeNames {
    /// Variables only.
    Rule,
    /// Variables, ids, and names in quotes.
    Goal,
}

/// The tokens of one file and how far they are read.
///
/// Methods that return `None` have reported why.
#[derive(Debug)]
struct Parser<'a> {
    text: &'a str,
    file: u32,
    tokens: Vec<Token>,
    at: usize,
    /// Where the item being read must end: the next rule's beginning, or the end of the file.
    limit: usize,
    /// Tokens that begin a rule or an include beyond doubt, ascending.
    beginnings: Vec<usize>,
    names: NodeNames,
    findings: Vec<Finding>,
    comments: Vec<(usize, String)>,
    /// Findings after which an item cannot be used.
    fatal: usize,
    /// Words in parts of the current item that could not be read.
    lost: Vec<Name>,
    /// Where it was last reported that tokens ran out.
    end_reported: Option<usize>,
}

impl<'a> Parser<'a> {
    fn new(text: &'a str, file: u32, start: usize, names: NodeNames) -> Self {
        let Lexed {
            tokens,
            comments,
            problems,
        } = lex(text, start);
        let limit = tokens.len();
        let mut parser = Self {
            text,
            file,
            tokens,
            at: 0,
            limit,
            beginnings: Vec::new(),
            names,
            findings: Vec::new(),
            comments,
            fatal: 0,
            lost: Vec::new(),
            end_reported: None,
        };
        for (range, problem) in problems {
            parser.report(range, problem);
        }
        if names == NodeNames::Rule {
            let begins = |&at: &usize| parser.begins_rule(at) || parser.begins_include(at);
            parser.beginnings = (0..limit).filter(begins).collect();
        }
        parser
    }

    fn span(&self, range: Range<usize>) -> Span {
        Span::new(self.file, range.start, range.end)
    }

    fn report(&mut self, range: Range<usize>, problem: Problem) {
        self.report_related(range, problem, None);
    }

    fn report_related(
        &mut self,
        range: Range<usize>,
        problem: Problem,
        related: Option<(Span, String)>,
    ) {
        let readable = matches!(problem, Problem::Stray(_) | Problem::WrongOperand { .. });
        self.fatal += usize::from(!readable);
        let span = self.span(range);
        self.findings.push(Finding {
            span,
            problem,
            related,
        });
    }

    /// Reports that `expected` should stand at the current token.
    fn expected(&mut self, expected: impl Into<String>, candidates: &[&str]) {
        let suggestion = match self.peek() {
            Some(token) if token.kind == TokenKind::Word => {
                suggest(self.token_text(self.at), candidates.iter().copied())
            }
            _ => None,
        };
        if !self.end_is_news() {
            return;
        }
        let (range, found) = self.found();
        self.report(
            range,
            Problem::Expected {
                expected: expected.into(),
                found,
                suggestion,
            },
        );
    }

    /// Reports that a bracket has no partner.
    fn unclosed(&mut self, range: Range<usize>, opening: char) {
        if self.end_is_news() {
            self.report(range, Problem::Unclosed { opening });
        }
    }

    /// Whether it was not yet reported that the tokens ran out here, if they did. One report is
    /// enough: what encloses the innermost open bracket is open, too.
    fn end_is_news(&mut self) -> bool {
        if self.peek().is_some() {
            return true;
        }
        self.fatal += 1;
        self.end_reported.replace(self.at) != Some(self.at)
    }

    /// Remembers the words among these tokens as lost.
    fn lose(&mut self, tokens: Range<usize>) {
        for at in tokens {
            let Some(token) = self.tokens.get(at) else {
                break;
            };
            if matches!(token.kind, TokenKind::Word | TokenKind::Number) {
                let text = &self.text[token.range.clone()];
                self.lost
                    .push(Name::new(text, self.span(token.range.clone())));
            }
        }
    }

    /// Remembers the words of a part of the file as lost.
    fn lose_span(&mut self, span: Span) {
        let first = self
            .tokens
            .partition_point(|token| token.range.start < span.start);
        let end = self
            .tokens
            .partition_point(|token| token.range.start < span.end);
        self.lose(first..end);
    }

    /// The current token's range and what it is, in words.
    fn found(&self) -> (Range<usize>, String) {
        if let Some(token) = self.peek() {
            return (
                token.range.clone(),
                format!("`{}`", &self.text[token.range.clone()]),
            );
        }
        let end = self
            .at
            .checked_sub(1)
            .map_or(0, |last| self.tokens[last].range.end);
        let words = if self.at < self.tokens.len() {
            "the next rule"
        } else {
            "the end"
        };
        (end..end, words.to_owned())
    }

    fn peek(&self) -> Option<&Token> {
        self.tokens[..self.limit].get(self.at)
    }

    fn token_text(&self, at: usize) -> &'a str {
        self.tokens[..self.limit]
            .get(at)
            .map_or("", |token| &self.text[token.range.clone()])
    }

    fn is_symbol_at(&self, at: usize, symbol: &str) -> bool {
        self.tokens[..self.limit]
            .get(at)
            .is_some_and(|token| matches!(token.kind, TokenKind::Symbol(found) if found == symbol))
    }

    fn is_symbol(&self, symbol: &str) -> bool {
        self.is_symbol_at(self.at, symbol)
    }

    fn is_word(&self, word: &str) -> bool {
        self.peek()
            .is_some_and(|token| token.kind == TokenKind::Word)
            && self.token_text(self.at) == word
    }

    fn is_word_at(&self, at: usize) -> bool {
        self.tokens[..self.limit]
            .get(at)
            .is_some_and(|token| token.kind == TokenKind::Word)
    }

    /// Which of the keywords the current token is. One that is misspelt is told of and taken for what it was meant
    /// to be.
    fn keyword_among(&mut self, keywords: &[&'static str], expected: &str) -> Option<&'static str> {
        let word = self.token_text(self.at);
        let known = |word: &str| keywords.iter().find(|&&known| known == word).copied();
        known(word).or_else(|| {
            self.expected(expected, keywords);
            let meant = self
                .is_word_at(self.at)
                .then(|| suggest(word, keywords.iter().copied()));
            known(&meant??)
        })
    }

    fn bump(&mut self) -> Range<usize> {
        let range = self.peek().map_or(0..0, |token| token.range.clone());
        self.at = (self.at + 1).min(self.limit);
        range
    }

    fn eat(&mut self, symbol: &str) -> bool {
        let found = self.is_symbol(symbol);
        if found {
            self.bump();
        }
        found
    }

    fn expect(&mut self, symbol: &str, expected: &str) -> Option<Range<usize>> {
        if self.is_symbol(symbol) {
            return Some(self.bump());
        }
        self.expected(expected, &[]);
        None
    }

    /// A word that is no number.
    fn word(&mut self, expected: &str) -> Option<Name> {
        if self
            .peek()
            .is_some_and(|token| token.kind == TokenKind::Word)
        {
            return Some(self.bump_name());
        }
        self.expected(expected, &[]);
        None
    }

    /// A word, or a number without sign or point, taken as the name of something.
    fn name(&mut self, expected: &str) -> Option<Name> {
        match self.peek() {
            Some(token) if token.kind == TokenKind::Word || self.is_digits(self.at) => {
                Some(self.bump_name())
            }
            _ => {
                self.expected(expected, &[]);
                None
            }
        }
    }

    /// A word, number without sign or point, or (in goals) a quoted name, taken as a node.
    fn node(&mut self, expected: &str) -> Option<Name> {
        if self.names == NodeNames::Goal
            && self
                .peek()
                .is_some_and(|token| token.kind == TokenKind::Text)
        {
            return Some(self.bump_name());
        }
        self.name(expected)
    }

    /// The current token as a name; a quoted one keeps its quotes and gets canonical escapes.
    fn bump_name(&mut self) -> Name {
        let range = self.bump();
        let text = &self.text[range.clone()];
        let span = self.span(range);
        if text.starts_with('"') {
            Name::new(quote(&unquote(text)), span)
        } else {
            Name::new(text, span)
        }
    }

    /// Whether the token is a number that can name something: `4`, not `-4` or `4.5`.
    fn is_digits(&self, at: usize) -> bool {
        self.tokens[..self.limit]
            .get(at)
            .is_some_and(|token| token.kind == TokenKind::Number)
            && self.token_text(at).chars().all(char::is_alphanumeric)
    }

    fn number(&mut self, expected: &str) -> Option<(f64, Range<usize>)> {
        if self
            .peek()
            .is_some_and(|token| token.kind == TokenKind::Number)
        {
            let range = self.bump();
            let text = &self.text[range.clone()];
            return match text.parse::<f64>() {
                Ok(value) if value.is_finite() => Some((value, range)),
                _ => {
                    let found = text.to_owned();
                    let (what, range_words) = ("a number", "finite");
                    self.report(
                        range,
                        Problem::OutOfRange {
                            what,
                            range: range_words,
                            found,
                        },
                    );
                    None
                }
            };
        }
        self.expected(expected, &[]);
        None
    }

    /// After something broken that began at token `start`: skips to the first token of a later
    /// line, or to a closing brace.
    fn skip_broken_line(&mut self, start: usize) {
        if self.at == start {
            self.bump();
        }
        self.skip_line();
        self.lose(start..self.at);
    }

    fn skip_line(&mut self) {
        while let Some(token) = self.peek() {
            if token.first_on_line || self.is_symbol("}") {
                break;
            }
            self.bump();
        }
    }

    /// Skips past the brace that closes the `depth` open ones.
    fn skip_braces(&mut self, mut depth: usize) {
        while depth > 0 && self.peek().is_some() {
            if self.is_symbol("{") {
                depth += 1;
            } else if self.is_symbol("}") {
                depth -= 1;
            }
            self.bump();
        }
    }

    /// Whether a rule or combo begins at token `at`: `[dormant ...] name : active (`, but not
    /// `name : active (x, y)`, which is a node of type `active`.
    fn begins_rule(&self, mut at: usize) -> bool {
        let word = |at: usize| {
            self.tokens
                .get(at)
                .is_some_and(|token| token.kind == TokenKind::Word)
                || self.is_digits(at)
        };
        if !self.tokens[at].first_on_line {
            return false;
        }
        while rule::MODIFIERS.contains(&self.token_text(at)) && word(at + 1) {
            at += 1;
        }
        if !word(at) || !self.is_symbol_at(at + 1, ":") {
            return false;
        }
        let kind = self.token_text(at + 2);
        if matches!(kind, "active" | "passive") {
            return self.is_symbol_at(at + 3, "{")
                || (self.is_symbol_at(at + 3, "(") && !self.is_symbol_at(at + 5, ","));
        }
        // A node's place in a drawing is two numbers, so that one can only be a cost.
        let cost = self.is_symbol_at(at + 3, "(")
            && self.is_symbol_at(at + 5, ")")
            && self.tokens[at + 4].kind == TokenKind::Number;
        cost && suggest(kind, rule::KINDS).is_some()
    }

    fn begins_include(&self, at: usize) -> bool {
        let follows = at
            .checked_sub(1)
            .is_some_and(|before| self.is_symbol_at(before, ":"));
        self.tokens[at].first_on_line && !follows && self.is_keyword(at, "include", "(")
    }

    /// Whether the word and what follows it are `keyword` and this bracket, misspelt or not.
    fn is_keyword(&self, at: usize, keyword: &str, bracket: &str) -> bool {
        let word = self.token_text(at);
        self.is_symbol_at(at + 1, bracket)
            && self.tokens[at].kind == TokenKind::Word
            && (word == keyword || suggest(word, [keyword]).is_some())
    }
}
