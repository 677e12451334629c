//! Where text came from: source files, byte spans, and names that remember their span.
//!
//! Guarantee: a [`Name`] compares, orders and hashes by its text alone, so two rules that read the
//! same are equal wherever they stand.

use std::borrow::Borrow;
use std::cmp::Ordering;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::ops::Deref;
use std::sync::Arc;

/// A range of bytes in one file of a [`crate::Grammar`] (`grammar.files[span.file]`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Span {
    /// Index of the file; 0 is the file that was asked for, others are its includes.
    pub file: u32,
    /// First byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

impl Span {
    /// The range `start..end` of the file with index `file`.
    pub const fn new(file: u32, start: usize, end: usize) -> Self {
        Self { file, start, end }
    }

    /// The smallest span that covers `self` and `other`, which lie in the same file.
    #[must_use]
    pub fn to(self, other: Self) -> Self {
        Self {
            file: self.file,
            start: self.start.min(other.start),
            end: self.end.max(other.end),
        }
    }
}

/// An identifier (or quoted text) and where it stands.
///
/// Cloning shares the text. Made by code rather than read from a file (`Name::from("robot")`) it has an empty span.
#[derive(Clone, Default)]
pub struct Name {
    text: Arc<str>,
    span: Span,
}

impl Name {
    /// A name read from a file.
    pub fn new(text: impl Into<Arc<str>>, span: Span) -> Self {
        Self {
            text: text.into(),
            span,
        }
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// Where it stands.
    pub const fn span(&self) -> Span {
        self.span
    }
}

impl Deref for Name {
    type Target = str;
    fn deref(&self) -> &str {
        &self.text
    }
}

impl Borrow<str> for Name {
    fn borrow(&self) -> &str {
        &self.text
    }
}

impl From<&str> for Name {
    fn from(text: &str) -> Self {
        Self::new(text, Span::default())
    }
}

impl PartialEq for Name {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl Eq for Name {}

impl PartialEq<str> for Name {
    fn eq(&self, other: &str) -> bool {
        *self.text == *other
    }
}

impl PartialEq<&str> for Name {
    fn eq(&self, other: &&str) -> bool {
        *self.text == **other
    }
}

impl PartialOrd for Name {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Name {
    fn cmp(&self, other: &Self) -> Ordering {
        self.text.cmp(&other.text)
    }
}

impl Hash for Name {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.text.hash(state);
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl fmt::Debug for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.text, f)
    }
}

/// From so many bytes to the next, a file remembers line and column, so that finding those of a place costs
/// the same in a file of one long line.
const STRIDE: usize = 1024;

/// A file as it was read: its name for messages and its text. Cloning shares the text.
#[derive(Clone)]
pub struct SourceFile {
    name: Arc<str>,
    text: Arc<str>,
    /// Line and column, from 0, of the first character at or after each multiple of [`STRIDE`].
    marks: Arc<[(usize, usize)]>,
}

/// Where one is after `text`, coming from line and column.
fn after(text: &str, (line, column): (usize, usize)) -> (usize, usize) {
    match text.rfind('\n') {
        None => (line, column + text.chars().count()),
        Some(last) => {
            let more = text.bytes().filter(|&byte| byte == b'\n').count();
            (line + more, text[last + 1..].chars().count())
        }
    }
}

impl SourceFile {
    /// A file called `name` in messages, holding `text`.
    pub fn new(name: &str, text: &str) -> Self {
        let mut marks = vec![(0, 0)];
        for place in (STRIDE..text.len()).step_by(STRIDE) {
            let from = text.ceil_char_boundary(place - STRIDE);
            let piece = &text[from..text.ceil_char_boundary(place)];
            marks.push(after(piece, marks[marks.len() - 1]));
        }
        Self {
            name: name.into(),
            text: text.into(),
            marks: marks.into(),
        }
    }

    /// The name given in messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The whole text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Line and column of byte `offset`, both counted from 1, the column in characters.
    ///
    /// An offset past the end gives the place after the last character.
    pub fn line_and_column(&self, offset: usize) -> (usize, usize) {
        let end = self.text.floor_char_boundary(offset);
        // The mark before, or the one before that where the mark itself is moved past the place.
        let from = |mark: usize| self.text.ceil_char_boundary(mark * STRIDE);
        let mut mark = (end / STRIDE).min(self.marks.len() - 1);
        while from(mark) > end {
            mark -= 1;
        }
        let (line, column) = after(&self.text[from(mark)..end], self.marks[mark]);
        (line + 1, column + 1)
    }
}

impl PartialEq for SourceFile {
    fn eq(&self, other: &Self) -> bool {
        // Each of a file's defects has a copy of it, and they are compared again and again.
        let shared = Arc::ptr_eq(&self.text, &other.text);
        self.name == other.name && (shared || self.text == other.text)
    }
}

impl Eq for SourceFile {}

impl fmt::Debug for SourceFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SourceFile({:?}, {} bytes)", self.name, self.text.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_count_characters_and_lines_start_at_one() {
        let file = SourceFile::new("a.aggl", "uno\nseñal->b\n");
        assert_eq!(file.line_and_column(0), (1, 1));
        let arrow = file.text().find("->").unwrap();
        assert_eq!(file.line_and_column(arrow), (2, 6));
        assert_eq!(file.line_and_column(10_000), (3, 1));
    }

    #[test]
    fn places_in_long_files_are_found_from_the_mark_before() {
        // Lines and characters of every length, so that marks fall into the midst of both.
        let line = |n: usize| "añ€😀".repeat(n * 37 % 211);
        let text: String = (0..60).map(|n| line(n) + "\n").collect();
        assert!(text.len() > 20 * STRIDE);
        let file = SourceFile::new("a.aggl", &text);
        let (mut line, mut column) = (1, 1);
        for (place, character) in text.char_indices() {
            assert_eq!(file.line_and_column(place), (line, column), "at {place}");
            (line, column) = match character {
                '\n' => (line + 1, 1),
                _ => (line, column + 1),
            };
        }
        assert_eq!(file.line_and_column(text.len()), (line, column));
    }

    #[test]
    fn a_name_is_its_text() {
        let here = Name::new("robot", Span::new(0, 4, 9));
        assert_eq!(here, Name::from("robot"));
        assert_ne!(here.span(), Name::from("robot").span());
    }
}
