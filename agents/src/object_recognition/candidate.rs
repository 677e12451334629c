//! One object, and the evidence for and against it standing where it is believed to.

use super::config::Config;
use super::memory::Memory;
use super::place::Place;
use super::{RecognizedObject, Sighting};
use dsr::Time;
use nalgebra::Vector2;

/// A possible object.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    /// Its identity, or once confirmed its class and number.
    pub(super) name: Option<String>,
    /// Whether the evidence was enough to report it.
    pub(super) confirmed: bool,
    pub(super) identified: bool,
    pub(super) class: String,
    pub(super) place: Place,
    pub(super) size: Vector2<f64>,
    pub(super) hits: u32,
    pub(super) born: Time,
    pub(super) last_seen: Time,
    /// The number of the frame that last showed it.
    pub(super) last_frame: u64,
    /// Newest look in bit 0: 1 a hit, 0 a miss.
    pub(super) looks: u32,
    /// Looks in a row that should have shown it and did not.
    pub(super) misses: u32,
    /// Until when misses have been held against it.
    pub(super) missed_until: Time,
    pub(super) existence: f64,
    pub(super) room: Option<String>,
    /// Where else it may be.
    pub(super) memory: Memory,
}

/// How much a size changes with one more sighting, once it is the mean of as many as this inverts.
const SIZE_GAIN: f64 = 0.05;

impl Candidate {
    /// An object known from before.
    pub(super) fn resumed(object: &RecognizedObject, config: &Config) -> Self {
        Self {
            name: Some(object.name.clone()),
            identified: object.identified,
            confirmed: true,
            class: object.class.clone(),
            place: Place::settled(object.last_seen, object.pose, config),
            size: object.size,
            hits: config.confirmation_hits,
            born: object.last_seen,
            last_seen: object.last_seen,
            last_frame: 0,
            looks: 0,
            misses: 0,
            missed_until: object.last_seen,
            existence: object.confidence.clamp(0.01, 0.999),
            room: object.in_room.clone(),
            memory: Memory::resumed(object.places.clone(), object.remembered, object.stay),
        }
    }

    /// One that `sighting` may show.
    pub(super) fn new(time: Time, sighting: &Sighting, frame: u64, config: &Config) -> Self {
        Self {
            name: sighting.identity().map(str::to_owned),
            identified: sighting.identity().is_some(),
            confirmed: false,
            class: sighting.detection.class.clone(),
            place: Place::new(time, sighting.pose, config),
            size: sighting.detection.size,
            hits: 1,
            born: time,
            last_seen: time,
            last_frame: frame,
            looks: 1,
            misses: 0,
            missed_until: time,
            existence: 0.5,
            room: None,
            memory: Memory::default(),
        }
    }

    /// Takes in a sighting that frame number `frame` showed.
    pub(super) fn hit(&mut self, time: Time, sighting: &Sighting, frame: u64, config: &Config) {
        self.place.update(time, sighting.pose, config);
        if self.confirmed {
            self.remember(time, sighting, config);
        }
        self.hits = self.hits.saturating_add(1);
        let gain = (1.0 / f64::from(self.hits)).max(SIZE_GAIN);
        self.size += (sighting.detection.size - self.size) * gain;
        self.last_seen = self.last_seen.max(time);
        self.last_frame = frame;
        self.looks = self.looks << 1 | 1;
        self.misses = 0;
        self.missed_until = self.last_seen;
        let present = self.existence * config.detection_probability;
        let chance = config.false_probability * (1.0 - self.existence);
        self.existence = (present / (present + chance)).min(0.999);
    }

    /// Notes where it was seen: at its place, or where it seems to be instead.
    fn remember(&mut self, time: Time, sighting: &Sighting, config: &Config) {
        let settled = self.place.pose();
        let apart = settled.translation.vector - sighting.pose.translation.vector;
        let same = apart.norm() <= config.memory.same_place;
        let pose = if same { settled } else { sighting.pose };
        self.memory.saw(time, pose, &config.memory);
    }

    /// A camera looked and did not see it. Looks in quick succession fail for the same reason, so
    /// they count once.
    pub(super) fn missed(&mut self, time: Time, config: &Config) {
        self.looks <<= 1;
        self.misses = self.misses.saturating_add(1);
        if time.since(self.missed_until) < config.look_period {
            return;
        }
        self.missed_until = time;
        let present = self.existence * (1.0 - config.detection_probability);
        let absent = (1.0 - config.false_probability) * (1.0 - self.existence);
        self.existence = present / (present + absent);
        if self.identified {
            self.existence = self.existence.max(config.identity_confidence);
        }
    }

    /// Whether the evidence is enough to report it.
    pub(super) fn is_ready(&self, config: &Config) -> bool {
        let considered = config.confirmation_looks.clamp(1, 32);
        let hits = (self.looks & (u32::MAX >> (32 - considered))).count_ones();
        let wanted = if self.identified {
            config.identified_hits
        } else {
            config.confirmation_hits
        };
        hits >= wanted
    }

    /// Whether it has been disproved; an object known by identity is always somewhere.
    pub(super) fn is_dead(&self, config: &Config) -> bool {
        !(self.identified && self.confirmed) && self.existence < config.least_confidence
    }

    /// What is believed of it, once confirmed.
    pub(super) fn recognized(&self) -> Option<RecognizedObject> {
        let name = self.name.clone().filter(|_| self.confirmed)?;
        Some(RecognizedObject {
            name,
            identified: self.identified,
            class: self.class.clone(),
            pose: self.place.pose(),
            size: self.size,
            confidence: self.existence,
            last_seen: self.last_seen,
            in_room: self.room.clone(),
            places: self.memory.ranked(),
            remembered: self.memory.time().unwrap_or(self.last_seen),
            stay: self.memory.learned_stay(),
        })
    }
}
