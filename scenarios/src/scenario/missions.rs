//! What the robot shall do and when, as scenarios and mission files say it. This file guarantees that
//! no mission waits for one that there is not, that can never succeed, or that waits for it in turn.

use super::Mission;
use super::diagnostic::{Invalid, Problem, ProblemKind};
use super::file::{Kind, Names, Read, document, file, moment, time, time_of_day};
use super::reader::{Bound, Located, Problems, Table};
use super::value::{DAY, Period, Preemption};
use agents::names::suggest;
use dsr::Time;
use jiff::civil::{DateTime, Time as ClockTime};
use std::collections::BTreeSet;
use std::fmt;

/// Missions to be submitted together, and the grammar that they go by.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MissionFile {
    /// The grammar's file, relative to the mission file's folder, and its text.
    pub rules: Option<(String, String)>,
    /// In the order of the file.
    pub missions: Vec<Mission>,
}

/// What there is already when a mission file is submitted.
#[derive(Clone, Copy)]
pub struct Present<'a> {
    /// The time of the instance.
    pub now: Time,
    /// Its missions.
    pub missions: &'a [Earlier],
    /// Whether a node has this name.
    pub has: &'a dyn Fn(&str) -> bool,
}

impl fmt::Debug for Present<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let missions = self.missions;
        f.debug_struct("Present")
            .field("now", &self.now)
            .field("missions", &missions)
            .finish_non_exhaustive()
    }
}

/// A mission that is there already.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Earlier {
    /// Its name.
    pub name: String,
    /// What became of it, where it will never succeed.
    pub hopeless: Option<String>,
}

impl MissionFile {
    /// Reads a mission file, as far as it can be read, and tells every problem with it. `rules` names the grammar to go by; each `[[mission]]` has a `name`, a
    /// `goal` (a file) and, where they are wanted, `priority`, `preemption`, `at` (a time of day, the next
    /// one after that of `present`; days begin at midnight of the instance's clock), `every` ("hour", "day", "week" or
    /// seconds), `within` (seconds from its beginning until it fails) and `after` (the name of a mission
    /// that must have succeeded: of the file, or one that is present). `read` gives what is in the files that it
    /// names, `file` is how diagnostics call it.
    pub fn parse(
        file: &str,
        text: &str,
        present: Present<'_>,
        read: &dyn Fn(&str) -> std::io::Result<Vec<u8>>,
    ) -> (Self, Option<Box<Invalid>>) {
        let invalid = |problems: Vec<Problem>| Box::new(Invalid::new(file, text, problems));
        let document = match document(text) {
            Ok(document) => document,
            Err(problems) => return (Self::default(), Some(invalid(problems))),
        };
        let problems = Problems::default();
        let title = "the mission file".to_owned();
        let table = Table::new(document.get_ref(), 0..0, title, &problems);
        let mut names = Names::new(text);
        let path = table.get::<String>("rules");
        let rules = path.map(|path| (path.value, super::file::file(&table, "rules", "", read)));
        let missions = missions(
            &table,
            &mut names,
            moment(present.now),
            present.missions,
            read,
        );
        for name in names.all().filter(|name| (present.has)(&name.value)) {
            let kind = ProblemKind::TakenName { name: name.value };
            problems.add(kind, name.span);
        }
        if !table.has("mission") {
            let message = "it names no mission: each begins with a line [[mission]]";
            problems.add(ProblemKind::BadEntry { message }, 0..0);
        }
        table.close();
        let problems = problems.into_vec();
        let wrong = (!problems.is_empty()).then(|| invalid(problems));
        (Self { rules, missions }, wrong)
    }
}

/// The missions of a table; times of day are the next ones after `begin`, or at it.
pub(super) fn missions(
    outer: &Table<'_>,
    names: &mut Names<'_>,
    begin: DateTime,
    earlier: &[Earlier],
    read: Read<'_>,
) -> Vec<Mission> {
    let mut missions = Vec::new();
    let mut waits: Vec<Wait> = Vec::new();
    for table in outer.tables("mission") {
        let name = names.take(&table, Kind::Other);
        let path = table.require::<String>("goal");
        let goal = path
            .as_ref()
            .map(|path| file(&table, "goal", &path.value, read));
        let priority = table.get("priority").map_or(0, |priority| priority.value);
        let seconds = |key| {
            let given = table.has(key);
            given.then(|| table.number(key, Bound::Seconds, 1.0))
        };
        let deadline = seconds("deadline");
        let within = seconds("within");
        let preemption = table.get::<Preemption>("preemption");
        let preemption = preemption.map_or(Preemption::default(), |policy| policy.value);
        let period = table.get::<Period>("every").map(|period| period.value.0);
        let at = table.moment::<ClockTime>("at");
        let begins = match at {
            Some(at) => next(begin, at, period),
            // Periods are counted from its first beginning.
            None => period.and_then(|_| time(begin)),
        };
        if let (Some(begins), Some(now), Some(deadline)) = (begins, time(begin), deadline)
            && begins.since(now) >= deadline
        {
            let message = "its deadline comes before it begins";
            let kind = ProblemKind::BadEntry { message };
            table.problems.add(kind, table.span_of("deadline"));
        }
        let after = table.get::<String>("after");
        waits.extend(name.clone().map(|name| (name, after.clone())));
        if let (Some(name), Some(path), Some(goal)) = (name, path, goal) {
            missions.push(Mission {
                name,
                file: path.value,
                goal,
                priority,
                deadline,
                preemption: preemption.0,
                begins,
                period,
                within,
                after: after.map(|after| after.value),
            });
        }
        table.close();
    }
    for (name, after) in &waits {
        if let Some(after) = after
            && let Some(kind) = vain(name, &after.value, &waits, earlier)
        {
            outer.problems.add(kind, after.span.clone());
        }
    }
    missions
}

/// A mission's name, and the one that it waits for.
type Wait = (String, Option<Located<String>>);

/// Why a mission waits in vain, if it does.
fn vain(name: &str, after: &str, waits: &[Wait], earlier: &[Earlier]) -> Option<ProblemKind> {
    let find = |name: &str| waits.iter().find(|(known, _)| known == name);
    if find(after).is_none() {
        let Some(known) = earlier.iter().find(|known| known.name == after) else {
            let here: BTreeSet<&str> = waits.iter().map(|(name, _)| name.as_str()).collect();
            let earlier = earlier.iter().map(|known| known.name.as_str());
            let earlier = earlier
                .filter(|name| !here.contains(name))
                .collect::<Vec<_>>();
            return Some(ProblemKind::UnknownName {
                kind: "mission",
                name: after.to_owned(),
                help: suggest(after, here.iter().copied().chain(earlier)),
            });
        };
        let outcome = known.hopeless.clone()?;
        let mission = after.to_owned();
        return Some(ProblemKind::WaitsInVain { mission, outcome });
    }
    // Whom it waits for, whom that one waits for, and so on until one of them comes twice.
    let mut chain = vec![after];
    while chain.last() != Some(&name) {
        let (_, next) = chain.last().and_then(|last| find(last))?;
        let next = next.as_ref()?.value.as_str();
        if chain.contains(&next) {
            return None;
        }
        chain.push(next);
    }
    chain.pop();
    Some(ProblemKind::WaitsForItself {
        mission: name.to_owned(),
        by: chain.into_iter().map(str::to_owned).collect(),
    })
}

/// The first time after `begin`, or at it, that a clock shows `at`, or that is a whole number of periods after
/// that time of this day.
fn next(begin: DateTime, at: ClockTime, period: Option<f64>) -> Option<Time> {
    let today = time_of_day(begin.date(), at)?;
    let late = time(begin)?.since(today);
    let step = period.unwrap_or(DAY).min(DAY);
    Some(if late > 0.0 {
        today + (late / step).ceil() * step
    } else {
        today
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use expect_test::expect;

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
goal = "call.aggt"
"#;

    /// Reads a file at an hour of some day; what is wrong with it, a line each.
    fn parse(text: &str, hour: f64) -> Result<MissionFile, String> {
        let now = Time::from_seconds(20_000.0 * DAY + hour * 3600.0);
        let earlier = |name: &str, hopeless: Option<&str>| Earlier {
            name: name.to_owned(),
            hopeless: hopeless.map(str::to_owned),
        };
        let earlier = [
            earlier("therapy", None),
            earlier("meal", Some("was cancelled")),
        ];
        let read = |path: &str| match path {
            "rules.aggl" | "call.aggt" => Ok(path.as_bytes().to_vec()),
            _ => Err(std::io::Error::from(std::io::ErrorKind::NotFound)),
        };
        let present = Present {
            now,
            missions: &earlier,
            has: &|name| name == "robot",
        };
        let (file, wrong) = MissionFile::parse("round.toml", text, present, &read);
        wrong.map_or(Ok(file), |invalid| {
            let lines = invalid.problems.iter().map(|problem| {
                let help = miette::Diagnostic::help(problem);
                let help = help.map_or_else(String::new, |help| format!(" ({help})"));
                format!("{}:{} {problem}{help}", problem.line, problem.column)
            });
            Err(lines.collect::<Vec<_>>().join("\n"))
        })
    }

    #[test]
    fn times_of_day_are_the_next_ones() {
        for (hour, day) in [(9.0, 0.0), (10.5, 0.0), (11.0, 1.0)] {
            let file = parse(ROUND, hour).unwrap();
            assert_eq!(file.rules.unwrap().1, "rules.aggl");
            let [call, look] = &file.missions[..] else {
                panic!("two missions")
            };
            let begins = Time::from_seconds((20_000.0 + day) * DAY + 10.5 * 3600.0);
            assert_eq!(call.begins, Some(begins), "{hour}");
            assert_eq!((call.period, call.within), (Some(DAY), Some(600.0)));
            assert_eq!(
                (call.priority, call.preemption.as_str()),
                (2, "between_steps")
            );
            assert_eq!((look.begins, look.period, look.within), (None, None, None));
        }
    }

    #[test]
    fn all_that_is_wrong_is_told_at_once() {
        let wrong = ROUND
            .replace("priority = 2", "prioritiy = 2\ndeadline = \"noon\"")
            .replace("10:30", "25:00")
            .replace("\"day\"", "\"moon\"")
            .replace("600", "-1")
            .replace("between_steps", "soon")
            .replace("\"look\"", "\"call\"")
            .replace("rules.aggl", "rule.aggl")
            .replace("therapy", "terapy");
        let wrong = wrong + "\n[[mission]]\nnam = \"c\"\n";
        let odd = "\n[[mission]]\nname = \"robot\"\ngoal = \"call.aggt\"\nat = \"11:00\"\n\
            deadline = 20\nevery = 1e300\nwithin = 1e18\n";
        expect![[r#"
            2:9 cannot read `rule.aggl`: entity not found
            7:1 unknown key `prioritiy` in [[mission]] (did you mean `priority`?)
            8:12 `deadline` must be a number
            9:14 `preemption` must be "at_once", "between_steps" or "never"
            10:6 `25:00` is not a time of the day, as "10:30"
            11:9 `every` must be "hour", "day", "week" or a number of seconds from 1 to 3.2e9
            12:10 `within` must be more than 0 and at most 3.2e9 (seconds: a hundred years)
            13:9 there is no mission called `terapy` (did you mean `therapy`?)
            16:8 the name `call` is used twice (first used in line 5)
            19:1 [[mission]] lacks `name`
            19:1 [[mission]] lacks `goal`
            20:1 unknown key `nam` in [[mission]] (did you mean `name`?)
            23:8 there is already a node `robot`
            26:12 its deadline comes before it begins
            27:9 `every` must be "hour", "day", "week" or a number of seconds from 1 to 3.2e9
            28:10 `within` must be more than 0 and at most 3.2e9 (seconds: a hundred years)"#]]
        .assert_eq(&parse(&(wrong + odd), 9.0).unwrap_err());
        expect!["1:1 it names no mission: each begins with a line [[mission]]"]
            .assert_eq(&parse("", 9.0).unwrap_err());
        expect!["1:11 unclosed array table, expected `]`"]
            .assert_eq(&parse("[[mission]\nname = 1 2\n", 9.0).unwrap_err());
    }

    #[test]
    fn who_waits_in_vain_is_told() {
        let round = |waits: &[(&str, &str)]| {
            let missions = waits.iter().map(|(name, after)| {
                format!(
                    "[[mission]]\nname = \"{name}\"\ngoal = \"call.aggt\"\nafter = \"{after}\"\n"
                )
            });
            parse(&missions.collect::<String>(), 9.0).unwrap_err()
        };
        expect!["4:9 mission `a` waits for itself"].assert_eq(&round(&[("a", "a")]));
        expect![[r"
            4:9 mission `a` waits for itself, by way of b and c
            8:9 mission `b` waits for itself, by way of c and a
            12:9 mission `c` waits for itself, by way of a and b"]]
        .assert_eq(&round(&[("a", "b"), ("b", "c"), ("c", "a"), ("d", "a")]));
        expect!["4:9 mission `meal` was cancelled, and does not begin again"]
            .assert_eq(&round(&[("a", "meal")]));
    }
}
