//! `cortex path` as its users meet it: single questions on weighted maps, whole lists of problems,
//! and files that are wrong.

use crate::support::Program;
use serde_json::{Value, json};
use std::fs;
use tempfile::TempDir;

const MAP: &str = "type octile\nheight 3\nwidth 4\nmap\n....\n.@@.\n....\n";
const GRID: &str = "type weighted_octile\nheight 3\nwidth 4\nmap\n.44.\n.@@.\n....\n";

fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.map"), MAP).unwrap();
    fs::write(folder.path().join("a.wmap"), GRID).unwrap();
    folder
}

/// Exit code, answer, standard error of `cortex path ... --json`, run on `folder`'s files.
fn path(folder: &TempDir, arguments: &[&str]) -> (i32, Value, String) {
    let files: Vec<String> = arguments
        .iter()
        .map(|word| match word.strip_prefix("@") {
            Some(file) => folder.path().join(file).display().to_string(),
            None => (*word).to_owned(),
        })
        .collect();
    let mut words = vec!["path"];
    words.extend(files.iter().map(String::as_str));
    words.push("--json");
    let output = Program::run(&words);
    (
        output.status.code().unwrap(),
        serde_json::from_slice(&output.stdout).unwrap_or_default(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

#[test]
fn each_cost_model_finds_its_own_cheapest_path() {
    let folder = folder();
    let ends = ["--grid", "@a.wmap", "--from", "0,0", "--to", "3,0"];
    // Along the top the three steps cost 2.5, 4 and 2.5 by the mean; below it is seven steps of 1.
    for (model, cost, length) in [("length_mean", 7.0, 7.0), ("length_dest", 7.0, 7.0)] {
        for algorithm in ["astar", "dijkstra", "dstar_lite"] {
            let mut words = ends.to_vec();
            words.extend(["--model", model, "--algorithm", algorithm]);
            let (code, answer, error) = path(&folder, &words);
            assert_eq!((code, error.as_str()), (0, ""));
            assert_eq!(answer["cost"], cost, "{model} {algorithm}");
            assert_eq!(answer["length"], length);
            assert_eq!(answer["cells"][0], json!([0, 0]));
            assert_eq!(answer["cells"].as_array().unwrap().len(), 8);
        }
    }
    let (_, answer, _) = path(&folder, &[&ends[..], &["--model", "node_sum"]].concat());
    assert_eq!(answer["cost"], 8.0, "eight cells of cost 1");
}

#[test]
fn a_list_of_problems_is_checked_line_by_line() {
    let folder = folder();
    let good = "version 1\n0 a.map 4 3 0 0 3 0 3\n0 a.map 4 3 0 0 3 2 5\n";
    fs::write(folder.path().join("good.scen"), good).unwrap();
    let bad = good.replace("3 2 5", "3 2 4.8") + "0 a.map 4 3 0 0 1 1 1.5\n";
    fs::write(folder.path().join("bad.scen"), bad).unwrap();
    let (code, answer, _) = path(&folder, &["--map", "@a.map", "--scen", "@good.scen"]);
    assert_eq!(code, 0);
    assert_eq!(
        [
            &answer["checked"],
            &answer["matched"],
            &answer["mismatched"]
        ],
        [2, 2, 0]
    );
    let (code, answer, _) = path(&folder, &["--map", "@a.map", "--scen", "@bad.scen"]);
    assert_eq!(code, 1);
    assert_eq!(
        [
            &answer["checked"],
            &answer["matched"],
            &answer["mismatched"]
        ],
        [3, 1, 2]
    );
    assert_eq!(answer["mismatches"][0]["line"], 3);
    assert_eq!(answer["mismatches"][0]["found"], 5.0);
    let reason = answer["mismatches"][1]["found"].as_str().unwrap();
    assert!(reason.contains("blocked"), "{reason}");
}

#[test]
fn no_path_is_an_answer_and_a_wrong_file_is_not() {
    let folder = folder();
    let blocked = ["--map", "@a.map", "--from", "0,0", "--to", "1,1"];
    let (code, answer, _) = path(&folder, &blocked);
    assert_eq!(code, 1);
    assert!(answer["reason"].as_str().unwrap().contains("blocked"));
    let (code, _, error) = path(
        &folder,
        &["--map", "@a.map", "--from", "0,0", "--to", "4,1"],
    );
    assert_eq!(code, 2);
    assert!(error.contains("4 x 3 cells"), "{error}");
    fs::write(
        folder.path().join("a.map"),
        MAP.replace("....\n.@", "..x.\n.@"),
    )
    .unwrap();
    let (code, _, error) = path(&folder, &blocked);
    assert_eq!(code, 2);
    assert!(error.contains("a.map:5:3"), "{error}");
}
