//! From text to tokens.
//!
//! Guarantee: every byte is either blank, part of a comment, part of one token, or reported; the
//! lexer never gives up before the end.

use crate::Problem;
use std::ops::Range;
use winnow::combinator::{alt, opt, preceded};
use winnow::error::EmptyError;
use winnow::prelude::*;
use winnow::stream::LocatingSlice;
use winnow::token::{any, literal, one_of, take_till, take_while};

type Input<'a> = LocatingSlice<&'a str>;
type LexResult<T> = Result<T, EmptyError>;

/// What a token is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TokenKind {
    /// Letters, digits and `_`.
    Word,
    /// A number, also one that names a node (`4:place`).
    Number,
    /// Text in quotes; the token's range has the quotes in it.
    Text,
    /// What stands between the brackets of `include( )`.
    Path,
    /// A bracket, arrow, operator or other mark.
    Symbol(&'static str),
}

/// A token: its bytes in the file, and whether it is the first on its line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Token {
    pub(crate) kind: TokenKind,
    pub(crate) range: Range<usize>,
    pub(crate) first_on_line: bool,
}

/// What the lexer made of a file.
#[derive(Debug, Default)]
pub(crate) struct Lexed {
    pub(crate) tokens: Vec<Token>,
    /// Comments with the byte that they begin at, without `#` and surrounding blanks.
    pub(crate) comments: Vec<(usize, String)>,
    pub(crate) problems: Vec<(Range<usize>, Problem)>,
}

/// Longer marks stand before their beginnings.
const SYMBOLS: [&str; 19] = [
    "=>", "->", "<=", ">=", "!=", "{", "}", "(", ")", ":", ",", ".", "*", "=", "<", ">", "+", "-",
    "/",
];

enum Lexeme<'a> {
    Blank,
    Newline,
    Comment(&'a str),
    Token(TokenKind),
    Unclosed,
    Unknown(char),
}

/// Reads `text` from byte `start` on; ranges count from the beginning of `text`.
pub(crate) fn lex(text: &str, start: usize) -> Lexed {
    let mut lexed = Lexed::default();
    let mut input = LocatingSlice::new(&text[start..]);
    let mut first_on_line = true;
    let mut path_next = false;
    while !input.is_empty() {
        let mut lexeme = if path_next { path } else { lexeme };
        path_next = false;
        let Ok((found, range)) = lexeme.by_ref().with_span().parse_next(&mut input) else {
            break;
        };
        let range = range.start + start..range.end + start;
        match found {
            Lexeme::Blank => {}
            Lexeme::Newline => first_on_line = true,
            Lexeme::Comment(words) => lexed.comments.push((range.start, words.trim().to_owned())),
            Lexeme::Token(kind) => {
                path_next = kind == TokenKind::Symbol("(") && after_include(text, &lexed.tokens);
                // A blank path is no token: the parser tells of `include()`.
                if !text[range.clone()].trim().is_empty() {
                    lexed.tokens.push(Token {
                        kind,
                        range,
                        first_on_line,
                    });
                }
                first_on_line = false;
            }
            Lexeme::Unclosed => {
                lexed.problems.push((range, Problem::UnclosedText));
                first_on_line = false;
            }
            Lexeme::Unknown(character) => match lexed.problems.last_mut() {
                Some((last, Problem::UnknownCharacter(_))) if last.end == range.start => {
                    last.end = range.end;
                }
                _ => lexed
                    .problems
                    .push((range, Problem::UnknownCharacter(character))),
            },
        }
    }
    lexed
}

fn after_include(text: &str, tokens: &[Token]) -> bool {
    tokens.last().is_some_and(|token| {
        token.kind == TokenKind::Word
            && token.first_on_line
            && &text[token.range.clone()] == "include"
    })
}

fn path<'a>(input: &mut Input<'a>) -> LexResult<Lexeme<'a>> {
    take_till(0.., (')', '\n'))
        .value_into(TokenKind::Path)
        .parse_next(input)
}

fn lexeme<'a>(input: &mut Input<'a>) -> LexResult<Lexeme<'a>> {
    alt((
        take_while(1.., |c: char| c.is_whitespace() && c != '\n').map(|_| Lexeme::Blank),
        '\n'.map(|_| Lexeme::Newline),
        preceded('#', take_till(0.., '\n')).map(Lexeme::Comment),
        number.value_into(TokenKind::Number),
        take_while(1.., is_word).value_into(TokenKind::Word),
        take_while(3.., '=').value_into(TokenKind::Symbol("===")),
        text,
        symbol,
        any.map(Lexeme::Unknown),
    ))
    .parse_next(input)
}

fn is_word(character: char) -> bool {
    character.is_alphanumeric() || character == '_'
}

/// A number that no word goes on from: `4` and `1e5`, not `4th`.
fn number<'a>(input: &mut Input<'a>) -> LexResult<&'a str> {
    let digits = |input: &mut Input<'a>| take_while(1.., '0'..='9').parse_next(input);
    let fraction = (
        opt(('.', digits)),
        opt((one_of(['e', 'E']), opt(one_of(['+', '-'])), digits)),
    );
    let number = (opt('-'), digits, fraction).take();
    (number, winnow::combinator::not(one_of(is_word)))
        .map(|(text, ())| text)
        .parse_next(input)
}

fn text<'a>(input: &mut Input<'a>) -> LexResult<Lexeme<'a>> {
    let escaped = preceded('\\', winnow::token::none_of('\n')).void();
    let plain = take_till(1.., ('"', '\\', '\n')).void();
    let inside = winnow::combinator::repeat::<_, _, (), _, _>(0.., alt((escaped, plain)));
    preceded('"', (inside, opt('\\'), opt('"')))
        .map(|((), _, closed)| match closed {
            Some(_) => Lexeme::Token(TokenKind::Text),
            None => Lexeme::Unclosed,
        })
        .parse_next(input)
}

fn symbol<'a>(input: &mut Input<'a>) -> LexResult<Lexeme<'a>> {
    for symbol in SYMBOLS {
        if opt(literal(symbol)).parse_next(input)?.is_some() {
            return Ok(Lexeme::Token(TokenKind::Symbol(symbol)));
        }
    }
    winnow::combinator::fail(input)
}

/// Turns a parser that takes text into one that gives a token.
trait ValueInto<'a> {
    fn value_into(self, kind: TokenKind) -> impl Parser<Input<'a>, Lexeme<'a>, EmptyError>;
}

impl<'a, P: Parser<Input<'a>, &'a str, EmptyError>> ValueInto<'a> for P {
    fn value_into(self, kind: TokenKind) -> impl Parser<Input<'a>, Lexeme<'a>, EmptyError> {
        self.map(move |_| Lexeme::Token(kind))
    }
}

/// The content of a quoted token, escapes (`\"`, `\\`, `\n`, `\t`) resolved. A backslash before
/// any other character stands for that character.
pub(crate) fn unquote(quoted: &str) -> String {
    let inner = quoted.strip_prefix('"').unwrap_or(quoted);
    let inner = inner.strip_suffix('"').unwrap_or(inner);
    let mut content = String::with_capacity(inner.len());
    let mut characters = inner.chars();
    while let Some(character) = characters.next() {
        content.push(match character {
            '\\' => match characters.next() {
                Some('n') => '\n',
                Some('t') => '\t',
                Some(other) => other,
                None => '\\',
            },
            other => other,
        });
    }
    content
}

/// `content` as a quoted token; the inverse of [`unquote`].
pub(crate) fn quote(content: &str) -> String {
    let mut quoted = String::with_capacity(content.len() + 2);
    quoted.push('"');
    for character in content.chars() {
        match character {
            '"' => quoted.push_str("\\\""),
            '\\' => quoted.push_str("\\\\"),
            '\n' => quoted.push_str("\\n"),
            '\t' => quoted.push_str("\\t"),
            other => quoted.push(other),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<&str> {
        lex(text, 0)
            .tokens
            .into_iter()
            .map(|token| &text[token.range])
            .collect()
    }

    #[test]
    fn numbers_words_and_arrows_are_told_apart() {
        assert_eq!(words("1->4(in)*"), ["1", "->", "4", "(", "in", ")", "*"]);
        assert_eq!(
            words("a:b(-270,-45.5)"),
            ["a", ":", "b", "(", "-270", ",", "-45.5", ")"]
        );
        assert_eq!(
            words("(- 1 1.distance)"),
            ["(", "-", "1", "1", ".", "distance", ")"]
        );
        assert_eq!(words("4th 1e5 ==="), ["4th", "1e5", "==="]);
        assert_eq!(words("=> <= != = señal"), ["=>", "<=", "!=", "=", "señal"]);
    }

    #[test]
    fn an_include_path_is_one_token() {
        assert_eq!(
            words("include(/a b/c.aggl)"),
            ["include", "(", "/a b/c.aggl", ")"]
        );
        assert_eq!(words("include()"), ["include", "(", ")"]);
        assert_eq!(words("(include a b)"), ["(", "include", "a", "b", ")"]);
    }

    #[test]
    fn comments_and_unknown_characters_are_kept_apart() {
        let lexed = lex("# one\na ?? b \"open\nc", 0);
        assert_eq!(lexed.comments, [(0, "one".to_owned())]);
        assert_eq!(lexed.tokens.len(), 3);
        assert_eq!(
            lexed.problems,
            [
                (8..10, Problem::UnknownCharacter('?')),
                (13..18, Problem::UnclosedText)
            ]
        );
    }

    #[test]
    fn quoting_is_undone_by_unquoting() {
        let content = "say \"hi\"\\ \n\tñ";
        assert_eq!(unquote(&quote(content)), content);
    }
}
