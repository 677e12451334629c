//! Analyses of written rules, and critical pairs against every small graph.
#![allow(clippy::needless_raw_string_hashes, reason = "expect-test writes them")]

use crate::testing::oracle::Model;
use crate::testing::random::{AWKWARD, FEW, Words, soup};
use crate::testing::repair::repaired;
use crate::testing::{CARE, care_centre, read};
use crate::{
    Condition, Defects, Diagnostic, Grammar, Name, PatternNode, Problem, Rule, parse_grammar,
};
use dsr::{Graph, Schema, Time};
use expect_test::{Expect, expect};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;

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

/// One label and one type, so that every graph of three nodes can be tried.
const ONE: Words = Words {
    variables: &["a", "b"],
    types: &["thing"],
    labels: &["on"],
    attributes: &["n"],
    any_literal: false,
};

/// Every graph of up to `most` nodes.
fn every_graph(most: usize) -> Vec<Model> {
    let mut all = Vec::new();
    for count in 0..=most {
        for bits in 0..1_u32 << (count * count) {
            let mut model = Model::default();
            let name = |index: usize| format!("n{index}");
            for index in 0..count {
                model.nodes.insert(name(index), "thing".to_owned());
            }
            for pair in (0..count * count).filter(|pair| bits & (1 << pair) != 0) {
                let link = (name(pair / count), "on".to_owned(), name(pair % count));
                model.links.insert(link);
            }
            all.push(model);
        }
    }
    all.sort_by_key(|model| (model.nodes.len(), model.links.len()));
    all
}

/// Nodes and links.
type Size = (usize, usize);

/// The size of the smallest graph where the first rule disables the second, by trying.
fn tried(models: &[Model], first: &Rule, second: &Rule) -> Option<Size> {
    let found = models.iter().find(|model| {
        let of = |rule: &Rule| -> Vec<_> {
            let all = model.assignments(rule).into_iter();
            all.filter(|at| model.rule_holds(rule, at)).collect()
        };
        let seconds = of(second);
        of(first).iter().any(|one| {
            let Some(after) = model.applied(first, one) else {
                return false;
            };
            seconds.iter().any(|two| {
                let other = first.name != second.name || one != two;
                let there = two.values().all(|node| after.nodes.contains_key(node));
                other && !(there && after.rule_holds(second, two))
            })
        })
    });
    found.map(|model| (model.nodes.len(), model.links.len()))
}

/// `(on x y)` of the variables of a rule and one that is quantified over, or that it is not.
fn literal() -> impl Strategy<Value = Condition> {
    let variable = || prop::sample::select(vec!["a", "b", "q"]);
    (variable(), variable(), any::<bool>()).prop_map(|(from, to, there)| {
        let link = Condition::Edge {
            label: "on".into(),
            from: from.into(),
            to: to.into(),
        };
        if there {
            link
        } else {
            Condition::Not(Box::new(link))
        }
    })
}

/// A quantifier over two literals.
fn quantified() -> impl Strategy<Value = Condition> {
    (literal(), literal(), 0..4, 0..4).prop_map(|(one, other, shape, quantifier)| {
        let body = Box::new(match shape {
            0 => one,
            1 => Condition::And(vec![one, other]),
            2 => Condition::Or(vec![one, other]),
            _ => Condition::When {
                condition: Box::new(one),
                consequence: Box::new(other),
            },
        });
        let variables = vec![PatternNode::new("q", "thing")];
        let whole = if quantifier % 2 == 0 {
            Condition::Exists { variables, body }
        } else {
            Condition::Forall { variables, body }
        };
        if quantifier < 2 {
            whole
        } else {
            Condition::Not(Box::new(whole))
        }
    })
}

/// Two rules, with conditions or without.
fn pair(condition: impl Strategy<Value = Option<Condition>>) -> impl Strategy<Value = Grammar> {
    let body = (ONE.pattern(2, 2), ONE.pattern(2, 2), condition);
    prop::collection::vec((ONE.rule(), body), 2).prop_map(|rules| {
        let mut grammar = read("name=x\n===\n");
        for (index, (rule, (left, right, precondition))) in rules.into_iter().enumerate() {
            let mut rule = Rule {
                left,
                right,
                precondition,
                ..rule
            };
            rule.parameters.clear();
            rule.effect.clear();
            let mut rule = repaired(rule);
            rule.name = Name::from(format!("r{index}").as_str());
            grammar.rules.push(rule);
        }
        grammar
    })
}

proptest! {
    #![proptest_config(crate::testing::cases(60))]

    #[test]
    fn critical_pairs_are_those_of_every_small_graph(grammar in pair(Just(None))) {
        for (shown, smallest) in sizes(&grammar, &every_graph(3)) {
            prop_assert_eq!(shown, smallest);
        }
    }

}

#[test]
fn critical_pairs_through_quantifiers_are_found_in_nearly_all_small_graphs() {
    let mut runner = TestRunner::deterministic();
    let strategy = pair(quantified().prop_map(Some));
    let models = every_graph(3);
    let (mut all, mut missed, mut larger) = (0, 0, 0);
    for _ in 0..200 {
        let grammar = strategy.new_tree(&mut runner).unwrap().current();
        for (shown, smallest) in sizes(&grammar, &models) {
            all += usize::from(smallest.is_some());
            missed += usize::from(smallest.is_some() && shown.is_none());
            larger += usize::from(smallest.is_some() && shown > smallest);
        }
    }
    assert!(
        all > 100 && 50 * missed < all && 50 * larger < all,
        "{all} {missed} {larger}"
    );
}

/// By pair of rules, the sizes of the graph that a conflict is shown with and of the smallest of the models
/// where there is one.
fn sizes(grammar: &Grammar, models: &[Model]) -> Vec<(Option<Size>, Option<Size>)> {
    let found = grammar.conflicts(crate::EFFORT_LIMIT).found;
    let mut sizes = Vec::new();
    for first in &grammar.rules {
        for second in &grammar.rules {
            let conflict = found
                .iter()
                .find(|c| *first.name == *c.first && *second.name == *c.second);
            let shown = conflict.map(|conflict| {
                let mut graph = Graph::in_memory(Schema::open());
                graph
                    .commit(&conflict.graph, "test", Time::default())
                    .unwrap();
                let model = Model::of_graph(&graph);
                // The oracle agrees that it is one.
                assert!(
                    tried(std::slice::from_ref(&model), first, second).is_some(),
                    "{first}{second}"
                );
                (model.nodes.len(), model.links.len())
            });
            sizes.push((shown, tried(models, first, second)));
        }
    }
    sizes
}

#[test]
fn many_rules_are_compared_by_what_they_have_in_common() {
    // Each pair of neighbours shares a label; all share their types.
    let rule = |index: usize| {
        let next = index + 1;
        format!(
            "r{index} : active(1) {{ {{ a:t b:t c:t a->b(l{index}) b->c(m) }} => \
             {{ a:t b:t c:t a->b(l{next}) b->c(m) }} }}\n"
        )
    };
    let text = "name=x\n===\n".to_owned() + &(0..400).map(rule).collect::<String>();
    let conflicts = read(&text).conflicts(crate::EFFORT_LIMIT);
    assert_eq!(conflicts.left, 0);
    let of = |c: &super::Conflict| (c.first.clone(), c.second.clone());
    let pairs: Vec<_> = conflicts.found.iter().map(of).collect();
    let itself = |index: usize| (format!("r{index}"), format!("r{index}"));
    assert_eq!(pairs, (0..400).map(itself).collect::<Vec<_>>());
}

#[test]
fn rules_with_quantifiers_are_all_compared() {
    let labels = ["in", "at", "holds", "near", "on"];
    let rule = |index: usize| {
        let (kept, made) = (labels[index % 5], labels[(index / 2 + 1) % 5]);
        let none = labels[(index / 3 + 2) % 5];
        let nodes = "r:robot a:room b:room p:person o:object";
        let links = format!("a->b(door) p->a(in) o->a({kept})");
        format!(
            "r{index} : active(1) {{ {{ {nodes} r->a(in) {links} }} => {{ {nodes} r->b(in) {links} r->o({made}) }}\n\
             precondition {{ (and (forall q:person (when (near r q) (> q.trust {index})))\n\
             (not (exists t:object ({none} t a)))) }}\n\
             effect {{ (forall q:person (when (near r q) (not (near r q)))) (assign r.n (- r.n 1)) }} }}\n"
        )
    };
    let text = "name=x\n===\n".to_owned() + &(0..6).map(rule).collect::<String>();
    let conflicts = read(&text).conflicts(crate::EFFORT_LIMIT / 4);
    assert_eq!((conflicts.left, conflicts.undecided), (0, Vec::new()));
    // `r2` and `r3` never match: they ask for a link and that there is none. Leaving a room disables whoever else would leave
    // it, unless one forbids what the other has.
    let pairs = conflicts
        .found
        .iter()
        .map(|c| format!("{} {}", c.first, c.second));
    let pairs: Vec<String> = pairs.collect();
    expect!["r0 r0, r0 r1, r0 r4, r0 r5, r1 r0, r1 r1, r1 r4, r1 r5, r4 r0, r4 r1, r4 r4, r4 r5, r5 r0, r5 r1, r5 r4, r5 r5"].assert_eq(&pairs.join(", "));
}

#[test]
fn what_is_too_much_to_compare_is_counted() {
    // Everything can be laid over everything, and nothing is disabled; so that all is tried.
    let words = |word: fn(usize) -> String| (1..9).map(word).collect::<Vec<_>>().join(" ");
    let nodes = words(|index| format!("n{index}:t"));
    let links = words(|index| format!("n1->n{index}(l)"));
    let rule = |index: usize| {
        format!(
            "r{index} : active(1) {{ {{ {nodes} {links} }} => {{ {nodes} {links} }}\n\
             precondition {{ (forall a:t b:t c:t d:t (when (and (l a b) (l c d)) (> a.n b.n))) }}\n\
             effect {{ (assign n1.n 1) }} }}\n"
        )
    };
    let text = "name=x\n===\n".to_owned() + &(0..20).map(rule).collect::<String>();
    let conflicts = read(&text).conflicts(crate::EFFORT_LIMIT / 100);
    // Each pair has its share: none is left to the last ones only.
    assert!(conflicts.left > 0);
    let (first, second, why) = &conflicts.undecided[0];
    assert_eq!(
        (&**first, &**second, *why),
        ("r0", "r0", crate::Undecided::Effort)
    );
}

proptest! {
    #![proptest_config(crate::testing::cases(300))]

    #[test]
    fn nothing_that_can_be_written_breaks_an_analysis(text in soup(), rules in AWKWARD.grammar()) {
        for text in [text, rules.to_string()] {
            let (grammar, _) = parse_grammar(&text, "soup");
            let _ = grammar.analyse(None);
            let _ = grammar.unreachable(&care_centre().snapshot()).unwrap();
            for conflict in grammar.conflicts(crate::EFFORT_LIMIT / 100).found.into_iter().take(3) {
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
