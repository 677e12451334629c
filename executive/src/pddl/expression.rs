//! PDDL text as nested lists. This file guarantees that each list and word knows where it stands,
//! and that text with a bracket too many or too few is refused at that bracket.

use super::defect::{Defects, Problem};
use grammar::{SourceFile, Span};

/// Lists nested deeper than this are refused.
const DEPTH_LIMIT: usize = 256;

/// A word or a list of such.
#[derive(Debug, Clone)]
pub(super) enum Expression {
    /// A word, in lower case: PDDL does not tell cases apart.
    Word(String, Span),
    List(Vec<Expression>, Span),
}

impl Expression {
    pub(super) fn span(&self) -> Span {
        match self {
            Self::Word(_, span) | Self::List(_, span) => *span,
        }
    }

    pub(super) fn word(&self) -> Option<&str> {
        match self {
            Self::Word(word, _) => Some(word),
            Self::List(..) => None,
        }
    }

    pub(super) fn list(&self) -> Option<&[Expression]> {
        match self {
            Self::Word(..) => None,
            Self::List(list, _) => Some(list),
        }
    }

    /// The word that a list begins with.
    pub(super) fn head(&self) -> Option<&str> {
        self.list()?.first()?.word()
    }
}

/// Reads a file that holds one list.
pub(super) fn read(file: &SourceFile, defects: &mut Defects) -> Option<Expression> {
    let text = file.text();
    let bytes = text.as_bytes();
    let mut open: Vec<(usize, Vec<Expression>)> = Vec::new();
    let mut read = None;
    let mut at = 0;
    while at < bytes.len() {
        match bytes[at] {
            b';' => at = text[at..].find('\n').map_or(bytes.len(), |end| at + end),
            b'(' => {
                if read.is_some() {
                    defects.add(file, Span::new(0, at, at + 1), Problem::AfterTheEnd);
                    return read;
                }
                if open.len() >= DEPTH_LIMIT {
                    defects.add(
                        file,
                        Span::new(0, at, at + 1),
                        Problem::TooDeep(DEPTH_LIMIT),
                    );
                    return None;
                }
                open.push((at, Vec::new()));
                at += 1;
            }
            b')' => {
                let Some((start, list)) = open.pop() else {
                    defects.add(file, Span::new(0, at, at + 1), Problem::Stray);
                    return read;
                };
                at += 1;
                let list = Expression::List(list, Span::new(0, start, at));
                match open.last_mut() {
                    Some((_, outer)) => outer.push(list),
                    None => read = Some(list),
                }
            }
            _ if text[at..].starts_with(char::is_whitespace) => {
                let rest = &text[at..];
                at += rest.len() - rest.trim_start().len();
            }
            _ => {
                let ends = |c: char| c.is_whitespace() || "();".contains(c);
                let end = text[at..].find(ends).map_or(bytes.len(), |end| at + end);
                let span = Span::new(0, at, end);
                match open.last_mut() {
                    Some((_, list)) => {
                        list.push(Expression::Word(text[at..end].to_lowercase(), span));
                    }
                    None if read.is_some() => {
                        defects.add(file, span, Problem::AfterTheEnd);
                        return read;
                    }
                    None => {
                        let expected = "`(define ...)`".to_owned();
                        defects.add(file, span, Problem::expected(expected, &text[at..end]));
                        return None;
                    }
                }
                at = end;
            }
        }
    }
    if let Some((start, _)) = open.first() {
        // The innermost bracket tells more than the first, which encloses the whole file.
        let start = open.get(1).map_or(*start, |(start, _)| *start);
        defects.add(file, Span::new(0, start, start + 1), Problem::Unclosed);
        return None;
    }
    if read.is_none() && defects.is_empty() {
        defects.add(file, Span::new(0, 0, 0), Problem::Empty);
    }
    read
}
