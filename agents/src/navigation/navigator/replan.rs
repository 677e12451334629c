//! When the navigator plans a path, and to where. This file guarantees that it plans at most twice a
//! second, and that a way is given up only for one that is clearly better or because it is closed.

use super::course::{Care, Course, Hindrance};
use super::{Navigator, View};
use crate::grid::CostGrid;
use crate::navigation::band::Band;
use crate::navigation::people::{Person, Presence};
use crate::navigation::planner::price;
use crate::navigation::target::{
    Destination, Target, Task, has_moved, places_to_join, places_to_talk, places_with,
};
use nalgebra::Point2;

impl Navigator {
    /// Plans where there is a reason to.
    pub(super) fn keep_planned(
        &mut self,
        course: &mut Course,
        grid: &CostGrid,
        view: &View,
    ) -> Result<(), Hindrance> {
        let person = person_of(&course.task, view.inputs.people);
        let anchor = course.task.target.anchor(view.inputs.people);
        if anchor.is_none() && course.task.target.follows_people() {
            return Err(Hindrance::NoPerson);
        }
        let age = course
            .planned
            .map_or(f64::INFINITY, |planned| view.now.since(planned));
        let company = course.task.target.is_company();
        if age < if company { 0.3 } else { 0.5 } {
            return course.hindrance.map_or(Ok(()), Err);
        }
        let moved = anchor.is_some_and(|anchor| has_moved(course.person, anchor));
        let now = price(grid, self.band.points());
        course.price = course.price.min(now.cost);
        if company {
            return self.plan(course, grid, view, person, Care::Map);
        }
        let dearer = now.blocked || now.cost > 1.3 * course.price + 1.5;
        if self.band.points().is_empty() || moved || dearer || course.hindrance.is_some() {
            return self.plan(course, grid, view, person, Care::Map);
        }
        let reviewed = course.reviewed.max(course.planned);
        if reviewed.is_none_or(|then| view.now.since(then) >= self.config.review) {
            course.reviewed = Some(view.now);
            self.load(grid, view, Care::Map);
            if self.planner.has_news() {
                self.review(course, grid, view, person);
            }
        }
        Ok(())
    }

    /// Takes a new way only where it is clearly cheaper than the one the robot is on.
    fn review(
        &mut self,
        course: &mut Course,
        grid: &CostGrid,
        view: &View,
        person: Option<&Person>,
    ) {
        let old = std::mem::take(&mut self.band);
        let (kept, plans) = (course.clone(), self.plans);
        let found = self.plan(course, grid, view, person, Care::Map);
        let new = self.planner.price(self.band.points());
        let before = self.planner.price(old.points());
        if found.is_err() || !before.blocked && new.cost > 0.85 * before.cost {
            (self.band, self.plans) = (old, plans);
            *course = kept;
        }
    }

    /// Loads the planner with what a path is to take account of.
    fn load(&mut self, grid: &CostGrid, view: &View, care: Care) {
        let robot = view.robot.position;
        self.planner.load(grid);
        if view.inputs.social {
            self.planner
                .expect(view.others, robot, view.inputs.limits.max_speed);
        }
        if care == Care::Laser {
            let standing: Vec<Presence> = view
                .others
                .iter()
                .filter(|person| view.inputs.social && !person.is_walking())
                .map(|person| person.predicted(0.0))
                .collect();
            let reach = (view.inputs.limits.radius, 4.0);
            self.planner.block(&self.obstacles, &standing, robot, reach);
        }
    }

    /// Plans a path and lays a band along it.
    pub(super) fn plan(
        &mut self,
        course: &mut Course,
        grid: &CostGrid,
        view: &View,
        person: Option<&Person>,
        care: Care,
    ) -> Result<(), Hindrance> {
        self.plans += 1;
        course.planned = Some(view.now);
        let robot = view.robot.position;
        self.load(grid, view, care);
        let found = self.line(course, grid, view, person);
        course.hindrance = found.as_ref().err().copied();
        let (destination, line) = found?;
        course.hindered = None;
        let line_end = line[line.len() - 1];
        course.line.clone_from(&line);
        course.destination = Some(Destination {
            point: line_end,
            ..destination
        });
        let anchor = course.task.target.anchor(view.inputs.people);
        let led_elsewhere = anchor.is_some_and(|anchor| has_moved(course.person, anchor));
        course.person = anchor.unwrap_or(robot);
        course.at_place = false;
        self.band = Band::new(&line, &self.config.gains);
        self.relax(grid, view, 20);
        course.price = price(grid, self.band.points()).cost;
        let length = self.band.length();
        // A person who walked off is no fault of the way; anything else that makes it longer is.
        if course.left.is_infinite() || led_elsewhere {
            course.shortest = length;
        }
        if course.left.is_infinite() || length > course.left + 0.5 {
            course.noted = length;
        }
        course.left = length;
        Ok(())
    }

    /// The way to the first of the task's places that can be reached.
    fn line(
        &mut self,
        course: &Course,
        grid: &CostGrid,
        view: &View,
        person: Option<&Person>,
    ) -> Result<(Destination, Vec<Point2<f64>>), Hindrance> {
        let robot = view.robot.position;
        let single = |point, heading| vec![(Destination { point, heading }, 1.0)];
        let places = match (&course.task.target, person) {
            (Target::Region { entry, .. }, _) => {
                let region = course.region.as_ref();
                let place = region.and_then(|region| region.place_inside(*entry, grid));
                let point = place.ok_or(Hindrance::RegionBlocked)?;
                vec![(
                    Destination {
                        point,
                        heading: None,
                    },
                    0.3,
                )]
            }
            (Target::Point(point), _) => single(*point, None),
            (Target::Pose(pose), _) => {
                single(pose.translation.vector.into(), Some(pose.rotation.angle()))
            }
            (Target::Places(places), _) => places.iter().map(|place| (*place, 0.15)).collect(),
            (Target::Group { members }, _) => {
                let people = view.inputs.people.iter();
                let members: Vec<&Person> = people.filter(|p| members.contains(&p.name)).collect();
                let places = places_to_join(&members, robot).into_iter();
                places.map(|place| (place, 0.05)).collect()
            }
            (Target::Person { .. } | Target::Company { .. }, None) => {
                return Err(Hindrance::NoPerson);
            }
            (Target::Company { place, .. }, Some(person)) => {
                places_with(person, *place, grid, robot)
                    .map(|place| (place, 0.15))
                    .collect()
            }
            (Target::Person { distance, .. }, Some(person)) => {
                places_to_talk(person, *distance, robot)
                    .map(|place| (place, 0.15))
                    .collect()
            }
        };
        let mut first_error = None;
        for (place, tolerance) in places {
            match self.planner.line_to(robot, &place, tolerance) {
                Ok(line) => return Ok((place, line)),
                Err(error) => first_error = first_error.or(Some(error)),
            }
        }
        Err(first_error.map_or(Hindrance::RegionBlocked, Hindrance::NoPath))
    }
}

/// Whom a task leads to, where they are known.
pub(super) fn person_of<'a>(task: &Task, people: &'a [Person]) -> Option<&'a Person> {
    let name = task.target.person()?;
    people.iter().find(|person| person.name == name)
}
