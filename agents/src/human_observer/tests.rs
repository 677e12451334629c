//! The observer against synthetic cameras that err as the bars say: 0.1 m of noise, 10 % misses,
//! one false detection a second and camera.

mod binding;
mod looks;
mod relating;
mod tracking;

use super::*;
use crate::perception::synthetic::{Errors, Random, USUAL, camera, look};
use nalgebra::{Isometry2, Vector2};
use std::f64::consts::PI;

const PERIOD: f64 = 1.0 / 15.0;

/// Where people truly are at a time: `None` for somebody who is not there.
type Truth<'a> = &'a dyn Fn(f64) -> Vec<Option<Isometry2<f64>>>;

fn pose(x: f64, y: f64, heading: f64) -> Isometry2<f64> {
    Isometry2::new(Vector2::new(x, y), heading)
}

/// Somebody who walks from `from` to `to` in the time from 0 to `duration`.
fn walk(from: [f64; 2], to: [f64; 2], duration: f64, t: f64) -> Isometry2<f64> {
    let (from, to) = (Vector2::from(from), Vector2::from(to));
    let way = to - from;
    let place = from + way * (t / duration).clamp(0.0, 1.0);
    Isometry2::new(place, way.y.atan2(way.x))
}

/// What a run of the observer came to.
#[derive(Debug, Default)]
struct Outcome {
    /// For each true person, the ids it was tracked under, in order.
    ids: Vec<Vec<u64>>,
    /// Instants at which a true person was tracked / was there.
    hits: usize,
    present: usize,
    /// Tracked people with no true person within 0.7 m, summed over instants.
    ghosts: usize,
    /// Instants at which two tracks stood for one person.
    doubles: usize,
    squared_error: f64,
    squared_heading_error: f64,
    scene: Scene,
}

impl Outcome {
    fn rmse(&self) -> f64 {
        (self.squared_error / self.hits as f64).sqrt()
    }

    /// Multiple object tracking accuracy: 1 less the share of misses, false people and switches.
    fn mota(&self) -> f64 {
        let switches: usize = self.ids.iter().map(|ids| ids.len().saturating_sub(1)).sum();
        let wrong = self.present - self.hits + self.ghosts + self.doubles + switches;
        1.0 - wrong as f64 / self.present as f64
    }
}

/// One run: an observer, the cameras that feed it and the walls around.
struct Run {
    observer: Observer,
    cameras: Vec<CameraFrame>,
    surroundings: Surroundings,
    errors: Errors,
    random: Random,
}

impl Run {
    fn new(cameras: Vec<CameraFrame>, seed: u64) -> Self {
        Self {
            observer: Observer::new(Config::default()),
            cameras,
            surroundings: Surroundings::default(),
            errors: USUAL,
            random: Random::new(seed),
        }
    }

    /// What all cameras show at `t`.
    fn frames(&mut self, t: f64, truth: Truth) -> Vec<CameraFrame> {
        let people: Vec<_> = truth(t).into_iter().flatten().collect();
        let time = Time::from_seconds(t);
        let (plan, errors, random) = (&self.surroundings.plan, self.errors, &mut self.random);
        let cameras = self.cameras.iter();
        cameras
            .map(|c| look(c, time, PERIOD, &people, plan, errors, random))
            .collect()
    }

    /// Runs from `start` to `end`, scoring from `settled` on.
    fn go(&mut self, start: f64, settled: f64, end: f64, truth: Truth) -> Outcome {
        let mut outcome = Outcome::default();
        let steps = ((end - start) / PERIOD).round() as usize;
        for step in 0..=steps {
            let t = start + step as f64 * PERIOD;
            let frames = self.frames(t, truth);
            let scene = self
                .observer
                .observe(Time::from_seconds(t), &frames, &self.surroundings);
            if t >= settled {
                score(&mut outcome, &scene, &truth(t));
            }
            outcome.scene = scene;
        }
        outcome
    }
}

/// Matches tracked people with true ones within 0.7 m, at the least distance.
fn score(outcome: &mut Outcome, scene: &Scene, truth: &[Option<Isometry2<f64>>]) {
    outcome.ids.resize(truth.len(), Vec::new());
    let mut pairs = Vec::new();
    for (row, pose) in truth.iter().enumerate() {
        let Some(pose) = pose else { continue };
        outcome.present += 1;
        for (column, person) in scene.people.iter().enumerate() {
            let distance = (person.pose.translation.vector - pose.translation.vector).norm();
            pairs.push(Pair {
                row,
                column,
                benefit: 0.7 - distance,
            });
        }
    }
    let matched = assign(truth.len(), scene.people.len(), &pairs);
    for (column, person) in scene.people.iter().enumerate() {
        let near_somebody = pairs.iter().any(|p| p.column == column && p.benefit > 0.0);
        match matched.iter().find(|m| m.1 == column) {
            Some((row, _)) => {
                let Some(pose) = truth[*row] else { continue };
                outcome.hits += 1;
                let between = pose.inv_mul(&person.pose);
                outcome.squared_error += between.translation.vector.norm_squared();
                outcome.squared_heading_error += between.rotation.angle().powi(2);
                if outcome.ids[*row].last() != Some(&person.id) {
                    outcome.ids[*row].push(person.id);
                }
            }
            None if near_somebody => outcome.doubles += 1,
            None => outcome.ghosts += 1,
        }
    }
}

/// Four cameras in the corners of a square of `side` metres around the origin, all of it in view of
/// several of them.
fn corners(side: f64) -> Vec<CameraFrame> {
    let half = side / 2.0;
    let range = side * 1.5;
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .iter()
        .enumerate()
        .map(|(index, (x, y)): (usize, &(f64, f64))| {
            let name = format!("camera{index}");
            camera(&name, x * half, y * half, (-y).atan2(-x), 0.55 * PI, range)
        })
        .collect()
}
