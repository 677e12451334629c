//! Unfolded combos against their steps, carried out one by one on random small graphs.

use super::unfold;
use crate::testing::oracle::{Assignment, Model, TYPES};
use crate::testing::random::FEW;
use crate::testing::repair::repaired;
use crate::{
    Binding, Combo, ComboStep, ComboVariable, Grammar, Kind, Name, PatternEdge, Rule, Unfolded,
    parse_grammar,
};
use expect_test::expect;
use proptest::prelude::*;
use std::collections::BTreeMap;

/// Two or three rules in a row, some of their variables the same.
fn grammars() -> impl Strategy<Value = Grammar> {
    let rules = prop::collection::vec(FEW.rule(), 2..4);
    let same = prop::collection::vec((0..3_usize, 0..4_usize, 0..3_usize, 0..4_usize), 0..5);
    (rules, same, prop::bool::ANY).prop_map(|(rules, same, optional)| {
        let (mut grammar, _) = parse_grammar(TYPES, "types.aggl");
        for (index, rule) in rules.into_iter().enumerate() {
            let mut rule = repaired(rule);
            rule.name = Name::from(format!("r{index}").as_str());
            // A `pot` is a `box` by the schema alone, which unfolding does not know.
            let pots = |nodes: &mut Vec<crate::PatternNode>| {
                nodes.truncate(2);
                for node in nodes.iter_mut().filter(|node| node.type_name == "pot") {
                    node.type_name = "tool".into();
                }
            };
            pots(&mut rule.left.nodes);
            pots(&mut rule.right.nodes);
            pots(&mut rule.parameters);
            rule.left.edges.truncate(2);
            rule.effect.truncate(1);
            grammar.rules.push(repaired_as(rule));
        }
        let alias = |index: usize| Name::from(format!("s{index}").as_str());
        let steps = (0..grammar.rules.len()).map(|index| ComboStep {
            rule: grammar.rules[index].name.clone(),
            alias: alias(index),
            optional: optional && index == 1,
        });
        let part = |step: usize, variable: usize| {
            let rule = grammar.rules.get(step)?;
            let mut variables: Vec<&Name> = Vec::new();
            for node in rule.bound_nodes().chain(&rule.right.nodes) {
                if !variables.contains(&&node.variable) {
                    variables.push(&node.variable);
                }
            }
            let variable = (*variables.get(variable % variables.len().max(1))?).clone();
            Some(ComboVariable {
                alias: alias(step),
                variable,
            })
        };
        let equalities = same
            .iter()
            .filter_map(|&(a, x, b, y)| Some(vec![part(a, x)?, part(b, y)?]))
            .filter(|pair| pair[0].alias != pair[1].alias)
            .collect();
        let combo = Combo {
            name: "all".into(),
            cost: 1.0,
            kind: Kind::Active,
            steps: steps.collect(),
            equalities,
            comments: Vec::new(),
        };
        grammar.combos.push(combo);
        grammar
    })
}

fn repaired_as(rule: Rule) -> Rule {
    let name = rule.name.clone();
    Rule {
        name,
        ..repaired(rule)
    }
}

/// The steps one by one; `None` where one of them cannot be applied.
fn in_turn(grammar: &Grammar, whole: &Unfolded, model: &Model, at: &Assignment) -> Option<Model> {
    let mut model = model.clone();
    let mut at = at.clone();
    for step in &whole.steps {
        let rule = grammar.own_rule(&step.rule)?;
        let name_of = |variable: &Name| {
            let (_, unfolded) = step.variables.iter().find(|(own, _)| own == variable)?;
            at.get(&**unfolded).cloned()
        };
        let mut own = Assignment::new();
        for node in rule.bound_nodes() {
            let name = name_of(&node.variable)?;
            // A node that an earlier step deleted.
            model.nodes.get(&name)?;
            own.insert(node.variable.to_string(), name);
        }
        if !model.rule_holds(rule, &own) {
            return None;
        }
        let before = model.clone();
        let (after, with_created) = model.rewritten(rule, &own)?;
        model = after;
        for (own, unfolded) in &step.variables {
            if let Some(name) = with_created.get(&**own) {
                at.insert(unfolded.to_string(), name.clone());
            }
        }
        // A link that comes back later is kept with its attributes.
        for (key, value) in before.link_values {
            model.link_values.entry(key).or_insert(value);
        }
    }
    let Model {
        links, link_values, ..
    } = &mut model;
    link_values.retain(|(link, _), _| links.contains(link));
    Some(model)
}

/// The model with the nodes that `before` does not have called by what they are joined to.
fn canonical(before: &Model, after: &Model) -> Vec<Vec<String>> {
    let created: Vec<&String> = after
        .nodes
        .keys()
        .filter(|name| !before.nodes.contains_key(*name))
        .collect();
    let mut texts = Vec::new();
    permutations(created.len(), &mut Vec::new(), &mut |order| {
        let names: BTreeMap<&String, String> = created
            .iter()
            .zip(order)
            .map(|(name, n)| (*name, format!("new{n}")))
            .collect();
        let name = |name: &String| names.get(name).unwrap_or(name).clone();
        let mut lines: Vec<String> = after
            .nodes
            .iter()
            .map(|(n, t)| format!("{}:{t}", name(n)))
            .collect();
        lines.extend(
            after
                .links
                .iter()
                .map(|(f, l, t)| format!("{}-{l}>{}", name(f), name(t))),
        );
        lines.extend(
            after
                .values
                .iter()
                .map(|((n, a), v)| format!("{}.{a}={v:?}", name(n))),
        );
        lines.extend(
            after
                .link_values
                .iter()
                .map(|(((f, l, t), a), v)| format!("{}-{l}>{}.{a}={v:?}", name(f), name(t))),
        );
        lines.sort();
        texts.push(lines);
    });
    texts.sort();
    texts.truncate(1);
    texts
}

fn permutations(length: usize, chosen: &mut Vec<usize>, visit: &mut impl FnMut(&[usize])) {
    if chosen.len() == length {
        visit(chosen);
    }
    for next in 0..length {
        if !chosen.contains(&next) {
            chosen.push(next);
            permutations(length, chosen, visit);
            chosen.pop();
        }
    }
}

proptest! {
    #![proptest_config(crate::testing::cases(400))]

    #[test]
    fn an_unfolded_combo_does_what_its_steps_do(
        models in prop::collection::vec(Model::strategy(), 3),
        grammar in grammars(),
    ) {
        let (unfolded, _) = unfold(&grammar);
        for whole in &unfolded {
            for model in &models {
                for at in model.assignments(&whole.rule) {
                    let distinct: std::collections::BTreeSet<&String> = at.values().collect();
                    if distinct.len() < at.len() {
                        continue;
                    }
                    let expected = in_turn(&grammar, whole, model, &at);
                    let holds = model.rule_holds(&whole.rule, &at);
                    let found = if holds { model.applied(&whole.rule, &at) } else { None };
                    let new = |m: &Model| m.nodes.keys().filter(|n| !model.nodes.contains_key(*n)).count();
                    if expected.as_ref().is_some_and(|m| new(m) > 5) {
                        continue;
                    }
                    prop_assert_eq!(
                        found.map(|m| canonical(model, &m)),
                        expected.map(|m| canonical(model, &m)),
                        "{} at {:?} of {}\n{:?}", whole.rule, at, grammar, model
                    );
                }
            }
        }
    }
}

/// The rule with what the goal of a hierarchical one asks for as its left side, read off the rule itself.
fn aimed_at(rule: &Rule) -> Rule {
    let mut aim = rule.clone();
    let kept = |name: &Name| {
        let only_left = rule.left.node(name).is_some() && rule.right.node(name).is_none();
        !only_left
    };
    aim.left = rule.right.clone();
    aim.parameters.retain(|node| kept(&node.variable));
    for edge in &rule.left.edges {
        let again = rule.right.edge(&edge.from, &edge.label, &edge.to).is_some();
        if !edge.negated && !again && kept(&edge.from) && kept(&edge.to) {
            aim.left.edges.push(PatternEdge {
                negated: true,
                ..edge.clone()
            });
        }
    }
    // A node that changes its type has the new one in the end.
    aim.parameters
        .retain(|node| rule.right.node(&node.variable).is_none());
    aim.precondition = None;
    let known: Vec<Name> = aim
        .bound_nodes()
        .map(|node| node.variable.clone())
        .collect();
    let known = |edge: &PatternEdge| known.contains(&edge.from) && known.contains(&edge.to);
    aim.left.edges.retain(known);
    aim
}

proptest! {
    #![proptest_config(crate::testing::cases(300))]

    #[test]
    fn a_hierarchical_rule_aims_at_what_it_would_bring_about(
        rule in FEW.rule(),
        model in Model::strategy(),
    ) {
        let mut rule = repaired(rule);
        rule.hierarchical = true;
        rule.effect.clear();
        let (mut grammar, _) = parse_grammar(TYPES, "types.aggl");
        grammar.rules.push(rule.clone());
        let aim = aimed_at(&rule);
        let graph = model.to_graph();
        let snapshot = graph.snapshot();
        let matches = grammar.matches(&snapshot, &rule, &Binding::new()).unwrap();
        for found in matches.take(4) {
            let found = found.unwrap();
            let name = |id| snapshot.find_node(id).unwrap().unwrap().name().unwrap();
            let named: Assignment =
                found.iter().map(|(variable, id)| (variable.to_string(), name(id))).collect();
            let goal = grammar.subgoal(&snapshot, &rule, &found).unwrap();
            // It is met now where the nodes that are kept, and any for those that are made, are as wanted.
            let same = |at: &Assignment| {
                at.iter().all(|(variable, node)| named.get(variable).is_none_or(|n| n == node))
            };
            let mut all = model.assignments(&aim).into_iter();
            let expected = all.any(|at| same(&at) && model.rule_holds(&aim, &at));
            let met = grammar.goal_holds(&snapshot, &goal).unwrap().is_some();
            prop_assert_eq!(met, expected, "{}{}", rule, goal);
            // It is met once the rule was applied.
            if let Ok(operations) = grammar.apply(&snapshot, &rule.name, &found) {
                let mut after = model.to_graph();
                let change = dsr::Transaction { operations, ..dsr::Transaction::new() };
                after.commit(&change, "test", dsr::Time::default()).unwrap();
                let met = grammar.goal_holds(&after.snapshot(), &goal).unwrap();
                prop_assert!(met.is_some(), "{rule}{goal}");
            }
        }
    }
}

/// What is reported about a grammar.
fn told(text: &str, expected: &expect_test::Expect) {
    let (_, diagnostics) = crate::parse_grammar(text, "f.aggl");
    expected.assert_eq(&crate::Defects { diagnostics }.to_string());
}

#[test]
fn a_combo_that_is_never_whole_is_told_where_it_breaks() {
    let rules = "name=x\n===\ndrop : active(1) { { c:cup } => { } }\n\
                 wash : active(1) { { c:cup } => { c:cup } effect { (assign c.clean true) } }\n";
    told(
        &format!(
            "{rules}both : active(1) {{\ndrop as d optional\nwash as w\nwhere:\nd.c = w.c\n}}\n"
        ),
        &expect![
            "f.aggl:7:9: warning: this combo is never applied with all its steps: step `w` uses `c`, which an earlier step deletes"
        ],
    );
    // Without the optional step's node being the same, nothing is wrong.
    told(
        &format!("{rules}both : active(1) {{\ndrop as d optional\nwash as w\n}}\n"),
        &expect![[""]],
    );
}
