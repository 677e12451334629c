//! What can be seen from a place between walls, as an outline.

use super::map::{Place, Point};

/// Rays go out so close to each other, radians.
const BETWEEN: f64 = 0.04;

/// The outline of what is seen from a place at an opening angle as far as `range` or the first wall.
pub(crate) fn outline(place: Place, angle: f64, range: f64, walls: &[[f64; 4]]) -> Vec<Point> {
    let [x, y, heading] = place;
    let count = (angle / BETWEEN).ceil().clamp(1.0, 200.0) as u32;
    let ray = |n: u32| {
        let direction = heading + angle * (f64::from(n) / f64::from(count) - 0.5);
        let (way_y, way_x) = direction.sin_cos();
        let hit = |wall: &[f64; 4]| meeting([x, y], [way_x, way_y], wall);
        let far = walls.iter().filter_map(hit).fold(range, f64::min);
        [x + far * way_x, y + far * way_y].map(|length| (length * 100.0).round() / 100.0)
    };
    // All around there is no corner at the place itself.
    let corner = (angle < std::f64::consts::TAU - BETWEEN).then_some([x, y]);
    corner.into_iter().chain((0..=count).map(ray)).collect()
}

/// How far along a way of length 1 a wall is met.
fn meeting([x, y]: Point, [way_x, way_y]: Point, wall: &[f64; 4]) -> Option<f64> {
    let [ax, ay, bx, by] = *wall;
    let (wall_x, wall_y) = (bx - ax, by - ay);
    let cross = way_x * wall_y - way_y * wall_x;
    let (to_x, to_y) = (ax - x, ay - y);
    let far = (to_x * wall_y - to_y * wall_x) / cross;
    let along = (to_x * way_y - to_y * way_x) / cross;
    // Parallel ones divide by nothing, and are not met. A camera may hang on a wall.
    (far > 0.02 && (0.0..=1.0).contains(&along)).then_some(far)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sight_ends_at_the_first_wall_or_the_range() {
        let walls = [
            [2.0, -5.0, 2.0, 0.5],
            [3.0, -5.0, 3.0, 5.0],
            [-0.0, -1.0, 0.0, 1.0],
        ];
        let outline = outline([0.0, 0.0, 0.0], 1.0, 4.0, &walls);
        assert!(outline[0].iter().all(|length| length.abs() < 1e-9));
        let farthest = |from: f64, to: f64| {
            let ends = outline[1..].iter();
            let within = ends.filter(|[_, y]| (from..to).contains(y));
            within.map(|[x, _]| *x).fold(f64::NEG_INFINITY, f64::max)
        };
        assert!((farthest(-3.0, 0.45) - 2.0).abs() < 0.02);
        assert!((farthest(0.55, 3.0) - 3.0).abs() < 0.02);
        let alone = super::outline([0.0, 0.0, 0.0], 1.0, 4.0, &[]);
        let far = |[x, y]: &Point| (x.hypot(*y) - 4.0).abs() < 0.02;
        assert!(alone[1..].iter().all(far));
    }
}
