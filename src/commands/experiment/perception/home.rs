//! A home in which six things are carried about, by habit and unseen, while a robot looks into one room after
//! the other. This file owns how often the place that object recognition ranks first is the right one,
//! and how often the place where it saw the thing last is.

use crate::bench::Chance;
use agents::messages::{CameraFrame, ObjectDetection};
use agents::object_recognition::{Config, Recognizer};
use agents::perception::FloorPlan;
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};
use std::f64::consts::TAU;

const THINGS: [&str; 6] = ["mug", "book", "glasses", "remote", "keys", "phone"];
/// Rooms in a row, m wide and deep, and places in each at which things are put down.
const ROOMS: usize = 4;
const ROOM: f64 = 5.0;
const PLACES: usize = 3;
/// How often a thing comes to its usual place, to the second, and so on.
const HABITS: [u32; 4] = [50, 25, 15, 10];
/// A thing stays where it is for so long on average, s.
const STAY: f64 = 3.0 * HOUR;
/// The robot looks into a room by chance every so often, so many times, so far apart, s.
const BETWEEN_VISITS: f64 = HOUR / 2.0;
const LOOKS: u32 = 10;
const BETWEEN_LOOKS: f64 = 0.5;
const DAYS: f64 = 10.0;
/// From then on it is asked, s.
const SETTLED: f64 = 24.0 * HOUR;
const HOUR: f64 = 3600.0;
/// Of a hundred: looks that miss a thing, visits during which something hides it, and looks at which a thing
/// that is there is taken for another.
const MISSES: u32 = 10;
const HIDDEN: u32 = 20;
const MISTAKEN: u32 = 2;
const NOISE: f64 = 0.1;
/// An answer this near to the truth is right, m.
const RIGHT: f64 = 0.5;

/// How often, of a hundred questions, each answer was right.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Right {
    pub(super) ranked_first: f64,
    pub(super) seen_last: f64,
}

/// A thing, its usual places, where it is, and when it is carried on.
struct Thing {
    usual: Vec<usize>,
    at: usize,
    until: f64,
}

/// Lives in the home for some days.
pub(super) fn live(seed: u64) -> Right {
    let mut chance = Chance::new(seed);
    let places: Vec<Point2<f64>> = (0..ROOMS * PLACES).map(place).collect();
    let plan = plan();
    let mut things: Vec<Thing> = THINGS.iter().map(|_| thing(&mut chance)).collect();
    let mut recognizer = Recognizer::new(Config::default());
    let (mut asked, mut ranked_first, mut seen_last) = (0.0, 0.0, 0.0);
    let mut clock = 0.0;
    while clock < DAYS * 24.0 * HOUR {
        clock += BETWEEN_VISITS * (0.5 + chance.share());
        for thing in &mut things {
            carry(thing, clock, &mut chance);
        }
        let known = recognizer.observe(Time::from_seconds(clock), &[], &plan);
        if clock >= SETTLED {
            for (name, thing) in THINGS.iter().zip(&things) {
                let right = |at: Vector2<f64>| (at - places[thing.at].coords).norm() <= RIGHT;
                let object = known.iter().find(|object| object.name == **name);
                let first = object.and_then(|object| object.places.first());
                asked += 1.0;
                ranked_first +=
                    f64::from(first.is_some_and(|place| right(place.pose.translation.vector)));
                seen_last +=
                    f64::from(object.is_some_and(|object| right(object.pose.translation.vector)));
            }
        }
        let room = chance.below(ROOMS as u32) as usize;
        let hidden: Vec<bool> = things.iter().map(|_| chance.below(100) < HIDDEN).collect();
        for _ in 0..LOOKS {
            clock += BETWEEN_LOOKS;
            let mut frame = camera(room, clock);
            for (index, thing) in things.iter().enumerate() {
                let seen = thing.at / PLACES == room && !hidden[index];
                if seen && chance.below(100) >= MISSES {
                    let mistaken = chance.below(100) < MISTAKEN;
                    let shift = if mistaken {
                        chance.below(5) as usize + 1
                    } else {
                        0
                    };
                    let name = THINGS[(index + shift) % THINGS.len()];
                    frame
                        .objects
                        .push(detection(name, places[thing.at], &frame, &mut chance));
                }
            }
            recognizer.observe(Time::from_seconds(clock), &[frame], &plan);
        }
    }
    Right {
        ranked_first: 100.0 * ranked_first / f64::max(asked, 1.0),
        seen_last: 100.0 * seen_last / f64::max(asked, 1.0),
    }
}

/// Where the places are: three in a triangle in each room.
fn place(index: usize) -> Point2<f64> {
    let middle = Point2::new((index / PLACES) as f64 * ROOM + ROOM / 2.0, ROOM / 2.0);
    let direction = (index % PLACES) as f64 * TAU / PLACES as f64;
    middle + Vector2::new(direction.cos(), direction.sin()) * 1.5
}

fn plan() -> FloorPlan {
    let corner = |x: usize, y: f64| Point2::new(x as f64 * ROOM, y);
    let outline = |x| {
        vec![
            corner(x, 0.0),
            corner(x + 1, 0.0),
            corner(x + 1, ROOM),
            corner(x, ROOM),
        ]
    };
    let rooms = (0..ROOMS).map(|x| (format!("room_{x}"), outline(x)));
    FloorPlan::new(
        rooms,
        (0..=ROOMS).map(|x| [corner(x, 0.0), corner(x, ROOM)]),
    )
}

fn thing(chance: &mut Chance) -> Thing {
    let mut free: Vec<usize> = (0..ROOMS * PLACES).collect();
    let mut draw = || free.swap_remove(chance.below(free.len() as u32) as usize);
    let usual: Vec<usize> = HABITS.iter().map(|_| draw()).collect();
    let at = usual[0];
    Thing {
        usual,
        at,
        until: stay(chance),
    }
}

/// A time of this mean, of which each second is the last as likely as any other.
fn stay(chance: &mut Chance) -> f64 {
    -STAY * (1.0 - chance.share()).ln()
}

/// Carries the thing about until `clock`: to another of its places each time, the more usual the oftener.
fn carry(thing: &mut Thing, clock: f64, chance: &mut Chance) {
    while thing.until < clock {
        let before = thing.at;
        while thing.at == before {
            let mut draw = chance.below(HABITS.iter().sum());
            for (place, habit) in thing.usual.iter().zip(HABITS) {
                if draw < habit {
                    thing.at = *place;
                    break;
                }
                draw -= habit;
            }
        }
        thing.until += stay(chance);
    }
}

/// The robot's camera in the middle of a room, which looks all round.
fn camera(room: usize, clock: f64) -> CameraFrame {
    let middle = Vector2::new(room as f64 * ROOM + ROOM / 2.0, ROOM / 2.0);
    CameraFrame {
        camera: "robot".to_owned(),
        time: Time::from_seconds(clock),
        world_from_camera: Isometry2::new(middle, 0.0),
        field_of_view: TAU,
        range: 4.0,
        people: Vec::new(),
        objects: Vec::new(),
    }
}

fn detection(
    name: &str,
    place: Point2<f64>,
    frame: &CameraFrame,
    chance: &mut Chance,
) -> ObjectDetection {
    // Evenly spread, with the deviation stated.
    let mut noise = || (chance.share() - 0.5) * NOISE * 12.0_f64.sqrt();
    let at = place + Vector2::new(noise(), noise());
    let local = frame.world_from_camera.inverse_transform_point(&at);
    ObjectDetection {
        class: name.to_owned(),
        identity: Some(name.to_owned()),
        camera_from_object: Isometry2::new(local.coords, 0.0),
        size: Vector2::new(0.1, 0.1),
        score: 0.9,
    }
}
