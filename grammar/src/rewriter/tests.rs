//! Rewriting in memory against commits of the same rule.

use super::*;
use crate::testing::oracle::{Model, TYPES};
use crate::testing::random::FEW;
use crate::testing::repair::repaired;
use crate::testing::{graph, rule};
use crate::{has_errors, parse_grammar};
use dsr::{NodeRef, Time, Transaction};
use proptest::prelude::*;
use std::collections::BTreeSet;

type Content = (BTreeSet<(NodeId, TypeId)>, BTreeSet<EdgeKey>);

fn of_snapshot(snapshot: &Snapshot) -> Content {
    let nodes = snapshot.nodes().map(Result::unwrap);
    let edges = snapshot.nodes().map(Result::unwrap);
    (
        nodes.map(|node| (node.id(), node.type_id())).collect(),
        edges
            .flat_map(|node| node.out_edges())
            .map(Result::unwrap)
            .collect(),
    )
}

fn of_working(graph: &WorkingGraph) -> Content {
    (graph.nodes().collect(), graph.edges().collect())
}

proptest! {
    #![proptest_config(crate::testing::cases(1000))]

    #[test]
    fn a_step_in_memory_is_what_a_commit_does(model in Model::strategy(), rule in FEW.rule()) {
        let (mut grammar, _) = parse_grammar(TYPES, "types.aggl");
        let mut rule = repaired(rule);
        rule.effect.clear();
        rule.strict = false;
        grammar.rules.push(rule);
        let (grammar, diagnostics) = parse_grammar(&grammar.to_string(), "random.aggl");
        prop_assert!(!has_errors(&diagnostics));
        let mut shared = model.to_graph();
        shared.set_rules(Arc::new(grammar.clone()));
        let snapshot = shared.snapshot();
        let mut working = WorkingGraph::of(&snapshot).unwrap();
        let mut rewriter = match Rewriter::new(&grammar, "r", &snapshot) {
            Ok(rewriter) => rewriter,
            Err(RewriteError::Unknown { .. }) => return Ok(()),
            Err(other) => panic!("{other}"),
        };
        for _ in 0..4 {
            let snapshot = shared.snapshot();
            let rule = &grammar.rules[0];
            let some = grammar.matches(&snapshot, rule, &crate::Binding::new()).unwrap().next();
            let rewritten = rewriter.rewrite(&mut working, &[]).unwrap();
            prop_assert_eq!(rewritten, some.is_some());
            if !rewritten {
                break;
            }
            let mut commit = Transaction::new();
            let at = rule.bound_nodes().enumerate().map(|(slot, node)| {
                (node.variable.to_string(), NodeRef::Id(rewriter.node(slot).unwrap()))
            });
            commit.apply_rule("r", at.collect());
            shared.commit(&commit, "test", Time::default()).unwrap();
            prop_assert_eq!(of_working(&working), of_snapshot(&shared.snapshot()), "{}", rule);
        }
    }
}

#[test]
fn what_is_more_than_two_sides_is_refused() {
    let world = graph(&[("box", "x"), ("box", "y")], &[("x", "on", "y")]);
    let snapshot = world.snapshot();
    let refused = |body: &str| {
        let grammar = rule(body);
        Rewriter::new(&grammar, "r", &snapshot)
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        refused("{ a:box } => { a:box } effect { (assign a.n 1) }"),
        "rule `r` has an effect block, which is not done in memory"
    );
    assert_eq!(
        refused("{ a:box b:box } => { a:box b:box a->b(by) }"),
        "the schema has no `by`, which rule `r` makes"
    );
}

#[test]
fn given_nodes_are_kept() {
    let world = graph(
        &[("box", "x"), ("box", "y"), ("box", "z")],
        &[("x", "on", "y"), ("x", "on", "z")],
    );
    let snapshot = world.snapshot();
    let grammar = rule("{ a:box b:box a->b(on) } => { a:box b:box }");
    let mut rewriter = Rewriter::new(&grammar, "r", &snapshot).unwrap();
    let mut working = WorkingGraph::of(&snapshot).unwrap();
    let b = rewriter.slot("b").unwrap();
    assert!(rewriter.rewrite(&mut working, &[(b, NodeId(3))]).unwrap());
    assert!(!rewriter.rewrite(&mut working, &[(b, NodeId(3))]).unwrap());
    assert_eq!(
        working.edges().map(|key| key.to).collect::<Vec<_>>(),
        [NodeId(2)]
    );
}

#[test]
fn a_new_node_is_none_of_those_that_a_quantifier_tried() {
    let world = graph(
        &[("box", "x"), ("box", "y")],
        &[("x", "on", "x"), ("y", "on", "y")],
    );
    let snapshot = world.snapshot();
    let body = "{ a:box } => { a:box c:box c->c(on)* } precondition { (forall q:box (on a a)) }";
    let mut rewriter = Rewriter::new(&rule(body), "r", &snapshot).unwrap();
    let mut working = WorkingGraph::of(&snapshot).unwrap();
    assert!(rewriter.rewrite(&mut working, &[]).unwrap());
    assert_eq!(working.edges().count(), 2);
}
