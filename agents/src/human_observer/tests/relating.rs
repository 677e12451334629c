//! Relations of people with rooms, objects, each other and the robot.

use super::*;

/// Runs people who stand still before cameras that do not err, and gives the scene at the end.
fn settle(run: &mut Run, start: f64, end: f64, people: &[Isometry2<f64>]) -> Scene {
    run.errors = Errors {
        position: 0.0,
        heading: 0.0,
        miss: 0.0,
        clutter: 0.0,
    };
    let people: Vec<_> = people.iter().copied().map(Some).collect();
    run.go(start, end, end, &|_| people.clone()).scene
}

fn table(size: [f64; 2]) -> Object {
    Object {
        name: "table1".to_owned(),
        class: "table".to_owned(),
        world_from_object: pose(0.0, 0.0, PI / 2.0),
        shape: Shape::Rectangle,
        size: Vector2::from(size),
        space: Vec::new(),
    }
}

#[test]
fn people_face_to_face_interact_after_a_second_and_not_back_to_back() {
    let mut run = Run::new(corners(10.0), 0);
    let facing = [pose(-1.0, 0.0, 0.3), pose(1.0, 0.0, PI - 0.3)];
    assert_eq!(settle(&mut run, 0.0, 0.9, &facing).interacting, []);
    assert_eq!(settle(&mut run, 1.0, 2.0, &facing).interacting, [(1, 2)]);

    let mut run = Run::new(corners(10.0), 0);
    let one_away = [pose(-1.0, 0.0, 0.0), pose(1.0, 0.0, 0.0)];
    assert_eq!(settle(&mut run, 0.0, 4.0, &one_away).interacting, []);
    let mut run = Run::new(corners(10.0), 0);
    let too_far = [pose(-1.6, 0.0, 0.0), pose(1.6, 0.0, PI)];
    assert_eq!(settle(&mut run, 0.0, 4.0, &too_far).interacting, []);
}

#[test]
fn people_who_pass_each_other_do_not_interact() {
    let mut run = Run::new(corners(10.0), 0);
    for step in 0..90 {
        let t = f64::from(step) * PERIOD;
        let frames = run.frames(t, &|t| {
            vec![
                Some(walk([-4.0, 0.3], [4.0, 0.3], 6.0, t)),
                Some(walk([4.0, -0.3], [-4.0, -0.3], 6.0, t)),
            ]
        });
        let scene = run
            .observer
            .observe(Time::from_seconds(t), &frames, &run.surroundings);
        assert_eq!(scene.interacting, [], "at {t} s");
    }
}

#[test]
fn an_interaction_does_not_flicker_at_the_limit_of_facing() {
    let mut run = Run::new(corners(10.0), 7);
    let limit = 45f64.to_radians();
    let at = |angle: f64| vec![Some(pose(-1.0, 0.0, angle)), Some(pose(1.0, 0.0, PI))];
    run.go(0.0, 0.0, 4.0, &|_| at(0.5 * limit));
    let mut changes = 0;
    let mut held = true;
    for step in 0..600 {
        let t = 4.1 + f64::from(step) * PERIOD;
        let frames = run.frames(t, &|_| at(limit));
        let scene = run
            .observer
            .observe(Time::from_seconds(t), &frames, &run.surroundings);
        let holds = scene.interacting == [(1, 2)];
        changes += usize::from(holds != held);
        held = holds;
    }
    assert_eq!(
        (changes, held),
        (0, true),
        "noise of 0.15 rad around the threshold for 40 s"
    );
}

#[test]
fn somebody_near_an_object_and_facing_it_interacts_with_it() {
    // The table is turned by 90 degrees: 2 m along y, 1 m along x.
    let scene = |pose: Isometry2<f64>, object: Object| {
        let mut run = Run::new(corners(10.0), 0);
        run.surroundings.objects = vec![object];
        settle(&mut run, 0.0, 3.0, &[pose]).interacting_with
    };
    let yes = [(1, "table1".to_owned())];
    assert_eq!(
        scene(pose(0.9, 0.8, PI), table([2.0, 1.0])),
        yes,
        "faces the edge before it"
    );
    assert_eq!(scene(pose(0.9, 0.8, 0.0), table([2.0, 1.0])), []);
    assert_eq!(
        scene(pose(1.3, 0.0, PI), table([2.0, 1.0])),
        [],
        "out of reach"
    );
    assert_eq!(scene(pose(0.2, 0.3, 0.0), table([2.0, 1.0])), yes, "on it");
    let round = Object {
        shape: Shape::Circle,
        ..table([1.0, 9.0])
    };
    assert_eq!(scene(pose(0.0, 0.9, -PI / 2.0), round.clone()), yes);
    assert_eq!(scene(pose(0.0, 1.1, -PI / 2.0), round), []);
    let watched = Object {
        space: [(0.0, -0.5), (3.0, -1.5), (3.0, 1.5), (0.0, 0.5)]
            .map(|(x, y)| Point2::new(x, y))
            .to_vec(),
        ..table([1.0, 0.1])
    };
    assert_eq!(
        scene(pose(2.5, 0.0, PI), watched.clone()),
        yes,
        "in its affordance space"
    );
    assert_eq!(scene(pose(3.5, 0.0, PI), watched), []);
}

#[test]
fn somebody_before_the_robot_is_near_and_in_front_until_turned_away_for_two_seconds() {
    let mut run = Run::new(corners(10.0), 0);
    run.surroundings.world_from_robot = Some(pose(0.0, 0.0, 0.0));
    let scene = settle(&mut run, 0.0, 1.0, &[pose(1.9, 0.0, PI)]);
    assert_eq!((scene.near_robot, scene.front), (vec![1], vec![1]));
    let scene = settle(&mut run, 1.1, 3.0, &[pose(1.9, 0.0, PI / 2.0)]);
    assert_eq!((scene.near_robot, scene.front), (vec![1], vec![1]));
    let scene = settle(&mut run, 3.1, 5.0, &[pose(1.9, 0.0, PI / 2.0)]);
    assert_eq!((scene.near_robot, scene.front), (vec![1], vec![]));
    let scene = settle(&mut run, 5.1, 6.0, &[pose(2.2, 0.0, PI)]);
    assert_eq!(
        (scene.near_robot, scene.front),
        (vec![1], vec![]),
        "near until beyond 2.3 m"
    );
    let scene = settle(&mut run, 6.1, 7.0, &[pose(2.5, 0.0, PI)]);
    assert_eq!((scene.near_robot, scene.front), (vec![], vec![]));
}

#[test]
fn rooms_change_past_the_margin_and_relations_end_with_their_people() {
    let room = |x: f64| {
        [(x, -5.0), (x + 5.0, -5.0), (x + 5.0, 5.0), (x, 5.0)].map(|(x, y)| Point2::new(x, y))
    };
    let mut run = Run::new(corners(10.0), 0);
    run.surroundings.plan = FloorPlan::new(
        [
            ("west".to_owned(), room(-5.0).to_vec()),
            ("east".to_owned(), room(0.0).to_vec()),
        ],
        [],
    );
    run.surroundings.world_from_robot = Some(pose(0.0, 0.0, 0.0));
    let west = [(1, "west".to_owned())].into();
    let east = [(1, "east".to_owned())].into();
    assert_eq!(
        settle(&mut run, 0.0, 1.0, &[pose(-0.3, 0.0, 0.0)]).in_room,
        west
    );
    assert_eq!(
        settle(&mut run, 1.1, 2.0, &[pose(0.1, 0.0, 0.0)]).in_room,
        west
    );
    assert_eq!(
        settle(&mut run, 2.1, 3.0, &[pose(0.4, 0.0, 0.0)]).in_room,
        east
    );
    let gone = settle(&mut run, 3.1, 6.0, &[]);
    assert_eq!(gone, Scene::default());
}
