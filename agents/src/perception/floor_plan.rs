//! Rooms and walls as perception needs them: which room a point lies in, and whether a wall stands
//! between two points.

use geo::{Contains, Distance, Euclidean, Intersects, Line, LineString, Point, Polygon};
use nalgebra::Point2;

/// Rooms and walls in the world frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FloorPlan {
    rooms: Vec<(String, Polygon<f64>)>,
    walls: Vec<Line<f64>>,
}

fn coordinate(point: Point2<f64>) -> geo::Coord<f64> {
    geo::Coord {
        x: point.x,
        y: point.y,
    }
}

/// The polygon with corners `outline` (closed by itself), or `None` with fewer than three corners
/// or a corner that is not finite.
pub(crate) fn polygon(outline: &[Point2<f64>]) -> Option<Polygon<f64>> {
    let usable = outline.len() >= 3 && outline.iter().all(|p| p.x.is_finite() && p.y.is_finite());
    usable.then(|| {
        Polygon::new(
            outline
                .iter()
                .map(|&p| coordinate(p))
                .collect::<LineString>(),
            Vec::new(),
        )
    })
}

/// Metres from `point` to `polygon`; 0 inside.
pub(crate) fn distance_to_polygon(point: Point2<f64>, polygon: &Polygon<f64>) -> f64 {
    Euclidean.distance(&Point::from(coordinate(point)), polygon)
}

impl FloorPlan {
    /// A plan of `rooms` (name and outline, world frame, metres) and `walls` (end points). Where
    /// rooms overlap the first by name holds. Rooms without an area are left out.
    pub fn new(
        rooms: impl IntoIterator<Item = (String, Vec<Point2<f64>>)>,
        walls: impl IntoIterator<Item = [Point2<f64>; 2]>,
    ) -> Self {
        let mut rooms: Vec<_> = rooms
            .into_iter()
            .filter_map(|(name, outline)| Some((name, polygon(&outline)?)))
            .collect();
        rooms.sort_by(|a, b| a.0.cmp(&b.0));
        let walls = walls
            .into_iter()
            .map(|[a, b]| Line::new(coordinate(a), coordinate(b)))
            .collect();
        Self { rooms, walls }
    }

    /// The name of the room that `point` lies in.
    pub fn room_at(&self, point: Point2<f64>) -> Option<&str> {
        let point = Point::from(coordinate(point));
        self.rooms
            .iter()
            .find(|(_, polygon)| polygon.contains(&point))
            .map(|(name, _)| &**name)
    }

    /// The room to call `point`'s, for something that was in `current`: it stays there until it is
    /// more than `margin` metres outside, so that a pose that trembles on a threshold does not
    /// change rooms with every reading.
    pub fn room_after<'a>(
        &'a self,
        current: Option<&str>,
        point: Point2<f64>,
        margin: f64,
    ) -> Option<&'a str> {
        let stays = self.rooms.iter().find(|(name, polygon)| {
            Some(name.as_str()) == current && distance_to_polygon(point, polygon) <= margin
        });
        match stays {
            Some((name, _)) => Some(name),
            None => self.room_at(point),
        }
    }

    /// Whether a wall stands between `a` and `b`.
    pub fn wall_between(&self, a: Point2<f64>, b: Point2<f64>) -> bool {
        let sight = Line::new(coordinate(a), coordinate(b));
        self.walls.iter().any(|wall| wall.intersects(&sight))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x: f64) -> Vec<Point2<f64>> {
        [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]
            .map(|(dx, y)| Point2::new(x + dx, y))
            .to_vec()
    }

    fn plan() -> FloorPlan {
        FloorPlan::new(
            [
                ("kitchen".to_owned(), square(0.0)),
                ("hall".to_owned(), square(4.0)),
            ],
            [[Point2::new(4.0, 0.0), Point2::new(4.0, 3.0)]],
        )
    }

    #[test]
    fn a_point_lies_in_the_room_around_it() {
        assert_eq!(plan().room_at(Point2::new(1.0, 1.0)), Some("kitchen"));
        assert_eq!(plan().room_at(Point2::new(5.0, 1.0)), Some("hall"));
        assert_eq!(plan().room_at(Point2::new(9.0, 1.0)), None);
    }

    #[test]
    fn a_room_is_left_only_beyond_the_margin() {
        let plan = plan();
        let at = |x| Point2::new(x, 2.0);
        assert_eq!(
            plan.room_after(Some("kitchen"), at(4.1), 0.2),
            Some("kitchen")
        );
        assert_eq!(plan.room_after(Some("kitchen"), at(4.3), 0.2), Some("hall"));
        assert_eq!(plan.room_after(Some("hall"), at(3.9), 0.2), Some("hall"));
        assert_eq!(plan.room_after(None, at(3.9), 0.2), Some("kitchen"));
        assert_eq!(plan.room_after(Some("hall"), at(8.3), 0.2), None);
    }

    #[test]
    fn walls_block_the_sight_and_doors_do_not() {
        let plan = plan();
        assert!(plan.wall_between(Point2::new(3.0, 1.0), Point2::new(5.0, 1.0)));
        assert!(!plan.wall_between(Point2::new(3.0, 3.5), Point2::new(5.0, 3.5)));
    }

    #[test]
    fn a_room_without_area_is_no_room() {
        let plan = FloorPlan::new([("slit".to_owned(), vec![Point2::origin(); 2])], []);
        assert_eq!(plan, FloorPlan::default());
    }
}
