//! Follows the band and watches the headway. This file guarantees that a robot which makes none
//! tries something else, and in the end says so.

use super::course::{Care, Course};
use super::replan::person_of;
use super::{Cause, Decision, Failure, Navigator, STAND, Status, View};
use crate::navigation::anticipation::{Manoeuvre, Scene};
use crate::navigation::band::{BandState, Surroundings};
use crate::navigation::control::{Motion, follow};
use crate::navigation::target::Target;

impl Navigator {
    /// Lets the band move.
    pub(super) fn relax(&mut self, view: &View, iterations: usize) -> BandState {
        let people = if view.inputs.social {
            view.inputs.people
        } else {
            &[]
        };
        let limits = &view.inputs.limits;
        let around = Surroundings {
            obstacles: &self.obstacles,
            people,
            radius: limits.radius,
            speed: limits.max_speed,
        };
        self.band.update(&around, &self.config.gains, iterations)
    }

    /// Follows the band, watches the headway.
    pub(super) fn drive(&mut self, course: &mut Course, view: &View) -> Decision {
        let broken = matches!(self.relax(view, 2), BandState::Broken { .. });
        let age = course
            .planned
            .map_or(0.0, |planned| view.now.since(planned));
        let left = self.band.length();
        if left < course.shortest - 0.2 {
            course.shortest = left;
            course.headway = view.now;
            course.recoveries = 0;
        }
        let waited = view.now.since(course.headway);
        if waited > self.config.give_up_after {
            return (STAND, Status::Failed(Failure::Stuck));
        }
        let due = self.config.recover_after * f64::from(course.recoveries + 1);
        if waited > due {
            course.recoveries += 1;
            // Every other time it makes room first, and plans when it has.
            if course.recoveries.is_multiple_of(2) {
                course.backing_until = Some(view.now + 2.0);
            }
        }
        if waited > due || broken && age >= 0.5 {
            let person = person_of(&course.task, view.inputs.people);
            if let Some(grid) = view.inputs.grid {
                // Without a new way the old one is as good as any.
                course.hindrance = self.plan(course, grid, view, person, Care::Laser).err();
            }
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
        let addressee = match &course.task.target {
            Target::Person { name, .. } => Some(name.as_str()),
            _ => None,
        };
        let scene = Scene {
            line,
            people: view.inputs.people,
            ground: &self.ground,
            limits,
            waited,
            addressee,
        };
        let choice = self.anticipation.choose(&view.robot, &scene);
        let stands = choice.motion.linear.abs() < 0.02
            && !matches!(choice.manoeuvre, Manoeuvre::Along(share) if share > 0.0);
        let status = if stands {
            Status::Waiting(Cause::People)
        } else {
            Status::Moving
        };
        (choice.motion, status)
    }

    /// Backs off slowly, or turns where there is no room behind.
    pub(super) fn back_off(&self, view: &View) -> Motion {
        let (_, behind) = self.config.guard.allowed(view.scan, &view.inputs.limits);
        if behind > 0.05 {
            Motion {
                linear: -0.15,
                angular: 0.0,
            }
        } else {
            Motion {
                linear: 0.0,
                angular: 0.5,
            }
        }
    }
}
