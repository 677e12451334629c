//! What a TOML value may be read as. A type says what it expects, for the diagnostic.

use super::reader::{LONGEST, Located};
use jiff::civil::{DateTime, Time as ClockTime};
use toml::de::DeValue;

/// A type that a TOML value can be read as.
pub(super) trait Value: Sized {
    /// What the value must be, for the diagnostic.
    const EXPECTED: &'static str;
    /// The value, if it is of this type.
    fn read(value: &DeValue<'_>) -> Option<Self>;
}

/// Seconds of a day.
pub(super) const DAY: f64 = 86_400.0;

impl Value for f64 {
    const EXPECTED: &'static str = "a number";
    fn read(value: &DeValue<'_>) -> Option<Self> {
        match value {
            DeValue::Float(float) => float.as_str().parse().ok(),
            DeValue::Integer(integer) => integer.as_str().parse().ok(),
            _ => None,
        }
    }
}

impl Value for i64 {
    const EXPECTED: &'static str = "a whole number";
    fn read(value: &DeValue<'_>) -> Option<Self> {
        let DeValue::Integer(integer) = value else {
            return None;
        };
        Self::from_str_radix(integer.as_str(), integer.radix()).ok()
    }
}

impl Value for bool {
    const EXPECTED: &'static str = "true or false";
    fn read(value: &DeValue<'_>) -> Option<Self> {
        if let DeValue::Boolean(flag) = value {
            Some(*flag)
        } else {
            None
        }
    }
}

impl Value for String {
    const EXPECTED: &'static str = "a text in quotes";
    fn read(value: &DeValue<'_>) -> Option<Self> {
        if let DeValue::String(text) = value {
            Some(text.to_string())
        } else {
            None
        }
    }
}

/// How long it takes until a mission begins again, seconds.
pub(super) struct Period(pub(super) f64);

impl Value for Period {
    const EXPECTED: &'static str =
        "\"hour\", \"day\", \"week\" or a number of seconds from 1 to 3.2e9";
    fn read(value: &DeValue<'_>) -> Option<Self> {
        let seconds = match String::read(value).as_deref() {
            Some("hour") => Some(3600.0),
            Some("day") => Some(DAY),
            Some("week") => Some(7.0 * DAY),
            Some(_) => None,
            None => f64::read(value),
        };
        seconds
            .filter(|seconds| (1.0..=LONGEST).contains(seconds))
            .map(Self)
    }
}

/// When a mission gives way to one of higher priority.
pub(super) struct Preemption(pub(super) String);

impl Default for Preemption {
    fn default() -> Self {
        Self("at_once".to_owned())
    }
}

impl Value for Preemption {
    const EXPECTED: &'static str = "\"at_once\", \"between_steps\" or \"never\"";
    fn read(value: &DeValue<'_>) -> Option<Self> {
        let name = String::read(value)?;
        let known = ["at_once", "between_steps", "never"].contains(&name.as_str());
        known.then_some(Self(name))
    }
}

impl<const N: usize> Value for [f64; N] {
    const EXPECTED: &'static str = match N {
        2 => "two numbers, as [x, y]",
        3 => "three numbers, as [x, y, heading]",
        4 => "four numbers, as [xmin, ymin, xmax, ymax]",
        _ => "a list of numbers",
    };
    fn read(value: &DeValue<'_>) -> Option<Self> {
        let DeValue::Array(list) = value else {
            return None;
        };
        let numbers: Option<Vec<f64>> = list.iter().map(|item| f64::read(item.get_ref())).collect();
        numbers?.try_into().ok()
    }
}

impl Value for Vec<[f64; 2]> {
    const EXPECTED: &'static str = "a list of points, as [[x, y], [x, y], [x, y]]";
    fn read(value: &DeValue<'_>) -> Option<Self> {
        let DeValue::Array(list) = value else {
            return None;
        };
        list.iter()
            .map(|item| <[f64; 2]>::read(item.get_ref()))
            .collect()
    }
}

impl Value for Vec<Located<String>> {
    const EXPECTED: &'static str = "a list of names";
    fn read(value: &DeValue<'_>) -> Option<Self> {
        let DeValue::Array(list) = value else {
            return None;
        };
        list.iter()
            .map(|item| {
                let value = String::read(item.get_ref())?;
                Some(Located {
                    value,
                    span: item.span(),
                })
            })
            .collect()
    }
}

/// A date with a time, or a time of the day, in quotes or in TOML's own notation.
fn moment_text(value: &DeValue<'_>) -> Option<String> {
    match value {
        DeValue::String(text) => Some(text.to_string()),
        DeValue::Datetime(moment) => Some(moment.to_string()),
        _ => None,
    }
}

impl Value for Result<DateTime, String> {
    const EXPECTED: &'static str = "a date and time, as \"2026-03-02T10:25:00\"";
    fn read(value: &DeValue<'_>) -> Option<Self> {
        let text = moment_text(value)?;
        Some(text.parse().map_err(|_| text))
    }
}

impl Value for Result<ClockTime, String> {
    const EXPECTED: &'static str = "a time of the day, as \"10:30\"";
    fn read(value: &DeValue<'_>) -> Option<Self> {
        let text = moment_text(value)?;
        Some(text.parse().map_err(|_| text))
    }
}

/// Whether every number in a value is finite.
pub(super) fn is_finite(value: &DeValue<'_>) -> bool {
    match value {
        DeValue::Float(_) => f64::read(value).is_some_and(f64::is_finite),
        DeValue::Array(list) => list.iter().all(|item| is_finite(item.get_ref())),
        _ => true,
    }
}
