//! How little a place suits a robot, from 0 (nobody minds) to 1: the one number that a planner or a
//! person wants. This file owns what makes a place uncomfortable, and guarantees that the worst of
//! all reasons decides: reasons are not added up, because people's own ratings are ranked better by
//! the maximum (READING.md item 5).

use super::gaussian::AsymmetricGaussian;
use super::groups::{Grouping, TooCrowded};
use super::scene::{FARTHEST, Wall, is_place, is_pose};
use super::stamps::distance_to_segment;
use geo::Validation;
use nalgebra::{Isometry2, Point2};
use serde::{Deserialize, Serialize};

/// A situation, in any one frame; metres.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ComfortScene {
    /// Where people stand and face.
    pub people: Vec<Isometry2<f64>>,
    /// From whom to whom, or to what, somebody attends.
    pub links: Vec<Wall>,
    /// Corners of the room, either way round; none for a place without walls.
    pub room: Vec<Point2<f64>>,
    /// Walls beside the room's outline.
    pub walls: Vec<Wall>,
}

/// Why a place has no comfort.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ComfortError {
    /// The place itself is nowhere.
    #[error("the place is not within {FARTHEST:e} m")]
    Place,
    /// Somebody is nowhere.
    #[error("the pose of person {index} is no place within {FARTHEST:e} m")]
    Person {
        /// Index among the people.
        index: usize,
    },
    /// Somebody attends to nowhere.
    #[error("link {index} has an end that is no place within {FARTHEST:e} m")]
    Link {
        /// Index among the links.
        index: usize,
    },
    /// A wall is nowhere.
    #[error("wall {index} has an end that is no place within {FARTHEST:e} m")]
    Wall {
        /// Index among the walls.
        index: usize,
    },
    /// A corner of the room is nowhere.
    #[error("corner {index} of the room is no place within {FARTHEST:e} m")]
    Corner {
        /// Index among the corners.
        index: usize,
    },
    /// Nothing fits into the room.
    #[error("the room of {corners} corners encloses nothing")]
    Room {
        /// How many corners it has.
        corners: usize,
    },
    /// An outline that crosses or touches itself leaves open what is inside.
    #[error("the outline of the room, of {corners} corners, crosses itself")]
    Crossed {
        /// How many corners it has.
        corners: usize,
    },
    /// Too many people to look for groups among.
    #[error(transparent)]
    People(#[from] TooCrowded),
}

/// What makes a place uncomfortable, and how much.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Comfort {
    /// People's density: the cost of a place is at least that of everybody's density there.
    pub shape: AsymmetricGaussian,
    /// The cost of standing right between two who attend to each other, or between somebody and
    /// what they attend to: that of the edge of intimate space.
    pub between: f64,
    /// How fast that falls off to the sides: a standard deviation, metres. The half width of the
    /// space between two.
    pub between_width: f64,
    /// How groups are found. Between any two of a group is like between two who are linked.
    pub grouping: Grouping,
}

impl Default for Comfort {
    fn default() -> Self {
        Self {
            shape: AsymmetricGaussian::HALL,
            between: 0.9,
            between_width: 0.5,
            grouping: Grouping::default(),
        }
    }
}

impl Comfort {
    /// The cost of `place`, in [0, 1]: the greatest of people's densities there and the costs of
    /// being between. Who is behind a wall does not mind; outside of the room it is 1, because
    /// nobody can be there.
    ///
    /// Linear in people, links and walls, and quadratic in the members of a group.
    ///
    /// # Errors
    /// [`ComfortError`].
    pub fn cost(&self, scene: &ComfortScene, place: Point2<f64>) -> Result<f64, ComfortError> {
        scene.check(place)?;
        if !scene.room.is_empty() && !contains(&scene.room, place) {
            return Ok(1.0);
        }
        let edges = scene
            .room
            .iter()
            .zip(scene.room.iter().cycle().skip(1))
            .map(|(a, b)| [*a, *b]);
        let walls: Vec<Wall> = edges.chain(scene.walls.iter().copied()).collect();
        let seen = |from: Point2<f64>| !walls.iter().any(|wall| cross(&[from, place], wall));
        let position = |person: &Isometry2<f64>| Point2::from(person.translation.vector);
        let mut links = scene.links.clone();
        for group in self.grouping.groups(&scene.people)? {
            for (at, one) in group.iter().enumerate() {
                let others = group[..at].iter();
                links
                    .extend(others.map(|other| [*one, *other].map(|i| position(&scene.people[i]))));
            }
        }
        let people = scene
            .people
            .iter()
            .filter(|person| seen(position(person)))
            .map(|person| self.shape.density(person, place));
        let between = links
            .iter()
            .filter(|link| link.iter().any(|end| seen(*end)))
            .map(|link| {
                let deviation = distance_to_segment(place, link) / self.between_width;
                self.between * (-0.5 * deviation * deviation).exp()
            });
        Ok(people.chain(between).fold(0.0, f64::max))
    }
}

impl ComfortScene {
    fn check(&self, place: Point2<f64>) -> Result<(), ComfortError> {
        if !is_place(&place) {
            return Err(ComfortError::Place);
        }
        if let Some(index) = self.people.iter().position(|pose| !is_pose(pose)) {
            return Err(ComfortError::Person { index });
        }
        let broken = |walls: &[Wall]| walls.iter().position(|ends| !ends.iter().all(is_place));
        if let Some(index) = broken(&self.links) {
            return Err(ComfortError::Link { index });
        }
        if let Some(index) = broken(&self.walls) {
            return Err(ComfortError::Wall { index });
        }
        if self.room.is_empty() {
            return Ok(());
        }
        check_room(&self.room)
    }
}

/// Whether a closed outline is that of a room.
///
/// # Errors
/// [`ComfortError::Corner`], [`ComfortError::Room`], [`ComfortError::Crossed`].
pub fn check_room(room: &[Point2<f64>]) -> Result<(), ComfortError> {
    let corners = room.len();
    if let Some(index) = room.iter().position(|corner| !is_place(corner)) {
        return Err(ComfortError::Corner { index });
    }
    if area(room) < LEAST_AREA {
        return Err(ComfortError::Room { corners });
    }
    if !is_simple(room) {
        return Err(ComfortError::Crossed { corners });
    }
    Ok(())
}

/// A room smaller than this is none, m^2: corners in one line enclose as much by rounding.
const LEAST_AREA: f64 = 1e-6;

/// What a closed outline encloses, m^2 (shoelace).
fn area(outline: &[Point2<f64>]) -> f64 {
    let Some(first) = outline.first() else {
        return 0.0;
    };
    // From the first corner, so that squares of large coordinates do not swallow a small room.
    let pairs = outline
        .windows(2)
        .map(|pair| (pair[0] - first, pair[1] - first));
    let twice: f64 = pairs.map(|(a, b)| a.perp(&b)).sum();
    (twice / 2.0).abs()
}

/// Whether a closed outline crosses itself nowhere.
fn is_simple(outline: &[Point2<f64>]) -> bool {
    let ring = outline.iter().map(|p| geo::Coord { x: p.x, y: p.y });
    geo::Polygon::new(ring.collect(), Vec::new()).is_valid()
}

/// Whether a point is within a closed outline (even-odd).
fn contains(outline: &[Point2<f64>], point: Point2<f64>) -> bool {
    let pairs = outline.iter().zip(outline.iter().cycle().skip(1));
    let crossings = pairs.filter(|(a, b)| {
        (a.y <= point.y) != (b.y <= point.y)
            && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
    });
    crossings.count() % 2 == 1
}

/// Whether two stretches cross in a point inside both.
fn cross([a, b]: &Wall, [c, d]: &Wall) -> bool {
    let side = |p: &Point2<f64>, q: &Point2<f64>, r: &Point2<f64>| (q - p).perp(&(r - p));
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn at(x: f64, y: f64, heading: f64) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(x, y), heading)
    }

    fn cost(scene: &ComfortScene, x: f64, y: f64) -> f64 {
        Comfort::default().cost(scene, Point2::new(x, y)).unwrap()
    }

    fn square() -> Vec<Point2<f64>> {
        [(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)]
            .map(|(x, y)| Point2::new(x, y))
            .to_vec()
    }

    #[test]
    fn the_worst_reason_decides() {
        let mut scene = ComfortScene {
            people: vec![at(0.0, 0.0, 0.0)],
            ..ComfortScene::default()
        };
        assert!((cost(&scene, 1.0, 0.0) - (-0.5f64).exp()).abs() < 1e-12);
        // Somebody far away changes nothing, and neither would a second one at the same place.
        scene.people.push(at(-8.0, 0.0, PI));
        scene.people.push(at(0.0, 0.0, 0.0));
        assert!((cost(&scene, 1.0, 0.0) - (-0.5f64).exp()).abs() < 1e-12);
        assert!(cost(&ComfortScene::default(), 1.0, 0.0).abs() < 1e-12);
    }

    #[test]
    fn between_two_who_attend_to_each_other_is_no_place() {
        let people = vec![at(0.0, 0.0, 0.0), at(3.4, 0.0, PI)];
        let ends = [0.0, 3.4].map(|x| Point2::new(x, 0.0));
        let apart = ComfortScene {
            people: people.clone(),
            ..ComfortScene::default()
        };
        let linked = ComfortScene {
            people,
            links: vec![ends],
            ..ComfortScene::default()
        };
        assert!((cost(&linked, 1.7, 0.0) - 0.9).abs() < 1e-12);
        assert!(cost(&apart, 1.7, 0.0) < 0.3);
        // Two who stand close and face each other are a group without being told so.
        let near = ComfortScene {
            people: vec![at(0.0, 0.0, 0.0), at(1.2, 0.0, PI)],
            ..ComfortScene::default()
        };
        assert!((cost(&near, 0.6, 0.0) - 0.9).abs() < 1e-12);
    }

    #[test]
    fn walls_end_peoples_claims_and_the_room() {
        let mut scene = ComfortScene {
            people: vec![at(-1.0, 0.0, 0.0)],
            room: square(),
            ..ComfortScene::default()
        };
        assert!(cost(&scene, 0.0, 0.0) > 0.6);
        assert!((cost(&scene, 2.5, 0.0) - 1.0).abs() < 1e-12);
        scene.walls = vec![[Point2::new(-0.5, -2.0), Point2::new(-0.5, 2.0)]];
        assert!(cost(&scene, 0.0, 0.0).abs() < 1e-12);
    }

    #[test]
    fn what_cannot_be_is_refused_for_what_it_is() {
        let refused = |scene: ComfortScene, x: f64| {
            Comfort::default()
                .cost(&scene, Point2::new(x, 0.0))
                .unwrap_err()
                .to_string()
        };
        let empty = ComfortScene::default;
        assert_eq!(refused(empty(), f64::NAN), "the place is not within 1e8 m");
        let nowhere = ComfortScene {
            people: vec![at(0.0, 0.0, 0.0), at(0.0, f64::INFINITY, 0.0)],
            ..empty()
        };
        assert_eq!(
            refused(nowhere, 0.0),
            "the pose of person 1 is no place within 1e8 m"
        );
        let flat = ComfortScene {
            room: [0.0, 1.0, 2.0].map(|x| Point2::new(x, x)).to_vec(),
            ..empty()
        };
        assert_eq!(refused(flat, 0.0), "the room of 3 corners encloses nothing");
        let line = ComfortScene {
            room: [0.1, 0.2, 0.7].map(|x| Point2::new(x, 3.0 * x)).to_vec(),
            ..empty()
        };
        assert_eq!(refused(line, 0.0), "the room of 3 corners encloses nothing");
        let torn = ComfortScene {
            room: [0.0, 1.0, 1e200].map(|x| Point2::new(x, x * x)).to_vec(),
            ..empty()
        };
        assert_eq!(
            refused(torn, 0.0),
            "corner 2 of the room is no place within 1e8 m"
        );
        let crossed = ComfortScene {
            room: [(-2.0, -2.0), (2.0, 2.0), (2.0, -2.0), (-2.0, 1.0)]
                .map(|(x, y)| Point2::new(x, y))
                .to_vec(),
            ..empty()
        };
        assert_eq!(
            refused(crossed, 0.0),
            "the outline of the room, of 4 corners, crosses itself"
        );
        let open = ComfortScene {
            links: vec![[Point2::origin(), Point2::new(f64::NAN, 0.0)]],
            ..empty()
        };
        assert_eq!(
            refused(open, 0.0),
            "link 0 has an end that is no place within 1e8 m"
        );
    }

    proptest! {
        #[test]
        fn costs_stay_between_0_and_1_and_one_more_person_never_comforts(
            people in prop::collection::vec((-3.0..3.0f64, -3.0..3.0f64, -4.0..4.0f64), 0..6),
            x in -3.0..3.0f64, y in -3.0..3.0f64,
        ) {
            let people: Vec<_> = people.into_iter().map(|(x, y, t)| at(x, y, t)).collect();
            let scene = |count: usize| ComfortScene {
                people: people[..count].to_vec(),
                ..ComfortScene::default()
            };
            // Groups may come apart when somebody comes; the density of people never falls.
            let lonely = Comfort { between: 0.0, ..Comfort::default() };
            let place = Point2::new(x, y);
            let mut before = 0.0;
            for count in 0..=people.len() {
                let cost = Comfort::default().cost(&scene(count), place).unwrap();
                prop_assert!((0.0..=1.0).contains(&cost));
                let density = lonely.cost(&scene(count), place).unwrap();
                prop_assert!(density >= before);
                before = density;
            }
        }
    }
}
