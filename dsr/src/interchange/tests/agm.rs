//! AGM models in.

use super::{AGM, refused, world};
use crate::NodeId;

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
            "line 2 column 40: there is a symbol `1` already",
        ),
        (
            model("<symbol id='1' type='t'/><link src='1' dst='9' label='in'/>"),
            "line 2 column 47: there is no symbol `9` for the link `in`",
        ),
        (
            model("<symbol id='1' type='t'><attribute key='k'/></symbol>"),
            "has no `value`",
        ),
        (
            "<model/>".to_owned(),
            "line 1 column 1: expected `<AGMModel>`",
        ),
        (model("<symbol"), "line 3 column 1: "),
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
