//! `cortex mission` on a live run: what is submitted is carried out, what is more important comes
//! first, and what is paused waits.

use crate::examples::blocks;
use crate::support::{Program, Run, within};
use serde_json::Value;
use std::fs;
use std::time::Duration;

const CARE_CENTRE: &str = "scenarios/care-centre";
const GOAL: &str = r#"{ "robot":robot "corridor":room "robot"->"corridor"(in) }"#;

/// How long the executive and the robot may take.
const PATIENCE: Duration = Duration::from_mins(2);

/// Exit code, standard output and standard error of `cortex mission ... --instance I`.
fn mission(instance: &str, arguments: &[&str]) -> (i32, String, String) {
    let words = [&["mission"], arguments, &["--instance", instance]].concat();
    let output = Program::run(&words);
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let code = output.status.code().unwrap();
    (code, text(output.stdout), text(output.stderr))
}

/// Asks for the reasons of what `to_the_corridor` did.
fn why(instance: &str) {
    let ask = |what: &str| {
        let output = Program::run(&["why", what, "--json", "--instance", instance]);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        let code = output.status.code().unwrap();
        let told: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
        (code, told, error)
    };
    let (code, told, error) = ask("to_the_corridor");
    assert_eq!((code, &told["kind"]), (0, &"mission".into()), "{error}");
    let decisions = told["decisions"].as_array().unwrap();
    let named = |what: &str| decisions.iter().any(|decision| decision["what"] == what);
    assert!(named("plan 1") && named("succeeded"), "{told}");

    let (_, shown, _) = mission(instance, &["show", "to_the_corridor", "--json"]);
    let shown: Value = serde_json::from_str(&shown).unwrap();
    let steps = shown["steps"].as_array().unwrap();
    let done = steps.iter().rfind(|step| step["status"] == "done").unwrap();
    let (code, step, error) = ask(done["name"].as_str().unwrap());
    assert_eq!((code, &step["kind"]), (0, &"step".into()), "{error}");
    assert_eq!(step["rule"], done["rule"]);
    assert_eq!(step["plan"]["what"], "plan 1");
    assert_eq!(step["planned"]["agent"], "executive");
    let purpose = &step["purpose"][0];
    assert_eq!(purpose["link"], "robot -in-> corridor");
    assert!(
        purpose["step"].is_null(),
        "the goal itself asks for it: {step}"
    );

    let left = format!("robot-in->{}", done["binding"]["room1"].as_str().unwrap());
    let (code, told, error) = ask(&left);
    assert_eq!((code, &told["kind"]), (0, &"edge".into()), "{error}");
    assert_eq!(told["removed"]["agent"], "navigation", "{told}");
    let status = format!("{}.status", done["name"].as_str().unwrap());
    let (_, told, error) = ask(&status);
    assert_eq!(told["value"], "done", "{error}");
    assert!(told["written"]["version"].is_u64(), "{told}");
    let (code, _, error) = ask("robot.batery");
    assert_eq!(code, 2);
    assert!(
        error.contains("`battery`") || error.contains("batery"),
        "{error}"
    );
    let output = Program::run(&["why", "--instance", instance]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(
        text.contains("mission invite is ") && text.contains("plan 1"),
        "{text}"
    );
}

#[test]
fn missions_are_submitted_paused_resumed_and_cancelled_while_a_run_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let goal = file("to_the_corridor.aggt", GOAL);
    let wrong = file("wrong.aggt", &GOAL.replace(":room", ":rooom"));
    let arguments = [CARE_CENTRE, "--no-baseline", "--speed", "3"];
    let mut run = Run::new("missions", &arguments).start();
    run.until("mission invite is running");
    let instance = run.instance_name().to_owned();

    // Behind the one that runs.
    let submit = ["submit", &goal, "--name", "later", "--priority", "-1"];
    assert_eq!(mission(&instance, &submit).0, 0);
    let (code, out, err) = mission(&instance, &["cancel", "later"]);
    assert_eq!(
        (code, out.as_str()),
        (0, "mission later is cancelled\n"),
        "{err}"
    );
    let (code, out, _) = mission(&instance, &["cancel", "later"]);
    assert_eq!(code, 1);
    assert_eq!(out, "nothing to cancel: mission later is cancelled\n");

    let (code, out, err) = mission(&instance, &["pause", "invite"]);
    assert_eq!(
        (code, out.as_str()),
        (0, "mission invite is paused\n"),
        "{err}"
    );
    let (code, out, _) = mission(&instance, &["pause", "invite"]);
    assert_eq!(code, 1);
    assert_eq!(out, "nothing to pause: mission invite is paused\n");

    let (code, _, err) = mission(&instance, &["submit", &wrong]);
    assert_eq!(code, 2);
    assert!(
        err.contains("wrong.aggt:1:") && err.contains("`room`"),
        "{err}"
    );
    let taken = ["submit", &goal, "--name", "corridor"];
    let (code, _, err) = mission(&instance, &taken);
    assert_eq!(code, 2);
    assert!(err.contains("give the mission another name"), "{err}");
    let (code, _, err) = mission(&instance, &["cancel", "invte"]);
    assert_eq!(code, 2);
    assert!(err.contains("did you mean `invite`?"), "{err}");

    let submit = ["submit", &goal, "--priority", "5", "--wait", "--json"];
    let (code, out, err) = mission(&instance, &submit);
    let submitted: Value = serde_json::from_str(&out).unwrap_or_default();
    assert_eq!(code, 0, "{out}{err}");
    assert_eq!(submitted["status"], "succeeded");

    let (_, out, _) = mission(&instance, &["list", "--json"]);
    let listed: Value = serde_json::from_str(&out).unwrap();
    let named = |name: &str| {
        let all = listed.as_array().unwrap();
        all.iter().find(|one| one["name"] == name).unwrap()
    };
    assert_eq!(named("invite")["status"], "paused");
    assert_eq!(named("to_the_corridor")["priority"], 5);
    assert_eq!(named("later")["status"], "cancelled");

    let (code, out, _) = mission(&instance, &["resume", "invite"]);
    assert_eq!(code, 0);
    // It has the robot again as soon as the executive has taken its next turn.
    let resumed = ["mission invite is queued\n", "mission invite is running\n"];
    assert!(resumed.contains(&out.as_str()), "{out}");
    why(&instance);
    let (_, out, _) = mission(&instance, &["show", "invite"]);
    assert!(
        out.starts_with("invite  ") && out.contains("gives way at_once"),
        "{out}"
    );
    run.until("mission invite is succeeded");
    run.wait_until_no_process_is_left();
}

#[test]
fn the_mission_of_the_tutorial_is_carried_out_with_a_carer_at_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let [_, _, rules, goal] = &blocks("your-own-mission", "aggl")[..] else {
        panic!("the tutorial has other blocks");
    };
    file(
        "rules.aggl",
        &crate::tree::read("scenarios/care-centre/rules.aggl"),
    );
    let rules = file("round.aggl", rules);
    let goal = file("call.aggt", goal);
    let round = file("round.toml", &blocks("your-own-mission", "toml")[0]);
    let arguments = [CARE_CENTRE, "--no-baseline", "--speed", "3"];
    let mut run = Run::new("tutorial", &arguments).start();
    run.until("mission invite is running");
    let instance = run.instance_name().to_owned();

    let wrong = fs::read_to_string(&round).unwrap();
    let wrong = wrong
        .replace("18:00", "8 pm")
        .replace("after = \"call\"", "after = \"invit\"");
    let wrong = file("wrong.toml", &wrong.replacen("call.aggt", "cal.aggt", 1));
    let (code, _, error) = mission(&instance, &["submit", &wrong]);
    assert_eq!(code, 2);
    for said in [
        "3 problems",
        "`8 pm` is not",
        "cannot read `cal.aggt`",
        "did you mean `invite`?",
    ] {
        assert!(error.contains(said), "{error}");
    }
    let (code, _, error) = mission(&instance, &["submit", &round]);
    assert_eq!(code, 0, "{error}");
    let planned = Program::run(&["plan", &goal, "--json", "--instance", &instance]);
    let planned: Value = serde_json::from_slice(&planned.stdout).unwrap();
    assert_eq!(planned["status"], "solved", "{planned}");

    let shown = |name: &str| -> Value {
        let (_, out, _) = mission(&instance, &["show", name, "--json"]);
        serde_json::from_str(&out).unwrap()
    };
    assert!(shown("evening_call")["begins"].as_f64().unwrap() > 0.0);
    let status = "dispatched";
    let called = within(PATIENCE, || {
        let call = shown("call");
        let mut steps = call["steps"].as_array()?.iter();
        let step = steps.find(|step| step["rule"] == "callOver" && step["status"] == status)?;
        Some(step["binding"]["person"].as_str()?.to_owned())
    });
    let called = called.expect("a step for the carer");
    let person = format!("person={called}");
    let apply = [
        "rules",
        "apply",
        &rules,
        "--rule",
        "callOver",
        "--instance",
        &instance,
    ];
    let applied = Program::run(&[&apply[..], &["--bind", &person]].concat());
    let error = String::from_utf8_lossy(&applied.stderr);
    assert!(applied.status.success(), "{error}");
    run.until("mission call is succeeded");
    let why = Program::run(&["why", "call", "--instance", &instance]);
    let why = String::from_utf8(why.stdout).unwrap();
    assert!(why.contains("succeeded: the goal holds"), "{why}");
    assert_eq!(shown("evening_call")["status"], "queued");
    let waits = shown("evening_call")["waits_for"][0].clone();
    let until = waits.as_str().unwrap();
    assert!(
        until.starts_with("until ") && until.ends_with(" 18:00:00"),
        "{until}"
    );
    run.interrupt();
    run.wait_until_no_process_is_left();
}
