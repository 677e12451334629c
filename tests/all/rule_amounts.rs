//! What a rule costs and how long it takes where it matches, as `cortex rules match` and `apply` tell it:
//! an amount that is missing has a reason, for people and for machines.

use crate::support::Program;
use serde_json::{Value, json};
use std::fs;
use tempfile::TempDir;

const RULES: &str = "name=amounts
===
go : active(1) cost(r.price) duration(e(r, way, p).length)
{
	{ r:robot p:place }
	=>
	{ r:robot p:place r->p(at) }
}
";

const WORLD: &str = r#"{"format":"dsr/1","nodes":[
{"id":1,"type":"robot","name":"rich","attributes":{"price":2.0}},
{"id":2,"type":"robot","name":"owing","attributes":{"price":-2.0}},
{"id":3,"type":"robot","name":"none"},
{"id":4,"type":"place","name":"door"}],
"edges":[{"from":1,"label":"way","to":4,"attributes":{"length":7.5}},{"from":3,"label":"way","to":4}]}"#;

const OWING: [(&str, &str); 2] = [
    (
        "cost",
        "`r.price` is -2, but must be a number that is 0 or more",
    ),
    (
        "duration",
        "`e(r, way, p).length` has no value: e(r, way, p).length is missing, as r (owing) has no link `way` to p (door)",
    ),
];
const NONE: [(&str, &str); 2] = [
    ("cost", "`r.price` has no value: r.price is missing"),
    (
        "duration",
        "`e(r, way, p).length` has no value: e(r, way, p).length is missing",
    ),
];

fn run(folder: &TempDir, verb: &str, rest: &[&str]) -> String {
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (rules, world) = (path("rules.aggl"), path("world.json"));
    let first = ["rules", verb, &rules, "--rule", "go", "--world", &world];
    let output = Program::run(&[&first[..], rest].concat());
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("rules.aggl"), RULES).unwrap();
    fs::write(folder.path().join("world.json"), WORLD).unwrap();
    folder
}

#[test]
fn applying_tells_the_amounts_or_why_there_are_none() {
    let folder = folder();
    let apply = |robot: &str, rest: &[&str]| {
        let bind = format!("r={robot}");
        run(&folder, "apply", &[&["--bind", &bind], rest].concat())
    };
    let told = apply("rich", &[]);
    assert!(told.ends_with("\ncost 2; duration 7.5 s\n"), "{told}");
    let told: Value = serde_json::from_str(&apply("rich", &["--json"])).unwrap();
    let amounts = [&told["cost"], &told["duration"], &told["amounts_missing"]];
    assert_eq!(amounts, [&json!(2.0), &json!(7.5), &json!({})]);
    for (robot, missing) in [("owing", OWING), ("none", NONE)] {
        let [(_, cost), (_, duration)] = missing;
        let told = apply(robot, &[]);
        let line = format!("\nno cost: {cost}; no duration: {duration}\n");
        assert!(told.ends_with(&line), "{told}");
        let told: Value = serde_json::from_str(&apply(robot, &["--json"])).unwrap();
        let amounts = [&told["cost"], &told["duration"], &told["amounts_missing"]];
        let why = json!({ "cost": cost, "duration": duration });
        assert_eq!(amounts, [&Value::Null, &Value::Null, &why]);
    }
}

#[test]
fn matches_without_amounts_are_told() {
    let folder = folder();
    let [lacking, nothing] = [OWING, NONE].map(|missing| {
        missing
            .map(|(what, why)| format!("        no {what}: {why}\n"))
            .concat()
    });
    let told = run(&folder, "match", &[]);
    let (_, lines) = told.split_once('\n').unwrap();
    let expected =
        format!("    r=rich p=door\n    r=owing p=door\n{lacking}    r=none p=door\n{nothing}");
    assert_eq!(lines, expected);
    let told: Value = serde_json::from_str(&run(&folder, "match", &["--json"])).unwrap();
    let row = |place: usize, [(_, cost), (_, duration)]: [(&str, &str); 2]| json!({ "match": place, "cost": cost, "duration": duration });
    assert_eq!(
        told["amounts_missing"],
        json!([row(1, OWING), row(2, NONE)])
    );
    let counted: Value =
        serde_json::from_str(&run(&folder, "match", &["--json", "--count"])).unwrap();
    assert_eq!(counted.get("amounts_missing"), None);
}
