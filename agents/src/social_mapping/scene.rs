//! What social mapping is told, and what becomes of bad input. This file owns the rule: where the
//! map itself would be wrong the scene is refused; where one item is bad, the item alone is left
//! out or mended as its [`Rejection`] says, and always reported.

use super::config::SocialConfig;
use super::limits::{LARGEST_BODY, MOST_SPEED};
use super::object_space::{Agenda, Outline};
use super::rejection::{Rejection, UsedBy};
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// A wall from one point to another, world frame, metres.
pub type Wall = [Point2<f64>; 2];

/// What is further than this from the origin of its frame along an axis is no place, metres: more than twice
/// round the Earth. Up to here, places are known to a ten-millionth of a metre; far beyond, neither the meshes of
/// neighbours nor squares of distances mean anything any more.
pub const FARTHEST: f64 = 1e8;

/// The radius taken for a person whose own is unusable, metres.
pub const BODY_RADIUS: f64 = 0.25;

/// Everything the social map depends on, beside the time. World frame, SI.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SocialScene {
    /// What the grid covers: xmin, ymin, xmax, ymax.
    pub bounds: [f64; 4],
    /// The walls.
    pub walls: Vec<Wall>,
    /// Radius of the robot, for which the map is inflated.
    pub robot_radius: f64,
    /// Whether people have zones and objects have spaces; otherwise both are mere obstacles.
    pub social: bool,
    /// The people.
    pub people: Vec<Person>,
    /// Who talks with whom, by name.
    pub interactions: Vec<(String, String)>,
    /// The objects.
    pub objects: Vec<Object>,
    /// What is done with them when.
    pub activities: Vec<Activity>,
    /// What whoever made the scene had to leave out; the update passes it on.
    pub rejected: Vec<Rejection>,
}

/// A person.
#[derive(Debug, Clone, PartialEq)]
pub struct Person {
    /// Unique among people.
    pub name: String,
    /// Where the person stands and faces.
    pub world_from_person: Isometry2<f64>,
    /// Velocity, world frame, m/s.
    pub velocity: Vector2<f64>,
    /// Radius of the body.
    pub radius: f64,
    /// What else is known.
    pub manner: Manner,
}

/// What a person does, feels and wants, as far as it is known.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Manner {
    /// An activity by its name in the configuration, such as `cooking`.
    pub activity: Option<String>,
    /// The room that the person is in, which may tell the activity.
    pub room: Option<String>,
    /// Values of socialization features, by name.
    pub features: BTreeMap<String, f64>,
    /// What the robot does with the person, such as `escort`: opens the task's cooperation zones.
    pub task: Option<String>,
}

/// An object.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Unique among objects.
    pub name: String,
    /// The name of its type, such as `table`: chooses its space.
    pub class: String,
    /// Where it stands and faces.
    pub world_from_object: Isometry2<f64>,
    /// What it covers.
    pub outline: Outline,
}

/// Something scheduled with an object.
#[derive(Debug, Clone, PartialEq)]
pub struct Activity {
    /// What it is called.
    pub name: String,
    /// The object's name.
    pub object: String,
    /// When it starts.
    pub start: Time,
    /// When it ends.
    pub end: Time,
}

/// Why no map can be made of a scene.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SceneError {
    /// The bounds enclose nothing, or are no places.
    #[error(
        "the map's bounds {bounds:?} enclose nothing; need xmin < xmax and ymin < ymax within {FARTHEST:e} m"
    )]
    Bounds {
        /// As given.
        bounds: [f64; 4],
    },
    /// The grid would be larger than [`MOST_CELLS`].
    #[error(
        "the map's bounds {bounds:?} at {resolution} m a cell need {cells} cells; a grid has at most {MOST_CELLS}"
    )]
    TooLarge {
        /// As given.
        bounds: [f64; 4],
        /// Side of a cell, metres.
        resolution: f64,
        /// How many it would have.
        cells: f64,
    },
    /// A wall has an end that is no place: leaving it out would open the map.
    #[error("wall {index} has an end that is no place within {FARTHEST:e} m")]
    Wall {
        /// Its index in `walls`.
        index: usize,
    },
    /// The robot's radius is not a length.
    #[error("the robot's radius is {radius} m, where it may be from 0 m to {LARGEST_BODY} m")]
    RobotRadius {
        /// As given.
        radius: f64,
    },
}

/// The largest grid that is made: the 16 MiB of costs that a large value has at the most where the schema says nothing else.
pub const MOST_CELLS: f64 = 4_194_304.0;

/// Whether a grid may have so many cells.
///
/// # Errors
/// [`SceneError::TooLarge`].
pub fn check_size(bounds: [f64; 4], resolution: f64) -> Result<(), SceneError> {
    let [xmin, ymin, xmax, ymax] = bounds;
    let cells = ((xmax - xmin) / resolution).ceil() * ((ymax - ymin) / resolution).ceil();
    if cells > MOST_CELLS {
        return Err(SceneError::TooLarge {
            bounds,
            resolution,
            cells,
        });
    }
    Ok(())
}

impl SocialScene {
    /// Whether a map can be made of the scene at `resolution` metres a cell.
    pub(super) fn check(&self, resolution: f64) -> Result<(), SceneError> {
        let bounds = self.bounds;
        let [xmin, ymin, xmax, ymax] = bounds;
        if !bounds.iter().all(|b| b.abs() <= FARTHEST) || xmin >= xmax || ymin >= ymax {
            return Err(SceneError::Bounds { bounds });
        }
        check_size(bounds, resolution)?;
        if !(0.0..=LARGEST_BODY).contains(&self.robot_radius) {
            return Err(SceneError::RobotRadius {
                radius: self.robot_radius,
            });
        }
        match self
            .walls
            .iter()
            .position(|wall| !wall.iter().all(is_place))
        {
            Some(index) => Err(SceneError::Wall { index }),
            None => Ok(()),
        }
    }

    /// The people who can be mapped.
    pub(super) fn sound_people(&self, rejected: &mut Vec<Rejection>) -> Vec<Cow<'_, Person>> {
        let mut people = Vec::with_capacity(self.people.len());
        for person in &self.people {
            let name = || person.name.clone();
            if !is_pose(&person.world_from_person) {
                rejected.push(Rejection::PersonPose { name: name() });
                continue;
            }
            let mut sound = Cow::Borrowed(person);
            if !person.velocity.iter().all(|v| v.abs() <= MOST_SPEED) {
                rejected.push(Rejection::PersonVelocity { name: name() });
                sound.to_mut().velocity = Vector2::zeros();
            }
            if !(person.radius > 0.0 && person.radius <= LARGEST_BODY) {
                rejected.push(Rejection::PersonRadius {
                    name: name(),
                    radius: person.radius,
                });
                sound.to_mut().radius = BODY_RADIUS;
            }
            people.push(sound);
        }
        people
    }

    /// The objects that can be mapped.
    pub(super) fn sound_objects<'a>(&'a self, rejected: &mut Vec<Rejection>) -> Vec<&'a Object> {
        let (sound, bad): (Vec<_>, Vec<_>) = self
            .objects
            .iter()
            .partition(|o| is_pose(&o.world_from_object) && o.outline.is_valid());
        rejected.extend(bad.iter().map(|o| Rejection::Object {
            name: o.name.clone(),
        }));
        sound
    }

    /// The agenda of one object. Backward activities are left out here and reported by
    /// [`Self::check_uses`].
    pub(super) fn agenda(&self, object: &str) -> Vec<Agenda> {
        self.activities
            .iter()
            .filter(|activity| activity.object == object)
            .filter_map(|activity| Agenda::new(activity.start, activity.end).ok())
            .collect()
    }

    /// Reports what of the agenda and of R(t) is without effect: activities that do not end after they start, and objects
    /// that nobody has seen or that have no space.
    pub(super) fn check_uses(
        &self,
        objects: &[&Object],
        config: &SocialConfig,
        rejected: &mut Vec<Rejection>,
    ) {
        let mut used: Vec<(UsedBy, &str)> = Vec::new();
        for activity in &self.activities {
            let name = activity.name.clone();
            match Agenda::new(activity.start, activity.end) {
                Ok(_) => used.push((UsedBy::Activity(name), &activity.object)),
                Err(error) => rejected.push(Rejection::ActivityOrder {
                    activity: name,
                    error,
                }),
            }
        }
        let named = config.usage_of.keys();
        used.extend(named.map(|object| (UsedBy::Settings, object.as_str())));
        for (by, object) in used {
            let seen = objects.iter().find(|one| one.name == object);
            let object = object.to_owned();
            match seen {
                Some(seen) if config.spaces.contains_key(&seen.class) => {}
                Some(seen) => rejected.push(Rejection::NoSpace {
                    by,
                    object,
                    class: seen.class.clone(),
                }),
                None => {
                    let known = objects.iter().map(|one| one.name.as_str());
                    // What is not seen yet is no misspelling of all that is.
                    let near = dsr::suggest(&object, known);
                    rejected.push(Rejection::Unseen { by, object, near });
                }
            }
        }
    }
}

/// Whether a point is a place: finite, and at most [`FARTHEST`] along either axis.
pub fn is_place(point: &Point2<f64>) -> bool {
    point.x.abs() <= FARTHEST && point.y.abs() <= FARTHEST
}

/// Whether somebody or something can be at this pose: a place, and a heading.
pub fn is_pose(pose: &Isometry2<f64>) -> bool {
    is_place(&pose.translation.vector.into()) && pose.rotation.angle().is_finite()
}
