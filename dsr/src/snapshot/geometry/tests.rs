//! Transforms against products of nalgebra, history against exact values, and what is refused.

use super::*;
use crate::{EdgeRef, Graph, Image, Operation, Schema, Transaction, decode_image};
use proptest::prelude::*;

const KEPT: usize = 4;

fn graph() -> Graph {
    let schema = "open = true\n[attributes]\ntransform = { kind = \"pose\", history = 4 }\n";
    Graph::in_memory(Schema::from_toml("s.toml", schema).unwrap())
}

fn seconds(seconds: f64) -> Time {
    Time::from_seconds(seconds)
}

fn name(index: usize) -> String {
    format!("n{index}")
}

fn set_pose(transaction: &mut Transaction, parent: &str, child: &str, pose: Pose) {
    transaction.push(Operation::CreateEdge {
        edge: EdgeRef::new(parent, "pose", child),
        attributes: vec![("transform".into(), pose.into())],
    });
}

fn commit(graph: &mut Graph, transaction: &Transaction, time: f64) {
    graph.commit(transaction, "test", seconds(time)).unwrap();
}

fn id(snapshot: &Snapshot, name: &str) -> NodeId {
    snapshot.find_node_by_name(name).unwrap().unwrap().id()
}

fn pose() -> impl Strategy<Value = Pose> {
    let row = prop::array::uniform6(-3.0..3.0f64);
    row.prop_map(|[x, y, z, a, b, c]| {
        Pose::from_parts(
            Translation3::new(x, y, z),
            UnitQuaternion::from_euler_angles(a, b, c),
        )
    })
}

fn near(a: &Pose, b: &Pose) -> bool {
    (a.to_homogeneous() - b.to_homogeneous()).amax() < 1e-9
}

/// Node 0 is the root; node i + 1 hangs on a node before it.
fn tree() -> impl Strategy<Value = Vec<(usize, Vec<Pose>)>> {
    let edge = (
        any::<prop::sample::Index>(),
        prop::collection::vec(pose(), 1..7),
    );
    prop::collection::vec(edge, 1..12).prop_map(|edges| {
        let hung = edges.into_iter().enumerate();
        hung.map(|(i, (parent, poses))| (parent.index(i + 1), poses))
            .collect()
    })
}

/// Moves every edge of the tree once a second for as long as it has poses.
fn moving(tree: &[(usize, Vec<Pose>)]) -> Graph {
    let mut graph = graph();
    let mut nodes = Transaction::new();
    for index in 0..=tree.len() {
        nodes.create_node("thing", &name(index), vec![]);
    }
    commit(&mut graph, &nodes, 0.0);
    for second in 0..6 {
        let mut transaction = Transaction::new();
        for (child, (parent, poses)) in tree.iter().enumerate() {
            if let Some(pose) = poses.get(second) {
                set_pose(&mut transaction, &name(*parent), &name(child + 1), *pose);
            }
        }
        commit(&mut graph, &transaction, 1.0 + second as f64);
    }
    graph
}

/// The pose of an edge at a time as the poses of a tree say, or nothing.
fn expected(poses: &[Pose], time: f64) -> Option<Pose> {
    if poses.len() == 1 {
        return Some(poses[0]);
    }
    let known = poses.len().saturating_sub(KEPT) + 1..=poses.len();
    let before = time.floor() as usize;
    if !known.contains(&before) {
        return None;
    }
    let (a, b) = (&poses[before - 1], poses.get(before)?);
    Some(a.lerp_slerp(b, time - before as f64))
}

fn root_from(
    tree: &[(usize, Vec<Pose>)],
    node: usize,
    of: &impl Fn(&[Pose]) -> Option<Pose>,
) -> Option<Pose> {
    if node == 0 {
        return Some(Pose::identity());
    }
    let (parent, poses) = &tree[node - 1];
    Some(root_from(tree, *parent, of)? * of(poses)?)
}

proptest! {
    #[test]
    fn transforms_are_what_nalgebra_composes(tree in tree(), a: prop::sample::Index, b: prop::sample::Index) {
        let (a, b) = (a.index(tree.len() + 1), b.index(tree.len() + 1));
        let snapshot = moving(&tree).snapshot();
        let newest = |poses: &[Pose]| poses.last().copied();
        let (root_from_a, root_from_b) = (root_from(&tree, a, &newest).unwrap(), root_from(&tree, b, &newest).unwrap());
        let found = snapshot.transform(id(&snapshot, &name(a)), id(&snapshot, &name(b))).unwrap();
        prop_assert!(near(&found, &(root_from_a.inverse() * root_from_b)));
        let world = snapshot.pose_in_world(id(&snapshot, &name(b))).unwrap();
        prop_assert_eq!(world.is_some(), b != 0);
        prop_assert!(near(&world.unwrap_or(Pose::identity()), &root_from_b));
    }

    #[test]
    fn transforms_at_a_time_are_composed_of_interpolated_poses(
        tree in tree(), node: prop::sample::Index, time in 0.5..7.0f64,
    ) {
        let node = node.index(tree.len() + 1);
        let snapshot = moving(&tree).snapshot();
        let (root, node_id) = (id(&snapshot, "n0"), id(&snapshot, &name(node)));
        // Down to the nanosecond, as times are.
        let time = seconds(time);
        let at = |poses: &[Pose]| expected(poses, time.seconds());
        match (snapshot.transform_at(root, node_id, time), root_from(&tree, node, &at)) {
            (Ok(found), Some(expected)) => prop_assert!(near(&found, &expected), "{found} {expected}"),
            (Err(TransformError::Extrapolation { .. }), None) => {}
            (found, expected) => prop_assert!(false, "{found:?} instead of {expected:?}"),
        }
    }
}

fn turned(x: f64, angle: f64) -> Pose {
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
    Pose::from_parts(Translation3::new(x, 0.0, 0.0), rotation)
}

/// `world` to `robot` at 1, 2, ... s, x = 10, 20, ..., turning by 0.5 a second; `camera` fixed on
/// the robot.
fn robot(samples: usize) -> Graph {
    let mut graph = graph();
    let mut transaction = Transaction::new();
    for node in ["world", "robot", "camera"] {
        transaction.create_node("thing", node, vec![]);
    }
    set_pose(&mut transaction, "robot", "camera", turned(1.0, 0.0));
    commit(&mut graph, &transaction, 0.0);
    for n in 1..=samples {
        let mut transaction = Transaction::new();
        let n = n as f64;
        set_pose(
            &mut transaction,
            "world",
            "robot",
            turned(10.0 * n, 0.5 * n),
        );
        commit(&mut graph, &transaction, n);
    }
    graph
}

#[test]
fn history_is_bounded_and_between_samples_exact() {
    let snapshot = robot(6).snapshot();
    let (world, robot) = (id(&snapshot, "world"), id(&snapshot, "robot"));
    let at = |time| snapshot.transform_at(world, robot, seconds(time));
    for (time, x, angle) in [
        (3.0, 30.0, 1.5),
        (3.25, 32.5, 1.625),
        (5.5, 55.0, 2.75),
        (6.0, 60.0, 3.0),
    ] {
        let found = at(time).unwrap();
        assert!(near(&found, &turned(x, angle)), "at {time}: {found}");
    }
    // A sample is given to the bit.
    assert_eq!(at(4.0).unwrap(), turned(40.0, 2.0));
    for time in [2.999, 6.001] {
        let refused = TransformError::Extrapolation {
            edge: "`world` -pose-> `robot`".into(),
            time: seconds(time),
            earliest: seconds(3.0),
            latest: seconds(6.0),
        };
        assert_eq!(at(time), Err(refused));
    }
    let edge = snapshot.parent_pose(robot).unwrap().unwrap();
    let transform = snapshot.schema().attribute_id("transform").unwrap();
    let history = edge.history(transform).unwrap();
    let times: Vec<f64> = history.iter().map(|a| a.time.seconds()).collect();
    assert_eq!(times, [6.0, 5.0, 4.0, 3.0]);
    // What was written once is fixed, below what moves and above.
    let camera = id(&snapshot, "camera");
    assert_eq!(
        snapshot.transform_at(robot, camera, seconds(99.0)),
        Ok(turned(1.0, 0.0))
    );
    let found = snapshot.transform_at(camera, world, seconds(4.0)).unwrap();
    let expected = turned(40.0, 2.0) * turned(1.0, 0.0);
    assert!(near(&found, &expected.inverse()));
}

#[test]
fn a_restored_graph_has_the_history_too() {
    let before = robot(6).snapshot();
    let image = decode_image(&Image::of(&before).unwrap().to_bytes()).unwrap();
    let mut graph = graph();
    graph.restore(&image).unwrap();
    let mut transaction = Transaction::new();
    set_pose(&mut transaction, "world", "robot", turned(70.0, 3.5));
    commit(&mut graph, &transaction, 7.0);
    let snapshot = graph.snapshot();
    let (world, robot) = (id(&snapshot, "world"), id(&snapshot, "robot"));
    let found = snapshot.transform_at(world, robot, seconds(4.5)).unwrap();
    assert!(near(&found, &turned(45.0, 2.25)));
    assert!(snapshot.transform_at(world, robot, seconds(3.5)).is_err());
}

#[test]
fn memory_of_history_is_given_back() {
    let mut graph = robot(6);
    graph.set_limits(crate::Limits {
        history_bytes: 0,
        ..crate::Limits::default()
    });
    let write = |graph: &mut Graph, n: f64| {
        let mut transaction = Transaction::new();
        set_pose(&mut transaction, "world", "robot", turned(n, 0.0));
        commit(graph, &transaction, n);
    };
    write(&mut graph, 10.0);
    let before = graph.bytes_in_use();
    for n in 0..500 {
        write(&mut graph, 11.0 + f64::from(n));
    }
    assert_eq!(graph.bytes_in_use(), before);
    let empty = |graph: &mut Graph| {
        let mut transaction = Transaction::new();
        transaction.delete_node("robot");
        commit(graph, &transaction, 1000.0);
        graph.bytes_in_use()
    };
    let after = empty(&mut graph);
    let mut other = robot(1);
    other.set_limits(crate::Limits {
        history_bytes: 0,
        ..crate::Limits::default()
    });
    assert_eq!(after, empty(&mut other), "a history is gone with its edge");
}

#[test]
fn two_writes_of_one_commit_are_one_sample() {
    let mut graph = robot(1);
    let mut transaction = Transaction::new();
    set_pose(&mut transaction, "world", "robot", turned(1.0, 0.0));
    set_pose(&mut transaction, "world", "robot", turned(2.0, 0.0));
    commit(&mut graph, &transaction, 2.0);
    let snapshot = graph.snapshot();
    let edge = snapshot
        .parent_pose(id(&snapshot, "robot"))
        .unwrap()
        .unwrap();
    let transform = snapshot.schema().attribute_id("transform").unwrap();
    let history = edge.history(transform).unwrap();
    let known: Vec<f64> = history
        .iter()
        .map(|a| a.value.as_pose().unwrap().translation.x)
        .collect();
    assert_eq!(known, [2.0, 10.0]);
}

#[test]
fn what_cannot_be_told_is_refused() {
    let mut graph = robot(2);
    let mut transaction = Transaction::new();
    for node in ["island", "a", "b", "mute"] {
        transaction.create_node("thing", node, vec![]);
    }
    set_pose(&mut transaction, "a", "b", turned(1.0, 0.0));
    set_pose(&mut transaction, "b", "a", turned(1.0, 0.0));
    transaction.create_edge("world", "pose", "mute");
    commit(&mut graph, &transaction, 2.0);
    let told = |graph: &Graph, target: &str, source: &str, time: Option<f64>| {
        let snapshot = graph.snapshot();
        let (target, source) = (id(&snapshot, target), id(&snapshot, source));
        let found = match time {
            Some(time) => snapshot.transform_at(target, source, seconds(time)),
            None => snapshot.transform(target, source),
        };
        found.unwrap_err().to_string()
    };
    assert_eq!(
        told(&graph, "robot", "island", None),
        "`robot` and `island` hang on different trees of poses: on `world` and on `island`"
    );
    assert_eq!(
        told(&graph, "world", "a", None),
        "the poses that `a` hangs on lead in a circle"
    );
    assert_eq!(
        told(&graph, "world", "mute", None),
        "`world` -pose-> `mute` has no pose in `transform`"
    );
    let snapshot = graph.snapshot();
    assert_eq!(
        snapshot.transform(NodeId(77), id(&snapshot, "world")),
        Err(TransformError::UnknownNode(NodeId(77)))
    );
    let mut transaction = Transaction::new();
    set_pose(&mut transaction, "island", "robot", turned(0.0, 0.0));
    commit(&mut graph, &transaction, 3.0);
    assert_eq!(
        told(&graph, "world", "robot", None),
        "`robot` has two poses, from `world` and from `island`"
    );

    let mut half = robot(0);
    for (time, angle) in [(1.0, 0.0), (2.0, std::f64::consts::PI)] {
        let mut transaction = Transaction::new();
        set_pose(&mut transaction, "world", "robot", turned(0.0, angle));
        commit(&mut half, &transaction, time);
    }
    assert!(told(&half, "world", "robot", Some(1.5)).contains("half a turn"));

    let mut forgetful = Graph::in_memory(Schema::open());
    let mut transaction = Transaction::new();
    transaction.create_node("thing", "world", vec![]);
    transaction.create_node("thing", "robot", vec![]);
    set_pose(&mut transaction, "world", "robot", turned(1.0, 0.0));
    commit(&mut forgetful, &transaction, 5.0);
    assert!(told(&forgetful, "world", "robot", Some(6.0)).contains("no `history`"));
}

#[test]
fn robocomps_edges_are_read_in_metres_and_with_their_times() {
    let mut graph = Graph::in_memory(Schema::open());
    let mut transaction = Transaction::new();
    for node in ["world", "robot", "arm"] {
        transaction.create_node("thing", node, vec![]);
    }
    let quarter = std::f32::consts::FRAC_PI_2;
    transaction.push(Operation::CreateEdge {
        edge: EdgeRef::new("world", "RT", "robot"),
        attributes: vec![
            (
                "rt_translation".into(),
                Value::F32List(vec![1000.0, 0.0, 0.0, 3000.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            ),
            ("rt_rotation_euler_xyz".into(), Value::F32List(vec![0.0; 9])),
            ("rt_timestamps".into(), Value::U64List(vec![2000, 4000, 0])),
        ],
    });
    transaction.push(Operation::CreateEdge {
        edge: EdgeRef::new("robot", "RT", "arm"),
        attributes: vec![
            (
                "rt_translation".into(),
                Value::F32Vector(vec![0.0, 500.0, 0.0]),
            ),
            (
                "rt_rotation_euler_xyz".into(),
                Value::F32Vector(vec![quarter, quarter, 0.0]),
            ),
        ],
    });
    commit(&mut graph, &transaction, 0.0);
    let snapshot = graph.snapshot();
    let (world, arm) = (id(&snapshot, "world"), id(&snapshot, "arm"));
    let found = snapshot.transform_at(world, arm, seconds(2.5)).unwrap();
    // About x first, then about the y that this turned upwards: x ends up along -z turned to y.
    let x_of_arm = found.rotation * Vector3::x();
    assert!((found.translation.vector - Vector3::new(1.5, 0.5, 0.0)).norm() < 1e-6);
    assert!((x_of_arm - Vector3::y()).norm() < 1e-6, "{x_of_arm}");
    let newest = snapshot.transform(world, arm).unwrap();
    assert!((newest.translation.x - 3.0).abs() < 1e-12);
    assert!(snapshot.transform_at(world, arm, seconds(4.5)).is_err());
}
