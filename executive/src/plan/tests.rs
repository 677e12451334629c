//! Planning on graphs: which plan is found, and why there is none.

use super::*;
use crate::testing::{CARE, add, centre, connect, goal, read, ring};
use dsr::{Graph, Schema, Time, Transaction};
use expect_test::expect;

fn outcome(grammar: &Grammar, graph: &Graph, wanted: &str, options: &Options) -> Outcome {
    let goal = goal(grammar, wanted);
    let limits = &mut Limits::new().with_expansions(20_000);
    plan(grammar, &graph.snapshot(), &goal, options, limits).unwrap()
}

fn written(outcome: &Outcome) -> String {
    let mut lines = Vec::new();
    for step in &outcome.steps {
        let binding: Vec<&str> = step.binding.values().map(String::as_str).collect();
        lines.push(format!(
            "{}({}) {}",
            step.rule,
            binding.join(", "),
            step.cost
        ));
    }
    let cost = outcome
        .cost
        .map_or(String::new(), |cost| format!(", {cost}"));
    let optimal = if outcome.optimal { ", optimal" } else { "" };
    lines.push(format!("{:?}{cost}{optimal}", outcome.status));
    lines.extend(outcome.reason.clone());
    lines.join("\n")
}

const ATTENTION: &str = "{ \"ana\":person \"shelly\":robot \"ana\"->\"shelly\"(front) }";

#[test]
fn the_shorter_way_is_taken_and_success_is_priced_in() {
    let grammar = read(CARE);
    let graph = ring(&grammar);
    let options = Options {
        effort: Effort::Optimal,
        ..Options::default()
    };
    // 3 + 4 + 2, then 1 and a tenth of the 9 before.
    expect![[r"
        changeRoom(shelly, hall, corridor) 3
        changeRoom(shelly, corridor, kitchen) 4
        approach(ana, shelly, kitchen) 2
        takeTheAttention(ana, shelly) 1
        Solved, 10.9, optimal"]]
    .assert_eq(&written(&outcome(&grammar, &graph, ATTENTION, &options)));
}

#[test]
fn a_step_that_costs_more_or_is_excluded_is_gone_around() {
    let grammar = read(CARE);
    let graph = ring(&grammar);
    let binding = [
        ("robot", "shelly"),
        ("room1", "hall"),
        ("room2", "corridor"),
    ];
    for by in [20.0, f64::INFINITY] {
        let options = Options {
            raised: vec![Raised {
                rule: "changeRoom".to_owned(),
                binding: binding.map(|(v, n)| (v.to_owned(), n.to_owned())).into(),
                by,
            }],
            ..Options::default()
        };
        let wanted = "{ \"shelly\":robot \"kitchen\":room \"shelly\"->\"kitchen\"(in) }";
        expect![[r"
            changeRoom(shelly, hall, ward) 6
            changeRoom(shelly, ward, kitchen) 6
            Solved, 12, optimal"]]
        .assert_eq(&written(&outcome(&grammar, &graph, wanted, &options)));
    }
}

#[test]
fn why_there_is_no_plan_names_the_rule_that_comes_nearest() {
    let grammar = read(CARE);
    let mut graph = ring(&grammar);
    add(&mut graph, &[("room", "attic")], &[]);
    let why = |wanted: &str| written(&outcome(&grammar, &graph, wanted, &Options::default()));
    expect![[r"
        Unsolvable
        shelly -in-> attic cannot be reached: rule `changeRoom` needs some room -connected-> attic, which no rule brings about"]]
    .assert_eq(&why("{ \"shelly\":robot \"attic\":room \"shelly\"->\"attic\"(in) }"));
    expect![[r"
        Unsolvable
        some place -in-> attic cannot be reached: no rule makes a link `in` there"]]
    .assert_eq(&why(
        "{ \"shelly\":robot p:place \"attic\":room \"shelly\"->p(at) p->\"attic\"(in) }",
    ));
    expect![[r#"
        Unsolvable
        there is no node "bob""#]]
    .assert_eq(&why(
        "{ \"shelly\":robot \"bob\":person \"shelly\"->\"bob\"(is_near) }",
    ));
    expect![[r"
        Unsolvable
        no order of steps works: all 4 states that matter were tried"]]
    .assert_eq(&why(
        "{ \"shelly\":robot a:room b:room \"shelly\"->a(in) \"shelly\"->b(in) }",
    ));
    expect![[r"
        Unsolvable
        there is no object, and no rule creates one"]]
    .assert_eq(&why("{ \"shelly\":robot o:object \"shelly\"->o(is_near) }"));
}

#[test]
fn a_cost_that_is_no_amount_is_told_with_its_place() {
    let grammar = read(CARE);
    let mut graph = ring(&grammar);
    add(
        &mut graph,
        &[("room", "attic"), ("room", "loft")],
        &[("kitchen", "connected", "attic")],
    );
    connect(&mut graph, "attic", "loft", -1.0);
    let why = |to: &str| {
        let wanted = format!("{{ \"shelly\":robot \"{to}\":room \"shelly\"->\"{to}\"(in) }}");
        outcome(&grammar, &graph, &wanted, &Options::default())
            .reason
            .unwrap()
    };
    let ward = "{ \"shelly\":robot \"ward\":room \"shelly\"->\"ward\"(in) }";
    let solved = outcome(&grammar, &graph, ward, &Options::default());
    assert_eq!((solved.status, solved.notes.len()), (Status::Solved, 2));
    assert!(
        solved.notes[0].contains("was left out"),
        "{:?}",
        solved.notes
    );
    expect!["shelly -in-> attic cannot be reached; changeRoom(robot=shelly, room1=kitchen, room2=attic) was left out, since its cost (kitchen -connected-> attic).distance has no value; changeRoom(robot=shelly, room1=attic, room2=loft) was left out, since its cost (attic -connected-> loft).distance is -1, and costs are from 0 to 1000000000 (and at another binding)"].assert_eq(&why("attic"));
    expect!["shelly -in-> loft cannot be reached; changeRoom(robot=shelly, room1=kitchen, room2=attic) was left out, since its cost (kitchen -connected-> attic).distance has no value; changeRoom(robot=shelly, room1=attic, room2=loft) was left out, since its cost (attic -connected-> loft).distance is -1, and costs are from 0 to 1000000000 (and at another binding)"].assert_eq(&why("loft"));
}

#[test]
fn at_a_limit_it_says_how_far_it_came() {
    let grammar = read(CARE);
    let graph = ring(&grammar);
    let goal = goal(&grammar, ATTENTION);
    let snapshot = graph.snapshot();
    let mut limits = Limits::new().with_expansions(2);
    let options = Options::default();
    let stopped = plan(&grammar, &snapshot, &goal, &options, &mut limits).unwrap();
    expect![[r"
        Limit
        stopped with no plan yet: as many states were expanded as allowed (7 facts, 10 actions, 2 states expanded); the nearest state still lacked ana -front-> shelly"]].assert_eq(&written(&stopped));
    let mut cancelled = Limits::new().with_clock(1.0, || f64::INFINITY);
    let stopped = plan(&grammar, &snapshot, &goal, &options, &mut cancelled).unwrap();
    expect![[r"
        Limit
        stopped while grounding: the time allowed is over"]]
    .assert_eq(&written(&stopped));
}

#[test]
fn a_rule_with_too_many_bindings_meets_the_limit_while_they_are_counted() {
    let grammar = read(
        "name=odd\n===\n
        meet : active(1) { { a:room b:room c:room d:room } => { a:room b:room c:room d:room a->b(connected) } }\n",
    );
    let mut graph = centre(&grammar);
    let names: Vec<String> = (0..300).map(|i| format!("r{i}")).collect();
    let rooms: Vec<(&str, &str)> = names.iter().map(|n| ("room", n.as_str())).collect();
    add(&mut graph, &rooms, &[]);
    let goal = goal(&grammar, "{ a:room b:room a->b(connected) }");
    let snapshot = graph.snapshot();
    let options = Options::default();
    let mut limits = Limits::new().with_bytes(10_000_000);
    let stopped = plan(&grammar, &snapshot, &goal, &options, &mut limits).unwrap();
    expect![[r"
        Limit
        stopped while grounding: the memory allowed is used up"]]
    .assert_eq(&written(&stopped));
    let mut asked = 0;
    let mut limits = Limits::new().with_clock(1.0, || {
        asked += 1;
        f64::from(asked) * 0.01
    });
    let stopped = plan(&grammar, &snapshot, &goal, &options, &mut limits).unwrap();
    expect![[r"
        Limit
        stopped while grounding: the time allowed is over"]]
    .assert_eq(&written(&stopped));
}

#[test]
fn twenty_five_rooms_are_crossed_with_few_expansions() {
    let grammar = read(CARE);
    let mut graph = centre(&grammar);
    let name = |x: usize, y: usize| format!("room{x}{y}");
    for x in 0..5 {
        for y in 0..5 {
            add(&mut graph, &[("room", &name(x, y))], &[]);
        }
    }
    for x in 0..5 {
        for y in 0..5 {
            if x < 4 {
                connect(&mut graph, &name(x, y), &name(x + 1, y), 1.0);
            }
            if y < 4 {
                connect(&mut graph, &name(x, y), &name(x, y + 1), 1.0);
            }
        }
    }
    add(
        &mut graph,
        &[("robot", "shelly"), ("person", "ana")],
        &[("shelly", "in", "room00"), ("ana", "in", "room44")],
    );
    let planned = outcome(&grammar, &graph, ATTENTION, &Options::default());
    assert_eq!(planned.steps.len(), 10);
    assert!(planned.optimal);
    assert!(planned.expanded < 400, "{}", planned.expanded);
}

/// A hen that lays eggs into boxes: new nodes, dormant rules, values.
const HEN: &str = "name=hen\n===\n
lay : active(1) activates(paint) { { h:hen b:box h->b(on) } => { h:hen b:box h->b(on) e:egg e->b(inside) } }
dormant paint : active(1) { { e:egg e->e(painted)* } => { e:egg e->e(painted) } }
hop : active(1) { { h:hen b:box c:box h->b(on) } => { h:hen b:box c:box h->c(on) }
    precondition { (< h.tired 2) } effect { (assign h.tired (+ 1 h.tired)) } }
rest : active(5) { { h:hen } => { h:hen } precondition { (> h.tired 0) } effect { (assign h.tired 0) } }
\n";

fn hen() -> (Grammar, Graph) {
    let mut graph = Graph::in_memory(Schema::open());
    let mut transaction = Transaction::new();
    transaction.create_node("hen", "berta", vec![("tired".to_owned(), 1i64.into())]);
    for name in ["red", "green", "blue"] {
        transaction.create_node("box", name, vec![]);
    }
    transaction.create_edge("berta", "on", "red");
    graph.commit(&transaction, "test", Time::default()).unwrap();
    (read(HEN), graph)
}

#[test]
fn new_nodes_can_be_planned_with_and_sleeping_rules_woken() {
    let (grammar, graph) = hen();
    let wanted = "{ e:egg f:egg b:box e->b(inside) f->b(inside) e->e(painted) f->f(painted) }";
    let planned = outcome(&grammar, &graph, wanted, &Options::default());
    expect![[r"
        lay(red, berta) 1
        paint(lay.e#1) 1
        lay(red, berta) 1
        paint(lay.e#2) 1
        Solved, 4"]]
    .assert_eq(&written(&planned));
    assert_eq!(planned.steps[0].creates["e"], "lay.e#1");
    // With no spare for a second egg there is no plan, and the reason says so.
    let options = Options {
        spares: 1,
        ..Options::default()
    };
    expect![[r"
        Unsolvable
        no choice of nodes fits all of the goal at once; each rule was given 1 new nodes at most; attributes were followed through their first values only"]].assert_eq(&written(&outcome(&grammar, &graph, wanted, &options)));
}

#[test]
fn optimal_is_claimed_only_where_more_new_nodes_could_not_be_cheaper() {
    let (_, graph) = hen();
    let wanted = "{ e:egg b:box e->b(inside) }";
    let lay = |cost: u8| {
        let sides = "{ h:hen b:box h->b(on) } => { h:hen b:box h->b(on) e:egg e->b(inside) }";
        let walk = "{ h:hen b:box c:box h->b(on) } => { h:hen b:box c:box h->c(on) }";
        let rules = format!("lay : active({cost}) {{ {sides} }}\nhop : active(1) {{ {walk} }}");
        read(&format!("name=hen\n===\n{rules}\n"))
    };
    let planned = outcome(&lay(2), &graph, wanted, &Options::default());
    assert_eq!((planned.cost, planned.optimal), (Some(2.0), true));
    // Where laying costs nothing, many eggs could make a cheaper way to the green box.
    let wanted = "{ e:egg \"green\":box e->\"green\"(inside) }";
    let planned = outcome(&lay(0), &graph, wanted, &Options::default());
    assert_eq!((planned.cost, planned.optimal), (Some(1.0), false));
}

#[test]
fn values_that_rules_assign_are_planned_with() {
    let (grammar, graph) = hen();
    let wanted =
        "{ e:egg \"green\":box f:egg \"blue\":box e->\"green\"(inside) f->\"blue\"(inside) }";
    expect![[r"
        hop(red, blue, berta) 1
        lay(blue, berta) 1
        rest(berta) 5
        hop(blue, green, berta) 1
        lay(green, berta) 1
        Solved, 9"]]
    .assert_eq(&written(&outcome(
        &grammar,
        &graph,
        wanted,
        &Options::default(),
    )));
}
