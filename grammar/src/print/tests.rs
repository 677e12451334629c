//! Printed text reads back as what was printed, whatever it was.

use crate::testing::random::{AWKWARD, soup};
use crate::testing::{CARE, read};
use crate::{Defects, Types, parse_goal, parse_grammar};
use expect_test::expect;
use proptest::prelude::*;

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
