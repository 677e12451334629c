//! What is said of comparisons, against what numbers of all kinds do.

use crate::testing::read;
use crate::{Binding, Grammar, Problem};
use dsr::{Graph, Schema, Time, Transaction, Value};
use proptest::prelude::*;
use proptest::sample::select;

const NODES: &str = "{ a:t b:t c:t }";

fn grammar(precondition: &str) -> Grammar {
    read(&format!(
        "name=x\n===\nr : active(1) {{ {NODES} => {NODES} precondition {{ {precondition} }} }}\n"
    ))
}

fn schema(attribute: &str) -> Schema {
    let text = format!("[types]\nt = []\n[attributes]\nn = {{ {attribute} }}\n");
    Schema::from_toml("schema", &text).unwrap()
}

/// Why the rule never matches.
fn never(precondition: &str, schema: Option<&Schema>) -> Option<String> {
    let found = grammar(precondition).analyse(schema).into_iter();
    let mut reasons = found.filter_map(|found| match found.problem {
        Problem::NeverMatches { reason } => Some(reason),
        _ => None,
    });
    reasons.next()
}

#[test]
fn comparisons_that_go_round_never_hold() {
    for (condition, reason) in [
        ("(> a.n (+ a.n 1))", "(> a.n (+ a.n 1)) never holds"),
        (
            "(< (+ a.n 1) (- a.n 2))",
            "(< (+ a.n 1) (- a.n 2)) never holds",
        ),
        (
            "(!= (+ a.n 1) (+ a.n 1))",
            "(!= (+ a.n 1) (+ a.n 1)) never holds",
        ),
        (
            "(> a.n (/ 1 0))",
            "(> a.n (/ 1 0)) never holds: what it reckons has no value",
        ),
        ("(> (+ 1 2) (* 2 2))", "(> (+ 1 2) (* 2 2)) never holds"),
        (
            "(and (< a.n (- 4 1)) (> a.n (+ 1 2)))",
            "no `a.n` is (< (- 4 1)) and (> (+ 1 2))",
        ),
        (
            "(and (< a.n b.n) (< b.n c.n) (< c.n a.n))",
            "(< a.n b.n) and (< c.n a.n) and (< b.n c.n) never hold together",
        ),
        (
            "(and (< (+ a.n 1) b.n) (= c.n 2) (< (+ b.n 1) a.n))",
            "(< (+ a.n 1) b.n) and (< (+ b.n 1) a.n) never hold together",
        ),
        (
            "(and (<= a.n 2) (>= b.n 3) (<= b.n a.n))",
            "(<= b.n a.n) and (<= a.n 2) and (>= b.n 3) never hold together",
        ),
        (
            "(and (< a.n b.n) (not (= a.n a.n)))",
            "(not (= a.n a.n)) and (< a.n b.n) never hold together",
        ),
    ] {
        assert_eq!(
            never(condition, None).as_deref(),
            Some(reason),
            "{condition}"
        );
    }
}

#[test]
fn what_rounding_or_a_value_that_is_no_number_allows_is_not_called_impossible() {
    for condition in [
        "(= a.n (+ a.n 1))",
        "(!= a.n a.n)",
        "(and (< a.n b.n) (<= b.n c.n) (<= c.n a.n))",
        "(and (<= (+ a.n 3) b.n) (<= b.n (+ a.n 2)))",
        "(and (= a.n b.n) (= b.n c.n) (!= a.n c.n))",
        "(and (< (+ a.n 0.5) b.n) (< b.n (+ a.n 1)))",
        "(and (< a.n b.n) (<= b.n (+ a.n 0.5)) (<= (+ a.n 0.5) a.n))",
    ] {
        assert_eq!(never(condition, None), None, "{condition}");
    }
}

#[test]
fn of_whole_numbers_more_is_known() {
    let whole = schema("kind = \"i64\", min = 0.0, max = 9.0");
    for condition in [
        "(= a.n (+ a.n 1))",
        "(!= a.n a.n)",
        "(and (< a.n b.n) (<= b.n c.n) (<= c.n a.n))",
        "(and (<= (+ a.n 3) b.n) (<= b.n (+ a.n 2)))",
        "(and (<= (+ a.n 3) b.n) (<= (+ b.n 3) c.n) (<= c.n (+ a.n 5)))",
        "(and (< a.n b.n) (< b.n (+ a.n 1)))",
        "(> a.n (+ b.n 9))",
        "(and (> a.n 2.5) (< a.n b.n) (< b.n 3.5))",
    ] {
        assert!(never(condition, Some(&whole)).is_some(), "{condition}");
    }
    assert_eq!(never("(= a.n (+ b.n 9))", Some(&whole)), None);
    // A real with a range is a number.
    let real = schema("kind = \"f64\", min = 0.0");
    assert!(never("(!= a.n a.n)", Some(&real)).is_some());
    assert_eq!(never("(!= a.n a.n)", Some(&schema("kind = \"f64\""))), None);
}

/// Numbers where kinds and rounding make a difference.
const REALS: [f64; 10] = [
    0.0,
    1.0,
    -0.5,
    2.5,
    9_007_199_254_740_992.0,
    9_007_199_254_740_994.0,
    -9_007_199_254_740_992.0,
    1e300,
    f64::INFINITY,
    f64::NAN,
];
const WHOLE: [i64; 9] = [
    0,
    1,
    2,
    -1,
    9_007_199_254_740_992,
    9_007_199_254_740_993,
    9_007_199_254_740_995,
    -9_007_199_254_740_993,
    i64::MAX,
];

fn term() -> impl Strategy<Value = String> {
    let attribute = || select(vec!["a.n", "b.n", "c.n"]);
    let added = || {
        select(vec![
            "0",
            "1",
            "2",
            "3",
            "-1",
            "-2",
            "0.5",
            "9007199254740993",
        ])
    };
    prop_oneof![
        4 => attribute().prop_map(str::to_owned),
        1 => select(vec!["0", "1", "3", "2.5", "9007199254740993"]).prop_map(str::to_owned),
        3 => (attribute(), added()).prop_map(|(a, n)| format!("(+ {a} {n})")),
        1 => (attribute(), added()).prop_map(|(a, n)| format!("(- {a} {n})")),
        1 => (attribute(), added(), added()).prop_map(|(a, n, m)| format!("(+ {n} {a} {m})")),
        1 => (attribute(), added(), added()).prop_map(|(a, n, m)| format!("(- (+ {a} {n}) {m})")),
    ]
}

fn comparison() -> impl Strategy<Value = String> {
    let operator = select(vec!["=", "!=", "<", "<", "<=", "<=", ">", ">="]);
    (operator, term(), term(), 0..8).prop_map(|(operator, left, right, not)| {
        let comparison = format!("({operator} {left} {right})");
        if not == 0 {
            format!("(not {comparison})")
        } else {
            comparison
        }
    })
}

fn value(kind: Option<&'static str>) -> impl Strategy<Value = Value> {
    let real = || select(&REALS[..]).prop_map(Value::F64);
    let whole = || select(&WHOLE[..]).prop_map(Value::I64);
    match kind {
        Some("i64") => whole().boxed(),
        Some(_) => real().boxed(),
        None => prop_oneof![5 => real(), 5 => whole(), 1 => Just(Value::from("x"))].boxed(),
    }
}

/// A precondition, the kind that the schema gives numbers, and values that nodes have.
fn case() -> impl Strategy<Value = (String, Option<&'static str>, Vec<Value>)> {
    let all = prop::collection::vec(comparison(), 1..5);
    let all = all.prop_map(|all| format!("(and {})", all.join(" ")));
    let kind = select(vec![None, None, Some("i64"), Some("f64")]);
    (all, kind).prop_flat_map(|(all, kind)| {
        let values = prop::collection::vec(value(kind), 7);
        (Just(all), Just(kind), values)
    })
}

/// Whether some three of the nodes, two with each of the values, match.
fn matches(precondition: &str, schema: Schema, values: &[Value]) -> bool {
    let mut graph = Graph::in_memory(schema);
    let mut world = Transaction::new();
    for (index, value) in values.iter().chain(values).enumerate() {
        let attributes = vec![("n".to_owned(), value.clone())];
        world.create_node("t", &format!("n{index}"), attributes);
    }
    graph.commit(&world, "test", Time::default()).unwrap();
    let (grammar, snapshot) = (grammar(precondition), graph.snapshot());
    let found = grammar.matches(&snapshot, &grammar.rules[0], &Binding::new());
    found.unwrap().next().transpose().unwrap().is_some()
}

proptest! {
    #![proptest_config(crate::testing::cases(1500))]

    #[test]
    fn no_numbers_meet_what_is_called_impossible((condition, kind, values) in case()) {
        let schema = kind.map(|kind| schema(&format!("kind = \"{kind}\"")));
        if let Some(reason) = never(&condition, schema.as_ref()) {
            let schema = schema.unwrap_or_else(Schema::open);
            prop_assert!(!matches(&condition, schema, &values), "{condition}: {reason}");
        }
    }
}
