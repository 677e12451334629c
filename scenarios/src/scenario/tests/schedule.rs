//! The schedule in a file of its own, with a scenario and alone.

use super::*;
use crate::scenario::{Invalid, parse_schedule};
use dsr::Time;

const SCHEDULE: &str = r#"
[[activity]]
name = "match"
object = "screen"
start = "14:00"
end = "16:00"
cancelled = true
"#;

fn with(schedule: &str) -> Result<Scenario, Box<Invalid>> {
    let text = format!("schedule = \"today.toml\"\n{TWO_ROOMS}");
    let read = |name: &str| match name {
        "today.toml" => Ok(schedule.as_bytes().to_vec()),
        _ => Ok(Vec::new()),
    };
    Scenario::parse("rooms/scenario.toml", &text, &read)
}

fn told(invalid: &Invalid) -> Vec<String> {
    let one = |problem: &crate::scenario::Problem| format!("{}: {}", problem.line, problem.kind);
    invalid.problems.iter().map(one).collect()
}

#[test]
fn a_schedule_adds_to_the_activities_of_the_main_file() {
    let scenario = with(SCHEDULE).expect("a good schedule");
    let activities: Vec<_> = scenario
        .activities
        .iter()
        .map(|one| (one.name.as_str(), one.cancelled))
        .collect();
    assert_eq!(activities, [("news", false), ("match", true)]);
    let after = scenario.activities[1].start.since(scenario.start);
    assert!((after - 4.0 * 3600.0).abs() < 1e-6);
}

#[test]
fn what_is_wrong_with_a_schedule_is_told_with_its_own_file_and_lines() {
    let invalid = with(&SCHEDULE.replace("16:00", "14:00")).expect_err("a bad schedule");
    assert_eq!(told(&invalid), ["6: this activity ends when it starts"]);
    let spoilt = SCHEDULE
        .replace("\"screen\"", "\"sreen\"")
        .replace("\"match\"", "\"news\"")
        .replace("16:00", "13:00");
    let invalid = with(&spoilt).expect_err("a bad schedule");
    assert_eq!(invalid.file, "rooms/today.toml");
    let told = told(&invalid);
    assert_eq!(told.len(), 3, "{told:?}");
    assert!(
        told[0].starts_with("3: ") && told[0].contains("of this name already"),
        "{told:?}"
    );
    assert!(
        told[1].starts_with("4: there is no object called `sreen`"),
        "{told:?}"
    );
    assert!(
        told[2].starts_with("6: this activity ends before it starts"),
        "{told:?}"
    );
    let invalid = with("[[activty]]").expect_err("a bad schedule");
    assert_eq!(invalid.problems.len(), 1);
}

#[test]
fn alone_it_may_name_any_object_on_the_day_that_is_given() {
    let day = 20_514.0 * 86_400.0;
    let read = |text: &str| parse_schedule("today.toml", text, Time::from_seconds(day + 70_000.0));
    let activities = read(SCHEDULE).expect("a good schedule");
    assert!((activities[0].start.seconds() - day - 14.0 * 3600.0).abs() < 1e-6);
    assert!(read(&SCHEDULE.replace("screen", "elsewhere")).is_ok());
    assert!(read("").is_ok_and(|none| none.is_empty()));
    let twice = format!("{SCHEDULE}{SCHEDULE}");
    assert_eq!(told(&read(&twice).expect_err("one name twice")).len(), 1);
}
