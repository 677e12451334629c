//! The robot's body and drive. It never moves deeper into anything solid, however
//! long the step, and counts each contact once.

use super::obstacles::{Obstacles, distance_to_segment};
use super::{Body, Collisions};
use crate::scenario::Robot;
use agents::messages::VelocityCommand;
use agents::navigation::control::Motion;
use dsr::Time;
use nalgebra::{Isometry2, Point2, Rotation2, Vector2};

/// The base stops by itself when no command came for this long, s.
const COMMAND_TIMEOUT: f64 = 0.5;
/// A contact is over when the gap exceeds this, m: a body resting against the robot is one contact.
const CONTACT_GAP: f64 = 0.02;

/// What the robot may touch.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Contact {
    Wall(usize),
    Object(usize),
    Person(String),
}

#[derive(Debug, Clone)]
pub(super) struct Base {
    pub(super) pose: Isometry2<f64>,
    /// Forward speed, m/s, and turning speed, rad/s.
    pub(super) velocity: Vector2<f64>,
    /// Speed to the left, m/s.
    pub(super) lateral: f64,
    pub(super) collisions: Collisions,
    command: Option<(Time, Motion)>,
    touching: Vec<Contact>,
}

impl Base {
    pub(super) fn new(robot: &Robot) -> Self {
        Self {
            pose: robot.pose,
            velocity: Vector2::zeros(),
            lateral: 0.0,
            collisions: Collisions::default(),
            command: None,
            touching: Vec::new(),
        }
    }

    pub(super) fn position(&self) -> Point2<f64> {
        self.pose.translation.vector.into()
    }

    /// Takes a command that arrived at `now`. One that is no number is not taken.
    pub(super) fn take(&mut self, now: Time, command: VelocityCommand) {
        let VelocityCommand {
            linear,
            lateral,
            angular,
            ..
        } = command;
        if [linear, lateral, angular]
            .iter()
            .all(|speed| speed.is_finite())
        {
            let motion = Motion {
                linear,
                lateral,
                angular,
            };
            self.command = Some((now, motion));
        }
    }

    /// Drives for `dt` seconds until `now`.
    pub(super) fn drive(
        &mut self,
        robot: &Robot,
        now: Time,
        dt: f64,
        obstacles: &Obstacles,
        people: &[Body],
    ) {
        let fresh = self
            .command
            .filter(|(came, _)| now.since(*came) <= COMMAND_TIMEOUT + 1e-9);
        let wanted = fresh.map_or_else(Motion::default, |(_, wanted)| wanted);
        let now = Motion {
            linear: self.velocity.x,
            lateral: self.lateral,
            angular: self.velocity.y,
        };
        let moves = robot.limits().reachable(now, wanted, dt);
        self.velocity = Vector2::new(moves.linear, moves.angular);
        self.lateral = moves.lateral;
        // Short enough that a step cannot carry the body across anything.
        let parts = (moves.speed() * dt / (robot.radius * 0.25)).ceil().max(1.0);
        let mut blocked = Vec::new();
        for _ in 0..parts as usize {
            let move_by = |part: f64| {
                let moves = Motion {
                    linear: self.velocity.x,
                    lateral: self.lateral,
                    ..moves
                };
                advance(&self.pose, moves, dt / parts * part)
            };
            let meets = |part: f64| {
                let to = Point2::from(move_by(part).translation.vector);
                deeper(robot.radius, self.position(), to, obstacles, people)
            };
            let into = meets(1.0);
            if into.is_empty() {
                self.pose = move_by(1.0);
                continue;
            }
            // Up to the contact, then only the turn goes on.
            let (mut free, mut stopped) = (0.0, 1.0);
            for _ in 0..16 {
                let middle = f64::midpoint(free, stopped);
                if meets(middle).is_empty() {
                    free = middle;
                } else {
                    stopped = middle;
                }
            }
            let turned = move_by(1.0).rotation;
            self.pose = move_by(free);
            self.pose.rotation = turned;
            (self.velocity.x, self.lateral) = (0.0, 0.0);
            blocked.extend(into);
        }
        self.count(robot.radius, blocked, obstacles, people);
    }

    /// Counts the contacts that are new, and forgets those that are over.
    fn count(
        &mut self,
        radius: f64,
        blocked: Vec<Contact>,
        obstacles: &Obstacles,
        people: &[Body],
    ) {
        let here = self.position();
        self.touching.retain(|contact| match contact {
            Contact::Wall(at) => {
                distance_to_segment(here, obstacles.walls[*at]) < radius + CONTACT_GAP
            }
            Contact::Object(at) => obstacles.objects[*at].distance(here) < radius + CONTACT_GAP,
            Contact::Person(name) => people.iter().any(|person| {
                person.name == *name
                    && (person.position - here).norm() < radius + person.radius + CONTACT_GAP
            }),
        });
        let overlapping = people
            .iter()
            .filter(|person| (person.position - here).norm() < radius + person.radius)
            .map(|person| Contact::Person(person.name.clone()));
        for contact in blocked.into_iter().chain(overlapping) {
            if self.touching.contains(&contact) {
                continue;
            }
            match contact {
                Contact::Wall(_) => self.collisions.walls += 1,
                Contact::Object(_) => self.collisions.objects += 1,
                Contact::Person(_) => self.collisions.people += 1,
            }
            self.touching.push(contact);
        }
    }
}

/// The pose after moving at constant speeds (an arc) for `dt` seconds.
fn advance(pose: &Isometry2<f64>, motion: Motion, dt: f64) -> Isometry2<f64> {
    let turn = motion.angular * dt;
    let way = Vector2::new(motion.linear, motion.lateral) * dt;
    // Chord of the arc: its direction is half the turn, its length shrinks by sinc.
    let half = turn / 2.0;
    let chord = if half.abs() < 1e-9 {
        way
    } else {
        way * (half.sin() / half)
    };
    let step = Isometry2::new(Rotation2::new(half) * chord, turn);
    pose * step
}

/// All that a disc would enter, or enter deeper, by moving.
fn deeper(
    radius: f64,
    from: Point2<f64>,
    to: Point2<f64>,
    obstacles: &Obstacles,
    people: &[Body],
) -> Vec<Contact> {
    let enters = |before: f64, after: f64, reach: f64| after < reach && after < before - 1e-12;
    let mut into = Vec::new();
    for (at, wall) in obstacles.walls.iter().enumerate() {
        let (before, after) = (
            distance_to_segment(from, *wall),
            distance_to_segment(to, *wall),
        );
        if enters(before, after, radius) {
            into.push(Contact::Wall(at));
        }
    }
    for (at, object) in obstacles.objects.iter().enumerate() {
        if enters(object.distance(from), object.distance(to), radius) {
            into.push(Contact::Object(at));
        }
    }
    for person in people {
        let (before, after) = (
            (person.position - from).norm(),
            (person.position - to).norm(),
        );
        if enters(before, after, radius + person.radius) {
            into.push(Contact::Person(person.name.clone()));
        }
    }
    into
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Base as Kind;
    use proptest::prelude::*;

    fn command(linear: f64, angular: f64) -> VelocityCommand {
        VelocityCommand {
            time: Time::default(),
            linear,
            lateral: 0.0,
            angular,
        }
    }

    fn wall_at(x: f64) -> Obstacles {
        let wall = [Point2::new(x, -5.0), Point2::new(x, 5.0)];
        Obstacles {
            walls: vec![wall],
            objects: Vec::new(),
        }
    }

    /// Drives with a fresh command in every step; returns the base and the time it ended.
    fn drive(robot: &Robot, obstacles: &Obstacles, people: &[Body], dt: f64, steps: usize) -> Base {
        let mut base = Base::new(robot);
        let mut now = Time::default();
        for _ in 0..steps {
            base.take(now, command(10.0, 0.0));
            now = now + dt;
            base.drive(robot, now, dt, obstacles, people);
        }
        base
    }

    #[test]
    fn it_speeds_up_within_its_limits_and_stops_without_commands() {
        let robot = Robot::default();
        let mut base = Base::new(&robot);
        let free = Obstacles {
            walls: Vec::new(),
            objects: Vec::new(),
        };
        let start = Time::from_seconds(100.0);
        base.take(start, command(10.0, 10.0));
        base.drive(&robot, start + 0.1, 0.1, &free, &[]);
        assert!(
            (base.velocity - Vector2::new(0.08, 0.25)).norm() < 1e-12,
            "{}",
            base.velocity
        );
        let mut now = start + 0.1;
        for _ in 0..100 {
            now = now + 0.1;
            base.drive(&robot, now, 0.1, &free, &[]);
        }
        assert_eq!(base.velocity, Vector2::zeros(), "the command is old");
    }

    #[test]
    fn a_turn_while_driving_is_an_arc() {
        let speed = std::f64::consts::PI / 2.0;
        let quarter = advance(&Isometry2::identity(), Motion::new(speed, speed), 1.0);
        assert!((quarter.translation.vector - Vector2::new(1.0, 1.0)).norm() < 1e-12);
        assert!((quarter.rotation.angle() - std::f64::consts::PI / 2.0).abs() < 1e-12);
    }

    #[test]
    fn only_an_omnidirectional_base_goes_sideways() {
        let free = Obstacles {
            walls: Vec::new(),
            objects: Vec::new(),
        };
        for (base, sideways) in [(Kind::Differential, 0.0), (Kind::Omnidirectional, 0.6)] {
            let robot = Robot {
                base,
                ..Robot::default()
            };
            let mut body = Base::new(&robot);
            let mut now = Time::default();
            for _ in 0..40 {
                let aside = VelocityCommand {
                    lateral: 0.6,
                    ..command(0.0, 0.0)
                };
                body.take(now, aside);
                now = now + 0.05;
                body.drive(&robot, now, 0.05, &free, &[]);
            }
            assert!((body.lateral - sideways).abs() < 1e-9, "{base:?}");
            assert!((body.position().y - 2.0 * sideways).abs() < 0.5 * sideways + 1e-9);
            assert!(body.position().x.abs() < 1e-9);
        }
    }

    #[test]
    fn leaning_on_a_wall_is_one_collision_and_coming_back_another() {
        let robot = Robot::default();
        let obstacles = wall_at(1.0);
        let mut base = drive(&robot, &obstacles, &[], 0.05, 100);
        assert_eq!(
            base.collisions,
            Collisions {
                walls: 1,
                ..Collisions::default()
            }
        );
        let mut now = Time::from_seconds(5.0);
        for (speed, steps) in [(-0.5, 40), (0.5, 160)] {
            for _ in 0..steps {
                base.take(now, command(speed, 0.0));
                now = now + 0.05;
                base.drive(&robot, now, 0.05, &obstacles, &[]);
            }
        }
        assert_eq!(base.collisions.walls, 2);
    }

    #[test]
    fn a_person_in_the_way_stops_the_robot_and_one_who_walks_into_it_counts() {
        let robot = Robot::default();
        let free = Obstacles {
            walls: Vec::new(),
            objects: Vec::new(),
        };
        let person = Body::standing("ana", Point2::new(1.0, 0.0), 0.0, 0.2);
        let base = drive(&robot, &free, std::slice::from_ref(&person), 0.05, 100);
        assert_eq!(base.collisions.people, 1);
        assert!(base.position().x <= 1.0 - 0.45 + 1e-9);
        let mut still = Base::new(&robot);
        let inside = Body {
            position: Point2::new(0.3, 0.0),
            ..person
        };
        still.drive(&robot, Time::default(), 0.05, &free, &[inside]);
        assert_eq!(still.collisions.people, 1);
    }

    proptest! {
        #[test]
        fn no_wall_is_ever_crossed(dt in 0.01..2.0f64, wall in 0.3..3.0f64, speed in 0.1..20.0f64) {
            let robot = Robot { max_speed: speed, max_acceleration: 100.0, ..Robot::default() };
            let base = drive(&robot, &wall_at(wall), &[], dt, 60);
            prop_assert!(base.position().x <= wall - robot.radius + 1e-9);
        }
    }
}
