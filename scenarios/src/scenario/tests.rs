//! Scenario files: what a good one says, and where each mistake is underlined.

#![allow(clippy::float_cmp, reason = "what a file says is read to the bit")]
#![allow(clippy::too_many_lines, reason = "a report is read in one piece")]

use super::{Face, Invalid, Mission, ProblemKind, Scenario};
use expect_test::{Expect, expect};
use miette::{GraphicalReportHandler, GraphicalTheme};
use nalgebra::Point2;

mod schedule;
mod social;

const TWO_ROOMS: &str = r#"
name = "two-rooms"
start = "2026-03-02T10:00:00"
duration = 60.0

[[room]]
name = "hall"
polygon = [[0, 0], [4, 0], [4, 3], [0, 3]]

[[room]]
name = "study"
polygon = [[4, 0], [8, 0], [8, 3], [4, 3]]

[[door]]
rooms = ["hall", "study"]
position = [4.0, 1.5]
width = 1.0

[[place]]
name = "desk"
pose = [7.0, 1.0, 0.5]

[[object]]
name = "screen"
class = "tv"
pose = [6.0, 2.8, -1.5708]
size = [0.1, 1.0]

[robot]
pose = [1.0, 1.0, 0.0]

[[person]]
name = "ana"
pose = [2.0, 2.0, 0.0]
schedule = [
    { at = "10:01", go = "desk" },
    { after = 5.0, go = [2.0, 2.0], face = "ben" },
]

[[person]]
name = "ben"
pose = [3.0, 2.0, 3.14]

[[activity]]
name = "news"
object = "screen"
start = "10:05"
end = "10:30"

[[mission]]
name = "visit"
goal = "missions/visit.aggt"
"#;

fn parse(text: &str) -> Result<Scenario, Box<Invalid>> {
    Scenario::parse("scenario.toml", text, &|name| match name {
        "rules.aggl" => Ok(b"the rules".to_vec()),
        "missions/visit.aggt" => Ok(b"the goal".to_vec()),
        _ => Err(std::io::Error::other("no such file")),
    })
}

/// The problems of `TWO_ROOMS` with `from` replaced by `to`.
fn problems(from: &str, to: &str) -> Vec<ProblemKind> {
    assert!(TWO_ROOMS.contains(from), "{from} is not in the text");
    match parse(&TWO_ROOMS.replacen(from, to, 1)) {
        Ok(_) => Vec::new(),
        Err(invalid) => invalid
            .problems
            .into_iter()
            .map(|problem| problem.kind)
            .collect(),
    }
}

fn rendered(text: &str) -> String {
    let Err(invalid) = parse(text) else {
        return "fine".to_owned();
    };
    let mut out = String::new();
    GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor())
        .with_width(90)
        .render_report(&mut out, invalid.as_ref())
        .expect("a report renders");
    out
}

fn check(text: &str, expected: &Expect) {
    expected.assert_eq(&rendered(text));
}

#[test]
fn a_good_file_is_read_whole() {
    let scenario = parse(TWO_ROOMS).expect("a good file");
    assert_eq!(
        scenario.start.seconds(),
        1_772_445_600.0,
        "10:00 counted as UTC"
    );
    assert_eq!(scenario.activities[0].start.since(scenario.start), 300.0);
    assert_eq!(scenario.bounds, [0.0, 0.0, 8.0, 3.0]);
    assert_eq!(
        scenario
            .find_room(Point2::new(7.0, 1.0))
            .map(|r| r.name.as_str()),
        Some("study")
    );
    assert_eq!(scenario.rooms[0].centroid(), Point2::new(2.0, 1.5));
    assert_eq!(scenario.rules, "the rules");
    assert_eq!(scenario.missions[0].goal, "the goal");
    let schedule = &scenario.people[0].schedule;
    assert_eq!(schedule[0].go, Some(Point2::new(7.0, 1.0)));
    assert_eq!(
        schedule[0].face,
        Some(Face::Heading(0.5)),
        "a place says where to look"
    );
    assert_eq!(schedule[1].face, Some(Face::Person(1)));
}

#[test]
fn missions_have_times_of_the_day_periods_and_an_order() {
    let more = "at = \"10:30\"\nevery = \"day\"\nwithin = 60\n\n[[mission]]\nname = \"look\"\n\
                goal = \"missions/visit.aggt\"\nat = \"09:00\"\nafter = \"visit\"\n\n[[mission]]\nname = \"turn\"\n\
                goal = \"missions/visit.aggt\"\nevery = 90\n";
    let scenario = parse(&format!("{TWO_ROOMS}{more}")).unwrap();
    let times = |mission: &Mission| {
        let begins = mission.begins.map(|begins| begins.since(scenario.start));
        (
            begins,
            mission.period,
            mission.within,
            mission.after.clone(),
        )
    };
    let times: Vec<_> = scenario.missions.iter().map(times).collect();
    let next_day = 23.0 * 3600.0;
    assert_eq!(
        times,
        [
            (Some(1800.0), Some(86_400.0), Some(60.0), None),
            (Some(next_day), None, None, Some("visit".to_owned())),
            (Some(0.0), Some(90.0), None, None),
        ]
    );
    let wrong = "at = \"25:00\"\nevery = \"moon\"\nwithin = 0\nafter = \"vist\"\n";
    let told = parse(&format!("{TWO_ROOMS}{wrong}")).unwrap_err();
    let told: Vec<String> = told.problems.iter().map(ToString::to_string).collect();
    assert_eq!(told.len(), 4, "{told:?}");
    assert!(
        told[1].contains("\"week\"") && told[3].contains("vist"),
        "{told:?}"
    );
}

#[test]
fn a_shared_wall_comes_out_once_and_leaves_the_door_open() {
    let scenario = parse(TWO_ROOMS).expect("a good file");
    let mut shared: Vec<_> = scenario
        .walls
        .iter()
        .filter(|wall| wall.iter().all(|end| end.x == 4.0))
        .map(|wall| (wall[0].y, wall[1].y))
        .collect();
    shared.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert_eq!(shared, [(0.0, 1.0), (2.0, 3.0)]);
    let length: f64 = scenario
        .walls
        .iter()
        .map(|wall| (wall[1] - wall[0]).norm())
        .sum();
    assert!(
        (length - (8.0 + 8.0 + 3.0 * 3.0 - 1.0)).abs() < 1e-9,
        "{length}"
    );
}

#[test]
fn every_problem_of_a_file_is_underlined_in_one_report() {
    let text = r#"
name = "broken"
start = "yesterday"
duration = nan
speed = 3

[[room]]
name = "hall"
polygon = [[0, 0], [4, 0]]

[[room]]
name = "study"
polygon = [[0, 0], [4, 0], [4, 3], [0, 3]]

[[door]]
rooms = ["study", "hal"]
position = [2.0, 1.0]
width = 1.0

[[object]]
name = "screen"
clas = "tv"
class = "tvv"
pose = [1, 1, 0]
size = [0.1, 1.0]

[robot]
pose = [9, 9, 0]

[[activity]]
name = "news"
object = "screem"
start = "10:05"
end = "10:00"
"#;
    check(
        text,
        &expect![[r#"
              × scenario.toml has 10 problems

            Error: 
              × `yesterday` is not a date and time, as "2026-03-02T10:25:00"
               ╭─[scenario.toml:3:9]
             2 │ name = "broken"
             3 │ start = "yesterday"
               ·         ───────────
             4 │ duration = nan
               ╰────

            Error: 
              × `duration` must be a finite number
               ╭─[scenario.toml:4:12]
             3 │ start = "yesterday"
             4 │ duration = nan
               ·            ───
             5 │ speed = 3
               ╰────

            Error: 
              × unknown key `speed` in the scenario
               ╭─[scenario.toml:5:1]
             4 │ duration = nan
             5 │ speed = 3
               · ─────
             6 │ 
               ╰────
              help: known are: start, name, duration, room, door, wall, map_unknown, map, bounds,
                    place, object, camera, robot, person, stream, activity, mission, rules, tracks,
                    social, human_observer

            Error: 
              × room `hall` has 2 corners, a polygon needs at least 3
                ╭─[scenario.toml:9:11]
              8 │ name = "hall"
              9 │ polygon = [[0, 0], [4, 0]]
                ·           ────────────────
             10 │ 
                ╰────

            Error: 
              × there is no room called `hal`
                ╭─[scenario.toml:16:19]
             15 │ [[door]]
             16 │ rooms = ["study", "hal"]
                ·                   ─────
             17 │ position = [2.0, 1.0]
                ╰────
              help: did you mean `hall`?

            Error: 
              × this door is not on a wall of room `study`: the nearest is 1.00 m away
                ╭─[scenario.toml:17:12]
             16 │ rooms = ["study", "hal"]
             17 │ position = [2.0, 1.0]
                ·            ──────────
             18 │ width = 1.0
                ╰────

            Error: 
              × unknown key `clas` in [[object]]
                ╭─[scenario.toml:22:1]
             21 │ name = "screen"
             22 │ clas = "tv"
                · ────
             23 │ class = "tvv"
                ╰────
              help: did you mean `class`?

            Error: 
              × there is no class of object called `tvv`
                ╭─[scenario.toml:23:9]
             22 │ clas = "tv"
             23 │ class = "tvv"
                ·         ─────
             24 │ pose = [1, 1, 0]
                ╰────
              help: did you mean `tv`?

            Error: 
              × there is no object called `screem`
                ╭─[scenario.toml:32:10]
             31 │ name = "news"
             32 │ object = "screem"
                ·          ────────
             33 │ start = "10:05"
                ╰────
              help: did you mean `screen`?

            Error: 
              × this activity ends before it starts
                ╭─[scenario.toml:34:7]
             33 │ start = "10:05"
             34 │ end = "10:00"
                ·       ───────
                ╰────
        "#]],
    );
}

#[test]
fn broken_syntax_is_underlined() {
    check(
        "name = \"x\"\nstart = \nduration = 1.0\n[[room]\n",
        &expect![[r#"
              × scenario.toml has 2 problems

            Error: 
              × string values must be quoted, expected literal string
               ╭─[scenario.toml:2:9]
             1 │ name = "x"
             2 │ start = 
               ·         ▲
             3 │ duration = 1.0
               ╰────

            Error: 
              × unclosed array table, expected `]`
               ╭─[scenario.toml:4:8]
             3 │ duration = 1.0
             4 │ [[room]
               ·        ▲
               ╰────
        "#]],
    );
}

#[test]
fn line_and_column_count_from_one_in_characters() {
    let invalid = parse("# é\nname = \"a\"\n  spead = 3\n").expect_err("much is missing");
    let unknown = invalid
        .problems
        .iter()
        .find(|problem| matches!(problem.kind, ProblemKind::UnknownKey { .. }))
        .expect("spead is unknown");
    assert_eq!((unknown.line, unknown.column), (3, 3));
}

#[test]
fn each_kind_of_mistake_is_told_apart() {
    use ProblemKind as P;
    type Hit = (&'static str, &'static str, fn(&P) -> bool);
    let hits: &[Hit] = &[
        ("name = \"hall\"", "name = \"the hall\"", |p| {
            matches!(p, P::BadName { .. })
        }),
        ("name = \"ben\"", "name = \"ana\"", |p| {
            matches!(p, P::DuplicateName { line: 33, .. })
        }),
        ("[4, 0], [4, 3], [0, 3]]", "[4, 3], [4, 0], [0, 3]]", |p| {
            matches!(p, P::CrossedOutline { .. })
        }),
        ("[4.0, 1.5]", "[4.0, 2.8]", |p| {
            matches!(p, P::DoorTooWide { .. })
        }),
        ("[4.0, 1.5]", "[3.0, 1.5]", |p| {
            matches!(p, P::DoorOffWall { .. })
        }),
        ("[\"hall\", \"study\"]", "[\"hall\", \"hall\"]", |p| {
            matches!(p, P::DoorToItself { .. })
        }),
        ("[7.0, 1.0, 0.5]", "[70.0, 1.0, 0.5]", |p| {
            matches!(p, P::OutsideRooms { .. })
        }),
        ("[7.0, 1.0, 0.5]", "[7.0, inf, 0.5]", |p| {
            matches!(p, P::NotFinite { .. })
        }),
        ("[7.0, 1.0, 0.5]", "[7.0, 1.0]", |p| {
            matches!(p, P::WrongType { .. })
        }),
        ("[2.0, 2.0], face", "[0.1, 2.0], face", |p| {
            matches!(p, P::NoSpace { .. })
        }),
        ("go = \"desk\"", "go = \"dusk\"", |p| {
            matches!(p, P::UnknownName { .. })
        }),
        ("go = \"desk\"", "go = \"screen\"", |p| {
            matches!(p, P::BadEntry { .. })
        }),
        ("face = \"ben\"", "face = \"bea\"", |p| {
            matches!(p, P::UnknownName { .. })
        }),
        ("face = \"ben\"", "at = \"10:00\"", |p| {
            matches!(p, P::BadEntry { .. })
        }),
        ("end = \"10:30\"", "end = \"10:04\"", |p| {
            matches!(p, P::EndsBeforeStart)
        }),
        ("end = \"10:30\"", "", |p| matches!(p, P::MissingKey { .. })),
        ("end = \"10:30\"", "end = \"25:30\"", |p| {
            matches!(p, P::NotATime { .. })
        }),
        (
            "visit.aggt\"",
            "visit.aggt\"\npreemption = \"maybe\"",
            |p| matches!(p, P::WrongType { .. }),
        ),
        ("visit.aggt", "call.aggt", |p| {
            matches!(p, P::UnreadableFile { .. })
        }),
        ("[1.0, 1.0, 0.0]", "[0.1, 1.0, 0.0]", |p| {
            matches!(p, P::NoSpace { .. })
        }),
        ("duration = 60.0", "duration = 0", |p| {
            matches!(p, P::OutOfRange { .. })
        }),
        (
            "[robot]",
            "[[camera]]\nname = \"eye\"\npose = [1, 1, 0]\nfield_of_view = 1\nrange = 5\ndelay = -0.1\n[robot]",
            |p| matches!(p, P::OutOfRange { .. }),
        ),
        (
            "[robot]",
            "[[camera]]\nname = \"eye\"\npose = [1, 1, 0]\nfield_of_view = 1\nrange = 5\ndelay_jitter = -1\n[robot]",
            |p| matches!(p, P::OutOfRange { .. }),
        ),
    ];
    for (from, to, is_expected) in hits {
        let found = problems(from, to);
        assert!(
            found.iter().any(is_expected),
            "{from} -> {to} gave {found:?}"
        );
        assert!(found.len() <= 4, "{from} -> {to} gave a heap: {found:?}");
    }
}

proptest::proptest! {
    #[test]
    fn no_text_makes_the_loader_panic(cut in 0..TWO_ROOMS.len(), junk in ".{0,12}") {
        let text = format!("{}{junk}{}", &TWO_ROOMS[..cut], &TWO_ROOMS[cut..]);
        if let Err(invalid) = parse(&text) {
            proptest::prop_assert!(!invalid.problems.is_empty());
            proptest::prop_assert!(!rendered(&text).is_empty());
        }
    }
}

#[test]
fn a_base_goes_by_its_name_and_is_differential_where_none_is_given() {
    let read = |line: &str| {
        let text = format!(
            "name = \"hall\"\nstart = \"2026-03-02T10:00:00\"\nduration = 9.0\n[[room]]\nname = \"hall\"\n\
             polygon = [[0, 0], [4, 0], [4, 4], [0, 4]]\n[robot]\npose = [2, 2, 0]\n{line}\n"
        );
        Scenario::parse("scenario.toml", &text, &|_| Ok(Vec::new()))
    };
    assert_eq!(
        read("").unwrap().robot.base,
        crate::scenario::Base::Differential
    );
    let omni = read("base = \"omnidirectional\"").unwrap();
    assert_eq!(omni.robot.base, crate::scenario::Base::Omnidirectional);
    let invalid = read("base = \"omnidirectionel\"").unwrap_err();
    let told = format!("{:?}", miette::Report::new(*invalid));
    assert!(told.contains("did you mean `omnidirectional`"), "{told}");
}
