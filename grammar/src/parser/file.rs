//! A whole grammar file: header, types, rules, combos, includes.
//!
//! Guarantee: everything between two readable items is either part of one or reported.

use super::rule::{Action, Broken};
use super::{Finding, NodeNames, Parser};
use crate::lexer::TokenKind;
use crate::sound::{Part, Region};
use crate::{Combo, Include, Name, Problem, Property, Rule, Span, TypeDeclaration, Types};
use dsr::suggest;
use std::ops::Range;

/// A grammar file by itself, its includes not followed.
#[derive(Debug, Default)]
pub(crate) struct ParsedFile {
    pub(crate) properties: Vec<Property>,
    pub(crate) types: Types,
    pub(crate) items: Vec<Item>,
    pub(crate) comments: Vec<String>,
    /// Rules and combos with errors in them.
    pub(crate) broken: Vec<Broken>,
    /// Where each of its parts begins.
    pub(crate) regions: Vec<Region>,
    pub(crate) findings: Vec<Finding>,
}

/// What stands between the types block and the end.
#[derive(Debug)]
pub(crate) enum Item {
    Rule(Box<Rule>),
    Combo(Combo),
    Include(Include),
}

/// Reads a grammar file that will have index `file` in its grammar.
pub(crate) fn parse_file(text: &str, file: u32) -> ParsedFile {
    let mut parsed = ParsedFile::default();
    let start = header(text, file, &mut parsed);
    let mut parser = Parser::new(text, file, start, NodeNames::Rule);
    parser
        .findings
        .splice(0..0, std::mem::take(&mut parsed.findings));
    parser.items(&mut parsed);
    let rest = parser.comments_before(usize::MAX);
    parsed.comments.extend(rest);
    parsed.findings = parser.findings;
    parsed
}

/// Reads `key = value` lines up to `===`. Gives the byte after it.
fn header(text: &str, file: u32, parsed: &mut ParsedFile) -> usize {
    let mut offset = 0;
    for line in text.split_inclusive('\n') {
        let content = line.trim();
        let start = offset + (line.len() - line.trim_start().len());
        let content_span = Span::new(file, start, start + content.len());
        offset += line.len();
        if content.len() >= 3 && content.bytes().all(|byte| byte == b'=') {
            return offset;
        }
        if content.is_empty() {
            continue;
        }
        if let Some(comment) = content.strip_prefix('#') {
            parsed.comments.push(comment.trim().to_owned());
            continue;
        }
        let property = content.split_once('=').filter(|(key, _)| {
            let key = key.trim_end();
            !key.is_empty()
                && key
                    .chars()
                    .all(|c| c.is_alphanumeric() || matches!(c, '_' | '-' | '.'))
        });
        if let Some((key, value)) = property {
            let key = key.trim_end();
            let span = Span::new(file, start, start + key.len());
            let value = value.trim().to_owned();
            parsed.properties.push(Property {
                key: Name::new(key, span),
                value,
            });
            continue;
        }
        let problem = Problem::Expected {
            expected: "`key = value` or `===`".to_owned(),
            found: format!("`{content}`"),
            suggestion: None,
        };
        parsed.findings.push(Finding {
            span: content_span,
            problem,
            related: None,
        });
        if content.contains([':', '{', '(']) || content == "types" {
            return start;
        }
    }
    let problem = Problem::Expected {
        expected: "`===` after the header".to_owned(),
        found: "the end".to_owned(),
        suggestion: None,
    };
    let end = Span::new(file, text.len(), text.len());
    parsed.findings.push(Finding {
        span: end,
        problem,
        related: None,
    });
    text.len()
}

impl Parser<'_> {
    fn items(&mut self, parsed: &mut ParsedFile) {
        loop {
            self.limit = self.tokens.len();
            let Some(token) = self.peek().cloned() else {
                break;
            };
            if self.is_keyword(self.at, "include", "(") || self.at_bare_include() {
                parsed
                    .regions
                    .push(self.region(token.range.start, Part::Include));
                let comments = self.comments_before(token.range.start);
                if let Some(path) = self.include() {
                    parsed.items.push(Item::Include(Include { path, comments }));
                } else {
                    self.skip_to_item();
                }
            } else if self.is_keyword(self.at, "types", "{") {
                parsed
                    .regions
                    .push(self.region(token.range.start, Part::Types));
                if !parsed.types.is_empty() {
                    let what = "`types`".to_owned();
                    self.report(token.range, Problem::Repeated { what });
                }
                self.types(&mut parsed.types);
                let end = self.tokens[self.at.saturating_sub(1)].range.end;
                parsed.comments.extend(self.comments_before(end));
            } else if token.kind == TokenKind::Word || self.is_digits(self.at) {
                let action = self.action();
                let end = self.tokens[self.at.saturating_sub(1)].range.end;
                let comments = self.comments_before(end);
                let name = match &action {
                    Ok(Action::Rule(rule)) => Some(rule.name.clone()),
                    Ok(Action::Combo(combo)) => Some(combo.name.clone()),
                    Err(broken) => broken.name.clone(),
                };
                parsed
                    .regions
                    .push(self.region(token.range.start, Part::Rule(name)));
                match action {
                    Ok(Action::Rule(mut rule)) => {
                        rule.comments = comments;
                        parsed.items.push(Item::Rule(rule));
                    }
                    Ok(Action::Combo(mut combo)) => {
                        combo.comments = comments;
                        parsed.items.push(Item::Combo(combo));
                    }
                    Err(broken) => parsed.broken.push(broken),
                }
            } else if let TokenKind::Symbol(symbol @ ("===" | "}" | ")")) = token.kind {
                self.bump();
                self.report(token.range, Problem::Stray(symbol.to_owned()));
            } else {
                self.expected("a rule, `include(path)` or the end", &[]);
                self.skip_to_item();
            }
        }
    }

    fn region(&self, start: usize, of: Part) -> Region {
        let start = self.span(start..start);
        Region { start, of }
    }

    /// Takes the comments that begin before byte `end`.
    fn comments_before(&mut self, end: usize) -> Vec<String> {
        let taken = self.comments.partition_point(|(start, _)| *start < end);
        self.comments
            .drain(..taken)
            .map(|(_, words)| words)
            .collect()
    }

    /// Tells of a keyword that is misspelt, and takes it for what it was meant to be.
    fn keyword(&mut self, keyword: &'static str) {
        if !self.is_word(keyword) {
            self.expected("a rule, `include(path)`, `types` or the end", &[keyword]);
        }
        self.bump();
    }

    fn include(&mut self) -> Option<Name> {
        if self.at_bare_include() {
            return self.bare_include();
        }
        let is_misspelt = !self.is_word("include");
        self.keyword("include");
        let opening = self.bump();
        if is_misspelt {
            return self.path_after(opening.end);
        }
        if self
            .peek()
            .is_none_or(|token| token.kind != TokenKind::Path)
        {
            self.expected("the path of a grammar file", &[]);
            return None;
        }
        let range = self.bump();
        let raw = &self.text[range.clone()];
        let start = range.start + (raw.len() - raw.trim_start().len());
        let path = raw.trim();
        let name = Name::new(path, self.span(start..start + path.len()));
        self.expect(")", "`)` after the path")?;
        Some(name)
    }

    /// Whether a line such as `include path` begins here, without the brackets, misspelt or not.
    fn at_bare_include(&self) -> bool {
        let word = self.token_text(self.at);
        let rest = self.rest_of_line();
        let path = &self.text[rest];
        self.is_word_at(self.at)
            && self.tokens[self.at].first_on_line
            && (word == "include" || suggest(word, ["include"]).is_some())
            && !path.is_empty()
            && !path.contains([':', '(', '{'])
    }

    /// What follows the current token on its line, but for blanks and a comment.
    fn rest_of_line(&self) -> Range<usize> {
        let start = self.tokens[self.at].range.end;
        let line = self.text[start..].lines().next().unwrap_or_default();
        let words = line.split('#').next().unwrap_or_default();
        let first = start + (words.len() - words.trim_start().len());
        first..first + words.trim().len()
    }

    fn bare_include(&mut self) -> Option<Name> {
        let rest = self.rest_of_line();
        let keyword = self.bump();
        while self
            .peek()
            .is_some_and(|token| token.range.start < rest.end)
        {
            self.bump();
        }
        let is_bracket = |c: char| matches!(c, '"' | '\'' | '<' | '>' | ')');
        let path = self.text[rest.clone()].trim_matches(is_bracket);
        let problem = Problem::Expected {
            expected: "`include(path)`".to_owned(),
            found: format!("`{}`", &self.text[keyword.start..rest.end]),
            suggestion: Some(format!("include({path})")),
        };
        self.report(keyword.start..rest.end, problem);
        (!path.is_empty()).then(|| Name::new(path, self.span(rest)))
    }

    /// The path from a place to the bracket on its line, which the lexer did not know to be one.
    fn path_after(&mut self, start: usize) -> Option<Name> {
        let rest = &self.text[start..];
        let length = rest.find([')', '\n'])?;
        let raw = &rest[..length];
        let first = start + (raw.len() - raw.trim_start().len());
        let path = raw.trim();
        let name = Name::new(path, self.span(first..first + path.len()));
        while self
            .peek()
            .is_some_and(|token| token.range.start < start + length)
        {
            self.bump();
        }
        self.eat(")");
        (!path.is_empty()).then_some(name)
    }

    fn types(&mut self, types: &mut Types) {
        self.keyword("types");
        let opening = self.bump();
        self.limit = self
            .beginnings
            .first()
            .copied()
            .unwrap_or(self.tokens.len())
            .max(self.at);
        loop {
            if self.eat("}") {
                break;
            }
            if self.peek().is_none() || self.is_symbol("===") || self.is_symbol("{") {
                self.unclosed(opening.clone(), '{');
                break;
            }
            let before = self.at;
            let declaration = self.type_declaration();
            if declaration.is_none() {
                self.skip_broken_line(before);
            }
            types.declarations.extend(declaration);
        }
        if !self.eat("===") {
            self.expected("`===` after the types", &[]);
        }
    }

    fn type_declaration(&mut self) -> Option<TypeDeclaration> {
        self.expect("(", "`( type : parent )` or `}`")?;
        let mut declaration = TypeDeclaration {
            names: Vec::new(),
            parents: Vec::new(),
        };
        declaration.names.push(self.name("a type")?);
        while !self.is_symbol(")") && !self.is_symbol(":") {
            declaration.names.push(self.name("a type, `:` or `)`")?);
        }
        if self.eat(":") {
            declaration
                .parents
                .push(self.name("the type that is inherited from")?);
            while !self.is_symbol(")") {
                declaration.parents.push(self.name("a type or `)`")?);
            }
        }
        self.expect(")", "`)`")?;
        Some(declaration)
    }

    /// Skips to the next token at which an item can begin.
    fn skip_to_item(&mut self) {
        let next = self
            .beginnings
            .partition_point(|&beginning| beginning <= self.at);
        let next = self
            .beginnings
            .get(next)
            .copied()
            .unwrap_or(self.tokens.len());
        self.bump();
        while self.at < next {
            let starts_line = self.peek().is_some_and(|token| token.first_on_line);
            if starts_line && self.is_keyword(self.at, "types", "{") {
                break;
            }
            self.bump();
        }
    }
}
