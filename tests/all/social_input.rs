//! What `cortex social` is given and cannot use: refused with its place and what could be used, or reported.

use crate::social::{cortex, person, recording, save};
use crate::support::root;
use serde_json::{Value, json};
use std::fs;

#[test]
fn an_agenda_that_ends_before_it_starts_is_refused_wherever_one_is_read() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("missions")).unwrap();
    for part in [
        "scenario.toml",
        "schedule.toml",
        "rules.aggl",
        "missions/invite.aggt",
    ] {
        let from = root().join("scenarios/care-centre").join(part);
        fs::copy(from, folder.path().join(part)).unwrap();
    }
    let scenario = folder.path().to_str().unwrap();
    let picture = folder.path().join("map.png");
    let picture = picture.to_str().unwrap();
    let today = fs::read_to_string(folder.path().join("schedule.toml")).unwrap();
    let whole = fs::read_to_string(folder.path().join("scenario.toml")).unwrap();
    let late =
        "\n[[activity]]\nname = \"late\"\nobject = \"desk\"\nstart = \"10:00\"\nend = \"09:59\"\n";
    for (schedule, main, at) in [
        (format!("{today}{late}"), whole.clone(), "schedule.toml:"),
        (today.clone(), format!("{whole}{late}"), "scenario.toml:"),
    ] {
        save(&folder, "schedule.toml", &schedule);
        save(&folder, "scenario.toml", &main);
        for arguments in [
            &["run", scenario][..],
            &["social", "map", scenario, "--out", picture],
            &["social", "density", scenario, "--out", picture],
            &["agent", "world", "--scenario", scenario],
            &["store", "--scenario", scenario],
        ] {
            let (code, _, err) = cortex(arguments);
            assert_eq!(code, 2, "{arguments:?}: {err}");
            assert!(
                err.contains("ends before it starts") && err.contains(at),
                "{arguments:?}: {err}"
            );
        }
    }
}

#[test]
fn what_cannot_be_used_is_refused_with_what_could() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(&folder, true);
    let broken = save(&folder, "broken.json", "{\"frames\": [\n{\"t\": 1,");
    let people: Vec<Value> = (0..20_001).map(|id| person(id, 0.0, 0.0, 0.0)).collect();
    let crowd = json!({"frames": [{"t": 0, "people": people}]}).to_string();
    let crowd = save(&folder, "crowd.json", &crowd);
    for (arguments, says) in [
        (&["social", "groups", &broken][..], "line 2, column 8"),
        (
            &["social", "groups", &crowd],
            "20001 people stand too close to look for groups among them",
        ),
        (&["social", "groups", &file, "--method", "facng"], "facing"),
        (
            &["social", "density", &file, "--out", "density.gif"],
            "its ending decides",
        ),
        (
            &["social", "map", &file, "--at", "noon", "--out", "map.svg"],
            "not a time",
        ),
        (
            &["social", "map", &file, "--at", "-x", "--out", "map.svg"],
            "`-x` is not a time of a recording",
        ),
        (
            &["social", "schedule", &broken, "--instance", "nobody-here"],
            "no instance `nobody-here` is running",
        ),
        (&["social", "comfort", &file, "--folds", "1"], "2.."),
        (&["experiment", "fd-tabel1"], "did you mean `fd-table1`?"),
        (
            &["experiment", "fd-table1", "--tracks", &file],
            "`--tracks` is for `perception`",
        ),
        (
            &["experiment", "perception", "--tracks", "nowhere.txt"],
            "cannot read nowhere.txt",
        ),
    ] {
        let (code, _, err) = cortex(arguments);
        assert_eq!(code, 2, "{arguments:?}: {err}");
        assert!(err.contains(says), "{arguments:?}: {err}");
    }
}

#[test]
fn names_in_settings_that_nothing_has_are_told_with_the_nearest() {
    let folder = tempfile::tempdir().unwrap();
    let care_centre = root().join("scenarios/care-centre");
    let care_centre = care_centre.to_str().unwrap();
    let people = recording(&folder, false);
    let settings = |text: &str| save(&folder, "settings.toml", &format!("[social]\n{text}\n"));
    let draw = |of: &str, settings: &str| {
        let out = folder.path().join("map.svg");
        let out = out.to_str().unwrap().to_owned();
        cortex(&["social", "map", of, "--settings", settings, "--out", &out])
    };
    for (text, says) in [
        ("usage_of.day_tw.ramp = 60.0", "no object called `day_tw`"),
        (
            "activity_in.kichen = \"cooking\"",
            "no room called `kichen`",
        ),
        (
            "spaces.tabel.margin = 0.5",
            "no class of object called `tabel`",
        ),
    ] {
        let (code, _, err) = draw(care_centre, &settings(text));
        assert_eq!(code, 2, "{text}: {err}");
        assert!(
            err.contains(says) && err.contains("did you mean") && err.contains("settings.toml:2"),
            "{err}"
        );
    }
    // A recording has neither rooms nor objects.
    let both = settings("usage_of.tv.ramp = 60.0\nactivity_in.attic = \"cooking\"");
    let (code, out, err) = draw(&people, &both);
    assert_eq!(code, 0, "{err}");
    assert!(
        out.contains("no room called `attic`") && out.contains("nothing called `tv`"),
        "{out}"
    );
    let (code, _, err) = draw(&people, &settings("activity_in.attic = \"coking\""));
    assert_eq!(code, 2);
    assert!(
        err.contains("`coking` is none; did you mean `cooking`?"),
        "{err}"
    );
}

#[test]
fn a_time_of_the_day_moves_people_and_a_negative_one_of_a_recording_is_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let map = |of: &str, at: &str| {
        let out = folder.path().join("map.svg");
        let out = out.to_str().unwrap().to_owned();
        let (code, told, err) = cortex(&["social", "density", of, "--at", at, "--out", &out]);
        assert_eq!(code, 0, "{err}");
        (told, fs::read_to_string(out).unwrap())
    };
    let people = recording(&folder, false);
    assert!(map(&people, "-5").0.contains("t = 1: people 3"));
    let care_centre = root().join("scenarios/care-centre");
    let care_centre = care_centre.to_str().unwrap();
    let drawn = |at: &str| {
        let text = map(care_centre, at).1;
        text.replace(&format!("{at}:00"), "")
    };
    // The television's space claims as much at both times.
    assert_ne!(drawn("10:45"), drawn("10:46"));
    let (told, _) = map(care_centre, "06:00");
    assert!(told.contains("people are where they are then"), "{told}");
}
