//! `cortex graph` and `cortex where` from outside: what each verb answers of a file and of a running graph,
//! and with which exit code.

use crate::support::{Process, Program, TestInstance};
use dsr::{EdgeRef, Operation, Pose, Session, Time, Transaction};
use serde_json::{Value as Json, json};
use std::fs;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

const PATIENCE: Duration = Duration::from_secs(20);

const ROBOCOMP: &str = r#"{"DSRModel":{"symbols":{
 "1":{"id":"1","type":"root","name":"root","attribute":{"level":{"type":1,"value":0,"timestamp":"17000000001","agent_id":12}},
  "links":[{"src":"1","dst":"2","label":"RT","linkAttribute":{
   "rt_translation":{"type":3,"value":[1500,-250.5,0]},"rt_rotation_euler_xyz":{"type":3,"value":[0,0,0]}}}]},
 "2":{"id":2,"type":"omnirobot","name":"robot","attribute":{"parent":{"type":7,"value":"1"}},"links":[]}}}}"#;

const WORLD: &str = r#"{"format":"dsr/1","nodes":[
 {"id":1,"type":"room","name":"kitchen","attributes":{"area":12.5}},
 {"id":2,"type":"robot","name":"shelly","attributes":{"going":"slow"}}],
 "edges":[{"from":2,"label":"in","to":1,"attributes":{}}]}"#;

/// What a verb of `graph` says, its complaints, and its exit code.
fn graph(arguments: &[&str]) -> (String, String, i32) {
    let all: Vec<&str> = ["graph"].iter().chain(arguments).copied().collect();
    let output = Program::run(&all);
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let code = output.status.code().unwrap();
    (text(output.stdout), text(output.stderr), code)
}

/// As [`graph`], for a verb that must succeed.
fn told(arguments: &[&str]) -> String {
    let (out, err, code) = graph(arguments);
    assert_eq!(code, 0, "{arguments:?}: {err}");
    out
}

fn told_json(arguments: &[&str]) -> Json {
    let mut all = arguments.to_vec();
    all.push("--json");
    serde_json::from_str(&told(&all)).unwrap()
}

/// A folder with a file of that text.
fn file(name: &str, text: &str) -> (TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, text).unwrap();
    let path = path.to_str().unwrap().to_owned();
    (folder, path)
}

/// A store in another process, whose graph is what a file says.
fn running(test: &str, text: &str) -> (TestInstance, Process, Session) {
    let instance = TestInstance::new(test);
    let store = Process::peer("store", &instance);
    let session = Session::attach(&instance.0, "setup", PATIENCE).unwrap();
    let (_folder, path) = file("world.json", text);
    told(&["import", &path, "--instance", instance.name()]);
    (instance, store, session)
}

#[test]
fn every_verb_of_graph_has_an_example() {
    for verb in [
        "show",
        "get",
        "set",
        "watch",
        "history",
        "export",
        "import",
        "diff",
        "check",
        "transform",
    ] {
        let help = told(&[verb, "--help"]);
        assert!(help.contains("Example:\n  cortex graph"), "{verb}");
        assert!(help.contains("--json"), "{verb}");
    }
}

#[test]
fn a_file_of_robocomp_goes_out_and_in_again_with_every_attribute() {
    let (folder, path) = file("robocomp.json", ROBOCOMP);
    let written = told(&["export", "robocomp", "--file", &path]);
    let again = folder.path().join("again.json");
    fs::write(&again, &written).unwrap();
    let again = again.to_str().unwrap();
    assert_eq!(told(&["export", "robocomp", "--file", again]), written);
    assert_eq!(told(&["diff", &path, again]), "");
    let written: Json = serde_json::from_str(&written).unwrap();
    let level = &written["DSRModel"]["symbols"]["1"]["attribute"]["level"];
    let expected = json!({"type": 1, "value": 0, "timestamp": "17000000001", "agent_id": 12});
    assert_eq!(*level, expected);
    let seen = told_json(&["transform", "root", "robot", "--file", &path]);
    assert_eq!(seen["translation"], json!([1.5, -0.2505, 0.0]));
    for (format, words) in [
        ("dot", "digraph"),
        ("graphml", "<graphml"),
        ("json", "dsr/1"),
    ] {
        assert!(told(&["export", format, "--file", &path]).contains(words));
    }
}

#[test]
fn a_graph_in_a_file_is_read_and_changed_like_one_that_runs() {
    let (folder, path) = file("world.json", WORLD);
    assert_eq!(told(&["get", "kitchen.area", "--file", &path]), "12.5\n");
    told(&["set", "kitchen.area", "14", "--file", &path]);
    let got = told_json(&["get", "kitchen.area", "--file", &path]);
    assert_eq!(
        got["value"],
        json!(14.0),
        "a whole number is of the kind that is there"
    );
    let node = told_json(&["get", "shelly", "--file", &path]);
    assert_eq!((&node["id"], &node["type"]), (&json!(2), &json!("robot")));
    let edge = told_json(&["get", "shelly-in->kitchen", "--file", &path]);
    assert_eq!(edge["label"], "in");
    let shown = told(&["show", "robot", "--file", &path]);
    assert!(
        shown.contains("shelly : robot") && shown.contains("-in-> kitchen"),
        "{shown}"
    );
    assert!(!shown.contains('\x1b'), "no colours but on a terminal");
    let history = told_json(&["history", "kitchen.area", "--file", &path]);
    assert_eq!(history["entries"].as_array().unwrap().len(), 1);
    let (_, said, code) = graph(&["watch", "--file", &path]);
    assert_eq!((code, said.contains("not a file")), (2, true), "{said}");
    let (_, said, code) = graph(&["get", "kitchen.going", "--file", &path]);
    assert_eq!(
        (code, said.as_str()),
        (1, "kitchen has no attribute `going`\n")
    );
    for (arguments, words) in [
        (["get", "kitchn.area"], "did you mean `kitchen`?"),
        (["get", "kitchen.aera"], "did you mean `area`?"),
        (["get", "shelly-inn->kitchen"], "unknown edge label `inn`"),
        (["show", "rom"], "did you mean `room`?"),
    ] {
        let (_, said, code) = graph(&[arguments[0], arguments[1], "--file", &path]);
        assert_eq!((code, said.contains(words)), (2, true), "{said}");
    }
    drop(folder);
}

#[test]
fn what_is_wrong_with_a_file_is_shown_in_its_lines() {
    let (_folder, path) = file(
        "broken.json",
        "{\"format\":\"dsr/1\",\n\"nodes\":[{\"id\":1,",
    );
    for verb in [&["show"][..], &["export", "json"], &["diff", &path]] {
        let arguments: Vec<&str> = verb.iter().copied().chain(["--file", &path]).collect();
        let (_, said, code) = graph(&arguments);
        assert_eq!(code, 2, "{said}");
        assert!(said.contains("broken.json:2:17"), "{said}");
    }
    let (out, _, code) = graph(&["check", "--json", "--file", &path]);
    let out: Json = serde_json::from_str(&out).unwrap();
    assert_eq!((code, &out["problems"][0]["line"]), (1, &json!(2)));
}

#[test]
fn check_tells_everything_that_is_wrong() {
    let schema = "[types]\nroom = []\nrobot = []\n[labels]\nin = {}\n[attributes]\narea = { kind = \"f64\" }\n";
    let (folder, path) = file("world.json", WORLD);
    let schema_path = folder.path().join("schema.toml");
    fs::write(&schema_path, schema).unwrap();
    let schema = schema_path.to_str().unwrap();
    let (out, _, code) = graph(&["check", "--file", &path, "--schema", schema, "--json"]);
    let out: Json = serde_json::from_str(&out).unwrap();
    assert_eq!((code, &out["errors"]), (1, &json!(1)));
    let problem = &out["problems"][0];
    assert_eq!(problem["message"], "unknown attribute `going`");
    assert_eq!(
        (&problem["line"], &problem["column"]),
        (&json!(3), &json!(56))
    );
    let (shown, _, code) = graph(&["check", "--file", &path, "--schema", schema]);
    assert_eq!(code, 1);
    assert!(
        shown.contains("world.json:3:56") && shown.contains("1 error"),
        "{shown}"
    );
    assert!(told(&["check", "--file", &path]).contains("nothing is wrong"));
    let dangling = ROBOCOMP.replace(r#""links":[]"#, r#""links":[{"dst":"9","label":"in"}]"#);
    let (_folder, path) = file("dangling.json", &dangling);
    let out = told_json(&["check", "--file", &path]);
    assert_eq!((&out["errors"], &out["warnings"]), (&json!(0), &json!(1)));
}

#[test]
fn diff_says_no_where_graphs_differ() {
    let (folder, path) = file("a.json", WORLD);
    let other = folder.path().join("b.json");
    fs::write(
        &other,
        WORLD.replace("12.5", "13.5").replace("shelly", "viriato"),
    )
    .unwrap();
    let other = other.to_str().unwrap();
    let (out, _, code) = graph(&["diff", &path, other]);
    assert_eq!(code, 1);
    for line in [
        "~ kitchen.area = 12.5 -> 13.5",
        "- shelly : robot",
        "+ viriato : robot  {going = \"slow\"}",
        "- shelly -in-> kitchen",
        "+ viriato -in-> kitchen",
    ] {
        assert!(out.lines().any(|found| found == line), "{line}\n{out}");
    }
    let (out, _, code) = graph(&["diff", &path, other, "--json"]);
    let out: Json = serde_json::from_str(&out).unwrap();
    assert_eq!((code, &out["equal"]), (1, &json!(false)));
    assert_eq!(out["differences"].as_array().unwrap().len(), 5);
    let same = told_json(&["diff", &path, "--file", &path]);
    assert_eq!(same, json!({"equal": true, "differences": []}));
}

#[test]
fn a_file_is_brought_into_a_running_graph_and_compared_with_it() {
    let (instance, store, mut session) = running("import", WORLD);
    let name = instance.name();
    let (folder, path) = file("world.json", WORLD);
    let running = format!("@{name}");
    assert_eq!(told(&["diff", &path, &running]), "");
    // A merge changes what differs and leaves the rest.
    let more = WORLD.replace("12.5", "15.0").replace("shelly", "viriato");
    let other = folder.path().join("more.json");
    fs::write(&other, more).unwrap();
    let other = other.to_str().unwrap();
    let before = session.snapshot().unwrap().version();
    told(&["import", other, "--instance", name]);
    let after = session.snapshot().unwrap();
    assert_eq!(after.version().0, before.0 + 1, "one commit");
    assert_eq!(after.node_count(), 3);
    assert_eq!(told(&["get", "kitchen.area", "--instance", name]), "15.0\n");
    assert_eq!(
        told(&["get", "shelly.going", "--instance", name]),
        "\"slow\"\n"
    );
    // A replacement takes away what the file does not have.
    told(&["import", other, "--replace", "--instance", name]);
    assert_eq!(session.snapshot().unwrap().node_count(), 2);
    assert_eq!(told(&["diff", other, "--instance", name]), "");
    let (_, said, code) = graph(&["set", "kitchen.aera", "1", "--instance", "nobody-here"]);
    assert_eq!((code, said.contains("no instance")), (2, true), "{said}");
    assert!(Path::new(other).exists());
    drop(session);
    store.finish();
}

/// Sets one number of `shelly`.
fn step(session: &mut Session, n: f64) {
    let mut transaction = Transaction::new();
    transaction.set("shelly", "n", n);
    session
        .commit(&transaction, Time::from_seconds(100.0 + n))
        .unwrap();
}

#[test]
fn watch_and_history_tell_what_was_changed_when_and_by_whom() {
    let (instance, store, mut session) = running("watch", WORLD);
    let name = instance.name();
    step(&mut session, 0.0);
    let watch = Program::command(&[
        "graph",
        "watch",
        "--attribute",
        "n",
        "--count",
        "3",
        "--json",
    ])
    .args(["--instance", name])
    .stdout(std::process::Stdio::piped())
    .spawn()
    .unwrap();
    // It follows from some moment on: go on until it has seen enough.
    let waiting = std::thread::spawn(move || watch.wait_with_output().unwrap());
    let mut n = 0.0;
    while !waiting.is_finished() {
        n += 1.0;
        step(&mut session, n);
        let mut transaction = Transaction::new();
        transaction.set("kitchen", "area", n);
        session
            .commit(&transaction, Time::from_seconds(100.0 + n))
            .unwrap();
    }
    let watched = String::from_utf8(waiting.join().unwrap().stdout).unwrap();
    let rows: Vec<Json> = watched
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .filter(|row: &Json| row.get("gap").is_none())
        .collect();
    assert_eq!(rows.len(), 3, "{watched}");
    for row in &rows {
        assert_eq!(row["agent"], "setup");
        let node = &row["nodes"][0];
        assert_eq!(
            (&node["name"], &node["touch"]),
            (&json!("shelly"), &json!("updated"))
        );
        assert!(node["attributes"].get("n").is_some(), "{row}");
    }
    // Beyond what the loop above came to, for time does not run back.
    for n in 1..=3 {
        step(&mut session, 1e6 + f64::from(n));
    }
    let history = told_json(&["history", "shelly.n", "--limit", "2", "--instance", name]);
    let entries = history["entries"].as_array().unwrap();
    let values: Vec<f64> = entries
        .iter()
        .map(|e| e["value"].as_f64().unwrap())
        .collect();
    assert_eq!(values, [1_000_003.0, 1_000_002.0]);
    assert_eq!(entries[0]["agent"], "setup");
    let time = entries[0]["time"].as_f64().unwrap();
    assert!((time - 1_000_103.0).abs() < 1e-6, "{time}");
    assert_eq!(history["newest"], entries[0]["version"]);
    let mut transaction = Transaction::new();
    transaction.delete_edge("shelly", "in", "kitchen");
    session.commit(&transaction, Time::default()).unwrap();
    let mut transaction = Transaction::new();
    transaction.delete_node("shelly");
    session.commit(&transaction, Time::default()).unwrap();
    let history = told_json(&["history", "shelly", "--limit", "3", "--instance", name]);
    let happened: Vec<&Json> = history["entries"]
        .as_array()
        .unwrap()
        .iter()
        .map(|entry| &entry["value"])
        .collect();
    assert_eq!(
        happened,
        [
            &json!(["deleted"]),
            &json!(["- -in-> kitchen"]),
            &json!(["n = 1000003"])
        ]
    );
    let shown = told(&["history", "shelly", "--instance", name]);
    assert!(shown.starts_with("shelly (gone): versions "), "{shown}");
    drop(session);
    store.finish();
}

#[test]
fn a_running_graph_tells_transforms() {
    let (instance, store, mut session) = running("transform", WORLD);
    let mut transaction = Transaction::new();
    transaction.push(Operation::CreateEdge {
        edge: EdgeRef::new("kitchen", "pose", "shelly"),
        attributes: vec![("transform".into(), Pose::translation(2.0, 0.0, 0.0).into())],
    });
    session
        .commit(&transaction, Time::from_seconds(5.0))
        .unwrap();
    let name = instance.name();
    let seen = told(&["transform", "shelly", "kitchen", "--instance", name]);
    assert_eq!(seen, "(-2.000, 0.000) m, heading 0.000 rad\n");
    let (_, said, code) = graph(&[
        "transform",
        "shelly",
        "kitchen",
        "--at",
        "-1",
        "--instance",
        name,
    ]);
    assert_eq!((code, said.contains("no `history`")), (1, true), "{said}");
    drop(session);
    store.finish();
}

#[test]
fn where_ranks_places_and_says_when_there_are_none() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("world.json");
    let world = r#"{"format":"dsr/1","nodes":[
     {"id":1,"type":"mug","name":"blue","attributes":{"places":[1.5,2.5,0.5,0.7,2.0,10.5, 5.5,2.5,0.5,0.2,1.0,5.5]}},
     {"id":2,"type":"mug","name":"red","attributes":{"places":[3.5,2.5,0.5,0.9,1.0,9.5]}},
     {"id":3,"type":"book","name":"novel","attributes":{}}],"edges":[]}"#;
    fs::write(&file, world).unwrap();
    let file = file.to_str().unwrap();
    let ask = |what: &str| {
        let output = Program::run(&["where", what, "--file", file, "--json"]);
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (
            output.status.code().unwrap(),
            text(output.stdout),
            text(output.stderr),
        )
    };
    let places = |what: &str| -> Vec<(String, f64)> {
        let (code, out, err) = ask(what);
        assert_eq!(code, 0, "{err}");
        let answer: Json = serde_json::from_str(&out).unwrap();
        assert_eq!(answer["name"], what);
        let rows = answer["places"].as_array().unwrap().iter();
        rows.map(|row| {
            let object = row["object"].as_str().unwrap().to_owned();
            (object, row["probability"].as_f64().unwrap())
        })
        .collect()
    };
    let told = |rows: &[(&str, f64)]| -> Vec<(String, f64)> {
        let row = |(name, p): &(&str, f64)| ((*name).to_owned(), *p);
        rows.iter().map(row).collect()
    };
    assert_eq!(places("blue"), told(&[("blue", 0.7), ("blue", 0.2)]));
    assert_eq!(
        places("mug"),
        told(&[("red", 0.9), ("blue", 0.7), ("blue", 0.2)])
    );
    assert_eq!(ask("novel").0, 1);
    let (code, _, err) = ask("blu");
    assert_eq!(code, 2);
    assert!(err.contains("did you mean `blue`?"), "{err}");
}
