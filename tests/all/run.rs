//! `cortex run` as its users meet it: whole runs of the shipped scenarios, and what happens when
//! something goes wrong in the middle of one.

use crate::support::{Program, Run, within};
use dsr::{Session, Time, Transaction};
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::time::Duration;

const CARE_CENTRE: &str = "scenarios/care-centre";
const PLAZA: &str = "scenarios/plaza";
const PATIENCE: Duration = Duration::from_secs(20);

fn report(folder: &Path) -> (String, Value) {
    let text = fs::read_to_string(folder.join("report.json")).unwrap();
    let json = serde_json::from_str(&text).unwrap();
    (text, json)
}

fn zones(psi: &Value) -> [f64; 4] {
    ["intimate", "personal", "social", "public"].map(|zone| psi[zone].as_f64().unwrap())
}

/// Less time in people's intimate and personal space than without social behaviour.
fn assert_politer(report: &Value) {
    let close = |psi: &Value| zones(psi)[0] + zones(psi)[1];
    let (with, without) = (close(&report["psi"]), close(&report["baseline"]["psi"]));
    assert!(
        with < without,
        "in people's space {with} % of the time with, {without} % without"
    );
}

#[test]
fn the_same_seed_gives_the_same_report_byte_for_byte() {
    let reports = [(); 2].map(|()| {
        let run = Run::new(
            "lockstep",
            &[CARE_CENTRE, "--lockstep", "--seed", "3", "--no-baseline"],
        );
        let folder = run.succeed();
        report(folder.path()).0
    });
    assert!(
        reports[0] == reports[1],
        "the reports differ:\n{}\n{}",
        reports[0],
        reports[1]
    );
}

#[test]
fn a_group_a_thing_and_a_pose_are_gone_to_as_planned() {
    let arguments = [
        "scenarios/reception",
        "--lockstep",
        "--seed",
        "1",
        "--no-baseline",
    ];
    let folder = Run::new("reception", &arguments).succeed();
    let (_, report) = report(folder.path());
    assert_eq!(report["success"], true);
    assert_eq!(report["robot"]["collisions"], 0);
    assert!(report["psi"]["intimate"].as_f64().unwrap() <= 0.0);
    let steps = report["plan"].as_array().unwrap().iter();
    let done: Vec<&str> = steps
        .filter(|step| step["status"] == "done")
        .map(|step| step["rule"].as_str().unwrap())
        .collect();
    assert_eq!(done, ["approachGroup", "goToObject", "goToPose"]);
}

#[test]
fn all_that_the_robot_does_with_people_is_planned_and_done() {
    let arguments = [
        "scenarios/company",
        "--lockstep",
        "--seed",
        "1",
        "--no-baseline",
    ];
    let folder = Run::new("company", &arguments).succeed();
    let (_, report) = report(folder.path());
    assert_eq!(report["success"], true);
    assert_eq!(report["robot"]["collisions"], 0);
    let done: Vec<(&str, &str)> = report["plan"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|step| step["status"] == "done")
        .map(|step| {
            (
                step["mission"].as_str().unwrap(),
                step["rule"].as_str().unwrap(),
            )
        })
        .collect();
    for step in [
        ("greet", "approach"),
        ("greet", "askForPermission"),
        ("bring", "escort"),
        ("pass", "letPass"),
        ("lead", "follow"),
        ("meet", "wait"),
    ] {
        assert!(done.contains(&step), "{step:?} is not among {done:?}");
    }
}

#[test]
fn the_care_centre_is_crossed_and_reported_beside_the_run_without_social_behaviour() {
    let run = Run::new("care", &[CARE_CENTRE, "--lockstep", "--seed", "1"]);
    let folder = run.succeed();
    let (_, report) = report(folder.path());
    assert_eq!(report["scenario"], "care-centre");
    assert_eq!(report["success"], true);
    for psi in [
        &report["psi"],
        &report["psi_moving"],
        &report["baseline"]["psi"],
    ] {
        let sum: f64 = zones(psi).iter().sum();
        assert!((sum - 100.0).abs() < 1e-6, "{psi}");
    }
    assert_politer(&report);
    assert!(report["robot"]["path_length"].as_f64().unwrap() > 10.0);
    assert_eq!(report["robot"]["collisions"], 0);
    let rules: Vec<&str> = report["plan"]
        .as_array()
        .unwrap()
        .iter()
        .map(|s| s["rule"].as_str().unwrap())
        .collect();
    assert!(
        rules.contains(&"changeRoom") && rules.contains(&"takeTheAttention"),
        "{rules:?}"
    );
    assert!(
        report["agents"]
            .as_array()
            .unwrap()
            .iter()
            .all(|a| a["cpu_seconds"].is_null())
    );
    for picture in ["map.svg", "map.png"] {
        assert!(
            fs::metadata(folder.path().join(picture)).unwrap().len() > 10_000,
            "{picture}"
        );
    }
}

#[test]
fn the_places_of_the_papers_are_crossed() {
    for name in ["apartment", "corridor", "flat", "home", "therapy-centre"] {
        let folder = format!("scenarios/{name}");
        let arguments = [
            folder.as_str(),
            "--lockstep",
            "--seed",
            "1",
            "--no-baseline",
        ];
        let (_, report) = report(Run::new(name, &arguments).succeed().path());
        assert_eq!(report["scenario"], name);
        assert_eq!(report["success"], true, "{name}");
        assert_eq!(report["robot"]["collisions"], 0, "{name}");
    }
}

#[test]
fn the_plaza_is_crossed_there_and_back_among_walkers() {
    let folder = Run::new("plaza", &[PLAZA, "--lockstep", "--seed", "1"]).succeed();
    let (_, report) = report(folder.path());
    assert_eq!(report["success"], true);
    assert_eq!(report["mission"]["missions"].as_array().unwrap().len(), 3);
    assert_eq!(report["robot"]["collisions"], 0);
    assert_politer(&report);
}

/// A recording in the shape of `obsmat.txt`: two people who walk across the plaza and back.
fn recording() -> String {
    let mut text = String::new();
    for step in 0..200 {
        let (frame, t) = (1 + 10 * step, f64::from(step) * 0.4);
        for (id, y, speed) in [(1, 4.0, 1.2), (2, 8.0, -1.0)] {
            let (x, v) = if t * f64::abs(speed) < 14.0 {
                (t * speed, speed)
            } else {
                continue;
            };
            let x = if speed > 0.0 { 0.5 + x } else { 14.5 + x };
            let _ = writeln!(text, "{frame} {id} {x} 0 {y} {v} 0 0");
        }
    }
    text
}

#[test]
fn recorded_pedestrians_take_the_place_of_simulated_ones() {
    let folder = tempfile::tempdir().unwrap();
    let tracks = folder.path().join("obsmat.txt");
    fs::write(&tracks, recording()).unwrap();
    let tracks = tracks.to_str().unwrap();
    let run = Run::new(
        "tracks",
        &[PLAZA, "--lockstep", "--tracks", tracks, "--no-baseline"],
    );
    let folder = run.succeed();
    let (_, report) = report(folder.path());
    assert_eq!(report["success"], true);
    assert_eq!(report["people"].as_array().unwrap().len(), 2);
}

/// Whom the supervisor starts again.
const VICTIMS: [&str; 6] = [
    "navigation",
    "human_observer",
    "object_recognition",
    "social_mapping",
    "executive",
    "store",
];

#[test]
fn an_agent_that_is_killed_is_restarted_and_the_mission_still_succeeds() {
    let mut run = Run::new("killed", &[CARE_CENTRE, "--speed", "10", "--no-baseline"]).start();
    run.until("mission invite is running");
    for victim in VICTIMS {
        run.kill(victim);
        run.until(&format!("{victim} ended"));
    }
    let folder = run.succeed();
    let (_, report) = report(folder.path());
    assert_eq!(report["success"], true);
    let agents = report["agents"].as_array().unwrap();
    let restarts = |name| agents.iter().find(|a| a["name"] == name).unwrap()["restarts"].clone();
    for victim in VICTIMS {
        assert_eq!(restarts(victim), 1, "{victim}");
    }
    assert_eq!(restarts("world"), 0);
}

#[test]
fn a_store_that_is_killed_again_and_again_loses_nothing() {
    let mut run = Run::new("stores", &[CARE_CENTRE, "--speed", "10", "--no-baseline"]).start();
    run.until("mission invite is running");
    for _ in 0..3 {
        run.kill("store");
        run.until("store ended");
    }
    let folder = run.succeed();
    let (_, report) = report(folder.path());
    assert_eq!(report["success"], true);
    assert_eq!(report["agents"][0]["restarts"], 3);
}

#[test]
fn while_social_mapping_hangs_the_robot_says_that_its_map_is_lost() {
    let mut run = Run::new("hangs", &[CARE_CENTRE, "--speed", "4", "--no-baseline"]).start();
    run.until("mission invite is running");
    let name = run.instance_name().to_owned();
    let becomes = |state: &str| {
        let asked = within(PATIENCE, || {
            let got = Program::run(&["graph", "get", "robot.map_state", "--instance", &name]);
            (got.stdout == format!("{state:?}\n").as_bytes()).then_some(())
        });
        assert!(asked.is_some(), "it never becomes {state}");
    };
    becomes("current");
    run.stop("social_mapping");
    becomes("lost");
    run.resume("social_mapping");
    becomes("current");
    run.interrupt();
    assert_eq!(run.exit_code(), 1);
    run.assert_nothing_is_left();
}

#[test]
fn an_interrupt_ends_every_process_and_leaves_nothing() {
    let mut run = Run::new("interrupt", &[CARE_CENTRE]).start();
    run.until("mission invite is running");
    assert!(!run.processes().is_empty());
    run.interrupt();
    assert_eq!(run.exit_code(), 1);
    run.assert_nothing_is_left();
}

#[test]
fn a_supervisor_that_is_killed_takes_its_processes_with_it_and_the_next_run_cleans_up() {
    let mut run = Run::new("supervisor", &[CARE_CENTRE]).start();
    run.until("mission invite is running");
    run.kill_supervisor();
    run.wait_until_no_process_is_left();
    let again = Run::on(
        run.instance_name(),
        &[CARE_CENTRE, "--lockstep", "--no-baseline"],
    );
    again.succeed();
    run.assert_nothing_is_left();
}

#[test]
fn what_was_acknowledged_as_durable_is_there_in_the_next_run_after_all_were_killed() {
    let state = tempfile::tempdir().unwrap();
    let arguments = [CARE_CENTRE, "--state", state.path().to_str().unwrap()];
    let mut run = Run::new("state", &[&arguments[..], &["--durable"]].concat()).start();
    run.until("mission invite is running");
    let instance = dsr::Instance::new(run.instance_name()).unwrap();
    let attach = || Session::attach(&instance, "cortex-graph", PATIENCE).unwrap();
    let mut transaction = Transaction::new();
    transaction.create_node("tv", "screen", vec![]);
    let commit = attach().commit(&transaction, Time::default()).unwrap();
    assert!(commit.durable);
    run.kill_supervisor();
    run.wait_until_no_process_is_left();
    let mut again = Run::on(run.instance_name(), &arguments).start();
    again.until("mission invite is running");
    let snapshot = attach().snapshot().unwrap();
    assert!(snapshot.find_node_by_name("screen").unwrap().is_some());
    assert!(snapshot.version() > commit.version);
    drop(snapshot);
    again.interrupt();
    assert_eq!(again.exit_code(), 1);
    again.assert_nothing_is_left();
}

#[test]
fn the_live_graph_is_shown_from_another_terminal() {
    let mut run = Run::new("show", &[CARE_CENTRE]).start();
    run.until("mission invite is running");
    let name = run.instance_name().to_owned();
    let shown = Program::run(&["graph", "show", "robot", "--instance", &name]);
    assert!(shown.status.success(), "{shown:?}");
    let text = String::from_utf8(shown.stdout).unwrap();
    assert!(
        text.contains("robot : robot") && text.contains("-in-> "),
        "{text}"
    );
    let set = Program::run(&[
        "graph",
        "set",
        "robot.max_speed",
        "0.33",
        "--instance",
        &name,
    ]);
    assert!(set.status.success(), "{set:?}");
    let got = Program::run(&["graph", "get", "robot.max_speed", "--instance", &name]);
    assert_eq!(String::from_utf8(got.stdout).unwrap(), "0.33\n");
    let wrong = Program::run(&["graph", "get", "robto.max_speed", "--instance", &name]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(
        String::from_utf8(wrong.stderr)
            .unwrap()
            .contains("did you mean `robot`?")
    );
    // What the robot plans on is in the graph too, for whoever likes to look at it.
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("grid.f32");
    let path = file.to_str().unwrap();
    let grid = ["graph", "get", "world.social_grid", "--bytes", path];
    let saved = Program::run(&[&grid[..], &["--instance", &name]].concat());
    assert!(saved.status.success(), "{saved:?}");
    let bytes = fs::read(&file).unwrap();
    let (costs, rest) = bytes.as_chunks::<4>();
    assert!(!costs.is_empty() && rest.is_empty());
    assert!(costs.iter().all(|cost| f32::from_le_bytes(*cost) >= 1.0));
    let dirty = [
        "graph",
        "get",
        "world.social_grid_dirty",
        "--instance",
        &name,
    ];
    let dirty = String::from_utf8(Program::run(&dirty).stdout).unwrap();
    let dirty: Value = serde_json::from_str(&dirty).unwrap();
    let dirty: [f64; 4] = serde_json::from_value(dirty["value"].clone()).unwrap();
    assert!(dirty[1] * dirty[3] <= costs.len() as f64, "{dirty:?}");
    let json = Program::run(&["graph", "export", "json", "--instance", &name]);
    let json: Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(json["format"], "dsr/1");
    let twice = Program::run(&["run", CARE_CENTRE, "--instance", &name]);
    assert!(
        String::from_utf8(twice.stderr)
            .unwrap()
            .contains("is running already")
    );
    run.interrupt();
    assert_eq!(run.exit_code(), 1);
}

#[test]
fn a_broken_scenario_is_told_with_line_and_column() {
    let folder = tempfile::tempdir().unwrap();
    for file in ["scenario.toml", "schedule.toml", "rules.aggl"] {
        let text = fs::read_to_string(crate::support::root().join(CARE_CENTRE).join(file)).unwrap();
        fs::write(folder.path().join(file), text).unwrap();
    }
    fs::create_dir(folder.path().join("missions")).unwrap();
    for mission in fs::read_dir(crate::support::root().join(CARE_CENTRE).join("missions")).unwrap()
    {
        let mission = mission.unwrap();
        fs::copy(
            mission.path(),
            folder.path().join("missions").join(mission.file_name()),
        )
        .unwrap();
    }
    let path = folder.path().join("scenario.toml");
    let good = fs::read_to_string(&path).unwrap();
    let line = good.lines().position(|line| line == "[robot]").unwrap();
    fs::write(&path, good.replace("[robot]", "[robott]")).unwrap();
    let run = Program::run(&["run", folder.path().to_str().unwrap()]);
    assert_eq!(run.status.code(), Some(2));
    let told = String::from_utf8(run.stderr).unwrap();
    assert!(told.contains(&format!(":{}:", line + 1)), "{told}");
    fs::write(&path, good).unwrap();
    let rules = folder.path().join("rules.aggl");
    let text = fs::read_to_string(&rules).unwrap();
    fs::write(
        &rules,
        text.replacen("robot->room1(in)", "robto->room1(in)", 1),
    )
    .unwrap();
    let run = Program::run(&["run", folder.path().to_str().unwrap()]);
    assert_eq!(run.status.code(), Some(2));
    let told = String::from_utf8(run.stderr).unwrap();
    assert!(
        told.contains("rules.aggl:") && told.contains("robot"),
        "{told}"
    );
}
