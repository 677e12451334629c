//! Looks: with them people keep their numbers where place and motion do not tell.

use super::*;
use crate::perception::synthetic::Random;

/// So many dimensions have looks here.
const DIMENSIONS: usize = 32;

/// What somebody looks like in one image.
fn image(person: usize, random: &mut Random) -> Vec<f32> {
    let mut own = Random::new(900 + person as u64);
    let noise = 0.6;
    (0..DIMENSIONS)
        .map(|_| (own.normal() + noise * random.normal()) as f32)
        .collect()
}

/// As [`Run::go`], with the looks of everybody who is seen, if `looks`.
fn go(run: &mut Run, start: f64, end: f64, looks: bool, truth: Truth) -> Outcome {
    let mut outcome = Outcome::default();
    let mut random = Random::new(77);
    let steps = ((end - start) / PERIOD).round() as usize;
    for step in 0..=steps {
        let t = start + step as f64 * PERIOD;
        let mut frames = run.frames(t, truth);
        let there = truth(t);
        for frame in frames.iter_mut().filter(|_| looks) {
            for person in &mut frame.people {
                let at = frame.world_from_camera * person.position;
                let distance = |pose: &Isometry2<f64>| (pose.translation.vector - at.coords).norm();
                let poses = there.iter().enumerate();
                let poses =
                    poses.filter_map(|(index, pose)| Some((distance(pose.as_ref()?), index)));
                let nearest = poses.min_by(|a, b| a.0.total_cmp(&b.0));
                if let Some((_, index)) = nearest.filter(|(distance, _)| *distance < 0.5) {
                    person.appearance = image(index, &mut random);
                }
            }
        }
        let now = Time::from_seconds(t);
        let scene = run.observer.observe(now, &frames, &run.surroundings);
        score(&mut outcome, &scene, &there);
        outcome.scene = scene;
    }
    outcome
}

#[test]
fn somebody_who_comes_back_after_a_minute_elsewhere_is_known_by_looks_alone() {
    // Of three people, the first leaves in the west and comes again from the east.
    let truth = |t: f64| {
        let west = (t < 4.0).then(|| walk([0.0, 0.0], [-4.8, 0.0], 4.0, t));
        let east = (t > 64.0).then(|| walk([4.8, 2.0], [0.0, 2.0], 4.0, t - 64.0));
        let stays = |y: f64| Some(pose(-1.0, y, 0.0));
        vec![west.or(east), stays(-2.0), stays(-4.0)]
    };
    for (looks, numbers) in [(true, 1), (false, 2)] {
        let mut run = Run::new(corners(10.0), 5);
        let outcome = go(&mut run, 0.0, 70.0, looks, &truth);
        assert_eq!(outcome.ids[0].len(), numbers, "{:?}", outcome.ids);
        assert_eq!((outcome.ids[1].len(), outcome.ids[2].len()), (1, 1));
    }
}

#[test]
fn two_who_meet_and_turn_back_are_not_taken_for_two_who_pass() {
    // Without headings, the way back of the one looks like the way on of the other.
    let truth = |t: f64| {
        let away = |x: f64| {
            let there = walk([x, 0.0], [x / 20.0, 0.0], 3.0, t.min(3.0));
            let back = walk([x / 20.0, 0.0], [x, 0.0], 3.0, t - 3.0);
            Some(if t < 3.0 { there } else { back })
        };
        vec![away(-3.0), away(3.0)]
    };
    let switches = |looks: bool| -> usize {
        let runs = (0..20).map(|seed| {
            let mut run = Run::new(corners(10.0), seed);
            run.errors.heading = 3.0;
            let outcome = go(&mut run, 0.0, 6.0, looks, &truth);
            let switches = outcome.ids.iter().map(|ids| ids.len().saturating_sub(1));
            switches.sum::<usize>()
        });
        runs.sum()
    };
    let [with, without] = [true, false].map(switches);
    assert!(
        with == 0 && without > 5,
        "{with} with looks, {without} without"
    );
}
