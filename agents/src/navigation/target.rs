//! Where exactly the robot shall drive for its task: a place inside a room beyond its door, a place
//! in front of a person, or the place itself. This file guarantees that a place offered in a room
//! lies inside it, and one offered for a person lies outside their personal space.

mod join;

pub use join::{places_before, places_to_join};

use super::people::{PERSONAL, Person};
use crate::grid::CostGrid;
use crate::social_mapping::AsymmetricGaussian;
use geo::{Contains, Distance, Euclidean, LineString, Polygon};
use nalgebra::{Isometry2, Point2, Rotation2, Vector2, distance};
use std::f64::consts::{FRAC_PI_4, TAU};

/// What the robot shall get to.
#[derive(Debug, Clone, PartialEq)]
pub enum Target {
    /// Any place well inside a region, such as a room.
    Region {
        /// Its outline, world frame.
        polygon: Vec<Point2<f64>>,
        /// Where the robot comes in, such as the middle of the door.
        entry: Option<Point2<f64>>,
    },
    /// A point, whatever the heading.
    Point(Point2<f64>),
    /// A point and a heading.
    Pose(Isometry2<f64>),
    /// One of some places, the first that can be reached.
    Places(Vec<Destination>),
    /// Among people who stand together, facing their middle, outside the personal space of each.
    Group {
        /// Their names.
        members: Vec<String>,
    },
    /// In front of a person, facing them.
    Person {
        /// The name of the person.
        name: String,
        /// How far from the person, metres. Personal space ends 1.18 m ahead of people; nearer is
        /// where the person wants the robot, in the cooperation zone ahead (AP 2.2).
        distance: f64,
    },
    /// With a person who walks, for as long as it takes (AP 4.2).
    Company {
        /// The name of the person.
        name: String,
        /// At which place.
        place: Company,
        /// Where the way together ends; without it, it ends with the task.
        until: Option<End>,
    },
}

/// Where a way together ends: when both are well inside a region, and the robot out of its entry.
#[derive(Debug, Clone, PartialEq)]
pub struct End {
    /// The region's outline, world frame.
    pub polygon: Vec<Point2<f64>>,
    /// Where one comes in, such as the middle of the door.
    pub entry: Option<Point2<f64>>,
}

impl End {
    /// Whether a robot and its companion at these places are at the end.
    pub fn is_reached(&self, robot: Point2<f64>, companion: Point2<f64>) -> bool {
        let region = Region::new(&self.polygon);
        let inside = |place| region.depth(place) > INSIDE;
        let clear = self
            .entry
            .is_none_or(|entry| distance(&entry, &robot) > CLEAR_OF_ENTRY);
        inside(robot) && inside(companion) && clear
    }
}

/// Where the robot goes that keeps somebody company.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Company {
    /// At the person's right, else at their left; behind where neither has room, such as in a door.
    Beside,
    /// Behind the person.
    Behind,
}

impl Target {
    /// Whom the task leads to, or with whom.
    pub fn person(&self) -> Option<&str> {
        match self {
            Self::Person { name, .. } | Self::Company { name, .. } => Some(name),
            Self::Region { .. }
            | Self::Point(_)
            | Self::Pose(_)
            | Self::Places(_)
            | Self::Group { .. } => None,
        }
    }

    /// Whether it depends on where people are.
    pub fn follows_people(&self) -> bool {
        self.person().is_some() || matches!(self, Self::Group { .. })
    }

    /// Where those are whom it depends on: the person, or the middle of those of a group who are known.
    pub fn anchor(&self, people: &[Person]) -> Option<Point2<f64>> {
        if let Self::Group { members } = self {
            let known = people.iter().filter(|p| members.contains(&p.name));
            return join::middle(known);
        }
        let name = self.person()?;
        let person = people.iter().find(|person| person.name == name);
        person.map(Person::position)
    }

    /// Whether it moves with the person.
    pub fn is_company(&self) -> bool {
        matches!(self, Self::Company { .. })
    }
}

/// Something to carry out.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    /// Tells one task from the next.
    pub id: String,
    /// What to get to.
    pub target: Target,
}

/// A place at which a task ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Destination {
    /// Where, world frame.
    pub point: Point2<f64>,
    /// Where to face there, radians.
    pub heading: Option<f64>,
}

/// The robot is inside a region when it is so far from its outline, metres.
pub const INSIDE: f64 = 0.3;
/// Who stands this far from an entry leaves others room to come in, metres.
const CLEAR_OF_ENTRY: f64 = 1.3;
/// How far from the entry a place inside is looked for, metres, most wanted first.
const BEYOND_ENTRY: [f64; 4] = [0.8, 1.0, 1.2, 0.6];
/// A place inside should be so far from the outline, metres.
const COMFORT: f64 = 0.45;

/// The outline of a region.
#[derive(Debug, Clone)]
pub struct Region(Polygon<f64>);

impl Region {
    /// The region with these corners, in order.
    pub fn new(corners: &[Point2<f64>]) -> Self {
        let outline: LineString<f64> = corners.iter().map(|p| (p.x, p.y)).collect();
        Self(Polygon::new(outline, Vec::new()))
    }

    /// How far `place` is from the outline, metres: positive inside, negative outside.
    pub fn depth(&self, place: Point2<f64>) -> f64 {
        let place = geo::Point::new(place.x, place.y);
        let gap = Euclidean.distance(&place, self.0.exterior());
        if self.0.contains(&place) { gap } else { -gap }
    }

    /// A place inside for a robot that comes in at `entry`: 0.6 m to 1.2 m beyond it, where the grid
    /// is cheapest; without such a place or an entry, the place deepest inside. `None` where every
    /// place inside is blocked.
    pub fn place_inside(&self, entry: Option<Point2<f64>>, grid: &CostGrid) -> Option<Point2<f64>> {
        let near_entry = entry.into_iter().flat_map(|entry| {
            BEYOND_ENTRY.into_iter().flat_map(move |far| {
                (0..24).map(move |k| {
                    entry + Rotation2::new(TAU * f64::from(k) / 24.0) * Vector2::new(far, 0.0)
                })
            })
        });
        let beyond = near_entry.filter(|place| self.depth(*place) >= COMFORT);
        self.best(beyond, grid)
            .or_else(|| self.best(self.lattice().into_iter(), grid))
    }

    /// The cheapest and, of equally cheap ones, deepest free place inside; the first of equals.
    fn best(
        &self,
        places: impl Iterator<Item = Point2<f64>>,
        grid: &CostGrid,
    ) -> Option<Point2<f64>> {
        let mut best: Option<(f32, f64, Point2<f64>)> = None;
        for place in places {
            let Some(cost) = grid.cell_at(place).map(|cell| grid.cost(cell)) else {
                continue;
            };
            let depth = self.depth(place).min(1.0);
            let better = best.is_none_or(|(least, deepest, _)| {
                cost < least || (cost <= least && depth > deepest + 1e-6)
            });
            if cost.is_finite() && depth > 0.0 && better {
                best = Some((cost, depth, place));
            }
        }
        best.map(|(_, _, place)| place)
    }

    fn lattice(&self) -> Vec<Point2<f64>> {
        use geo::BoundingRect;
        let Some(bounds) = self.0.bounding_rect() else {
            return Vec::new();
        };
        let steps = |length: f64| (length / 0.25).floor() as usize;
        let (columns, rows) = (steps(bounds.width()), steps(bounds.height()));
        let at = |column: usize, row: usize| {
            let (x, y) = (column as f64 * 0.25, row as f64 * 0.25);
            Point2::new(bounds.min().x + x, bounds.min().y + y)
        };
        (0..=rows)
            .flat_map(|row| (0..=columns).map(move |column| at(column, row)))
            .collect()
    }
}

/// From somebody who is kept company to the robot's centre beside them, metres: in the outermost part of
/// personal space, which ends 0.88 m aside, for who comes nearer makes people step aside.
const ASIDE: f64 = 0.86;
/// Who still comes from behind keeps so much farther aside for each metre that is left, up to a metre: the
/// two close in along the way and not across it.
const WIDE: f64 = 0.4;
/// The same behind, where personal space ends 0.59 m away.
const BEHIND: f64 = 0.9;
/// The robot aims at where its companion will be in so many seconds: it brakes for the end of its way.
const AHEAD: f64 = 0.6;
/// So many times that far ahead, there must be room beside the companion, too: falling behind takes time.
const FALLING_BEHIND: f64 = 4.0;
/// The nearest part of the way from a companion to a place that counts, metres: they may walk beside a
/// wall themselves.
const OWN_ROOM: f64 = 0.35;

/// Where to keep `person` company, the best place first; one aside only if it is free on `grid`, and no
/// wall lies between.
pub fn places_with(
    person: &Person,
    place: Company,
    grid: &CostGrid,
    robot: Point2<f64>,
) -> impl Iterator<Item = Destination> + use<> {
    let ahead = if person.is_walking() {
        person.velocity * AHEAD
    } else {
        Vector2::zeros()
    };
    let position = person.position() + ahead;
    let heading = if person.is_walking() {
        person.velocity.y.atan2(person.velocity.x)
    } else {
        person.world_from_person.rotation.angle()
    };
    let turned = Rotation2::new(heading);
    let free_from = |position: Point2<f64>, offset: Vector2<f64>| {
        let steps = (offset.norm() / grid.resolution).ceil().max(1.0);
        (0..=steps as usize).all(|k| {
            let along = offset * (k as f64 / steps);
            let cell = grid.cell_at(position + along);
            along.norm() < OWN_ROOM || cell.is_some_and(|cell| grid.cost(cell).is_finite())
        })
    };
    // Also where the companion will be while the robot falls behind.
    let later = ahead * FALLING_BEHIND;
    let samples = (later.norm() / grid.resolution).ceil().max(1.0);
    let has_room = |offset: Vector2<f64>| {
        (0..=samples as usize).all(|k| {
            let then = position + later * (k as f64 / samples);
            grid.cell_at(then).is_none() || free_from(then, offset)
        })
    };
    let left = (position - robot)
        .dot(&(turned * Vector2::x()))
        .clamp(0.0, 1.0);
    let aside: Vec<Vector2<f64>> = [-1.0, 1.0]
        .into_iter()
        .map(|side| turned * Vector2::new(0.0, side))
        .filter(|side| place == Company::Beside && has_room(side * ASIDE))
        .map(|side| {
            let wide = side * (ASIDE + WIDE * left);
            if free_from(position, wide) {
                wide
            } else {
                side * ASIDE
            }
        })
        .collect();
    // The nearest place behind that is as far along the way as the companion allows.
    let behind = turned * Vector2::new(-BEHIND, 0.0);
    let offsets = aside.into_iter().chain([behind]);
    offsets.map(move |offset| Destination {
        point: position + offset,
        heading: Some(heading),
    })
}

/// Where to talk to `person`: in front of them, else ever more to their side (the nearer side
/// first), facing them. Within personal space only in front of them, where they want the robot; there,
/// farther places come after the wanted one (AP 4.1).
pub fn places_to_talk(
    person: &Person,
    far: f64,
    robot: Point2<f64>,
) -> impl Iterator<Item = Destination> {
    let (position, facing) = (person.position(), person.world_from_person.rotation);
    let offset = person.world_from_person.inverse_transform_point(&robot);
    let side = if offset.y >= 0.0 {
        FRAC_PI_4
    } else {
        -FRAC_PI_4
    };
    let within = far < AsymmetricGaussian::HALL.front * PERSONAL.sqrt();
    let places = if within {
        [0.0, 0.25, 0.5, 0.75, 1.0].map(|farther| (0.0, far + farther))
    } else {
        [0.0, side, -side, 2.0 * side, -2.0 * side].map(|turn| (turn, far))
    };
    places.into_iter().map(move |(turn, far)| {
        let outward = Rotation2::new(turn) * Vector2::new(far, 0.0);
        let point = position + facing * outward;
        let back = position - point;
        Destination {
            point,
            heading: Some(back.y.atan2(back.x)),
        }
    })
}

/// Whether two people's places, or one person's at two times, differ enough to drive elsewhere.
pub(super) fn has_moved(from: Point2<f64>, to: Point2<f64>) -> bool {
    distance(&from, &to) > 0.3
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::BLOCKED;
    use crate::navigation::people::INTIMATE;

    fn room() -> Region {
        Region::new(
            &[(2.0, 0.0), (6.0, 0.0), (6.0, 4.0), (2.0, 4.0)].map(|(x, y)| Point2::new(x, y)),
        )
    }

    #[test]
    fn the_place_in_a_room_lies_beyond_the_door_and_off_the_walls() {
        let grid = CostGrid::covering([0.0, 0.0, 6.0, 4.0], 0.1);
        let door = Point2::new(2.0, 2.0);
        let place = room().place_inside(Some(door), &grid).unwrap();
        assert!(
            room().depth(place) >= 0.6 && distance(&door, &place) <= 1.2 + 1e-9,
            "{place}"
        );
        assert!(room().depth(Point2::new(1.5, 2.0)) < -0.49);
    }

    #[test]
    fn where_all_beyond_the_door_is_blocked_the_deepest_free_place_is_taken() {
        let mut grid = CostGrid::covering([0.0, 0.0, 6.0, 4.0], 0.1);
        for row in 0..40 {
            for column in 0..40 {
                grid.costs[row * 60 + column] = BLOCKED;
            }
        }
        let place = room()
            .place_inside(Some(Point2::new(2.0, 2.0)), &grid)
            .unwrap();
        assert!(place.x >= 4.0 && room().depth(place) >= 0.95, "{place}");
        grid.costs.fill(BLOCKED);
        assert_eq!(room().place_inside(None, &grid), None);
    }

    #[test]
    fn company_is_kept_at_the_right_else_at_the_left_and_behind_in_a_door() {
        let mut grid = CostGrid::covering([0.0, 0.0, 10.0, 5.0], 0.1);
        let walker = |x: f64, y: f64| Person {
            name: "ana".into(),
            world_from_person: Isometry2::new(Vector2::new(x, y), 0.0),
            velocity: Vector2::new(0.5, 0.0),
            radius: 0.25,
        };
        let side = |grid: &CostGrid, person: &Person| {
            let robot = person.position() - Vector2::new(2.0, 0.0);
            let place = places_with(person, Company::Beside, grid, robot).next();
            let place = person.world_from_person.inverse() * place.unwrap().point;
            assert!(
                person
                    .predicted(AHEAD)
                    .squared_deviation(person.world_from_person * place)
                    > INTIMATE
            );
            (place.y * 2.0).round() as i32
        };
        assert_eq!(
            side(&grid, &walker(2.0, 2.5)),
            -3,
            "wide on the right from behind"
        );
        assert_eq!(side(&grid, &walker(2.0, 0.6)), 3, "no room on the right");
        for row in (0..20).chain(30..50) {
            grid.costs[row * 100 + 50] = BLOCKED;
        }
        assert_eq!(side(&grid, &walker(4.0, 2.5)), 0, "a door is near");
        assert_eq!(side(&grid, &walker(6.0, 2.5)), -3, "the door is behind");
        let behind = places_with(&walker(2.0, 2.5), Company::Behind, &grid, Point2::origin());
        assert_eq!(behind.count(), 1);
    }

    #[test]
    fn within_personal_space_one_talks_in_front_only() {
        let person = Person {
            name: "ana".into(),
            world_from_person: Isometry2::new(Vector2::new(3.0, 1.0), 0.5),
            velocity: Vector2::zeros(),
            radius: 0.25,
        };
        for place in places_to_talk(&person, 0.57, Point2::new(0.0, 9.0)) {
            let own = person
                .world_from_person
                .inverse_transform_point(&place.point);
            assert!(own.y.abs() < 1e-9 && own.x > 0.56, "{own}");
        }
    }

    #[test]
    fn the_first_place_to_talk_is_in_front_and_all_are_outside_personal_space() {
        let person = Person {
            name: "ana".into(),
            world_from_person: Isometry2::new(Vector2::new(3.0, 1.0), 0.5),
            velocity: Vector2::zeros(),
            radius: 0.25,
        };
        let places: Vec<_> = places_to_talk(&person, 1.3, Point2::new(0.0, 9.0)).collect();
        assert!(
            (places[0].point
                - (person.position() + Vector2::new(0.5f64.cos(), 0.5f64.sin()) * 1.3))
                .norm()
                < 1e-9
        );
        let now = person.predicted(0.0);
        for place in places {
            assert!(now.squared_deviation(place.point) > PERSONAL);
            let facing = Rotation2::new(place.heading.unwrap()) * Vector2::new(1.3, 0.0);
            assert!((place.point + facing - person.position()).norm() < 1e-9);
        }
    }
}
