//! Walls cut the space of an object off: nobody watches a television through one. This file owns
//! the clipping of a convex polygon to what can be seen from a point inside it; without walls in
//! the polygon it comes back unchanged.

use super::scene::Wall;
use nalgebra::{Point2, Vector2};

/// Rays beside each event look just past the corner, radians (a centimetre at a kilometre).
const BESIDE: f64 = 1e-5;
/// Points closer than this on the outline are one, metres: rays beside a corner find it again.
const MERGE: f64 = 1e-3;

/// The part of the convex `polygon` (counter-clockwise) that is visible from `viewpoint` past
/// `walls`, counter-clockwise. Where the viewpoint is not inside, the polygon itself.
///
/// Exact up to `1e-5` rad. O((n + m) m) for n corners and m walls in the polygon.
pub(super) fn visible(
    polygon: &[Point2<f64>],
    viewpoint: Point2<f64>,
    walls: &[Wall],
) -> Vec<Point2<f64>> {
    let edges: Vec<Wall> = (0..polygon.len())
        .map(|i| [polygon[i], polygon[(i + 1) % polygon.len()]])
        .collect();
    let inside = |p: Point2<f64>| edges.iter().all(|[a, b]| (b - a).perp(&(p - a)) >= 0.0);
    if !inside(viewpoint) {
        return polygon.to_vec();
    }
    let near: Vec<Wall> = walls
        .iter()
        .filter(|[a, b]| {
            inside(*a) || inside(*b) || edges.iter().any(|edge| meet(edge, &[*a, *b]).is_some())
        })
        .copied()
        .collect();
    if near.is_empty() {
        return polygon.to_vec();
    }

    let mut events: Vec<Point2<f64>> = polygon.to_vec();
    for (i, wall) in near.iter().enumerate() {
        events.extend(wall.iter().filter(|p| inside(**p)));
        events.extend(edges.iter().filter_map(|edge| meet(edge, wall)));
        events.extend(near[..i].iter().filter_map(|other| meet(other, wall)));
    }
    let mut angles: Vec<f64> = events
        .iter()
        .map(|p| p - viewpoint)
        .filter(|d| d.norm() > MERGE)
        .map(|d| d.y.atan2(d.x))
        .flat_map(|angle| [angle - BESIDE, angle, angle + BESIDE])
        .collect();
    angles.sort_by(f64::total_cmp);

    let mut outline: Vec<Point2<f64>> = Vec::with_capacity(angles.len());
    for angle in angles {
        let (sin, cos) = angle.sin_cos();
        let direction = Vector2::new(cos, sin);
        let reach = edges
            .iter()
            .chain(&near)
            .filter_map(|segment| distance_along(viewpoint, direction, segment))
            .fold(f64::INFINITY, f64::min);
        let point = viewpoint + direction * reach;
        if reach.is_finite()
            && outline
                .last()
                .is_none_or(|last| (last - point).norm() > MERGE)
        {
            outline.push(point);
        }
    }
    outline
}

/// Where two segments cross, if they do and are not parallel.
fn meet(one: &Wall, other: &Wall) -> Option<Point2<f64>> {
    let (u, v) = (one[1] - one[0], other[1] - other[0]);
    let across = u.perp(&v);
    let offset = other[0] - one[0];
    let (s, t) = (offset.perp(&v) / across, offset.perp(&u) / across);
    let unit = 0.0..=1.0;
    (across != 0.0 && unit.contains(&s) && unit.contains(&t)).then(|| one[0] + u * s)
}

/// How far along the ray the segment is met, metres.
fn distance_along(from: Point2<f64>, direction: Vector2<f64>, segment: &Wall) -> Option<f64> {
    let v = segment[1] - segment[0];
    let across = direction.perp(&v);
    let offset = segment[0] - from;
    let (distance, t) = (offset.perp(&v) / across, offset.perp(&direction) / across);
    (across != 0.0 && distance >= 0.0 && (0.0..=1.0).contains(&t)).then_some(distance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::social_mapping::object_space::{Outline, Space};
    use nalgebra::Isometry2;

    fn square() -> Vec<Point2<f64>> {
        [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]
            .map(|(x, y)| Point2::new(x, y))
            .to_vec()
    }

    fn area(polygon: &[Point2<f64>]) -> f64 {
        let next = polygon.iter().cycle().skip(1);
        polygon
            .iter()
            .zip(next)
            .map(|(a, b)| a.coords.perp(&b.coords))
            .sum::<f64>()
            / 2.0
    }

    fn wall(a: (f64, f64), b: (f64, f64)) -> Wall {
        [Point2::new(a.0, a.1), Point2::new(b.0, b.1)]
    }

    #[test]
    fn walls_elsewhere_change_nothing() {
        let eye = Point2::new(1.0, 1.0);
        let far = [
            wall((9.0, 0.0), (9.0, 4.0)),
            wall((-1.0, -1.0), (5.0, -1.0)),
        ];
        assert_eq!(visible(&square(), eye, &far), square());
    }

    #[test]
    fn a_wall_right_across_halves_the_space() {
        let half = visible(
            &square(),
            Point2::new(1.0, 1.0),
            &[wall((2.0, -1.0), (2.0, 5.0))],
        );
        assert!((area(&half) - 8.0).abs() < 1e-3);
        assert!(half.iter().all(|p| p.x < 2.0 + 1e-9));
    }

    #[test]
    fn a_door_lets_the_view_through() {
        // From (1, 2) the gap from y = 1 to 3 at x = 2 shows the cone |y - 2| <= x - 1: all of it up
        // to x = 3, where it meets the square's sides, and everything beyond.
        let walls = [wall((2.0, -1.0), (2.0, 1.0)), wall((2.0, 3.0), (2.0, 5.0))];
        let seen = visible(&square(), Point2::new(1.0, 2.0), &walls);
        assert!(
            (area(&seen) - (8.0 + 3.0 + 4.0)).abs() < 1e-3,
            "{}",
            area(&seen)
        );
    }

    #[test]
    fn crossing_walls_hide_what_is_behind_both() {
        let walls = [wall((2.0, -1.0), (2.0, 5.0)), wall((-1.0, 2.0), (5.0, 2.0))];
        let seen = visible(&square(), Point2::new(0.5, 0.5), &walls);
        assert!((area(&seen) - 4.0).abs() < 1e-3);
    }

    #[test]
    fn a_television_detected_a_little_behind_its_wall_still_faces_its_room() {
        let outline = Outline::Rectangle(Vector2::new(0.1, 1.2));
        let tv = Isometry2::new(Vector2::new(-0.08, 5.0), 0.0);
        let space = Space::VIEWED.polygon(&outline, &tv);
        let eye = Space::VIEWED.viewpoint(&outline, &tv);
        let seen = visible(&space, eye, &[wall((0.0, -9.0), (0.0, 19.0))]);
        assert!(seen.iter().all(|p| p.x > -1e-9));
        // All but the strip of 0.08 m behind the wall, about 2 m wide.
        assert!((area(&space) - area(&seen) - 0.08 * 2.06).abs() < 1e-2);
    }
}
