//! The examples of the language reference, taken from its page and carried out.

use crate::testing::{describe, graph};
use crate::{
    AttributePath, Binding, Comparison, Condition, Constant, Expression, Goal, Grammar, Rule,
    SourceFile, Types, has_errors, load_grammar, parse_goal,
};
use dsr::{EdgeRef, Graph, Snapshot, Time, Transaction, Value};
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

/// A grammar, which may include those that the page gives a name: ```` ```aggl file=NAME ````.
fn grammar(text: &str) -> Grammar {
    let whole = if text.contains("\n===\n") {
        text.to_owned()
    } else {
        format!("name=example\n===\n{text}")
    };
    let mut include = |path: &str, _: &str| {
        let named = |words: &str| words.strip_prefix("aggl file=") == Some(path);
        let file = blocks().into_iter().find(|(words, _)| named(words));
        let (_, text) = file.ok_or("the page has no such file")?;
        Ok(SourceFile::new(path, &text))
    };
    let (grammar, diagnostics) = load_grammar(&whole, "aggl.md", &mut include);
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
        let value: Value = literal.value();
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

/// What applying a rule comes to, beside the change.
fn amounts(grammar: &Grammar, snapshot: &Snapshot, rule: &Rule, found: &Binding) -> String {
    let cost = grammar.cost(snapshot, rule, found).unwrap();
    let duration = grammar.duration(snapshot, rule, found).unwrap();
    format!(
        "{} cost {cost} duration {} success {} agent {}\n",
        rule.kind,
        duration.map_or("-".to_owned(), |seconds| seconds.to_string()),
        rule.success,
        rule.agent.as_deref().unwrap_or("-"),
    )
}

#[test]
fn every_example_of_the_reference_does_what_it_says() {
    let blocks = blocks();
    let mut carried_out = 0;
    for (index, (words, text)) in blocks.iter().enumerate() {
        if *words == "aggt" {
            goal(text);
        }
        if let "aggt holds" | "aggt unmet" = *words {
            let before = blocks[..index]
                .iter()
                .rfind(|(words, _)| *words == "aggt before");
            let snapshot = world(&before.unwrap().1).snapshot();
            let met = Grammar::default()
                .goal_holds(&snapshot, &goal(text))
                .unwrap();
            assert_eq!(met.is_some(), *words == "aggt holds", "{text}");
            carried_out += 1;
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
        if *then == "text amounts" {
            assert_eq!(amounts(&grammar, &snapshot, rule, &found), *after, "{text}");
            carried_out += 1;
            continue;
        }
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
    assert!(carried_out >= 21, "{carried_out} examples");
}
