//! The steps that are about somebody and not about a place: asking them, waiting for them, letting them pass.
//! This file owns when each is done, and guarantees that none of them lasts for ever.

use super::read::World;
use super::{Messages, Navigation, Progress, inputs};
use crate::messages::Speech;
use crate::navigation::control::wrapped;
use crate::navigation::navigator::{Failure, Output};
use crate::navigation::people::Person;
use crate::navigation::target::{Region, Target};
use dsr::Time;
use nalgebra::{Point2, Vector2, distance};
use std::f64::consts::FRAC_PI_4;

/// How often the robot asks, seconds.
const REPEAT: f64 = 3.0;
/// For how long it asks, and stands for somebody who comes or passes, seconds.
pub(super) const ASKING: f64 = 60.0;
const STANDING: f64 = 120.0;
/// A person faces the robot when it lies within this of where they look, radians.
const FACING: f64 = FRAC_PI_4;
/// The robot steps this far aside at most to let somebody pass, in such steps, metres.
const ASIDE: f64 = 1.2;
const STEP: f64 = 0.2;
/// Who is so far beyond the robot has passed, metres.
const PASSED: f64 = 0.5;

fn robot(messages: &Messages) -> Option<Point2<f64>> {
    let odometry = messages.odometry?;
    Some(odometry.world_from_robot.translation.vector.into())
}

impl Navigation {
    /// Turns to a person and asks, until they look at the robot.
    pub(super) fn ask(
        &mut self,
        (name, words): (&str, &str),
        now: Time,
        messages: &Messages,
        world: &World,
        speech: &mut Option<Speech>,
    ) -> (Output, Progress) {
        let person = world.people.iter().find(|person| person.name == name);
        let toward = person.map(Person::position);
        let output = self
            .navigator
            .face(now, &inputs(messages, world, None), toward);
        let (Some(attempt), Some(robot)) = (&mut self.attempt, robot(messages)) else {
            return (output, Progress::UnderWay);
        };
        if now.since(attempt.began) > ASKING {
            let failure = person.map_or_else(
                || Failure::PersonUnseen.to_string(),
                |person| format!("{} did not turn to the robot", person.name),
            );
            return (output, Progress::Failed(failure));
        }
        let Some(person) = person else {
            return (output, Progress::UnderWay);
        };
        let way = robot - person.position();
        let heading = person.world_from_person.rotation.angle();
        if wrapped(way.y.atan2(way.x) - heading).abs() <= FACING {
            return (output, Progress::Done);
        }
        if attempt.asked.is_none_or(|asked| now.since(asked) >= REPEAT) {
            attempt.asked = Some(now);
            *speech = Some(Speech {
                time: now,
                toward: person.position(),
                text: words.to_owned(),
            });
        }
        (output, Progress::UnderWay)
    }

    /// Stands, turned to a person, until they are in the robot's room.
    pub(super) fn wait(
        &mut self,
        name: &str,
        now: Time,
        messages: &Messages,
        world: &World,
    ) -> (Output, Progress) {
        let person = world.people.iter().find(|person| person.name == name);
        let toward = person.map(Person::position);
        let output = self
            .navigator
            .face(now, &inputs(messages, world, None), toward);
        let room = world
            .rooms
            .iter()
            .find(|room| Some(room.id) == world.robot.room && room.polygon.len() >= 3);
        let inside = |person: &Person| {
            room.is_some_and(|room| Region::new(&room.polygon).depth(person.position()) > 0.0)
        };
        if person.is_some_and(inside) {
            return (output, Progress::Done);
        }
        (output, self.patience(now, &format!("{name} did not come")))
    }

    /// Drives out of a person's way, as far as there is room, and stands until they are past.
    pub(super) fn let_pass(
        &mut self,
        name: &str,
        now: Time,
        messages: &Messages,
        world: &World,
    ) -> (Output, Progress) {
        let person = world.people.iter().find(|person| person.name == name);
        let (Some(person), Some(robot)) = (person, robot(messages)) else {
            let output = self.navigator.step(now, &inputs(messages, world, None));
            return (output, self.patience(now, "nobody has been in sight"));
        };
        let walks = person.velocity.try_normalize(1e-3);
        let beyond = walks.map(|ahead| (person.position() - robot).dot(&ahead));
        if beyond.is_some_and(|beyond| beyond > PASSED) {
            let output = self.navigator.step(now, &inputs(messages, world, None));
            return (output, Progress::Done);
        }
        let aside = self.attempt.as_ref().and_then(|attempt| attempt.aside);
        let aside = aside.or_else(|| {
            let ahead = walks.filter(|_| person.is_walking())?;
            let place = aside_of(person.position(), ahead, robot, messages);
            if let Some(attempt) = &mut self.attempt {
                attempt.aside = Some(place);
            }
            Some(place)
        });
        let Some(place) = aside else {
            let toward = Some(person.position());
            let inputs = inputs(messages, world, None);
            let output = self.navigator.face(now, &inputs, toward);
            return (output, self.patience(now, &format!("{name} did not pass")));
        };
        // Whether it got there or there was no way: it stands, and the person passes.
        let (output, _) = self.drive(&Target::Point(place), now, messages, world);
        (output, self.patience(now, &format!("{name} did not pass")))
    }

    fn patience(&self, now: Time, reason: &str) -> Progress {
        let began = self.attempt.as_ref().map_or(now, |attempt| attempt.began);
        if now.since(began) > STANDING {
            Progress::Failed(reason.to_owned())
        } else {
            Progress::UnderWay
        }
    }
}

/// The place beside the robot that is farthest from the line on which a person walks, of those that the
/// robot can be at with nothing blocked between.
fn aside_of(
    person: Point2<f64>,
    ahead: Vector2<f64>,
    robot: Point2<f64>,
    messages: &Messages,
) -> Point2<f64> {
    let across = Vector2::new(-ahead.y, ahead.x);
    let off_line = |place: Point2<f64>| (place - person).dot(&across).abs();
    let free = |place: Point2<f64>| {
        messages.grid.is_some_and(|grid| {
            let cell = grid.cell_at(place);
            cell.is_some_and(|cell| grid.cost(cell).is_finite())
        })
    };
    let mut best = robot;
    for side in [1.0, -1.0] {
        let steps = (1..=(ASIDE / STEP) as usize).map(|k| side * STEP * k as f64);
        let places = steps.map(|far| robot + across * far);
        for place in places.take_while(|place| free(*place)) {
            if off_line(place) > off_line(best) + 1e-6 && distance(&robot, &place) <= ASIDE + 1e-9 {
                best = place;
            }
        }
    }
    best
}
