//! Human observer: detections of a camera network to tracked people and how they relate.
//!
//! A constant-velocity Kalman filter per person, gating, globally optimal assignment (confirmed
//! people first, so that a false start never takes a detection from somebody known), birth and death
//! by evidence, and identities handed on when somebody is lost and found. Guarantees that a number
//! given to a person is never given to another, and that the same frames in any order within one
//! call give the same scene to the bit.

mod appearance;
mod config;
mod graph;
mod identity;
mod nearest;
mod relations;
mod scene;
mod track;

#[cfg(test)]
mod tests;

pub use config::{Appearances, Association, Config, Nearest, Thresholds, Tracking};
pub use graph::{HumanObserver, SETTINGS, people, person_id, person_name, surroundings};
pub use scene::{Object, Scene, Shape, Surroundings, TrackedPerson};

use crate::messages::CameraFrame;
use crate::perception::{FloorPlan, Pair, assign, hides, in_time_order, is_finite_pose, sees};
use appearance::{Appearance, Gallery};
use dsr::Time;
use nalgebra::Point2;
use relations::Relations;
use std::collections::BTreeMap;
use track::{Sighting, Track};

/// Tracks people from the frames of several cameras.
#[derive(Debug)]
pub struct Observer {
    config: Tracking,
    tracks: Vec<Track>,
    relations: Relations,
    next_id: u64,
    frame: u64,
    /// The time of the newest frame taken in.
    clock: Option<Time>,
    /// The time of each camera's newest frame.
    cameras: BTreeMap<String, Time>,
    /// Pairs of people who may be one.
    suspects: BTreeMap<(u64, u64), identity::Suspicion>,
    /// Those whose tracks are over.
    gallery: Gallery,
    refused: Refused,
}

/// What was refused since the beginning, and why.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Refused {
    /// Frames too far behind the newest one.
    pub late_frames: u64,
    /// Frames not newer than the last one of the same camera.
    pub repeated_frames: u64,
    /// Frames from the future, or with a pose, range or angle that is no number.
    pub absurd_frames: u64,
    /// Detections that are no number or lie out of their camera's range.
    pub absurd_detections: u64,
    /// Looks that give no direction; the detections themselves count.
    pub absurd_appearances: u64,
}

/// A camera's clock may run ahead of ours by this much, s.
const GREATEST_LEAD: f64 = 0.1;

impl Observer {
    /// An observer that knows nobody.
    pub fn new(config: Config) -> Self {
        Self {
            config: config.tracking,
            tracks: Vec::new(),
            relations: Relations::new(config.relations),
            next_id: 1,
            frame: 0,
            clock: None,
            cameras: BTreeMap::new(),
            suspects: BTreeMap::new(),
            gallery: Gallery::default(),
            refused: Refused::default(),
        }
    }

    /// Takes over a person known from before, as a restarted observer does. New people get larger
    /// numbers. A number that is tracked already is left as it is.
    pub fn adopt(&mut self, person: &TrackedPerson) {
        self.next_id = self.next_id.max(person.id + 1);
        let known = self.tracks.iter().any(|t| t.id == Some(person.id));
        if !known && is_finite_pose(&person.pose) && person.velocity.norm().is_finite() {
            self.tracks.push(Track::resumed(person, &self.config));
        }
    }

    /// What was refused so far.
    pub fn refused(&self) -> Refused {
        self.refused
    }

    /// Takes in `frames` and says who is there at `now`.
    ///
    /// Frames may come in any order; they are taken in by time, then by the camera's name. Late ones
    /// are measured against where people were then, up to the configured delay.
    pub fn observe(
        &mut self,
        now: Time,
        frames: &[CameraFrame],
        surroundings: &Surroundings,
    ) -> Scene {
        for frame in in_time_order(frames) {
            if self.accepts(now, frame) {
                self.take_in(frame, &surroundings.plan);
            }
        }
        self.bury(now);
        let config = &self.config;
        let mut people: Vec<TrackedPerson> = self
            .tracks
            .iter()
            .filter_map(|track| track.person(now, config))
            .collect();
        people.sort_by_key(|person| person.id);
        self.relations.relate(now, people, surroundings)
    }

    /// Whether the frame can be taken in; counts it where not.
    fn accepts(&mut self, now: Time, frame: &CameraFrame) -> bool {
        let sane = is_finite_pose(&frame.world_from_camera)
            && frame.range.is_finite()
            && frame.field_of_view.is_finite()
            && frame.time.since(now) <= GREATEST_LEAD;
        let repeated = self
            .cameras
            .get(&frame.camera)
            .is_some_and(|last| frame.time <= *last);
        let late = self
            .clock
            .is_some_and(|clock| clock.since(frame.time) > self.config.greatest_delay);
        if !sane {
            self.refused.absurd_frames += 1;
        } else if repeated {
            self.refused.repeated_frames += 1;
        } else if late {
            self.refused.late_frames += 1;
        }
        sane && !repeated && !late
    }

    fn take_in(&mut self, frame: &CameraFrame, plan: &FloorPlan) {
        self.frame += 1;
        let before = self.cameras.insert(frame.camera.clone(), frame.time);
        let since = before.map_or(0.0, |before| frame.time.since(before));
        self.clock = Some(self.clock.map_or(frame.time, |clock| clock.max(frame.time)));
        let sightings = self.sightings(frame);
        for track in &mut self.tracks {
            track.predict(frame.time, &self.config);
        }
        if self.config.association == Association::Nearest {
            self.take_nearest(&sightings);
            self.bury(frame.time);
            return;
        }
        let mut free: Vec<usize> = (0..sightings.len()).collect();
        for confirmed in [true, false] {
            self.associate(frame.time, &sightings, &mut free, confirmed);
        }
        self.count_misses(frame, since, &sightings, plan);
        let newborn = free
            .iter()
            .map(|&index| Track::new(&sightings[index], self.frame, &self.config));
        self.tracks.extend(newborn);
        self.confirm(plan);
        self.bury(frame.time);
        self.merge(frame.time);
    }

    /// Forgets those for whom the evidence has run out at `now`.
    fn bury(&mut self, now: Time) {
        let config = &self.config;
        let gallery = &mut self.gallery;
        self.tracks.retain(|track| match config.association {
            Association::Evidence => {
                let dead = track.is_dead(now, config);
                if dead && let (Some(id), Some(looks)) = (track.id, &track.appearance) {
                    let (time, place) = (track.last_seen, track.last_place());
                    gallery.remember(id, looks.clone(), time, place, &config.appearance);
                }
                !dead
            }
            Association::Nearest => !nearest::is_dead(track, now, &config.nearest),
        });
    }

    /// The frame's usable detections in the world frame, in order of x.
    fn sightings(&mut self, frame: &CameraFrame) -> Vec<Sighting> {
        let reach = frame.range + 4.0 * self.config.position_noise;
        let turn = frame.world_from_camera.rotation.angle();
        let mut sightings = Vec::with_capacity(frame.people.len());
        for person in &frame.people {
            let distance = person.position.coords.norm();
            let sane = distance <= reach
                && person.score.is_finite()
                && person.heading.is_none_or(f64::is_finite);
            if !sane {
                self.refused.absurd_detections += 1;
            } else if person.score >= self.config.least_score {
                let appearance = Appearance::of(&person.appearance);
                let absurd = appearance.is_none() && !person.appearance.is_empty();
                self.refused.absurd_appearances += u64::from(absurd);
                sightings.push(Sighting {
                    appearance,
                    time: frame.time,
                    position: frame.world_from_camera * person.position,
                    heading: person.heading.map(|heading| heading + turn),
                    score: person.score,
                });
            }
        }
        sightings.sort_by(|a, b| {
            let by_place = a.position.x.total_cmp(&b.position.x);
            by_place.then(a.position.y.total_cmp(&b.position.y))
        });
        sightings
    }

    /// Gives the `free` sightings (indices, in order of x) to the confirmed or the unconfirmed
    /// tracks, and leaves in it those that nobody took.
    fn associate(
        &mut self,
        frame_time: Time,
        sightings: &[Sighting],
        free: &mut Vec<usize>,
        confirmed: bool,
    ) {
        let config = &self.config;
        let greatest_cost = config.greatest_cost();
        let mut pairs = Vec::new();
        for (row, track) in self.tracks.iter().enumerate() {
            if track.id.is_some() != confirmed || track.is_lost(frame_time, config) {
                continue;
            }
            let reach = track.reach(frame_time, config);
            let x = track.position().x;
            let first = free.partition_point(|&i| sightings[i].position.x < x - reach);
            let candidates = free[first..].iter().enumerate();
            for (offset, &index) in candidates {
                if sightings[index].position.x > x + reach {
                    break;
                }
                let Some(innovation) = track.innovation(&sightings[index], config) else {
                    continue;
                };
                if innovation.distance() <= config.gate {
                    let benefit = greatest_cost - innovation.cost();
                    pairs.push(Pair {
                        row,
                        column: first + offset,
                        benefit,
                    });
                }
            }
        }
        let mut taken = vec![false; free.len()];
        for (row, column) in assign(self.tracks.len(), free.len(), &pairs) {
            let (track, sighting) = (&mut self.tracks[row], &sightings[free[column]]);
            if let Some(innovation) = track.innovation(sighting, config) {
                track.hit(sighting, &innovation, self.frame, config);
                taken[column] = true;
            }
        }
        let mut taken = taken.into_iter();
        free.retain(|_| taken.next() == Some(false));
    }

    /// Holds it against those the camera had to see and did not. Hidden behind a body is not had to:
    /// one that this frame shows, or one that it missed as well.
    /// `since` is the time from the camera's frame before, s.
    fn count_misses(
        &mut self,
        frame: &CameraFrame,
        since: f64,
        sightings: &[Sighting],
        plan: &FloorPlan,
    ) {
        let camera = Point2::from(frame.world_from_camera.translation.vector);
        let config = &self.config;
        let bodies: Vec<Point2<f64>> = sightings
            .iter()
            .map(|sighting| sighting.position)
            .chain(
                self.tracks
                    .iter()
                    .filter(|t| t.is_followed(config))
                    .map(Track::position),
            )
            .collect();
        for track in &mut self.tracks {
            if track.last_frame == self.frame {
                continue;
            }
            let place = track.position();
            let visible = sees(frame, plan, place, config.view_margin)
                && !bodies
                    .iter()
                    .any(|&body| hides(camera, body, place, config.body_radius));
            if visible {
                track.missed(frame.time, since, config);
            }
        }
    }
}
