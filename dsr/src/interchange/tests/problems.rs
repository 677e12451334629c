//! What is told of files and graphs that are wrong, and of graph JSON that is right.

use super::super::*;
use super::{refused, world};
use crate::Schema;

#[test]
fn a_graph_survives_graph_json() {
    let text = r#"{"format":"dsr/1","nodes":[
        {"id":7,"type":"room","name":"kitchen","attributes":{"area":12.0,"n":3}},
        {"id":2,"type":"robot","name":"shelly","attributes":{"id":{"type":"u64","value":"18446744073709551615"}}}],
        "edges":[{"from":2,"label":"in","to":7,"attributes":{"since":{"type":"f32_list","value":[0.5]}}}]}"#;
    let once = crate::json::to_json(&world(text)).unwrap();
    let again = crate::json::to_json(&world(&once.to_string())).unwrap();
    assert_eq!(again, once);
    assert_eq!(once["nodes"][1]["attributes"]["area"].to_string(), "12.0");
}

#[test]
fn plain_numbers_of_graph_json_are_what_the_schema_says() {
    let schema = "[types]\nroom = []\n[labels]\n[attributes]\narea = { kind = \"f64\" }\n";
    let schema = Schema::from_toml("s.toml", schema).unwrap();
    let text =
        r#"{"format":"dsr/1","nodes":[{"type":"room","name":"k","attributes":{"area":12}}]}"#;
    let read = read(text, &schema).unwrap();
    assert_eq!(read.check(text, &schema), []);
}

#[test]
fn everything_wrong_with_a_file_is_told_at_once_and_in_its_place() {
    let text = r#"{"format":"dsr/1","nodes":[
 {"id":1,"type":"room","name":"kitchen","attributes":{"area":{"type":"f65","value":1},"n":null}},
 {"id":-3,"type":"room","name":"kitchen"}],
"edges":[{"from":"kitchn","label":"in","to":9}]}"#;
    expect_test::expect![[r"
        line 2 column 62: attribute `area`: unknown kind of value `f65`, did you mean `f64`?
        line 2 column 91: attribute `n`: null and untyped objects are no values
        line 3 column 8: -3 is no node's id
        line 3 column 32: there are two nodes with the name `kitchen`
        line 4 column 18: an edge `in` ends at `kitchn`, which is not in the file, did you mean `kitchen`?
        line 4 column 45: an edge `in` ends at node 9, which is not in the file"]]
    .assert_eq(&refused(text));
    expect_test::expect!["line 2 column 17: EOF while parsing a value"]
        .assert_eq(&refused("{\"format\":\"dsr/1\",\n\"nodes\":[{\"id\":1,"));
    expect_test::expect!["line 1 column 11: the format is `dsr/9`, not `dsr/1`"]
        .assert_eq(&refused(r#"{"format":"dsr/9","nodes":[]}"#));
}

const SCHEMA: &str = r#"
[types]
thing = []
room = ["thing"]
robot = ["thing"]
[labels]
in = { from = ["robot"], to = ["room"] }
[attributes]
area = { kind = "f64", min = 0.0 }
"#;

#[test]
fn what_a_schema_forbids_is_told_with_a_suggestion() {
    let schema = Schema::from_toml("s.toml", SCHEMA).unwrap();
    let text = r#"{"format":"dsr/1","nodes":[
 {"id":1,"type":"rom","name":"kitchen","attributes":{"aera":1.0}},
 {"id":2,"type":"room","name":"hall","attributes":{"area":-1.0}},
 {"id":3,"type":"robot","name":"shelly","attributes":{"area":"big"}}],
"edges":[{"from":2,"label":"in","to":3},{"from":3,"label":"inn","to":2}]}"#;
    // The plain numbers and texts are not yet read with the schema: all of it is told.
    let world = read(text, &Schema::open()).unwrap();
    let told: Vec<String> = world
        .check(text, &schema)
        .iter()
        .map(ToString::to_string)
        .collect();
    expect_test::expect![[r"
        line 2 column 17: unknown node type `rom`, did you mean `room`?
        line 2 column 55: unknown attribute `aera`, did you mean `area`?
        line 3 column 59: `area` must lie in [0, inf], not -1
        line 4 column 62: `area` is a f64, not a string
        line 5 column 28: `in` does not join room to robot
        line 5 column 59: unknown edge label `inn`, did you mean `in`?"]]
    .assert_eq(&told.join("\n"));
    let text = r#"{"DSRModel":{"symbols":[
 {"id":1,"type":"robt","attribute":{"area":{"type":1,"value":3}},"links":[{"dst":5,"label":"in"}]}]}}"#;
    let world = read(text, &schema).unwrap();
    let told: Vec<String> = world
        .check(text, &schema)
        .iter()
        .map(ToString::to_string)
        .collect();
    expect_test::expect![[r"
        line 2 column 17: unknown node type `robt`, did you mean `robot`?
        line 2 column 44: `area` is a f64, not a i32
        line 2 column 82: the link `in` of symbol 1 is left out: there is no symbol 5"]]
    .assert_eq(&told.join("\n"));
}

#[test]
fn a_problem_shows_the_line_that_it_is_about() {
    let text =
        "{\"format\":\"dsr/1\",\n\"nodes\":[{\"id\":true,\"type\":\"room\",\"name\":\"k\"}]}";
    let error = read(text, &Schema::open()).unwrap_err();
    let handler = miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::none());
    let mut shown = String::new();
    handler
        .render_report(&mut shown, &error.in_file("w.json", text))
        .unwrap();
    for words in [
        "w.json: 1 problem",
        "true is no node's id",
        "w.json:2:16",
        "\"nodes\":[{\"id\":true",
    ] {
        assert!(shown.contains(words), "{shown}");
    }
}

#[test]
fn broken_kinematics_are_found() {
    let text = r#"{"DSRModel":{"symbols":[
 {"id":1,"type":"world","name":"world","links":[
   {"dst":2,"label":"RT","linkAttribute":{"rt_translation":{"type":3,"value":[1,2,3]},"rt_rotation_euler_xyz":{"type":3,"value":[0,0,0]}}},
   {"dst":3,"label":"RT"}]},
 {"id":2,"type":"robot","name":"robot","attribute":{"parent":{"type":7,"value":"99"}}},
 {"id":3,"type":"robot","name":"mute"},
 {"id":4,"type":"a","name":"a","links":[{"dst":5,"label":"RT","linkAttribute":{"tx":{"type":0,"value":"1"}}},{"dst":2,"label":"RT"}]},
 {"id":5,"type":"b","name":"b","links":[{"dst":4,"label":"RT"}]}]}}"#;
    let found = check_graph(&world(text)).unwrap();
    let told: Vec<String> = found
        .iter()
        .map(|p| format!("{}: {p}", p.severity))
        .collect();
    expect_test::expect![[r"
        error: `robot` has two poses, from `world` and from `a`
        warning: `world` -RT-> `mute` has no pose in `rt_translation`
        warning: `b` -RT-> `a` has no pose in `rt_translation`
        error: `a` -RT-> `b` has no pose in `rt_translation`
        error: the poses that `a` hangs on lead in a circle
        warning: the `parent` of `robot` is 99, which is not in the graph"]]
    .assert_eq(&told.join("\n"));
    let islands = r#"{"format":"dsr/1","nodes":[{"type":"t","name":"a"},{"type":"t","name":"b"},{"type":"t","name":"c"},
        {"type":"t","name":"d"},{"type":"t","name":"e"}],"edges":[
        {"from":"a","label":"pose","to":"b","attributes":{"transform":{"type":"pose","value":{"translation":[0,0,0],"rotation":[0,0,0,1]}}}},
        {"from":"c","label":"pose","to":"d","attributes":{"transform":{"type":"pose","value":{"translation":[0,0,0],"rotation":[0,0,0,1]}}}}]}"#;
    let found = check_graph(&world(islands)).unwrap();
    assert_eq!(
        found.iter().map(ToString::to_string).collect::<Vec<_>>(),
        ["poses form 2 trees that nothing connects: `a` with 2 nodes, `c` with 2 nodes"]
    );
}
