//! What the monitor makes of single steps, on graphs that are written out.

use super::{Finding, Monitor, Report};
use crate::mission::record::{Step, StepStatus};
use crate::testing::{add, goal, read};
use dsr::{Graph, Schema, Time, Transaction};
use expect_test::expect;

const RULES: &str = "name=cafe
===
pour : active(1) agent(arm) duration(20)
{
	{ m:machine } => { m:machine c:cup m->c(holds) }
}
serve : active(1) agent(arm)
{
	{ m:machine c:cup p:person m->c(holds) } => { m:machine c:cup p:person p->c(has) }
	precondition { (not (exists r:robot (blocks r m))) }
}
call : active(1) agent(voice)
{
	{ p:person } => { p:person } effect { (assign p.calls 1) }
}
wipe : active(1) agent(arm)
{
	{ m:machine c:cup m->c(holds) } => { m:machine } effect { (clean m m) }
}
";

const GOAL: &str = r#"{ "ana":person c:cup "ana"->c(has) }"#;

fn cafe() -> Graph {
    let mut graph = Graph::in_memory(Schema::open());
    add(
        &mut graph,
        &[
            ("machine", "gaggia"),
            ("person", "ana"),
            ("robot", "shelly"),
        ],
        &[],
    );
    graph
}

fn step(rule: &str, status: StepStatus, binding: &[(&str, &str)]) -> Step {
    Step {
        id: None,
        name: String::new(),
        index: 0,
        rule: rule.to_owned(),
        agent: String::new(),
        binding: binding
            .iter()
            .map(|&(v, node)| (v.to_owned(), node.to_owned()))
            .collect(),
        status,
        since: Time::from_seconds(100.0),
        reason: String::new(),
    }
}

/// The report at a time, seconds after the steps got their status.
fn judge(graph: &Graph, after: f64, steps: &[Step]) -> Report {
    let grammar = read(RULES);
    let goal = goal(&grammar, GOAL);
    let now = Time::from_seconds(100.0 + after);
    Monitor::new(&grammar)
        .judge(&grammar, &graph.snapshot(), now, steps, &goal)
        .unwrap()
}

const WELL: Finding = Finding::Sound {
    dispatch: None,
    ahead: None,
};
const POUR: (&str, StepStatus, &[(&str, &str)]) = ("pour", StepStatus::Running, &[("m", "gaggia")]);
const SERVE: (&str, StepStatus, &[(&str, &str)]) = (
    "serve",
    StepStatus::Pending,
    &[("m", "gaggia"), ("p", "ana")],
);

fn pour_and_serve() -> [Step; 2] {
    [POUR, SERVE].map(|(rule, status, binding)| step(rule, status, binding))
}

#[test]
fn what_makes_nodes_or_sets_attributes_is_over_only_when_its_agent_says_so() {
    let mut graph = cafe();
    add(
        &mut graph,
        &[("cup", "cup_1")],
        &[("gaggia", "holds", "cup_1")],
    );
    let call = step("call", StepStatus::Running, &[("p", "ana")]);
    for step in [call, pour_and_serve()[0].clone()] {
        assert_eq!(judge(&graph, 1.0, &[step]).over, 0);
    }
}

#[test]
fn a_node_that_is_to_go_and_a_link_from_an_effect_are_looked_for() {
    let mut graph = cafe();
    add(
        &mut graph,
        &[("cup", "cup_1")],
        &[("gaggia", "holds", "cup_1")],
    );
    let wipe = [step(
        "wipe",
        StepStatus::Running,
        &[("m", "gaggia"), ("c", "cup_1")],
    )];
    assert_eq!(judge(&graph, 1.0, &wipe).over, 0);
    add(&mut graph, &[], &[("gaggia", "clean", "gaggia")]);
    assert_eq!(judge(&graph, 1.0, &wipe).over, 0);
    let mut transaction = Transaction::new();
    transaction.delete_node("cup_1");
    graph.commit(&transaction, "test", Time::default()).unwrap();
    assert_eq!(
        judge(&graph, 1.0, &wipe),
        Report {
            over: 1,
            next: Finding::Finished
        }
    );
}

#[test]
fn a_node_made_by_an_earlier_step_is_chosen_when_its_turn_comes() {
    let mut graph = cafe();
    let serve = &pour_and_serve()[1..];
    expect![[
        r#"Broken("left-hand side of `serve` does not hold: nothing in the graph matches it")"#
    ]]
    .assert_eq(&format!("{:?}", judge(&graph, 1.0, serve).next));
    add(
        &mut graph,
        &[("cup", "cup_1")],
        &[("gaggia", "holds", "cup_1")],
    );
    expect![[
        r#"Sound { dispatch: Some({"c": "cup_1", "m": "gaggia", "p": "ana"}), ahead: None }"#
    ]]
    .assert_eq(&format!("{:?}", judge(&graph, 1.0, serve).next));
}

#[test]
fn what_later_steps_need_and_no_earlier_one_changes_is_watched() {
    let mut graph = cafe();
    let steps = pour_and_serve();
    assert_eq!(judge(&graph, 1.0, &steps).next, WELL);
    add(&mut graph, &[], &[("shelly", "blocks", "gaggia")]);
    expect![[r#"Sound { dispatch: None, ahead: Some("`serve` will not be possible: (exists r:robot (blocks r m)) holds, which must not be") }"#]]
        .assert_eq(&format!("{:?}", judge(&graph, 1.0, &steps).next));
    let mut transaction = Transaction::new();
    transaction.delete_node("ana");
    graph.commit(&transaction, "test", Time::default()).unwrap();
    expect![[r#"Sound { dispatch: None, ahead: Some("`serve` needs p (ana), which is not in the graph") }"#]].assert_eq(&format!("{:?}", judge(&graph, 1.0, &steps).next));
}

#[test]
fn a_plan_that_misses_the_goal_is_noticed() {
    let graph = cafe();
    let pour = &pour_and_serve()[..1];
    // Nodes are made, so the goal's cup may be any: nothing can be said against it.
    assert_eq!(judge(&graph, 1.0, pour).next, WELL);
    let call = [step("call", StepStatus::Running, &[("p", "ana")])];
    expect![[r#"Sound { dispatch: None, ahead: Some("the plan will not reach the goal: nothing in the graph matches the goal") }"#]].assert_eq(&format!("{:?}", judge(&graph, 1.0, &call).next));
}

#[test]
fn a_step_is_given_four_times_its_duration_or_two_minutes() {
    let graph = cafe();
    let pour = &pour_and_serve()[..1];
    let call = [step("call", StepStatus::Dispatched, &[("p", "ana")])];
    for (steps, limit) in [(pour, 80.0), (&call[..], 120.0)] {
        let late = judge(&graph, limit + 0.1, steps).next;
        assert_eq!(late, Finding::TimedOut(limit));
        assert!(!matches!(
            judge(&graph, limit - 0.1, steps).next,
            Finding::TimedOut(_)
        ));
    }
}
