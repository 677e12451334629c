//! The terminal's picture after keys. Guarantees that what is told here can be reached by keys alone.

use super::draw::draw;
use super::screen::{Next, Screen};
use super::*;
use dsr::{EdgeRef, Graph, Operation, Schema, Time, Transaction, Value, planar_pose};
use nalgebra::{Isometry2, Vector2};
use ratatui::Terminal;
use ratatui::backend::TestBackend;

fn screen() -> (Looker, Screen) {
    let mut graph = Graph::in_memory(Schema::open());
    let mut transaction = Transaction::new();
    transaction.create_node("robot", "shelly", vec![("max_speed".into(), 0.5.into())]);
    transaction.create_node("room", "kitchen", vec![]);
    transaction.create_edge("shelly", "in", "kitchen");
    let walls = Value::F64List(vec![0.0, 0.0, 6.0, 0.0, 6.0, 0.0, 6.0, 4.0]);
    transaction.create_node("world", "world", vec![("walls".into(), walls)]);
    let pose = planar_pose(&Isometry2::new(Vector2::new(2.0, 2.0), 0.0));
    transaction.push(Operation::CreateEdge {
        edge: EdgeRef::new("world", "pose", "shelly"),
        attributes: vec![("transform".into(), Value::Pose(pose))],
    });
    let seven = Time::from_seconds(7.0);
    graph.commit(&transaction, "setup", seven).unwrap();
    let mut faster = Transaction::new();
    faster.set("shelly", "max_speed", 0.9);
    let ten = Time::from_seconds(10.0);
    graph.commit(&faster, "driver", ten).unwrap();
    let mut looker = Looker::new(Source::Recording(Box::new(graph)));
    let screen = Screen::of(&mut looker).unwrap();
    (looker, screen)
}

/// What is on the screen after these keys.
fn after(looker: &mut Looker, screen: &mut Screen, keys: &[KeyCode]) -> String {
    for key in keys {
        assert_eq!(screen.key(*key), Next::Go, "{key:?}");
        screen.look(looker).unwrap();
    }
    let mut terminal = Terminal::new(TestBackend::new(80, 24)).unwrap();
    terminal.draw(|frame| draw(screen, frame)).unwrap();
    terminal.backend().to_string()
}

fn typed(text: &str) -> Vec<KeyCode> {
    text.chars().map(KeyCode::Char).collect()
}

#[test]
fn nodes_are_listed_filtered_and_shown_with_writer_age_and_edges() {
    let (mut looker, mut screen) = screen();
    let text = after(&mut looker, &mut screen, &[]);
    assert!(
        text.contains("kitchen : room") && text.contains("3 nodes"),
        "{text}"
    );
    let text = after(&mut looker, &mut screen, &[KeyCode::Down]);
    assert!(
        text.contains("max_speed = 0.9  driver, 0.0 s ago"),
        "{text}"
    );
    assert!(text.contains("shelly -in-> kitchen"), "{text}");
    let text = after(&mut looker, &mut screen, &typed("/KIT"));
    assert!(text.contains("1 nodes with KIT_"), "{text}");
    let text = after(&mut looker, &mut screen, &[KeyCode::Esc]);
    assert!(text.contains("3 nodes"), "{text}");
}

#[test]
fn why_and_history_are_told_of_what_is_chosen() {
    let (mut looker, mut screen) = screen();
    let keys = [KeyCode::Down, KeyCode::Enter, KeyCode::Char('w')];
    let text = after(&mut looker, &mut screen, &keys);
    assert!(
        text.contains("why shelly.max_speed") && text.contains("by driver"),
        "{text}"
    );
    let text = after(
        &mut looker,
        &mut screen,
        &[KeyCode::Esc, KeyCode::Char('h')],
    );
    assert!(text.contains("history of shelly.max_speed"), "{text}");
    assert!(
        text.contains("driver  0.9") && text.contains("setup  0.5"),
        "{text}"
    );
    // Of an edge as well, and of the node itself.
    let keys = [KeyCode::Esc, KeyCode::Down, KeyCode::Char('w')];
    let text = after(&mut looker, &mut screen, &keys);
    assert!(text.contains("why shelly-in->kitchen"), "{text}");
    let keys = [KeyCode::Esc, KeyCode::Left, KeyCode::Char('w')];
    let text = after(&mut looker, &mut screen, &keys);
    assert!(
        text.contains("why shelly") && !text.contains("why shelly-"),
        "{text}"
    );
}

#[test]
fn the_time_goes_back_and_on() {
    let (mut looker, mut screen) = screen();
    let text = after(
        &mut looker,
        &mut screen,
        &[KeyCode::Down, KeyCode::Char(',')],
    );
    assert!(
        text.contains("max_speed = 0.5  setup") && text.contains("then: "),
        "{text}"
    );
    let text = after(&mut looker, &mut screen, &[KeyCode::Char('.')]);
    assert!(
        text.contains("max_speed = 0.9") && !text.contains("then: "),
        "{text}"
    );
    let text = after(
        &mut looker,
        &mut screen,
        &[KeyCode::Char('<'), KeyCode::Char('n')],
    );
    assert!(text.contains("max_speed = 0.9"), "{text}");
}

#[test]
fn every_view_can_be_reached_and_the_keys_end_it() {
    let (mut looker, mut screen) = screen();
    let text = after(&mut looker, &mut screen, &typed("2"));
    assert!(
        text.contains("0 people, 0 groups") && text.contains("shelly"),
        "{text}"
    );
    assert!(
        text.contains('\u{28ff}') || text.chars().any(|c| ('\u{2801}'..'\u{28ff}').contains(&c)),
        "{text}"
    );
    let text = after(&mut looker, &mut screen, &[KeyCode::Tab]);
    assert!(text.contains("There are no missions."), "{text}");
    let text = after(&mut looker, &mut screen, &typed("4"));
    assert!(text.contains("A recording has no processes."), "{text}");
    let text = after(&mut looker, &mut screen, &typed("5"));
    assert!(text.contains("driver shelly"), "{text}");
    let text = after(&mut looker, &mut screen, &typed("r"));
    assert!(
        text.contains("commits with rules") && !text.contains("driver"),
        "{text}"
    );
    let text = after(&mut looker, &mut screen, &typed("?"));
    assert!(text.contains("ten seconds back and on"), "{text}");
    after(&mut looker, &mut screen, &typed("x"));
    assert_eq!(screen.key(KeyCode::Char('q')), Next::End);
}
