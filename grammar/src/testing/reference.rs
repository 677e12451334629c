//! The examples of the language reference, taken from its page and carried out.

use crate::testing::{describe, graph};
use crate::{
    AttributePath, Binding, Comparison, Condition, Constant, Expression, Goal, Grammar, Literal,
    Types, has_errors, parse_goal, parse_grammar,
};
use dsr::{EdgeRef, Graph, Time, Transaction, Value};
use std::sync::Arc;

const PAGE: &str = include_str!("../../../docs/src/aggl.md");

/// Fenced blocks: what stands after the fence, and the text.
fn blocks() -> Vec<(&'static str, String)> {
    let mut blocks = Vec::new();
    let mut lines = PAGE.lines();
    while let Some(line) = lines.next() {
        if let Some(words) = line.strip_prefix("```") {
            let text: Vec<&str> = lines.by_ref().take_while(|line| *line != "```").collect();
            blocks.push((words, text.join("\n") + "\n"));
        }
    }
    blocks
}

fn grammar(text: &str) -> Grammar {
    let whole = if text.contains("\n===\n") {
        text.to_owned()
    } else {
        format!("name=example\n===\n{text}")
    };
    let (grammar, diagnostics) = parse_grammar(&whole, "aggl.md");
    assert!(!has_errors(&diagnostics), "{text}\n{diagnostics:?}");
    grammar
}

fn goal(text: &str) -> Goal {
    parse_goal(text, "aggl.md", &Types::default()).unwrap_or_else(|e| panic!("{text}\n{e}"))
}

fn plain(quoted: &str) -> &str {
    quoted.trim_matches('"')
}

/// The graph that a goal without variables describes, attributes by `(= x.attribute value)`.
fn world(text: &str) -> Graph {
    let goal = goal(text);
    let named = |n: &crate::PatternNode| matches!(goal.constants[&*n.variable], Constant::Name(_));
    assert!(goal.pattern.nodes.iter().all(named), "{text}");
    let nodes = goal.pattern.nodes.iter();
    let nodes: Vec<_> = nodes
        .map(|n| (n.type_name.as_str(), plain(&n.variable)))
        .collect();
    let edges = goal.pattern.edges.iter();
    let links: Vec<_> = edges
        .map(|e| (plain(&e.from), &*e.label, plain(&e.to)))
        .collect();
    let mut graph = graph(&nodes, &links);
    let mut transaction = Transaction::new();
    for condition in goal
        .precondition
        .iter()
        .flat_map(crate::matching::conjuncts)
    {
        let Condition::Compare {
            operator: Comparison::Equal,
            left,
            right,
        } = condition
        else {
            panic!("{condition}");
        };
        let (Expression::Attribute(path), Expression::Literal(literal)) = (&**left, &**right)
        else {
            panic!("{condition}");
        };
        let value: Value = match literal {
            Literal::Integer(n) => (*n).into(),
            Literal::Real(x) => (*x).into(),
            Literal::Text(text) => text.as_str().into(),
            Literal::Boolean(b) => (*b).into(),
        };
        match path {
            AttributePath::Node {
                variable,
                attribute,
            } => {
                transaction.set(plain(variable), attribute, value);
            }
            AttributePath::Edge {
                from,
                label,
                to,
                attribute,
            } => {
                let edge = EdgeRef::new(plain(from), label, plain(to));
                transaction.set_on_edge(edge, attribute, value);
            }
        }
    }
    graph.commit(&transaction, "test", Time::default()).unwrap();
    graph
}

#[test]
fn every_example_of_the_reference_does_what_it_says() {
    let blocks = blocks();
    let mut carried_out = 0;
    for (index, (words, text)) in blocks.iter().enumerate() {
        if *words == "aggt" {
            goal(text);
        }
        if !words.starts_with("aggl") {
            continue;
        }
        let grammar = grammar(text);
        let Some(("aggt before", before)) = blocks.get(index + 1).map(|(w, t)| (*w, t)) else {
            continue;
        };
        let (then, after) = &blocks[index + 2];
        let name = words
            .strip_prefix("aggl apply=")
            .map_or(&*grammar.rules[0].name, |name| name);
        let rule = grammar.rule(name).unwrap();
        let mut graph = world(before);
        let snapshot = graph.snapshot();
        let found = grammar
            .matches(&snapshot, rule, &Binding::new())
            .unwrap()
            .next();
        if *then == "aggt nowhere" {
            assert!(found.is_none(), "{text}");
            carried_out += 1;
            continue;
        }
        let found = found.unwrap_or_else(|| panic!("no match: {text}")).unwrap();
        if *then == "aggt subgoal" {
            assert_eq!(
                grammar.subgoal(&snapshot, rule, &found).unwrap(),
                goal(after),
                "{text}"
            );
            carried_out += 1;
            continue;
        }
        assert_eq!(*then, "aggt after", "{text}");
        graph.set_rules(Arc::new(grammar.clone()));
        let mut transaction = Transaction::new();
        transaction.apply_rule(name, found.to_refs());
        graph.commit(&transaction, "test", Time::default()).unwrap();
        assert_eq!(describe(&graph), describe(&world(after)), "{text}");
        carried_out += 1;
    }
    assert!(carried_out >= 14, "{carried_out} examples");
}
