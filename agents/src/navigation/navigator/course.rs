//! A task under way, and what hinders it. This file owns the memory that one task has of its own.

use super::{Cause, Failure, Status};
use crate::navigation::path::PathError;
use crate::navigation::target::{Destination, Region, Target, Task};
use dsr::Time;
use nalgebra::Point2;

/// A task under way.
#[derive(Debug, Clone)]
pub(super) struct Course {
    pub(super) task: Task,
    pub(super) region: Option<Region>,
    pub(super) ended: Option<Status>,
    /// The path that the band was laid along.
    pub(super) line: Vec<Point2<f64>>,
    /// Where the band leads.
    pub(super) destination: Option<Destination>,
    /// Where the person stood for whom the destination was chosen.
    pub(super) person: Point2<f64>,
    pub(super) planned: Option<Time>,
    /// When it was last asked whether the map has news.
    pub(super) reviewed: Option<Time>,
    /// The least price that the band has had since it was planned.
    pub(super) price: f64,
    /// The way that was left at the last step, metres.
    pub(super) left: f64,
    /// The shortest way that was left, whatever became of it.
    pub(super) shortest: f64,
    /// The way that was left when it had last become noticeably shorter, and when that was. A way
    /// that turns out longer is noted anew.
    pub(super) noted: f64,
    pub(super) headway: Time,
    /// The time lost so far, seconds: it grows with the clock and shrinks with the headway.
    pub(super) lost: f64,
    pub(super) recoveries: u32,
    pub(super) backing_until: Option<Time>,
    /// Since when there has been no way, or no sight of the person.
    pub(super) hindered: Option<Time>,
    pub(super) hindrance: Option<Hindrance>,
    pub(super) at_place: bool,
}

/// What a new path takes account of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Care {
    /// The grid, which is right about all that does not walk.
    Map,
    /// Also what the laser sees: the grid has led the robot to where it cannot go on.
    Laser,
}

/// Why there is no way now.
#[derive(Debug, Clone, Copy)]
pub(super) enum Hindrance {
    NoPath(PathError),
    RegionBlocked,
    NoPerson,
}

impl Hindrance {
    pub(super) fn status(self, given_up: bool) -> Status {
        match self {
            Self::NoPath(error) if given_up => Status::Failed(Failure::NoPath(error)),
            Self::RegionBlocked if given_up => Status::Failed(Failure::RegionBlocked),
            Self::NoPerson if given_up => Status::Failed(Failure::PersonUnseen),
            Self::NoPath(_) | Self::RegionBlocked => Status::Waiting(Cause::NoPath),
            Self::NoPerson => Status::Waiting(Cause::NoPerson),
        }
    }
}

impl Course {
    pub(super) fn new(task: &Task, now: Time) -> Self {
        let region = match &task.target {
            Target::Region { polygon, .. } => Some(Region::new(polygon)),
            _ => None,
        };
        Self {
            task: task.clone(),
            region,
            ended: None,
            line: Vec::new(),
            destination: None,
            person: Point2::origin(),
            planned: None,
            reviewed: None,
            price: f64::INFINITY,
            left: f64::INFINITY,
            shortest: f64::INFINITY,
            noted: f64::INFINITY,
            headway: now,
            lost: 0.0,
            recoveries: 0,
            backing_until: None,
            hindered: None,
            hindrance: None,
            at_place: false,
        }
    }
}
