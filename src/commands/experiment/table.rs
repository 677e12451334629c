//! A table of figures, ours beside the printed ones. This file owns how it is written; whether two
//! figures agree is said by the row, in the precision of the print.

use serde_json::{Value, json};
use std::fmt::Write as _;

/// Figures in rows and columns, and what to know about them.
pub(super) struct Table {
    pub(super) columns: Vec<&'static str>,
    pub(super) rows: Vec<Row>,
    pub(super) notes: Vec<&'static str>,
}

/// A line of a table.
pub(super) struct Row {
    pub(super) label: String,
    /// One for each column.
    pub(super) cells: Vec<Cell>,
    /// Why ours differ from the printed ones, where they do.
    pub(super) note: Option<&'static str>,
}

/// Ours, and what is printed where something is.
#[derive(Clone)]
pub(super) struct Cell {
    ours: Figure,
    /// Digits after the point, for people.
    digits: usize,
    printed: Option<Figure>,
    /// How far apart the two may lie.
    tolerance: f64,
    /// The standard deviation of ours over repetitions, where there were some.
    deviation: Option<f64>,
}

/// What stands in a cell.
#[derive(Clone, PartialEq)]
pub(super) enum Figure {
    /// The column is about something else.
    Nothing,
    Number(f64),
    Text(String),
}

impl Cell {
    pub(super) fn number(ours: f64) -> Self {
        Self {
            ours: Figure::Number(ours),
            digits: 2,
            printed: None,
            tolerance: 0.0,
            deviation: None,
        }
    }

    /// A figure of which the fifth digit counts.
    pub(super) fn fine(ours: f64) -> Self {
        Self {
            digits: 5,
            ..Self::number(ours)
        }
    }

    pub(super) fn numbers(ours: f64, printed: f64, tolerance: f64) -> Self {
        Self {
            ours: Figure::Number(ours),
            digits: 2,
            printed: Some(Figure::Number(printed)),
            tolerance,
            deviation: None,
        }
    }

    /// Says by how much ours deviates from repetition to repetition.
    pub(super) fn deviating(self, deviation: f64) -> Self {
        Self {
            deviation: Some(deviation),
            ..self
        }
    }

    pub(super) fn text(ours: impl Into<String>) -> Self {
        Self {
            ours: Figure::Text(ours.into()),
            digits: 2,
            printed: None,
            tolerance: 0.0,
            deviation: None,
        }
    }

    pub(super) fn nothing() -> Self {
        Self {
            ours: Figure::Nothing,
            ..Self::text("")
        }
    }

    pub(super) fn texts(ours: impl Into<String>, printed: impl Into<String>) -> Self {
        Self {
            ours: Figure::Text(ours.into()),
            digits: 2,
            printed: Some(Figure::Text(printed.into())),
            tolerance: 0.0,
            deviation: None,
        }
    }

    pub(super) fn agrees(&self) -> bool {
        match (&self.ours, &self.printed) {
            (_, None) => true,
            (Figure::Number(ours), Some(Figure::Number(printed))) => {
                (ours - printed).abs() <= self.tolerance
            }
            (ours, Some(printed)) => ours == printed,
        }
    }

    fn text_form(&self) -> String {
        let mut text = self.ours.text_form(self.digits);
        if let Some(deviation) = self.deviation {
            // Writing to a string does not fail.
            let _ = write!(text, " ({deviation:.2})");
        }
        match &self.printed {
            None => text,
            Some(printed) => {
                let mark = if self.agrees() { "" } else { " !" };
                format!("{text} | {}{mark}", printed.text_form(self.digits))
            }
        }
    }

    fn json_form(&self) -> Value {
        let mut form = match (&self.printed, self.deviation) {
            (None, None) => return self.ours.json_form(),
            (None, _) => json!({ "ours": self.ours.json_form() }),
            (Some(printed), _) => json!({
                "ours": self.ours.json_form(),
                "printed": printed.json_form(),
                "agrees": self.agrees(),
            }),
        };
        if let Some(deviation) = self.deviation {
            form["deviation"] = json!(deviation);
        }
        form
    }
}

impl Figure {
    fn text_form(&self, digits: usize) -> String {
        match self {
            Self::Nothing => String::new(),
            Self::Number(number) => format!("{number:.digits$}"),
            Self::Text(text) => text.clone(),
        }
    }

    fn json_form(&self) -> Value {
        match self {
            Self::Nothing => Value::Null,
            Self::Number(number) => json!(number),
            Self::Text(text) => json!(text),
        }
    }
}

impl Row {
    /// Whether all figures agree with the printed ones.
    pub(super) fn agrees(&self) -> bool {
        self.cells.iter().all(Cell::agrees)
    }

    /// Whether all that is claimed in words holds, whatever the figures are.
    #[cfg(test)]
    pub(super) fn claims_hold(&self) -> bool {
        let in_words = |cell: &&Cell| matches!(cell.ours, Figure::Text(_));
        self.cells.iter().filter(in_words).all(Cell::agrees)
    }
}

impl Table {
    /// For people: a cell with two figures has ours first and the printed one second.
    pub(super) fn text(&self, name: &str, about: &str) -> String {
        let header: Vec<String> = std::iter::once(String::new())
            .chain(self.columns.iter().map(|column| (*column).to_owned()))
            .collect();
        let mut lines = vec![header];
        for row in &self.rows {
            let cells = row.cells.iter().map(Cell::text_form);
            lines.push(std::iter::once(row.label.clone()).chain(cells).collect());
        }
        let widths: Vec<usize> = (0..=self.columns.len())
            .map(|column| {
                let cells = lines.iter().filter_map(|line| line.get(column));
                cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
            })
            .collect();
        let mut cells = self.rows.iter().flat_map(|row| &row.cells);
        let key = if cells.any(|cell| cell.printed.is_some()) {
            "ours | printed, ! where they differ\n"
        } else {
            ""
        };
        let mut text = format!("{name}: {about}\n{key}\n");
        for (index, line) in lines.iter().enumerate() {
            let mut cells = line
                .iter()
                .zip(&widths)
                .map(|(cell, width)| format!("{cell:width$}"));
            let mut whole = cells.next().unwrap_or_default();
            for cell in cells {
                whole.push_str("  ");
                whole.push_str(&cell);
            }
            // Writing to a string does not fail.
            let _ = writeln!(text, "{}", whole.trim_end());
            let note = index.checked_sub(1).and_then(|row| self.rows[row].note);
            if let Some(note) = note {
                let indent = " ".repeat(widths[0]);
                let note = note.replace('\n', &format!("\n{indent}    "));
                let _ = writeln!(text, "{indent}  ^ {note}");
            }
        }
        for note in &self.notes {
            let _ = write!(text, "\n{note}\n");
        }
        text
    }

    /// For machines.
    pub(super) fn json(&self, name: &str, about: &str) -> Value {
        let rows = self.rows.iter().map(|row| {
            let cells = self.columns.iter().zip(&row.cells);
            let values: serde_json::Map<String, Value> = cells
                .map(|(column, cell)| ((*column).to_owned(), cell.json_form()))
                .collect();
            json!({
                "label": row.label, "values": values, "agrees": row.agrees(), "note": row.note,
            })
        });
        json!({
            "name": name, "about": about, "columns": self.columns,
            "rows": rows.collect::<Vec<_>>(), "notes": self.notes,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_shows_both_figures_and_why_they_differ() {
        let table = Table {
            columns: vec!["width", "passes"],
            rows: vec![
                Row {
                    label: "near".into(),
                    cells: vec![Cell::numbers(1.004, 1.05, 0.015), Cell::texts("yes", "yes")],
                    note: Some("a slip"),
                },
                Row {
                    label: "far away".into(),
                    cells: vec![Cell::number(2.0), Cell::text("no")],
                    note: None,
                },
            ],
            notes: vec!["That is all."],
        };
        let expected = "\
t: a test
ours | printed, ! where they differ

          width          passes
near      1.00 | 1.05 !  yes | yes
          ^ a slip
far away  2.00           no

That is all.
";
        assert_eq!(table.text("t", "a test"), expected);
        let json = table.json("t", "a test");
        assert_eq!(json["rows"][0]["values"]["width"]["agrees"], false);
        assert_eq!(json["rows"][1]["values"]["passes"], "no");
    }
}
