//! What is told of a file with many mistakes: each of them, at its place, whatever else is wrong.
#![allow(clippy::needless_raw_string_hashes, reason = "expect-test writes them")]

use super::check;
use expect_test::expect;

#[test]
fn every_misspelt_word_of_a_header_is_told() {
    check(
        "name=x\n===
dormnat strct a : actve(1) cots(2) durration(3) wings(4) succes(2)
{
	{ p:t } => { q:t p->p(l) }
}
b : active(one cots(2) agnet(nav)
{
	{ p:t } => { p:t }
}
strict c active(1) wings(4)
{
	{ p:t } => { q:t p->p(l) }
}
",
        &expect![[r"
            f.aggl:3:1: error: expected `dormant`, `hierarchical`, `strict` or a rule's name, found `dormnat` (did you mean `dormant`?)
            f.aggl:3:9: error: expected `dormant`, `hierarchical`, `strict` or a rule's name, found `strct` (did you mean `strict`?)
            f.aggl:3:19: error: expected `active` or `passive`, found `actve` (did you mean `active`?)
            f.aggl:3:28: error: expected `{`, `success`, `activates`, `cost`, `duration` or `agent`, found `cots` (did you mean `cost`?)
            f.aggl:3:36: error: expected `{`, `success`, `activates`, `cost`, `duration` or `agent`, found `durration` (did you mean `duration`?)
            f.aggl:3:49: error: expected `{`, `success`, `activates`, `cost`, `duration` or `agent`, found `wings`
            f.aggl:3:58: error: expected `{`, `success`, `activates`, `cost`, `duration` or `agent`, found `succes` (did you mean `success`?)
            f.aggl:3:65: error: the probability must be between 0 and 1, not 2
            f.aggl:5:19: error: no variable `p` on the right side (did you mean `q`?)
            f.aggl:5:22: error: no variable `p` on the right side (did you mean `q`?)
            f.aggl:7:12: error: expected a number, found `one`
            f.aggl:7:16: error: expected `{`, `success`, `activates`, `cost`, `duration` or `agent`, found `cots` (did you mean `cost`?)
            f.aggl:7:24: error: expected `{`, `success`, `activates`, `cost`, `duration` or `agent`, found `agnet` (did you mean `agent`?)
            f.aggl:11:10: error: expected `:` after the rule's name, found `active`
            f.aggl:11:20: error: expected `{`, `success`, `activates`, `cost`, `duration` or `agent`, found `wings`
            f.aggl:13:19: error: no variable `p` on the right side (did you mean `q`?)
            f.aggl:13:22: error: no variable `p` on the right side (did you mean `q`?)"]],
    );
}

#[test]
fn a_misspelt_block_hides_nothing_in_it_or_after_it() {
    check(
        "name=x\n===
a : active(1)
{
	{ p:t }
	->
	{ p:t }
	paramters { q:t q:t }
	precondtion { (nto (l p q)) (l p z) }
	efect { (asign p.n 1) (l p y) }
}
b : active(1)
{
	{ p:t
	=>
	{ p:t
	precondtion { (l p z) }
}
c : actve(1) { { p:t } => { p:u p->z(l) } }
",
        &expect![[r"
            f.aggl:6:2: error: expected `=>` between the two sides, found `->`
            f.aggl:8:2: error: expected `parameters`, `precondition`, `effect` or `}`, found `paramters` (did you mean `parameters`?)
            f.aggl:8:18: error: variable `q` is declared twice
            f.aggl:9:2: error: expected `parameters`, `precondition`, `effect` or `}`, found `precondtion` (did you mean `precondition`?)
            f.aggl:9:17: error: expected a link `(label a b)` or an operator, found `nto` (did you mean `not`?)
            f.aggl:9:35: error: no variable `z` on the left side or among the parameters (did you mean `p`?)
            f.aggl:10:2: error: expected `parameters`, `precondition`, `effect` or `}`, found `efect` (did you mean `effect`?)
            f.aggl:10:11: error: expected a link `(label a b)` or an operator, found `asign` (did you mean `assign`?)
            f.aggl:10:29: error: no variable `y` in this rule (did you mean `p`?)
            f.aggl:14:2: error: `{` is never closed
            f.aggl:16:2: error: `{` is never closed
            f.aggl:17:2: error: expected `parameters`, `precondition`, `effect` or `}`, found `precondtion` (did you mean `precondition`?)
            f.aggl:17:21: error: no variable `z` on the left side or among the parameters (did you mean `p`?)
            f.aggl:19:5: error: expected `active` or `passive`, found `actve` (did you mean `active`?)
            f.aggl:19:36: error: no variable `z` on the right side (did you mean `p`?)"]],
    );
}

#[test]
fn a_combo_is_told_of_at_the_words_that_are_wrong() {
    check(
        "name=x\n===
go : active(1) { { r:robot a:room } => { r:robot a:room } }
dormant visit : active(2) success(0.5) cost(3)
{
	go as one optonal
	go az two optional
	go three
	goo as four
	wher:
	one.r = tow.r
}
none : active(1) { }
empty : active(1) { where: }
colon : active(1) { go as one go as two where one.r = two.q }
",
        &expect![[r"
            f.aggl:4:1: error: a combo has no `dormant`, but the rules that are its steps may
            f.aggl:4:27: error: a combo has no `success`, but the rules that are its steps may
            f.aggl:4:40: error: a combo has no `cost`, but the rules that are its steps may
            f.aggl:6:12: error: expected `optional`, or the next step on its own line, found `optonal` (did you mean `optional`?)
            f.aggl:7:5: error: expected `as` and an alias, found `az` (did you mean `as`?)
            f.aggl:8:5: error: expected `as` and an alias, found `three`
            f.aggl:9:2: error: no rule `goo` (did you mean `go`?)
            f.aggl:10:2: error: expected a step `rule as alias`, or `where:`, found `wher` (did you mean `where`?)
            f.aggl:11:10: error: no alias `tow` (did you mean `two`?)
            f.aggl:13:20: error: expected `{` and the left side, or a step `rule as alias`, found `}`
            f.aggl:14:19: error: expected a step `rule as alias`, found none
            f.aggl:15:47: error: expected `:` after `where`, found `one`
            f.aggl:15:59: error: no variable `q` in the rule of this step (did you mean `a`?)"]],
    );
}

#[test]
fn an_include_without_brackets_is_read_as_one() {
    check(
        "name=x\n===\ninclude one.aggl # the first\ninclud \"two.aggl\"\n\
         r : active(1) { { a:t } => { b:t } effect { (l a c) } }\n",
        &expect![[r#"
            f.aggl:3:1: error: expected `include(path)`, found `include one.aggl` (did you mean `include(one.aggl)`?)
            f.aggl:3:9: error: cannot read the included file `one.aggl`: no other files are at hand
            f.aggl:4:1: error: expected `include(path)`, found `includ "two.aggl"` (did you mean `include(two.aggl)`?)
            f.aggl:4:8: error: cannot read the included file `two.aggl`: no other files are at hand
            f.aggl:5:48: error: `a` is deleted by this rule (keep the node on the right side, or leave the effect out)
            f.aggl:5:50: error: no variable `c` in this rule (did you mean `b`?)"#]],
    );
}

#[test]
fn names_that_a_missing_file_may_declare_are_told_once() {
    check(
        "name=x\n===\ntypes { (room) }\n===\ninclude(one.aggl)\n\
         r : active(1) activates(s, rr) { { a:rom } => { a:rom } }\n\
         c : active(1) { r as x s as y where: x.a = x.b }\n",
        &expect![[r"
            f.aggl:5:9: error: cannot read the included file `one.aggl`: no other files are at hand
            f.aggl:6:25: warning: no rule `s` in the files that could be read: one that is missing may declare it (did you mean `c`?)
            f.aggl:6:28: warning: no rule `rr` in the files that could be read: one that is missing may declare it (did you mean `r`?)
            f.aggl:6:38: warning: no type `rom` in the files that could be read: one that is missing may declare it (did you mean `room`?)
            f.aggl:7:46: error: no variable `b` in the rule of this step (did you mean `a`?)"]],
    );
}

#[test]
fn a_misspelt_block_of_a_goal_is_checked() {
    let told =
        |text: &str| crate::parse_goal(text, "g.aggt", &crate::Types::default()).unwrap_err();
    let text = "{\n\tr:robot\n}\nprecondtion\n{\n\t(nto (in r q))\n\t(> q.area 1)\n}\nmore";
    expect![[r#"
        g.aggt:4:1: error: expected `precondition` or the end of the goal, found `precondtion` (did you mean `precondition`?)
        g.aggt:6:3: error: expected a link `(label a b)` or an operator, found `nto` (did you mean `not`?)
        g.aggt:9:1: error: expected the end of the goal, found `more`"#]].assert_eq(&told(text).to_string());
    expect!["g.aggt:1:13: error: expected `precondition` or the end of the goal, found `more`"]
        .assert_eq(&told("{ r:robot } more").to_string());
    expect!["g.aggt:1:13: error: expected `precondition` or the end of the goal, found `}`"]
        .assert_eq(&told("{ r:robot } }").to_string());
}

#[test]
fn what_was_meant_is_no_longer_looked_for_where_nearly_every_name_is_unknown() {
    let all = |each: &dyn Fn(usize) -> String| (0..3_000).map(each).collect::<Vec<_>>().concat();
    let (nodes, links) = (
        all(&|n| format!("a{n}:t ")),
        all(&|n| format!("b{n}->a{n}(l) ")),
    );
    let text = format!("name=x\n===\nr : active(1) {{ {{ {nodes} {links} }} => {{ }} }}\n");
    let (_, found) = crate::parse_grammar(&text, "f.aggl");
    let help: Vec<bool> = found
        .iter()
        .map(|found| found.problem.help().is_some())
        .collect();
    assert_eq!((help.len(), help[0], help[2_999]), (3_000, true, false));
}

#[test]
fn a_rule_of_more_nodes_than_can_be_matched_is_an_error() {
    let nodes = |count: usize| (0..count).map(|n| ["v", &n.to_string(), ":t "].concat());
    let found = |left: usize, parameters: usize| {
        let [left, parameters] = [left, parameters].map(|count| nodes(count).collect::<String>());
        let parameters = parameters.replace('v', "p");
        let text = format!(
            "name=x\n===\nr : active(1) {{ {{ {left} }} => {{ {left} }} parameters {{ {parameters} }} }}\n"
        );
        let diagnostics = crate::parse_grammar(&text, "f.aggl").1;
        crate::Defects { diagnostics }.to_string()
    };
    assert_eq!(found(4_000, 96), "");
    let told = "f.aggl:3:1: error: a rule binds at most 4096 nodes, and this one 4097";
    assert_eq!(found(4_000, 97), told);
}
