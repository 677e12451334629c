//! Rules that change in a graph, and rules that wake.

use super::{AWAKE, NODE, Published, RULES};
use crate::testing::read;
use crate::{Grammar, parse_grammar};
use dsr::{Graph, Refusal, Schema, Time, Transaction};
use std::sync::Arc;

const EGG: &str = "name=eggs
===
lay : active(1) activates(hatch, hatch) { { h:hen } => { h:hen e:egg } }
dormant hatch : active(1) { { e:egg } => { e:chick } }
both : active(1) { lay as l  hatch as h  where: l.e = h.e }
";

fn farm(grammar: &Grammar) -> Graph {
    let mut graph = crate::testing::graph(&[("hen", "berta"), ("egg", "first")], &[]);
    graph.set_rules(Arc::new(grammar.clone()));
    graph
}

fn try_rule(graph: &mut Graph, rule: &str, binding: &[(&str, &str)]) -> Result<(), String> {
    let mut transaction = Transaction::new();
    let binding = binding.iter().map(|(v, n)| ((*v).to_owned(), (*n).into()));
    transaction.apply_rule(rule, binding.collect());
    let done = graph.commit(&transaction, "test", Time::default());
    done.map(|_| ()).map_err(|refusal| refusal.to_string())
}

fn publish(graph: &mut Graph, grammar: &Grammar) -> Result<(), Refusal> {
    let transaction = grammar.publish(&graph.snapshot()).unwrap();
    graph
        .commit(&transaction, "test", Time::default())
        .map(|_| ())
}

#[test]
fn a_dormant_rule_sleeps_until_a_rule_that_activates_it_is_applied() {
    let grammar = read(EGG);
    let mut graph = farm(&grammar);
    let asleep = "rule `hatch` is not applicable: `hatch` is dormant and has not been activated";
    assert_eq!(
        try_rule(&mut graph, "hatch", &[("e", "first")]),
        Err(asleep.to_owned())
    );
    assert_eq!(try_rule(&mut graph, "lay", &[("h", "berta")]), Ok(()));
    let awake = grammar.awake(&graph.snapshot()).unwrap();
    assert_eq!(awake.into_iter().collect::<Vec<_>>(), ["hatch"]);
    assert_eq!(try_rule(&mut graph, "hatch", &[("e", "first")]), Ok(()));
    // It stays awake, and is not woken twice.
    let version = |graph: &Graph| {
        let snapshot = graph.snapshot();
        let node = snapshot.find_node_by_name(NODE).unwrap().unwrap();
        let awake = snapshot.schema().find_attribute(AWAKE).unwrap();
        node.attribute(awake).unwrap().unwrap().version
    };
    let before = version(&graph);
    assert_eq!(try_rule(&mut graph, "lay", &[("h", "berta")]), Ok(()));
    assert_eq!(version(&graph), before);
}

#[test]
fn a_combo_wakes_its_own_later_steps() {
    let grammar = read(EGG);
    let mut graph = farm(&grammar);
    assert_eq!(try_rule(&mut graph, "both", &[("h", "berta")]), Ok(()));
    let lines = crate::testing::describe(&graph);
    assert!(lines.contains(&"chick_1:chick".to_owned()), "{lines:?}");
}

#[test]
fn published_rules_hold_from_the_commit_on_and_bad_ones_change_nothing() {
    let grammar = read(EGG);
    let mut graph = farm(&grammar);
    publish(&mut graph, &grammar).unwrap();
    try_rule(&mut graph, "lay", &[("h", "berta")]).unwrap();

    let better = EGG.replace("{ e:chick }", "{ e:duck }");
    publish(&mut graph, &read(&better)).unwrap();
    let published = Published::find(&graph.snapshot()).unwrap().unwrap();
    assert_eq!(
        Published::version(&graph.snapshot()).unwrap(),
        Some(published.version)
    );
    assert_eq!(
        published.read(graph.snapshot().schema()).unwrap().rules,
        read(&better).rules
    );
    // What was awake stays so.
    try_rule(&mut graph, "hatch", &[("e", "first")]).unwrap();
    assert!(crate::testing::describe(&graph).contains(&"first:duck".to_owned()));

    let before = crate::testing::describe(&graph);
    let mut bad = Transaction::new();
    bad.create_node("hen", "another", vec![]);
    bad.set(
        NODE,
        RULES,
        "name=bad\n===\nlay : active(1) { { h:hen } => { h:hen x->h(by) } }\n",
    );
    let refusal = graph
        .commit(&bad, "test", Time::default())
        .unwrap_err()
        .to_string();
    assert!(
        refusal.contains("grammar:3:40: error: no variable `x`"),
        "{refusal}"
    );
    assert_eq!(crate::testing::describe(&graph), before);
    try_rule(&mut graph, "lay", &[("h", "berta")]).unwrap();

    // A rule that is made dormant goes to sleep, though it was awake under its old name.
    let sleepy = EGG.replace("hatch", "emerge");
    publish(&mut graph, &read(&sleepy)).unwrap();
    assert!(try_rule(&mut graph, "emerge", &[("e", "egg_1")]).is_err());
}

#[test]
fn rules_that_do_not_fit_the_schema_are_refused() {
    let schema = "[types]\nhen = []\negg = []\nchick = []\ngrammar = []\n[attributes]\n\
                  rules = { kind = \"string\" }\nawake = { kind = \"string\" }\n";
    let mut graph = Graph::in_memory(Schema::from_toml("schema", schema).unwrap());
    graph.set_rules(Arc::new(read(EGG)));
    publish(&mut graph, &read(EGG)).unwrap();
    let ducks = read(&EGG.replace("chick", "duck"));
    let refusal = publish(&mut graph, &ducks).unwrap_err().to_string();
    assert!(
        refusal.contains("the schema has no type `duck`"),
        "{refusal}"
    );
}

#[test]
fn the_whole_text_says_what_all_files_say() {
    let mut loader = |path: &str, _: &str| {
        let text = "name=b\n===\ntypes { (cup : thing) (mug : cup) }\n===\n\
                    use : active(1) { { c:cup } => { c:cup c->c(used) } }\n";
        Ok(crate::SourceFile::new(path, text))
    };
    let text = "name=a\n===\ntypes { (thing) (cup : gear) }\n===\ninclude(b.aggl)\n\
                break : active(2) { { c:mug } => { } }\n\
                both : active(1) { use as u  break as b  where: u.c = b.c }\n";
    let (grammar, diagnostics) = crate::load_grammar(text, "a.aggl", &mut loader);
    assert!(diagnostics.is_empty(), "{diagnostics:?}");
    let (whole, diagnostics) = parse_grammar(&grammar.whole_text(), "whole");
    assert!(diagnostics.is_empty(), "{diagnostics:?}");
    assert_eq!(
        (&whole.rules, &whole.combos),
        (&grammar.rules, &grammar.combos)
    );
    assert_eq!(whole.unfolded, grammar.unfolded);
    for (sub, ancestor) in [("mug", "thing"), ("cup", "gear"), ("thing", "cup")] {
        let known = grammar.types.is_subtype(sub, ancestor);
        assert_eq!(
            whole.types.is_subtype(sub, ancestor),
            known,
            "{sub} {ancestor}"
        );
    }
}
