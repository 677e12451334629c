//! Foxglove's messages made from places, outlines and values. It guarantees that what lies on the floor
//! has height 0 and that colours stay within [0, 1].

use crate::view::map::{Place, Point};
use agents::messages::LaserScan;
use dsr::{Pose, Time};
use foxglove::messages::line_primitive::Type as Line;
use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{
    ArrowPrimitive, Color, CubePrimitive, CylinderPrimitive, FrameTransform, Grid,
    LaserScan as FoxgloveScan, LinePrimitive, PackedElementField, Point3, Pose as FoxglovePose,
    PosesInFrame, Quaternion, TextPrimitive, Timestamp, Vector2, Vector3,
};

/// Red, green, blue and how opaque, each in [0, 1].
pub(super) type Colour = [f64; 4];

const BLACK: Colour = [0.0, 0.0, 0.0, 1.0];

/// A time as the messages have it; before 1970 it is 1970.
pub(super) fn timestamp(time: Time) -> Timestamp {
    let nanoseconds = u64::try_from(time.nanoseconds()).unwrap_or(0);
    let seconds = u32::try_from(nanoseconds / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new(seconds, (nanoseconds % 1_000_000_000) as u32)
}

#[allow(clippy::unnecessary_wraps, reason = "a field of a message is optional")]
fn colour([r, g, b, a]: Colour) -> Option<Color> {
    Some(Color { r, g, b, a })
}

fn point([x, y]: Point) -> Point3 {
    Point3 { x, y, z: 0.0 }
}

#[allow(clippy::unnecessary_wraps, reason = "a field of a message is optional")]
fn standing([x, y, heading]: Place, z: f64) -> Option<FoxglovePose> {
    let half = heading / 2.0;
    Some(FoxglovePose {
        position: Some(Vector3 { x, y, z }),
        orientation: Some(Quaternion {
            x: 0.0,
            y: 0.0,
            z: half.sin(),
            w: half.cos(),
        }),
    })
}

/// Green where crossing costs what free space costs, red where it costs 3.5 or more.
pub(super) fn usage_colour(usage: Option<f64>) -> Colour {
    let hot = ((usage.unwrap_or(1.0) - 1.0) / 2.5).clamp(0.0, 1.0);
    [0.2 + 0.7 * hot, 0.7 - 0.5 * hot, 0.2, 0.9]
}

/// The middle of an outline's corners.
pub(super) fn middle(outline: &[Point]) -> Point {
    let count = outline.len().max(1) as f64;
    let sum = |axis: usize| outline.iter().map(|point| point[axis]).sum::<f64>() / count;
    [sum(0), sum(1)]
}

pub(super) fn ring(outline: &[Point], thickness: f64, of: Colour) -> LinePrimitive {
    LinePrimitive {
        r#type: Line::LineLoop as i32,
        pose: standing([0.0; 3], 0.0),
        thickness,
        points: outline.iter().copied().map(point).collect(),
        color: colour(of),
        ..LinePrimitive::default()
    }
}

pub(super) fn walls(walls: &[[f64; 4]], of: Colour) -> LinePrimitive {
    let ends = walls.iter().flat_map(|&[x, y, u, v]| [[x, y], [u, v]]);
    LinePrimitive {
        r#type: Line::LineList as i32,
        pose: standing([0.0; 3], 0.0),
        thickness: 0.08,
        points: ends.map(point).collect(),
        color: colour(of),
        ..LinePrimitive::default()
    }
}

pub(super) fn text(text: &str, at: Point, height: f64) -> TextPrimitive {
    TextPrimitive {
        pose: standing([at[0], at[1], 0.0], height),
        billboard: true,
        font_size: 12.0,
        scale_invariant: true,
        color: colour(BLACK),
        text: text.to_owned(),
    }
}

pub(super) fn cylinder(at: Place, radius: f64, height: f64, of: Colour) -> CylinderPrimitive {
    CylinderPrimitive {
        pose: standing(at, height / 2.0),
        size: Some(Vector3 {
            x: 2.0 * radius,
            y: 2.0 * radius,
            z: height,
        }),
        bottom_scale: 1.0,
        top_scale: 1.0,
        color: colour(of),
    }
}

pub(super) fn cube(at: Place, size: [f64; 2], height: f64, of: Colour) -> CubePrimitive {
    CubePrimitive {
        pose: standing(at, height / 2.0),
        size: Some(Vector3 {
            x: size[0],
            y: size[1],
            z: height,
        }),
        color: colour(of),
    }
}

pub(super) fn arrow(at: Place, length: f64, of: Colour) -> ArrowPrimitive {
    ArrowPrimitive {
        pose: standing(at, 0.05),
        shaft_length: 0.7 * length,
        shaft_diameter: 0.05,
        head_length: 0.3 * length,
        head_diameter: 0.12,
        color: colour(of),
    }
}

/// Where `child` is, seen from `parent`.
pub(super) fn transform(time: Time, parent: String, child: String, pose: &Pose) -> FrameTransform {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    FrameTransform {
        timestamp: Some(timestamp(time)),
        parent_frame_id: parent,
        child_frame_id: child,
        translation: Some(Vector3 {
            x: t.x,
            y: t.y,
            z: t.z,
        }),
        rotation: Some(Quaternion {
            x: q.x,
            y: q.y,
            z: q.z,
            w: q.w,
        }),
    }
}

/// A path, each place looking to the next.
pub(super) fn path(time: Time, frame: &str, points: &[Point]) -> PosesInFrame {
    let heading = |index: usize| {
        let from = points[index.min(points.len().saturating_sub(2))];
        let to = points[(index + 1).min(points.len() - 1)];
        (to[1] - from[1]).atan2(to[0] - from[0])
    };
    let poses = points.iter().enumerate();
    let poses = poses.filter_map(|(index, &[x, y])| standing([x, y, heading(index)], 0.0));
    PosesInFrame {
        timestamp: Some(timestamp(time)),
        frame_id: frame.to_owned(),
        poses: poses.collect(),
    }
}

/// What the laser at the middle of `robot` measures.
pub(super) fn scan(scan: &LaserScan, robot: &str) -> FoxgloveScan {
    let steps = scan.ranges.len().saturating_sub(1) as f64;
    FoxgloveScan {
        timestamp: Some(timestamp(scan.time)),
        frame_id: robot.to_owned(),
        pose: standing([0.0; 3], 0.0),
        start_angle: scan.angle_min,
        end_angle: scan.angle_min + steps * scan.angle_step,
        ranges: scan.ranges.iter().copied().map(f64::from).collect(),
        intensities: Vec::new(),
    }
}

/// Costs row by row from the lowest y; `place` has x and y of the lower left corner and the side of a cell.
pub(super) fn grid(time: Time, frame: &str, place: [f64; 3], columns: u32, costs: &[f32]) -> Grid {
    let [x, y, side] = place;
    let mut data = Vec::with_capacity(4 * costs.len());
    for cost in costs {
        data.extend_from_slice(&cost.to_le_bytes());
    }
    Grid {
        timestamp: Some(timestamp(time)),
        frame_id: frame.to_owned(),
        pose: standing([x, y, 0.0], 0.0),
        column_count: columns,
        cell_size: Some(Vector2 { x: side, y: side }),
        row_stride: 4 * columns,
        cell_stride: 4,
        fields: vec![PackedElementField {
            name: "cost".to_owned(),
            offset: 0,
            r#type: NumericType::Float32 as i32,
        }],
        data: data.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_looks_ahead_and_its_end_looks_where_it_came_to() {
        let path = path(
            Time::default(),
            "world",
            &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]],
        );
        let turn = |index: usize| path.poses[index].orientation.unwrap();
        assert!(turn(0).z.abs() < 1e-12);
        assert!((turn(1).z - std::f64::consts::FRAC_PI_4.sin()).abs() < 1e-12);
        assert_eq!(turn(1), turn(2));
        assert!(super::path(Time::default(), "world", &[]).poses.is_empty());
    }

    #[test]
    fn a_grid_has_as_many_bytes_as_its_strides_say() {
        let grid = grid(Time::default(), "world", [0.0, 0.0, 0.1], 3, &[1.0; 6]);
        assert_eq!(grid.data.len() as u32, 2 * grid.row_stride);
    }
}
