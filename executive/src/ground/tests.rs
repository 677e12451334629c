//! The planner against trying everything with the grammar's own matcher and the store's own
//! application, on random grammars and graphs; and the simulator against the store.

use super::simulate;
use crate::plan::{Options, Status, plan_above};
use crate::search::{Effort, Limits};
use crate::testing::goal;
use dsr::{Graph, NodeId, Schema, Time, Transaction, Value};
use grammar::{Binding, Goal, Grammar};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::fmt::Write;
use std::sync::Arc;

/// Nodes by name with type and level, and links.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct State {
    nodes: Vec<(String, String, Option<i64>)>,
    links: Vec<(String, String, String)>,
}

impl State {
    fn graph(&self, grammar: &Grammar) -> Graph {
        let mut graph = Graph::in_memory(Schema::open());
        graph.set_rules(Arc::new(grammar.clone()));
        let mut transaction = Transaction::new();
        for (name, type_name, level) in &self.nodes {
            let level = level.map(|level| ("level".to_owned(), level.into()));
            transaction.create_node(type_name, name, level.into_iter().collect());
        }
        for (from, label, to) in &self.links {
            transaction.create_edge(from.as_str(), label, to.as_str());
        }
        graph.commit(&transaction, "test", Time::default()).unwrap();
        graph
    }

    fn of(graph: &Graph) -> Self {
        let snapshot = graph.snapshot();
        let (mut nodes, mut links) = (Vec::new(), Vec::new());
        let name = |id: NodeId| snapshot.find_node(id).unwrap().unwrap().name().unwrap();
        for node in snapshot.nodes() {
            let node = node.unwrap();
            let level = match node.value("level").unwrap() {
                Some(Value::I64(level)) => Some(level),
                _ => None,
            };
            nodes.push((node.name().unwrap(), node.type_name().to_owned(), level));
            for edge in node.out_edges() {
                let edge = edge.unwrap();
                let label = snapshot.schema().label_name(edge.label).to_owned();
                links.push((name(edge.from), label, name(edge.to)));
            }
        }
        nodes.sort();
        links.sort();
        Self { nodes, links }
    }
}

const MOST_STATES: usize = 400;

/// The least cost to the goal (success is 1 everywhere), or none; `Err` where there are too many
/// states to tell.
fn brute_force(grammar: &Grammar, start: &State, goal: &Goal) -> Result<Option<f64>, ()> {
    let mut best: BTreeMap<State, u64> = BTreeMap::from([(start.clone(), 0)]);
    let mut open = BinaryHeap::from([Reverse((0, start.clone()))]);
    while let Some(Reverse((cost, state))) = open.pop() {
        if cost > best[&state] {
            continue;
        }
        let graph = state.graph(grammar);
        let snapshot = graph.snapshot();
        if grammar.goal_holds(&snapshot, goal).unwrap().is_some() {
            return Ok(Some(cost as f64));
        }
        for rule in &grammar.rules {
            let matches: Vec<Binding> = grammar
                .matches(&snapshot, rule, &Binding::new())
                .unwrap()
                .map(Result::unwrap)
                .collect();
            for binding in matches {
                // What has no cost is not planned with.
                let Ok(price) = grammar.cost(&snapshot, rule, &binding) else {
                    continue;
                };
                let mut next = state.graph(grammar);
                let mut transaction = Transaction::new();
                transaction.apply_rule(&rule.name, binding.to_refs());
                if next.commit(&transaction, "test", Time::default()).is_err() {
                    continue;
                }
                let next = State::of(&next);
                let cost = cost + price as u64;
                if best.get(&next).is_none_or(|&known| cost < known) {
                    best.insert(next.clone(), cost);
                    open.push(Reverse((cost, next)));
                }
                if best.len() > MOST_STATES {
                    return Err(());
                }
            }
        }
    }
    Ok(None)
}

const VARIABLES: [&str; 3] = ["a", "b", "c"];

fn type_name() -> impl Strategy<Value = &'static str> {
    prop_oneof![6 => Just("x"), 1 => Just("y"), 2 => Just("z")]
}

fn links(variables: usize, least: usize, most: usize) -> impl Strategy<Value = String> {
    prop::collection::btree_map(
        (0..variables, 0..variables, 0..2usize),
        0..8u8,
        least..=most,
    )
    .prop_map(move |links| {
        let mut text = String::new();
        for ((from, to, label), star) in links {
            let star = if star == 0 { "*" } else { "" };
            let (from, to) = (VARIABLES[from], VARIABLES[to]);
            let label = ["p", "q"][label];
            write!(text, "{from}->{to}({label}){star} ").unwrap();
        }
        text
    })
}

fn formula(last: &'static str) -> impl Strategy<Value = String> {
    let term = prop_oneof![
        Just("(p a a)".to_owned()),
        Just(format!("(q a {last})")),
        Just(format!("(= a {last})")),
        Just("(= a.level 1)".to_owned()),
        Just(format!("(< a.level {last}.level)")),
        Just("(exists v:x (q v a))".to_owned()),
        Just(format!("(forall v:y (when (p v {last}) (= v a)))")),
    ];
    prop_oneof![
        2 => term.clone(),
        2 => term.clone().prop_map(|f| format!("(not {f})")),
        1 => (term.clone(), term).prop_map(|(f, g)| format!("(or {f} (not {g}))")),
    ]
}

fn effect(last: &'static str) -> impl Strategy<Value = String> {
    prop_oneof![
        Just(format!("(q {last} a)")),
        Just("(not (p a a))".to_owned()),
        Just("(assign a.level 1)".to_owned()),
        Just("(assign a.level (- 1 a.level))".to_owned()),
        Just("(retype a z)".to_owned()),
        Just("(retype a y)".to_owned()),
        Just("(forall v:x (not (p v a)))".to_owned()),
        Just("(forall v:x (when (q v v) (p v a)))".to_owned()),
        Just(format!("(when (p a {last}) (not (q a {last})))")),
    ]
}

/// A rule over two or three nodes, of which the last may be deleted.
fn rule(number: usize) -> impl Strategy<Value = String> {
    (1..=3usize)
        .prop_flat_map(move |variables| {
            let last = VARIABLES[variables - 1];
            (
                prop::collection::vec(type_name(), variables),
                links(variables, 0, 2),
                links(variables, 1, 3),
                prop::option::weighted(0.3, formula(last)),
                prop::collection::vec(effect(last), 0..2),
                (1..4u8, prop::bool::weighted(0.2)),
                (prop::bool::weighted(0.15), prop::bool::weighted(0.5)),
            )
        })
        .prop_map(move |(types, left, right, condition, effects, cost, extra)| {
            let (deletes, strict) = extra;
            let cost = match cost {
                (cost, false) => format!("active({cost})"),
                (cost, true) => format!("active(1) cost(+ {cost} a.level)"),
            };
            let nodes: Vec<String> = VARIABLES
                .iter()
                .zip(&types)
                .map(|(v, t)| format!("{v}:{t}"))
                .collect();
            // A deleted node cannot be spoken of on the right or in effects.
            let deletes = deletes && types.len() > 1 && effects.is_empty();
            let kept = if deletes { types.len() - 1 } else { types.len() };
            let gone = VARIABLES[types.len() - 1];
            let right: Vec<&str> = right
                .split_whitespace()
                .filter(|link| {
                    let ends = link.split('(').next().unwrap();
                    !deletes || !ends.split("->").any(|end| end == gone)
                })
                .collect();
            let strict = if deletes && strict { "strict " } else { "" };
            let condition = condition.map_or(String::new(), |c| format!("precondition {{ {c} }}"));
            let effects = if effects.is_empty() {
                String::new()
            } else {
                format!("effect {{ {} }}", effects.join(" "))
            };
            format!(
                "{strict}r{number} : {cost} {{ {{ {} {left} }} => {{ {} {} }} {condition} {effects} }}",
                nodes.join(" "),
                nodes[..kept].join(" "),
                right.join(" "),
            )
        })
}

fn grammar_text() -> impl Strategy<Value = String> {
    (2..=4usize)
        .prop_flat_map(|count| (0..count).map(rule).collect::<Vec<_>>())
        .prop_map(|rules| {
            format!(
                "name=random\n===\ntypes {{ (x) (y) (z : x) }}\n===\n{}\n",
                rules.join("\n")
            )
        })
}

fn state() -> impl Strategy<Value = State> {
    let node = (type_name(), prop::option::of(0..2i64));
    (
        prop::collection::vec(node, 2..=4),
        prop::collection::btree_set((0..4usize, 0..2usize, 0..4usize), 0..4),
    )
        .prop_map(|(nodes, links)| {
            let count = nodes.len();
            let nodes = nodes.into_iter().enumerate();
            State {
                links: links
                    .into_iter()
                    .filter(|&(from, _, to)| from < count && to < count)
                    .map(|(from, label, to)| {
                        (
                            format!("n{from}"),
                            ["p", "q"][label].to_owned(),
                            format!("n{to}"),
                        )
                    })
                    .collect(),
                nodes: nodes
                    .map(|(i, (t, level))| (format!("n{i}"), t.to_owned(), level))
                    .collect(),
            }
        })
}

fn goal_text() -> impl Strategy<Value = String> {
    (
        prop::bool::ANY,
        type_name(),
        links(2, 2, 4),
        prop::option::weighted(0.2, formula("b")),
    )
        .prop_map(|(constant, type_name, links, condition)| {
            let condition = condition.map_or(String::new(), |c| format!("precondition {{ {c} }}"));
            let text = format!("{{ a:x b:{type_name} {links} }} {condition}");
            if constant {
                text.replace("b:", "\"n1\":")
                    .replace("->b", "->\"n1\"")
                    .replace(" b->", " \"n1\"->")
            } else {
                text
            }
        })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 120, max_global_rejects: 20_000, ..ProptestConfig::default() })]

    #[test]
    fn plans_are_those_that_trying_everything_finds(
        text in grammar_text(), start in state(), wanted in goal_text(),
    ) {
        let (grammar, diagnostics) = grammar::parse_grammar(&text, "random.aggl");
        prop_assume!(!grammar::has_errors(&diagnostics));
        let Ok(wanted) = grammar::parse_goal(&wanted, "goal", &grammar.types) else {
            return Err(TestCaseError::reject("goal"));
        };
        let Ok(least) = brute_force(&grammar, &start, &wanted) else {
            return Err(TestCaseError::reject("too many states"));
        };
        let graph = start.graph(&grammar);
        let snapshot = graph.snapshot();
        // As ever, and as where there are too many actions to make any.
        let efforts = [(1000, Effort::First), (1000, Effort::Anytime), (1000, Effort::Optimal), (0, Effort::First)];
        for (many, effort) in efforts {
            let options = Options { effort, ..Options::default() };
            let limits = &mut Limits::new().with_expansions(100_000);
            let outcome = plan_above(many, &grammar, &snapshot, &wanted, &options, limits).unwrap();
            let expected = if least.is_some() { Status::Solved } else { Status::Unsolvable };
            prop_assert_eq!(outcome.status, expected, "{:?}", outcome);
            if outcome.optimal {
                prop_assert_eq!(outcome.cost, least);
            } else {
                prop_assert!(effort == Effort::First || least.is_none());
            }
        }
        // The store carries the plans out and the goal holds.
        for many in [1000, 0] {
            if least.is_none() {
                break;
            }
            let mut graph = start.graph(&grammar);
            let limits = &mut Limits::new();
            let (snapshot, options) = (graph.snapshot(), Options::default());
            let outcome = plan_above(many, &grammar, &snapshot, &wanted, &options, limits).unwrap();
            for step in outcome.steps {
                let mut transaction = Transaction::new();
                let binding = step.binding.into_iter().map(|(v, n)| (v, n.into()));
                transaction.apply_rule(&step.rule, binding.collect());
                graph.commit(&transaction, "test", Time::default()).unwrap();
            }
            let snapshot = graph.snapshot();
            prop_assert!(grammar.goal_holds(&snapshot, &wanted).unwrap().is_some());
        }
    }

    #[test]
    fn the_simulator_foresees_what_the_store_does(text in grammar_text(), start in state()) {
        let (grammar, diagnostics) = grammar::parse_grammar(&text, "random.aggl");
        prop_assume!(!grammar::has_errors(&diagnostics));
        let wanted = goal(&grammar, "{ a:x }");
        let graph = start.graph(&grammar);
        let snapshot = graph.snapshot();
        let problem = super::Problem::read(&grammar, &snapshot, &wanted, 0).unwrap();
        for rule in &grammar.rules {
            let operator = problem.operator(&rule.name).unwrap();
            let nodes: Vec<u32> = (0..problem.world.nodes.len() as u32).collect();
            let bound = problem.program.operators[operator].bound;
            for choice in 0..nodes.len().pow(bound as u32) {
                let mut environment = problem.program.operators[operator].environment();
                let mut rest = choice;
                for slot in &mut environment[..bound] {
                    *slot = (rest % nodes.len()) as u32;
                    rest /= nodes.len();
                }
                let distinct = (0..bound).all(|i| !environment[..i].contains(&environment[i]));
                let binding: Binding = rule
                    .bound_nodes()
                    .zip(&environment)
                    .map(|(node, &o)| (node.variable.clone(), problem.world.nodes[o as usize]))
                    .collect();
                let stored = grammar.obstacle(&snapshot, rule, &binding).unwrap();
                let foreseen = simulate::testing::obstacle(
                    &problem.program.operators[operator],
                    &mut environment,
                    &problem.world.facts,
                    problem.words(),
                );
                if !distinct {
                    continue;
                }
                prop_assert_eq!(stored.is_some(), foreseen.is_some(), "{:?} {:?}", stored, foreseen);
                let mut facts = problem.world.facts.clone();
                let operator = &problem.program.operators[operator];
                for created in &mut environment[operator.bound..operator.variables.len()] {
                    *created = facts.add_object();
                }
                let changes =
                    simulate::changes(&problem.program, operator, &mut environment, &facts);
                let mut after = start.graph(&grammar);
                let mut transaction = Transaction::new();
                transaction.apply_rule(&rule.name, binding.to_refs());
                let taken = after.commit(&transaction, "test", Time::default()).is_ok();
                if stored.is_none() {
                    prop_assert_eq!(taken, changes.is_some());
                }
                let (true, Some(changes)) = (taken, changes) else {
                    continue;
                };
                let after = State::of(&after);
                simulate::testing::apply(&changes, &mut facts);
                let mut links = Vec::new();
                for (label, name) in problem.program.vocabulary.labels.iter() {
                    for &(from, to) in facts.pairs(label) {
                        if [from, to].iter().any(|end| !nodes.contains(end)) {
                            continue;
                        }
                        let ends = [from, to].map(|o| problem.name(o).to_owned());
                        let [from, to] = ends;
                        links.push((from, name.to_owned(), to));
                    }
                }
                links.sort();
                let in_world = |name: &String| problem.world.object_named(name).is_some();
                let known = |link: &&(String, String, String)| {
                    problem.program.vocabulary.labels.find(&link.1).is_some()
                        && in_world(&link.0)
                        && in_world(&link.2)
                };
                let stored: Vec<_> = after.links.iter().filter(known).cloned().collect();
                prop_assert_eq!(links, stored);
                let mut types: Vec<(String, String)> = Vec::new();
                for &object in &nodes {
                    for &exact in facts.types(object) {
                        let exact = problem.program.vocabulary.types.name(exact).to_owned();
                        types.push((problem.name(object).to_owned(), exact));
                    }
                }
                let stored = after.nodes.iter().filter(|n| in_world(&n.0));
                let stored: Vec<_> = stored.map(|n| (n.0.clone(), n.1.clone())).collect();
                prop_assert_eq!(types, stored);
            }
        }
    }
}

#[test]
fn the_random_grammars_make_plans_of_several_steps() {
    // Else the properties above would prove little.
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let mut steps = [0; 4];
    for _ in 0..1500 {
        let mut draw =
            |strategy: BoxedStrategy<String>| strategy.new_tree(&mut runner).unwrap().current();
        let (text, wanted) = (draw(grammar_text().boxed()), draw(goal_text().boxed()));
        let (grammar, diagnostics) = grammar::parse_grammar(&text, "random.aggl");
        let Ok(wanted) = grammar::parse_goal(&wanted, "goal", &grammar.types) else {
            continue;
        };
        if grammar::has_errors(&diagnostics) {
            continue;
        }
        let start = state().new_tree(&mut runner).unwrap().current();
        let graph = start.graph(&grammar);
        let limits = &mut Limits::new().with_expansions(1000);
        let options = Options::default();
        let outcome = crate::plan(&grammar, &graph.snapshot(), &wanted, &options, limits).unwrap();
        if outcome.status == Status::Solved {
            steps[outcome.steps.len().min(3)] += 1;
        }
    }
    assert!(steps.iter().all(|&count| count >= 10), "{steps:?}");
}
