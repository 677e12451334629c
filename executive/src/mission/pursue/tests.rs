//! Which commits concern the plan in force, and which of its steps are left out.

use crate::mission::testing::{Agent, GO_TO_WARD, GREET_ANA, House};
use expect_test::expect;

#[test]
fn what_a_later_step_starts_from_already_is_not_brought_about_again() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.agent = Agent::Hangs;
    house.run(3);
    // Somebody carries the robot to the ward.
    house.change(|transaction| {
        transaction.delete_edge("shelly", "in", "hall");
        transaction.create_edge("shelly", "in", "ward");
    });
    house.run(1);
    expect![[r"
        greet/1/0 changeRoom(shelly, hall, kitchen) dropped: approach(p=ana, robot=shelly, room=ward) is possible already
        greet/1/1 changeRoom(shelly, kitchen, ward) dropped: approach(p=ana, robot=shelly, room=ward) is possible already
        greet/1/2 approach(ana, shelly, ward) running
        greet/1/3 takeTheAttention(ana, shelly) pending"]]
    .assert_eq(&house.steps());
    house.agent = Agent::Works;
    house.run(6);
    expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("greet"));
    assert_eq!(house.planner.asked.get(), 1, "no plan was needed");
}

#[test]
fn a_step_that_the_goal_needs_is_not_left_out() {
    // The robot shall have been with ana and be in the hall: both rooms are on the way.
    let goal = r#"{ "ana":person "shelly":robot "hall":room
        "ana"->"shelly"(front) "shelly"->"hall"(in) }"#;
    let mut house = House::new(&[("greet", goal, 0)]);
    house.run(20);
    expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("greet"));
    assert!(
        !house.steps().contains("possible already"),
        "{}",
        house.steps()
    );
}

/// Whether the executive takes the last commit to concern it, and how many transactions its next
/// turn makes.
fn after(change: impl FnOnce(&mut dsr::Transaction)) -> (bool, usize) {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.agent = Agent::Hangs;
    house.run(3);
    let change = house.change(change);
    let snapshot = house.graph.snapshot();
    let concerns = house.executive.concerns(&change, snapshot.schema());
    (concerns, house.turn())
}

#[test]
fn what_does_not_matter_concerns_nobody() {
    assert_eq!(after(|t| t.set("ana", "status", "awake")), (false, 0));
    assert_eq!(
        after(|t| t.create_node("object", "cup", vec![])),
        (false, 0)
    );
    assert_eq!(
        after(|t| t.delete_edge("hall", "connected", "garden")),
        (false, 0)
    );
    let dearer = |t: &mut dsr::Transaction| {
        let door = dsr::EdgeRef::new("kitchen", "connected", "ward");
        t.set_on_edge(door, "distance", 90.0);
    };
    assert_eq!(after(dearer), (false, 0));
    let (concerns, transactions) = after(|t| t.delete_edge("kitchen", "connected", "ward"));
    assert!(concerns && transactions > 0);
    let (concerns, _) = after(|t| {
        t.create_node(
            "mission",
            "go",
            vec![("goal".to_owned(), GO_TO_WARD.into())],
        );
    });
    assert!(concerns);
}

#[test]
fn no_link_that_comes_or_goes_makes_a_decision_unless_it_concerns_the_plan() {
    let nodes = ["hall", "kitchen", "garden", "ward", "shelly", "ana"];
    let (mut quiet, mut loud) = (0, 0);
    for label in ["in", "connected", "is_near", "front", "at"] {
        for (from, to) in nodes.iter().flat_map(|a| nodes.map(|b| (*a, b))) {
            let mut house = House::new(&[("greet", GREET_ANA, 0)]);
            house.agent = Agent::Hangs;
            house.run(3);
            let there = house.holds(from, label, to);
            let change = house.try_change(|transaction| {
                if there {
                    transaction.delete_edge(from, label, to);
                } else {
                    transaction.create_edge(from, label, to);
                }
            });
            let Some(change) = change else {
                continue;
            };
            let snapshot = house.graph.snapshot();
            if house.executive.concerns(&change, snapshot.schema()) {
                loud += 1;
            } else {
                quiet += 1;
                assert_eq!(house.turn(), 0, "{from} {label} {to}");
            }
        }
    }
    assert!(quiet > 10 && loud > 3, "{quiet} quiet, {loud} loud");
}
