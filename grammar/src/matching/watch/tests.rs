//! A watch against fresh searches, however the graph changes.

use super::*;
use crate::testing::oracle::{Model, NODE_TYPES, TYPES};
use crate::testing::random::FEW;
use crate::testing::repair::repaired;
use crate::testing::{graph, read, rule};
use crate::{PatternEdge, PatternNode, has_errors, parse_grammar};
use dsr::{EdgeRef, Graph, NodeRef, Operation, Owner, Time, Transaction, Value};
use proptest::prelude::*;

/// One or two operations that belong together; nodes by number.
#[derive(Debug, Clone)]
enum Act {
    Create(usize, usize),
    Delete(usize),
    Retype(usize, usize),
    /// Goes and comes again under its old id.
    Replace(usize, usize),
    Link(usize, usize, usize),
    Unlink(usize, usize, usize),
    /// Goes and comes again without its attributes.
    Relink(usize, usize, usize),
    Set(usize, usize, Option<i64>),
    SetOnLink((usize, usize, usize), usize, Option<i64>),
}

fn act() -> impl Strategy<Value = Act> {
    let node = || 0..7_usize;
    let link = || (node(), 0..2_usize, node());
    let value = || prop::option::weighted(0.8, -2..5_i64);
    prop_oneof![
        2 => (node(), 0..6_usize).prop_map(|(node, kind)| Act::Create(node, kind)),
        1 => node().prop_map(Act::Delete),
        1 => (node(), 0..6_usize).prop_map(|(node, kind)| Act::Retype(node, kind)),
        1 => (node(), 0..6_usize).prop_map(|(node, kind)| Act::Replace(node, kind)),
        5 => link().prop_map(|(a, label, b)| Act::Link(a, label, b)),
        3 => link().prop_map(|(a, label, b)| Act::Unlink(a, label, b)),
        1 => link().prop_map(|(a, label, b)| Act::Relink(a, label, b)),
        3 => (node(), 0..2_usize, value()).prop_map(|(node, what, value)| Act::Set(node, what, value)),
        2 => (link(), 0..2_usize, value())
            .prop_map(|(link, what, value)| Act::SetOnLink(link, what, value)),
    ]
}

fn operations(act: &Act, snapshot: &Snapshot) -> Vec<Operation> {
    let name = |number: usize| format!("node{number}");
    let at = |number: usize| NodeRef::Name(name(number));
    let edge = |a: usize, label: usize, b: usize| EdgeRef::new(at(a), ["on", "by"][label], at(b));
    let kind = |index: usize| NODE_TYPES[index].to_owned();
    let create = |id, node, index| Operation::CreateNode {
        id,
        type_name: kind(index),
        name: name(node),
        attributes: vec![],
    };
    let assign = |owner, what: usize, value: Option<i64>| {
        let name = ["n", "m"][what].to_owned();
        match value {
            Some(value) => Operation::SetAttribute {
                owner,
                name,
                value: Value::I64(value),
            },
            None => Operation::RemoveAttribute { owner, name },
        }
    };
    match *act {
        Act::Create(node, index) => vec![create(None, node, index)],
        Act::Delete(node) => vec![Operation::DeleteNode { node: at(node) }],
        Act::Retype(node, index) => vec![Operation::RetypeNode {
            node: at(node),
            type_name: kind(index),
        }],
        Act::Replace(node, index) => {
            let old = snapshot.find_node_by_name(&name(node)).unwrap();
            let id = old.map(|old| old.id());
            vec![
                Operation::DeleteNode { node: at(node) },
                create(id, node, index),
            ]
        }
        Act::Link(a, label, b) => vec![Operation::CreateEdge {
            edge: edge(a, label, b),
            attributes: vec![],
        }],
        Act::Unlink(a, label, b) => vec![Operation::DeleteEdge {
            edge: edge(a, label, b),
        }],
        Act::Relink(a, label, b) => vec![
            Operation::DeleteEdge {
                edge: edge(a, label, b),
            },
            Operation::CreateEdge {
                edge: edge(a, label, b),
                attributes: vec![],
            },
        ],
        Act::Set(node, what, value) => vec![assign(Owner::Node(at(node)), what, value)],
        Act::SetOnLink((a, label, b), what, value) => {
            vec![assign(Owner::Edge(edge(a, label, b)), what, value)]
        }
    }
}

/// Commits as many of the acts, from the first on, as the graph allows together.
fn commit(graph: &mut Graph, acts: &[Act]) -> Option<Change> {
    let snapshot = graph.snapshot();
    let all: Vec<Vec<Operation>> = acts.iter().map(|act| operations(act, &snapshot)).collect();
    (1..=all.len()).rev().find_map(|count| {
        let transaction = Transaction {
            operations: all[..count].concat(),
            ..Transaction::new()
        };
        let committed = graph.commit(&transaction, "test", Time::default());
        committed.ok().map(|(_, change)| change)
    })
}

fn fresh(grammar: &Grammar, rule: &str, snapshot: &Snapshot) -> BTreeSet<Binding> {
    let rule = grammar.rule(rule).unwrap();
    let matches = grammar.matches(snapshot, rule, &Binding::new()).unwrap();
    matches.map(Result::unwrap).collect()
}

fn of_rule(matches: &[RuleMatch], rule: &str) -> BTreeSet<Binding> {
    let of_rule = matches.iter().filter(|found| found.rule == *rule);
    of_rule.map(|found| found.binding.clone()).collect()
}

/// A rule with one more node and a link to it or from it: it begins as the other does.
fn with_more(
    mut rule: Rule,
    (kind, label, [out, negated, first]): &(usize, usize, [bool; 3]),
) -> Rule {
    let node = PatternNode::new("more", NODE_TYPES[*kind]);
    let nodes = &mut rule.left.nodes;
    let other = if *first { nodes.first() } else { nodes.last() };
    let other = other.map_or_else(|| Name::from("more"), |node| node.variable.clone());
    let (from, to) = if *out {
        (other, Name::from("more"))
    } else {
        (Name::from("more"), other)
    };
    nodes.push(node.clone());
    if rule.precondition.is_some() && *negated {
        // Begins as the other does but for its condition.
        rule.precondition = None;
    }
    rule.right.nodes.push(node);
    rule.left.edges.push(PatternEdge {
        from,
        label: Name::from(["on", "by"][*label]),
        to,
        negated: *negated,
    });
    rule
}

proptest! {
    #![proptest_config(crate::testing::cases(600))]

    #[test]
    fn a_watch_has_what_a_fresh_search_finds(
        model in Model::strategy(),
        rules in prop::collection::vec(FEW.rule(), 1..4),
        related in prop::collection::vec((0..5_usize, 0..2_usize, any::<[bool; 3]>()), 0..4),
        groups in prop::collection::vec(prop::collection::vec(act(), 1..4), 1..12),
    ) {
        let (mut grammar, _) = parse_grammar(TYPES, "types.aggl");
        let more = related.iter().map(|more| with_more(rules[0].clone(), more));
        let rules = more.chain(rules.clone()).collect::<Vec<_>>();
        for (index, rule) in rules.into_iter().enumerate() {
            let mut rule = repaired(rule);
            rule.name = format!("r{index}").as_str().into();
            grammar.rules.push(rule);
        }
        let (grammar, diagnostics) = parse_grammar(&grammar.to_string(), "random.aggl");
        prop_assert!(!has_errors(&diagnostics));
        let grammar = Arc::new(grammar);
        let names: Vec<&str> = grammar.rules.iter().map(|rule| rule.name.as_str()).collect();
        let mut graph = model.to_graph();
        let mut watch = Watch::new(Arc::clone(&grammar), &names, &graph.snapshot()).unwrap();
        for acts in &groups {
            let before: Vec<BTreeSet<Binding>> =
                names.iter().map(|name| watch.matches(name).collect()).collect();
            let Some(change) = commit(&mut graph, acts) else { continue };
            let snapshot = graph.snapshot();
            let delta = watch.update(&change, &snapshot).unwrap();
            prop_assert_eq!(watch.version(), snapshot.version());
            for (name, before) in names.iter().zip(before) {
                let expected = fresh(&grammar, name, &snapshot);
                let now: Vec<Binding> = watch.matches(name).collect();
                prop_assert_eq!(now.len(), watch.count(name));
                let now: BTreeSet<Binding> = now.into_iter().collect();
                prop_assert_eq!(&now, &expected, "{} after {:?}", grammar.rule(name).unwrap(), change);
                let added: BTreeSet<Binding> = now.difference(&before).cloned().collect();
                let removed: BTreeSet<Binding> = before.difference(&now).cloned().collect();
                prop_assert_eq!(of_rule(&delta.added, name), added);
                prop_assert_eq!(of_rule(&delta.removed, name), removed);
            }
        }
    }
}

fn link(graph: &mut Graph, from: &str, label: &str, to: &str) -> Change {
    let mut transaction = Transaction::new();
    transaction.create_edge(from, label, to);
    graph
        .commit(&transaction, "test", Time::default())
        .unwrap()
        .1
}

#[test]
fn a_missed_change_is_made_up_for_and_a_late_one_ignored() {
    let grammar = Arc::new(rule("{ a:box b:box a->b(on) } => { a:box b:box }"));
    let mut world = graph(
        &[("box", "x"), ("box", "y"), ("box", "z")],
        &[("z", "on", "x")],
    );
    let mut watch = Watch::new(grammar, &["r"], &world.snapshot()).unwrap();
    let first = link(&mut world, "x", "on", "y");
    let between = world.snapshot();
    let second = link(&mut world, "y", "on", "z");
    let early = watch.update(&second, &between).unwrap();
    assert_eq!((early, watch.count("r")), (MatchDelta::default(), 1));
    let delta = watch.update(&second, &world.snapshot()).unwrap();
    assert_eq!((delta.added.len(), watch.count("r")), (2, 3));
    let late = watch.update(&first, &world.snapshot()).unwrap();
    assert_eq!((late, watch.count("r")), (MatchDelta::default(), 3));
}

/// The matches that a change has brought, in words.
fn added(delta: &MatchDelta) -> Vec<String> {
    let added = delta.added.iter();
    added
        .map(|found| format!("{} {}", found.rule, found.binding))
        .collect()
}

#[test]
fn rules_that_differ_in_names_only_share_their_matches() {
    let grammar = Arc::new(read(
        "name=test\n===\n\
         up : active(1) { { a:box b:box a->b(on) } => { a:box b:box } }\n\
         down : active(1) { { c:box d:box c->d(on) } => { c:box d:box d->c(on) } }\n\
         aside : active(1) { { c:box d:box c->d(by) } => { c:box d:box } }\n",
    ));
    let mut world = graph(
        &[("box", "x"), ("box", "y"), ("box", "z")],
        &[("z", "on", "x")],
    );
    let mut watch = Watch::new(grammar, &["up", "down", "aside"], &world.snapshot()).unwrap();
    assert_eq!(watch.patterns.len(), 2);
    let change = link(&mut world, "x", "on", "y");
    let delta = watch.update(&change, &world.snapshot()).unwrap();
    let told = added(&delta);
    assert_eq!(told, ["up a = 1, b = 2", "down c = 1, d = 2"]);
}

#[test]
fn searches_that_begin_alike_are_made_together() {
    let grammar = Arc::new(read(
        "name=test\n===\n\
         go : active(1) { { r:bot a:room b:room r->a(in) a->b(door) } => { r:bot a:room b:room } }\n\
         bring : active(1) { { c:cup y:room x:room q:bot q->x(in) x->y(door) c->y(in) } => { } }\n\
         meet : active(1) { { r:bot a:room b:room p:man r->a(in) a->b(door) p->b(in) } => { }\n\
         precondition { (not (exists o:man (likes p o))) } }\n\
         rest : active(1) { { r:bot a:room t:cup r->a(in) t->r(on) } => { } }\n",
    ));
    let names = ["go", "bring", "meet", "rest"];
    let nodes = [
        ("bot", "r"),
        ("room", "a"),
        ("room", "b"),
        ("room", "c"),
        ("cup", "cup"),
        ("man", "p"),
        ("man", "q"),
    ];
    let links = [
        ("a", "door", "b"),
        ("a", "door", "c"),
        ("cup", "in", "b"),
        ("p", "in", "c"),
        ("q", "in", "b"),
        ("q", "likes", "p"),
    ];
    let mut world = graph(&nodes, &links);
    let told = grammar.shared_steps(Some(&world.snapshot())).unwrap();
    let told = told.iter().map(|shared| {
        let (label, rules) = (&shared.label, shared.rules.join(" "));
        format!("{label} {rules}: {}", shared.steps.join(", "))
    });
    assert_eq!(
        told.collect::<Vec<_>>(),
        [
            "door go bring meet: given a b, r from in to a",
            "in go bring meet: given r a, b from door of a"
        ]
    );
    let mut watch = Watch::new(grammar, &names, &world.snapshot()).unwrap();
    let change = link(&mut world, "r", "in", "a");
    let delta = watch.update(&change, &world.snapshot()).unwrap();
    let told = added(&delta);
    assert_eq!(
        told,
        [
            "go r = 1, a = 2, b = 3",
            "go r = 1, a = 2, b = 4",
            "bring c = 5, y = 3, x = 2, q = 1",
            "meet r = 1, a = 2, b = 4, p = 6"
        ]
    );
    let [shared] = &watch.shared.values().collect::<Vec<_>>()[..] else {
        panic!("{:?}", watch.shared)
    };
    let by_step = shared
        .branches
        .iter()
        .filter(|branch| matches!(branch.part, shared::Part::Step(_)));
    let by_step: Vec<usize> = by_step.map(|branch| branch.through.len()).collect();
    // The door is gone through once for three rules, and then each looks for its own.
    assert_eq!(by_step, [3, 1, 1, 1]);
    assert_eq!(shared.alone.len(), 1);
}

#[test]
fn a_rule_that_is_not_there_is_told_with_the_right_name() {
    let grammar = Arc::new(rule("{ a:box } => { a:box }"));
    let world = graph(&[("box", "x")], &[]);
    let error = Watch::new(grammar, &["rr"], &world.snapshot()).unwrap_err();
    assert_eq!(error.to_string(), "no rule `rr`, did you mean `r`?");
}
