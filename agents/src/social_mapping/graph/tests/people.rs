//! What the graph says of people beside their poses, groups as nodes, and settings.

use super::*;

/// The members of a group by the graph, and where it is; `None` where it is over.
fn group(centre: &Centre, name: &str) -> Option<(String, Vector2<f64>)> {
    let snapshot = centre.0.snapshot();
    let node = snapshot.find_node_by_name(name).unwrap()?;
    let label = snapshot.schema().find_label(MEMBER).unwrap();
    let person = |edge: dsr::EdgeKey| snapshot.find_node(edge.from).unwrap().unwrap();
    let members = node.in_edges_of(label);
    let mut members: Vec<String> = members
        .map(|edge| person(edge.unwrap()).name().unwrap())
        .collect();
    members.sort();
    let place = snapshot.world_from(node.id()).unwrap().unwrap();
    Some((members.join(" "), place.translation.vector))
}

#[test]
fn groups_are_nodes_that_last_while_people_come_and_go() {
    let mut centre = Centre::new();
    centre.place("ana", pose(5.0, 5.0, 0.0));
    centre.place("bo", pose(6.2, 5.0, PI));
    let mut agent = agent();
    centre.turn(&mut agent, noon());
    let group = |centre: &Centre| group(centre, "group_1");
    let (members, place) = group(&centre).unwrap();
    assert_eq!(members, "ana bo");
    assert!((place - Vector2::new(5.6, 5.0)).norm() < 1e-9);
    let extent = centre.value("group_1", EXTENT).unwrap();
    assert_eq!(extent.as_f64s().unwrap().len(), 4);

    // What the group feels is the mean of those of whom it is known.
    let features = |centre: &Centre| match centre.value("group_1", FEATURES) {
        Some(Value::String(text)) => text,
        other => format!("{other:?}"),
    };
    assert_eq!(features(&centre), "None");
    centre.set("ana", "features", "emotional_state=happy, role=staff");
    centre.set("bo", "features", "emotional_state=sad");
    centre.turn(&mut agent, noon() + 0.1);
    assert_eq!(features(&centre), "emotional_state=0.77, role=0.8");
    centre.set("ana", "features", "");
    centre.set("bo", "features", "");
    centre.turn(&mut agent, noon() + 0.2);
    assert_eq!(features(&centre), "None");

    // A turn in which nothing changes writes nothing.
    let (turn, _) = centre.turn(&mut agent, noon() + 0.3);
    assert!(turn.transaction.is_empty());

    // Somebody joins, and the agent is started anew: it is the same group.
    centre.add("person", "cleo", Some(pose(5.6, 5.9, -PI / 2.0)), &[]);
    let mut agent = SocialMapping::new(SocialConfig::default(), 0.1).unwrap();
    centre.turn(&mut agent, noon() + 0.4);
    assert_eq!(group(&centre).unwrap().0, "ana bo cleo");
    // Ana leaves: still the same.
    centre.place("ana", pose(1.5, 1.0, 0.0));
    centre.turn(&mut agent, noon() + 0.6);
    assert_eq!(group(&centre).unwrap().0, "bo cleo");
    // All go their ways: it is over after a while.
    centre.place("cleo", pose(11.0, 9.5, 0.0));
    centre.turn(&mut agent, noon() + 1.0);
    assert!(group(&centre).is_some());
    centre.turn(&mut agent, noon() + 4.0);
    assert_eq!(group(&centre), None);
}

#[test]
fn two_groups_keep_their_names_while_everybody_shuffles() {
    let mut centre = Centre::new();
    let names = ["ana", "bo", "cleo", "dov", "eve", "finn", "gus"];
    for name in &names[2..] {
        centre.add("person", name, Some(pose(0.0, 0.0, 0.0)), &[]);
    }
    let mut agent = agent();
    for turn in 0..150 {
        let time = f64::from(turn) * 0.2;
        for (index, name) in names.iter().enumerate() {
            // Four in a ring and three in another, each swaying at a pace of their own.
            let (centre_x, count, at) = if index < 4 {
                (4.0, 4.0, index)
            } else {
                (8.0, 3.0, index - 4)
            };
            let pace = 0.7 + 0.23 * index as f64;
            let angle = 2.0 * PI * at as f64 / count + 0.25 * (pace * time).sin();
            let distance = 0.75 + 0.12 * (1.3 * pace * time).cos();
            let (x, y) = (
                centre_x + distance * angle.cos(),
                5.0 + distance * angle.sin(),
            );
            let heading = angle + PI + 0.5 * (1.7 * pace * time).sin();
            centre.place(name, pose(x, y, heading));
        }
        centre.turn(&mut agent, noon() + time);
        let members = |name| group(&centre, name).map(|(members, _)| members);
        assert_eq!(
            members("group_1").as_deref(),
            Some("ana bo cleo dov"),
            "{time}"
        );
        assert_eq!(
            members("group_2").as_deref(),
            Some("eve finn gus"),
            "{time}"
        );
        assert_eq!(members("group_3"), None, "{time}");
    }
}

#[test]
fn without_social_behaviour_there_are_no_groups() {
    let mut centre = Centre::new();
    let mut agent = agent();
    centre.turn(&mut agent, noon());
    assert_eq!(group(&centre, "group_1").unwrap().0, "ana bo");
    centre.set("world", "social", false);
    centre.turn(&mut agent, noon() + 0.2);
    assert_eq!(group(&centre, "group_1"), None);
}

#[test]
fn what_a_person_does_feels_and_is_wanted_for_comes_from_the_graph() {
    let mut centre = Centre::new();
    centre.set("ana", "activity", "cooking");
    centre.set("ana", "task", "escort");
    centre.set("bo", "features", "emotional_state=happy");
    let mut agent = agent();
    let (turn, _) = centre.turn(&mut agent, noon());
    assert_eq!(turn.rejected, []);
    let grid = turn.grid.unwrap().grid;
    let cost = |x, y| grid.cost(grid.cell_at(Point2::new(x, y)).unwrap());
    // Ana cooks: wide to the sides, and an escort may be there.
    assert!((cost(5.05, 6.35) - FREE).abs() < 1e-6);
    assert!((cost(5.05, 7.5) - Zone::Social.cost()).abs() < 1e-6);
    centre.set("ana", "activity", "yodelling");
    centre.set("bo", "features", "emotional_state=glad");
    let (turn, _) = centre.turn(&mut agent, noon() + 0.2);
    let said: Vec<String> = turn.rejected.iter().map(ToString::to_string).collect();
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(
        said[0].starts_with("person bo has no features: `glad` is no value"),
        "{said:?}"
    );
    assert!(
        said[1]
            .starts_with("person ana: there is no activity called `yodelling`; known are: cooking"),
        "{said:?}"
    );
}

#[test]
fn rooms_tell_activities_and_running_steps_tell_tasks() {
    let mut centre = Centre::new();
    centre.add("room", "kitchen", None, &[]);
    let binding = r#"{"robot":"robot","person":"ana"}"#;
    let step = [
        ("status", "running".into()),
        ("rule", "escort".into()),
        ("binding", binding.into()),
    ];
    centre.add("step", "step", None, &step);
    let mut relate = Transaction::new();
    relate.create_edge("ana", "in", "kitchen");
    centre.commit(&relate);
    let config = SocialConfig::default();
    let ana = |centre: &Centre| {
        let scene = scene(&centre.0.snapshot(), &config).unwrap();
        let manner = scene.people[0].manner.clone();
        (manner.room, manner.task)
    };
    let kitchen = Some("kitchen".to_owned());
    assert_eq!(ana(&centre), (kitchen.clone(), Some("escort".to_owned())));
    // What is said of her goes before, and a step that is over or asks for no zones opens none.
    centre.set("ana", "task", "follow");
    assert_eq!(ana(&centre).1.as_deref(), Some("follow"));
    centre.set("ana", "task", "");
    centre.set("step", "rule", "greet");
    assert_eq!(ana(&centre), (kitchen, None));
    centre.set("step", "rule", "escort");
    centre.set("step", "status", "done");
    assert_eq!(ana(&centre).1, None);
}

#[test]
fn space_gives_way_to_walls_where_the_world_says_so() {
    let mut centre = Centre::new();
    let mut agent = agent();
    // Ana faces the wall at y = 8 from 1.65 m, bo from 1.3 m.
    centre.place("ana", pose(4.0, 6.35, PI / 2.0));
    centre.place("bo", pose(9.0, 6.7, PI / 2.0));
    let (turn, _) = centre.turn(&mut agent, noon());
    let cost = |turn: &Turn, x, y| {
        let grid = &turn.grid.as_ref().unwrap().grid;
        grid.cost(grid.cell_at(Point2::new(x, y)).unwrap())
    };
    assert!((cost(&turn, 4.05, 7.35) - 4.0).abs() < 1e-6);
    let passages = |centre: &Centre, name| match centre.value(name, PASSAGES) {
        Some(Value::String(text)) => text,
        other => format!("{other:?}"),
    };
    assert_eq!(passages(&centre, "ana"), "None");
    centre.set("world", SETTINGS, r#"{"walls": {}}"#);
    let (turn, _) = centre.turn(&mut agent, noon() + 0.2);
    assert_eq!(passages(&centre, "ana"), "adapted, free, free, free");
    assert_eq!(passages(&centre, "bo"), "blocked, free, free, free");
    // Past ana's narrowed space there is room; past bo's there is not.
    assert!(cost(&turn, 4.05, 7.35) < 4.0);
    assert!(cost(&turn, 9.05, 7.55) >= BLOCKED);
    centre.set("world", SETTINGS, "{}");
    centre.turn(&mut agent, noon() + 0.4);
    assert_eq!(passages(&centre, "bo"), "None");
}

#[test]
fn settings_of_the_world_hold_from_the_next_turn_and_wrong_ones_are_reported() {
    let mut centre = Centre::new();
    let mut agent = agent();
    let cells = |turn: &Turn| turn.grid.as_ref().map(|sent| sent.grid.width);
    let (turn, _) = centre.turn(&mut agent, noon());
    assert_eq!(cells(&turn), Some(120));
    centre.set(
        "world",
        SETTINGS,
        r#"{"resolution": 0.2, "proxemics": {"shape": "printed"}}"#,
    );
    let (turn, _) = centre.turn(&mut agent, noon() + 0.2);
    assert_eq!((cells(&turn), turn.rejected), (Some(60), vec![]));
    for (later, settings, problem) in [
        (
            2.0,
            r#"{"resolution": -1}"#,
            "resolution must be from 0.005 m to 10 m",
        ),
        (3.0, r#"{"resolutoin": 1}"#, "unknown field `resolutoin`"),
    ] {
        centre.set("world", SETTINGS, settings);
        let (turn, _) = centre.turn(&mut agent, noon() + later);
        let said: Vec<String> = turn.rejected.iter().map(ToString::to_string).collect();
        assert!(said.len() == 1 && said[0].contains(problem), "{said:?}");
        assert!(cells(&turn).is_none_or(|width| width == 60));
    }
}

#[test]
fn a_cancelled_activity_claims_nothing() {
    let mut centre = Centre::new();
    let entry = [
        ("start", NOON.into()),
        ("end", (NOON + 60.0).into()),
        ("object", "table".into()),
    ];
    centre.add("activity", "therapy", None, &entry);
    let mut agent = agent();
    let usage = |centre: &Centre| centre.value("table", USAGE).unwrap().as_f64().unwrap();
    centre.turn(&mut agent, noon());
    assert!((usage(&centre) - 3.5).abs() < 1e-9);
    centre.set("therapy", "cancelled", true);
    centre.turn(&mut agent, noon() + 0.2);
    assert!((usage(&centre) - 1.5).abs() < 1e-9);
    // Moved by an hour instead, it is near again.
    centre.set("therapy", "cancelled", false);
    centre.set("therapy", "start", NOON + 1350.0);
    centre.set("therapy", "end", NOON + 3600.0);
    centre.turn(&mut agent, noon() + 0.4);
    assert!((usage(&centre) - 2.5).abs() < 0.011);
}

#[test]
fn the_outlines_of_who_walks_reach_ahead_as_the_grid_does() {
    let (mut centre, mut agent) = (Centre::new(), agent());
    centre.turn(&mut agent, noon());
    let ahead = |centre: &Centre| {
        let zone = centre.value("ana", ZONES[1]).unwrap();
        let (points, _) = zone.as_f64s().unwrap().as_chunks::<2>();
        let far = points.iter().map(|[x, _]| x - 5.0);
        far.fold(f64::NEG_INFINITY, f64::max)
    };
    let standing = ahead(&centre);
    centre.set("ana", "velocity", [1.0, 0.0]);
    let (_, written) = centre.turn(&mut agent, noon() + 0.1);
    assert_eq!(written, POLYLINES[..3]);
    assert!((ahead(&centre) / standing - 1.5).abs() < 1e-9);
    // A hair faster is no other shape.
    centre.set("ana", "velocity", [1.02, 0.0]);
    assert_eq!(centre.turn(&mut agent, noon() + 0.2).1, [""; 0]);
}
