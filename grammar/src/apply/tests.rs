//! Rules applied through the store, on graphs that are written out.

use crate::testing::oracle::{Model, TYPES};
use crate::testing::random::FEW;
use crate::testing::repair::repaired;
use crate::testing::{CARE, apply, care_centre, describe, graph, read, rule};
use crate::{ApplyError, Binding, Obstacle};
use crate::{Grammar, parse_grammar};
use dsr::{Time, Transaction, Value};
use proptest::prelude::*;

#[test]
fn the_robot_crosses_the_care_centre_and_takes_a_persons_attention() {
    let grammar = read(CARE);
    let mut centre = care_centre();
    let mut step = |rule: &str, binding: &[(&str, &str)]| {
        apply(&mut centre, &grammar, rule, binding).unwrap();
    };
    step(
        "changeRoom",
        &[("robot", "shelly"), ("room1", "hall"), ("room2", "kitchen")],
    );
    step(
        "approach",
        &[("robot", "shelly"), ("room", "kitchen"), ("p", "ana")],
    );
    step("takeTheAttention", &[("robot", "shelly"), ("p", "ana")]);
    let lines = describe(&centre);
    for there in [
        "shelly->kitchen(in)",
        "shelly->ana(is_near)",
        "ana->shelly(front)",
    ] {
        assert!(
            lines.iter().any(|line| line == there),
            "{there} in {lines:#?}"
        );
    }
    assert!(!lines.iter().any(|line| line == "shelly->hall(in)"));
    assert!(
        lines
            .iter()
            .any(|line| line == "hall->kitchen(connected).distance=F64(4.5)")
    );

    // Leaving the room ends being near.
    apply(
        &mut centre,
        &grammar,
        "changeRoom",
        &[("robot", "shelly"), ("room1", "kitchen"), ("room2", "ward")],
    )
    .unwrap();
    assert!(
        !describe(&centre)
            .iter()
            .any(|line| line.contains("is_near"))
    );
}

#[test]
fn a_refusal_names_the_link_that_is_missing() {
    let grammar = read(CARE);
    let mut centre = care_centre();
    let before = describe(&centre);
    let binding = [("robot", "shelly"), ("room1", "kitchen"), ("room2", "ward")];
    let refusal = apply(&mut centre, &grammar, "changeRoom", &binding).unwrap_err();
    assert_eq!(
        refusal,
        "rule `changeRoom` is not applicable: robot (shelly) has no link `in` to room1 (kitchen)"
    );
    let binding = [("robot", "shelly"), ("room1", "hall")];
    let refusal = apply(&mut centre, &grammar, "changeRoom", &binding).unwrap_err();
    assert!(
        refusal.ends_with("room2 is not bound to a node"),
        "{refusal}"
    );
    let refusal = apply(&mut centre, &grammar, "changeRom", &binding).unwrap_err();
    assert!(
        refusal.ends_with("no rule `changeRom`, did you mean `changeRoom`?"),
        "{refusal}"
    );
    assert_eq!(describe(&centre), before);
}

#[test]
fn creating_deleting_and_retyping_nodes() {
    let grammar = rule("{ a:egg b:hen a->b(under) } => { a:chick c:shell a->c(out_of) } ");
    let mut farm = graph(
        &[
            ("egg", "e"),
            ("hen", "h"),
            ("farm", "f"),
            ("shell", "shell_1"),
        ],
        &[("e", "under", "h"), ("h", "in", "f"), ("e", "in", "f")],
    );
    apply(&mut farm, &grammar, "r", &[("a", "e"), ("b", "h")]).unwrap();
    assert_eq!(
        describe(&farm),
        [
            "e->f(in)",
            "e->shell_2(out_of)",
            "e:chick",
            "f:farm",
            "shell_1:shell",
            "shell_2:shell"
        ]
    );
}

#[test]
fn a_strict_rule_leaves_no_link_hanging() {
    let text = "name=t\n===\nstrict r : active(1) { { a:egg b:hen a->b(under) } => { b:hen } }";
    let grammar = read(text);
    let mut farm = graph(
        &[("egg", "e"), ("hen", "h"), ("farm", "f")],
        &[("e", "under", "h"), ("e", "in", "f")],
    );
    let snapshot = farm.snapshot();
    let id = |name| snapshot.find_node_by_name(name).unwrap().unwrap().id();
    let binding: Binding = [("a", id("e")), ("b", id("h"))].into_iter().collect();
    let error = grammar.apply(&snapshot, "r", &binding).unwrap_err();
    assert_eq!(
        error,
        ApplyError::Dangling {
            variable: "a".into(),
            node: "e".into(),
            label: "in".into()
        }
    );
    let mut transaction = Transaction::new();
    transaction.delete_edge("e", "in", "f");
    farm.commit(&transaction, "test", Time::default()).unwrap();
    apply(&mut farm, &grammar, "r", &[("a", "e"), ("b", "h")]).unwrap();
    assert_eq!(describe(&farm), ["f:farm", "h:hen"]);
}

#[test]
fn a_starred_link_on_the_right_creates_nothing_and_clears_what_is_there() {
    let grammar = rule("{ a:arm } => { a:arm a->a(rest)* }");
    let mut arms = graph(
        &[("arm", "left"), ("arm", "right")],
        &[("left", "rest", "left")],
    );
    for arm in ["left", "right"] {
        apply(&mut arms, &grammar, "r", &[("a", arm)]).unwrap();
    }
    assert_eq!(describe(&arms), ["left:arm", "right:arm"]);
}

#[test]
fn assignments_read_the_state_before_the_rule_and_keep_the_kind() {
    let grammar = rule(
        "{ a:lamp b:lamp } => { a:lamp b:lamp a->b(beside) } effect {
            (assign a.level b.level) (assign b.level a.level)
            (assign a.count (+ a.count 1)) (assign e(a, beside, b).gap (/ a.count 2)) }",
    );
    let mut lamps = graph(&[("lamp", "x"), ("lamp", "y")], &[]);
    let mut transaction = Transaction::new();
    transaction.set("x", "level", 1.5);
    transaction.set("y", "level", 2.5);
    transaction.set("x", "count", Value::U64(3));
    lamps.commit(&transaction, "test", Time::default()).unwrap();
    apply(&mut lamps, &grammar, "r", &[("a", "x"), ("b", "y")]).unwrap();
    assert_eq!(
        describe(&lamps),
        [
            "x->y(beside)",
            "x->y(beside).gap=F64(1.5)",
            "x.count=U64(4)",
            "x.level=F64(2.5)",
            "x:lamp",
            "y.level=F64(1.5)",
            "y:lamp"
        ]
    );
}

#[test]
fn assigning_what_has_no_value_is_refused_whole() {
    let grammar =
        rule("{ a:lamp } => { a:lamp a->a(on) } effect { (assign a.level (/ 1 a.missing)) }");
    let mut lamps = graph(&[("lamp", "x")], &[]);
    let refusal = apply(&mut lamps, &grammar, "r", &[("a", "x")]).unwrap_err();
    assert!(
        refusal.ends_with("`(/ 1 a.missing)` has no value"),
        "{refusal}"
    );
    assert_eq!(describe(&lamps), ["x:lamp"]);
}

#[test]
fn quantified_effects_create_delete_and_skip_what_the_condition_excludes() {
    let grammar = rule(
        "{ t:table } => { t:table } effect {
            (forall c:cup
                (when (on c t) (and (not (on c t)) (create s saucer) (under s c))))
        }",
    );
    let mut kitchen = graph(
        &[("table", "t"), ("cup", "a"), ("cup", "b"), ("cup", "c")],
        &[("a", "on", "t"), ("c", "on", "t")],
    );
    apply(&mut kitchen, &grammar, "r", &[("t", "t")]).unwrap();
    assert_eq!(
        describe(&kitchen),
        [
            "a:cup",
            "b:cup",
            "c:cup",
            "saucer_1->a(under)",
            "saucer_1:saucer",
            "saucer_2->c(under)",
            "saucer_2:saucer",
            "t:table"
        ]
    );
    let grammar =
        rule("{ t:table } => { t:table } effect { (forall c:cup (delete c)) (retype t desk) }");
    apply(&mut kitchen, &grammar, "r", &[("t", "t")]).unwrap();
    assert_eq!(
        describe(&kitchen),
        ["saucer_1:saucer", "saucer_2:saucer", "t:desk"]
    );
}

#[test]
fn the_right_side_wins_over_an_effect_that_unlinks_it() {
    let grammar =
        rule("{ a:pose } => { a:pose a->a(reach) } effect { (forall p:pose (not (reach p p))) }");
    let mut poses = graph(&[("pose", "a"), ("pose", "b")], &[("b", "reach", "b")]);
    apply(&mut poses, &grammar, "r", &[("a", "a")]).unwrap();
    assert_eq!(describe(&poses), ["a->a(reach)", "a:pose", "b:pose"]);
}

#[test]
fn a_link_that_is_there_stays_if_the_right_side_wants_it() {
    let grammar =
        rule("{ a:pose } => { a:pose a->a(reach) } effect { (forall p:pose (not (reach p p))) }");
    let mut poses = graph(&[("pose", "a")], &[("a", "reach", "a")]);
    apply(&mut poses, &grammar, "r", &[("a", "a")]).unwrap();
    assert_eq!(describe(&poses), ["a->a(reach)", "a:pose"]);
}

#[test]
fn two_values_for_one_attribute_are_refused() {
    let grammar = rule(
        "{ a:lamp } => { a:lamp } effect {
            (forall b:lamp (when (not (= a b)) (assign a.level b.level))) }",
    );
    let lamps = |levels: [f64; 2]| {
        let mut lamps = graph(&[("lamp", "x"), ("lamp", "y"), ("lamp", "z")], &[]);
        let mut transaction = Transaction::new();
        transaction.set("y", "level", levels[0]);
        transaction.set("z", "level", levels[1]);
        lamps.commit(&transaction, "test", Time::default()).unwrap();
        lamps
    };
    assert_eq!(
        apply(&mut lamps([2.0, 2.0]), &grammar, "r", &[("a", "x")]),
        Ok(())
    );
    let refusal = apply(&mut lamps([2.0, 3.0]), &grammar, "r", &[("a", "x")]).unwrap_err();
    assert!(
        refusal.ends_with("sets the `level` of one thing both to 2 and to 3"),
        "{refusal}"
    );
}

#[test]
fn what_a_rule_aims_at_is_recognised_where_somebody_else_brought_it_about() {
    let grammar = read(CARE);
    let mut centre = care_centre();
    let snapshot = centre.snapshot();
    let id = |name| snapshot.find_node_by_name(name).unwrap().unwrap().id();
    let binding: Binding = [
        ("robot", id("shelly")),
        ("room1", id("hall")),
        ("room2", id("kitchen")),
    ]
    .into_iter()
    .collect();
    let rule = grammar.rule("changeRoom").unwrap();
    let obstacle = grammar.outcome_obstacle(&snapshot, rule, &binding).unwrap();
    assert!(matches!(obstacle, Some(Obstacle::MissingLink { label, .. }) if label == "in"));
    let mut transaction = Transaction::new();
    transaction.create_edge("shelly", "in", "kitchen");
    centre
        .commit(&transaction, "test", Time::default())
        .unwrap();
    let obstacle = grammar
        .outcome_obstacle(&centre.snapshot(), rule, &binding)
        .unwrap();
    assert!(
        matches!(obstacle, Some(Obstacle::StarredLink { .. })),
        "still in the hall"
    );
    let mut transaction = Transaction::new();
    transaction.delete_edge("shelly", "in", "hall");
    centre
        .commit(&transaction, "test", Time::default())
        .unwrap();
    assert_eq!(
        grammar
            .outcome_obstacle(&centre.snapshot(), rule, &binding)
            .unwrap(),
        None
    );
}

#[test]
fn effects_that_would_fill_the_memory_are_refused() {
    let nodes: Vec<String> = (0..20).map(|index| format!("n{index}")).collect();
    let nodes: Vec<(&str, &str)> = nodes.iter().map(|name| ("t", name.as_str())).collect();
    let mut many = graph(&nodes, &[]);
    let before = describe(&many);
    let all = "(forall a:t b:t c:t (forall d:t e:t f:t ";
    let nowhere = "(exists u:t v:t w:t (exists x:t y:t z:t (and (= x y) (not (= x y)))))";
    for effect in [
        format!("{all} (create n t)))"),
        format!("{all} (when (l a b) (create n t))))"),
        format!("(when {nowhere} (create n t))"),
    ] {
        let grammar = rule(&format!("{{ }} => {{ }} effect {{ {effect} }}"));
        let error = apply(&mut many, &grammar, "r", &[]).unwrap_err();
        assert!(
            error.contains("beyond 100000 changes or 5000000 choices"),
            "{error}"
        );
        assert_eq!(describe(&many), before);
    }
}

proptest! {
    #![proptest_config(crate::testing::cases(2000))]

    #[test]
    fn applying_does_what_the_oracle_does(model in Model::strategy(), rule in FEW.rule()) {
        let (mut grammar, _): (Grammar, _) = parse_grammar(TYPES, "types.aggl");
        grammar.rules.push(repaired(rule));
        let rule = &grammar.rules[0];
        let all = model.assignments(rule);
        let mut matches: Vec<_> = all.iter().filter(|at| model.rule_holds(rule, at)).collect();
        matches.truncate(3);
        for at in matches {
            let mut graph = model.to_graph();
            let binding: Vec<(&str, &str)> =
                at.iter().map(|(variable, name)| (variable.as_str(), name.as_str())).collect();
            let done = apply(&mut graph, &grammar, "r", &binding);
            match model.applied(rule, at) {
                Some(expected) => {
                    prop_assert_eq!(&done, &Ok(()), "{}", rule);
                    prop_assert_eq!(Model::of_graph(&graph), expected, "{} at {:?}", rule, at);
                }
                None => {
                    prop_assert!(done.is_err(), "{} at {:?}", rule, at);
                    prop_assert_eq!(&Model::of_graph(&graph), &model);
                }
            }
        }
    }

    #[test]
    fn a_rule_that_was_never_checked_is_refused_at_worst(
        model in Model::strategy(),
        rule in FEW.rule(),
    ) {
        let mut grammar = Grammar::default();
        grammar.rules.push(rule);
        let rule = &grammar.rules[0];
        let graph = model.to_graph();
        let snapshot = graph.snapshot();
        let nodes = snapshot.nodes().map(|node| node.unwrap().id());
        let binding: Binding =
            rule.bound_nodes().map(|node| node.variable.clone()).zip(nodes).collect();
        if let Ok(matches) = grammar.matches(&snapshot, rule, &Binding::new()) {
            for binding in matches.take(10) {
                let _ = grammar.apply(&snapshot, &rule.name, &binding.unwrap());
            }
        }
        let _ = grammar.apply(&snapshot, &rule.name, &binding);
        let _ = grammar.outcome_obstacle(&snapshot, rule, &binding);
        let _ = grammar.cost(&snapshot, rule, &binding);
    }
}
