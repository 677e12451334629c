//! Where schedules put people at a time, were nobody in anybody's way. It is a function of the scenario and the time
//! alone: the simulated world differs from it by what people do about each other and the robot.

use super::obstacles::Obstacles;
use super::route::FloorPlan;
use crate::scenario::{Begin, Face, Person, Scenario};
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};

/// No entry of a schedule takes less, s: the world looks at schedules this often.
const LEAST: f64 = 0.05;

/// A person at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whereabouts {
    /// Where the person is, and faces.
    pub pose: Isometry2<f64>,
    /// How the person walks, m/s.
    pub velocity: Vector2<f64>,
}

/// Where each of the scenario's people is at `now`, `None` for who has left; at the start and before it, where they are then.
pub fn whereabouts(scenario: &Scenario, now: Time) -> Vec<Option<Whereabouts>> {
    let obstacles = Obstacles {
        walls: scenario.walls.clone(),
        objects: scenario.objects.clone(),
    };
    let plan = FloorPlan::new(scenario.bounds, &obstacles);
    let people = scenario.people.iter();
    let found: Vec<_> = people
        .map(|person| follow(person, scenario.start, now, &plan))
        .collect();
    let turned = |one: &Followed| {
        let direction = match &one.face {
            None => None,
            Some(Face::Heading(heading)) => Some(Vector2::new(heading.cos(), heading.sin())),
            Some(Face::Point(point)) => Some(point - one.position),
            Some(Face::Person(index)) => found
                .get(*index)
                .and_then(Option::as_ref)
                .map(|other| other.position - one.position),
        };
        let direction = direction.filter(|direction| direction.norm() > 1e-6);
        let heading = direction.map_or(one.heading, |d| d.y.atan2(d.x));
        Whereabouts {
            pose: Isometry2::new(one.position.coords, heading),
            velocity: one.velocity,
        }
    };
    found.iter().map(|one| one.as_ref().map(turned)).collect()
}

/// From where, and the corners from there on.
type Way = (Point2<f64>, Vec<Point2<f64>>);

struct Followed {
    position: Point2<f64>,
    heading: f64,
    velocity: Vector2<f64>,
    /// Where somebody who stands looks.
    face: Option<Face>,
}

/// Goes through a schedule until `now`.
fn follow(person: &Person, start: Time, now: Time, plan: &FloorPlan) -> Option<Followed> {
    let mut one = Followed {
        position: person.pose.translation.vector.into(),
        heading: person.pose.rotation.angle(),
        velocity: Vector2::zeros(),
        face: None,
    };
    let mut done = start;
    // Those who begin again go the same ways again.
    let mut ways: Vec<Option<Way>> = vec![None; person.schedule.len()];
    loop {
        for (entry, way) in person.schedule.iter().zip(&mut ways) {
            let begin = match entry.begin {
                Begin::At(time) => time.max(done),
                Begin::After(seconds) => done + seconds,
            };
            if begin >= now {
                return Some(one);
            }
            if entry.go.is_some() || entry.face.is_some() {
                one.face.clone_from(&entry.face);
            }
            done = begin + LEAST;
            if let Some(goal) = entry.go {
                let known = way.take().filter(|(from, _)| *from == one.position);
                let (_, corners) = way.insert(
                    known.unwrap_or_else(|| (one.position, plan.route(one.position, goal))),
                );
                done = done.max(one.walk(corners, person.speed, begin, now));
                if one.velocity != Vector2::zeros() {
                    return Some(one);
                }
            }
            if entry.leave && done <= now {
                return None;
            }
        }
        if !person.repeat || person.schedule.is_empty() {
            return Some(one);
        }
    }
}

impl Followed {
    /// Walks past the corners as far as one comes from `begin` until `now`, and says when the last is reached.
    fn walk(&mut self, corners: &[Point2<f64>], speed: f64, begin: Time, now: Time) -> Time {
        let mut at = begin;
        for corner in corners {
            let way = corner - self.position;
            if way.norm() < 1e-9 {
                continue;
            }
            let arrival = at + way.norm() / speed;
            self.heading = way.y.atan2(way.x);
            if arrival > now {
                self.velocity = way.normalize() * speed;
                self.position += self.velocity * now.since(at);
                return arrival;
            }
            (self.position, at) = (*corner, arrival);
        }
        at
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::scenario;
    use super::*;
    use crate::scenario::Entry;
    use crate::world::{Inputs, World};

    #[test]
    fn who_is_in_nobodys_way_is_where_the_simulated_world_has_them() {
        let scenario = scenario();
        let mut world = World::new(&scenario, 1, None);
        for step in 1..=400 {
            let truth = world.step(0.05, &Inputs::default()).truth;
            let expected = whereabouts(&scenario, truth.time);
            assert_eq!(truth.people.len(), expected.len());
            for (body, one) in truth.people.iter().zip(expected) {
                let one = one.unwrap();
                let apart = (body.position.coords - one.pose.translation.vector).norm();
                // Corners are cut, and the last step is as short as it needs to be.
                assert!(apart < 0.5, "{step}: {} is {apart} m away", body.name);
                if step == 400 {
                    let turned = body.heading - one.pose.rotation.angle();
                    assert!(apart < 0.1 && turned.sin().abs() < 0.05, "{turned}");
                }
            }
        }
    }

    #[test]
    fn at_the_start_and_before_it_people_are_where_they_start_and_who_leaves_is_gone() {
        let mut scenario = scenario();
        for early in [0.0, -3600.0] {
            let found = whereabouts(&scenario, scenario.start + early);
            for (person, one) in scenario.people.iter().zip(found) {
                assert_eq!(one.unwrap().pose, person.pose);
            }
        }
        scenario.people[1].schedule[0].leave = true;
        let found = whereabouts(&scenario, scenario.start + 60.0);
        assert!(found[0].is_some() && found[1].is_none());
        let found = whereabouts(&scenario, scenario.start + 3.0);
        assert!(found[1].is_some_and(|one| one.velocity.norm() > 0.5));
    }

    #[test]
    fn who_begins_again_at_once_is_somewhere_all_the_same() {
        let mut scenario = scenario();
        scenario.people[0].repeat = true;
        scenario.people[0].schedule = vec![Entry {
            begin: Begin::After(0.0),
            go: None,
            face: Some(Face::Heading(1.0)),
            leave: false,
        }];
        let found = whereabouts(&scenario, scenario.start + 3600.0);
        assert!((found[0].unwrap().pose.rotation.angle() - 1.0).abs() < 1e-9);
    }
}
