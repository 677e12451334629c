//! Files as people bring them: every shape the language had, and everything that can be wrong.
#![allow(clippy::needless_raw_string_hashes, reason = "expect-test writes them")]

use super::*;
use crate::testing::{CARE, read};
use crate::{Condition, Effect, Expression, Kind, Literal};
use expect_test::{Expect, expect};

mod recovery;

/// What is reported about a grammar, one line each.
fn check(text: &str, expected: &Expect) {
    let (_, diagnostics) = parse_grammar(text, "f.aggl");
    expected.assert_eq(&Defects { diagnostics }.to_string());
}

#[test]
fn rules_of_every_age_are_read() {
    // Without types, with drawing positions, a digit-leading variable, nested effects on
    // several lines, `eq`, an empty block.
    let grammar = read(
        "fontName=Arial\nname=old\nnodeThickness=2.0\n===\n\
         setStop : active(1)\n{\n\t{\n\t\t1:robot(0,0)\n\t\t1->1(stop)*\n\t}\n\t=>\n\t{\n\
         \t\t1:robot(-12,0.5)\n\t\t1->1(stop)\n\t}\n\tprecondition\n\t{\n\t}\n\teffect\n\t{\n\t\t(and\n\
         \t\t\t(forall somepose:pose\n\t\t\t\t(when\n\t\t\t\t\t(not (eq 1 somepose) )\n\
         \t\t\t\t\t(not (reach somepose somepose))\n\t\t\t\t)\n\t\t\t)\n\t\t)\n\t}\n}\n\n\n\
         dormant nap : passive(2.5) success(0.5) activates(setStop, nap)\n{\n{ a:b } => { a:c }\n\
         parameters { p:pose q:pose }\n}\n",
    );
    assert_eq!(grammar.property("name"), Some("old"));
    let [stop, nap] = &grammar.rules[..] else {
        panic!("{grammar}")
    };
    assert_eq!(stop.kind, Kind::Active);
    assert_eq!(stop.left.nodes[0].variable, "1");
    assert_eq!(stop.right.nodes[0].position, Some([-12.0, 0.5]));
    assert!(stop.left.edges[0].negated && !stop.right.edges[0].negated);
    assert_eq!(stop.precondition, None);
    let [Effect::Forall { body, .. }] = &stop.effect[..] else {
        panic!("{stop}")
    };
    let [
        Effect::When {
            condition: Condition::Not(same),
            ..
        },
    ] = &body[..]
    else {
        panic!("{stop}")
    };
    assert_eq!(**same, Condition::Same("1".into(), "somepose".into()));
    assert!(nap.dormant && nap.kind == Kind::Passive);
    assert_eq!(
        (nap.success.to_bits(), nap.parameters.len()),
        (0.5_f64.to_bits(), 2)
    );
    assert_eq!(nap.cost, Expression::number(2.5));
    assert_eq!(nap.activates, ["setStop", "nap"]);
}

#[test]
fn the_newer_clauses_are_read() {
    let grammar = read(CARE);
    let rule = grammar.rule("changeRoom").unwrap();
    assert_eq!(rule.agent.as_deref(), Some("navigation"));
    assert_eq!(rule.cost.to_string(), "e(room1, connected, room2).distance");
    let duration = rule.duration.as_ref().unwrap();
    assert_eq!(
        duration.to_string(),
        "(/ e(room1, connected, room2).distance 0.5)"
    );
    assert_eq!(rule.comments, ["Through the door into the next room."]);
    assert_eq!(
        grammar.rule("approach").unwrap().cost,
        Expression::Literal(Literal::Integer(2))
    );
    assert!(grammar.types.is_subtype("robot", "thing"));
}

#[test]
fn all_errors_of_a_file_come_at_once_and_good_rules_survive() {
    let text = "name=broken
what is this
===
types
{
(robot room)
(kitchen : rom)
(a : b)
(b : a)
}
===
good : active(1) { { r:robot } => { r:robot r->r(on) } }

first : actve(1)
{
	{
		r:robot
		r->k(in)
		r=>r
	}
	=>
	{
	}
}

second : active(one) success(1.5)
{
	{ r:robot
	=>
	{ r:robot }
}

third : active(1)
{
	{ r:robot(3,4) q:kichen r->qq(in) r->r(x) r->r(x)* }
	=>
	{ r:robot }
	precondition
	{
		(foral x:robot (in x r))
		(in r)
		(not (in r q)
	}
}

good : passive(0)
{
	{ r:robot q:room }
	=>
	{ q:room }
	precondition { (and (in robot q) (< r.speed \"fast\")) }
	effect { (in r q) (assign q.seen (+ 1 true)) (or (in q q)) }
}
} $$ stray
";
    let (grammar, diagnostics) = parse_grammar(text, "f.aggl");
    assert_eq!(grammar.rules.len(), 1, "{grammar}");
    expect![[r#"
        f.aggl:2:1: error: expected `key = value` or `===`, found `what is this`
        f.aggl:7:12: warning: type `rom` is not declared, and taken as one that inherits from nothing (did you mean `room`?)
        f.aggl:8:2: error: type `a` inherits from itself
        f.aggl:9:2: error: type `b` inherits from itself
        f.aggl:14:9: error: expected `active` or `passive`, found `actve` (did you mean `active`?)
        f.aggl:18:6: error: no variable `k` on the left side (did you mean `r`?)
        f.aggl:19:4: error: expected `:` and a type, or `->` and a node, found `=>`
        f.aggl:26:17: error: expected a number, found `one`
        f.aggl:26:30: error: the probability must be between 0 and 1, not 1.5
        f.aggl:28:2: error: `{` is never closed
        f.aggl:35:19: error: no type `kichen` (did you mean `kitchen`?)
        f.aggl:35:29: error: no variable `qq` on the left side (did you mean `q`?)
        f.aggl:35:44: error: the link `r->r(x)` is both there and starred on the left side
        f.aggl:40:4: error: expected a link `(label a b)` or an operator, found `foral` (did you mean `forall`?)
        f.aggl:41:3: error: expected a link `(label a b)`, found `(in r)`
        f.aggl:42:3: error: `(` is never closed
        f.aggl:46:1: error: rule `good` is declared twice
        f.aggl:51:26: error: no variable `robot` on the left side or among the parameters
        f.aggl:51:46: error: < takes numbers, not text
        f.aggl:52:15: error: `r` is deleted by this rule (keep the node on the right side, or leave the effect out)
        f.aggl:52:40: error: + takes numbers, not a truth value
        f.aggl:52:48: error: expected an effect: conditions belong after `when`, found `or`
        f.aggl:54:1: error: `}` closes nothing (remove it, or look for a missing opening bracket)
        f.aggl:54:3: error: unknown character '$'
        f.aggl:54:11: error: expected `:` after the rule's name, found the end"#]].assert_eq(&Defects { diagnostics }.to_string());
}

#[test]
fn a_type_that_others_inherit_from_need_not_be_declared() {
    check(
        "name=x\n===\ntypes { (robot : thing) (room : thing) }\n===
r : active(1) { { t:thing q:thnig } => { t:thing q:thnig } }",
        &expect![[r#"
            f.aggl:5:29: error: no type `thnig` (did you mean `thing`?)
            f.aggl:5:52: error: no type `thnig` (did you mean `thing`?)"#]],
    );
}

#[test]
fn scopes_and_types_are_checked() {
    check(
        "name=x\n===\ntypes { (robot) (room) }\n===\n
r : active(1) activates(s)
{
	{ r:robot q:romo r->qq(in) r->r(x) r->r(x)* }
	=>
	{ r:robot n:room }
	parameters { p:room }
	precondition { (and (in robot q) (forall r:room (in n r)) (< r.speed \"fast\")) }
	effect { (in r q) (assign p.seen (+ 1 true)) (create p room) (delete z) }
}",
        &expect![[r#"
            f.aggl:6:25: error: no rule `s` (did you mean `r`?)
            f.aggl:8:14: error: no type `romo` (did you mean `room`?)
            f.aggl:8:22: error: no variable `qq` on the left side (did you mean `q`?)
            f.aggl:8:37: error: the link `r->r(x)` is both there and starred on the left side
            f.aggl:12:26: error: no variable `robot` on the left side or among the parameters
            f.aggl:12:43: error: variable `r` is declared twice
            f.aggl:12:54: error: no variable `n` on the left side or among the parameters (did you mean `p`?)
            f.aggl:12:71: error: < takes numbers, not text
            f.aggl:13:17: error: `q` is deleted by this rule (keep the node on the right side, or leave the effect out)
            f.aggl:13:40: error: + takes numbers, not a truth value
            f.aggl:13:55: error: variable `p` is declared twice
            f.aggl:13:71: error: no variable `z` in this rule (did you mean `n`?)"#]],
    );
}

#[test]
fn combos_are_checked_against_their_rules() {
    check(
        "name=x\n===
go : active(1) { { r:robot a:room } => { r:robot a:room } }
visit : active(2)
{
	go as one
	goo as two optional
	go as one
	where:
	one.r = one.a
	tow.r = one.robot
	one.r
}
again : active(2) { go as x where: x.r = x.a }
",
        &expect![[r#"
            f.aggl:7:2: error: no rule `goo` (did you mean `go`?)
            f.aggl:8:8: error: alias `one` is declared twice
            f.aggl:10:14: warning: `one.r` is a `robot` and `one.a` a `room`: never the same node
            f.aggl:11:2: error: no alias `tow` (did you mean `two`?)
            f.aggl:11:14: error: no variable `robot` in the rule of this step
            f.aggl:13:1: error: expected `=` and another `alias.variable`, found `}`
            f.aggl:14:1: warning: this combo cannot be applied as one: `r` and `a` of one step would be one node
            f.aggl:14:44: warning: `x.r` is a `robot` and `x.a` a `room`: never the same node"#]],
    );
}

#[test]
fn unclosed_brackets_stop_at_the_next_rule() {
    check(
        "name=x\n===
one : active(1) { { a:t } => { a:t } effect { (forall b:t (l a b)
two : active(1) { { a:t } => { a:t }
three : active(1) { { a:t } => { a:t } }
four : active(1) { { a:t => { a:t } }",
        &expect![[r#"
            f.aggl:3:47: error: `(` is never closed
            f.aggl:4:37: error: expected `}` at the end of the rule, found the next rule
            f.aggl:6:20: error: `{` is never closed"#]],
    );
}

#[test]
fn a_stray_bracket_is_reported_and_the_rule_is_kept() {
    let text = "name=x\n===\nheat : active(1) { { a:t } => { a:t } effect\n{ (when (cold a a)\n\
                (not (cold a a)))\n) } }\n";
    let (grammar, diagnostics) = parse_grammar(text, "f.aggl");
    assert_eq!(grammar.rules.len(), 1);
    expect![
        "f.aggl:6:1: error: `)` closes nothing (remove it, or look for a missing opening bracket)"
    ]
    .assert_eq(&Defects { diagnostics }.to_string());
}

#[test]
fn nesting_has_a_limit() {
    let deep = |depth: usize| {
        format!(
            "n=x\n===\nr : active(1) {{ {{ a:t }} => {{ a:t }} precondition {{ {} (l a a) {} }} }}",
            "(not ".repeat(depth),
            ")".repeat(depth),
        )
    };
    let (grammar, diagnostics) = parse_grammar(&deep(crate::DEPTH_LIMIT - 1), "f.aggl");
    assert_eq!((grammar.rules.len(), diagnostics.len()), (1, 0));
    let (_, diagnostics) = parse_grammar(&deep(100_000), "f.aggl");
    let [only] = &diagnostics[..] else {
        panic!("{diagnostics:?}")
    };
    assert!(matches!(only.problem, Problem::TooDeep { .. }));
}

#[test]
fn a_misspelt_keyword_or_an_open_rule_hides_no_include() {
    check(
        "name=x\n===\ntyps\n{\n(room)\n}\n===\nr : active(1)\n{\n{ a:room }\n=>\n{ a:rom\n\ninclud(one.aggl)\n\
         s : active(1) { { a:room } => { a:room } precondition { (and (l a a) } }\ninclude(two.aggl)\n",
        &expect![[r#"
            f.aggl:3:1: error: expected a rule, `include(path)`, `types` or the end, found `typs` (did you mean `types`?)
            f.aggl:12:1: error: `{` is never closed
            f.aggl:12:5: warning: no type `rom` in the files that could be read: one that is missing may declare it (did you mean `room`?)
            f.aggl:14:1: error: expected a rule, `include(path)`, `types` or the end, found `includ` (did you mean `include`?)
            f.aggl:14:8: error: cannot read the included file `one.aggl`: no other files are at hand
            f.aggl:15:57: error: `(` is never closed
            f.aggl:16:9: error: cannot read the included file `two.aggl`: no other files are at hand"#]],
    );
    // What stands in the middle of a rule is none.
    let text =
        "name=x\n===\nr : active(1)\n{\n{ a:include(3,4)\ninclude:t(1,2) }\n=>\n{ a:include }\n}\n";
    check(text, &expect![[""]]);
}

#[test]
fn included_files_are_read_once_and_missing_ones_are_told() {
    let mut asked = Vec::new();
    let (grammar, diagnostics) = load_grammar(
        "name=main\n===\ninclude(base.aggl)\ninclude(gone.aggl)\n\
         b : active(1) { { x:t } => { x:t } }\nc : active(1) { a as s nothere as t }\n",
        "main.aggl",
        &mut |path, from| {
            asked.push(format!("{path} from {from}"));
            match path {
                "base.aggl" => Ok(SourceFile::new(
                    "base.aggl",
                    "name=base\n===\ninclude(main.aggl)\na : active(1) { { x:t y->x(l) } => { } }",
                )),
                "main.aggl" => Ok(SourceFile::new("main.aggl", "")),
                _ => Err("no such file".to_owned()),
            }
        },
    );
    assert_eq!(
        asked,
        [
            "base.aggl from main.aggl",
            "main.aggl from base.aggl",
            "gone.aggl from main.aggl"
        ]
    );
    let names: Vec<&str> = grammar.rules.iter().map(|rule| &*rule.name).collect();
    assert_eq!(names, ["a", "b"]);
    // `nothere` may be declared in the missing file.
    expect![[r#"
        main.aggl:4:9: error: cannot read the included file `gone.aggl`: no such file
        main.aggl:6:24: warning: no rule `nothere` in the files that could be read: one that is missing may declare it
        base.aggl:4:23: error: no variable `y` on the left side (did you mean `x`?)"#]]
    .assert_eq(&Defects { diagnostics }.to_string());
    assert!(
        !grammar.to_string().contains("a : active"),
        "only the main file is printed"
    );
}

#[test]
fn types_that_no_file_that_could_be_read_declares_are_told_once_each() {
    let (_, diagnostics) = load_grammar(
        "name=main\n===\ntypes\n{\n(thing)\n(room cup : thing)\n}\n===\ninclude(gone.aggl)\n\
         a : active(1) { { x:rom y:cup z:sofa } => { x:rom y:cup z:sofa } }\n",
        "main.aggl",
        &mut |_, _| Err("no such file".to_owned()),
    );
    expect![[r#"
        main.aggl:9:9: error: cannot read the included file `gone.aggl`: no such file
        main.aggl:10:21: warning: no type `rom` in the files that could be read: one that is missing may declare it (did you mean `room`?)
        main.aggl:10:33: warning: no type `sofa` in the files that could be read: one that is missing may declare it"#]].assert_eq(&Defects { diagnostics }.to_string());
}

#[test]
fn misspelt_keywords_are_told_wherever_they_stand() {
    let written = [
        ("dormnat r : active(1) { A => A }", "dormant"),
        ("r : actve(1) { A => A }", "active"),
        ("r : pasive(1) { A => A }", "passive"),
        ("r : active(1) succes(0.5) { A => A }", "success"),
        ("r : active(1) activate(r) { A => A }", "activates"),
        ("r : active(1) costs(2) { A => A }", "cost"),
        ("r : active(1) durtion(2) { A => A }", "duration"),
        ("r : active(1) agnet(nav) { A => A }", "agent"),
        ("r : active(1) { A => A paramters { p:t } }", "parameters"),
        (
            "r : active(1) { A => A precondtion { (l a b) } }",
            "precondition",
        ),
        ("r : active(1) { A => A efect { (l a b) } }", "effect"),
        (
            "r : active(1) { A => A precondition { (nto (l a b)) } }",
            "not",
        ),
        (
            "r : active(1) { A => A precondition { (adn (l a b) (l b a)) } }",
            "and",
        ),
        (
            "r : active(1) { A => A precondition { (exsts q:t (l a q)) } }",
            "exists",
        ),
        (
            "r : active(1) { A => A precondition { (foral q:t (l a q)) } }",
            "forall",
        ),
        (
            "r : active(1) { A => A precondition { (whne (l a b) (l b a)) } }",
            "when",
        ),
        (
            "r : active(1) { A => A effect { (assing a.n 3) } }",
            "assign",
        ),
        (
            "r : active(1) { A => A effect { (asign a.n (+ a.n 1)) } }",
            "assign",
        ),
        (
            "r : active(1) { A => A effect { (foral q:t (l a q)) } }",
            "forall",
        ),
        (
            "r : active(1) { A => A effect { (whne (l a b) (l b a)) } }",
            "when",
        ),
        ("r : active(1) { A => A effect { (delte a) } }", "delete"),
        ("r : active(1) { A => A effect { (creat c t) } }", "create"),
        ("r : active(1) { A => A effect { (retpye a u) } }", "retype"),
    ];
    for (rule, keyword) in written {
        let rule = rule.replace('A', "{ a:t b:t }");
        let (_, diagnostics) = parse_grammar(&format!("name=x\n===\n{rule}\n"), "f.aggl");
        let told: Vec<String> = diagnostics
            .iter()
            .filter_map(|d| d.problem.help())
            .collect();
        assert_eq!(told, [format!("did you mean `{keyword}`?")], "{rule}");
    }
    // A label may look like one, if it joins nodes.
    read(
        "name=x\n===\nr : active(1) { { a:t b:t } => { a:t b:t } effect { (creates a b) (assigns a b) } }\n",
    );
}

#[test]
fn a_diagnostic_underlines_its_place() {
    let (_, diagnostics) = parse_grammar(
        "name=x\n===\nr : active(1)\n{\n\t{ robot:robot room:room\n\t  robto->room(in) }\n\t=>\n\t{ }\n}\n",
        "care.aggl",
    );
    let mut shown = String::new();
    miette::NarratableReportHandler::new()
        .render_report(&mut shown, &diagnostics[0])
        .unwrap();
    expect![[r#"
        no variable `robto` on the left side
            Diagnostic severity: error
        Begin snippet for care.aggl starting at line 5, column 1

        snippet line 5: 	{ robot:robot room:room
        snippet line 6: 	  robto->room(in) }
            label at line 6, columns 4 to 8: here
        snippet line 7: 	=>
        diagnostic help: did you mean `robot`?
    "#]]
    .assert_eq(&shown);
}

#[test]
fn goals_name_nodes_by_id_by_name_or_leave_them_open() {
    let types = read(CARE).types;
    let text = "\n{\n\t1:robot(1,1)\n\t\"room 4\":room\n\tp:person\n\t1->\"room 4\"(in)\n\
                \t1->p(is_near)*\n}\nprecondition\n{\n\t(not (= p 1))\n}\n";
    let goal = parse_goal(text, "g.aggt", &types).unwrap();
    assert_eq!(goal.constants["1"], crate::Constant::Id(1));
    assert_eq!(
        goal.constants["\"room 4\""],
        crate::Constant::Name("room 4".into())
    );
    assert_eq!(goal.constants.len(), 2);
    let same = Condition::Same("p".into(), "1".into());
    assert_eq!(goal.precondition, Some(Condition::Not(Box::new(same))));

    let error = parse_goal(
        "{ 1:robott 1->4(in) 99999999999999999999:room } x",
        "g.aggt",
        &types,
    );
    expect![[r#"
        g.aggt:1:5: error: no type `robott` (did you mean `robot`?)
        g.aggt:1:15: error: no variable `4` in this goal (did you mean `1`?)
        g.aggt:1:21: error: a node's id must be a whole number below 2^64, not 99999999999999999999
        g.aggt:1:49: error: expected `precondition` or the end of the goal, found `x`"#]]
    .assert_eq(&error.unwrap_err().to_string());
    let error = parse_goal("{ 1:robott 1->4(in) }", "g.aggt", &types);
    expect![[r#"
        g.aggt:1:5: error: no type `robott` (did you mean `robot`?)
        g.aggt:1:15: error: no variable `4` in this goal (did you mean `1`?)"#]]
    .assert_eq(&error.unwrap_err().to_string());
}
