//! Printed text reads back as what was printed, whatever it was.
#![allow(clippy::needless_raw_string_hashes, reason = "expect-test writes them")]

use crate::testing::random::{AWKWARD, soup};
use crate::testing::{CARE, read};
use crate::{Binding, Defects, Types, parse_goal, parse_grammar};
use dsr::{Graph, Schema, Time, Transaction, Value};
use expect_test::expect;
use proptest::prelude::*;

#[test]
fn costs_and_durations_that_are_no_amounts_are_told() {
    let text = "name=x\n===\na : active(1) cost (- 1 5) { { a:t } => { } }\n\
         b : active(1) duration (/ 1 0) { { a:t } => { } }\nc : active(1) cost (\"x\") { { a:t } => { } }\n\
         d : active(1) cost (- a.n 5) duration (* 2 3) { { a:t } => { } }\n";
    let (_, diagnostics) = parse_grammar(text, "f.aggl");
    expect![[r#"
            f.aggl:3:20: error: the cost must be a number of 0 or more, not (- 1 5)
            f.aggl:4:24: error: the duration in seconds must be a number of 0 or more, not (/ 1 0)
            f.aggl:5:21: error: this takes numbers, not text"#]]
    .assert_eq(&Defects { diagnostics }.to_string());
}

#[test]
fn whole_numbers_are_exact_from_the_least_to_the_largest() {
    let schema = "open = true\n[attributes]\nn = { kind = \"u64\", index = true }\n";
    let schema = Schema::from_toml("schema", schema).unwrap();
    for number in [u64::MAX, u64::MAX - 1, 1 << 63, i64::MAX as u64] {
        let text = format!(
            "r : active({number}) {{ {{ a:t }} => {{ a:t }} \
             precondition {{ (= a.n {number}) }} effect {{ (assign a.m {number}) }} }}\n"
        );
        let grammar = read(&format!("name=x\n===\n{text}"));
        assert_eq!(grammar.analyse(None).len(), 0);
        let rule = &grammar.rules[0];
        assert_eq!(
            read(&grammar.to_string()).rules[0].precondition,
            rule.precondition
        );
        assert!(rule.to_string().contains(&format!("(assign a.m {number})")));
        let mut graph = Graph::in_memory(schema.clone());
        let mut world = Transaction::new();
        for value in [number, number - 1] {
            let name = value.to_string();
            world.create_node("t", &name, vec![]);
            world.set(name.as_str(), "n", value);
        }
        graph.commit(&world, "test", Time::default()).unwrap();
        let snapshot = graph.snapshot();
        let found = grammar.matches(&snapshot, rule, &Binding::new()).unwrap();
        let found: Vec<Binding> = found.map(Result::unwrap).collect();
        let node = snapshot
            .find_node_by_name(&number.to_string())
            .unwrap()
            .unwrap();
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].get("a"), Some(node.id()));
        let operations = grammar.apply(&snapshot, "r", &found[0]).unwrap();
        let change = Transaction {
            operations,
            ..Transaction::new()
        };
        graph.commit(&change, "test", Time::default()).unwrap();
        let snapshot = graph.snapshot();
        let node = snapshot.find_node(node.id()).unwrap().unwrap();
        let value = node.value("m").unwrap().unwrap();
        let as_i64 = i64::try_from(number).map(Value::I64);
        assert_eq!(value, as_i64.unwrap_or(Value::U64(number)));
    }
    let least = read(
        "name=x\n===\nr : active(1) { { a:t } => { a:t } precondition { (> a.n -9223372036854775808) } }\n",
    );
    assert!(least.to_string().contains("(> a.n -9223372036854775808)"));
}

#[test]
fn whole_numbers_beyond_all_values_are_refused_at_their_place() {
    for number in ["18446744073709551616", "-9223372036854775809"] {
        let text = format!(
            "name=x\n===\nr : active(1) {{ {{ a:t }} => {{ a:t }} precondition {{ (> a.n {number}) }} }}\n"
        );
        let (_, defects) = parse_grammar(&text, "test.aggl");
        let told = defects[0].to_string();
        assert!(
            told.starts_with("a whole number must be from -9223372036854775808"),
            "{told}"
        );
        assert!(told.ends_with(&format!("not {number}")), "{told}");
        assert_eq!(&text[defects[0].span.start..defects[0].span.end], number);
        // With a point it is a real, and digits name a node.
        let text = text.replace(number, &format!("{number}.0"));
        assert_eq!(parse_grammar(&text, "test.aggl").1.len(), 0);
    }
    let long =
        "name=x\n===\nr : active(1) { { 18446744073709551616:t } => { 18446744073709551616:t } }\n";
    assert_eq!(parse_grammar(long, "test.aggl").1.len(), 0);
}

#[test]
fn a_rule_in_canonical_form() {
    let text = "
        # makes room
        name = x
        ===
        # about moving
        move:active( 2 )success(.5)";
    let (_, diagnostics) = parse_grammar(text, "x");
    assert!(!diagnostics.is_empty(), "`.5` is no number");
    let grammar = read(
        "name = x\n===\n# about moving\nstrict move:active( 2 )success(0.5) cost((+ a.n 1))
        activates(move){ { a:box(1,-2.5) b:box a->b(on) b->b(free)* } # why not
        => { a:box b:box } precondition { (!= a b) (>= a.n 1.0) } effect { (and (not (on b a))
        (forall c:box (when (and (on c a) (not (= c b))) (assign c.note \"moved\")))) } }",
    );
    expect![[r#"
        name=x
        ===

        # about moving
        # why not
        strict move : active(1) success(0.5) activates(move) cost(+ a.n 1)
        {
        	{
        		a:box(1,-2.5)
        		b:box
        		a->b(on)
        		b->b(free)*
        	}
        	=>
        	{
        		a:box
        		b:box
        	}
        	precondition
        	{
        		(and (not (= a b)) (>= a.n 1.0))
        	}
        	effect
        	{
        		(and
        			(not (on b a))
        			(forall c:box
        				(when (and (on c a) (not (= c b))) (assign c.note "moved"))
        			)
        		)
        	}
        }
    "#]]
    .assert_eq(&grammar.to_string());
}

#[test]
fn canonical_text_does_not_change_any_more() {
    let once = read(CARE).to_string();
    assert_eq!(read(&once).to_string(), once);
    assert_eq!(read(&once), read(CARE));
}

proptest! {
    #[test]
    fn what_is_printed_reads_back(grammar in AWKWARD.grammar()) {
        let text = grammar.to_string();
        let (back, diagnostics) = parse_grammar(&text, "printed.aggl");
        prop_assert!(back == grammar, "{text}\n{}\n{}", back, Defects { diagnostics });
    }

    #[test]
    fn whatever_can_be_read_prints_and_reads_back(text in soup()) {
        let (read, _) = parse_grammar(&text, "soup.aggl");
        let printed = read.to_string();
        let (back, _) = parse_grammar(&printed, "printed.aggl");
        prop_assert_eq!(back, read, "{}", printed);
    }

    #[test]
    fn no_text_makes_the_parser_panic(text in any::<String>()) {
        let (grammar, diagnostics) = parse_grammar(&text, "noise.aggl");
        prop_assert!(!diagnostics.is_empty() || text.contains("==="), "{:?}", grammar);
        for diagnostic in diagnostics {
            prop_assert!(diagnostic.span.start <= diagnostic.span.end);
            prop_assert!(text.get(diagnostic.span.start..diagnostic.span.end).is_some());
        }
    }

    #[test]
    fn goals_read_back(text in soup()) {
        let text = format!("{{ 1:t \"two\":t a:t 1->a(l) }} precondition {{ {text}");
        if let Ok(goal) = parse_goal(&text, "soup.aggt", &Types::default()) {
            let printed = goal.to_string();
            let back = parse_goal(&printed, "printed.aggt", &Types::default());
            prop_assert_eq!(back, Ok(goal), "{}", printed);
        }
    }
}
