//! Missions that are asked to wait or end, that are late, and that give way.

use crate::mission::testing::{Agent, GO_TO_WARD, GREET_ANA, House};
use crate::{MissionSpec, Preemption, Schedule};
use dsr::Value;
use expect_test::expect;

/// A goal that the robot can reach while it hangs in another mission.
const GO_TO_KITCHEN: &str = r#"{ "shelly":robot "kitchen":room "shelly"->"kitchen"(in) }"#;

fn ask(house: &mut House, mission: &str, request: &str) {
    house.change(|transaction| transaction.set(mission, "request", request));
}

#[test]
fn a_paused_mission_drops_its_step_and_goes_on_when_it_is_resumed() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0)]);
    house.run(2);
    ask(&mut house, "go", "pause");
    house.run(5);
    expect!["paused, 0: paused on request"].assert_eq(&house.mission("go"));
    expect![[r"
        go/1/0 changeRoom(shelly, hall, kitchen) dropped: paused on request
        go/1/1 changeRoom(shelly, kitchen, ward) dropped: paused on request"]]
    .assert_eq(&house.steps());
    let asked = house.planner.asked.get();
    ask(&mut house, "go", "resume");
    house.run(12);
    expect!["succeeded, 1: the goal holds"].assert_eq(&house.mission("go"));
    assert_eq!(house.planner.asked.get(), asked + 1);
}

#[test]
fn a_cancelled_mission_is_over_and_the_next_one_begins() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0), ("greet", GREET_ANA, 0)]);
    house.agent = Agent::Hangs;
    house.run(3);
    ask(&mut house, "go", "cancel");
    house.agent = Agent::Works;
    house.run(14);
    expect!["cancelled, 0: cancelled on request"].assert_eq(&house.mission("go"));
    expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("greet"));
    ask(&mut house, "go", "resume");
    assert_eq!(house.turn(), 1, "what makes no sense is struck out");
    expect!["cancelled, 0: cancelled on request"].assert_eq(&house.mission("go"));
    assert_eq!(house.turn(), 0);
}

#[test]
fn a_mission_fails_at_its_deadline_and_the_earlier_one_goes_first() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0), ("greet", GREET_ANA, 0)]);
    house.agent = Agent::Hangs;
    house.turn();
    let soon = house.now.seconds() + 3.0;
    house.change(|transaction| transaction.set("greet", "deadline", Value::F64(soon)));
    house.run(2);
    expect!["queued, 0: "].assert_eq(&house.mission("go"));
    expect!["running, 0: "].assert_eq(&house.mission("greet"));
    house.run(6);
    expect!["failed, 0: its deadline passed while changeRoom(robot=shelly, room1=hall, room2=kitchen) was running"].assert_eq(&house.mission("greet"));
    expect!["running, 0: "].assert_eq(&house.mission("go"));
}

/// A mission `urgent` comes while `go` is in the middle of a step; how both stand two turns later,
/// and when all has been done.
fn preempted(preemption: Preemption) -> Vec<String> {
    let mut house = House::new(&[("go", GO_TO_WARD, 0)]);
    house.agent = Agent::Hangs;
    house.turn();
    let name = preemption.name();
    house.change(|transaction| transaction.set("go", "preemption", name));
    house.run(3);
    let urgent = MissionSpec {
        name: "urgent".to_owned(),
        goal: GO_TO_KITCHEN.to_owned(),
        priority: 1,
        deadline: None,
        preemption: Preemption::Never,
        schedule: Schedule::default(),
    };
    house.change(|transaction| {
        transaction.create_node("mission", "urgent", urgent.attributes());
    });
    house.run(2);
    let mut told = vec![house.mission("go"), house.mission("urgent")];
    house.agent = Agent::Works;
    house.run(16);
    told.extend([house.mission("go"), house.mission("urgent")]);
    told
}

#[test]
fn a_mission_gives_way_at_once_between_steps_or_never() {
    expect![[r#"
        [
            "queued, 0: mission `urgent` comes first",
            "running, 0: ",
            "succeeded, 1: the goal holds",
            "succeeded, 0: the goal holds",
        ]
    "#]]
    .assert_debug_eq(&preempted(Preemption::AtOnce));
    expect![[r#"
        [
            "running, 0: ",
            "queued, 0: ",
            "succeeded, 1: the goal holds",
            "succeeded, 0: the goal holds",
        ]
    "#]]
    .assert_debug_eq(&preempted(Preemption::BetweenSteps));
    expect![[r#"
        [
            "running, 0: ",
            "queued, 0: ",
            "succeeded, 0: the goal holds",
            "succeeded, 0: the goal holds",
        ]
    "#]]
    .assert_debug_eq(&preempted(Preemption::Never));
}

#[test]
fn a_mission_that_is_cancelled_while_it_is_planned_is_over_in_the_next_turn() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0)]);
    house.turn();
    let planned = house.planner.asked.get();
    let snapshot = house.graph.snapshot();
    let decided = house
        .executive
        .step_unless(house.now, &snapshot, &|| true)
        .unwrap();
    for transaction in &decided {
        let committed = house.graph.commit(transaction, "executive", house.now);
        committed.unwrap();
    }
    assert_eq!(house.planner.asked.get(), planned + 1);
    expect!["running, 0: "].assert_eq(&house.mission("go"));
    expect![""].assert_eq(&house.steps());
    ask(&mut house, "go", "cancel");
    house.turn();
    expect!["cancelled, 0: cancelled on request"].assert_eq(&house.mission("go"));
    assert_eq!(house.planner.asked.get(), planned + 1);
}

#[test]
fn a_mission_whose_planning_was_interrupted_is_planned_in_the_next_turn() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0)]);
    house.turn();
    let snapshot = house.graph.snapshot();
    let decided = house.executive.step_unless(house.now, &snapshot, &|| true);
    assert!(house.steps().is_empty() && decided.is_ok());
    house.run(12);
    expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("go"));
}
