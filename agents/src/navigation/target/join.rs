//! Where to stand with several people, and before a thing. This file guarantees that a place offered with a
//! group lies outside the personal space of each of its members, and one before a thing off its outline.

use super::Destination;
use crate::navigation::people::{PERSONAL, Person};
use nalgebra::{Isometry2, Point2, Rotation2, Vector2, distance};
use std::f64::consts::{FRAC_PI_4, TAU};

/// Directions from the middle of a group in which places are looked for.
const DIRECTIONS: u32 = 24;
/// How much farther from the middle than its members, metres.
const FARTHER: [f64; 6] = [0.0, 0.2, 0.4, 0.7, 1.0, 1.5];
/// A member who does not see a place makes it as bad as so many metres more from the middle.
const UNSEEN: f64 = 0.5;
/// What a metre of the robot's way to a place counts beside one from the middle.
const WAY: f64 = 0.2;
/// Between the robot's surface and a thing's when it stands before it, metres.
const BEFORE: f64 = 0.35;

/// The middle of where people stand; `None` of nobody.
pub(super) fn middle<'a>(people: impl Iterator<Item = &'a Person>) -> Option<Point2<f64>> {
    let (sum, count) = people.fold((Vector2::zeros(), 0.0), |(sum, count), person| {
        (sum + person.position().coords, count + 1.0)
    });
    (count > 0.0).then(|| (sum / count).into())
}

/// Where to join `members`, the best place first: near their middle, seen by all of them, in the gap that
/// they leave (TD 5.5: facing them), and on the robot's side. None where they leave no room.
pub fn places_to_join(members: &[&Person], robot: Point2<f64>) -> Vec<Destination> {
    let Some(middle) = middle(members.iter().copied()) else {
        return Vec::new();
    };
    let reach = members
        .iter()
        .map(|person| distance(&person.position(), &middle))
        .fold(0.0, f64::max);
    let mut places = Vec::new();
    for far in FARTHER.map(|farther| reach + farther) {
        for k in 0..DIRECTIONS {
            let direction = Rotation2::new(TAU * f64::from(k) / f64::from(DIRECTIONS));
            let point = middle + direction * Vector2::new(far, 0.0);
            let now = || members.iter().map(|person| person.predicted(0.0));
            if now().any(|person| person.squared_deviation(point) < PERSONAL) {
                continue;
            }
            let blind = |person: &crate::navigation::people::Presence| {
                (point - person.position).dot(&person.facing) < 0.0
            };
            let unseen = now().filter(blind).count() as f64;
            let cost = far + UNSEEN * unseen + WAY * distance(&point, &robot);
            let back = middle - point;
            let heading = Some(back.y.atan2(back.x));
            places.push((cost, Destination { point, heading }));
        }
    }
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    places.into_iter().map(|(_, place)| place).collect()
}

/// Where to stand before a thing of this `size` along its own x and y, for a robot of that `radius`: at its
/// front, which looks along its x, else ever more round it; facing it.
pub fn places_before(
    world_from_thing: &Isometry2<f64>,
    size: Vector2<f64>,
    radius: f64,
) -> Vec<Destination> {
    let half = size / 2.0;
    let turns = [0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 4.0].map(|turn| turn * FRAC_PI_4);
    let place = |turn: f64| {
        let way = Rotation2::new(turn) * Vector2::x();
        let to_edge = |half: f64, part: f64| half / part.abs().max(1e-9);
        let edge = to_edge(half.x, way.x).min(to_edge(half.y, way.y));
        let point = world_from_thing * Point2::from(way * (edge + radius + BEFORE));
        let back = world_from_thing.translation.vector - point.coords;
        Destination {
            point,
            heading: Some(back.y.atan2(back.x)),
        }
    };
    turns.map(place).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn person(x: f64, y: f64, heading: f64) -> Person {
        Person {
            name: format!("{x} {y}"),
            world_from_person: Isometry2::new(Vector2::new(x, y), heading),
            velocity: Vector2::zeros(),
            radius: 0.25,
        }
    }

    #[test]
    fn two_who_talk_are_joined_beside_both_on_the_robots_side() {
        let people = [person(2.4, 3.0, 0.0), person(3.6, 3.0, PI)];
        let members: Vec<&Person> = people.iter().collect();
        for (robot, side) in [(Point2::new(3.0, 0.0), -1.0), (Point2::new(3.0, 6.0), 1.0)] {
            let places = places_to_join(&members, robot);
            let best = places[0];
            assert!((best.point.x - 3.0).abs() < 0.3, "{}", best.point);
            assert!((best.point.y - 3.0) * side > 0.7 && (best.point.y - 3.0) * side < 1.3);
            let toward = best.heading.unwrap() + side * FRAC_PI_2;
            assert!(toward.abs() < 0.4, "{toward}");
            for place in &places {
                let mut now = people.iter().map(|p| p.predicted(0.0));
                assert!(now.all(|p| p.squared_deviation(place.point) >= PERSONAL));
            }
        }
        assert!(places_to_join(&[], Point2::origin()).is_empty());
    }

    #[test]
    fn three_in_a_ring_are_joined_in_the_gap() {
        let at = |angle: f64| person(angle.cos(), angle.sin(), angle + PI);
        let people = [at(0.5 * PI), at(PI), at(1.5 * PI)];
        let members: Vec<&Person> = people.iter().collect();
        let best = places_to_join(&members, Point2::new(6.0, 0.0))[0];
        assert!(
            best.point.x > 0.5 && best.point.y.abs() < 0.4,
            "{}",
            best.point
        );
    }

    #[test]
    fn a_thing_is_faced_from_its_front_first_and_off_its_outline() {
        let pose = Isometry2::new(Vector2::new(4.0, 5.0), -FRAC_PI_2);
        let places = places_before(&pose, Vector2::new(0.2, 1.6), 0.25);
        assert!((places[0].point - Point2::new(4.0, 4.3)).norm() < 1e-9);
        assert!((places[0].heading.unwrap() - FRAC_PI_2).abs() < 1e-9);
        for place in &places {
            let own = pose.inverse_transform_point(&place.point);
            let gap = (own.x.abs() - 0.1).max(own.y.abs() - 0.8);
            assert!(gap > 0.4 * 0.6, "{own}");
        }
    }
}
