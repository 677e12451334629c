//! Cameras that err, for the tests: noise, misses and false detections drawn from a seed.

use super::{FloorPlan, difference, sees};
use crate::messages::{CameraFrame, ObjectDetection, PersonDetection};
use dsr::Time;
use nalgebra::{Isometry2, Point2, UnitComplex, Vector2};
use std::f64::consts::TAU;

/// A small linear congruential generator (Knuth's MMIX constants), the high bits used.
#[derive(Debug)]
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// In [0, 1).
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Normal with mean 0 and deviation 1.
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (TAU * self.uniform()).cos()
    }
}

/// How cameras err.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Errors {
    pub(crate) position: f64,
    pub(crate) heading: f64,
    pub(crate) miss: f64,
    /// False detections per second and camera.
    pub(crate) clutter: f64,
}

/// The errors that issue bars are stated for: 0.1 m, 10 % misses, 1 false detection a second.
pub(crate) const USUAL: Errors = Errors {
    position: 0.1,
    heading: 0.15,
    miss: 0.1,
    clutter: 1.0,
};

/// An empty frame of a camera at (x, y) that looks along `heading`.
pub(crate) fn camera(
    name: &str,
    x: f64,
    y: f64,
    heading: f64,
    view: f64,
    range: f64,
) -> CameraFrame {
    CameraFrame {
        camera: name.to_owned(),
        time: Time::default(),
        world_from_camera: Isometry2::new(Vector2::new(x, y), heading),
        field_of_view: view,
        range,
        people: Vec::new(),
        objects: Vec::new(),
    }
}

/// What `camera` shows of `people` (poses in the world) at `time`, `period` seconds after its last
/// frame.
pub(crate) fn look(
    camera: &CameraFrame,
    time: Time,
    period: f64,
    people: &[Isometry2<f64>],
    plan: &FloorPlan,
    errors: Errors,
    random: &mut Random,
) -> CameraFrame {
    let mut frame = CameraFrame {
        time,
        ..camera.clone()
    };
    for person in people {
        let place = Point2::from(person.translation.vector);
        if sees(camera, plan, place, 0.0) && random.uniform() >= errors.miss {
            let local = camera.world_from_camera.inverse() * person;
            let noise = Vector2::new(random.normal(), random.normal()) * errors.position;
            frame.people.push(PersonDetection {
                position: Point2::from(local.translation.vector + noise),
                heading: Some(local.rotation.angle() + random.normal() * errors.heading),
                score: 0.9,
            });
        }
    }
    if random.uniform() < errors.clutter * period {
        let (distance, angle) = somewhere(camera, random);
        frame.people.push(PersonDetection {
            position: Point2::new(distance * angle.cos(), distance * angle.sin()),
            heading: Some(difference(random.uniform() * TAU, 0.0)),
            score: 0.6,
        });
    }
    frame
}

/// A place evenly spread over the view: distance and direction.
fn somewhere(camera: &CameraFrame, random: &mut Random) -> (f64, f64) {
    let distance = camera.range * random.uniform().sqrt();
    (distance, (random.uniform() - 0.5) * camera.field_of_view)
}

/// An object as it truly is.
#[derive(Debug, Clone)]
pub(crate) struct Thing {
    pub(crate) class: &'static str,
    pub(crate) identity: Option<&'static str>,
    pub(crate) pose: Isometry2<f64>,
    pub(crate) size: Vector2<f64>,
}

impl Thing {
    /// The detection of it without any error.
    pub(crate) fn detection(&self, frame: &CameraFrame) -> ObjectDetection {
        ObjectDetection {
            class: self.class.to_owned(),
            identity: self.identity.map(str::to_owned),
            camera_from_object: frame.world_from_camera.inverse() * self.pose,
            size: self.size,
            score: 0.9,
        }
    }
}

/// Adds what `frame`'s camera shows of `things`; false detections have one of their classes.
pub(crate) fn look_at_things(
    frame: &mut CameraFrame,
    period: f64,
    things: &[Thing],
    plan: &FloorPlan,
    errors: Errors,
    random: &mut Random,
) {
    for thing in things {
        let place = Point2::from(thing.pose.translation.vector);
        if sees(frame, plan, place, 0.0) && random.uniform() >= errors.miss {
            let mut detection = thing.detection(frame);
            let noise = Vector2::new(random.normal(), random.normal()) * errors.position;
            let turn = UnitComplex::new(random.normal() * errors.heading);
            let local = &mut detection.camera_from_object;
            local.translation.vector += noise;
            local.rotation = turn * local.rotation;
            frame.objects.push(detection);
        }
    }
    if !things.is_empty() && random.uniform() < errors.clutter * period {
        let (distance, angle) = somewhere(frame, random);
        let like = &things[(random.uniform() * things.len() as f64) as usize];
        let place = Vector2::new(distance * angle.cos(), distance * angle.sin());
        frame.objects.push(ObjectDetection {
            class: like.class.to_owned(),
            identity: None,
            camera_from_object: Isometry2::new(place, random.uniform() * TAU),
            size: like.size,
            score: 0.6,
        });
    }
}
