//! RoboComp DSR JSON in and out again.

use super::super::*;
use super::{ROBOCOMP, refused, world};
use crate::{Graph, NodeId, Schema, Snapshot, Time, Value};
use proptest::prelude::*;

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
    let told: Vec<String> = read(text, &Schema::open())
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
            "line 2 column 48: attribute `a`: 2147483648 is not a 32-bit integer (type 1)",
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
            "line 2 column 7: -1 is no symbol's id",
        ),
        (
            symbol(r#"{"id":1,"#),
            "line 2 column 9: key must be a string",
        ),
        (
            symbol(r#"{"id":1,"type":"t"},{"id":"1","type":"t"}"#),
            "line 2 column 27: there are two nodes with the id 1",
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

/// A file read into a graph and written as RoboComp DSR JSON.
fn there_and_back(text: &str) -> (Snapshot, serde_json::Value) {
    let world = world(text);
    let json = to_robocomp(&world).unwrap();
    (world, json)
}

#[test]
fn robocomp_out_and_in_again_is_the_same_to_the_stamp() {
    let (before, written) = there_and_back(ROBOCOMP);
    let text = serde_json::to_string_pretty(&written).unwrap();
    let (after, again) = there_and_back(&text);
    assert_eq!(again, written);
    assert_eq!(crate::differences(&before, &after).unwrap(), []);
    // Each attribute of the file is in what we write, of the same type and value.
    let symbols = |text: &str| {
        let json: serde_json::Value = serde_json::from_str(text).unwrap();
        json["DSRModel"]["symbols"].clone()
    };
    let (given, written) = (symbols(ROBOCOMP), &written["DSRModel"]["symbols"]);
    for (id, symbol) in given.as_object().unwrap() {
        let attributes = symbol["attribute"].as_object().unwrap();
        for (name, attribute) in attributes {
            let ours = &written[id]["attribute"][name];
            assert_eq!(ours["type"], attribute["type"], "{name}");
            // A u64 is a text, and may have been a number.
            let single = |json: &serde_json::Value| match json {
                serde_json::Value::String(text) => text.parse::<f32>().ok(),
                json => json.as_f64().map(|x| x as f32),
            };
            match (single(&attribute["value"]), attribute["value"].as_array()) {
                (Some(number), _) => assert_eq!(single(&ours["value"]), Some(number), "{name}"),
                (_, Some(row)) => {
                    let ours = ours["value"].as_array().unwrap();
                    assert_eq!(ours.len(), row.len());
                    for (a, b) in ours.iter().zip(row) {
                        assert_eq!(single(a), single(b), "{name}");
                    }
                }
                _ => assert_eq!(ours["value"], attribute["value"], "{name}"),
            }
        }
    }
    let stamped = &written["100"]["attribute"]["t4"];
    assert_eq!(stamped["timestamp"], "1700000000123456789");
    assert_eq!(stamped["agent_id"], 12);
    let plain = written["100"]["attribute"]["t1"].as_object().unwrap();
    let fields: Vec<&str> = plain.keys().map(String::as_str).collect();
    assert_eq!(fields, ["type", "value"], "nothing is made up");
}

proptest! {
    #[test]
    fn whatever_a_graph_holds_survives_robocomp(
        values in prop::collection::vec((crate::graph::tests::value(), 0..3usize, 0..9i64), 1..12),
        turn in prop::array::uniform6(-3.0..3.0f64),
    ) {
        let mut graph = Graph::in_memory(Schema::open());
        let mut transaction = crate::Transaction::new();
        transaction.create_node("thing", "a", vec![]);
        transaction.create_node("thing", "b\"\u{1}", vec![]);
        transaction.push(crate::Operation::CreateEdge {
            edge: crate::EdgeRef::new("a", "pose", "b\"\u{1}"),
            attributes: vec![("transform".into(), crate::Pose::new(
                nalgebra::Vector3::new(turn[0], turn[1], turn[2]),
                nalgebra::Vector3::new(turn[3], turn[4], turn[5]),
            ).into())],
        });
        graph.commit(&transaction, "setup", Time::from_seconds(1.0)).unwrap();
        for (n, (value, agent, time)) in values.into_iter().enumerate() {
            let mut transaction = crate::Transaction::new();
            transaction.set("a", &format!("x{n}"), value);
            let agent = ["navigation", "7", "file"][agent];
            graph.commit(&transaction, agent, Time::from_nanoseconds(time)).unwrap();
        }
        let before = graph.snapshot();
        let written = to_robocomp(&before).unwrap();
        let (after, again) = there_and_back(&written.to_string());
        prop_assert_eq!(crate::differences(&before, &after).unwrap(), vec![]);
        prop_assert_eq!(again, written.clone());
        // RoboComp knows the pose as its RT, in millimetres.
        let link = &written["DSRModel"]["symbols"]["1"]["links"][0];
        prop_assert_eq!(&link["label"], "RT");
        let mut link = link.clone();
        link.as_object_mut().unwrap().remove("cortex");
        let mut plain = written.clone();
        plain["DSRModel"]["symbols"]["1"]["links"][0] = link;
        plain["DSRModel"]["symbols"]["1"]["links"][0]["linkAttribute"].as_object_mut().unwrap().remove("transform");
        let theirs = world(&plain.to_string());
        let [ours, theirs] = [&before, &theirs].map(|graph| graph.transform(NodeId(1), NodeId(2)).unwrap());
        prop_assert!((ours.to_homogeneous() - theirs.to_homogeneous()).amax() < 1e-4);
    }
}
