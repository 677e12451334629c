//! `cortex plan` as its users meet it: plans, the lack of them with its reason, limits, and what is
//! wrong with what it is given.

use crate::support::Program;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::fs;
use tempfile::TempDir;

const RULES: &str = "name=rooms
===
types { (robot room : thing) }
===
changeRoom : active(1) agent(navigation)
{
	{ r:robot a:room b:room r->a(in) a->b(connected) }
	=>
	{ r:robot a:room b:room r->b(in) a->b(connected) }
}
carry : active(10)
{
	{ r:robot a:room b:room r->a(in) }
	=>
	{ r:robot a:room b:room r->b(in) }
}
";

/// Rooms 2, 3, ... in a row, each joined to the next, and a robot in the first.
fn row(rooms: u32, joined: bool) -> String {
    let mut nodes = r#"{"id":1,"type":"robot","name":"rob"}"#.to_owned();
    let mut edges = r#"{"from":1,"label":"in","to":2}"#.to_owned();
    for id in 2..2 + rooms {
        // Writing to a string does not fail.
        let _ = write!(nodes, r#",{{"id":{id},"type":"room","name":"room{id}"}}"#);
        if joined && id > 2 {
            let _ = write!(
                edges,
                r#",{{"from":{},"label":"connected","to":{id}}}"#,
                id - 1
            );
        }
    }
    format!(r#"{{"format":"dsr/1","nodes":[{nodes}],"edges":[{edges}]}}"#)
}

/// Exit code, standard output and standard error.
fn plan(rules: &str, world: &str, goal: &str, flags: &[&str]) -> (i32, String, String) {
    let folder: TempDir = tempfile::tempdir().unwrap();
    let files = [
        ("rules.aggl", rules),
        ("world.json", world),
        ("goal.aggt", goal),
    ];
    let paths = files.map(|(name, text)| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    });
    let mut arguments = vec!["plan"];
    arguments.extend(paths.iter().map(String::as_str));
    arguments.extend(flags);
    let output = Program::run(&arguments);
    let words = |bytes| String::from_utf8(bytes).unwrap();
    (
        output.status.code().unwrap(),
        words(output.stdout),
        words(output.stderr),
    )
}

fn json(rules: &str, world: &str, goal: &str, flags: &[&str]) -> (i32, Value) {
    let flags: Vec<&str> = flags.iter().copied().chain(["--json"]).collect();
    let (code, out, err) = plan(rules, world, goal, &flags);
    (
        code,
        serde_json::from_str(&out).unwrap_or_else(|_| panic!("{out}{err}")),
    )
}

#[test]
fn the_best_plan_is_found_for_a_goal_that_names_nodes_by_id_or_name() {
    for goal in [
        "{ 1:robot 4:room 1->4(in) }",
        "{ r:robot \"room4\":room r->\"room4\"(in) }",
    ] {
        let (code, plan) = json(RULES, &row(3, true), goal, &["--optimal"]);
        assert_eq!(code, 0);
        assert_eq!(
            (&plan["status"], &plan["optimal"]),
            (&json!("solved"), &json!(true))
        );
        assert_eq!(
            (&plan["cost"], &plan["reason"]),
            (&json!(2.0), &json!(null))
        );
        let steps = plan["steps"].as_array().unwrap();
        let first = json!({"r": "rob", "a": "room2", "b": "room3"});
        assert_eq!(
            (&steps[0]["rule"], &steps[0]["binding"]),
            (&json!("changeRoom"), &first)
        );
        assert_eq!((steps.len(), &steps[1]["agent"]), (2, &json!("navigation")));
        let [grounded, first, all] =
            ["grounded", "first_plan", "seconds"].map(|name| plan[name].as_f64());
        assert!(
            grounded.is_some() && grounded <= first && first <= all,
            "{plan}"
        );
        assert!(plan["expanded"].is_u64());
    }
}

#[test]
fn without_flags_a_plan_is_printed_and_with_time_it_becomes_better() {
    let goal = "{ 1:robot 13:room 1->13(in) }";
    let (code, out, _) = plan(RULES, &row(12, true), goal, &[]);
    assert_eq!(code, 0);
    assert!(
        out.contains("r=rob") && out.contains("steps, cost"),
        "{out}"
    );
    let (code, plan) = json(RULES, &row(12, true), goal, &["--time-limit", "60"]);
    assert_eq!((code, &plan["optimal"]), (0, &json!(true)), "{plan}");
    assert_eq!(
        (&plan["cost"], plan["steps"].as_array().unwrap().len()),
        (&json!(10.0), 1)
    );
}

#[test]
fn where_there_is_no_plan_the_answer_is_no_with_the_reason() {
    let rules = RULES.split("carry").next().unwrap();
    let goal = "{ 1:robot 4:room 1->4(in) }";
    let (code, plan) = json(rules, &row(3, false), goal, &[]);
    assert_eq!((code, &plan["status"]), (1, &json!("unsolvable")));
    assert!(plan["reason"].as_str().unwrap().contains("room4"), "{plan}");
    assert_eq!((&plan["steps"], &plan["cost"]), (&json!([]), &json!(null)));
    let (code, plan) = json(rules, &row(3, true), "{ 1:robot 99:room 1->99(in) }", &[]);
    assert_eq!((code, &plan["reason"]), (1, &json!("there is no node 99")));
}

#[test]
fn a_limit_ends_the_search_and_says_so() {
    let goal = "{ 1:robot 60:room 1->60(in) }";
    let (code, plan) = json(
        RULES,
        &row(80, true),
        goal,
        &["--optimal", "--time-limit", "1e-9"],
    );
    assert_eq!((code, &plan["status"]), (1, &json!("limit")));
    assert!(
        plan["reason"]
            .as_str()
            .unwrap()
            .contains("the time allowed is over"),
        "{plan}"
    );
}

#[test]
fn broken_input_is_told_with_its_place() {
    let (world, goal) = (row(3, true), "{ 1:robot 4:room 1->4(in) }");
    for (rules, world, goal, words) in [
        (
            &*RULES.replace("r->a(in)", "q->a(in)"),
            &*world,
            goal,
            "rules.aggl:7:",
        ),
        (
            RULES,
            "{\"format\":\"dsr/1\",\n\"nodes\":[{",
            goal,
            "world.json:2:",
        ),
        (RULES, &*world, "{ 1:robt }", "goal.aggt:1:5"),
    ] {
        let (code, out, err) = plan(rules, world, goal, &[]);
        assert_eq!((code, out.as_str()), (2, ""), "{err}");
        assert!(err.contains(words), "{err}");
    }
    let (code, _, err) = plan(RULES, &world, goal, &["--time-limit", "0"]);
    assert!(code == 2 && err.contains("--time-limit"), "{err}");
}

const LIFT: &str = "(define (domain lift) (:requirements :strips :typing :action-costs)
  (:types floor) (:predicates (at ?f - floor) (above ?a ?b - floor))
  (:functions (total-cost) - number)
  (:action up :parameters (?a ?b - floor) :precondition (and (at ?a) (above ?a ?b))
    :effect (and (not (at ?a)) (at ?b) (increase (total-cost) 2))))";

#[test]
fn tasks_in_pddl_are_planned_for_and_plans_written_for_validators() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let problem = "(define (problem p) (:domain lift) (:objects a b c - floor)
      (:init (at a) (above a b) (above b c)) (:goal (at c)) (:metric minimize (total-cost)))";
    fs::write(path("lift.pddl"), LIFT).unwrap();
    fs::write(path("p.pddl"), problem).unwrap();
    fs::write(path("bad.pddl"), problem.replace("(at c)", "(att c)")).unwrap();
    let (lift, plan_file) = (path("lift.pddl"), path("plan"));
    let run = |problem: &str| {
        let problem = path(problem);
        let flags = ["--optimal", "--json", "--plan-file", &plan_file];
        Program::run(&[&["plan", "--pddl", &lift, &problem][..], &flags].concat())
    };
    let output = run("p.pddl");
    assert_eq!(output.status.code(), Some(0));
    let plan: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (&plan["cost"], &plan["optimal"]),
        (&json!(4.0), &json!(true))
    );
    assert_eq!(plan["steps"][1]["binding"], json!({"a": "b", "b": "c"}));
    let written = fs::read_to_string(&plan_file).unwrap();
    assert_eq!(written, "(up a b)\n(up b c)\n; cost = 4 (general cost)\n");
    let output = run("bad.pddl");
    assert_eq!(output.status.code(), Some(2));
    let words = String::from_utf8(output.stderr).unwrap();
    assert!(
        words.contains("bad.pddl:2") && words.contains("did you mean `at`?"),
        "{words}"
    );
}

#[test]
fn what_is_written_in_pddl_has_the_same_best_plan() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (texts, plan_file) = (path("pddl"), path("plan"));
    let flags = [
        "--optimal",
        "--write-pddl",
        &texts,
        "--plan-file",
        &plan_file,
    ];
    let goal = "{ r:robot \"room4\":room r->\"room4\"(in) }";
    let (code, planned) = json(RULES, &row(3, true), goal, &flags);
    assert_eq!(code, 0, "{planned}");
    let [domain, problem] = ["domain", "problem"].map(|name| path(&format!("pddl/{name}.pddl")));
    let output = Program::run(&["plan", "--pddl", &domain, &problem, "--optimal", "--json"]);
    let again: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (&again["status"], &again["cost"]),
        (&json!("solved"), &planned["cost"])
    );
    let rules: Vec<String> = again["steps"]
        .as_array()
        .unwrap()
        .iter()
        .map(|step| format!("({})", step["rule"].as_str().unwrap()))
        .collect();
    let written = fs::read_to_string(&plan_file).unwrap();
    assert_eq!(written.lines().take(rules.len()).collect::<Vec<_>>(), rules);
}
