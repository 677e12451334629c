//! `cortex mission` on a live run: what is submitted is carried out, what is more important comes
//! first, and what is paused waits.

use crate::support::{Program, Run};
use serde_json::Value;
use std::fs;

const CARE_CENTRE: &str = "scenarios/care-centre";
const GOAL: &str = r#"{ "robot":robot "corridor":room "robot"->"corridor"(in) }"#;

/// Exit code, standard output and standard error of `cortex mission ... --instance I`.
fn mission(instance: &str, arguments: &[&str]) -> (i32, String, String) {
    let words = [&["mission"], arguments, &["--instance", instance]].concat();
    let output = Program::run(&words);
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let code = output.status.code().unwrap();
    (code, text(output.stdout), text(output.stderr))
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

    let submit = ["submit", &goal, "--name", "later", "--priority", "-1"];
    assert_eq!(mission(&instance, &submit).0, 0);
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
    // Where the robot is by then, the goal of `later` holds as well: it may be over already.
    let (code, _, _) = mission(&instance, &["cancel", "later"]);
    assert!([0, 1].contains(&code));

    let (code, out, _) = mission(&instance, &["resume", "invite"]);
    assert_eq!(code, 0);
    // It has the robot again as soon as the executive has taken its next turn.
    let resumed = ["mission invite is queued\n", "mission invite is running\n"];
    assert!(resumed.contains(&out.as_str()), "{out}");
    let (_, out, _) = mission(&instance, &["show", "invite"]);
    assert!(
        out.starts_with("invite  ") && out.contains("gives way at_once"),
        "{out}"
    );
    run.until("mission invite is succeeded");
    run.wait_until_no_process_is_left();
}
