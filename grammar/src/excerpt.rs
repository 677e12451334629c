//! The piece of a file that is shown with a defect.
//!
//! Guarantee: it is at most a few lines, and of lines that are very long only what is near the
//! defect; so that many defects in a long line do not show that line as many times.

use crate::{Defects, SourceFile, Span};
use miette::{
    GraphicalReportHandler, GraphicalTheme, MietteError, MietteSpanContents, SourceCode,
    SourceSpan, SpanContents,
};

/// So many bytes are underlined at most.
const UNDERLINED: usize = 160;
/// So many bytes are shown at most on each side of what is underlined.
const BESIDE: usize = 400;
/// Of the line itself, where it is longer than that, so many on each side.
const NEAR: usize = 80;
/// Two places further apart are shown one after the other.
const TOGETHER: usize = 2_000;

impl SourceFile {
    /// What is underlined of `span` when it is shown: all of it, or where that is long its beginning.
    pub fn underlined(&self, span: Span) -> SourceSpan {
        let start = self.text().floor_char_boundary(span.start);
        let end = span.end.clamp(start, start.saturating_add(UNDERLINED));
        SourceSpan::new(start.into(), self.text().floor_char_boundary(end) - start)
    }

    /// Where the text that is shown before `place` begins: lines before its own, or a piece of that.
    fn beginning(&self, place: usize, lines_before: usize) -> usize {
        if lines_before == 0 {
            return place;
        }
        let least = self
            .text()
            .floor_char_boundary(place.saturating_sub(BESIDE));
        let before = &self.text()[least..place];
        let ends = before.bytes().enumerate().rev();
        let mut begins = ends
            .filter(|(_, byte)| *byte == b'\n')
            .map(|(at, _)| at + 1);
        let line = match begins.next() {
            Some(own) => own,
            None if least == 0 => 0,
            None => return self.text().floor_char_boundary(place.saturating_sub(NEAR)),
        };
        match begins.nth(lines_before - 1) {
            Some(first) => least + first,
            None if least == 0 => 0,
            None => least + line,
        }
    }

    /// Where the text that is shown after `place` ends, likewise.
    fn end(&self, place: usize, lines_after: usize) -> usize {
        if lines_after == 0 {
            return place;
        }
        let most = self
            .text()
            .floor_char_boundary(place.saturating_add(BESIDE));
        let after = &self.text()[place..most];
        let whole = most == self.text().len();
        let ends = after.bytes().enumerate();
        let mut ends = ends
            .filter(|(_, byte)| *byte == b'\n')
            .map(|(at, _)| place + at + 1);
        let line = match ends.next() {
            Some(own) => own,
            None if whole => most,
            None => return self.text().floor_char_boundary(place.saturating_add(NEAR)),
        };
        match ends.nth(lines_after - 1) {
            Some(last) => last,
            None if whole => most,
            None => line,
        }
    }
}

impl Defects {
    /// The whole report as it is shown in a terminal, without colours.
    pub fn report(&self) -> String {
        let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor());
        let mut text = String::new();
        // Writing to a string does not fail, and every place lies in its file.
        let _ = handler.render_report(&mut text, self);
        text
    }
}

impl SourceCode for SourceFile {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        lines_before: usize,
        lines_after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let (start, end) = (span.offset(), span.offset().saturating_add(span.len()));
        if span.len() > TOGETHER || self.text().get(start..end).is_none() {
            return Err(MietteError::OutOfBounds);
        }
        let (start, end) = (
            self.beginning(start, lines_before),
            self.end(end, lines_after),
        );
        let data = &self.text()[start..end];
        let (line, column) = self.line_and_column(start);
        Ok(Box::new(MietteSpanContents::new_named(
            self.name().to_owned(),
            data.as_bytes(),
            (start, end - start).into(),
            line - 1,
            column - 1,
            data.bytes().filter(|&byte| byte == b'\n').count(),
        )))
    }
}

#[cfg(test)]
mod tests {
    use crate::{Defects, SHOWN_LIMIT, parse_grammar};
    use expect_test::expect;

    fn defects(text: &str) -> Defects {
        let (_, diagnostics) = parse_grammar(text, "long.aggl");
        Defects { diagnostics }
    }

    #[test]
    fn of_a_long_line_only_what_is_near_a_defect_is_shown() {
        let rule = |index: usize, link: &str| {
            format!("r{index} : active(1) {{ {{ a:t b:t a->{link}(l) }} => {{ a:t b:t }} }} ")
        };
        let good: String = (0..50).map(|index| rule(index, "b")).collect();
        let text = format!("name=x\n===\n{good}{}{good}\n", rule(99, "señal"));
        let rendered = defects(&text).report();
        let near = rendered
            .lines()
            .skip_while(|line| !line.contains("[long.aggl:3:"));
        let near: Vec<String> = near
            .map(|line| format!("|{}", line.trim_end()))
            .take(4)
            .collect();
        expect![[r"
            |   ╭─[long.aggl:3:2772]
            | 3 │ active(1) { { a:t b:t a->b(l) } => { a:t b:t } } r99 : active(1) { { a:t b:t a->señal(l) } => { a:t b:t } } r0 : active(1) { { a:t b:t a->b(l) } => { a:t b:t } } r1
            |   ·                                                                                 ──┬──
            |   ·                                                                                   ╰── here"]]
        .assert_eq(&near.join("\n"));
    }

    #[test]
    fn however_many_defects_there_are_no_more_than_the_limit_are_shown() {
        for separator in [" ", "\n"] {
            let rule = |index: usize| {
                format!("r{index} : active(1) {{ {{ a:t x->a(é) }} => {{ a:t (p }} }}{separator}")
            };
            let text = "name=x\n===\n".to_owned() + &(0..2_000).map(rule).collect::<String>();
            let defects = defects(&text);
            let all = defects.diagnostics.len();
            assert!(all > 2_000);
            let more = format!("and {} more", all - SHOWN_LIMIT);
            assert!(defects.to_string().ends_with(&more));
            let rendered = defects.report();
            assert!(rendered.contains(&more));
            assert!(rendered.len() < 200_000, "{}", rendered.len());
        }
    }

    #[test]
    fn every_place_of_every_file_can_be_shown() {
        use super::*;
        for text in [
            "",
            "\n",
            "a",
            "añ\r\n\n€",
            &"é\n".repeat(500),
            &"€".repeat(900),
        ] {
            let file = SourceFile::new("f", text);
            for start in 0..=text.len() {
                for length in [0, 1, 2, 7, 300, 5_000] {
                    let under = file.underlined(Span::new(0, start, start + length));
                    for lines in 0..3 {
                        let contents = file.read_span(&under, lines, lines).unwrap();
                        let (from, to) = (contents.span().offset(), contents.span().len());
                        assert!(from <= under.offset());
                        assert!(from + to >= under.offset() + under.len());
                        assert!(to <= UNDERLINED + 2 * BESIDE);
                        assert!(std::str::from_utf8(contents.data()).is_ok());
                        let (line, column) = file.line_and_column(from);
                        assert_eq!((contents.line() + 1, contents.column() + 1), (line, column));
                    }
                }
            }
        }
    }
}
