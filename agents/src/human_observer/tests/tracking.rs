//! Tracks: identity, birth, death, and what the errors of cameras must not do.

use super::*;

#[test]
fn people_who_cross_keep_their_identities() {
    for seed in 0..20 {
        let mut run = Run::new(corners(12.0), seed);
        let outcome = run.go(0.0, 1.5, 8.0, &|t| {
            vec![
                // The first two meet at 0.4 m; the third crosses between them later.
                Some(walk([-5.0, -0.5], [5.0, 0.1], 8.0, t)),
                Some(walk([5.0, 0.5], [-5.0, -0.1], 8.0, t)),
                Some(walk([-4.0, -4.0], [4.0, 4.0], 8.0, t - 1.0)),
            ]
        });
        assert!(
            outcome.ids.iter().all(|ids| ids.len() == 1),
            "seed {seed}: {outcome:?}"
        );
        assert_eq!(
            (outcome.ghosts, outcome.doubles),
            (0, 0),
            "seed {seed}: {outcome:?}"
        );
        assert!(outcome.rmse() < 0.12, "seed {seed}: {}", outcome.rmse());
    }
}

#[test]
fn overlapping_cameras_see_one_person_once() {
    for seed in 0..20 {
        let mut run = Run::new(corners(8.0), seed);
        let outcome = run.go(0.0, 0.0, 20.0, &|t: f64| {
            let (s, c) = (0.5 * t).sin_cos();
            vec![Some(pose(2.0 * c, 2.0 * s, 0.5 * t + PI / 2.0))]
        });
        assert_eq!(outcome.ids, [[1]], "seed {seed}");
        assert_eq!((outcome.ghosts, outcome.doubles), (0, 0), "seed {seed}");
        assert!(
            outcome.hits + 8 > outcome.present,
            "seed {seed}: confirmed within half a second"
        );
        let heading_error = (outcome.squared_heading_error / outcome.hits as f64).sqrt();
        assert!(heading_error < 0.15, "seed {seed}: {heading_error}");
    }
}

#[test]
fn false_detections_make_no_people() {
    for seed in 0..10 {
        let mut run = Run::new(corners(10.0), seed);
        let outcome = run.go(0.0, 0.0, 120.0, &|_| Vec::new());
        assert_eq!(outcome.ghosts, 0, "seed {seed}");
        assert_eq!(
            run.observer.next_id, 1,
            "seed {seed}: nobody was ever confirmed"
        );
    }
}

#[test]
fn somebody_who_leaves_unseen_is_kept_and_found_again_under_the_same_number() {
    // One camera sees x < 3 only; the person walks out of view and comes back.
    let mut run = Run::new(vec![camera("west", -5.0, 0.0, 0.0, PI / 2.0, 8.0)], 5);
    let truth = |t: f64| {
        let out = walk([0.0, 0.0], [6.0, 0.0], 6.0, t);
        vec![Some(if t < 6.0 {
            out
        } else {
            walk([6.0, 0.5], [0.0, 0.5], 6.0, t - 6.0)
        })]
    };
    let out = run.go(0.0, 1.0, 6.0, &truth);
    assert_eq!(out.scene.people.len(), 1, "kept while out of view");
    let back = run.go(6.0 + PERIOD, 10.0, 12.0, &truth);
    assert_eq!(back.ids, [[1]]);
    assert_eq!(back.ghosts, 0);
}

#[test]
fn somebody_who_vanishes_in_view_is_dropped_soon_and_out_of_view_later() {
    let mut run = Run::new(corners(10.0), 3);
    run.errors.clutter = 0.0;
    let truth = |t: f64| vec![(t < 3.0).then(|| pose(1.0, 1.0, 0.0))];
    let mut people_at = |start, end| run.go(start, end, end, &truth).scene.people.len();
    assert_eq!(
        (people_at(0.0, 3.05), people_at(3.2, 3.4)),
        (1, 0),
        "four cameras look: within 0.4 s"
    );

    let mut run = Run::new(corners(10.0), 3);
    run.go(0.0, 0.0, 3.0, &|_| vec![Some(pose(1.0, 1.0, 0.0))]);
    let mut at = |t: f64| {
        run.observer
            .observe(Time::from_seconds(t), &[], &Surroundings::default())
            .people
            .len()
    };
    assert_eq!(
        (at(6.0), at(12.9), at(13.1)),
        (1, 1, 0),
        "no camera, no evidence against"
    );
}

#[test]
fn somebody_overlooked_for_two_seconds_is_found_again_and_not_taken_for_a_newcomer() {
    let run = |back: Isometry2<f64>| {
        let mut run = Run::new(corners(10.0), 3);
        run.go(0.0, 1.0, 3.0, &|_| vec![Some(pose(1.0, 1.0, 0.0))]);
        assert_eq!(run.go(3.1, 4.0, 5.0, &|_| Vec::new()).scene.people, []);
        run.go(5.0, 5.5, 6.0, &|_| vec![Some(back)]).ids
    };
    assert_eq!(
        run(pose(1.5, 1.2, 0.4)),
        [[1]],
        "came out from behind a pillar"
    );
    assert_eq!(
        run(pose(1.5, 1.2, PI)),
        [[2]],
        "came in by the door the other left by"
    );
}

#[test]
fn a_wall_between_hides_and_does_not_kill() {
    let mut run = Run::new(vec![camera("west", -5.0, 0.0, 0.0, PI / 2.0, 12.0)], 9);
    run.surroundings.plan = FloorPlan::new([], [[Point2::new(2.0, -9.0), Point2::new(2.0, 0.2)]]);
    let truth = |t: f64| vec![Some(walk([1.5, 1.5], [2.8, -0.6], 3.0, t))];
    let outcome = run.go(0.0, 1.0, 8.0, &truth);
    assert_eq!(
        outcome.scene.people.len(),
        1,
        "in range and angle, but behind the wall"
    );
}

#[test]
fn a_number_is_never_given_twice() {
    let mut run = Run::new(corners(10.0), 1);
    let first = run.go(0.0, 0.0, 2.0, &|_| vec![Some(pose(-3.0, 0.0, 0.0))]);
    run.go(2.0, 2.0, 8.0, &|_| Vec::new());
    let second = run.go(8.0, 8.0, 10.0, &|_| vec![Some(pose(-3.0, 0.0, 0.0))]);
    assert_eq!(
        (first.scene.people[0].id, second.scene.people[0].id),
        (1, 2)
    );
}

#[test]
fn a_restarted_observer_adopts_people_and_doubles_nobody() {
    let truth = |t: f64| {
        vec![
            Some(walk([-3.0, 0.0], [3.0, 0.0], 6.0, t)),
            Some(pose(0.0, 3.0, 1.0)),
        ]
    };
    let mut run = Run::new(corners(10.0), 4);
    let before = run.go(0.0, 1.0, 3.0, &truth);
    run.observer = Observer::new(Config::default());
    for person in &before.scene.people {
        run.observer.adopt(person);
    }
    let after = run.go(3.5, 3.5, 6.0, &truth);
    assert_eq!(after.ids, before.ids);
    assert_eq!((after.ghosts, after.doubles), (0, 0));
    let later = run.go(6.0, 8.0, 9.0, &|_| vec![Some(pose(-3.0, -3.0, 0.0))]);
    assert_eq!(later.ids, [[3]], "numbers go on after the adopted ones");
}

#[test]
fn two_numbers_for_one_person_are_merged_into_the_older() {
    let mut run = Run::new(corners(10.0), 6);
    let twin = |id, x: f64| TrackedPerson {
        id,
        pose: pose(x, 0.0, 0.0),
        velocity: Vector2::zeros(),
        covariance: [0.02, 0.0, 0.02],
        confidence: 0.9,
        last_seen: Time::default(),
    };
    run.observer.adopt(&twin(7, 0.1));
    run.observer.adopt(&twin(4, -0.1));
    let outcome = run.go(0.1, 1.2, 3.0, &|_| vec![Some(pose(0.0, 0.0, 0.0))]);
    assert_eq!(outcome.ids, [[4]]);
    assert_eq!(outcome.doubles, 0, "one within 1.1 s");
}

#[test]
fn two_people_side_by_side_stay_two() {
    for seed in 0..10 {
        let mut run = Run::new(corners(10.0), seed);
        let outcome = run.go(0.0, 1.5, 12.0, &|t| {
            vec![
                Some(walk([-4.0, 0.25], [4.0, 0.25], 8.0, t)),
                Some(walk([-4.0, -0.25], [4.0, -0.25], 8.0, t)),
            ]
        });
        assert!(
            outcome.ids.iter().all(|ids| ids.len() == 1),
            "seed {seed}: {:?}",
            outcome.ids
        );
        assert!(outcome.mota() > 0.99, "seed {seed}: {}", outcome.mota());
    }
}

#[test]
fn the_order_of_frames_and_detections_changes_nothing() {
    let truth = |t: f64| {
        vec![
            Some(walk([-4.0, 0.0], [4.0, 0.0], 6.0, t)),
            Some(walk([4.0, 0.4], [-4.0, 0.4], 6.0, t)),
        ]
    };
    let mut run = Run::new(corners(10.0), 8);
    let mut other = Observer::new(Config::default());
    for step in 0..90 {
        let t = f64::from(step) * PERIOD;
        let mut frames = run.frames(t, &truth);
        let now = Time::from_seconds(t);
        let scene = run.observer.observe(now, &frames, &run.surroundings);
        frames.reverse();
        for frame in &mut frames {
            frame.people.reverse();
        }
        assert_eq!(scene, other.observe(now, &frames, &run.surroundings));
    }
}

#[test]
fn late_frames_help_and_wrong_ones_are_refused_and_counted() {
    let truth = |t: f64| vec![Some(walk([-4.0, 0.0], [4.0, 0.0], 6.0, t))];
    let mut run = Run::new(corners(10.0), 2);
    run.errors = Errors {
        position: 0.05,
        clutter: 0.0,
        miss: 0.0,
        heading: 0.1,
    };
    let mut last = Scene::default();
    let mut delayed = std::collections::VecDeque::new();
    for step in 0..75 {
        let t = f64::from(step) * PERIOD;
        let frames = run.frames(t, &truth);
        // Camera 0 is on time, the others come four frames (0.27 s) late.
        delayed.push_back(frames[1..].to_vec());
        let mut arrived = vec![frames[0].clone()];
        if delayed.len() > 4 {
            arrived.extend(delayed.pop_front().unwrap());
        }
        last = run
            .observer
            .observe(Time::from_seconds(t), &arrived, &run.surroundings);
    }
    assert_eq!(run.observer.refused(), Refused::default());
    let place = truth(74.0 * PERIOD)[0].unwrap().translation.vector;
    assert!((last.people[0].pose.translation.vector - place).norm() < 0.15);

    let now = Time::from_seconds(5.0);
    let frame = |time: f64| {
        let mut frame = run.cameras[0].clone();
        frame.time = Time::from_seconds(time);
        frame
    };
    let mut absurd = frame(5.0);
    absurd.people = [f64::NAN, 900.0, f64::INFINITY, 1.0]
        .map(|x| crate::messages::PersonDetection {
            position: Point2::new(x, 0.0),
            heading: None,
            score: 0.9,
            appearance: vec![f32::NAN],
        })
        .to_vec();
    let mut lost = frame(5.0);
    lost.camera = "lost".to_owned();
    lost.world_from_camera.translation.x = f64::NAN;
    let mut old = frame(4.0);
    old.camera = "old".to_owned();
    let frames = [absurd.clone(), absurd, lost, old, frame(7.0)];
    run.observer.observe(now, &frames[..2], &run.surroundings);
    run.observer.observe(now, &frames[2..], &run.surroundings);
    assert_eq!(
        run.observer.refused(),
        Refused {
            late_frames: 1,
            repeated_frames: 1,
            absurd_frames: 2,
            absurd_detections: 3,
            absurd_appearances: 1
        }
    );
}

#[test]
fn a_crowd_of_150_is_tracked() {
    // People on 150 lanes 0.8 m apart in both directions, under 16 cameras.
    let mut cameras = Vec::new();
    for row in 0..4 {
        for column in 0..4 {
            let (x, y) = (f64::from(column) * 8.0 - 12.0, f64::from(row) * 8.0 - 12.0);
            let name = format!("camera{row}{column}");
            cameras.push(camera(&name, x, y, 0.0, std::f64::consts::TAU, 7.0));
        }
    }
    let truth = |t: f64| {
        (0..150)
            .map(|index| {
                let y = f64::from(index % 30) - 14.5;
                let x = f64::from(index / 30) * 5.0 - 14.0;
                let way = if index % 2 == 0 { 4.0 } else { -4.0 };
                Some(walk([x, y], [x + way, y], 4.0, t))
            })
            .collect()
    };
    let outcome = Run::new(cameras, 11).go(0.0, 1.0, 4.0, &truth);
    assert!(outcome.mota() > 0.97, "{}", outcome.mota());
    assert!(outcome.rmse() < 0.12, "{}", outcome.rmse());
}

#[test]
fn nearest_neighbours_follow_one_person_and_forget_whom_they_lost() {
    let mut config = Config::default();
    config.tracking.association = Association::Nearest;
    let mut run = Run::new(corners(10.0), 3);
    run.observer = Observer::new(config);
    let truth = |t: f64| vec![Some(walk([-3.0, 0.0], [3.0, 0.0], 6.0, t))];
    assert_eq!(run.go(0.0, 0.5, 3.0, &truth).ids, [[1]]);
    assert_eq!(run.go(3.0, 3.4, 4.0, &|_| vec![None]).scene.people, []);
    assert_eq!(
        run.go(4.0, 4.3, 5.0, &truth).ids,
        [[2]],
        "a newcomer, for all it knows"
    );
}

#[test]
fn somebody_seen_in_vain_is_not_brought_back_by_a_single_detection() {
    let mut run = Run::new(corners(10.0), 3);
    run.errors.clutter = 0.0;
    run.go(0.0, 1.0, 2.0, &|_| vec![Some(pose(1.0, 1.0, 0.0))]);
    assert_eq!(run.go(2.1, 2.4, 2.6, &|_| vec![None]).scene.people, []);
    let mut frame = run.cameras[0].clone();
    frame.time = Time::from_seconds(2.7);
    frame.people = vec![crate::messages::PersonDetection {
        position: frame
            .world_from_camera
            .inverse_transform_point(&Point2::new(1.1, 1.0)),
        heading: None,
        score: 0.9,
        appearance: Vec::new(),
    }];
    let now = Time::from_seconds(2.7);
    let scene = run.observer.observe(now, &[frame], &run.surroundings);
    assert_eq!(scene.people, []);
}
