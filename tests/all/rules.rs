//! `cortex rules` as its users meet it: what it says of good and broken grammars, what it finds in
//! worlds of every format, and how it ends.

use crate::support::Program;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const RULES: &str = "name=rooms
===
types
{
(robot : thing)
(room : thing)
}
===
changeRoom : active(1) agent(navigation)
{
	{ r:robot a:room b:room r->a(in) a->b(connected) }
	=>
	{ r:robot a:room b:room r->b(in) a->b(connected) }
}
big : passive(1) cost(e(a, connected, a).distance)
{
	{ a:room }
	=>
	{ a:room }
	precondition { (and (> a.area 5) (exists b:room (connected a b))) }
}
";

const WORLD: &str = r#"{"format":"dsr/1","nodes":[
{"id":1,"type":"robot","name":"rob"},
{"id":2,"type":"room","name":"r2","attributes":{"area":4.0}},
{"id":3,"type":"room","name":"r3","attributes":{"area":9.0}},
{"id":4,"type":"room","name":"r4","attributes":{"area":16.0}}],
"edges":[{"from":1,"label":"in","to":3},{"from":2,"label":"connected","to":3},
{"from":3,"label":"connected","to":2},{"from":3,"label":"connected","to":4},
{"from":4,"label":"connected","to":3}]}"#;

/// A folder with files of the user's.
struct Folder(TempDir);

impl Folder {
    fn new(files: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}

/// Exit code, standard output and standard error.
fn rules(folder: &Folder, verb: &str, file: &str, rest: &[&str]) -> (i32, String, String) {
    let file = folder.path(file);
    let mut arguments = vec!["rules", verb, text(&file)];
    let world = rest.contains(&"--world");
    arguments.extend(rest.iter().filter(|word| **word != "--world"));
    let path = folder.path("world");
    if world {
        arguments.extend(["--world", text(&path)]);
    }
    let output = Program::run(&arguments);
    let words = |bytes| String::from_utf8(bytes).unwrap();
    (
        output.status.code().unwrap(),
        words(output.stdout),
        words(output.stderr),
    )
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn json(folder: &Folder, verb: &str, file: &str, rest: &[&str]) -> (i32, Value) {
    let mut rest = rest.to_vec();
    rest.push("--json");
    let (code, out, err) = rules(folder, verb, file, &rest);
    (
        code,
        serde_json::from_str(&out).unwrap_or_else(|_| panic!("{out}{err}")),
    )
}

#[test]
fn a_good_grammar_is_checked_listed_and_printed_again() {
    let folder = Folder::new(&[("a.aggl", RULES)]);
    let (code, out, err) = rules(&folder, "check", "a.aggl", &[]);
    assert_eq!((code, err.as_str()), (0, ""));
    assert!(out.ends_with("2 types, 2 rules\n"), "{out}");
    let (code, list) = json(&folder, "list", "a.aggl", &[]);
    assert_eq!(code, 0);
    assert_eq!(list["types"], json!(["robot", "room", "thing"]));
    assert_eq!(list["diagnostics"], json!([]));
    let [change, big] = [&list["rules"][0], &list["rules"][1]];
    assert_eq!(
        [&change["name"], &change["agent"]],
        ["changeRoom", "navigation"]
    );
    assert_eq!([&change["active"], &big["active"]], [true, false]);
    assert_eq!(change["cost"], 1.0);
    assert_eq!(big["cost"], "e(a, connected, a).distance");
    let (code, once, _) = rules(&folder, "fmt", "a.aggl", &[]);
    assert_eq!(code, 0);
    fs::write(folder.path("b.aggl"), &once).unwrap();
    let (_, again, _) = rules(&folder, "fmt", "b.aggl", &[]);
    assert_eq!(once, again);
    let (_, of_once) = json(&folder, "list", "b.aggl", &[]);
    assert_eq!(of_once, list);
}

#[test]
fn includes_are_found_beside_the_file_that_names_them_and_each_defect_has_its_place() {
    let included = "name=b\n===\ninclude(../a.aggl)\ninclude(missing.aggl)\n\
        good : active(1) { { x:room } => { x:room x->x(seen) } }\nbroken : actve(1) {}\n";
    let main = "name=a\n===\ninclude(sub/b.aggl)\nmine : active(2) { { x:room } => { x:room } }\n";
    let folder = Folder::new(&[("a.aggl", main), ("sub/b.aggl", included)]);
    let (code, _, err) = rules(&folder, "check", "a.aggl", &[]);
    assert_eq!(code, 2);
    let b = folder.path("sub/b.aggl");
    let b = text(&b);
    let missing = format!("{b}:4:9: error: cannot read the included file `missing.aggl`");
    let broken = format!("{b}:6:10: error: expected `active` or `passive`, found `actve`");
    assert!(err.contains(&missing) && err.contains(&broken), "{err}");
    let (code, list) = json(&folder, "list", "a.aggl", &[]);
    assert_eq!(code, 0, "it could be read");
    let names: Vec<&str> = list["rules"]
        .as_array()
        .unwrap()
        .iter()
        .map(|r| r["name"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["good", "mine"]);
    let row = &list["diagnostics"][0];
    assert_eq!([&row["severity"], &row["file"]], ["error", b]);
    assert_eq!([&row["line"], &row["column"]], [4, 9]);
    let (code, out, err) = rules(&folder, "fmt", "a.aggl", &[]);
    assert_eq!(code, 0, "the file itself can be printed: {err}");
    assert!(
        out.contains("include(sub/b.aggl)") && !out.contains("good"),
        "{out}"
    );
    let (code, out, _) = rules(&folder, "fmt", "sub/b.aggl", &[]);
    assert_eq!(
        (code, out.as_str()),
        (2, ""),
        "printing it would lose `broken`"
    );
}

#[test]
fn what_a_manifest_does_not_give_is_told_in_both_files() {
    let tidy = "name=tidy\n===\nclear : active(1) agent(keeper)\n{ { c:cup t:table c->t(on) } => { t:table } \
                effect { (assign t.clear true) } }\nmove : active(1) agent(keeper)\n\
                { { c:cup a:table b:table c->a(on) } => { c:cup a:table b:table c->b(on) } }\n";
    let manifest = "agent = \"keeper\"\nnodes = [\"cup\"]\nrules = [\"clear\", \"claer\"]\n";
    let folder = Folder::new(&[("a.aggl", tidy), ("keeper.toml", manifest)]);
    let path = folder.path("keeper.toml");
    let (code, _, err) = rules(&folder, "check", "a.aggl", &["--manifest", text(&path)]);
    assert_eq!(code, 2, "{err}");
    let of = |file: &str, place: &str| format!("{}:{place}", text(&folder.path(file)));
    for expected in [
        of(
            "a.aggl",
            "4:24: warning: this removes a link `on`, which the manifest of `keeper` gives only by this rule",
        ),
        of(
            "a.aggl",
            "5:24: error: the manifest of `keeper` gives no right to apply this rule",
        ),
        of("keeper.toml", "3:19: error: no rule `claer`"),
    ] {
        assert!(err.contains(&expected), "{expected}\n{err}");
    }
    assert!(err.contains("this writes `t.clear`"), "{err}");
    assert!(!err.contains("deletes a `cup`"), "{err}");
    let given = manifest.replace(", \"claer\"", ", \"move\"");
    fs::write(&path, given).unwrap();
    let (code, _, err) = rules(&folder, "check", "a.aggl", &["--manifest", text(&path)]);
    assert_eq!(code, 0, "{err}");
    assert!(err.contains("this makes a link `on`"), "{err}");
}

#[test]
fn a_combo_is_listed_with_the_rules_that_it_stands_for() {
    let combo = "name=two\n===\n\
                 open : active(1) { { d:door d->d(shut) } => { d:door } }\n\
                 pass : active(2) { { r:robot d:door d->d(shut)* } => { r:robot d:door r->d(passed) } }\n\
                 through : active(0) { open as first optional pass as second\n\
                 where: ( first.d = second.d ) }\n";
    let folder = Folder::new(&[("a.aggl", combo)]);
    let (code, out, err) = rules(&folder, "list", "a.aggl", &[]);
    assert_eq!(code, 0, "{err}");
    let expected = "combo through : active, cost 0  (open as first optional, pass as second)\n    \
                    as rule through  ";
    assert!(out.contains(expected), "{out}");
    assert!(out.contains("    as rule through_without_first  "), "{out}");
    let (_, list) = json(&folder, "list", "a.aggl", &[]);
    let listed = &list["rules"][2];
    assert_eq!(
        [&listed["name"], &listed["combo"]],
        [&json!("through"), &json!(true)]
    );
    let names: Vec<&Value> = listed["variants"]
        .as_array()
        .unwrap()
        .iter()
        .map(|variant| &variant["name"])
        .collect();
    assert_eq!(names, ["through", "through_without_first"]);
    assert_eq!(listed["variants"][1]["steps"], json!(["second"]));
}

#[test]
fn rules_beside_a_broken_one_are_used_and_the_broken_one_is_told() {
    let broken = "bad : active(1)\n{\n\t{ r:robto }\n\t=>\n\t{ r:robto }\n}\n";
    let text = format!("{RULES}{broken}");
    let folder = Folder::new(&[("a.aggl", text.as_str()), ("world", WORLD)]);
    let one = ["--world", "--rule", "changeRoom"];
    let apply = ["--world", "--rule", "changeRoom", "--bind", "b=r2"];
    for (verb, rest) in [
        ("match", &one[..]),
        ("match", &one[..1]),
        ("explain", &one[..]),
        ("export", &["--dot"][..]),
        ("apply", &apply[..]),
    ] {
        let (code, out, err) = rules(&folder, verb, "a.aggl", rest);
        assert_eq!(code, 0, "{verb}: {err}");
        assert!(out.contains("changeRoom") && !out.contains("bad"), "{out}");
        assert!(err.contains("a.aggl:24:6: error: "), "{err}");
        assert!(
            err.contains("warning: without the broken rules `bad`\n"),
            "{err}"
        );
    }
    let (_, out, _) = rules(&folder, "list", "a.aggl", &[]);
    assert!(
        out.contains("\nrule big") && out.contains("\nbroken rule bad"),
        "{out}"
    );
    let (code, _, err) = rules(&folder, "match", "a.aggl", &["--world", "--rule", "bad"]);
    assert_eq!(code, 2);
    assert!(err.contains("robto"), "{err}");
    fs::write(
        folder.path("a.aggl"),
        text.replace("(room : thing)", "(room thing"),
    )
    .unwrap();
    let (code, _, err) = rules(&folder, "match", "a.aggl", &one);
    assert_eq!(code, 2);
    assert!(
        err.contains("no rule can be used, because every rule"),
        "{err}"
    );
    let rest = RULES.rsplit_once("===").unwrap();
    let missing = format!(
        "{}===\ninclude(no.aggl)\n{}{}",
        rest.0,
        rest.1,
        broken.replace("robto", "tram")
    );
    fs::write(folder.path("a.aggl"), missing).unwrap();
    let (code, out, err) = rules(&folder, "match", "a.aggl", &one);
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("changeRoom"), "{out}");
    assert!(
        err.contains("warning: without `bad`, whose types may be declared there\n"),
        "{err}"
    );
    let wrong = ["--world", "--rule", "changeRoom", "--bind", "a=rob"];
    let (code, out, _) = rules(&folder, "apply", "a.aggl", &wrong);
    assert_eq!(code, 1, "{out}");
    assert!(out.contains("not a room"), "{out}");
}

#[test]
fn a_rule_that_can_never_be_applied_is_told_once_also_where_a_world_is_given() {
    let never = "dormant late : passive(1)\n{\n\t{ r:robot }\n\t=>\n\t{ r:robot }\n}\n";
    let text = format!("{RULES}{never}");
    let folder = Folder::new(&[("a.aggl", text.as_str()), ("world", WORLD)]);
    for rest in [&[][..], &["--world"][..]] {
        let (_, out, err) = rules(&folder, "check", "a.aggl", rest);
        let told = format!("{out}{err}");
        assert_eq!(told.matches("can never be applied").count(), 1, "{told}");
    }
}

#[test]
fn a_file_that_is_not_there_is_bad_input() {
    let folder = Folder::new(&[]);
    for verb in ["check", "list", "fmt"] {
        let (code, _, err) = rules(&folder, verb, "none.aggl", &[]);
        assert!(
            code == 2 && err.contains("none.aggl"),
            "{verb}: {code} {err}"
        );
    }
    fs::write(folder.path("latin.aggl"), b"name=caf\xe9\n").unwrap();
    let (code, _, err) = rules(&folder, "check", "latin.aggl", &[]);
    let expected = "latin.aggl:1: byte 9 of the file is not UTF-8 text";
    assert!(code == 2 && err.contains(expected), "{code} {err}");
}

#[test]
fn matches_are_listed_by_name_or_counted() {
    let folder = Folder::new(&[("a.aggl", RULES), ("world", WORLD)]);
    let (code, found) = json(
        &folder,
        "match",
        "a.aggl",
        &["--rule", "changeRoom", "--world"],
    );
    assert_eq!(code, 0);
    assert_eq!(
        [&found["rule"], &found["count"]],
        [&json!("changeRoom"), &json!(2)]
    );
    assert!(found["seconds"].as_f64().unwrap() > 0.0);
    let mut matches = found["matches"].as_array().unwrap().clone();
    matches.sort_by_key(ToString::to_string);
    let expected = [
        json!({"r": "rob", "a": "r3", "b": "r2"}),
        json!({"r": "rob", "a": "r3", "b": "r4"}),
    ];
    assert_eq!(matches, expected);
    let (_, counted) = json(
        &folder,
        "match",
        "a.aggl",
        &["--rule", "big", "--count", "--world"],
    );
    assert_eq!(
        (&counted["count"], counted.get("matches")),
        (&json!(2), None)
    );
    let (_, all) = json(&folder, "match", "a.aggl", &["--world"]);
    assert_eq!(all.as_array().unwrap().len(), 2, "every rule");
    let (code, _, err) = rules(&folder, "match", "a.aggl", &["--rule", "bigg", "--world"]);
    assert!(
        code == 2 && err.contains("did you mean `big`?"),
        "{code} {err}"
    );
}

#[test]
fn a_rule_is_tried_and_its_change_shown_or_why_there_is_none() {
    let folder = Folder::new(&[("a.aggl", RULES), ("world", WORLD)]);
    let change = ["--rule", "changeRoom", "--world"];
    let (code, _, err) = rules(&folder, "apply", "a.aggl", &change);
    assert_eq!(code, 2);
    assert!(
        err.contains("more than once") && err.contains("b=r4"),
        "{err}"
    );
    let bound: Vec<&str> = change.into_iter().chain(["--bind", "b=4"]).collect();
    let (code, out, _) = rules(&folder, "apply", "a.aggl", &bound);
    assert_eq!(code, 0);
    assert_eq!(
        out,
        "changeRoom  r=rob a=r3 b=r4\n    - rob -in-> r3\n    + rob -in-> r4\ncost 1\n"
    );
    let (_, applied) = json(&folder, "apply", "a.aggl", &bound);
    assert_eq!(
        applied["binding"],
        json!({"r": "rob", "a": "r3", "b": "r4"})
    );
    let created = json!({
        "do": "create_edge", "from": "rob", "label": "in", "to": "r4", "attributes": {},
    });
    assert_eq!(applied["operations"][1], created);
    let far: Vec<&str> = change
        .into_iter()
        .chain(["--bind", "r=rob", "a=r2", "b=r3"])
        .collect();
    let (code, refused) = json(&folder, "apply", "a.aggl", &far);
    assert_eq!((code, &refused["applicable"]), (1, &json!(false)));
    assert_eq!(refused["reason"], "r (rob) has no link `in` to a (r2)");
    for (bind, words) in [("b=r5", "did you mean"), ("c=r2", "has no variable `c`")] {
        let wrong: Vec<&str> = change.into_iter().chain(["--bind", bind]).collect();
        let (code, _, err) = rules(&folder, "apply", "a.aggl", &wrong);
        assert!(code == 2 && err.contains(words), "{code} {err}");
    }
    assert_eq!(
        fs::read_to_string(folder.path("world")).unwrap(),
        WORLD,
        "it stays as it is"
    );
}

#[test]
fn worlds_of_other_systems_are_matched_and_exported() {
    let agm = r#"<AGMModel><link src="1" dst="3" label="in"/><link src="3" dst="4" label="connected"/>
        <symbol id="1" type="robot"><attribute key="imName" value="rob"/></symbol>
        <symbol id="3" type="room"/><symbol id="4" type="room"/></AGMModel>"#;
    let robocomp = "\u{feff}{\"DSRModel\":{\"symbols\":{
        \"1\":{\"id\":1,\"type\":\"robot\",\"name\":\"rob\",\"attribute\":{},\"links\":[
          {\"src\":\"1\",\"dst\":\"3\",\"label\":\"in\",\"linkAttribute\":{}}]},
        \"3\":{\"id\":3,\"type\":\"room\",\"name\":\"3\",\"attribute\":{\"n\":{\"type\":7,\"value\":\"9\"}},\"links\":[
          {\"src\":3,\"dst\":4,\"label\":\"connected\"},{\"src\":3,\"dst\":99,\"label\":\"RT\"}]},
        \"4\":{\"id\":4,\"type\":\"room\",\"name\":\"4\",\"links\":[]}}}}";
    for world in [agm, robocomp] {
        let folder = Folder::new(&[("a.aggl", RULES), ("world", world)]);
        let (code, found) = json(
            &folder,
            "match",
            "a.aggl",
            &["--rule", "changeRoom", "--world"],
        );
        assert_eq!(code, 0);
        assert_eq!(found["matches"], json!([{"r": "rob", "a": "3", "b": "4"}]));
        let path = folder.path("world");
        let export = Program::run(&["graph", "export", "json", "--file", text(&path)]);
        let graph: Value = serde_json::from_slice(&export.stdout).unwrap();
        assert_eq!(graph["format"], "dsr/1");
        assert_eq!(graph["nodes"].as_array().unwrap().len(), 3);
        assert_eq!(graph["edges"].as_array().unwrap().len(), 2);
        let told = String::from_utf8(export.stderr).unwrap();
        assert_eq!(
            told.contains("there is no symbol 99"),
            world == robocomp,
            "{told}"
        );
    }
    let folder = Folder::new(&[("world", "<AGMModel>\n<symbol id='1'/></AGMModel>")]);
    let path = folder.path("world");
    let broken = Program::run(&["graph", "export", "json", "--file", text(&path)]);
    assert_eq!(broken.status.code(), Some(2));
    let told = String::from_utf8(broken.stderr).unwrap();
    assert!(
        told.contains("world:2:1") && told.contains("`<symbol>` has no `type`"),
        "{told}"
    );
}

#[test]
fn explain_shows_the_search_and_what_it_came_across() {
    let folder = Folder::new(&[("rules.aggl", RULES), ("world", WORLD)]);
    let (code, out, _) = rules(
        &folder,
        "explain",
        "rules.aggl",
        &["--rule", "changeRoom", "--world"],
    );
    assert_eq!(code, 0);
    let expected = "\
changeRoom, by the graph's counts: cost 4.3
    binds  from            candidates  passing  if
    r a    every link `in`  1.0 (1)     1.0 (1)
    b      connected of a  1.3 (2)     1.3 (2)
";
    assert_eq!(words_of(&out), words_of(expected));
    let (code, out, _) = rules(&folder, "explain", "rules.aggl", &["--json", "--world"]);
    assert_eq!(code, 0);
    let plans: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(plans[1]["rule"], "big");
    assert_eq!(plans[1]["steps"][0]["source"], "every room");
    assert_eq!(
        plans[1]["steps"][0]["found"],
        json!({"candidates": 3, "passing": 2})
    );
    let (code, out, _) = rules(&folder, "explain", "rules.aggl", &["--rule", "big"]);
    assert_eq!((code, out.contains("no world was given")), (0, true));
}

#[test]
fn explain_shows_which_rules_share_steps_when_they_are_watched() {
    let text = "name=x\n===\n\
                go : active(1) { { r:robot a:room b:room r->a(in) a->b(door) } => { } }\n\
                meet : active(1) { { q:robot x:room y:room p:person q->x(in) x->y(door) p->y(in) } => { } }\n";
    let folder = Folder::new(&[("rules.aggl", text)]);
    let (code, out, _) = rules(&folder, "explain", "rules.aggl", &["--rule", "meet"]);
    assert_eq!(code, 0);
    let expected = "watched with go, once where `in` changes (in the names of go): given r a, b from door of a";
    assert!(out.contains(expected), "{out}");
    let (_, out, _) = rules(&folder, "explain", "rules.aggl", &["--json"]);
    let plans: Value = serde_json::from_str(&out).unwrap();
    let set = json!({"label": "in", "with": ["meet"], "names_of": "go",
        "steps": ["given r a", "b from door of a"]});
    let shared = plans[0]["shared"].as_array().unwrap();
    assert!(shared.contains(&set), "{shared:?}");
}

/// The words of a table, line by line.
fn words_of(table: &str) -> Vec<Vec<&str>> {
    table
        .lines()
        .map(|line| line.split_whitespace().collect())
        .collect()
}
