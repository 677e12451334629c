//! Follows the band and watches the headway. This file guarantees that a robot which makes none
//! tries something else, and in the end says so.

use super::course::{Care, Course};
use super::replan::person_of;
use super::{Cause, Decision, Failure, Navigator, STAND, Status, View};
use crate::grid::CostGrid;
use crate::navigation::anticipation::{Manoeuvre, Scene};
use crate::navigation::band::{BandState, Surroundings};
use crate::navigation::control::{Motion, follow, speed_near, turn_to};
use crate::navigation::people::Person;
use nalgebra::distance;

/// A companion that is farther away than this from where they should be is gone another way, metres.
const CATCHING_UP: f64 = 2.0;
/// The headway that the robot makes in a second at top speed makes up for so many lost seconds.
const HEADWAY_WORTH: f64 = 3.0;

impl Navigator {
    /// Lets the band move.
    pub(super) fn relax(&mut self, grid: &CostGrid, view: &View, iterations: usize) -> BandState {
        let people = if view.inputs.social { view.others } else { &[] };
        let limits = &view.inputs.limits;
        let around = Surroundings {
            obstacles: &self.obstacles,
            people,
            grid: Some(grid),
            radius: limits.radius,
            speed: limits.max_speed,
        };
        self.band.update(&around, &self.config.gains, iterations)
    }

    /// Follows the band, watches the headway.
    pub(super) fn drive(&mut self, course: &mut Course, grid: &CostGrid, view: &View) -> Decision {
        let broken = matches!(self.relax(grid, view, 2), BandState::Broken { .. });
        let age = course
            .planned
            .map_or(0.0, |planned| view.now.since(planned));
        let company = course.task.target.is_company();
        let waited = if company {
            self.count_standing(course, view)
        } else {
            self.count_headway(course, view)
        };
        if waited > self.config.give_up_after {
            return (STAND, Status::Failed(Failure::Stuck));
        }
        let due = self.config.recover_after * f64::from(course.recoveries + 1);
        if waited > due {
            course.recoveries += 1;
            // Every other time it makes room first, and plans when it has; but not blindly back into
            // the way of people.
            let walkers = view.inputs.people.iter().any(Person::is_walking);
            if course.recoveries.is_multiple_of(2) && !(view.inputs.social && walkers) {
                course.backing_until = Some(view.now + 2.0);
            }
        }
        if waited > due || broken && age >= 0.5 {
            let person = person_of(&course.task, view.inputs.people);
            // Without a new way the old one is as good as any.
            course.hindrance = self.plan(course, grid, view, person, Care::Laser).err();
        }
        if company && let Some(turn) = falls_back(course, view) {
            return (turn, Status::Waiting(Cause::People));
        }
        let limits = &view.inputs.limits;
        let line = self.band.points();
        if !view.inputs.social {
            let ahead = line.get(1..).unwrap_or_default();
            let motion = follow(&view.robot, ahead, limits.max_speed, limits, false);
            return (motion, Status::Moving);
        }
        self.ground
            .load(view.robot.position, &self.obstacles, limits.radius);
        let addressee = course.task.target.person();
        let scene = Scene {
            line,
            people: view.others,
            ground: &self.ground,
            grid: Some(grid),
            limits,
            lost: if company { 0.0 } else { course.lost },
            addressee,
        };
        let choice = self.anticipation.choose(&view.robot, &scene);
        let stands = choice.motion.speed() < 0.02
            && !matches!(choice.manoeuvre, Manoeuvre::Along(share) if share > 0.0);
        let status = if stands {
            Status::Waiting(Cause::People)
        } else {
            Status::Moving
        };
        (choice.motion, status)
    }

    /// Takes account of the way that is left; for how long it has not become shorter, seconds.
    fn count_headway(&self, course: &mut Course, view: &View) -> f64 {
        let left = self.band.length();
        course.left = left;
        let since = self
            .last
            .map_or(0.0, |last| view.now.since(last.time).clamp(0.0, 1.0));
        course.lost += since;
        if left < course.shortest {
            let worth = HEADWAY_WORTH / view.inputs.limits.max_speed.max(0.05);
            course.lost = (course.lost - (course.shortest - left) * worth).max(0.0);
            course.shortest = left;
        }
        if left < course.noted - 0.2 {
            course.noted = left;
            course.headway = view.now;
            course.recoveries = 0;
        }
        view.now.since(course.headway)
    }

    /// For how long the robot has stood though its companion is away, seconds: the way that is left is as
    /// long as the companion makes it, and says nothing.
    fn count_standing(&self, course: &mut Course, view: &View) -> f64 {
        course.left = self.band.length();
        if view.robot.motion.speed() > 0.05 || course.left < 1.0 {
            course.headway = view.now;
            course.recoveries = 0;
        }
        view.now.since(course.headway)
    }

    /// Backs off slowly, or turns where there is no room behind.
    pub(super) fn back_off(&self, view: &View) -> Motion {
        let (_, behind) = self.config.guard.allowed(view.scan, &view.inputs.limits);
        if behind > 0.05 {
            Motion::new(-0.15, 0.0)
        } else {
            Motion::new(0.0, 0.5)
        }
    }
}

/// What a robot does that is further on than its place with a companion: it lets them catch up, and does
/// not turn back.
fn falls_back(course: &Course, view: &View) -> Option<Motion> {
    let destination = course.destination?;
    let heading = destination.heading?;
    let way = destination.point - view.robot.position;
    let ahead = way.x * heading.cos() + way.y * heading.sin();
    let near = way.norm() < CATCHING_UP;
    let walks = person_of(&course.task, view.inputs.people).is_some_and(Person::is_walking);
    (walks && near && ahead < 0.0).then(|| turn_to(&view.robot, heading, 0.1))
}

/// The same motion, slower near those who stand: see [`speed_near`].
pub(super) fn calmed(wanted: Motion, view: &View) -> Motion {
    let limits = &view.inputs.limits;
    let standing = view.others.iter().filter(|person| !person.is_walking());
    let gaps = standing.map(|person| {
        distance(&person.position(), &view.robot.position) - person.radius - limits.radius
    });
    let nearest = gaps.fold(f64::INFINITY, f64::min);
    if !view.inputs.social {
        return wanted;
    }
    let most = speed_near(nearest, limits.max_speed);
    wanted.capped(most)
}
