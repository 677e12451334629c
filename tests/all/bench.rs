//! `cortex bench` as its users meet it: what it tells, and that nothing of it is left. How fast it is
//! depends on the machine and is not tested.

use crate::support::Program;
use serde_json::Value;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use tempfile::TempDir;

#[test]
fn the_graphs_figures_are_all_there_and_no_process_or_memory_of_theirs_is_left() {
    let folder = TempDir::new().unwrap();
    let output = Program::command(&["bench", "graph", "--quick", "--json"])
        .env("CORTEX_RUNTIME_DIR", folder.path())
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let figures: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    let names: Vec<&str> = figures
        .iter()
        .map(|f| f["name"].as_str().unwrap())
        .collect();
    assert_eq!(
        names,
        [
            "commit_ack_poll",
            "visible_poll",
            "commit_ack_block",
            "read_attribute",
            "read_pose",
            "label_edges_per_edge",
            "commits_flat_out",
            "attach_100k",
            "private_memory_per_agent",
            "torn_reads",
            "hot_pose_visible",
            "commit_ack_beside_stopped",
            "commit_ack_beside_killed",
            "commit_ack_inspected",
            "inspector_cores",
            "inspector_first_answer",
        ]
    );
    for figure in &figures {
        let (name, value) = (&figure["name"], figure["value"].as_f64().unwrap());
        assert!(figure["unit"].is_string(), "{name}");
        if name == "torn_reads" {
            assert!(value.abs() < f64::EPSILON, "{value} torn reads");
            assert!(figure["ratio"].is_null());
        } else if name.as_str().unwrap().starts_with("inspector_") {
            assert!(value > 0.0, "{figure}");
        } else {
            let [raw, ratio] = ["raw", "ratio"].map(|field| figure[field].as_f64().unwrap());
            assert!(value > 0.0 && raw > 0.0, "{figure}");
            assert!((ratio - value / raw).abs() < 1e-9 * ratio, "{figure}");
        }
    }
    let user = fs::read_dir(folder.path())
        .unwrap()
        .next()
        .unwrap()
        .unwrap();
    let left: Vec<_> = fs::read_dir(user.path()).unwrap().collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn the_figures_of_social_maps_are_all_there_each_beside_something() {
    let output = Program::run(&["bench", "social", "--json"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let rows: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    let names: Vec<&str> = rows.iter().map(|f| f["name"].as_str().unwrap()).collect();
    assert_eq!(
        names,
        [
            "density_100",
            "density_100_one_moved",
            "density_100_one_moved_new",
            "density_1000",
            "contours_100",
            "map_100_one_moved",
            "map_1000",
        ]
    );
    for row in &rows {
        let [value, peer, ratio] =
            ["value", "peer", "ratio"].map(|field| row[field].as_f64().unwrap());
        assert!(
            value > 0.0 && (ratio - peer / value).abs() < 1e-9 * ratio,
            "{row}"
        );
        assert!(!row["beside"].as_str().unwrap().is_empty(), "{row}");
    }
}

#[test]
fn a_thousand_people_are_tracked_beside_the_time_of_a_frame() {
    let output = Program::run(&["bench", "perception", "--json"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let rows: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    let names: Vec<&str> = rows.iter().map(|f| f["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["track_1000", "track_1000_p99"]);
    assert!(rows.iter().all(|row| row["value"].as_f64().unwrap() > 0.0));
}

#[test]
fn rules_are_not_measured_without_their_peers() {
    let program = std::path::Path::new(env!("CARGO_BIN_EXE_cortex-under-test"));
    // Beside it nothing is, and there is no cargo to build it with.
    let folder = TempDir::new_in(program.parent().unwrap()).unwrap();
    let alone = folder.path().join("cortex");
    fs::hard_link(program, &alone).unwrap();
    let refused = || {
        let output = std::process::Command::new(&alone)
            .args(["bench", "rules", "--json"])
            .env("PATH", folder.path())
            .output()
            .unwrap();
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(output.stdout.is_empty());
        told
    };
    let told = refused();
    for words in [
        "cortex-peers",
        "cargo cannot be started",
        "cargo install --path peers",
    ] {
        let told = told.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(told.contains(words), "{words}: {told}");
    }
    // It lies in no folder of target files, so that cargo builds where it always does.
    let cargo = folder.path().join("cargo");
    let asked = folder.path().join("asked");
    let script = format!("#!/bin/sh\necho \"$@\" > '{}'\nexit 101\n", asked.display());
    fs::write(&cargo, script).unwrap();
    fs::set_permissions(&cargo, fs::Permissions::from_mode(0o755)).unwrap();
    let told = refused();
    assert!(told.contains("cargo ended with"), "{told}");
    let asked = fs::read_to_string(asked).unwrap();
    assert!(
        asked.starts_with("build --quiet --package peers"),
        "{asked}"
    );
    assert!(!asked.contains("--target-dir"), "{asked}");
}
