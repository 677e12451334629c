//! A camera of the network and the detectors behind it: what is in view, found with noise, missed
//! or imagined. Detections carry no identity of a person, and come in no order.

use super::Body;
use super::obstacles::{Obstacles, distance_to_segment};
use super::random::normal;
use crate::scenario::{Camera, Object};
use agents::messages::{CameraFrame, ObjectDetection, PersonDetection};
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};
use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Poisson};
use std::f64::consts::PI;

/// Everything one image shows.
pub(super) fn image(
    camera: &Camera,
    obstacles: &Obstacles,
    people: &[Body],
    random: &mut ChaCha8Rng,
    time: Time,
) -> CameraFrame {
    let mut found: Vec<PersonDetection> = Vec::new();
    for (index, person) in people.iter().enumerate() {
        let behind = |other: &Body| hides(camera, other, person.position);
        let others = people
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != index);
        let hidden = others.map(|(_, other)| other).any(behind);
        if in_view(camera, obstacles, person.position)
            && !hidden
            && !random.random_bool(camera.miss_rate)
        {
            found.push(person_seen(camera, person, random));
        }
    }
    let imagined = imagined(camera, random);
    for _ in 0..imagined {
        found.push(person_imagined(camera, random));
    }
    found.shuffle(random);
    let mut objects: Vec<ObjectDetection> = Vec::new();
    for object in &obstacles.objects {
        let at = Point2::from(object.pose.translation.vector);
        let hidden = people.iter().any(|person| hides(camera, person, at));
        if in_view(camera, obstacles, at) && !hidden && !random.random_bool(camera.miss_rate) {
            objects.push(object_seen(camera, object, random));
        }
    }
    CameraFrame {
        camera: camera.name.clone(),
        time,
        world_from_camera: camera.pose,
        field_of_view: camera.field_of_view,
        range: camera.range,
        people: found,
        objects,
    }
}

/// Whether a point is within the opening angle and the range, and no wall is before it.
fn in_view(camera: &Camera, obstacles: &Obstacles, point: Point2<f64>) -> bool {
    let local = camera.pose.inverse_transform_point(&point);
    let direction = local.y.atan2(local.x).abs();
    direction <= camera.field_of_view / 2.0
        && local.coords.norm() <= camera.range
        && obstacles.sees(camera.pose.translation.vector.into(), point)
}

/// Whether a body stands between the camera and a point. Whoever stands at the point itself (sits
/// on the seat, leans on the table) does not hide it.
fn hides(camera: &Camera, body: &Body, point: Point2<f64>) -> bool {
    let eye = Point2::from(camera.pose.translation.vector);
    let beside = (body.position - point).norm() <= body.radius;
    let nearer = (body.position - eye).norm() < (point - eye).norm();
    nearer && !beside && distance_to_segment(body.position, [eye, point]) < body.radius
}

fn noise(random: &mut ChaCha8Rng, deviation: f64) -> Vector2<f64> {
    let x = normal(random, deviation);
    Vector2::new(x, normal(random, deviation))
}

/// Confidence falls from 1 beside the camera to 0.6 at the end of its range.
fn score(camera: &Camera, distance: f64) -> f64 {
    1.0 - 0.4 * (distance / camera.range).min(1.0)
}

fn person_seen(camera: &Camera, person: &Body, random: &mut ChaCha8Rng) -> PersonDetection {
    let position = camera.pose.inverse_transform_point(&person.position);
    let heading = person.heading - camera.pose.rotation.angle();
    PersonDetection {
        position: position + noise(random, camera.position_noise),
        heading: Some(super::wrap(heading + normal(random, camera.heading_noise))),
        score: score(camera, position.coords.norm()),
        appearance: Vec::new(),
    }
}

fn object_seen(camera: &Camera, object: &Object, random: &mut ChaCha8Rng) -> ObjectDetection {
    let mut camera_from_object = camera.pose.inverse() * object.pose;
    camera_from_object.translation.vector += noise(random, camera.position_noise);
    let turn = normal(random, camera.heading_noise);
    camera_from_object *= Isometry2::rotation(turn);
    ObjectDetection {
        class: object.class.clone(),
        identity: object.marker.then(|| object.name.clone()),
        score: score(camera, camera_from_object.translation.vector.norm()),
        camera_from_object,
        size: object.size,
    }
}

/// How many people this image shows who are not there.
fn imagined(camera: &Camera, random: &mut ChaCha8Rng) -> usize {
    // Poisson refuses a mean of 0, which is a camera without false detections.
    Poisson::new(camera.false_rate / camera.rate).map_or(0, |count| {
        let n: f64 = count.sample(random);
        n as usize
    })
}

fn person_imagined(camera: &Camera, random: &mut ChaCha8Rng) -> PersonDetection {
    let half = camera.field_of_view / 2.0;
    let direction = random.random_range(-half..=half);
    // The square root spreads them evenly over the area.
    let distance = camera.range * random.random_range(0.0..1.0_f64).sqrt();
    PersonDetection {
        position: Point2::new(direction.cos() * distance, direction.sin() * distance),
        heading: Some(random.random_range(-PI..PI)),
        score: random.random_range(0.3..0.8),
        appearance: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::random::stream;

    fn camera() -> Camera {
        Camera {
            name: "eye".to_owned(),
            pose: Isometry2::new(Vector2::new(1.0, 1.0), PI / 2.0),
            field_of_view: PI / 2.0,
            range: 6.0,
            rate: 10.0,
            position_noise: 0.0,
            heading_noise: 0.0,
            miss_rate: 0.0,
            false_rate: 0.0,
            delay: 0.0,
            delay_jitter: 0.0,
        }
    }

    fn see(camera: &Camera, people: &[Body], walls: Vec<crate::scenario::Wall>) -> CameraFrame {
        let obstacles = Obstacles {
            walls,
            objects: Vec::new(),
        };
        image(
            camera,
            &obstacles,
            people,
            &mut stream(1, "camera/eye"),
            Time::default(),
        )
    }

    fn person(x: f64, y: f64) -> Body {
        Body::standing("ana", Point2::new(x, y), PI, 0.2)
    }

    #[test]
    fn a_person_ahead_is_found_in_the_cameras_frame() {
        let frame = see(&camera(), &[person(0.0, 4.0)], Vec::new());
        let seen = &frame.people[0];
        assert!(
            (seen.position - Point2::new(3.0, 1.0)).norm() < 1e-12,
            "{}",
            seen.position
        );
        assert!((seen.heading.expect("a heading") - PI / 2.0).abs() < 1e-12);
        let back = frame.world_from_camera * seen.position;
        assert!((back - Point2::new(0.0, 4.0)).norm() < 1e-12);
    }

    #[test]
    fn nobody_is_seen_outside_the_angle_beyond_the_range_or_behind_something() {
        for (x, y) in [(5.0, 2.0), (1.0, 7.5), (1.0, 0.0)] {
            assert!(
                see(&camera(), &[person(x, y)], Vec::new())
                    .people
                    .is_empty(),
                "{x} {y}"
            );
        }
        let wall = [Point2::new(0.0, 2.0), Point2::new(2.0, 2.0)];
        assert!(
            see(&camera(), &[person(1.0, 4.0)], vec![wall])
                .people
                .is_empty()
        );
        let queue = [person(1.0, 3.0), person(1.1, 5.0)];
        assert_eq!(
            see(&camera(), &queue, Vec::new()).people.len(),
            1,
            "the first hides the other"
        );
    }

    #[test]
    fn noise_misses_and_false_detections_come_at_the_stated_rates() {
        let camera = Camera {
            position_noise: 0.1,
            miss_rate: 0.3,
            false_rate: 2.0,
            ..camera()
        };
        let mut random = stream(5, "camera/eye");
        let obstacles = Obstacles {
            walls: Vec::new(),
            objects: Vec::new(),
        };
        let (mut hits, mut square, mut false_ones) = (0.0, 0.0, 0.0);
        for _ in 0..5000 {
            let people = [person(1.0, 4.0)];
            let frame = image(&camera, &obstacles, &people, &mut random, Time::default());
            for found in frame.people {
                if found.score > 0.8 - 1e-9 {
                    hits += 1.0;
                    square += (found.position - Point2::new(3.0, 0.0)).norm_squared();
                } else {
                    false_ones += 1.0;
                }
            }
        }
        assert!((hits / 5000.0 - 0.7_f64).abs() < 0.03, "{hits}");
        assert!(((square / hits / 2.0_f64).sqrt() - 0.1).abs() < 0.01);
        assert!((false_ones / 5000.0 - 0.2_f64).abs() < 0.03, "{false_ones}");
    }
}
