//! Worlds of other systems: what comes in, what is refused and where, and that nothing panics.

use super::*;
use crate::{Graph, NodeId, Schema, Snapshot, Time, Value};
use proptest::prelude::*;

fn world(text: &str) -> Snapshot {
    let mut graph = Graph::in_memory(Schema::open());
    graph
        .commit(&read(text).unwrap().transaction, "test", Time::default())
        .unwrap();
    graph.snapshot()
}

fn refused(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

const ROBOCOMP: &str = r#"{"DSRModel":{"symbols":{
 "100":{"id":"100","type":"root","name":"root","attribute":{
   "t0":{"type":0,"value":"SeaGreen"},
   "t1":{"type":1,"value":-2147483648},
   "t2":{"type":2,"value":71.272423},
   "t3":{"type":3,"value":[0,0.1,-4.886917963631277e-07]},
   "t4":{"type":4,"value":true,"timestamp":1700000000123456789,"agent_id":12},
   "t5":{"type":5,"value":[0,128,255]},
   "t6":{"type":6,"value":4294967295},
   "t7":{"type":7,"value":"18446744073709551615"},
   "t8":{"type":8,"value":0.1},
   "t9":{"type":9,"value":["18446744073709551615",3]},
   "t10":{"type":10,"value":[1,2]},
   "t11":{"type":11,"value":[1,2,3]},
   "t12":{"type":12,"value":[1,2,3,4]},
   "t13":{"type":13,"value":[1,2,3,4,5,0.6]}},
  "links":[{"src":"100","dst":"200","label":"RT","linkAttribute":{
   "rt_translation":{"type":3,"value":[10,0,-2.5]}}}]},
 "200":{"id":200,"type":"omnirobot","name":"robot","attribute":{},"links":[]}}}}"#;

#[test]
fn every_type_of_robocomp_comes_in_without_loss() {
    let world = world(ROBOCOMP);
    let root = world.find_node_by_name("root").unwrap().unwrap();
    assert_eq!((root.id(), root.type_name()), (NodeId(100), "root"));
    let expected = [
        ("t0", Value::from("SeaGreen")),
        ("t1", Value::I32(i32::MIN)),
        ("t2", Value::F32(71.272_42)),
        ("t3", Value::F32List(vec![0.0, 0.1, -4.886_918e-7])),
        ("t4", Value::Bool(true)),
        ("t5", Value::U8List(vec![0, 128, 255])),
        ("t6", Value::U32(u32::MAX)),
        ("t7", Value::U64(u64::MAX)),
        ("t8", Value::F64(0.1)),
        ("t9", Value::U64List(vec![u64::MAX, 3])),
        ("t10", Value::F32Vector(vec![1.0, 2.0])),
        ("t11", Value::F32Vector(vec![1.0, 2.0, 3.0])),
        ("t12", Value::F32Vector(vec![1.0, 2.0, 3.0, 4.0])),
        ("t13", Value::F32Vector(vec![1.0, 2.0, 3.0, 4.0, 5.0, 0.6])),
    ];
    assert_eq!(
        root.attributes().unwrap().len(),
        expected.len(),
        "no time stamp, no agent id"
    );
    for (name, value) in expected {
        assert_eq!(root.value(name).unwrap(), Some(value), "{name}");
    }
    let edge = root.out_edges().next().unwrap().unwrap();
    assert_eq!(edge.to, NodeId(200));
    let moved = world
        .find_edge(edge)
        .unwrap()
        .unwrap()
        .value("rt_translation")
        .unwrap();
    assert_eq!(moved, Some(Value::F32List(vec![10.0, 0.0, -2.5])));
}

#[test]
fn the_variants_of_robocomp_are_read() {
    let list = "\u{feff}{\"DSRModel\":{\"symbols\":[
        {\"id\":2,\"type\":\"room\",\"links\":[]},
        {\"id\":1,\"type\":\"robot\",\"name\":\"r\",\"attribute\":{\"on\":{\"type\":4,\"value\":1},
          \"far\":{\"type\":2,\"value\":null}},\"links\":[{\"dst\":2,\"label\":\"in\"}]}]}}\n}, left over";
    let list = world(list);
    assert_eq!(
        list.find_node_by_name("2").unwrap().unwrap().id(),
        NodeId(2)
    );
    let robot = list.find_node(NodeId(1)).unwrap().unwrap();
    assert_eq!(robot.value("on").unwrap(), Some(Value::Bool(true)));
    assert!(matches!(robot.value("far").unwrap(), Some(Value::F32(x)) if x.is_nan()));
    assert_eq!(robot.out_edges().count(), 1);
    let keyed = world(r#"{"DSRModel":{"symbols":{"7":{"type":"room","name":"k"}}}}"#);
    assert!(keyed.find_node(NodeId(7)).unwrap().is_some());
}

#[test]
fn a_link_of_robocomp_to_nowhere_is_left_out_and_told() {
    let text = r#"{"DSRModel":{"symbols":[{"id":1,"type":"t","links":[
        {"src":1,"dst":9,"label":"RT"},{"src":1,"dst":1,"label":"is"}]}]}}"#;
    let told: Vec<String> = read(text)
        .unwrap()
        .left_out
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(
        told,
        ["the link `RT` of symbol 1 is left out: there is no symbol 9"]
    );
    assert_eq!(world(text).edge_count(), 1);
}

#[test]
fn a_broken_robocomp_file_is_told_with_its_place() {
    let symbol = |inner: &str| format!("{{\"DSRModel\":{{\"symbols\":[\n{inner}]}}}}");
    let attribute = |number: u8, value: &str| {
        let attribute = format!(r#""a":{{"type":{number},"value":{value}}}"#);
        symbol(&format!(
            r#"{{"id":1,"type":"t","name":"n","attribute":{{{attribute}}}}}"#
        ))
    };
    for (text, words) in [
        (
            attribute(1, "2147483648"),
            "2147483648 is not a 32-bit integer (type 1) at line 2",
        ),
        (
            attribute(2, "1e300"),
            "1e+300 is not a single-precision number",
        ),
        (attribute(5, "[256]"), "[256] is not a list of bytes"),
        (
            attribute(7, "\"-1\""),
            "\"-1\" is not an unsigned 64-bit integer",
        ),
        (attribute(11, "[1,2]"), "[1,2] is not three numbers"),
        (attribute(14, "1"), "unknown type 14"),
        (
            symbol(r#"{"id":-1,"type":"t"}"#),
            "-1 is no symbol's id at line 2 column 8",
        ),
        (symbol(r#"{"id":1,"#), "at line 2"),
        (
            symbol(r#"{"id":1,"type":"t"},{"id":"1","type":"t"}"#),
            "two symbols have the id 1",
        ),
        (
            symbol(r#"{"id":1,"type":"t","links":[{"src":2,"dst":1,"label":"in"}]}"#),
            "symbol 1 has a link `in` that starts at 2",
        ),
        (
            symbol(r#"{"id":1,"type":"t","name":"a"},{"id":2,"type":"t","name":"a"}"#),
            "the symbols 1 and 2 are both named `a`",
        ),
    ] {
        let told = refused(&text);
        assert!(told.contains(words), "{told}\n{text}");
    }
}

const AGM: &str = r#"<?xml version="1.0"?>
<AGMModel>
  <!-- links may come first -->
  <link src="1" dst="3" label="in" enabled="true"/>
  <symbol id="1" type="robot"><attribute key="imName" value="shelly"/></symbol>
  <symbol id="3" type="room">
    <attribute key="imName" value="room"/>
    <attribute key="polyline" value="-8500 2500;-3500 2500"/>
  </symbol>
  <symbol id="4" type="room"><attribute key="imName" value="room"/></symbol>
  <symbol id="door_a" type="door"/>
  <link src="3" dst="door_a" label="RT"><linkAttribute key="tx" value="-7500"/></link>
</AGMModel>"#;

#[test]
fn agm_models_come_in_with_links_before_symbols() {
    let world = world(AGM);
    let name = |id| {
        world
            .find_node(NodeId(id))
            .unwrap()
            .unwrap()
            .name()
            .unwrap()
    };
    assert_eq!(
        [name(1), name(3), name(4)],
        ["shelly", "3", "4"],
        "`room` is not unique"
    );
    let room = world.find_node(NodeId(3)).unwrap().unwrap();
    assert_eq!(
        room.value("polyline").unwrap(),
        Some("-8500 2500;-3500 2500".into())
    );
    assert_eq!(room.value("imName").unwrap(), Some("room".into()));
    let door = world.find_node_by_name("door_a").unwrap().unwrap();
    let edge = room.out_edges().next().unwrap().unwrap();
    assert_eq!(edge.to, door.id());
    let edge = world.find_edge(edge).unwrap().unwrap();
    assert_eq!(edge.value("tx").unwrap(), Some("-7500".into()));
    let robot = world.find_node(NodeId(1)).unwrap().unwrap();
    let within = robot.out_edges().next().unwrap().unwrap();
    let within = world.find_edge(within).unwrap().unwrap();
    assert_eq!(within.value("enabled").unwrap(), Some("true".into()));
}

#[test]
fn a_name_never_takes_the_id_of_another_symbol() {
    let xml = r#"<AGMModel><symbol id="1" type="t"><attribute key="imName" value="2"/></symbol>
        <symbol id="2" type="t"/></AGMModel>"#;
    let world = world(xml);
    assert_eq!(
        world.find_node_by_name("2").unwrap().unwrap().id(),
        NodeId(2)
    );
    assert_eq!(
        world.find_node_by_name("1").unwrap().unwrap().id(),
        NodeId(1)
    );
}

#[test]
fn a_broken_agm_model_is_told_with_line_and_column() {
    let model = |inner: &str| format!("<AGMModel>\n  {inner}\n</AGMModel>");
    for (text, words) in [
        (
            model("<symbol id='1'/>"),
            "line 2 column 3: `<symbol>` has no `type`",
        ),
        (
            model("<symbl/>"),
            "line 2 column 3: expected `<symbol>` or `<link>`, found `<symbl>`",
        ),
        (
            model("<symbol id='1' type='t'/><symbol id='1' type='t'/>"),
            "line 2 column 28: there is a symbol `1` already",
        ),
        (
            model("<symbol id='1' type='t'/><link src='1' dst='9' label='in'/>"),
            "line 2 column 28: there is no symbol `9` for the link `in`",
        ),
        (
            model("<symbol id='1' type='t'><attribute key='k'/></symbol>"),
            "has no `value`",
        ),
        (
            "<model/>".to_owned(),
            "line 1 column 1: expected `<AGMModel>`",
        ),
        (model("<symbol"), "3:1"),
    ] {
        let told = refused(&text);
        assert!(told.contains(words), "{told}\n{text}");
    }
}

#[test]
fn an_entity_that_would_fill_the_memory_is_refused() {
    let bomb =
        r#"<!DOCTYPE a [<!ENTITY x "xxxxxxxx"><!ENTITY y "&x;&x;&x;">]><AGMModel>&y;</AGMModel>"#;
    assert!(refused(bomb).contains("DTD"), "{}", refused(bomb));
}

#[test]
fn deep_nesting_is_no_way_to_exhaust_the_stack() {
    let depth = 200_000;
    let xml = format!(
        "{}{}",
        "<AGMModel>".repeat(depth),
        "</AGMModel>".repeat(depth)
    );
    assert!(read(&xml).is_err());
    let json = format!(
        "{{\"DSRModel\":{}{}}}",
        "[".repeat(depth),
        "]".repeat(depth)
    );
    assert!(read(&json).is_err());
}

/// A text with a few of its characters taken out, doubled or replaced.
fn mutated(text: &'static str) -> impl Strategy<Value = String> {
    let edit = (any::<prop::sample::Index>(), 0..3u8, any::<char>());
    prop::collection::vec(edit, 0..6).prop_map(move |edits| {
        let mut letters: Vec<char> = text.chars().collect();
        for (place, kind, letter) in edits {
            let place = place.index(letters.len());
            match kind {
                0 => drop(letters.remove(place)),
                1 => letters.insert(place, letters[place]),
                _ => letters[place] = letter,
            }
        }
        letters.into_iter().collect()
    })
}

proptest! {
    #[test]
    fn no_mutated_robocomp_file_panics(text in mutated(ROBOCOMP)) {
        commit_or_refuse(&text)?;
    }

    #[test]
    fn no_mutated_agm_model_panics(text in mutated(AGM)) {
        commit_or_refuse(&text)?;
    }
}

/// Reads a text and, where that works, makes the world; a refusal says something.
fn commit_or_refuse(text: &str) -> Result<(), TestCaseError> {
    match read(text) {
        Err(error) => prop_assert!(!error.to_string().is_empty()),
        Ok(Import { transaction, .. }) => {
            let mut graph = Graph::in_memory(Schema::open());
            if let Err(refusal) = graph.commit(&transaction, "test", Time::default()) {
                prop_assert!(!refusal.to_string().is_empty());
            }
        }
    }
    Ok(())
}
