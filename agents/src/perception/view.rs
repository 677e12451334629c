//! What a camera could have seen, and frames in one order. A look that should have shown something
//! and did not is evidence, so the test errs on the side of "could not have seen it".

use super::{FloorPlan, difference};
use crate::messages::CameraFrame;
use nalgebra::{Isometry2, Point2};
use std::f64::consts::{PI, TAU};

/// Whether the camera of `frame` had to see something at `point` (world frame): in range, inside
/// the field of view, and no wall before it. `margin` (metres) is how far inside the borders of the
/// view it must lie, and how far before the point the line of sight may end; it covers the
/// uncertainty of the point and the depth of the thing.
pub fn sees(frame: &CameraFrame, plan: &FloorPlan, point: Point2<f64>, margin: f64) -> bool {
    let in_camera = frame
        .world_from_camera
        .inverse_transform_point(&point)
        .coords;
    let distance = in_camera.norm();
    if distance > frame.range - margin {
        return false;
    }
    if distance <= margin {
        // So close that the margin covers every direction: only an all-round camera is sure.
        return frame.field_of_view >= TAU;
    }
    if frame.field_of_view < TAU {
        let direction = difference(in_camera.y.atan2(in_camera.x), 0.0).abs();
        // The border of the view is a ray; a point is `margin` away from it at this angle.
        if direction > frame.field_of_view.min(2.0 * PI) / 2.0 - (margin / distance).asin() {
            return false;
        }
    }
    let end = in_camera * ((distance - margin) / distance);
    let camera = Point2::from(frame.world_from_camera.translation.vector);
    !plan.wall_between(camera, frame.world_from_camera * Point2::from(end))
}

/// Whether a body at `front` hides `place` from `camera`: it stands before it, within `radius` metres
/// of the line of sight.
pub fn hides(camera: Point2<f64>, front: Point2<f64>, place: Point2<f64>, radius: f64) -> bool {
    let sight = place - camera;
    let length = sight.norm();
    if length <= radius {
        return false;
    }
    let along = (front - camera).dot(&sight) / length;
    let aside = (front - camera).perp(&sight).abs() / length;
    aside < radius && along > 0.0 && along < length - radius
}

/// `frames` by time, then by the camera's name: the order in which evidence is taken in, whatever
/// the order it arrived in.
pub fn in_time_order(frames: &[CameraFrame]) -> Vec<&CameraFrame> {
    let mut ordered: Vec<&CameraFrame> = frames.iter().collect();
    ordered.sort_by(|a, b| (a.time, &a.camera).cmp(&(b.time, &b.camera)));
    ordered
}

/// Whether every number of `pose` is finite. Detections come from outside; one NaN in a filter
/// never leaves it again.
pub fn is_finite_pose(pose: &Isometry2<f64>) -> bool {
    pose.translation.vector.iter().all(|v| v.is_finite())
        && pose.rotation.re.is_finite()
        && pose.rotation.im.is_finite()
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::Time;
    use nalgebra::Vector2;

    fn camera(field_of_view: f64) -> CameraFrame {
        CameraFrame {
            camera: "c".to_owned(),
            time: Time::default(),
            world_from_camera: Isometry2::new(Vector2::new(1.0, 0.0), PI / 2.0),
            field_of_view,
            range: 5.0,
            people: Vec::new(),
            objects: Vec::new(),
        }
    }

    #[test]
    fn the_view_is_a_sector_less_its_margin() {
        let frame = camera(PI / 2.0);
        let sees = |x, y, margin| sees(&frame, &FloorPlan::default(), Point2::new(x, y), margin);
        assert!(sees(1.0, 4.9, 0.0) && !sees(1.0, 4.9, 0.2) && !sees(1.0, 5.1, 0.0));
        assert!(sees(2.9, 2.0, 0.0) && !sees(2.9, 2.0, 0.2) && !sees(3.1, 2.0, 0.0));
        assert!(sees(-0.9, 2.0, 0.0) && !sees(1.0, -1.0, 0.0));
        assert!(!sees(1.0, 0.1, 0.2), "beside the lens");
    }

    #[test]
    fn an_all_round_camera_sees_behind_itself() {
        let frame = camera(TAU);
        assert!(sees(
            &frame,
            &FloorPlan::default(),
            Point2::new(1.0, -2.0),
            0.3
        ));
        assert!(sees(
            &frame,
            &FloorPlan::default(),
            Point2::new(1.0, -0.1),
            0.3
        ));
    }

    #[test]
    fn a_body_hides_what_is_right_behind_it() {
        let (camera, place) = (Point2::new(0.0, 0.0), Point2::new(4.0, 0.0));
        let hides = |x, y| hides(camera, Point2::new(x, y), place, 0.25);
        assert!(hides(2.0, 0.2) && !hides(2.0, 0.3));
        assert!(!hides(4.2, 0.0) && !hides(3.9, 0.0) && !hides(-1.0, 0.0));
    }

    #[test]
    fn a_wall_hides_what_is_behind_it_and_not_what_leans_on_it() {
        let frame = camera(PI / 2.0);
        let plan = FloorPlan::new([], [[Point2::new(0.0, 2.0), Point2::new(2.0, 2.0)]]);
        assert!(!sees(&frame, &plan, Point2::new(1.0, 3.0), 0.3));
        assert!(sees(&frame, &plan, Point2::new(1.0, 2.1), 0.3));
        assert!(sees(&frame, &plan, Point2::new(1.0, 1.0), 0.3));
    }
}
