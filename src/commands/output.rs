//! Printing answers on standard output. Guarantees that colours are for terminals only.

use crate::Failure;
use dsr::{Time, Value, json};
use std::fmt;
use std::io::{IsTerminal, Write};

/// Prints; a reader that went away (`| head`) is no error.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut output = std::io::stdout().lock();
    let printed = output.write_all(text.as_bytes());
    match printed.and_then(|()| output.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure::internal(
            format!("cannot write what was asked for: {error}"),
        )),
        _ => Ok(()),
    }
}

/// Prints JSON for people and machines.
pub(crate) fn print_json(json: &serde_json::Value) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(json).map_err(Failure::internal)?;
    print(&format!("{text}\n"))
}

/// Says something beside the answer, on standard error.
pub(crate) fn tell(text: &str) {
    drop(std::io::stderr().write_all(text.as_bytes()));
}

/// Whether standard output shows colours, and nobody said that it should not.
fn colours() -> bool {
    std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}

fn styled(text: &str, style: &str) -> String {
    if text.is_empty() || !colours() {
        text.to_owned()
    } else {
        format!("\x1b[{style}m{text}\x1b[0m")
    }
}

/// What a line is about.
pub(crate) fn bold(text: &str) -> String {
    styled(text, "1")
}

/// What matters less.
pub(crate) fn dim(text: &str) -> String {
    styled(text, "2")
}

/// What is new.
pub(crate) fn green(text: &str) -> String {
    styled(text, "32")
}

/// What is gone.
pub(crate) fn red(text: &str) -> String {
    styled(text, "31")
}

/// What is different.
pub(crate) fn yellow(text: &str) -> String {
    styled(text, "33")
}

/// The beginning of a text that is longer than `most` characters.
pub(crate) fn brief(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{} ...", &text[..end]),
        None => text.to_owned(),
    }
}

/// A time as people read it: the date and the time of day by the clock of the instance.
pub(crate) fn clock(time: Time) -> String {
    let moment = jiff::Timestamp::from_nanosecond(time.nanoseconds().into()).unwrap_or_default();
    let moment = moment.to_zoned(jiff::tz::TimeZone::UTC);
    let whole = moment.subsec_nanosecond() / 1_000_000 == 0;
    let form = if whole {
        "%Y-%m-%d %H:%M:%S"
    } else {
        "%Y-%m-%d %H:%M:%S%.3f"
    };
    moment.strftime(form).to_string()
}

/// A value as people read it.
pub(crate) fn value_text(value: &Value) -> String {
    match value {
        Value::Pose(pose) => {
            let (at, turn) = (pose.translation.vector, pose.rotation);
            let (roll, pitch, yaw) = turn.euler_angles();
            if roll.abs() < 1e-6 && pitch.abs() < 1e-6 && at.z.abs() < 1e-6 {
                format!("({:.3}, {:.3}) m, heading {yaw:.3} rad", at.x, at.y)
            } else {
                format!(
                    "({:.3}, {:.3}, {:.3}) m, roll {roll:.3} pitch {pitch:.3} yaw {yaw:.3} rad",
                    at.x, at.y, at.z
                )
            }
        }
        Value::F64(x) => format!("{x}"),
        Value::F32(x) => format!("{x}"),
        Value::I32(n) => format!("{n}"),
        Value::U32(n) => format!("{n}"),
        Value::U64(n) => format!("{n}"),
        Value::Vector(row) | Value::F64List(row) => {
            let row: Vec<String> = row.iter().map(|x| format!("{x:.3}")).collect();
            format!("[{}]", row.join(", "))
        }
        Value::F32Vector(row) | Value::F32List(row) => {
            let row: Vec<String> = row.iter().map(|x| format!("{x:.3}")).collect();
            format!("[{}]", row.join(", "))
        }
        Value::Large(handle) => handle.to_string(),
        Value::U8List(bytes) => format!("{bytes:?}"),
        Value::U64List(row) => format!("{row:?}"),
        Value::Bool(_) | Value::I64(_) | Value::String(_) => json::value_to_json(value).to_string(),
    }
}

/// Columns that line up. A row whose only text is its first is a line of its own, and does not count
/// for the columns.
#[derive(Debug, Default)]
pub(crate) struct Table {
    indent: usize,
    rows: Vec<Vec<String>>,
}

/// How many characters a terminal shows of a text.
fn width(text: &str) -> usize {
    let mut shown = 0;
    let mut escape = false;
    for letter in text.chars() {
        match letter {
            '\x1b' => escape = true,
            'm' if escape => escape = false,
            _ if escape => {}
            _ => shown += 1,
        }
    }
    shown
}

impl Table {
    pub(crate) fn new(headings: &[&str]) -> Self {
        let mut table = Self::default();
        table.rows.push(headings.iter().map(|h| dim(h)).collect());
        table
    }

    /// A table without headings.
    pub(crate) fn indented(indent: usize) -> Self {
        Self {
            indent,
            rows: Vec::new(),
        }
    }

    pub(crate) fn row<const N: usize>(&mut self, row: [String; N]) {
        self.rows.push(row.into());
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let alone = |row: &[String]| row.iter().skip(1).all(String::is_empty);
        let mut widths: Vec<usize> = Vec::new();
        for row in self.rows.iter().filter(|row| !alone(row)) {
            widths.resize(widths.len().max(row.len()), 0);
            for (widest, cell) in widths.iter_mut().zip(row) {
                *widest = (*widest).max(width(cell));
            }
        }
        for row in &self.rows {
            let mut line = " ".repeat(self.indent);
            for (column, cell) in row.iter().enumerate() {
                line.push_str(cell);
                let wide = widths.get(column).copied().unwrap_or(0);
                line.push_str(&" ".repeat(wide.saturating_sub(width(cell)) + 2));
            }
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_whatever_is_coloured() {
        let mut table = Table::indented(1);
        table.row(["\x1b[1ma\x1b[0m".to_owned(), "b".to_owned()]);
        table.row(["a long line of its own".to_owned(), String::new()]);
        table.row(["ccc".to_owned(), "d".to_owned()]);
        assert_eq!(
            table.to_string(),
            " \x1b[1ma\x1b[0m    b\n a long line of its own\n ccc  d\n"
        );
    }
}
