//! Mission files: TOML that says what shall be done and when. This file guarantees that all that is
//! wrong with one is told at once, each with its place.

use super::{MissionSpec, Preemption, Schedule};
use dsr::Time;
use miette::{Diagnostic, NamedSource, SourceSpan};
use serde::Deserialize;
use std::ops::Range;
use thiserror::Error;
use toml::Spanned;

/// Seconds of a day.
const DAY: f64 = 86_400.0;

/// All that is wrong with a mission file.
#[derive(Debug, Clone, Error, Diagnostic)]
#[error("{} in the mission file", match .defects.len() { 1 => "a fault".to_owned(), n => format!("{n} faults") })]
#[diagnostic(code(missions))]
pub struct MissionFileError {
    #[source_code]
    text: NamedSource<String>,
    #[related]
    defects: Vec<Defect>,
}

/// One thing that is wrong.
#[derive(Debug, Clone, Error, Diagnostic)]
#[error("{message}")]
struct Defect {
    message: String,
    #[label("here")]
    span: Option<SourceSpan>,
    #[help]
    help: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    rules: Option<String>,
    #[serde(default)]
    mission: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: Spanned<String>,
    goal: Spanned<String>,
    #[serde(default)]
    priority: i64,
    preemption: Option<Spanned<String>>,
    at: Option<Spanned<String>>,
    every: Option<Spanned<Every>>,
    within: Option<Spanned<f64>>,
    after: Option<String>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Every {
    Seconds(f64),
    Word(String),
}

/// A mission file.
#[derive(Debug, Clone, PartialEq)]
pub struct MissionFile {
    /// The grammar to go by, relative to the file's folder.
    pub rules: Option<String>,
    /// The missions, in the order of the file.
    pub missions: Vec<PlannedMission>,
}

/// A mission of a file, whose goal is in a file of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedMission {
    name: String,
    /// The file of its goal, relative to the file's folder.
    pub goal: String,
    priority: i64,
    preemption: Preemption,
    /// Seconds since midnight.
    at: Option<f64>,
    period: Option<f64>,
    within: Option<f64>,
    after: Option<String>,
}

impl PlannedMission {
    /// The mission as of `now`, with the text of its goal.
    ///
    /// A time of day is its next one; days begin at midnight of the instance's clock.
    pub fn spec(&self, now: Time, goal: String) -> MissionSpec {
        let begins = match (self.at, self.period) {
            (Some(at), _) => {
                let today = now - now.seconds().rem_euclid(DAY) + at;
                Some(if today < now { today + DAY } else { today })
            }
            (None, Some(_)) => Some(now),
            (None, None) => None,
        };
        MissionSpec {
            name: self.name.clone(),
            goal,
            priority: self.priority,
            deadline: self.within.map(|within| begins.unwrap_or(now) + within),
            preemption: self.preemption,
            schedule: Schedule {
                begins,
                period: self.period,
                after: self.after.clone(),
            },
        }
    }
}

/// Notes what is wrong.
#[derive(Default)]
struct Reader {
    defects: Vec<Defect>,
}

impl Reader {
    fn note(&mut self, message: String, span: Range<usize>, help: &str) {
        self.defects.push(Defect {
            message,
            span: Some(span.into()),
            help: (!help.is_empty()).then(|| help.to_owned()),
        });
    }

    fn positive(&mut self, what: &str, seconds: &Spanned<f64>) -> f64 {
        let value = *seconds.get_ref();
        if !(value.is_finite() && value > 0.0) {
            let message = format!("`{what}` must be more than 0 seconds");
            self.note(message, seconds.span(), "");
        }
        value
    }

    fn mission(&mut self, entry: &Entry) -> PlannedMission {
        if entry.name.get_ref().is_empty() {
            self.note("a mission has a name".to_owned(), entry.name.span(), "");
        }
        let at = entry.at.as_ref().and_then(|at| {
            let seconds = time_of_day(at.get_ref());
            if seconds.is_none() {
                let message = format!("`{}` is no time of day", at.get_ref());
                self.note(message, at.span(), "write \"10:00\", or \"10:00:30\"");
            }
            seconds
        });
        let period = entry.every.as_ref().and_then(|every| {
            let period = match every.get_ref() {
                Every::Seconds(seconds) => Some(*seconds),
                Every::Word(word) => match word.as_str() {
                    "hour" => Some(3600.0),
                    "day" => Some(DAY),
                    "week" => Some(7.0 * DAY),
                    _ => None,
                },
            };
            let period = period.filter(|period| period.is_finite() && *period > 0.0);
            if period.is_none() {
                let help = "write \"hour\", \"day\", \"week\", or a number of seconds";
                self.note("no period".to_owned(), every.span(), help);
            }
            period
        });
        let preemption = entry.preemption.as_ref().and_then(|policy| {
            let mut all = Preemption::ALL.into_iter();
            let known = all.find(|known| known.name() == policy.get_ref());
            if known.is_none() {
                let message = format!("no such policy `{}`", policy.get_ref());
                let names = Preemption::ALL.map(Preemption::name).join(", ");
                self.note(message, policy.span(), &format!("one of {names}"));
            }
            known
        });
        PlannedMission {
            name: entry.name.get_ref().clone(),
            goal: entry.goal.get_ref().clone(),
            priority: entry.priority,
            preemption: preemption.unwrap_or_default(),
            at,
            period,
            within: (entry.within.as_ref()).map(|within| self.positive("within", within)),
            after: entry.after.clone(),
        }
    }
}

/// Seconds since midnight of `HH:MM` or `HH:MM:SS`.
fn time_of_day(text: &str) -> Option<f64> {
    let mut parts = text.split(':').map(|part| {
        let digits = part.len() == 2 && part.bytes().all(|byte| byte.is_ascii_digit());
        part.parse::<u32>().ok().filter(|_| digits)
    });
    let (hours, minutes) = (parts.next()??, parts.next()??);
    let seconds = match parts.next() {
        Some(seconds) => seconds?,
        None => 0,
    };
    let fits = hours < 24 && minutes < 60 && seconds < 60 && parts.next().is_none();
    fits.then(|| f64::from(hours * 3600 + minutes * 60 + seconds))
}

impl MissionFile {
    /// Reads a mission file: `rules` names the grammar to go by; each `[[mission]]` has a `name`, a
    /// `goal` (a file) and, where they are wanted, `priority`, `preemption`, `at` (a time of day),
    /// `every` ("hour", "day", "week" or seconds), `within` (seconds from its beginning until it
    /// fails) and `after` (the name of a mission that must have succeeded).
    ///
    /// # Errors
    /// Broken TOML, unknown keys and values that make no sense; all at once.
    pub fn from_toml(file_name: &str, text: &str) -> Result<Self, MissionFileError> {
        let error = |defects| MissionFileError {
            text: NamedSource::new(file_name, text.to_owned()),
            defects,
        };
        let file: File = toml::from_str(text).map_err(|e| {
            error(vec![Defect {
                message: e.message().to_owned(),
                span: e.span().map(Into::into),
                help: None,
            }])
        })?;
        let mut reader = Reader::default();
        let missions: Vec<_> = file.mission.iter().map(|one| reader.mission(one)).collect();
        for (index, entry) in file.mission.iter().enumerate() {
            let same = |other: &Entry| other.name.get_ref() == entry.name.get_ref();
            if file.mission[..index].iter().any(same) {
                let message = format!("there are two missions `{}`", entry.name.get_ref());
                reader.note(message, entry.name.span(), "");
            }
        }
        if reader.defects.is_empty() {
            let rules = file.rules;
            Ok(Self { rules, missions })
        } else {
            Err(error(reader.defects))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROUND: &str = r#"
rules = "rules.aggl"

[[mission]]
name = "call"
goal = "call.aggt"
priority = 2
preemption = "between_steps"
at = "10:30"
every = "day"
within = 600
after = "therapy"

[[mission]]
name = "look"
goal = "look.aggt"
"#;

    #[test]
    fn times_of_day_are_the_next_ones() {
        let file = MissionFile::from_toml("round.toml", ROUND).unwrap();
        assert_eq!(file.rules.as_deref(), Some("rules.aggl"));
        let midnight = Time::from_seconds(20_000.0 * DAY);
        let begins = |hour: f64| {
            let now = midnight + hour * 3600.0;
            let spec = file.missions[0].spec(now, String::new());
            let begins = spec.schedule.begins.unwrap();
            assert!((spec.deadline.unwrap().since(begins) - 600.0).abs() < 1e-6);
            begins.since(midnight) / 3600.0
        };
        assert!((begins(9.0) - 10.5).abs() < 1e-6);
        assert!((begins(11.0) - 34.5).abs() < 1e-6);
        let spec = file.missions[0].spec(midnight, "{}".to_owned());
        assert_eq!((spec.priority, spec.goal.as_str()), (2, "{}"));
        assert_eq!(spec.preemption, Preemption::BetweenSteps);
        assert_eq!(spec.schedule.period, Some(DAY));
        assert_eq!(spec.schedule.after.as_deref(), Some("therapy"));
        let look = file.missions[1].spec(midnight, String::new());
        assert_eq!((look.schedule, look.deadline), (Schedule::default(), None));
    }

    #[test]
    fn all_that_is_wrong_is_told_at_once() {
        let wrong = ROUND
            .replace("10:30", "25:00")
            .replace("\"day\"", "\"moon\"")
            .replace("600", "-1")
            .replace("between_steps", "soon")
            .replace("\"look\"", "\"call\"");
        let error = MissionFile::from_toml("round.toml", &wrong).unwrap_err();
        let told: Vec<String> = error.defects.iter().map(ToString::to_string).collect();
        assert_eq!(
            told,
            [
                "`25:00` is no time of day",
                "no period",
                "no such policy `soon`",
                "`within` must be more than 0 seconds",
                "there are two missions `call`",
            ]
        );
        assert!(MissionFile::from_toml("a.toml", "[[mission]]\nnam = 1").is_err());
        for bad in ["1:00", "10:60", "10:00:00:00", "+1:00", "10"] {
            assert_eq!(time_of_day(bad), None, "{bad}");
        }
    }
}
