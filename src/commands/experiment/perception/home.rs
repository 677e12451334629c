//! Homes in which six things are carried about, by habit and unseen, while a robot looks into one room after
//! the other. This file owns how often the place that object recognition ranks first is the right one,
//! and how often the place where it saw the thing last is.

mod law;

use crate::bench::Chance;
use agents::messages::{CameraFrame, ObjectDetection};
use agents::object_recognition::{Config, Recognizer};
use agents::perception::FloorPlan;
use dsr::Time;
use law::{Belief, Law};
use nalgebra::{Isometry2, Point2, Vector2};
use std::f64::consts::TAU;

const THINGS: [&str; 6] = ["mug", "book", "glasses", "remote", "keys", "phone"];
/// Rooms in a row, m wide and deep, and places in each at which things are put down.
const ROOMS: usize = 4;
const ROOM: f64 = 5.0;
const PLACES: usize = 3;
/// The robot looks into a room so many times, so far apart, s.
const LOOKS: u32 = 10;
const BETWEEN_LOOKS: f64 = 0.5;
const HOUR: f64 = 3600.0;
/// From the second day on it is asked, s.
const SETTLED: f64 = 24.0 * HOUR;
/// Of a hundred: looks that miss a thing, visits during which something hides it, and looks at which a thing
/// that is there is taken for another.
const MISSES: u32 = 10;
const HIDDEN: u32 = 20;
const MISTAKEN: u32 = 2;
const NOISE: f64 = 0.1;
/// An answer this near to the truth is right, m.
const RIGHT: f64 = 0.5;

/// What is different from home to home.
#[derive(Debug, Clone, Copy)]
pub(super) struct Home {
    pub(super) name: &'static str,
    law: Law,
    /// From one visit to a room, drawn by chance, to the next, on average, s.
    between_visits: f64,
    days: f64,
}

/// Things have a place of their own, are used elsewhere and put back; the robot makes its round of the rooms
/// three times a day.
pub(super) const TIDY: Home = Home {
    name: "tidy home",
    law: Law::Tidy {
        at_home: 1.5 * HOUR,
        away: 0.75 * HOUR,
        elsewhere: 7,
        put_back: 0.8,
    },
    between_visits: 3.0 * HOUR,
    days: 30.0,
};

/// Things are carried from one to another of four places, and the robot looks in every half hour.
pub(super) const BUSY: Home = Home {
    name: "busy home",
    law: Law::Habits {
        stay: 3.0 * HOUR,
        shares: [0.5, 0.25, 0.15, 0.1],
    },
    between_visits: HOUR / 2.0,
    days: 10.0,
};

/// How often, of a hundred questions, each answer was right.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Right {
    ranked_first: f64,
    seen_last: f64,
    /// The likeliest place for somebody who knows the home's law, and whose looks never err.
    law_known: f64,
}

impl Right {
    /// In the order of the fields.
    pub(super) fn shares(&self) -> [f64; 3] {
        [self.ranked_first, self.seen_last, self.law_known]
    }
}

/// A thing, where of its usual places it is, when it is carried on, and what can be known of it.
struct Thing {
    usual: Vec<usize>,
    at: usize,
    until: f64,
    belief: Belief,
}

/// Lives in the home for some days.
pub(super) fn live(home: &Home, seed: u64) -> Right {
    let mut chance = Chance::new(seed);
    let places: Vec<Point2<f64>> = (0..ROOMS * PLACES).map(place).collect();
    let plan = plan();
    let mut things: Vec<Thing> = THINGS.iter().map(|_| thing(home, &mut chance)).collect();
    let mut recognizer = Recognizer::new(Config::default());
    let (mut asked, mut count) = (0.0, Right::default());
    let mut clock = 0.0;
    while clock < home.days * 24.0 * HOUR {
        clock += home.between_visits * (0.5 + chance.share());
        for thing in &mut things {
            carry(home, thing, clock, &mut chance);
            thing.belief.pass(clock);
        }
        let known = recognizer.observe(Time::from_seconds(clock), &[], &plan);
        if clock >= SETTLED {
            for (name, thing) in THINGS.iter().zip(&things) {
                let truth = places[thing.usual[thing.at]].coords;
                let right = |at: Vector2<f64>| (at - truth).norm() <= RIGHT;
                let object = known.iter().find(|object| object.name == **name);
                let first = object.and_then(|object| object.places.first());
                asked += 1.0;
                count.ranked_first +=
                    f64::from(first.is_some_and(|place| right(place.pose.translation.vector)));
                count.seen_last +=
                    f64::from(object.is_some_and(|object| right(object.pose.translation.vector)));
                count.law_known += f64::from(thing.belief.likeliest() == thing.at);
            }
        }
        let room = chance.below(ROOMS as u32) as usize;
        let hidden: Vec<bool> = things.iter().map(|_| chance.below(100) < HIDDEN).collect();
        for (thing, hidden) in things.iter_mut().zip(&hidden) {
            let in_room = |place: usize| thing.usual[place] / PLACES == room;
            let seen = in_room(thing.at) && !hidden;
            thing
                .belief
                .look(in_room, seen.then_some(thing.at), f64::from(HIDDEN) / 100.0);
        }
        for _ in 0..LOOKS {
            clock += BETWEEN_LOOKS;
            let mut frame = camera(room, clock);
            for (index, thing) in things.iter().enumerate() {
                let at = thing.usual[thing.at];
                let seen = at / PLACES == room && !hidden[index];
                if seen && chance.below(100) >= MISSES {
                    let mistaken = chance.below(100) < MISTAKEN;
                    let shift = if mistaken {
                        chance.below(5) as usize + 1
                    } else {
                        0
                    };
                    let name = THINGS[(index + shift) % THINGS.len()];
                    let found = detection(name, places[at], &frame, &mut chance);
                    frame.objects.push(found);
                }
            }
            recognizer.observe(Time::from_seconds(clock), &[frame], &plan);
        }
    }
    let share = |count: f64| 100.0 * count / f64::max(asked, 1.0);
    Right {
        ranked_first: share(count.ranked_first),
        seen_last: share(count.seen_last),
        law_known: share(count.law_known),
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

fn thing(home: &Home, chance: &mut Chance) -> Thing {
    let mut free: Vec<usize> = (0..ROOMS * PLACES).collect();
    let mut draw = || free.swap_remove(chance.below(free.len() as u32) as usize);
    let usual: Vec<usize> = (0..home.law.places()).map(|_| draw()).collect();
    Thing {
        usual,
        at: 0,
        until: home.law.stay(0, chance),
        belief: Belief::new(home.law),
    }
}

/// Carries the thing about until `clock`.
fn carry(home: &Home, thing: &mut Thing, clock: f64, chance: &mut Chance) {
    while thing.until < clock {
        thing.at = home.law.next(thing.at, chance);
        thing.until += home.law.stay(thing.at, chance);
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
