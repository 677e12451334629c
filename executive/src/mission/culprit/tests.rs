//! Decisions and the commits that gave occasion to them.

use crate::mission::testing::{Agent, GO_TO_WARD, GREET_ANA, House};
use expect_test::expect;

#[test]
fn the_commit_that_closed_a_door_is_named_whatever_came_after_it() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.agent = Agent::Hangs;
    house.run(3);
    let before = house.graph.snapshot().version().0;
    house.change(|transaction| transaction.set("ana", "status", "awake"));
    house.close("kitchen", "ward");
    for mood in ["glad", "sad", "glad"] {
        house.change(|transaction| transaction.set("ana", "status", mood));
    }
    house.run(1);
    let decisions = house.decisions("greet");
    let last = decisions.last().unwrap();
    let cause = last.cause.as_ref().unwrap();
    assert_eq!(
        (cause.version.0, cause.agent.as_str()),
        (before + 2, "world")
    );
    assert_eq!(last.what, "plan 2");
    expect![
        "`changeRoom` will not be possible: room1 (kitchen) has no link `connected` to room2 (ward)"
    ]
    .assert_eq(&last.why);
    assert_eq!(
        (decisions[0].what.as_str(), &decisions[0].cause),
        ("plan 1", &None)
    );
}

#[test]
fn a_door_that_was_open_again_in_between_is_blamed_on_the_last_commit_that_closed_it() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.agent = Agent::Hangs;
    house.run(3);
    house.close("kitchen", "ward");
    house.change(|transaction| transaction.create_edge("kitchen", "connected", "ward"));
    house.change(|transaction| transaction.delete_edge("kitchen", "connected", "ward"));
    let closed = house.graph.snapshot().version();
    house.change(|transaction| transaction.set("ana", "status", "awake"));
    house.run(1);
    let decisions = house.decisions("greet");
    let cause = decisions.last().unwrap().cause.clone().unwrap();
    assert_eq!(cause.version, closed);
}

#[test]
fn a_rule_that_came_in_the_way_is_told_with_its_nodes() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0)]);
    house.agent = Agent::Hangs;
    house.run(3);
    house.change(|transaction| {
        let binding = [("robot", "shelly"), ("room1", "hall"), ("room2", "garden")];
        let binding = binding.map(|(variable, node)| (variable.to_owned(), node.into()));
        transaction.apply_rule("changeRoom", binding.to_vec());
    });
    house.run(1);
    let cause = house.decisions("go").last().unwrap().cause.clone().unwrap();
    assert_eq!(
        cause.rules,
        ["changeRoom(robot=shelly, room1=hall, room2=garden)"]
    );
}

#[test]
fn a_step_that_its_agent_failed_is_that_agents_commit() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0)]);
    house.agent = Agent::FailsAt("changeRoom");
    house.run(3);
    let failed = house.graph.snapshot().version();
    house.run(1);
    let cause = house.decisions("go").last().unwrap().cause.clone().unwrap();
    assert_eq!(
        (cause.version, cause.agent.as_str()),
        (failed, "navigation")
    );
}

#[test]
fn what_only_the_clock_brought_about_has_no_commit() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0)]);
    house.agent = Agent::Silent;
    house.run(43);
    let decisions = house.decisions("go");
    let last = decisions.last().unwrap();
    assert!(
        last.why.ends_with("did not take it in 20 s"),
        "{}",
        last.why
    );
    assert_eq!(last.cause, None);
}

#[test]
fn the_oldest_decisions_go_first() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0)]);
    house.agent = Agent::Hangs;
    house.run(3);
    for _ in 0..40 {
        house.close("kitchen", "ward");
        house.run(2);
        house.change(|transaction| {
            transaction.create_edge("kitchen", "connected", "ward");
            transaction.create_edge("ward", "connected", "kitchen");
        });
        house.close("garden", "ward");
        house.run(2);
        house.change(|transaction| {
            transaction.create_edge("garden", "connected", "ward");
            transaction.create_edge("ward", "connected", "garden");
        });
    }
    let decisions = house.decisions("go");
    assert_eq!(decisions.len(), 30);
    assert!(decisions.is_sorted_by(|one, other| one.time <= other.time));
}
