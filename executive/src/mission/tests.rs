//! Missions in the house, from the first plan to the last step.

use super::testing::{Agent, GO_TO_WARD, GREET_ANA, House};
use crate::Config;
use expect_test::expect;

#[test]
fn a_plan_is_carried_out_to_the_end() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.run(12);
    assert!(house.holds("ana", "front", "shelly"));
    expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("greet"));
    expect![[r"
        greet/1/0 changeRoom(shelly, hall, kitchen) done
        greet/1/1 changeRoom(shelly, kitchen, ward) done
        greet/1/2 approach(ana, shelly, ward) done
        greet/1/3 takeTheAttention(ana, shelly) done"]]
    .assert_eq(&house.steps());
    expect![[r"
        mission `greet` is queued
        mission `greet` begins
        mission `greet` has plan 1: changeRoom(robot=shelly, room1=hall, room2=kitchen), changeRoom(robot=shelly, room1=kitchen, room2=ward), approach(p=ana, robot=shelly, room=ward), takeTheAttention(p=ana, robot=shelly)
        changeRoom(robot=shelly, room1=hall, room2=kitchen) is dispatched to navigation
        changeRoom(robot=shelly, room1=kitchen, room2=ward) is dispatched to navigation
        approach(p=ana, robot=shelly, room=ward) is dispatched to navigation
        takeTheAttention(p=ana, robot=shelly) is dispatched to navigation
        mission `greet` succeeded (the goal holds)"]].assert_eq(&house.journal.join("\n"));
    assert_eq!(house.turn(), 0, "what is over stays over");
    assert_eq!(house.planner.asked.get(), 1);
}

#[test]
fn an_unchanged_world_gives_no_transaction() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.agent = Agent::Hangs;
    house.run(4);
    for _ in 0..20 {
        assert_eq!(house.turn(), 0);
    }
    assert_eq!(house.planner.asked.get(), 1);
}

#[test]
fn a_mission_whose_goal_holds_needs_no_plan() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.change(|transaction| transaction.create_edge("ana", "front", "shelly"));
    house.run(2);
    expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("greet"));
    assert_eq!(
        (house.steps(), house.planner.asked.get()),
        (String::new(), 0)
    );
}

#[test]
fn a_door_closed_ahead_is_noticed_at_once_and_gone_around() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.run(2);
    house.close("kitchen", "ward");
    house.run(1);
    expect![[r"
        greet/1/0 changeRoom(shelly, hall, kitchen) dropped: `changeRoom` will not be possible: room1 (kitchen) has no link `connected` to room2 (ward)
        greet/1/1 changeRoom(shelly, kitchen, ward) dropped: `changeRoom` will not be possible: room1 (kitchen) has no link `connected` to room2 (ward)
        greet/1/2 approach(ana, shelly, ward) dropped: `changeRoom` will not be possible: room1 (kitchen) has no link `connected` to room2 (ward)
        greet/1/3 takeTheAttention(ana, shelly) dropped: `changeRoom` will not be possible: room1 (kitchen) has no link `connected` to room2 (ward)
        greet/2/4 changeRoom(shelly, hall, garden) running
        greet/2/5 changeRoom(shelly, garden, ward) pending
        greet/2/6 approach(ana, shelly, ward) pending
        greet/2/7 takeTheAttention(ana, shelly) pending"]].assert_eq(&house.steps());
    house.run(12);
    expect!["succeeded, 1: the goal holds"].assert_eq(&house.mission("greet"));
}

#[test]
fn a_surprise_that_leaves_the_first_step_as_it_is_does_not_interrupt_it() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.agent = Agent::Hangs;
    house.run(3);
    house.change(|transaction| {
        transaction.delete_edge("ana", "in", "ward");
        transaction.create_edge("ana", "in", "kitchen");
    });
    house.run(1);
    expect![[r"
        greet/1/1 changeRoom(shelly, kitchen, ward) dropped: `approach` will not be possible: p (ana) has no link `in` to room (ward)
        greet/1/2 approach(ana, shelly, ward) dropped: `approach` will not be possible: p (ana) has no link `in` to room (ward)
        greet/1/3 takeTheAttention(ana, shelly) dropped: `approach` will not be possible: p (ana) has no link `in` to room (ward)
        greet/1/0 changeRoom(shelly, hall, kitchen) running
        greet/2/5 approach(ana, shelly, kitchen) pending
        greet/2/6 takeTheAttention(ana, shelly) pending"]].assert_eq(&house.steps());
    expect!["running, 1: `approach` will not be possible: p (ana) has no link `in` to room (ward)"]
        .assert_eq(&house.mission("greet"));
    house.agent = Agent::Works;
    house.run(8);
    expect!["succeeded, 1: the goal holds"].assert_eq(&house.mission("greet"));
}

#[test]
fn without_another_plan_the_step_in_hand_goes_on() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.agent = Agent::Hangs;
    house.run(3);
    house.change(|transaction| transaction.delete_edge("ana", "in", "ward"));
    house.run(2);
    assert!(
        house
            .steps()
            .contains("greet/1/0 changeRoom(shelly, hall, kitchen) running")
    );
    expect!["running, 0: `approach` will not be possible: p (ana) has no link `in` to room (ward); no plan: ana -front-> shelly cannot be reached: rule `takeTheAttention` needs shelly -is_near-> ana; rule `approach` needs ana -in-> some room, which no rule brings about"].assert_eq(&house.mission("greet"));
    house.change(|transaction| transaction.create_edge("ana", "in", "ward"));
    house.run(1);
    expect!["running, 0: "].assert_eq(&house.mission("greet"));
    house.agent = Agent::Works;
    house.run(12);
    expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("greet"));
}

#[test]
fn whom_the_plan_aims_at_is_watched_though_the_goal_names_nobody() {
    let goal = r#"{ p:person "shelly":robot p->"shelly"(front) }
        precondition { (= p.status "awake") }"#;
    let mut house = House::new(&[("greet", goal, 0)]);
    house.change(|transaction| {
        transaction.create_node("person", "bob", vec![("status".to_owned(), "awake".into())]);
        transaction.create_edge("bob", "in", "ward");
        transaction.set("ana", "status", "awake");
    });
    house.agent = Agent::Hangs;
    house.run(3);
    assert!(
        house
            .steps()
            .contains("takeTheAttention(ana, shelly) pending")
    );
    house.change(|transaction| transaction.set("ana", "status", "asleep"));
    house.run(1);
    assert!(
        house
            .steps()
            .contains("takeTheAttention(bob, shelly) pending")
    );
    expect![[r#"running, 1: the plan will not reach the goal: (= p.status "awake") does not hold: p.status = "asleep""#]].assert_eq(&house.mission("greet"));
}

#[test]
fn what_the_robot_itself_brings_about_is_not_taken_for_somebody_elses() {
    // The robot comes to be in the ward, and so must whoever looks at it.
    let goal = r#"{ p:person "shelly":robot "ward":room
        p->"ward"(in) "shelly"->"ward"(in) p->"shelly"(front) }"#;
    let mut house = House::new(&[("greet", goal, 0)]);
    house.run(12);
    expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("greet"));
    assert_eq!(house.planner.asked.get(), 1);
}

#[test]
fn a_left_side_that_breaks_stops_the_step() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0)]);
    house.agent = Agent::Hangs;
    house.run(3);
    house.change(|transaction| {
        transaction.delete_edge("shelly", "in", "hall");
        transaction.create_edge("shelly", "in", "garden");
    });
    house.run(1);
    expect![[r"
        go/1/0 changeRoom(shelly, hall, kitchen) dropped: left-hand side of `changeRoom` no longer holds: robot (shelly) has no link `in` to room1 (hall)
        go/1/1 changeRoom(shelly, kitchen, ward) dropped: left-hand side of `changeRoom` no longer holds: robot (shelly) has no link `in` to room1 (hall)
        go/2/2 changeRoom(shelly, garden, ward) running"]].assert_eq(&house.steps());
    expect!["running, 1: left-hand side of `changeRoom` no longer holds: robot (shelly) has no link `in` to room1 (hall)"].assert_eq(&house.mission("go"));
}

#[test]
fn an_effect_that_somebody_else_brings_about_ends_the_step() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0)]);
    house.agent = Agent::Hangs;
    house.run(3);
    house.change(|transaction| {
        transaction.delete_edge("shelly", "in", "hall");
        transaction.create_edge("shelly", "in", "kitchen");
    });
    house.run(1);
    expect![[r"
        go/1/0 changeRoom(shelly, hall, kitchen) done: its effect holds
        go/1/1 changeRoom(shelly, kitchen, ward) running"]]
    .assert_eq(&house.steps());
    house.change(|transaction| {
        transaction.delete_edge("shelly", "in", "kitchen");
        transaction.create_edge("shelly", "in", "ward");
    });
    house.run(1);
    expect![[r"
        go/1/0 changeRoom(shelly, hall, kitchen) done: its effect holds
        go/1/1 changeRoom(shelly, kitchen, ward) done: its effect holds"]]
    .assert_eq(&house.steps());
    expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("go"));
}

#[test]
fn a_silent_agent_is_noticed_by_its_deadline_and_in_the_end_given_up() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0)]);
    house.agent = Agent::Silent;
    // `changeRoom` expects 5 s, so it is given 20 s.
    house.run(43);
    expect![[r"
        go/1/0 changeRoom(shelly, hall, kitchen) unanswered: navigation did not take it in 20 s
        go/1/1 changeRoom(shelly, kitchen, ward) dropped: changeRoom(robot=shelly, room1=hall, room2=kitchen) unanswered: navigation did not take it in 20 s
        go/2/2 changeRoom(shelly, hall, kitchen) dispatched
        go/2/3 changeRoom(shelly, kitchen, ward) pending"]].assert_eq(&house.steps());
    house.run(300);
    expect!["failed, 3: no plan: shelly -in-> ward cannot be reached; steps that failed lately were left out; agent navigation did not take 4 steps, the last of them changeRoom(robot=shelly, room1=hall, room2=kitchen)"].assert_eq(&house.mission("go"));
    assert_eq!(house.turn(), 0);
}

#[test]
fn an_agent_that_answers_after_long_is_at_work_again() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0)]);
    house.agent = Agent::Silent;
    // Three steps of 20 s are over: without another way it is asked a fourth time.
    house.run(130);
    assert!(house.mission("go").starts_with("running"));
    let experience = || {
        let rules = crate::testing::read(super::testing::RULES);
        let (_, raised) = crate::experience(&rules, &house.graph.snapshot()).unwrap();
        raised.len()
    };
    assert_eq!(experience(), 3, "another mission knows of all its rules");
    house.agent = Agent::Works;
    house.run(10);
    expect!["succeeded, 3: the goal holds"].assert_eq(&house.mission("go"));
}

#[test]
fn a_silent_agent_is_asked_after_a_pause_and_silence_hides_no_other_want() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0)]);
    house.agent = Agent::Silent;
    house.run(130);
    house.change(|transaction| transaction.set("go", "request", "pause"));
    house.run(200);
    house.change(|transaction| transaction.set("go", "request", "resume"));
    house.agent = Agent::Works;
    house.run(12);
    assert!(
        house.mission("go").starts_with("succeeded"),
        "{}",
        house.mission("go")
    );

    let mut shut = House::new(&[("go", GO_TO_WARD, 0)]);
    shut.agent = Agent::Silent;
    shut.run(130);
    for room in ["kitchen", "garden"] {
        shut.close(room, "ward");
    }
    shut.run(10);
    let waits = shut.mission("go");
    assert!(
        waits.starts_with("running") && waits.contains("no plan"),
        "{waits}"
    );
    for room in ["kitchen", "garden"] {
        shut.change(|transaction| transaction.create_edge(room, "connected", "ward"));
    }
    shut.agent = Agent::Works;
    shut.run(12);
    assert!(
        shut.mission("go").starts_with("succeeded"),
        "{}",
        shut.mission("go")
    );
}

#[test]
fn a_step_that_its_agent_failed_is_avoided() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.run(2);
    house.agent = Agent::FailsAt("changeRoom");
    house.run(1);
    house.agent = Agent::Works;
    house.run(15);
    expect![[r"
        greet/1/0 changeRoom(shelly, hall, kitchen) failed: it is too far
        greet/1/1 changeRoom(shelly, kitchen, ward) dropped: changeRoom(robot=shelly, room1=hall, room2=kitchen) failed: it is too far
        greet/1/2 approach(ana, shelly, ward) dropped: changeRoom(robot=shelly, room1=hall, room2=kitchen) failed: it is too far
        greet/1/3 takeTheAttention(ana, shelly) dropped: changeRoom(robot=shelly, room1=hall, room2=kitchen) failed: it is too far
        greet/2/4 changeRoom(shelly, hall, garden) done
        greet/2/5 changeRoom(shelly, garden, ward) done
        greet/2/6 approach(ana, shelly, ward) done
        greet/2/7 takeTheAttention(ana, shelly) done"]].assert_eq(&house.steps());
    expect!["succeeded, 1: the goal holds"].assert_eq(&house.mission("greet"));
}

#[test]
fn a_step_that_always_fails_ends_the_mission_with_the_reason() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.agent = Agent::FailsAt("approach");
    house.run(80);
    expect!["failed, 2: no plan: ana -front-> shelly cannot be reached; steps that failed lately were left out; approach(p=ana, robot=shelly, room=ward) failed 3 times: it is too far"].assert_eq(&house.mission("greet"));
    expect![[r"
        greet/1/0 changeRoom(shelly, hall, kitchen) done
        greet/1/1 changeRoom(shelly, kitchen, ward) done
        greet/1/2 approach(ana, shelly, ward) failed: it is too far
        greet/1/3 takeTheAttention(ana, shelly) dropped: approach(p=ana, robot=shelly, room=ward) failed: it is too far
        greet/2/4 approach(ana, shelly, ward) failed: it is too far
        greet/2/5 takeTheAttention(ana, shelly) dropped: approach(p=ana, robot=shelly, room=ward) failed: it is too far
        greet/3/6 approach(ana, shelly, ward) failed: it is too far
        greet/3/7 takeTheAttention(ana, shelly) dropped: approach(p=ana, robot=shelly, room=ward) failed: it is too far"]].assert_eq(&house.steps());
}

#[test]
fn without_a_plan_it_waits_and_plans_once_perception_has_seen() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.change(|transaction| transaction.delete_node("ana"));
    house.run(4);
    expect![[r#"running, 0: no plan: there is no node "ana""#]].assert_eq(&house.mission("greet"));
    house.change(|transaction| {
        transaction.create_node("person", "ana", vec![]);
        transaction.create_edge("ana", "in", "hall");
    });
    house.run(2);
    expect!["running, 0: "].assert_eq(&house.mission("greet"));
    house.run(12);
    expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("greet"));
}

#[test]
fn a_mission_without_a_plan_fails_with_the_reason() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.close("kitchen", "ward");
    house.close("garden", "ward");
    house.run(40);
    expect!["failed, 0: no plan: ana -front-> shelly cannot be reached: rule `takeTheAttention` needs shelly -is_near-> ana; rule `approach` needs shelly -in-> ward; rule `changeRoom` needs some room -connected-> ward, which no rule brings about"]
        .assert_eq(&house.mission("greet"));
    expect![[r"
        mission `greet` is queued
        mission `greet` begins
        mission `greet` waits (no plan: ana -front-> shelly cannot be reached: rule `takeTheAttention` needs shelly -is_near-> ana; rule `approach` needs shelly -in-> ward; rule `changeRoom` needs some room -connected-> ward, which no rule brings about)
        mission `greet` failed (no plan: ana -front-> shelly cannot be reached: rule `takeTheAttention` needs shelly -is_near-> ana; rule `approach` needs shelly -in-> ward; rule `changeRoom` needs some room -connected-> ward, which no rule brings about)"]]
    .assert_eq(&house.journal.join("\n"));
    assert_eq!(house.turn(), 0);
}

#[test]
fn started_anew_it_goes_on_with_the_step_that_runs() {
    let mut house = House::new(&[("first", GO_TO_WARD, 1), ("greet", GREET_ANA, 0)]);
    let mut undisturbed = House::new(&[("first", GO_TO_WARD, 1), ("greet", GREET_ANA, 0)]);
    for _ in 0..20 {
        house.restart();
        house.run(1);
        undisturbed.run(1);
        assert_eq!(house.steps(), undisturbed.steps());
    }
    expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("first"));
    expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("greet"));
}

#[test]
fn the_highest_priority_comes_first_and_then_the_order_of_the_list() {
    let goal = GO_TO_WARD;
    let mut house = House::new(&[("a", goal, 0), ("c", goal, 5), ("b", goal, 5)]);
    house.run(20);
    house
        .journal
        .retain(|line| line.ends_with("succeeded (the goal holds)"));
    expect![[r"
        mission `c` succeeded (the goal holds)
        mission `b` succeeded (the goal holds)
        mission `a` succeeded (the goal holds)"]]
    .assert_eq(&house.journal.join("\n"));
}

#[test]
fn a_lost_or_doubled_commit_does_no_harm() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    for turn in 0..30 {
        let transactions = house.decide();
        for transaction in transactions {
            if turn % 3 == 0 {
                continue;
            }
            house
                .graph
                .commit(&transaction, "executive", house.now)
                .unwrap();
            house
                .graph
                .commit(&transaction, "executive", house.now)
                .unwrap_err();
        }
        house.act();
    }
    expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("greet"));
    expect![[r"
        greet/1/0 changeRoom(shelly, hall, kitchen) done
        greet/1/1 changeRoom(shelly, kitchen, ward) done
        greet/1/2 approach(ana, shelly, ward) done
        greet/1/3 takeTheAttention(ana, shelly) done"]]
    .assert_eq(&house.steps());
}

#[test]
fn a_decision_on_a_step_that_changed_meanwhile_is_refused() {
    let mut house = House::new(&[("go", GO_TO_WARD, 0)]);
    house.agent = Agent::Hangs;
    house.run(3);
    house.close("kitchen", "ward");
    let late = house.decide();
    house.agent = Agent::Works;
    house.act();
    for transaction in late {
        house
            .graph
            .commit(&transaction, "executive", house.now)
            .unwrap_err();
    }
    house.run(12);
    expect!["succeeded, 1: the goal holds"].assert_eq(&house.mission("go"));
}

#[test]
fn a_goal_that_cannot_be_read_fails_the_mission() {
    let mut house = House::new(&[("greet", "{ \"ana\":persn }", 0), ("go", GO_TO_WARD, 0)]);
    house.run(8);
    expect!["failed, 0: the goal cannot be read: goal:1:9: error: no type `persn` (did you mean `person`?)"].assert_eq(&house.mission("greet"));
    expect!["succeeded, 0: the goal holds"].assert_eq(&house.mission("go"));
}

#[test]
fn a_mission_called_like_another_node_is_told_once() {
    let mut house = House::new(&[("ward", GO_TO_WARD, 0)]);
    house.run(3);
    expect!["mission `ward` is left out (the graph has another node of that name)"]
        .assert_eq(&house.journal.join("\n"));
}

#[test]
fn only_the_newest_of_what_is_over_stays_in_the_graph() {
    let mut house = House::new(&[("greet", GREET_ANA, 0)]);
    house.configure(Config {
        history: 3,
        tries: 100,
        ..Config::default()
    });
    house.agent = Agent::FailsAt("approach");
    house.run(60);
    assert!(house.steps().lines().count() <= 3 + 4, "{}", house.steps());
}
