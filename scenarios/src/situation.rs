//! One situation, and all that social mapping makes of it: what the pictures of a moment show. This file
//! owns how a frame of a recording and a moment of a scenario become a scene; what is left out of the
//! scene is among its rejections.

use crate::metrics::mapped;
use crate::scenario::Scenario;
use crate::scenes::Frame;
use crate::world::{Whereabouts, whereabouts};
use agents::social_mapping::rejection::Rejection;
use agents::social_mapping::scene::{Activity, BODY_RADIUS, Manner, Person, SceneError};
use agents::social_mapping::{
    ConfigError, SocialConfig, SocialMapper, SocialScene, Update, extent,
};
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};
use std::collections::BTreeMap;

/// Beyond the outlines of zones of a recording, metres, so that they can be told from the edge.
const AROUND: f64 = 0.3;
/// The map of a recording with nobody in it, metres from its origin.
const NOBODY: f64 = 2.5;

/// A moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Situation {
    /// What it is a moment of.
    pub name: String,
    /// When, for people; empty where that is of no account.
    pub moment: String,
    /// When, for R(t).
    pub now: Time,
    /// Who and what is there.
    pub scene: SocialScene,
    /// Outlines of the rooms.
    pub rooms: Vec<Vec<Point2<f64>>>,
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
}

impl Situation {
    /// A frame of a recording, on an open floor as far as the zones of its people and groups reach. Features that `config` does not
    /// know are left out.
    pub fn of_frame(name: &str, frame: &Frame, config: &SocialConfig) -> Self {
        let mut rejected = Vec::new();
        let mut people = Vec::with_capacity(frame.people.len());
        for one in &frame.people {
            let name = one.id.to_string();
            let features = config
                .features
                .parse(one.features.as_deref().unwrap_or_default());
            let features = features.unwrap_or_else(|error| {
                let name = name.clone();
                rejected.push(Rejection::PersonFeatures { name, error });
                BTreeMap::new()
            });
            people.push(Person {
                name,
                world_from_person: one.pose,
                velocity: Vector2::zeros(),
                radius: BODY_RADIUS,
                manner: Manner {
                    activity: one.activity.clone(),
                    features,
                    task: one.task.clone(),
                    room: None,
                },
            });
        }
        rejected.extend(
            config
                .activity_in
                .keys()
                .map(|room| Rejection::Room { room: room.clone() }),
        );
        let mut situation = Self::of_people(name, Time::from_seconds(frame.time), people, config);
        situation.moment = format!("t = {}", frame.time);
        situation.scene.rejected = rejected;
        situation
    }

    /// These people on an open floor, as far as their zones and those of their groups reach.
    pub fn of_people(name: &str, now: Time, people: Vec<Person>, config: &SocialConfig) -> Self {
        let extent = extent(config, &people);
        let [left, bottom, right, top] = extent.unwrap_or([-NOBODY, -NOBODY, NOBODY, NOBODY]);
        Self {
            name: name.to_owned(),
            moment: String::new(),
            now,
            scene: SocialScene {
                bounds: [left - AROUND, bottom - AROUND, right + AROUND, top + AROUND],
                robot_radius: BODY_RADIUS,
                social: true,
                people,
                ..SocialScene::default()
            },
            rooms: Vec::new(),
        }
    }

    /// A scenario at a time of its day, with everybody where their schedules have them, as [`whereabouts`] says.
    pub fn of_scenario(scenario: &Scenario, now: Time) -> Self {
        let found = whereabouts(scenario, now);
        let people = scenario.people.iter().zip(found);
        let people = people.filter_map(|(person, found)| {
            let Whereabouts { pose, velocity } = found?;
            Some(Person {
                name: person.name.clone(),
                world_from_person: pose,
                velocity,
                radius: person.radius,
                manner: Manner {
                    room: scenario
                        .find_room(pose.translation.vector.into())
                        .map(|room| room.name.clone()),
                    ..Manner::default()
                },
            })
        });
        let held = scenario.activities.iter().filter(|one| !one.cancelled);
        let activities = held.map(|activity| Activity {
            name: activity.name.clone(),
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

    /// Maps it; the mapper has its layers. Nobody has watched who talks with whom, so whoever stands in
    /// one group is taken to.
    ///
    /// # Errors
    /// [`SituationError`].
    pub fn map(&self, config: &SocialConfig) -> Result<(Update, SocialMapper), SituationError> {
        let people = &self.scene.people;
        let poses: Vec<Isometry2<f64>> = people.iter().map(|p| p.world_from_person).collect();
        // More people than can be searched are in no group; the update reports that.
        let groups = config.grouping.groups(&poses).unwrap_or_default();
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
        Ok((mapper.update(self.now, &scene)?, mapper))
    }
}

/// A time of its day, `HH:MM:SS`.
pub fn time_of_day(time: Time) -> String {
    const DAY: i64 = 86_400;
    let seconds = time.nanoseconds().div_euclid(1_000_000_000).rem_euclid(DAY);
    let (hours, minutes) = (seconds / 3600, seconds / 60 % 60);
    format!("{hours:02}:{minutes:02}:{:02}", seconds % 60)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::Seen;
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
        let seen = |id, pose| Seen {
            id,
            pose,
            activity: None,
            features: None,
            task: None,
        };
        let mut frame = Frame {
            time: 4.0,
            people: vec![
                seen(7, at(0.0, 0.0, 0.0)),
                seen(9, at(1.4, 0.0, std::f64::consts::PI)),
                seen(2, at(0.0, 4.0, 0.0)),
            ],
            truth: None,
        };
        let config = SocialConfig::default();
        let map = |frame: &Frame| Situation::of_frame("two", frame, &config).map(&config);
        let (update, _) = map(&frame).unwrap();
        assert_eq!(update.groups.len(), 1);
        assert_eq!(update.groups[0].members, ["7", "9"]);
        assert_eq!(update.rejected, []);
        let grid = &update.grid;
        let cost = |x, y| grid.cost(grid.cell_at(Point2::new(x, y)).unwrap());
        assert!((cost(0.72, 0.0) - 4.0).abs() < 1e-6);
        assert!(cost(0.0, 4.0) >= BLOCKED);
        assert!((cost(2.5, 2.5) - FREE).abs() < 1e-6);

        // The map ends beyond everybody's zones, however far they reach: here 2.146 widths.
        let reach = |front: f64| front * (-2.0 * 0.1f64.ln()).sqrt() + AROUND;
        let [left, bottom, right, top] = Situation::of_frame("two", &frame, &config).scene.bounds;
        // To the left, the group's personal space reaches furthest: its members stand 0.7 m from its middle.
        let group = 0.7 - 1.7 * (-2.0 * 0.5f64.ln()).sqrt() - AROUND;
        assert!((left - group).abs() < 1e-6 && (right - (1.4 + reach(0.5))).abs() < 1e-6);
        assert!((bottom + reach(0.75)).abs() < 1e-6 && (top - (4.0 + reach(0.75))).abs() < 1e-6);
        frame.people[2].activity = Some("in_the_bathroom".into());
        let [left, .., top] = Situation::of_frame("two", &frame, &config).scene.bounds;
        assert!((left + reach(2.5)).abs() < 1e-6 && (top - (4.0 + reach(2.5))).abs() < 1e-6);
        frame.people[0].features = Some("emotional_state=merry".into());
        let (update, _) = map(&frame).unwrap();
        assert!((update.people[2].shape.rear - 2.5).abs() < 1e-12);
        let said: Vec<String> = update.rejected.iter().map(ToString::to_string).collect();
        assert_eq!(said.len(), 1);
        assert!(
            said[0].starts_with("person 7 has no features: `merry`"),
            "{said:?}"
        );
    }
}
