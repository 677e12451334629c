//! Object recognition: detections of objects to objects, each with the place where it was seen last and
//! those where it may be.
//!
//! A detection belongs to the object it names, or to the nearest of its class (optimally assigned).
//! Several sightings make an object, averaging makes its pose, and looks that should have shown it
//! and did not take confidence away. Guarantees that a name given to one object is never given to
//! another, and that the same frames in any order within one call give the same objects to the bit.

mod candidate;
mod config;
mod graph;
mod memory;
mod place;
mod whereabouts;

#[cfg(test)]
mod tests;

pub use config::{Config, MemoryConfig};
pub use graph::{ObjectRecognition, objects};
pub use memory::Place;
pub use whereabouts::{Whereabouts, whereabouts};

use crate::messages::{CameraFrame, ObjectDetection};
use crate::perception::{FloorPlan, Pair, assign, hides, in_time_order, is_finite_pose, sees};
use candidate::Candidate;
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};
use std::collections::BTreeMap;

/// Recognises objects in the frames of several cameras.
#[derive(Debug)]
pub struct Recognizer {
    config: Config,
    objects: Vec<Candidate>,
    /// For each class, the number the next nameless object gets.
    next_number: BTreeMap<String, u64>,
    frame: u64,
    /// The time of each camera's newest frame.
    cameras: BTreeMap<String, Time>,
}

/// An object and what is believed of it.
#[derive(Debug, Clone, PartialEq)]
pub struct RecognizedObject {
    /// Its identity where a detection gave one, else its class and a number, such as `table_2`.
    pub name: String,
    /// Whether a detection gave its name.
    pub identified: bool,
    /// What it is, a type of the schema such as `table`.
    pub class: String,
    /// Where it was seen last and faces, world frame.
    pub pose: Isometry2<f64>,
    /// Extent along its own x and y, m.
    pub size: Vector2<f64>,
    /// Probability that it is there, in [0, 1].
    pub confidence: f64,
    /// When a camera last saw it.
    pub last_seen: Time,
    /// The room it is in, where there is one.
    pub in_room: Option<String>,
    /// Where it may be, the likeliest place first. What the probabilities lack of one is for somewhere
    /// else.
    pub places: Vec<Place>,
    /// When those probabilities hold.
    pub remembered: Time,
    /// How long it stays at a place on average, s, where that was learned.
    pub stay: Option<f64>,
}

/// A usable detection in the world frame.
#[derive(Debug, Clone)]
struct Sighting<'a> {
    detection: &'a ObjectDetection,
    pose: Isometry2<f64>,
}

/// A name longer than this, or empty, cannot be a node's.
const GREATEST_NAME: usize = 255;

impl Sighting<'_> {
    /// The identity, if it can be a name.
    fn identity(&self) -> Option<&str> {
        let usable = |name: &&str| !name.is_empty() && name.len() <= GREATEST_NAME;
        self.detection.identity.as_deref().filter(usable)
    }
}

impl Recognizer {
    /// A recogniser that knows no objects.
    pub fn new(config: Config) -> Self {
        Self {
            config,
            objects: Vec::new(),
            next_number: BTreeMap::new(),
            frame: 0,
            cameras: BTreeMap::new(),
        }
    }

    /// Takes over an object known from before, as a restarted recogniser does. A name that is known
    /// already is left as it is.
    pub fn adopt(&mut self, object: &RecognizedObject) {
        self.reserve(&object.name);
        let known = self
            .objects
            .iter()
            .any(|o| o.name.as_ref() == Some(&object.name));
        if known || !is_finite_pose(&object.pose) {
            return;
        }
        self.objects.push(Candidate::resumed(object, &self.config));
    }

    /// Keeps `name`, where it is a class and a number, from being given to a new object of the class.
    pub fn reserve(&mut self, name: &str) {
        let Some((class, number)) = name.rsplit_once('_') else {
            return;
        };
        let Ok(number) = number.parse::<u64>() else {
            return;
        };
        let next = self.next_number.entry(class.to_owned()).or_insert(1);
        *next = (*next).max(number.saturating_add(1));
    }

    /// Takes in `frames` and says what is where at `now`, in order of name.
    ///
    /// Frames may come in any order; they are taken in by time, then by the camera's name. Frames
    /// not newer than the last of their camera, or from the future, are not looked at.
    pub fn observe(
        &mut self,
        now: Time,
        frames: &[CameraFrame],
        plan: &FloorPlan,
    ) -> Vec<RecognizedObject> {
        for frame in in_time_order(frames) {
            let repeated = self
                .cameras
                .get(&frame.camera)
                .is_some_and(|last| frame.time <= *last);
            let sane = is_finite_pose(&frame.world_from_camera)
                && frame.range.is_finite()
                && frame.field_of_view.is_finite()
                && frame.time <= now + GREATEST_LEAD;
            if sane && !repeated {
                self.take_in(frame, plan);
            }
        }
        let config = &self.config;
        self.objects
            .retain(|o| o.confirmed || now.since(o.last_seen) <= config.tentative_time);
        for object in &mut self.objects {
            let position = object.place.position();
            let room = plan.room_after(object.room.as_deref(), position, config.room_margin);
            object.room = room.map(str::to_owned);
            object.memory.pass(now, &config.memory);
        }
        let mut recognized: Vec<_> = self
            .objects
            .iter()
            .filter_map(Candidate::recognized)
            .collect();
        recognized.sort_by(|a, b| a.name.cmp(&b.name));
        recognized
    }

    fn take_in(&mut self, frame: &CameraFrame, plan: &FloorPlan) {
        self.frame += 1;
        self.cameras.insert(frame.camera.clone(), frame.time);
        let sightings = sightings(frame, &self.config);
        let mut free = Vec::new();
        for sighting in sightings {
            match sighting.identity() {
                Some(identity) => self.identified(frame.time, identity, &sighting),
                None => free.push(sighting),
            }
        }
        // Known objects choose first: a false start must not take a sighting from them.
        for known in [true, false] {
            self.associate(frame.time, &mut free, known);
        }
        self.count_misses(frame, plan);
        for sighting in &free {
            self.objects.push(Candidate::new(
                frame.time,
                sighting,
                self.frame,
                &self.config,
            ));
        }
        self.confirm();
        let config = &self.config;
        self.objects.retain(|object| !object.is_dead(config));
    }

    /// A sighting that names its object: of that object, else of a nameless one of its class that
    /// stands there, else of a new one.
    fn identified(&mut self, time: Time, identity: &str, sighting: &Sighting) {
        let place = Point2::from(sighting.pose.translation.vector);
        let by_name = self
            .objects
            .iter()
            .position(|o| o.name.as_deref() == Some(identity));
        let found = by_name.or_else(|| {
            let nameless = self
                .objects
                .iter()
                .enumerate()
                .filter_map(|(index, object)| {
                    let distance = (object.place.position() - place).norm();
                    let fits = !object.identified
                        && object.class == sighting.detection.class
                        && distance <= self.config.gate;
                    fits.then_some((distance, index))
                });
            nameless
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .map(|(_, index)| index)
        });
        let index = found.unwrap_or_else(|| {
            self.objects
                .push(Candidate::new(time, sighting, self.frame, &self.config));
            self.objects.len() - 1
        });
        let object = &mut self.objects[index];
        if found.is_some() {
            object.hit(time, sighting, self.frame, &self.config);
        }
        object.identified = true;
        object.name = Some(identity.to_owned());
        if object.class != sighting.detection.class {
            object.class.clone_from(&sighting.detection.class);
        }
    }

    /// Gives the `free` sightings to known or to unconfirmed objects of their class, and leaves in
    /// it those that nobody took.
    fn associate(&mut self, time: Time, free: &mut Vec<Sighting>, known: bool) {
        let mut pairs = Vec::new();
        for (row, object) in self.objects.iter().enumerate() {
            if object.confirmed != known || object.last_frame == self.frame {
                continue;
            }
            for (column, sighting) in free.iter().enumerate() {
                if sighting.detection.class == object.class {
                    let place = Point2::from(sighting.pose.translation.vector);
                    let distance = (place - object.place.position()).norm();
                    // Squared: two fair matches are better than a good and a bad one.
                    let benefit = self.config.gate.powi(2) - distance.powi(2);
                    pairs.push(Pair {
                        row,
                        column,
                        benefit,
                    });
                }
            }
        }
        let mut taken = vec![false; free.len()];
        for (row, column) in assign(self.objects.len(), free.len(), &pairs) {
            self.objects[row].hit(time, &free[column], self.frame, &self.config);
            taken[column] = true;
        }
        let mut taken = taken.into_iter();
        free.retain(|_| taken.next() == Some(false));
    }

    /// Holds it against those the camera had to see and did not.
    fn count_misses(&mut self, frame: &CameraFrame, plan: &FloorPlan) {
        let camera = Point2::from(frame.world_from_camera.translation.vector);
        let bodies: Vec<Point2<f64>> = frame
            .people
            .iter()
            .map(|p| frame.world_from_camera * p.position)
            .collect();
        let body_radius = self.config.body_radius;
        for object in self
            .objects
            .iter_mut()
            .filter(|o| o.last_frame != self.frame)
        {
            let margin = self.config.view_margin + object.size.norm() / 2.0;
            let visible = |place| {
                sees(frame, plan, place, margin)
                    && !bodies
                        .iter()
                        .any(|&body| hides(camera, body, place, body_radius))
            };
            if visible(object.place.position()) {
                object.missed(frame.time, &self.config);
            }
            object
                .memory
                .looked_in_vain(frame.time, visible, &self.config);
        }
    }

    /// Reports the candidates with evidence enough. Where an object of the same class is being
    /// missed at the same time, it is waited until that one is seen again or taken to have moved.
    fn confirm(&mut self) {
        let mut moved = Vec::new();
        for index in 0..self.objects.len() {
            let object = &self.objects[index];
            if object.confirmed || !object.is_ready(&self.config) {
                continue;
            }
            if object.name.is_none() {
                match self.missed_like(index) {
                    Some(old) if self.objects[old].misses >= self.config.moved_looks => {
                        self.move_identity(old, index);
                        moved.push(old);
                    }
                    Some(_) => continue,
                    None => self.objects[index].name = Some(self.new_name(index)),
                }
            }
            self.objects[index].confirmed = true;
        }
        moved.sort_unstable();
        for index in moved.into_iter().rev() {
            self.objects.remove(index);
        }
    }

    /// An object like the candidate that cameras look for in vain since the candidate appeared; the
    /// one missed most often.
    fn missed_like(&self, index: usize) -> Option<usize> {
        let new = &self.objects[index];
        let candidates = self.objects.iter().enumerate().filter(|(_, old)| {
            old.confirmed && old.class == new.class && old.last_seen < new.born && old.misses > 0
        });
        let most = candidates
            .max_by(|(_, a), (_, b)| a.misses.cmp(&b.misses).then_with(|| b.name.cmp(&a.name)));
        most.map(|(index, _)| index)
    }

    /// The candidate `new` is the object `old` at another place.
    fn move_identity(&mut self, old: usize, new: usize) {
        let gone = &mut self.objects[old];
        gone.confirmed = false;
        let (name, room, identified) = (gone.name.take(), gone.room.take(), gone.identified);
        let memory = std::mem::take(&mut gone.memory);
        let here = &mut self.objects[new];
        (here.name, here.room, here.identified) = (name, room, identified);
        here.memory = memory;
    }

    /// The next name of the candidate's class that nobody has.
    fn new_name(&mut self, index: usize) -> String {
        let class = &self.objects[index].class;
        let next = self.next_number.entry(class.clone()).or_insert(1);
        loop {
            let name = format!("{class}_{next}");
            *next += 1;
            if self.objects.iter().all(|o| o.name.as_ref() != Some(&name)) {
                return name;
            }
        }
    }
}

/// A camera's clock may run ahead of ours by this much, s.
const GREATEST_LEAD: f64 = 0.1;

/// The frame's usable detections in the world frame, in an order of their own.
fn sightings<'a>(frame: &'a CameraFrame, config: &Config) -> Vec<Sighting<'a>> {
    let mut sightings: Vec<Sighting> = frame
        .objects
        .iter()
        .filter(|detection| {
            let distance = detection.camera_from_object.translation.vector.norm();
            is_finite_pose(&detection.camera_from_object)
                && distance <= frame.range + 4.0 * config.position_noise
                && detection.size.iter().all(|s| s.is_finite() && *s >= 0.0)
                && detection.score >= config.least_score
                && !detection.class.is_empty()
                && detection.class.len() < GREATEST_NAME - 20
        })
        .map(|detection| Sighting {
            detection,
            pose: frame.world_from_camera * detection.camera_from_object,
        })
        .collect();
    sightings.sort_by(|a, b| {
        let (p, q) = (a.pose.translation.vector, b.pose.translation.vector);
        p.x.total_cmp(&q.x)
            .then(p.y.total_cmp(&q.y))
            .then_with(|| a.detection.identity.cmp(&b.detection.identity))
            .then_with(|| a.detection.class.cmp(&b.detection.class))
    });
    sightings
}
