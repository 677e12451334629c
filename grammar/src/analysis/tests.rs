//! Analyses of written rules, and critical pairs against every small graph.
#![allow(clippy::needless_raw_string_hashes, reason = "expect-test writes them")]

use crate::testing::oracle::Model;
use crate::testing::random::{AWKWARD, FEW, soup};
use crate::testing::repair::repaired;
use crate::testing::{CARE, care_centre, read};
use crate::{Defects, Diagnostic, Problem, parse_grammar};
use dsr::Schema;
use expect_test::{Expect, expect};
use proptest::prelude::*;

fn check(diagnostics: Vec<Diagnostic>, expected: &Expect) {
    expected.assert_eq(&Defects { diagnostics }.to_string());
}

#[test]
fn rules_that_never_match_and_variables_that_do_nothing_are_told() {
    let text = "name=x
===
same : active(1) { { a:t b:t a->b(l) } => { a:t b:t a->b(l) } precondition { (= a b) } }
both : active(1) { { a:t a->a(l) } => { a:t } precondition { (not (l a a)) } }
none : active(1) { { a:t a->a(l) } => { a:t } precondition { (and (> a.n 5) (<= a.n 5)) } }
some : active(1) { { a:t a->a(l) } => { a:t } precondition { (and (> a.n 5) (<= a.n 6)) } }
text : active(1) { { a:t a->a(l) } => { a:t } precondition { (or (= 1 2) (= a.s \"x\")) } }
idle : active(1) { { a:t b:t a->a(l) } => { a:t b:t } precondition { (exists u:t v:t (l a v)) } }
lone : active(1) { { a:t a->a(l) } => { a:t } precondition { (exists u:t (l a a)) } }
any : active(1) { { a:t a->a(l) } => { a:t } precondition { (exists u:t (and)) } }
dormant deep : active(1) { { a:t a->a(l) } => { a:t } }
";
    check(
        read(text).analyse(None),
        &expect![[r#"
            test.aggl:3:1: warning: this rule never matches: (= a b) never holds
            test.aggl:4:1: warning: this rule never matches: `a->a(l)` would have to be there and not
            test.aggl:5:1: warning: this rule never matches: no `a.n` is (> 5) and (<= 5)
            test.aggl:8:26: warning: nothing uses `b`: it only asks for one more `t`
            test.aggl:8:78: warning: nothing uses `u`: it only asks for one more `t`
            test.aggl:9:70: warning: nothing uses `u`: it only asks for one more `t`
            test.aggl:11:9: warning: this rule can never be applied: it is dormant, and no rule activates it"#]],
    );
}

/// What is said of a rule with nodes `a` and `b` of a type, a link `l` between them, and this precondition.
fn said(precondition: &str, schema: Option<&Schema>) -> Vec<String> {
    let text = format!(
        "name=x\n===\nr : active(1) {{ {{ a:t b:t a->b(l) b->a(l)* }} => {{ a:t b:t }} \
         precondition {{ {precondition} }} }}\n"
    );
    let found = read(&text).analyse(schema);
    found.iter().map(ToString::to_string).collect()
}

#[test]
fn what_is_assigned_to_links_that_need_not_be_there_is_told() {
    let text = "name=x
===
a : active(1) { { a:t b:t a->b(l) } => { a:t b:t a->b(l) }
 effect { (assign e(a, l, b).d 1) (assign e(b, l, a).d 1) } }
b : active(1) { { a:t b:t a->b(l) } => { a:t b:t } effect { (assign e(a, l, b).d 1) } }
c : active(1) { { a:t b:t } => { a:t b:t } precondition { (> e(a, l, b).d 2) }
 effect { (assign e(a, l, b).d 1) (l b a) (assign e(b, l, a).d 1) } }
d : active(1) { { a:t } => { a:t } effect { (forall q:t (when (l a q) (assign e(a, l, q).d 1))) } }
e : active(1) { { a:t } => { a:t } effect { (forall q:t (assign e(a, l, q).d (+ e(a, l, q).d 1))) } }
f : active(1) { { a:t } => { a:t } effect { (forall q:t (assign e(a, l, q).d 1)) } }
g : active(1) { { a:t b:t a->b(l) } => { a:t b:t a->b(l)* } effect { (assign e(a, l, b).d 1) } }
h : active(1) { { a:t b:t a->b(l) b->a(l) } => { a:t b:t b->a(l) } precondition { (l a b) }
 effect { (not (l a b)) (assign e(a, l, b).d 1) (not (l b a)) (assign e(b, l, a).d 1) } }
i : active(1) { { a:t b:t } => { a:t b:t } precondition { (l a b) } effect { (not (l a b)) (assign e(a, l, b).d 1) } }
j : active(1) { { a:t b:t a->b(l) } => { a:t b:t } effect { (l a b) (assign e(a, l, b).d 1) } }
";
    check(
        read(text).analyse(None),
        &expect![[r#"
            test.aggl:4:48: warning: nothing in this rule says that there is a link `b->a(l)`: where there is none, nothing is assigned
            test.aggl:5:74: warning: this rule takes away the link `a->b(l)`, so that nothing is assigned to it
            test.aggl:10:70: warning: nothing in this rule says that there is a link `a->q(l)`: where there is none, nothing is assigned
            test.aggl:11:83: warning: this rule takes away the link `a->b(l)`, so that nothing is assigned to it
            test.aggl:13:38: warning: this rule takes away the link `a->b(l)`, so that nothing is assigned to it
            test.aggl:14:105: warning: this rule takes away the link `a->b(l)`, so that nothing is assigned to it"#]],
    );
}

#[test]
fn an_amount_that_no_match_gives_is_told_at_its_attribute() {
    let text = "name=x
===
a : active(1) cost(x.v) { { x:t } => { x:t } precondition { (< x.v 0) } }
b : active(1) duration(e(x, q, x).v) { { x:t x->x(q)* } => { x:t } }
d : active(1) cost(x.v) duration(e(x, q, y).v) { { x:t y:t } => { x:t y:t } precondition { (or (< x.v 0) (q x y)) } }
e : active(1) cost(x.v) { { x:t } => { x:t } precondition { (and (< x.v 0) (> x.v 0)) } }
f : active(1) duration(x.v) { { x:t } => { x:t } precondition { (= x.v \"long\") } }
";
    let mut found = read(text).analyse(None);
    found.retain(|found| !matches!(found.problem, Problem::UnusedVariable { .. }));
    check(
        found,
        &expect![[r#"
        test.aggl:3:22: warning: this is a number of 0 or more at no match of the rule: no `x.v` is (>= 0) and (< 0)
        test.aggl:4:35: warning: this is a number of 0 or more at no match of the rule: `x->x(q)` would have to be there and not
        test.aggl:6:1: warning: this rule never matches: no `x.v` is (< 0) and (> 0)
        test.aggl:7:26: warning: this is a number of 0 or more at no match of the rule: no `x.v` is (>= 0) and (= "long")"#]],
    );
}

#[test]
fn conflicts_are_told_in_the_names_of_their_graph() {
    let text = "name=x
===
go : active(1) { { r:robot a:room b:room r->a(in) a->b(door) } => { r:robot a:room b:room r->b(in) a->b(door) } }
stay : active(1) { { b:robot a:room b->a(in) } => { b:robot a:room b->a(in) } }
";
    let found = read(text).conflicts(None, crate::EFFORT_LIMIT).found;
    let told: Vec<String> = found.iter().map(|c| c.diagnostic.to_string()).collect();
    expect![[r#"
        `go` can disable `go` (r has no link `in` to a) where there are r:robot a:room b:room b_2:room r->a(in) a->b(door) a->b_2(door)
        `go` can disable `stay` (r has no link `in` to a) where there are r:robot a:room b:room r->a(in) a->b(door)"#]].assert_eq(&told.join("\n"));
}

#[test]
fn contradictions_are_found_wherever_they_are() {
    let never = [
        "(not (= 1 1))",
        "(and (= a.s \"A\") (= a.s \"B\"))",
        "(and (= a.s \"A\") (= a.s 3))",
        "(and (= a.s true) (= a.s false))",
        "(= true false)",
        "(and (= a.n 3) (!= a.n 3))",
        "(and (>= a.n 3) (<= a.n 3) (!= a.n 3))",
        "(and (= a.s \"A\") (not (= a.s \"A\")))",
        "(and (= a.s b.s) (not (= b.s a.s)))",
        "(and (< a.n b.n) (>= a.n b.n))",
        "(and (< (+ a.n 1) b.n) (not (> b.n (+ a.n 1))))",
        "(< a.n a.n)",
        "(!= a a)",
        "(not (exists q:t (l a q)))",
        "(forall q:t (not (l a q)))",
        "(forall q:t (l q a))",
        "(forall q:t (when (l a q) (not (l a q))))",
        "(exists q:t (and (l a q) (not (l a q))))",
        "(exists q:t (and (> q.n 1) (< q.n 1)))",
        "(not (forall q:t (or (l a q) (not (l a q)))))",
        "(or (and (> a.n 2) (< a.n 1)) (l b a))",
        "(and (or (l b a) (= a.s 1)) (= a.s 2))",
        "(and (> a.n 2) (not (>= a.n 2)))",
        "(and (when (l a b) (= a.s 1)) (= a.s 2))",
        "(and (> (* a.n b.n) 5) (< (* a.n b.n) 5))",
        "(and (> (* a.n b.n) b.m) (> b.m a.m) (> a.m (* a.n b.n)))",
        "(and (> (+ a.n b.n) 5) (= a.m (+ a.n b.n)) (< a.m 4))",
    ];
    for condition in never {
        let said = said(condition, None);
        assert!(
            said[0].starts_with("this rule never matches: "),
            "{condition}: {said:?}"
        );
    }
    let may = [
        "(and (!= a.s true) (!= a.s false))",
        "(and (not (= a.n 3)) (not (!= a.n 3)))",
        "(and (not (< a.n 3)) (not (>= a.n 3)))",
        "(not (< a.n a.n))",
        "(!= a.n a.n)",
        "(not (exists q:u (l a q)))",
        "(exists q:t (= q a))",
        "(and (exists q:t (l b q)) (exists q:t (not (l b q))))",
        "(or (and (> a.n 2) (< a.n 1)) (l a a))",
        "(and (> a.n 9007199254740992) (<= a.n 9007199254740993))",
        "(and (> a.n 2) (< b.n 2))",
    ];
    for condition in may {
        assert_eq!(said(condition, None), Vec::<String>::new(), "{condition}");
    }
}

#[test]
fn ranges_and_kinds_of_the_schema_are_held_against_every_part_of_a_condition() {
    let schema = r#"
        [types]
        t = []
        [labels]
        l = { from = ["t"], to = ["t"] }
        [attributes]
        n = { kind = "f64", min = 0.0, max = 10.0 }
        on = { kind = "bool" }
        name = { kind = "string" }
        "#;
    let schema = Schema::from_toml("schema", schema).unwrap();
    for (condition, reason) in [
        (
            "(or (> a.n 11) (< a.n -1))",
            "no `a.n` is (>= 0, by the schema) and (<= 10, by the schema) and (> 11); \
             and otherwise no `a.n` is (>= 0, by the schema) and (<= 10, by the schema) and (< -1)",
        ),
        (
            "(exists q:t (= q.n 12))",
            "no `q.n` is (>= 0, by the schema) and (<= 10, by the schema) and (= 12)",
        ),
        ("(= a.n \"A\")", "`a.n` is never (= \"A\") by the schema"),
        ("(= a.name 3)", "`a.name` is never (= 3) by the schema"),
        (
            "(and (!= a.on true) (!= a.on false))",
            "no `a.on` is (!= true) and (!= false)",
        ),
    ] {
        let expected = vec![format!("this rule never matches: {reason}")];
        assert_eq!(said(condition, Some(&schema)), expected, "{condition}");
    }
    assert!(said("(or (> a.n 9) (< a.n -1))", Some(&schema)).is_empty());
}

#[test]
fn a_conflict_over_nodes_that_come_or_go_tells_which_rule_makes_them() {
    let text = "name=x
===
lay : active(1) { { h:hen } => { h:hen e:egg e->e(raw) } }
count : active(1) { { h:hen h->h(up) } => { h:hen h->h(up) } precondition { (forall e:egg (seen e e)) } }
flee : active(1) { { h:hen h->h(up) } => { } }
";
    let found = read(text).conflicts(None, crate::EFFORT_LIMIT).found;
    check(
        found.into_iter().map(|found| found.diagnostic).collect(),
        &expect![[r#"
            test.aggl:3:1: note: `lay` can disable `count` (for e (egg_1): e (egg_1) has no link `seen` to e (egg_1), where `lay` makes egg_1) where there are h:hen h->h(up)
            test.aggl:5:1: note: `flee` can disable `lay` (`flee` deletes h) where there are h:hen h->h(up)
            test.aggl:5:1: note: `flee` can disable `count` (`flee` deletes h) where there are h:hen h->h(up)"#]],
    );
}

#[test]
fn rules_with_many_variables_within_each_other_are_not_compared() {
    let variables: String = (0..20_000)
        .map(|n| ["v", &n.to_string(), ":t "].concat())
        .collect();
    let text = format!(
        "name=x\n===\nr : active(1) {{ {{ a:t }} => {{ a:t a->a(l) }} precondition {{ (forall {variables} (not (l v0 v1))) }} }}"
    );
    let found = read(&text).conflicts(None, crate::EFFORT_LIMIT);
    let pair = ("r".to_owned(), "r".to_owned(), crate::Undecided::Size);
    assert_eq!((found.found.len(), found.undecided), (0, vec![pair]));
}

#[test]
fn links_and_values_that_no_schema_allows_are_told() {
    let schema = r#"
        [types]
        thing = []
        cup = ["thing"]
        room = []
        [labels]
        on = { from = ["thing"], to = ["thing"] }
        in = { from = ["room", "cup"], to = ["room"] }
        [attributes]
        level = { kind = "f64", min = 0.0, max = 1.0 }
        name = { kind = "string" }
        "#;
    let schema = Schema::from_toml("schema", schema).unwrap();
    let text = "name=x
===
fine : active(1) { { a:thing r:room a->r(in) a->a(on) } => { a:thing r:room } }
odd : active(1) { { a:room r:room a->r(in) } => { a:room r:room } precondition { (on a a) } }
full : active(1) { { a:cup a->a(on) } => { a:cup } precondition { (> a.level 1) } }
word : active(1) { { a:cup a->a(on) } => { a:cup } precondition { (< a.name 1) } }
";
    check(
        read(text).analyse(Some(&schema)),
        &expect![[r#"
            test.aggl:4:1: warning: this rule never matches: no type of the schema can have all the links of `a`
            test.aggl:5:1: warning: this rule never matches: no `a.level` is (>= 0, by the schema) and (<= 1, by the schema) and (> 1)
            test.aggl:6:1: warning: this rule never matches: `a.name` is no number by the schema"#]],
    );
}

#[test]
fn rules_that_nothing_makes_applicable_are_told() {
    let more = "\
lay : active(1) activates(hatch) { { r:robot } => { r:robot e:egg r->e(holds) } }
dormant hatch : active(1) { { r:robot e:egg r->e(holds) } => { r:robot e:bird r->e(holds) } }
free : active(1) { { r:robot b:bird r->b(holds) } => { r:robot b:bird } }
cook : active(1) { { e:egg p:pan e->p(into) } => { p:pan } }
crack : active(1) { { e:egg p:room e->p(in) } => { p:room } }
";
    let text = CARE.split_once("===").unwrap().0.to_owned() + "===\n";
    let grammar = read(&(text + more));
    check(
        grammar.unreachable(&care_centre().snapshot()).unwrap(),
        &expect![[r#"
            test.aggl:6:1: warning: this rule can never be applied: there is never a `pan`
            test.aggl:7:1: warning: this rule can never be applied: there is never a link `in` like `e->p`"#]],
    );
}

proptest! {
    #![proptest_config(crate::testing::cases(600))]

    #[test]
    fn a_rule_that_is_said_never_to_match_does_not(
        rule in FEW.rule(),
        models in prop::collection::vec(Model::strategy(), 8),
    ) {
        let rule = repaired(rule);
        let mut grammar = read("name=x\n===\n");
        grammar.rules.push(rule.clone());
        let never = |found: &Diagnostic| matches!(found.problem, Problem::NeverMatches { .. });
        if let Some(found) = grammar.analyse(None).iter().find(|found| never(found)) {
            for model in models {
                let mut all = model.assignments(&rule).into_iter();
                prop_assert!(!all.any(|at| model.rule_holds(&rule, &at)), "{found}: {rule}");
            }
        }
    }
}

proptest! {
    #![proptest_config(crate::testing::cases(300))]

    #[test]
    fn nothing_that_can_be_written_breaks_an_analysis(text in soup(), rules in AWKWARD.grammar()) {
        for text in [text, rules.to_string()] {
            let (grammar, _) = parse_grammar(&text, "soup");
            let _ = grammar.analyse(None);
            let _ = grammar.unreachable(&care_centre().snapshot()).unwrap();
            for conflict in grammar.conflicts(None, crate::EFFORT_LIMIT / 100).found.into_iter().take(3) {
                prop_assert!(!conflict.graph.operations.is_empty());
            }
            for rule in grammar.all_rules() {
                let dot = rule.to_dot();
                prop_assert_eq!(dot.matches('{').count() >= 3, true);
            }
            let whole = grammar.whole_text();
            let (again, _) = parse_grammar(&whole, "whole");
            prop_assert_eq!(again.rules.len(), grammar.rules.len(), "{}", whole);
        }
    }
}
