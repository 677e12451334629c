//! Where exactly the robot shall drive for its task: a place inside a room beyond its door, a place
//! in front of a person, or the place itself. This file guarantees that a place offered in a room
//! lies inside it, and one offered for a person lies outside their personal space.

use super::people::Person;
use crate::grid::CostGrid;
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
    /// In front of a person, facing them.
    Person {
        /// The name of the person.
        name: String,
        /// How far from the person, metres. Personal space ends 1.18 m ahead of people.
        distance: f64,
    },
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

/// Where to talk to `person`: in front of them, else ever more to their side (the nearer side
/// first), facing them.
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
    [0.0, side, -side, 2.0 * side, -2.0 * side]
        .into_iter()
        .map(move |turn| {
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
    use crate::navigation::people::PERSONAL;

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
