//! The spaces of a scenario's objects over its whole run. This file owns when a space counts as in
//! use; the shapes and R(t) are those of social mapping, asked of social mapping itself.

use crate::scenario::{Object, Scenario, Shape};
use agents::social_mapping::scene::{Object as MappedObject, SceneError, SocialScene};
use agents::social_mapping::{
    Agenda, ConfigError, Outline, SocialConfig, SocialMapper, UsageCurve,
};
use dsr::Time;
use geo::Intersects;
use nalgebra::Point2;

/// The space in which one object is used, and its agenda.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectSpace {
    /// The object.
    pub name: String,
    /// R(t).
    pub curve: UsageCurve,
    /// When it is used.
    pub agenda: Vec<Agenda>,
    polygon: geo::Polygon,
}

/// Why the spaces of a scenario's objects are not known.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SpacesError {
    /// The figures of social mapping are unusable.
    #[error("{}", .problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
    Config {
        /// All that is wrong with them.
        problems: Vec<ConfigError>,
    },
    /// The scenario makes no map.
    #[error(transparent)]
    Scene(#[from] SceneError),
}

impl ObjectSpace {
    /// A space within `outline` (world frame, m; the first point not repeated).
    pub fn new(
        name: &str,
        outline: &[Point2<f64>],
        curve: UsageCurve,
        agenda: Vec<Agenda>,
    ) -> Self {
        let ring = outline.iter().map(|p| geo::Coord { x: p.x, y: p.y });
        Self {
            name: name.to_owned(),
            curve,
            agenda,
            polygon: geo::Polygon::new(ring.collect(), Vec::new()),
        }
    }

    /// R(`now`).
    pub fn usage(&self, now: Time) -> f64 {
        self.curve.usage(now, &self.agenda)
    }

    /// Whether an activity is under way or near: R(`now`) is above its least value. A space that
    /// nobody is about to use or has just used disturbs nobody, so crossing it does not count.
    pub fn is_in_use(&self, now: Time) -> bool {
        self.usage(now) > self.curve.least
    }

    /// Whether `point` is in the space or on its outline.
    pub fn contains(&self, point: Point2<f64>) -> bool {
        self.polygon.intersects(&geo::Point::new(point.x, point.y))
    }

    /// The outline, world frame, m; the first point not repeated.
    pub fn outline(&self) -> impl Iterator<Item = Point2<f64>> {
        let ring = &self.polygon.exterior().0;
        ring[..ring.len().saturating_sub(1)]
            .iter()
            .map(|c| Point2::new(c.x, c.y))
    }
}

/// The spaces of all objects of `scenario` whose class has one, as `config` shapes them and as far
/// as walls let them reach: who is behind the wall is not between people and their television.
///
/// # Errors
/// [`SpacesError`] where social mapping could make no map of the scenario either.
pub fn object_spaces(
    scenario: &Scenario,
    config: &SocialConfig,
) -> Result<Vec<ObjectSpace>, SpacesError> {
    let scene = SocialScene {
        bounds: scenario.bounds,
        walls: scenario.walls.clone(),
        robot_radius: scenario.robot.radius,
        social: true,
        objects: scenario.objects.iter().map(mapped).collect(),
        ..SocialScene::default()
    };
    let mut mapper =
        SocialMapper::new(config.clone()).map_err(|problems| SpacesError::Config { problems })?;
    let map = mapper.update(scenario.start, &scene)?;
    let spaces = map.objects.into_iter().map(|object| {
        let curve = config.usage_of.get(&object.name).unwrap_or(&config.usage);
        let agenda = scenario
            .activities
            .iter()
            .filter(|activity| activity.object == object.name && !activity.cancelled)
            .filter_map(|activity| Agenda::new(activity.start, activity.end).ok())
            .collect();
        ObjectSpace::new(&object.name, &object.space, *curve, agenda)
    });
    Ok(spaces.collect())
}

/// An object as social mapping has it.
pub(crate) fn mapped(object: &Object) -> MappedObject {
    MappedObject {
        name: object.name.clone(),
        class: object.class.clone(),
        world_from_object: object.pose,
        outline: match object.shape {
            Shape::Rectangle => Outline::Rectangle(object.size),
            Shape::Circle => Outline::Circle(object.size.x / 2.0),
        },
    }
}
