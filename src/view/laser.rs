//! A turn of the robot's laser on the map.

use agents::messages::LaserScan;
use nalgebra::{Isometry2, Point2};
use serde_json::{Value as Json, json};

/// Where each beam ends, in the world's frame to the centimetre, and the places in that list of beams that
/// met nothing.
pub(crate) fn beams(scan: &LaserScan, world_from_robot: &Isometry2<f64>) -> Json {
    let (mut ends, mut free) = (Vec::new(), Vec::new());
    for (index, range) in scan.ranges.iter().enumerate() {
        let mut range = f64::from(*range);
        if !range.is_finite() || range >= scan.range_max {
            range = scan.range_max;
            free.push(index);
        }
        let angle = scan.angle_min + index as f64 * scan.angle_step;
        let end = world_from_robot * Point2::new(range * angle.cos(), range * angle.sin());
        ends.push([end.x, end.y].map(|length| (length * 100.0).round() / 100.0));
    }
    let at = world_from_robot.translation.vector;
    json!({"time": scan.time.seconds(), "from": [at.x, at.y], "ends": ends, "free": free})
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::Time;
    use nalgebra::Vector2;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn beams_end_where_the_robot_sees_something_and_those_that_see_nothing_are_named() {
        let scan = LaserScan {
            time: Time::from_seconds(5.0),
            angle_min: -FRAC_PI_2,
            angle_step: FRAC_PI_2,
            range_max: 8.0,
            ranges: vec![1.0, 8.0, 2.0],
        };
        // The robot looks north.
        let place = Isometry2::new(Vector2::new(3.0, 4.0), FRAC_PI_2);
        let json = beams(&scan, &place);
        assert_eq!(json["ends"], json!([[4.0, 4.0], [3.0, 12.0], [1.0, 4.0]]));
        assert_eq!(json["free"], json!([1]));
        assert_eq!(json["from"], json!([3.0, 4.0]));
    }
}
