//! The verbs of rules where there is too much of something: defects in a line, rules that conflict, matches.
//! Each has a stated limit, and says that it was met.

use crate::support::Program;
use serde_json::{Value, json};
use std::fs;
use tempfile::TempDir;

fn cortex(folder: &TempDir, arguments: &[&str]) -> (i32, String, String) {
    let path = |word: &&str| {
        let file = folder.path().join(word);
        if file.exists() {
            file.to_str().unwrap().to_owned()
        } else {
            (*word).to_owned()
        }
    };
    let arguments: Vec<String> = arguments.iter().map(path).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let output = Program::run(&arguments);
    let words = |bytes| String::from_utf8(bytes).unwrap();
    let code = output.status.code().unwrap();
    (code, words(output.stdout), words(output.stderr))
}

fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

#[test]
fn many_defects_in_one_line_are_shown_in_part_and_listed_whole() {
    let rule =
        |index: usize| format!("r{index} : active(1) {{ {{ a:t x->a(l) }} => {{ a:t (p }} }} ");
    let text = "name=x\n===\n".to_owned() + &(0..400).map(rule).collect::<String>();
    let folder = folder(&[("rules.aggl", &text)]);
    let (code, _, told) = cortex(&folder, &["rules", "check", "rules.aggl"]);
    assert_eq!(code, 2);
    assert!(told.len() < 200_000, "{} bytes", told.len());
    assert!(told.contains(" more"), "{told}");
    let (code, out, _) = cortex(&folder, &["rules", "check", "rules.aggl", "--json"]);
    assert_eq!(code, 2);
    let out: Value = serde_json::from_str(&out).unwrap();
    assert!(out["diagnostics"].as_array().unwrap().len() >= 400);
    assert_eq!(out["diagnostics_left"], 0);
}

#[test]
fn findings_without_end_are_listed_for_machines_in_part() {
    let defects = "x->a(l) ".repeat(2_500);
    let long = "q".repeat(100_000);
    let text = format!(
        "name=x\n===\n{long} : active(1) {{ {{ a:t {defects} }} => {{ a:t }} }}\n{long} : active(1) {{ {{ a:t }} => {{ a:t }} }}\n"
    );
    let folder = folder(&[("rules.aggl", &text)]);
    for verb in ["check", "list"] {
        let (code, out, _) = cortex(&folder, &["rules", verb, "rules.aggl", "--json"]);
        assert_eq!(code, if verb == "check" { 2 } else { 0 });
        let out: Value = serde_json::from_str(&out).unwrap();
        let listed = out["diagnostics"].as_array().unwrap();
        assert_eq!(listed.len(), 2_000);
        assert!(out["diagnostics_left"].as_u64().unwrap() >= 501);
        let longest = listed
            .iter()
            .map(|row| row["message"].as_str().unwrap().len());
        assert!(longest.max().unwrap() < 3_000);
    }
}

#[test]
fn conflicts_of_many_rules_have_a_limit_that_is_told() {
    let rule = |index: usize| {
        format!(
            "r{index} : active(1) {{ {{ r:robot a:room b:room r->a(in) a->b(door) }} => \
             {{ r:robot a:room b:room r->b(in) a->b(door) }} }}\n"
        )
    };
    let text = "name=x\n===\n".to_owned() + &(0..100).map(rule).collect::<String>();
    let folder = folder(&[("rules.aggl", &text)]);
    let (code, out, _) = cortex(&folder, &["rules", "check", "rules.aggl", "--json"]);
    let out: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(code, 0);
    assert_eq!(
        out["conflicts"].as_array().unwrap().len(),
        grammar::CONFLICT_LIMIT
    );
    assert_eq!(
        out["conflicts_left"],
        json!(100 * 100 - grammar::CONFLICT_LIMIT)
    );
    // Of which it was not found out is named, and why.
    let undecided = out["undecided"].as_array().unwrap();
    assert_eq!(undecided.len(), grammar::CONFLICT_LIMIT);
    let why = "as many conflicts as are given had been found";
    assert!(undecided.iter().all(|pair| pair["reason"] == why));
    let (code, _, told) = cortex(&folder, &["rules", "check", "rules.aggl", "--conflicts"]);
    assert_eq!(code, 0);
    for words in [
        "of 9000 pairs of rules",
        "`r10` and `r9`: as many",
        "and 8990 more",
    ] {
        assert!(told.contains(words), "{words}: {told}");
    }
}

#[test]
fn a_goal_is_printed_again_with_its_comments() {
    let goal =
        "# where to\n{ p:person  \"hall\":room p->\"hall\"(in) }\nprecondition { (> p.age 5) }";
    let folder = folder(&[("goal.aggt", goal), ("bad.aggt", "{ p:person p->q(in) }")]);
    let (code, out, _) = cortex(&folder, &["rules", "fmt", "goal.aggt"]);
    let expected = "# where to\n{\n\tp:person\n\t\"hall\":room\n\tp->\"hall\"(in)\n}\n\
                    precondition\n{\n\t(> p.age 5)\n}\n";
    assert_eq!((code, &*out), (0, expected));
    fs::write(folder.path().join("goal.aggt"), &out).unwrap();
    let (_, again, _) = cortex(&folder, &["rules", "fmt", "goal.aggt"]);
    assert_eq!(again, out);
    let (code, out, told) = cortex(&folder, &["rules", "fmt", "bad.aggt"]);
    assert_eq!((code, &*out), (2, ""), "{told}");
}

#[test]
fn matches_without_end_are_listed_and_counted_in_part() {
    let node =
        |id: usize| json!({"id": id, "type": "box", "name": format!("b{id}"), "attributes": {}});
    let nodes: Vec<Value> = (1..=300).map(node).collect();
    let world = json!({"format": "dsr/1", "nodes": nodes, "edges": []}).to_string();
    let rule = "name=x\n===\nwide : active(1) { { a:box b:box c:box d:box } => { a:box b:box c:box d:box } }\n\
        pair : active(1) { { a:box b:box } => { a:box b:box } }\n";
    let folder = folder(&[("rules.aggl", rule), ("world.json", &world)]);
    let matched = |rest: &[&str]| {
        let arguments = [
            "rules",
            "match",
            "rules.aggl",
            "--world",
            "world.json",
            "--rule",
        ];
        let (code, out, told) = cortex(&folder, &[&arguments[..], rest].concat());
        assert_eq!(code, 0, "{told}");
        out
    };
    let out = matched(&["wide", "--limit", "3"]);
    assert!(out.starts_with("wide: at least "), "{out}");
    assert!(
        out.contains("stopped after 200000000 nodes had been tried"),
        "{out}"
    );
    assert_eq!(out.lines().filter(|line| line.contains("a=")).count(), 3);
    let out: Value = serde_json::from_str(&matched(&["wide", "--count", "--json"])).unwrap();
    assert_eq!(out["complete"], json!(false));
    assert!(out["count"].as_u64().unwrap() > 100_000_000);
    let out: Value = serde_json::from_str(&matched(&["pair", "--limit", "5", "--json"])).unwrap();
    assert_eq!(
        (&out["complete"], &out["count"]),
        (&json!(true), &json!(300 * 299))
    );
    assert_eq!(out["matches"].as_array().unwrap().len(), 5);
    let out = matched(&["pair", "--limit", "5"]);
    assert!(
        out.ends_with("and 89695 more (--limit N lists N)\n"),
        "{out}"
    );
    let arguments = [
        "rules",
        "explain",
        "rules.aggl",
        "--world",
        "world.json",
        "--rule",
        "wide",
    ];
    let (_, out, _) = cortex(&folder, &arguments);
    assert!(
        out.contains("given up after 200000000 nodes had been tried;"),
        "{out}"
    );
}

#[test]
fn a_rule_of_a_hundred_thousand_nodes_is_checked_as_fast_as_it_is_read() {
    // Looking through all nodes for each would take minutes.
    let count = 100_000;
    let all = |each: &dyn Fn(usize) -> String| (1..count).map(each).collect::<Vec<_>>().concat();
    let chain = all(&|n| format!("x{n}:t x{n}->x{}(next) ", n - 1));
    let deep = all(&|n| format!("(when (up x{n} x{n}) (forall y:t (not (next x{n} y))))"));
    let rule = format!(
        "name=long\n===\nr : active(1) {{ {{ x0:t {chain} }} => {{ x0:t {chain} }} effect {{ {deep} }} }}\n"
    );
    let folder = folder(&[("rules.aggl", &rule)]);
    for (verb, expected) in [("check", 2), ("list", 0)] {
        let (code, out, _) = cortex(&folder, &["rules", verb, "rules.aggl", "--json"]);
        assert_eq!(code, expected, "{verb}");
        let out: Value = serde_json::from_str(&out).unwrap();
        let told = &out["diagnostics"];
        assert_eq!(told.as_array().map(Vec::len), Some(1), "{told}");
        let words = "a rule binds at most 4096 nodes, and this one 100000";
        assert_eq!(told[0]["message"], words);
    }
}

#[test]
fn conditions_nested_deeply_leave_conflicts_undecided() {
    // Each quantifier ranges over a dozen nodes: what is tried would be twelve to the fortieth.
    let depth = 40;
    let each = |count: usize, word: &str| -> String {
        let words: Vec<String> = (0..count)
            .map(|n| word.replace('#', &n.to_string()))
            .collect();
        words.concat()
    };
    let (nodes, nested) = (each(12, "x#:A "), each(depth, "(forall z#:A "));
    let last = depth - 1;
    let close = ")".repeat(depth);
    let rule = format!(
        "name=deep\n===\nr : active(1) {{ {{ {nodes} }} => {{ x0:A }} precondition {{ {nested} (p x0 z{last}) {close} }} }}\n"
    );
    let folder = folder(&[("rules.aggl", &rule)]);
    let (code, out, told) = cortex(&folder, &["rules", "check", "rules.aggl", "--json"]);
    assert_eq!(code, 0, "{told}");
    let out: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(
        (&out["conflicts"], &out["conflicts_left"]),
        (&json!([]), &json!(1))
    );
}
