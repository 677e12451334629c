//! Rules that change while a system runs: they reach the store, the executive and its planner, and
//! bad ones change nothing.

use crate::support::{Program, TestInstance};
use crate::tree::root;
use dsr::{Filter, Session, Snapshot};
use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_mins(1);
const LOOK: Duration = Duration::from_millis(200);

/// A process of the system, ended with the test.
struct Member(Child);

impl Member {
    fn start(arguments: &[&str]) -> Self {
        let mut command = Program::command(arguments);
        command
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        Self(command.spawn().unwrap())
    }
}

impl Drop for Member {
    fn drop(&mut self) {
        if let Some(pid) = Pid::from_raw(self.0.id().cast_signed()) {
            let _ = kill_process(pid, Signal::TERM);
        }
        drop(self.0.wait());
    }
}

/// The care centre with other rules and a mission of its own.
fn scenario(folder: &Path, rules: &str, goal: &str) {
    let care = root().join("scenarios/care-centre");
    for file in ["scenario.toml", "schedule.toml"] {
        fs::copy(care.join(file), folder.join(file)).unwrap();
    }
    fs::write(folder.join("rules.aggl"), rules).unwrap();
    fs::create_dir(folder.join("missions")).unwrap();
    fs::write(folder.join("missions/invite.aggt"), goal).unwrap();
}

/// A store, an executive and a world, and a session with the store.
fn start(folder: &Path, instance: &TestInstance) -> ([Member; 3], Session) {
    let common = [
        "--scenario",
        folder.to_str().unwrap(),
        "--instance",
        instance.name(),
    ];
    let store = Member::start(&[&["store"], &common[..]].concat());
    let session = Session::attach(&instance.0, "watch", PATIENCE).unwrap();
    let executive = Member::start(&[&["agent", "executive"], &common[..]].concat());
    // Slow, so that the executive does not lose its patience before the rule comes.
    let world = Member::start(&[&["agent", "world", "--speed", "0.2"], &common[..]].concat());
    ([store, executive, world], session)
}

/// The texts of an attribute of all nodes of a type.
fn texts(snapshot: &Snapshot, type_name: &str, attribute: &str) -> Vec<String> {
    let nodes = snapshot.nodes().map(Result::unwrap);
    let nodes = nodes.filter(|node| node.type_name() == type_name);
    nodes
        .filter_map(|node| node.value(attribute).unwrap())
        .map(|value| value.as_str().unwrap().to_owned())
        .collect()
}

fn until(session: &mut Session, what: &str, holds: impl Fn(&Snapshot) -> bool) {
    let mut changes = session.changes(Filter::default()).unwrap();
    let rounds = (PATIENCE.as_millis() / LOOK.as_millis()) as usize;
    for round in 0.. {
        if holds(&session.snapshot().unwrap()) {
            break;
        }
        assert!(round < rounds, "{what} never came");
        changes.wait(LOOK).unwrap();
        let schema = session.snapshot().unwrap().schema().clone();
        while changes.next(&schema).unwrap().is_some() {}
    }
}

/// Until a mission runs and has said why it has no plan.
fn until_no_plan(session: &mut Session) {
    until(session, "a mission without a plan", |snapshot| {
        texts(snapshot, "mission", "status").contains(&"running".to_owned())
            && !texts(snapshot, "mission", "reason").concat().is_empty()
    });
}

#[test]
fn a_mission_uses_a_rule_that_was_loaded_later_and_a_bad_grammar_changes_nothing() {
    let instance = TestInstance::new("live-rules");
    let folder = tempfile::tempdir().unwrap();
    let care = fs::read_to_string(root().join("scenarios/care-centre/rules.aggl")).unwrap();
    // Without the way through doors there is no plan.
    let without = care
        .replace("changeRoom :", "passThrough :")
        .replace("passThrough : active", "passThrough : passive");
    scenario(
        folder.path(),
        &without,
        "{ \"robot\":robot \"kitchen\":room \"robot\"->\"kitchen\"(in) }\n",
    );
    let name = instance.name();
    let (_members, mut session) = start(folder.path(), &instance);
    until_no_plan(&mut session);
    assert_eq!(texts(&session.snapshot().unwrap(), "step", "rule"), [""; 0]);

    // A bad grammar is refused with all that is wrong with it.
    let bad = folder.path().join("bad.aggl");
    let broken = care
        .replace("robot->room2(in)", "robot->room3(in)")
        .replace("(at robot here)", "(att robot here)");
    fs::write(&bad, broken).unwrap();
    let rules_of = |snapshot: &Snapshot| texts(snapshot, "grammar", "rules").concat();
    let before = rules_of(&session.snapshot().unwrap());
    let load =
        |file: &Path| Program::run(&["rules", "load", file.to_str().unwrap(), "--instance", name]);
    let refused = load(&bad);
    assert_eq!(refused.status.code(), Some(2));
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(said.contains("no variable `room3`"), "{said}");
    assert!(
        said.contains("the schema has no label `att` (did you mean `at`?)"),
        "{said}"
    );
    // Neither does it get in beside the verb.
    let text = fs::read_to_string(&bad).unwrap();
    let refused = Program::run(&["graph", "set", "grammar.rules", &text, "--instance", name]);
    assert_eq!(refused.status.code(), Some(2));
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(said.contains("the rules are refused"), "{said}");
    assert_eq!(rules_of(&session.snapshot().unwrap()), before);
    assert!(before.contains("passThrough"));

    // The new rule reaches the planner ...
    let better = folder.path().join("better.aggl");
    fs::write(&better, &care).unwrap();
    let loaded = load(&better);
    let said = String::from_utf8(loaded.stderr).unwrap();
    assert_eq!(loaded.status.code(), Some(0), "{said}");
    until(&mut session, "a plan with the new rule", |snapshot| {
        texts(snapshot, "step", "rule").contains(&"changeRoom".to_owned())
            && texts(snapshot, "step", "status").contains(&"dispatched".to_owned())
    });
    // ... and the store, which applies it.
    let snapshot = session.snapshot().unwrap();
    let robot = snapshot.find_node_by_name("robot").unwrap().unwrap();
    let label = snapshot.schema().find_label("in").unwrap();
    let room = |snapshot: &Snapshot| {
        let robot = snapshot.find_node(robot.id()).unwrap().unwrap();
        let key = robot.out_edges_of(label).next().unwrap().unwrap();
        snapshot.find_node(key.to).unwrap().unwrap().name().unwrap()
    };
    let here = room(&snapshot);
    let file = better.to_str().unwrap();
    let apply = |rest: &[&str]| {
        let arguments = [
            "rules",
            "apply",
            file,
            "--rule",
            "changeRoom",
            "--instance",
            name,
        ];
        Program::run(&[&arguments[..], rest].concat())
    };
    assert_eq!(here, "entrance");
    let binding = ["--bind", "room1=entrance", "--bind", "room2=corridor"];
    let shown = apply(&[&binding[..], &["--dry-run", "--json"]].concat());
    let said = String::from_utf8(shown.stderr).unwrap();
    let shown: serde_json::Value = serde_json::from_slice(&shown.stdout).expect(&said);
    assert_eq!(
        (&shown["applicable"], &shown["committed"]),
        (&true.into(), &false.into())
    );
    assert_eq!(room(&session.snapshot().unwrap()), here);
    let applied = apply(&binding);
    assert_eq!(applied.status.code(), Some(0), "{applied:?}");
    assert_eq!(room(&session.snapshot().unwrap()), "corridor");
    // Where it does not hold any more, the answer is no.
    assert_eq!(apply(&binding).status.code(), Some(1));
}

#[test]
fn a_rule_that_one_agent_wakes_is_planned_with_by_another_until_it_is_put_to_sleep() {
    let instance = TestInstance::new("sleeping-rules");
    let folder = tempfile::tempdir().unwrap();
    let care = fs::read_to_string(root().join("scenarios/care-centre/rules.aggl")).unwrap();
    // Nobody plans with a passive rule, so that another process must apply it.
    let sleeping = care.replace("changeRoom : active", "dormant changeRoom : active")
        + "\nunlock : passive(1) activates(changeRoom) { { r:robot } => { r:robot } }\n";
    scenario(
        folder.path(),
        &sleeping,
        "{ \"robot\":robot \"kitchen\":room \"robot\"->\"kitchen\"(in) }\n",
    );
    let name = instance.name();
    let (_members, mut session) = start(folder.path(), &instance);
    until_no_plan(&mut session);
    let file = folder.path().join("rules.aggl");
    let file = file.to_str().unwrap();
    let apply = |rule: &str, binding: &[&str]| {
        let arguments = ["rules", "apply", file, "--rule", rule, "--instance", name];
        let output = Program::run(&[&arguments[..], binding].concat());
        let said = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8(said).unwrap())
    };
    let through = ["--bind", "room1=entrance", "--bind", "room2=corridor"];
    let (code, said) = apply("changeRoom", &through);
    assert!(code == Some(1) && said.contains("dormant"), "{said}");
    assert_eq!(texts(&session.snapshot().unwrap(), "step", "rule"), [""; 0]);

    // Woken by one process, it is used by the planner in another.
    let (code, said) = apply("unlock", &[]);
    assert_eq!(code, Some(0), "{said}");
    let awake = |snapshot: &Snapshot| texts(snapshot, "grammar", "awake").concat();
    assert_eq!(awake(&session.snapshot().unwrap()), "changeRoom ");
    until(&mut session, "a plan with the woken rule", |snapshot| {
        texts(snapshot, "step", "rule").contains(&"changeRoom".to_owned())
            && texts(snapshot, "step", "status").contains(&"dispatched".to_owned())
    });

    // Loading rules anew puts nothing to sleep that was woken ...
    fs::write(
        file,
        sleeping.replace("unlock : passive(1)", "unlock : passive(2)"),
    )
    .unwrap();
    let loaded = Program::run(&["rules", "load", file, "--instance", name]);
    assert_eq!(loaded.status.code(), Some(0), "{loaded:?}");
    let rules = texts(&session.snapshot().unwrap(), "grammar", "rules").concat();
    assert!(rules.contains("unlock : passive(2)"), "{rules}");
    assert_eq!(awake(&session.snapshot().unwrap()), "changeRoom ");
    // ... and taking its name out of the attribute does.
    let asleep = Program::run(&["graph", "set", "grammar.awake", "", "--instance", name]);
    assert_eq!(asleep.status.code(), Some(0), "{asleep:?}");
    let (code, said) = apply("changeRoom", &through);
    assert!(code == Some(1) && said.contains("dormant"), "{said}");
}
