//! What a report shows of a file. It guarantees that of a line that is very long only what is near the place
//! is shown, whoever found the fault: a file of one line can be as long as it likes.

use miette::{
    Diagnostic, LabeledSpan, MietteError, MietteHandler, MietteSpanContents, ReportHandler,
    Severity, SourceCode, SourceSpan, SpanContents,
};
use std::fmt;

/// So many bytes are underlined at most.
const UNDERLINED: usize = 160;
/// Lines up to so many bytes are shown whole.
const LONG: usize = 800;
/// Of a longer one, so many on each side of what is underlined.
const NEAR: usize = 80;

/// Shows reports as miette does, with excerpts of long lines.
pub(crate) struct Handler(pub(crate) MietteHandler);

impl ReportHandler for Handler {
    fn debug(&self, report: &dyn Diagnostic, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.debug(&Excerpt::of(report), f)
    }
}

/// A report whose places are shown by excerpts.
struct Excerpt<'a> {
    whole: &'a dyn Diagnostic,
    source: Option<Source<'a>>,
    related: Vec<Excerpt<'a>>,
}

impl<'a> Excerpt<'a> {
    fn of(whole: &'a dyn Diagnostic) -> Self {
        let related = whole.related().into_iter().flatten();
        Self {
            whole,
            source: whole.source_code().map(Source),
            related: related.map(Self::of).collect(),
        }
    }
}

impl fmt::Debug for Excerpt<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.whole, f)
    }
}

impl fmt::Display for Excerpt<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self.whole, f)
    }
}

impl std::error::Error for Excerpt<'_> {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.whole.source()
    }
}

impl Diagnostic for Excerpt<'_> {
    fn code<'b>(&'b self) -> Option<Box<dyn fmt::Display + 'b>> {
        self.whole.code()
    }

    fn severity(&self) -> Option<Severity> {
        self.whole.severity()
    }

    fn help<'b>(&'b self) -> Option<Box<dyn fmt::Display + 'b>> {
        self.whole.help()
    }

    fn url<'b>(&'b self) -> Option<Box<dyn fmt::Display + 'b>> {
        self.whole.url()
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.source.as_ref().map(|source| source as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let short = |label: LabeledSpan| {
            let length = label.len().min(UNDERLINED);
            let text = label.label().map(str::to_owned);
            let short = LabeledSpan::new(text.clone(), label.offset(), length);
            if label.primary() {
                LabeledSpan::new_primary_with_span(text, *short.inner())
            } else {
                short
            }
        };
        Some(Box::new(self.whole.labels()?.map(short)))
    }

    fn related<'b>(&'b self) -> Option<Box<dyn Iterator<Item = &'b dyn Diagnostic> + 'b>> {
        let related = self.related.iter().map(|one| one as &dyn Diagnostic);
        (!self.related.is_empty()).then(|| Box::new(related) as Box<_>)
    }

    fn diagnostic_source(&self) -> Option<&dyn Diagnostic> {
        self.whole.diagnostic_source()
    }
}

/// A file of which excerpts are shown.
struct Source<'a>(&'a dyn SourceCode);

impl SourceCode for Source<'_> {
    fn read_span<'b>(
        &'b self,
        span: &SourceSpan,
        before: usize,
        after: usize,
    ) -> Result<Box<dyn SpanContents<'b> + 'b>, MietteError> {
        let lines = self.0.read_span(span, before, after)?;
        let (data, beginning) = (lines.data(), lines.span().offset());
        if data
            .split(|&byte| byte == b'\n')
            .all(|line| line.len() <= LONG)
        {
            return Ok(lines);
        }
        let boundary = |at: &usize| data.get(*at).is_none_or(|byte| byte & 0xC0 != 0x80);
        let place = span.offset().saturating_sub(beginning).min(data.len());
        let end = (place + span.len()).min(data.len());
        // On whole characters.
        let start = (0..=place.saturating_sub(NEAR)).rfind(boundary);
        let start = start.unwrap_or_default();
        let end = (end.saturating_add(NEAR).min(data.len())..=data.len()).find(boundary);
        let piece = &data[start..end.unwrap_or(data.len())];
        let above = &data[..start];
        let newlines = |bytes: &[u8]| bytes.split(|&byte| byte == b'\n').skip(1).count();
        let (line, first) = match above.iter().rposition(|&byte| byte == b'\n') {
            Some(last) => (&above[last + 1..], 0),
            None => (above, lines.column()),
        };
        // In bytes, as miette counts.
        let column = first + line.len();
        let span = (beginning + start, piece.len()).into();
        let row = lines.line() + newlines(above);
        let count = newlines(piece);
        Ok(Box::new(match lines.name() {
            Some(name) => {
                MietteSpanContents::new_named(name.to_owned(), piece, span, row, column, count)
            }
            None => MietteSpanContents::new(piece, span, row, column, count),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::interchange::{Problem, Problems, Severity};
    use miette::{GraphicalReportHandler, GraphicalTheme};

    fn rendered(text: &str, spans: &[std::ops::Range<usize>]) -> String {
        let problem = |span: &std::ops::Range<usize>| Problem {
            severity: Severity::Error,
            message: "wrong".to_owned(),
            span: Some(span.clone()),
            help: None,
            place: None,
        };
        let problems = Problems::new("f.json", text, spans.iter().map(problem).collect());
        let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor());
        let mut report = String::new();
        handler
            .render_report(&mut report, &Excerpt::of(&problems))
            .unwrap();
        report
    }

    #[test]
    fn a_long_line_is_shown_near_the_place_with_its_column() {
        let text = format!("{{}}\n{}señal{}\n", "é".repeat(90_000), "x".repeat(90_000));
        let place = text.find("señal").unwrap();
        let report = rendered(&text, &[place..place + 6, place..text.len(), 0..2]);
        assert!(report.len() < 3_000, "{report}");
        assert!(report.contains("f.json:2:180001"), "{report}");
        assert!(report.contains("éseñalx"), "{report}");
        assert!(report.contains("f.json:1:1"), "{report}");
    }

    #[test]
    fn every_place_of_a_long_line_can_be_shown() {
        let text = "añ€😀 ".repeat(300) + "\n" + &"b".repeat(30);
        let places = text.char_indices().map(|(at, c)| at..at + c.len_utf8());
        let places: Vec<_> = places.step_by(7).collect();
        assert!(rendered(&text, &places).contains("f.json:2:1"));
    }
}
