//! `cortex social` and `cortex experiment` as their users meet them: groups and their scores,
//! comfort, pictures, tables, and what is wrong with what they are given.

use crate::support::{Program, Run, root, within};
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::fs;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

/// Exit code, standard output and standard error.
pub(crate) fn cortex(arguments: &[&str]) -> (i32, String, String) {
    let output = Program::run(arguments);
    let words = |bytes| String::from_utf8(bytes).unwrap();
    (
        output.status.code().unwrap(),
        words(output.stdout),
        words(output.stderr),
    )
}

pub(crate) fn lines(text: &str) -> Vec<Value> {
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

pub(crate) fn person(id: u32, x: f64, y: f64, heading: f64) -> Value {
    json!({"id": id, "x_m": x, "y_m": y, "theta_rad": heading})
}

/// Two who talk and one who passes; then one alone, who was said to be in a group.
pub(crate) fn recording(folder: &TempDir, truth: bool) -> String {
    let talk = [
        person(4, 0.0, 0.0, 0.0),
        person(2, 1.0, 0.0, PI),
        person(7, 4.0, 3.0, 1.0),
    ];
    let mut frames = vec![
        json!({"t": 1, "people": talk, "groups": [[2, 4]]}),
        json!({"t": 2.5, "people": [person(4, 0.0, 0.0, 0.0)], "groups": [[2, 4]]}),
    ];
    if !truth {
        for frame in &mut frames {
            frame.as_object_mut().unwrap().remove("groups");
        }
    }
    save(
        folder,
        "people.json",
        &json!({"frames": frames}).to_string(),
    )
}

pub(crate) fn save(folder: &TempDir, name: &str, text: &str) -> String {
    let path = folder.path().join(name);
    fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn groups_are_found_frame_by_frame_and_scored_where_the_truth_is_known() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(&folder, true);
    let (code, out, _) = cortex(&["social", "groups", &file, "--json"]);
    let found = lines(&out);
    assert_eq!(code, 0);
    assert_eq!(found.len(), 3);
    assert_eq!(found[0], json!({"t": 1.0, "groups": [[2, 4]]}));
    assert_eq!(found[1], json!({"t": 2.5, "groups": []}));
    let scores = &found[2];
    assert_eq!(scores["precision"], 1.0);
    assert_eq!(scores["recall"], 0.5);
    assert!((scores["f1_t2_3"].as_f64().unwrap() - 2.0 / 3.0).abs() < 1e-12);
    assert_eq!(scores["f1_t2_3"], scores["f1_t1"]);

    let strict = [
        "social",
        "groups",
        &file,
        "--method",
        "triangulation_strict",
    ];
    let (code, out, _) = cortex(&strict);
    assert_eq!(code, 0);
    assert!(
        out.contains("method triangulation_strict") && out.contains("recall 0.000"),
        "{out}"
    );

    let (_, out, _) = cortex(&["social", "groups", &recording(&folder, false), "--json"]);
    assert_eq!(lines(&out).len(), 2);
}

#[test]
fn the_closer_the_people_the_dearer_the_place() {
    let folder = tempfile::tempdir().unwrap();
    let scene = |name: &str, x: f64| {
        json!({
            "identifier": name, "robot": {"id": 0}, "objects": [], "links": [],
            "humans": [{"id": 1, "xPos": x, "yPos": 0, "orientation": -90}],
            "room": [[-500, -500], [500, -500], [500, 500], [-500, 500]],
        })
        .to_string()
    };
    let text = [scene("near", 40.0), scene("far", 300.0), scene("on", 0.0)].join("\n");
    let file = save(&folder, "scenes.json", &text);
    let (code, out, _) = cortex(&["social", "comfort", &file, "--json"]);
    assert_eq!(code, 0);
    let costs: Vec<f64> = lines(&out)
        .iter()
        .map(|line| line["cost"].as_f64().unwrap())
        .collect();
    assert!(
        costs[1] < 0.05 && costs[0] > 0.8 && costs[0] < 1.0,
        "{costs:?}"
    );
    assert!((costs[2] - 1.0).abs() < 1e-9);
    assert_eq!(lines(&out)[0]["identifier"], "near");

    let flat = text.replacen("[500,500],[-500,500]", "[0,-500],[100,-500]", 1);
    assert_ne!(flat, text);
    let (code, _, err) = cortex(&["social", "comfort", &save(&folder, "flat.json", &flat)]);
    assert_eq!(code, 2);
    assert!(
        err.contains("scene near: the room of 4 corners encloses nothing"),
        "{err}"
    );
}

#[test]
fn a_situation_is_drawn_and_written_as_a_map() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(&folder, false);
    let out = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for (verb, name, magic) in [
        ("density", "density.svg", &b"<svg"[..]),
        ("map", "costs.png", b"\x89PNG"),
        ("map", "costs.yaml", b"image: costs.pgm"),
    ] {
        let (code, text, err) = cortex(&["social", verb, &file, "--at", "2", "--out", &out(name)]);
        assert_eq!(code, 0, "{err}");
        assert!(text.contains("t = 1: people 3, groups 1"), "{text}");
        assert!(fs::read(out(name)).unwrap().starts_with(magic), "{name}");
    }
    let (_, text, _) = cortex(&[
        "social",
        "map",
        &file,
        "--at=-1",
        "--out",
        &out("first.svg"),
    ]);
    assert!(
        text.contains("the recording starts at ") && text.contains(": this is its first frame"),
        "{text}"
    );
    let (_, text, _) = cortex(&["social", "map", &file, "--out", &out("first.svg")]);
    assert!(!text.contains("the recording starts"), "{text}");
    let svg = fs::read_to_string(out("density.svg")).unwrap();
    for words in [
        "group 1",
        "intimate, density 0.9",
        "person, facing",
        " m</text>",
    ] {
        assert!(
            svg.contains(words) || svg.contains(&words.replace("</text>", "\n</text>")),
            "{words}"
        );
    }
    assert!(fs::read(out("costs.pgm")).unwrap().starts_with(b"P5\n"));

    let scenario = [
        "social",
        "density",
        "scenarios/care-centre",
        "--at",
        "10:45",
    ];
    let picture = out("centre.svg");
    let (code, text, err) = cortex(&[&scenario[..], &["--out", &picture]].concat());
    assert_eq!(code, 0, "{err}");
    assert!(text.contains("people 10"), "{text}");
    assert!(
        fs::read_to_string(Path::new(&picture))
            .unwrap()
            .contains("day_tv R = 3.50")
    );
}

#[test]
fn figures_and_what_is_known_of_people_show_in_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let mut escorted = person(1, 0.0, 0.0, 0.0);
    escorted["task"] = "guide".into();
    escorted["activity"] = "gardening".into();
    let mut other = person(2, 6.0, 0.0, PI);
    other["features"] = "role=staff".into();
    let frames = json!({"frames": [{"t": 0, "people": [escorted, other]}]});
    let file = save(&folder, "people.json", &frames.to_string());
    let picture = folder.path().join("density.svg");
    let draw = |rest: &[&str]| {
        let to = [
            "social",
            "density",
            &file,
            "--out",
            picture.to_str().unwrap(),
        ];
        let (code, out, err) = cortex(&[&to[..], rest].concat());
        assert_eq!(code, 0, "{err}");
        (out, fs::read_to_string(&picture).unwrap())
    };
    let (told, plain) = draw(&[]);
    assert!(
        told.contains("person 1: there is no activity called `gardening`; known are: cooking"),
        "{told}"
    );
    assert!(
        told.contains("person 1: there is no task called `guide`; known are: approach"),
        "{told}"
    );
    assert!(!plain.contains("cooperation zone"));
    let settings = "[social]\n\
        activities.gardening = { front = 1.5, left = 1.0, rear = 0.8, right = 1.0 }\n\
        cooperation.guide = [{ direction = 1.57, opening = 1.0 }]\n";
    let settings = save(&folder, "social.toml", settings);
    let (told, drawn) = draw(&["--settings", &settings]);
    assert_eq!(told.lines().count(), 1, "{told}");
    assert!(drawn.contains("cooperation zone"));
    let wrong = save(&folder, "wrong.toml", "[social]\nresolutoin = 1\n");
    let (code, _, err) = cortex(&[
        "social",
        "map",
        &file,
        "--out",
        "map.png",
        "--settings",
        &wrong,
    ]);
    assert_eq!(code, 2);
    assert!(
        err.contains("wrong.toml:2") && err.contains("resolutoin"),
        "{err}"
    );
}

#[test]
fn a_map_goes_as_far_as_the_figures_of_the_flags() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let alone = json!({"frames": [{"t": 0, "people": [person(1, 0.0, 0.0, 0.0)]}]});
    fs::write(path("alone.json"), alone.to_string()).unwrap();
    fs::write(path("printed.toml"), "[social]\nproxemics = \"printed\"\n").unwrap();
    let settings = path("printed.toml");
    let maps = [["--proxemics", "printed"], ["--settings", &settings]].map(|flags| {
        let (file, out) = (path("alone.json"), path("map.yaml"));
        let map = ["social", "map", &file, "--ros-mode", "raw", "--out", &out];
        let (code, _, error) = cortex(&[&map[..], &flags].concat());
        assert_eq!(code, 0, "{error}");
        fs::read(path("map.pgm")).unwrap()
    });
    assert_eq!(maps[0], maps[1]);
}

#[test]
fn layers_of_the_map_are_drawn_one_by_one() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(&folder, false);
    let blocked = |layer: &str| {
        let out = folder.path().join("layer.yaml");
        let (code, _, err) = cortex(&[
            "social",
            "map",
            &file,
            "--layer",
            layer,
            "--out",
            out.to_str().unwrap(),
        ]);
        assert_eq!(code, 0, "{err}");
        let image = fs::read(out.with_extension("pgm")).unwrap();
        let cells = image.splitn(4, |byte| *byte == b'\n').nth(3).unwrap();
        cells.split(|grey| *grey == 0).count() - 1
    };
    // Three bodies of 0.25 m, which the filter takes out; with a robot as large; with intimate space.
    let [bodies, filtered, inflated, master] =
        ["obstacles", "people_filter", "inflation", "master"].map(blocked);
    assert!((50..100).contains(&bodies), "{bodies}");
    assert_eq!((filtered, inflated), (0, 0));
    assert!(master > 2 * bodies, "{master}");
    assert_eq!(master, blocked("social"));
}

#[test]
fn a_schedule_is_put_into_effect_while_the_system_runs_and_groups_are_in_its_graph() {
    const PATIENCE: Duration = Duration::from_mins(1);
    let mut run = Run::new("schedule", &["scenarios/care-centre", "--no-baseline"]).start();
    run.until("mission invite is running");
    let name = run.instance_name().to_owned();
    let get = |path: &str| {
        let (_, out, _) = cortex(&["graph", "get", path, "--instance", &name]);
        out.trim().to_owned()
    };
    let becomes = |path: &str, value: &str| {
        let reached = within(PATIENCE, || (get(path) == value).then_some(()));
        assert!(reached.is_some(), "{path} is {}, not {value}", get(path));
    };
    becomes("day_tv.usage", "3.5");
    let folder = tempfile::tempdir().unwrap();
    let today = fs::read_to_string(root().join("scenarios/care-centre/schedule.toml")).unwrap();
    let cancelled = today.replace("end = \"11:00\"", "end = \"11:00\"\ncancelled = true");
    assert_ne!(cancelled, today);
    let put = |text: &str| {
        let file = save(&folder, "today.toml", text);
        cortex(&["social", "schedule", &file, "--instance", &name])
    };
    let (code, out, err) = put(&cancelled);
    assert_eq!(code, 0, "{err}");
    assert!(
        out.contains("at day_tv, cancelled (changed)") && out.contains("(as before)"),
        "{out}"
    );
    becomes("day_tv.usage", "1.5");
    let (code, _, err) = put(&today.replace("11:00", "09:00"));
    assert_eq!(code, 2);
    assert!(
        err.contains("today.toml:") && err.contains("ends before it starts"),
        "{err}"
    );
    let set = |path: &str, value: &str| {
        let (code, _, err) = cortex(&["graph", "set", path, value, "--instance", &name]);
        assert_eq!(code, 0, "{err}");
    };
    set("news.cancelled", "false");
    becomes("day_tv.usage", "3.5");
    set("news.object", "day_tx");
    let waits =
        "activity news waits: nothing called `day_tx` has been seen so far; did you mean `day_tv`?";
    becomes("news.problems", &format!("\"{waits}\""));
    set("news.object", "day_tv");
    becomes("day_tv.usage", "3.5");
    assert_eq!(get("news.problems"), "");
    let group = within(PATIENCE, || {
        let (code, out, _) = cortex(&["graph", "show", "group_1", "--instance", &name]);
        (code == 0).then_some(out)
    });
    let group = group.expect("a group");
    assert!(group.contains("personal_zone"), "{group}");
    let joined = within(PATIENCE, || {
        let (_, out, _) = cortex(&["graph", "show", "person", "--instance", &name]);
        out.contains("-member_of-> group_").then_some(())
    });
    assert!(joined.is_some(), "nobody is a member of a group");
    run.interrupt();
    assert_eq!(run.exit_code(), 1);
}

#[test]
fn every_experiment_listed_runs() {
    let (code, out, _) = cortex(&["experiment", "list", "--json"]);
    assert_eq!(code, 0);
    let list: Vec<Value> = serde_json::from_str(&out).unwrap();
    let names: Vec<&str> = list
        .iter()
        .map(|one| one["name"].as_str().unwrap())
        .collect();
    for name in [
        "td-table1",
        "td-table2",
        "td-table4",
        "td-gains",
        "ap-table1",
        "ap-escort",
        "compare",
        "fd-table1",
        "fd-table5",
        "tg-shapes",
        "tg-groups",
    ] {
        assert!(names.contains(&name), "{name}");
    }
    let (code, out, _) = cortex(&["experiment", "fd-table1", "--json"]);
    assert_eq!(code, 0);
    let table: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(table["rows"].as_array().unwrap().len(), 9);
    let (code, out, _) = cortex(&["experiment", "fd-table1"]);
    assert_eq!(code, 0);
    assert!(out.contains("READING.md 3"), "{out}");
}

/// Two people who pass each other, 3 m apart, in 20 s.
fn two_who_pass() -> String {
    let line = |frame: u32| {
        let x = f64::from(frame) * 0.04;
        let back = 20.0 - x;
        format!("{frame} 1 {x:.3} 0.0\n{frame} 2 {back:.3} 3.0\n")
    };
    (0..=500).step_by(10).map(line).collect()
}

#[test]
fn ways_of_driving_are_held_against_each_other_also_among_recorded_people() {
    let folder = tempfile::tempdir().unwrap();
    let tracks = save(&folder, "tracks.txt", &two_who_pass());
    let arguments = ["experiment", "compare", "--seeds", "1", "--json"];
    let (code, out, err) = cortex(&[&arguments[..], &["--tracks", &tracks]].concat());
    assert_eq!(code, 0, "{err}");
    assert!(err.contains("of 35"), "no progress: {err}");
    let comparison: Value = serde_json::from_str(&out).unwrap();
    let worlds = comparison["worlds"].as_array().unwrap();
    assert_eq!(worlds.last().unwrap()["world"], "recorded");
    let mean = |world: &Value, method: &str, figure: &str| {
        let mean = &world["methods"][method][figure]["mean"];
        mean.as_f64().unwrap()
    };
    let mut kept_out = 0;
    for world in worlds {
        for method in comparison["methods"].as_array().unwrap() {
            let method = method.as_str().unwrap();
            assert!(mean(world, method, "duration") > 1.0, "{world}");
        }
        assert!(mean(world, "cortex", "success") > 99.0, "{world}");
        let personal = |method| mean(world, method, "psi_personal");
        assert!(personal("cortex") <= personal("a_star"), "{world}");
        kept_out += i32::from(personal("cortex") < personal("a_star"));
    }
    assert!(
        kept_out >= 3,
        "A* is in nobody's space either: {comparison}"
    );
}

#[test]
fn perception_is_held_against_recorded_and_simulated_people() {
    let folder = tempfile::tempdir().unwrap();
    let tracks = save(&folder, "tracks.txt", &two_who_pass());
    for more in [&["--tracks", tracks.as_str()][..], &[]] {
        let arguments = ["experiment", "perception", "--seeds", "1", "--json"];
        let (code, out, err) = cortex(&[&arguments, more].concat());
        assert_eq!(code, 0, "{err}");
        let table: Value = serde_json::from_str(&out).unwrap();
        let figure = |name: &str| table[name].as_f64().unwrap();
        assert!(figure("mota") > 0.9 && figure("idf1") > 0.85, "{table}");
        assert!(figure("position_rmse") < 0.1, "{table}");
        assert!(figure("heading_error") < 0.1, "{table}");
        assert!(figure("latency_p99") > 0.0, "{table}");
        assert!(figure("right_place") > 40.0, "{table}");
        let sort = table["rows"][1]["values"]["mota"].as_f64().unwrap();
        assert!(figure("mota") >= sort, "{table}");
        assert_eq!(
            table["rows"][0]["values"]["id_switches"],
            table["id_switches"]
        );
    }
}
