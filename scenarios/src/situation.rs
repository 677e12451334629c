//! One situation, and all that social mapping makes of it: what the pictures of a moment show. This file
//! owns how a frame of a recording and a moment of a scenario become a scene; what is left out of the
//! scene is among its rejections.

use crate::metrics::mapped;
use crate::scenario::Scenario;
use crate::scenes::Frame;
use agents::social_mapping::groups::{Grouping, TooManyPeople};
use agents::social_mapping::scene::{Activity, BODY_RADIUS, Person, SceneError};
use agents::social_mapping::{ConfigError, SocialConfig, SocialMapper, SocialScene, Update};
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};

/// Around the people of a recording, metres: as far as social space reaches.
const AROUND: f64 = 2.5;

/// A moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Situation {
    /// What it is a moment of.
    pub name: String,
    /// When, for people.
    pub moment: String,
    /// When, for R(t).
    pub now: Time,
    /// Who and what is there.
    pub scene: SocialScene,
    /// Outlines of the rooms.
    pub rooms: Vec<Vec<Point2<f64>>>,
}

/// What social mapping makes of a situation.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapped {
    /// The grid, the polylines, R(t), and what was left out.
    pub update: Update,
    /// Who stands together, as indices of the update's people.
    pub groups: Vec<Vec<usize>>,
}

/// Why a situation cannot be mapped.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SituationError {
    /// The figures of social mapping are unusable.
    #[error("{}", .problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
    Config {
        /// All that is wrong.
        problems: Vec<ConfigError>,
    },
    /// The scene itself is.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Too many people to look for groups among.
    #[error(transparent)]
    People(#[from] TooManyPeople),
}

impl Situation {
    /// A frame of a recording, on an open floor around its people.
    pub fn of_frame(name: &str, frame: &Frame) -> Self {
        let places = || frame.people.iter().map(|(_, pose)| pose.translation.vector);
        let low = places().reduce(|a, b| a.inf(&b)).unwrap_or_default();
        let high = places().reduce(|a, b| a.sup(&b)).unwrap_or_default();
        let margin = Vector2::repeat(AROUND);
        let (low, high) = (low - margin, high + margin);
        let people = frame.people.iter().map(|(name, pose)| Person {
            name: name.to_string(),
            world_from_person: *pose,
            velocity: Vector2::zeros(),
            radius: BODY_RADIUS,
        });
        Self {
            name: name.to_owned(),
            moment: format!("t = {}", frame.time),
            now: Time::from_seconds(frame.time),
            scene: SocialScene {
                bounds: [low.x, low.y, high.x, high.y],
                robot_radius: BODY_RADIUS,
                social: true,
                people: people.collect(),
                ..SocialScene::default()
            },
            rooms: Vec::new(),
        }
    }

    /// A scenario at a time of its day, with everybody where they are at its start.
    pub fn of_scenario(scenario: &Scenario, now: Time) -> Self {
        let people = scenario.people.iter().map(|person| Person {
            name: person.name.clone(),
            world_from_person: person.pose,
            velocity: Vector2::zeros(),
            radius: person.radius,
        });
        let activities = scenario.activities.iter().map(|activity| Activity {
            object: activity.object.clone(),
            start: activity.start,
            end: activity.end,
        });
        Self {
            name: scenario.name.clone(),
            moment: time_of_day(now),
            now,
            scene: SocialScene {
                bounds: scenario.bounds,
                walls: scenario.walls.clone(),
                robot_radius: scenario.robot.radius,
                social: true,
                people: people.collect(),
                objects: scenario.objects.iter().map(mapped).collect(),
                activities: activities.collect(),
                ..SocialScene::default()
            },
            rooms: scenario
                .rooms
                .iter()
                .map(|room| room.polygon.clone())
                .collect(),
        }
    }

    /// Maps it. Groups are found, and whoever stands together has the space between them.
    ///
    /// # Errors
    /// [`SituationError`].
    pub fn map(
        &self,
        config: &SocialConfig,
        grouping: &Grouping,
    ) -> Result<Mapped, SituationError> {
        let people: Vec<&Person> = self.scene.people.iter().collect();
        let poses: Vec<Isometry2<f64>> = people.iter().map(|p| p.world_from_person).collect();
        let groups = grouping.groups(&poses)?;
        let mut scene = self.scene.clone();
        for group in &groups {
            for (at, one) in group.iter().enumerate() {
                let name = |index: usize| people[index].name.clone();
                let pairs = group[..at].iter().map(|other| (name(*other), name(*one)));
                scene.interactions.extend(pairs);
            }
        }
        let mut mapper = SocialMapper::new(config.clone())
            .map_err(|problems| SituationError::Config { problems })?;
        let update = mapper.update(self.now, &scene)?;
        // The update leaves out whose pose is not finite; so do groups.
        let kept: Vec<&str> = update.people.iter().map(|p| p.name.as_str()).collect();
        let place = |index: &usize| kept.iter().position(|name| *name == people[*index].name);
        let groups = groups
            .iter()
            .map(|group| group.iter().filter_map(place).collect())
            .collect();
        Ok(Mapped { update, groups })
    }
}

/// `HH:MM:SS`.
fn time_of_day(time: Time) -> String {
    const DAY: i64 = 86_400;
    let seconds = time.nanoseconds().div_euclid(1_000_000_000).rem_euclid(DAY);
    let (hours, minutes) = (seconds / 3600, seconds / 60 % 60);
    format!("{hours:02}:{minutes:02}:{:02}", seconds % 60)
}

#[cfg(test)]
mod tests {
    use super::*;
    use agents::grid::{BLOCKED, FREE};

    fn at(x: f64, y: f64, heading: f64) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(x, y), heading)
    }

    #[test]
    fn times_are_of_a_day() {
        let time = Time::from_seconds(86_400.0 * 3.0 + 3600.0 * 9.0 + 60.0 * 5.0 + 7.9);
        assert_eq!(time_of_day(time), "09:05:07");
        assert_eq!(time_of_day(Time::from_seconds(-1.0)), "23:59:59");
    }

    #[test]
    fn a_frame_is_mapped_with_its_groups() {
        let frame = Frame {
            time: 4.0,
            people: vec![
                (7, at(0.0, 0.0, 0.0)),
                (9, at(1.4, 0.0, std::f64::consts::PI)),
                (2, at(0.0, 4.0, 0.0)),
            ],
            truth: None,
        };
        let situation = Situation::of_frame("two", &frame);
        let mapped = situation
            .map(&SocialConfig::default(), &Grouping::default())
            .unwrap();
        assert_eq!(mapped.groups, [[0, 1]]);
        assert_eq!(mapped.update.rejected, []);
        let grid = &mapped.update.grid;
        let cost = |x, y| grid.cost(grid.cell_at(Point2::new(x, y)).unwrap());
        assert!((cost(0.72, 0.0) - 4.0).abs() < 1e-6);
        assert!(cost(0.0, 4.0) >= BLOCKED);
        assert!((cost(3.0, 2.5) - FREE).abs() < 1e-6);
    }
}
