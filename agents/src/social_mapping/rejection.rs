//! What of a scene was left out or mended, and why: this file owns the words for it, and guarantees that each says of
//! what it speaks.

use super::features::FeatureError;
use super::groups::TooCrowded;
use super::limits::{LARGEST_BODY, MOST_LENGTH, MOST_SPEED};
use super::object_space::NoDuration;
use super::scene::{BODY_RADIUS, FARTHEST};
use std::fmt;

/// An item that was left out of the map or mended.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Rejection {
    /// The person is left out.
    #[error("person {name} is ignored: the pose is no place within {FARTHEST:e} m")]
    PersonPose {
        /// The person.
        name: String,
    },
    /// The person counts as standing still.
    #[error(
        "person {name} is taken to stand still: the velocity is none of up to {MOST_SPEED} m/s"
    )]
    PersonVelocity {
        /// The person.
        name: String,
    },
    /// The person has the radius [`BODY_RADIUS`].
    #[error(
        "person {name} is given the usual radius, {BODY_RADIUS} m: {radius} m is none up to {LARGEST_BODY} m"
    )]
    PersonRadius {
        /// The person.
        name: String,
        /// As given.
        radius: f64,
    },
    /// The object is left out.
    #[error(
        "object {name} is ignored: its pose is no place within {FARTHEST:e} m, or its size none of up to \
         {MOST_LENGTH} m"
    )]
    Object {
        /// The object.
        name: String,
    },
    /// The person counts as doing nothing in particular, or as working with the robot at nothing.
    #[error("person {name}: there is no {what} called `{given}`{help}")]
    PersonManner {
        /// The person.
        name: String,
        /// `activity` or `task`.
        what: &'static str,
        /// As given.
        given: String,
        /// The nearest name in the configuration, or all.
        help: String,
    },
    /// The person counts as being in the first of them.
    #[error("person {name} is in several rooms, {rooms}: {first} counts")]
    PersonRooms {
        /// The person.
        name: String,
        /// The rooms by name.
        rooms: String,
        /// The first.
        first: String,
    },
    /// The person's features are left out.
    #[error("person {name} has no features: {error}")]
    PersonFeatures {
        /// The person.
        name: String,
        /// What is wrong.
        error: FeatureError,
    },
    /// The settings stay as they were.
    #[error("the social settings of the world are not used: {problem}")]
    Settings {
        /// What is wrong.
        problem: String,
    },
    /// The grid given out before is the last one.
    #[error("the new social grid is not given out: {problem}")]
    Grid {
        /// Why.
        problem: String,
    },
    /// Nobody is in a group.
    #[error(transparent)]
    Groups(#[from] TooCrowded),
    /// The space between the two is left out.
    #[error("{name} and {other} interact, but nobody called {missing} has a place")]
    Interaction {
        /// One of them.
        name: String,
        /// The other.
        other: String,
        /// Whom the map does not have.
        missing: String,
    },
    /// The space between the two is left out: nobody talks across that distance.
    #[error("{name} and {other} interact at {distance:.1} m: too far for a space between them")]
    InteractionTooFar {
        /// One of them.
        name: String,
        /// The other.
        other: String,
        /// Between them, metres.
        distance: f64,
    },
    /// The activity is left out.
    #[error("activity {activity} is ignored: {error}")]
    ActivityOrder {
        /// The activity.
        activity: String,
        /// What is wrong.
        error: NoDuration,
    },
    /// The activity is left out.
    #[error("activity {activity} is ignored: its start or end is not a time")]
    ActivityTime {
        /// The activity.
        activity: String,
    },
    /// What names the object has no effect until the object is seen.
    #[error("{by} waits: nothing called `{object}` has been seen so far{}", did_you_mean(near.as_deref()))]
    Unseen {
        /// What names it.
        by: UsedBy,
        /// The name given.
        object: String,
        /// The nearest of the names that were seen, where one is near.
        near: Option<String>,
    },
    /// What names the object has no effect.
    #[error("{by} has no effect: {object} is of the class {class}, which has no space")]
    NoSpace {
        /// What names it.
        by: UsedBy,
        /// The object.
        object: String,
        /// Its class.
        class: String,
    },
    /// Nobody is inside or outside of such a room.
    #[error("the polygon of {room} is no room's: {problem}")]
    Polygon {
        /// The room.
        room: String,
        /// What is wrong.
        problem: String,
    },
    /// What is usually done in the room has no effect.
    #[error("`activity_in` has no effect: there is no room called `{room}`")]
    Room {
        /// The name given.
        room: String,
    },
}

/// What names an object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum UsedBy {
    /// An activity, by its name.
    Activity(String),
    /// `usage_of` of the settings.
    Settings,
}

impl fmt::Display for UsedBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Activity(name) => write!(f, "activity {name}"),
            Self::Settings => f.write_str("`usage_of`"),
        }
    }
}

/// The node at which what is wrong was entered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Entered<'a> {
    /// The world: its settings.
    World,
    /// The activity of this name.
    Activity(&'a str),
    /// The person of this name.
    Person(&'a str),
}

impl Rejection {
    /// Where somebody entered it; `None` for what was measured.
    pub fn entered(&self) -> Option<Entered<'_>> {
        match self {
            Self::PersonManner { name, .. } | Self::PersonFeatures { name, .. } => {
                Some(Entered::Person(name))
            }
            Self::ActivityOrder { activity, .. } | Self::ActivityTime { activity } => {
                Some(Entered::Activity(activity))
            }
            Self::Unseen { by, .. } | Self::NoSpace { by, .. } => Some(match by {
                UsedBy::Activity(name) => Entered::Activity(name),
                UsedBy::Settings => Entered::World,
            }),
            Self::Settings { .. }
            | Self::Grid { .. }
            | Self::Room { .. }
            | Self::Polygon { .. } => Some(Entered::World),
            Self::PersonPose { .. }
            | Self::PersonVelocity { .. }
            | Self::PersonRadius { .. }
            | Self::PersonRooms { .. }
            | Self::Object { .. }
            | Self::Groups(_)
            | Self::Interaction { .. }
            | Self::InteractionTooFar { .. } => None,
        }
    }

    /// Whether it may come right by itself, once more has been seen.
    pub fn is_waiting(&self) -> bool {
        matches!(self, Self::Unseen { .. })
    }
}

fn did_you_mean(near: Option<&str>) -> String {
    near.map_or_else(String::new, |name| format!("; did you mean `{name}`?"))
}
