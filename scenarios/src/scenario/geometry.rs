//! Rooms to walls. Guarantees that a wall shared by two rooms comes out once, and that no wall
//! crosses a door.

use super::{Door, Room, Wall};
use geo::{Area, Centroid, Distance, Euclidean, Intersects, Validation};
use nalgebra::{Point2, Vector2};

/// A door this far from an outline still belongs to it (rooms may be drawn with thick walls).
pub(super) const DOOR_REACH: f64 = 0.15;

fn polygon(corners: &[Point2<f64>]) -> geo::Polygon {
    let ring = corners
        .iter()
        .map(|p| geo::Coord { x: p.x, y: p.y })
        .collect();
    geo::Polygon::new(ring, Vec::new())
}

/// Whether `point` lies in the polygon or on its outline.
pub(super) fn contains(corners: &[Point2<f64>], point: Point2<f64>) -> bool {
    polygon(corners).intersects(&geo::Point::new(point.x, point.y))
}

/// Whether the outline encloses an area without crossing itself.
pub(super) fn is_simple(corners: &[Point2<f64>]) -> bool {
    let polygon = polygon(corners);
    polygon.is_valid() && polygon.unsigned_area() > 1e-6
}

/// Centre of the area.
pub(super) fn centroid(corners: &[Point2<f64>]) -> Point2<f64> {
    let mean = corners
        .iter()
        .fold(Vector2::zeros(), |sum, p| sum + p.coords);
    polygon(corners)
        .centroid()
        .map_or(Point2::from(mean / corners.len() as f64), |c| {
            Point2::new(c.x(), c.y())
        })
}

/// Distance from `point` to the wall.
pub(super) fn distance_to_wall(point: Point2<f64>, wall: &Wall) -> f64 {
    let line = geo::Line::new((wall[0].x, wall[0].y), (wall[1].x, wall[1].y));
    Euclidean.distance(&geo::Point::new(point.x, point.y), &line)
}

/// The sides of a polygon.
pub(super) fn edges(corners: &[Point2<f64>]) -> impl Iterator<Item = Wall> {
    corners
        .iter()
        .zip(corners.iter().cycle().skip(1))
        .map(|(&a, &b)| [a, b])
}

/// How a door sits in an outline.
pub(super) enum Fit {
    /// On an edge of this direction.
    On(Vector2<f64>),
    /// Not on it; distance to the nearest edge.
    Off(f64),
    /// On an edge that leaves only this width about the door's middle.
    Narrow(f64),
}

/// How `door` sits in the outline of a room.
pub(super) fn fit(corners: &[Point2<f64>], position: Point2<f64>, width: f64) -> Fit {
    let nearest = edges(corners)
        .map(|edge| (distance_to_wall(position, &edge), edge))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((distance, edge)) = nearest else {
        return Fit::Off(f64::INFINITY);
    };
    if distance > DOOR_REACH {
        return Fit::Off(distance);
    }
    let along = (edge[1] - edge[0]).normalize();
    let middle = (position - edge[0]).dot(&along);
    let space = 2.0 * middle.min((edge[1] - edge[0]).norm() - middle);
    if space + 1e-9 < width {
        Fit::Narrow(space.max(0.0))
    } else {
        Fit::On(along)
    }
}

/// A line and the stretch of it that is wall.
struct Stretch {
    along: Vector2<f64>,
    /// Signed distance of the line from the origin.
    offset: f64,
    from: f64,
    to: f64,
}

impl Stretch {
    fn of(wall: &Wall) -> Self {
        let mut along = (wall[1] - wall[0]).normalize();
        if along.x < -1e-9 || (along.x.abs() <= 1e-9 && along.y < 0.0) {
            along = -along;
        }
        let (a, b) = (wall[0].coords.dot(&along), wall[1].coords.dot(&along));
        let offset = along.perp(&wall[0].coords);
        Self {
            along,
            offset,
            from: a.min(b),
            to: a.max(b),
        }
    }

    fn wall(&self) -> Wall {
        let normal = Vector2::new(-self.along.y, self.along.x) * self.offset;
        [self.from, self.to].map(|t| Point2::from(self.along * t + normal))
    }

    fn same_line(&self, other: &Self) -> bool {
        self.along.perp(&other.along).abs() < 1e-6 && (self.offset - other.offset).abs() < 1e-3
    }
}

/// Outlines of walled rooms and extra walls, less the doors, each stretch once.
pub(super) fn walls(rooms: &[Room], doors: &[Door], extra: &[Wall]) -> Vec<Wall> {
    let mut stretches: Vec<Stretch> = Vec::new();
    let outlines = rooms
        .iter()
        .filter(|room| room.walled)
        .flat_map(|room| edges(&room.polygon));
    for wall in outlines.chain(extra.iter().copied()) {
        if (wall[1] - wall[0]).norm() > 1e-9 {
            merge(&mut stretches, Stretch::of(&wall));
        }
    }
    for door in doors {
        stretches = stretches
            .into_iter()
            .flat_map(|stretch| cut(stretch, door))
            .collect();
    }
    stretches.iter().map(Stretch::wall).collect()
}

/// Adds a stretch, and joins it with those of the same line that it touches.
fn merge(stretches: &mut Vec<Stretch>, mut new: Stretch) {
    while let Some(at) = stretches.iter().position(|old| {
        old.same_line(&new) && old.from <= new.to + 1e-6 && new.from <= old.to + 1e-6
    }) {
        let old = stretches.swap_remove(at);
        new.from = new.from.min(old.from);
        new.to = new.to.max(old.to);
    }
    stretches.push(new);
}

/// What a door leaves of a stretch.
fn cut(stretch: Stretch, door: &Door) -> Vec<Stretch> {
    let offset = stretch.along.perp(&door.position.coords);
    let middle = door.position.coords.dot(&stretch.along);
    let (from, to) = (middle - door.width / 2.0, middle + door.width / 2.0);
    let parallel = stretch.along.perp(&door.along).abs() < 0.1;
    if !parallel
        || (offset - stretch.offset).abs() > DOOR_REACH
        || to <= stretch.from
        || from >= stretch.to
    {
        return vec![stretch];
    }
    [(stretch.from, from), (to, stretch.to)]
        .into_iter()
        .filter(|(from, to)| to - from > 1e-6)
        .map(|(from, to)| Stretch {
            from,
            to,
            ..stretch
        })
        .collect()
}
