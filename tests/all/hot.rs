//! Attributes that their owner gives out beside the graph, between real processes.

use crate::support::{Process, TestInstance};
use dsr::{
    CommitError, HotAttribute, HotError, Owner, Refusal, Session, Snapshot, Time, Transaction,
};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(20);

/// The number that all three coordinates of the robot's pose are, and its time in microseconds.
fn look(snapshot: &Snapshot) -> (i64, i64) {
    let name = snapshot.schema().attribute_id("pose").unwrap();
    let robot = snapshot.find_node_by_name("robot").unwrap().unwrap();
    let read = robot.attribute(name).unwrap().unwrap();
    let place = read.value.as_pose().unwrap().translation.vector;
    let numbers = [place.x, place.y, place.z].map(|number| number as i64);
    assert_eq!(numbers, [numbers[0]; 3], "a pose in halves");
    (numbers[0], read.time.nanoseconds() / 1000)
}

/// Looks until the pose is beyond `n`.
fn look_beyond(session: &mut Session, n: i64) -> i64 {
    loop {
        let (found, time) = look(&session.snapshot().unwrap());
        if found > n {
            assert_eq!(found, time, "a value with its own time");
            return found;
        }
        std::thread::yield_now();
    }
}

#[test]
fn a_hot_pose_is_read_whole_and_new_and_outlives_its_owner() {
    let instance = TestInstance::new("hot");
    let store = Process::peer("hot-store", &instance);
    let mut session = Session::attach(&instance.0, "reader", PATIENCE).unwrap();
    assert_eq!(look(&session.snapshot().unwrap()).0, 0, "as committed");
    let owner = Process::peer("hot-owner", &instance);
    look_beyond(&mut session, 0);
    // The same snapshot shows what comes after it; without hot values it stands still.
    let snapshot = session.snapshot().unwrap();
    let committed = snapshot.committed();
    let (before, still) = (look(&snapshot).0, look(&committed));
    let mut last = before;
    for _ in 0..100_000 {
        let (n, time) = look(&snapshot);
        assert!(n >= last && n == time, "{n} after {last}, at {time}");
        last = n;
    }
    assert!(last > before, "it went on");
    assert_eq!(look(&committed), still);
    // Folded in: it comes into the graph itself.
    while look(&session.snapshot().unwrap().committed()).0 <= still.0 {
        std::thread::yield_now();
    }
    // Who comes late finds it.
    let mut late = Session::attach(&instance.0, "tool", PATIENCE).unwrap();
    look_beyond(&mut late, last);
    // Its owner dies: what it said last stands, and the next owner goes on.
    owner.kill();
    let known = look(&session.snapshot().unwrap()).0;
    assert!(known >= last);
    assert_eq!(look(&session.snapshot().unwrap()).0, known);
    let owner = Process::peer("hot-owner", &instance);
    look_beyond(&mut session, known);
    owner.finish();
    // A later commit by another is newer than what the owner gave out.
    let mut transaction = Transaction::new();
    transaction.set("robot", "pose", dsr::Pose::translation(-1.0, -1.0, -1.0));
    let end = Time::from_seconds(1e6);
    late.commit(&transaction, end).unwrap();
    assert_eq!(look(&session.snapshot().unwrap()).0, -1);
    drop((session, late));
    store.finish();
}

/// The number of the robot's pose, given that of its owner.
fn seen(session: &mut Session) -> i64 {
    look(&session.snapshot().unwrap()).0
}

#[test]
fn who_may_not_write_an_attribute_shows_nobody_a_value_of_it() {
    let instance = TestInstance::new("foreign");
    let store = Process::peer("hot-store", &instance);
    let mut reader = Session::attach(&instance.0, "reader", PATIENCE).unwrap();
    let robot = || Owner::Node("robot".into());
    let refused = |session: &mut Session| {
        let error = session.hot(robot(), "pose").unwrap_err();
        let HotError::Commit(CommitError::Refused(Refusal::NotAllowed(why))) = error else {
            panic!("{error}");
        };
        why
    };
    // An agent without the right, and a process that goes by the name of one that has it.
    let mut guest = Session::attach(&instance.0, "guest", PATIENCE).unwrap();
    assert!(refused(&mut guest).contains("`guest` has no manifest"));
    let owner = Process::peer("hot-owner", &instance);
    look_beyond(&mut reader, 0);
    let mut impostor = Session::attach(&instance.0, "driver", PATIENCE).unwrap();
    assert!(refused(&mut impostor).contains("only one process"));
    owner.finish();
    // Of two that may, readers believe the one that committed last, and not the later value.
    let place = |n: i64| dsr::Pose::translation(n as f64, n as f64, n as f64);
    let time = |n: i64| Time::from_nanoseconds(n * 1000);
    let start = 1_000_000_000;
    let mut tools: Vec<(Session, HotAttribute)> = (0..2)
        .map(|i| {
            let mut session = Session::attach(&instance.0, "tool", PATIENCE).unwrap();
            let mut pose = session.hot(robot(), "pose").unwrap();
            pose.set(place(start + i), time(start + i)).unwrap();
            assert_eq!(seen(&mut reader), start + i);
            (session, pose)
        })
        .collect();
    let (session, pose) = &mut tools[0];
    pose.set(place(start + 10), time(start + 10)).unwrap();
    assert_eq!(seen(&mut reader), start + 1, "the other committed last");
    let mut transaction = Transaction::new();
    assert!(pose.fold_into(&mut transaction));
    session.commit(&transaction, time(start + 10)).unwrap();
    pose.set(place(start + 11), time(start + 11)).unwrap();
    assert_eq!(seen(&mut reader), start + 11, "it has committed since");
    drop((guest, impostor, reader, tools));
    store.finish();
}

#[test]
fn only_what_is_there_and_hot_can_be_given_out() {
    let instance = TestInstance::new("cold");
    let store = Process::peer("hot-store", &instance);
    let mut session = Session::attach(&instance.0, "tool", PATIENCE).unwrap();
    let mut transaction = Transaction::new();
    transaction.create_node("robot", "other", vec![("speed".into(), 1.0.into())]);
    session.commit(&transaction, Time::default()).unwrap();
    let mut hot = |node: &str, name| session.hot(Owner::Node(node.into()), name);
    assert!(matches!(
        hot("other", "speed"),
        Err(HotError::NotHot { .. })
    ));
    assert!(matches!(
        hot("other", "pose"),
        Err(HotError::NotFound { .. })
    ));
    assert!(matches!(
        hot("nobody", "pose"),
        Err(HotError::NotFound { .. })
    ));
    let misspelt = hot("robot", "pos").unwrap_err();
    assert!(
        misspelt.to_string().contains("did you mean `pose`"),
        "{misspelt}"
    );
    let mut pose = hot("robot", "pose").unwrap();
    assert!(matches!(
        pose.set(1.0, Time::default()),
        Err(HotError::Schema(_))
    ));
    drop((pose, session));
    store.finish();
}
