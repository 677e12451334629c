//! DOT and GraphML out.

use super::super::*;
use super::world;
use crate::Snapshot;

/// A graph whose names and texts would break a careless writer.
fn awkward() -> Snapshot {
    let text = r#"{"format":"dsr/1","nodes":[
        {"id":1,"type":"ro<om","name":"a \"b\" & <c>\\\n","attributes":{"n":1,"text":"x & y\u0001","on":true}},
        {"id":2,"type":"room","name":"d","attributes":{"n":2.5,"row":[1.0,2.0],"on":false}}],
        "edges":[{"from":1,"label":"next to","to":2,"attributes":{"x":{"type":"f32","value":"inf"}}},
                 {"from":2,"label":"next to","to":1}]}"#;
    world(text)
}

#[test]
fn dot_quotes_what_it_must() {
    expect_test::expect![[r#"
        digraph dsr {
          node [shape=box];
          n1 [label="a \"b\" & <c>\\\n\nro<om"];
          n2 [label="d\nroom"];
          n1 -> n2 [label="next to"];
          n2 -> n1 [label="next to"];
        }
    "#]]
    .assert_eq(&to_dot(&awkward()).unwrap());
}

#[test]
fn graphml_is_xml_that_says_everything() {
    let text = to_graphml(&awkward()).unwrap();
    expect_test::expect![[r#"
        <?xml version="1.0" encoding="UTF-8"?>
        <graphml xmlns="http://graphml.graphdrawing.org/xmlns">
          <key id="name" for="node" attr.name="name" attr.type="string"/>
          <key id="type" for="node" attr.name="type" attr.type="string"/>
          <key id="label" for="edge" attr.name="label" attr.type="string"/>
          <key id="n0" for="node" attr.name="n" attr.type="string"/>
          <key id="n1" for="node" attr.name="on" attr.type="boolean"/>
          <key id="n2" for="node" attr.name="row" attr.type="string"/>
          <key id="n3" for="node" attr.name="text" attr.type="string"/>
          <key id="e0" for="edge" attr.name="x" attr.type="float"/>
          <graph id="dsr" edgedefault="directed">
            <node id="n1">
              <data key="name">a &quot;b&quot; &amp; &lt;c&gt;\&#10;</data>
              <data key="type">ro&lt;om</data>
              <data key="n0">1</data>
              <data key="n1">true</data>
              <data key="n3">x &amp; y�</data>
            </node>
            <node id="n2">
              <data key="name">d</data>
              <data key="type">room</data>
              <data key="n0">2.5</data>
              <data key="n1">false</data>
              <data key="n2">{&quot;type&quot;:&quot;vector&quot;,&quot;value&quot;:[1.0,2.0]}</data>
            </node>
            <edge source="n1" target="n2">
              <data key="label">next to</data>
              <data key="e0">INF</data>
            </edge>
            <edge source="n2" target="n1">
              <data key="label">next to</data>
            </edge>
          </graph>
        </graphml>
    "#]].assert_eq(&text);
    let document = roxmltree::Document::parse(&text).unwrap();
    let elements = |name: &'static str| {
        document
            .descendants()
            .filter(move |node| node.has_tag_name(("http://graphml.graphdrawing.org/xmlns", name)))
    };
    let ids: Vec<_> = elements("node")
        .map(|node| node.attribute("id").unwrap())
        .collect();
    assert_eq!(ids, ["n1", "n2"]);
    let keys: Vec<_> = elements("key")
        .map(|key| key.attribute("id").unwrap())
        .collect();
    for data in elements("data") {
        assert!(keys.contains(&data.attribute("key").unwrap()), "{data:?}");
    }
    for edge in elements("edge") {
        for end in ["source", "target"] {
            assert!(ids.contains(&edge.attribute(end).unwrap()), "{edge:?}");
        }
    }
    let name = elements("data")
        .find(|data| data.attribute("key") == Some("name"))
        .unwrap();
    assert_eq!(name.text(), Some("a \"b\" & <c>\\\n"));
}
