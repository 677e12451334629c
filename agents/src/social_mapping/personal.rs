//! The space of one person, from all that is known of them: what they do (AP Fig. 2), how fast they walk
//! (AP 2.1), what they feel and want (TG 3.3.3), what walls leave (FD IV-C), and where they want the
//! robot (AP 2.2). This file owns the order in which these act: activity, velocity, features, walls.

use super::adaptation::{Passage, wall_distances};
use super::config::SocialConfig;
use super::four_sided::FourSided;
use super::scene::{Manner, Person, Wall};
use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, PI};

/// Where somebody wants the robot: a sector of their personal space, outside of the intimate one,
/// which costs as much as free space (AP 2.2).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CooperationZone {
    /// Its middle, counter-clockwise from the heading, radians.
    pub direction: f64,
    /// Its full opening angle, radians.
    pub opening: f64,
}

impl CooperationZone {
    /// Where somebody wants the robot that comes to talk: a third of a half turn ahead. AP leaves the
    /// opening to whoever configures.
    pub const AHEAD: Self = Self {
        direction: 0.0,
        opening: FRAC_PI_3,
    };

    /// Whether a place in the person's own frame lies in the sector.
    pub fn contains(&self, place: Point2<f64>) -> bool {
        let off = place.y.atan2(place.x) - self.direction;
        off.sin().atan2(off.cos()).abs() <= self.opening / 2.0
    }

    pub(super) fn is_valid(&self) -> bool {
        self.direction.abs() <= 2.0 * PI && self.opening > 0.0 && self.opening <= 2.0 * PI
    }
}

/// The most zones that a task has (AP 2.2).
pub const MOST_ZONES: usize = 2;

/// AP's shapes: widths ahead, to the sides and behind while cooking, running, standing and in the
/// bathroom (Fig. 2).
pub(super) fn activities() -> BTreeMap<String, FourSided> {
    [
        ("cooking", [0.5, 1.5, 0.5, 1.5]),
        ("running", [2.0, 0.7, 0.7, 0.7]),
        ("standing", [0.8, 1.0, 1.0, 1.0]),
        ("in_the_bathroom", [2.5, 2.5, 2.5, 2.5]),
    ]
    .map(|(name, sides)| (name.to_owned(), FourSided::from_sides(sides)))
    .into_iter()
    .collect()
}

/// AP's tasks: approaching from ahead, escorting on either side, following behind. The paper leaves the
/// openings to whoever configures; a third of a half turn lets a robot in.
pub(super) fn cooperation() -> BTreeMap<String, Vec<CooperationZone>> {
    let zone = |direction: f64| CooperationZone {
        direction,
        opening: FRAC_PI_3,
    };
    [
        ("approach", vec![CooperationZone::AHEAD]),
        ("escort", vec![zone(FRAC_PI_2), zone(-FRAC_PI_2)]),
        ("follow", vec![zone(PI)]),
    ]
    .map(|(name, zones)| (name.to_owned(), zones))
    .into_iter()
    .collect()
}

/// What a person does: as is known of them, else as is usual in the room that they are in (AP 2.1).
pub fn activity_of<'a>(config: &'a SocialConfig, manner: &'a Manner) -> Option<&'a String> {
    let by_room = || config.activity_in.get(manner.room.as_ref()?);
    manner.activity.as_ref().or_else(by_room)
}

/// A person's widths where they stand or walk: the one shape of grid, outlines and pictures. Activities that the
/// configuration does not know leave the usual shape.
pub fn shape_of(config: &SocialConfig, person: &Person, walls: &[Wall]) -> FourSided {
    let usual = FourSided::from(config.proxemics.shape);
    let mut shape = activity_of(config, &person.manner)
        .and_then(|name| config.activities.get(name))
        .copied()
        .unwrap_or(usual);
    if config.stretch {
        let own = person.world_from_person.rotation.inverse() * person.velocity;
        shape = shape.walking(own.x);
    }
    let shape = config.features.apply(shape, &person.manner.features);
    match &config.walls {
        Some(law) => law.adapt(shape, wall_distances(&person.world_from_person, walls)),
        None => shape,
    }
}

/// What walls leave on each side of a person (front, left, rear, right), where the configuration asks.
pub fn passages_of(config: &SocialConfig, person: &Person, walls: &[Wall]) -> Option<[Passage; 4]> {
    let law = config.walls.as_ref()?;
    Some(law.passages(wall_distances(&person.world_from_person, walls)))
}

#[cfg(test)]
mod tests {
    use super::super::adaptation::WallAdaptation;
    use super::super::scene::BODY_RADIUS;
    use super::*;
    use nalgebra::{Isometry2, Vector2};

    fn person(manner: Manner) -> Person {
        Person {
            name: "ana".into(),
            world_from_person: Isometry2::identity(),
            velocity: Vector2::zeros(),
            radius: BODY_RADIUS,
            manner,
        }
    }

    #[test]
    fn what_somebody_does_and_feels_shapes_their_space() {
        let config = SocialConfig::default();
        let usual = shape_of(&config, &person(Manner::default()), &[]);
        assert_eq!(usual, FourSided::HALL);
        let walks = Person {
            velocity: Vector2::new(1.0, 0.0),
            ..person(Manner::default())
        };
        let walking = shape_of(&config, &walks, &[]);
        assert!((walking.front - 1.5).abs() < 1e-12);
        let cook = Manner {
            activity: Some("cooking".into()),
            ..Manner::default()
        };
        let cooking = shape_of(&config, &person(cook), &[]);
        assert_eq!(cooking.sides().map(|s| (s * 10.0) as i32), [5, 15, 5, 15]);
        let mut config = config;
        let room = Some("kitchen".to_owned());
        let in_kitchen = |manner| Manner {
            room: room.clone(),
            ..manner
        };
        config.activity_in = [("kitchen".to_owned(), "cooking".to_owned())].into();
        let by_room = shape_of(&config, &person(in_kitchen(Manner::default())), &[]);
        assert_eq!(by_room, cooking);
        let stands = in_kitchen(Manner {
            activity: Some("standing".into()),
            ..Manner::default()
        });
        let standing = shape_of(&config, &person(stands), &[]);
        assert_eq!(standing, config.activities["standing"]);
        let happy = Manner {
            features: config.features.parse("emotional_state=happy").unwrap(),
            ..Manner::default()
        };
        let happy = shape_of(&config, &person(happy), &[]);
        assert!(happy.front < usual.front && happy.left < usual.left);
    }

    #[test]
    fn walls_narrow_a_space_where_configured() {
        let wall = [Point2::new(1.65, -3.0), Point2::new(1.65, 3.0)];
        let mut config = SocialConfig::default();
        let ana = person(Manner::default());
        assert_eq!(shape_of(&config, &ana, &[wall]), FourSided::HALL);
        config.walls = Some(WallAdaptation::default());
        let narrow = shape_of(&config, &ana, &[wall]);
        assert!((narrow.front - 0.8f64.powf(0.976) / 1.2).abs() < 1e-9);
        let [front, left, ..] = passages_of(&config, &ana, &[wall]).unwrap();
        assert!(matches!(front, Passage::Adapted { .. }) && left == Passage::Free);
    }

    #[test]
    fn an_escort_walks_on_either_side() {
        let zones = &cooperation()["escort"];
        let inside = |x: f64, y: f64| zones.iter().any(|zone| zone.contains(Point2::new(x, y)));
        assert!(inside(0.0, 1.0) && inside(0.2, -1.0));
        assert!(!inside(1.0, 0.0) && !inside(-1.0, 0.0));
        assert!(cooperation()["follow"][0].contains(Point2::new(-1.0, -0.1)));
    }
}
