//! What sensors make of the world: when frames arrive, and what observers make of them.

use super::*;
use agents::grid::CostGrid;
use agents::human_observer::{Config, Observer, Scene, Surroundings};
use agents::navigation::map_age::MapState;
use agents::navigation::navigator::{Inputs as Seen, Navigator, Status};
use agents::navigation::target::{Target, Task};
use agents::perception::FloorPlan;

/// A hall with a camera that misses nobody, and somebody who walks along it from the first second on.
fn hall() -> Scenario {
    let text = r#"
name = "hall"
start = "2026-03-02T10:00:00"
duration = 60.0
[[room]]
name = "hall"
polygon = [[0, 0], [12, 0], [12, 6], [0, 6]]
[[camera]]
name = "eye"
pose = [0.1, 3.0, 0.0]
field_of_view = 3.0
range = 14.0
miss_rate = 0.0
[robot]
pose = [1.0, 0.5, 0.0]
[[person]]
name = "ana"
pose = [2.0, 4.0, 0.0]
speed = 1.0
schedule = [{ after = 1.0, go = [10.0, 4.0] }]
"#;
    let read = |_: &str| Ok(Vec::new());
    Scenario::parse("scenario.toml", text, &read).expect("a good scenario")
}

fn delayed(delay: f64, delay_jitter: f64) -> Scenario {
    let mut scenario = hall();
    scenario.cameras[0].delay = delay;
    scenario.cameras[0].delay_jitter = delay_jitter;
    scenario
}

fn frames(scenario: &Scenario, seconds: f64) -> Vec<(Time, CameraFrame)> {
    let outputs = run(&mut World::new(scenario, 3, None), seconds, None);
    let arrived = |o: Outputs| o.frames.into_iter().map(move |frame| (o.truth.time, frame));
    outputs.into_iter().flat_map(arrived).collect()
}

fn surroundings(scenario: &Scenario) -> Surroundings {
    let rooms = scenario.rooms.iter();
    let rooms = rooms.map(|room| (room.name.clone(), room.polygon.clone()));
    Surroundings {
        plan: FloorPlan::new(rooms, scenario.walls.clone()),
        ..Surroundings::default()
    }
}

#[test]
fn a_delayed_frame_is_the_same_frame_later() {
    let (plain, late) = (frames(&hall(), 5.0), frames(&delayed(0.2, 0.0), 5.2));
    assert_eq!((plain.len(), late.len()), (50, 50));
    for ((taken, plain), (arrived, late)) in plain.iter().zip(&late) {
        assert_eq!(plain, late);
        assert_eq!(late.time, *taken);
        assert!((arrived.since(*taken) - 0.2).abs() < 1e-6);
    }
}

#[test]
fn jitter_spreads_the_arrivals_and_changes_no_frame() {
    let plain = frames(&hall(), 10.0);
    let late = frames(&delayed(0.1, 0.4), 10.5);
    let delays: Vec<f64> = late.iter().map(|(now, f)| now.since(f.time)).collect();
    assert!(delays.iter().all(|d| (0.07..0.53).contains(d)));
    let early = delays.iter().filter(|d| **d < 0.3).count();
    assert!((25..75).contains(&early), "{early} of {}", delays.len());
    let mut sorted: Vec<CameraFrame> = late.into_iter().map(|(_, frame)| frame).collect();
    sorted.sort_by_key(|frame| frame.time);
    let plain: Vec<CameraFrame> = plain.into_iter().map(|(_, frame)| frame).collect();
    assert_eq!(sorted[..plain.len()], plain);
}

#[test]
fn an_observer_tracks_a_walker_through_late_frames() {
    let scenario = delayed(0.2, 0.1);
    let surroundings = surroundings(&scenario);
    let mut world = World::new(&scenario, 3, None);
    let mut observer = Observer::new(Config::default());
    let (mut squares, mut count) = (0.0, 0.0);
    for output in run(&mut world, 9.0, None) {
        let truth = output.truth;
        let scene: Scene = observer.observe(truth.time, &output.frames, &surroundings);
        let ana = person(&truth, "ana");
        if truth.time.since(scenario.start) < 3.0 {
            continue;
        }
        let [seen] = &scene.people[..] else {
            panic!("{} people", scene.people.len());
        };
        assert_eq!(seen.id, 1);
        squares += (seen.position() - ana.position).norm_squared();
        count += 1.0;
    }
    let error = f64::sqrt(squares / count);
    // Whoever stood still for the observer since the last frame would be 0.25 m behind.
    assert!(error < 0.15, "{error} m");
    assert_eq!(
        observer.refused(),
        agents::human_observer::Refused::default()
    );
}

#[test]
fn lost_beams_read_the_greatest_range_at_the_stated_rate_and_the_others_as_ever() {
    let mut scenario = hall();
    let scans = |scenario: &Scenario| -> Vec<LaserScan> {
        let outputs = run(&mut World::new(scenario, 3, None), 5.0, None);
        outputs.into_iter().filter_map(|o| o.scan).collect()
    };
    let plain = scans(&scenario);
    scenario.robot.laser.dropout_rate = 0.2;
    let (mut met, mut lost) = (0.0, 0.0);
    for (plain, scan) in plain.iter().zip(&scans(&scenario)) {
        for (&before, &now) in plain.ranges.iter().zip(&scan.ranges) {
            let is_lost = before < 10.0 && now.to_bits() == 10.0_f32.to_bits();
            assert!(is_lost || before.to_bits() == now.to_bits());
            met += f64::from(u8::from(before < 10.0));
            lost += f64::from(u8::from(is_lost));
        }
    }
    assert!((lost / met - 0.2_f64).abs() < 0.02, "{lost} of {met}");
}

#[test]
fn somebody_whom_only_the_laser_sees_is_not_driven_into_where_beams_get_lost() {
    for seed in 1..=5 {
        let mut scenario = hall();
        scenario.people[0].schedule.clear();
        scenario.people[0].pose = Isometry2::new(Vector2::new(5.0, 3.0), 0.0);
        scenario.robot.pose = Isometry2::new(Vector2::new(1.0, 3.0), 0.0);
        scenario.robot.laser.dropout_rate = 0.2;
        let mut world = World::new(&scenario, seed, None);
        let mut navigator = Navigator::default();
        let grid = CostGrid::covering([0.0, 0.0, 12.0, 6.0], 0.1);
        let task = Task {
            id: "across".to_owned(),
            target: Target::Point(Point2::new(10.0, 3.0)),
        };
        let (mut scan, mut odometry, mut velocity) = (None, None, None);
        let mut status = Status::Idle;
        for _ in 0..600 {
            let speech = Vec::new();
            let output = world.step(0.1, &Inputs { velocity, speech });
            scan = output.scan.or(scan);
            odometry = output.odometry.or(odometry);
            let seen = Seen {
                odometry: odometry.as_ref(),
                scan: scan.as_ref(),
                grid: Some(&grid),
                map: MapState::Current,
                walls: &scenario.walls,
                people: &[],
                task: Some(&task),
                limits: scenario.robot.limits(),
                social: false,
            };
            let step = navigator.step(world.time(), &seen);
            velocity = Some(step.command);
            status = step.status;
            if status == Status::Arrived {
                break;
            }
        }
        assert_eq!(status, Status::Arrived, "seed {seed}");
        assert_eq!(world.truth().collisions.total(), 0, "seed {seed}");
    }
}
