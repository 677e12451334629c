//! What somebody entered wrongly while the system runs: where it is told, and what stays in force meanwhile.

use super::*;

/// What stands at a node; empty where nothing does.
fn problems(centre: &Centre, node: &str) -> String {
    let value = centre.value(node, PROBLEMS);
    value.map_or_else(String::new, |value| value.as_str().unwrap().to_owned())
}

#[test]
fn an_agenda_that_cannot_be_stands_at_the_activity_and_the_world_until_it_is_mended() {
    let (mut centre, mut agent) = (Centre::new(), agent());
    let mut now = noon();
    let mut turn = |centre: &mut Centre| {
        now = now + 1.0;
        centre.turn(&mut agent, now).1
    };
    let times = [("start", (NOON + 9.0).into()), ("end", NOON.into())];
    centre.add("activity", "news", None, &times);
    centre.set("news", "object", "tabel");
    turn(&mut centre);
    let backward = "activity news is ignored: it ends at 1800000000.000 s, before it starts at 1800000009.000 s";
    assert_eq!(problems(&centre, "news"), backward);
    assert_eq!(problems(&centre, "world"), backward);
    centre.set("news", "end", NOON + 60.0);
    turn(&mut centre);
    let waits =
        "activity news waits: nothing called `tabel` has been seen so far; did you mean `table`?";
    assert_eq!(problems(&centre, "news"), waits);
    // Nothing is written again while nothing changes.
    assert_eq!(turn(&mut centre), [""; 0]);
    centre.set("ana", "activity", "coking");
    turn(&mut centre);
    let activity = "person ana: there is no activity called `coking`; did you mean `cooking`?";
    assert_eq!(problems(&centre, "ana"), activity);
    assert_eq!(problems(&centre, "world"), format!("{waits}\n{activity}"));
    centre.set("ana", "activity", "cooking");
    centre.set("news", "object", "table");
    turn(&mut centre);
    for node in ["news", "ana", "world"] {
        assert_eq!(problems(&centre, node), "");
    }
}

#[test]
fn settings_that_cannot_be_used_leave_those_before_in_force_and_are_told_at_the_world() {
    let (mut centre, mut agent) = (Centre::new(), agent());
    let mut now = noon();
    let mut turn = |centre: &mut Centre| {
        now = now + 1.0;
        centre.turn(&mut agent, now);
        problems(centre, "world")
    };
    centre.add("room", "kitchen", None, &[]);
    let settings = |more: &str| format!("{{\"usage\": {{\"least\": 2.0}}{more}}}");
    centre.set("world", SETTINGS, settings(""));
    assert_eq!(turn(&mut centre), "");
    assert_eq!(centre.value("table", "usage"), Some(2.0.into()));
    for (wrong, says) in [
        (
            r#"{"activity_in": {"kichen": "cooking"}}"#,
            "activity_in needs names of rooms, and `kichen` is none; did you mean `kitchen`?",
        ),
        (
            r#"{"activity_in": {"kitchen": "coking"}}"#,
            "activity_in.kitchen needs the name of an activity, and `coking` is none; did you mean `cooking`?",
        ),
        (
            r#"{"spaces": {"tabel": {"margin": 0.5}}}"#,
            "spaces needs classes of objects, and `tabel` is none; did you mean `table`?",
        ),
        (
            r#"{"features": {"known": {"role": {"levels": {"guest": 2.0}}}}}"#,
            "features.known.role.levels.guest must be above 0 and at most 1",
        ),
    ] {
        centre.set("world", SETTINGS, wrong);
        let told = turn(&mut centre);
        assert_eq!(
            told,
            format!("the social settings of the world are not used: {says}")
        );
        assert_eq!(centre.value("table", "usage"), Some(2.0.into()), "{wrong}");
    }
    // A room that comes later makes them right.
    centre.set("world", SETTINGS, r#"{"activity_in": {"hall": "running"}}"#);
    assert!(turn(&mut centre).contains("`hall` is none"));
    centre.add("room", "hall", None, &[]);
    assert_eq!(turn(&mut centre), "");
    assert_eq!(centre.value("table", "usage"), Some(1.5.into()));
    // An object may not have been seen yet: the rest counts.
    let waiting = settings(r#", "usage_of": {"tabel": {"ramp": 60.0}}"#);
    centre.set("world", SETTINGS, waiting);
    assert_eq!(
        turn(&mut centre),
        "`usage_of` waits: nothing called `tabel` has been seen so far; did you mean `table`?"
    );
    assert_eq!(centre.value("table", "usage"), Some(2.0.into()));
}

#[test]
fn why_there_is_no_map_stands_at_the_world() {
    let (mut centre, mut agent) = (Centre::new(), agent());
    centre.set("robot", "radius", f64::NAN);
    let (turn, written) = centre.turn(&mut agent, noon());
    assert!(turn.stopped.is_some() && turn.grid.is_none());
    assert_eq!(written, ["world.problems"]);
    assert_eq!(
        problems(&centre, "world"),
        "there is no new map: the robot's radius is NaN m, where it may be from 0 m to 10 m"
    );
    // All else that is wrong stays told, and what is mended meanwhile goes.
    let activity = "person ana: there is no activity called `coking`; did you mean `cooking`?";
    centre.set("ana", "activity", "coking");
    for (bounds, why) in [
        (
            Value::from([0.0; 4]),
            "the map's bounds [0.0, 0.0, 0.0, 0.0] enclose nothing; need xmin < xmax and ymin < ymax within 1e8 m",
        ),
        (
            Value::from([0.0; 3]),
            "the attribute bounds of world must be four numbers: xmin, ymin, xmax, ymax",
        ),
    ] {
        centre.set("world", "bounds", bounds);
        centre.turn(&mut agent, noon());
        let told = problems(&centre, "world");
        assert_eq!(told, format!("there is no new map: {why}\n{activity}"));
        assert_eq!(problems(&centre, "ana"), activity);
    }
    centre.set("ana", "activity", "cooking");
    centre.turn(&mut agent, noon());
    assert_eq!(problems(&centre, "ana"), "");
    centre.set("world", "bounds", [0.0, 0.0, 12.0, 10.0]);
    centre.set("robot", "radius", 0.25);
    assert!(centre.turn(&mut agent, noon()).0.grid.is_some());
    assert_eq!(problems(&centre, "world"), "");
}

#[test]
fn a_grid_that_is_too_large_is_told_and_the_map_before_goes_on() {
    let (mut centre, mut agent) = (Centre::new(), agent());
    let mut now = noon();
    let mut turn = |centre: &mut Centre| {
        now = now + 1.0;
        centre.turn(&mut agent, now).0
    };
    assert!(turn(&mut centre).grid.is_some());
    centre.set("world", SETTINGS, r#"{"resolution": 0.005}"#);
    let after = turn(&mut centre);
    assert!(after.stopped.is_none() && after.grid.is_none());
    assert_eq!(
        problems(&centre, "world"),
        "the social settings of the world are not used: the map's bounds [0.0, 0.0, 12.0, 10.0] at 0.005 m a cell need \
         4800000 cells; a grid has at most 4194304"
    );
    centre.place("ana", pose(6.0, 6.0, 0.0));
    let moved = turn(&mut centre).grid.unwrap();
    assert!((moved.grid.resolution - 0.1).abs() < 1e-12);
    // In a smaller world they can be used.
    centre.set("world", "bounds", [0.0, 0.0, 10.0, 10.0]);
    let fine = turn(&mut centre).grid.unwrap();
    assert!((fine.grid.resolution - 0.005).abs() < 1e-12);
    assert_eq!(problems(&centre, "world"), "");
    centre.set("world", "bounds", [0.0, 0.0, 250.0, 250.0]);
    let after = turn(&mut centre);
    assert!(matches!(
        after.stopped,
        Some(StepError::Scene(SceneError::TooLarge { .. }))
    ));
    assert!(problems(&centre, "world").contains("need 2500000000 cells"));
}

#[test]
fn a_grid_that_there_is_no_room_for_is_told_until_there_is() {
    let (mut centre, mut agent) = (Centre::new(), agent());
    centre.turn(&mut agent, noon());
    agent.given_out(Some(&LargeError::OutOfMemory { bytes: 48000 }));
    centre.turn(&mut agent, noon() + 1.0);
    assert_eq!(
        problems(&centre, "world"),
        "the new social grid is not given out: no room in /dev/shm for a value of 48000 bytes"
    );
    agent.given_out(None);
    centre.turn(&mut agent, noon() + 2.0);
    assert_eq!(problems(&centre, "world"), "");
}

#[test]
fn a_room_whose_outline_is_none_is_told_at_the_world() {
    let (mut centre, mut agent) = (Centre::new(), agent());
    centre.add("room", "kitchen", None, &[]);
    let mut now = noon();
    let mut told = |centre: &mut Centre, polygon: &[f64]| {
        now = now + 1.0;
        centre.set("kitchen", "polygon", Value::F64List(polygon.to_vec()));
        centre.turn(&mut agent, now);
        problems(centre, "world")
    };
    let none = |why: &str| format!("the polygon of kitchen is no room's: {why}");
    for (polygon, why) in [
        (&[][..], "the room of 0 corners encloses nothing"),
        (
            &[0.0, 0.0, 1.0, 1.0, 2.0, 2.0],
            "the room of 3 corners encloses nothing",
        ),
        (
            &[0.0, 0.0, 2.0, 2.0, 2.0, 0.0, 0.0, 1.0],
            "the outline of the room, of 4 corners, crosses itself",
        ),
        (
            &[0.0, 0.0, 1.0, 0.0, 1.0],
            "it needs two numbers, x and y, for each corner",
        ),
        (
            &[0.0, 0.0, 1.0, 0.0, f64::NAN, 1.0],
            "corner 2 of the room is no place within 1e8 m",
        ),
    ] {
        assert_eq!(told(&mut centre, polygon), none(why));
    }
    assert_eq!(told(&mut centre, &[0.0, 0.0, 1.0, 0.0, 1.0, 1.0]), "");
}

#[test]
fn settings_are_laid_over_those_of_the_scenario() {
    let (mut centre, mut agent) = (Centre::new(), agent());
    let mut now = noon();
    let mut turn = |centre: &mut Centre| {
        now = now + 1.0;
        centre.turn(&mut agent, now);
        assert_eq!(problems(centre, "world"), "");
        centre.value("ana", "personal_zone")
    };
    centre.add("room", "kitchen", None, &[]);
    let mut enter = Transaction::new();
    enter.create_edge("ana", "in", "kitchen");
    centre.commit(&enter);
    let plain = turn(&mut centre);
    let scenario = r#"{"activity_in": {"kitchen": "running"}, "resolution": 0.2}"#;
    centre.set("world", SCENARIO_SETTINGS, scenario);
    centre.set("world", SETTINGS, scenario);
    let running = turn(&mut centre);
    assert_ne!(running, plain);
    // What is not given stays as the scenario has it, and without any all is.
    centre.set("world", SETTINGS, r#"{"clearance_cost": 0.3}"#);
    assert_eq!(turn(&mut centre), running);
    centre.set("world", SETTINGS, r#"{"activity_in": {}}"#);
    assert_eq!(turn(&mut centre), plain);
    centre.set("world", SETTINGS, "{}");
    assert_eq!(turn(&mut centre), running);
}
