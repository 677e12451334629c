//! Recordings as their users meet them: a run that is recorded, a recorder that is killed, a recording
//! that is looked at as of a time and played again as a running system.

use crate::support::{Program, Run, within};
use serde_json::{Value as Json, json};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

const CARE_CENTRE: &str = "scenarios/care-centre";
const PATIENCE: Duration = Duration::from_secs(30);

/// What a verb says in JSON, and its exit code.
fn told(arguments: &[&str]) -> (Json, i32) {
    let output = Program::run(&[arguments, &["--json"]].concat());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let json =
        serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {said}"));
    (json, output.status.code().unwrap())
}

fn time(value: &Json) -> f64 {
    value.as_f64().unwrap()
}

/// The times at which an attribute was written.
fn history(file: &str, path: &str) -> Vec<f64> {
    let (history, _) = told(&["graph", "history", path, "--file", file]);
    let entries = history["entries"].as_array().unwrap();
    entries.iter().map(|entry| time(&entry["time"])).collect()
}

#[test]
fn a_recorded_run_is_looked_at_as_of_any_time_and_played_again_to_the_same_graph() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let file = file.to_str().unwrap();
    let arguments = [CARE_CENTRE, "--lockstep", "--no-baseline", "--record", file];
    Run::new("record", &arguments).succeed();

    let (verdict, code) = told(&["replay", file]);
    assert_eq!(code, 0, "{verdict}");
    assert_eq!(verdict["identical"], true);
    assert_eq!(
        (&verdict["complete"], &verdict["cut"]),
        (&json!(true), &json!(false))
    );
    assert_eq!(verdict["missed"], 0);
    assert_eq!(verdict["version"], verdict["compared"]);
    assert!(verdict["commits"].as_u64().unwrap() > 1000, "{verdict}");
    assert!(verdict["digests"].as_u64().unwrap() > 2, "{verdict}");

    // Of each tick there is what the world measured and what the robot was told.
    let messages = |channel: &str| verdict["messages"][channel].as_u64().unwrap();
    let ticks = verdict["ticks"].as_u64().unwrap();
    assert!(ticks > 100, "{verdict}");
    // The laser turns and the base is located ten times a second.
    let half = ticks.div_ceil(2);
    assert_eq!((messages("odometry"), messages("laser")), (half, half));
    // And that it shall stand, at the end.
    assert_eq!(messages("velocity"), ticks + 1);
    assert!(messages("detections") >= ticks, "{verdict}");

    let velocities = history(file, "robot.velocity");
    assert!(velocities.len() > 100, "{}", velocities.len());
    let (end, start) = (velocities[0], velocities[velocities.len() - 1]);
    let middle = f64::midpoint(start, end);
    for (at, expected) in [
        (middle.to_string(), middle),
        (
            (middle - start).floor().to_string(),
            start + (middle - start).floor(),
        ),
    ] {
        let (then, _) = told(&[
            "graph",
            "get",
            "robot.velocity",
            "--file",
            file,
            "--at",
            &at,
        ]);
        let then = time(&then["time"]);
        assert!(
            (expected - 1.5..=expected + 1.5).contains(&then),
            "{at}: {then} of {expected}"
        );
    }
    let (_, code) = told(&["graph", "diff", file, file]);
    assert_eq!(code, 0);
    let refused = Program::run(&["graph", "set", "robot.max_speed", "1.0", "--file", file]);
    assert_eq!(refused.status.code(), Some(2));
    as_a_running_system(file);
    in_python(file);
}

/// The tutorial's program reads the recording, where Python and the public package `mcap` are installed.
#[allow(clippy::print_stderr, reason = "a test that did not look must say so")]
fn in_python(file: &str) {
    let known = Command::new("python3").args(["-c", "import mcap"]).output();
    if !known.is_ok_and(|output| output.status.success()) {
        eprintln!("SKIPPED: Python has no package mcap, so the tutorial's program was not run");
        return;
    }
    let program = crate::examples::blocks("recording-in-python", "python").remove(0);
    let output = Command::new("python3")
        .args(["-c", &program, file])
        .output();
    let output = output.unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let failed = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{failed}");
    assert!(
        said.lines().count() > 3 && said.contains("person_"),
        "{said}"
    );
}

/// What a recording is played into is a graph like any other, with rules and agents on record.
fn as_a_running_system(file: &str) {
    let instance = crate::support::TestInstance::new("replay");
    let name = instance.name();
    let replay = Program::command(&["replay", file, "--instance", name, "--keep", "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let at = format!("@{name}");
    let same = within(PATIENCE, || {
        let output = Program::run(&["graph", "diff", file, &at]);
        (output.status.code() == Some(0)).then_some(())
    });
    assert!(
        same.is_some(),
        "it never became what the recording ends with"
    );
    let rules = |source: &[&str]| {
        let (why, _) = told(&[&["graph", "history", "robot-in->day_room"], source].concat());
        why["entries"][0]["rules"].clone()
    };
    let live = rules(&["--instance", name]);
    assert_eq!(live, rules(&["--file", file]));
    let id = rustix::process::Pid::from_child(&replay);
    rustix::process::kill_process(id, rustix::process::Signal::INT).unwrap();
    let output = replay.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    let verdict: Json = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(verdict["identical"], true);
}

#[test]
fn a_recorder_that_is_killed_leaves_what_it_saw_and_the_next_goes_on_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let name = text(&file);
    let arguments = [
        CARE_CENTRE,
        "--speed",
        "10",
        "--no-baseline",
        "--record",
        &name,
    ];
    let mut run = Run::new("cut", &arguments).start();
    run.until("mission invite is running");
    // What it saw in the second before is in the file.
    let written = || std::fs::metadata(&file).map_or(0, |found| found.len());
    let first = written();
    assert!(within(PATIENCE, || (written() > first).then_some(())).is_some());
    run.kill("record");
    run.until("recorder ended");
    run.succeed();

    let (verdict, code) = told(&["replay", &name]);
    assert_eq!((code, &verdict["cut"]), (0, &json!(true)), "{verdict}");
    assert!(verdict["commits"].as_u64().unwrap() > 0, "{verdict}");
    let said = String::from_utf8(Program::run(&["replay", &name]).stdout).unwrap();
    assert!(said.contains("cut off"), "{said}");
    let (verdict, code) = told(&["replay", &text(&folder.path().join("run-2.mcap"))]);
    assert_eq!((code, &verdict["complete"]), (0, &json!(true)), "{verdict}");
}

#[test]
fn what_is_no_recording_is_bad_input() {
    for arguments in [
        &["replay", "README.md"][..],
        &["replay", "nowhere.mcap"],
        &["graph", "show", "--at", "3", "--instance", "nobody"],
    ] {
        let output = Program::run(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    }
}
