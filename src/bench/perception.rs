//! Measuring the human observer in a crowd: a thousand people under a network of cameras, beside the time
//! of a frame. It guarantees that they are tracked indeed: the run fails where they are not.

use super::chance::Chance;
use super::quantity::Quantity;
use crate::Failure;
use agents::human_observer::{Config, Observer, Surroundings};
use agents::messages::{CameraFrame, PersonDetection};
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};
use scenarios::metrics::TrackingScore;
use std::f64::consts::{PI, TAU};
use std::hint::black_box;
use std::time::Instant;

const PEOPLE: usize = 1000;
/// Lanes along which people walk back and forth, metres apart; each has some people one behind the other.
const LANES: usize = 50;
const BETWEEN_LANES: f64 = 1.2;
const BETWEEN_PEOPLE: f64 = 3.0;
/// The hall's side, m, and the cameras along it, which hang from the ceiling and look all round.
const SIDE: f64 = 60.0;
const CAMERAS: usize = 5;
const RANGE: f64 = 9.0;
const SPEED: f64 = 1.2;
/// Images a second of every camera.
const RATE: f64 = 30.0;
const SECONDS: f64 = 6.0;
/// Until everybody has been seen often enough, s.
const SETTLED: f64 = 1.0;
/// The cameras' errors: noise in m and rad, share of misses, false detections a second.
const NOISE: f64 = 0.1;
const TURN: f64 = 0.1;
const MISSES: f64 = 0.1;
const FALSE_RATE: f64 = 1.0;
/// What is tracked less well than this is not tracked.
const LEAST_MOTA: f64 = 0.9;

/// All figures of perception.
pub(crate) fn perception() -> Result<Vec<Quantity>, Failure> {
    let names: Vec<String> = (0..PEOPLE).map(|person| person.to_string()).collect();
    let mut chance = Chance::new(1);
    let mut observer = Observer::new(Config::default());
    let mut score = TrackingScore::default();
    let mut latencies = Vec::new();
    for step in 0..(SECONDS * RATE) as u32 {
        let seconds = f64::from(step) / RATE;
        let now = Time::from_seconds(seconds);
        let people: Vec<_> = (0..PEOPLE).map(|person| pose(person, seconds)).collect();
        let frames = frames(now, &people, &mut chance);
        let began = Instant::now();
        let scene = observer.observe(now, black_box(&frames), &Surroundings::default());
        let latency = began.elapsed().as_nanos() as u64;
        if seconds >= SETTLED {
            latencies.push(latency);
            score.add(
                names.iter().map(String::as_str).zip(people),
                scene.people.iter().map(|person| (person.id, person.pose)),
            );
        }
    }
    let mota = score.figures().map_or(0.0, |figures| figures.mota);
    if mota < LEAST_MOTA {
        let told = format!("of {PEOPLE} people too few are tracked: MOTA {mota:.3}");
        return Err(Failure::internal(told));
    }
    let middle = super::figure::median(&mut latencies);
    let slow = latencies[latencies.len() * 99 / 100] as f64;
    Ok(vec![
        quantity("track_1000", middle),
        quantity("track_1000_p99", slow),
    ])
}

fn quantity(name: &str, nanoseconds: f64) -> Quantity {
    Quantity {
        peer: Some((1e3 / RATE, false)),
        beside: "a frame of 30 Hz".to_owned(),
        ..Quantity::new(name.to_owned(), nanoseconds * 1e-6, "ms")
    }
}

/// Where somebody is: on a lane, walking some metres ahead and back again.
fn pose(person: usize, seconds: f64) -> Isometry2<f64> {
    let (lane, place) = (person % LANES, person / LANES);
    let turns = SPEED * seconds / BETWEEN_PEOPLE;
    let ahead = turns.rem_euclid(2.0);
    let (along, heading) = if ahead < 1.0 {
        (ahead, 0.0)
    } else {
        (2.0 - ahead, PI)
    };
    let x = (place as f64 + along) * BETWEEN_PEOPLE - BETWEEN_PEOPLE / 2.0;
    Isometry2::new(Vector2::new(x, lane as f64 * BETWEEN_LANES), heading)
}

/// What all cameras show.
fn frames(time: Time, people: &[Isometry2<f64>], chance: &mut Chance) -> Vec<CameraFrame> {
    let mut frames = Vec::new();
    for camera in 0..CAMERAS * CAMERAS {
        let [column, row] = [camera % CAMERAS, camera / CAMERAS].map(|at| at as f64 + 0.5);
        let world_from_camera =
            Isometry2::translation(column * SIDE / CAMERAS as f64, row * SIDE / CAMERAS as f64);
        let mut seen = Vec::new();
        for person in people {
            let local = world_from_camera.inv_mul(person);
            if local.translation.vector.norm() < RANGE && chance.share() >= MISSES {
                let noise = Vector2::new(normal(chance), normal(chance)) * NOISE;
                seen.push(PersonDetection {
                    position: Point2::from(local.translation.vector + noise),
                    heading: Some(local.rotation.angle() + normal(chance) * TURN),
                    score: 0.9,
                    appearance: Vec::new(),
                });
            }
        }
        if chance.share() < FALSE_RATE / RATE {
            let (direction, distance) = (chance.share() * TAU, chance.share().sqrt() * RANGE);
            seen.push(PersonDetection {
                position: Point2::new(direction.cos() * distance, direction.sin() * distance),
                heading: Some(chance.share() * TAU),
                score: 0.6,
                appearance: Vec::new(),
            });
        }
        frames.push(CameraFrame {
            camera: format!("camera_{camera}"),
            time,
            world_from_camera,
            field_of_view: TAU,
            range: RANGE,
            people: seen,
            objects: Vec::new(),
        });
    }
    frames
}

/// Normal with mean 0 and deviation 1.
fn normal(chance: &mut Chance) -> f64 {
    let radius = (-2.0 * (1.0 - chance.share()).ln()).sqrt();
    radius * (TAU * chance.share()).cos()
}
