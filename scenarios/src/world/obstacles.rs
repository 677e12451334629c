//! What stands still and is solid: distances to it and lines of sight through it. Walls have no
//! thickness; a thing is solid over its whole outline.

use crate::scenario::{Object, Shape, Wall};
use nalgebra::{Point2, Vector2};

/// The solid things of a world.
#[derive(Debug, Clone)]
pub(super) struct Obstacles {
    pub(super) walls: Vec<Wall>,
    pub(super) objects: Vec<Object>,
}

/// The 2-D cross product.
pub(super) fn cross(a: Vector2<f64>, b: Vector2<f64>) -> f64 {
    a.x * b.y - a.y * b.x
}

/// Distance from `point` to the segment.
pub(super) fn distance_to_segment(point: Point2<f64>, [a, b]: Wall) -> f64 {
    let along = b - a;
    let length = along.norm_squared();
    let at = if length > 0.0 {
        ((point - a).dot(&along) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (point - (a + along * at)).norm()
}

/// Whether two segments meet, ends included.
pub(super) fn segments_meet([a, b]: Wall, [c, d]: Wall) -> bool {
    let side = |p: Point2<f64>, q: Point2<f64>, r: Point2<f64>| cross(q - p, r - p);
    let (abc, abd) = (side(a, b, c), side(a, b, d));
    let (cda, cdb) = (side(c, d, a), side(c, d, b));
    if abc == 0.0 && abd == 0.0 {
        // On one line: they meet where their stretches overlap.
        let along = b - a;
        let at = |p: Point2<f64>| (p - a).dot(&along);
        let (c, d) = (at(c).min(at(d)), at(c).max(at(d)));
        return d >= 0.0 && c <= at(b);
    }
    abc * abd <= 0.0 && cda * cdb <= 0.0
}

impl Obstacles {
    /// Whether no wall stands between two points.
    pub(super) fn sees(&self, from: Point2<f64>, to: Point2<f64>) -> bool {
        !self
            .walls
            .iter()
            .any(|wall| segments_meet([from, to], *wall))
    }

    /// Distance from `point` to the nearest wall, or to the nearest thing that one cannot sit on.
    pub(super) fn clearance_of_walker(&self, point: Point2<f64>) -> f64 {
        let walls = self
            .walls
            .iter()
            .map(|wall| distance_to_segment(point, *wall));
        let objects = self.objects.iter().filter(|object| object.class != "seat");
        walls
            .chain(objects.map(|object| object.distance(point)))
            .fold(f64::INFINITY, f64::min)
    }

    /// Every straight side that a laser may meet.
    pub(super) fn sides(&self) -> impl Iterator<Item = Wall> {
        let corners = self.objects.iter().filter_map(Object::corners);
        let sides = corners.flat_map(|c| [[c[0], c[1]], [c[1], c[2]], [c[2], c[3]], [c[3], c[0]]]);
        self.walls.iter().copied().chain(sides)
    }

    /// Every round thing that a laser may meet: its centre and radius.
    pub(super) fn discs(&self) -> impl Iterator<Item = (Point2<f64>, f64)> {
        let round = self
            .objects
            .iter()
            .filter(|object| object.shape == Shape::Circle);
        round.map(|object| (object.pose.translation.vector.into(), object.size.x / 2.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_meet_where_they_cross_touch_or_overlap() {
        let at = |x: f64, y: f64| Point2::new(x, y);
        let wall = [at(0.0, 0.0), at(2.0, 0.0)];
        assert!(segments_meet(wall, [at(1.0, -1.0), at(1.0, 1.0)]));
        assert!(
            segments_meet(wall, [at(2.0, 0.0), at(3.0, 1.0)]),
            "touching at an end"
        );
        assert!(
            segments_meet(wall, [at(1.0, 0.0), at(5.0, 0.0)]),
            "along the same line"
        );
        assert!(
            !segments_meet(wall, [at(2.5, 0.0), at(5.0, 0.0)]),
            "behind it on the same line"
        );
        assert!(!segments_meet(wall, [at(2.1, -1.0), at(2.1, 1.0)]));
        assert!(!segments_meet(wall, [at(1.0, 0.1), at(1.0, 1.0)]));
    }

    #[test]
    fn the_nearest_point_of_a_segment_is_inside_it_or_an_end() {
        let wall = [Point2::new(0.0, 0.0), Point2::new(2.0, 0.0)];
        assert!((distance_to_segment(Point2::new(1.0, 3.0), wall) - 3.0).abs() < 1e-12);
        assert!((distance_to_segment(Point2::new(5.0, 4.0), wall) - 5.0).abs() < 1e-12);
    }
}
