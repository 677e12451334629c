//! The schedule: what is done with which object and when. This file owns its tables, which stand in the
//! main file or in one of their own that whoever works there edits; and it guarantees that what it
//! returns ends after it starts.

use super::diagnostic::{Invalid, Problem, ProblemKind};
use super::file::{Kind, Names, document, moment, time_of_day};
use super::reader::{Problems, Table};
use super::{Activity, Scenario};
use dsr::Time;
use jiff::civil::{Date, Time as ClockTime};
use std::cmp::Ordering;

/// Reads a schedule by itself: the tables `[[activity]]` of a file, at clock times of the day of `day`.
/// Whether there are such objects is not asked.
///
/// # Errors
/// Every problem found, each with its line and column.
pub fn parse_schedule(file: &str, text: &str, day: Time) -> Result<Vec<Activity>, Box<Invalid>> {
    let mut names = Names::new(text);
    names.accept_objects();
    whole(text, &mut names, moment(day).date())
        .map_err(|problems| Box::new(Invalid::new(file, text, problems)))
}

/// Adds the activities of a schedule to a scenario that has been read but for them.
pub(super) fn extend(scenario: &mut Scenario, file: &str, text: &str) -> Result<(), Box<Invalid>> {
    let mut names = Names::new(text);
    let objects = scenario.objects.iter().map(|one| (&one.name, Kind::Object));
    let others = [
        scenario
            .rooms
            .iter()
            .map(|one| &one.name)
            .collect::<Vec<_>>(),
        scenario.places.iter().map(|one| &one.name).collect(),
        scenario.cameras.iter().map(|one| &one.name).collect(),
        scenario.people.iter().map(|one| &one.name).collect(),
        scenario.activities.iter().map(|one| &one.name).collect(),
        scenario.missions.iter().map(|one| &one.name).collect(),
        vec![&scenario.robot.name],
    ];
    let others = others.into_iter().flatten().map(|name| (name, Kind::Other));
    names.take_elsewhere(objects.chain(others));
    let activities = whole(text, &mut names, moment(scenario.start).date())
        .map_err(|problems| Box::new(Invalid::new(file, text, problems)))?;
    scenario.activities.extend(activities);
    Ok(())
}

fn whole(text: &str, names: &mut Names<'_>, day: Date) -> Result<Vec<Activity>, Vec<Problem>> {
    let document = document(text)?;
    let problems = Problems::default();
    let title = "the schedule".to_owned();
    let table = Table::new(document.get_ref(), 0..0, title, &problems);
    let activities = activities(&table, names, day);
    table.close();
    let problems = problems.into_vec();
    if problems.is_empty() {
        Ok(activities)
    } else {
        Err(problems)
    }
}

/// The tables `[[activity]]`.
pub(super) fn activities(file: &Table<'_>, names: &mut Names<'_>, day: Date) -> Vec<Activity> {
    let mut activities = Vec::new();
    for table in file.tables("activity") {
        let name = names.take(&table, Kind::Other);
        let object = table.require::<String>("object");
        if let Some(object) = object
            .as_ref()
            .filter(|o| !names.is(&o.value, Kind::Object))
        {
            names.unknown(table.problems, "object", &[Kind::Object], object);
        }
        for key in ["start", "end"] {
            if !table.has(key) {
                table.missing(key);
            }
        }
        let clocks = (
            table.moment::<ClockTime>("start"),
            table.moment::<ClockTime>("end"),
        );
        let cancelled = table.get("cancelled").is_some_and(|flag| flag.value);
        if let (Some(start), Some(end)) = clocks {
            let wrong = match end.cmp(&start) {
                Ordering::Less => Some(ProblemKind::EndsBeforeStart),
                Ordering::Equal => Some(ProblemKind::EndsAtStart),
                Ordering::Greater => None,
            };
            if let Some(wrong) = wrong {
                table.problems.add(wrong, table.span_of("end"));
            }
            let times = time_of_day(day, start).zip(time_of_day(day, end));
            if let (Some(name), Some(object), Some((start, end))) = (name, object, times) {
                activities.push(Activity {
                    name,
                    object: object.value,
                    start,
                    end,
                    cancelled,
                });
            }
        }
        table.close();
    }
    activities
}
